#include "Diagnostics/ContactsByBruteForce.h"
#include "NarrowPhase/NarrowPhase.h"

#include "Common/DegenerateCases.h"
#include "Common/RandomMeshes.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>
#include <set>
#include <utility>
#include <vector>

namespace palpate::test {
namespace {

using Eigen::Vector3d;
using testing::Mesh, testing::boxMesh;

ContactBuffers piercingContacts(const Mesh& a, const Mesh& b) {
  const auto meshOf = [](const Mesh& mesh) -> TriangleMesh {
    return {MeshTopology(mesh.positions.size(), mesh.triangles), mesh.positions, mesh.positions};
  };
  const TriangleMesh first = meshOf(a), second = meshOf(b);
  ContactBuffers out;
  findContactsByBruteForce({first, second, {.method = Method::Intersection}}, out);
  return out;
}

/// A closed pyramid with its tip, vertex 0, down.
Mesh pyramid(const Vector3d& tip, double height, double halfWidth) {
  Mesh mesh{{tip}, {{0, 2, 1}, {0, 3, 2}, {0, 4, 3}, {0, 1, 4}, {1, 2, 3}, {1, 3, 4}}};
  for (const auto& [x, y] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}})
    mesh.positions.push_back(tip + Vector3d(x * halfWidth, y * halfWidth, height));
  return mesh;
}

/// Vertex i + 5 j is at (i, j, 0) for 0 <= i, j <= 4. All diagonals are along (1, 1, 0).
Mesh plate() { return testing::moved(testing::flat(4, 0), {0, 0, 0}, 4); }

Mesh turned(Mesh mesh, double angle, const Vector3d& axis, const Vector3d& shift = {0, 0, 0}) {
  for (Vector3d& p : mesh.positions) p = Eigen::AngleAxisd(angle, axis) * p + shift;
  return mesh;
}

/// The only contact of the tip, and of any vertex of the pyramid.
VertexTriangleContact contactOfTip(const Vector3d& tip, double halfWidth = 0.7) {
  const Mesh a = pyramid(tip, 1, halfWidth), b = plate();
  const ContactBuffers found = piercingContacts(a, b);
  EXPECT_EQ(found.vertexTriangle.size(), 1u);
  if (found.vertexTriangle.empty()) return {};
  const VertexTriangleContact c = found.vertexTriangle[0];
  EXPECT_EQ(c.vertex, 0u);
  Vector3d way = a.positions[c.vertex];
  for (int i = 0; i < 3; ++i) way -= c.weights[i] * b.positions[c.vertices[i]];
  EXPECT_LE((way - c.distance * c.normal).norm(), 1e-15);
  const ContactBuffers swapped = piercingContacts(b, a);
  EXPECT_EQ(swapped.triangleVertex.size(), 1u);
  EXPECT_TRUE(swapped.triangleVertex[0] == c);
  return c;
}

TEST(Piercing, ATipBelowAnInteriorFeatureHasItsDepth) {
  for (const auto& [x, y, feature] : {std::tuple{2.6, 2.3, TriangleFeature::Face},
                                      {2.5, 2.5, TriangleFeature::EdgeCA},
                                      {2.5, 2.0, TriangleFeature::EdgeBC},
                                      {2.0, 2.4, TriangleFeature::EdgeBC},
                                      {2.0, 2.0, TriangleFeature::CornerC}}) {
    SCOPED_TRACE(std::to_string(x) + ", " + std::to_string(y));
    const VertexTriangleContact c = contactOfTip({x, y, -0.1});
    EXPECT_EQ(c.feature, feature);
    EXPECT_DOUBLE_EQ(c.distance, -0.1);
    EXPECT_EQ(c.normal, Vector3d::UnitZ());
  }
}

/// The tip is beyond the border, and the edges at the tip that cross the plate pass below it.
TEST(Piercing, OfATipBeyondTheBorderTheEdgesLeaveOverIt) {
  const Mesh a = pyramid({2.3, -0.03, -0.04}, 1, 2), b = plate();
  const ContactBuffers found = piercingContacts(a, b);
  EXPECT_TRUE(found.vertexTriangle.empty());
  std::set<Segment> edges;
  for (const EdgeEdgeContact& c : found.edgeEdge) {
    edges.insert(c.edgeA);
    EXPECT_EQ(c.edgeB, (Segment{2, 3}));
    // The edge is along (+-2, 2, 1), the border along x.
    EXPECT_TRUE(c.normal.isApprox(Vector3d(0, -1, 2).normalized(), 1e-12));
    EXPECT_NEAR(c.distance, -0.05 / std::sqrt(5.0), 1e-12);
  }
  EXPECT_EQ(edges, (std::set<Segment>{{0, 3}, {0, 4}}));
}

