#include "Diagnostics/ContactsByBruteForce.h"
#include "NarrowPhase/NarrowPhase.h"
#include "NarrowPhase/Proximity.h"
#include "Octree/Traversal.h"

#include "Meshes.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace palpate {
namespace {

using Eigen::Vector3d;
using scenes::SceneMesh;

TriangleMesh meshOf(const SceneMesh& mesh) {
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
  const auto count = [](const TriangleMesh& mesh) {
    return static_cast<std::uint32_t>(mesh.topology.elements.size());
  };
  for (std::uint32_t s = 0; s < count(pair.a); ++s) {
    Eigen::AlignedBox3d box = boxOf(pair.a, s);
    const double size = box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff();
    const Vector3d margin = Vector3d::Constant(pair.settings.thickness * 1.000001 + 1e-12 * size);
    box.min() -= margin;
    box.max() += margin;
    for (std::uint32_t t = pair.self() ? s + 1 : 0; t < count(pair.b); ++t)
      if (box.intersects(boxOf(pair.b, t))) candidates.push_back({s, t});
  }
  return candidates;
}

// ---- Contacts as comparable rows: ids, then the bits of every number ----

using Row = std::vector<std::uint64_t>;

void append(Row& row, double value) {
  row.push_back(std::bit_cast<std::uint64_t>(value + 0.0));  // one zero
}
void append(Row& row, const Vector3d& value) {
  for (const double x : value) append(row, x);
}

Row rowOf(const VertexTriangleContact& c) {
  Row row{c.vertex, c.triangle, c.vertices[0], c.vertices[1], c.vertices[2]};
  append(row, c.weights);
  append(row, c.normal);
  append(row, c.distance);
  append(row, c.timeOfImpact);
  return row;
}

Row rowOf(const EdgeEdgeContact& c) {
  Row row{c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]};
  append(row, c.weightA);
  append(row, c.weightB);
  append(row, c.normal);
  append(row, c.distance);
  append(row, c.timeOfImpact);
  return row;
}

template <class Contacts>
std::vector<Row> sortedRows(const Contacts& contacts) {
  std::vector<Row> rows;
  for (const auto& contact : contacts) rows.push_back(rowOf(contact));
  std::sort(rows.begin(), rows.end());
  return rows;
}

struct Found {
  ContactBuffers fast, oracle;
};

Found find(const TriangleMesh& a, const TriangleMesh& b, double thickness, Contacts contacts) {
  const MeshPair pair{a, b, {Method::Proximity, thickness, contacts}};
  Found found;
  const std::vector<ElementPair> candidates = candidatesOf(pair);
  // Batches have odd sizes, and contacts must not depend on them.
  for (std::size_t begin = 0; begin < candidates.size(); begin += 37)
    findContacts(
        pair,
        std::span(candidates).subspan(begin, std::min<std::size_t>(37, candidates.size() - begin)),
        found.fast);
  findContactsByBruteForce(pair, found.oracle);
  return found;
}

/// Expects equal sets with equal bits and without duplicates. Returns how many contacts there are.
std::size_t expectSame(const TriangleMesh& a, const TriangleMesh& b, double thickness) {
  std::size_t count = 0;
  for (const Contacts contacts : {Contacts::Distinct, Contacts::All}) {
    SCOPED_TRACE(contacts == Contacts::All ? "All" : "Distinct");
    const auto& [fast, oracle] = find(a, b, thickness, contacts);
    const std::vector<Row> vertexTriangle = sortedRows(fast.vertexTriangle);
    const std::vector<Row> triangleVertex = sortedRows(fast.triangleVertex);
    const std::vector<Row> edgeEdge = sortedRows(fast.edgeEdge);
    EXPECT_EQ(vertexTriangle.size(), oracle.vertexTriangle.size());
    EXPECT_EQ(triangleVertex.size(), oracle.triangleVertex.size());
    EXPECT_EQ(edgeEdge.size(), oracle.edgeEdge.size());
    EXPECT_TRUE(vertexTriangle == sortedRows(oracle.vertexTriangle));
    EXPECT_TRUE(triangleVertex == sortedRows(oracle.triangleVertex));
    EXPECT_TRUE(edgeEdge == sortedRows(oracle.edgeEdge));
    for (const auto* rows : {&vertexTriangle, &triangleVertex, &edgeEdge})
      EXPECT_EQ(std::adjacent_find(rows->begin(), rows->end()), rows->end());
    count += vertexTriangle.size() + triangleVertex.size() + edgeEdge.size();
  }
  return count;
}

