#include "Queries/BodyPenetration.h"
#include "Core/Stopping.h"
#include "Core/Threads.h"

#include "Common/ExpectRefused.h"
#include "Common/FieldMeshes.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Queries/MovedMeshes.h"
#include "Unit/Queries/QueryTruth.h"

#include <palpate/FeaturePairs.h>
#include <palpate/OctreeBasedCD.h>

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

// Directions and depths of bodies: what a translation must do is tested on the moved positions, all
// triangles against all.
namespace palpate::testing {
namespace {

/// A beam bent to a U: concave, with a slot that is open upward.
Solid bracket(Random& random) {
  return cells(3, random, [](const std::array<int, 3>& c) { return c[2] == 0 || c[0] != 1; });
}

struct Bodies {
  Bodies(const Mesh& first, const Mesh& second, Engine engine = Engine::Octree)
      : collisions(settingsOf(engine)),
        a(collisions.addTriangleMesh(first.positions, first.triangles)),
        b(collisions.addTriangleMesh(second.positions, second.triangles)) {}
  Penetration penetration() { return collisions.queries().penetration(a, b); }

  OctreeBasedCD collisions;
  GeometryId a, b;
};

/// Whether no triangles have a common point, and no vertex of either is inside the other.
bool areApart(const Mesh& a, const Mesh& b) {
  for (const auto& [i, j, k] : a.triangles)
    for (const auto& [p, q, r] : b.triangles)
      if (trianglesIntersect(a.positions[i], a.positions[j], a.positions[k], b.positions[p],
                             b.positions[q], b.positions[r]))
        return false;
  Bodies bodies(a, b);
  std::vector<InsideVertex> inside;
  bodies.collisions.queries().findInsideVertices(bodies.a, bodies.b, inside);
  if (!inside.empty()) return false;
  bodies.collisions.queries().findInsideVertices(bodies.b, bodies.a, inside);
  return inside.empty();
}

void expectSame(const Penetration& p, const Penetration& q) {
  EXPECT_EQ(p.intersecting, q.intersecting);
  EXPECT_EQ(p.direction, q.direction);
  EXPECT_EQ(p.depth, q.depth);
  EXPECT_EQ(p.minimal, q.minimal);
  for (const auto& [one, two] : {std::pair(p.a, q.a), std::pair(p.b, q.b)}) {
    EXPECT_EQ(one.element, two.element);
    EXPECT_EQ(one.weights, two.weights);
    EXPECT_EQ(one.position, two.position);
    EXPECT_EQ(one.distance, two.distance);
  }
}

/// The laws of an answer for bodies that intersect.
void expectSeparates(const Mesh& a, const Mesh& b, const Penetration& p, double size) {
  ASSERT_TRUE(p.intersecting);
  EXPECT_NEAR(p.direction.norm(), 1.0, 1e-12);
  EXPECT_GT(p.depth, 0.0);
  EXPECT_TRUE(areApart(moved(a, p.depth * p.direction), b));
  EXPECT_LE((p.a.position + p.depth * p.direction - p.b.position).norm(), 1e-9 * size);
  for (const auto& [point, mesh] : {std::pair(p.a, &a), std::pair(p.b, &b)}) {
    ASSERT_LT(point.element, mesh->triangles.size());
    EXPECT_EQ(point.vertices, mesh->triangles[point.element]);
    EXPECT_GE(point.weights.minCoeff(), 0.0);
    Vector3d position = Vector3d::Zero();
    for (int i = 0; i < 3; ++i) position += point.weights[i] * mesh->positions[point.vertices[i]];
    EXPECT_LE((position - point.position).norm(), 1e-12 * size);
    EXPECT_EQ(point.distance, p.depth);
  }
}

void expectApart(const Mesh& a, const Mesh& b) {
  const Penetration p = Bodies(a, b).penetration();
  EXPECT_FALSE(p.intersecting);
  EXPECT_EQ(p.depth, 0.0);
  EXPECT_EQ(p.direction, Vector3d::Zero());
  EXPECT_EQ(p.a.element, kNoElement);
  EXPECT_EQ(p.b.element, kNoElement);
}

std::vector<Mesh> bodiesOfAllKinds(Random& random) {
  return {cube(-1, 1), sphere(6, 8, {0, 0, 0}, 1.2), torusMesh(16, 8),
          boxMesh({-1.5, -1, -0.05}, {1.5, 1, 0.05}),
          moved(scaledBy(surfaceMeshOf(bracket(random)), 0.7), {-1, -1, -1})};
}

TEST(Penetration, TheTranslationSeparatesBodiesOfAllKinds) {
  Random random(1);
  const std::vector<Mesh> kinds = bodiesOfAllKinds(random);
  std::size_t intersecting = 0;
  for (const Mesh& first : kinds)
    for (const Mesh& second : kinds)
      for (int i = 0; i < casesOf(4); ++i) {
        const Mesh a = turned(first, randomTurn(random)),
                   other = turned(second, randomTurn(random)),
                   b = moved(other, randomPoint(random, -1.2, 1.2));
        const Penetration p = Bodies(a, b).penetration();
        EXPECT_EQ(p.intersecting, !areApart(a, b));
        if (!p.intersecting) continue;
        ++intersecting;
        expectSeparates(a, b, p, 3.0);
        expectSame(p, Bodies(a, b, Engine::BruteForce).penetration());
      }
  EXPECT_GE(intersecting, leastOf(60));
}

/// A power of two scales the answer. A body far from the origin, or placed there, is separated up
/// to rounding.
TEST(Penetration, BodiesOfAnySizePlacedAnywhereAreSeparated) {
  const Mesh a = torusMesh(12, 6), b = moved(sphere(6, 8, {0, 0, 0}, 1.0), {0.6, 0.3, 0.2});
  const Penetration one = Bodies(a, b).penetration();
  for (const double factor : {0x1p-300, 0x1p40, 0x1p300}) {
    const Penetration p = Bodies(scaledBy(a, factor), scaledBy(b, factor)).penetration();
    ASSERT_TRUE(p.intersecting);
    EXPECT_NEAR(p.depth / factor, one.depth, 1e-9);
    EXPECT_EQ(p.minimal, one.minimal);
  }
  Random random(2);
  for (int i = 0; i < 20; ++i) {
    const Pose pose{randomTurn(random), Vector3d::Constant(100)};
    const auto placedMesh = [&](const Mesh& mesh) {
      return Mesh{placed(mesh.positions, pose.rotation, pose.translation), mesh.triangles};
    };
    const Mesh placedA = placedMesh(a), placedB = placedMesh(b);
    Bodies bodies(a, i % 2 ? b : placedB);
    bodies.collisions.setTransform(bodies.a, pose);
    if (i % 2) bodies.collisions.setTransform(bodies.b, pose);
    const Penetration p = bodies.penetration();
    ASSERT_TRUE(p.intersecting);
    EXPECT_FALSE(areApart(placedA, placedB));
    EXPECT_TRUE(areApart(moved(placedA, p.depth * p.direction), placedB));
  }
  for (const double far : {1e6, -1e9}) {
    const Mesh p = moved(cube(0, 1), Vector3d::Constant(far)), q = moved(p, {0.75, 0, 0});
    const Penetration found = Bodies(p, q).penetration();
    ASSERT_TRUE(found.intersecting);
    EXPECT_NEAR(found.depth, 0.25, 1e-11 * std::abs(far));
    EXPECT_TRUE(areApart(moved(p, found.depth * found.direction), q));
  }
}

/// The least translation of convex bodies: over the normals of all faces and of all pairs of edges.
double leastTranslation(const Mesh& a, const Mesh& b) {
  double least = std::numeric_limits<double>::infinity();
  const auto take = [&](const Vector3d& normal) {
    if (!(normal.norm() > 1e-9)) return;
    for (const double sign : {1.0, -1.0}) {
      const Vector3d d = sign * normal.normalized();
      double most = -std::numeric_limits<double>::infinity(), lowest = -most;
      for (const Vector3d& p : b.positions) most = std::max(most, d.dot(p));
      for (const Vector3d& p : a.positions) lowest = std::min(lowest, d.dot(p));
      least = std::min(least, most - lowest);
    }
  };
  const auto edges = [](const Mesh& mesh) {
    std::vector<Vector3d> all;
    for (const Triangle& t : mesh.triangles)
      for (int i = 0; i < 3; ++i)
        if (t[i] < t[(i + 1) % 3])
          all.push_back(mesh.positions[t[(i + 1) % 3]] - mesh.positions[t[i]]);
    return all;
  };
  for (const Mesh* mesh : {&a, &b})
    for (const auto& [i, j, k] : mesh->triangles)
      take(
          (mesh->positions[j] - mesh->positions[i]).cross(mesh->positions[k] - mesh->positions[i]));
  for (const Vector3d& e : edges(a))
    for (const Vector3d& f : edges(b)) take(e.normalized().cross(f.normalized()));
  return least;
}

TEST(Penetration, OfConvexBodiesNoTranslationIsShorter) {
  Random random(3);
  const std::vector<Mesh> kinds{cube(-1, 1), boxMesh({-1, -0.5, -0.1}, {1, 0.5, 0.1}),
                                sphere(2, 4, {0, 0, 0}, 1.0), sphere(4, 6, {0, 0, 0}, 1.1)};
  int minimal = 0;
  for (const Mesh& first : kinds)
    for (const Mesh& second : kinds)
      for (int i = 0; i < 5; ++i) {
        const Mesh a = turned(first, randomTurn(random)),
                   other = turned(second, randomTurn(random)),
                   b = moved(other, randomPoint(random, -0.6, 0.6));
        const Penetration p = Bodies(a, b).penetration();
        if (!p.intersecting) continue;
        EXPECT_NEAR(p.depth, leastTranslation(a, b), 1e-9);
        EXPECT_TRUE(p.minimal);
        ++minimal;
      }
  EXPECT_GT(minimal, 50);
}

TEST(Penetration, OfConcaveBodiesTheShortestWayOutIsFound) {
  Random random(4);
  const Solid solid = bracket(random);
  Bodies bodies(cube(0, 1), cube(0, 1));
  const GeometryId slot = bodies.collisions.addTetrahedralMesh(solid.positions, solid.tetrahedra);
  const Mesh key = boxMesh({0.9, -0.5, 0.6}, {2.1, 3.5, 2.5});
  const GeometryId id = bodies.collisions.addTriangleMesh(key.positions, key.triangles);
  const Penetration p = bodies.collisions.queries().penetration(id, slot);
  ASSERT_TRUE(p.intersecting);
  EXPECT_NEAR(p.depth, 2.1, 1e-9);  // sideways, through one arm
  EXPECT_FALSE(p.minimal);
  // A key that fits leaves the bottom only.
  bodies.collisions.setPositions(id, boxMesh({1.1, -0.5, 0.6}, {1.9, 3.5, 2.5}).positions);
  const Penetration up = bodies.collisions.queries().penetration(id, slot);
  EXPECT_NEAR(up.depth, 0.4, 1e-9);
}

TEST(Penetration, DependsOnNoQueryBeforeIt) {
  // The query before finds a corner of the second part inside, which here is in no triangle.
  const Mesh both = joined(cube(0, 1), cube(0.01, 1.01)), box = cube(0.5, 1.5);
  Mesh first = both;
  first.triangles.resize(box.triangles.size());
  Bodies bodies(first, moved(cube(0, 1), {0.4, 0.39, 0.38}));
  const Penetration alone = bodies.penetration();
  EXPECT_NEAR(alone.depth, 0.6, 1e-9);
  EXPECT_TRUE(alone.minimal);
  const GeometryId a = bodies.collisions.addTriangleMesh(both.positions, both.triangles),
                   b = bodies.collisions.addTriangleMesh(box.positions, box.triangles);
  EXPECT_TRUE(bodies.collisions.queries().penetration(a, b).intersecting);
  expectSame(bodies.penetration(), alone);
}

TEST(Penetration, BodiesThatOnlyTouchDoNotIntersect) {
  const Mesh unit = cube(0, 1);
  expectApart(unit, moved(unit, {1, 0, 0}));            // a face on a face
  expectApart(unit, moved(unit, {1, 0.25, 0.5}));       // parts of faces
  expectApart(unit, moved(unit, {1, 1, 0}));            // an edge
  expectApart(unit, moved(unit, {1, 1, 1}));            // a corner
  expectApart(unit, moved(unit, {1 + 1e-12, 0, 0}));    // apart
  expectApart(unit, boxMesh({-1, -1, -1}, {2, 2, 0}));  // on a larger face
  expectApart(unit, Mesh{});
  Random random(5);
  const Solid solid = bracket(random);
  OctreeBasedCD collisions;
  const GeometryId slot = collisions.addTetrahedralMesh(solid.positions, solid.tetrahedra);
  const Mesh key = boxMesh({1, 0, 1}, {2, 3, 3});  // fills the slot exactly
  const GeometryId id = collisions.addTriangleMesh(key.positions, key.triangles);
  EXPECT_FALSE(collisions.queries().penetration(id, slot).intersecting);
}

TEST(Penetration, AlignedBodiesIntersectThoughNoEdgePiercesAFace) {
  const Mesh unit = cube(0, 1);
  for (const Mesh& other : {unit, moved(unit, {0.5, 0, 0}), moved(unit, {0.25, 0.5, 0}),
                            boxMesh({0, 0, 0}, {1, 1, 0.5}), boxMesh({-1, 0, 0}, {2, 1, 1}),
                            boxMesh({0.25, 0, -1}, {0.75, 1, 2})}) {
    const Penetration p = Bodies(unit, other).penetration();
    expectSeparates(unit, other, p, 2.0);
    EXPECT_NEAR(p.depth, leastTranslation(unit, other), 1e-9);
  }
}

TEST(Penetration, ABodyInsideAnotherIntersectsItUnlessItIsInAHollow) {
  const Mesh outer = cube(-2, 2), inner = moved(sphere(5, 6, {0, 0, 0}, 0.5), {0.5, 0, 0});
  const Penetration p = Bodies(inner, outer).penetration();
  expectSeparates(inner, outer, p, 2.0);
  EXPECT_LE(p.depth, 2.0 + 1e-9);
  const Penetration other = Bodies(outer, inner).penetration();
  expectSeparates(outer, inner, other, 2.0);
  const Mesh hollow = joined(outer, insideOut(cube(-1.5, 1.5)));
  expectApart(inner, hollow);
  expectApart(hollow, inner);
}

/// How often a search asks for the time, which it does in proportion to its work.
std::size_t workOf(const Mesh& first, const Mesh& second) {
  const Threads thread(1);
  Body a(GeometryId{0}), b(GeometryId{1});
  for (const auto& [mesh, body] : {std::pair(&first, &a), std::pair(&second, &b)}) {
    makeBody(mesh->positions, mesh->triangles, thread, *body);
    body->mesh.topology = MeshTopology(mesh->positions.size(), mesh->triangles);
  }
  std::size_t asked = 0;
  const Deadline::Clock clock = [&] {
    ++asked;
    return Deadline::Time::min();
  };
  const std::atomic<bool> isCancelled = false;
  const Deadline deadline(Deadline::Time::max(), isCancelled, clock);
  const StopScope scope(&deadline);
  PenetrationScratch scratch;
  EXPECT_TRUE(penetrationOf(a, b, Engine::Octree, scratch).intersecting);
  return asked;
}

/// Of a ball among many plates, which fits between none, the way along the stack is shortest. The
/// search along directions that cannot become better ends after a share of the triangles.
TEST(Penetration, LayersAreLeftByTheShortWayAtACostInProportionToTheirTriangles) {
  for (const int count : {100, 300}) {
    Mesh plates;
    const double half = 2.0 * count;
    for (int i = 0; i < count; ++i)
      append(plates, boxMesh({-half, -half, i - 0.3}, {half, half, i + 0.3}));
    const Mesh ball = moved(sphere(8, 10, {0, 0, 0}, 0.9), {0, 0, count / 2 + 0.2});
    const Penetration p = Bodies(ball, plates).penetration();
    ASSERT_TRUE(p.intersecting);
    EXPECT_LE(p.depth, 0.75 * count);
    EXPECT_FALSE(Bodies(moved(ball, p.depth * p.direction), plates).penetration().intersecting);
    EXPECT_LE(workOf(ball, plates), 40000 + 25 * plates.triangles.size());
  }
}

/// Two stacks of plates that reach into each other: one plate's thickness separates them, not one
/// body's size.
TEST(Penetration, StacksOfPlatesShiftByOnePlate) {
  for (const double shift : {0.02, 0.5}) {
    Mesh a, b;
    for (int i = 0; i < 60; ++i) {
      append(b, boxMesh({-5, -5, i - 0.2}, {5, 5, i + 0.2}));
      const double z = i + 0.4 - shift;
      append(a, boxMesh({-3, -4, z - 0.2}, {7, 6, z + 0.2}));
    }
    const Penetration p = Bodies(a, b).penetration();
    ASSERT_TRUE(p.intersecting);
    EXPECT_NEAR(p.depth, shift == 0.02 ? 0.02 : 0.3, 1e-9);
  }
}

/// Pieces of a planned cut with fingers that fit: sides that lie in each other hold nothing.
TEST(Penetration, SidesThatLieInEachOtherDoNotHoldBodies) {
  // A row of columns between a plane and the cut.
  const auto comb = [](double back, double tip, double root, int first) {
    Mesh body;
    for (int i = 0; i < 6; ++i) {
      const double x = i % 2 == first ? tip : root;
      for (const double z : {0.0, 1.0})
        for (const double y : {1.0 * i, i + 1.0}) {
          body.positions.push_back({back, y, z});
          body.positions.push_back({x, y, z});
        }
    }
    const auto quad = [&](std::uint32_t p, std::uint32_t q, std::uint32_t r, std::uint32_t s) {
      body.triangles.push_back({p, q, r});
      body.triangles.push_back({p, r, s});
    };
    for (std::uint32_t i = 0; i < 6; ++i) {
      const std::uint32_t v = 8 * i;  // corners: bit 0 at the front, bit 1 at the end, bit 2 on top
      quad(v, v + 2, v + 3, v + 1);
      quad(v + 4, v + 5, v + 7, v + 6);
      quad(v, v + 4, v + 6, v + 2);
      quad(v + 1, v + 3, v + 7, v + 5);
      if (i == 0) quad(v, v + 1, v + 5, v + 4);
      const std::uint32_t w = v + 8;
      if (i == 5) {
        quad(v + 2, v + 6, v + 7, v + 3);
        continue;
      }
      quad(v + 2, v + 6, w + 4, w);  // without area
      quad(v + 2, w, w + 1, v + 3);
      quad(v + 3, w + 1, w + 5, v + 7);
      quad(v + 7, w + 5, w + 4, v + 6);
    }
    return body;
  };
  const Mesh a = comb(0, 2.5, 1.5, 0), b = insideOut(comb(4, 1.5, 2.5, 1));
  expectApart(a, b);
  const Penetration p = Bodies(moved(a, {0.0625, 0, 0}), b).penetration();
  ASSERT_TRUE(p.intersecting);
  EXPECT_NEAR(p.depth, 0.0625, 1e-9);
  EXPECT_FALSE(
      Bodies(moved(moved(a, {0.0625, 0, 0}), p.depth * p.direction), b).penetration().intersecting);
}

/// Extruded bodies with one profile: their caps are fans, of which each triangle touches each.
TEST(Penetration, EqualProfilesAreDecidedWhereTheyLieInEachOther) {
  const auto gear = [](double bottom, double top) {
    constexpr std::uint32_t kTeeth = 96;
    Mesh body;
    for (const double z : {bottom, top})
      for (std::uint32_t i = 0; i < kTeeth; ++i) {
        const double r = i % 4 < 2 ? 1.25 : 0.875, angle = 2 * M_PI * i / kTeeth;
        body.positions.push_back({r * std::cos(angle), r * std::sin(angle), z});
      }
    body.positions.push_back({0, 0, bottom});
    body.positions.push_back({0, 0, top});
    for (std::uint32_t i = 0; i < kTeeth; ++i) {
      const std::uint32_t j = (i + 1) % kTeeth;
      body.triangles.push_back({i, j, j + kTeeth});
      body.triangles.push_back({i, j + kTeeth, i + kTeeth});
      body.triangles.push_back({2 * kTeeth, j, i});
      body.triangles.push_back({2 * kTeeth + 1, i + kTeeth, j + kTeeth});
    }
    return body;
  };
  expectApart(gear(0, 1), gear(1, 2));
  EXPECT_NEAR(Bodies(gear(0, 1), gear(0.9375, 2)).penetration().depth, 0.0625, 1e-9);
  EXPECT_NEAR(Bodies(gear(0, 1), gear(0, 1)).penetration().depth, 1.0, 1e-9);
}

/// A closed surface without volume has no inside, wherever it is.
TEST(Penetration, WhatHasNoVolumeIntersectsNothing) {
  const Mesh unit = cube(0, 1);
  const Mesh flat = boxMesh({-1, -1, 0.5}, {2, 2, 0.5}),
             inner = boxMesh({0.25, 0.25, 0.5}, {0.75, 0.75, 0.5}),
             needle = boxMesh({0.5, 0.5, -1}, {0.5, 0.5, 2}),
             point = boxMesh({0.5, 0.5, 0.5}, {0.5, 0.5, 0.5});
  const Mesh sheet{
      {{-1, -1, 0.25}, {2, -1, 0.5}, {2, 2, 0.25}, {-1, 2, 0.75}, {0.5, 0.5, 0.4}, {0.5, 0.5, 0.4}},
      {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}, {1, 0, 5}, {2, 1, 5}, {3, 2, 5}, {0, 3, 5}}};
  for (const Mesh& none : {flat, inner, needle, point, sheet}) {
    expectApart(none, unit);
    expectApart(unit, none);
    // Beside a body with a volume it does not count.
    const Mesh both = joined(moved(unit, {3, 0, 0}), none);
    expectApart(both, unit);
    const Penetration p = Bodies(both, moved(unit, {3.75, 0, 0})).penetration();
    ASSERT_TRUE(p.intersecting);
    EXPECT_NEAR(p.depth, 0.25, 1e-9);
  }
}

/// A shape and a mesh in either order: the same answer, reversed.
Penetration withShape(const Mesh& mesh, const AnalyticalGeometry& shape) {
  OctreeBasedCD collisions;
  const GeometryId a = collisions.addTriangleMesh(mesh.positions, mesh.triangles),
                   b = collisions.addAnalyticalGeometry(shape);
  const Penetration p = collisions.queries().penetration(a, b),
                    q = collisions.queries().penetration(b, a);
  EXPECT_EQ(p.intersecting, q.intersecting);
  EXPECT_NEAR(p.depth, q.depth, 1e-9 + 0.02 * p.depth);
  for (const auto& [answer, sign] : {std::pair(p, 1.0), std::pair(q, -1.0)}) {
    if (!answer.intersecting) continue;
    EXPECT_LE((answer.a.position + answer.depth * answer.direction - answer.b.position).norm(),
              1e-9);
    Mesh apart = moved(mesh, sign * answer.depth * answer.direction);
    collisions.setPositions(a, apart.positions);
    EXPECT_GT(collisions.queries().distance(a, b).distance, 0.0);
    EXPECT_FALSE(collisions.queries().penetration(a, b).intersecting);
    collisions.setPositions(a, mesh.positions);
  }
  return p;
}

TEST(Penetration, ShapesAndMeshesAreSeparated) {
  const Mesh unit = cube(0, 1);
  const auto expect = [&](const AnalyticalGeometry& shape, double depth,
                          const Vector3d& direction) {
    const Penetration p = withShape(unit, shape);
    ASSERT_TRUE(p.intersecting);
    EXPECT_NEAR(p.depth, depth, 1e-9);
    EXPECT_LE((p.direction - direction).norm(), 1e-6);
    EXPECT_TRUE(p.minimal);
  };
  expect(Sphere{{1.25, 0.5, 0.5}, 0.5}, 0.25, {-1, 0, 0});
  expect(Sphere{{0.75, 0.5, 0.4}, 0.5}, 0.75, {-1, 0, 0});
  expect(Capsule{{1.25, 0.5, -3}, {1.25, 0.5, 4}, 0.5}, 0.25, {-1, 0, 0});
  expect(Cylinder{{1.25, 0.5, -3}, {1.25, 0.5, 4}, 0.5}, 0.25, {-1, 0, 0});
  expect(Box{{1.25, 0.5, 0.5}, {0.5, 2, 2}}, 0.25, {-1, 0, 0});
  expect(Plane{{0, 0, 0.25}, {0, 0, 3}}, 0.25, {0, 0, 1});
  for (const AnalyticalGeometry& apart : std::vector<AnalyticalGeometry>{
           Sphere{{1.5, 0.5, 0.5}, 0.5}, Box{{1.5, 0.5, 0.5}, {0.5, 2, 2}},
           Plane{{0, 0, 0}, {0, 0, 1}}, Sphere{{1.6, 0.5, 0.5}, 0.5}, Sphere{{0.5, 0.5, 0.5}, 0.0}})
    EXPECT_FALSE(withShape(unit, apart).intersecting);
  const Mesh ring = torusMesh(24, 12);
  for (const AnalyticalGeometry& concave : std::vector<AnalyticalGeometry>{
           Sphere{{0.05, 0.02, 0.1}, 0.75}, Capsule{{1, 0, -1}, {1, 0.1, 1}, 0.1},
           Cylinder{{1, 0, -1}, {1, 0.1, 1}, 0.1}, Box{{1, 0, 0}, {0.1, 0.1, 1}}}) {
    const Penetration p = withShape(ring, concave);
    EXPECT_TRUE(p.intersecting);
    EXPECT_FALSE(p.minimal);
    EXPECT_LE(p.depth, 0.5);
  }
}

TEST(Penetration, TwoShapesHaveTheirDistance) {
  OctreeBasedCD collisions;
  const GeometryId a = collisions.addAnalyticalGeometry(Box{{0, 0, 0}, {1, 1, 1}}),
                   b = collisions.addAnalyticalGeometry(Box{{1.7, 0.1, 0}, {1, 1, 1}}),
                   c = collisions.addAnalyticalGeometry(Sphere{{5, 0, 0}, 1}),
                   floor = collisions.addAnalyticalGeometry(Plane{{0, 0, 0}, {0, 0, 1}});
  const Penetration p = collisions.queries().penetration(a, b);
  EXPECT_TRUE(p.intersecting);
  EXPECT_TRUE(p.minimal);
  EXPECT_NEAR(p.depth, 0.3, 1e-9);
  EXPECT_LE((p.direction - Vector3d(-1, 0, 0)).norm(), 1e-9);
  EXPECT_FALSE(collisions.queries().penetration(a, c).intersecting);
  EXPECT_NEAR(collisions.queries().penetration(floor, a).depth, 1.0, 1e-9);
}

TEST(Penetration, RefusesWhatHasNoInside) {
  Mesh open = cube(0, 1);
  open.triangles.erase(open.triangles.begin());
  Bodies bodies(cube(0, 1), open);
  OctreeBasedCD& collisions = bodies.collisions;
  const GeometryId lines = collisions.addLineMesh(open.positions, std::vector<Segment>{{0, 1}}),
                   points = collisions.addPointSet(open.positions),
                   plane = collisions.addAnalyticalGeometry(Plane{}),
                   other = collisions.addAnalyticalGeometry(Plane{}),
                   sheet = collisions.addAnalyticalGeometry(Plane{{0, 0, 0}, {0, 0, 1}, true});
  const auto expect = [&](ErrorCode code, const std::string& words, GeometryId a, GeometryId b,
                          GeometryId named) {
    expectRefused(
        code, words, [&] { collisions.queries().penetration(a, b); }, named);
  };
  const std::string edge = "3 edges belong to one triangle only, the first is (0, 4)";
  expect(ErrorCode::NotClosed, edge, bodies.a, bodies.b, bodies.b);
  expect(ErrorCode::NotClosed, edge, bodies.b, bodies.a, bodies.b);
  expect(ErrorCode::NotClosed, edge, bodies.b, plane, bodies.b);
  expect(ErrorCode::NotClosed, "line mesh", lines, bodies.a, lines);
  expect(ErrorCode::NotClosed, "point set", bodies.a, points, points);
  expect(ErrorCode::NotClosed, "two-sided", bodies.a, sheet, sheet);
  expect(ErrorCode::UnsupportedMethod, "both planes", plane, other, plane);
  expect(ErrorCode::InvalidSettings, "twice", bodies.a, bodies.a, bodies.a);
}

}  // namespace
}  // namespace palpate::testing
