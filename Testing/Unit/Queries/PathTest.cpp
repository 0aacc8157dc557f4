#include "Common/BallTruth.h"
#include "Common/ExpectRefused.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Queries/QueryTruth.h"

#include <palpate/FeaturePairs.h>
#include <palpate/OctreeBasedCD.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

// Paths: the octrees' answers are those of brute force, bit by bit, and those of points sampled
// along the path. Known cases have exact answers.
namespace palpate::testing {
namespace {

struct Answer {
  std::vector<PathInterval> inside;
  std::vector<PathClearance> outside;
};

Answer follow(const SpatialQueries& queries, const Positions& path, double radius,
              const std::vector<GeometryId>& bodies) {
  Answer answer;
  queries.path(path, radius, bodies, answer.inside, answer.outside);
  return answer;
}

bool areEqual(const PathInterval& a, const PathInterval& b) {
  return a.body == b.body && a.enter == b.enter && a.leave == b.leave &&
         a.entryElement == b.entryElement && a.exitElement == b.exitElement;
}
bool areEqual(const PathClearance& a, const PathClearance& b) {
  return a.body == b.body && a.distance == b.distance && a.at == b.at &&
         testing::isSame(a.nearest, b.nearest);
}
bool areEqual(const Answer& a, const Answer& b) {
  const auto same = [](const auto& l, const auto& r) { return areEqual(l, r); };
  return std::ranges::equal(a.inside, b.inside, same) &&
         std::ranges::equal(a.outside, b.outside, same);
}

/// A path by its arc length.
class Line {
 public:
  explicit Line(const Positions& points) : m_points(points) {
    for (std::size_t i = 0; i + 1 < points.size(); ++i)
      m_starts.push_back(m_starts.back() + (points[i + 1] - points[i]).norm());
  }
  double length() const { return m_starts.back(); }
  Vector3d operator()(double s) const {
    std::size_t i = 0;
    while (i + 2 < m_points.size() && m_starts[i + 1] <= s) ++i;
    const double length = m_starts[i + 1] - m_starts[i];
    return m_points[i] +
           (length > 0 ? (s - m_starts[i]) / length : 0.0) * (m_points[i + 1] - m_points[i]);
  }

