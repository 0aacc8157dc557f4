#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/FloatingPointMode.h"
#include "Common/QueryCalls.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Queries/QueryTruth.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cfenv>
#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <string>
#include <vector>

// findInsideVertices() of closed bodies, by the cells that they are made of and by brute force.
// Where parts of a body overlap, each vertex leaves by the outer surface.
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
               byThreads = insideOf(walk, body, {}, settingsOf(Engine::Octree, 4)),
               truth = insideOf(walk, body, {}, settingsOf(Engine::BruteForce));
    EXPECT_EQ(byThreads, truth);
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
  EXPECT_EQ(found, expected);
}

/// One triangle less, a triangle turned, and two triangles more, each at an edge of its own.
TEST(InsideVertices, NeedAClosedBody) {
  Mesh open = sphere(8, 8, {0, 0, 0}, 1), flipped = open, fins = open;
  const Mesh whole = open;
  open.triangles.pop_back();
  std::swap(flipped.triangles[0][0], flipped.triangles[0][1]);
  for (const Triangle& corners : {fins.triangles.front(), fins.triangles.back()}) {
    fins.triangles.push_back(
        {corners[0], corners[1], static_cast<std::uint32_t>(fins.positions.size())});
    fins.positions.emplace_back(2, 2, 2);
  }
  const std::vector<Segment> lost = findMeshDefects(open.triangles).open,
                             shared = findMeshDefects(fins.triangles).shared;
  const Triangle& last = whole.triangles.back();
  EXPECT_EQ(lost.size(), 3u);
  for (const Segment& edge : lost)
    for (const std::uint32_t v : edge) EXPECT_NE(std::count(last.begin(), last.end(), v), 0);
  EXPECT_EQ(findMeshDefects(flipped.triangles).flipped.size(), 3u);
  ASSERT_EQ(shared.size(), 2u);
  ASSERT_NE(shared[0][0], shared[1][0]);

  OctreeBasedCD detection;
  const GeometryId a = addTo(detection, open), b = addTo(detection, flipped),
                   c = addTo(detection, fins);
  const auto expectNone = [&](GeometryId body, const std::string& words, const Segment& edge) {
    expectRefused(
        ErrorCode::NotClosed,
        words + ", the first is (" + std::to_string(edge[0]) + ", " + std::to_string(edge[1]) + ")",
        [&] { insideVertices(detection, b, body); }, body);
  };
  expectNone(a,
             "geometry 0 has no inside: it is not closed and consistently oriented; 3 edges belong "
             "to one triangle only",
             lost[0]);
  expectNone(c, "; 2 edges belong to three triangles or more", shared[0]);
  EXPECT_THROW(insideVertices(detection, a, b), Error);
  EXPECT_THROW(insideVertices(detection, a, a), Error);
  detection.setTriangles(a, whole.positions, whole.triangles);
  EXPECT_NO_THROW(insideVertices(detection, b, a));
}

using Eigen::Vector3d;

/// A body of turned boxes, for which distances inside are known.
struct Boxes {
  struct Part {
    Eigen::Matrix3d rotation;
    Vector3d centre, half;
    int sign = 1;  ///< -1: wound inward, a cavity of another part
    /// How far inside, along the axes, a point is; negative outside.
    double margin(const Vector3d& p) const {
      return (half - (rotation.transpose() * (p - centre)).cwiseAbs()).minCoeff();
    }
  };
  std::vector<Part> parts;

