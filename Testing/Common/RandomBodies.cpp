#include "Common/RandomBodies.h"

#include <Eigen/Geometry>

#include <cmath>

namespace palpate::testing {

namespace {

/// Of lengths in histories that a fuzzer decides: the exponents of sizes and coordinates in units.
constexpr int kMostSpread = 0;
constexpr double kFar = 0x1p20;  ///< in units

}  // namespace

Vector3d RandomBodies::inSpace(Vector3d p) const {
  switch (m_space) {
    case Space::Grid:
    case Space::FlatGrid:
      for (double& x : p) x = m_unit * grid() * std::round(x / (m_unit * grid()));
      if (m_space == Space::FlatGrid) p[2] = 0.0;
      break;
    case Space::Flat:
      p[2] = 0.0;
      break;
    case Space::NearlyFlat:
      if (std::abs(p[2]) > 1e-12 * m_unit) p[2] *= 1e-13;
      break;
    case Space::Far:
      for (double& x : p)
        if (x < m_unit * kFar / 2) x += m_unit * kFar;
      break;
    case Space::Unit:
    case Space::Tiny:
      break;
  }
  return p;
}

Positions RandomBodies::inSpace(Positions positions) const {
  for (Vector3d& p : positions) p = inSpace(p);
  return positions;
}

double RandomBodies::length(double units) const {
  return m_unit * (isGrid() ? grid() / 2 * std::round(units / (grid() / 2)) : units);
}

std::array<double, 4> RandomBodies::lengths() const {
  if (areLarge()) return {0.0, m_unit * 0.002, m_unit * 0.01, m_unit * 0.03};
  return {0.0, m_unit * 0.001, length(0.07), length(0.25)};
}

/// A short way of large bodies.
Vector3d RandomBodies::motionStep() {
  const double size = m_unit * 1e-4;
  Vector3d by = randomPoint(m_random, -size, size);
  if (m_space == Space::Flat || m_space == Space::NearlyFlat) by[2] = 0.0;
  return by;
}

Pose RandomBodies::pose(const Pose& from) {
  if (areLarge() && !isGrid()) return {from.rotation, from.translation + motionStep()};
  const auto turn = [&](double least, const Vector3d& axis) -> Eigen::Matrix3d {
    return Eigen::AngleAxisd(uniform(m_random, -least, least), axis).toRotationMatrix();
  };
  const Vector3d axis = randomPoint(m_random, 0.1, 1).normalized(),
                 by = m_unit * randomPoint(m_random, -0.1, 0.1);
  switch (m_space) {
    case Space::Grid:
    case Space::FlatGrid: {
      Eigen::Matrix3d quarter = Eigen::Matrix3d::Identity();
      const auto k = m_space == Space::FlatGrid ? 2 : static_cast<int>(m_random() % 3);
      if (m_random() % 2) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        quarter.setZero();
        quarter(k, k) = 1, quarter(i, j) = -1, quarter(j, i) = 1;
      }
      const Eigen::Matrix3d rotation = quarter * from.rotation;
      const Vector3d centre = m_unit * Vector3d(0.5, 0.5, m_space == Space::Grid ? 0.5 : 0.0);
      return {rotation, inSpace(Vector3d(centre - rotation * centre + 3 * by))};
    }
    case Space::Flat:
    case Space::NearlyFlat:
      return {turn(0.5, Vector3d::UnitZ()) * from.rotation,
              from.translation + Vector3d(by[0], by[1], 0)};
    case Space::Far:
      return {from.rotation, from.translation + by};
    case Space::Unit:
    case Space::Tiny:
      break;
  }
  const Eigen::Matrix3d rotation = m_random() % 4 ? Eigen::Matrix3d(turn(0.5, axis) * from.rotation)
                                                  : Eigen::Matrix3d::Identity();
  return {rotation, from.translation + by};
}

Positions RandomBodies::motion(const Positions& from) {
  constexpr std::array<double, 5> kSizes{0.0, 1e-3, 0.02, 0.1, 0.5},
      kLargeSizes{0.0, 2e-5, 1e-4, 3e-4, 2e-3};
  const auto& sizes = isGrid() || !areLarge() ? kSizes : kLargeSizes;
  const double size = m_unit * sizes[m_random() % 5], drift = m_unit * sizes[m_random() % 4];
  const Vector3d by = (isGrid() ? 3 : 1) * randomPoint(m_random, -drift, drift);
  Positions to = moved(m_random, from, size);
  for (Vector3d& p : to) p += by;
  return inSpace(to);
}

