#include <palpate/FeaturePairs.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"
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
#include <string>
#include <vector>

// Method::Continuous with shapes, against distances along the step that this file computes.

namespace palpate::testing {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A shape at both ends of a step.
struct Tool {
  AnalyticalGeometry geometry;
  std::array<Pose, 2> ends;

  /// A point of its frame at a time. It moves linearly.
  Vector3d at(const Vector3d& p, double t) const { return (1 - t) * ends[0](p) + t * ends[1](p); }
};

Positions cornersOf(const AnalyticalGeometry& geometry) {
  double radius = 0;
  return testing::cornersOf({geometry}, radius);
}

/// The faces of a hull of points in general position, or of a box: three corners with all others on
/// one side.
std::vector<Triangle> facesOf(const Positions& p) {
  std::vector<Triangle> faces;
  const auto n = static_cast<std::uint32_t>(p.size());
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; j < n; ++j)
      for (std::uint32_t k = 0; k < n; ++k) {
        if (j < i || k < i || j == k || i == j || i == k) continue;
        const Vector3d normal = (p[j] - p[i]).cross(p[k] - p[i]);
        if (normal.norm() > 1e-9 && std::all_of(p.begin(), p.end(), [&](const Vector3d& q) {
              return normal.dot(q - p[i]) <= 1e-9;
            }))
          faces.push_back({i, j, k});
      }
  return faces;
}

/// For a plane, by three of its points. For a cylinder and a point, by the centres of its ends.
double distanceAt(const Plane& plane, const Tool& tool, const std::array<Vector3d, 3>& x,
                  double t) {
  const Vector3d along = plane.normal.unitOrthogonal(), across = plane.normal.cross(along);
  const Vector3d origin = tool.at(plane.point, t);
  const Vector3d normal = (tool.at(plane.point + along, t) - origin)
                              .cross(tool.at(plane.point + across, t) - origin)
                              .normalized();
  double least = kInfinity, most = -kInfinity;
  for (const Vector3d& p : x) {
    least = std::min(least, normal.dot(p - origin));
    most = std::max(most, normal.dot(p - origin));
  }
  return std::max({0.0, least, plane.twoSided ? -most : 0.0});
}

double distanceAt(const Cylinder& cylinder, const Tool& tool, const Vector3d& x, double t) {
  const Vector3d p = tool.at(cylinder.p0, t), q = tool.at(cylinder.p1, t),
                 axis = (q - p).normalized();
  const double height = axis.dot(x - p), beyond = std::max(-height, height - (q - p).norm());
  const double across = (x - p - height * axis).norm() - cylinder.radius;
  return std::hypot(std::max(0.0, across), std::max(0.0, beyond));
}

/// The faces of an element.
double distanceAt(const Cylinder& cylinder, const Tool& tool, const std::array<Vector3d, 3>& x,
                  double t) {
  const auto onEdge = [&](const Vector3d& p, const Vector3d& q) {
    return minimumOf([&](double s) { return distanceAt(cylinder, tool, p + s * (q - p), t); });
  };
  if (x[1] == x[2]) return x[0] == x[1] ? distanceAt(cylinder, tool, x[0], t) : onEdge(x[0], x[1]);
  return minimumOf(
      [&](double s) { return onEdge(x[0] + s * (x[1] - x[0]), x[0] + s * (x[2] - x[0])); });
}

