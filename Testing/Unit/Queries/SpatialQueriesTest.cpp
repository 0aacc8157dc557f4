#include "Common/ExpectRefused.h"
#include "Common/FailingAllocation.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Queries/EveryQuery.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

// Validity of SpatialQueries, and the threads and callbacks that may call them. Many threads ask at
// once and get the answers of one. Repeated single calls allocate nothing. Invalid calls throw the
// documented error, name what is wrong, and leave the caller's vectors unchanged. The tests of each
// query compare its results with brute force.
namespace palpate::testing {
namespace {

void expectInvalidQuery(const QueryScene& scene, const SpatialQueries& queries,
                        const std::string& words) {
  expectRefused(ErrorCode::InvalidCall, words, [&] {
    (void)queries.findTetrahedron(scene.solid, {0, 0, 0});
  });
}

TEST(SpatialQueries, AreInvalidAfterAnyChangeOfTheirGeometries) {
  const std::vector<std::pair<std::string, std::function<void(QueryScene&)>>> changes{
      {"setPositions", [](QueryScene& s) { s.collisions.setPositions(s.ball, s.rest); }},
      {"setTransform",
       [](QueryScene& s) {
         s.collisions.setTransform(s.ball, {.translation = {0, 0, 0.1}});
       }},
      {"setTriangles",
       [](QueryScene& s) { s.collisions.setTriangles(s.ball, s.rest, s.triangles); }},
      {"add", [](QueryScene& s) { s.collisions.addPointSet(s.probes); }},
      {"addAnalyticalGeometry",
       [](QueryScene& s) { s.collisions.addAnalyticalGeometry(Sphere{}); }},
      {"remove", [](QueryScene& s) { s.collisions.removeGeometry(s.line); }},
      {"advance", [](QueryScene& s) { s.collisions.advance(); }}};
  for (const auto& [name, change] : changes) {
    SCOPED_TRACE(name);
    QueryScene scene;
    const SpatialQueries queries = scene.collisions.queries();
    EXPECT_TRUE(queries.findTetrahedron(scene.solid, {0.1, 0.1, 0.1}));
    change(scene);
    expectInvalidQuery(scene, queries, "call queries() again");
    // Queries that are requested now are valid. The earlier ones stay outdated.
    EXPECT_TRUE(scene.collisions.queries().findTetrahedron(scene.solid, {0.1, 0.1, 0.1}));
    expectInvalidQuery(scene, queries, "call queries() again");
  }
}

TEST(SpatialQueries, StayValidThroughDetectionsAndPairs) {
  QueryScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  const std::vector<QueryAnswers> before = ask(scene, queries);
  OctreeBasedCD& collisions = scene.collisions;
  const std::vector<std::function<void()>> calls{
      [&] {
        collisions.addCollisionPair(scene.points, scene.ball, {Method::Proximity, 0.1});
      },
      [&] { collisions.detectCollision(); },
      [&] { collisions.forEachCandidate([](auto&&...) {}); },
      [&] { collisions.update(); },
      [&] {
        collisions.setContactPredicate(
            scene.points, scene.ball,
            [](const ContactFeatures&) -> bool { throw std::runtime_error("no"); });
      },
      [&] { EXPECT_THROW(collisions.detectCollision(), std::runtime_error); },
      [&] {
        collisions.setDisabledElements(scene.ball, std::vector<std::uint32_t>{0, 1, 2});
      },
      [&] {
        collisions.setCollisionFilter(scene.ball, {2, 4});
      },
      [&] { collisions.detectCollision(); },
      [&] { collisions.removeCollisionPair(scene.points, scene.ball); },
      [&] { EXPECT_THROW(collisions.setPositions(scene.ball, scene.probes), Error); },
      [&] { (void)collisions.queries(); }};
  for (const auto& call : calls) {
    call();
    EXPECT_TRUE(isSame(ask(scene, queries), before));
  }
  const SpatialQueries copy = queries;
  EXPECT_TRUE(isSame(ask(scene, copy), before));
}

TEST(SpatialQueries, MayOutliveAndMoveWithTheirOwner) {
  std::optional<QueryScene> scene(std::in_place);
  const SpatialQueries queries = scene->collisions.queries();
  const std::vector<QueryAnswers> before = ask(*scene, queries);
  OctreeBasedCD moved = std::move(scene->collisions);
  EXPECT_TRUE(isSame(ask(*scene, queries), before));
  { const OctreeBasedCD last = std::move(moved); }
  expectInvalidQuery(*scene, queries, "queries()");
  SpatialQueries empty = queries;
  const SpatialQueries taken = std::move(empty);
  expectInvalidQuery(*scene, empty, "moved from");
}

TEST(SpatialQueries, ThrowWithinACallbackOfTheirOwner) {
  QueryScene scene;
  OctreeBasedCD& collisions = scene.collisions;
  collisions.addCollisionPair(scene.points, scene.ball, {Method::Proximity, 0.2});
  const SpatialQueries queries = collisions.queries();
  collisions.setContactPredicate(scene.points, scene.ball, [&](const ContactFeatures&) {
    return queries.findTetrahedron(scene.solid, {0.1, 0.1, 0.1}).has_value();
  });
  expectRefused(ErrorCode::InvalidCall, "predicate or callback",
                [&] { collisions.detectCollision(); });
  collisions.setContactPredicate(scene.points, scene.ball, {});
  collisions.detectCollision();
  ask(scene, queries);
}

/// Outdated queries throw, also while another thread updates the octrees.
TEST(SpatialQueries, OutdatedOnesThrowBesideNewOnes) {
  QueryScene scene;
  for (int repeat = 0; repeat < 20; ++repeat) {
    const SpatialQueries old = scene.collisions.queries();
    Positions moved = scene.rest;
    for (Vector3d& p : moved) p.x() += 1e-3 * repeat;
    scene.collisions.setPositions(scene.ball, moved);
    const std::jthread updating([&] { (void)scene.collisions.queries(); });
    for (int i = 0; i < 50; ++i) expectInvalidQuery(scene, old, "queries() again");
  }
}

TEST(QueryThreads, ManyThreadsGetTheAnswersOfOne) {
  constexpr int kProbes = casesOf(60);
  const QueryScene alone(settingsOf(Engine::Octree), kProbes);
  const std::vector<QueryAnswers> expected = ask(alone, alone.collisions.queries());
  for (const int threads : {1, 3}) {
    QueryScene scene(settingsOf(Engine::Octree, threads), kProbes);
    for (int repeat = 0; repeat < 3; ++repeat) {
      std::vector<std::vector<QueryAnswers>> answers(4);
      {
        std::vector<std::jthread> askers;
        for (auto& each : answers)
          askers.emplace_back([&] { each = ask(scene, scene.collisions.queries()); });
      }
      for (const auto& each : answers) EXPECT_TRUE(isSame(each, expected));
      scene.collisions.setPositions(scene.ball, scene.rest);  // the next ones update the octree
      scene.collisions.advance();
    }
  }
}

/// Scratch and the caller's vectors keep their capacity.
TEST(QueryAllocations, RepeatedSingleCallsAllocateNothing) {
  Random random(802);
  const QueryScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  std::vector<AnalyticalGeometry> shapes = shapesOfEveryKind(random);
  shapes.resize(7);  // another box or hull allocates again
  shapes.insert(shapes.end(), {Sphere{{0, 0, 0}, 0.1}, Capsule{{-0.2, 0, 0}, {0.1, 0, 0}, 0.05},
                               Cylinder{{-0.1, 0, 0}, {0.1, 0, 0}, 0.0}});
  QueryAnswers answers;
  const auto expectNone = [&](const std::string& name, const auto& run) {
    run();
    FailingAllocation::arm(0);
    run();
    FailingAllocation::disarm();
    EXPECT_EQ(FailingAllocation::count(), 0u) << name;
  };
  scene.forEachCall([&](const QueryCall& call, GeometryId id) {
    if (call.isBatch) return;
    expectNone(call.name, [&] {
      for (std::size_t i = 0; i < scene.probes.size(); ++i)
        call.ask(queries, id, scene.probes[i], scene.rays[i], answers);
    });
  });
  expectNone("all geometries", [&] {
    for (const Ray& ray : scene.rays) {
      answers.firstOfAll = queries.firstHit(ray);
      answers.pick = queries.pick(ray);
      answers.pickOfFrontFaces = queries.pick(ray, true);
    }
  });
  expectNone("shapes in turn", [&] {
    for (const Vector3d& p : scene.probes)
      for (const GeometryId id : {scene.ball, scene.solid, scene.open, scene.line, scene.points})
        for (const AnalyticalGeometry& shape : shapes) {
          queries.contacts(id, shape, {Matrix3d::Identity(), p}, 0.05, answers.contacts);
          queries.overlapping(id, shape, {Matrix3d::Identity(), p}, answers.overlapping);
        }
  });
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

const Vector3d kPoint(0.1, 0.2, 0.3);
const Ray kRay{{0, 0, 3}, {0, 0, -1}};

/// Expects that a query is refused, and that its answers are as they were.
void expectUnanswered(const QueryCall& call, ErrorCode code, const std::string& words,
                      const SpatialQueries& queries, GeometryId id, const Vector3d& point = kPoint,
                      const Ray& ray = kRay) {
  SCOPED_TRACE(call.name);
  const QueryAnswers before{};
  QueryAnswers answers = before;
  expectRefused(code, words, [&] { call.ask(queries, id, point, ray, answers); });
  EXPECT_TRUE(isSame(answers, before));
}

bool asksRay(const QueryCall& call) {
  return call.name.ends_with("Hit") || call.name.ends_with("Hits");
}
bool asksShape(const QueryCall& call) {
  return call.name == "overlapping" || call.name == "contacts";
}

using enum ErrorCode;

TEST(QueryErrors, Geometries) {
  QueryScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  for (const QueryCall& call : queryCalls()) {
    expectUnanswered(call, UnknownGeometry, "geometry 99", queries, GeometryId{99});
    expectUnanswered(call, UnknownGeometry, "geometry 7", queries, scene.removed);
    const bool hasSides = call.needs >= Needs::Triangles;
    if (call.needs > Needs::Nothing)
      expectUnanswered(call, hasSides ? NotClosed : UnsupportedMethod, "geometry 6 is a shape",
                       queries, scene.shape);
    if (hasSides)
      expectUnanswered(call, NotClosed, "geometry 4 is a line mesh", queries, scene.line);
    if (call.needs == Needs::Inside)
      expectUnanswered(call, NotClosed, "geometry 3 has no inside", queries, scene.open);
  }
  OctreeBasedCD other;
  const GeometryId none = addTo(other, Mesh{});
  EXPECT_FALSE(other.queries().contains(none, {0, 0, 0}));
  expectRefused(NotClosed, "geometry 0 has no triangles", [&] {
    other.queries().signedDistance(none, {0, 0, 0});
  });
  scene.collisions.setPositions(scene.ball, scene.rest);
  for (const QueryCall& call : queryCalls())
    expectUnanswered(call, InvalidCall, "call queries() again", queries, scene.ball);
  expectRefused(InvalidCall, "call queries() again", [&] { queries.firstHit(kRay); });
  expectRefused(InvalidCall, "call queries() again", [&] { queries.pick(kRay); });
}

TEST(QueryErrors, PointsAndRays) {
  const QueryScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  const auto refused = [&](ErrorCode code, const std::string& words, const Ray& ray) {
    for (const QueryCall& call : queryCalls())
      for (const GeometryId id : {scene.ball, scene.shape})
        if (asksRay(call))
          expectUnanswered(call, code, (call.isBatch ? "ray 0 has " : "the ray has ") + words,
                           queries, id, kPoint, ray);
    expectRefused(code, words, [&] { queries.firstHit(ray); });
    expectRefused(code, words, [&] { queries.pick(ray); });
    expectRefused(code, words, [&] { queries.pick(ray, true); });
  };
  for (const double x : {kNan, kInfinity, -kInfinity}) {
    for (int axis = 0; axis < 3; ++axis) {
      Vector3d bad = kPoint;
      bad[axis] = x;
      for (const QueryCall& call : queryCalls()) {
        const std::string point = call.isBatch ? "point 0 is (" : "the query's point is (";
        if (!asksRay(call))
          expectUnanswered(call, asksShape(call) ? InvalidShape : NonFinitePosition,
                           asksShape(call) ? "the query's shape: " : point, queries, scene.ball,
                           bad);
      }
      refused(NonFinitePosition, "origin (", {bad, {1, 0, 0}});
      refused(NonFinitePosition, "origin (", {{0, 0, 0}, bad});
    }
    refused(InvalidSettings, "tMin", {{0, 0, 0}, {1, 0, 0}, x});
  }
  refused(InvalidSettings, "tMin 0 and tMax nan", {{0, 0, 0}, {1, 0, 0}, 0, kNan});
  refused(InvalidSettings, "tMin 2 and tMax 1", {{0, 0, 0}, {1, 0, 0}, 2, 1});
  refused(InvalidSettings, "a direction of length 0", {{0, 0, 0}, {0, 0, 0}});
  refused(InvalidSettings, "a direction of length 0", {{0, 0, 0}, {-0.0, 0, 0}});
}

TEST(QueryErrors, Shapes) {
  const QueryScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  std::vector<std::uint32_t> elements{7};
  std::vector<ShapeContact> contacts(1);
  const Matrix3d unit = Matrix3d::Identity();
  const Vector3d zero(0, 0, 0);
  const Sphere ball{zero, 1};
  const struct {
    ErrorCode code;
    std::string words;
    AnalyticalGeometry shape;
    Pose pose;
  } rows[] = {{InvalidShape, "radius is -1", Sphere{zero, -1}, {}},
              {InvalidShape, "centre is", Sphere{{0, kNan, 0}, 1}, {}},
              {InvalidShape, "halfExtents", Box{zero, {1, -1, 1}}, {}},
              {InvalidShape, "p1", Cylinder{zero, zero, 1}, {}},
              {InvalidShape, "normal", Plane{zero, zero}, {}},
              {InvalidShape, "the hull has no points", ConvexHull{}, {}},
              {InvalidTransform, "rotation", ball, {2 * unit, zero}},
              {InvalidTransform, "rotation", ball, {-unit, zero}},
              {InvalidTransform, "translation", ball, {unit, {0, 0, kInfinity}}}};
  for (const auto& row : rows) {
    const std::string all = "the query's shape: " + row.words;
    expectRefused(row.code, all,
                  [&] { queries.overlapping(scene.ball, row.shape, row.pose, elements); });
    expectRefused(row.code, all,
                  [&] { queries.contacts(scene.ball, row.shape, row.pose, 0.1, contacts); });
  }
  for (const double thickness : {-1.0, kNan, kInfinity})
    expectRefused(InvalidSettings, "thickness is",
                  [&] { queries.contacts(scene.ball, ball, {}, thickness, contacts); });
  EXPECT_TRUE(elements == std::vector<std::uint32_t>{7} && contacts.size() == 1);
}

InsideSettings windingRule(double margin) { return {InsideRule::WindingNumber, margin}; }

TEST(QueryErrors, Settings) {
  const QueryScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  const GeometryId ball = scene.ball, line = scene.line;
  std::vector<SurfacePoint> points(2);
  std::vector<std::uint32_t> elements(2);
  std::vector<InsideVertex> inside(1);
  for (const double length : {-1.0, -5e-324, kNan}) {
    expectRefused(InvalidSettings, "maxDistance is ",
                  [&] { queries.closestPoint(ball, kPoint, length); });
    expectRefused(InvalidSettings, "maxDistance is ",
                  [&] { queries.closestPoints(ball, Positions(2, kPoint), points, length); });
    expectRefused(InvalidSettings, "maxDistance is ",
                  [&] { queries.nearestElements(ball, kPoint, 1, points, length); });
    expectRefused(InvalidSettings, "radius is ",
                  [&] { queries.elementsWithin(ball, kPoint, length, elements); });
  }
  expectRefused(InvalidSettings, "maxDistance is nan; it must be a number of at least 0",
                [&] { queries.closestPoint(ball, kPoint, kNan); });
  expectRefused(InvalidSettings, "radius is inf",
                [&] { queries.elementsWithin(ball, kPoint, kInfinity, elements); });
  for (const int k : {0, -1, std::numeric_limits<int>::min()})
    expectRefused(InvalidSettings, "k is " + std::to_string(k),
                  [&] { queries.nearestElements(ball, kPoint, k, points); });
  for (const double margin : {-0.1, 0.5, kNan}) {
    expectRefused(InvalidSettings, "margin is ",
                  [&] { (void)queries.contains(ball, kPoint, windingRule(margin)); });
    expectRefused(InvalidSettings, "margin is ",
                  [&] { queries.findInsideVertices(line, ball, inside, windingRule(margin)); });
  }
  const InsideSettings badRule{static_cast<InsideRule>(9), 0.0};
  expectRefused(InvalidSettings, "rule is 9",
                [&] { queries.signedDistance(ball, kPoint, badRule); });
  expectRefused(InvalidSettings, "rule is 9",
                [&] { queries.findInsideVertices(line, ball, inside, badRule); });
  EXPECT_TRUE(points.size() == 2 && elements.size() == 2 && inside.size() == 1);
}

TEST(QueryErrors, BatchesAndTwoGeometries) {
  QueryScene scene;
  const GeometryId plane = addTo(scene.collisions, Plane{}),
                   other = addTo(scene.collisions, Plane{{0, 0, 0}, {1, 0, 0}, true});
  const SpatialQueries queries = scene.collisions.queries();
  const GeometryId ball = scene.ball, line = scene.line;
  const SurfacePoint point{ball, 7, {1, 2, 3}, {0, 1, 0}, {4, 5, 6}, 8.0};
  const RayHit hit{ball, 7, {1, 2, 3}, {0, 1, 0}, 4.0, true, true};
  std::vector<SurfacePoint> points(2, point);
  std::vector<SignedDistance> distances(2, {point, 9.0});
  std::vector<RayHit> hits(2, hit);
  std::vector<InsideVertex> inside(1);
  std::vector<EmbeddedVertex> embedded(1);
  const Positions two{kPoint, {0, kNan, 0}}, three(3, kPoint);
  const std::vector<Ray> twoRays{kRay, {{0, kNan, 0}, {1, 0, 0}}}, threeRays(3, kRay);
  const std::string room = "3 points, but room for 2 answers";
  expectRefused(InvalidSettings, room, [&] { queries.closestPoints(ball, three, points); });
  expectRefused(InvalidSettings, room, [&] { queries.signedDistances(ball, three, distances); });
  expectRefused(InvalidSettings, "3 rays, but room for 2 answers",
                [&] { queries.firstHits(ball, threeRays, hits); });
  expectRefused(NonFinitePosition, "point 1 is (",
                [&] { queries.closestPoints(ball, two, points); });
  expectRefused(NonFinitePosition, "point 1 is (",
                [&] { queries.signedDistances(ball, two, distances); });
  expectRefused(NonFinitePosition, "ray 1 has origin (",
                [&] { queries.firstHits(ball, twoRays, hits); });
  expectRefused(InvalidSettings, "geometry 0 twice", [&] { queries.distance(ball, ball); });
  expectRefused(UnsupportedMethod, "both planes", [&] { queries.distance(plane, other); });
  expectRefused(UnknownGeometry, "geometry 9", [&] { queries.distance(ball, GeometryId{99}); });
  expectRefused(NotClosed, "geometry 4 is a line mesh",
                [&] { queries.findInsideVertices(ball, line, inside, windingRule(0)); });
  const std::string both = "geometry 0 is both the body and the owner of the vertices";
  expectRefused(InvalidSettings, both,
                [&] { queries.findInsideVertices(ball, ball, inside, windingRule(0)); });
  expectRefused(InvalidSettings, both, [&] { queries.findEmbeddedVertices(ball, ball, embedded); });
  expectRefused(UnsupportedMethod,
                "geometry 4 is a line mesh; findEmbeddedVertices() is for tetrahedral",
                [&] { queries.findEmbeddedVertices(ball, line, embedded); });
  expectRefused(UnsupportedMethod,
                "geometry 4 is a line mesh; findTetrahedron() is for tetrahedral meshes",
                [&] { queries.findTetrahedron(line, Vector3d::Zero()); });
  EXPECT_TRUE(isSame(points, std::vector<SurfacePoint>(2, point)));
  EXPECT_TRUE(isSame(distances, std::vector<SignedDistance>(2, {point, 9.0})));
  EXPECT_TRUE(isSame(hits, std::vector<RayHit>(2, hit)));
  EXPECT_TRUE(inside.size() == 1 && embedded.size() == 1);
}

}  // namespace
}  // namespace palpate::testing
