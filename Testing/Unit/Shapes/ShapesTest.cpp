#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/QueryCalls.h"
#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Common/StepBodies.h"
#include "Common/TestGeometry.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

// Analytical shapes against triangles, lines and points: the definition by a signed distance and a
// search that are written here.

namespace palpate::testing {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

using Placed = MeasuredShape;

/// One of each kind, around the middle of the unit cube.
std::vector<Placed> shapes(Random& random) {
  std::vector<Placed> all;
  std::vector<AnalyticalGeometry> kinds = shapesOfEveryKind(random);
  ConvexHull prism{{{0.01, 0, 0}}};  // with parallel faces
  for (int i = 0; i < 3; ++i)
    for (const double z : {-0.2, 0.2})
      prism.points.push_back({0.25 * std::cos(2 * i), 0.25 * std::sin(2 * i), z});
  kinds.push_back(prism);
  for (const AnalyticalGeometry& geometry : kinds)
    all.push_back({geometry, randomTurn(random), randomPoint(random, 0.3, 0.7)});
  return all;
}

CollisionData answer(const TestGeometry& body, const Placed& shape, const PairSettings& pair) {
  const Pose pose{shape.rotation, shape.translation};
  return stepOf(settingsOf(Engine::Octree), bodyOf("body", body, body.positions),
                shapeOf("shape", shape.geometry, pose, pose), pair);
}

/// Identifies an element.
using Element = std::array<std::uint32_t, 3>;
Element elementOf(const ShapeContact& c) {
  return {static_cast<std::uint32_t>(c.element), c.id, c.vertices[1]};
}
std::map<Element, ShapeContact> contactsByElement(const CollisionData& data) {
  std::map<Element, ShapeContact> contacts;
  for (const ShapeContact& c : data.shape()) contacts.emplace(elementOf(c), c);
  EXPECT_EQ(contacts.size(), data.shape().size());
  EXPECT_TRUE(std::ranges::is_sorted(data.shape(), {}, elementOf));
  return contacts;
}

// ---- The definition ----

constexpr double kSearch = 1e-7;  ///< error of the search above where distances are constant

/// Every element with its least distance, and the least distance on its boundary.
struct Truth {
  double own, boundary;
};
/// The least distance of a face beyond `reach` is a lower bound only.
std::map<Element, Truth> truthOf(const TestGeometry& body, const Placed& shape, double reach) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  std::map<Element, Truth> truth;
  const auto& at = body.positions;
  const std::vector<Triangle> elements = body.elements();
  for (std::uint32_t t = 0; t < elements.size(); ++t) {
    const Triangle& corners = elements[t];
    double edges = kNone;
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t p = std::min(corners[i], corners[(i + 1) % 3]),
                          q = std::max(corners[i], corners[(i + 1) % 3]);
      const double start = shape.signedDistance(at[p]), end = shape.signedDistance(at[q]);
      truth[{0, p, p}] = {start, kNone};
      if (p == q) continue;
      const double edge = leastOn(shape, at[p], at[q]);
      truth[{1, p, q}] = {edge, std::min(start, end)};
      edges = std::min(edges, edge);
    }
    if (body.type != GeometryType::Triangles) continue;
    const auto& [a, b, c] = corners;
    const Vector3d middle = (at[a] + at[b] + at[c]) / 3;
    const double size =
        std::max({(at[a] - middle).norm(), (at[b] - middle).norm(), (at[c] - middle).norm()});
    const double bound = shape.signedDistance(middle) - size;  // distances grow no faster
    truth[{2, t, b}] = {bound > reach ? bound : leastOn(shape, at[a], at[b], at[c]), edges};
  }
  return truth;
}

