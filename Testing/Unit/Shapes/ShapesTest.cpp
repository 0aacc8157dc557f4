#include <palpate/Capture.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/QueryCalls.h"
#include "Common/PairRun.h"
#include "Common/Replayed.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Common/TestGeometry.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

// Analytical shapes against triangles, lines and points: the definition by a signed distance and a
// search that are written here.

namespace palpate::testing {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Triangles that cover a hull's surface, each with its plane: every three points with all others
/// on one side. If all points are in one plane: every three.
struct Facets {
  struct Facet {
    std::array<Vector3d, 3> corners;
    Vector3d normal;  ///< out
    double turn;      ///< 1: by the corners' winding, too
  };
  std::vector<Facet> all;
  bool isBody = false;

  explicit Facets(const Positions& points) {
    const std::size_t n = points.size();
    for (const bool body : {true, false}) {
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = i; j < n; ++j)
          for (std::size_t k = j; k < n; ++k) {
            Vector3d normal = (points[j] - points[i]).cross(points[k] - points[i]);
            double above = 0, below = 0;
            for (const Vector3d& p : points) {
              const double height = normal.normalized().dot(p - points[i]);
              above = std::max(above, height);
              below = std::min(below, height);
            }
            if (body && (normal.norm() < 1e-12 || std::min(above, -below) > 1e-12)) continue;
            isBody |= body && std::max(above, -below) > 1e-12;
            const double turn = above > -below ? -1 : 1;
            normal = turn * normal.normalized();
            all.push_back({{points[i], points[j], points[k]}, normal, turn});
            if (body || normal == Vector3d::Zero()) continue;
            all.push_back({{points[i], points[j], points[k]}, -normal, -turn});
          }
      if (isBody) return;
      if (body) all.clear();
    }
  }

  double signedDistance(const Vector3d& x) const {
    double highest = -std::numeric_limits<double>::infinity(), nearest = -highest;
    for (const Facet& f : all) {
      const double height = f.normal.dot(x - f.corners[0]);
      highest = std::max(highest, height);
      if (height < -1e-14) continue;
      bool over = true;
      for (int i = 0; i < 3; ++i) {
        const Vector3d &p = f.corners[i], edge = f.corners[(i + 1) % 3] - p, from = x - p;
        over &= f.normal.dot(edge.cross(from)) * f.turn > 0;
        const double square = edge.squaredNorm(),
                     t = square > 0 ? std::clamp(from.dot(edge) / square, 0.0, 1.0) : 0.0;
        nearest = std::min(nearest, (from - t * edge).norm());
      }
      if (over) nearest = std::min(nearest, std::abs(height));
    }
    return isBody && highest < 0 ? highest : nearest;
  }
};

struct Placed {
  AnalyticalGeometry geometry;
  Matrix3d rotation = Matrix3d::Identity();
  Vector3d translation = Vector3d::Zero();
  std::optional<Facets> facets{};  ///< of a hull of few points

  Placed(const AnalyticalGeometry& shape, const Matrix3d& turn = Matrix3d::Identity(),
         const Vector3d& shift = Vector3d::Zero())
      : geometry(shape), rotation(turn), translation(shift) {
    const auto* hull = std::get_if<ConvexHull>(&geometry);
    if (hull && hull->points.size() < 10) facets.emplace(hull->points);
  }
};

