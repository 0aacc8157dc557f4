#include "Common/ObjText.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Core/SimdPath.h"
#include "Unit/Queries/QueryTruth.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

// Rays against triangles, lines and points without radius: every hit is that of rational
// arithmetic, octrees answer as brute force bit by bit, and no ray leaks out of a closed mesh.
namespace palpate::testing {
namespace {

/// Expects the hits of rational arithmetic. `elements` at `positions` are those of the geometry.
std::size_t expectExact(const Both& both, const Positions& positions,
                        std::span<const Triangle> elements, const Ray& ray) {
  const std::vector<RayHit> hits = consistentHits(both, ray);
  const std::vector<RationalHit> truth = hitsOf(ray, positions, elements);
  EXPECT_EQ(hits.size(), truth.size());
  for (std::size_t i = 0; i < std::min(hits.size(), truth.size()); ++i) {
    const RayHit& hit = hits[i];
    EXPECT_EQ(hit.geometry, both.id);
    EXPECT_EQ(hit.element, truth[i].element);
    if (hit.element >= elements.size()) continue;
    const Triangle& vertices = elements[hit.element];
    EXPECT_EQ(hit.vertices, vertices);
    const auto& [a, b, c] = vertices;
    double extent = 0.0;
    for (const std::uint32_t v : vertices)
      extent = std::max(extent, (positions[v] - ray.origin).cwiseAbs().maxCoeff());
    const double most = ray.direction.cwiseAbs().maxCoeff();
    const double error = Rational(hit.t - truth[i].first).get_d();
    EXPECT_LE(std::abs(error) * most, 1e-15 * extent + 2.3e-16 * std::abs(hit.t) * most);
    EXPECT_EQ(hit.frontFace, facingOf(ray, positions, vertices) < 0);
    EXPECT_NEAR(hit.weights.sum(), 1.0, 1e-15);
    EXPECT_GE(hit.weights.minCoeff(), 0.0);
    const Vector3d at = hit.weights[0] * positions[a] + hit.weights[1] * positions[b] +
                        hit.weights[2] * positions[c];
    EXPECT_LE((at - ray.origin - hit.t * ray.direction).norm(),
              1e-14 * (extent + ray.origin.norm()));
  }
  return hits.size();
}

/// A ray with its range cut at hits, between them and beyond.
std::vector<Ray> withRanges(const Both& both, Ray ray) {
  std::vector<Ray> rays{ray};
  ray.tMin = -kInfinity;
  std::vector<RayHit> hits;
  for (const double tMin : {-1e3, 0.0}) {
    ray.tMin = tMin;
    rays.push_back(ray);
  }
  both.bruteForce.queries().allHits(both.id, ray, hits);
  if (hits.empty()) return rays;
  const double first = hits.front().t, last = hits.back().t;
  for (const auto& [tMin, tMax] : {std::pair{first, kInfinity},
                                   {first, last},
                                   {-1e3, first},
                                   {first, first},
                                   {last, last},
                                   {0.5 * (first + last), kInfinity},
                                   {-1e3, 0.5 * (first + last)},
                                   {last, 2 * last + 1},
                                   {std::nextafter(first, kInfinity), kInfinity},
                                   {-1e3, std::nextafter(first, -kInfinity)}})
    if (tMin <= tMax) rays.push_back({ray.origin, ray.direction, tMin, tMax});
  return rays;
}

TEST(RayHits, AreThoseOfRationalArithmeticOnALattice) {
  Random random(201);
  std::size_t hits = 0;
  for (int round = 0; round < casesOf(8); ++round) {
    const TestGeometry soup = latticeSoup(random, 40, 3 + round % 3);
    const Both both(soup);
    for (int i = 0; i < 12; ++i) {
      Ray ray{onLattice(random, 5), onLattice(random, 5)};
      ray.direction -= onLattice(random, 5);
      if (i % 3 == 0) ray = hardRay(random, soup.positions, soup.triangles);
      if (i % 3 == 1) ray.origin *= 0.5;
      if (ray.direction == Vector3d::Zero()) ray.direction = {0, 0, 1};
      for (const Ray& each : withRanges(both, ray))
        hits += expectExact(both, soup.positions, soup.triangles, each);
      ASSERT_FALSE(HasFailure()) << round << ' ' << i;
    }
  }
  EXPECT_GE(hits, leastOf(1000));
}

TEST(RayHits, AreThoseOfRationalArithmeticForEveryGeometryType) {
  Random random(202);
  for (const TestGeometry& geometry : hardGeometries(random)) {
    Both both(geometry);
    const std::vector<Triangle> elements = geometry.elements();
    std::size_t hits = 0;
    const auto test = [&](const Positions& now, int count) {
      for (int i = 0; i < count; ++i) {
        for (const Ray& each : withRanges(both, hardRay(random, now, elements)))
          hits += expectExact(both, now, elements, each);
        ASSERT_FALSE(HasFailure()) << i;
      }
    };
    test(geometry.positions, casesOf(10));
    const Positions now = moved(random, geometry.positions, 0.05);
    both.change([&](OctreeBasedCD& each) { each.setPositions(both.id, now); });
    test(now, casesOf(4));
    const Matrix3d turn = Eigen::AngleAxisd(1.1, Vector3d(1, -2, 3).normalized()).matrix();
    const Vector3d t(0.3, 0.2, -0.7);
    both.change([&](OctreeBasedCD& each) { each.setTransform(both.id, {turn, t}); });
    test(placed(now, turn, t), casesOf(4));
    EXPECT_GE(hits, leastOf(50));
  }
}

// ---- Closed meshes ----

/// Bodies of unit cells: points inside are known without a ray. Rays go along faces, through edges
/// and corners.
TEST(RayHits, CrossWhereTheRayChangesSide) {
  Random random(203);
  constexpr int n = 4;
  std::size_t crossing = 0, grazing = 0;
  for (int round = 0; round < casesOf(6); ++round) {
    std::set<std::array<int, 3>> full;
    const Solid solid = cells(n, random, [&](const std::array<int, 3>& c) {
      const bool filled =
          round == 0 || c[round % 3] == 0 || c[(round + 1) % 3] == 3 || (round > 3 && c[2] == 2);
      if (filled) full.insert(c);
      return filled;
    });
    const Both both(solid);
    const auto surface = both.octree.surface(both.id);
    const std::vector<Triangle> triangles(surface.triangles.begin(), surface.triangles.end());
    const auto isInside = [&](const oracle::Vector& p) {  // p is not on the surface
      std::array<int, 3> cell;
      for (std::size_t k = 0; k < 3; ++k) {
        mpz_class floor;
        mpz_fdiv_q(floor.get_mpz_t(), p[k].get_num_mpz_t(), p[k].get_den_mpz_t());
        cell[k] = static_cast<int>(floor.get_si());
      }
      return full.contains(cell);
    };
    for (int i = 0; i < casesOf(150); ++i) {
      Ray ray{0.5 * onLattice(random, 2 * n + 5) - Vector3d(1, 1, 1), onLattice(random, 5)};
      ray.direction -= onLattice(random, 5);
      if (ray.direction == Vector3d::Zero()) continue;
      const std::vector<RayHit> hits = consistentHits(both, ray);
      const std::vector<RationalHit> parts = hitsOf(ray, solid.positions, triangles);
      ASSERT_EQ(hits.size(), parts.size());
      std::size_t crossings = 0;
      for (std::size_t h = 0; h < hits.size(); ++h) {
        ASSERT_EQ(hits[h].element, parts[h].element);
        crossings += hits[h].crosses;
        (hits[h].crosses ? crossing : grazing)++;
        if (parts[h].first == 0) continue;  // it begins on the surface
        const Rational before = h == 0 ? Rational(0) : parts[h - 1].last;
        const Rational after = h + 1 < parts.size() ? parts[h + 1].first : parts[h].last + 2;
        const bool inBefore = isInside(pointOf(ray, (before + parts[h].first) / 2)),
                   inAfter = isInside(pointOf(ray, (parts[h].last + after) / 2));
        ASSERT_EQ(hits[h].crosses, inBefore != inAfter) << i << ' ' << h;
        if (inBefore != inAfter && parts[h].first == parts[h].last) {
          EXPECT_EQ(hits[h].frontFace, inAfter);
        }
      }
      if (parts.empty() || parts[0].first > 0) {
        EXPECT_EQ(crossings % 2, isInside(pointOf(ray, 0)) ? 1u : 0u);
      }
    }
  }
  EXPECT_GE(crossing, leastOf(300));
  EXPECT_GE(grazing, leastOf(50));
}

/// Rays from a point inside a closed mesh through all of its vertices and the middles of all edges.
/// Returns their number.
std::size_t expectNoLeak(const Mesh& mesh, const Vector3d& inside) {
  const TestGeometry geometry = testGeometry(mesh);
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  const GeometryId id = geometry.addTo(collisions);
  const SpatialQueries queries = collisions.queries();
  EXPECT_TRUE(queries.contains(id, inside));
  Positions targets = mesh.positions;
  for (const auto& [p, q] : geometry.edges())
    targets.push_back(0.5 * (mesh.positions[p] + mesh.positions[q]));
  std::vector<Ray> rays;
  for (const Vector3d& target : targets) rays.push_back({inside, target - inside});
  std::vector<RayHit> firsts(rays.size()), hits;
  queries.firstHits(id, rays, firsts);
  std::size_t leaks = 0, even = 0, wrong = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (isLeftOut(i)) continue;
    queries.allHits(id, rays[i], hits);
    leaks += hits.empty();
    even +=
        std::count_if(hits.begin(), hits.end(), [](const RayHit& h) { return h.crosses; }) % 2 == 0;
    wrong += hits.empty() || !isSame(hits[0], firsts[i]);
  }
  EXPECT_EQ(leaks, 0u);
  EXPECT_EQ(even, 0u);
  EXPECT_EQ(wrong, 0u);
  return rays.size();
}

/// A ball with hills and valleys, so that rays have several hits. bits: of its coordinates, so that
/// rays pass exactly through vertices and middles of edges.
Mesh hilly(std::uint32_t rings, std::uint32_t segments, int bits) {
  Mesh mesh = sphere(rings, segments, {0, 0, 0}, 1.0);
  for (Vector3d& p : mesh.positions) {
    p *= 1.0 + 0.3 * std::sin(7 * p.x() + 2) * std::cos(9 * p.y()) + 0.2 * std::sin(11 * p.z());
    p.x() += 0.4 * std::sin(3 * p.z());
    for (double& x : p) x = std::ldexp(std::round(std::ldexp(x, bits)), -bits);
  }
  return mesh;
}

TEST(RayHits, NoRayLeaksThroughVerticesAndEdges) {
  EXPECT_EQ(expectNoLeak(hilly(28, 36, 20), {0, 0, 0}), 3890u);
  EXPECT_EQ(expectNoLeak(hilly(28, 36, 50), {0.01, 0.02, 0.03}), 3890u);
  EXPECT_EQ(expectNoLeak(hilly(28, 36, 12), {0.125, 0.25, -0.125}), 3890u);
}

/// PALPATE_LEAK_RAYS=198746: as many rays as in the published comparison of libraries.
TEST(RayHits, NoRayLeaksOutOfALargeMesh) {
  if (std::getenv("PALPATE_LEAK_RAYS"))
    EXPECT_EQ(expectNoLeak(hilly(183, 273, 30), {0, 0, 0}), 198746u);
  else
    EXPECT_EQ(expectNoLeak(hilly(60, 80, 30), {0, 0, 0}), 18882u);
}

TEST(RayHits, NoRayLeaksOutOfPublishedMeshes) {
  const std::filesystem::path file =
      std::filesystem::path(PALPATE_SHARED_DATA) / "meshes" / "aneurysm.obj";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is absent";
  const Mesh mesh = readObj(file);
  if (!findMeshDefects(mesh.triangles).closed()) GTEST_SKIP() << "the mesh is not closed";
  OctreeBasedCD collisions;
  const GeometryId id = collisions.addTriangleMesh(mesh.positions, mesh.triangles);
  Random random(204);
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : mesh.positions) box.extend(p);
  Vector3d inside = box.center();
  for (int i = 0; i < 10000 && !collisions.queries().contains(id, inside); ++i)
    inside = box.min() + randomPoint(random, 0, 1).cwiseProduct(box.sizes());
  EXPECT_EQ(expectNoLeak(mesh, inside), 28374u);
}

