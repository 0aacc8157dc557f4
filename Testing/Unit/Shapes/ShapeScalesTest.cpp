#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Common/StepBodies.h"
#include "Common/TestGeometry.h"
#include "Shapes/Shape.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

// Shapes of any size: a scene scaled by a power of two has the scaled contacts. Squares of its
// lengths leave the range of double at most of these scales.

namespace palpate::testing {
namespace {

constexpr double kDenormal = std::numeric_limits<double>::denorm_min();
/// The largest length of these scenes is 4. Scaled, it is near the limit of 1e300 = 2^996.6,
/// or its last bits are near the end of the range of double.
constexpr int kScales[] = {994, 900, 530, 512, 380, 250, -250, -380, -512, -530, -900, -1022};

AnalyticalGeometry scaled(AnalyticalGeometry geometry, double by) {
  forEachField(geometry, [&](const std::string& name, auto& field) {
    using Field = std::decay_t<decltype(field)>;
    if constexpr (std::is_same_v<Field, std::vector<Vector3d>>) {
      for (Vector3d& p : field) p *= by;
    } else if constexpr (!std::is_same_v<Field, bool>) {
      if (name != "normal") field *= by;
    }
  });
  return geometry;
}

/// A shape and a geometry with elements, or two shapes, in one step.
struct Scene {
  AnalyticalGeometry shape;
  std::array<Pose, 2> ends;
  std::optional<AnalyticalGeometry> other{};
  std::array<Pose, 2> otherEnds{};
  TestGeometry geometry{};
  Positions now{};

  Scene scaledBy(double by) const {
    Scene scene = *this;
    scene.shape = scaled(shape, by);
    if (other) scene.other = scaled(*other, by);
    for (auto* moves : {&scene.ends, &scene.otherEnds})
      for (Pose& move : *moves) move.translation *= by;
    for (auto* list : {&scene.geometry.positions, &scene.now})
      for (Vector3d& p : *list) p *= by;
    for (double& radius : scene.geometry.radii) radius *= by;
    return scene;
  }

