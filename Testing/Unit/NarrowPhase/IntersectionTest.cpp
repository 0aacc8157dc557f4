#include "Diagnostics/ContactsByBruteForce.h"
#include "NarrowPhase/NarrowPhase.h"

#include "Meshes.h"
#include "Unit/Math/TrianglePairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <map>
#include <vector>

namespace palpate::test {
namespace {

using Eigen::Vector3d;
using scenes::SceneMesh;

TriangleMesh meshOf(std::vector<Vector3d> positions, const std::vector<Triangle>& triangles) {
  return {MeshTopology(positions.size(), triangles), positions, positions};
}
TriangleMesh meshOf(const Corners& corners) {
  return meshOf({corners.begin(), corners.end()}, {{0, 1, 2}});
}
TriangleMesh meshOf(const SceneMesh& mesh) { return meshOf(mesh.positions, mesh.triangles); }

ContactBuffers contactsOf(const TriangleMesh& a, const TriangleMesh& b) {
  ContactBuffers out;
  findContactsByBruteForce({a, b, {.method = Method::Intersection}}, out);
  return out;
}

using Row = std::vector<std::uint64_t>;
void append(Row& row, const Vector3d& value) {
  for (const double x : value) row.push_back(std::bit_cast<std::uint64_t>(x + 0.0));  // one zero
}
void append(Row& row, double value) { append(row, Vector3d(value, 0, 0)); }

/// Contacts by their ids, each with the bits of its numbers. Equal ids have equal bits.
using Rows = std::map<Row, Row>;
Rows rowsOf(const Buffer<VertexTriangleContact>& contacts) {
  Rows rows;
  for (const VertexTriangleContact& c : contacts) {
    Row bits{c.vertices[0], c.vertices[1], c.vertices[2]};
    append(bits, c.weights);
    append(bits, c.normal);
    append(bits, c.distance);
    EXPECT_EQ(rows.try_emplace({c.vertex, c.triangle}, bits).first->second, bits);
  }
  return rows;
}
Rows rowsOf(const Buffer<EdgeEdgeContact>& contacts, bool swapped = false) {
  Rows rows;
  for (const EdgeEdgeContact& c : contacts) {
    // At distance zero the normal turns only up to sign: without it.
    const bool touching = c.distance == 0;
    Row bits;
    append(bits, swapped ? c.weightB : c.weightA);
    append(bits, swapped ? c.weightA : c.weightB);
    append(bits, touching ? Vector3d(0, 0, 0) : swapped ? Vector3d(-c.normal) : c.normal);
    append(bits, c.distance);
    Row ids{c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]};
    if (swapped) ids = {c.edgeB[0], c.edgeB[1], c.edgeA[0], c.edgeA[1]};
    EXPECT_EQ(rows.try_emplace(ids, bits).first->second, bits);
  }
  return rows;
}

std::vector<Row> idsOf(const Rows& rows) {
  std::vector<Row> ids;
  for (const auto& [key, bits] : rows) ids.push_back(key);
  return ids;
}

/// Swapping the meshes exchanges vertex-triangle and triangle-vertex, bit for bit, and reverses
/// edge-edge.
void expectSwaps(const ContactBuffers& ab, const ContactBuffers& ba) {
  EXPECT_EQ(rowsOf(ab.vertexTriangle), rowsOf(ba.triangleVertex));
  EXPECT_EQ(rowsOf(ab.triangleVertex), rowsOf(ba.vertexTriangle));
  EXPECT_EQ(rowsOf(ab.edgeEdge), rowsOf(ba.edgeEdge, true));
  EXPECT_EQ(ab.intersectingTriangles.size(), ba.intersectingTriangles.size());
}

/// The contacts of two triangles by their ids, in any order of the triangles.
void expectContacts(const Corners& first, const Corners& second,
                    const std::vector<Row>& vertexTriangle, const std::vector<Row>& triangleVertex,
                    const std::vector<Row>& edgeEdge) {
  const TriangleMesh a = meshOf(first), b = meshOf(second);
  const ContactBuffers found = contactsOf(a, b);
  EXPECT_EQ(found.intersectingTriangles.size(), 1u);
  EXPECT_EQ(idsOf(rowsOf(found.vertexTriangle)), vertexTriangle);
  EXPECT_EQ(idsOf(rowsOf(found.triangleVertex)), triangleVertex);
  EXPECT_EQ(idsOf(rowsOf(found.edgeEdge)), edgeEdge);
  expectSwaps(found, contactsOf(b, a));
}

const Corners kGround{{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}};
const Corners kPiercing{{{1, 1, -1}, {1, 1.5, 2}, {1.5, 1, 2}}};

/// The older octree had no contacts in these cases. Testing/Regression has them as captures.
TEST(IntersectionRegression, HasTheContactsOfTheDefinition) {
  expectContacts(kGround, kPiercing, {}, {{0, 0}}, {});
  expectContacts(kPiercing, kGround, {{0, 0}}, {}, {});
  // Two edges of the first cross the ground's plane: one inside, one exactly on the edge y = 0. The
  // vertex that they share is behind the ground, and a corner of the ground behind the first.
  const Corners three{{{1, 1, 1}, {1, 1, -1}, {1, -1, 1}}};
  expectContacts(three, kGround, {{1, 0}}, {{1, 0}}, {{1, 2, 0, 1}});
  const Corners inside{{{1, 1, 0}, {2, 1, 0}, {1, 2, 0}}};
  expectContacts(inside, kGround, {{0, 0}, {1, 0}, {2, 0}}, {}, {});
  const Corners star{{{-1, 1, 0}, {6, 1, 0}, {1, -1, 0}}};
  expectContacts(
      star, kGround, {}, {{0, 0}},
      {{0, 1, 0, 2}, {0, 1, 1, 2}, {0, 2, 0, 1}, {0, 2, 0, 2}, {1, 2, 0, 1}, {1, 2, 1, 2}});
  const Corners standing{{{1, 1, 0}, {1, 2, 3}, {2, 1, 3}}};
  expectContacts(standing, kGround, {{0, 0}}, {}, {});
  const ContactBuffers found = contactsOf(meshOf(standing), meshOf(kGround));
  EXPECT_EQ(found.vertexTriangle[0].distance, 0);
  EXPECT_EQ(found.vertexTriangle[0].normal, Vector3d::UnitZ());
  EXPECT_TRUE(found.vertexTriangle[0].weights.isApprox(Vector3d(0.5, 0.25, 0.25), 1e-15));
  Corners ground = kGround, piercing = kPiercing;
  for (Corners* corners : {&ground, &piercing})
    for (Vector3d& corner : *corners) corner *= 1e-9;
  expectContacts(piercing, ground, {{0, 0}}, {}, {});
}

// ---- Definitions ----

/// An end of each crossing edge is behind the other triangle.
TEST(Intersection, OneEdgeOfEachGivesTheEndsBehind) {
  const Corners interlocked{{{1, 1, -1}, {1, 1, 1}, {1, -5, 0.5}}};
  expectContacts(interlocked, kGround, {{0, 0}}, {{0, 0}}, {});
  const ContactBuffers found = contactsOf(meshOf(interlocked), meshOf(kGround));
  EXPECT_EQ(found.vertexTriangle[0].distance, -1);
  EXPECT_EQ(found.vertexTriangle[0].normal, Vector3d::UnitZ());
}

/// The tip is below the ground and beyond its edge y = 0, and its edges are steep. The nearest
/// point of the ground is (1, 0, 0). The normal is along the line from the tip to it.
TEST(Intersection, NormalsOfEdgesPointToTheSideOfTheWindingNormal) {
  const Corners slanted{{{1, -3, -4}, {1, 3.4, 4}, {1.5, 3.4, 4}}};
  const ContactBuffers found = contactsOf(meshOf(slanted), meshOf(kGround));
  ASSERT_EQ(found.vertexTriangle.size(), 1u);
  EXPECT_EQ(found.vertexTriangle[0].weights, Vector3d(0.75, 0.25, 0));
  EXPECT_EQ(found.vertexTriangle[0].distance, -5);
  EXPECT_TRUE(found.vertexTriangle[0].normal.isApprox(Vector3d(0, 0.6, 0.8), 1e-15));
}

TEST(Intersection, EveryTouchingPairHasContactsWithUnitNormals) {
  Random random(31);
  int seen = 0;
  for (int repeat = 0; repeat < 4000; ++repeat) {
    const auto kind = static_cast<Kind>(repeat % static_cast<int>(Kind::Count));
    const auto [first, second] = makePair(kind, random);
    const TriangleMesh a = meshOf(first), b = meshOf(second);
    const ContactBuffers found = contactsOf(a, b);
    SignCounts counts;
    const bool intersect = intersectTriangles(first, second, counts).intersect();
    ASSERT_EQ(found.intersectingTriangles.size(), intersect ? 1u : 0u);
    const std::size_t contacts =
        found.vertexTriangle.size() + found.triangleVertex.size() + found.edgeEdge.size();
    ASSERT_EQ(contacts > 0, intersect);
    for (const auto* list : {&found.vertexTriangle, &found.triangleVertex})
      for (const VertexTriangleContact& c : *list) {
        ASSERT_NEAR(c.normal.norm(), 1, 1e-15) << repeat;
        ASSERT_EQ(c.weights.sum(), 1) << repeat;
      }
    for (const EdgeEdgeContact& c : found.edgeEdge) ASSERT_NEAR(c.normal.norm(), 1, 1e-15);
    expectSwaps(found, contactsOf(b, a));
    ASSERT_FALSE(HasFailure()) << "pair " << repeat;
    seen += intersect;
  }
  EXPECT_GT(seen, 1000);
}

TEST(Intersection, SpheresIntersectInOneRingWithTheSameBitsFromEveryPair) {
  SceneMesh second = scenes::sphere(6);
  for (Vector3d& p : second.positions) p += Vector3d(0.9, 0.31, 0.17);
  const TriangleMesh a = meshOf(scenes::sphere(6)), b = meshOf(second);
  const ContactBuffers found = contactsOf(a, b);
  EXPECT_GT(found.intersectingTriangles.size(), 50u);
  expectSwaps(found, contactsOf(b, a));
  // One contact for each vertex that an edge connects to the outside; these stand for all pairs.
  EXPECT_GT(rowsOf(found.vertexTriangle).size(), 5u);
  EXPECT_EQ(rowsOf(found.vertexTriangle).size(), found.vertexTriangle.size());
  EXPECT_TRUE(found.edgeEdge.empty());
  for (const VertexTriangleContact& c : found.vertexTriangle) EXPECT_LT(c.distance, 0);
  EXPECT_EQ(found.exactDecisions, 0u);
}

TEST(Intersection, IdenticalMeshesTouchInEveryFeature) {
  const TriangleMesh a = meshOf(scenes::sphere(1)), b = a;
  const ContactBuffers found = contactsOf(a, b);
  const auto vertexTriangle = rowsOf(found.vertexTriangle);
  EXPECT_EQ(vertexTriangle.size(), 12u * 5u);          // each vertex on its five triangles
  EXPECT_EQ(rowsOf(found.edgeEdge).size(), 30u * 9u);  // itself and four at either end
  for (const EdgeEdgeContact& c : found.edgeEdge) EXPECT_EQ(c.distance, 0);
}

// ---- Self-collision ----

ContactBuffers selfContactsOf(const TriangleMesh& mesh) { return contactsOf(mesh, mesh); }

TEST(SelfIntersection, NeighboursDoNotTouchInWhatTheyShare) {
  for (const SceneMesh& mesh : {scenes::sphere(4), scenes::sheet(6), scenes::tube(8, 4)}) {
    const ContactBuffers found = selfContactsOf(meshOf(mesh));
    EXPECT_TRUE(found.intersectingTriangles.empty());
    EXPECT_TRUE(found.vertexTriangle.empty() && found.edgeEdge.empty());
  }
}

TEST(SelfIntersection, NeighboursAreDecidedByFloatingPoint) {
  EXPECT_EQ(selfContactsOf(meshOf(scenes::sphere(8))).exactDecisions, 0u);
}

TEST(SelfIntersection, DuplicatedVerticesTouch) {
  const TriangleMesh mesh = meshOf(
      {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0}, {-1, 0, 1}, {0, -1, 1}}, {{0, 1, 2}, {3, 4, 5}});
  const ContactBuffers found = selfContactsOf(mesh);
  EXPECT_EQ(idsOf(rowsOf(found.vertexTriangle)), (std::vector<Row>{{0, 1}, {3, 0}}));
  EXPECT_EQ(found.edgeEdge.size(), 4u);
  EXPECT_EQ(found.intersectingTriangles.size(), 1u);
}

