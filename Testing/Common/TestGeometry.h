#pragma once

#include <palpate/OctreeBasedCD.h>

#include "Common/ContactRows.h"
#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

/// Random geometries of every type, and one frame of a pair of them.
namespace palpate::testing {

using Eigen::Vector3d;
using Positions = std::vector<Vector3d>;

/// A rigid placement. Products are summed as the library does.
struct Place {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Vector3d translation = Vector3d::Zero();

  Vector3d operator()(const Vector3d& p) const {
    Vector3d q;
    for (int k = 0; k < 3; ++k)
      q[k] = rotation(k, 0) * p[0] + rotation(k, 1) * p[1] + rotation(k, 2) * p[2] + translation[k];
    return q;
  }
  Pose pose() const { return {rotation, translation}; }
  Positions operator()(Positions positions) const {
    for (Vector3d& p : positions) p = (*this)(p);
    return positions;
  }
  /// Then turns by the angle about an axis through a point, and shifts.
  Place then(const Vector3d& axis, double angle, const Vector3d& through,
             const Vector3d& by) const {
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
    return {turn * rotation, turn * (translation - through) + through + by};
  }
};

/// A geometry with vertices, of any type.
struct TestGeometry {
  GeometryType type = GeometryType::Triangles;
  Positions positions;
  std::vector<Triangle> triangles;
  std::vector<Segment> segments;
  std::vector<double> radii{0.0};

