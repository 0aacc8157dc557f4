// findInsideVertices() of bodies whose parts overlap: each vertex leaves by the outer surface.
#include <palpate/OctreeBasedCD.h>

#include "Common/FailingAllocation.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Queries/QueryTruth.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace palpate::testing {

namespace {

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

TEST(OuterSurface, VerticesInCrossingBarsLeaveByIt) {
  // Both bars hide the middle of each other's faces: there, the nearest ways lead to the corners
  // between them.
  const Boxes bars{{{Eigen::Matrix3d::Identity(), {0, 0, 0}, {2, 0.5, 0.5}},
                    {Eigen::Matrix3d::Identity(), {0, 0, 0}, {0.5, 2, 0.6}}}};
  Random random(1);
  std::vector<Vector3d> points{{0, 0, 0}, {0.1, 0.05, 0.02}};
  for (int i = 0; i < casesOf(60); ++i)
    points.push_back(randomPoint(random, -1, 1).cwiseProduct(Vector3d(1.0, 1.0, 0.6)));
  expectWaysOut(bars, points);
}

TEST(OuterSurface, VerticesInTurnedOverlappingBoxesLeaveByIt) {
  Random random(2);
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

/// The outer surface is found while vertices are searched. If memory ends there, nothing is lost.
TEST(OuterSurface, SurvivesFailingAllocations) {
  const Mesh body = Boxes{{{Eigen::Matrix3d::Identity(), {0, 0, 0}, {2, 0.5, 0.5}},
                           {Eigen::Matrix3d::Identity(), {0, 0, 0}, {0.5, 2, 0.6}}}}
                        .mesh();
  Settings settings;
  settings.threads = 1;
  OctreeBasedCD detection(settings);
  const GeometryId vertices =
                       detection.addPointSet(std::vector<Vector3d>{{0, 0, 0}, {0.2, 0.1, 0}}),
                   id = detection.addTriangleMesh(body.positions, body.triangles);
  const SpatialQueries queries = detection.queries();
  std::vector<InsideVertex> expected;
  queries.findInsideVertices(vertices, id, expected);
  EXPECT_EQ(expected.size(), 2u);
  std::size_t failures = 0;
  for (bool hasFailed = true; hasFailed; ++failures) {
    std::vector<InsideVertex> found;
    hasFailed = FailingAllocation::throwsAt(
        failures + 1, [&] { queries.findInsideVertices(vertices, id, found); });
    EXPECT_EQ(found, hasFailed ? std::vector<InsideVertex>() : expected);
  }
  EXPECT_GT(failures, 10u);
}

/// A body without overlaps keeps the nearest point of its surface.
TEST(OuterSurface, IsTheWholeSurfaceOfASimpleBody) {
  Random random(3);
  Mesh body = sphere(9, 14, {0, 0, 0}, 1.0);
  for (Vector3d& p : body.positions) p *= uniform(random, 0.5, 1.0);
  std::vector<Vector3d> points;
  for (int i = 0; i < casesOf(2000); ++i) points.push_back(randomPoint(random, -1, 1));
  OctreeBasedCD detection;
  const GeometryId id = detection.addTriangleMesh(body.positions, body.triangles);
  const std::vector<InsideVertex> inside = insideOf(points, body);
  EXPECT_GT(inside.size(), points.size() / 20);
  for (const InsideVertex& each : inside) {
    const auto nearest = detection.queries().closestPoint(id, points[each.vertex]);
    ASSERT_EQ(each.triangle, nearest->element);
    ASSERT_EQ(each.depth, nearest->distance);
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