// ---- Directions, batches ----

/// Rays through a cube with exact parameters, cut at each hit: on faces, edges and corners. No ray
/// lies in a face.
TEST(RayHits, CrossAtTheEndsOfTheRangeAsTheEndlessRay) {
  TestGeometry cube;
  for (int i = 0; i < 8; ++i) cube.positions.emplace_back(4 * (i & 1), 2 * (i & 2), i & 4);
  cube.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  const Both both(cube);
  std::size_t crossing = 0, touching = 0;
  const Vector3d directions[] = {{1, 0, 0},  {0, -1, 0}, {0, 1, 1},
                                 {1, 0, -1}, {1, 1, 1},  {-1, 1, 1}};
  for (const Vector3d& direction : directions)
    for (int i = 0; i < 125; ++i) {
      const Vector3d through(i % 5, i / 5 % 5, i / 25);
      bool isInFace = false;
      for (int k = 0; k < 3; ++k)
        isInFace |= direction[k] == 0 && (through[k] == 0 || through[k] == 4);
      if (isInFace) continue;
      const std::vector<RayHit> all = consistentHits(both, {through, direction, -8.0});
      for (const RayHit& hit : all) {
        (hit.crosses ? crossing : touching) += 1;
        const std::vector<RayHit> from = consistentHits(both, {through, direction, hit.t}),
                                  to = consistentHits(both, {through, direction, -8.0, hit.t});
        ASSERT_FALSE(from.empty() || to.empty());
        for (const RayHit& cut : {from.front(), to.back()}) {
          EXPECT_EQ(cut.t, hit.t);
          EXPECT_EQ(cut.crosses, hit.crosses) << through << '\n' << direction;
        }
      }
    }
  EXPECT_GT(crossing, 400u);
  EXPECT_GT(touching, 20u);
}