TestGeometry RandomBodies::box() {
  const Vector3d low = randomPoint(m_random, 0, 0.4), high = randomPoint(m_random, 0.5, 1);
  return testGeometry(dividedBox(low, high, m_random() % 2 ? 1 : 2));
}

TestGeometry RandomBodies::smallGeometry(int type) {
  const std::uint64_t any = m_random();
  const Vector3d middle = randomPoint(m_random, 0.3, 0.7);
  switch (type) {
    case 0:
      return testGeometry(soup(m_random, any % 12, uniform(m_random, 0.05, 0.4)));
    case 1:
      return box();
    case 2:
      return testGeometry(sphere(3, 4, middle, uniform(m_random, 0.1, 0.5)));
    case 3:
      return testGeometry(sheet(any % 2 ? 2 : 4, middle[2], 0));
    case 4: {
      const TestGeometry line = thread(m_random, 2 + any % 8, 0.3, 0.02, any % 16 < 8);
      return m_random() % 3 ? line : tapered(m_random, line, 0.05);
    }
    default: {
      const TestGeometry points = particles(m_random, 1 + any % 12, 0.05);
      return m_random() % 3 ? points : tapered(m_random, points, 0.1);
    }
  }
}

TestGeometry RandomBodies::largeGeometry(int type) {
  const std::uint64_t any = m_random();
  const Vector3d middle = randomPoint(m_random, 0.48, 0.52);
  switch (type) {
    case 0:
      return testGeometry(soup(m_random, 300 + any % 300, 0.05));
    case 1:
      return testGeometry(sphere(12, 16, middle, 0.3));
    case 2:
    case 3:
      return testGeometry(
          sheet(static_cast<std::uint32_t>(12 + any % 12), middle[2], uniform(m_random, 0, 6)));
    case 4:
      return thread(m_random, 300, 0.05, any % 2 ? 0.005 : 0.0, false);
    default:
      return particles(m_random, 400, 0.01);
  }
}

/// In L. A fuzzer may make a geometry smaller than others, and move a coordinate far away.
TestGeometry RandomBodies::stretched(TestGeometry geometry) {
  const int decision = m_random.isDecided() ? static_cast<int>(m_random() % 256) : 0;
  const double size =
      m_unit * (decision < 192 ? 1.0 : std::ldexp(1.0, (192 - decision) * kMostSpread / 64));
  for (Vector3d& p : geometry.positions) p *= size;
  for (double& radius : geometry.radii) radius = m_random() % 3 ? length(radius) : 0.0;
  if (decision % 8 == 7 && !geometry.positions.empty()) {
    Vector3d& p = geometry.positions[m_random() % geometry.positions.size()];
    const auto axis = static_cast<int>(m_random() % 3);
    const int exponent = (static_cast<int>(m_random() % 256) - 128) * kMostSpread / 128;
    p[axis] = m_unit * std::ldexp(uniform(m_random, -1, 1), exponent);
  }
  geometry.positions = inSpace(geometry.positions);
  return geometry;
}

Solid RandomBodies::solid() {
  Solid solid = cells(areLarge() ? 5 : 1, m_random);
  const double size = uniform(m_random, 0.2, 0.8) / (areLarge() ? 5 : 1);
  const Vector3d at = randomPoint(m_random, 0, 0.5);
  for (Vector3d& p : solid.positions) p = m_unit * (size * p + at);
  solid.positions = inSpace(solid.positions);
  return solid;
}

AnalyticalGeometry RandomBodies::shape() {
  const Vector3d middle = inSpace(m_unit * Vector3d(0.5, 0.5, 0.5)),
                 corner = inSpace(m_unit * Vector3d(0.25, 0.25, 0.25));
  switch (m_random() % 7) {
    case 0:
      return Sphere{corner, length(0.25)};
    case 1:
      return Capsule{corner, middle, length(0.125)};
    case 2:
      return Box{middle, Vector3d(length(0.25), length(0.125), length(0.3))};
    case 3:
      return Plane{middle, {1, 2, 3}, m_random() % 2 == 0};
    case 4:
      return Plane{middle, {0, 0, 1}, m_random() % 2 == 0};
    case 5:
      return Cylinder{corner, corner + m_unit * Vector3d(0, 0.5, 0), length(0.125)};
    default:
      return ConvexHull{stretched(testGeometry(soup(m_random, 2, 0.3))).positions};
  }
}

TestGeometry RandomBodies::geometry(int type) {
  return stretched(areLarge() ? largeGeometry(type) : smallGeometry(type));
}

}  // namespace palpate::testing
