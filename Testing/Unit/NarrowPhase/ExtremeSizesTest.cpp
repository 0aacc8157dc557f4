// Triangles at one point, around one vertex, and of sizes and distances of very different orders:
// the work that their contacts need. Frame/DegenerateCasesTest.cpp compares contacts.
#include <palpate/OctreeBasedCD.h>

#include "Common/DegenerateCases.h"
#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Common/SupportedMethods.h"
#include "NarrowPhase/FeatureTests.h"
#include "NarrowPhase/ProximityFilter.h"
#include "NarrowPhase/SharedVertex.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace palpate::testing {
namespace {

using Eigen::Vector3d;

Mesh atOnePoint(std::uint32_t n) {
  Mesh mesh;
  const Vector3d p(0.25, 0.5, 0.75);
  for (std::uint32_t i = 0; i < n; ++i) addTriangle(mesh, p, p, p);
  return mesh;
}

/// A triangle around a position: `width` wide.
Mesh triangleAt(const Vector3d& centre, double width) {
  const Vector3d u(0, 1, 0), v(0.3, 0, -1);
  Mesh mesh;
  addTriangle(mesh, centre + width * u, centre + width * (0.8 * v - 0.5 * u),
              centre - width * (0.8 * v + 0.5 * u));
  return mesh;
}

/// A cone of n triangles around vertex 0.
Mesh star(std::uint32_t n) {
  Mesh mesh;
  mesh.positions.push_back({0, 0, 0.5});
  for (std::uint32_t i = 0; i < n; ++i) {
    mesh.positions.push_back({std::cos(6.283185307 * i / n), std::sin(6.283185307 * i / n), 0});
    mesh.triangles.push_back({0, 1 + i, 1 + (i + 1) % n});
  }
  return mesh;
}

TEST(ExtremeSizes, TrianglesAtOnePointNeedNoExactArithmetic) {
  const Mesh a = atOnePoint(14), b = atOnePoint(9);
  for (const Method method : supportedMethods(GeometryType::Triangles, GeometryType::Triangles))
    for (const Contacts contacts : {Contacts::Distinct, Contacts::All}) {
      PairRun run(settingsOf(Engine::Octree), a, b, {method, 0.125, contacts});
      run.step(a.positions, a.positions, b.positions, b.positions);
      EXPECT_EQ(run.detection().statistics().exactDecisions, 0u) << static_cast<int>(method);
    }
}

/// The number of pairs of a star's triangles that are near each other only at its vertex.
TEST(ExtremeSizes, FewPairsAroundAVertexAreMeasured) {
  const std::uint32_t n = 200;
  const Mesh mesh = star(n);
  std::vector<FloatPoint> floats;
  for (const Vector3d& p : mesh.positions) floats.push_back(FloatFrame()(p));
  FloatPair pair{floats.data(), floats.data()};
  const MeshTopology topology(mesh.positions.size(), mesh.triangles);
  pair.shiftLower.fill(-1e-4f);
  pair.shiftUpper.fill(1e-4f);
  const std::vector<ElementPair> first{{0, 1}};
  const SharedVertex sharedVertex(topology, &pair, first);
  std::size_t measured = 0;
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = i + 1; j < n; ++j) {
      const Triangle &s = mesh.triangles[i], &t = mesh.triangles[j];
      const bool areNeighbours = j == i + 1 || (i == 0 && j == n - 1);
      const bool isAlone = sharedVertex.isAlone(s, t, sameCorners(s, t));
      EXPECT_FALSE(areNeighbours && isAlone);
      measured += !isAlone;
    }
  EXPECT_LT(measured, 4 * n);
}

/// Of a large and a tiny triangle, a feature pair is measured only if they may be near.
TEST(ExtremeSizes, TinyTrianglesAreDroppedByTheirBoxes) {
  TrianglePairBatch batch{};
  const Mesh large = triangleAt({1, 0, 0.3}, 0.02);
  for (int lane = 0; lane < TrianglePairBatch::kSize; ++lane) {
    // The tiny triangle is near the origin, or, in odd lanes, at a corner of the large one.
    const Mesh tiny =
        triangleAt(lane % 2 ? large.positions[1] : Vector3d::Zero(), std::exp2(-12 - 3 * lane));
    for (int corner = 0; corner < 3; ++corner)
      for (int axis = 0; axis < 3; ++axis) {
        batch.coordinates[TrianglePairBatch::rowOfA(corner, axis)][lane] =
            large.positions[static_cast<std::size_t>(corner)][axis];
        batch.coordinates[TrianglePairBatch::rowOfB(corner, axis)][lane] =
            tiny.positions[static_cast<std::size_t>(corner)][axis];
      }
  }
  std::uint32_t possible[TrianglePairBatch::kSize];
  findPossibleProximity(batch, 1e-3, true, 0.0, possible);
  for (int lane = 0; lane < TrianglePairBatch::kSize; ++lane)
    EXPECT_EQ(possible[lane] != 0, lane % 2 == 1) << lane;
}

}  // namespace
}  // namespace palpate::testing