void expectWellFormed(const ShapeContact& c, const TestGeometry& body, const Placed& shape) {
  EXPECT_NEAR(c.normal.norm(), 1, 1e-14);
  EXPECT_GE(c.weights.minCoeff(), 0);
  EXPECT_NEAR(c.weights.sum(), 1, 1e-15);
  Vector3d point = Vector3d::Zero();
  for (int i = 0; i < 3; ++i) point += c.weights[i] * body.positions[c.vertices[i]];
  const double centre = c.distance + body.radius(0);
  EXPECT_LE((point - c.point).norm(), 1e-14);
  EXPECT_LE((c.point - centre * c.normal - c.pointOnShape).norm(), 1e-14);
  EXPECT_NEAR(shape.signedDistance(c.point), centre, 1e-13);
  EXPECT_NEAR(shape.signedDistance(c.pointOnShape), 0, 1e-8);
  EXPECT_GE(shape.signedDistance(c.point + 1e-3 * c.normal), centre + 1e-3 - 1e-10);
}

/// The least distance of the triangles around a vertex or an edge, or of the segments around a
/// vertex. Infinite for a triangle.
double leastAround(const TestGeometry& body, const Element& element,
                   const std::map<Element, ShapeContact>& all) {
  double least = std::numeric_limits<double>::infinity();
  const std::vector<Triangle> elements = body.elements();
  for (std::uint32_t t = 0; element[0] < 2 && t < elements.size(); ++t) {
    const Triangle& corners = elements[t];
    const auto has = [&](std::uint32_t v) {
      return std::find(corners.begin(), corners.end(), v) != corners.end();
    };
    if (!has(element[1]) || !has(element[2])) continue;
    const bool isSegment = body.type == GeometryType::Lines;
    const std::uint32_t a = corners[0], b = corners[1];
    const auto found =
        all.find(isSegment ? Element{1, std::min(a, b), std::max(a, b)} : Element{2, t, b});
    if (found != all.end()) least = std::min(least, found->second.distance);
  }
  return least;
}

TEST(Shapes, MatchTheDefinition) {
  Random random(2);
  const std::vector<TestGeometry> bodies{
      testGeometry(soup(random, 60, 0.3)), testGeometry(soup(random, 60, 0.8)),
      testGeometry(sphere(8, 12, {.5, .5, .5}, .4)), thread(random, 60, 0.1, 0.02, false),
      particles(random, 100, 0.01)};
  std::array<std::size_t, 3> distinct{}, inside{};
  for (std::size_t bodyIndex = 0; bodyIndex < bodies.size(); ++bodyIndex) {
    const TestGeometry& body = bodies[bodyIndex];
    std::size_t number = bodyIndex;
    for (const Placed& shape : shapes(random)) {
      if (isLeftOut(number++, 3)) continue;
      SCOPED_TRACE("shape " + std::to_string(shape.geometry.index()));
      const double thickness = 0.05;
      const auto all = contactsByElement(
                     answer(body, shape, {Method::Proximity, thickness, Contacts::All})),
                 own = contactsByElement(
                     answer(body, shape, {Method::Proximity, thickness, Contacts::Distinct}));
      for (const auto& [element, truth] : truthOf(body, shape, thickness + body.radius(0))) {
        const auto found = all.find(element);
        if (found == all.end()) {
          EXPECT_GT(truth.own - body.radius(0), thickness - kSearch) << element[0];
          continue;
        }
        const ShapeContact& c = found->second;
        EXPECT_NEAR(c.distance + body.radius(0), truth.own, kSearch) << element[0];
        EXPECT_LE(c.distance + body.radius(0), truth.own + 1e-13)
            << "the search found a nearer point";
        expectWellFormed(c, body, shape);
        const auto held = own.find(element);
        EXPECT_TRUE(held != own.end() || truth.boundary <= truth.own + kSearch ||
                    leastAround(body, element, all) < c.distance)
            << element[0];
        if (held == own.end()) continue;
        ++distinct[element[0]];
        inside[element[0]] += c.distance < 0;
        EXPECT_EQ(held->second, c);
        EXPECT_GT(c.weights.head(element[0] + 1).minCoeff(), 0);
      }
      for (const auto& [element, c] : own) EXPECT_TRUE(all.contains(element));
    }
  }
  for (int kind = 0; kind < 3; ++kind) {
    EXPECT_GE(distinct[kind], leastOf(50, 15)) << kind;
    EXPECT_GE(inside[kind], leastOf(30, 8)) << kind;
  }
}