std::size_t expectSameWithItself(const SceneMesh& mesh, double thickness) {
  const TriangleMesh own = meshOf(mesh);
  return expectSame(own, own, thickness);
}

std::size_t expectSame(const SceneMesh& a, const SceneMesh& b, double thickness) {
  return expectSame(meshOf(a), meshOf(b), thickness);
}

// ---- Meshes ----

class RandomVectors {
 public:
  double real() { return std::uniform_real_distribution<double>(-1, 1)(m_engine); }
  std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>(m_engine() % n); }
  Vector3d vector() { return {real(), real(), real()}; }

 private:
  std::mt19937_64 m_engine{11};
};

/// Triangles between random vertices, with repeated corners and non-manifold edges.
SceneMesh soup(std::uint32_t vertices, std::uint32_t triangles, double size,
               RandomVectors& random) {
  SceneMesh mesh;
  for (std::uint32_t i = 0; i < vertices; ++i) mesh.positions.push_back(size * random.vector());
  for (std::uint32_t i = 0; i < triangles; ++i)
    mesh.triangles.push_back(
        {random.below(vertices), random.below(vertices), random.below(vertices)});
  return mesh;
}

SceneMesh moved(SceneMesh mesh, const Vector3d& by, double scale = 1.0) {
  for (Vector3d& p : mesh.positions) p = scale * p + by;
  return mesh;
}

