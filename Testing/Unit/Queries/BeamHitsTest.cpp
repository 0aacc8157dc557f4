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

// Neighbouring rays search together: firstHits() and allHits() of such batches have the bits of
// single calls, and the hits of rational arithmetic.
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

/// Bundles about rays from anywhere, from and to vertices, along edges and axes, and in planes of
/// triangles. Their ranges end anywhere, at hits, or have no length.
Rays bundlesFor(Random& random, const Positions& positions, std::span<const Triangle> elements,
                double step, std::size_t count) {
  const auto corner = [&] { return positions[elements[random() % elements.size()][random() % 3]]; };
  Rays rays;
  while (rays.size() < count) {
    const auto& [i, j, k] = elements[random() % elements.size()];
    const Vector3d p = positions[i], q = positions[j], r = positions[k], middle = (p + q + r) / 3;
    Ray ray{middle + randomPoint(random, -2, 2), {0, 0, 0}};
    const unsigned kind = random() % 8;
    if (kind == 1) ray.origin = corner();
    if (kind == 2) ray.origin = middle;
    if (kind == 3) ray.origin = middle + 500 * randomPoint(random, -1, 1);
    ray.direction = corner() - ray.origin;
    if (kind == 4) ray = {p - 2 * (q - p), q - p};
    if (kind == 5) ray = {p + (p - q) + 0.5 * (p - r), (q - p) + 0.5 * (r - q)};
    if (kind >= 6) {
      ray.direction = Vector3d::Unit(static_cast<Eigen::Index>(random() % 3));
      ray.direction *= random() % 2 ? 2.0 : -0.5;
      ray.origin = corner() - 2 * ray.direction;
    }
    const double atCorner = (corner() - ray.origin).norm() / ray.direction.norm();
    switch (random() % 5) {
      case 0:
        ray.tMin = uniform(random, -1, 1);
        break;
      case 1:
        ray.tMax = std::isfinite(atCorner) ? atCorner : 1.0;
        break;
      case 2:
        if (std::isfinite(atCorner)) ray.tMin = ray.tMax = atCorner;
        break;
      default:
        break;
    }
    if (ray.direction != Vector3d::Zero()) addBundle(random, ray, step, rays);
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

/// Every type: triangles in general position, on a lattice, without area, far away; and others,
/// which search one by one.
std::vector<TestGeometry> everyGeometry(Random& random) {
  std::vector<TestGeometry> all{testGeometry(sphere(20, 30, {0.5, 0.5, 0.5}, 0.4)),
                                testGeometry(soup(random, 200, 0.2)),
                                latticeSoup(random, 60, 4),
                                testGeometry(sheet(16, 0.5, 0.0)),
                                thread(random, 80, 0.1, 0.0, true),
                                thread(random, 80, 0.1, 0.01, false),
                                tapered(random, particles(random, 60, 0.0), 0.05)};
  all.push_back(all[0]);
  for (Vector3d& p : all.back().positions) p += Vector3d(1e3, -2e3, 5e2);
  all.push_back(all[1]);
  for (std::size_t i = 0; i < 600; i += 9) {
    Positions& p = all.back().positions;
    p[i + 2] = i % 2 ? p[i] : Vector3d(2 * p[i + 1] - p[i]);
  }
  all.push_back(all[0]);  // each triangle twice
  all.back().triangles.insert(all.back().triangles.end(), all[0].triangles.begin(),
                              all[0].triangles.end());
  return all;
}

TEST(BeamHits, AreThoseOfSingleCallsOnEveryPath) {
  Random random(401);
  const Matrix3d turn = Eigen::AngleAxisd(0.7, Vector3d(1, 2, 2) / 3).toRotationMatrix();
  for (const TestGeometry& geometry : everyGeometry(random))
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
        EXPECT_GE(hits, leastOf(30, 5));
        if (HasFailure()) return;
      }
      useSimdPath("");
    }
}

