#include <palpate/FeaturePairs.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/QueryCalls.h"
#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Common/TestGeometry.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <utility>
#include <vector>

// Lines and points: every pair of geometry types against brute force and against the definition,
// which is written here with <palpate/FeaturePairs.h>. Unsupported pairs are refused.

namespace palpate::testing {
namespace {

using Ids = std::vector<std::uint32_t>;

/// The definition of All with public functions: vertices of the other geometry against triangles,
/// and points also against segments. For two point sets: points of the first against points of the
/// second.
std::set<Ids> expectedVertexTriangle(const TestGeometry& vertices, const TestGeometry& others,
                                     double thickness, bool ofSecond) {
  std::set<Ids> ids;
  const bool points = vertices.type == GeometryType::Points;
  if (others.type != GeometryType::Triangles &&
      !(points && (others.type == GeometryType::Lines || !ofSecond)))
    return ids;
  const std::vector<Triangle> elements = others.elements();
  const auto& at = others.positions;
  for (std::uint32_t v = 0; v < vertices.positions.size(); ++v)
    for (std::uint32_t t = 0; t < elements.size(); ++t) {
      const auto& [i, j, k] = elements[t];
      if (&vertices == &others && !(v < t)) continue;
      const VertexTriangleDistance d =
          vertexTriangleDistance(vertices.positions[v], at[i], at[j], at[k]);
      const double radius = d.weights[0] * others.radius(i) + d.weights[1] * others.radius(j) +
                            d.weights[2] * others.radius(k);
      if (d.distance - (vertices.radius(v) + radius) <= thickness)
        ids.insert(ofSecond ? Ids{t, v} : Ids{v, t});
    }
  return ids;
}

std::set<Ids> expectedEdgeEdge(const TestGeometry& a, const TestGeometry& b, double thickness) {
  std::set<Ids> ids;
  for (const Segment& p : a.edges())
    for (const Segment& q : b.edges()) {
      if (&a == &b && (!(p < q) || p[0] == q[0] || p[0] == q[1] || p[1] == q[0] || p[1] == q[1]))
        continue;
      const EdgeEdgeDistance d = edgeEdgeDistance(a.positions[p[0]], a.positions[p[1]],
                                                  b.positions[q[0]], b.positions[q[1]]);
      const auto radius = [](const TestGeometry& geometry, const Segment& edge, double weight) {
        return (1 - weight) * geometry.radius(edge[0]) + weight * geometry.radius(edge[1]);
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

TEST(GeometryTypes, AllMatchesTheDefinition) {
  Random random(2);
  const TestGeometry organ = testGeometry(sphere(8, 12, {0.5, 0.5, 0.5}, 0.4));
  const TestGeometry line = tapered(random, thread(random, 120, 0.12, 0, false), 0.03);
  const TestGeometry loop = thread(random, 80, 0.15, 0, true), drops = particles(random, 300, 0.03);
  const TestGeometry smoke = tapered(random, particles(random, 250, 0), 0.04);
  constexpr double kThickness = 0.02;
  for (const auto& [a, b] : Pairs{{&organ, &line},
                                  {&line, &organ},
                                  {&drops, &organ},
                                  {&organ, &drops},
                                  {&line, &loop},
                                  {&line, &line},
                                  {&line, &smoke},
                                  {&smoke, &line},
                                  {&drops, &loop},
                                  {&smoke, &drops},
                                  {&smoke, &smoke}}) {
    const Rows rows(answer(*a, *b, {Method::Proximity, kThickness, Contacts::All}));
    EXPECT_EQ(idsOf(rows.vertexTriangle, 2), expectedVertexTriangle(*a, *b, kThickness, false));
    EXPECT_EQ(idsOf(rows.triangleVertex, 2),
              a == b ? std::set<Ids>() : expectedVertexTriangle(*b, *a, kThickness, true));
    EXPECT_EQ(idsOf(rows.edgeEdge, 4), expectedEdgeEdge(*a, *b, kThickness));
    EXPECT_GT(rows.contacts(), 5u);
  }
}

TEST(GeometryTypes, DistinctHasFewerContactsAndKeepsTheNearest) {
  Random random(3);
  for (int run = 0; run < 40; ++run) {
    const TestGeometry organ = testGeometry(soup(random, 30, 0.2));
    const TestGeometry line = thread(random, 12, 0.3, 0.02, false),
                       loop = thread(random, 9, 0.3, 0, true);
    for (const auto& [a, b] :
         Pairs{{&organ, &line}, {&line, &organ}, {&line, &loop}, {&loop, &line}, {&line, &line}}) {
      const CollisionData all = answer(*a, *b, {Method::Proximity, 0.1, Contacts::All}),
                          distinct = answer(*a, *b, {Method::Proximity, 0.1, Contacts::Distinct});
      const auto ofAll = idsOf(Rows(all).edgeEdge, 4);
      for (const Ids& ids : idsOf(Rows(distinct).edgeEdge, 4)) EXPECT_TRUE(ofAll.contains(ids));
      EXPECT_DOUBLE_EQ(leastDistance(all), leastDistance(distinct));
    }
  }
}

// ---- Hand-computed contacts ----

TestGeometry lineOf(Positions positions, double radius = 0.0) {
  TestGeometry line{GeometryType::Lines, std::move(positions), {}, {}, {radius}};
  for (std::uint32_t i = 1; i < line.positions.size(); ++i) line.segments.push_back({i - 1, i});
  return line;
}

constexpr PairSettings kNear{Method::Proximity, 0.25, Contacts::Distinct};

TEST(GeometryTypes, EdgesHaveOneContactAtTheirClosestPoints) {
  const TestGeometry bend = lineOf({{-1, 0, 1}, {0, 0, 0.125}, {1, 0, 1}}),
                     along = lineOf({{0, -4, 0}, {0, 4, 0}}),
                     roof = lineOf({{0, -1, -1}, {0, 0, 0}, {0, 1, -1}}, 0.125),
                     first = lineOf({{0, 0, 0}, {4, 0, 0}}),
                     beside = lineOf({{2, 0, 0.125}, {6, 0, 0.125}}),
                     above = lineOf({{-8, 0, 0.25}, {8, 0, 0.25}}, 0.5);
  const TestGeometry pyramid{GeometryType::Triangles,
                             {{0, 0, 0}, {1, 1, -1}, {-1, 1, -1}, {-1, -1, -1}, {1, -1, -1}},
                             {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}},
                             {}};
  struct Row {
    const char* name;
    const TestGeometry &a, &b;
    double weightA, weightB, distance;
  };
  for (const Row& row : {Row{"a vertex over an edge", bend, along, 1, 0.5, 0.125},
                         {"two vertices, less the radius", bend, roof, 1, 1, 0},
                         {"an apex that overlaps a thread", pyramid, above, 0, 0.5, -0.25},
                         {"the middle of parallel edges", first, beside, 0.75, 0.25, 0.125}}) {
    SCOPED_TRACE(row.name);
    const CollisionData data = answer(row.a, row.b, kNear);
    EXPECT_TRUE(data.triangleVertex().empty());
    ASSERT_EQ(data.edgeEdge().size(), 1u);
    const EdgeEdgeContact& c = data.edgeEdge()[0];
    EXPECT_EQ(c.edgeA, (Segment{0, 1}));  // the lowest edge at a vertex
    EXPECT_EQ(c.edgeB, (Segment{0, 1}));
    EXPECT_EQ(c.weightA, row.weightA);
    EXPECT_EQ(c.weightB, row.weightB);
    EXPECT_EQ(c.distance, row.distance);
  }
}

TEST(GeometryTypes, ParticlesTouchThreadsAndEachOther) {
  const TestGeometry thread = lineOf({{0, 0, 0}, {4, 0, 0}, {4, 4, 0}}, 0.125);
  const TestGeometry drops{GeometryType::Points,
                           {{1, 0, 0.5}, {4.25, -0.25, 0}, {9, 9, 9}, {1, 0.25, 0.5}},
                           {},
                           {},
                           {0.25}};
  const CollisionData data = answer(drops, thread, kNear);
  ASSERT_EQ(data.vertexTriangle().size(), 3u);
  const VertexTriangleContact &over = data.vertexTriangle()[0], &corner = data.vertexTriangle()[1];
  EXPECT_EQ(over.vertices, (Triangle{0, 1, 1}));
  EXPECT_EQ(over.weights, Vector3d(0.75, 0.25, 0));
  EXPECT_EQ(over.distance, 0.125);  // 0.5 less both radii
  EXPECT_EQ(over.normal, Vector3d(0, 0, 1));
  EXPECT_EQ(corner.triangle, 0u);  // the lower one of the two segments at the corner
  EXPECT_EQ(corner.weights[0], 0.0);
  EXPECT_EQ(answer(drops, thread, {Method::Proximity, 0.25, Contacts::All}).vertexTriangle().size(),
            4u);
  const CollisionData self = answer(drops, drops, kNear);
  ASSERT_EQ(self.vertexTriangle().size(), 1u);
  EXPECT_EQ(self.vertexTriangle()[0].vertex, 0u);
  EXPECT_EQ(self.vertexTriangle()[0].triangle, 3u);
  EXPECT_EQ(self.vertexTriangle()[0].distance, -0.25);
  EXPECT_EQ(self.vertexTriangle()[0].normal, Vector3d(0, -1, 0));
}

TEST(GeometryTypes, ThinEndOfATaperDoesNotSuppressItsThickEnd) {
  // Both segments at the thick vertex are nearer to the particle at their thin ends.
  TestGeometry spindle = lineOf({{-2, 0, 0.5}, {0, 0, 0}, {2, 0, 0.5}});
  spindle.radii = {0, 1, 0};
  const TestGeometry drop{GeometryType::Points, {{0, 0, 1.125}}, {}, {}, {0}};
  const CollisionData data = answer(drop, spindle, {Method::Proximity, 0.5, Contacts::Distinct});
  EXPECT_EQ(data.vertexTriangle().size(), 2u);
  // The first segment falls away, and the second is nearer only where it is thin.
  spindle.positions[0][2] = -0.5;
  const CollisionData onVertex =
      answer(drop, spindle, {Method::Proximity, 0.2, Contacts::Distinct});
  ASSERT_EQ(onVertex.vertexTriangle().size(), 1u);
  EXPECT_EQ(onVertex.vertexTriangle()[0].triangle, 0u);
  EXPECT_EQ(onVertex.vertexTriangle()[0].distance, 0.125);
  const TestGeometry far = lineOf({{-2, 0, 0.5}, {0, 0, 0}, {2, 0, 0.5}}, 0.625);
  EXPECT_EQ(answer(drop, far, {Method::Proximity, 0.5, Contacts::Distinct}).vertexTriangle().size(),
            2u);
}

TEST(GeometryTypes, ContinuousStopsAtTheRadius) {
  const TestGeometry ground{
      GeometryType::Triangles, {{-4, -4, 0}, {4, -4, 0}, {0, 4, 0}}, {{0, 1, 2}}, {}};
  const TestGeometry drop{GeometryType::Points, {{0, 0, 2}}, {}, {}, {0.5}};
  const CollisionData data = answer(settingsOf(Engine::Octree), drop, ground, {Method::Continuous},
                                    {{0, 0, -2}}, ground.positions);
  ASSERT_EQ(data.vertexTriangle().size(), 1u);
  EXPECT_NEAR(data.vertexTriangle()[0].timeOfImpact, 1.5 / 4, 1e-6);
  EXPECT_NEAR(data.vertexTriangle()[0].distance, 0.0, 1e-5);
}

TEST(GeometryTypes, RestDistanceExcludesNeighboursAlongTheThread) {
  // A hairpin with corners half a unit apart, ten units long: 0-1-2-3 and back at height 0.125.
  const TestGeometry hairpin =
      lineOf({{0, 0, 0}, {4, 0, 0}, {5, 0, 0.0625}, {4, 0, 0.125}, {0, 0, 0.125}});
  TestGeometry ring = lineOf({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}),
               branching = lineOf({{0, 0, 0}, {0, 0, 1}, {0, 0, 2}});
  ring.segments.push_back({3, 0});
  branching.positions.insert(branching.positions.end(), {{1, 0, 1}, {1, 0, 2}});
  branching.segments.insert(branching.segments.end(), {{1, 3}, {3, 4}});
  Positions stretched = hairpin.positions;
  stretched[2][0] = 400;
  struct Restrained {
    const char* name;
    const TestGeometry& line;
    double thickness, restDistance;
    std::set<Ids> pairs;
    Positions now{};
  };
  for (const auto& [name, line, thickness, restDistance, pairs, now] :
       {Restrained{"all", hairpin, 0.25, 0, {{0, 1, 2, 3}, {0, 1, 3, 4}, {1, 2, 3, 4}}},
        {"edges next but one are 1.002 apart", hairpin, 0.25, 1.5, {{0, 1, 3, 4}}},
        {"none is so far", hairpin, 0.25, 2.5, {}},
        {"the rest positions count", hairpin, 0.25, 2.5, {}, stretched},
        {"a closed thread", ring, 1.5, 0, {{0, 1, 2, 3}, {0, 3, 1, 2}}},
        {"opposite edges are one apart, either way", ring, 1.5, 1.25, {}},
        {"branches", branching, 1.0, 0, {{0, 1, 3, 4}, {1, 2, 3, 4}}},
        {"branches one apart", branching, 1.0, 1.0, {{0, 1, 3, 4}, {1, 2, 3, 4}}},
        {"the shortest way between branches", branching, 1.0, 1.25, {}}}) {
    SCOPED_TRACE(name);
    PairSettings pair{Method::Proximity, thickness, Contacts::All};
    pair.restDistance = restDistance;
    const Positions& at = now.empty() ? line.positions : now;
    const Rows rows(answer(settingsOf(Engine::Octree), line, line, pair, at, at));
    EXPECT_EQ(idsOf(rows.edgeEdge, 4), pairs);
  }
}

// ---- Degenerate ----

/// On a coarse grid: coincident, parallel and collinear segments, and some without length.
TEST(GeometryTypes, DegenerateLinesAndPointsMatchBruteForce) {
  Random random(9);
  const TestGeometry organ = testGeometry(sphere(4, 6, {1, 1, 1}, 1));
  for (int run = 0; run < casesOf(30); ++run) {
    const auto onGrid = [&](GeometryType type, std::size_t count, double radius) {
      TestGeometry geometry{type, {}, {}, {}, {radius}};
      const auto at = [&] { return static_cast<double>(random() % 3); };
      for (std::size_t v = 0; v < count; ++v) {
        const double x = at(), y = at(), z = at();
        geometry.positions.push_back({x, y, z});
      }
      return geometry;
    };
    const TestGeometry drops = onGrid(GeometryType::Points, 20, run % 2 ? 0.25 : 0.0),
                       others = onGrid(GeometryType::Points, 20, 0.0);
    TestGeometry line = onGrid(GeometryType::Lines, 12, run % 2 ? 0.25 : 0.0);
    for (std::uint32_t e = 0; e < 16; ++e) {
      const auto p = static_cast<std::uint32_t>(random() % 12);
      line.segments.push_back({p, static_cast<std::uint32_t>((p + 1 + random() % 11) % 12)});
    }
    for (const auto& [a, b] : Pairs{{&drops, &line},
                                    {&line, &drops},
                                    {&drops, &others},
                                    {&drops, &drops},
                                    {&line, &organ},
                                    {&line, &line}})
      for (const PairSettings& pair : settingsFor(run % 3 ? 0.5 : 1.0)) {
        const bool lands = run % 4 > 1 && a == &drops;  // on others
        const Positions& now = lands ? others.positions : a->positions;
        const CollisionData data =
            answer(settingsOf(Engine::Octree), *a, *b, pair, now, b->positions);
        expectSameContacts(data,
                           answer(settingsOf(Engine::BruteForce), *a, *b, pair, now, b->positions));
        EXPECT_TRUE(data.validity().degenerateTrianglesA.empty());
        EXPECT_TRUE(data.validity().degenerateTrianglesB.empty());
        for (const auto& c : data.edgeEdge()) expectWellFormed(c);
        for (const auto& c : data.vertexTriangle()) {
          EXPECT_NEAR(c.normal.norm(), 1.0, 1e-15);
          EXPECT_EQ(c.weights.sum(), 1.0);
          EXPECT_GE(c.weights.minCoeff(), 0.0);
        }
      }
  }
}

/// Triangles without area are listed, segments and points are not.
TEST(GeometryTypes, OnlyTrianglesWithoutAreaAreDegenerate) {
  TestGeometry flat;
  flat.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 1, 0}};
  flat.triangles = {{0, 1, 2}, {0, 1, 3}};
  const TestGeometry points{GeometryType::Points, {{1.5, 0, 0.1}, {0.2, 0.2, 0.1}}, {}, {}, {0.0}};
  const Validity validity =
      answer(flat, points, {Method::Proximity, 0.3, Contacts::All}).validity();
  EXPECT_EQ(validity.degenerateTrianglesA, (std::vector<std::uint32_t>{0}));
  EXPECT_TRUE(validity.degenerateTrianglesB.empty());
  PairSettings earliest{Method::Continuous, 0.3};
  earliest.continuous.earliestTimeOnly = true;  // has no contacts
  EXPECT_TRUE(answer(flat, points, earliest).validity().degenerateTrianglesA.empty());
}

// ---- Refused calls ----

TEST(GeometryTypes, BadInputThrowsErrorsThatNameIt) {
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
  expectRefused(Code::IndexOutOfRange, "segment 1 joins vertex 1 with itself", [&] {
    collisions.addLineMesh(two, std::vector<Segment>{{0, 1}, {1, 1}});
  });
  for (const double bad : {-1.0, kNan, std::numeric_limits<double>::infinity()}) {
    expectRefused(Code::InvalidRadius, "radius is", [&] { collisions.addPointSet(two, bad); });
    expectRefused(Code::InvalidRadius, "geometry 0, vertex 1: radius is", [&] {
      collisions.addLineMesh(two, one, std::vector<double>{1, bad});
    });
  }
  expectRefused(Code::InvalidRadius, "geometry 0: 1 radii given for 2 vertices",
                [&] { collisions.addLineMesh(two, one, std::vector<double>{1}); });

  const GeometryId line = collisions.addLineMesh(two, one),
                   points = collisions.addPointSet(two, 1.0),
                   thick = collisions.addLineMesh(two, one, std::vector<double>{1, 2}),
                   mesh = collisions.addTriangleMesh(two, std::vector<Triangle>{{0, 1, 0}});
  EXPECT_EQ(line, GeometryId{0});  // refused calls used no id
  const PairSettings near{Method::Proximity, 1.0};
  for (const GeometryId other : {mesh, line, points})
    expectRefused(Code::UnsupportedMethod, "use Auto, Proximity or Continuous",
                  [&] { collisions.addCollisionPair(line, other, {Method::Intersection}); });
  expectRefused(Code::UnsupportedMethod, "one radius for all vertices", [&] {
    collisions.addCollisionPair(thick, mesh, {Method::Continuous, 1.0});
  });
  expectRefused(Code::InvalidSettings, "needs a positive thickness", [&] {
    collisions.addCollisionPair(line, mesh, {Method::Proximity, 0.0});
  });
  expectRefused(Code::NotClosed, "geometry 0 is a line mesh, which has no inside",
                [&] { testing::insideVertices(collisions, points, line); });
  expectRefused(Code::UnsupportedMethod, "geometry 0 is a line mesh",
                [&] { collisions.setTriangles(line, two, {}); });
  PairSettings rest = near;
  for (const double bad : {-1.0, kNan}) {
    rest.restDistance = bad;
    expectRefused(Code::InvalidSettings, "restDistance is",
                  [&] { collisions.addCollisionPair(line, line, rest); });
  }
  rest.restDistance = 1.0;
  expectRefused(Code::InvalidSettings, "for a triangle or line mesh with itself",
                [&] { collisions.addCollisionPair(line, thick, rest); });
  EXPECT_TRUE(collisions.pairs().empty());
  collisions.addCollisionPair(thick, mesh, {Method::Proximity, 0.0});  // the radii are not 0
}

}  // namespace
}  // namespace palpate::testing
