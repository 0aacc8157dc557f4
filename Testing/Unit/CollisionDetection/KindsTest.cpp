#include <palpate/Capture.h>
#include <palpate/Distance.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ContactRows.h"
#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

// Lines and points: every pair of kinds against brute force and against the definition, written
// here over <palpate/Distance.h>; what cannot be tested is refused.

namespace palpate::testing {
namespace {

using Eigen::Vector3d;
using Positions = std::vector<Vector3d>;

/// A geometry of any kind.
struct Thing {
  GeometryKind kind = GeometryKind::Triangles;
  Positions positions;
  std::vector<Triangle> triangles;
  std::vector<Segment> segments;
  std::vector<double> radii{0.0};

  GeometryId addTo(OctreeBasedCD& collisions) const {
    switch (kind) {
      case GeometryKind::Triangles:
        return collisions.addTriangleMesh(positions, triangles);
      case GeometryKind::Lines:
        return radii.size() == 1 ? collisions.addLineMesh(positions, segments, radii[0])
                                 : collisions.addLineMesh(positions, segments, radii);
      case GeometryKind::Points:
        return radii.size() == 1 ? collisions.addPointSet(positions, radii[0])
                                 : collisions.addPointSet(positions, radii);
    }
    return {};
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

Thing things(const Mesh& mesh) {
  return {GeometryKind::Triangles, mesh.positions, mesh.triangles, {}};
}

using Pairs = std::vector<std::pair<const Thing*, const Thing*>>;

/// A random walk in the unit cube, closed or not.
Thing thread(Random& random, std::uint32_t segments, double step, double radius, bool closed) {
  Thing line{GeometryKind::Lines, {randomPoint(random, 0.2, 0.8)}, {}, {}, {radius}};
  for (std::uint32_t i = 1; i <= segments; ++i) {
    line.positions.push_back((line.positions.back() + randomPoint(random, -step, step))
                                 .cwiseMax(Vector3d::Zero())
                                 .cwiseMin(Vector3d::Ones()));
    line.segments.push_back(i % 3 ? Segment{i - 1, i} : Segment{i, i - 1});
  }
  if (closed) line.segments.push_back({segments, 0});
  return line;
}

Thing particles(Random& random, std::size_t count, double radius) {
  Thing points{GeometryKind::Points, {}, {}, {}, {radius}};
  for (std::size_t i = 0; i < count; ++i) points.positions.push_back(randomPoint(random, 0, 1));
  return points;
}

/// Radii of its own for each vertex.
Thing tapered(Random& random, Thing thing, double most) {
  thing.radii.clear();
  for (std::size_t v = 0; v < thing.positions.size(); ++v)
    thing.radii.push_back(uniform(random, 0, most));
  return thing;
}

Positions moved(Random& random, Positions positions, double most) {
  for (Vector3d& p : positions) p += randomPoint(random, -most, most);
  return positions;
}

/// One frame of a pair.
CollisionData answer(const Settings& settings, const Thing& a, const Thing& b,
                     const PairSettings& pair, const Positions& nowA, const Positions& nowB) {
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

CollisionData answer(const Thing& a, const Thing& b, const PairSettings& pair) {
  return answer(settingsOf(Engine::Octree), a, b, pair, a.positions, b.positions);
}

std::vector<PairSettings> settingsFor(double thickness, bool continuous = true) {
  std::vector<PairSettings> all{{Method::Proximity, thickness, Contacts::Distinct},
                                {Method::Proximity, thickness, Contacts::All}};
  if (continuous) {
    all.push_back({Method::Continuous, thickness, Contacts::All});
    all.push_back({Method::Continuous, 0, Contacts::All});
    all.push_back({Method::Continuous, thickness, Contacts::Earliest});
  }
  return all;
}

/// Octrees with any threads answer as brute force does, bit by bit; returns how many contacts.
std::size_t expectOracle(Random& random, const Thing& a, const Thing& b, const PairSettings& pair) {
  const Positions nowA = moved(random, a.positions, 0.03), nowB = moved(random, b.positions, 0.03);
  const Rows truth(answer(settingsOf(Engine::BruteForce), a, b, pair, nowA, nowB));
  EXPECT_TRUE(ascend(truth.vertexTriangle, 2) && ascend(truth.triangleVertex, 2) &&
              ascend(truth.edgeEdge, 4));
  for (const Settings& settings : octreeSettings())
    expectSameRows(Rows(answer(settings, a, b, pair, nowA, nowB)), truth);
  return truth.contacts() + (truth.earliestTimeOfImpact <= 1.0);
}

TEST(Kinds, AnswerAsBruteForce) {
  Random random(1);
  const Thing organ = things(sphere(8, 12, {0.5, 0.5, 0.5}, 0.4));
  const Thing line = thread(random, 150, 0.12, 0.01, false),
              loop = thread(random, 80, 0.15, 0, true);
  const Thing needle = tapered(random, thread(random, 60, 0.1, 0, false), 0.03);
  const Thing smoke = particles(random, 200, 0.02),
              drops = tapered(random, particles(random, 200, 0), 0.04);
  std::size_t contacts = 0;
  for (const auto& [a, b] : Pairs{{&organ, &line},
                                  {&line, &organ},
                                  {&organ, &smoke},
                                  {&smoke, &organ},
                                  {&line, &loop},
                                  {&loop, &line},
                                  {&line, &line},
                                  {&loop, &loop}})
    for (PairSettings pair : settingsFor(0.02)) {
      contacts += expectOracle(random, *a, *b, pair);
      pair.restDistance = a == b ? 0.3 : 0.0;
      contacts += expectOracle(random, *a, *b, pair);
    }
  for (const auto& [a, b] : Pairs{{&organ, &needle},
                                  {&needle, &organ},
                                  {&needle, &line},
                                  {&needle, &needle},
                                  {&drops, &organ},
                                  {&organ, &drops}})
    for (const PairSettings& pair : settingsFor(0.005, false))
      contacts += expectOracle(random, *a, *b, pair);
  EXPECT_GT(contacts, 1000u);
}

using Ids = std::vector<std::uint32_t>;

/// The definition of All over public functions.
std::set<Ids> expectedVertexTriangle(const Thing& vertices, const Thing& triangles,
                                     double thickness, bool triangleFirst) {
  std::set<Ids> ids;
  if (triangles.kind != GeometryKind::Triangles) return ids;
  for (std::uint32_t v = 0; v < vertices.positions.size(); ++v)
    for (std::uint32_t t = 0; t < triangles.triangles.size(); ++t) {
      const auto& [i, j, k] = triangles.triangles[t];
      const Positions& p = triangles.positions;
      const double distance =
          vertexTriangleDistance(vertices.positions[v], p[i], p[j], p[k]).distance;
      if (distance - vertices.radius(v) <= thickness)
        ids.insert(triangleFirst ? Ids{t, v} : Ids{v, t});
    }
  return ids;
}

std::set<Ids> expectedEdgeEdge(const Thing& a, const Thing& b, double thickness) {
  std::set<Ids> ids;
  for (const Segment& p : a.edges())
    for (const Segment& q : b.edges()) {
      if (&a == &b && (!(p < q) || p[0] == q[0] || p[0] == q[1] || p[1] == q[0] || p[1] == q[1]))
        continue;
      const EdgeEdgeDistance d = edgeEdgeDistance(a.positions[p[0]], a.positions[p[1]],
                                                  b.positions[q[0]], b.positions[q[1]]);
      const auto radius = [](const Thing& thing, const Segment& edge, double weight) {
        return (1 - weight) * thing.radius(edge[0]) + weight * thing.radius(edge[1]);
      };
      if (d.distance - (radius(a, p, d.weightA) + radius(b, q, d.weightB)) <= thickness)
        ids.insert({p[0], p[1], q[0], q[1]});
    }
  return ids;
}

std::set<Ids> idsOf(const std::vector<Row>& rows, std::size_t words) {
  std::set<Ids> ids;
  for (const Row& row : rows) ids.insert(Ids(row.begin(), row.begin() + words));
  EXPECT_EQ(ids.size(), rows.size());
  return ids;
}

TEST(Kinds, AllIsWhatTheDefinitionSays) {
  Random random(2);
  const Thing organ = things(sphere(8, 12, {0.5, 0.5, 0.5}, 0.4));
  const Thing line = tapered(random, thread(random, 120, 0.12, 0, false), 0.03);
  const Thing loop = thread(random, 80, 0.15, 0, true), drops = particles(random, 300, 0.03);
  constexpr double kThickness = 0.02;
  for (const auto& [a, b] : Pairs{{&organ, &line},
                                  {&line, &organ},
                                  {&drops, &organ},
                                  {&organ, &drops},
                                  {&line, &loop},
                                  {&line, &line}}) {
    const Rows rows(answer(*a, *b, {Method::Proximity, kThickness, Contacts::All}));
    EXPECT_EQ(idsOf(rows.vertexTriangle, 2), expectedVertexTriangle(*a, *b, kThickness, false));
    EXPECT_EQ(idsOf(rows.triangleVertex, 2), expectedVertexTriangle(*b, *a, kThickness, true));
    EXPECT_EQ(idsOf(rows.edgeEdge, 4), expectedEdgeEdge(*a, *b, kThickness));
    EXPECT_GT(rows.contacts(), 5u);
  }
}

/// Of every contact.
double least(const CollisionData& data) {
  double least = std::numeric_limits<double>::infinity();
  for (const auto& c : data.vertexTriangle()) least = std::min(least, c.distance);
  for (const auto& c : data.triangleVertex()) least = std::min(least, c.distance);
  for (const auto& c : data.edgeEdge()) least = std::min(least, c.distance);
  return least;
}

TEST(Kinds, DistinctIsFewerAndKeepsTheNearest) {
  Random random(3);
  for (int run = 0; run < 40; ++run) {
    const Thing organ = things(soup(random, 30, 0.2));
    const Thing line = thread(random, 12, 0.3, 0.02, false), loop = thread(random, 9, 0.3, 0, true);
    for (const auto& [a, b] :
         Pairs{{&organ, &line}, {&line, &organ}, {&line, &loop}, {&loop, &line}, {&line, &line}}) {
      const CollisionData all = answer(*a, *b, {Method::Proximity, 0.1, Contacts::All}),
                          distinct = answer(*a, *b, {Method::Proximity, 0.1, Contacts::Distinct});
      const auto ofAll = idsOf(Rows(all).edgeEdge, 4);
      for (const Ids& ids : idsOf(Rows(distinct).edgeEdge, 4)) EXPECT_TRUE(ofAll.contains(ids));
      EXPECT_DOUBLE_EQ(least(all), least(distinct));
    }
  }
}

// ---- Laws ----

/// Vertices of the two exchanged.
CollisionData swapped(const CollisionData& data) {
  CollisionData::Contents contents;
  contents.earliestTimeOfImpact = data.earliestTimeOfImpact();
  contents.vertexTriangle.assign(data.triangleVertex().begin(), data.triangleVertex().end());
  contents.triangleVertex.assign(data.vertexTriangle().begin(), data.vertexTriangle().end());
  for (EdgeEdgeContact c : data.edgeEdge()) {
    std::swap(c.edgeA, c.edgeB);
    std::swap(c.weightA, c.weightB);
    c.normal = -c.normal;
    contents.edgeEdge.push_back(c);
  }
  const auto sort = [](auto& list, auto key) {
    std::sort(list.begin(), list.end(),
              [&](const auto& l, const auto& r) { return key(l) < key(r); });
  };
  sort(contents.vertexTriangle, [](const auto& c) { return std::tuple(c.vertex, c.triangle); });
  sort(contents.triangleVertex, [](const auto& c) { return std::tuple(c.triangle, c.vertex); });
  sort(contents.edgeEdge, [](const auto& c) { return std::tuple(c.edgeA, c.edgeB); });
  return CollisionData(contents);
}

TEST(Kinds, SwappingSwapsTheAnswer) {
  Random random(4);
  const Thing organ = things(sphere(8, 12, {0.5, 0.5, 0.5}, 0.4));
  const Thing line = thread(random, 120, 0.1, 0.02, false),
              loop = thread(random, 90, 0.1, 0.01, true);
  const Thing drops = particles(random, 300, 0.03);
  for (const auto& [a, b] : Pairs{{&organ, &line}, {&line, &loop}, {&drops, &organ}})
    for (const PairSettings& pair : settingsFor(0.02)) {
      const Rows there(swapped(answer(*a, *b, pair))), back(answer(*b, *a, pair));
      expectSameRows(there, back);
    }
}

TEST(Kinds, MotionThatIsExactChangesNothing) {
  Random random(5);
  const auto onGrid = [](Thing thing) {
    for (Vector3d& p : thing.positions)
      for (double& x : p) x = std::round(x * 1024) / 1024;
    return thing;
  };
  const Thing organ = onGrid(things(sphere(8, 12, {0.5, 0.5, 0.5}, 0.4)));
  const Thing line = onGrid(thread(random, 150, 0.1, 0.0625, false));
  const Thing drops = onGrid(particles(random, 300, 0.0625));
  const auto translated = [](Thing thing) {
    for (Vector3d& p : thing.positions) p += Vector3d(512, -64, 8192);
    return thing;
  };
  const auto turned = [](Thing thing) {  // x to y to z to x
    for (Vector3d& p : thing.positions) p = Vector3d(p[2], p[0], p[1]);
    return thing;
  };
  const Thing* const pairs[][2] = {{&organ, &line}, {&organ, &drops}, {&line, &line}};
  for (const auto& [a, b] : pairs)
    for (const Contacts contacts : {Contacts::Distinct, Contacts::All}) {
      const PairSettings pair{Method::Proximity, 0.03125, contacts};
      const Rows rows(answer(*a, *b, pair));
      const Thing farA = translated(*a), farB = translated(*b);
      expectSameRows(Rows(answer(farA, a == b ? farA : farB, pair)), rows);
      const Thing turnedA = turned(*a), turnedB = turned(*b);
      const Rows other(answer(turnedA, a == b ? turnedA : turnedB, pair));
      EXPECT_EQ(idsOf(other.edgeEdge, 4), idsOf(rows.edgeEdge, 4));
      EXPECT_EQ(idsOf(other.triangleVertex, 2), idsOf(rows.triangleVertex, 2));
      EXPECT_GT(rows.contacts(), 10u);
    }
}

// ---- Meaning, by hand ----

Thing lineOf(Positions positions, double radius = 0.0) {
  Thing line{GeometryKind::Lines, std::move(positions), {}, {}, {radius}};
  for (std::uint32_t i = 1; i < line.positions.size(); ++i) line.segments.push_back({i - 1, i});
  return line;
}

constexpr PairSettings kNear{Method::Proximity, 0.25, Contacts::Distinct};

TEST(Kinds, VertexOverEdgeIsOneContactUnderTheLowestEdge) {
  // A thread's bend points down at the middle of a straight one.
  const Thing bend = lineOf({{-1, 0, 1}, {0, 0, 0.125}, {1, 0, 1}});
  const Thing straight = lineOf({{0, -4, 0}, {0, 4, 0}});
  const CollisionData data = answer(bend, straight, kNear);
  ASSERT_EQ(data.edgeEdge().size(), 1u);
  const EdgeEdgeContact& c = data.edgeEdge()[0];
  EXPECT_EQ(c.edgeA, (Segment{0, 1}));
  EXPECT_EQ(c.weightA, 1.0);
  EXPECT_EQ(c.weightB, 0.5);
  EXPECT_EQ(c.distance, 0.125);
  EXPECT_EQ(c.normal, Vector3d(0, 0, 1));
}

TEST(Kinds, EndToEndIsOneContact) {
  const Thing down = lineOf({{-1, 0, 1}, {0, 0, 0.125}, {1, 0, 1}});
  const Thing up = lineOf({{0, -1, -1}, {0, 0, 0}, {0, 1, -1}}, 0.125);
  const CollisionData data = answer(down, up, kNear);
  ASSERT_EQ(data.edgeEdge().size(), 1u);
  EXPECT_EQ(data.edgeEdge()[0].weightA, 1.0);
  EXPECT_EQ(data.edgeEdge()[0].weightB, 1.0);
  EXPECT_EQ(data.edgeEdge()[0].distance, 0.0);  // 0.125 less the radius
}

TEST(Kinds, ApexUnderAThreadIsFound) {
  const Thing pyramid{GeometryKind::Triangles,
                      {{0, 0, 0}, {1, 1, -1}, {-1, 1, -1}, {-1, -1, -1}, {1, -1, -1}},
                      {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}},
                      {}};
  const Thing straight = lineOf({{-8, 0, 0.25}, {8, 0, 0.25}}, 0.5);
  const CollisionData data = answer(pyramid, straight, kNear);
  EXPECT_TRUE(data.triangleVertex().empty());
  ASSERT_EQ(data.edgeEdge().size(), 1u);
  EXPECT_EQ(data.edgeEdge()[0].edgeA, (Segment{0, 1}));
  EXPECT_EQ(data.edgeEdge()[0].weightA, 0.0);
  EXPECT_EQ(data.edgeEdge()[0].distance, -0.25);  // overlap
}

TEST(Kinds, ParallelEdgesMeetInTheMiddle) {
  const Thing a = lineOf({{0, 0, 0}, {4, 0, 0}}), b = lineOf({{2, 0, 0.125}, {6, 0, 0.125}});
  const CollisionData data = answer(a, b, kNear);
  ASSERT_EQ(data.edgeEdge().size(), 1u);
  EXPECT_EQ(data.edgeEdge()[0].weightA, 0.75);
  EXPECT_EQ(data.edgeEdge()[0].weightB, 0.25);
}

TEST(Kinds, ParticleOnAPlaneReportsItsDepth) {
  const Thing ground{
      GeometryKind::Triangles, {{-4, -4, 0}, {4, -4, 0}, {0, 4, 0}}, {{0, 1, 2}}, {}};
  const Thing drop{GeometryKind::Points, {{0, 0, 0.25}, {0, 0, -3}}, {}, {}, {0.5, 1.0}};
  const CollisionData data = answer(drop, ground, {Method::Proximity, 0.0, Contacts::Distinct});
  ASSERT_EQ(data.vertexTriangle().size(), 1u);
  EXPECT_EQ(data.vertexTriangle()[0].vertex, 0u);
  EXPECT_EQ(data.vertexTriangle()[0].distance, -0.25);
  EXPECT_EQ(data.vertexTriangle()[0].normal, Vector3d(0, 0, 1));
}

TEST(Kinds, ContinuousStopsAtTheRadius) {
  const Thing ground{
      GeometryKind::Triangles, {{-4, -4, 0}, {4, -4, 0}, {0, 4, 0}}, {{0, 1, 2}}, {}};
  const Thing drop{GeometryKind::Points, {{0, 0, 2}}, {}, {}, {0.5}};
  const CollisionData data = answer(settingsOf(Engine::Octree), drop, ground, {Method::Continuous},
                                    {{0, 0, -2}}, ground.positions);
  ASSERT_EQ(data.vertexTriangle().size(), 1u);
  EXPECT_NEAR(data.vertexTriangle()[0].timeOfImpact, 1.5 / 4, 1e-6);
  EXPECT_NEAR(data.vertexTriangle()[0].distance, 0.0, 1e-5);
}

TEST(Kinds, RestDistanceLeavesOutNeighboursAlongTheThread) {
  // A hairpin with corners half a unit apart, ten units long: 0-1-2-3 and back at height 0.125.
  const Thing hairpin =
      lineOf({{0, 0, 0}, {4, 0, 0}, {5, 0, 0.0625}, {4, 0, 0.125}, {0, 0, 0.125}});
  PairSettings pair{Method::Proximity, 0.25, Contacts::All};
  const auto pairsFound = [&] { return idsOf(Rows(answer(hairpin, hairpin, pair)).edgeEdge, 4); };
  EXPECT_EQ(pairsFound(), (std::set<Ids>{{0, 1, 2, 3}, {0, 1, 3, 4}, {1, 2, 3, 4}}));
  pair.restDistance = 1.5;  // edges next but one are 1.002 apart
  EXPECT_EQ(pairsFound(), (std::set<Ids>{{0, 1, 3, 4}}));
  pair.restDistance = 2.5;
  EXPECT_TRUE(pairsFound().empty());
  // Only the shape that it was added in counts.
  Positions stretched = hairpin.positions;
  stretched[2][0] = 400;
  EXPECT_EQ(Rows(answer(settingsOf(Engine::Octree), hairpin, hairpin, pair, stretched, stretched))
                .edgeEdge.size(),
            0u);
  // Round a closed thread the shorter way counts.
  Thing ring = lineOf({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}});
  ring.segments.push_back({3, 0});
  pair = {Method::Proximity, 1.5, Contacts::All};
  EXPECT_EQ(answer(ring, ring, pair).edgeEdge().size(), 2u);
  pair.restDistance = 1.25;  // opposite edges are one apart, either way
  EXPECT_EQ(answer(ring, ring, pair).edgeEdge().size(), 0u);
}

// ---- Degenerate ----

TEST(Kinds, DegenerateLinesAnswerAsBruteForce) {
  Random random(6);
  const Thing organ = things(sphere(4, 6, {1, 1, 1}, 1));
  for (int run = 0; run < 30; ++run) {
    Thing zoo{GeometryKind::Lines, {}, {}, {}, {run % 2 ? 0.25 : 0.0}};
    // On a coarse grid: coincident, parallel and collinear segments, some without length.
    for (int v = 0; v < 12; ++v) {
      const auto at = [&] { return static_cast<double>(random() % 3); };
      const double x = at(), y = at(), z = at();
      zoo.positions.push_back({x, y, z});
    }
    for (std::uint32_t e = 0; e < 16; ++e) {
      const auto p = static_cast<std::uint32_t>(random() % 12);
      zoo.segments.push_back({p, static_cast<std::uint32_t>((p + 1 + random() % 11) % 12)});
    }
    for (const Contacts contacts : {Contacts::Distinct, Contacts::All})
      for (const Thing* other : std::vector<const Thing*>{&organ, &zoo})
        for (const double thickness : {0.5, 1.0}) {
          const PairSettings pair{Method::Proximity, thickness, contacts};
          const Rows truth(answer(settingsOf(Engine::BruteForce), zoo, *other, pair, zoo.positions,
                                  other->positions));
          expectSameRows(Rows(answer(zoo, *other, pair)), truth);
          const CollisionData data = answer(zoo, *other, pair);
          for (const auto& c : data.edgeEdge()) expectWellFormed(c);
        }
  }
}

// ---- Refused ----

template <class F>
void expectRefused(ErrorCode code, const std::string& words, F&& call) {
  try {
    call();
    ADD_FAILURE() << "accepted; expected: " << words;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code);
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
  }
}

TEST(Kinds, BadInputIsRefusedByName) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  const Positions two{{0, 0, 0}, {1, 0, 0}};
  const std::vector<Segment> one{{0, 1}};
  using Code = ErrorCode;
  expectRefused(Code::NonFinitePosition, "geometry 0, vertex 1", [&] {
    collisions.addLineMesh(Positions{{0, 0, 0}, {kNan, 0, 0}}, one);
  });
  expectRefused(Code::NonFinitePosition, "geometry 0, vertex 0", [&] {
    collisions.addPointSet(Positions{{kNan, 0, 0}});
  });
  expectRefused(Code::IndexOutOfRange, "geometry 0, segment 0: vertex index 2 is out of range",
                [&] {
                  collisions.addLineMesh(two, std::vector<Segment>{{0, 2}});
                });
  expectRefused(Code::IndexOutOfRange, "segment 1: joins vertex 1 with itself", [&] {
    collisions.addLineMesh(two, std::vector<Segment>{{0, 1}, {1, 1}});
  });
  for (const double bad : {-1.0, kNan, std::numeric_limits<double>::infinity()}) {
    expectRefused(Code::InvalidRadius, "radius is", [&] { collisions.addPointSet(two, bad); });
    expectRefused(Code::InvalidRadius, "geometry 0, vertex 1: radius is", [&] {
      collisions.addLineMesh(two, one, std::vector<double>{1, bad});
    });
  }
  expectRefused(Code::InvalidRadius, "1 radii given for 2 vertices",
                [&] { collisions.addLineMesh(two, one, std::vector<double>{1}); });

