#include "Common/ExpectRefused.h"
#include "Common/FloatingPointMode.h"
#include "Common/QueryCalls.h"
#include "Common/Sanitized.h"
#include "Unit/Queries/QueryTruth.h"

#include <gtest/gtest.h>

#include <cfenv>
#include <functional>
#include <set>
#include <string>

// findInsideVertices() of closed bodies, by the cells that they are made of and by brute force.
namespace palpate::testing {
namespace {

using Cell = std::array<int, 3>;

/// Strictly inside: all cells that touch p are filled.
bool isInside(const Vector3d& p, int n, const std::function<bool(Cell)>& filled) {
  for (int corner = 0; corner < 8; ++corner) {
    Cell c;
    for (int k = 0; k < 3; ++k) {
      const bool onPlane = p[k] == std::floor(p[k]);
      c[k] = static_cast<int>(std::floor(p[k])) - (onPlane && (corner >> k & 1));
      if (c[k] < 0 || c[k] >= n) return false;
    }
    if (!filled(c)) return false;
  }
  return true;
}

/// Concave, with a closed hollow. No two cells meet in an edge or a corner only.
const std::vector<std::function<bool(Cell)>> kBodies = {
    [](Cell) { return true; },
    [](Cell c) { return c[2] == 0 || c[0] == 0 || c[0] == 3; },
    [](Cell c) { return c[0] == 0 || c[1] == 0 || c[2] == 0; },
    [](Cell c) {
      return c != Cell{1, 1, 1};
    },
};

/// As a mesh of either winding, and as tetrahedra, for the vertices of each geometry type. Rays hit
/// edges and corners.
TEST(InsideVertices, MatchTheCellsOfTheBody) {
  constexpr int n = 4;
  Random random(12);
  std::size_t number = 0;
  for (const auto& filled : kBodies) {
    const Solid solid = cells(n, random, filled);
    const Mesh surface = surfaceMeshOf(solid);
    for (const GeometryType type :
         {GeometryType::Triangles, GeometryType::Lines, GeometryType::Points}) {
      if (isLeftOut(number++)) continue;
      const TestGeometry points = lattice(type, n, 0.5);
      std::set<std::uint32_t> expected, found;
      for (std::uint32_t v = 0; v < points.positions.size(); ++v)
        if (isInside(points.positions[v], n, filled)) expected.insert(v);
      ASSERT_FALSE(expected.empty());
      const std::vector<InsideVertex> all = insideOf(points, surface);
      for (const InsideVertex& inside : all) {
        EXPECT_TRUE(found.insert(inside.vertex).second);
        const Vector3d& p = points.positions[inside.vertex];
        Vector3d exit = Vector3d::Zero();
        for (int i = 0; i < 3; ++i) exit += inside.weights[i] * solid.positions[inside.vertices[i]];
        EXPECT_NEAR((p + inside.depth * inside.direction - exit).norm(), 0, 1e-14);
        // The nearest of the lattice's points that are not inside is on the surface, or half a
        // cell from it along an axis.
        double nearest = 1e9;
        for (const Vector3d& q : points.positions)
          if (!isInside(q, n, filled)) nearest = std::min(nearest, (p - q).norm());
        EXPECT_EQ(inside.depth, nearest);
      }
      EXPECT_EQ(found, expected);
      std::set<std::uint32_t> inverted;
      for (const InsideVertex& inside : insideOf(points, insideOut(surface)))
        inverted.insert(inside.vertex);
      EXPECT_EQ(inverted, expected);
      EXPECT_EQ(insideOf(points, solid, {}, settingsOf(Engine::Octree, 2)), all);
      EXPECT_EQ(insideOf(points, solid, {}, settingsOf(Engine::BruteForce)), all);
    }
  }
}

TEST(InsideVertices, MatchBruteForceForAnyNumberOfThreads) {
  Random random(11);
  for (int trial = 0; trial < 6; trial += kShareOfCases == 1 ? 1 : 3) {
    // Positions from apart to wholly inside, far from the origin, too.
    const Vector3d centre(trial % 2 ? 1e6 : 0, 0, 0),
        other = centre + Vector3d(0, 1.5 - 0.25 * trial, 0.1);
    Mesh a = sphere(24, 40, other, 0.5), b = sphere(30, 50, centre, 1);
    for (Mesh* mesh : {&a, &b}) mesh->positions = moved(random, mesh->positions, 0.01);
    const auto expectBalls = [&](const Mesh& points, const Mesh& body, const Vector3d& middle,
                                 double radius) {
      const auto expected = insideOf(points, body, {}, settingsOf(Engine::BruteForce));
      for (const int threads : {1, 4})
        EXPECT_EQ(insideOf(points, body, {}, settingsOf(Engine::Octree, threads)), expected);
      std::set<std::uint32_t> found;
      for (const InsideVertex& v : expected) found.insert(v.vertex);
      for (std::uint32_t v = 0; v < points.positions.size(); ++v) {
        const double distance = (points.positions[v] - middle).norm();
        if (distance < 0.96 * radius - 0.02 || distance > radius + 0.02) {
          EXPECT_EQ(found.contains(v), distance < radius);
        }
      }
    };
    expectBalls(a, b, centre, 1);
    expectBalls(b, a, other, 0.5);
  }
}

/// The search starts from the nearest element of the previous vertex.
TEST(InsideVertices, DoNotDependOnThePreviousVertex) {
  Random random(11);
  for (int run = 0; run < 30; ++run) {
    const double scale = run % 3 == 0 ? 1e-6 : run % 3 == 1 ? 1.0 : 1e7;
    const Vector3d centre = (run % 2) * scale * Vector3d(3e5, -1e5, 7e4);
    Mesh body = sphere(7, 10, {0, 0, 0}, 1);
    for (Vector3d& p : body.positions) p = uniform(random, 0.3, 1.0) * scale * p + centre;
    Mesh walk;
    Vector3d at = Vector3d::Zero();
    for (std::uint32_t i = 0; i < 300; ++i) {
      // Steps of the depth's size, sometimes out of the body, and some of them onto vertices of the
      // surface.
      const double size = std::pow(10.0, uniform(random, -4, 0));
      at = (0.8 * at + size * randomPoint(random, -1, 1)).cwiseMax(-0.8).cwiseMin(0.8);
      walk.positions.push_back(i % 7 ? Vector3d(scale * at + centre)
                                     : body.positions[random() % body.positions.size()]);
      if (i >= 2) walk.triangles.push_back({i - 2, i - 1, i});
    }
    const auto found = insideOf(walk, body),
               truth = insideOf(walk, body, {}, settingsOf(Engine::BruteForce));
    EXPECT_EQ(found, truth);
    EXPECT_GT(truth.size(), 10u);
    EXPECT_LT(truth.size(), 290u);
  }
}

/// Cells of 2^-1060. A caller that flushes denormals to zero would find nothing.
TEST(InsideVertices, DoNotDependOnTheCallersFloatingPoint) {
  Random random(13);
  Mesh body = surfaceMeshOf(cells(2, random));
  Positions points = lattice(GeometryType::Points, 2, 0.5).positions;
  for (Positions* positions : {&body.positions, &points})
    for (Vector3d& p : *positions) p *= 0x1p-1060;
  const auto expected = insideOf(points, body);
  EXPECT_EQ(expected.size(), 27u);
  OctreeBasedCD detection;
  const GeometryId first = addTo(detection, points), second = addTo(detection, body);
  std::fenv_t before;
  std::fegetenv(&before);
  addFloatingPointMode(kFlushResults | kFlushOperands);
  const auto found = insideVertices(detection, first, second);
  std::fesetenv(&before);
  EXPECT_EQ(std::vector<InsideVertex>(found.begin(), found.end()), expected);
}

TEST(InsideVertices, UseTheLastPositions) {
  const Mesh a = sphere(8, 8, {0, 0, 0}, 0.5);
  Mesh b = sphere(8, 8, {0, 0, 0}, 2);
  OctreeBasedCD detection;
  const GeometryId first = detection.addTriangleMesh(a.positions, a.triangles),
                   second = detection.addTriangleMesh(b.positions, b.triangles);
  EXPECT_EQ(insideVertices(detection, first, second).size(), a.positions.size());
  EXPECT_EQ(insideVertices(detection, second, first).size(), 0u);
  for (Vector3d& p : b.positions) p.x() += 10;
  detection.setPositions(second, b.positions);
  EXPECT_EQ(insideVertices(detection, first, second).size(), 0u);
}

TEST(InsideVertices, NeedAClosedBody) {
  Mesh open = sphere(8, 8, {0, 0, 0}, 1), flipped = open;
  const Triangle lost = open.triangles.back();
  open.triangles.pop_back();
  std::swap(flipped.triangles[0][0], flipped.triangles[0][1]);
  const MeshDefects holes = findMeshDefects(open.triangles);
  EXPECT_EQ(holes.open.size(), 3u);
  for (const Segment& edge : holes.open)
    for (const std::uint32_t v : edge) EXPECT_NE(std::count(lost.begin(), lost.end(), v), 0);
  EXPECT_EQ(findMeshDefects(flipped.triangles).flipped.size(), 3u);

  OctreeBasedCD detection;
  const GeometryId a = detection.addTriangleMesh(open.positions, open.triangles),
                   b = detection.addTriangleMesh(flipped.positions, flipped.triangles);
  const Segment& edge = holes.open[0];
  expectRefused(
      ErrorCode::NotClosed,
      "geometry 0 has no inside: it is not closed and consistently oriented; 3 edges belong to one "
      "triangle only, the first is (" +
          std::to_string(edge[0]) + ", " + std::to_string(edge[1]) + ")",
      [&] { insideVertices(detection, b, a); }, a);
  EXPECT_THROW(insideVertices(detection, a, b), Error);
  EXPECT_THROW(insideVertices(detection, a, a), Error);
  // Closed by setTriangles.
  const Mesh whole = sphere(8, 8, {0, 0, 0}, 1);
  detection.setTriangles(a, whole.positions, whole.triangles);
  EXPECT_NO_THROW(insideVertices(detection, b, a));
}

/// Two more triangles, each at an edge of its own.
TEST(InsideVertices, ErrorsNameTheFirstEdge) {
  Mesh fins = sphere(8, 8, {0, 0, 0}, 1);
  for (const Triangle& corners : {fins.triangles.front(), fins.triangles.back()}) {
    fins.triangles.push_back(
        {corners[0], corners[1], static_cast<std::uint32_t>(fins.positions.size())});
    fins.positions.emplace_back(2, 2, 2);
  }
  const std::vector<Segment> shared = findMeshDefects(fins.triangles).shared;
  ASSERT_EQ(shared.size(), 2u);
  ASSERT_NE(shared[0][0], shared[1][0]);
  OctreeBasedCD detection;
  const GeometryId a = detection.addTriangleMesh(fins.positions, fins.triangles),
                   b = detection.addTriangleMesh(fins.positions, fins.triangles);
  expectRefused(ErrorCode::NotClosed,
                "; 2 edges belong to three triangles or more, the first is (" +
                    std::to_string(shared[0][0]) + ", " + std::to_string(shared[0][1]) + ")",
                [&] { insideVertices(detection, b, a); });
}

}  // namespace
}  // namespace palpate::testing
