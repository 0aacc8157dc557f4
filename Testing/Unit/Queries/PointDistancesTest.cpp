#include "Common/FieldMeshes.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Queries/PointDistances.h"
#include "Unit/Queries/QueryTruth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

// Closest points, nearest elements and elements within a radius: octrees answer as brute force, bit
// by bit, and both as rational arithmetic.
namespace palpate::testing {
namespace {

/// Expects that all queries about the points agree with each other and with brute force.
void expectSameAnswers(const Both& both, std::span<const Vector3d> points) {
  const SpatialQueries fast = both.octree.queries(), truth = both.bruteForce.queries();
  std::vector<SurfacePoint> nearest, trueNearest, batch(points.size()), limitedBatch(points.size());
  std::vector<std::uint32_t> within, trueWithin;
  const double limit = 0.1;
  fast.closestPoints(both.id, points, batch);
  fast.closestPoints(both.id, points, limitedBatch, limit);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vector3d& p = points[i];
    const auto a = fast.closestPoint(both.id, p);
    ASSERT_TRUE(a);
    ASSERT_TRUE(isSame(a, truth.closestPoint(both.id, p)));
    ASSERT_TRUE(isSame(batch[i], *a));
    const auto limited = fast.closestPoint(both.id, p, limit);
    ASSERT_EQ(limited.has_value(), limitedBatch[i].element != kNoElement);
    if (limited) {
      ASSERT_TRUE(isSame(limitedBatch[i], *limited) && isSame(*limited, *a));
    }
    for (const double most : {a->distance, std::nextafter(a->distance, kInfinity)})
      if (most >= 0) {
        ASSERT_TRUE(
            isSame(fast.closestPoint(both.id, p, most), truth.closestPoint(both.id, p, most)));
      }
    fast.nearestElements(both.id, p, 7, nearest);
    truth.nearestElements(both.id, p, 7, trueNearest);
    ASSERT_TRUE(isSame(nearest, trueNearest));
    ASSERT_TRUE(isSame(nearest[0], *a));
    const double radius = std::max(0.0, nearest.back().distance);
    fast.elementsWithin(both.id, p, radius, within);
    truth.elementsWithin(both.id, p, radius, trueWithin);
    ASSERT_EQ(within, trueWithin);
    fast.nearestElements(both.id, p, 40, nearest, radius);
    truth.nearestElements(both.id, p, 40, trueNearest, radius);
    ASSERT_TRUE(isSame(nearest, trueNearest));
    ASSERT_EQ(nearest.size(), std::min<std::size_t>(40, within.size()));
  }
}

/// The distance of p from the nearest of the balls along a segment in 400 bits: the minimum of a
/// convex function, by golden sections.
mpf_class distanceFromBalls(const Vector3d& p, const Vector3d& a, const Vector3d& b, double radiusA,
                            double radiusB) {
  const auto gap = [&](const mpf_class& t) {
    mpf_class square(0, 400);
    for (int k = 0; k < 3; ++k) {
      const mpf_class from = mpf_class(p[k], 400) - a[k] - t * (mpf_class(b[k], 400) - a[k]);
      square += from * from;
    }
    return mpf_class(sqrt(square) - radiusA - t * (mpf_class(radiusB, 400) - radiusA));
  };
  mpf_class low(0, 400), high(1, 400);
  for (int i = 0; i < 290; ++i) {
    const mpf_class l = low + (high - low) * 0.382, r = low + (high - low) * 0.618;
    if (gap(l) < gap(r))
      high = r;
    else
      low = l;
  }
  return std::min({gap(mpf_class(0, 400)), gap(mpf_class(1, 400)), gap(low)},
                  [](const mpf_class& l, const mpf_class& r) { return l < r; });
}

/// An element's distance from a point in 400 bits, less the radius. Elements without radius have
/// the exact squares beside it.
struct TrueDistance {
  std::uint32_t element;
  Rational square;
  mpf_class distance;
};

/// Of all elements, by distance and then by element.
std::vector<TrueDistance> trueDistances(const TestGeometry& geometry, const Positions& now,
                                        const Vector3d& p) {
  const std::vector<Triangle> elements = geometry.elements();
  std::vector<TrueDistance> all;
  for (std::uint32_t e = 0; e < elements.size(); ++e) {
    const auto& [a, b, c] = elements[e];
    const oracle::Closest closest = oracle::vertexTriangle(p, now[a], now[b], now[c]);
    all.push_back(
        {e, closest.square,
         geometry.radius(a) == geometry.radius(b)
             ? mpf_class(oracle::root(closest.square) - mpf_class(geometry.radius(a), 400))
             : distanceFromBalls(p, now[a], now[b], geometry.radius(a), geometry.radius(b))});
  }
  const bool sameRadius = geometry.radii.size() == 1;
  std::stable_sort(all.begin(), all.end(), [&](const TrueDistance& l, const TrueDistance& r) {
    return sameRadius ? l.square < r.square : l.distance < r.distance;
  });
  return all;
}

/// Expects the order and the values of exact arithmetic.
void expectTrueAnswers(const Both& both, const TestGeometry& geometry, const Positions& now,
                       std::span<const Vector3d> points) {
  const SpatialQueries queries = both.octree.queries();
  std::vector<SurfacePoint> nearest;
  std::vector<std::uint32_t> within;
  for (const Vector3d& p : points) {
    const std::vector<TrueDistance> truth = trueDistances(geometry, now, p);
    queries.nearestElements(both.id, p, 9, nearest);
    ASSERT_EQ(nearest.size(), std::min<std::size_t>(9, truth.size()));
    Eigen::AlignedBox3d box(p);
    for (const Vector3d& q : now) box.extend(q);
    for (std::size_t i = 0; i < nearest.size(); ++i) {
      const SurfacePoint& found = nearest[i];
      ASSERT_EQ(found.element, truth[i].element) << i;
      const Triangle vertices = geometry.elements()[found.element];
      ASSERT_EQ(found.vertices, vertices);
      const double size = box.sizes().maxCoeff();
      // 1e-15 of the diagonal, and the rounding of coordinates.
      const double error = 1e-15 * (size + p.norm());
      ASSERT_NEAR(mpf_class(truth[i].distance - found.distance).get_d(), 0.0, error);
      const auto& [a, b, c] = vertices;
      ASSERT_LE((found.weights[0] * now[a] + found.weights[1] * now[b] + found.weights[2] * now[c] -
                 found.position)
                    .norm(),
                4 * error);
      ASSERT_NEAR(found.weights.sum(), 1.0, 1e-15);
    }
    const double radius = std::max(0.0, nearest[nearest.size() / 2].distance);
    queries.elementsWithin(both.id, p, radius, within);
    std::vector<std::uint32_t> expected;
    for (const TrueDistance& each : truth)
      if (each.distance <= radius) expected.push_back(each.element);
    std::sort(expected.begin(), expected.end());
    ASSERT_EQ(within, expected);
    // The greatest distance is included, exactly.
    const double least = nearest[0].distance;
    for (const double most :
         {std::nextafter(least, -kInfinity), least, std::nextafter(least, kInfinity)})
      if (most >= 0) {
        ASSERT_EQ(queries.closestPoint(both.id, p, most).has_value(), truth[0].distance <= most);
      }
  }
}

/// At rest; deformed, over a whole step; and placed near and far.
TEST(PointDistances, AreThoseOfBruteForceAndExactForEveryGeometryType) {
  Random random(101);
  std::vector<TestGeometry> geometries = geometriesOfEveryType(random);
  geometries.push_back(testGeometry(soup(random, 40, 0.2)));
  for (std::size_t i = 0; i < 120; i += 3) {  // without area
    Positions& p = geometries.back().positions;
    if (i % 4 == 0) p[i + 1] = p[i];
    if (i % 4 == 1) p[i + 2] = p[i + 1] = p[i];
    if (i % 4 == 2) p[i + 2] = p[i] + 0.5 * (p[i + 1] - p[i]);
    if (i % 4 == 3) p[i + 2] = p[i] + 3 * (p[i + 1] - p[i]);
  }
  geometries.back().triangles.push_back({0, 0, 5});  // repeated vertices
  geometries.back().triangles.push_back({7, 7, 7});
  std::size_t number = 0;
  for (const TestGeometry& geometry : geometries) {
    Both both(geometry);
    const std::vector<Triangle> elements = geometry.elements();
    const auto test = [&](const Positions& now) {
      expectSameAnswers(both, hardPoints(random, now, elements, casesOf(48)));
      expectTrueAnswers(both, geometry, now, hardPoints(random, now, elements, casesOf(8)));
    };
    test(geometry.positions);
    const Positions now = moved(random, geometry.positions, 0.05);
    both.change([&](OctreeBasedCD& each) {
      each.addCollisionPair(both.id, both.id, {.thickness = 0.01});
      each.setPositions(both.id, geometry.positions, now);
    });
    test(now);
    const Matrix3d turn = randomTurn(random);
    const double far = std::array{0.0, 1e3, 1e12}[number++ % 3];
    both.change([&](OctreeBasedCD& each) {
      each.removeCollisionPair(both.id, both.id);
      each.setTransform(both.id, {turn, {far, -2 * far, 0.3}});
    });
    test(placed(now, turn, {far, -2 * far, 0.3}));
  }
}

/// Rotations that are orthonormal only within the tolerance, of a body far from its own origin.
/// They stretch more than floats are rounded. Rays and shapes find what brute force finds, too.
TEST(PointDistances, InexactRotationsFarFromTheBodysOrigin) {
  Random random(106);
  TestGeometry farAway =
      testGeometry(joined(soup(random, 300, 0.05), sphere(40, 80, {0, 0, 0}, 1)));
  const Vector3d far(4e6, 1e6, -2e6);
  for (Vector3d& p : farAway.positions) p += far;
  Matrix3d shear;
  shear << 3, 1, 0, 1, -3, 1, 0, 1, 3;
  const Matrix3d unit = Matrix3d::Identity();
  for (const Matrix3d& stretch : {Matrix3d((1 - 4e-10) * unit), Matrix3d((1 + 4e-10) * unit),
                                  Matrix3d(unit + 1.4e-10 * shear)}) {
    Both both(farAway);
    const Matrix3d turn = randomTurn(random) * stretch;
    both.change([&](OctreeBasedCD& each) { each.setTransform(both.id, {turn, -(turn * far)}); });
    const Positions world = placed(farAway.positions, turn, -(turn * far));
    expectSameAnswers(both, hardPoints(random, world, farAway.triangles, casesOf(300, 60)));
    std::size_t hits = 0, overlaps = 0;
    std::vector<std::uint32_t> found, truth;
    for (int i = 0; i < casesOf(700, 150); ++i) {
      const Vector3d p = randomPoint(random, -1.5, 1.5);
      hits += consistentHits(both, {p, randomPoint(random, -1, 1)}).size();
      if (i % 10) continue;
      for (const AnalyticalGeometry& shape :
           {AnalyticalGeometry(Sphere{p, 0.2}), AnalyticalGeometry(Capsule{p, {0, 0, 1}, 0.1}),
            AnalyticalGeometry(Box{p, {0.3, 0.1, 0.2}})}) {
        both.octree.queries().overlapping(both.id, shape, Pose{}, found);
        both.bruteForce.queries().overlapping(both.id, shape, Pose{}, truth);
        ASSERT_EQ(found, truth);
        overlaps += found.size();
      }
    }
    EXPECT_GE(hits, leastOf(200, 40));
    EXPECT_GE(overlaps, leastOf(500, 100));
  }
}

/// Every coordinate is a small integer, so that many elements are equally near.
TEST(PointDistances, TiesGoToTheLowestElement) {
  Random random(103);
  for (const unsigned size : {2u, 4u}) {
    std::vector<TestGeometry> geometries(3, latticeSoup(random, 60, size));
    for (std::uint32_t v = 0; v < 180; v += 2) geometries[1].segments.push_back({v, v + 1});
    geometries[1].triangles.clear(), geometries[2].triangles.clear();
    geometries[1].type = GeometryType::Lines, geometries[2].type = GeometryType::Points;
    geometries.push_back(geometries[1]), geometries.push_back(geometries[2]);
    geometries[3].radii = geometries[4].radii = {0.5};
    for (const TestGeometry& geometry : geometries) {
      const Both both(geometry);
      Positions points;
      for (int i = 0; i < casesOf(30); ++i) points.push_back(0.5 * onLattice(random, 2 * size + 1));
      expectSameAnswers(both, points);
      expectTrueAnswers(both, geometry, geometry.positions, points);
      std::size_t ties = 0;
      for (const Vector3d& p : points) {
        const auto truth = trueDistances(geometry, geometry.positions, p);
        ties += truth[0].square == truth[1].square;
      }
      EXPECT_GE(ties, leastOf(points.size() / 4));
    }
  }
}

/// Points with different radii that touch the same ball around the point asked for.
TEST(PointDistances, TiesOfDifferentRadii) {
  const TestGeometry points{GeometryType::Points,
                            {{5, 0, 0}, {0, 4, 0}, {0, 0, -3}, {3, 4, 0}, {0, 3, 4}, {2, 0, 0}},
                            {},
                            {},
                            {3, 2, 1, 3, 3, 0.5}};
  const Both both(points);
  const Vector3d centre(0, 0, 0);
  expectSameAnswers(both, std::span(&centre, 1));
  std::vector<SurfacePoint> nearest;
  both.octree.queries().nearestElements(both.id, centre, 6, nearest);
  ASSERT_EQ(nearest.size(), 6u);
  const std::uint32_t expected[] = {5, 0, 1, 2, 3, 4};
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(nearest[i].element, expected[i]);
}

/// The centre of a ball is equally far from all of its triangles up to rounding.
TEST(PointDistances, NearlyEqualDistancesAreDecidedExactly) {
  Random random(106);
  const TestGeometry ball = testGeometry(sphere(10, 14, {0, 0, 0}, 1.0));
  std::vector<TestGeometry> geometries(5, ball);
  for (std::size_t i = 1; i < 5; ++i) {
    geometries[i].type = GeometryType::Points;
    geometries[i].triangles.clear();
    geometries[i].radii = {i == 4 ? 1e9 : 0.75};
  }
  for (const std::size_t i : {2, 3}) {  // different radii, the same distance up to rounding
    geometries[i].radii.clear();
    for (Vector3d& p : geometries[i].positions) {
      const double size = uniform(random, 1, 2);
      p *= size;
      geometries[i].radii.push_back(size - 0.5);
    }
  }
  geometries[3].type = GeometryType::Lines;  // away from the centre, with the radius of the ball
  for (std::uint32_t v = 0; v < ball.positions.size(); ++v) {
    geometries[3].positions.push_back(3 * geometries[3].positions[v]);
    geometries[3].radii.push_back(0.25);
    geometries[3].segments.push_back({v, v + static_cast<std::uint32_t>(ball.positions.size())});
  }
  for (const TestGeometry& geometry : geometries) {
    const Both both(geometry);
    const Vector3d centre(0, 0, 0);
    expectSameAnswers(both, std::span(&centre, 1));
    expectTrueAnswers(both, geometry, geometry.positions, std::span(&centre, 1));
  }
}

/// A segment without length is a ball of its larger radius, in every query.
TEST(PointDistances, SegmentsWithoutLengthHaveTheirLargerRadius) {
  for (const Segment& segment : {Segment{0, 1}, Segment{1, 0}}) {
    const Both both(
        TestGeometry{GeometryType::Lines, {{0, 0, 0}, {0, 0, 0}}, {}, {segment}, {0.5, 2.0}});
    for (const OctreeBasedCD* each : {&both.octree, &both.bruteForce}) {
      const SpatialQueries queries = each->queries();
      const auto nearest = queries.closestPoint(both.id, {0, 0, 10});
      ASSERT_TRUE(nearest);
      EXPECT_EQ(nearest->distance, 8.0);
      EXPECT_EQ(nearest->vertices[nearest->weights[1] == 1.0], 1u);
      EXPECT_EQ(queries.firstHit(both.id, {{0, 0, 10}, {0, 0, -1}})->t, 8.0);
      std::vector<std::uint32_t> elements;
      queries.elementsWithin(both.id, {0, 0, 10}, 8.0, elements);
      EXPECT_EQ(elements.size(), 1u);
      queries.elementsWithin(both.id, {0, 0, 10}, 7.9, elements);
      EXPECT_EQ(elements.size(), 0u);
      for (const AnalyticalGeometry& shape :
           {AnalyticalGeometry(Sphere{{0, 0, 1.5}, 0.1}),
            AnalyticalGeometry(Box{{0, 0, 1.5}, {0.1, 0.1, 0.1}}),
            AnalyticalGeometry(Capsule{{0, 0, 1.5}, {0, 1, 1.5}, 0.1})}) {
        queries.overlapping(both.id, shape, {Matrix3d::Identity(), {0, 0, 0}}, elements);
        EXPECT_EQ(elements.size(), 1u) << shape.index();
      }
    }
  }
}

/// The closest point is on the shape, at the distance that the shape's definition gives.
TEST(PointDistances, ShapesHaveTheirClosestPoints) {
  Random random(108);
  for (const AnalyticalGeometry& geometry : shapesOfEveryKind(random)) {
    const MeasuredShape shape{geometry, randomTurn(random), randomPoint(random, -1, 1)};
    Both both(geometry);
    both.change([&](OctreeBasedCD& each) {
      each.setTransform(both.id, {shape.rotation, shape.translation});
    });
    const SpatialQueries queries = both.octree.queries();
    Positions points;
    for (int i = 0; i < casesOf(200); ++i)
      points.push_back(shape.translation + randomPoint(random, -1, 1) * (i % 2 ? 0.2 : 3.0));
    std::vector<SurfacePoint> batch(points.size());
    queries.closestPoints(both.id, points, batch);
    for (std::size_t i = 0; i < points.size(); ++i) {
      SCOPED_TRACE(std::to_string(geometry.index()) + ", point " + std::to_string(i));
      const auto found = queries.closestPoint(both.id, points[i]);
      ASSERT_TRUE(found && isSame(*found, batch[i]));
      ASSERT_TRUE(isSame(found, both.bruteForce.queries().closestPoint(both.id, points[i])));
      EXPECT_EQ(found->element, kNoElement);
      const double most = found->distance;
      EXPECT_NEAR(most, shape.signedDistance(points[i]), 1e-13);
      EXPECT_NEAR(shape.signedDistance(found->position), 0.0, 1e-13);
      EXPECT_NEAR((points[i] - found->position).norm(), std::abs(most), 1e-14);
      if (most >= 0) {
        EXPECT_TRUE(isSame(queries.closestPoint(both.id, points[i], most), found));
      }
      if (most > 0) {
        EXPECT_FALSE(queries.closestPoint(both.id, points[i], std::nextafter(most, 0)));
      }
    }
  }
}

TEST(PointDistances, ARoughlyNearestTriangleIsWithinItsTolerance) {
  Random random(2);
  for (const auto& [name, mesh] : fieldMeshes(random)) {
    SCOPED_TRACE(name);
    OctreeBasedCD collisions;
    const GeometryId id = collisions.addTriangleMesh(mesh.positions, mesh.triangles);
    Body geometry(id);
    geometry.mesh.now = Positions(mesh.positions);
    geometry.mesh.before = geometry.mesh.now;
    geometry.mesh.topology.vertexCount = mesh.positions.size();
    geometry.mesh.topology.elements.assign(mesh.triangles.begin(), mesh.triangles.end());
    geometry.revisions.elements.topology = geometry.revisions.counter.next();
    const Threads threads(1);
    const double spread =
        geometry.tree.sampleFrame(geometry.mesh, geometry.revisions.elements.topology);
    geometry.tree.update(geometry.mesh, geometry.revisions.elements.topology, frameScale(spread),
                         {}, threads);
    Eigen::AlignedBox3d box;
    for (const Vector3d& p : mesh.positions) box.extend(p);
    const double size = box.diagonal().norm();
    for (int i = 0; i < casesOf(1000); ++i) {
      Vector3d p = box.center() + randomPoint(random, -1, 1) * size;
      if (i % 4 == 0) p = mesh.positions[random() % mesh.positions.size()];
      std::array<std::uint32_t, 8> likely;
      for (std::uint32_t& place : likely)
        place = static_cast<std::uint32_t>(random() % mesh.triangles.size());
      const auto near = PointDistances(geometry, p, false)
                            .roughlyNearest(1e-9 * size, std::span(likely).first(random() % 9));
      const double exact = collisions.queries().closestPoint(id, p)->distance;
      ASSERT_NEAR(near.distance, exact, 1e-9 * size);
      ASSERT_LT(near.place, mesh.triangles.size());
    }
  }
}

/// Each query of a geometry without elements has no answer.
TEST(PointDistances, EmptyGeometriesHaveNone) {
  for (const GeometryType type :
       {GeometryType::Triangles, GeometryType::Lines, GeometryType::Points}) {
    TestGeometry empty;
    empty.type = type;
    const Both both(empty);
    std::vector<SurfacePoint> points(2);
    std::vector<std::uint32_t> elements(2);
    std::vector<ShapeContact> contacts(1);
    const Sphere ball{{0, 0, 0}, 10};
    const Pose none;
    for (const OctreeBasedCD* each : {&both.octree, &both.bruteForce}) {
      const SpatialQueries queries = each->queries();
      EXPECT_FALSE(queries.closestPoint(both.id, {0, 0, 0}));
      queries.nearestElements(both.id, {0, 0, 0}, 3, points);
      queries.elementsWithin(both.id, {0, 0, 0}, 1, elements);
      EXPECT_TRUE(points.empty() && elements.empty());
      points.resize(2), elements.resize(2);
      queries.closestPoints(both.id, Positions(2, Vector3d(0, 0, 0)), points);
      EXPECT_EQ(points[1].element, kNoElement);
      queries.overlapping(both.id, ball, none, elements);
      queries.contacts(both.id, ball, none, 1.0, contacts);
      EXPECT_TRUE(elements.empty() && contacts.empty());
    }
    EXPECT_TRUE(consistentHits(both, {{0, 0, 0}, {1, 0, 0}}).empty());
  }
}

}  // namespace
}  // namespace palpate::testing
