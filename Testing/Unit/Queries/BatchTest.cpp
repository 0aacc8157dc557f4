#include "Common/ExpectRefused.h"
#include "Common/Sanitized.h"
#include "Core/SimdPath.h"
#include "Unit/Queries/QueryTruth.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

// Batch calls, in which several queries take turns in large geometries: each answer has the bits of
// the single call, on every SIMD path.
namespace palpate::testing {
namespace {

constexpr std::size_t kSizes[] = {0, 1, 3, 7, 8, 9, 16, 17, 50, 99, 1000};

/// Large enough that queries take turns.
std::vector<TestGeometry> largeGeometries() {
  Random random(301);
  return {testGeometry(sphere(131, 120, {0.5, 0.5, 0.5}, 0.4)),
          testGeometry(soup(random, 30'000, 0.02)), thread(random, 30'000, 0.02, 0.001, true),
          tapered(random, particles(random, 30'000, 0.0), 0.01)};
}

/// Some begin far away, miss, end before they hit, or meet vertices and edges.
std::vector<Ray> raysFor(Random& random, const TestGeometry& geometry, std::size_t count) {
  const auto vertex = [&] { return geometry.positions[random() % geometry.positions.size()]; };
  std::vector<Ray> rays;
  while (rays.size() < count) {
    Ray ray{randomPoint(random, -1, 2), vertex()};
    const std::size_t kind = rays.size() % 6;
    if (kind == 1) ray.direction = randomPoint(random, 0, 1);
    if (kind == 2) ray.direction = 0.5 * (ray.direction + vertex());
    if (kind == 3) ray.origin = 1e3 * randomPoint(random, -1, 1);
    if (kind == 4) ray.origin = vertex();
    ray.direction -= ray.origin;
    if (kind == 5) ray.direction = randomPoint(random, -1, 1);
    if (random() % 3 == 0) ray.tMin = uniform(random, -1, 1);
    if (random() % 3 == 0) ray.tMax = ray.tMin + uniform(random, 0, 1);
    if (ray.direction != Vector3d::Zero()) rays.push_back(ray);
  }
  return rays;
}

/// Some are vertices, far away, equally far from many elements, or near the point before.
Positions pointsFor(Random& random, const TestGeometry& geometry, std::size_t count) {
  Positions points;
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3d p = geometry.positions[random() % geometry.positions.size()];
    if (i % 6 == 0) points.push_back(p);
    if (i % 6 == 1) points.push_back(p + randomPoint(random, -0.01, 0.01));
    if (i % 6 == 2) points.push_back(randomPoint(random, 0, 1));
    if (i % 6 == 3) points.push_back(randomPoint(random, -100, 100));
    if (i % 6 == 4) points.push_back({0.5, 0.5, uniform(random, 0, 1)});  // on the sphere's axis
    if (i % 6 == 5)
      points.push_back(points.back() + (i % 4 == 1 ? 0.0 : 1.0) * Vector3d(1e-9, 0, 1e-3));
  }
  return points;
}

/// Calls f(queries, geometry, id) for each geometry, SIMD path, and number of threads.
template <class F>
void forLargeGeometries(F&& f) {
  const Matrix3d turn = Eigen::AngleAxisd(0.7, Vector3d(1, 2, 2) / 3).toRotationMatrix();
  for (const TestGeometry& geometry : largeGeometries())
    for (const int threads : {1, 3}) {
      OctreeBasedCD collisions(settingsOf(Engine::Octree, threads));
      const GeometryId id = geometry.addTo(collisions);
      if (threads == 3) collisions.setTransform(id, {turn, {0.1, -0.2, 0.1}});
      for (const std::string& path : simdPaths()) {
        SCOPED_TRACE(path);
        useSimdPath(path);
        f(collisions.queries(), geometry, id);
      }
    }
  useSimdPath("");
}

TEST(Batch, FirstHitsAreThoseOfSingleCalls) {
  std::size_t hits = 0, misses = 0;
  forLargeGeometries(
      [&](const SpatialQueries& queries, const TestGeometry& geometry, GeometryId id) {
        Random random(302);
        for (const std::size_t size : kSizes) {
          const std::vector<Ray> rays = raysFor(random, geometry, size);
          std::vector<RayHit> out(size);
          queries.firstHits(id, rays, out);
          for (std::size_t i = 0; i < size; ++i) {
            const auto hit = queries.firstHit(id, rays[i]);
            const RayHit none{id, kNoElement, {}, {0, 0, 0}, kInfinity, false, false};
            ASSERT_TRUE(isSame(out[i], hit.value_or(none))) << size << ' ' << i;
            ++(hit ? hits : misses);
          }
        }
      });
  EXPECT_GE(hits, 1000u);
  EXPECT_GE(misses, 1000u);
}

TEST(Batch, ClosestPointsAreThoseOfSingleCalls) {
  std::size_t misses = 0;
  forLargeGeometries(
      [&](const SpatialQueries& queries, const TestGeometry& geometry, GeometryId id) {
        Random random(303);
        for (const std::size_t size : kSizes) {
          const double limits[] = {0.01, 0.0, 1.0, kInfinity}, most = limits[size % 4];
          const Positions points = pointsFor(random, geometry, size);
          std::vector<SurfacePoint> out(size);
          queries.closestPoints(id, points, out, most);
          for (std::size_t i = 0; i < size; ++i) {
            const auto nearest = queries.closestPoint(id, points[i], most);
            const SurfacePoint none{id, kNoElement, {}, {0, 0, 0}, {0, 0, 0}, kInfinity};
            ASSERT_TRUE(isSame(out[i], nearest.value_or(none))) << size << ' ' << most << ' ' << i;
            misses += !nearest;
          }
        }
      });
  EXPECT_GE(misses, 1000u);
}

TEST(Batch, SignedDistancesAreThoseOfSingleCalls) {
  forLargeGeometries(
      [&](const SpatialQueries& queries, const TestGeometry& geometry, GeometryId id) {
        if (geometry.type != GeometryType::Triangles) return;
        const bool isClosed = geometry.triangles[0][0] == geometry.triangles[1][0];  // the sphere
        Random random(304);
        for (const InsideRule rule : {InsideRule::Closed, InsideRule::WindingNumber}) {
          if (rule == InsideRule::Closed && !isClosed) continue;
          for (const std::size_t size : {0, 1, 9, isLongRun() ? 200 : casesOf(50)}) {
            Positions points = pointsFor(random, geometry, size);
            for (std::size_t i = size / 2; i + 1 < size; ++i)  // a path through the surface
              points[i + 1] = points[i] + randomPoint(random, -0.1, 0.1);
            std::vector<SignedDistance> out(size);
            queries.signedDistances(id, points, out, {rule});
            for (std::size_t i = 0; i < size; ++i)
              ASSERT_TRUE(isSame(out[i], queries.signedDistance(id, points[i], {rule}))) << i;
          }
        }
      });
}

TEST(Batch, ARefusedQueryWritesNothing) {
  const TestGeometry geometry = testGeometry(sphere(131, 120, {0.5, 0.5, 0.5}, 0.4));
  OctreeBasedCD collisions;
  const GeometryId id = geometry.addTo(collisions);
  const SpatialQueries queries = collisions.queries();
  Random random(305);
  std::vector<Ray> rays = raysFor(random, geometry, 40);
  rays[20].origin[1] = std::numeric_limits<double>::quiet_NaN();
  Positions points = pointsFor(random, geometry, 40);
  points[20][2] = kInfinity;
  const RayHit hit{id, 7, {1, 2, 3}, {0, 1, 0}, 4.0, true, true};
  const SurfacePoint point{id, 7, {1, 2, 3}, {0, 1, 0}, {4, 5, 6}, 8.0};
  std::vector<RayHit> hits(40, hit);
  std::vector<SurfacePoint> nearest(40, point);
  std::vector<SignedDistance> distances(40, {point, 9.0});
  expectRefused(ErrorCode::NonFinitePosition, "ray 20 ",
                [&] { queries.firstHits(id, rays, hits); });
  expectRefused(ErrorCode::NonFinitePosition, "point 20 ",
                [&] { queries.closestPoints(id, points, nearest); });
  expectRefused(ErrorCode::NonFinitePosition, "point 20 ",
                [&] { queries.signedDistances(id, points, distances); });
  EXPECT_TRUE(isSame(hits, std::vector<RayHit>(40, hit)));
  EXPECT_TRUE(isSame(nearest, std::vector<SurfacePoint>(40, point)));
  EXPECT_TRUE(isSame(distances, std::vector<SignedDistance>(40, {point, 9.0})));
}

}  // namespace
}  // namespace palpate::testing