  CollisionData answer(const PairSettings& pair) const {
    const auto moving = [](const AnalyticalGeometry& tool, const std::array<Pose, 2>& poses) {
      return shapeOf("shape", tool, poses[0], poses[1]);
    };
    return stepOf(settingsOf(Engine::Octree), moving(shape, ends),
                  other ? moving(*other, otherEnds) : bodyOf("elements", geometry, now), pair);
  }
};

/// All but those that are a point or so thin that nothing is measured at their ends.
std::vector<AnalyticalGeometry> measuredShapes() {
  Random random(4);
  std::vector<AnalyticalGeometry> all = shapesOfEveryKind(random);
  all.pop_back();
  return all;
}

std::array<Pose, 2> randomMoves(Random& random) {
  std::array<Pose, 2> ends;
  ends[0] = {randomTurn(random), randomPoint(random, -0.3, 0.3)};
  ends[1] = {randomTurn(random), randomPoint(random, -0.3, 0.3)};
  return ends;
}

TestGeometry elements(Random& random, int type) {
  TestGeometry geometry;
  geometry.type = static_cast<GeometryType>(type);
  if (type > 0) geometry.radii = {0.01};
  for (std::uint32_t i = 0; i < 20; ++i) {
    const Vector3d p = randomPoint(random, -0.7, 0.7);
    geometry.positions.push_back(p);
    if (type < 2) geometry.positions.push_back(p + randomPoint(random, -0.4, 0.4));
    if (type == 0) geometry.positions.push_back(p + randomPoint(random, -0.4, 0.4));
    if (type == 0) geometry.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    if (type == 1) geometry.segments.push_back({2 * i, 2 * i + 1});
  }
  return geometry;
}

using Element = std::array<std::uint32_t, 3>;
std::map<Element, ShapeContact> byElement(const CollisionData& data) {
  std::map<Element, ShapeContact> contacts;
  for (const ShapeContact& c : data.shape())
    contacts.emplace(Element{static_cast<std::uint32_t>(c.element), c.id, c.vertices[1]}, c);
  return contacts;
}

/// The contacts that may be missing: those at the border of being one.
bool isMarginal(const ShapeContact& c, const PairSettings& pair) {
  const double weight = c.weights.head(static_cast<int>(c.element) + 1).minCoeff();
  return weight < 1e-6 || c.timeOfImpact > 1 - 1e-5 ||
         (pair.method == Method::Proximity && pair.thickness - c.distance < 1e-9);
}

/// The disjoint part of a geometry that a contact is of.
std::uint32_t partOf(const Scene& scene, const ShapeContact& c) {
  return c.vertices[0] / (3 - static_cast<std::uint32_t>(scene.geometry.type));
}

/// Whatever Contacts::Distinct leaves out, each part keeps its first contact, and with Proximity
/// the nearest one. slack: L.
void expectFirstOfParts(const Scene& scene, const CollisionData& all, const CollisionData& distinct,
                        const PairSettings& pair, double slack) {
  const auto firstOf = [&](const CollisionData& data) {
    std::map<std::uint32_t, double> first;
    for (const ShapeContact& c : data.shape()) {
      const double value = pair.method == Method::Continuous ? c.timeOfImpact : c.distance;
      const auto [entry, isNew] = first.try_emplace(partOf(scene, c), value);
      if (!isNew) entry->second = std::min(entry->second, value);
    }
    return first;
  };
  const auto kept = firstOf(distinct);
  for (const auto& [part, value] : firstOf(all)) {
    const auto found = kept.find(part);
    ASSERT_NE(found, kept.end()) << part;
    EXPECT_LE(found->second,
              value + (pair.method == Method::Continuous ? pair.continuous.timeTolerance : slack));
  }
}

/// Contacts of a scene and of its copy, `by` times as large.
/// extent: L, of coordinates.
std::size_t expectSame(const Scene& scene, const PairSettings& pair, double by, double extent = 1) {
  // Lengths below the resolution of the smaller scene are in neither.
  const Scene copy = scene.scaledBy(by), original = copy.scaledBy(1 / by);
  PairSettings there = pair, distinctHere = pair, distinctThere;
  there.thickness *= by;
  distinctThere = there;
  distinctHere.contacts = distinctThere.contacts = Contacts::Distinct;
  const CollisionData here = original.answer(pair), found = copy.answer(there);
  const bool step = pair.method == Method::Continuous;
  const double slack = (step ? 1e-5 : 1e-12) * extent + 100 * (kDenormal / by);
  const auto near = [&](const Vector3d& small, const Vector3d& large) {
    EXPECT_LE((small - large / by).cwiseAbs().maxCoeff(), slack);
  };
  expectFirstOfParts(scene, here, original.answer(distinctHere), pair, slack);
  expectFirstOfParts(scene, found, copy.answer(distinctThere), pair, slack * by);
  for (const auto& [ours, theirs] : {std::pair{&here, &found}, {&found, &here}}) {
    const auto others = byElement(*theirs);
    for (const auto& [element, c] : byElement(*ours)) {
      ShapeContact atOne = c;
      if (ours == &found) atOne.distance /= by;
      EXPECT_TRUE(others.contains(element) || isMarginal(atOne, pair)) << "element " << element[0];
    }
  }
  const auto contacts = byElement(found);
  for (const auto& [element, c] : byElement(here)) {
    const auto other = contacts.find(element);
    if (other == contacts.end()) continue;
    const ShapeContact& f = other->second;
    EXPECT_NEAR(f.distance / by, c.distance, slack);
    EXPECT_NEAR(f.timeOfImpact, c.timeOfImpact, 3e-6);
    EXPECT_NEAR(f.normal.norm(), 1, 1e-13);
    // Inside, several points of a triangle may be equally deep, and several directions equally
    // short.
    if (c.distance < 1e-3) continue;
    EXPECT_NEAR((f.normal - c.normal).norm(), 0, 1e3 * slack);
    near(c.point, f.point);
    near(c.pointOnShape, f.pointOnShape);
  }
  EXPECT_EQ(found.shapeShape().size(), here.shapeShape().size());
  if (here.shapeShape().size() == 1 && found.shapeShape().size() == 1) {
    const ShapeShapeContact &c = here.shapeShape()[0], &f = found.shapeShape()[0];
    EXPECT_NEAR(f.distance / by, c.distance, slack);
    EXPECT_NEAR(f.timeOfImpact, c.timeOfImpact, 3e-6);
    EXPECT_NEAR(f.normal.norm(), 1, 1e-13);
  }
  return here.shape().size() + here.shapeShape().size();
}

PairSettings settingsWith(Method method, double thickness) {
  return {method, thickness, Contacts::All};
}

TEST(ShapeScales, ContactsWithElementsAreCorrectAtAnySize) {
  Random random(1);
  std::array<std::size_t, 2> contacts{};
  std::size_t number = 0;
  const std::vector<AnalyticalGeometry> shapes = measuredShapes();
  for (std::size_t s = 0; s < shapes.size(); ++s)
    for (const int type : {0, 1, 2})
      for (const Method method : {Method::Proximity, Method::Continuous}) {
        const TestGeometry geometry = elements(random, type);
        Scene scene{shapes[s], randomMoves(random)};
        scene.geometry = geometry;
        scene.now = moved(random, geometry.positions, 0.3);
        for (const int scale : kScales) {
          if (isLeftOut(number++)) continue;
          SCOPED_TRACE("shape " + std::to_string(s) + " by 2^" + std::to_string(scale) +
                       ", method " + std::to_string(static_cast<int>(method)) + ", type " +
                       std::to_string(type));
          contacts[method == Method::Continuous] +=
              expectSame(scene, settingsWith(method, 0.02), std::ldexp(1, scale));
        }
      }
  EXPECT_GE(contacts[0], leastOf(1000));
  EXPECT_GE(contacts[1], leastOf(1000));
}

TEST(ShapeScales, ContactsBetweenShapesAreCorrectAtAnySize) {
  Random random(2);
  const std::vector<AnalyticalGeometry> shapes = measuredShapes();
  std::size_t contacts = 0, number = 0;
  for (std::size_t i = 0; i < shapes.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      if (std::holds_alternative<Plane>(shapes[i]) && std::holds_alternative<Plane>(shapes[j]))
        continue;
      const Scene scene{shapes[i], randomMoves(random), shapes[j], randomMoves(random)};
      for (const int scale : kScales)
        for (const Method method : {Method::Proximity, Method::Continuous}) {
          if (isLeftOut(number++)) continue;
          SCOPED_TRACE("shapes " + std::to_string(i) + " and " + std::to_string(j) + " by 2^" +
                       std::to_string(scale) + ", method " +
                       std::to_string(static_cast<int>(method)));
          const double thickness = method == Method::Proximity ? 4 : 0.02;
          contacts += expectSame(scene, settingsWith(method, thickness), std::ldexp(1, scale));
        }
    }
  EXPECT_GE(contacts, leastOf(700));
}

/// Placed 2^996 from the origin, where the last bit of a coordinate is 2^944.
TEST(ShapeScales, ContactsAreCorrectFarFromTheOrigin) {
  Random random(3);
  std::size_t contacts = 0;
  for (const AnalyticalGeometry& shape : measuredShapes())
    for (const int type : {0, 1, 2}) {
      Scene scene{shape, randomMoves(random)};
      scene.geometry = elements(random, type);
      const Vector3d far(0x1p20, -0x1p19, 0x1p18);
      for (Pose& end : scene.ends) end.translation += far;
      for (Vector3d& p : scene.geometry.positions) p += far;
      scene.now = moved(random, scene.geometry.positions, 0.3);
      // Coordinates are rounded to 2^-32 of the lengths here.
      contacts += expectSame(scene, settingsWith(Method::Proximity, 0.02), 0x1p975, 0x1p20);
    }
  EXPECT_GT(contacts, 50u);
}

/// Normals of planes may have any length, and the half-length of a capsule may overflow when
/// squared.
TEST(ShapeScales, LengthsMayBeAnywhereInTheRangeOfDouble) {
  const auto expectDistance = [](const AnalyticalGeometry& shape, const Vector3d& point,
                                 double distance, double thickness) {
    const CollisionData data =
        stepOf(settingsOf(Engine::Octree),
               bodyOf("point", {GeometryType::Points, {point}, {}, {}}, {point}),
               shapeOf("shape", shape, {}, {}), {Method::Proximity, thickness});
    ASSERT_EQ(data.shape().size(), 1u) << thickness;
    EXPECT_NEAR(data.shape()[0].distance / thickness, distance / thickness, 1e-13) << thickness;
    EXPECT_NEAR(data.shape()[0].normal.norm(), 1, 1e-15);
  };
  for (const double length : {0x1p1023, 0x1p600, 0x1p-600, 0x1p-1060, 0x1p-1074})
    expectDistance(Plane{{0, 0, 0}, {0, length, length}}, {0, 1, 1}, std::sqrt(2.0), 2.0);
  for (const double half : {1e155, 1e160, 1e-160, 1e-300, 1e-308}) {
    const Capsule capsule{{-half, 0, 0}, {half, 0, 0}, 0.5 * half};
    expectDistance(capsule, {0, 0.25 * half, 0}, -0.25 * half, 0.5 * half);
    expectDistance(capsule, {0.5 * half, 0, 0.75 * half}, 0.25 * half, 0.5 * half);
  }
}

/// Just inside the limit, the other tests of this file expect correct contacts.
TEST(ShapeScales, SizesBeyondTheLimitAreRefused) {
  const double most = 1e300, beyond = std::nextafter(most, 2 * most);
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  const auto tryBoth = [&](const std::string& name, auto&& shapeOf) {
    EXPECT_NO_THROW(collisions.removeGeometry(collisions.addAnalyticalGeometry(shapeOf(most))));
    EXPECT_NO_THROW(collisions.removeGeometry(collisions.addAnalyticalGeometry(shapeOf(0.0))));
    expectRefused(ErrorCode::InvalidShape, ": " + name + " is ",
                  [&] { collisions.addAnalyticalGeometry(shapeOf(beyond)); });
    expectRefused(ErrorCode::InvalidShape, "at most 1e+300 in magnitude",
                  [&] { collisions.addAnalyticalGeometry(shapeOf(beyond)); });
  };
  tryBoth("radius", [](double x) { return Sphere{{0, 0, 0}, x}; });
  tryBoth("centre", [](double x) { return Sphere{{0, -x, 0}, 1}; });
  tryBoth("radius", [](double x) { return Capsule{{0, 0, 0}, {0, 0, 1}, x}; });
  tryBoth("p0", [](double x) { return Capsule{{-x, 0, 0}, {0, 0, 1}, 1}; });
  tryBoth("p1", [](double x) { return Capsule{{0, 0, 0}, {0, 0, x}, 1}; });
  tryBoth("point", [](double x) { return Plane{{0, 0, x}}; });
  tryBoth("centre", [](double x) { return Box{{0, 0, x}, {1, 1, 1}}; });
  tryBoth("halfExtents", [](double x) { return Box{{0, 0, 0}, {1, x, 1}}; });
  tryBoth("radius", [](double x) { return Cylinder{{0, 0, 0}, {0, 0, 1}, x}; });
  tryBoth("p0", [](double x) { return Cylinder{{x, 0, 0}, {0, 0, 1}, 1}; });
  tryBoth("p1", [](double x) { return Cylinder{{0, 0, 0}, {0, 1, x}, 1}; });
  tryBoth("point 1", [](double x) { return ConvexHull{{{0, 0, 0}, {0, -x, 1}}}; });
  EXPECT_NO_THROW(collisions.addAnalyticalGeometry(Plane{{0, 0, 0}, {0, 0, beyond}}));
}

TEST(ShapeScales, HullsOfTooManyPointsAreRefused) {
  ConvexHull hull{Positions(kMaxHullPoints, Vector3d(1, 2, 3))};
  hull.points.front() = {0, 0, 0};
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  EXPECT_NO_THROW(collisions.addAnalyticalGeometry(hull));
  hull.points.push_back({0, 0, 0});
  expectRefused(ErrorCode::InvalidShape, "131073 points; it must have at most 131072",
                [&] { collisions.addAnalyticalGeometry(hull); });
}

}  // namespace
}  // namespace palpate::testing
