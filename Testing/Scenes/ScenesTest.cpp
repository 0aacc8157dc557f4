#include "Scenes.h"
#include "World.h"

#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

namespace palpate::scenes {
namespace {

using Eigen::Vector3d;

/// Every edge is in two triangles, once in each direction.
bool closedAndConsistentlyWound(const SceneMesh& mesh) {
  std::map<Segment, int> directed;
  for (const auto& [a, b, c] : mesh.triangles) {
    for (const Segment& side : {Segment{a, b}, Segment{b, c}, Segment{c, a}}) ++directed[side];
  }
  for (const auto& [side, count] : directed) {
    const auto opposite = directed.find({side[1], side[0]});
    if (count != 1 || opposite == directed.end()) return false;
  }
  return true;
}

double volume(const SceneMesh& mesh) {
  double six = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    six += mesh.positions[a].dot(mesh.positions[b].cross(mesh.positions[c]));
  }
  return six / 6;
}

std::vector<Eigen::AlignedBox3d> boxes(const Scene& scene, int frame, std::size_t mesh) {
  std::vector<Vector3d> positions;
  scene.positions(frame, mesh, positions);
  const Vector3d margin = Vector3d::Constant(scene.thickness / 2);
  std::vector<Eigen::AlignedBox3d> result;
  for (const auto& [a, b, c] : scene.meshes[mesh].triangles) {
    Eigen::AlignedBox3d box(positions[a]);
    box.extend(positions[b]).extend(positions[c]);
    result.emplace_back(box.min() - margin, box.max() + margin);
  }
  return result;
}

std::size_t candidates(const Scene& scene, int frame, std::size_t a, std::size_t b) {
  std::size_t count = 0;
  const auto boxesB = boxes(scene, frame, b);
  Eigen::AlignedBox3d all;
  for (const auto& box : boxesB) all.extend(box);
  for (const auto& box : boxes(scene, frame, a)) {
    if (!box.intersects(all)) continue;
    for (const auto& other : boxesB) count += box.intersects(other);
  }
  return count;
}

TEST(Meshes, HaveTheirCountsClosureAndWinding) {
  for (const SceneMesh& mesh : {sphere(1), sphere(2), sphere(11), gradedSphere(24, 1e-2)}) {
    EXPECT_TRUE(closedAndConsistentlyWound(mesh));
    EXPECT_EQ(mesh.positions.size(), mesh.triangles.size() / 2 + 2);
    EXPECT_GT(volume(mesh), 2.5);
  }
  EXPECT_EQ(sphere(7).triangles.size(), 20u * 49);
  EXPECT_EQ(sheet(9).triangles.size(), 162u);
  EXPECT_EQ(tube(5, 4).triangles.size(), 40u);
}

TEST(Meshes, GradedSphereSpansItsRangeOfSizes) {
  const SceneMesh mesh = gradedSphere(119, 1e-4);
  double least = 1, most = 0;
  for (const auto& [a, b, c] :
       std::span(mesh.triangles)
           .first(mesh.triangles.size() - 2 * 119)) {  // without the fans at the poles
    const Vector3d& corner = mesh.positions[a];
    const double size =
        std::sqrt((mesh.positions[b] - corner).cross(mesh.positions[c] - corner).norm());
    least = std::min(least, size);
    most = std::max(most, size);
  }
  EXPECT_NEAR(most / least, 1e4, 2e3);
}

TEST(Organs, AreClosedWoundOutwardAndOfTheirSize) {
  std::map<std::string, double> millilitres;
  std::size_t triangles = 0;
  for (const auto& [name, mesh] : organMeshes()) {
    EXPECT_TRUE(closedAndConsistentlyWound(mesh)) << name;
    millilitres[name] = volume(mesh) / 1000;
    triangles += mesh.triangles.size();
  }
  EXPECT_EQ(triangles, 11'100u);
  EXPECT_NEAR(millilitres["Liver"], 900, 50);
  EXPECT_NEAR(millilitres["Stomach"], 280, 30);
  EXPECT_NEAR(millilitres["Spleen"], 165, 20);
  EXPECT_NEAR(millilitres["Kidney"], 120, 20);
  EXPECT_LT(millilitres["Gallbladder"], 30);
  EXPECT_EQ(organs().triangleCount(), 10840u);
}

TEST(Organs, BreatheAlongEachOther) {
  const Scene scene = breathingOrgans();
  std::size_t touching = 0;
  for (const auto& [a, b] : scene.pairs) touching += candidates(scene, 30, a, b) > 0;
  EXPECT_GE(touching, 4u);  // the liver with three organs, the stomach with the spleen
}

TEST(Organs, FilesMatchTheGenerator) {
  for (const Organ& organ : organMeshes()) {
    std::ifstream file(std::filesystem::path(PALPATE_SOURCE_DIR "/Data/Organs") /
                       (organ.name + ".obj"));
    std::stringstream text;
    text << file.rdbuf();
    EXPECT_TRUE(text.str() == organObj(organ)) << organ.name;
  }
}

TEST(Organs, EveryPairTouchesAndSeparates) {
  const Scene scene = organs();
  ASSERT_EQ(scene.pairs.size(), 10u);
  std::size_t apart = 0, together = 0;
  for (const auto& [a, b] : scene.pairs) {
    const std::size_t atCentre = candidates(scene, 30, a, b);
    EXPECT_GT(atCentre, 1000u) << a << " " << b;
    together += atCentre;
    apart += candidates(scene, 0, a, b);
  }
  EXPECT_GT(together, 30'000u);
  EXPECT_LT(together, 90'000u);
  EXPECT_LT(apart, 3'000u);
}

TEST(Scenes, AreReproducibleAndPeriodic) {
  for (const auto make : {organs, unevenBodies, foldedCloth}) {
    const Scene first = make(), second = make();
    std::vector<Vector3d> one, other, later;
    for (std::size_t m = 0; m < first.meshes.size(); ++m) {
      first.positions(17, m, one);
      second.positions(17, m, other);
      first.positions(17 + first.frames, m, later);
      EXPECT_EQ(one, other);
      EXPECT_EQ(one, later);
      EXPECT_EQ(one.size(), first.meshes[m].positions.size());
    }
    EXPECT_EQ(first.thickness, second.thickness);
  }
}

TEST(Scenes, HaveTheirTriangleCounts) {
  EXPECT_EQ(clothOnBall().meshes.front().triangles.size(), 112'338u);
  EXPECT_EQ(unevenBodies().triangleCount(), 103'292u);
  EXPECT_EQ(foldedCloth().triangleCount(), 18'050u);
  EXPECT_EQ(twistedRods().triangleCount(), 80'640u);
  for (const std::size_t count : {1'000u, 16'000u, 64'000u}) {
    const double cells = std::sqrt(count / 4.0);  // per side, rounded to a whole number
    EXPECT_NEAR(static_cast<double>(interleavedSheets(count).triangleCount()), count,
                1.1 * count / cells);
  }
}

// Boxes, keys, octree and scratch together, also if every frame is rebuilt and each buffer has its
// peak size.
TEST(Scenes, NeedLessThanAHundredBytesPerTriangle) {
  for (const Scene& scene : {organs(), foldedCloth(), interleavedSheets(64'000)}) {
    Settings settings;
    settings.octree.update = OctreeUpdate::Rebuild;
    OctreeBasedCD detection(settings);
    std::vector<GeometryId> ids;
    for (const SceneMesh& mesh : scene.meshes)
      ids.push_back(detection.addTriangleMesh(mesh.positions, mesh.triangles));
    std::vector<Vector3d> positions;
    for (int frame = 0; frame < scene.frames; ++frame) {
      for (std::size_t mesh = 0; mesh < ids.size(); ++mesh) {
        scene.positions(frame, mesh, positions);
        detection.setPositions(ids[mesh], positions);
      }
      detection.update();
    }
    const OctreeStatistics statistics = detection.octree().statistics();
    EXPECT_LT(statistics.bytes, 100 * statistics.elements) << scene.meshes[0].triangles.size();
  }
}

TEST(Scenes, HardScenesAreSmallPeriodicAndTouch) {
  const std::vector<Scene> scenes = hardScenes();
  ASSERT_EQ(scenes.size(), 8u);
  for (const Scene& scene : scenes) {
    EXPECT_LT(scene.triangleCount(), 3'000u) << scene.name;
    std::size_t most = 0;
    std::vector<Vector3d> one, later;
    for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
      scene.positions(5, m, one);
      scene.positions(5 + scene.frames, m, later);
      EXPECT_EQ(one, later) << scene.name;
    }
    for (int frame = 0; frame < scene.frames; ++frame)
      for (const auto& [a, b] : scene.pairs) most = std::max(most, candidates(scene, frame, a, b));
    EXPECT_GT(most, 20u) << scene.name;
  }
}

TEST(Scenes, OneMeshGlidesThroughItsCopy) {
  const Scene scene = glidingMeshes({sphere(6)});
  ASSERT_EQ(scene.meshes.size(), 2u);
  EXPECT_EQ(candidates(scene, 0, 0, 1), 0u);
  EXPECT_GT(candidates(scene, 26, 0, 1), 0u);
}

/// A body that passes through another within the first step has impacts there.
TEST(World, FirstStepHasMotion) {
  World world(1);
  const SceneMesh floor{{{-5, -5, 0}, {5, -5, 0}, {0, 5, 0}}, {{0, 1, 2}}};
  const SceneMesh thrown{{{-1, -1, 1}, {1, -1, 1}, {0, 1, 1}}, {{0, 1, 2}}};
  const World::BodyId below = world.addMesh("floor", floor, 0),
                      above = world.addMesh("thrown", thrown, 1);
  world.addPair(above, below, {.method = Method::Continuous}, 0);
  world.predict(1.0, {0, 0, -2}, 0);  // from z = 1 to z = -1
  world.detectOnly();
  EXPECT_EQ(world.contacts(above, below).vertexTriangle().size(), 3u);
}

}  // namespace
}  // namespace palpate::scenes
