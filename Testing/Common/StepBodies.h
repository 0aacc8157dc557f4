#pragma once

#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ContactRows.h"
#include "Common/PairRun.h"
#include "Common/Solids.h"
#include "Common/TestGeometry.h"

#include <Eigen/Geometry>

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

/// Geometries of every type with their steps, and one step of two of them.
namespace palpate::testing {

struct StepBody {
  std::string name;
  GeometryType type;
  std::function<GeometryId(OctreeBasedCD&)> add;
  std::function<void(OctreeBasedCD&, GeometryId)> move;  ///< sets both ends of the step
  Positions before{}, now{};                             ///< in the world; none of a shape
  std::vector<double> radii{};
  bool hasField = false;
};

inline StepBody bodyOf(std::string name, const TestGeometry& geometry, const Positions& now) {
  return {std::move(name),
          geometry.type,
          [geometry](OctreeBasedCD& collisions) { return geometry.addTo(collisions); },
          [before = geometry.positions, now](OctreeBasedCD& collisions, GeometryId id) {
            collisions.setPositions(id, before, now);
          },
          geometry.positions,
          now,
          geometry.radii};
}

/// The same as a placed body: its frame is turned and shifted, and turns further in the step.
inline StepBody placed(std::string name, const TestGeometry& geometry, double angle,
                       const Vector3d& shift) {
  using Turn = Eigen::AngleAxisd;
  const Vector3d axis = Vector3d(1, 2, 3).normalized(), centre(0.5, 0.5, 0.5);
  const std::array<Eigen::Matrix3d, 2> turns{Turn(0.3, axis).toRotationMatrix(),
                                             Turn(0.3 + angle, axis).toRotationMatrix()};
  const std::array<Vector3d, 2> shifts{centre - turns[0] * centre,
                                       centre - turns[1] * centre + shift};
  StepBody body = bodyOf(std::move(name), geometry, {});
  body.before.clear();
  for (const Vector3d& x : geometry.positions) {
    body.before.push_back(turns[0] * x + shifts[0]);
    body.now.push_back(turns[1] * x + shifts[1]);
  }
  body.move = [=](OctreeBasedCD& collisions, GeometryId id) {
    collisions.setTransform(id, {turns[0], shifts[0]}, {turns[1], shifts[1]});
  };
  return body;
}

inline StepBody shapeOf(std::string name, const AnalyticalGeometry& shape, const Pose& before,
                        const Pose& now) {
  return {std::move(name), GeometryType::Shape,
          [shape](OctreeBasedCD& collisions) { return collisions.addAnalyticalGeometry(shape); },
          [before, now](OctreeBasedCD& collisions, GeometryId id) {
            collisions.setTransform(id, before, now);
          }};
}

inline StepBody shapeOf(std::string name, const AnalyticalGeometry& shape, const Vector3d& motion) {
  return shapeOf(std::move(name), shape, Pose{}, Pose{Eigen::Matrix3d::Identity(), motion});
}

/// Every geometry type but fields in the unit cube, with steps of about `motion`.
inline std::vector<StepBody> bodiesOfEveryType(Random& random, double motion) {
  const TestGeometry triangles = testGeometry(soup(random, 60, 0.15)),
                     sheets = testGeometry(sheet(6, 0.5, 0.3)),
                     line = thread(random, 40, 0.15, 0.02, false),
                     points = particles(random, 50, 0.03);
  const TestGeometry taperedLine = tapered(random, line, 0.05),
                     taperedPoints = tapered(random, points, 0.05);
  Solid block = cells(2, random);
  for (Vector3d& x : block.positions) x = 0.25 * x + Vector3d(0.3, 0.25, 0.27);
  TestGeometry surface;
  surface.positions = block.positions;
  StepBody solid = bodyOf("tetrahedra", surface, moved(random, block.positions, motion));
  solid.add = [block](OctreeBasedCD& collisions) {
    return collisions.addTetrahedralMesh(block.positions, block.tetrahedra);
  };
  std::vector<StepBody> all;
  const auto add = [&](std::string name, const TestGeometry& geometry) {
    all.push_back(bodyOf(std::move(name), geometry, moved(random, geometry.positions, motion)));
  };
  add("triangles", triangles);
  add("sheet", sheets);
  all.push_back(placed("placed triangles", triangles, motion, Vector3d::Constant(motion)));
  all.push_back(solid);
  add("line", line);
  add("tapered line", taperedLine);
  add("points", points);
  all.push_back(placed("placed points", points, motion, Vector3d::Constant(-motion)));
  add("tapered points", taperedPoints);
  const Vector3d way(motion, 0, -motion);
  all.push_back(shapeOf("sphere", Sphere{{0.5, 0.5, 0.5}, 0.2}, way));
  all.push_back(shapeOf("capsule", Capsule{{0.3, 0.4, 0.5}, {0.7, 0.5, 0.6}, 0.1}, way));
  all.push_back(shapeOf("plane", Plane{{0.5, 0.5, 0.5}, {0.3, 0.1, 1}}, way));
  all.push_back(shapeOf("two-sided plane", Plane{{0.5, 0.5, 0.5}, {0.3, 0.1, 1}, true}, way));
  all.push_back(shapeOf("box", Box{{0.5, 0.5, 0.5}, {0.2, 0.1, 0.15}}, way));
  all.push_back(shapeOf("cylinder", Cylinder{{0.3, 0.4, 0.5}, {0.7, 0.5, 0.6}, 0.1}, way));
  all.push_back(shapeOf(
      "hull", ConvexHull{{{0.3, 0.3, 0.3}, {0.7, 0.4, 0.3}, {0.5, 0.7, 0.4}, {0.5, 0.5, 0.8}}},
      way));
  return all;
}

/// A distance field that moves by `motion`, as a geometry and attached to its mesh.
inline std::vector<StepBody> bodiesWithField(const Vector3d& motion) {
  const Mesh mesh = sphere(8, 12, {0.5, 0.5, 0.5}, 0.3);
  const auto field = std::make_shared<const DistanceField>(DistanceField::build(
      {mesh.positions, mesh.triangles}, {.errorBound = 0.01, .band = 0.3, .threads = 1}));
  StepBody alone = shapeOf("field", Sphere{}, motion);
  alone.type = GeometryType::Field;
  alone.add = [field](OctreeBasedCD& collisions) { return collisions.addDistanceField(field); };
  StepBody attached = alone;
  attached.name = "mesh with a field";
  attached.type = GeometryType::Triangles;
  attached.add = [field, mesh](OctreeBasedCD& collisions) {
    const GeometryId id = collisions.addTriangleMesh(mesh.positions, mesh.triangles);
    collisions.attachDistanceField(id, field);
    return id;
  };
  alone.hasField = attached.hasField = true;
  return {alone, attached};
}

/// The contacts of one step of two bodies, or of a body with itself.
inline CollisionData stepOf(const Settings& settings, const StepBody& a, const StepBody& b,
                            const PairSettings& pair) {
  OctreeBasedCD collisions(settings);
  const GeometryId first = a.add(collisions), second = &a == &b ? first : b.add(collisions);
  collisions.addCollisionPair(first, second, pair);
  a.move(collisions, first);
  if (first != second) b.move(collisions, second);
  collisions.detectCollision();
  EXPECT_EQ(collisions.octree().validate(), std::vector<std::string>{});
  return collisions.collisionData(first, second);
}

/// Expects the step of brute force, bit by bit, from octrees with any number of threads. Returns
/// it.
inline CollisionData expectEveryEngine(const StepBody& a, const StepBody& b,
                                       const PairSettings& pair) {
  const CollisionData truth = stepOf(settingsOf(Engine::BruteForce), a, b, pair);
  for (const Settings& settings : octreeSettings()) {
    SCOPED_TRACE(nameOf(settings));
    const CollisionData found = stepOf(settings, a, b, pair);
    expectSameContacts(found, truth);
    EXPECT_EQ(found.hash(), truth.hash());
    EXPECT_EQ(found.validity(), truth.validity());
  }
  return truth;
}

}  // namespace palpate::testing