/// One of each type, around the middle of the unit cube.
std::vector<Placed> shapes(Random& random) {
  std::vector<Placed> all;
  const auto place = [&](const AnalyticalGeometry& geometry) {
    all.push_back({geometry, randomTurn(random), randomPoint(random, 0.3, 0.7)});
  };
  place(Sphere{{0.01, 0, 0}, 0.25});
  place(Capsule{{-0.3, 0, 0}, {0.2, 0.1, 0}, 0.1});
  place(Plane{{0, 0.05, 0}, {1, 2, 3}, false});
  place(Plane{{0, 0.05, 0}, {1, -2, 3}, true});
  place(Box{{0.05, 0, 0}, {0.3, 0.2, 0.1}});
  place(Cylinder{{-0.2, 0, 0}, {0.3, 0.1, 0}, 0.15});
  place(Sphere{{0, 0, 0}, 0});
  place(Capsule{{-0.3, 0, 0}, {0.2, 0.1, 0}, 0});
  place(Box{{0, 0, 0}, {0.3, 0.2, 0}});
  place(Cylinder{{-0.2, 0, 0}, {0.3, 0.1, 0}, 0});
  Positions cloud, plate;
  for (int i = 0; i < 6; ++i) cloud.push_back(randomPoint(random, -0.3, 0.3));
  cloud.push_back(cloud[2]);
  for (int i = 0; i < 4; ++i)
    plate.push_back({uniform(random, -.3, .3), 0.1, uniform(random, -.3, .3)});
  place(ConvexHull{cloud});
  place(ConvexHull{plate});
  place(ConvexHull{{{-0.3, 0, 0}, {0.1, 0, 0}, {0.3, 0, 0}}});
  place(ConvexHull{{{0.1, 0, 0}, {0.1, 0, 0}}});
  Positions prism{{0.01, 0, 0}};  // with parallel faces
  for (int i = 0; i < 3; ++i)
    for (const double z : {-0.2, 0.2})
      prism.push_back({0.25 * std::cos(2 * i), 0.25 * std::sin(2 * i), z});
  place(ConvexHull{prism});
  return all;
}

CollisionData answer(const Settings& settings, const TestGeometry& body, const Placed& shape,
                     const PairSettings& pair, bool shapeFirst = false) {
  OctreeBasedCD collisions(settings);
  const GeometryId tool = collisions.addAnalyticalGeometry(shape.geometry),
                   mesh = body.addTo(collisions);
  collisions.setTransform(tool, {shape.rotation, shape.translation});
  collisions.addCollisionPair(shapeFirst ? tool : mesh, shapeFirst ? mesh : tool, pair);
  collisions.detectCollision();
  EXPECT_EQ(collisions.octree().validate(), std::vector<std::string>{});
  return collisions.collisionData(shapeFirst ? tool : mesh, shapeFirst ? mesh : tool);
}

CollisionData answer(const TestGeometry& body, const Placed& shape, const PairSettings& pair) {
  return answer(settingsOf(Engine::Octree), body, shape, pair);
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

/// The distance of each shape, from its definition.
double signedDistance(const Placed& placed, const Vector3d& world) {
  const Vector3d x = placed.rotation.transpose() * (world - placed.translation);
  const auto ofBox = [](std::initializer_list<double> beyond) {
    double outside = 0;
    for (const double b : beyond) outside += b > 0 ? b * b : 0;
    return outside > 0 ? std::sqrt(outside) : std::max(beyond);
  };
  if (const auto* s = std::get_if<Sphere>(&placed.geometry))
    return (x - s->centre).norm() - s->radius;
  if (const auto* c = std::get_if<Capsule>(&placed.geometry)) {
    const Vector3d u = c->p1 - c->p0;
    const double t = u.dot(x - c->p0) / u.squaredNorm();
    return (x - c->p0 - std::clamp(t, 0.0, 1.0) * u).norm() - c->radius;
  }
  if (const auto* p = std::get_if<Plane>(&placed.geometry)) {
    const double height = p->normal.normalized().dot(x - p->point);
    return p->twoSided ? std::abs(height) : height;
  }
  if (const auto* b = std::get_if<Box>(&placed.geometry)) {
    const Vector3d beyond = (x - b->centre).cwiseAbs() - b->halfExtents;
    return ofBox({beyond[0], beyond[1], beyond[2]});
  }
  if (placed.facets) return placed.facets->signedDistance(x);
  const auto& c = std::get<Cylinder>(placed.geometry);
  const Vector3d u = (c.p1 - c.p0).normalized(), from = x - 0.5 * (c.p0 + c.p1);
  return ofBox(
      {u.cross(from).norm() - c.radius, std::abs(u.dot(from)) - 0.5 * (c.p1 - c.p0).norm()});
}

double leastOn(const Placed& shape, const Vector3d& p, const Vector3d& q) {
  return minimumOf([&](double t) { return signedDistance(shape, p + t * (q - p)); });
}
double leastOn(const Placed& shape, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  return minimumOf([&](double t) { return leastOn(shape, a + t * (b - a), a + t * (c - a)); });
}

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
      const double start = signedDistance(shape, at[p]), end = signedDistance(shape, at[q]);
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
    const double bound = signedDistance(shape, middle) - size;  // distances grow no faster
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
  EXPECT_NEAR(signedDistance(shape, c.point), centre, 1e-13);
  EXPECT_NEAR(signedDistance(shape, c.pointOnShape), 0, 1e-8);
  EXPECT_GE(signedDistance(shape, c.point + 1e-3 * c.normal), centre + 1e-3 - 1e-10);
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
      if (isLeftOut(number++)) continue;
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
    EXPECT_GT(distinct[kind], leastOf(50)) << kind;
    EXPECT_GT(inside[kind], leastOf(30)) << kind;
  }
}

