#include <palpate/FeaturePairs.h>
#include <palpate/Meshes.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/Simplify.h>

#include "Common/ExpectRefused.h"
#include "Common/Sanitized.h"
#include "Queries/ClosedBody.h"
#include "Simplify/SimplifyCertificate.h"
#include "Common/FieldMeshes.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace palpate::testing {
namespace {

double diagonalOf(const Mesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& p : mesh.positions) box.extend(p);
  return box.diagonal().norm();
}

SimplifiedMesh simplified(const Mesh& mesh, double share, int threads = 1) {
  return simplify({mesh.positions, mesh.triangles},
                  {.maxDistance = share * diagonalOf(mesh), .threads = threads});
}

Eigen::Vector3d randomPointOf(Random& random, const std::vector<Eigen::Vector3d>& positions,
                              const Triangle& triangle) {
  double s = uniform(random, 0, 1), t = uniform(random, 0, 1);
  if (s + t > 1) s = 1 - s, t = 1 - t;
  const Eigen::Vector3d &a = positions[triangle[0]], &b = positions[triangle[1]],
                        &c = positions[triangle[2]];
  return a + s * (b - a) + t * (c - a);
}

/// A closed body with random waves, and its vertices and triangles in random order.
Mesh organMesh(Random& random, std::uint32_t rings, std::uint32_t segments) {
  Mesh mesh = sphere(rings, segments, {0, 0, 0}, 1.0);
  std::array<Eigen::Vector3d, 4> waves;
  for (Eigen::Vector3d& wave : waves) wave = randomPoint(random, -4, 4);
  for (Eigen::Vector3d& p : mesh.positions) {
    double radius = 1.0;
    for (const Eigen::Vector3d& wave : waves) radius += 0.1 * std::sin(wave.dot(p));
    p = Eigen::Vector3d(radius * p[0], 0.6 * radius * p[1], 0.8 * radius * p[2]);
  }
  std::vector<std::uint32_t> order(mesh.positions.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::shuffle(order.begin(), order.end(), random);
  Mesh shuffled = mesh;
  for (std::size_t i = 0; i < order.size(); ++i) shuffled.positions[order[i]] = mesh.positions[i];
  for (Triangle& triangle : shuffled.triangles)
    for (std::uint32_t& v : triangle) v = order[v];
  std::shuffle(shuffled.triangles.begin(), shuffled.triangles.end(), random);
  return shuffled;
}

std::vector<NamedMesh> simplifyMeshes(Random& random) {
  std::vector<NamedMesh> meshes = fieldMeshes(random);
  std::erase_if(meshes, [](const NamedMesh& named) {
    return named.name == "crossing" || named.name == "flat";  // refused: see below
  });
  meshes.push_back({"organ", organMesh(random, 30, 40)});
  const Mesh hollow =
      joined(sphere(24, 30, {0, 0, 0}, 1.0), insideOut(sphere(20, 24, {0, 0.1, 0}, 0.6)));
  meshes.push_back({"hollow", hollow});
  Mesh nested = sphere(20, 30, {0, 0, 0}, 1.0);
  append(nested, sphere(12, 14, {0, 0, 0}, 0.5));
  meshes.push_back({"nested", nested});
  Mesh apart = sphere(20, 30, {0, 0, 0}, 1.0);
  append(apart, sphere(12, 16, {2.0, 0, 0}, 0.98));
  append(apart, boxMesh({5, 0, 0}, {5.001, 0.001, 0.001}));
  meshes.push_back({"apart", apart});
  meshes.push_back({"inverted", insideOut(sphere(20, 30, {0, 0, 0}, 1.0))});
  Mesh withSegment = sphere(20, 30, {0, 0, 0}, 1.0);
  withSegment.triangles.push_back({3, 4, 4});
  meshes.push_back({"triangle without area", withSegment});
  return meshes;
}

/// Checks the promises of simplify() without its certificate: by all pairs of triangles, and by
/// queries for many points.
void check(Random& random, const Mesh& mesh, const SimplifiedMesh& result, double maxDistance) {
  EXPECT_TRUE(findMeshDefects(result.triangles).closed());
  EXPECT_LE(result.triangles.size(), mesh.triangles.size());
  EXPECT_LE(result.distance, maxDistance);
  EXPECT_GT(result.distance, 0.0);
  std::size_t common = 0;
  for (std::size_t t = 0; t < result.triangles.size(); t += kShareOfCases) {
    const auto& [a, b, c] = result.triangles[t];
    const auto& p = result.positions;
    const Eigen::AlignedBox3d box =
        Eigen::AlignedBox3d(p[a].cwiseMin(p[b]).cwiseMin(p[c]), p[a].cwiseMax(p[b]).cwiseMax(p[c]));
    for (const auto& [d, e, f] : mesh.triangles) {
      const auto& q = mesh.positions;
      if (box.intersects({q[d].cwiseMin(q[e]).cwiseMin(q[f]), q[d].cwiseMax(q[e]).cwiseMax(q[f])}))
        common += trianglesIntersect(p[a], p[b], p[c], q[d], q[e], q[f]);
    }
  }
  EXPECT_EQ(common, 0u);

  OctreeBasedCD scene;
  const GeometryId body = scene.addTriangleMesh(mesh.positions, mesh.triangles),
                   around = scene.addTriangleMesh(result.positions, result.triangles);
  const SpatialQueries queries = scene.queries();
  std::size_t outside = 0, inside = 0, far = 0;
  double furthest = 0.0;
  for (const Eigen::Vector3d& p : mesh.positions) outside += !queries.contains(around, p);
  for (const Triangle& triangle : mesh.triangles)
    outside += !queries.contains(around, randomPointOf(random, mesh.positions, triangle));
  const Eigen::Vector3d low = mesh.positions[0], high = mesh.positions.back();
  for (int i = 0; i < casesOf(500); ++i) {  // inside the body
    const Eigen::Vector3d p = low + uniform(random, 0, 1) * (high - low);
    outside += queries.contains(body, p) && !queries.contains(around, p);
  }
  const int samples = casesOf(static_cast<int>(40000 / result.triangles.size())) + 2;
  for (const Triangle& triangle : result.triangles)
    for (int i = 0; i < samples + 3; ++i) {
      const Eigen::Vector3d p = i < 3 ? result.positions[triangle[static_cast<std::size_t>(i)]]
                                      : randomPointOf(random, result.positions, triangle);
      inside += queries.contains(body, p);
      furthest = std::max(furthest, queries.closestPoint(body, p)->distance);
      far += furthest > result.distance;
    }
  EXPECT_EQ(outside, 0u);
  EXPECT_EQ(inside, 0u);
  EXPECT_EQ(far, 0u) << furthest << " of " << result.distance;
}

/// Each mesh by several distances, organs by any, and boxes that are a narrow gap apart.
TEST(Simplify, EnclosesTheMeshAndIsNear) {
  Random random(1);
  std::size_t number = 0;
  const auto checkBy = [&](double share, const std::string& name, const Mesh& mesh) {
    SCOPED_TRACE(name + " " + std::to_string(share));
    check(random, mesh, simplified(mesh, share), share * diagonalOf(mesh));
  };
  for (const double share : {0.002, 0.02, 0.1})
    for (const auto& [name, mesh] : simplifyMeshes(random))
      if (!isLeftOut(number++, 3)) checkBy(share, name, mesh);
  for (int i = 0; i < casesOf(10, 3); ++i) {
    const Mesh organ = organMesh(random, 40, 50);
    checkBy(std::pow(10.0, uniform(random, -3.0, -1.0)), "organ " + std::to_string(i), organ);
  }
  const Mesh organ = organMesh(random, 12, 16);
  for (const double share : {1e-8, 1e-6, 1.0, 100.0}) checkBy(share, "small organ", organ);
  for (const double gap : {1e-2, 1e-4, 1e-6})
    checkBy(0.02, "gap of " + std::to_string(gap),
            joined(boxMesh({0, 0, 0}, {1, 1, 1}), boxMesh({1 + gap, 0.2, 0.3}, {2, 0.7, 0.8})));
}

TEST(Simplify, FineMeshesBecomeMuchCoarser) {
  for (const Mesh& mesh : {sphere(80, 120, {0, 0, 0}, 1.0), torusMesh(160, 60)})
    EXPECT_LT(10 * simplified(mesh, 0.02).triangles.size(), mesh.triangles.size());
  Random random(5);
  const Mesh organ = organMesh(random, 80, 100);
  const SimplifiedMesh result = simplified(organ, 0.01);
  EXPECT_LT(5 * result.triangles.size(), organ.triangles.size());
  // Parts fail at first, and get a finer level.
  EXPECT_GT(simplified(torusMesh(160, 60), 0.1).rounds, 1);
}

TEST(Simplify, KeepsCavitiesAndLeavesOutShellsInside) {
  const Mesh hollow =
      joined(sphere(30, 40, {0, 0, 0}, 1.0), insideOut(sphere(20, 30, {0, 0, 0}, 0.6)));
  Mesh nested = sphere(30, 40, {0, 0, 0}, 1.0);
  append(nested, sphere(20, 30, {0, 0, 0}, 0.6));
  const SimplifiedMesh ofHollow = simplified(hollow, 0.01), ofNested = simplified(nested, 0.01);
  OctreeBasedCD scene;
  const GeometryId one = scene.addTriangleMesh(ofHollow.positions, ofHollow.triangles),
                   two = scene.addTriangleMesh(ofNested.positions, ofNested.triangles);
  const SpatialQueries queries = scene.queries();
  EXPECT_FALSE(queries.contains(one, {0, 0, 0}));
  EXPECT_TRUE(queries.contains(one, {0, 0, 0.8}));
  EXPECT_TRUE(queries.contains(two, {0, 0, 0}));
  EXPECT_GT(queries.closestPoint(two, {0, 0, 0})->distance, 0.99);
}

TEST(Simplify, ThreadsDoNotChangeTheResult) {
  Random random(7);
  const Mesh mesh = organMesh(random, 60, 80);
  const SimplifiedMesh one = simplified(mesh, 0.003), four = simplified(mesh, 0.003, 4);
  EXPECT_EQ(one.positions, four.positions);
  EXPECT_EQ(one.triangles, four.triangles);
  EXPECT_EQ(one.distance, four.distance);
  EXPECT_EQ(one.rounds, four.rounds);
}

TEST(Simplify, RefusesMeshesThatTouchThemselves) {
  Random random(1);
  for (const auto& [name, mesh] : fieldMeshes(random)) {
    SCOPED_TRACE(name);
    const auto simplify = [&mesh = mesh] { simplified(mesh, 0.01); };
    if (name == "crossing")
      expectRefused(ErrorCode::UnsupportedMethod, "crosses or touches itself: triangles ",
                    simplify);
    if (name == "flat")  // without a volume, there is no way outward
      expectRefused(ErrorCode::NotAvailable, "no displacement of vertex ", simplify);
  }
  Mesh spindle = torusMesh(24, 16);
  for (Eigen::Vector3d& p : spindle.positions) {
    const double length = std::hypot(p[0], p[1]), shorter = (length - 0.9) / length;
    p = {shorter * p[0], shorter * p[1], p[2]};
  }
  expectRefused(ErrorCode::UnsupportedMethod, "crosses or touches itself: triangles ",
                [&] { simplified(spindle, 0.01); });
  Mesh touching = boxMesh({0, 0, 0}, {1, 1, 1});
  append(touching, boxMesh({1, 0.2, 0.3}, {2, 0.7, 0.8}));
  expectRefused(ErrorCode::UnsupportedMethod, "crosses or touches itself: triangles ",
                [&] { simplified(touching, 0.01); });
}

/// Where the sides of a surface are mistaken for each other, the result would lie inside the body.
/// The tests of components then refuse it.
TEST(Simplify, VeryThinPlates) {
  Random random(6);
  for (const double thickness : {1e-6, 1e-8, 4e-8})
    for (const bool isInverted : {false, true}) {
      SCOPED_TRACE(thickness);
      Mesh plate = boxMesh({-1, -1, 0}, {1, 1, thickness});
      if (isInverted) plate = insideOut(plate);
      try {
        check(random, plate, simplified(plate, 0.01), 0.01 * diagonalOf(plate));
      } catch (const Error& error) {
        EXPECT_TRUE(isInverted) << error.what();
        EXPECT_EQ(error.code(), ErrorCode::NotAvailable) << error.what();
      }
    }
}

TEST(Simplify, RefusesWhatIsOutOfRange) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const Mesh box = boxMesh({-1, -1, -1}, {1, 1, 1});
  const auto call = [](const Mesh& mesh, SimplifySettings settings) {
    return [=] { simplify({mesh.positions, mesh.triangles}, settings); };
  };
  for (const double length : {0.0, -1.0, kNan, std::numeric_limits<double>::infinity()})
    expectRefused(ErrorCode::InvalidSettings, "maxDistance is ",
                  call(box, {.maxDistance = length}));
  for (const double length : {1e-10, 1e61})
    expectRefused(ErrorCode::InvalidSettings, "it must be in [",
                  call(box, {.maxDistance = length}));
  for (const int threads : {-1, 1025})
    expectRefused(ErrorCode::InvalidSettings, "threads is ",
                  call(box, {.maxDistance = 0.1, .threads = threads}));
  Mesh open = box, wrong = box, notFinite = box, large = box, point = box;
  open.triangles.pop_back();
  expectRefused(ErrorCode::NotClosed, "geometry 0 has no inside", call(open, {.maxDistance = 0.1}));
  expectRefused(ErrorCode::NotClosed, "no triangles", call({}, {.maxDistance = 0.1}));
  wrong.triangles[3][1] = 8;
  expectRefused(ErrorCode::IndexOutOfRange, "triangle 3", call(wrong, {.maxDistance = 0.1}));
  notFinite.positions[5][2] = kNan;
  expectRefused(ErrorCode::NonFinitePosition, "vertex 5", call(notFinite, {.maxDistance = 0.1}));
  for (Eigen::Vector3d& p : large.positions) p *= 0x1p300;
  expectRefused(ErrorCode::InvalidSettings, "longest side", call(large, {.maxDistance = 0x1p290}));
  for (Eigen::Vector3d& p : point.positions) p = {1, 2, 3};
  expectRefused(ErrorCode::InvalidSettings, "longest side", call(point, {.maxDistance = 0.1}));
}