 private:
  const Positions& m_points;
  std::vector<double> m_starts{0.0};
};

/// Expects the answers of brute force, and those of points along the path. isBody: whether
/// contains() answers. size: L, of all coordinates.
Answer expectSamples(const Both& scene, bool isBody, const Positions& path, double radius,
                     double size = 5.0) {
  const GeometryId body = scene.id;
  const SpatialQueries queries = scene.octree.queries(), truth = scene.bruteForce.queries();
  const Answer found = follow(queries, path, radius, {body}),
               expected = follow(truth, path, radius, {body});
  EXPECT_TRUE(areEqual(found, expected));
  EXPECT_NE(found.inside.empty(), found.outside.empty());

  const Line line(path);
  const double slack = 1e-6 * size;  // of grazing ends
  for (std::size_t i = 0; i < found.inside.size(); ++i) {
    const PathInterval& interval = found.inside[i];
    EXPECT_LE(0.0, interval.enter);
    EXPECT_LE(interval.enter, interval.leave);
    EXPECT_LE(interval.leave, line.length() * (1 + 1e-15));
    if (i > 0) {
      EXPECT_LT(found.inside[i - 1].leave, interval.enter);
    }
  }
  constexpr int kSamples = 400;
  double least = kInfinity;
  for (int i = 0; i <= kSamples; ++i) {
    const double s = line.length() * i / kSamples;
    const Vector3d p = line(s);
    const double distance = queries.closestPoint(body, p)->distance;
    least = std::min(least, distance - radius);
    const bool isIn = (isBody && queries.contains(body, p)) ||
                      (distance < 0 || (radius > 0 && distance <= radius));
    bool isClaimed = false, isNearEnd = false;
    for (const PathInterval& interval : found.inside) {
      isClaimed |= interval.enter <= s && s <= interval.leave;
      isNearEnd |= std::abs(s - interval.enter) < slack || std::abs(s - interval.leave) < slack;
    }
    // Samples that only just touch may fall between the ends' accuracy.
    if (!isNearEnd && std::abs(distance - radius) > 1e-12 * size) {
      EXPECT_EQ(isClaimed, isIn) << "at " << s << ", distance " << distance;
    }
  }
  for (const PathClearance& clearance : found.outside) {
    EXPECT_EQ(clearance.nearest.distance, clearance.distance);
    EXPECT_EQ(clearance.body, body);
    const double there = queries.closestPoint(body, line(clearance.at))->distance;
    EXPECT_GE(least, clearance.distance - 1e-13 * size);
    EXPECT_NEAR(std::max(0.0, there - radius), clearance.distance, 1e-13 * size);
  }
  return found;
}

/// The distance of a point from an element, less the radius: of a segment from the nearest of its
/// balls.
double elementGap(const TestGeometry& geometry, const Positions& now,
                  const std::array<std::uint32_t, 3>& vertices, const Vector3d& p) {
  const auto& [a, b, c] = vertices;
  if (geometry.type == GeometryType::Triangles)
    return vertexTriangleDistance(p, now[a], now[b], now[c]).distance;
  return static_cast<double>(
      roundDistance(wide(p), wide(now[a]), wide(now[b]), geometry.radius(a), geometry.radius(b)));
}

/// Expects that the ball touches the entry and exit elements at the ends.
void expectEndsOnElements(const TestGeometry& geometry, const Positions& now, const Answer& found,
                          const Positions& path, double radius, double size = 5.0) {
  const Line line(path);
  const auto expectTouch = [&](std::uint32_t element, double s) {
    EXPECT_NEAR(elementGap(geometry, now, geometry.elements()[element], line(s)), radius,
                1e-11 * size)
        << element;
  };
  for (const PathInterval& interval : found.inside) {
    if (interval.enter > 0) {
      ASSERT_NE(interval.entryElement, kNoElement);
      expectTouch(interval.entryElement, interval.enter);
    }
    if (interval.leave < line.length() * (1 - 1e-15)) {
      ASSERT_NE(interval.exitElement, kNoElement);
      expectTouch(interval.exitElement, interval.leave);
    }
  }
}

Positions randomPath(Random& random, double most, int points) {
  Positions path;
  for (int i = 0; i < points; ++i)
    path.push_back(Vector3d(0.5, 0.5, 0.5) + randomPoint(random, -most, most));
  if (points > 3) path[2] = path[1];
  return path;
}

struct SampledPaths {
  std::size_t intervals = 0, clearances = 0;