/// Meshes and directions in denormal numbers, and in huge ones.
TEST(RayHits, AnyMagnitude) {
  Random random(206);
  for (const auto& [exponent, ofDirection] : {std::pair(-1060, 0),
                                              {-1060, -1060},
                                              {-500, 0},
                                              {-500, -500},
                                              {0, -1020},
                                              {0, -600},
                                              {0, 600},
                                              {0, 990},
                                              {500, 0},
                                              {500, 500},
                                              {900, 0},
                                              {900, 900}}) {
    SCOPED_TRACE(std::to_string(exponent) + ", directions " + std::to_string(ofDirection));
    TestGeometry mesh = latticeSoup(random, 40, 4);
    for (Vector3d& p : mesh.positions) p *= std::ldexp(1.0, exponent);
    const Both both(mesh);
    std::size_t hits = 0;
    for (int i = 0; i < casesOf(40); ++i) {
      const Vector3d from = onLattice(random, 4), direction = onLattice(random, 4) - from;
      const Ray ray{std::ldexp(1.0, exponent) * onLattice(random, 4),
                    std::ldexp(1.0, ofDirection) * direction};
      if (direction == Vector3d::Zero()) continue;
      const std::vector<RayHit> found = consistentHits(both, ray);
      const std::vector<RationalHit> truth = hitsOf(ray, mesh.positions, mesh.triangles);
      std::size_t finite = 0;  // beyond the largest double there are no hits
      while (finite < truth.size() && std::isfinite(truth[finite].first.get_d())) ++finite;
      ASSERT_EQ(found.size(), finite) << i;
      hits += found.size();
      for (std::size_t h = 0; h < found.size(); ++h) {
        EXPECT_EQ(found[h].element, truth[h].element);
        const double t = truth[h].first.get_d();
        EXPECT_NEAR(found[h].t, t, 1e-15 * std::abs(t) + 5e-324);
        EXPECT_TRUE(found[h].weights.allFinite());
      }
    }
    EXPECT_GE(hits, leastOf(10));
  }
}