/// The distance of an element, {p, p, p}, {p, q, q} or a triangle, to the tool at a time; 0 inside.
double distanceAt(const Tool& tool, const std::vector<Triangle>& faces,
                  const std::array<Vector3d, 3>& x, double t) {
  if (const auto* plane = std::get_if<Plane>(&tool.geometry)) return distanceAt(*plane, tool, x, t);
  const auto* cylinder = std::get_if<Cylinder>(&tool.geometry);
  if (cylinder) return distanceAt(*cylinder, tool, x, t);
  double radius = 0;
  Positions corners = testing::cornersOf({tool.geometry}, radius);
  for (Vector3d& p : corners) p = tool.at(p, t);
  std::vector<Triangle> parts = faces;
  if (faces.empty()) parts = {{0, static_cast<std::uint32_t>(corners.size() - 1), 0}};
  double least = kInfinity;
  bool inside = !faces.empty();
  for (const auto& [i, j, k] : parts) {
    const std::array<Vector3d, 3> face{corners[i], corners[j], corners[k]};
    inside &= (face[1] - face[0]).cross(face[2] - face[0]).dot(x[0] - face[0]) < 0;
    if (trianglesIntersect(x[0], x[1], x[2], face[0], face[1], face[2])) return 0;
    for (int a = 0; a < 3; ++a) {
      least = std::min({least, vertexTriangleDistance(x[a], face[0], face[1], face[2]).distance,
                        vertexTriangleDistance(face[a], x[0], x[1], x[2]).distance});
      for (int b = 0; b < 3; ++b)
        least = std::min(
            least, edgeEdgeDistance(x[a], x[(a + 1) % 3], face[b], face[(b + 1) % 3]).distance);
    }
  }
  return inside ? 0 : std::max(0.0, least - radius);
}

struct Moving {
  TestGeometry geometry;
  Positions now;

  std::array<Vector3d, 3> at(const Triangle& corners, double t) const {
    std::array<Vector3d, 3> x;
    for (int i = 0; i < 3; ++i)
      x[i] = (1 - t) * geometry.positions[corners[i]] + t * now[corners[i]];
    return x;
  }
  /// The vertices, edges and triangles as contacts name them: type, and vertices.
  std::vector<std::pair<ShapeElement, Triangle>> elements() const {
    std::vector<std::pair<ShapeElement, Triangle>> all;
    for (std::uint32_t v = 0; v < now.size(); ++v) all.push_back({ShapeElement::Vertex, {v, v, v}});
    for (const auto& [p, q] : geometry.edges()) all.push_back({ShapeElement::Edge, {p, q, q}});
    for (const Triangle& t : geometry.triangles) all.push_back({ShapeElement::Face, t});
    return all;
  }
};

CollisionData answer(const Settings& settings, const Moving& body, const Tool& tool,
                     const PairSettings& pair) {
  return stepOf(settings, bodyOf("mesh", body.geometry, body.now),
                shapeOf("shape", tool.geometry, tool.ends[0], tool.ends[1]), pair);
}

PairSettings continuous(double thickness, double timeTolerance = 1e-6) {
  PairSettings pair{Method::Continuous, thickness};
  pair.continuous.timeTolerance = timeTolerance;
  return pair;
}

bool holds(const Triangle& all, const Triangle& part) {
  return std::all_of(part.begin(), part.end(), [&](std::uint32_t v) {
    return std::find(all.begin(), all.end(), v) != all.end();
  });
}

struct Tally {
  std::size_t contacts = 0, within = 0;
};