  bool contains(const Vector3d& p) const {
    int number = 0;
    for (const Part& part : parts) number += part.margin(p) > 0.0 ? part.sign : 0;
    return number != 0;
  }
  Mesh mesh() const {
    Mesh result;
    for (const Part& part : parts) {
      Mesh box = boxMesh(-part.half, part.half);
      for (Vector3d& p : box.positions) p = part.rotation * p + part.centre;
      append(result, part.sign < 0 ? insideOut(box) : box);
    }
    return result;
  }
  /// The distance of the outer surface, from the distances of points of it that are dense. It is
  /// too large by at most about `spacing`.
  double depth(const Vector3d& p, double spacing) const {
    double least = std::numeric_limits<double>::infinity();
    for (const Part& part : parts)
      for (int axis = 0; axis < 3; ++axis)
        for (const double side : {-1.0, 1.0}) {
          const int u = (axis + 1) % 3, v = (axis + 2) % 3;
          const auto count = [&](int k) { return std::ceil(2.0 * part.half[k] / spacing); };
          for (double i = 0; i <= count(u); ++i)
            for (double j = 0; j <= count(v); ++j) {
              Vector3d at;
              at[axis] = side * part.half[axis];
              at[u] = (2.0 * i / count(u) - 1.0) * part.half[u];
              at[v] = (2.0 * j / count(v) - 1.0) * part.half[v];
              const Vector3d q = part.rotation * at + part.centre,
                             aside = 1e-9 * part.rotation.col(axis);
              if ((q - p).norm() < least && !(contains(q + aside) && contains(q - aside)))
                least = (q - p).norm();
            }
        }
    return least;
  }
};

void expectWaysOut(const Boxes& boxes, const std::vector<Vector3d>& points) {
  constexpr double kSpacing = 0.02;
  Random beside(7);
  const Mesh mesh = boxes.mesh();
  const std::vector<InsideVertex> inside = insideOf(points, mesh);
  EXPECT_EQ(inside, insideOf(points, mesh, {}, settingsOf(Engine::BruteForce)));
  EXPECT_EQ(inside, insideOf(points, mesh, {.rule = InsideRule::WindingNumber}));
  std::size_t count = 0;
  for (const Vector3d& p : points) count += boxes.contains(p);
  EXPECT_EQ(inside.size(), count);
  for (const InsideVertex& each : inside) {
    const Vector3d &p = points[each.vertex], end = p + each.depth * each.direction;
    Vector3d point = Vector3d::Zero();
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(each.vertices[i], mesh.triangles[each.triangle][i]);
      point += each.weights[i] * mesh.positions[each.vertices[i]];
    }
    ASSERT_LT((point - end).norm(), 1e-12);
    ASSERT_LE(each.depth, boxes.depth(p, kSpacing) + 1e-12);
    // The point is on the outer surface: so its distance is not too small.
    bool isOutside = false;
    for (int k = 0; k < 5000 && !isOutside; ++k)
      isOutside = !boxes.contains(end + 1e-7 * randomPoint(beside, -1, 1));
    ASSERT_TRUE(isOutside);
  }
}

TEST(OuterSurface, VerticesInOverlappingBoxesLeaveByIt) {
  Random random(2);
  // Both bars hide the middle of each other's faces: there, the nearest ways lead to the corners
  // between them.
  expectWaysOut(Boxes{{{Matrix3d::Identity(), {0, 0, 0}, {2, 0.5, 0.5}},
                       {Matrix3d::Identity(), {0, 0, 0}, {0.5, 2, 0.6}}}},
                {{0, 0, 0}, {0.1, 0.05, 0.02}, {0.4, 0.4, 0.1}, {-0.3, 0.2, 0.4}, {0.9, 0.1, 0}});
  for (int i = 0; i < casesOf(12); ++i) {
    Boxes boxes;
    for (int k = 0; k < 2; ++k)
      boxes.parts.push_back({randomTurn(random), 0.3 * randomPoint(random, -1, 1),
                             Vector3d::Constant(0.4) + 0.5 * randomPoint(random, 0, 1)});
    std::vector<Vector3d> points;
    for (int k = 0; k < 20; ++k) points.push_back(randomPoint(random, -0.8, 0.8));
    expectWaysOut(boxes, points);
  }
}

