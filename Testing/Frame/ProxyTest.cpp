// Method::Proxy: its contacts beside exact distances, with the error that the result states.
#include <palpate/FeaturePairs.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/FailingAllocation.h"
#include "Common/PairRun.h"
#include "Core/SimdPath.h"
#include "Common/FieldMeshes.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

namespace palpate::testing {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

struct ParticleScene {
  std::string name;
  Mesh body;
  bool isClosed;
  double thickness, allowedError;
  Matrix3d rotation = Matrix3d::Identity();
  Vector3d translation = Vector3d::Zero();
  bool isPlaced = false;
};

Mesh organ(Random& random) {
  Mesh mesh = sphere(28, 40, Vector3d::Zero(), 1.0);
  const Vector3d phase = randomPoint(random, 0, 6);
  for (Vector3d& p : mesh.positions)
    p *= 1.0 + 0.12 * std::sin(3 * p[0] + phase[0]) * std::cos(4 * p[1] + phase[1]) +
         0.03 * std::sin(9 * p[2] + phase[2]);
  return mesh;
}

std::vector<ParticleScene> scenes() {
  Random random(5);
  std::vector<ParticleScene> all{
      {"sphere", sphere(24, 36, {0.1, 0.2, 0.3}, 1.0), true, 0.05, 0.02},
      {"torus", torusMesh(40, 20), true, 0.04, 0.02},
      {"box", boxMesh({-1, -0.5, -0.25}, {1, 0.5, 0.25}), true, 0.03, 1e-3},
      {"fine box", dividedBox({-1, -0.7, -0.5}, {1, 0.7, 0.5}, 6), true, 0.05, 1e-4},
      {"thin plate", dividedBox({-1, -1, -0.004}, {1, 1, 0.004}, 8), true, 0.05, 1e-3},
      {"open sheet", sheet(24, 0.0, 0.4), false, 0.03, 4e-3},
      {"organ", organ(random), true, 0.05, 0.02},
      {"star", starMesh(random), true, 0.05, 0.01},
      {"soup", soup(random, 60, 0.1), false, 0.03, 0.01},
      {"wide thickness", sphere(24, 36, Vector3d::Zero(), 1.0), true, 0.3, 0.05},
  };
  const std::size_t unplaced = all.size();
  for (std::size_t i = 0; i < unplaced; i += 2) {
    ParticleScene scene = all[i];
    scene.name += ", placed";
    scene.isPlaced = true;
    const double angle = uniform(random, 0, 6);
    scene.rotation =
        Eigen::AngleAxisd(angle, randomPoint(random, -1, 1).normalized()).toRotationMatrix();
    // As inexact as setTransform() accepts.
    if (i % 4 == 0) scene.rotation(0, 1) += 3e-10;
    scene.translation = randomPoint(random, -50, 50);
    all.push_back(scene);
  }
  return all;
}

/// Points on the body, near it, far from it, and in its bounding box.
Points particlesAround(Random& random, const ParticleScene& scene, std::size_t count) {
  Points world = scene.body.positions, points;
  for (Vector3d& p : world) p = scene.rotation * p + scene.translation;
  for (std::size_t i = 0; i < count; ++i) {
    const auto& [a, b, c] = scene.body.triangles[random() % scene.body.triangles.size()];
    const double s = random() % 5 ? uniform(random, 0, 1) : 0.0,
                 t = random() % 5 ? uniform(random, 0, 1 - s) : 0.0;
    Vector3d p = world[a] + s * (world[b] - world[a]) + t * (world[c] - world[a]);
    const std::uint64_t kind = random() % 8;
    if (kind > 0) p += randomPoint(random, -1, 1) * scene.thickness * (kind > 5 ? 4.0 : 1.0);
    points.push_back(p);
  }
  return points;
}

PairSettings pairOf(const ParticleScene& scene) {
  PairSettings pair{.method = Method::Proxy, .thickness = scene.thickness};
  pair.allowedError = scene.allowedError;
  pair.proxy.widestNormalCone = 0.6;  // the meshes are coarse
  return pair;
}

struct ParticleRun {
  ParticleRun(const ParticleScene& scene, const Points& points, std::span<const double> radii,
              const Settings& settings)
      : detection(settings) {
    smoke = detection.addPointSet(points, radii);
    body = addMesh(detection, scene.body);
    if (scene.isPlaced) detection.setTransform(body, {scene.rotation, scene.translation});
    detection.addCollisionPair(smoke, body, pairOf(scene));
    detection.detectCollision();
  }
  const CollisionData& data() const { return detection.collisionData(smoke, body); }