  GeometryId addTo(OctreeBasedCD& collisions) const {
    switch (type) {
      case GeometryType::Triangles:
        return collisions.addTriangleMesh(positions, triangles);
      case GeometryType::Lines:
        return radii.size() == 1 ? collisions.addLineMesh(positions, segments, radii[0])
                                 : collisions.addLineMesh(positions, segments, radii);
      case GeometryType::Points:
        return radii.size() == 1 ? collisions.addPointSet(positions, radii[0])
                                 : collisions.addPointSet(positions, radii);
      case GeometryType::Shape:
      case GeometryType::Field:
        break;
    }
    return {};
  }
  /// As contacts and queries name their vertices: {p, q, q} for a segment and {p, p, p} for a
  /// point.
  std::vector<Triangle> elements() const {
    std::vector<Triangle> all = triangles;
    for (const auto& [p, q] : segments) all.push_back({p, q, q});
    if (type == GeometryType::Points)
      for (std::uint32_t p = 0; p < positions.size(); ++p) all.push_back({p, p, p});
    return all;
  }
  double radius(std::uint32_t vertex) const { return radii.size() == 1 ? radii[0] : radii[vertex]; }
  std::vector<Segment> edges() const {
    std::set<Segment> all;
    const auto add = [&](std::uint32_t p, std::uint32_t q) {
      if (p != q) all.insert({std::min(p, q), std::max(p, q)});
    };
    for (const auto& [a, b, c] : triangles) add(a, b), add(b, c), add(c, a);
    for (const auto& [p, q] : segments) add(p, q);
    return {all.begin(), all.end()};
  }
};

inline TestGeometry testGeometry(const Mesh& mesh) {
  return {GeometryType::Triangles, mesh.positions, mesh.triangles, {}};
}

using Pairs = std::vector<std::pair<const TestGeometry*, const TestGeometry*>>;

/// A random walk in the unit cube, closed or not.
inline TestGeometry thread(Random& random, std::uint32_t segments, double step, double radius,
                           bool closed) {
  TestGeometry line{GeometryType::Lines, {randomPoint(random, 0.2, 0.8)}, {}, {}, {radius}};
  for (std::uint32_t i = 1; i <= segments; ++i) {
    line.positions.push_back((line.positions.back() + randomPoint(random, -step, step))
                                 .cwiseMax(Vector3d::Zero())
                                 .cwiseMin(Vector3d::Ones()));
    line.segments.push_back(i % 3 ? Segment{i - 1, i} : Segment{i, i - 1});
  }
  if (closed) line.segments.push_back({segments, 0});
  return line;
}

inline TestGeometry particles(Random& random, std::size_t count, double radius) {
  TestGeometry points{GeometryType::Points, {}, {}, {}, {radius}};
  for (std::size_t i = 0; i < count; ++i) points.positions.push_back(randomPoint(random, 0, 1));
  return points;
}

/// Gives each vertex its own radius.
inline TestGeometry tapered(Random& random, TestGeometry geometry, double most) {
  geometry.radii.clear();
  for (std::size_t v = 0; v < geometry.positions.size(); ++v)
    geometry.radii.push_back(uniform(random, 0, most));
  return geometry;
}

/// Meshes, lines and points in the unit cube: closed, open and in parts; without radii, with one,
/// and with one for each vertex.
inline std::vector<TestGeometry> geometriesOfEveryType(Random& random) {
  return {testGeometry(sphere(8, 12, {0.5, 0.5, 0.5}, 0.4)),
          testGeometry(soup(random, 150, 0.1)),
          testGeometry(sheet(8, 0.5, 0.0)),
          thread(random, 120, 0.1, 0.0, false),
          thread(random, 120, 0.1, 0.01, true),
          tapered(random, thread(random, 120, 0.1, 0.01, false), 0.05),
          particles(random, 150, 0.0),
          particles(random, 150, 0.02),
          tapered(random, particles(random, 150, 0.02), 0.1)};
}

inline Positions moved(Random& random, Positions positions, double most) {
  for (Vector3d& p : positions) p += randomPoint(random, -most, most);
  return positions;
}

/// One frame of a pair.
inline CollisionData answer(const Settings& settings, const TestGeometry& a, const TestGeometry& b,
                            const PairSettings& pair, const Positions& nowA,
                            const Positions& nowB) {
  OctreeBasedCD collisions(settings);
  const GeometryId first = a.addTo(collisions);
  const bool self = &a == &b;
  const GeometryId second = self ? first : b.addTo(collisions);
  collisions.addCollisionPair(first, second, pair);
  collisions.setPositions(first, a.positions, nowA);
  if (!self) collisions.setPositions(second, b.positions, nowB);
  collisions.detectCollision();
  EXPECT_EQ(collisions.octree().validate(), std::vector<std::string>{});
  return collisions.collisionData(first, second);
}

inline CollisionData answer(const TestGeometry& a, const TestGeometry& b,
                            const PairSettings& pair) {
  return answer(settingsOf(Engine::Octree), a, b, pair, a.positions, b.positions);
}

inline std::vector<PairSettings> settingsFor(double thickness, bool continuous = true) {
  std::vector<PairSettings> all{{Method::Proximity, thickness, Contacts::Distinct},
                                {Method::Proximity, thickness, Contacts::All}};
  if (continuous) {
    all.push_back({Method::Continuous, thickness, Contacts::All});
    all.push_back({Method::Continuous, 0, Contacts::All});
    all.push_back({.method = Method::Continuous,
                   .thickness = thickness,
                   .continuous = {.earliestTimeOnly = true}});
  }
  return all;
}

/// Expects the contacts of brute force, bit by bit, from octrees with any number of threads.
/// Returns how many contacts there are.
inline std::size_t expectOracle(Random& random, const TestGeometry& a, const TestGeometry& b,
                                const PairSettings& pair) {
  const Positions nowA = moved(random, a.positions, 0.03), nowB = moved(random, b.positions, 0.03);
  const Rows truth(answer(settingsOf(Engine::BruteForce), a, b, pair, nowA, nowB));
  EXPECT_TRUE(ascend(truth.vertexTriangle, 2) && ascend(truth.triangleVertex, 2) &&
              ascend(truth.edgeEdge, 4));
  for (const Settings& settings : octreeSettings())
    expectSameRows(Rows(answer(settings, a, b, pair, nowA, nowB)), truth);
  return truth.contacts() + (truth.earliestTimeOfImpact <= 1.0);
}

}  // namespace palpate::testing