/// The law of Contacts::All: at the time of every contact its element is near. For every element
/// that comes near, it or a part of its boundary has a contact, and that is not later.
Tally expectTrue(const CollisionData& data, const Moving& body, const Tool& tool,
                 const PairSettings& pair) {
  Tally tally;
  const std::vector<Triangle> faces = cornersOf(tool.geometry).size() > 2
                                          ? facesOf(cornersOf(tool.geometry))
                                          : std::vector<Triangle>{};
  const double distance = pair.thickness + body.geometry.radii[0];
  double motion = 0;
  for (std::size_t v = 0; v < body.now.size(); ++v)
    motion = std::max(motion, (body.now[v] - body.geometry.positions[v]).norm());
  for (const Vector3d& p : {Vector3d(-2, -2, -2), Vector3d(2, 2, 2), Vector3d(2, -2, 2)})
    motion += (tool.ends[1](p) - tool.ends[0](p)).norm();
  const double early = pair.continuous.timeTolerance * motion + 1e-9;
  for (const ShapeContact& c : data.shape()) {
    ++tally.contacts;
    tally.within += c.timeOfImpact > 0;
    const auto x = body.at(c.vertices, c.timeOfImpact);
    Vector3d point = Vector3d::Zero();
    for (int i = 0; i < 3; ++i) point += c.weights[i] * x[i];
    EXPECT_LE((point - c.point).norm(), 1e-12);
    EXPECT_NEAR(c.normal.norm(), 1, 1e-12);
    EXPECT_GT(c.weights.head(static_cast<int>(c.element) + 1).minCoeff(), 0);
    const double centres = c.distance + body.geometry.radii[0];
    EXPECT_LE((c.point - centres * c.normal - c.pointOnShape).norm(), 1e-12);
    EXPECT_LE(distanceAt(tool, faces, x, c.timeOfImpact), distance + early) << c.timeOfImpact;
    if (c.timeOfImpact == 0) continue;
    EXPECT_LE(std::abs(centres - distance), early);
    EXPECT_LE(distanceAt(tool, faces, {c.point, c.point, c.point}, c.timeOfImpact),
              centres + early);
  }
  for (const auto& [element, corners] : body.elements()) {
    // Distances grow no faster than the geometries move: up to there, or a small step further.
    const auto gap = [&, &corners = corners](double t) {
      return distanceAt(tool, faces, body.at(corners, t), t) - distance;
    };
    double low = 0, high = 0, left = gap(0);
    while (left > 0 && high < 1) {
      low = high;
      high = std::min(1.0, high + std::max(left / (2 * motion), 1.0 / 64));
      left = gap(high);
    }
    if (left > 0) continue;
    for (int i = 0; i < 50 && high > low; ++i) {
      const double middle = 0.5 * (low + high);
      (gap(middle) <= 0 ? high : low) = middle;
    }
    double first = kInfinity;
    for (const ShapeContact& c : data.shape())
      if (holds(corners, c.vertices)) first = std::min(first, c.timeOfImpact);
    EXPECT_LE(first, high + 1e-13) << static_cast<int>(element) << " of " << tool.geometry.index();
  }
  return tally;
}

Moving movingBody(Random& random, int type, double radius) {
  Moving body;
  body.geometry.type = static_cast<GeometryType>(type);
  body.geometry.radii = {radius};
  Vector3d push;  // past the middle
  const auto add = [&](const Vector3d& p) {
    body.geometry.positions.push_back(p);
    body.now.push_back(p + push + randomPoint(random, -0.3, 0.3));
    return static_cast<std::uint32_t>(body.now.size() - 1);
  };
  for (int i = 0; i < 3; ++i) {
    const Vector3d p = randomPoint(random, -1, 1);
    push = -1.6 * p;
    const std::uint32_t a = add(p);
    if (type == 2) continue;
    const std::uint32_t b = add(p + randomPoint(random, -0.6, 0.6));
    if (type == 1) body.geometry.segments.push_back({a, b});
    if (type == 0) body.geometry.triangles.push_back({a, b, add(p + randomPoint(random, -.6, .6))});
  }
  return body;
}

TEST(ShapeSteps, TimesAreNeverLateAndEarlyByTheToleranceAtMost) {
  Random random(1);
  std::size_t number = 0, contacts = 0, within = 0;
  for (int run = 0; run < 4; ++run)
    for (const int kind : {0, 1, 2}) {
      const Moving body = movingBody(random, kind, kind == 0 || run % 2 ? 0.0 : 0.02);
      for (const AnalyticalGeometry& geometry : shapesOfEveryKind(random)) {
        if (isLeftOut(number++, 5)) continue;
        Tool tool{geometry, {}};
        tool.ends[0] = {randomTurn(random), randomPoint(random, -0.3, 0.3)};
        tool.ends[1] = tool.ends[0];
        if (run % 3 > 0) tool.ends[1].translation += randomPoint(random, -0.5, 0.5);
        if (run % 3 > 1) {
          const double angle = uniform(random, 0, 3);
          tool.ends[1].rotation =
              Eigen::AngleAxisd(angle, randomPoint(random, -1, 1).normalized()) *
              tool.ends[1].rotation;
        }
        SCOPED_TRACE("run " + std::to_string(run) + ", shape " + std::to_string(geometry.index()));
        PairSettings pair = continuous(run % 4 < 2 ? 0.0 : 0.03, run % 5 ? 1e-6 : 1e-3);
        pair.contacts = Contacts::All;
        const CollisionData all = answer(settingsOf(Engine::Octree), body, tool, pair);
        const Tally tally = expectTrue(all, body, tool, pair);
        contacts += tally.contacts;
        within += tally.within;
        pair.continuous.earliestTimeOnly = true;
        const CollisionData only = answer(settingsOf(Engine::Octree), body, tool, pair);
        EXPECT_TRUE(only.shape().empty());
        EXPECT_EQ(only.earliestTimeOfImpact(), all.earliestTimeOfImpact());
      }
    }
  EXPECT_GE(contacts, leastOf(50, 10));
  EXPECT_GE(within, leastOf(25, 5));
}