TEST(RayHits, AreTheSameOnEverySimdPath) {
  for (const std::string& path : simdPaths()) {
    SCOPED_TRACE(path);
    useSimdPath(path);
    Random random(210);
    const TestGeometry geometry = testGeometry(sphere(20, 30, {0.5, 0.5, 0.5}, 0.4));
    const std::vector<Triangle> elements = geometry.elements();
    const Both both(geometry);
    std::size_t hits = 0;
    for (int i = 0; i < casesOf(300); ++i)
      hits += consistentHits(both, hardRay(random, geometry.positions, elements)).size();
    EXPECT_GE(hits, leastOf(200));
  }
  useSimdPath("");
}

/// Rays through placed vertices that triangles share, where roundings of t exceed the gaps of hits.
TEST(RayHits, AscendAtAnyMagnitude) {
  Random random(207);
  for (const double scale : {1e-66, 1.0, 1e66}) {
    for (int i = 0; i < casesOf(40, 12); ++i) {
      TestGeometry mesh;
      for (int k = 0; k < 30; ++k) mesh.positions.push_back(scale * onLattice(random, 4));
      const auto vertex = [&] { return static_cast<std::uint32_t>(random() % 30); };
      for (int k = 0; k < 100; ++k) mesh.triangles.push_back({vertex(), vertex(), vertex()});
      Both both(mesh);
      const Matrix3d turn = randomTurn(random);
      const Vector3d shift = scale * randomPoint(random, -1, 1);
      both.change([&](OctreeBasedCD& each) { each.setTransform(both.id, {turn, shift}); });
      for (int k = 0; k < 40; ++k) {
        const Vector3d origin = scale * randomPoint(random, -3, 7);
        const Positions now = placed(mesh.positions, turn, shift);
        const Vector3d target =
            k % 2 ? now[vertex()] : Vector3d(scale * randomPoint(random, -3, 7));
        consistentHits(both, {origin, 3 * (target - origin), -100});
      }
    }
  }
}

