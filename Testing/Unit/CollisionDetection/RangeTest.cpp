#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

// The range of lengths: every call takes kLargestMeasure, and refuses the next double by name.

namespace palpate {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Positions = std::vector<Vector3d>;
using enum ErrorCode;

const double kBeyond = std::nextafter(kLargestMeasure, INFINITY);
const std::vector<Triangle> kTriangle{{0, 1, 2}};

/// A triangle, one of whose coordinates is x.
Positions corners(double x) { return {{0, 0, 0}, {1, 0, 0}, {0, x, 1}}; }

/// Calls with the largest length, then with the next double, and both negative if isSigned.
void expectLimit(ErrorCode code, const std::string& named, const std::function<void(double)>& call,
                 bool isSigned = false) {
  SCOPED_TRACE(named);
  for (const double sign : {1.0, -1.0}) {
    if (sign < 0 && !isSigned) continue;
    EXPECT_NO_THROW(call(sign * kLargestMeasure));
    try {
      call(sign * kBeyond);
      ADD_FAILURE() << "accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code) << error.what();
      EXPECT_NE(std::string(error.what()).find(named), std::string::npos) << error.what();
    }
  }
}

TEST(Range, OfPositions) {
  OctreeBasedCD collisions;
  const auto expectPositions = [](const std::string& named,
                                  const std::function<void(double)>& call) {
    expectLimit(NonFinitePosition, named, call, true);
  };
  expectPositions("vertex 2: position is",
                  [](double x) { OctreeBasedCD().addTriangleMesh(corners(x), kTriangle); });
  expectPositions("vertex 2: position is", [](double x) {
    Positions positions = corners(x);
    positions.push_back({3, 3, 3});
    OctreeBasedCD().addTetrahedralMesh(positions, std::vector<Tetrahedron>{{0, 1, 2, 3}});
  });
  expectPositions("vertex 2: position is", [](double x) {
    OctreeBasedCD().addLineMesh(corners(x), std::vector<Segment>{{0, 1}});
  });
  expectPositions("vertex 2: position is",
                  [](double x) { OctreeBasedCD().addPointSet(corners(x)); });
  const GeometryId mesh = collisions.addTriangleMesh(corners(1), kTriangle);
  expectPositions("geometry 0, vertex 2: position is",
                  [&](double x) { collisions.setPositions(mesh, corners(x)); });
  expectPositions("geometry 0, vertex 2: position before is",
                  [&](double x) { collisions.setPositions(mesh, corners(x), corners(1)); });
  expectPositions("geometry 0, vertex 2: position now is",
                  [&](double x) { collisions.setPositions(mesh, corners(1), corners(x)); });
  expectPositions("geometry 0, vertex 2: position is",
                  [&](double x) { collisions.setTriangles(mesh, corners(x), kTriangle); });
}

/// In every place of the vectors in which positions are checked.
TEST(Range, OfEachCoordinate) {
  OctreeBasedCD collisions;
  Positions positions(41, Vector3d(1, 2, 3));
  const GeometryId points = collisions.addPointSet(positions);
  for (std::size_t v = 0; v < positions.size(); ++v)
    for (int k = 0; k < 3; ++k) {
      const double good = positions[v][k];
      expectLimit(
          NonFinitePosition, "vertex " + std::to_string(v) + ": position is",
          [&](double x) {
            positions[v][k] = x;
            collisions.setPositions(points, positions);
          },
          true);
      positions[v][k] = good;
    }
}

TEST(Range, OfRadiiTransformsAndSettings) {
  OctreeBasedCD collisions;
  expectLimit(InvalidRadius, "vertex 0: radius is",
              [](double x) { OctreeBasedCD().addPointSet(corners(1), x); });
  expectLimit(InvalidRadius, "vertex 1: radius is", [](double x) {
    OctreeBasedCD().addLineMesh(corners(1), std::vector<Segment>{{0, 1}},
                                std::vector<double>{0, x, 0});
  });
  const GeometryId placed = collisions.addTriangleMesh(corners(1), kTriangle),
                   other = collisions.addTriangleMesh(corners(2), kTriangle);
  const Matrix3d one = Matrix3d::Identity();
  expectLimit(
      InvalidTransform, "geometry 0: translation is",
      [&](double x) {
        collisions.setTransform(placed, {one, {0, x, 0}});
      },
      true);
  expectLimit(
      InvalidTransform, "geometry 0: before: translation is",
      [&](double x) {
        collisions.setTransform(placed, {one, {x, 0, 0}}, {one, {0, 0, 0}});
      },
      true);
  collisions.addCollisionPair(placed, other);
  collisions.addCollisionPair(other, other);
  expectLimit(InvalidSettings, "thickness is",
              [&](double x) { collisions.setPairSettings(placed, other, {.thickness = x}); });
  expectLimit(InvalidSettings, "motionTolerance is", [&](double x) {
    collisions.setPairSettings(placed, other,
                               {.thickness = 1, .automatic = {.motionTolerance = x}});
  });
  expectLimit(InvalidSettings, "allowedError is",
              [&](double x) { collisions.setPairSettings(placed, other, {.allowedError = x}); });
  expectLimit(InvalidSettings, "restDistance is",
              [&](double x) { collisions.setPairSettings(other, other, {.restDistance = x}); });
}

TEST(Range, OfQueries) {
  OctreeBasedCD collisions;
  const GeometryId mesh = collisions.addTriangleMesh(corners(1), kTriangle);
  const SpatialQueries queries = collisions.queries();
  std::vector<std::uint32_t> elements;
  std::vector<ShapeContact> contacts;
  std::vector<PathInterval> inside;
  std::vector<PathClearance> outside;
  const Matrix3d one = Matrix3d::Identity();
  const std::vector<GeometryId> bodies{mesh};
  expectLimit(
      NonFinitePosition, "the query's point is",
      [&](double x) {
        (void)queries.closestPoint(mesh, {x, 0, 0});
      },
      true);
  expectLimit(InvalidSettings, "radius is", [&](double x) {
    queries.elementsWithin(mesh, {0, 0, 0}, x, elements);
  });
  expectLimit(
      NonFinitePosition, "the ray has origin",
      [&](double x) {
        (void)queries.firstHit(mesh, {{0, x, 0}, {0, 0, 1}});
      },
      true);
  expectLimit(
      NonFinitePosition, "the ray has origin",
      [&](double x) {
        (void)queries.firstHit(mesh, {{0, 0, 0}, {0, x, 1}});
      },
      true);
  expectLimit(
      InvalidTransform, "the query's shape: translation is",
      [&](double x) {
        queries.overlapping(mesh, Sphere{{0, 0, 0}, 1}, {one, {0, 0, x}}, elements);
      },
      true);
  expectLimit(InvalidSettings, "thickness is", [&](double x) {
    queries.contacts(mesh, Sphere{{0, 0, 0}, 1}, {one, {0, 0, 0}}, x, contacts);
  });
  expectLimit(
      NonFinitePosition, "point 1 of the path is",
      [&](double x) {
        queries.path(Positions{{0, 0, 0}, {x, 0, 0}}, 0, bodies, inside, outside);
      },
      true);
  expectLimit(InvalidSettings, "radius is", [&](double x) {
    queries.path(Positions{{0, 0, 0}, {1, 0, 0}}, x, bodies, inside, outside);
  });
}

TEST(Range, OfDistanceFields) {
  const Positions positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const std::vector<Triangle> triangles{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  const DistanceField field =
      DistanceField::build({positions, triangles}, {.errorBound = 0.1, .band = 0.5});
  expectLimit(
      NonFinitePosition, "the point is",
      [&](double x) {
        (void)field.value({0, x, 0});
      },
      true);
  for (const double bad : {kBeyond, -kBeyond}) {
    Positions wide = positions;
    wide[3][2] = bad;
    EXPECT_THROW(DistanceField::build({wide, triangles}, {.errorBound = 0.1, .band = 0.5}), Error);
  }
  EXPECT_THROW(DistanceField::build({positions, triangles}, {.errorBound = kBeyond, .band = 0.5}),
               Error);
  EXPECT_THROW(DistanceField::build({positions, triangles}, {.errorBound = 0.1, .band = kBeyond}),
               Error);
}

}  // namespace
}  // namespace palpate