  OctreeBasedCD detection;
  GeometryId smoke, body;
};

void expectWithinError(const ParticleScene& scene, const Points& points,
                       std::span<const double> radii, const ParticleRun& run,
                       std::size_t& contacts) {
  const Validity& validity = run.data().validity();
  EXPECT_EQ(validity.method, Method::Proxy);
  EXPECT_FALSE(validity.trusted);
  EXPECT_LE(run.data().errorBound(), scene.allowedError * (1 + 1e-6) + 1e-8);
  EXPECT_GE(validity.proxyDepth, scene.thickness);
  EXPECT_EQ(validity.displacementLimit, scene.thickness);
  const double error = run.data().errorBound() + 1e-14;
  const SpatialQueries queries = run.detection.queries();
  auto next = run.data().shape().begin();
  const auto end = run.data().shape().end();
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const double exact = scene.isClosed ? queries.signedDistance(run.body, points[i]).distance
                                        : queries.closestPoint(run.body, points[i])->distance,
                 limit = scene.thickness + radii[i];
    if (next == end || next->id != i) {
      EXPECT_FALSE(exact < limit - error && exact > error - validity.proxyDepth)
          << "particle " << i << " at " << exact << " is missing";
      continue;
    }
    const ShapeContact& c = *next++;
    ++contacts;
    EXPECT_LE(exact, limit + error) << "particle " << i;
    EXPECT_GE(exact, -validity.proxyDepth - error);
    const double found = c.distance + radii[i];
    EXPECT_NEAR(found, exact, error) << "particle " << i;
    EXPECT_LE(found, limit);
    EXPECT_NEAR(c.normal.norm(), 1.0, 1e-12);
    EXPECT_LT((c.point - c.pointOnShape - found * c.normal).norm(), 1e-12);
    EXPECT_EQ(c.point, points[i]);
    EXPECT_EQ(c.element, ShapeElement::Vertex);
    EXPECT_EQ(c.vertices, (std::array{i, i, i}));
    // The point on the surface is near it, too.
    EXPECT_LE(queries.closestPoint(run.body, c.pointOnShape)->distance, error + 1e-12);
  }
  EXPECT_EQ(next, end) << "contacts are not in ascending order of particles";
}

std::vector<double> radiiOf(Random& random, std::size_t count, double most) {
  std::vector<double> radii(count);
  for (double& radius : radii) radius = uniform(random, 0, most);
  return radii;
}

TEST(Proxy, EachContactIsWithinTheStatedErrorAndNoneIsMissing) {
  Random random(1);
  std::size_t number = 0;
  for (const ParticleScene& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    if (isLeftOut(number++)) continue;
    const Points points = particlesAround(random, scene, 1500);
    const std::vector<double> radii = radiiOf(random, points.size(), 0.3 * scene.thickness);
    const ParticleRun run(scene, points, radii, settingsOf(Engine::Octree, 2));
    std::size_t contacts = 0;
    expectWithinError(scene, points, radii, run, contacts);
    EXPECT_GT(contacts, 200u);
    // On curved meshes planes answered.
    const std::string first = scene.name.substr(0, 5);
    if (first == "spher" || first == "torus" || first == "organ" || first == "open ") {
      EXPECT_GT(run.data().errorBound(), 0.2 * scene.allowedError);
    }
  }
}

