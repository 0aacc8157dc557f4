#include "Common/BallTruth.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Queries/QueryTruth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

// Rays against solid bodies: lines and points with radii, and analytical shapes. The truth is a
// function that is negative inside, written here, in long double. Along the ray it must be negative
// between a hit that enters and the next one that leaves, and positive elsewhere.
namespace palpate::testing {
namespace {

using Depth = std::function<long double(const Wide&)>;

/// Of lines and points with radii.
Depth depthOf(const TestGeometry& geometry, const Positions& positions) {
  return [&geometry, positions, elements = geometry.elements()](const Wide& x) {
    long double least = INFINITY;
    for (const auto& [p, q, _] : elements) {
      // No ball reaches further than the larger one from the segment's middle.
      const Wide a = wide(positions[p]), b = wide(positions[q]);
      if ((x - (a + b) / 2).norm() - (b - a).norm() / 2 -
              std::max(geometry.radius(p), geometry.radius(q)) >
          least)
        continue;
      least = std::min(least, roundDistance(x, wide(positions[p]), wide(positions[q]),
                                            geometry.radius(p), geometry.radius(q)));
    }
    return least;
  };
}

Depth depthOf(const MeasuredShape& shape) {
  return [&](const Wide& x) { return shape.signedDistance(x.cast<double>()); };
}

/// Expects hits on the surface, and the body between them. error: L.
std::size_t expectBodyBetween(const Both& both, const Ray& ray, const Depth& depth, double length,
                              double error = 1e-9) {
  const std::vector<RayHit> hits = consistentHits(both, ray);
  const auto at = [&](double t) -> Wide {
    return wide(ray.origin) + static_cast<long double>(t) * wide(ray.direction);
  };
  const double speed = ray.direction.stableNorm();
  const double begin = ray.tMin, end = std::min(ray.tMax, ray.tMin + length / speed);
  for (const RayHit& hit : hits) {
    EXPECT_GE(hit.t, ray.tMin);
    EXPECT_LE(hit.t, ray.tMax);
    EXPECT_LT(std::abs(static_cast<double>(depth(at(hit.t)))), error) << hit.t;
  }
  for (std::size_t i = 1; i < hits.size(); ++i) {
    EXPECT_LE(hits[i - 1].t, hits[i].t);
    EXPECT_NE(hits[i - 1].frontFace, hits[i].frontFace);  // in and out in turn
  }
  const bool beginsInside = depth(at(begin)) < 0;
  if (!hits.empty() && std::abs(static_cast<double>(depth(at(begin)))) > error) {
    EXPECT_EQ(hits[0].frontFace, !beginsInside);
  }
  std::size_t next = 0;
  bool inside = hits.empty() ? beginsInside : !hits[0].frontFace;
  for (int i = 0; i <= 400; ++i) {
    const double t = begin + (end - begin) * i / 400;
    for (; next < hits.size() && hits[next].t <= t; ++next) inside = hits[next].frontFace;
    const auto found = static_cast<double>(depth(at(t)));
    if (std::abs(found) <= error) continue;
    EXPECT_EQ(inside, found < 0) << t << ' ' << found;
  }
  return hits.size();
}

Ray randomRay(Random& random) {
  const Vector3d origin = randomPoint(random, -1, 2), target = randomPoint(random, 0, 1);
  return {origin, std::ldexp(1.0, static_cast<int>(random() % 9) - 4) * (target - origin)};
}

TEST(RoundRays, EnterAndLeaveLinesAndPoints) {
  Random random(301);
  std::vector<TestGeometry> geometries{thread(random, 60, 0.2, 0.05, true),
                                       particles(random, 80, 0.08),
                                       tapered(random, thread(random, 60, 0.2, 0.05, false), 0.1),
                                       tapered(random, particles(random, 80, 0.02), 0.15)};
  geometries.push_back(geometries[0]);  // segments without length
  for (std::size_t i = 5; i < 60; i += 10)
    geometries.back().positions[i] = geometries.back().positions[i - 1];
  for (const TestGeometry& geometry : geometries) {
    Both both(geometry);
    std::size_t hits = 0;
    const auto test = [&](const Positions& now, int count) {
      const Depth depth = depthOf(geometry, now);
      for (int i = 0; i < casesOf(count, count / 3); ++i) {
        Ray ray = randomRay(random);
        if (i % 4 == 1) ray.origin = now[random() % now.size()];  // from inside
        if (i % 4 == 2) ray.tMin = 0.5, ray.tMax = 0.9;
        if (i % 4 == 3) ray.tMin = -1.0;
        hits += expectBodyBetween(both, ray, depth, 4.0);
        ASSERT_FALSE(HasFailure()) << i;
      }
    };
    test(geometry.positions, 40);
    const Positions now = moved(random, geometry.positions, 0.05);
    both.change([&](OctreeBasedCD& each) { each.setPositions(both.id, now); });
    test(now, 20);
    const Matrix3d turn = randomTurn(random);
    const Vector3d shift(0.1, 0.05, -0.1);
    both.change([&](OctreeBasedCD& each) { each.setTransform(both.id, {turn, shift}); });
    test(placed(now, turn, shift), 20);
    EXPECT_GE(hits, leastOf(30, 10));
  }
}

TEST(RoundRays, WeightsAreOfTheNearestPointOfTheElement) {
  Random random(305);
  std::size_t hits = 0;
  for (int round = 0; round < casesOf(40); ++round) {
    TestGeometry line{GeometryType::Lines, {}, {}, {{0, 1}, {1, 2}}, {}};
    for (int i = 0; i < 3; ++i) {
      line.positions.push_back(randomPoint(random, 0, 1));
      line.radii.resize(3);
      line.radii[i] = uniform(random, 0.01, 0.1);
    }
    const Both both(line);
    for (int i = 0; i < 20; ++i) {
      const Vector3d through =
          line.positions[1] +
          uniform(random, -1, 1) * (line.positions[i % 2 ? 0 : 2] - line.positions[1]);
      const Vector3d direction = randomPoint(random, -1, 1);
      for (const RayHit& hit : consistentHits(both, {through - 2 * direction, direction})) {
        const auto& [p, q, _] = hit.vertices;
        const Vector3d at = through + (hit.t - 2) * direction;
        const auto along = static_cast<double>(nearestBallOf(wide(at), wide(line.positions[p]),
                                                             wide(line.positions[q]), line.radii[p],
                                                             line.radii[q]));
        // The distance is flat where it is least: bracketing finds the place to half the digits.
        EXPECT_NEAR(hit.weights[1] + hit.weights[2], along, 1e-8);
        EXPECT_NEAR(hit.weights.sum(), 1.0, 1e-15);
        ++hits;
      }
    }
  }
  EXPECT_GE(hits, leastOf(500));
}

/// Those with a volume, in their own frame and in another one.
std::vector<MeasuredShape> roundShapes(Random& random) {
  ConvexHull frustum;
  for (const double x : {-1, 1})
    for (const double y : {-1, 1}) {
      frustum.points.push_back({0.2 * x, 0.1 * y, -0.3});
      frustum.points.push_back({0.5 * x, 0.3 * y, 0.4});
    }
  std::vector<AnalyticalGeometry> kinds = shapesOfEveryKind(random);
  kinds.resize(7);
  kinds.erase(kinds.begin() + 3);  // the plane with two sides
  kinds.push_back(frustum);
  std::vector<MeasuredShape> all;
  for (const AnalyticalGeometry& geometry : kinds) {
    all.push_back({geometry, Matrix3d::Identity(), {0.5, 0.5, 0.5}});
    all.push_back({geometry, randomTurn(random), randomPoint(random, 0.2, 0.8)});
  }
  return all;
}

TEST(RoundRays, EnterAndLeaveShapes) {
  Random random(302);
  for (const MeasuredShape& shape : roundShapes(random)) {
    Both both(shape.geometry);
    both.change([&](OctreeBasedCD& each) {
      each.setTransform(both.id, {shape.rotation, shape.translation});
    });
    const Depth depth = depthOf(shape);
    std::size_t hits = 0;
    for (int i = 0; i < casesOf(60); ++i) {
      Ray ray = randomRay(random);
      if (i % 4 == 1) ray.origin = shape.translation;
      if (i % 4 == 2) ray.tMin = 0.5, ray.tMax = 0.9;
      if (i % 4 == 3) ray.tMin = -1.0;
      if (i % 5 == 0) ray.direction = Vector3d::Unit(i % 3);
      hits += expectBodyBetween(both, ray, depth, 4.0);
      for (const RayHit& hit : consistentHits(both, ray)) {
        EXPECT_EQ(hit.element, kNoElement);
        EXPECT_TRUE(hit.crosses);
      }
      ASSERT_FALSE(HasFailure()) << i << ' ' << shape.geometry.index();
    }
    EXPECT_GE(hits, leastOf(5)) << shape.geometry.index();
  }
}

struct KnownHit {
  double t;
  bool frontFace, crosses = true;
  std::uint32_t element = kNoElement;  ///< kNoElement: any
};

void expectHits(const Both& both, const Ray& ray, const std::vector<KnownHit>& expected) {
  const std::vector<RayHit> hits = consistentHits(both, ray);
  ASSERT_EQ(hits.size(), expected.size());
  for (std::size_t i = 0; i < hits.size(); ++i) {
    EXPECT_EQ(hits[i].t, expected[i].t);
    EXPECT_FALSE(std::signbit(hits[i].t));
    EXPECT_EQ(hits[i].crosses, expected[i].crosses);
    EXPECT_TRUE(!expected[i].crosses || hits[i].frontFace == expected[i].frontFace);
    EXPECT_TRUE(expected[i].element == kNoElement || hits[i].element == expected[i].element);
  }
}

/// Overlapping and touching elements are one body.
TEST(RoundRays, OverlappingElementsAreOneBody) {
  const Both row(TestGeometry{
      GeometryType::Points, {{0, 0, 0}, {1.5, 0, 0}, {3, 0, 0}, {10, 0, 0}}, {}, {}, {1.0}});
  const Vector3d right(1, 0, 0), up(0, 0, 1);
  expectHits(row, {{-3, 0, 0}, right},
             {{2, true, true, 0}, {7, false, true, 2}, {12, true, true, 3}, {14, false, true, 3}});
  // From inside, with ends inside, between two bodies; both ends of a range are included.
  expectHits(row, {{0, 0, 0}, right, 0, 5}, {{4, false}});
  expectHits(row, {{0, 0, 0}, right, 0, 3}, {});
  expectHits(row, {{0, 0, 0}, right, 5, 8}, {});
  expectHits(row, {{0, 0, 0}, right, 4, 9}, {{4, false}, {9, true}});
  expectHits(row, {{0, 5, 0}, right}, {});
  // A ray that starts on the surface of one element, but inside another one, is inside.
  for (const bool isSwapped : {false, true}) {
    TestGeometry balls{GeometryType::Points, {{0, 0, 1}, {0, 0, 0}}, {}, {}, {1.0, 5.0}};
    if (isSwapped) {
      std::swap(balls.positions[0], balls.positions[1]);
      std::swap(balls.radii[0], balls.radii[1]);
    }
    const Both both(balls);
    expectHits(both, {{0, 0, 0}, up}, {{5, false}});
    expectHits(both, {{0, 0, 1}, up, 0, 1}, {});
    expectHits(both, {{0, 0, 1}, up, 1, 1}, {});
    expectHits(both, {{0, 0, 0}, up, 1, 1}, {});
  }
}

TEST(RoundRays, PlanesWithTwoSidesHaveOneHit) {
  const Both plane(AnalyticalGeometry(Plane{{0, 0, 1}, {0, 0, 2}, true}));
  expectHits(plane, {{0, 0, 3}, {0, 0, -1}}, {{2, true}});
  expectHits(plane, {{0, 0, 0}, {0, 0, 4}}, {{0.25, false}});
  expectHits(plane, {{0, 0, 1}, {1, 0, 0}}, {{0, false, false}});
  expectHits(plane, {{0, 0, 1}, {1, 0, 0}, 1, 1}, {{1, false, false}});
  expectHits(plane, {{0, 0, 3}, {1, 0, 0}}, {});
  expectHits(plane, {{0, 0, 1}, {0, 0, 1}}, {{0, false}});
  expectHits(plane, {{0, 0, 1}, {0, 0, -1}}, {{0, true}});
}

/// Small bodies far away, and rays of extreme lengths, keep the accuracy of their coordinates.
TEST(RoundRays, FarAwayAndOfAnyLength) {
  Random random(303);
  const TestGeometry ball{GeometryType::Points, {{0, 0, 0}}, {}, {}, {0.5}};
  const Both both(ball);
  const Depth depth = depthOf(ball, ball.positions);
  for (int i = 0; i < 100; ++i) {
    const double far = std::pow(10.0, uniform(random, 0, 6));
    const Vector3d origin = far * randomPoint(random, -1, 1);
    const Vector3d target = 0.4 * randomPoint(random, -0.5, 0.5);
    for (const int exponent : {-900, 0, 300}) {
      const Ray ray{origin, std::ldexp(1.0, exponent) * (target - origin)};
      const std::vector<RayHit> hits = consistentHits(both, ray);
      ASSERT_EQ(hits.size(), depth(wide(origin)) < 0 ? 1u : 2u);
      for (const RayHit& hit : hits) {
        const Vector3d at = std::ldexp(hit.t, exponent) * (target - origin) + origin;
        EXPECT_NEAR(at.norm(), 0.5, 1e-12 * (1 + far));
      }
    }
  }
}

/// Bodies of any type whose surface is at height 1 over the origin, which is inside.
std::vector<Both> bodiesAboutTheOrigin() {
  std::vector<Both> bodies;
  for (const AnalyticalGeometry& shape : {AnalyticalGeometry(Sphere{{0, 0, 0}, 1}),
                                          AnalyticalGeometry(Capsule{{-1, 0, 0}, {1, 0, 0}, 1}),
                                          AnalyticalGeometry(Box{{0, 0, 0}, {1, 1, 1}}),
                                          AnalyticalGeometry(Cylinder{{0, 0, -1}, {0, 0, 1}, 1}),
                                          AnalyticalGeometry(Plane{{0, 0, 1}, {0, 0, 1}, false})})
    bodies.emplace_back(shape);
  bodies.emplace_back(TestGeometry{GeometryType::Points, {{0, 0, 0}}, {}, {}, {1.0}});
  bodies.emplace_back(
      TestGeometry{GeometryType::Lines, {{-1, 0, 0}, {1, 0, 0}}, {}, {{0, 1}}, {1.0}});
  bodies.emplace_back(cube(-1.0, 1.0));
  return bodies;
}

/// A parameter is finite: what a ray meets beyond the largest double is no hit.
TEST(RoundRays, NoHitsBeyondTheLargestDouble) {
  for (const Both& body : bodiesAboutTheOrigin()) {
    const auto hits = [&](const Vector3d& origin, double length) {
      return consistentHits(body, {origin, {0, 0, -length}});
    };
    const Vector3d above(0, 0, 1e10), inside(0, 0, 0);
    EXPECT_EQ(hits(above, 1e-290).size(), hits(above, 1).size());
    EXPECT_EQ(hits(inside, 1e-300).size(), hits(inside, 1).size());
    for (const RayHit& hit : hits(above, 1e-290)) EXPECT_TRUE(std::isfinite(hit.t));
    EXPECT_TRUE(hits(above, 1e-300).empty());
    EXPECT_TRUE(hits(inside, 1e-310).empty());
    EXPECT_FALSE(body.octree.queries().pick({above, {0, 0, -1e-300}}));
    RayHit batch[1];
    body.octree.queries().firstHits(body.id, std::vector<Ray>{{above, {0, 0, -1e-300}}}, batch);
    EXPECT_TRUE(std::isinf(batch[0].t));
  }
}

/// As of a closed mesh: the hit where a ray starts or ends enters or leaves.
TEST(RoundRays, StartsAndEndsOnSurfaces) {
  const std::vector<Both> bodies = bodiesAboutTheOrigin();
  for (std::size_t i = 0; i < std::size(bodies); ++i) {
    SCOPED_TRACE(i);
    const auto expectOne = [&](const Ray& ray, double t, bool frontFace) {
      expectHits(bodies[i], ray, {{t, frontFace}});
      EXPECT_EQ(bodies[i].octree.queries().pick(ray, true).has_value(), frontFace);
    };
    expectOne({{0, 0, 1}, {0, 0, 1}}, 0, false);          // starts outward
    expectOne({{0, 0, 1}, {0, 0, -1}, 0, 0.5}, 0, true);  // starts inward
    expectOne({{0, 0, 3}, {0, 0, -1}, 0, 2}, 2, true);    // ends where it enters
    expectOne({{0, 0, 0}, {0, 0, 1}, 0, 1}, 1, false);    // ends where it leaves
    expectOne({{0, 0, 3}, {0, 0, -1}, 2, 2}, 2, true);
    expectOne({{0, 0, 0}, {0, 0, 1}, 1, 1}, 1, false);
    if (i == 0 || i == 5) expectHits(bodies[i], {{1, 0, 5}, {0, 0, -1}}, {{5, true, false}});
  }
}

/// Scaled by a power of two, a body and a ray have the same hits.
TEST(RoundRays, AnyMagnitude) {
  const auto scaledBodies = [](double s) {
    std::vector<Both> bodies;
    for (const AnalyticalGeometry& shape :
         {AnalyticalGeometry(Sphere{{0, 0, 0}, 2 * s}),
          AnalyticalGeometry(Capsule{{-s, 0, 0}, {s, 0, 0}, 2 * s}),
          AnalyticalGeometry(Cylinder{{-s, 0, -2 * s}, {0, s, 2 * s}, 3 * s})})
      bodies.emplace_back(shape);
    const Positions ends{{-s, 0, 0}, {s, s, 0}};
    bodies.emplace_back(TestGeometry{GeometryType::Points, ends, {}, {}, {2 * s}});
    bodies.emplace_back(TestGeometry{GeometryType::Lines, ends, {}, {{0, 1}}, {2 * s}});
    bodies.emplace_back(TestGeometry{GeometryType::Lines, ends, {}, {{0, 1}}, {2 * s, s}});
    return bodies;
  };
  Random random(304);
  std::vector<Ray> rays;
  for (int i = 0; i < 20; ++i) {
    const Vector3d origin = randomPoint(random, -9, 9);
    rays.push_back({origin, randomPoint(random, -1, 1) - origin});
  }
  const std::vector<Both> unscaled = scaledBodies(1.0);
  for (const int exponent : {-1000, -800, -540, -520, 505, 520, 800, 980}) {
    const double s = std::ldexp(1.0, exponent);
    const std::vector<Both> bodies = scaledBodies(s);
    for (std::size_t i = 0; i < bodies.size(); ++i)
      for (const Ray& ray : rays) {
        const auto expected = consistentHits(unscaled[i], ray),
                   hits = consistentHits(bodies[i], {s * ray.origin, s * ray.direction});
        ASSERT_EQ(hits.size(), expected.size()) << exponent << ' ' << i;
        for (std::size_t k = 0; k < hits.size(); ++k)
          EXPECT_NEAR(hits[k].t, expected[k].t, 1e-14) << exponent << ' ' << i;
      }
  }
}

}  // namespace
}  // namespace palpate::testing
