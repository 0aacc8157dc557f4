#include <palpate/OctreeBasedCD.h>

#include "Scenes.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdlib>

extern "C" void* __libc_malloc(std::size_t);
extern "C" void* __libc_realloc(void*, std::size_t);

namespace {
std::atomic<std::size_t> allocations{0};
}

/// Counts every allocation of the process, whoever makes it.
extern "C" void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
extern "C" void* realloc(void* memory, std::size_t size) {
  ++allocations;
  return __libc_realloc(memory, size);
}

namespace palpate {
namespace {

std::size_t allocationsOfSecondPass(const Settings& settings, const PairSettings& pairSettings) {
  const scenes::Scene scene = scenes::organs();
  OctreeBasedCD detection(settings);
  std::vector<GeometryId> ids;
  for (const auto& mesh : scene.meshes)
    ids.push_back(detection.addTriangleMesh(mesh.positions, mesh.triangles));
  for (const auto& [a, b] : scene.pairs) detection.addCollisionPair(ids[a], ids[b], pairSettings);
  std::vector<Eigen::Vector3d> positions;
  std::size_t before = 0;
  for (int frame = 0; frame < 2 * scene.frames; ++frame) {
    if (frame == scene.frames) before = allocations;
    for (std::size_t m = 0; m < ids.size(); ++m) {
      scene.positions(frame, m, positions);
      detection.setPositions(ids[m], positions);
    }
    detection.detectCollision();
  }
  return allocations - before;
}

TEST(SteadyFrame, AllocatesNothing) {
  Settings settings;
  settings.threads = 1;
  PairSettings proximity;
  proximity.thickness = scenes::organs().thickness;
  for (const OctreeUpdate update : {OctreeUpdate::Auto, OctreeUpdate::Rebuild}) {
    settings.octree.update = update;
    EXPECT_EQ(allocationsOfSecondPass(settings, proximity), 0u);
  }
}

TEST(SteadyFrame, AllocatesNothingWithLinesAndPoints) {
  constexpr std::uint32_t kSegments = 400;
  const scenes::SceneMesh sheet = scenes::sheet(40);
  std::vector<Segment> segments;
  for (std::uint32_t i = 0; i < kSegments; ++i) segments.push_back({i, i + 1});
  std::vector<Eigen::Vector3d> thread(kSegments + 1);
  const auto wind = [&](int frame) {
    for (std::uint32_t i = 0; i <= kSegments; ++i) {
      const double s = 0.0157 * i, phase = 0.1 * frame;
      thread[i] = {std::sin(3 * s + phase), std::sin(5 * s), 0.1 * std::sin(7 * s + phase)};
    }
  };
  wind(0);
  OctreeBasedCD detection(Settings{.threads = 1});
  const GeometryId tissue = detection.addTriangleMesh(sheet.positions, sheet.triangles),
                   suture = detection.addLineMesh(thread, segments, 0.01),
                   smoke = detection.addPointSet(thread, 0.02);
  const PairSettings near{.method = Method::Proximity, .thickness = 0.02};
  PairSettings self = near;
  self.restDistance = 0.1;
  detection.addCollisionPair(suture, suture, self);
  detection.addCollisionPair(suture, tissue, near);
  detection.addCollisionPair(smoke, tissue, near);
  std::size_t before = 0, contacts = 0;
  for (int frame = 0; frame < 20; ++frame) {
    if (frame == 10) before = allocations;
    wind(frame % 10);
    detection.setPositions(suture, thread);
    detection.setPositions(smoke, thread);
    detection.detectCollision();
    contacts += detection.statistics().contacts;
  }
  EXPECT_EQ(allocations - before, 0u);
  EXPECT_GT(contacts, 1000u);
}

TEST(SteadyFrame, AllocatesNothingWithShapes) {
  const scenes::SceneMesh sheet = scenes::sheet(40);
  OctreeBasedCD detection(Settings{.threads = 1});
  const GeometryId tissue = detection.addTriangleMesh(sheet.positions, sheet.triangles);
  std::vector<GeometryId> tools;
  for (const AnalyticalGeometry& tool : std::vector<AnalyticalGeometry>{
           Capsule{{-0.513, 0.0137, 0.3}, {0.487, 0.1093, 0.3317}, 0.4},
           Box{{0, 0, 0}, {0.2, 0.3, 0.1}}, Cylinder{{0, 0, -0.1}, {0, 0.3, 0}, 0.2}, Plane{}}) {
    tools.push_back(detection.addAnalyticalGeometry(tool));
    detection.addCollisionPair(tissue, tools.back(), {Method::Proximity, 0.01});
  }
  std::size_t before = 0, contacts = 0;
  for (int frame = 0; frame < 20; ++frame) {
    if (frame == 10) before = allocations;
    for (const GeometryId tool : tools)
      detection.setTransform(tool, Eigen::Matrix3d::Identity(), {0.02 * (frame % 10), 0, 0.05});
    detection.detectCollision();
    contacts += detection.statistics().contacts;
    EXPECT_EQ(detection.statistics().exactDecisions, 0u);
  }
  EXPECT_EQ(allocations - before, 0u);
  EXPECT_GT(contacts, 1000u);
}

TEST(SteadyFrame, CountsAllocations) {
  const std::size_t before = allocations;
  std::vector<int> some(allocations % 7 + 1);
  EXPECT_GE(allocations - before, some.empty() ? 0u : 1u);
}

}  // namespace
}  // namespace palpate