TEST(Simplify, RandomTopologyIsAnsweredOrRefused) {
  std::size_t answered = 0;
  for (int i = 0; i < casesOf(60); ++i) {
    Random random(static_cast<std::uint64_t>(i));
    Mesh mesh = i % 2 ? torusMesh(12, 6) : sphere(6, 9, {0, 0, 0}, 1.0);
    for (Eigen::Vector3d& p : mesh.positions) p += randomPoint(random, -1, 1) * 0.02 * (i % 10);
    if (i % 3 == 0) mesh.positions[random() % 20] = mesh.positions[random() % 20];
    try {
      const SimplifiedMesh result = simplified(mesh, 0.03);
      check(random, mesh, result, 0.03 * diagonalOf(mesh));
      ++answered;
    } catch (const Error& error) {
      EXPECT_TRUE(error.code() == ErrorCode::UnsupportedMethod ||
                  error.code() == ErrorCode::NotAvailable)
          << error.what();
    }
  }
  EXPECT_GE(answered, leastOf(20));
}

TEST(Simplify, ReportsProgressAndCanBeCancelled) {
  Random random(9);
  const Mesh mesh = organMesh(random, 60, 80);
  SimplifySettings settings{.maxDistance = 0.005};
  double last = 0.0;
  int calls = 0;
  settings.progress = [&](double fraction) {
    EXPECT_GE(fraction, last);
    EXPECT_LE(fraction, 1.0);
    last = fraction;
    ++calls;
    return true;
  };
  simplify({mesh.positions, mesh.triangles}, settings);
  EXPECT_GT(calls, 3);
  for (int until = 0; until < calls; ++until) {
    int left = until;
    settings.progress = [&](double) { return left-- > 0; };
    expectRefused(ErrorCode::Cancelled, "cancelled", [&] {
      simplify({mesh.positions, mesh.triangles}, settings);
    });
  }
}

