// The laws of the leaves of Method::Proxy, for points in each leaf, beside exact distances.
#include "DistanceField/SurfaceProxy.h"

#include <palpate/Error.h>
#include <palpate/FeaturePairs.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/EverySimdPath.h"
#include "Common/ExpectRefused.h"
#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Common/FieldMeshes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>

namespace palpate::testing {
namespace {

using Eigen::Vector3d;

struct Scene {
  std::string name;
  Mesh body;
  ProxySettings settings;
};

TriangleMesh meshOf(const Mesh& body) {
  return {MeshTopology(body.positions.size(), body.triangles), Positions(body.positions),
          Positions(body.positions)};
}

/// Two sheets with opposite normals that share their border and are `gap` apart in the middle.
Mesh pillow(std::uint32_t n, double gap) {
  Mesh mesh = sheet(n, 0.0, 0.4), back = mesh;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const std::size_t i = v % (n + 1), j = v / (n + 1);
    const bool isBorder = i == 0 || j == 0 || i == n || j == n;
    back.positions[v][2] -= isBorder ? 0.0 : gap;
  }
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  std::vector<std::uint32_t> names;
  for (std::size_t v = 0; v < first; ++v) {
    if (back.positions[v] == mesh.positions[v]) {
      names.push_back(static_cast<std::uint32_t>(v));
    } else {
      names.push_back(static_cast<std::uint32_t>(mesh.positions.size()));
      mesh.positions.push_back(back.positions[v]);
    }
  }
  for (const auto& [a, b, c] : back.triangles)
    mesh.triangles.push_back({names[a], names[c], names[b]});
  return mesh;
}

std::vector<Scene> scenes() {
  Random random(3);
  Mesh far = sphere(20, 30, {3e5, -2e5, 1e5}, 1.0);
  return {{"sphere", sphere(24, 36, {0.1, 0.2, 0.3}, 1.0), {0.08, 0.02, 0.5}},
          {"slivers", sphere(8, 300, Vector3d::Zero(), 1.0), {0.08, 0.05, 0.7}},
          {"torus", torusMesh(40, 20), {0.05, 0.02, 0.6}},
          {"box", boxMesh({-1, -0.5, -0.25}, {1, 0.5, 0.25}), {0.1, 1e-3, 0.25}},
          {"thin box", boxMesh({-1, -1, -0.002}, {1, 1, 0.002}), {0.1, 1e-2, 0.25}},
          {"pillow", pillow(24, 0.01), {0.03, 4e-3, 0.6}},
          {"star", starMesh(random), {0.05, 0.02, 1.2}},
          {"sheet", sheet(24, 0.0, 0.4), {0.05, 4e-3, 0.6}},
          {"soup", soup(random, 40, 0.3), {0.05, 0.05, 1.5}},
          {"far away", std::move(far), {0.08, 0.02, 0.5}}};
}

/// Points of a leaf, also at its corners, and below the middle of its faces.
std::vector<Vector3d> pointsOf(const SurfaceProxy& proxy, const SurfaceProxy::Leaf& leaf,
                               Random& random) {
  const double size = proxy.unit() * leaf.size;
  const Vector3d lower =
      proxy.lower() + proxy.unit() * Vector3d(leaf.lower[0], leaf.lower[1], leaf.lower[2]);
  std::vector<Vector3d> points;
  for (int i = 0; i < 8; ++i)
    points.emplace_back(lower + size * Vector3d(i & 1, i >> 1 & 1, i >> 2));
  for (int i = 0; i < 4; ++i) points.push_back(lower + size * randomPoint(random, 0, 1));
  for (int k = 0; k < 3; ++k) {
    points.emplace_back(lower + size * Vector3d::Constant(0.5));
    points.back()[k] = lower[k];
  }
  return points;
}

TEST(SurfaceProxy, EachLeafIsAsItsLawsSay) {
  Random random(1);
  std::size_t number = 0;
  for (const Scene& scene : scenes()) {
    if (isLeftOut(number++)) continue;
    SCOPED_TRACE(scene.name);
    OctreeBasedCD exact;
    const GeometryId id = addMesh(exact, scene.body);
    const SpatialQueries queries = exact.queries();
    const SurfaceProxy proxy(meshOf(scene.body), scene.settings, Threads(2));
    const double rounding = 1e-14 * proxy.magnitude();
    std::size_t planes = 0, lists = 0;
    const std::size_t step = 1 + proxy.leaves().size() / (6000 / kShareOfCases);
    for (std::size_t i = random() % step; i < proxy.leaves().size(); i += step) {
      const SurfaceProxy::Leaf& leaf = proxy.leaves()[i];
      ++(leaf.hasPlane() ? planes : lists);
      EXPECT_LE(leaf.error, scene.settings.allowedError);
      for (const Vector3d& p : pointsOf(proxy, leaf, random)) {
        const double distance = queries.closestPoint(id, p)->distance;
        if (!leaf.hasPlane()) {
          double listed = kInfinity;
          for (const SurfaceProxy::Listed& each : proxy.trianglesOf(leaf)) {
            const auto& [a, b, c] = scene.body.triangles[each.triangle];
            const auto& x = scene.body.positions;
            listed = std::min(listed, vertexTriangleDistance(p, x[a], x[b], x[c]).distance);
          }
          ASSERT_NEAR(listed, distance, rounding);
          continue;
        }
        const double height = leaf.distance(p[0], p[1], p[2]);
        ASSERT_NEAR(std::abs(height), distance, leaf.error + rounding);
        if (!proxy.isClosed() || std::abs(height) <= leaf.error + rounding) continue;
        ASSERT_EQ(height < 0, queries.signedDistance(id, p).distance < 0);
      }
    }
    EXPECT_GT(planes + lists, 500u / kShareOfCases);
    // Where two sides are nearer than a cell, and where borders are everywhere, there are none.
    const bool hasPlanes =
        scene.name != "soup" && scene.name != "thin box" && scene.name != "pillow";
    EXPECT_EQ(planes > 100 / kShareOfCases, hasPlanes);
  }
}

TEST(SurfaceProxy, PlacesWithoutALeafAreBeyondTheReach) {
  Random random(2);
  std::size_t number = 0;
  for (const Scene& scene : scenes()) {
    if (isLeftOut(number++)) continue;
    SCOPED_TRACE(scene.name);
    OctreeBasedCD exact;
    const GeometryId id = addMesh(exact, scene.body);
    const SpatialQueries queries = exact.queries();
    const SurfaceProxy proxy(meshOf(scene.body), scene.settings, Threads(1));
    std::size_t far = 0;
    const double units = proxy.unitCount();
    for (int i = 0; i < casesOf(4000); ++i) {
      const Vector3d at = randomPoint(random, 0, units - 1e-6);
      std::array<std::uint32_t, 3> unit;
      for (int k = 0; k < 3; ++k) unit[k] = static_cast<std::uint32_t>(at[k]);
      const auto index = [&](std::uint32_t divisor) {
        return (unit[2] / divisor % 4 * 4 + unit[1] / divisor % 4) * 4 + unit[0] / divisor % 4;
      };
      const std::uint32_t bricks = proxy.unitCount() / 16;
      const ProxyPlace place{(unit[2] / 16 * bricks + unit[1] / 16) * bricks + unit[0] / 16,
                             index(4) | index(1) << 6};
      const std::uint32_t leaf = proxy.leafAt(place);
      ASSERT_EQ(leaf, proxy.leafAtByBruteForce(place));
      if (leaf != SurfaceProxy::kNoLeaf) continue;
      ++far;
      const Vector3d p = proxy.lower() + proxy.unit() * at;
      ASSERT_GT(queries.closestPoint(id, p)->distance, scene.settings.reach);
    }
    EXPECT_GT(far, 200u / kShareOfCases);
  }
}

TEST(SurfaceProxy, ThreadsAndSimdPathsGiveTheSameLeaves) {
  const std::vector<Scene> all = scenes();
  for (std::size_t s = 0; s < all.size(); ++s) {
    if (isLeftOut(s, 3)) continue;
    const Scene& scene = all[s];
    SCOPED_TRACE(scene.name);
    const TriangleMesh mesh = meshOf(scene.body);
    const SurfaceProxy expected(mesh, scene.settings, Threads(1));
    const auto expectSame = [&](int threads) {
      const SurfaceProxy other(mesh, scene.settings, Threads(threads));
      ASSERT_EQ(other.leaves().size(), expected.leaves().size());
      EXPECT_EQ(std::memcmp(other.leaves().data(), expected.leaves().data(),
                            expected.leaves().size_bytes()),
                0);
      for (std::size_t i = 0; i < expected.leaves().size(); ++i) {
        const auto a = other.trianglesOf(other.leaves()[i]),
                   b = expected.trianglesOf(expected.leaves()[i]);
        EXPECT_TRUE(
            std::equal(a.begin(), a.end(), b.begin(), b.end(),
                       [](const auto& l, const auto& r) { return l.triangle == r.triangle; }));
      }
    };
    expectSame(3);
    for (const std::string& path : EverySimdPath()) {
      SCOPED_TRACE(path);
      expectSame(1);
    }
  }
}

/// Curved meshes with fine triangles are what planes are for.
TEST(SurfaceProxy, PlanesAnswerAFineMesh) {
  const Mesh fine = sphere(100, 160, Vector3d::Zero(), 1.0);
  const SurfaceProxy proxy(meshOf(fine), {0.02, 2e-3, 0.25}, Threads(2));
  const auto lists = std::count_if(proxy.leaves().begin(), proxy.leaves().end(),
                                   [](const auto& leaf) { return !leaf.hasPlane(); });
  EXPECT_LT(lists, static_cast<std::ptrdiff_t>(proxy.leaves().size() / 50));
}

/// Lists hold spheres in floats, which are coarse far from the origin.
TEST(SurfaceProxy, ListsAnswerExactlyFarFromTheOrigin) {
  Random random(5);
  std::size_t number = 0;
  for (const double offset : {0.0, 1e3, 1e5, 1e6, 1e8}) {
    SCOPED_TRACE(offset);
    const Eigen::Vector3d centre = offset * Eigen::Vector3d(1.0, -0.7, 0.3);
    for (const auto& [body, half] :
         {std::pair{boxMesh(centre.array() - 1.0, centre.array() + 1.0), 1.0},
          std::pair{sphere(6, 9, centre, 1.0), 0.8}}) {
      if (isLeftOut(number++)) continue;
      std::vector<Vector3d> points;
      for (int i = 0; i < casesOf(4000); ++i) {
        Vector3d at = randomPoint(random, -1, 1);
        for (int k = 0; k <= i % 3; ++k)
          at[k] = (at[k] < 0 ? -half : half) + 0.006 * uniform(random, -1, 1);
        points.push_back(centre + at);
      }
      OctreeBasedCD detection;
      const GeometryId particles = detection.addPointSet(points, 0.0),
                       id = detection.addTriangleMesh(body.positions, body.triangles);
      detection.addCollisionPair(
          particles, id, {.method = Method::Proxy, .thickness = 0.02, .allowedError = 1e-3});
      detection.detectCollision();
      const CollisionData& data = detection.collisionData(particles, id);
      const SpatialQueries queries = detection.queries();
      EXPECT_GT(data.shape().size(), points.size() / 100);
      for (const ShapeContact& contact : data.shape())
        ASSERT_NEAR(contact.distance, queries.signedDistance(id, points[contact.id]).distance,
                    data.errorBound());
    }
  }
}

TEST(SurfaceProxy, RefusesWhatIsTooLarge) {
  const auto expectTooLarge = [](const Mesh& body, const ProxySettings& settings) {
    expectRefused(ErrorCode::TooLarge, "",
                  [&] { SurfaceProxy(meshOf(body), settings, Threads(2)); });
  };
  const Mesh ball = sphere(12, 18, Vector3d::Zero(), 1.0);
  ProxySettings settings{0.1, 0.02, 0.5};
  EXPECT_NO_THROW(SurfaceProxy(meshOf(ball), settings, Threads(2)));
  settings.reach = 0x1p401;
  expectTooLarge(ball, settings);
  // A thickness of ten times the body's size. The work that is allowed is less here.
  settings = {20.0, 1e-6, 0.5, 1u << 22};
  expectTooLarge(ball, settings);
  settings = {0.1, 1e-9, 0.5, ProxySettings{}.mostWork, 1u << 10};
  expectTooLarge(ball, settings);
}

/// 512 entries for each triangle, but from 2^23 to 2^26.
TEST(SurfaceProxy, ListsMayGrowWithTheTriangles) {
  const ProxySettings settings;
  const std::uint64_t floor = 1u << 23, most = 1u << 26;
  EXPECT_EQ(settings.mostListedOf(0), floor);
  EXPECT_EQ(settings.mostListedOf(floor / 512), floor);
  EXPECT_EQ(settings.mostListedOf(floor / 512 + 1), floor + 512);
  EXPECT_EQ(settings.mostListedOf(most / 512 - 1), most - 512);
  EXPECT_EQ(settings.mostListedOf(most / 512), most);
  EXPECT_EQ(settings.mostListedOf(std::size_t{1} << 40), most);
}

/// The refusal takes at most 2^28 comparisons, a part of a second. Without the limit on lists, the
/// message would name the limit on comparisons.
TEST(SurfaceProxy, RefusesLongListsSoon) {
  struct Case {
    std::uint32_t rings, segments;
    double reach;
    std::uint64_t triangles, most;
  };
  // In the third case, the nodes that are shared by all tasks have items in lists, which count
  // threefold.
  for (const auto& [rings, segments, reach, triangles, most] :
       {Case{12, 18, 20.0, 396, 1u << 23}, Case{80, 110, 1.2, 17380, 512u * 17380},
        Case{80, 110, 20.0, 17380, 512u * 17380 / 3}}) {
    const Mesh ball = sphere(rings, segments, Vector3d::Zero(), 1.0);
    ASSERT_EQ(ball.triangles.size(), triangles);
    ProxySettings settings{reach, 1e-6, 0.5};
    settings.mostWork = 1u << 28;
    expectRefused(ErrorCode::TooLarge,
                  "more than " + std::to_string(most) + " entries in lists of triangles",
                  [&] { SurfaceProxy(meshOf(ball), settings, Threads(2)); });
  }
}

}  // namespace
}  // namespace palpate::testing
