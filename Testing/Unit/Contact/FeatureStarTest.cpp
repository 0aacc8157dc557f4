#include "Contact/FeatureStar.h"

#include "Common/FieldMeshes.h"
#include "Common/Sanitized.h"
#include "Common/Solids.h"
#include "Common/StarTruth.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <set>
#include <vector>

namespace palpate::test {
namespace {

using Eigen::Vector3d;
using oracle::StarTruth;

/// Asks about one feature of a mesh and compares the answers with StarTruth.
class StarAnswers {
 public:
  explicit StarAnswers(const testing::Mesh& mesh)
      : m_mesh(mesh),
        m_placed{MeshTopology(mesh.positions.size(), mesh.triangles), mesh.positions,
                 mesh.positions} {}

  const MeshTopology& topology() const { return m_placed.topology; }

  /// isInside(p): whether the line to p begins strictly inside, if that is known otherwise. Returns
  /// the number of closed stars.
  int check(const MeshFeature& feature, const std::vector<Vector3d>& points,
            const std::function<bool(const Vector3d&)>& isInside = nullptr) {
    const bool isEdge = feature.kind == MeshFeature::Kind::Edge;
    std::vector<std::uint32_t> ids{feature.id};
    if (isEdge) ids = {topology().edges[feature.id][0], topology().edges[feature.id][1]};
    const StarTruth truth(m_mesh.triangles, ids,
                          [&](std::uint32_t v) { return m_mesh.positions[v]; });
    SignCounts counts;
    const FeatureStar star(m_placed, false, feature, points.front(), points.back(), counts);
    EXPECT_EQ(star.isClosed(), truth.isClosed());
    for (const Vector3d& p : points) {
      EXPECT_EQ(star.holds(p), truth.holds(p));
      if (!star.isClosed()) continue;
      const bool isTrue = isInside ? isInside(p) : truth.hasInside(p);
      EXPECT_EQ(star.hasInside(p), isTrue)
          << (isEdge ? "edge " : "vertex ") << feature.id << " to " << p.transpose();
      EXPECT_EQ(truth.hasInside(p), isTrue);
    }
    return star.isClosed();
  }

 private:
  const testing::Mesh& m_mesh;
  TriangleMesh m_placed;
};

/// Cells of a grid touch along edges, in vertices and in faces: corners, ridges, saddles, and
/// vertices in which two surfaces meet. Most lines run along a face or an edge.
TEST(FeatureStar, SaysWhatTheCellsAroundAFeatureSay) {
  testing::Random random(3);
  int closed = 0;
  for (int round = 0; round < testing::casesOf(40); ++round) {
    std::set<std::array<int, 3>> filled;
    const testing::Solid solid = testing::cells(3, random, [&](const std::array<int, 3>& cell) {
      const bool isFilled = random() % 2 == 0;
      if (isFilled) filled.insert(cell);
      return isFilled;
    });
    if (filled.empty()) continue;
    const testing::Mesh mesh = testing::surfaceMeshOf(solid);
    // Strictly inside: all cells that hold the point are filled.
    const auto isInBody = [&](const Vector3d& p) {
      std::array<std::vector<int>, 3> places;
      for (int axis = 0; axis < 3; ++axis) {
        const int place = static_cast<int>(std::floor(p[axis]));
        places[axis].push_back(place);
        if (place == p[axis]) places[axis].push_back(place - 1);
      }
      for (const int x : places[0])
        for (const int y : places[1])
          for (const int z : places[2])
            if (!filled.contains({x, y, z})) return false;
      return true;
    };
    StarAnswers answers(mesh);
    const auto check = [&](MeshFeature::Kind kind, std::uint32_t id, const Vector3d& at) {
      std::vector<Vector3d> points;
      for (int i = 0; i < 10; ++i) {
        Vector3d offset(0, 0, 0);
        while (offset.isZero())
          for (int axis = 0; axis < 3; ++axis) offset[axis] = static_cast<int>(random() % 5) - 2;
        points.push_back(at + offset);
      }
      closed += answers.check({kind, id}, points,
                              [&](const Vector3d& p) { return isInBody(at + 0x1p-7 * (p - at)); });
    };
    for (std::uint32_t v = 0; v < mesh.positions.size(); ++v)
      if (!answers.topology().vertexTriangles[v].empty())
        check(MeshFeature::Kind::Vertex, v, mesh.positions[v]);
    for (std::uint32_t e = 0; e < answers.topology().edges.size(); ++e) {
      const auto [p, q] = answers.topology().edges[e];
      check(MeshFeature::Kind::Edge, e, 0.5 * (mesh.positions[p] + mesh.positions[q]));
    }
  }
  EXPECT_GT(closed, 5000 / testing::kShareOfCases / 2);
}

/// A body that is visible from its centre, with random radii: cones of any shape.
TEST(FeatureStar, SaysWhatRaysSayOfConesOfAnyShape) {
  testing::Random random(5);
  int closed = 0;
  for (int round = 0; round < testing::casesOf(20, 7); ++round) {
    const testing::Mesh mesh = testing::starMesh(random);
    StarAnswers answers(mesh);
    const auto check = [&](const MeshFeature& feature) {
      closed += answers.check(feature, {Vector3d::Zero()}, [](const Vector3d&) { return true; });
      std::vector<Vector3d> points;
      for (int i = 0; i < 6; ++i)
        points.push_back(mesh.positions[random() % mesh.positions.size()]);
      answers.check(feature, points);
    };
    for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) check({MeshFeature::Kind::Vertex, v});
    for (std::uint32_t e = 0; e < answers.topology().edges.size(); ++e)
      check({MeshFeature::Kind::Edge, e});
  }
  EXPECT_GE(closed, static_cast<int>(testing::leastOf(1000, 300)));
}

}  // namespace
}  // namespace palpate::test