TEST(Shapes, HullsOfManyPointsMatchTheirSphere) {
  Random random(7);
  const TestGeometry body = testGeometry(soup(random, 100, 0.3));
  const Positions round = sphere(16, 32, Vector3d::Zero(), 0.3).positions;
  for (int run = 0; run < 6; ++run) {
    const Matrix3d turn = randomTurn(random);
    const Vector3d at = randomPoint(random, 0.3, 0.7);
    const PairSettings pair{Method::Proximity, 0.05, Contacts::All};
    const auto facets = contactsByElement(answer(body, {ConvexHull{round}, turn, at}, pair)),
               exact = contactsByElement(answer(body, {Sphere{{0, 0, 0}, 0.3}, turn, at}, pair));
    EXPECT_GT(facets.size(), 50u);
    for (const auto& [element, c] : facets) {
      ASSERT_TRUE(exact.contains(element));
      // Chords of 11.25 degrees across and along.
      const double sagitta = 0.3 * 2 * (1 - std::cos(0.0982));
      EXPECT_GE(c.distance, exact.at(element).distance - 1e-14);
      EXPECT_LE(c.distance, exact.at(element).distance + sagitta);
    }
  }
}

// ---- Hand-computed contacts ----

TEST(Shapes, CubeOnTableTouchesWithItsCorners) {
  const TestGeometry cube = testGeometry(boxMesh({0, 0, 0}, {1, 1, 1}));
  const auto table = [](double height, bool twoSided) {
    return Placed{Plane{{0, 0, height}, {0, 0, 7}, twoSided}};
  };
  for (const double height : {0.0, 0.25}) {
    const CollisionData data = answer(cube, table(height, false), {Method::Proximity, 0.0});
    ASSERT_EQ(data.shape().size(), 4u);
    for (std::uint32_t v = 0; v < 4; ++v) {
      EXPECT_EQ(data.shape()[v].element, ShapeElement::Vertex);
      EXPECT_EQ(data.shape()[v].id, v);
      EXPECT_EQ(data.shape()[v].distance, -height);
      EXPECT_EQ(data.shape()[v].normal, Vector3d::UnitZ());
    }
  }
  // Through the middle of a sheet: four edges and one diagonal on each side cross it.
  const CollisionData data = answer(cube, table(0.5, true), {Method::Proximity, 0.0});
  EXPECT_EQ(data.shape().size(), 8u);
  for (const ShapeContact& c : data.shape()) {
    EXPECT_EQ(c.element, ShapeElement::Edge);
    EXPECT_EQ(c.distance, 0);
    EXPECT_EQ(c.point[2], 0.5);
  }
}

TEST(Shapes, CandidatesAreTheElementsNearby) {
  OctreeBasedCD collisions;
  std::vector<Vector3d> points;
  for (int i = 0; i < 100; ++i) points.emplace_back(i, 0, 0);
  const GeometryId cloud = collisions.addPointSet(points),
                   ball = collisions.addAnalyticalGeometry(Sphere{{50, 0, 0}, 2.5}),
                   other = collisions.addAnalyticalGeometry(Sphere{{0, 80, 0}, 1});
  collisions.addCollisionPair(cloud, ball, {.method = Method::Proximity, .thickness = 0.1});
  collisions.addCollisionPair(ball, other, {.method = Method::Proximity, .thickness = 0.1});
  collisions.detectCollision();
  EXPECT_EQ(collisions.pairStatistics(cloud, ball).candidatePairs, 5u);
  EXPECT_EQ(collisions.pairStatistics(ball, other).candidatePairs, 1u);
  EXPECT_EQ(collisions.statistics().candidatePairs, 6u);
}

