#include "NarrowPhase/FeatureBounds.h"

#include <palpate/FeaturePairs.h>

#include "Common/EverySimdPath.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "NarrowPhase/FeatureTests.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <vector>

namespace palpate {
namespace {

using namespace testing;
using Eigen::Vector3d;

struct BoundsScene {
  Mesh a, b;
  MeshTopology topologyA, topologyB;
  std::vector<FloatPoint> floatsA, floatsB;
  std::vector<ElementPair> pairs;
  Vector3d offset;
  double error;

  BoundsScene(const Mesh& first, const Mesh& second, const Vector3d& by)
      : a(first),
        b(second),
        topologyA(a.positions.size(), a.triangles),
        topologyB(b.positions.size(), b.triangles),
        offset(by) {
    double size = offset.cwiseAbs().maxCoeff();
    const auto toFloats = [&](const Mesh& mesh, std::vector<FloatPoint>& floats,
                              const Vector3d& origin) {
      for (const Vector3d& p : mesh.positions) {
        floats.push_back(FloatFrame::rounded(p - origin));
        size = std::max(size, (p - origin).cwiseAbs().maxCoeff());
      }
    };
    toFloats(a, floatsA, offset);
    toFloats(b, floatsB, Vector3d::Zero());
    for (std::uint32_t i = 0; i < a.triangles.size(); ++i)
      for (std::uint32_t j = 0; j < b.triangles.size(); ++j) pairs.push_back({i, j});
    error = 9 * 0x1p-24 * size;
  }
  std::vector<float> bounds() const {
    std::vector<float> found(pairs.size());
    featureBounds({topologyA,
                   topologyB,
                   floatsA.data(),
                   floatsB.data(),
                   {static_cast<float>(offset.x()), static_cast<float>(offset.y()),
                    static_cast<float>(offset.z())},
                   static_cast<float>(error)},
                  pairs, found.data());
    return found;
  }
  /// The least distance of the features whose tests the pair owns.
  double truth(const ElementPair& pair) const {
    const Triangle &s = a.triangles[pair.a], &t = b.triangles[pair.b];
    double least = std::numeric_limits<double>::infinity();
    for (std::uint32_t left = kOwnedByA[topologyA.owned[pair.a]] &
                              kOwnedByB[topologyB.owned[pair.b]] &
                              allowedTests(topologyA, topologyB);
         left; left &= left - 1) {
      const int test = std::countr_zero(left);
      const auto ofA = [&](int i) { return a.positions[s[static_cast<std::size_t>(i % 3)]]; };
      const auto ofB = [&](int i) { return b.positions[t[static_cast<std::size_t>(i % 3)]]; };
      const std::uint8_t f = kFeatureOfA[test], g = kFeatureOfB[test];
      const double distance =
          isCorner(f)   ? vertexTriangleDistance(ofA(f), ofB(0), ofB(1), ofB(2)).distance
          : isCorner(g) ? vertexTriangleDistance(ofB(g), ofA(0), ofA(1), ofA(2)).distance
                        : edgeEdgeDistance(ofA(edgeNumber(f)), ofA(edgeNumber(f) + 1),
                                           ofB(edgeNumber(g)), ofB(edgeNumber(g) + 1))
                              .distance;
      least = std::min(least, distance);
    }
    return least;
  }
};

std::vector<BoundsScene> boundsScenes() {
  Random random(8);
  std::vector<BoundsScene> scenes;
  for (const double scale : {1.0, 1e-3, 1e3})
    for (const double spread : {1.0, 30.0}) {
      const auto part = [&](std::size_t count, double size) {
        Mesh mesh = soup(random, count, size);
        for (Vector3d& p : mesh.positions) p *= scale;
        return mesh;
      };
      // One after the other: the order of arguments depends on the compiler.
      const Mesh first = part(40, 0.4), second = part(40, 0.4), large = part(20, 1.0),
                 small = part(60, 0.01);
      scenes.emplace_back(first, second, scale * spread * randomPoint(random, -1, 1));
      scenes.emplace_back(large, small, Vector3d::Zero());
    }
  // Flat and in one plane, with parallel edges, and without area.
  Mesh flatSheet = sheet(4, 0.0, 0.0), segments = soup(random, 20, 0.3);
  for (Vector3d& p : flatSheet.positions) p.z() = 0.0;
  for (Triangle& t : segments.triangles) t[2] = t[1];
  scenes.emplace_back(flatSheet, flatSheet, Vector3d::Zero());
  scenes.emplace_back(segments, flatSheet, Vector3d::Zero());
  return scenes;
}

TEST(FeatureBounds, NoFeatureIsNearerOnAnySimdPath) {
  std::size_t number = 0;
  for (const BoundsScene& scene : boundsScenes()) {
    SCOPED_TRACE("scene " + std::to_string(number));
    const std::vector<float> bounds = scene.bounds();
    for (const std::string& path : EverySimdPath()) {
      EXPECT_EQ(scene.bounds(), bounds) << path;
    }
    double sum = 0, distances = 0;
    for (std::size_t i = 0; i < bounds.size(); ++i) {
      const double truth = scene.truth(scene.pairs[i]);
      ASSERT_LE(bounds[i], truth + scene.error) << scene.pairs[i].a << ", " << scene.pairs[i].b;
      ASSERT_GE(bounds[i], 0.0f);
      if (!std::isfinite(truth)) continue;
      sum += bounds[i];
      distances += truth;
    }
    // Triangles of one size that are not flat: the bounds are no worse than separating directions.
    if (number % 2 == 0 && number < 12) {
      EXPECT_GT(sum, 0.5 * distances);
    }
    ++number;
  }
}

/// Each edge of one sheet is parallel to a third of the other one's.
TEST(FeatureBounds, ParallelSheetsAreAsFarApartAsTheyAre) {
  constexpr double kGap = 0.03125;
  Mesh lower = sheet(6, 0.0, 0.0), upper = lower;
  for (std::size_t v = 0; v < lower.positions.size(); ++v) {
    lower.positions[v].z() = 0.0;
    upper.positions[v] = lower.positions[v] + Vector3d(0.01, 0.02, kGap);
  }
  for (const float bound : BoundsScene(lower, upper, Vector3d::Zero()).bounds())
    EXPECT_GT(bound, 0.99 * kGap);
}

}  // namespace
}  // namespace palpate