TEST(Shapes, MoveWithTheirBodies) {
  Random random(3);
  const TestGeometry body = testGeometry(sphere(8, 10, {0.5, 0.5, 0.5}, 0.4));
  for (const Placed& shape : shapes(random)) {
    const PairSettings pair{Method::Proximity, 0.05};
    const auto here = contactsByElement(answer(body, shape, pair));
    for (int run = 0; run < 5; ++run) {
      const Matrix3d turn = randomTurn(random);
      const Vector3d shift = randomPoint(random, -4, 4);
      TestGeometry movedBody = body;
      for (Vector3d& p : movedBody.positions) p = turn * p + shift;
      const auto there = contactsByElement(
          answer(movedBody,
                 {shape.geometry, turn * shape.rotation, turn * shape.translation + shift}, pair));
      for (const auto& [element, c] : here) {
        const auto found = there.find(element);
        if (found == there.end()) {  // on the border of being a contact
          const double edge = std::min(c.weights.minCoeff(), 0.05 - c.distance);
          EXPECT_TRUE(element[0] > 0 || edge < 1e-12) << element[0] << ' ' << c.weights.transpose();
          continue;
        }
        EXPECT_NEAR(found->second.distance, c.distance, 1e-13);
        EXPECT_NEAR((found->second.normal - turn * c.normal).norm(), 0, 1e-7)
            << shape.geometry.index() << ' ' << element[0] << " at " << c.distance << ": "
            << (shape.rotation.transpose() * c.normal).transpose() << " and "
            << (shape.rotation.transpose() * turn.transpose() * found->second.normal).transpose();
      }
      EXPECT_NEAR(static_cast<double>(there.size()), static_cast<double>(here.size()), 1);
    }
  }
}

TEST(Shapes, MatchTheirTessellations) {
  Random random(4);
  const TestGeometry body = testGeometry(soup(random, 60, 0.15));
  const auto nearest = [](const CollisionData& data) {
    double distance = std::numeric_limits<double>::infinity();
    for (const auto& c : data.vertexTriangle()) distance = std::min(distance, c.distance);
    for (const auto& c : data.triangleVertex()) distance = std::min(distance, c.distance);
    for (const auto& c : data.edgeEdge()) distance = std::min(distance, c.distance);
    for (const auto& c : data.shape()) distance = std::min(distance, c.distance);
    return distance;
  };
  const Mesh ball = sphere(30, 60, Vector3d::Zero(), 0.3);
  const Mesh cube = boxMesh({-0.3, -0.2, -0.1}, {0.3, 0.2, 0.1});
  int apart = 0;
  for (int run = 0; run < casesOf(20); ++run) {
    const Matrix3d turn = randomTurn(random);
    const Vector3d at = Vector3d::Constant(0.5) + 1.1 * randomPoint(random, -1, 1).normalized();
    for (const bool isBall : {true, false}) {
      Mesh mesh = isBall ? ball : cube;
      for (Vector3d& p : mesh.positions) p = turn * p + at;
      const Placed shape{isBall ? AnalyticalGeometry(Sphere{{0, 0, 0}, 0.3})
                                : AnalyticalGeometry(Box{{0, 0, 0}, {0.3, 0.2, 0.1}}),
                         turn, at};
      const Mesh own{body.positions, body.triangles};
      PairRun meshes(settingsOf(Engine::Octree), own, mesh, {Method::Proximity, 1.0}, false);
      meshes.detect();
      const double truth = nearest(meshes.data()),
                   found = nearest(answer(body, shape, {Method::Proximity, 1.0}));
      if (!(truth > 0.01)) continue;
      ++apart;
      // Chords of 6 degrees are at most this far inside.
      EXPECT_NEAR(found, truth, isBall ? 0.3 * 2 * (1 - std::cos(3.1415927 / 60)) : 1e-14);
    }
  }
  EXPECT_GT(apart, casesOf(20));
}

