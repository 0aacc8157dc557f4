#include "Common/ContactRows.h"
#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"

#include <palpate/ConstraintRows.h>
#include <palpate/OctreeBasedCD.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

// A blunt tool a little way in a coarse sheet or slab. Its walls are far from the sheet's vertices,
// and are not where the vertices leave it.
namespace palpate::testing {
namespace {

using Eigen::Vector3d;

/// All lengths in mm. The tool is 6 wide; its end is at z = -depth, and the surface at z = 0.
struct BluntScene {
  Mesh tool, surface;
  std::string name;
};

std::vector<BluntScene> bluntScenes(double depth, bool closed) {
  std::vector<BluntScene> all;
  for (const int cells : {3, 5, 9, 20}) {
    Mesh surface = closed ? dividedBox({-15, -15, -6}, {15, 15, 0}, cells)
                          : sheet(static_cast<std::uint32_t>(cells), 0, 0);
    if (!closed)
      for (Vector3d& p : surface.positions) p = {30 * p.x() - 15, 30 * p.y() - 15, 0};
    for (const int parts : {1, 2, 4})
      all.push_back({dividedBox({-2.9, -3.2, -depth}, {3.1, 2.8, 12}, parts), surface,
                     std::to_string(cells) + " cells, " + std::to_string(parts) + " parts" +
                         (closed ? ", closed" : "")});
  }
  return all;
}

/// Calls f(contact, how far it pushes the tool up).
template <class F>
void forEachOf(const CollisionData& data, F&& f) {
  for (const auto& c : data.vertexTriangle()) f(c, c.normal.z());
  for (const auto& c : data.triangleVertex()) f(c, -c.normal.z());
  for (const auto& c : data.edgeEdge()) f(c, c.normal.z());
}

TEST(BluntTool, HasContactsAsDeepAsItIs) {
  constexpr double kDepth = 0.01;
  std::size_t number = 0;
  for (const bool closed : {false, true})
    for (const double thickness : {0.0, 0.1})
      for (const Contacts contacts : {Contacts::Distinct, Contacts::All})
        for (const BluntScene& scene : bluntScenes(kDepth, closed)) {
          if (testing::isLeftOut(number++)) continue;
          SCOPED_TRACE(scene.name + ", " + std::to_string(thickness) + ", " + toString(contacts));
          const PairSettings pair{.thickness = thickness, .contacts = contacts};
          std::vector<std::uint64_t> hashes;
          for (const Engine engine : {Engine::Octree, Engine::BruteForce}) {
            PairRun run(testing::settingsOf(engine), scene.tool, scene.surface, pair, false);
            run.detect();
            hashes.push_back(run.data().hash());
            int below = 0;
            forEachOf(run.data(), [&](const auto& c, double up) {
              EXPECT_GE(up, -1e-9);
              below += c.distance < 0.0;
              // Of all features that are near, some are as far beside each other.
              if (c.distance >= 0.0 || contacts == Contacts::All) return;
              EXPECT_GE(c.distance, -kDepth - 1e-12);
              EXPECT_GE(up, 1.0 - 1e-9);
            });
            EXPECT_GE(below, 4);
          }
          EXPECT_EQ(hashes[0], hashes[1]);
        }
}

/// Where the step begins in intersection as well as where it ends out of it.
TEST(BluntTool, IsLetOutOfASheet) {
  for (const bool closed : {false, true})
    for (const BluntScene& scene : bluntScenes(0.01, closed)) {
      SCOPED_TRACE(scene.name);
      PairRun run(testing::settingsOf(Engine::Octree), scene.tool, scene.surface,
                  {.thickness = 0.1}, false);
      std::vector<Vector3d> up = scene.tool.positions;
      for (Vector3d& p : up) p.z() += 0.03;
      run.step(scene.tool.positions, up, scene.surface.positions, scene.surface.positions);
      forEachOf(run.data(), [](const auto&, double towards) { EXPECT_GE(towards, -1e-9); });
    }
}

}  // namespace
}  // namespace palpate::testing