TEST(SelfIntersection, DuplicateTrianglesShareEverything) {
  const TriangleMesh mesh =
      meshOf({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {2, 0, 1}, {1, 1, 0}});
  EXPECT_TRUE(selfContactsOf(mesh).intersectingTriangles.empty());
}

/// By the definition, feature pair by feature pair.
TEST(SelfIntersection, CommonVerticesExcludeTheirFeaturesAndNoOthers) {
  Random random(32);
  int listed = 0;
  for (int repeat = 0; repeat < 20000; ++repeat) {
    std::vector<Vector3d> positions(5);
    for (Vector3d& p : positions) p = random.onGrid(3);
    const Triangle s{0, 1, 2}, t = random.below(2) ? Triangle{0, 3, 4} : Triangle{3, 1, 0};
    ContactBuffers found = selfContactsOf(meshOf(positions, {s, t}));
    // Without vertices that are behind, and edges at a border instead of them.
    std::erase_if(found.vertexTriangle, [](const auto& c) { return c.distance != 0; });
    std::erase_if(found.edgeEdge, [](const auto& c) { return c.distance != 0; });
    const auto cornersOf = [&](const Triangle& u) {
      return Corners{positions[u[0]], positions[u[1]], positions[u[2]]};
    };
    SignCounts counts;
    const TriangleIntersection all = intersectTriangles(cornersOf(s), cornersOf(t), counts);
    std::vector<Row> vertexTriangle, edgeEdge;
    const auto holds = [](const Triangle& u, std::uint32_t v) {
      return std::find(u.begin(), u.end(), v) != u.end();
    };
    for (int i = 0; i < 3; ++i) {
      if (all.cornersOfAOnB >> i & 1 && !holds(t, s[i])) vertexTriangle.push_back({s[i], 1});
      if (all.cornersOfBOnA >> i & 1 && !holds(s, t[i])) vertexTriangle.push_back({t[i], 0});
      for (int j = 0; j < 3; ++j) {
        std::array p{s[i], s[(i + 1) % 3]}, q{t[j], t[(j + 1) % 3]};
        std::sort(p.begin(), p.end());
        std::sort(q.begin(), q.end());
        const bool common = p[0] == q[0] || p[0] == q[1] || p[1] == q[0] || p[1] == q[1];
        if (q < p) std::swap(p, q);
        if (all.touchingEdges >> (3 * i + j) & 1 && !common)
          edgeEdge.push_back({p[0], p[1], q[0], q[1]});
      }
    }
    std::sort(vertexTriangle.begin(), vertexTriangle.end());
    std::sort(edgeEdge.begin(), edgeEdge.end());
    ASSERT_EQ(idsOf(rowsOf(found.vertexTriangle)), vertexTriangle) << repeat;
    ASSERT_EQ(idsOf(rowsOf(found.edgeEdge)), edgeEdge) << repeat;
    const bool meet = !vertexTriangle.empty() || !edgeEdge.empty() || all.edgesOfAThroughB != 0 ||
                      all.edgesOfBThroughA != 0;
    ASSERT_EQ(found.intersectingTriangles.size(), meet ? 1u : 0u) << repeat;
    listed += meet;
  }
  EXPECT_GT(listed, 1000);
  EXPECT_LT(listed, 19000);
}

}  // namespace
}  // namespace palpate::test