TEST(Shapes, HullsMatchEqualBoxesAndCapsules) {
  Random random(7);
  const TestGeometry body = testGeometry(soup(random, 100, 0.3));
  Positions corners = boxMesh({-0.3, -0.2, -0.1}, {0.3, 0.2, 0.1}).positions;
  for (int i = 0; i < 30; ++i)  // on its faces and inside
    corners.push_back(
        {uniform(random, -.3, .3), uniform(random, -.2, .2), i % 2 ? 0.1 : uniform(random, 0, .1)});
  const Positions round = sphere(16, 32, Vector3d::Zero(), 0.3).positions;
  for (int run = 0; run < 6; ++run) {
    const Matrix3d turn = randomTurn(random);
    const Vector3d at = randomPoint(random, 0.3, 0.7);
    const PairSettings pair{Method::Proximity, 0.05, Contacts::All};
    const auto hull = contactsByElement(answer(body, {ConvexHull{corners}, turn, at}, pair)),
               box = contactsByElement(
                   answer(body, {Box{{0, 0, 0}, {0.3, 0.2, 0.1}}, turn, at}, pair));
    EXPECT_GT(box.size(), 50u);
    EXPECT_EQ(box.size(), hull.size());
    for (const auto& [element, c] : box) {
      ASSERT_TRUE(hull.contains(element));
      EXPECT_NEAR(hull.at(element).distance, c.distance, 1e-14) << element[0];
    }
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

TEST(Shapes, TriangleIsTouchedAtItsClosestPoint) {
  const TestGeometry triangle =
      testGeometry(Mesh{{{-8, -8, 0}, {8, -8, 0}, {0, 8, 0}}, {{0, 1, 2}}});
  const auto only = [&](const AnalyticalGeometry& shape) {
    const CollisionData data = answer(triangle, {shape}, {Method::Proximity, 1.0});
    EXPECT_EQ(data.shape().size(), 1u);
    EXPECT_EQ(data.shape()[0].element, ShapeElement::Face);
    return data.shape()[0];
  };
  ShapeContact c = only(Sphere{{0, 0, 2}, 1.5});
  EXPECT_EQ(c.distance, 0.5);
  EXPECT_EQ(c.normal, -Vector3d::UnitZ());
  EXPECT_EQ(c.point, Vector3d::Zero());
  c = only(Sphere{{0, 0, -0.5}, 1.5});
  EXPECT_EQ(c.distance, -1);
  EXPECT_EQ(c.normal, Vector3d::UnitZ());
  c = only(Capsule{{-1, 0, 2}, {1, 0, 2}, 1.5});  // parallel: in the middle of the overlap
  EXPECT_EQ(c.point, Vector3d::Zero());
  c = only(Capsule{{0, 0, 4}, {1, 0, 2}, 1.5});
  EXPECT_EQ(c.point, Vector3d(1, 0, 0));
  c = only(Capsule{{0, 0, 4}, {0, 0, -2}, 1.5});  // its axis goes through
  EXPECT_EQ(c.distance, -1.5);
  EXPECT_EQ(c.point, Vector3d::Zero());
  EXPECT_EQ(c.normal[2], 0);              // out, across the axis
  c = only(Box{{0, 0, 2}, {1, 1, 1.5}});  // flat: in the middle
  EXPECT_EQ(c.point, Vector3d::Zero());
  EXPECT_EQ(c.distance, 0.5);
  c = only(Box{{0, 0, 1}, {1, 1, 1.5}});  // the nearest surface point is below
  EXPECT_EQ(c.distance, -0.5);
  EXPECT_EQ(c.normal, -Vector3d::UnitZ());
  c = only(Cylinder{{0, 0, 0.5}, {0, 0, 4}, 1});
  EXPECT_EQ(c.distance, 0.5);
  c = only(Cylinder{{0, -1, 2}, {0, 1, 2}, 1.5});
  EXPECT_EQ(c.point, Vector3d::Zero());
  EXPECT_EQ(c.distance, 0.5);
}

TEST(Shapes, DegenerateElementsMatchTheDefinition) {
  Random random(5);
  Positions unitCube{{1, 1, 1}};
  for (int v = 0; v < 8; ++v)
    unitCube.push_back({(v & 1) + 0.5, (v >> 1 & 1) + 0.5, (v >> 2) + 0.5});
  std::vector<Placed> all{{Sphere{{1, 1, 1}, 0.5}},
                          {Sphere{{1, 1, 1}, 0}},
                          {Capsule{{0, 0, 0}, {2, 0, 0}, 0}},
                          {Capsule{{0, 1, 1}, {2, 1, 1}, 0.5}},
                          {Capsule{{1, 1, 1}, {1, 1, 1}, 1}},
                          {Plane{{1, 1, 1}, {0, 0, 1}, false}},
                          {Plane{{1, 1, 1}, {0, 1, 1}, true}},
                          {Box{{1, 1, 1}, {0, 0, 0}}},
                          {Box{{1, 1, 1}, {1, 1, 0}}},
                          {Box{{1, 1, 1}, {1, 0.5, 0.5}}},
                          {Cylinder{{1, 1, 0}, {1, 1, 2}, 0.5}},
                          {Cylinder{{1, 1, 0}, {1, 1, 2}, 0}},
                          {ConvexHull{{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}}}},
                          {ConvexHull{{{0, 0, 1}, {2, 0, 1}, {0, 2, 1}}}},
                          {ConvexHull{{{0, 0, 0}, {2, 2, 2}, {1, 1, 1}}}},
                          {ConvexHull{{{1, 1, 1}}}},
                          {ConvexHull{unitCube}}};
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
  refuse(ConvexHull{{{0, 0, 0}, {0, kNan, 1}, {kNan, 0, 0}}},
         "point 1 is (0, nan, 1); it must be finite");
  try {
    collisions.addAnalyticalGeometry(ConvexHull{{{0, 0, 0}, {0, kEndless, 1}}});
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.element(), std::size_t{1});
  }
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
  expectRefused(Code::InvalidTransform, "geometry 0: rotation is not a rotation", [&] {
    collisions.setTransform(tool, {turned, {0, 0, 0}});
  });
  expectRefused(Code::InvalidTransform, "its determinant is -1", [&] {
    collisions.setTransform(tool, {-one, {0, 0, 0}});
  });
  expectRefused(Code::InvalidTransform, "rotation", [&] {
    collisions.setTransform(tool, {kNan * one, {0, 0, 0}});
  });
  expectRefused(Code::InvalidTransform, "translation is (0, 0, nan)", [&] {
    collisions.setTransform(tool, {one, {0, 0, kNan}});
  });
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

// ---- Captures and audit ----

TEST(Shapes, CapturesAndAuditIncludeThem) {
  Random random(6);
  const TestGeometry body = testGeometry(sphere(8, 12, {0.5, 0.5, 0.5}, 0.4));
  for (const int features : {20, 100000}) {
    Settings audited = settingsOf(Engine::Octree);
    audited.audit.features = features;
    OctreeBasedCD collisions(audited);
    const GeometryId mesh = body.addTo(collisions);
    for (const Placed& shape : shapes(random)) {
      const GeometryId tool = collisions.addAnalyticalGeometry(shape.geometry);
      collisions.setTransform(tool, {shape.rotation, shape.translation});
      collisions.addCollisionPair(tool, mesh, {Method::Proximity, 0.03});
    }
    collisions.detectCollision();
    EXPECT_TRUE(collisions.auditFailures().empty());
    EXPECT_GT(collisions.statistics().contacts, 50u);
    replayed(collisions);
  }
}

}  // namespace
}  // namespace palpate::testing