/// SupportedPairsTest.cpp compares engines and threads.
TEST(Proxy, SimdPathsGiveTheSameBits) {
  Random random(2);
  const std::vector<ParticleScene> all = scenes();
  for (std::size_t i = 2; i<all.size(); i += kShareOfCases> 1 ? 12 : 3) {
    const ParticleScene& scene = all[i];
    SCOPED_TRACE(scene.name);
    const Points points = particlesAround(random, scene, 301);
    const std::vector<double> radii = radiiOf(random, points.size(), 0.3 * scene.thickness);
    const ParticleRun expected(scene, points, radii, settingsOf(Engine::BruteForce));
    ParticleRun run(scene, points, radii, settingsOf(Engine::Octree, 3));
    const Points elsewhere(points.size(), scene.translation);
    for (const std::string& path : simdPaths()) {
      useSimdPath(path);
      run.detection.setPositions(run.smoke, elsewhere);
      run.detection.detectCollision();
      EXPECT_NE(run.data().hash(), expected.data().hash());
      run.detection.setPositions(run.smoke, points);
      run.detection.detectCollision();
      EXPECT_EQ(run.data().hash(), expected.data().hash());
      EXPECT_EQ(run.data().validity(), expected.data().validity());
    }
    useSimdPath("");
  }
}

TEST(Proxy, ParticlesMayBePlacedOrDisabled) {
  Random random(3);
  const ParticleScene scene = scenes()[0];
  const Points points = particlesAround(random, scene, 1000);
  ParticleRun run(scene, points, std::vector<double>(points.size(), 0.01),
                  settingsOf(Engine::Octree));
  OctreeBasedCD& detection = run.detection;
  const std::vector<ShapeContact> before(run.data().shape().begin(), run.data().shape().end());
  ASSERT_GT(before.size(), 100u);
  const Pose pose{Eigen::AngleAxisd(1, Vector3d(1, 2, 3).normalized()).toRotationMatrix(),
                  {3, 4, 5}};
  for (const GeometryId id : {run.smoke, run.body}) detection.setTransform(id, pose);
  detection.detectCollision();
  const auto after = run.data().shape();
  ASSERT_EQ(after.size(), before.size());
  std::size_t same = 0;
  for (std::size_t i = 0; i < after.size(); ++i) {
    // On the border of two leaves, rounding decides which of them answers.
    EXPECT_EQ(after[i].id, before[i].id);
    EXPECT_NEAR(after[i].distance, before[i].distance, 2 * run.data().errorBound());
    same += std::abs(after[i].distance - before[i].distance) < 1e-13 &&
            (after[i].normal - pose.rotation * before[i].normal).norm() < 1e-13;
  }
  EXPECT_GT(same, after.size() - after.size() / 50);
  detection.setDisabledElements(run.smoke, std::vector<std::uint32_t>{before[0].id, before[3].id});
  detection.detectCollision();
  ASSERT_EQ(run.data().shape().size(), before.size() - 2);
  EXPECT_EQ(run.data().shape()[0].id, before[1].id);
  // Without its elements the body has no surface.
  std::vector<std::uint32_t> all(scene.body.triangles.size());
  std::iota(all.begin(), all.end(), 0u);
  detection.setDisabledElements(run.body, all);
  detection.detectCollision();
  EXPECT_TRUE(run.data().shape().empty());
}

TEST(Proxy, AnOpenMeshWithAnOuterSideHasContactsInFrontOnly) {
  Random random(4);
  const ParticleScene scene = scenes()[5];
  const Points points = particlesAround(random, scene, 1000);
  OctreeBasedCD detection(settingsOf(Engine::Octree));
  const GeometryId smoke = detection.addPointSet(points), body = addMesh(detection, scene.body);
  detection.addCollisionPair(smoke, body,
                             {.method = Method::Proxy, .thickness = 0.03, .allowedError = 2e-3});
  const auto countBelow = [&] {
    detection.detectCollision();
    std::size_t below = 0;
    for (const ShapeContact& c : detection.collisionData(smoke, body).shape())
      below += c.normal[2] < 0;
    return below;
  };
  EXPECT_GT(countBelow(), 100u);
  const std::size_t all = detection.collisionData(smoke, body).shape().size();
  detection.setCollisionFilter(body, {.sidedness = Sidedness::Outer});
  // Beside the border, normals may lean over the edge.
  EXPECT_LT(countBelow(), 40u);
  EXPECT_LT(detection.collisionData(smoke, body).shape().size(), all - 100);
}

