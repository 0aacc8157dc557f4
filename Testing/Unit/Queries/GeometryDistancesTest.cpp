#include "Common/ExpectRefused.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Core/SimdPath.h"
#include "Unit/Math/IntersectionOracle.h"
#include "Unit/Queries/QueryTruth.h"

#include <palpate/OctreeBasedCD.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

// The least distance of two geometries: the octrees' answers are those of brute force, bit by bit,
// and those of rational arithmetic.
namespace palpate::testing {
namespace {

using Strings = std::vector<std::string>;

/// Two geometries searched by octrees, and by brute force.
struct TwoBodies : Both {
  template <class A, class B>
  TwoBodies(const A& geometryA, const B& geometryB) : a(add(geometryA)), b(add(geometryB)) {}
  /// Moves a geometry to a pose, by setTransform() or by its positions.
  void put(GeometryId which, const TestGeometry& geometry, const Matrix3d& turn,
           const Vector3d& shift, bool isPlaced) {
    Positions now = geometry.positions;
    for (Vector3d& p : now) p = turn * p + shift;
    change([&](OctreeBasedCD& each) {
      if (isPlaced)
        each.setTransform(which, {turn, shift});
      else
        each.setPositions(which, now);
    });
  }

  GeometryId a, b;
};

/// Expects the answer of brute force, and witnesses at the distance. size: L, of the coordinates.
GeometryDistance expectSameAnswers(const TwoBodies& both, double radii, double size) {
  const SpatialQueries queries = both.octree.queries();
  const GeometryDistance found = queries.distance(both.a, both.b),
                         truth = both.bruteForce.queries().distance(both.a, both.b);
  EXPECT_TRUE(isSame(found, truth))
      << found.distance << " of " << found.a.element << ", " << found.b.element << "; "
      << truth.distance << " of " << truth.a.element << ", " << truth.b.element;
  EXPECT_EQ(found.a.distance, found.distance);
  EXPECT_EQ(found.b.distance, found.distance);
  const double apart = (found.a.position - found.b.position).norm();
  EXPECT_LE(found.distance, apart + 1e-14 * size);
  EXPECT_GE(found.distance, apart - radii - 1e-14 * size);
  for (const SurfacePoint& point : {found.a, found.b})
    if (point.element != kNoElement) {
      EXPECT_NEAR(point.weights.sum(), 1.0, 1e-15);
      EXPECT_GE(point.weights.minCoeff(), 0.0);
    }
  EXPECT_EQ(queries.distance(both.b, both.a).distance, found.distance);
  return found;
}

double largestRadius(const TestGeometry& geometry) {
  return *std::max_element(geometry.radii.begin(), geometry.radii.end());
}

/// Expects that the witness on a, and no other point of it, is as near to b as claimed. The
/// distance of a point from b is that of closestPoint().
void expectNoNearerPoint(Random& random, const TwoBodies& both, const TestGeometry& a,
                         const GeometryDistance& found) {
  const SpatialQueries queries = both.octree.queries();
  const auto gapAt = [&](const Triangle& vertices, const Vector3d& weights) {
    Vector3d p = Vector3d::Zero();
    double radius = 0;
    for (int i = 0; i < 3; ++i) {
      p += weights[i] * a.positions[vertices[i]];
      radius += weights[i] * a.radius(vertices[i]);
    }
    return std::max(0.0, queries.closestPoint(both.b, p)->distance - radius);
  };
  EXPECT_NEAR(gapAt(found.a.vertices, found.a.weights), found.distance, 1e-13);
  EXPECT_LE(queries.closestPoint(both.b, found.b.position)->distance, 1e-13);
  for (const Triangle& vertices : a.elements())
    for (int i = 0; i < 3; ++i) {
      const double s = uniform(random, 0, 1), t = uniform(random, 0, 1 - s);
      EXPECT_GE(gapAt(vertices, {1 - s - t, s, t}), found.distance - 1e-13);
    }
}

TEST(GeometryDistances, AreThoseOfBruteForceAndOfPointsForEveryPairOfTypes) {
  Random random(201);
  const std::vector<TestGeometry> geometries = geometriesOfEveryType(random);
  std::size_t apart = 0, touching = 0, number = 0;
  const auto test = [&](const TestGeometry& a, const auto& b, double radii, const auto& move) {
    TwoBodies both(a, b);
    for (const double most : {3.0, 1.2, 0.5, 0.1, 0.0}) {
      if (isLeftOut(number++)) continue;
      const Vector3d shift = randomPoint(random, -most, most);
      both.change([&, turn = randomTurn(random), seed = random()](OctreeBasedCD& each) {
        move(each, both.b, turn, shift, seed);
      });
      const GeometryDistance found = expectSameAnswers(both, radii, 5.0);
      expectNoNearerPoint(random, both, a, found);
      (found.distance > 0 ? apart : touching) += 1;
      ASSERT_FALSE(::testing::Test::HasFailure()) << most;
    }
  };
  for (const TestGeometry& a : geometries) {
    for (const TestGeometry& b : geometries)
      test(a, b, largestRadius(a) + largestRadius(b),
           [&](OctreeBasedCD& each, GeometryId id, const Matrix3d&, const Vector3d& shift,
               std::uint64_t seed) {
             Random motion(seed);
             Positions now = moved(motion, b.positions, 0.01);
             for (Vector3d& p : now) p += shift;
             each.setPositions(id, now);
           });
    for (const AnalyticalGeometry& shape : shapesOfEveryKind(random))
      test(a, shape, largestRadius(a),
           [](OctreeBasedCD& each, GeometryId id, const Matrix3d& turn, const Vector3d& shift,
              std::uint64_t) {
             each.setTransform(id, {turn, shift + Vector3d(0.5, 0.5, 0.5)});
           });
    if (HasFailure()) return;
  }
  EXPECT_GE(apart, leastOf(300));
  EXPECT_GE(touching, leastOf(150));
}

/// No coordinate is exact after a body was placed, or far from the origin. Large meshes have more
/// elements than subtrees whose elements' heights are compared; their nearest points are often
/// vertices, which several triangles share. Every SIMD path gives the same answer.
TEST(GeometryDistances, OctreesAnswerAsBruteForceForPlacedBodiesLargeMeshesAndFarAway) {
  Random random(202);
  const auto bumpy = [](std::uint32_t rings, double height) {
    Mesh mesh = sphere(rings, 24, Vector3d::Zero(), 1.0);
    for (Vector3d& p : mesh.positions)
      p *= 1 + height * std::sin(5 * p[0]) * std::cos(4 * p[1]) * std::sin(3 * p[2] + 1);
    return testGeometry(std::move(mesh));
  };
  const struct {
    TestGeometry a, b;
    std::vector<double> away, shifts;
    double radius;
  } cases[] = {
      {testGeometry(sphere(10, 14, {0.5, 0.5, 0.5}, 0.4)),
       tapered(random, thread(random, 150, 0.1, 0.01, false), 0.05),
       {0.0, 1.0, 1e3, 1e9, 1e14},
       {2.0, 1.5, 1.2, 1.0, 0.5, 0.0},
       0.05},
      {bumpy(22, 0.15), bumpy(18, 0.2), {3.0}, {3.0, 2.6, 2.3, 2.2, 2.1, 2.0, 1.9, 1.8, 0.2}, 0.0}};
  std::size_t apart = 0, touching = 0;
  for (const auto& [a, b, away, shifts, radius] : cases)
    for (const double far : away)
      for (int placed = kShareOfCases > 1 && away.size() == 1 ? 3 : 0; placed < 4; ++placed) {
        TwoBodies both(a, b);
        const Vector3d at = far * Vector3d(1, -2, 0.3);
        for (const double shift : shifts) {
          const Matrix3d turn = randomTurn(random), turnOfB = randomTurn(random);
          const Vector3d aside = shift * randomPoint(random, -1, 1).normalized();
          both.put(both.a, a, turn, at, placed & 1);
          both.put(both.b, b, turnOfB, at + aside, placed & 2);
          const GeometryDistance found = expectSameAnswers(both, radius, 5.0 + 10 * far);
          (found.distance > 0 ? apart : touching) += 1;
          for (const std::string& path : away.size() == 1 ? simdPaths() : Strings{}) {
            useSimdPath(path);
            EXPECT_TRUE(isSame(both.octree.queries().distance(both.a, both.b), found)) << path;
          }
          useSimdPath("");
          ASSERT_FALSE(::testing::Test::HasFailure()) << far << ' ' << placed << ' ' << shift;
        }
      }
  EXPECT_GE(apart, leastOf(100));
  EXPECT_GE(touching, leastOf(9));
}

TEST(GeometryDistances, SurfacesOfTetrahedralMeshesAreMeshes) {
  Random random(203);
  const Solid a = cells(3, random), b = cells(2, random);
  TwoBodies both(a, b);
  for (const double at : {-5.0, -2.5, -2.0, -1.5, 0.5}) {
    Positions now = b.positions;
    for (Vector3d& p : now) p += Vector3d(at, 0.25, 0.25);
    both.change([&](OctreeBasedCD& each) { each.setPositions(both.b, now); });
    // b is [at, at + 2] wide, a is [0, 3]. Inside a, b's surface is apart from a's.
    const double expected = at < -2 ? -2 - at : at < 0 ? 0.0 : 0.25;
    EXPECT_EQ(expectSameAnswers(both, 0.0, 5.0).distance, expected) << at;
  }
}

TEST(GeometryDistances, ExchangedGeometriesGiveExchangedAnswers) {
  Random random(208);
  for (int round = 0; round < 40; ++round) {
    const TestGeometry a = testGeometry(soup(random, 40, 0.1));
    TestGeometry b = testGeometry(soup(random, 40, 0.1));
    if (round % 2 == 0) b = thread(random, 40, 0.1, 0.001, false);
    for (Vector3d& p : b.positions) p[0] += 1.5;
    const TwoBodies both(a, b);
    const SpatialQueries queries = both.octree.queries();
    const GeometryDistance one = queries.distance(both.a, both.b),
                           two = queries.distance(both.b, both.a);
    EXPECT_GT(one.distance, 0.0);
    EXPECT_TRUE(isSame(one, GeometryDistance{two.b, two.a, two.distance}));
  }
}

/// The nearest triangle of b is not the one that is nearest to b's middle.
TEST(GeometryDistances, ClampedBoxesDoNotHideTheNearestPair) {
  Random random(211);
  for (const double far : {1e10, 1e36, 1e45}) {
    TestGeometry a = testGeometry(soup(random, 60, 0.1)), b;
    const auto first = static_cast<std::uint32_t>(a.positions.size());
    a.positions.insert(a.positions.end(), {{0, 0, 0}, {far, 0, 0}, {far, 10, 0}});
    a.triangles.push_back({first, first + 1, first + 2});
    for (std::uint32_t i = 0; i < 40; ++i) {
      const double y = i == 17 ? 10.0 : 0.0, z = i == 17 ? 0.5 : 1.0 + 0.01 * i;
      b.positions.insert(b.positions.end(), {{far, y, z}, {far, y + 0.1, z}, {far, y, z + 0.1}});
      b.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    const GeometryDistance found = expectSameAnswers(TwoBodies(a, b), 0.0, far);
    EXPECT_EQ(found.distance, 0.5);
    EXPECT_EQ(found.a.element, 60u);
    EXPECT_EQ(found.b.element, 17u);
  }
}

/// The square of the least distance of two small meshes in rational arithmetic; 0 if they meet.
Rational squareOf(const TestGeometry& a, const TestGeometry& b) {
  Rational least = -1;
  const auto take = [&](const Rational& other) {
    if (least < 0 || other < least) least = other;
  };
  for (const Triangle& s : a.triangles)
    for (const Triangle& t : b.triangles) {
      const std::array<Vector3d, 6> x{a.positions[s[0]], a.positions[s[1]], a.positions[s[2]],
                                      b.positions[t[0]], b.positions[t[1]], b.positions[t[2]]};
      if (intersection::trianglesIntersect(x)) return 0;
      for (std::size_t i = 0; i < 3; ++i) {
        take(oracle::vertexTriangle(x[i], x[3], x[4], x[5]).square);
        take(oracle::vertexTriangle(x[3 + i], x[0], x[1], x[2]).square);
        for (std::size_t j = 0; j < 3; ++j)
          take(oracle::edgeEdge(x[i], x[(i + 1) % 3], x[3 + j], x[3 + (j + 1) % 3]).square);
      }
    }
  return least;
}

void expectRational(const TwoBodies& both, const Rational& square, double size) {
  const GeometryDistance found = expectSameAnswers(both, 0.0, size);
  EXPECT_EQ(found.distance == 0.0, square == 0) << found.distance;
  EXPECT_NEAR(found.distance, oracle::root(square).get_d(), 4e-15 * size);
}

/// Few small integers, so that triangles often touch, overlap in a plane or have no area.
TEST(GeometryDistances, AgreeWithRationalArithmeticOnGrids) {
  Random random(205);
  std::size_t meet = 0, apart = 0;
  for (int round = 0; round < casesOf(400); ++round) {
    const double size = round % 2 ? 3 : 6;
    const auto onGrid = [&](const Vector3d& shift) {
      TestGeometry mesh;
      for (std::uint32_t t = 0; t < 3; ++t) {
        for (int corner = 0; corner < 3; ++corner) {
          const Vector3d p = randomPoint(random, 0, size) + shift;
          mesh.positions.emplace_back(std::floor(p[0]), std::floor(p[1]), std::floor(p[2]));
        }
        mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
      }
      return mesh;
    };
    const TestGeometry a = onGrid(Vector3d::Zero()),
                       b = onGrid(Vector3d(static_cast<double>(round % 5), 0, 0));
    const Rational square = squareOf(a, b);
    const TwoBodies both(a, b);
    expectRational(both, square, 10.0);
    (square == 0 ? meet : apart) += 1;
    ASSERT_FALSE(::testing::Test::HasFailure()) << round;
  }
  EXPECT_GE(meet, leastOf(80));
  EXPECT_GE(apart, leastOf(80));
}

/// A corner of b lies on a face or edge of a up to rounding. Only exact arithmetic knows whether it
/// touches, and the point where nearly parallel triangles cross is uncertain.
TEST(GeometryDistances, AgreeWithRationalArithmeticWhereTrianglesNearlyTouch) {
  Random random(206);
  std::size_t meet = 0, apart = 0;
  for (int round = 0; round < 600; ++round) {
    const TestGeometry a = testGeometry(soup(random, 1, 1.0));
    TestGeometry b = testGeometry(soup(random, 1, 1.0));
    const double v = uniform(random, 0, 1), w = round % 3 ? uniform(random, 0, 1 - v) : 1 - v;
    const Vector3d target = a.positions[0] + v * (a.positions[1] - a.positions[0]) +
                            w * (a.positions[2] - a.positions[0]);
    const Vector3d normal =
        (a.positions[1] - a.positions[0]).cross(a.positions[2] - a.positions[0]).normalized();
    if (round % 4 == 0) {  // nearly parallel, and across a's plane
      const double tilt = std::pow(10.0, uniform(random, -17, -1));
      for (Vector3d& p : b.positions) {
        p -= normal.dot(p - a.positions[0]) * normal;
        p += tilt * uniform(random, -1, 1) * normal;
      }
    } else {
      const Vector3d shift = target - b.positions[0];
      for (Vector3d& p : b.positions) p += shift;
      if (round % 4 == 1)
        for (int i : {1, 2})  // all of b on one side
          b.positions[i] += (std::abs(normal.dot(b.positions[i] - target)) -
                             normal.dot(b.positions[i] - target)) *
                            normal;
    }
    const Rational square = squareOf(a, b);
    const TwoBodies both(a, b);
    expectRational(both, square, 4.0);
    (square == 0 ? meet : apart) += 1;
    ASSERT_FALSE(::testing::Test::HasFailure()) << round;
  }
  EXPECT_GT(meet, 100u);
  EXPECT_GT(apart, 100u);
}

TEST(GeometryDistances, WitnessesMeet) {
  // A long edge in the plane of a small triangle meets it far from the edge's middle.
  TestGeometry a, b;
  a.positions = {{0, 0, 0}, {100, 0, 0}, {100, 50, 0}};
  b.positions = {{1, -1, 0}, {2, -1, 0}, {1.5, 1, 0}};
  a.triangles = b.triangles = {{0, 1, 2}};
  const GeometryDistance flat = expectSameAnswers(TwoBodies(a, b), 0.0, 100.0);
  EXPECT_EQ(flat.distance, 0.0);
  EXPECT_LE(flat.a.position[0], 2.0);
  for (const double scale : {1e-305, 1e-200, 1e-163, 1.0, 1e150, 1e299}) {
    a.positions = {{0, 0, 0}, {4 * scale, 0, 0}, {0, 4 * scale, 0}};
    b.positions = {
        {scale, scale, -scale}, {scale, scale, 2 * scale}, {3 * scale, 3 * scale, 2 * scale}};
    const TwoBodies both(a, b);
    const GeometryDistance found = both.octree.queries().distance(both.a, both.b);
    EXPECT_EQ(found.distance, 0.0) << scale;
    EXPECT_LT((found.a.position - found.b.position).cwiseAbs().maxCoeff(), 1e-12 * scale) << scale;
  }
}

TEST(GeometryDistances, TiesGoToTheLowestElements) {
  Random random(207);
  // Two parallel plates of unit cells: every cell is equally near to its opposite.
  const auto plate = [](double z) {
    TestGeometry mesh = testGeometry(sheet(6, 0.0, 0.0));
    for (Vector3d& p : mesh.positions) p = {6 * p[0], 6 * p[1], z};
    return mesh;
  };
  const TestGeometry below = plate(0.0);
  TestGeometry above = plate(0.25);
  std::shuffle(above.triangles.begin(), above.triangles.end(), random);
  const TwoBodies both(below, above);
  const GeometryDistance found = expectSameAnswers(both, 0.0, 6.0);
  EXPECT_EQ(found.distance, 0.25);
  EXPECT_EQ(found.a.element, 0u);
}

/// Triangles around one edge, each with vertices of its own, are all equally near to a point above
/// it. The cost does not follow the number of pairs.
TEST(GeometryDistances, ManyUnweldedTrianglesAroundAnEdge) {
  constexpr std::uint32_t kCount = casesOf(10000);
  std::array<Mesh, 2> wheels;
  for (int side = 0; side < 2; ++side) {
    Mesh& wheel = wheels[static_cast<std::size_t>(side)];
    const double up = side == 0 ? 1.0 : -1.0, height = side == 0 ? 0.0 : 0.5;
    for (std::uint32_t i = 0; i < kCount; ++i) {
      const double angle = 6.0 * i / kCount;
      wheel.positions.insert(wheel.positions.end(),
                             {{0, 0, height},
                              {0, 0, height - up},
                              {std::cos(angle), std::sin(angle), height - 0.5 * up}});
      wheel.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
  }
  OctreeBasedCD collisions;
  const GeometryId a = testGeometry(wheels[0]).addTo(collisions),
                   b = testGeometry(wheels[1]).addTo(collisions);
  const GeometryDistance found = collisions.queries().distance(a, b);
  EXPECT_EQ(found.distance, 0.5);
  EXPECT_EQ(found.a.element, 0u);
  EXPECT_EQ(found.b.element, 0u);
  EXPECT_EQ(found.a.position, Vector3d(0, 0, 0));
  EXPECT_EQ(found.b.position, Vector3d(0, 0, 0.5));
}

/// All elements are nearly at the same distance. Floats cannot tell which pair is the nearest.
TEST(GeometryDistances, OctreesAnswerAsBruteForceForParallelPlates) {
  Random random(210);
  for (int round = 0; round < casesOf(60); ++round) {
    const auto rough = [&] {
      Mesh plate = sheet(9, 0.0, 0.0);
      const double noise = std::exp2(uniform(random, -50, -18));
      for (Vector3d& p : plate.positions) p.z() = noise * uniform(random, -1, 1);
      return testGeometry(plate);
    };
    const TestGeometry a = rough(), b = rough();
    const Matrix3d turn = randomTurn(random);
    Vector3d far = randomPoint(random, -1, 1);
    if (round % 2 == 0) far *= std::exp2(uniform(random, 10, 30));
    const double size = 5.0 + far.norm();
    {
      TwoBodies both(a, b);
      both.put(both.a, a, turn, far, round % 3 == 0);
      both.put(both.b, b, turn, far + turn * Vector3d(0.1, 0.2, 0.3), round % 4 < 2);
      expectSameAnswers(both, 0.0, size);
    }
    for (const AnalyticalGeometry& shape :
         {AnalyticalGeometry(Plane{{0, 0, -0.25}, {0, 0, 1}, false}),
          AnalyticalGeometry(Box{{0.5, 0.5, -0.5}, {2, 2, 0.2}}),
          AnalyticalGeometry(Capsule{{0, 0.5, -0.5}, {1, 0.5, -0.5}, 0.2})}) {
      TwoBodies both(a, shape);
      both.put(both.a, a, turn, far, round % 3 == 0);
      both.change([&](OctreeBasedCD& each) { each.setTransform(both.b, {turn, far}); });
      expectSameAnswers(both, 0.0, size);
    }
    ASSERT_FALSE(::testing::Test::HasFailure()) << round;
  }
}

/// Only rounding decides which of the triangles around a far sphere is the nearest. The nearest
/// corner of each is one of its box.
TEST(GeometryDistances, OctreesAnswerAsBruteForceForTrianglesAtOneDistance) {
  Random random(211);
  for (int round = 0; round < casesOf(300, 80); ++round) {
    const double radius = std::exp2(uniform(random, 26, 36));
    const Vector3d outward = randomPoint(random, -1, 1).normalized(), centre = radius * outward;
    TestGeometry geometry = testGeometry(soup(random, 150, 0.1));
    for (const Triangle& corners : geometry.triangles) {
      const Vector3d at = (centre + randomPoint(random, -1, 1)).normalized() * radius - centre;
      geometry.positions[corners[0]] = at;
      for (const std::size_t i : {1, 2})
        geometry.positions[corners[i]] = at + 0.3 * outward.cwiseProduct(randomPoint(random, 0, 1));
    }
    TwoBodies both(geometry, Sphere{{0, 0, 0}, 0.5});
    both.put(both.a, geometry, Matrix3d::Identity(), centre, round % 2);
    expectSameAnswers(both, 0.0, radius);
    ASSERT_FALSE(::testing::Test::HasFailure()) << round;
  }
}

TEST(GeometryDistances, TwoShapes) {
  Random random(210);
  const std::vector<AnalyticalGeometry> shapes = shapesOfEveryKind(random);
  for (const AnalyticalGeometry& a : shapes)
    for (const AnalyticalGeometry& b : shapes) {
      if (std::holds_alternative<Plane>(a) && std::holds_alternative<Plane>(b)) continue;
      TwoBodies both(a, b);
      for (const double most : {2.0, 0.2}) {
        const PlacedShape placedA{a, randomTurn(random), randomPoint(random, -most, most)},
            placedB{b, randomTurn(random), randomPoint(random, -most, most)};
        both.change([&](OctreeBasedCD& each) {
          each.setTransform(both.a, {placedA.rotation, placedA.translation});
          each.setTransform(both.b, {placedB.rotation, placedB.translation});
        });
        const GeometryDistance found = expectSameAnswers(both, 0.0, 5.0);
        const SpatialQueries queries = both.octree.queries();
        EXPECT_LE(queries.closestPoint(both.a, found.a.position)->distance, 1e-13);
        EXPECT_LE(queries.closestPoint(both.b, found.b.position)->distance, 1e-13);
        if (found.distance == 0.0) continue;
        // The shapes are apart along the points' direction by the distance.
        const Vector3d along = (found.a.position - found.b.position).normalized();
        EXPECT_NEAR(apartAlong(placedA, placedB, along), found.distance, 1e-12);
      }
    }
}

/// A shape is solid: of elements within it the lowest counts, whose own point is the witness.
TEST(GeometryDistances, OfElementsInAShapeAndOfEmptyGeometries) {
  OctreeBasedCD collisions;
  const GeometryId points = collisions.addPointSet(Positions{{0, 0, 0}, {4, 0, 0}}, 0.5),
                   ball = collisions.addAnalyticalGeometry(Sphere{{4, 3, 0}, 1.0}),
                   big = collisions.addAnalyticalGeometry(Sphere{{0, 0, 0}, 50.0}),
                   none = collisions.addPointSet(Positions{});
  const SpatialQueries queries = collisions.queries();
  EXPECT_EQ(queries.distance(big, ball).distance, 0.0);
  const GeometryDistance inside = queries.distance(points, big);
  EXPECT_EQ(inside.distance, 0.0);
  EXPECT_EQ(inside.a.element, 0u);
  EXPECT_EQ(inside.b.position, Vector3d(0, 0, 0));
  for (const GeometryId other : {points, ball}) {
    const GeometryDistance empty = queries.distance(other, none);
    EXPECT_EQ(empty.distance, kInfinity);
    EXPECT_EQ(empty.a.geometry, other);
    EXPECT_EQ(empty.a.element, kNoElement);
    EXPECT_EQ(empty.b.geometry, none);
    EXPECT_EQ(queries.distance(none, other).distance, kInfinity);
  }
}

}  // namespace
}  // namespace palpate::testing