/// The certificate by itself, for random triangles outside a body.
TEST(SimplifyCertificate, BoundsHoldForAllPoints) {
  Random random(11);
  std::size_t proven = 0, refused = 0;
  for (const Mesh& mesh :
       {organMesh(random, 20, 24), boxMesh({-1, -1, 0}, {1, 1, 0.01}), starMesh(random)}) {
    Body body(GeometryId{0});
    makeClosedBody({mesh.positions, mesh.triangles}, Threads(1), body);
    OctreeBasedCD scene;
    const GeometryId id = scene.addTriangleMesh(mesh.positions, mesh.triangles);
    const SpatialQueries queries = scene.queries();
    PointQueryStack stack;
    for (int i = 0; i < casesOf(900); ++i) {
      const double most = std::pow(10.0, uniform(random, -2, 0));
      const SimplifyCertificate certificate(body, most, 2.0);
      const Eigen::Vector3d at =
          randomPointOf(random, mesh.positions, mesh.triangles[random() % mesh.triangles.size()]);
      Corners corners;
      for (Eigen::Vector3d& p : corners) {
        const Eigen::Vector3d aside = most * randomPoint(random, -1, 1);
        p = at + uniform(random, 0, 3) * aside;
      }
      bool touches = false;
      for (const auto& [a, b, c] : mesh.triangles)
        touches |= trianglesIntersect(corners[0], corners[1], corners[2], mesh.positions[a],
                                      mesh.positions[b], mesh.positions[c]);
      EXPECT_EQ(certificate.touches(corners, stack), touches);
      EXPECT_EQ(certificate.isInside(corners[0], stack), queries.contains(id, corners[0]));
      if (touches || queries.contains(id, corners[0])) continue;
      const auto bound = certificate.distanceBound(corners, stack);
      double furthest = 0.0;
      const std::vector<Eigen::Vector3d> positions(corners.begin(), corners.end());
      for (int sample = 0; sample < 100; ++sample) {
        const Eigen::Vector3d p = sample < 3 ? corners[static_cast<std::size_t>(sample)]
                                             : randomPointOf(random, positions, {0, 1, 2});
        furthest = std::max(furthest, queries.closestPoint(id, p)->distance);
      }
      if (bound) {
        ++proven;
        EXPECT_LE(furthest, *bound);
        EXPECT_LE(*bound, most);
      } else {
        ++refused;
        EXPECT_GT(furthest, 0.8 * most) << "a proof was possible";
      }
    }
  }
  EXPECT_GE(proven, leastOf(100));
  EXPECT_GE(refused, leastOf(100));
}

}  // namespace
}  // namespace palpate::testing