// ---- Hand-computed contacts ----

Moving still(const TestGeometry& geometry) { return {geometry, geometry.positions}; }

TestGeometry triangleAtZero() {
  return {GeometryType::Triangles, {{-8, -8, 0}, {8, -8, 0}, {0, 8, 0}}, {{0, 1, 2}}, {}};
}

Tool moving(const AnalyticalGeometry& geometry, const Vector3d& from, const Vector3d& to) {
  const Matrix3d one = Matrix3d::Identity();
  return {geometry, {{{one, from}, {one, to}}}};
}

/// The one contact.
ShapeContact only(const Moving& body, const Tool& tool, double thickness) {
  const CollisionData data = answer(settingsOf(Engine::Octree), body, tool, continuous(thickness));
  EXPECT_EQ(data.shape().size(), 1u);
  return data.shape().empty() ? ShapeContact{} : data.shape()[0];
}

TEST(ShapeSteps, FastShapesDoNotTunnel) {
  const Moving sheet = still(triangleAtZero());
  const Vector3d above(0, -2, 10), below(0, -2, -10), up = Vector3d::UnitZ();
  for (const auto& [geometry, reach] : std::vector<std::pair<AnalyticalGeometry, double>>{
           {Sphere{{0, 0, 0}, 0.5}, 0.5},
           {Sphere{{0, 0, 0}, 0}, 0},
           {Capsule{{0, 0, 0}, {0.5, 0, 1}, 0.25}, 0.25},
           {Capsule{{0, 0, 0}, {0.5, 0, 1}, 0}, 0},
           {ConvexHull{{{0, 0, 0}, {1, 0, 2}, {-1, 0, 2}, {0, 1, 2}}}, 0}})
    for (const double thickness : {0.0, 0.25}) {
      const ShapeContact c = only(sheet, moving(geometry, above, below), thickness);
      EXPECT_EQ(c.element, ShapeElement::Face);
      EXPECT_NEAR(c.timeOfImpact, (10 - reach - thickness) / 20, 1.1e-6);
      EXPECT_LE(c.timeOfImpact, (10 - reach - thickness) / 20);
      EXPECT_NEAR(c.distance, thickness, 3e-5);
      EXPECT_NEAR((c.normal + up).norm(), 0, 1e-12);
      EXPECT_NEAR((c.point - Vector3d(0, -2, 0)).norm(), 0, 1e-12);
    }
  // The flat face of a box meets the triangle. Any of its corners may be named.
  const ShapeContact flat = only(sheet, moving(Box{{0, 0, 0}, {1, 1, 0.5}}, above, below), 0);
  EXPECT_EQ(flat.element, ShapeElement::Face);
  EXPECT_NEAR(flat.timeOfImpact, 0.475, 1e-6);
}

/// One moving point.
Moving particle(const Vector3d& from, const Vector3d& to) {
  return {{GeometryType::Points, {from}, {}, {}}, {to}};
}

