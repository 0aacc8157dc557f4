#include "NarrowPhase/FeaturePairs.h"

#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <set>

namespace palpate {

namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

struct Moving {
  testing::Mesh mesh;
  std::vector<Vector3d> now;
  std::vector<FloatPoint> floatsBefore, floatsNow;
  MeshTopology topology;

  Moving(testing::Random& random, const Vector3d& offset) : mesh(testing::soup(random, 40, 0.1)) {
    for (Vector3d& p : mesh.positions) p += offset;
    now = mesh.positions;
    for (Vector3d& p : now) p += testing::randomPoint(random, -0.5, 0.5);
    floatsBefore.resize(now.size());
    floatsNow.resize(now.size());
    toFloats(mesh.positions, {offset, 1.0}, floatsBefore.data());
    toFloats(now, {offset, 1.0}, floatsNow.data());
    topology = MeshTopology(now.size(), mesh.triangles);
  }
  template <class Vertices>
  AlignedBox3d box(const Vertices& vertices, double upTo) const {
    AlignedBox3d result;
    for (const std::uint32_t v : vertices)
      result.extend(mesh.positions[v]).extend((1 - upTo) * mesh.positions[v] + upTo * now[v]);
    return result;
  }
};

/// Boxes over [0, upTo], exact but for rounding in double: all that overlap are kept, and few
/// others.
TEST(FeaturePairs, KeepWhatOverlapsUpToAnyTime) {
  testing::Random random(1);
  for (const float upTo : {0.0f, 1e-6f, 0.01f, 0.3f, 0.999f, 1.0f}) {
    for (const double distance : {0.0, 1e4}) {
      const Vector3d offset(distance, -distance, 2 * distance);
      const Moving a(random, offset), b(random, offset);
      FloatPair floats{a.floatsNow.data(), b.floatsNow.data(), a.floatsBefore.data(),
                       b.floatsBefore.data()};
      floats.upTo = upTo;
      std::vector<TrianglePair> candidates;
      for (std::uint32_t i = 0; i < 40; ++i)
        for (std::uint32_t j = 0; j < 40; ++j) candidates.push_back({i, j});
      FeaturePairs pairs;
      findFeaturePairs(a.topology, b.topology, &floats, candidates, pairs);
      std::set<std::array<std::uint32_t, 2>> corners, edges;
      for (const FeaturePair& pair : pairs.vertexTriangle) corners.insert({pair.a, pair.b});
      for (const FeaturePair& pair : pairs.edgeEdge) edges.insert({pair.a, pair.b});
      std::size_t overlapping = 0;
      for (std::uint32_t v = 0; v < a.now.size(); ++v)
        for (std::uint32_t t = 0; t < 40; ++t)
          if (a.box(std::array{v}, upTo).intersects(b.box(b.mesh.triangles[t], upTo))) {
            EXPECT_TRUE(corners.contains({v, t})) << upTo;
            ++overlapping;
          }
      for (std::uint32_t p = 0; p < a.topology.edges.size(); ++p)
        for (std::uint32_t q = 0; q < b.topology.edges.size(); ++q)
          if (a.box(a.topology.edges[p], upTo).intersects(b.box(b.topology.edges[q], upTo))) {
            EXPECT_TRUE(edges.contains({p, q})) << upTo;
            ++overlapping;
          }
      EXPECT_GT(overlapping, 0u);
      EXPECT_LE(corners.size() + edges.size(), overlapping + 2 + overlapping / 100) << upTo;
    }
  }
}

}  // namespace

}  // namespace palpate
