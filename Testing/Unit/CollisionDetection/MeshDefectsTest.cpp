#include <palpate/Meshes.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/DegenerateCases.h"
#include "Common/ExpectRefused.h"
#include "Common/Sanitized.h"

#include <limits>

// Meshes as they come from files: triangles with vertices of their own, parts, and windings.
namespace palpate::testing {
namespace {

using Eigen::Vector3d;

void flip(Mesh& mesh) {
  for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
}
MeshDefects defectsOf(const Mesh& mesh) {
  return findMeshDefects(TriangleMeshView{mesh.positions, mesh.triangles});
}
std::size_t selfContacts(const std::vector<Vector3d>& positions,
                         const std::vector<Triangle>& triangles) {
  OctreeBasedCD collisions;
  const GeometryId id = collisions.addTriangleMesh(positions, triangles);
  collisions.addCollisionPair(id, id, {Method::Proximity, 0.01});
  collisions.detectCollision();
  return collisions.statistics().contacts;
}

TEST(Weld, JoinsTheTrianglesOfABody) {
  const Mesh ball = sphere(8, 10, {1, 2, 3}, 1), soup = unwelded(ball);
  EXPECT_TRUE(findMeshDefects(soup.triangles).unwelded);
  EXPECT_GT(selfContacts(soup.positions, soup.triangles), 0u);
  const Welded welded = weld(soup.positions, soup.triangles);
  EXPECT_EQ(welded.positions.size(), ball.positions.size());
  ASSERT_EQ(welded.triangles.size(), ball.triangles.size());
  for (std::size_t t = 0; t < ball.triangles.size(); ++t)
    for (int i = 0; i < 3; ++i)
      EXPECT_EQ(welded.positions[welded.triangles[t][i]], ball.positions[ball.triangles[t][i]]);
  ASSERT_EQ(welded.vertexOf.size(), soup.positions.size());
  for (std::size_t v = 0; v < soup.positions.size(); ++v)
    EXPECT_EQ(welded.positions[welded.vertexOf[v]], soup.positions[v]);
  const MeshDefects defects = findMeshDefects(welded.triangles);
  EXPECT_TRUE(defects.closed());
  EXPECT_FALSE(defects.unwelded);
  EXPECT_EQ(selfContacts(welded.positions, welded.triangles), 0u);
}

TEST(Weld, ZerosOfBothSignsAreEqual) {
  const std::vector<Vector3d> positions{{0.0, 1, 0}, {-0.0, 1, -0.0}, {0, -0.0, 5e-324}};
  const Welded welded = weld(positions, {});
  EXPECT_EQ(welded.vertexOf, (std::vector<std::uint32_t>{0, 0, 1}));
}

/// The definition: a vertex joins the first one before it that stayed and is near enough.
TEST(Weld, MatchesTheDefinition) {
  Random random(3);
  for (int repeat = 0; repeat < casesOf(200); ++repeat) {
    const double unit = std::exp2(uniform(random, -60, 60)),
                 distance = repeat % 4 == 0 ? 0.0 : unit * uniform(random, 0.001, 0.3);
    std::vector<Vector3d> positions;
    for (int i = 0; i < 60; ++i) {
      positions.push_back(unit * randomPoint(random, -1, 1));
      if (i % 3 == 0) positions.push_back(positions[positions.size() / 2]);
      if (i % 5 == 0)
        positions.push_back(positions.back() + 0.9 * distance * Vector3d::Unit(i % 3));
    }
    const Welded welded = weld(positions, {}, distance);
    std::vector<Vector3d> kept;
    for (std::size_t v = 0; v < positions.size(); ++v) {
      const auto joined = std::find_if(kept.begin(), kept.end(), [&](const Vector3d& q) {
        return (q - positions[v]).norm() <= distance;
      });
      EXPECT_EQ(welded.vertexOf[v], joined - kept.begin());
      if (joined == kept.end()) kept.push_back(positions[v]);
    }
    EXPECT_EQ(welded.positions, kept);
  }
  // Far from the origin a cell is finer than a double.
  const std::vector<Vector3d> far{{1e300, 0, 0}, {1e300, 0, 0}, {-1e300, 1, 0}};
  EXPECT_EQ(weld(far, {}, 1e-300).vertexOf, (std::vector<std::uint32_t>{0, 0, 1}));
  EXPECT_EQ(weld(far, {}, 1e-3).vertexOf, (std::vector<std::uint32_t>{0, 0, 1}));
}

TEST(Weld, RefusesInvalidInput) {
  const std::vector<Vector3d> good(3, Vector3d::Zero()),
      bad{{0, 0, 0}, {0, std::nan(""), 0}, {0, 0, 0}};
  expectRefused(ErrorCode::NonFinitePosition, "vertex 1 is ", [&] { weld(bad, {}); });
  const std::vector<Triangle> outside{{0, 1, 2}, {0, 1, 3}};
  expectRefused(ErrorCode::IndexOutOfRange, "triangle 1 names vertex 3; there are 3",
                [&] { weld(good, outside); });
  for (const double distance : {-1.0, std::nan(""), std::numeric_limits<double>::infinity()})
    expectRefused(ErrorCode::InvalidSettings, "distance is ", [&] { weld(good, {}, distance); });
}

TEST(MeshDefects, FindUnweldedTriangles) {
  EXPECT_FALSE(findMeshDefects(std::vector<Triangle>{{0, 1, 2}}).unwelded);
  EXPECT_TRUE(findMeshDefects(std::vector<Triangle>{{0, 1, 2}, {3, 4, 5}}).unwelded);
  EXPECT_FALSE(findMeshDefects(std::vector<Triangle>{{0, 1, 2}, {2, 4, 5}}).unwelded);
  EXPECT_FALSE(findMeshDefects(std::vector<Triangle>{{0, 1, 2}, {3, 3, 5}}).unwelded);

  const Mesh soup = unwelded(boxMesh({0, 0, 0}, {20, 20, 20}));
  OctreeBasedCD collisions;
  const GeometryId id = collisions.addTriangleMesh(soup.positions, soup.triangles);
  expectRefused(ErrorCode::NotClosed, "no two triangles share a vertex",
                [&] { collisions.queries().contains(id, Vector3d(1, 1, 1)); });
}

TEST(MeshDefects, FindMeshesThatAreInsideOut) {
  for (const double at : {0.0, 1e6, -1e200})
    for (const double size : {1e-9, 1.0, 1e9}) {
      if (size < 1e-12 * std::abs(at)) continue;
      Mesh body = boxMesh(Vector3d::Constant(at), Vector3d::Constant(at + size));
      if (body.positions.front() == body.positions.back()) continue;
      EXPECT_FALSE(defectsOf(body).insideOut);
      flip(body);
      EXPECT_TRUE(defectsOf(body).insideOut) << at << ' ' << size;
      body.triangles.pop_back();
      EXPECT_FALSE(defectsOf(body).insideOut);
    }
  // A cavity is wound inward; the body around it is not inside out.
  Mesh hollow = boxMesh({0, 0, 0}, {4, 4, 4}), cavity = boxMesh({1, 1, 1}, {2, 2, 2});
  flip(cavity);
  append(hollow, cavity);
  EXPECT_FALSE(defectsOf(hollow).insideOut);
  EXPECT_TRUE(defectsOf(hollow).overlapping.empty());
}

TEST(MeshDefects, FindPartsThatOverlap) {
  Mesh body = sphere(8, 10, {0, 0, 0}, 1);
  const auto count = static_cast<std::uint32_t>(body.triangles.size());
  append(body, sphere(8, 10, {5, 0, 0}, 1));
  EXPECT_TRUE(defectsOf(body).overlapping.empty());
  append(body, sphere(8, 10, {5, 1.5, 0}, 1));
  const std::vector<ElementPair> overlapping = defectsOf(body).overlapping;
  EXPECT_FALSE(overlapping.empty());
  EXPECT_TRUE(defectsOf(body).closed());
  for (const ElementPair& pair : overlapping) {
    EXPECT_EQ(pair.a / count, 1u);
    EXPECT_EQ(pair.b / count, 2u);
  }
  Mesh soup = unwelded(body);
  EXPECT_TRUE(defectsOf(soup).unwelded);
  EXPECT_TRUE(defectsOf(soup).overlapping.empty());
  soup.positions[7].x() = std::nan("");
  expectRefused(ErrorCode::NonFinitePosition, "geometry 0, vertex 7", [&] { defectsOf(soup); });
}

/// All boxes of a wheel's triangles overlap, and no two of its triangles intersect.
TEST(MeshDefects, OfAWheelAreFoundWithoutTestingEachPair) {
  Mesh wheel;
  const std::uint32_t count = 20000;
  wheel.positions = {{0, 0, -1}, {0, 0, 1}};
  for (std::uint32_t i = 0; i < count; ++i) {
    const double angle = 6.0 * i / count;
    wheel.positions.emplace_back(std::cos(angle), std::sin(angle), 0);
    wheel.triangles.push_back({0, 1, i + 2});
  }
  const MeshDefects defects = defectsOf(wheel);
  EXPECT_FALSE(defects.closed());
  EXPECT_TRUE(defects.overlapping.empty());
}

}  // namespace
}  // namespace palpate::testing