/// Vertices of a segment or a triangle may have one position, or lie on one line.
TEST(RayHits, WeightsOnElementsWithoutLengthOrArea) {
  std::vector<TestGeometry> geometries;
  for (const std::vector<double>& radii :
       std::vector<std::vector<double>>{{0.0}, {0.5}, {0.25, 0.5}, {0.5, 0.25}, {0.0, 0.5}})
    geometries.push_back({GeometryType::Lines, {{0, 0, 0}, {0, 0, 0}}, {}, {{0, 1}}, radii});
  for (const Positions& positions : std::vector<Positions>{{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}},
                                                           {{-1, 0, 0}, {1, 0, 0}, {1, 0, 0}},
                                                           {{0, -1, 0}, {0, 1, 0}, {0, 3, 0}},
                                                           {{0, -1, 1}, {0, 1, -1}, {0, -1, 1}}})
    geometries.push_back({GeometryType::Triangles, positions, {{0, 1, 2}}, {}});
  for (const Triangle& repeated : {Triangle{0, 0, 1}, {0, 1, 0}, {1, 0, 0}, {1, 1, 1}})
    geometries.push_back({GeometryType::Triangles, {{0, 1, 0}, {0, 0, 0}}, {repeated}, {}});
  for (const TestGeometry& geometry : geometries) {
    const Both both(geometry);
    for (const Vector3d& direction :
         {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(1, 2, 3), Vector3d(1e-200, 0, 0)}) {
      std::vector<RayHit> hits;
      const Ray ray{-2 * direction, direction};
      both.octree.queries().allHits(both.id, ray, hits);
      ASSERT_FALSE(hits.empty());
      for (const RayHit& hit : hits) {
        EXPECT_GE(hit.weights.minCoeff(), 0.0);  // false for NaN
        EXPECT_NEAR(hit.weights.sum(), 1.0, 0x1p-52);
        Vector3d at = Vector3d::Zero();
        double radius = 0;
        for (int i = 0; i < 3; ++i) {
          const std::uint32_t v = hit.vertices[static_cast<std::size_t>(i)];
          at += hit.weights[i] * geometry.positions[v];
          radius += hit.weights[i] * geometry.radius(v);
        }
        EXPECT_NEAR((ray.origin + hit.t * direction - at).norm(), radius, 1e-14);
      }
    }
  }
}

}  // namespace
}  // namespace palpate::testing
