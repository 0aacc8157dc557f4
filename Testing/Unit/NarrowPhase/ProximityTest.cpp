#include "Diagnostics/ContactsByBruteForce.h"
#include "NarrowPhase/NarrowPhase.h"
#include "NarrowPhase/Proximity.h"
#include "Octree/Traversal.h"

#include "Common/ContactRows.h"
#include "Common/DegenerateCases.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

// Candidates of boxes in batches against brute force. Frame/OracleTest.cpp and
// Frame/ContactLawTest.cpp compare whole frames with it.

namespace palpate::testing {
namespace {

using Eigen::Vector3d;

TriangleMesh meshOf(const Mesh& mesh) {
  return {MeshTopology(mesh.positions.size(), mesh.triangles), mesh.positions, mesh.positions};
}

Eigen::AlignedBox3d boxOf(const TriangleMesh& mesh, std::uint32_t triangle) {
  Eigen::AlignedBox3d box;
  for (const std::uint32_t v : mesh.topology.elements[triangle]) box.extend(mesh.now[v]);
  return box;
}

/// Every triangle pair with overlapping boxes, the first inflated by the thickness and a little
/// more.
std::vector<ElementPair> candidatesOf(const MeshPair& pair) {
  std::vector<ElementPair> candidates;
  for (std::uint32_t s = 0; s < pair.a.topology.elements.size(); ++s) {
    Eigen::AlignedBox3d box = boxOf(pair.a, s);
    const double size = box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff();
    const Vector3d margin = Vector3d::Constant(pair.settings.thickness * 1.000001 + 1e-12 * size);
    box.min() -= margin;
    box.max() += margin;
    for (std::uint32_t t = pair.self() ? s + 1 : 0; t < pair.b.topology.elements.size(); ++t)
      if (box.intersects(boxOf(pair.b, t))) candidates.push_back({s, t});
  }
  return candidates;
}

/// Batches have odd sizes, and contacts must not depend on them.
ContactBuffers contactsOf(const MeshPair& pair) {
  ContactBuffers found{};
  const std::vector<ElementPair> candidates = candidatesOf(pair);
  for (std::size_t begin = 0; begin < candidates.size(); begin += 37)
    findContacts(
        pair,
        std::span(candidates).subspan(begin, std::min<std::size_t>(37, candidates.size() - begin)),
        found);
  return found;
}

/// Expects equal sets with equal bits and without duplicates.
template <class List>
void expectSameSet(const List& found, const List& truth) {
  const std::vector<Row> rows = sortedRows(found);
  EXPECT_EQ(firstDifference(rows, sortedRows(truth)), "");
  EXPECT_EQ(std::adjacent_find(rows.begin(), rows.end()), rows.end());
}

/// Returns how many contacts there are.
std::size_t expectBruteForce(const MeshPair& pair) {
  ContactBuffers oracle{};
  findContactsByBruteForce(pair, oracle);
  const ContactBuffers found = contactsOf(pair);
  expectSameSet(found.vertexTriangle, oracle.vertexTriangle);
  expectSameSet(found.triangleVertex, oracle.triangleVertex);
  expectSameSet(found.edgeEdge, oracle.edgeEdge);
  return oracle.vertexTriangle.size() + oracle.triangleVertex.size() + oracle.edgeEdge.size();
}

/// Triangles between random vertices, with repeated corners and non-manifold edges.
Mesh crowd(Random& random, std::uint32_t vertices, std::uint32_t triangles, double size) {
  Mesh mesh;
  const auto any = [&] { return static_cast<std::uint32_t>(random() % vertices); };
  for (std::uint32_t i = 0; i < vertices; ++i)
    mesh.positions.push_back(randomPoint(random, -size, size));
  for (std::uint32_t i = 0; i < triangles; ++i) mesh.triangles.push_back({any(), any(), any()});
  return mesh;
}

Mesh folded(std::uint32_t cells, double (*x)(double), double tilt) {
  Mesh mesh = flat(cells, 0);
  for (Vector3d& p : mesh.positions) p = {x(p.x()), p.y(), tilt * p.x()};
  return mesh;
}

TEST(Proximity, ContactsAgreeWithBruteForce) {
  struct Scene {
    std::string name;
    Mesh a, b;
    double thickness;
    bool itself = false;
  };
  const Mesh ball = sphere(6, 9, {0, 0, 0}, 1), flat6 = flat(6, 0);
  std::vector<Scene> scenes{
      {"balls side by side", ball, moved(ball, {1.6, 0.1, 0.2}), 0.1},
      {"ball in ball", ball, moved(ball, {0.05, 0.02, 0.01}, 0.9), 0.12},
      {"wavy sheets", sheet(12, 0, 0), sheet(11, 0.02, 1), 0.03},
      {"a sheet on itself", flat6, flat6, 0.1},
      {"a sheet on a finer one", flat6, flat(8, 0.0625), 0.1},
      {"vertices over vertices", flat6, moved(flat6, {1.0 / 6, 1.0 / 6, 0.05}), 0.1},
      {"folded flat",
       folded(
           8, [](double x) { return std::min(x, 1 - x); }, 0),
       {},
       0.05,
       true},
      {"folded",
       folded(
           8, [](double x) { return std::min(x, 1 - x); }, 0.03),
       {},
       0.05,
       true},
      {"pleats",
       folded(
           16, [](double x) { return 0.1 * std::sin(25 * x); }, 0.2),
       {},
       0.03,
       true},
      {"thicker than everything", ball, moved(ball, {3, 0, 0}), 100},
      {"thicker than itself", ball, {}, 10, true}};
  Random random(11);
  for (std::uint32_t i = 0; i < 12; ++i) {
    const Mesh a = crowd(random, 20 + i, 40, 1), b = crowd(random, 30, 30, i % 3 ? 1.0 : 0.3);
    scenes.push_back({"crowds " + std::to_string(i), a, b, 0.02 * (1 + i)});
    scenes.push_back({"crowd " + std::to_string(i), a, {}, 0.03 * (1 + i), true});
  }
  std::size_t number = 0;
  for (const Scene& scene : scenes)
    for (const Contacts contacts : {Contacts::Distinct, Contacts::All}) {
      if (isLeftOut(number++)) continue;
      SCOPED_TRACE(scene.name + (contacts == Contacts::All ? ", all" : ", distinct"));
      const TriangleMesh a = meshOf(scene.a), b = meshOf(scene.b);
      EXPECT_GT(expectBruteForce(
                    {a, scene.itself ? a : b, {Method::Proximity, scene.thickness, contacts}}),
                0u);
    }
}

/// Of the features with the same vertices, the first.
TEST(Proximity, FeaturesOfSegmentsAndPointsHaveTheirFirstName) {
  const std::vector<int> cornersOf[] = {{0}, {1}, {2}, {0, 1}, {1, 2}, {2, 0}, {0, 1, 2}};
  for (const Triangle& corners : {Triangle{7, 8, 9}, {7, 8, 8}, {7, 7, 7}})
    for (int bits = 1; bits < 8; ++bits) {
      const Vector3d weights(bits & 1, bits >> 1 & 1, bits >> 2);
      std::set<std::uint32_t> spanned;
      for (std::size_t i = 0; i < 3; ++i)
        if (weights[static_cast<int>(i)] != 0) spanned.insert(corners[i]);
      const auto first =
          std::find_if(std::begin(cornersOf), std::end(cornersOf), [&](const auto& f) {
            std::set<std::uint32_t> own;
            for (const int i : f) own.insert(corners[static_cast<std::size_t>(i)]);
            return own == spanned;
          });
      EXPECT_EQ(static_cast<std::ptrdiff_t>(spannedFeature(corners, weights)),
                first - std::begin(cornersOf))
          << corners[0] << corners[1] << corners[2] << ", " << bits;
    }
}

/// A crumpled fan of long and short triangles around one vertex, in floats.
TEST(Proximity, TrianglesAroundOneVertexAgreeWithBruteForce) {
  Random random(11);
  std::size_t contacts = 0;
  for (int i = 0; i < 6; ++i) {
    Mesh fan{{{0, 0, 0}}, {}};
    for (std::uint32_t k = 0; k < 240; ++k) {
      fan.positions.push_back((k % 2 ? 1.0 : 0.3) * randomPoint(random, -1, 1));
      fan.positions.back() *= uniform(random, 0, 1);
    }
    for (std::uint32_t k = 0; k < 120; ++k) fan.triangles.push_back({0, 2 * k + 1, 2 * k + 2});
    const TriangleMesh mesh = meshOf(fan);
    for (const double thickness : {0.0, 0.004, 0.03}) {
      std::vector<FloatPoint> floats(fan.positions.size());
      toFloats(fan.positions, {}, floats.data());
      TreePair shift{};
      setShift(shift, {}, thickness);
      const FloatPair floatPair{floats.data(), floats.data(),    nullptr,
                                nullptr,       shift.shiftLower, shift.shiftUpper};
      contacts +=
          expectBruteForce({mesh, mesh, {Method::Proximity, thickness, Contacts::All}, &floatPair});
    }
  }
  EXPECT_GT(contacts, 1000u);
}

/// A vertex is not tested with the triangles around it, and of two points each pair is tested once.
TEST(Proximity, ExcludesAVertexWithTheElementsAroundIt) {
  const TriangleMesh triangles = meshOf(flat(2, 0)), other = triangles;
  const MeshPair self{triangles, triangles, {}}, two{triangles, other, {}};
  for (std::uint32_t v = 0; v < triangles.topology.vertexCount; ++v)
    for (std::uint32_t t = 0; t < triangles.topology.elements.size(); ++t) {
      const Triangle& corners = triangles.topology.elements[t];
      EXPECT_EQ(self.excludesVertex(v, t),
                std::find(corners.begin(), corners.end(), v) != corners.end());
      EXPECT_FALSE(two.excludesVertex(v, t));
    }
  TriangleMesh points = triangles;
  points.topology.type = GeometryType::Points;
  for (std::uint32_t t = 0; t < 4; ++t) points.topology.elements[t] = {t, t, t};
  const MeshPair ofPoints{points, points, {}};
  for (std::uint32_t v = 0; v < 4; ++v)
    for (std::uint32_t t = 0; t < 4; ++t) EXPECT_EQ(ofPoints.excludesVertex(v, t), t <= v);
}

/// The diagonals of the faces are parallel, or they cross in the middle.
TEST(Proximity, TwoUnitCubesFaceToFaceHaveFourOrFiveContacts) {
  const TriangleMesh below = meshOf(cube(0, 1));
  for (const bool crossing : {false, true}) {
    Mesh top = cube(0, 1);
    if (crossing)
      for (Vector3d& p : top.positions) p.x() = 1 - p.x();
    for (Triangle& t : top.triangles)
      if (crossing) std::swap(t[1], t[2]);
    const TriangleMesh above = meshOf(moved(top, {0, 0, 1.0625}));
    const MeshPair pair{below, above, {Method::Proximity, 0.125}};
    const ContactBuffers found = contactsOf(pair);
    EXPECT_EQ(found.vertexTriangle.size(), 4u);
    EXPECT_EQ(found.triangleVertex.size(), 0u);
    EXPECT_EQ(found.edgeEdge.size(), crossing ? 1u : 0u);
    for (const VertexTriangleContact& contact : found.vertexTriangle) {
      EXPECT_EQ(contact.distance, 0.0625);
      EXPECT_EQ(contact.normal, Vector3d(0, 0, -1));
      EXPECT_EQ(below.now[contact.vertex].z(), 1.0);
    }
    for (const EdgeEdgeContact& contact : found.edgeEdge) {
      EXPECT_EQ(contact.weightA, 0.5);
      EXPECT_EQ(contact.weightB, 0.5);
      EXPECT_EQ(contact.normal, Vector3d(0, 0, -1));
    }
    expectBruteForce(pair);
  }
}

}  // namespace
}  // namespace palpate::testing