/// How far a body must be lifted to be above the part of z = 0 with x <= 0 and |y| <= 4: from the
/// lowest place of its triangles above that.
double liftOf(const Mesh& body) {
  double lift = 0;
  for (const auto& [i, j, k] : body.triangles) {
    std::vector<Vector3d> corners{body.positions[i], body.positions[j], body.positions[k]};
    for (const Eigen::Vector4d& side : {Eigen::Vector4d(1, 0, 0, 0), {0, 1, 0, 4}, {0, -1, 0, 4}}) {
      std::vector<Vector3d> left;
      for (std::size_t c = 0; c < corners.size(); ++c) {
        const Vector3d &p = corners[c], &q = corners[(c + 1) % corners.size()];
        const double above = side.head<3>().dot(p) - side[3],
                     next = side.head<3>().dot(q) - side[3];
        if (above <= 0) left.push_back(p);
        if (above * next < 0) left.push_back(p + above / (above - next) * (q - p));
      }
      corners = left;
    }
    for (const Vector3d& p : corners) lift = std::max(lift, -p.z());
  }
  return lift;
}

/// Tilted boxes and prisms hang over the border of a sheet, and are a little deep in it: no contact
/// asks for more than the lift, although they hang over by up to their whole width.
TEST(Piercing, OfABodyOverABorderNothingIsDeeperThanTheLift) {
  std::size_t tried = 0;
  for (int seed = 0; seed < 400; ++seed) {
    testing::Random random(seed);
    const auto any = [&](double low, double high) { return testing::uniform(random, low, high); };
    const int cells = 1 + seed % 7;
    Mesh sheet = testing::flat(cells, 0);
    for (Vector3d& p : sheet.positions) p = 8.0 * p - Vector3d(8, 4, 0);
    const double width = any(0.5, 3), length = any(0.5, 3);
    Mesh body = seed % 2 == 0 ? testing::dividedBox({0, 0, 0}, {width, length, 1}, 2)
                              : testing::insideOut(pyramid({0, 0, 0}, -1, width));
    const double about = any(0, 6), turn = any(0, 6), tilt = std::pow(10, any(-9, -1));
    const Vector3d axis = Eigen::AngleAxisd(about, Vector3d::UnitZ()) * Vector3d::UnitX();
    body = turned(turned(body, turn, Vector3d::UnitZ()), tilt, axis);
    Eigen::AlignedBox3d box;
    for (const Vector3d& p : body.positions) box.extend(p);
    const double over = any(0.1, 0.9), beside = any(-1, 4), depth = std::pow(10, any(-7, -2));
    const Vector3d to(-over * box.sizes().x(), beside, -depth);
    for (Vector3d& p : body.positions)
      p += to - Vector3d(box.min().x(), box.center().y(), box.min().z());
    const double lift = liftOf(body);
    const ContactBuffers found = piercingContacts(sheet, body);
    if (found.intersectingTriangles.empty()) continue;
    ++tried;
    const auto expectShallow = [&](const auto& contacts) {
      for (const auto& c : contacts) EXPECT_GE(c.distance, -1.01 * lift - 1e-12) << seed;
    };
    expectShallow(found.vertexTriangle);
    expectShallow(found.triangleVertex);
    expectShallow(found.edgeEdge);
    EXPECT_FALSE(found.vertexTriangle.empty() && found.triangleVertex.empty() &&
                 found.edgeEdge.empty());
  }
  EXPECT_GE(tried, 200u);
}

/// All four edges at the tip cross the plate in edges and vertices of it.
TEST(Piercing, EdgesThroughEdgesAndVerticesCountOnce) {
  const VertexTriangleContact inEdges = contactOfTip({2, 2, -0.5}, 1.0);
  EXPECT_EQ(inEdges.feature, TriangleFeature::CornerC);
  EXPECT_EQ(inEdges.distance, -0.5);
  const Mesh a = pyramid({2, 2, -0.5}, 1, 2), b = plate();
  const ContactBuffers inVertices = piercingContacts(a, b);
  ASSERT_EQ(std::count_if(inVertices.vertexTriangle.begin(), inVertices.vertexTriangle.end(),
                          [](const auto& c) { return c.vertex == 0 && c.distance < 0; }),
            1);
}

/// Its edges enter the bar and leave it: neither end is inside.
TEST(Piercing, ANeedleThroughABarHasNoEndBehindIt) {
  const Mesh needle = boxMesh({0.4, 0.4, -1}, {0.5, 0.5, 5}), bar = boxMesh({0, 0, 0}, {1, 1, 0.2});
  const ContactBuffers found = piercingContacts(needle, bar);
  EXPECT_FALSE(found.intersectingTriangles.empty());
  for (const VertexTriangleContact& c : found.vertexTriangle) {
    const double z = needle.positions[c.vertex].z();
    const bool isTop =
        bar.positions[c.vertices[0]].z() == 0.2 && bar.positions[c.vertices[1]].z() == 0.2;
    EXPECT_EQ(c.distance < 0, (z < 0) == isTop);
  }
}