TEST(ShapeSteps, PlanesFindWhatFallsThroughThem) {
  const Tool floor = moving(Plane{}, {0, 0, -1}, {0, 0, 1}),
             sheet = moving(Plane{{0, 0, 0}, {0, 0, 1}, true}, {0, 0, -1}, {0, 0, 1});
  for (const double thickness : {0.0, 0.5})
    for (const Tool& tool : {floor, sheet}) {
      const ShapeContact c = only(particle({3, 4, 9}, {5, 4, -9}), tool, thickness);
      const double time = (10 - thickness) / 20;
      EXPECT_LE(c.timeOfImpact, time);
      EXPECT_NEAR(c.timeOfImpact, time, 1e-6);
      EXPECT_NEAR(c.distance, thickness, 3e-5);
      EXPECT_EQ(c.normal, Vector3d::UnitZ());
      EXPECT_NEAR((c.point - Vector3d(3 + 2 * time, 4, 9 - 18 * time)).norm(), 0, 3e-5);
    }
  const ShapeContact below = only(particle({3, 4, -9}, {5, 4, 9}), sheet, 0);
  EXPECT_LE(below.timeOfImpact, 0.5);
  EXPECT_NEAR(below.timeOfImpact, 0.5, 1e-6);
  EXPECT_EQ(below.normal, -Vector3d::UnitZ());
  EXPECT_EQ(only(particle({3, 4, -9}, {5, 4, 9}), floor, 0).timeOfImpact, 0);  // it was inside
  // A two-sided plane through which two of a triangle's edges pass before the step.
  const TestGeometry up{
      GeometryType::Triangles, {{0, 0, -2}, {1, 0, 2}, {0, 1, 2}}, {{0, 1, 2}}, {}};
  const CollisionData data = answer(settingsOf(Engine::Octree), still(up), sheet, continuous(0));
  ASSERT_EQ(data.shape().size(), 2u);
  for (const ShapeContact& c : data.shape()) {
    EXPECT_EQ(c.element, ShapeElement::Edge);
    EXPECT_EQ(c.timeOfImpact, 0);
  }
}

TEST(ShapeSteps, TouchesAtTheStartAndTheEndCount) {
  const auto touches = [](const AnalyticalGeometry& geometry, double thickness, const Vector3d& at,
                          const Vector3d& from) {
    const Tool still = moving(geometry, {0, 0, 0}, {0, 0, 0});
    EXPECT_EQ(only(particle(at, at), still, thickness).timeOfImpact, 0);
    EXPECT_EQ(only(particle(at, from), still, thickness).timeOfImpact, 0);
    const double last = only(particle(from, at), still, thickness).timeOfImpact;
    EXPECT_LE(last, 1);
    EXPECT_NEAR(last, 1, 1e-6);
    const Vector3d past = from + (1 + 1e-3) * (at - from), before = from + 0.999 * (at - from);
    EXPECT_NEAR(only(particle(from, past), still, thickness).timeOfImpact, 1 / 1.001, 1e-6);
    for (const Vector3d& end : {from, before}) {
      const CollisionData none =
          answer(settingsOf(Engine::Octree), particle(from, end), still, continuous(thickness));
      EXPECT_TRUE(none.shape().empty());
      EXPECT_EQ(none.earliestTimeOfImpact(), kInfinity);
      EXPECT_TRUE(none.validity().trusted);
    }
  };
  for (const double thickness : {0.0, 0.25}) {
    const Vector3d z(0, 0, thickness);
    touches(Sphere{{0, 0, 0}, 0.5}, thickness, Vector3d(0, 0, 0.5) + z, {0, 1, 8});
    touches(Plane{}, thickness, z, {5, 5, 3});
    touches(Plane{{0, 0, 0}, {0, 0, 2}, true}, thickness, -z, {5, 5, -3});
    const Cylinder can{{0, 0, -2}, {0, 0, 2}, 1};
    touches(can, thickness, Vector3d(0, 1 + thickness, 0), {5, 5, 3});
    touches(can, thickness, Vector3d(0.5, 0, 2) + z, {5, 5, 3});
    touches(can, thickness, Vector3d(0, 1 + 0.6 * thickness, 2 + 0.8 * thickness), {0, 5, 8});
  }
}