  const GeometryId line = collisions.addLineMesh(two, one),
                   points = collisions.addPointSet(two, 1.0),
                   thick = collisions.addLineMesh(two, one, std::vector<double>{1, 2}),
                   mesh = collisions.addTriangleMesh(two, std::vector<Triangle>{{0, 1, 0}});
  EXPECT_EQ(line, GeometryId{0});  // nothing refused took an id
  const PairSettings near{Method::Proximity, 1.0};
  for (const auto& [a, b] : std::vector<std::pair<GeometryId, GeometryId>>{
           {points, points}, {points, line}, {line, points}})
    expectRefused(Code::UnsupportedMethod, "cannot be tested against each other",
                  [&] { collisions.addCollisionPair(a, b, near); });
  for (const Method method : {Method::Auto, Method::Intersection})
    for (const GeometryId other : {mesh, line})
      expectRefused(Code::UnsupportedMethod, "a line mesh", [&] {
        collisions.addCollisionPair(line, other, {method, 1.0});
      });
  expectRefused(Code::UnsupportedMethod, "one radius for all vertices", [&] {
    collisions.addCollisionPair(thick, mesh, {Method::Continuous, 1.0});
  });
  expectRefused(Code::InvalidSettings, "needs a positive thickness", [&] {
    collisions.addCollisionPair(line, mesh, {Method::Proximity, 0.0});
  });
  expectRefused(Code::NotClosed, "geometry 0 is a line mesh, which has no inside",
                [&] { collisions.findInsideVertices(points, line); });
  expectRefused(Code::UnsupportedMethod, "geometry 0 is a line mesh",
                [&] { collisions.setTriangles(line, two, {}); });
  PairSettings rest = near;
  for (const double bad : {-1.0, kNan}) {
    rest.restDistance = bad;
    expectRefused(Code::InvalidSettings, "restDistance is",
                  [&] { collisions.addCollisionPair(line, line, rest); });
  }
  rest.restDistance = 1.0;
  expectRefused(Code::InvalidSettings, "for a line mesh with itself",
                [&] { collisions.addCollisionPair(line, thick, rest); });
  const GeometryId branching =
      collisions.addLineMesh(Positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                             std::vector<Segment>{{0, 1}, {0, 2}, {0, 3}});
  expectRefused(Code::InvalidSettings, "without branches",
                [&] { collisions.addCollisionPair(branching, branching, rest); });
  EXPECT_TRUE(collisions.pairs().empty());
  collisions.addCollisionPair(thick, mesh, {Method::Proximity, 0.0});  // the radii are not 0
}

// ---- Round the library ----

TEST(Kinds, CapturesHoldThem) {
  Random random(7);
  const Thing organ = things(sphere(8, 12, {0.5, 0.5, 0.5}, 0.4));
  const Thing line = tapered(random, thread(random, 100, 0.1, 0, false), 0.02),
              drops = particles(random, 50, 0.03);
  Settings audited = settingsOf(Engine::Octree);
  audited.audit.features = 100000;
  OctreeBasedCD collisions(audited);
  const GeometryId a = organ.addTo(collisions), b = line.addTo(collisions),
                   c = drops.addTo(collisions);
  PairSettings self{Method::Proximity, 0.01};
  self.restDistance = 0.2;
  collisions.addCollisionPair(b, b, self);
  collisions.addCollisionPair(a, b, {Method::Proximity, 0.02});
  collisions.addCollisionPair(c, a, {Method::Continuous, 0.01});
  collisions.setPositions(b, moved(random, line.positions, 0.05));
  collisions.detectCollision();
  EXPECT_TRUE(collisions.auditFailures().empty());
  EXPECT_EQ(collisions.statistics().segments, 100u);
  EXPECT_EQ(collisions.statistics().points, 50u);
  EXPECT_EQ(collisions.statistics().triangles, organ.triangles.size());
  const auto path = std::filesystem::temp_directory_path() / "palpate-kinds.capture";
  capture(collisions, path);
  OctreeBasedCD again = setUp(readCapture(path));
  std::filesystem::remove(path);
  again.detectCollision();
  for (const CollisionPair& pair : collisions.pairs()) {
    EXPECT_EQ(again.collisionData(pair.a, pair.b).hash(),
              collisions.collisionData(pair.a, pair.b).hash());
    EXPECT_FALSE(collisions.collisionData(pair.a, pair.b).validity().trusted);
  }
  EXPECT_GT(collisions.statistics().contacts, 10u);
}

}  // namespace
}  // namespace palpate::testing