TEST(Proxy, SetTrianglesAndSettingsBuildNewLeaves) {
  Random random(6);
  const std::vector<ParticleScene> all = scenes();
  const Points points = particlesAround(random, all[1], 800);
  const std::vector<double> radii(points.size(), 0.0);
  ParticleRun run(all[0], points, radii, settingsOf(Engine::Octree));
  run.detection.setTriangles(run.body, all[1].body.positions, all[1].body.triangles);
  const auto detect = [&](const PairSettings& pair) {
    run.detection.setPairSettings(run.smoke, run.body, pair);
    run.detection.detectCollision();
    return run.data().errorBound();
  };
  PairSettings pair = pairOf(all[1]);
  EXPECT_GT(detect(pair), 1e-3);
  const ParticleRun fresh(all[1], points, radii, settingsOf(Engine::Octree));
  EXPECT_EQ(run.data().hash(), fresh.data().hash());
  // A smaller error, and then exact answers by triangles where cones are narrow.
  pair.allowedError = 1e-3;
  EXPECT_LT(detect(pair), 1.001e-3);
  pair.allowedError = 1;
  pair.proxy.widestNormalCone = 1e-6;
  EXPECT_LT(detect(pair), 1e-12);
  // Another method, and this one again.
  EXPECT_EQ(detect({Method::Proximity, 0.04}), 0.0);
  EXPECT_TRUE(run.data().shape().empty());
  EXPECT_FALSE(run.data().vertexTriangle().empty());
  detect(pairOf(all[1]));
  EXPECT_EQ(run.data().hash(), fresh.data().hash());
}

TEST(Proxy, FailedAllocationLeavesTheNextDetectionRight) {
  Random random(9);
  const ParticleScene scene = scenes()[0];
  const Points points = particlesAround(random, scene, 300);
  const std::vector<double> radii(points.size(), 0.0);
  ParticleRun run(scene, points, radii, settingsOf(Engine::Octree));
  const std::uint64_t expected = run.data().hash();
  const auto detect = [&] { run.detection.detectCollision(); };
  std::size_t failures = 0;
  for (std::size_t n = 1; n < 4000; n = 2 * n + 1) {
    // Another thickness and back: the leaves are built anew.
    PairSettings other = pairOf(scene);
    other.thickness *= 1.5;
    run.detection.setPairSettings(run.smoke, run.body, other);
    detect();
    run.detection.setPairSettings(run.smoke, run.body, pairOf(scene));
    failures += FailingAllocation::throwsAt(n, detect);
    detect();
    EXPECT_EQ(run.data().hash(), expected) << "allocation " << n;
  }
  EXPECT_GT(failures, 2u);
}

TEST(Proxy, QueriesFindParticlesAfterADetectionWithoutTheirOctree) {
  Random random(8);
  const ParticleScene scene = scenes()[0];
  Points points = particlesAround(random, scene, 500);
  const std::vector<double> radii(points.size(), 0.0);
  ParticleRun run(scene, points, radii, settingsOf(Engine::Octree));
  for (Vector3d& p : points) p += Vector3d(0.01, 0, 0);
  run.detection.setPositions(run.smoke, points);
  run.detection.detectCollision();
  const FrameStatistics& statistics = run.detection.statistics();
  EXPECT_EQ(statistics.candidatePairs, 0u);
  EXPECT_EQ(statistics.rebuiltOctrees + statistics.refittedOctrees, 0u);
  EXPECT_EQ(run.detection.octree().validate(), std::vector<std::string>{});
  const SpatialQueries queries = run.detection.queries();
  EXPECT_EQ(queries.closestPoint(run.smoke, points[7])->distance, 0.0);
  const std::uint64_t hash = run.data().hash();
  run.detection.detectCollision();  // leaves the queries valid
  EXPECT_EQ(queries.closestPoint(run.smoke, points[9])->distance, 0.0);
  EXPECT_EQ(run.data().hash(), hash);
}

