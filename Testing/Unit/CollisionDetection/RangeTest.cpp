#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"

#include <cmath>
#include <functional>

// The range of lengths: every call takes kLargestMeasure, and refuses the next double by name.

namespace palpate {
namespace {

using Eigen::Vector3d;
using Positions = std::vector<Vector3d>;
using enum ErrorCode;

const double kBeyond = std::nextafter(kLargestMeasure, INFINITY);
const std::vector<Triangle> kTriangle{{0, 1, 2}};
const std::vector<Segment> kEdge{{0, 1}};

/// A triangle, one of whose coordinates is x.
Positions corners(double x) { return {{0, 0, 0}, {1, 0, 0}, {0, x, 1}}; }
Pose poseAt(double x) { return {.translation = {x, 0, 0}}; }

/// A call with a length x, the code of its refusal, and words of the message.
struct Limit {
  ErrorCode code;
  std::string named;
  std::function<void(double)> call;
  bool isSigned = true;
};

/// Calls with the largest length, then with the next double, and both negative if isSigned.
void expectLimits(const std::vector<Limit>& limits) {
  for (const auto& [code, named, call, isSigned] : limits)
    for (const double sign : {1.0, -1.0}) {
      if (sign < 0 && !isSigned) continue;
      SCOPED_TRACE(named);
      EXPECT_NO_THROW(call(sign * kLargestMeasure));
      testing::expectRefused(code, named, [&, &c = call] { c(sign * kBeyond); });
    }
}

TEST(Range, OfPositions) {
  OctreeBasedCD all;
  const GeometryId mesh = all.addTriangleMesh(corners(1), kTriangle);
  const auto addTetrahedron = [](double x) {
    Positions positions = corners(x);
    positions.push_back({3, 3, 3});
    OctreeBasedCD().addTetrahedralMesh(positions, std::vector<Tetrahedron>{{0, 1, 2, 3}});
  };
  const std::string added = "vertex 2: position is", set = "geometry 0, vertex 2: position ";
  expectLimits({
      {NonFinitePosition, added, [](double x) { OctreeBasedCD().addPointSet(corners(x)); }},
      {NonFinitePosition, added, [](double x) { OctreeBasedCD().addLineMesh(corners(x), kEdge); }},
      {NonFinitePosition, added,
       [](double x) { OctreeBasedCD().addTriangleMesh(corners(x), kTriangle); }},
      {NonFinitePosition, added, addTetrahedron},
      {NonFinitePosition, set + "is", [&](double x) { all.setPositions(mesh, corners(x)); }},
      {NonFinitePosition, set + "before is",
       [&](double x) { all.setPositions(mesh, corners(x), corners(1)); }},
      {NonFinitePosition, set + "now is",
       [&](double x) { all.setPositions(mesh, corners(1), corners(x)); }},
      {NonFinitePosition, set + "is",
       [&](double x) { all.setTriangles(mesh, corners(x), kTriangle); }},
  });
}

/// In every place of the vectors in which positions are checked.
TEST(Range, OfEachCoordinate) {
  OctreeBasedCD collisions;
  Positions positions(41, Vector3d(1, 2, 3));
  const GeometryId points = collisions.addPointSet(positions);
  for (std::size_t v = 0; v < positions.size(); ++v)
    for (int k = 0; k < 3; ++k) {
      const double good = positions[v][k];
      const auto set = [&](double x) {
        positions[v][k] = x;
        collisions.setPositions(points, positions);
      };
      expectLimits({{NonFinitePosition, "vertex " + std::to_string(v) + ": position is", set}});
      positions[v][k] = good;
    }
}

TEST(Range, OfRadiiTransformsAndSettings) {
  OctreeBasedCD all;
  const GeometryId a = all.addTriangleMesh(corners(1), kTriangle),
                   b = all.addTriangleMesh(corners(2), kTriangle);
  all.addCollisionPair(a, b);
  all.addCollisionPair(b, b);
  const auto addRadii = [](double x) {
    OctreeBasedCD().addLineMesh(corners(1), kEdge, std::vector<double>{0, x, 0});
  };
  const auto set = [&](const PairSettings& settings) { all.setPairSettings(a, b, settings); };
  expectLimits({
      {InvalidRadius, "vertex 0: radius is",
       [](double x) { OctreeBasedCD().addPointSet(corners(1), x); }, false},
      {InvalidRadius, "vertex 1: radius is", addRadii, false},
      {InvalidSettings, "thickness is", [&](double x) { set({.thickness = x}); }, false},
      {InvalidSettings, "allowedError is", [&](double x) { set({.allowedError = x}); }, false},
      {InvalidSettings, "motionTolerance is",
       [&](double x) { set({.thickness = 1, .automatic = {.motionTolerance = x}}); }, false},
      {InvalidSettings, "restDistance is",
       [&](double x) { all.setPairSettings(b, b, {.restDistance = x}); }, false},
      {InvalidTransform, "geometry 0: translation is",
       [&](double x) { all.setTransform(a, poseAt(x)); }},
      {InvalidTransform, "geometry 0: before: translation is",
       [&](double x) { all.setTransform(a, poseAt(x), poseAt(0)); }},
  });
}

TEST(Range, OfQueries) {
  OctreeBasedCD collisions;
  const GeometryId mesh = collisions.addTriangleMesh(corners(1), kTriangle);
  const SpatialQueries all = collisions.queries();
  std::vector<std::uint32_t> elements;
  std::vector<ShapeContact> contacts;
  std::vector<PathInterval> inside;
  std::vector<PathClearance> outside;
  const std::vector<GeometryId> bodies{mesh};
  const Sphere ball{{0, 0, 0}, 1};
  const auto along = [&](double x, double radius) {
    all.path(Positions{{0, 0, 0}, {x, 0, 0}}, radius, bodies, inside, outside);
  };
  const auto hit = [&](const Vector3d& from, const Vector3d& to) {
    (void)all.firstHit(mesh, {from, to});
  };
  expectLimits({
      {NonFinitePosition, "the query's point is",
       [&](double x) { (void)all.closestPoint(mesh, Vector3d(x, 0, 0)); }},
      {InvalidSettings, "radius is",
       [&](double x) { all.elementsWithin(mesh, Vector3d::Zero(), x, elements); }, false},
      {NonFinitePosition, "the ray has origin",
       [&](double x) { hit(Vector3d(0, x, 0), Vector3d(0, 0, 1)); }},
      {NonFinitePosition, "the ray has origin",
       [&](double x) { hit(Vector3d(0, 0, 0), Vector3d(0, x, 1)); }},
      {InvalidTransform, "the query's shape: translation is",
       [&](double x) { all.overlapping(mesh, ball, poseAt(x), elements); }},
      {InvalidSettings, "thickness is",
       [&](double x) { all.contacts(mesh, ball, poseAt(0), x, contacts); }, false},
      {NonFinitePosition, "point 1 of the path is", [&](double x) { along(x, 0); }},
      {InvalidSettings, "radius is", [&](double x) { along(1, x); }, false},
  });
}

TEST(Range, OfDistanceFields) {
  const Positions positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const std::vector<Triangle> triangles{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  const auto build = [&](double z, double errorBound, double band) {
    Positions wide = positions;
    wide[3][2] = z;
    return DistanceField::build({wide, triangles}, {.errorBound = errorBound, .band = band});
  };
  const DistanceField field = build(1, 0.1, 0.5);
  expectLimits({{NonFinitePosition, "the point is",
                 [&](double x) { (void)field.value(Vector3d(0, x, 0)); }}});
  EXPECT_THROW(build(kBeyond, 0.1, 0.5), Error);
  EXPECT_THROW(build(-kBeyond, 0.1, 0.5), Error);
  EXPECT_THROW(build(1, kBeyond, 0.5), Error);
  EXPECT_THROW(build(1, 0.1, kBeyond), Error);
}

}  // namespace
}  // namespace palpate
