#include "Common/ExpectRefused.h"
#include "Unit/Queries/EveryQuery.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <vector>

// Invalid calls of queries throw the documented error, name what is wrong, and leave the caller's
// vectors unchanged.
namespace palpate::testing {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

const Vector3d kPoint(0.1, 0.2, 0.3);
const Ray kRay{{0, 0, 3}, {0, 0, -1}};

/// Expects that a query is refused, and that its answers are as they were.
void expectUnanswered(const QueryCall& call, ErrorCode code, const std::string& words,
                      const SpatialQueries& queries, GeometryId id) {
  SCOPED_TRACE(call.name);
  const QueryAnswers before{};
  QueryAnswers answers = before;
  expectRefused(code, words, [&] { call.ask(queries, id, kPoint, kRay, answers); });
  EXPECT_TRUE(isSame(answers, before));
}

/// A closed ball, a shape, a line mesh and an open sheet.
struct ErrorScene {
  ErrorScene() {
    const Mesh whole = sphere(6, 8, {0, 0, 0}, 1), open = sheet(2, 0, 0);
    rest = whole.positions;
    ball = collisions.addTriangleMesh(whole.positions, whole.triangles);
    shape = collisions.addAnalyticalGeometry(Sphere{{0, 0, 0}, 1});
    line = collisions.addLineMesh(open.positions, std::vector<Segment>{{0, 1}, {1, 2}}, 0.1);
    sheetMesh = collisions.addTriangleMesh(open.positions, open.triangles);
    removed = collisions.addPointSet(open.positions);
    collisions.removeGeometry(removed);
  }
  OctreeBasedCD collisions;
  GeometryId ball, shape, line, sheetMesh, removed;
  Positions rest;
};

using enum ErrorCode;

TEST(QueryErrors, ValidCallsThrowNothing) {
  const ErrorScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  QueryAnswers answers;
  for (const QueryCall& call : queryCalls()) {
    SCOPED_TRACE(call.name);
    EXPECT_NO_THROW(call.ask(queries, scene.ball, kPoint, kRay, answers));
    if (call.needs == Needs::Nothing) {
      EXPECT_NO_THROW(call.ask(queries, scene.shape, kPoint, kRay, answers));
    }
  }
}

TEST(QueryErrors, UnknownAndRemovedGeometries) {
  const ErrorScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  for (const QueryCall& call : queryCalls()) {
    expectUnanswered(call, UnknownGeometry, "geometry 99", queries, GeometryId{99});
    expectUnanswered(call, UnknownGeometry, "geometry 4", queries, scene.removed);
  }
}

TEST(QueryErrors, ShapesAndBodiesWithoutInside) {
  const ErrorScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  for (const QueryCall& call : queryCalls()) {
    const bool hasSides = call.needs >= Needs::Triangles;
    if (call.needs > Needs::Nothing)
      expectUnanswered(call, hasSides ? NotClosed : UnsupportedMethod, "geometry 1 is a shape",
                       queries, scene.shape);
    if (hasSides)
      expectUnanswered(call, NotClosed, "geometry 2 is a line mesh", queries, scene.line);
    if (call.needs == Needs::Inside)
      expectUnanswered(call, NotClosed, "geometry 3 has no inside", queries, scene.sheetMesh);
  }
  const TestGeometry empty;
  OctreeBasedCD other;
  const GeometryId none = empty.addTo(other);
  EXPECT_FALSE(other.queries().contains(none, {0, 0, 0}));
  expectRefused(NotClosed, "geometry 0 has no triangles", [&] {
    other.queries().signedDistance(none, {0, 0, 0});
  });
}

TEST(QueryErrors, OutdatedQueries) {
  ErrorScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  scene.collisions.setPositions(scene.ball, scene.rest);
  for (const QueryCall& call : queryCalls())
    expectUnanswered(call, InvalidCall, "call queries() again", queries, scene.ball);
  expectRefused(InvalidCall, "call queries() again", [&] { queries.firstHit(kRay); });
  expectRefused(InvalidCall, "call queries() again", [&] { queries.pick(kRay); });
}

TEST(QueryErrors, Points) {
  const ErrorScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  const Vector3d good(0, 0, 0);
  std::vector<SurfacePoint> points(2);
  std::vector<SignedDistance> distances(2);
  std::vector<std::uint32_t> elements(2);
  for (const double x : {kNan, kInfinity, -kInfinity})
    for (int axis = 0; axis < 3; ++axis) {
      Vector3d bad = good;
      bad[axis] = x;
      const Positions both{good, bad};
      const auto refused = [&](auto&& call) {
        expectRefused(NonFinitePosition, "the query's point is (", call);
      };
      const auto refusedAt1 = [&](auto&& call) {
        expectRefused(NonFinitePosition, "point 1 is (", call);
      };
      refused([&] { queries.closestPoint(scene.ball, bad); });
      refusedAt1([&] { queries.closestPoints(scene.ball, both, points); });
      refused([&] { queries.nearestElements(scene.ball, bad, 1, points); });
      refused([&] { queries.elementsWithin(scene.ball, bad, 1, elements); });
      refused([&] { (void)queries.contains(scene.ball, bad); });
      refused([&] { queries.signedDistance(scene.ball, bad); });
      refusedAt1([&] { queries.signedDistances(scene.ball, both, distances); });
    }
  for (const double length : {-1.0, -5e-324, kNan}) {
    const auto refused = [&](const char* name, auto&& call) {
      expectRefused(InvalidSettings, std::string(name) + " is ", call);
    };
    refused("maxDistance", [&] { queries.closestPoint(scene.ball, good, length); });
    refused("maxDistance",
            [&] { queries.closestPoints(scene.ball, Positions(2, good), points, length); });
    refused("maxDistance", [&] { queries.nearestElements(scene.ball, good, 1, points, length); });
    refused("radius", [&] { queries.elementsWithin(scene.ball, good, length, elements); });
  }
  expectRefused(InvalidSettings, "maxDistance is nan; it must be a number of at least 0",
                [&] { queries.closestPoint(scene.ball, good, kNan); });
  expectRefused(InvalidSettings, "radius is inf",
                [&] { queries.elementsWithin(scene.ball, good, kInfinity, elements); });
  for (const int k : {0, -1, std::numeric_limits<int>::min()})
    expectRefused(InvalidSettings, "k is " + std::to_string(k),
                  [&] { queries.nearestElements(scene.ball, good, k, points); });
  for (const double margin : {-0.1, 0.5, kNan})
    expectRefused(InvalidSettings, "margin is", [&] {
      (void)queries.contains(scene.ball, good, {InsideRule::WindingNumber, margin});
    });
  expectRefused(InvalidSettings, "rule is 9", [&] {
    queries.signedDistance(scene.ball, good, {static_cast<InsideRule>(9), 0.0});
  });
  EXPECT_TRUE(points.size() == 2 && elements.size() == 2);
}

TEST(QueryErrors, Rays) {
  const ErrorScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  std::vector<RayHit> hits(1), both(2);
  const auto refused = [&](ErrorCode code, const std::string& words, const Ray& ray) {
    expectRefused(code, "the ray has " + words, [&] { queries.firstHit(scene.ball, ray); });
    expectRefused(code, words, [&] { queries.firstHit(scene.shape, ray); });
    expectRefused(code, words, [&] { queries.firstHit(ray); });
    expectRefused(code, words, [&] { (void)queries.anyHit(scene.ball, ray); });
    const Ray rays[] = {{{0, 0, 0}, {1, 0, 0}}, ray};
    expectRefused(code, "ray 1 has " + words, [&] { queries.firstHits(scene.ball, rays, both); });
    expectRefused(code, words, [&] { queries.allHits(scene.ball, ray, hits); });
    expectRefused(code, words, [&] { queries.pick(ray); });
    expectRefused(code, words, [&] { queries.pick(ray, true); });
  };
  for (const double x : {kNan, kInfinity}) {
    refused(NonFinitePosition, "origin (", {{0, x, 0}, {1, 0, 0}});
    refused(NonFinitePosition, "origin (", {{0, 0, 0}, {1, 0, x}});
    refused(InvalidSettings, "tMin", {{0, 0, 0}, {1, 0, 0}, x});
    refused(InvalidSettings, "tMin", {{0, 0, 0}, {1, 0, 0}, -x});
  }
  refused(InvalidSettings, "tMin 0 and tMax nan", {{0, 0, 0}, {1, 0, 0}, 0, kNan});
  refused(InvalidSettings, "tMin 2 and tMax 1", {{0, 0, 0}, {1, 0, 0}, 2, 1});
  refused(InvalidSettings, "a direction of length 0", {{0, 0, 0}, {0, 0, 0}});
  refused(InvalidSettings, "a direction of length 0", {{0, 0, 0}, {-0.0, 0, 0}});
  EXPECT_EQ(hits.size(), 1u);
}

TEST(QueryErrors, Shapes) {
  const ErrorScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  std::vector<std::uint32_t> elements{7};
  std::vector<ShapeContact> contacts(1);
  const Matrix3d unit = Matrix3d::Identity();
  const Vector3d zero(0, 0, 0);
  const auto refused = [&](ErrorCode code, const std::string& words, const AnalyticalGeometry& s,
                           const Matrix3d& r, const Vector3d& t) {
    expectRefused(code, words, [&] { queries.overlapping(scene.ball, s, {r, t}, elements); });
    expectRefused(code, words, [&] { queries.contacts(scene.ball, s, {r, t}, 0.1, contacts); });
  };
  const std::string place = "the query's shape: ";
  const Sphere ball{zero, 1};
  refused(InvalidShape, place + "radius is -1", Sphere{zero, -1}, unit, zero);
  refused(InvalidShape, place + "centre is", Sphere{{0, kNan, 0}, 1}, unit, zero);
  refused(InvalidShape, place + "halfExtents", Box{zero, {1, -1, 1}}, unit, zero);
  refused(InvalidShape, place + "p1", Cylinder{zero, zero, 1}, unit, zero);
  refused(InvalidShape, place + "normal", Plane{zero, zero}, unit, zero);
  refused(InvalidShape, place + "the hull has no points", ConvexHull{}, unit, zero);
  refused(InvalidTransform, place + "rotation", ball, 2 * unit, zero);
  refused(InvalidTransform, place + "rotation", ball, -unit, zero);
  refused(InvalidTransform, place + "translation", ball, unit, {0, 0, kInfinity});
  for (const double thickness : {-1.0, kNan, kInfinity})
    expectRefused(InvalidSettings, "thickness is", [&] {
      queries.contacts(scene.ball, ball, {unit, zero}, thickness, contacts);
    });
  EXPECT_TRUE(elements == std::vector<std::uint32_t>{7} && contacts.size() == 1);
}

TEST(QueryErrors, Batches) {
  const ErrorScene scene;
  const SpatialQueries queries = scene.collisions.queries();
  std::vector<SurfacePoint> points(2);
  std::vector<SignedDistance> distances(2);
  std::vector<RayHit> hits(2);
  const Positions three(3, Vector3d(0, 0, 0));
  const std::vector<Ray> rays(3, Ray{{0, 0, 0}, {1, 0, 0}});
  const std::string words = "3 points, but room for 2 answers";
  expectRefused(InvalidSettings, words, [&] { queries.closestPoints(scene.ball, three, points); });
  expectRefused(InvalidSettings, words,
                [&] { queries.signedDistances(scene.ball, three, distances); });
  expectRefused(InvalidSettings, "3 rays, but room for 2 answers",
                [&] { queries.firstHits(scene.ball, rays, hits); });
}

TEST(QueryErrors, TwoGeometries) {
  ErrorScene scene;
  const GeometryId plane = scene.collisions.addAnalyticalGeometry(Plane{}),
                   other =
                       scene.collisions.addAnalyticalGeometry(Plane{{0, 0, 0}, {1, 0, 0}, true});
  const SpatialQueries queries = scene.collisions.queries();
  const GeometryId ball = scene.ball, line = scene.line;
  std::vector<InsideVertex> inside(1);
  std::vector<EmbeddedVertex> embedded(1);
  const auto distance = [&](GeometryId a, GeometryId b) {
    return [&, a, b] { queries.distance(a, b); };
  };
  const auto findInside = [&](GeometryId a, GeometryId b, const InsideSettings& settings) {
    return [&, a, b, settings] { queries.findInsideVertices(a, b, inside, settings); };
  };
  const auto findEmbedded = [&](GeometryId a, GeometryId b) {
    return [&, a, b] { queries.findEmbeddedVertices(a, b, embedded); };
  };
  const auto byNumber = [](double margin) {
    return InsideSettings{InsideRule::WindingNumber, margin};
  };
  const std::string both = "geometry 0 is both the body and the owner of the vertices";
  const struct {
    ErrorCode code;
    std::string words;
    std::function<void()> call;
  } rows[] = {
      {InvalidSettings, "geometry 0 twice", distance(ball, ball)},
      {UnsupportedMethod, "both planes", distance(plane, other)},
      {UnknownGeometry, "geometry 9", distance(ball, GeometryId{9})},
      {InvalidSettings, "margin is -0.1", findInside(line, ball, byNumber(-0.1))},
      {InvalidSettings, "margin is 0.5", findInside(line, ball, byNumber(0.5))},
      {InvalidSettings, "margin is nan", findInside(line, ball, byNumber(kNan))},
      {InvalidSettings, "rule is 7", findInside(line, ball, {static_cast<InsideRule>(7), 0})},
      {NotClosed, "geometry 2 is a line mesh", findInside(ball, line, byNumber(0))},
      {InvalidSettings, both, findInside(ball, ball, byNumber(0))},
      {InvalidSettings, both, findEmbedded(ball, ball)},
      {UnsupportedMethod, "geometry 2 is a line mesh; findEmbeddedVertices() is for tetrahedral",
       findEmbedded(ball, line)},
      {UnsupportedMethod, "geometry 2 is a line mesh; findTetrahedron() is for tetrahedral meshes",
       [&] { queries.findTetrahedron(line, Vector3d::Zero()); }},
  };
  for (const auto& [code, words, call] : rows) expectRefused(code, words, call);
  EXPECT_TRUE(inside.size() == 1 && embedded.size() == 1);
}

}  // namespace
}  // namespace palpate::testing