TEST(BeamHits, AreThoseOfRationalArithmetic) {
  Random random(402);
  std::size_t hits = 0;
  for (const TestGeometry& geometry : everyGeometry(random)) {
    if (geometry.type != GeometryType::Triangles) continue;
    const Both both(geometry);
    const Rays rays =
        bundlesFor(random, geometry.positions, geometry.triangles, 0.25, casesOf(300, 100));
    hits += expectSingle(both.octree.queries(), both.id, rays);
    std::vector<RayHit> all, byBruteForce;
    std::vector<std::size_t> begins, beginsByBruteForce;
    both.octree.queries().allHits(both.id, rays, all, begins);
    both.bruteForce.queries().allHits(both.id, rays, byBruteForce, beginsByBruteForce);
    ASSERT_EQ(begins, beginsByBruteForce);
    ASSERT_TRUE(isSame(all, byBruteForce));
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const auto truth = hitsOf(rays[i], geometry.positions, geometry.triangles);
      ASSERT_EQ(begins[i + 1] - begins[i], truth.size()) << i;
      for (std::size_t h = 0; h < truth.size(); ++h)
        ASSERT_EQ(all[begins[i] + h].element, truth[h].element) << i;
    }
  }
  EXPECT_GE(hits, leastOf(1000, 300));
}

/// A raster of a sphere of 40,000 triangles, and a fan from inside.
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

TEST(BeamHits, NeighbouringRaysSearchTogether) {
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  const Mesh ball = sphere(141, 142, {0.5, 0.5, 0.5}, 0.4);
  const GeometryId id = collisions.addTriangleMesh(ball.positions, ball.triangles);
  const SpatialQueries queries = collisions.queries();
  BeamHits::Scratch scratch;
  BeamHits beam(SpatialQueries::Source::of(queries).at(id), scratch);
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
}

TEST(BeamHits, RaysWithoutOrderSearchOneByOne) {
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  const Mesh ball = sphere(141, 142, {0.5, 0.5, 0.5}, 0.4);
  const GeometryId id = collisions.addTriangleMesh(ball.positions, ball.triangles);
  const SpatialQueries queries = collisions.queries();
  BeamHits::Scratch scratch;
  BeamHits beam(SpatialQueries::Source::of(queries).at(id), scratch);
  Random random(403);
  for (int i = 0; i < 1000; ++i) {
    Rays rays;
    for (int k = 0; k < 16; ++k)
      rays.push_back({randomPoint(random, -1, 2), randomPoint(random, -1, 1)});
    EXPECT_EQ(beam.start(rays), 0u);
  }
}

TEST(BeamHits, ASteadyBatchAllocatesNothing) {
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  const Mesh ball = sphere(30, 40, {0.5, 0.5, 0.5}, 0.4);
  const GeometryId id = collisions.addTriangleMesh(ball.positions, ball.triangles);
  const SpatialQueries queries = collisions.queries();
  const Rays rays = imageRays();
  std::vector<RayHit> first(rays.size()), all;
  std::vector<std::size_t> begins;
  const auto run = [&] {
    queries.firstHits(id, rays, first);
    queries.allHits(id, rays, all, begins);
  };
  run();
  run();  // the vectors of the caller and of the library change places
  FailingAllocation::arm(0);
  run();
  FailingAllocation::disarm();
  EXPECT_EQ(FailingAllocation::count(), 0u);
  EXPECT_GE(all.size(), 5000u);
}

TEST(BeamHits, ARefusedBatchWritesNothing) {
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  const Mesh ball = sphere(30, 40, {0.5, 0.5, 0.5}, 0.4);
  const GeometryId id = collisions.addTriangleMesh(ball.positions, ball.triangles);
  const SpatialQueries queries = collisions.queries();
  Rays rays = imageRays();
  rays[20].origin[1] = kInfinity;
  const std::vector<RayHit> before{{id, 7, {1, 2, 3}, {0, 1, 0}, 4.0, true, true}};
  std::vector<RayHit> all = before;
  std::vector<std::size_t> begins{5, 6};
  expectRefused(ErrorCode::NonFinitePosition, "ray 20 ",
                [&] { queries.allHits(id, rays, all, begins); });
  rays.resize(15);
  FailingAllocation::arm(1);
  EXPECT_THROW(queries.allHits(id, rays, all, begins), std::bad_alloc);
  FailingAllocation::disarm();
  EXPECT_TRUE(isSame(all, before));
  EXPECT_EQ(begins, (std::vector<std::size_t>{5, 6}));
}

}  // namespace
}  // namespace palpate::testing