/// The corner is inside: its three faces are pierced by edges of the other cube, and it leaves
/// through the nearest face.
TEST(Piercing, CornersOfOverlappingCubesLeaveThroughTheNearestFace) {
  const Mesh a = boxMesh({0.9, 0.8, 0.7}, {1.9, 1.8, 1.7}), b = boxMesh({0, 0, 0}, {1, 1, 1});
  const ContactBuffers found = piercingContacts(a, b);
  ASSERT_EQ(found.vertexTriangle.size(), 1u);
  EXPECT_EQ(found.vertexTriangle[0].vertex, 0u);
  EXPECT_NEAR(found.vertexTriangle[0].distance, -0.1, 1e-15);
  EXPECT_EQ(found.vertexTriangle[0].normal, Vector3d::UnitX());
  ASSERT_EQ(found.triangleVertex.size(), 1u);
  EXPECT_EQ(found.triangleVertex[0].vertex, 7u);
  EXPECT_EQ(found.triangleVertex[0].normal, Vector3d(-Vector3d::UnitX()));
  // Two edges from each corner leave the other cube through a side, as deep as the corner.
  std::set<std::pair<Segment, Segment>> edges;
  for (const EdgeEdgeContact& c : found.edgeEdge) {
    edges.insert({c.edgeA, c.edgeB});
    EXPECT_NEAR(c.distance, -0.1, 1e-15);
    EXPECT_EQ(c.normal, Vector3d::UnitX());
  }
  EXPECT_EQ(edges.size(), 4u);
}

/// Of the plate's vertices in a blunt tool, whether its wall or its end is nearer. The plate may be
/// bumpy.
TEST(Piercing, ABluntToolLeavesThroughItsEnd) {
  std::size_t inside = 0;
  for (const double depth : {0.01, 0.3})
    for (const double width : {0.9, 1.3, 3.3})
      for (const double bump : {0.0, 0.004}) {
        const double low = 2.1 - width / 2, high = low + width;
        Mesh surface = plate();
        for (std::size_t v = 0; v < surface.positions.size(); ++v)
          surface.positions[v].z() = v % 2 == 0 ? bump : -bump;
        const ContactBuffers found =
            piercingContacts(boxMesh({low, low + 0.1, -depth}, {high, high + 0.1, 5}), surface);
        EXPECT_EQ(found.vertexTriangle.size(), 4u);
        for (const EdgeEdgeContact& c : found.edgeEdge) {
          EXPECT_GE(c.distance, -depth - 2 * bump - 1e-12);
          EXPECT_GT(c.normal.z(), 0.98);
        }
        for (const auto* list : {&found.vertexTriangle, &found.triangleVertex})
          for (const VertexTriangleContact& c : *list) {
            EXPECT_GE(c.distance, -depth - bump - 1e-12) << c.vertex;
            const double up = list == &found.vertexTriangle ? c.normal.z() : -c.normal.z();
            EXPECT_GT(up, 0.98);
            inside += list == &found.triangleVertex;
          }
      }
  EXPECT_GE(inside, 20u);
}

/// The far side of a thin bar is nearer to the tip. The needle's sides do not leave there.
TEST(Piercing, ATipDeepInABarLeavesTheWayItCame) {
  for (const double depth : {0.3, 0.7, 0.95}) {
    const Mesh bar = boxMesh({-5, -5, -1}, {5, 5, 0});
    const ContactBuffers found = piercingContacts(pyramid({0.1, 0.2, -depth}, 2, 0.1), bar);
    ASSERT_EQ(found.vertexTriangle.size(), 1u);
    EXPECT_DOUBLE_EQ(found.vertexTriangle[0].distance, -depth);
    EXPECT_EQ(found.vertexTriangle[0].normal, Vector3d::UnitZ());
  }
}

/// A second plate below the first one, in one mesh with it: the tip is behind it, and nearer to it.
TEST(Piercing, ATipBehindASheetDoesNotLeaveThroughAnother) {
  Mesh second = testing::insideOut(plate());
  for (Vector3d& p : second.positions) p = {1.6, p.y(), p.x() - 3};
  const ContactBuffers found =
      piercingContacts(pyramid({1.5, 2.2, -0.9}, 1, 0.05), testing::joined(plate(), second));
  ASSERT_EQ(found.vertexTriangle.size(), 1u);
  EXPECT_EQ(found.vertexTriangle[0].normal, Vector3d::UnitZ());
  EXPECT_NEAR(found.vertexTriangle[0].distance, -0.9, 1e-15);
}