TEST(Shapes, TriangleIsTouchedAtItsClosestPoint) {
  const TestGeometry triangle =
      testGeometry(Mesh{{{-8, -8, 0}, {8, -8, 0}, {0, 8, 0}}, {{0, 1, 2}}});
  const auto only = [&](const AnalyticalGeometry& shape) {
    const CollisionData data = answer(triangle, {shape}, {Method::Proximity, 1.0});
    EXPECT_EQ(data.shape().size(), 1u);
    EXPECT_EQ(data.shape()[0].element, ShapeElement::Face);
    return data.shape()[0];
  };
  const Vector3d zero = Vector3d::Zero(), up = Vector3d::UnitZ();
  struct Row {
    AnalyticalGeometry shape;
    double distance;
    Vector3d point, normal;
  };
  for (const auto& [shape, distance, point, normal] : {
           Row{Sphere{{0, 0, 2}, 1.5}, 0.5, zero, -up},
           Row{Sphere{{0, 0, -0.5}, 1.5}, -1, zero, up},
           Row{Capsule{{-1, 0, 2}, {1, 0, 2}, 1.5}, 0.5, zero, -up},  // the middle of the overlap
           Row{Capsule{{0, 0, 4}, {1, 0, 2}, 1.5}, 0.5, {1, 0, 0}, -up},
           Row{Box{{0, 0, 2}, {1, 1, 1.5}}, 0.5, zero, -up},  // flat: in the middle
           Row{Box{{0, 0, 1}, {1, 1, 1.5}}, -0.5, zero, -up},
           Row{Cylinder{{0, 0, 0.5}, {0, 0, 4}, 1}, 0.5, zero, -up},
           Row{Cylinder{{0, -1, 2}, {0, 1, 2}, 1.5}, 0.5, zero, -up},
       }) {
    SCOPED_TRACE(shape.index());
    const ShapeContact c = only(shape);
    EXPECT_EQ(c.distance, distance);
    EXPECT_EQ(c.point, point);
    EXPECT_EQ(c.normal, normal);
  }
  const ShapeContact through = only(Capsule{{0, 0, 4}, {0, 0, -2}, 1.5});  // its axis goes through
  EXPECT_EQ(through.distance, -1.5);
  EXPECT_EQ(through.point, zero);
  EXPECT_EQ(through.normal[2], 0);  // out, across the axis
}

TEST(Shapes, DegenerateElementsMatchTheDefinition) {
  Random random(5);
  std::vector<Placed> all;
  for (const AnalyticalGeometry& shape : degenerateShapes())
    all.push_back({shape, Matrix3d::Identity(), {1, 1, 1}});
  for (int run = 0; run < casesOf(6); ++run) {
    TestGeometry degenerate;  // on a coarse grid
    for (int v = 0; v < 12; ++v) {
      const auto at = [&] { return static_cast<double>(random() % 3); };
      const double x = at(), y = at(), z = at();
      degenerate.positions.push_back({x, y, z});
    }
    const auto any = [&] { return static_cast<std::uint32_t>(random() % 12); };
    for (int t = 0; t < 14; ++t) {
      const std::uint32_t a = any(), b = any(), c = any();
      degenerate.triangles.push_back({a, b, c});
    }
    for (const Placed& shape : all) {
      if (shape.geometry.index() == 1 &&
          std::get<Capsule>(shape.geometry).p0 == std::get<Capsule>(shape.geometry).p1)
        continue;  // the test's own formula needs a length
      SCOPED_TRACE("shape " + std::to_string(shape.geometry.index()));
      const auto found =
          contactsByElement(answer(degenerate, shape, {Method::Proximity, 0.75, Contacts::All}));
      for (const auto& [element, truth] : truthOf(degenerate, shape, 0.75)) {
        const auto c = found.find(element);
        if (c == found.end())
          EXPECT_GT(truth.own, 0.75 - kSearch);
        else
          EXPECT_NEAR(c->second.distance, truth.own, kSearch);
      }
      for (const auto& [element, c] : found) expectWellFormed(c, degenerate, shape);
    }
    // A capsule without length is a sphere.
    const PairSettings pair{Method::Proximity, 0.5};
    EXPECT_EQ(answer(degenerate, {Capsule{{1, 1, 1}, {1, 1, 1}, 0.5}}, pair).hash(),
              answer(degenerate, {Sphere{{1, 1, 1}, 0.5}}, pair).hash());
  }
}

// ---- Refused calls ----