/// Parts that touch in a plane: the faces that they have in common lead nowhere.
TEST(OuterSurface, VerticesInBoxesWithACommonPlaneLeaveByIt) {
  Random random(3);
  for (const bool isTurned : {false, true}) {
    const Eigen::Matrix3d turn =
        isTurned ? Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).toRotationMatrix()
                 : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
    const Boxes::Part large{turn, turn * Vector3d(-0.5, 0, 0), {0.5, 1, 1}},
        small{turn, turn * Vector3d(0.5, 0, 0), {0.5, 0.5, 0.5}},
        shifted{turn, turn * Vector3d(0.5, 0.3, 0.2), {0.5, 1, 1}};
    std::vector<Vector3d> points;
    for (int i = 0; i < casesOf(40); ++i)
      points.push_back(turn * randomPoint(random, -1, 1).cwiseProduct(Vector3d(0.3, 0.9, 0.9)));
    expectWaysOut(Boxes{{large, small}}, points);
    expectWaysOut(Boxes{{small, large}}, points);
    expectWaysOut(Boxes{{large, shifted}}, points);
  }
}

/// Where an edge of a cavity enters another part, three faces meet.
TEST(OuterSurface, VerticesNearACoveredEdgeOfACavityLeaveByIt) {
  Random random(4);
  for (int i = 0; i < casesOf(30, 5); ++i) {
    const Matrix3d both = randomTurn(random);
    const Boxes body{
        {{both, {0, 0, 0}, Vector3d::Constant(3.0)},
         {both, {0, 0, 0}, Vector3d::Constant(0.8), -1},
         {randomTurn(random), both * Vector3d(0.9, 0.9, 0.9), Vector3d::Constant(0.8)}}};
    std::vector<Vector3d> points;
    for (int k = 0; k < casesOf(40, 13); ++k)
      points.push_back(both * randomPoint(random, 0.4, 1.2));
    expectWaysOut(body, points);
  }
}

/// A ball that a random history deformed until triangles with one common vertex cross. Another
/// order of the triangles gave another point, sixteen times as far away.
TEST(OuterSurface, DoesNotDependOnTheOrderOfTriangles) {
  const std::vector<Vector3d> positions{
      {0.25331377010461115, 0.58225211674682298, 0.84750867716629052},
      {0.74525810247210433, 0.2944712369118479, 0.4157026638382294},
      {0.51126601400398619, 0.31798991971162976, 0.93143864326955761},
      {0.77079095248204765, 0.11622357978643014, 0.53430680994533608},
      {0.5525434082060463, 0.1077958530189351, 0.62266936122066974},
      {1.0326399632374157, 0.46739062498090694, -0.19753666280380983},
      {0.12371483156299372, 0.4411409744543609, 0.55114811875164094},
      {0.73484893752104163, 0.36148624519910955, 0.66287301063079795},
      {0.6475144729721376, 0.019183507299369271, -0.26284038778411445},
      {0.3195206925941742, 0.20908000236519855, -0.27908368336447292}};
  const std::vector<Triangle> triangles{
      {0, 1, 2}, {1, 5, 6}, {1, 6, 2}, {5, 9, 6}, {0, 2, 3}, {2, 6, 7}, {2, 7, 3}, {6, 9, 7},
      {0, 3, 4}, {3, 7, 8}, {3, 8, 4}, {7, 9, 8}, {0, 4, 1}, {4, 8, 5}, {4, 5, 1}, {8, 9, 5}};
  const std::vector<Vector3d> points{
      {0.53292798479852066, 0.32781866180965585, 0.72643530370194587}};
  for (std::size_t first = 0; first < triangles.size(); ++first) {
    Mesh body{positions, {}};
    for (std::size_t i = 0; i < triangles.size(); ++i)
      body.triangles.push_back(triangles[(first + i) % triangles.size()]);
    const std::vector<InsideVertex> inside = insideOf(points, body);
    ASSERT_EQ(inside.size(), 1u);
    EXPECT_EQ(body.triangles[inside[0].triangle], triangles[4]) << first;
    EXPECT_NEAR(inside[0].depth, 0.002694834119833099, 1e-12) << first;
  }
}

}  // namespace
}  // namespace palpate::testing