/// Past the rim at little more than the distance, and along a plane and the side of a cylinder.
TEST(ShapeSteps, NearMissesAreNoContacts) {
  const Tool can = moving(Cylinder{{0, 0, -2}, {0, 0, 2}, 1}, {0, 0, 0}, {0, 0, 0});
  const auto count = [](const Vector3d& from, const Vector3d& to, const Tool& tool,
                        double thickness) {
    return answer(settingsOf(Engine::Octree), particle(from, to), tool, continuous(thickness))
        .shape()
        .size();
  };
  for (const double gap : {1e-2, 1e-4, -1e-4}) {
    const double c = std::sqrt(0.5), reach = 0.5 + gap;
    const Vector3d rim(0, 1 + reach * c, 2 + reach * c), along(0, 4, -4);
    EXPECT_EQ(count(rim - along, rim + along, can, 0.5), gap < 0) << gap;
    const Vector3d side(0, 1 + gap, -1), up(0, 0, 2);
    EXPECT_EQ(count(side, side + up, can, 0), gap < 0) << gap;
    EXPECT_EQ(count({-9, 0, gap}, {9, 0, gap}, moving(Plane{}, {0, 0, 0}, {3, 0, 0}), 0), gap < 0);
  }
}

/// A shape turned over in one step has no extent at half time. No impact is late because of that.
TEST(ShapeSteps, HalfTurnsHaveNoFalseNegatives) {
  Tool over = moving(Plane{}, {0, 0, 0}, {0, 0, 0});
  over.ends[1].rotation = Eigen::DiagonalMatrix<double, 3>(1, -1, -1);
  const ShapeContact c = only(particle({0, 3, 1}, {0, 3, 1}), over, 0);
  EXPECT_LE(c.timeOfImpact, 0.5);
  EXPECT_TRUE(c.point.allFinite() && c.normal.allFinite() && c.pointOnShape.allFinite());
  Tool can = moving(Cylinder{{0, 0, -2}, {0, 0, 2}, 0.5}, {0, 0, 0}, {0, 0, 0});
  can.ends[1].rotation = over.ends[1].rotation;
  EXPECT_TRUE(
      answer(settingsOf(Engine::Octree), particle({0, 3, 1}, {0, 3, 1}), can, continuous(0.5))
          .shape()
          .empty());
  EXPECT_NEAR(only(particle({0, 0.75, 0}, {0, 0.25, 0}), can, 0).timeOfImpact, 0.5, 1e-6);
}

/// Features touch within roundings of their size. Boxes of elements allow as much.
TEST(ShapeSteps, OctreesFindWhatTouchesWithinRoundings) {
  const std::array<AnalyticalGeometry, 5> shapes{
      Plane{.twoSided = true}, Plane{}, Box{{0, 0, -1}, {1, 1, 1}},
      Cylinder{{0, 0, -2}, {0, 0, 0}, 1},
      ConvexHull{Positions{{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}, {0, 0, -1}}}};
  std::size_t touching = 0, apart = 0;
  for (const AnalyticalGeometry& shape : shapes)
    for (const double way : {0.0, 100.0})
      for (int i = 1; i < 64; ++i) {
        const double gap = std::ldexp(way > 0 ? 0.5 * way * i : 1.0 * i, -48);
        const Positions now{{1, 0, gap}, {0, 0, gap}, {0, 1, gap}};
        Positions before = now;
        for (Vector3d& p : before) p[0] += way;
        const auto contactsBy = [&](Engine engine) {
          OctreeBasedCD detection(settingsOf(engine));
          const GeometryId mesh = detection.addTriangleMesh(now, std::vector<Triangle>{{0, 1, 2}}),
                           tool = detection.addAnalyticalGeometry(shape);
          detection.addCollisionPair(mesh, tool,
                                     {.method = Method::Continuous, .contacts = Contacts::All});
          detection.setPositions(mesh, before, now);
          detection.detectCollision();
          return detection.collisionData(mesh, tool).shape().size();
        };
        const std::size_t truth = contactsBy(Engine::BruteForce);
        EXPECT_EQ(contactsBy(Engine::Octree), truth) << "gap " << gap << ", way " << way;
        ++(truth > 0 ? touching : apart);
      }
  EXPECT_GT(touching, 20u);
  EXPECT_GT(apart, 20u);
}

}  // namespace
}  // namespace palpate::testing