/// The cube [0, 1]³, each face cut along one diagonal; outward winding.
SceneMesh cube(bool otherDiagonals) {
  SceneMesh mesh;
  for (int i = 0; i < 8; ++i) mesh.positions.emplace_back(i & 1, i >> 1 & 1, i >> 2 & 1);
  const std::array<std::uint32_t, 4> faces[] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                                {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& [a, b, c, d] : faces) {
    if (otherDiagonals) {
      mesh.triangles.push_back({b, c, d});
      mesh.triangles.push_back({b, d, a});
    } else {
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  }
  return mesh;
}

SceneMesh wavySheet(int cells, double phase) {
  SceneMesh mesh = scenes::sheet(cells);
  for (Vector3d& p : mesh.positions)
    p.z() = 0.1 * std::sin(7 * p.x() + phase) * std::cos(5 * p.y());
  return mesh;
}

// ---- Tests ----

TEST(Proximity, RandomSoupsAgreeWithBruteForce) {
  RandomVectors random;
  std::size_t contacts = 0;
  for (int i = 0; i < 12; ++i) {
    SCOPED_TRACE("soup " + std::to_string(i));
    const SceneMesh a = soup(20 + i, 40, 1.0, random), b = soup(30, 30, i % 3 ? 1.0 : 0.3, random);
    contacts += expectSame(a, b, 0.02 * (1 + i));
    contacts += expectSameWithItself(a, 0.03 * (1 + i));
  }
  EXPECT_GT(contacts, 1000u);
}

TEST(Proximity, ClosedBodiesAgreeWithBruteForce) {
  const SceneMesh ball = scenes::sphere(4);
  EXPECT_GT(expectSame(ball, moved(ball, {1.6, 0.1, 0.2}), 0.1), 0u);
  EXPECT_GT(expectSame(ball, moved(ball, {0.05, 0.02, 0.01}, 0.9), 0.12), 0u);
  EXPECT_GT(expectSame(scenes::tube(12, 6), moved(scenes::sphere(3), {0.3, 0, 0}), 0.1), 0u);
}

TEST(Proximity, SheetsAgreeWithBruteForce) {
  EXPECT_GT(expectSame(wavySheet(12, 0.0), wavySheet(11, 1.0), 0.03), 0u);
  // Coplanar, with vertices on vertices, edges and faces, parallel edges, and everything touching.
  const SceneMesh flat = scenes::sheet(6);
  EXPECT_GT(expectSame(flat, flat, 0.1), 0u);
  EXPECT_GT(expectSame(flat, moved(scenes::sheet(8), {0, 0, 0.0625}), 0.1), 0u);
  EXPECT_GT(expectSame(flat, moved(flat, {1.0 / 6, 1.0 / 6, 0.05}), 0.1), 0u);
}

TEST(Proximity, FoldedMeshesAgreeWithBruteForceInSelfCollision) {
  SceneMesh folded = scenes::sheet(8);
  for (Vector3d& p : folded.positions)
    if (p.x() > 0) p = Vector3d(-p.x(), p.y(), 0.0);
  EXPECT_GT(expectSameWithItself(folded, 0.05), 0u);
  for (Vector3d& p : folded.positions) p.z() = 0.03 * std::sin(9 * p.x() + p.y());
  EXPECT_GT(expectSameWithItself(folded, 0.05), 0u);
  SceneMesh pleats = scenes::sheet(16);
  for (Vector3d& p : pleats.positions)
    p = Vector3d(0.12 * std::sin(20 * p.x()), p.y(), 0.1 * p.x());
  EXPECT_GT(expectSameWithItself(pleats, 0.03), 0u);
}

TEST(Proximity, OffsetsAndScalesAgreeWithBruteForce) {
  const SceneMesh a = wavySheet(8, 0.0), b = wavySheet(7, 1.0);
  for (const double scale : {1e-3, 1e3, 1e-150, 1e150})
    EXPECT_GT(expectSame(moved(a, Vector3d::Zero(), scale), moved(b, Vector3d::Zero(), scale),
                         0.03 * scale),
              0u);
  const Vector3d far(1e6, -1e6, 3e5);
  EXPECT_GT(expectSame(moved(a, far), moved(b, far), 0.03), 0u);
}

TEST(Proximity, DegenerateMeshesAgreeWithBruteForce) {
  RandomVectors random;
  SceneMesh degenerate = scenes::sheet(4);
  // Duplicate triangles, zero areas by value and by index, a point, slivers, huge and tiny ones.
  degenerate.triangles.push_back(degenerate.triangles[3]);
  degenerate.triangles.push_back(
      {degenerate.triangles[5][1], degenerate.triangles[5][0], degenerate.triangles[5][2]});
  const auto add = [&](const Vector3d& a, const Vector3d& b, const Vector3d& c) {
    const auto first = static_cast<std::uint32_t>(degenerate.positions.size());
    degenerate.positions.insert(degenerate.positions.end(), {a, b, c});
    degenerate.triangles.push_back({first, first + 1, first + 2});
  };
  add({0, 0, 0.01}, {0.5, 0.5, 0.01}, {1, 1, 0.01});
  add({0, 0, 0.01}, {1, 1, 0.01}, {0.25, 0.25, 0.01});
  add({0.1, 0.1, 0}, {0.1, 0.1, 0}, {0.1, 0.1, 0});
  add({-1, 0, 0.02}, {1, 1e-13, 0.02}, {0, 1e-12, 0.02});
  add({-1e6, -1e6, 0.03}, {1e6, -1e6, 0.03}, {0, 1e6, 0.03});
  add({0.3, 0.3, 0.01}, {0.3 + 1e-9, 0.3, 0.01}, {0.3, 0.3 + 1e-9, 0.01});
  add({1e-310, 0, 0.01}, {0, 1e-310, 0.01}, {1e-310, 1e-310, 0.01});
  degenerate.triangles.push_back({0, 0, 1});
  degenerate.triangles.push_back({2, 3, 2});
  degenerate.triangles.push_back({4, 4, 4});
  degenerate.triangles.push_back({0, 12, 24});  // collinear, over vertices of others
  degenerate.triangles.push_back({0, 6, 12});
  EXPECT_GT(expectSameWithItself(degenerate, 0.05), 0u);
  EXPECT_GT(expectSame(degenerate, moved(degenerate, {0.1, 0.1, 0.01}), 0.05), 0u);
  EXPECT_GT(expectSame(degenerate, degenerate, 0.05), 0u);
  const SceneMesh empty;
  EXPECT_EQ(expectSame(degenerate, empty, 0.05), 0u);
  EXPECT_EQ(expectSame(empty, degenerate, 0.05), 0u);
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
  RandomVectors random;
  std::size_t contacts = 0;
  for (int i = 0; i < 6; ++i) {
    SceneMesh fan;
    fan.positions.push_back({0, 0, 0});
    constexpr std::uint32_t kTriangles = 120;
    for (std::uint32_t k = 0; k < 2 * kTriangles; ++k)
      fan.positions.push_back(random.vector() * (k % 2 ? 1.0 : 0.3) * std::abs(random.real()));
    for (std::uint32_t k = 0; k < kTriangles; ++k)
      fan.triangles.push_back({0, 2 * k + 1, 2 * k + 2});
    const TriangleMesh mesh = meshOf(fan);
    for (const double thickness : {0.0, 0.004, 0.03}) {
      std::vector<FloatPoint> floats(fan.positions.size());
      toFloats(fan.positions, {}, floats.data());
      TreePair shift{};
      setShift(shift, {}, thickness);
      const FloatPair floatPair{floats.data(), floats.data(),    nullptr,
                                nullptr,       shift.shiftLower, shift.shiftUpper};
      const MeshPair pair{mesh, mesh, {Method::Proximity, thickness, Contacts::All}, &floatPair};
      ContactBuffers fast{}, oracle{};
      findContacts(pair, candidatesOf(pair), fast);
      findContactsByBruteForce(pair, oracle);
      EXPECT_TRUE(sortedRows(fast.vertexTriangle) == sortedRows(oracle.vertexTriangle)) << i;
      EXPECT_TRUE(sortedRows(fast.edgeEdge) == sortedRows(oracle.edgeEdge)) << i;
      contacts += oracle.vertexTriangle.size() + oracle.edgeEdge.size();
    }
  }
  EXPECT_GT(contacts, 1000u);
}

/// A vertex is not tested with the triangles around it, and of two points each pair is tested once.
TEST(Proximity, ExcludesAVertexWithTheElementsAroundIt) {
  const TriangleMesh triangles = meshOf(scenes::sheet(2)), other = triangles;
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

TEST(Proximity, ThicknessLargerThanEverythingAgreesWithBruteForce) {
  EXPECT_GT(expectSame(scenes::sphere(1), moved(scenes::sphere(1), {3, 0, 0}), 100.0), 0u);
  EXPECT_GT(expectSameWithItself(scenes::sphere(2), 10.0), 0u);
}

TEST(Proximity, TwoUnitCubesFaceToFaceHaveFourOrFiveContacts) {
  const TriangleMesh below = meshOf(cube(false));
  for (const bool otherDiagonals : {false, true}) {
    const TriangleMesh above = meshOf(moved(cube(otherDiagonals), {0, 0, 1.0625}));
    const ContactBuffers found = find(below, above, 0.125, Contacts::Distinct).fast;
    EXPECT_EQ(found.vertexTriangle.size(), 4u);
    EXPECT_EQ(found.triangleVertex.size(), 0u);
    EXPECT_EQ(found.edgeEdge.size(), otherDiagonals ? 1u : 0u);
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
    expectSame(below, above, 0.125);
  }
}

// ---- Unit independence ----

/// Normals of touching features follow a rule, and change with winding and mirroring.
Vector3d mappedNormal(const Vector3d& normal, double distance, bool mirrored) {
  if (distance == 0.0) return Vector3d::Zero();
  return mirrored ? Vector3d(-normal.x(), normal.y(), normal.z()) : normal;
}

/// The vertex of each corner with its weight, so that the order of corners does not matter.
Row unorderedRowOf(const VertexTriangleContact& c, bool mirrored, double scale) {
  Row row{c.vertex, c.triangle};
  std::array<std::pair<std::uint32_t, double>, 3> corners;
  for (int i = 0; i < 3; ++i) corners[i] = {c.vertices[i], c.weights[i]};
  std::sort(corners.begin(), corners.end());
  for (const auto& [corner, weight] : corners) {
    row.push_back(corner);
    append(row, weight);
  }
  append(row, mappedNormal(c.normal, c.distance, mirrored));
  append(row, c.distance / scale);
  return row;
}

std::vector<Row> unorderedRows(const ContactBuffers& found, bool mirrored, double scale) {
  std::vector<Row> rows;
  for (const auto* list : {&found.vertexTriangle, &found.triangleVertex})
    for (const VertexTriangleContact& contact : *list)
      rows.push_back(unorderedRowOf(contact, mirrored, scale));
  for (EdgeEdgeContact contact : found.edgeEdge) {
    contact.normal = mappedNormal(contact.normal, contact.distance, mirrored);
    contact.distance /= scale;
    rows.push_back(rowOf(contact));
  }
  std::sort(rows.begin(), rows.end());
  return rows;
}

/// On a grid, so that translations are exact.
SceneMesh gridSheet(int cells, double phase) {
  SceneMesh mesh = wavySheet(cells, phase);
  for (Vector3d& p : mesh.positions)
    for (double& x : p) x = std::round(x * 0x1p20) * 0x1p-20;
  return mesh;
}

TEST(Proximity, ExactTransformationsGiveTheSameContacts) {
  const double thickness = 0x1p-5;
  const std::array<SceneMesh, 2> meshes{gridSheet(10, 0.0), gridSheet(9, 1.0)};
  for (const Contacts contacts : {Contacts::Distinct, Contacts::All}) {
    const auto contactsOf = [&](auto&& transform, bool mirrored, double scale) {
      std::array<SceneMesh, 2> changed = meshes;
      for (SceneMesh& mesh : changed) transform(mesh);
      const Found found = find(meshOf(changed[0]), meshOf(changed[1]), thickness * scale, contacts);
      return unorderedRows(found.fast, mirrored, scale);
    };
    const std::vector<Row> rows = contactsOf([](SceneMesh&) {}, false, 1.0);
    EXPECT_GT(rows.size(), 50u);
    const auto scaled = [](SceneMesh& mesh) {
      for (Vector3d& p : mesh.positions) p *= 0x1p-10;
    };
    const auto far = [](SceneMesh& mesh) {
      for (Vector3d& p : mesh.positions) p += Vector3d(1e6, -1e4, 3e6);
    };
    const auto mirrored = [](SceneMesh& mesh) {
      for (Vector3d& p : mesh.positions) p.x() = -p.x();
    };
    const auto turned = [](SceneMesh& mesh) {
      for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        auto& corners = mesh.triangles[t];
        std::rotate(corners.begin(), corners.begin() + t % 3, corners.end());
        if (t % 2) std::swap(corners[0], corners[1]);
      }
    };
    EXPECT_TRUE(contactsOf(scaled, false, 0x1p-10) == rows);
    EXPECT_TRUE(contactsOf(far, false, 1.0) == rows);
    EXPECT_TRUE(contactsOf(mirrored, true, 1.0) == rows);
    EXPECT_TRUE(contactsOf(turned, false, 1.0) == rows);
  }
}

TEST(Proximity, SwappingTheMeshesSwapsTheLists) {
  const TriangleMesh a = meshOf(wavySheet(10, 0.0)), b = meshOf(wavySheet(9, 1.0));
  const ContactBuffers forth = find(a, b, 0.04, Contacts::All).fast;
  ContactBuffers back = find(b, a, 0.04, Contacts::All).fast;
  EXPECT_TRUE(sortedRows(forth.vertexTriangle) == sortedRows(back.triangleVertex));
  EXPECT_TRUE(sortedRows(forth.triangleVertex) == sortedRows(back.vertexTriangle));
  for (EdgeEdgeContact& contact : back.edgeEdge) {
    std::swap(contact.edgeA, contact.edgeB);
    std::swap(contact.weightA, contact.weightB);
    contact.normal = -contact.normal;
  }
  EXPECT_TRUE(sortedRows(forth.edgeEdge) == sortedRows(back.edgeEdge));
}

}  // namespace
}  // namespace palpate