/// A rod that is far through the plate is led out sideways: its end is further than its wall.
TEST(Piercing, ARodThroughAPlateLeavesThroughItsWall) {
  const Mesh rod = boxMesh({1.6, 1.7, -3}, {2.5, 2.3, 3});
  const ContactBuffers found = piercingContacts(rod, plate());
  ASSERT_EQ(found.triangleVertex.size(), 1u);
  EXPECT_NEAR(found.triangleVertex[0].distance, -0.3, 1e-15);
  EXPECT_EQ(found.triangleVertex[0].normal.z(), 0.0);
}

/// Two long roofs cross at a right angle, ridge below ridge by 0.1.
TEST(Piercing, EdgesThatHaveCrossedHaveADepth) {
  const double c = std::sqrt(0.5);
  const Mesh below =
      turned(boxMesh({-5, -0.5, -0.5}, {5, 0.5, 0.5}), std::numbers::pi / 4, Vector3d::UnitX());
  const Mesh above =
      turned(below, std::numbers::pi / 2, Vector3d::UnitZ(), {0.013, 0.017, 2 * c - 0.1});
  const ContactBuffers found = piercingContacts(above, below);
  EXPECT_TRUE(found.vertexTriangle.empty() && found.triangleVertex.empty());
  ASSERT_FALSE(found.edgeEdge.empty());
  for (const EdgeEdgeContact& contact : found.edgeEdge) {
    EXPECT_NEAR(contact.distance, -0.1, 1e-12);
    EXPECT_TRUE(contact.normal.isApprox(Vector3d::UnitZ(), 1e-12));
  }
  const ContactBuffers swapped = piercingContacts(below, above);
  ASSERT_EQ(swapped.edgeEdge.size(), found.edgeEdge.size());
  EXPECT_TRUE(swapped.edgeEdge[0].normal.isApprox(-Vector3d::UnitZ(), 1e-12));
}

/// The ridge of a roof, 0.05 above the flat end of a tool, and longer than the tool. All edges that
/// cross do so twice, and no end is behind. Corners of the tool are 1 beside the ridge.
TEST(Piercing, EdgesBelowARidgeHaveItsDepth) {
  for (const double angle : {0.0, 0.3, 1.1}) {
    const Mesh roof =
        turned({{{0, -5, 0.05}, {0, 5, 0.05}, {-5, 0, -1}, {5, 0, -1}}, {{0, 1, 2}, {1, 0, 3}}},
               angle, Vector3d::UnitZ());
    const Mesh tool = boxMesh({-1.3, -1.1, 0}, {1.2, 1.0, 3});
    for (const bool swapped : {false, true}) {
      const ContactBuffers found =
          swapped ? piercingContacts(roof, tool) : piercingContacts(tool, roof);
      EXPECT_FALSE(found.edgeEdge.empty());
      for (const EdgeEdgeContact& c : found.edgeEdge) {
        EXPECT_NEAR(c.distance, -0.05, 0.001);
        EXPECT_GT(swapped ? -c.normal.z() : c.normal.z(), 0.98);
      }
      for (const auto* list : {&found.vertexTriangle, &found.triangleVertex})
        for (const VertexTriangleContact& c : *list) EXPECT_GE(c.distance, -0.06) << angle;
    }
  }
}

/// A bumpy plate: the depth is the least distance to any point near the tip.
TEST(Piercing, TheDepthIsThatOfTheNearestTriangleAround) {
  for (int seed = 0; seed < 200; ++seed) {
    Mesh b = plate();
    for (std::size_t v = 0; v < b.positions.size(); ++v)
      b.positions[v].z() = 0.05 * (static_cast<double>((v * 7 + seed * 13) % 11) / 5 - 1);
    const Vector3d tip(1.5 + seed % 10 * 0.1, 1.5 + seed / 10 % 10 * 0.1, -0.15);
    const Mesh a = pyramid(tip, 1, 0.4 + 0.01 * (seed % 30));
    const ContactBuffers found = piercingContacts(a, b);
    double least = 1;
    for (const auto& [p, q, r] : b.triangles)
      least = std::min(
          least,
          vertexTriangleDistance(tip, b.positions[p], b.positions[q], b.positions[r]).distance);
    int ofTip = 0;
    for (const VertexTriangleContact& c : found.vertexTriangle) {
      if (c.vertex != 0) continue;
      ++ofTip;
      EXPECT_DOUBLE_EQ(c.distance, -least) << seed;
      EXPECT_GT(c.normal.z(), 0.5);
    }
    EXPECT_EQ(ofTip, 1) << seed;
  }
}

}  // namespace
}  // namespace palpate::test