  /// Paths to one body. touched: whose elements are met at the ends of intervals, or null.
  void test(Random& random, const Both& scene, bool isBody, int round,
            const TestGeometry* touched = nullptr) {
    const double radius = round % 4 == 0 ? 0.0 : uniform(random, 0, 0.15);
    const Positions path = randomPath(random, round % 3 ? 0.7 : 2.0, 2 + round % 4);
    const Answer found = expectSamples(scene, isBody, path, radius);
    if (touched) expectEndsOnElements(*touched, touched->positions, found, path, radius);
    ASSERT_FALSE(::testing::Test::HasFailure()) << "round " << round;
    intervals += found.inside.size();
    clearances += found.outside.size();
    for (const PathInterval& interval : found.inside) {
      if (isBody || touched) continue;
      EXPECT_EQ(interval.entryElement, kNoElement);
      EXPECT_EQ(interval.exitElement, kNoElement);
    }
  }
};

TEST(Path, AgreesWithSamplesForEveryGeometryType) {
  Random random(301);
  const Mesh ball = sphere(10, 14, {0.5, 0.5, 0.5}, 0.4);
  const std::pair<TestGeometry, bool> cases[] = {
      // whether it is a body
      {testGeometry(ball), true},
      {testGeometry(joined(ball, insideOut(sphere(7, 9, {0.5, 0.5, 0.5}, 0.2)))), true},
      {testGeometry(joined(ball, sphere(7, 9, {0.9, 0.5, 0.5}, 0.3))), true},
      {testGeometry(joined(ball, sphere(7, 9, {0.5, 0.5, 0.5}, 0.3))), true},
      {testGeometry(soup(random, 40, 0.2)), false},
      {testGeometry(sheet(6, 0.5, 0.0)), false},
      {thread(random, 30, 0.2, 0.0, false), false},
      {thread(random, 30, 0.2, 0.05, true), false},
      {tapered(random, thread(random, 30, 0.2, 0.01, false), 0.1), false},
      {particles(random, 60, 0.0), false},
      {particles(random, 60, 0.05), false},
      {tapered(random, particles(random, 60, 0.02), 0.1), false}};
  SampledPaths paths;
  for (const auto& [geometry, isBody] : cases)
    for (int round = 0; round < casesOf(40); ++round) {
      SCOPED_TRACE(&geometry - &cases[0].first);
      paths.test(random, Both(geometry), isBody, round, &geometry);
      if (HasFatalFailure()) return;
    }
  EXPECT_GE(paths.intervals, leastOf(200));
  EXPECT_GE(paths.clearances, leastOf(100));
}

TEST(Path, AgreesWithSamplesForEveryShape) {
  Random random(304);
  SampledPaths paths;
  for (const AnalyticalGeometry& shape : shapesOfEveryKind(random))
    for (int round = 0; round < 40; ++round) {
      SCOPED_TRACE(shape.index());
      Both scene(shape);
      const Matrix3d turn = randomTurn(random);
      const Vector3d shift = randomPoint(random, 0, 1);
      scene.change([&](OctreeBasedCD& each) { each.setTransform(scene.id, {turn, shift}); });
      paths.test(random, scene, false, round);
      if (HasFatalFailure()) return;
    }
  EXPECT_GT(paths.intervals, 100u);
  EXPECT_GT(paths.clearances, 50u);
}

TEST(Path, AgreesWithSamplesForTetrahedralMeshes) {
  Random random(302);
  const Both scene(cells(3, random, [](const auto& at) { return at[0] + at[1] + at[2] != 3; }));
  for (int round = 0; round < 60; ++round) {
    Positions path;
    for (int i = 0; i < 2 + round % 3; ++i) path.push_back(randomPoint(random, -1, 4));
    expectSamples(scene, true, path, round % 2 ? 0.0 : uniform(random, 0, 0.4));
    ASSERT_FALSE(::testing::Test::HasFailure()) << round;
  }
}

/// Inverted tetrahedra, where bodies also end at faces within the mesh.
TEST(Path, AgreesWithSamplesForFoldedTetrahedralMeshes) {
  Random random(303);
  const Solid solid = cells(2, random);
  std::size_t withoutElement = 0;
  for (int round = 0; round < 60; ++round) {
    Both scene(solid);
    Positions folded = solid.positions;
    for (Vector3d& p : folded)
      if (uniform(random, 0, 1) < 0.4) p += randomPoint(random, -1.5, 1.5);
    scene.change([&](OctreeBasedCD& each) { each.setPositions(scene.id, folded); });
    for (int i = 0; i < 4; ++i) {
      const Positions path{randomPoint(random, -2, 4), randomPoint(random, 0, 2),
                           randomPoint(random, -2, 4)};
      const Answer found = expectSamples(scene, true, path, i % 2 ? 0.0 : uniform(random, 0, 0.05));
      for (const PathInterval& interval : found.inside)
        withoutElement += interval.enter > 0 && interval.entryElement == kNoElement;
    }
    ASSERT_FALSE(::testing::Test::HasFailure()) << round;
  }
  EXPECT_GT(withoutElement, 0u);
}

TEST(Path, AgreesWithSamplesForPlacedBodiesAndFarFromTheOrigin) {
  Random random(303);
  const TestGeometry ball = testGeometry(sphere(10, 14, {0.5, 0.5, 0.5}, 0.4));
  for (const double far : {0.0, 1e3, 1e7})
    for (int round = 0; round < 30; ++round) {
      Both scene(ball);
      const Matrix3d turn = randomTurn(random);
      const Vector3d shift = far * Vector3d(1, -2, 0.3) + randomPoint(random, -1, 1);
      const Positions now = placed(ball.positions, turn, shift),
                      path = placed(randomPath(random, 0.7, 2 + round % 4), turn, shift);
      scene.change([&](OctreeBasedCD& each) {
        if (round % 2)
          each.setTransform(scene.id, {turn, shift});
        else
          each.setPositions(scene.id, now);
      });
      const double radius = round % 3 ? uniform(random, 0, 0.1) : 0.0, size = 5.0 + 10 * far;
      const Answer found = expectSamples(scene, true, path, radius, size);
      expectEndsOnElements(ball, now, found, path, radius, size);
      ASSERT_FALSE(::testing::Test::HasFailure()) << far << ' ' << round;
    }
}

/// A case with an exact answer.
struct Known {
  Positions path;
  double radius;
  std::vector<std::pair<double, double>> intervals;
};

void expectKnown(const SpatialQueries& queries, GeometryId body, const Known& known,
                 double error = 0.0) {
  const Answer found = follow(queries, known.path, known.radius, {body});
  ASSERT_EQ(found.inside.size(), known.intervals.size());
  ASSERT_EQ(found.outside.size(), known.intervals.empty() ? 1u : 0u);
  for (std::size_t i = 0; i < found.inside.size(); ++i) {
    EXPECT_NEAR(found.inside[i].enter, known.intervals[i].first, error);
    EXPECT_NEAR(found.inside[i].leave, known.intervals[i].second, error);
  }
}

/// A mesh and the surface of a tetrahedral mesh, [0, 2]³ each. All coordinates are exact.
TEST(Path, KnownPathsThroughACube) {
  Random random(305);
  const Known cases[] = {
      {{{-1, 1, 1}, {3, 1, 1}}, 0.0, {{1, 3}}},
      {{{-1, 0.5, 1}, {3, 0.5, 1}}, 0.0, {{1, 3}}},
      {{{1, 1, 1}, {3, 1, 1}}, 0.0, {{0, 1}}},
      {{{-1, 1, 1}, {1, 1, 1}}, 0.0, {{1, 2}}},
      {{{1, 1, 1}, {1.5, 1, 1}}, 0.0, {{0, 0.5}}},
      // Starting and ending on the surface.
      {{{0, 1, 1}, {1, 1, 1}}, 0.0, {{0, 1}}},
      {{{0, 1, 1}, {2, 1, 1}}, 0.0, {{0, 2}}},
      {{{-1, 1, 1}, {0, 1, 1}}, 0.0, {}},
      {{{-1, 1, 1}, {0, 1, 1}, {-1, 1, 1}}, 0.0, {}},
      {{{-1, 1, 1}, {0, 1, 1}, {1, 1, 1}}, 0.0, {{1, 2}}},
      {{{1, 1, 1}, {2, 1, 1}, {1, 1, 1}}, 0.0, {{0, 2}}},
      // An edge touched from outside; along a face, along an edge.
      {{{-3, 3, 1}, {3, -3, 1}}, 0.0, {}},
      {{{-1, 1, 0}, {3, 1, 0}}, 0.0, {}},
      {{{-1, 0, 0}, {3, 0, 0}}, 0.0, {}},
      {{{-1, 1, 0}, {1, 1, 0}, {1, 1, 1}}, 0.0, {{2, 3}}},
      {{{1, 1, 1}, {1, 1, 0}, {1.5, 1, 0}, {1.5, 1, 1}}, 0.0, {{0, 2.5}}},
      {{{1, 1, 1}, {1, 1, 0}, {1.5, 1, 0}, {1.5, 1, -1}}, 0.0, {{0, 1}}},
      // Repeated points.
      {{{-1, 1, 1}, {-1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {3, 1, 1}, {3, 1, 1}}, 0.0, {{1, 3}}},
      {{{1, 1, 1}, {1, 1, 1}}, 0.0, {{0, 0}}},
      {{{3, 1, 1}, {3, 1, 1}}, 0.0, {}},
      {{{0, 1, 1}, {0, 1, 1}}, 0.0, {}},
      // A ball.
      {{{-1, 1, 1}, {3, 1, 1}}, 0.5, {{0.5, 3.5}}},
      {{{1, 1, 1}, {3, 1, 1}}, 0.5, {{0, 1.5}}},
      {{{1, 1, 1}, {1.25, 1, 1}}, 0.5, {{0, 0.25}}},
      {{{1, 1, 1}, {1.25, 1, 1}}, 5.0, {{0, 0.25}}},
      {{{-2, 1, 1}, {-1, 1, 1}, {-2, 1, 1}}, 0.5, {}},
      {{{-2, 1, 1}, {-0.25, 1, 1}, {-2, 1, 1}}, 0.5, {{1.5, 2.0}}},
      {{{2.25, 1, 1}, {2.25, 1, 1}}, 0.5, {{0, 0}}},
      {{{1, 1, 1}, {1, 1, 1}}, 0.5, {{0, 0}}},
      {{{3, 1, 1}, {3, 1, 1}}, 0.5, {}}};
  const Mesh mesh = cube(0, 2);
  const Solid solid = cells(2, random);
  for (const Engine engine : {Engine::Octree, Engine::BruteForce}) {
    OctreeBasedCD collisions(settingsOf(engine));
    const GeometryId surface = collisions.addTriangleMesh(mesh.positions, mesh.triangles),
                     body = collisions.addTetrahedralMesh(solid.positions, solid.tetrahedra);
    const SpatialQueries queries = collisions.queries();
    for (std::size_t i = 0; i < std::size(cases); ++i) {
      SCOPED_TRACE(i);
      expectKnown(queries, surface, cases[i]);
      expectKnown(queries, body, cases[i]);
    }
    const double diagonal = std::sqrt(3.0);
    for (const GeometryId id : {surface, body})
      expectKnown(queries, id, {{{-1, -1, -1}, {3, 3, 3}}, 0.0, {{diagonal, 3 * diagonal}}}, 1e-15);
  }
}

TEST(Path, EntryAndExitElementsAreThoseThatThePathMeets) {
  OctreeBasedCD collisions;
  const Mesh mesh = cube(0, 2);
  const GeometryId body = collisions.addTriangleMesh(mesh.positions, mesh.triangles);
  constexpr std::uint32_t none = kNoElement;
  const struct {
    Positions path;
    double radius;
    std::uint32_t entry, exit;
  } cases[] = {{{{-1, 0.5, 1}, {3, 0.5, 1.25}}, 0.0, 0, 3},
               {{{-1, 1, 1}, {3, 1, 1}}, 0.0, 0, 2},  // lowest of two
               {{{1, 0.5, 1}, {3, 0.5, 1.25}}, 0.0, none, 3},
               {{{-1, 0.5, 1}, {1, 0.5, 1}}, 0.0, 0, none},
               {{{1, 1, 1}, {1.5, 1, 1}}, 0.0, none, none},
               {{{0, 0.5, 1}, {1, 0.5, 1}}, 0.0, 0, none},
               {{{-1, 0.5, 1}, {3, 0.5, 1.25}}, 0.125, 0, 3},
               {{{1, 1, 1}, {1.5, 1, 1}}, 0.25, none, none},
               {{{-0.125, 0.5, 1}, {1, 0.5, 1}}, 0.25, none, none}};
  for (const auto& [path, radius, entry, exit] : cases) {
    const Answer found = follow(collisions.queries(), path, radius, {body});
    ASSERT_EQ(found.inside.size(), 1u);
    EXPECT_EQ(found.inside[0].entryElement, entry);
    EXPECT_EQ(found.inside[0].exitElement, exit);
  }
}

TEST(Path, KnownPathsThroughNestedAndOverlappingBodies) {
  OctreeBasedCD collisions;
  const auto add = [&](const Mesh& mesh) {
    return collisions.addTriangleMesh(mesh.positions, mesh.triangles);
  };
  const GeometryId hollow = add(joined(cube(0, 4), insideOut(cube(1, 3)))),
                   twice = add(joined(cube(0, 4), cube(1, 3))),
                   overlapping = add(joined(cube(0, 2), cube(1, 3))),
                   glued = add(joined(cube(0, 2), boxMesh({2, 0, 0}, {4, 2, 2})));
  const SpatialQueries queries = collisions.queries();
  expectKnown(queries, hollow, {{{-1, 2, 2}, {5, 2, 2}}, 0.0, {{1, 2}, {4, 5}}});
  expectKnown(queries, hollow, {{{-1, 2, 2}, {5, 2, 2}}, 0.25, {{0.75, 2.25}, {3.75, 5.25}}});
  expectKnown(queries, hollow, {{{2, 2, 2}, {2.5, 2, 2}}, 0.0, {}});
  expectKnown(queries, hollow, {{{2, 2, 2}, {2.5, 2, 2}}, 0.25, {}});
  expectKnown(queries, twice, {{{-1, 2, 2}, {5, 2, 2}}, 0.0, {{1, 5}}});
  expectKnown(queries, twice, {{{-1, 2, 2}, {5, 2, 2}}, 0.25, {{0.75, 5.25}}});
  expectKnown(queries, overlapping, {{{-1, 1.5, 1.5}, {4, 1.5, 1.5}}, 0.0, {{1, 4}}});
  expectKnown(queries, overlapping, {{{-1, 1.5, 1.5}, {4, 1.5, 1.5}}, 0.25, {{0.75, 4.25}}});
  // Two faces lie on each other at x = 2.
  expectKnown(queries, glued, {{{-1, 1, 1}, {5, 1, 1}}, 0.0, {{1, 5}}});
  expectKnown(queries, glued, {{{1, 1, 1}, {2, 1, 1}, {2, 1, 1.5}, {3, 1, 1.5}}, 0.0, {{0, 2.5}}});
}

TEST(Path, MeshesWithoutInsideHoldThePathWhereItTouchesThem) {
  OctreeBasedCD collisions;
  const Positions triangle{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}};
  const GeometryId open = collisions.addTriangleMesh(triangle, std::vector<Triangle>{{0, 1, 2}}),
                   line = collisions.addLineMesh(Positions{{0, 0, 0}, {4, 0, 0}},
                                                 std::vector<Segment>{{0, 1}}, 0.5),
                   points = collisions.addPointSet(Positions{{1, 0, 0}, {3, 0, 0}}, 0.0);
  const SpatialQueries queries = collisions.queries();
  expectKnown(queries, open, {{{1, 1, 3}, {1, 1, -3}}, 0.0, {{3, 3}}});
  expectKnown(queries, open, {{{1, 1, 3}, {1, 1, -3}}, 0.5, {{2.5, 3.5}}});
  expectKnown(queries, open, {{{1, 1, 3}, {1, 1, 0}, {1, 1, 3}}, 0.0, {{3, 3}}});
  expectKnown(queries, open, {{{-1, 1, 0}, {5, 1, 0}}, 0.0, {{1, 4}}});
  expectKnown(queries, open, {{{1, 1, 3}, {1, 1, 1}}, 0.0, {}});
  expectKnown(queries, line, {{{1, 3, 0}, {1, -3, 0}}, 0.0, {{2.5, 3.5}}});
  expectKnown(queries, line, {{{1, 3, 0}, {1, -3, 0}}, 0.5, {{2, 4}}});
  expectKnown(queries, line, {{{-2, 0, 0}, {6, 0, 0}}, 0.0, {{1.5, 6.5}}});
  expectKnown(queries, points, {{{-2, 0, 0}, {6, 0, 0}}, 0.0, {{3, 3}, {5, 5}}});
  expectKnown(queries, points, {{{-2, 0, 0}, {6, 0, 0}}, 0.5, {{2.5, 3.5}, {4.5, 5.5}}});
  expectKnown(queries, points, {{{-2, 0, 0}, {6, 0, 0}}, 1.0, {{2, 6}}});
}

/// A needle that is planned to a point on the surface, as closestPoint() or firstHit() give it,
/// turns there. Its direction is rounded, so that a ray along it may end before the surface.
TEST(Path, PathsThatTurnOnTheSurfaceEnterThere) {
  Random random(306);
  const Mesh ball = sphere(10, 14, {0.5, 0.5, 0.5}, 0.4);
  TestGeometry open = testGeometry(ball);
  open.triangles.erase(open.triangles.begin());
  Both scene;
  const GeometryId closed = scene.add(ball), holed = scene.add(open);
  const SpatialQueries queries = scene.octree.queries();
  for (int round = 0; round < 500; ++round) {
    const double far = std::pow(10.0, uniform(random, 0, 6));
    const Vector3d inner(0.5, 0.5, 0.5);
    const Vector3d side = inner + randomPoint(random, -1, 1).normalized();
    const auto nearest = queries.closestPoint(holed, side);
    if (nearest->weights.minCoeff() < 1e-3) continue;  // it may be beside the hole
    const Vector3d on = nearest->position;
    const Positions path{on + far * (side - inner), on, inner};
    const double length = (path[0] - on).norm();
    for (const auto& [body, leave] :
         {std::pair(closed, length + (on - inner).norm()), std::pair(holed, length)}) {
      const Answer found = follow(queries, path, 0.0, {body});
      ASSERT_EQ(found.inside.size(), 1u) << round;
      EXPECT_NEAR(found.inside[0].enter, length, 1e-12 * far) << round;
      EXPECT_NEAR(found.inside[0].leave, leave, 1e-12 * far) << round;
      EXPECT_NE(found.inside[0].entryElement, kNoElement) << round;
    }
  }
}

TEST(Path, OrdersIntervalsByEntryAndClearancesByBody) {
  OctreeBasedCD collisions;
  const auto add = [&](double low, double high) {
    const Mesh mesh = cube(low, high);
    return collisions.addTriangleMesh(mesh.positions, mesh.triangles);
  };
  const GeometryId far = add(10, 11), right = add(1, 3), left = add(0, 2), same = add(0, 2),
                   ball = collisions.addAnalyticalGeometry(Sphere{{-1, 4, 1}, 1}),
                   none = collisions.addPointSet(Positions{});
  const SpatialQueries queries = collisions.queries();
  const Answer found =
      follow(queries, {{-1, 1.5, 1.5}, {4, 1.5, 1.5}}, 0.0, {far, right, left, same, ball, none});
  ASSERT_EQ(found.inside.size(), 3u);
  EXPECT_EQ(found.inside[0].body, left);
  EXPECT_EQ(found.inside[1].body, same);
  EXPECT_EQ(found.inside[2].body, right);
  ASSERT_EQ(found.outside.size(), 3u);
  EXPECT_EQ(found.outside[0].body, far);
  EXPECT_DOUBLE_EQ(found.outside[0].distance, std::sqrt(36 + 2 * 8.5 * 8.5));
  EXPECT_EQ(found.outside[0].at, 5.0);
  EXPECT_EQ(found.outside[1].body, ball);
  EXPECT_DOUBLE_EQ(found.outside[1].distance, std::sqrt(2.5 * 2.5 + 0.25) - 1);
  EXPECT_EQ(found.outside[1].at, 0.0);
  EXPECT_EQ(found.outside[1].nearest.element, kNoElement);
  EXPECT_EQ(found.outside[2].body, none);
  EXPECT_EQ(found.outside[2].distance, kInfinity);
  EXPECT_EQ(found.outside[2].nearest.element, kNoElement);
  const Answer again = follow(queries, {{-1, 1.5, 1.5}, {4, 1.5, 1.5}}, 0.0, {same, left});
  EXPECT_EQ(again.inside[0].body, same);
}

TEST(Path, BadCallsThrowErrorsThatNameThemAndChangeNothing) {
  OctreeBasedCD collisions;
  const Mesh mesh = cube(0, 2);
  const GeometryId body = collisions.addTriangleMesh(mesh.positions, mesh.triangles);
  const SpatialQueries queries = collisions.queries();
  const Positions path{{-1, 1, 1}, {3, 1, 1}}, point{{0, 0, 0}};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Answer answer = follow(queries, path, 0.0, {body});
  const Answer missed = follow(queries, {{-1, 1, 1}, {-2, 1, 1}}, 0.0, {body});
  answer.outside = missed.outside;
  const Answer before = answer;
  const auto refused = [&](ErrorCode code, const char* words, const Positions& along, double radius,
                           std::vector<GeometryId> bodies) {
    expectRefused(code, words,
                  [&] { queries.path(along, radius, bodies, answer.inside, answer.outside); });
    EXPECT_TRUE(areEqual(answer, before));
  };
  using enum ErrorCode;
  refused(InvalidSettings, "radius is -1", path, -1.0, {body});
  refused(InvalidSettings, "radius is nan", path, nan, {body});
  refused(InvalidSettings, "radius is inf", path, kInfinity, {body});
  refused(InvalidSettings, "the path has 1 points", point, 0.0, {body});
  refused(InvalidSettings, "the path has 0 points", {}, 0.0, {body});
  refused(NonFinitePosition, "point 1 of the path is (nan, 0, 0)", {{0, 0, 0}, {nan, 0, 0}}, 0.0,
          {body});
  refused(NonFinitePosition, "point 0 of the path is (-1e+308", {{-1e308, 0, 0}, {1, 0, 0}}, 0.0,
          {body});
  refused(InvalidSettings, "radius is 1e+308", path, 1e308, {body});
  refused(UnknownGeometry, "geometry 7", path, 0.0, {body, GeometryId{7}});
  queries.path(path, 0.0, {}, answer.inside, answer.outside);
  EXPECT_TRUE(answer.inside.empty());
  EXPECT_TRUE(answer.outside.empty());
  collisions.setPositions(body, mesh.positions);
  expectRefused(InvalidCall, "outdated",
                [&] { queries.path(path, 0.0, {}, answer.inside, answer.outside); });
}

}  // namespace
}  // namespace palpate::testing
