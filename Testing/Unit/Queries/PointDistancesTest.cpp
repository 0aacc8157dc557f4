#include "Common/ExpectRefused.h"
#include "Common/Solids.h"
#include "Common/TestGeometry.h"
#include "Unit/Math/RationalOracle.h"

#include <palpate/OctreeBasedCD.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

// Closest points, nearest elements, elements within a radius and signed distances: the octree's
// answers are those of brute force, bit by bit, and those of rational arithmetic.
namespace palpate::testing {
namespace {

using oracle::Rational;

/// The same geometry searched by octrees, and by brute force.
struct Both {
  explicit Both(const TestGeometry& geometry) {
    for (OctreeBasedCD* each : {&octree, &bruteForce}) id = geometry.addTo(*each);
  }
  template <class F>
  void change(F&& f) {
    for (OctreeBasedCD* each : {&octree, &bruteForce}) f(*each);
  }

  OctreeBasedCD octree{settingsOf(Engine::Octree)}, bruteForce{settingsOf(Engine::BruteForce)};
  GeometryId id{};
};

bool isSame(const SurfacePoint& a, const SurfacePoint& b) {
  return a.geometry == b.geometry && a.element == b.element && a.vertices == b.vertices &&
         a.weights == b.weights && a.position == b.position && a.distance == b.distance;
}

/// Points near the geometry, around it and far away, and its own vertices and middles of edges.
Positions pointsAround(Random& random, const Positions& vertices, std::size_t count) {
  Positions points;
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3d &p = vertices[random() % vertices.size()],
                   &q = vertices[random() % vertices.size()];
    switch (i % 5) {
      case 0:
        points.push_back(p + randomPoint(random, -0.01, 0.01));
        break;
      case 1:
        points.push_back(randomPoint(random, -1, 2));
        break;
      case 2:
        points.push_back(p);
        break;
      case 3:
        points.push_back(0.5 * (p + q));
        break;
      default:
        points.push_back(randomPoint(random, -1e6, 1e6));
    }
  }
  return points;
}

void expectSameAnswers(const Both& both, std::span<const Vector3d> points) {
  const SpatialQueries fast = both.octree.queries(), truth = both.bruteForce.queries();
  std::vector<SurfacePoint> nearest, trueNearest;
  std::vector<std::uint32_t> within, trueWithin;
  for (const Vector3d& p : points) {
    const auto a = fast.closestPoint(both.id, p), b = truth.closestPoint(both.id, p);
    ASSERT_TRUE(a && b);
    ASSERT_TRUE(isSame(*a, *b)) << a->element << ' ' << b->element;
    const auto limited = fast.closestPoint(both.id, p, a->distance);
    ASSERT_EQ(limited.has_value(), a->distance >= 0);
    ASSERT_FALSE(a->distance > 0 &&
                 fast.closestPoint(both.id, p, std::nextafter(a->distance, 0) * (1 - 1e-14)));
    fast.nearestElements(both.id, p, 7, nearest);
    truth.nearestElements(both.id, p, 7, trueNearest);
    ASSERT_EQ(nearest.size(), trueNearest.size());
    for (std::size_t i = 0; i < nearest.size(); ++i)
      ASSERT_TRUE(isSame(nearest[i], trueNearest[i])) << i;
    ASSERT_TRUE(isSame(nearest[0], *a));
    const double radius = std::max(0.0, nearest.back().distance);
    fast.elementsWithin(both.id, p, radius, within);
    truth.elementsWithin(both.id, p, radius, trueWithin);
    ASSERT_EQ(within, trueWithin);
  }
  std::vector<SurfacePoint> batch(points.size());
  fast.closestPoints(both.id, points, batch);
  for (std::size_t i = 0; i < points.size(); ++i)
    ASSERT_TRUE(isSame(batch[i], *fast.closestPoint(both.id, points[i])));
}

TEST(PointDistances, OctreesAnswerAsBruteForceForEveryGeometryType) {
  Random random(101);
  const TestGeometry meshes[] = {testGeometry(sphere(20, 30, {0.5, 0.5, 0.5}, 0.4)),
                                 testGeometry(soup(random, 300, 0.1)),
                                 testGeometry(sheet(12, 0.5, 0.0)),
                                 thread(random, 200, 0.1, 0.01, true),
                                 tapered(random, thread(random, 200, 0.1, 0.01, false), 0.05),
                                 particles(random, 300, 0.02),
                                 tapered(random, particles(random, 300, 0.02), 0.1)};
  for (const TestGeometry& geometry : meshes) {
    Both both(geometry);
    expectSameAnswers(both, pointsAround(random, geometry.positions, 150));
    // Deformed: refitted trees; and over a whole step.
    const Positions now = moved(random, geometry.positions, 0.05);
    both.change([&](OctreeBasedCD& each) {
      each.addCollisionPair(both.id, both.id, {.thickness = 0.01});
      each.setPositions(both.id, geometry.positions, now);
    });
    expectSameAnswers(both, pointsAround(random, now, 150));
  }
}

TEST(PointDistances, OctreesAnswerAsBruteForceForPlacedBodies) {
  Random random(102);
  const TestGeometry ball = testGeometry(sphere(20, 30, {0.5, 0.5, 0.5}, 0.4));
  for (const double far : {0.0, 1e3, 1e12}) {
    Both both(ball);
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(1.1, Vector3d(1, -2, 3).normalized()).toRotationMatrix();
    const Vector3d shift(far, -2 * far, 0.3);
    both.change([&](OctreeBasedCD& each) { each.setTransform(both.id, turn, shift); });
    Positions world;
    for (const Vector3d& p : ball.positions) world.push_back(turn * p + shift);
    Positions points = pointsAround(random, world, 150);
    for (Vector3d& p : points)
      if (p.cwiseAbs().maxCoeff() < 3) p += shift;
    expectSameAnswers(both, points);
  }
}

/// Every coordinate is a small integer, so that many elements are equally near.
TEST(PointDistances, TiesGoToTheLowestElement) {
  Random random(103);
  TestGeometry grid;
  for (int i = 0; i < 60; ++i) {
    const auto first = static_cast<std::uint32_t>(grid.positions.size());
    for (int corner = 0; corner < 3; ++corner)
      grid.positions.push_back(Vector3d(static_cast<double>(random() % 4),
                                        static_cast<double>(random() % 4),
                                        static_cast<double>(random() % 4)));
    grid.triangles.push_back({first, first + 1, first + 2});
  }
  Both both(grid);
  Positions points;
  for (int i = 0; i < 300; ++i)
    points.push_back(0.5 * Vector3d(static_cast<double>(random() % 9),
                                    static_cast<double>(random() % 9),
                                    static_cast<double>(random() % 9)));
  expectSameAnswers(both, points);
  // Against rational arithmetic: no element is nearer, and no lower one is as near.
  const SpatialQueries queries = both.octree.queries();
  std::size_t ties = 0;
  for (const Vector3d& p : points) {
    const auto found = queries.closestPoint(both.id, p);
    const auto squareOf = [&](std::uint32_t element) {
      const auto& [a, b, c] = grid.triangles[element];
      return oracle::vertexTriangle(p, grid.positions[a], grid.positions[b], grid.positions[c])
          .square;
    };
    const Rational best = squareOf(found->element);
    for (std::uint32_t e = 0; e < grid.triangles.size(); ++e) {
      const Rational other = squareOf(e);
      ASSERT_TRUE(other > best || (other == best && e >= found->element));
      ties += other == best && e != found->element;
    }
  }
  EXPECT_GT(ties, 100u);
}

/// The centre of a ball is equally far from all of its triangles up to rounding.
TEST(PointDistances, NearlyEqualDistancesAreDecidedExactly) {
  const TestGeometry ball = testGeometry(sphere(16, 24, {0, 0, 0}, 1.0));
  Both both(ball);
  const Vector3d centre(0, 0, 0);
  expectSameAnswers(both, std::span(&centre, 1));
  const auto found = both.octree.queries().closestPoint(both.id, centre);
  const auto squareOf = [&](std::uint32_t element) {
    const auto& [a, b, c] = ball.triangles[element];
    return oracle::vertexTriangle(centre, ball.positions[a], ball.positions[b], ball.positions[c])
        .square;
  };
  const Rational best = squareOf(found->element);
  for (std::uint32_t e = 0; e < ball.triangles.size(); ++e)
    ASSERT_TRUE(squareOf(e) > best || (squareOf(e) == best && e >= found->element)) << e;
}

TEST(PointDistances, SignedDistancesAreNegativeInside) {
  Random random(104);
  const Mesh mesh = sphere(16, 24, {0.5, 0.5, 0.5}, 0.4);
  Both both(testGeometry(mesh));
  const SpatialQueries queries = both.octree.queries(), truth = both.bruteForce.queries();
  Positions points;
  for (int i = 0; i < 400; ++i) points.push_back(randomPoint(random, 0, 1));
  std::vector<SignedDistance> batch(points.size());
  queries.signedDistances(both.id, points, batch);
  std::size_t inside = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const SignedDistance found = queries.signedDistance(both.id, points[i]);
    EXPECT_EQ(found.distance, batch[i].distance);
    EXPECT_EQ(found.distance, truth.signedDistance(both.id, points[i]).distance);
    EXPECT_EQ(found.distance < 0, queries.contains(both.id, points[i]));
    EXPECT_EQ(std::abs(found.distance), found.nearest.distance);
    const double exact = (points[i] - Vector3d(0.5, 0.5, 0.5)).norm() - 0.4;
    EXPECT_NEAR(found.distance, exact, 0.02);  // of the ball that the mesh is inscribed in
    const double byNumber =
        queries.signedDistance(both.id, points[i], {.rule = InsideRule::WindingNumber}).distance;
    EXPECT_EQ(byNumber, found.distance);
    inside += found.distance < 0;
  }
  EXPECT_GT(inside, 50u);
}

