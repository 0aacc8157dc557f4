#include <palpate/OctreeBasedCD.h>

#include "Common/BallTruth.h"
#include "Common/TestGeometry.h"
#include "Unit/Math/RationalOracle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <vector>

// Lines and points against rational arithmetic: which features are within the thickness, and their
// distances, on random and on degenerate positions. Impacts are compared with distances along the
// step in 64 bits and more.

namespace palpate::testing {
namespace {

using oracle::Rational;
using Ids = std::vector<std::uint32_t>;

/// An element's vertices in exact numbers.
Rational radiusOf(const TestGeometry& geometry, std::uint32_t vertex) {
  return Rational(geometry.radius(vertex));
}

struct Exact {
  Rational square, radii;
  double scale;  ///< one unit in the last place of the largest coordinate difference

  double distance() const {
    return mpf_class(oracle::root(square) - mpf_class(radii, 400)).get_d();
  }
};

Exact pointElement(const TestGeometry& points, std::uint32_t v, const TestGeometry& others,
                   const Triangle& element) {
  const auto& p = others.positions;
  const auto& [i, j, k] = element;
  const oracle::Closest closest = oracle::vertexTriangle(points.positions[v], p[i], p[j], p[k]);
  return {closest.square,
          radiusOf(points, v) + closest.weights[0] * radiusOf(others, i) +
              closest.weights[1] * radiusOf(others, j) + closest.weights[2] * radiusOf(others, k),
          oracle::ulpOfLargestDifference({points.positions[v], p[i], p[j], p[k]})};
}

Exact edgeEdge(const TestGeometry& a, const Segment& p, const TestGeometry& b, const Segment& q) {
  const auto &at = a.positions, &on = b.positions;
  const oracle::Closest closest = oracle::edgeEdge(at[p[0]], at[p[1]], on[q[0]], on[q[1]]);
  const Rational s = closest.weights[0], t = closest.weights[1];
  return {closest.square,
          (1 - s) * radiusOf(a, p[0]) + s * radiusOf(a, p[1]) + (1 - t) * radiusOf(b, q[0]) +
              t * radiusOf(b, q[1]),
          oracle::ulpOfLargestDifference({at[p[0]], at[p[1]], on[q[0]], on[q[1]]})};
}

/// The contacts are the features within the thickness, up to rounding, with their distances.
std::size_t compare(const std::map<Ids, Exact>& all, const std::map<Ids, double>& found,
                    double thickness) {
  for (const auto& [ids, exact] : all) {
    // Centres and weights are within 8 ulp. Radii are rounded and subtracted.
    const double error = 16 * exact.scale + 0x1p-51 * exact.radii.get_d(),
                 gap = exact.distance() - thickness;
    const auto place = found.find(ids);
    EXPECT_TRUE(gap >= -error || place != found.end());
    EXPECT_TRUE(gap <= error || place == found.end());
    if (place == found.end()) continue;
    EXPECT_NEAR(place->second, exact.distance(), error);
  }
  for (const auto& [ids, distance] : found) EXPECT_TRUE(all.contains(ids));
  return found.size();
}

/// Points against lines or points, and lines against lines.
std::size_t compareWithRationals(const TestGeometry& a, const TestGeometry& b, double thickness) {
  const CollisionData data = answer(a, b, {Method::Proximity, thickness, Contacts::All});
  std::map<Ids, Exact> vertexTriangle, edges;
  std::map<Ids, double> foundVertexTriangle, foundEdges;
  if (a.type == GeometryType::Points) {
    const std::vector<Triangle> elements = b.elements();
    for (std::uint32_t v = 0; v < a.positions.size(); ++v)
      for (std::uint32_t t = &a == &b ? v + 1 : 0; t < elements.size(); ++t)
        vertexTriangle.emplace(Ids{v, t}, pointElement(a, v, b, elements[t]));
  } else {
    for (const Segment& p : a.edges())
      for (const Segment& q : b.edges())
        edges.emplace(Ids{p[0], p[1], q[0], q[1]}, edgeEdge(a, p, b, q));
  }
  for (const auto& c : data.vertexTriangle())
    foundVertexTriangle.emplace(Ids{c.vertex, c.triangle}, c.distance);
  for (const auto& c : data.edgeEdge())
    foundEdges.emplace(Ids{c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]}, c.distance);
  EXPECT_TRUE(data.triangleVertex().empty());
  return compare(vertexTriangle, foundVertexTriangle, thickness) +
         compare(edges, foundEdges, thickness);
}

/// Moves positions to a coarse grid: coincident, collinear, without length.
void snap(TestGeometry& geometry) {
  for (Eigen::Vector3d& p : geometry.positions)
    for (double& x : p) x = std::round(4 * x) / 4;
}

TEST(ExactGeometryTypes, DistancesMatchRationalArithmetic) {
  Random random(1);
  std::size_t contacts = 0;
  for (int run = 0; run < 12; ++run) {
    const bool degenerate = run % 3 == 2, far = run % 3 == 1;
    TestGeometry line = thread(random, 24, 0.3, 0.02, run % 2), drops = particles(random, 30, 0.03),
                 smoke = particles(random, 30, 0.0), needle = thread(random, 20, 0.3, 0, false);
    smoke = tapered(random, smoke, 0.05);
    needle = tapered(random, needle, 0.05);
    for (TestGeometry* geometry : {&line, &drops, &smoke, &needle}) {
      if (degenerate) snap(*geometry);
      if (far)
        for (Eigen::Vector3d& p : geometry->positions) p += Eigen::Vector3d(1e6, -3e5, 7e4);
    }
    // Where several weights are equally near, radii differ. So tapered edges are tested in general
    // position only.
    contacts += compareWithRationals(drops, line, 0.1) + compareWithRationals(smoke, line, 0.1) +
                compareWithRationals(drops, smoke, 0.1) + compareWithRationals(drops, drops, 0.1) +
                compareWithRationals(smoke, smoke, 0.0) + compareWithRationals(smoke, needle, 0.0);
    if (!degenerate)
      contacts += compareWithRationals(line, needle, 0.05);
    else
      contacts += compareWithRationals(line, thread(random, 20, 0.3, 0.01, true), 0.25);
  }
  EXPECT_GT(contacts, 300u);
}

// ---- Impacts ----

/// The first time at which a point that moves along a line is `reach` from a segment, or 2. The
/// distance is convex in time.
long double firstTime(const Eigen::Vector3d& before, const Eigen::Vector3d& now,
                      const Eigen::Vector3d& a, const Eigen::Vector3d& b, long double reach,
                      bool& close) {
  const auto at = [&](long double t) {
    return roundDistance((1 - t) * wide(before) + t * wide(now), wide(a), wide(b), 0, 0);
  };
  long double from = 0, to = 1;
  for (int i = 0; i < 200; ++i) {
    const long double s = from + (to - from) / 3, t = to - (to - from) / 3;
    (at(s) <= at(t) ? to : from) = at(s) <= at(t) ? t : s;
  }
  close = std::abs(at(from) - reach) < 1e-12L;
  if (at(0) <= reach) return 0;
  if (at(from) > reach) return 2;
  long double apart = 0, within = from;
  for (int i = 0; i < 100; ++i) {
    const long double middle = (apart + within) / 2;
    (at(middle) <= reach ? within : apart) = middle;
  }
  return within;
}

TEST(ExactGeometryTypes, ImpactTimesAreTheEarliest) {
  Random random(2);
  std::size_t impacts = 0;
  for (int run = 0; run < 90; ++run) {
    const double radius = run % 2 ? 0.05 : 0.0, thickness = run % 4 < 2 ? 0.02 : 0.0;
    const TestGeometry drops = particles(random, 20, radius);
    TestGeometry other =
        run % 3 ? particles(random, 15, 0.03) : thread(random, 15, 0.3, 0.03, false);
    if (radius + thickness == 0.0) other.radii = {0.0};
    const Eigen::Vector3d drift = randomPoint(random, -0.3, 0.3);
    Positions now = moved(random, drops.positions, 0.5), drifted = other.positions;
    if (radius + thickness == 0.0)  // aimed at the other geometry, so that some touch
      for (std::size_t v = 0; v < now.size(); ++v) {
        const Eigen::Vector3d& target = other.positions[v % other.positions.size()];
        now[v] = 2 * target - drops.positions[v];
      }
    else
      for (Eigen::Vector3d& p : drifted) p += drift;
    const CollisionData data = answer(settingsOf(Engine::Octree), drops, other,
                                      {Method::Continuous, thickness, Contacts::All}, now, drifted);
    std::map<Ids, double> found;
    for (const auto& c : data.vertexTriangle())
      found.emplace(Ids{c.vertex, c.triangle}, c.timeOfImpact);
    const std::vector<Triangle> elements = other.elements();
    for (std::uint32_t v = 0; v < now.size(); ++v)
      for (std::uint32_t t = 0; t < elements.size(); ++t) {
        const auto& [i, j, k] = elements[t];
        const long double reach =
            static_cast<long double>(thickness) +
            (static_cast<long double>(radius) + static_cast<long double>(other.radius(0)));
        bool close = false;
        const long double time =
            firstTime(drops.positions[v], now[v] - (drifted[i] - other.positions[i]),
                      other.positions[i], other.positions[k], reach, close);
        const auto place = found.find({v, t});
        if (close && reach > 0) continue;
        if (reach == 0) {  // an aimed point may miss by an ulp; a reported contact is near
          EXPECT_TRUE(close || place == found.end());
          continue;
        }
        ASSERT_EQ(place != found.end(), time <= 1) << double(time);
        if (place == found.end()) continue;
        ++impacts;
        EXPECT_LE(place->second, double(time) + 1e-12);
        EXPECT_GE(place->second, double(time) - 1e-6 - 1e-12);
      }
  }
  EXPECT_GT(impacts, 200u);
}

/// Without radius and thickness, on positions where touching is exact.
TEST(ExactGeometryTypes, TouchesAreFoundExactly) {
  const TestGeometry drop{GeometryType::Points, {{0, 0, 2}, {3, 0, 2}, {1, 0, 0}}, {}, {}, {0}};
  const Positions now{{0, 0, -2}, {3, 0.0625, -2}, {5, 0, 0}};
  const TestGeometry wall{GeometryType::Points, {{0, 0, 1}, {3, 0, 0}, {2, 0, 0}}, {}, {}, {0}};
  const auto hits = [&](const TestGeometry& other, const Positions& otherNow) {
    std::map<Ids, double> times;
    const CollisionData data = answer(settingsOf(Engine::Octree), drop, other,
                                      {Method::Continuous, 0.0, Contacts::All}, now, otherNow);
    for (const auto& c : data.vertexTriangle()) {
      times.emplace(Ids{c.vertex, c.triangle}, c.timeOfImpact);
      EXPECT_NEAR(c.normal.norm(), 1.0, 1e-15);
    }
    return times;
  };
  const auto expectTimes = [](const std::map<Ids, double>& found,
                              const std::map<Ids, double>& times) {
    ASSERT_EQ(found.size(), times.size());
    for (const auto& [ids, time] : times) {
      ASSERT_TRUE(found.contains(ids));
      EXPECT_LE(found.at(ids), time);
      EXPECT_GE(found.at(ids), time - 1e-6);
    }
  };
  expectTimes(hits(wall, wall.positions), {{{0, 0}, 0.25}, {{2, 1}, 0.5}, {{2, 2}, 0.25}});
  // Across a segment, past its end, along it, and onto a point without length.
  TestGeometry line{GeometryType::Lines,
                    {{-1, 0, 1}, {1, 0, 1}, {4, 0, 0}, {4.5, 0, 0}, {2, 0, 0}, {2, 0, 0}},
                    {},
                    {{0, 1}, {2, 3}, {4, 5}},
                    {0}};
  expectTimes(hits(line, line.positions), {{{0, 0}, 0.25}, {{2, 1}, 0.75}, {{2, 2}, 0.25}});
  // Half as long, so that it touches.
  Positions towards = line.positions;
  towards[0][2] = towards[1][2] = 5;
  expectTimes(hits(line, towards), {{{0, 0}, 0.125}, {{2, 1}, 0.75}, {{2, 2}, 0.25}});
}

}  // namespace
}  // namespace palpate::testing
