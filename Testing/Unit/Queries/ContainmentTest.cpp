#include "Common/ExpectRefused.h"
#include "Common/FloatingPointMode.h"
#include "Common/QueryCalls.h"
#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"

#include <palpate/OctreeBasedCD.h>

#include <gtest/gtest.h>

#include <cfenv>
#include <cmath>
#include <functional>
#include <map>
#include <set>

namespace palpate {
namespace {

using testing::Mesh;
using testing::Random;
using testing::randomPoint;
using testing::settingsOf;
using testing::sphere;
using testing::uniform;
using Cell = std::array<int, 3>;

/// The closed surface of the unit cells for which `filled` holds, within [0, n]³: every face
/// between a filled cell and one that is not, as two triangles on integer vertices.
Mesh surfaceOf(int n, const std::function<bool(Cell)>& filled) {
  Mesh mesh;
  std::map<Cell, std::uint32_t> vertices;
  const auto vertex = [&](Cell at) {
    const auto [found, isNew] =
        vertices.emplace(at, static_cast<std::uint32_t>(mesh.positions.size()));
    if (isNew) mesh.positions.push_back(Eigen::Vector3d(at[0], at[1], at[2]));
    return found->second;
  };
  const auto full = [&](Cell c) {
    for (const int k : c)
      if (k < 0 || k >= n) return false;
    return filled(c);
  };
  for (int x = 0; x < n; ++x)
    for (int y = 0; y < n; ++y)
      for (int z = 0; z < n; ++z)
        for (int axis = 0; axis < 3 && full({x, y, z}); ++axis)
          for (int side = 0; side < 2; ++side) {
            Cell next{x, y, z};
            next[axis] += 2 * side - 1;
            if (full(next)) continue;
            const int u = (axis + 1) % 3, v = (axis + 2) % 3;
            std::array<std::uint32_t, 4> corners;
            for (int i = 0; i < 4; ++i) {
              Cell at{x, y, z};
              at[axis] += side;
              at[u] += i == 1 || i == 2;
              at[v] += i >= 2;
              corners[i] = vertex(at);
            }
            if (side == 0) std::swap(corners[1], corners[3]);
            mesh.triangles.push_back({corners[0], corners[1], corners[2]});
            mesh.triangles.push_back({corners[0], corners[2], corners[3]});
          }
  return mesh;
}

/// All points of the half-integer lattice in [-1, n + 1]³, as vertices of arbitrary triangles.
Mesh lattice(int n) {
  Mesh mesh;
  for (int x = -2; x <= 2 * n + 2; ++x)
    for (int y = -2; y <= 2 * n + 2; ++y)
      for (int z = -2; z <= 2 * n + 2; ++z) mesh.positions.push_back(Eigen::Vector3d(x, y, z) / 2);
  for (std::uint32_t v = 0; v + 2 < mesh.positions.size(); ++v)
    mesh.triangles.push_back({v, v + 1, v + 2});
  return mesh;
}

std::vector<InsideVertex> insideVertices(const Mesh& a, const Mesh& body,
                                         const Settings& settings = {}) {
  OctreeBasedCD detection(settings);
  const GeometryId first = detection.addTriangleMesh(a.positions, a.triangles),
                   second = detection.addTriangleMesh(body.positions, body.triangles);
  const auto found = testing::insideVertices(detection, first, second);
  return {found.begin(), found.end()};
}

/// Strictly inside: all cells that touch p are filled.
bool isInside(const Eigen::Vector3d& p, int n, const std::function<bool(Cell)>& filled) {
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

TEST(InsideVertices, MatchTheCellsWhereRaysHitEdgesAndCorners) {
  constexpr int n = 4;
  const Mesh points = lattice(n);
  for (const auto& filled : kBodies) {
    Mesh body = surfaceOf(n, filled);
    ASSERT_TRUE(findMeshDefects(body.triangles).closed());
    for (const bool inverted : {false, true}) {
      if (inverted)
        for (Triangle& t : body.triangles) std::swap(t[1], t[2]);
      std::set<std::uint32_t> expected, found;
      for (std::uint32_t v = 0; v < points.positions.size(); ++v)
        if (isInside(points.positions[v], n, filled)) expected.insert(v);
      ASSERT_FALSE(expected.empty());
      for (const InsideVertex& inside : insideVertices(points, body)) {
        EXPECT_TRUE(found.insert(inside.vertex).second);
        const Eigen::Vector3d& p = points.positions[inside.vertex];
        const auto& [a, b, c] = inside.vertices;
        const Eigen::Vector3d exit = inside.weights[0] * body.positions[a] +
                                     inside.weights[1] * body.positions[b] +
                                     inside.weights[2] * body.positions[c];
        EXPECT_NEAR((p + inside.depth * inside.direction - exit).norm(), 0, 1e-14);
        // The nearest of the lattice's points that are not inside is on the surface, or half a
        // cell from it along an axis.
        double nearest = 1e9;
        for (const Eigen::Vector3d& q : points.positions)
          if (!isInside(q, n, filled)) nearest = std::min(nearest, (p - q).norm());
        EXPECT_EQ(inside.depth, nearest);
      }
      EXPECT_EQ(found, expected);
    }
  }
}

TEST(InsideVertices, MatchBruteForceForAnyNumberOfThreads) {
  testing::Random random(11);
  for (int trial = 0; trial < 6; trial += testing::kShareOfCases == 1 ? 1 : 3) {
    // Positions from apart to wholly inside, far from the origin, too.
    const double gap = 0.25 * trial, far = trial % 2 ? 1e6 : 0;
    Mesh a = testing::sphere(24, 40, {far, 1.5 - gap, 0.1}, 0.5),
         b = testing::sphere(30, 50, {far, 0, 0}, 1);
    for (Mesh* mesh : {&a, &b})
      for (Eigen::Vector3d& p : mesh->positions) p += testing::randomPoint(random, -0.01, 0.01);
    Settings brute, one, many;
    brute.engine = Engine::BruteForce;
    one.threads = 1;
    many.threads = 4;
    for (const auto& [points, body] : {std::pair{a, b}, std::pair{b, a}}) {
      const auto expected = insideVertices(points, body, brute);
      EXPECT_EQ(insideVertices(points, body, one), expected);
      EXPECT_EQ(insideVertices(points, body, many), expected);
      std::set<std::uint32_t> found;
      for (const InsideVertex& v : expected) found.insert(v.vertex);
      for (std::uint32_t v = 0; v < points.positions.size(); ++v) {
        const bool large = body.positions.size() == b.positions.size();
        const double distance =
            (points.positions[v] - Eigen::Vector3d(far, large ? 0 : 1.5 - gap, large ? 0 : 0.1))
                .norm();
        const double radius = large ? 1 : 0.5;
        if (distance < 0.96 * radius - 0.02) {
          EXPECT_TRUE(found.contains(v));
        }
        if (distance > radius + 0.02) {
          EXPECT_FALSE(found.contains(v));
        }
      }
    }
  }
}

/// Cells of 2^-1060. A caller that flushes denormals to zero would find nothing.
/// The search starts from the nearest element of the previous vertex.
TEST(InsideVertices, DoNotDependOnThePreviousVertex) {
  Random random(11);
  for (int run = 0; run < 30; ++run) {
    const double scale = run % 3 == 0 ? 1e-6 : run % 3 == 1 ? 1.0 : 1e7;
    const Eigen::Vector3d centre = (run % 2) * scale * Eigen::Vector3d(3e5, -1e5, 7e4);
    Mesh body = sphere(7, 10, {0, 0, 0}, 1);
    for (Eigen::Vector3d& p : body.positions) p = uniform(random, 0.3, 1.0) * scale * p + centre;
    Mesh walk;
    Eigen::Vector3d at = Eigen::Vector3d::Zero();
    for (std::uint32_t i = 0; i < 300; ++i) {
      // Steps of the depth's size, sometimes out of the body, and some of them onto vertices of the
      // surface.
      at = (0.8 * at + std::pow(10.0, uniform(random, -4, 0)) * randomPoint(random, -1, 1))
               .cwiseMax(-0.8)
               .cwiseMin(0.8);
      walk.positions.push_back(i % 7 ? Eigen::Vector3d(scale * at + centre)
                                     : body.positions[random() % body.positions.size()]);
      if (i >= 2) walk.triangles.push_back({i - 2, i - 1, i});
    }
    const auto found = insideVertices(walk, body),
               truth = insideVertices(walk, body, settingsOf(Engine::BruteForce));
    EXPECT_EQ(found, truth);
    EXPECT_GT(truth.size(), 10u);
    EXPECT_LT(truth.size(), 290u);
  }
}

TEST(InsideVertices, DoNotDependOnTheCallersFloatingPoint) {
  constexpr int n = 2;
  Mesh body = surfaceOf(n, kBodies[0]), points = lattice(n);
  for (Mesh* mesh : {&body, &points})
    for (Eigen::Vector3d& p : mesh->positions) p *= 0x1p-1060;
  const auto expected = insideVertices(points, body);
  EXPECT_EQ(expected.size(), 27u);
  OctreeBasedCD detection;
  const GeometryId first = detection.addTriangleMesh(points.positions, points.triangles),
                   second = detection.addTriangleMesh(body.positions, body.triangles);
  std::fenv_t before;
  std::fegetenv(&before);
  testing::addFloatingPointMode(testing::kFlushResults | testing::kFlushOperands);
  const auto found = testing::insideVertices(detection, first, second);
  std::fesetenv(&before);
  EXPECT_EQ(std::vector<InsideVertex>(found.begin(), found.end()), expected);
}

TEST(InsideVertices, UseTheLastPositions) {
  const Mesh a = testing::sphere(8, 8, {0, 0, 0}, 0.5);
  Mesh b = testing::sphere(8, 8, {0, 0, 0}, 2);
  OctreeBasedCD detection;
  const GeometryId first = detection.addTriangleMesh(a.positions, a.triangles),
                   second = detection.addTriangleMesh(b.positions, b.triangles);
  EXPECT_EQ(testing::insideVertices(detection, first, second).size(), a.positions.size());
  EXPECT_EQ(testing::insideVertices(detection, second, first).size(), 0u);
  for (Eigen::Vector3d& p : b.positions) p.x() += 10;
  detection.setPositions(second, b.positions);
  EXPECT_EQ(testing::insideVertices(detection, first, second).size(), 0u);
}

TEST(InsideVertices, NeedAClosedBody) {
  Mesh open = testing::sphere(8, 8, {0, 0, 0}, 1), flipped = open;
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
  testing::expectRefused(
      ErrorCode::NotClosed,
      "geometry 0 has no inside: it is not closed and consistently oriented; 3 edges belong to one "
      "triangle only, the first is (" +
          std::to_string(edge[0]) + ", " + std::to_string(edge[1]) + ")",
      [&] { testing::insideVertices(detection, b, a); }, a);
  EXPECT_THROW(testing::insideVertices(detection, a, b), Error);
  EXPECT_THROW(testing::insideVertices(detection, a, a), Error);
  // Closed by setTriangles.
  const Mesh whole = testing::sphere(8, 8, {0, 0, 0}, 1);
  detection.setTriangles(a, whole.positions, whole.triangles);
  EXPECT_NO_THROW(testing::insideVertices(detection, b, a));
}

/// Two more triangles, each at an edge of its own.
TEST(InsideVertices, ErrorsNameTheFirstEdge) {
  Mesh fins = testing::sphere(8, 8, {0, 0, 0}, 1);
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
  testing::expectRefused(ErrorCode::NotClosed,
                         "; 2 edges belong to three triangles or more, the first is (" +
                             std::to_string(shared[0][0]) + ", " + std::to_string(shared[0][1]) +
                             ")",
                         [&] { testing::insideVertices(detection, b, a); });
}

}  // namespace
}  // namespace palpate