TEST(PointDistances, ShapesHaveTheirClosestPoints) {
  OctreeBasedCD collisions;
  const GeometryId ball = collisions.addAnalyticalGeometry(Sphere{{1, 0, 0}, 0.5});
  const SpatialQueries queries = collisions.queries();
  const auto outside = queries.closestPoint(ball, {3, 0, 0}),
             inside = queries.closestPoint(ball, {1.2, 0, 0});
  ASSERT_TRUE(outside && inside);
  EXPECT_EQ(outside->element, kNoElement);
  EXPECT_NEAR(outside->distance, 1.5, 1e-15);
  EXPECT_NEAR((outside->position - Vector3d(1.5, 0, 0)).norm(), 0, 1e-15);
  EXPECT_NEAR(inside->distance, -0.3, 1e-15);
  EXPECT_FALSE(queries.closestPoint(ball, {3, 0, 0}, 1.4));
}

TEST(PointDistances, BadInputThrowsErrorsThatNameIt) {
  OctreeBasedCD collisions;
  const Mesh mesh = sphere(6, 8, {0, 0, 0}, 1);
  const GeometryId ball = collisions.addTriangleMesh(mesh.positions, mesh.triangles),
                   shape = collisions.addAnalyticalGeometry(Sphere{{0, 0, 0}, 1});
  const SpatialQueries queries = collisions.queries();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Vector3d zero(0, 0, 0), bad(nan, 0, 0);
  std::vector<SurfacePoint> points;
  std::vector<std::uint32_t> elements;
  using enum ErrorCode;
  expectRefused(NonFinitePosition, "(nan, 0, 0)", [&] { queries.closestPoint(ball, bad); });
  expectRefused(NonFinitePosition, "(nan, 0, 0)", [&] { queries.contains(ball, bad); });
  expectRefused(InvalidSettings, "maxDistance is -1",
                [&] { queries.closestPoint(ball, zero, -1); });
  expectRefused(InvalidSettings, "k is 0", [&] { queries.nearestElements(ball, zero, 0, points); });
  expectRefused(InvalidSettings, "radius is -1",
                [&] { queries.elementsWithin(ball, zero, -1, elements); });
  expectRefused(UnsupportedMethod, "is a shape",
                [&] { queries.elementsWithin(shape, zero, 1, elements); });
  expectRefused(UnknownGeometry, "geometry 9", [&] { queries.closestPoint(GeometryId{9}, zero); });
  expectRefused(InvalidSettings, "1 points, but room for 2 answers", [&] {
    points.resize(2);
    queries.closestPoints(ball, std::span(&zero, 1), points);
  });
}

}  // namespace
}  // namespace palpate::testing