TEST(Proxy, PairsOfOneBodyShareLeaves) {
  Random random(9);
  const ParticleScene scene = scenes()[6];
  const Points first = particlesAround(random, scene, 300), second = {first[5], first[7]};
  const std::vector<double> radii(first.size(), 0.0);
  ParticleRun run(scene, first, radii, settingsOf(Engine::Octree));
  const GeometryId debris = run.detection.addPointSet(second);
  run.detection.addCollisionPair(debris, run.body, pairOf(scene));
  FailingAllocation::arm(0);
  run.detection.detectCollision();
  FailingAllocation::disarm();
  EXPECT_LT(FailingAllocation::peakBytes(), 100000u);  // the leaves need more
  run.detection.setPositions(run.smoke, first);
  for (const ShapeContact& c : run.detection.collisionData(debris, run.body).shape()) {
    bool found = false;
    for (const ShapeContact& other : run.data().shape())
      found |= other.point == c.point && other.distance == c.distance;
    EXPECT_TRUE(found);
  }
}

TEST(Proxy, IsRefusedWhereItHasNoMeaning) {
  OctreeBasedCD detection(settingsOf(Engine::Octree));
  const Mesh ball = sphere(8, 12, Vector3d::Zero(), 1.0);
  const std::vector<Segment> segments{{0, 1}};
  const GeometryId body = addMesh(detection, ball),
                   points = detection.addPointSet(ball.positions, 0.01),
                   lines = detection.addLineMesh(ball.positions, segments, 0.01),
                   shape = detection.addAnalyticalGeometry(Sphere{});
  PairSettings pair{.method = Method::Proxy, .thickness = 0.05, .allowedError = 0.01};
  const auto refuse = [&](GeometryId a, GeometryId b, ErrorCode code, const char* words) {
    expectRefused(code, words, [&] { detection.addCollisionPair(a, b, pair); });
  };
  constexpr auto kType = ErrorCode::UnsupportedMethod;
  refuse(body, points, kType, "for a point set and a triangle mesh in this order");
  refuse(body, body, kType, "for a point set and a triangle mesh in this order");
  refuse(lines, body, kType, "not for a line mesh and a triangle mesh");
  refuse(points, lines, kType, "for a point set and a triangle mesh in this order");
  refuse(points, shape, kType, "for a point set and a triangle mesh in this order");
  constexpr auto kSettings = ErrorCode::InvalidSettings;
  pair.allowedError = 0;
  refuse(points, body, kSettings, "needs a positive allowedError");
  pair.allowedError = std::numeric_limits<double>::infinity();
  refuse(points, body, kSettings, "allowedError is inf");
  pair.allowedError = -1;
  refuse(points, body, kSettings, "allowedError is -1");
  pair.allowedError = 0.01;
  for (const double cone : {0.0, 1.6, -1.0, std::nan("")}) {
    pair.proxy.widestNormalCone = cone;
    refuse(points, body, kSettings, "widestNormalCone is");
  }
  pair.proxy.widestNormalCone = 0.2;
  detection.addCollisionPair(points, body, pair);
  expectRefused(kType, "contact predicates are not for Method::Proxy", [&] {
    detection.setContactPredicate(points, body, [](const ContactFeatures&) { return true; });
  });
  detection.detectCollision();
  expectRefused(ErrorCode::NotAvailable, "uses Method::Proxy and has no candidate pairs",
                [&] { detection.candidatePairs(points, body); });
  Points moved = ball.positions;
  moved[3] += Vector3d(0.1, 0, 0);
  detection.setPositions(body, moved);
  expectRefused(kType, "is for a rigid body", [&] { detection.detectCollision(); });
  detection.setTriangles(body, moved, ball.triangles);
  detection.detectCollision();
  EXPECT_FALSE(detection.collisionData(points, body).shape().empty());
}

}  // namespace

}  // namespace palpate::testing
