#include "Common/ExpectRefused.h"
#include "Common/FailingAllocation.h"
#include "Common/Sanitized.h"
#include "Core/SimdPath.h"
#include "Queries/QuerySource.h"
#include "Unit/Queries/QueryTruth.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

// Batches: neighbouring rays search together, and several queries take turns in large geometries.
// Each answer has the bits of the single call, on every SIMD path.
namespace palpate::testing {
namespace {

using Rays = std::vector<Ray>;

/// A raster or a fan about a ray: rays whose origins or directions are a grid of `step`.
void addBundle(Random& random, const Ray& ray, double step, Rays& rays) {
  const std::size_t wide = 1 + random() % 40, high = 1 + random() % 3;
  const Eigen::Vector3d u = randomPoint(random, -1, 1), v = randomPoint(random, -1, 1);
  const unsigned kind = random() % 4;
  for (std::size_t y = 0; y < high; ++y)
    for (std::size_t x = 0; x < wide; ++x) {
      // On axes, so that rays on a lattice meet edges and vertices.
      const Vector3d aside = kind < 2 ? Vector3d(step * double(x), step * double(y), 0)
                                      : Vector3d(step * (double(x) * u + double(y) * v));
      Ray next = ray;
      (kind % 2 ? next.origin : next.direction) += aside;
      if (next.direction != Vector3d::Zero()) rays.push_back(next);
    }
}

/// Bundles about rays whose ranges end anywhere, at corners, or have no length.
Rays bundlesFor(Random& random, const Positions& positions, std::span<const Triangle> elements,
                double step, std::size_t count) {
  Rays rays;
  while (rays.size() < count) {
    Ray ray = hardRay(random, positions, elements);
    const Vector3d corner = positions[elements[random() % elements.size()][random() % 3]];
    const double atCorner = (corner - ray.origin).norm() / ray.direction.norm();
    const unsigned kind = random() % 5;
    if (kind == 0) ray.tMin = uniform(random, -1, 1);
    if (kind == 1 || kind == 2) ray.tMax = std::isfinite(atCorner) ? atCorner : 1.0;
    if (kind == 2) ray.tMin = ray.tMax;
    addBundle(random, ray, step, rays);
  }
  return rays;
}

/// Expects that a batch answers as single calls do. Returns the number of hits.
std::size_t expectSingle(const SpatialQueries& queries, GeometryId id, const Rays& rays) {
  std::vector<RayHit> first(rays.size()), all(1), single;
  std::vector<std::size_t> begins(1);
  queries.firstHits(id, rays, first);
  queries.allHits(id, rays, all, begins);
  EXPECT_EQ(begins.size(), rays.size() + 1);
  EXPECT_EQ(begins.front(), 0u);
  EXPECT_EQ(begins.back(), all.size());
  const RayHit none{id, kNoElement, {}, {0, 0, 0}, kInfinity, false, false};
  for (std::size_t i = 0; i < rays.size() && !::testing::Test::HasFailure(); ++i) {
    EXPECT_TRUE(isSame(first[i], queries.firstHit(id, rays[i]).value_or(none))) << i;
    queries.allHits(id, rays[i], single);
    const std::span hits = std::span(all).subspan(begins[i], begins[i + 1] - begins[i]);
    EXPECT_TRUE(isSame(std::vector<RayHit>(hits.begin(), hits.end()), single)) << i;
  }
  return all.size();
}

TEST(BeamHits, AreThoseOfSingleCallsOnEveryPath) {
  Random random(401);
  const Matrix3d turn = Eigen::AngleAxisd(0.7, Vector3d(1, 2, 2) / 3).toRotationMatrix();
  std::vector<TestGeometry> geometries = hardGeometries(random);
  std::size_t all = 0;
  geometries.push_back(thread(random, 80, 0.1, 0.01, false));  // search one by one
  geometries.push_back(tapered(random, particles(random, 60, 0.0), 0.05));
  for (const TestGeometry& geometry : geometries)
    for (const int threads : {1, 2, 8}) {
      OctreeBasedCD collisions(settingsOf(Engine::Octree, threads));
      const GeometryId id = geometry.addTo(collisions);
      Positions now = geometry.positions;
      if (threads == 2) {
        collisions.setTransform(id, {turn, {0.1, -0.2, 0.1}});
        now = placed(now, turn, {0.1, -0.2, 0.1});
      }
      if (threads == 8) {
        now = moved(random, now, 0.01);
        collisions.setPositions(id, now);
      }
      const std::vector<Triangle> elements = geometry.elements();
      std::vector<Rays> bundles;
      for (const double step : {1e-3, 0.02, 0.5})
        bundles.push_back(bundlesFor(random, now, elements, step, casesOf(600, 200)));
      for (const std::string& path : simdPaths()) {
        SCOPED_TRACE(path + ' ' + std::to_string(threads));
        useSimdPath(path);
        std::size_t hits = 0;
        for (const Rays& rays : bundles) hits += expectSingle(collisions.queries(), id, rays);
        EXPECT_GE(hits, leastOf(1));
        all += hits;
        if (HasFailure()) return;
      }
      useSimdPath("");
    }
  EXPECT_GE(all, leastOf(10000, 1000));
}

struct BallOfBeams {
  explicit BallOfBeams(std::uint32_t rings)
      : id(addTo(collisions, sphere(rings, rings, {0.5, 0.5, 0.5}, 0.4))) {}
  OctreeBasedCD collisions{settingsOf(Engine::Octree)};
  GeometryId id;
  const SpatialQueries queries = collisions.queries();
};

/// A raster of the ball, and a fan from inside.
Rays imageRays() {
  Rays rays;
  for (int y = 0; y < 40; ++y)
    for (int x = 0; x < 100; ++x)
      rays.push_back({{0.1 + 0.008 * x, 0.1 + 0.02 * y, -1}, {0.01, 0.02, 1}});
  for (int y = 0; y < 10; ++y)
    for (int x = 0; x < 100; ++x)
      rays.push_back(
          {{0.513, 0.5, 0.3}, {std::sin(0.02 * x - 1), 0.1 * y - 0.47, std::cos(0.02 * x - 1)}});
  return rays;
}

TEST(BeamHits, OnlyNeighbouringRaysSearchTogether) {
  const BallOfBeams ball(141);
  BeamHits::Scratch scratch;
  BeamHits beam(SpatialQueries::Source::of(ball.queries).at(ball.id), scratch);
  const Rays rays = imageRays();
  std::size_t together = 0, beams = 0, hits = 0;
  for (std::size_t i = 0; i < rays.size();) {
    const std::size_t count = beam.start(std::span(rays).subspan(i));
    together += count;
    beams += count > 0;
    if (count > 0)
      beam.first([&](std::size_t, const RayHit&) { ++hits; }, [](std::size_t) {},
                 [&](std::size_t) { FAIL(); });
    i += std::max<std::size_t>(count, 1);
  }
  EXPECT_GE(together, 4950u);
  EXPECT_LE(beams, 400u);
  EXPECT_GE(hits, 3000u);
  Random random(403);
  for (int i = 0; i < 1000; ++i) {
    Rays others(16);
    for (Ray& ray : others) {
      ray.origin = randomPoint(random, -1, 2);
      ray.direction = randomPoint(random, -1, 1);
    }
    EXPECT_EQ(beam.start(others), 0u);
  }
}

TEST(BeamHits, ASteadyBatchAllocatesNothingAndARefusedOneWritesNothing) {
  const BallOfBeams ball(30);
  Rays rays = imageRays();
  std::vector<RayHit> first(rays.size()), all;
  std::vector<std::size_t> begins;
  const auto run = [&] {
    ball.queries.firstHits(ball.id, rays, first);
    ball.queries.allHits(ball.id, rays, all, begins);
  };
  run();
  run();  // the vectors of the caller and of the library change places
  FailingAllocation::arm(0);
  run();
  FailingAllocation::disarm();
  EXPECT_EQ(FailingAllocation::count(), 0u);
  EXPECT_GE(all.size(), 5000u);

  const BallOfBeams other(30);
  const std::vector<RayHit> before{{other.id, 7, {1, 2, 3}, {0, 1, 0}, 4.0, true, true}};
  std::vector<RayHit> kept = before;
  std::vector<std::size_t> keptBegins{5, 6};
  const auto allHits = [&] { other.queries.allHits(other.id, rays, kept, keptBegins); };
  rays[20].origin[1] = kInfinity;
  expectRefused(ErrorCode::NonFinitePosition, "ray 20 ", allHits);
  rays.resize(15);
  EXPECT_TRUE(FailingAllocation::throwsAt(1, allHits));
  EXPECT_TRUE(isSame(kept, before));
  EXPECT_EQ(keptBegins, (std::vector<std::size_t>{5, 6}));
}

constexpr std::size_t kSizes[] = {0, 1, 3, 7, 8, 9, 16, 17, 50, 250};

/// Large enough that queries take turns.
std::vector<TestGeometry> largeGeometries() {
  Random random(301);
  return {testGeometry(sphere(131, 120, {0.5, 0.5, 0.5}, 0.4)),
          testGeometry(soup(random, 30'000, 0.02)), thread(random, 30'000, 0.02, 0.001, true),
          tapered(random, particles(random, 30'000, 0.0), 0.01)};
}

/// Some end before they hit.
std::vector<Ray> raysFor(Random& random, const TestGeometry& geometry, std::size_t count) {
  const std::vector<Triangle> elements = geometry.elements();
  std::vector<Ray> rays;
  while (rays.size() < count) {
    rays.push_back(hardRay(random, geometry.positions, elements));
    if (random() % 3 == 0) rays.back().tMin = uniform(random, -1, 1);
    if (random() % 3 == 0) rays.back().tMax = rays.back().tMin + uniform(random, 0, 1);
  }
  return rays;
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

TEST(Batch, FirstHitsAndClosestPointsAreThoseOfSingleCalls) {
  std::size_t hits = 0, noHits = 0, noPoints = 0;
  forLargeGeometries([&](const SpatialQueries& queries, const TestGeometry& geometry,
                         GeometryId id) {
    Random random(302);
    for (const std::size_t size : kSizes) {
      const std::vector<Ray> rays = raysFor(random, geometry, size);
      std::vector<RayHit> first(size);
      queries.firstHits(id, rays, first);
      const double limits[] = {0.01, 0.0, 1.0, kInfinity}, most = limits[size % 4];
      const Positions points =
          hardPoints(random, geometry.positions, geometry.elements(), static_cast<int>(size));
      std::vector<SurfacePoint> closest(size);
      queries.closestPoints(id, points, closest, most);
      for (std::size_t i = 0; i < size; ++i) {
        const auto hit = queries.firstHit(id, rays[i]);
        const RayHit noHit{id, kNoElement, {}, {0, 0, 0}, kInfinity, false, false};
        ASSERT_TRUE(isSame(first[i], hit.value_or(noHit))) << size << ' ' << i;
        ++(hit ? hits : noHits);
        const auto nearest = queries.closestPoint(id, points[i], most);
        const SurfacePoint none{id, kNoElement, {}, {0, 0, 0}, {0, 0, 0}, kInfinity};
        ASSERT_TRUE(isSame(closest[i], nearest.value_or(none))) << size << ' ' << most << ' ' << i;
        noPoints += !nearest;
      }
    }
  });
  EXPECT_GE(hits, 1000u);
  EXPECT_GE(noHits, 1000u);
  EXPECT_GE(noPoints, 500u);
}

}  // namespace
}  // namespace palpate::testing