TEST(Shapes, BadInputThrowsErrorsThatNameIt) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(),
                   kEndless = std::numeric_limits<double>::infinity();
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  using Code = ErrorCode;
  const auto refuse = [&](const AnalyticalGeometry& shape, const std::string& words) {
    expectRefused(Code::InvalidShape, "geometry 0: " + words,
                  [&] { collisions.addAnalyticalGeometry(shape); });
  };
  refuse(Sphere{{0, 0, 0}, -1}, "radius is -1; it must be finite and not negative");
  refuse(Sphere{{0, kNan, 0}, 1}, "centre is (0, nan, 0); it must be finite");
  refuse(Capsule{{0, 0, 0}, {0, 0, kEndless}, 1}, "p1 is (0, 0, inf); it must be finite");
  refuse(Capsule{{0, 0, 0}, {0, 0, 1}, kNan}, "radius is nan");
  refuse(Plane{{0, 0, 0}, {0, 0, 0}}, "normal is (0, 0, 0); it must be longer than zero");
  refuse(Box{{0, 0, 0}, {1, -2, 1}}, "halfExtents is (1, -2, 1); it must be finite and not neg");
  refuse(ConvexHull{}, "the hull has no points; it needs at least one");
  expectRefused(
      Code::InvalidShape, "point 1 is (0, nan, 1); it must be finite",
      [&] {
        collisions.addAnalyticalGeometry(ConvexHull{{{0, 0, 0}, {0, kNan, 1}, {kNan, 0, 0}}});
      },
      {}, std::size_t{1});
  refuse(Cylinder{{1, 2, 3}, {1, 2, 3}, 1}, "p1 is (1, 2, 3); it must be different from p0");

  const GeometryId tool = collisions.addAnalyticalGeometry(Sphere{{0, 0, 0}, 1}),
                   points = collisions.addPointSet(Positions{{0, 0, 0.5}});
  EXPECT_EQ(tool, GeometryId{0});  // refused calls used no id
  expectRefused(Code::UnsupportedMethod,
                "a shape and a point set; use Auto, Proximity or Continuous",
                [&] { collisions.addCollisionPair(tool, points, {Method::Intersection}); });
  collisions.addCollisionPair(tool, points, {Method::Proximity, 0.0});
  collisions.detectCollision();
  ASSERT_EQ(collisions.collisionData(tool, points).shape().size(), 1u);
  EXPECT_EQ(collisions.statistics().contacts, 1u);
  EXPECT_FALSE(collisions.collisionData(tool, points).validity().trusted);
  const Matrix3d one = Matrix3d::Identity();
  Matrix3d turned = one;
  turned(0, 1) = 2e-5;
  const auto refusePose = [&](const Pose& pose, const std::string& words) {
    expectRefused(Code::InvalidTransform, words, [&] { collisions.setTransform(tool, pose); });
  };
  refusePose({turned, {0, 0, 0}}, "geometry 0: rotation is not a rotation");
  refusePose({-one, {0, 0, 0}}, "its determinant is -1");
  refusePose({kNan * one, {0, 0, 0}}, "rotation");
  refusePose({one, {0, 0, kNan}}, "translation is (0, 0, nan)");
  expectRefused(Code::WrongPositionCount, "is a shape, which has no positions",
                [&] { collisions.setPositions(tool, Positions{}); });
  expectRefused(Code::UnsupportedMethod, "is a shape; setTriangles()",
                [&] { collisions.setTriangles(tool, Positions{}, {}); });
  expectRefused(Code::NotClosed, "is a shape",
                [&] { testing::insideVertices(collisions, points, tool); });
  expectRefused(Code::NotAvailable, "no candidate pairs",
                [&] { collisions.candidatePairs(tool, points); });
  expectRefused(Code::NotAvailable, "no candidate pairs", [&] {
    collisions.forEachCandidate(tool, points, [](std::span<const ElementPair>) {});
  });
  expectRefused(Code::UnsupportedMethod, "one of the two is a shape", [&] {
    collisions.setContactPredicate(tool, points, [](const ContactFeatures&) { return true; });
  });
  turned(0, 1) = 1e-10;
  collisions.setTransform(tool, {turned, {0, 0, 4}});
  collisions.forEachCandidate([](auto&&...) { ADD_FAILURE(); });
  collisions.detectCollision();
  EXPECT_TRUE(collisions.collisionData(tool, points).shape().empty());
  collisions.removeGeometry(tool);
  EXPECT_TRUE(collisions.pairs().empty());
}

}  // namespace
}  // namespace palpate::testing
