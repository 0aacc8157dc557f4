#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Queries/QueryTruth.h"

#include <gtest/gtest.h>

#include <vector>

// contacts(): the frame's contacts with the same shape, bit by bit.
namespace palpate::testing {
namespace {

/// The contacts of a frame whose shape is at this pose.
std::vector<ShapeContact> frameContacts(const Both::Add& add, const PlacedShape& shape,
                                        double thickness, Engine engine) {
  OctreeBasedCD collisions(settingsOf(engine));
  const GeometryId body = add(collisions), tool = collisions.addAnalyticalGeometry(shape.geometry);
  collisions.setTransform(tool, {shape.rotation, shape.translation});
  collisions.addCollisionPair(body, tool, {Method::Proximity, thickness, Contacts::Distinct});
  collisions.detectCollision();
  const auto contacts = collisions.collisionData(body, tool).shape();
  return {contacts.begin(), contacts.end()};
}

std::vector<PlacedShape> queriedShapes(Random& random) {
  std::vector<PlacedShape> all;
  for (const AnalyticalGeometry& geometry : shapesOfEveryKind(random))
    all.push_back({geometry, randomTurn(random), randomPoint(random, 0.3, 0.7)});
  return all;
}

void expectFrame(const Both::Add& add, const Both& both, Random& random, std::size_t& count) {
  const SpatialQueries fast = both.octree.queries(), truth = both.bruteForce.queries();
  std::vector<ShapeContact> found(1), expected;
  for (const PlacedShape& shape : queriedShapes(random))
    for (const double thickness : {0.0, 0.04}) {
      fast.contacts(both.id, shape.geometry, {shape.rotation, shape.translation}, thickness, found);
      truth.contacts(both.id, shape.geometry, {shape.rotation, shape.translation}, thickness,
                     expected);
      EXPECT_TRUE(found == expected) << shape.geometry.index();
      EXPECT_TRUE(found == frameContacts(add, shape, thickness, Engine::Octree));
      EXPECT_TRUE(found == frameContacts(add, shape, thickness, Engine::BruteForce));
      for (const ShapeContact& contact : found) EXPECT_EQ(contact.timeOfImpact, 1.0);
      count += found.size();
    }
}

TEST(QueryContacts, AreThoseOfTheFrame) {
  Random random(701);
  for (const TestGeometry& geometry : geometriesOfEveryType(random)) {
    std::size_t count = 0;
    const Positions now = moved(random, geometry.positions, 0.03);
    const Matrix3d turn = randomTurn(random);
    const Vector3d centre(0.5, 0.5, 0.5), shift = centre - turn * centre;
    const Both::Add still = [&](OctreeBasedCD&each) { return geometry.addTo(each); },
                    deformed =
                        [&](OctreeBasedCD&each) {
                          const GeometryId id = geometry.addTo(each);
                          each.update();
                          each.setPositions(id, now);
                          return id;
                        },
                    turned = [&](OctreeBasedCD&each) {
                      const GeometryId id = deformed(each);
                      each.setTransform(id, {turn, shift});
                      return id;
                    };
    for (const Both::Add& add : {still, deformed, turned})
      expectFrame(add, Both(add), random, count);
    EXPECT_GT(count, 300u);
  }
}

TEST(QueryContacts, OfTetrahedralMeshes) {
  Random random(702);
  Solid solid = cells(3, random);
  for (Vector3d& p : solid.positions) p /= 3;
  std::size_t count = 0;
  const Both::Add add = [&](OctreeBasedCD& each) {
    return each.addTetrahedralMesh(solid.positions, solid.tetrahedra);
  };
  expectFrame(add, Both(add), random, count);
  EXPECT_GT(count, 100u);
}

// ---- Contacts of a RigidMesh at thickness 0 ----

/// Whether a corner of one triangle is on the other, or two edges meet, exactly.
bool featuresTouch(const Positions& a, const Positions& b) {
  bool touch = false;
  for (std::size_t i = 0; i < 3; ++i) {
    touch = touch || oracle::vertexTriangle(a[i], b[0], b[1], b[2]).square == 0 ||
            oracle::vertexTriangle(b[i], a[0], a[1], a[2]).square == 0;
    for (std::size_t j = 0; j < 3; ++j)
      touch = touch || oracle::edgeEdge(a[i], a[(i + 1) % 3], b[j], b[(j + 1) % 3]).square == 0;
  }
  return touch;
}

/// Triangles on a lattice, moved by whole numbers and turned by quarters, touch exactly or not.
TEST(QueryContacts, RigidMeshesAtThicknessZeroTouch) {
  Random random(703);
  Matrix3d quarter;
  quarter << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  std::size_t touching = 0, apart = 0;
  CollisionData found, truth;
  for (int i = 0; i < casesOf(1500); ++i) {
    const TestGeometry body = latticeSoup(random, 1, 4), tool = latticeSoup(random, 1, 4);
    const Both both(body);
    RigidMesh mesh(tool.positions, tool.triangles);
    const Matrix3d turn = i % 2 ? quarter : Matrix3d(Matrix3d::Identity());
    const Vector3d from = onLattice(random, 3), shift = onLattice(random, 3) - from;
    both.octree.queries().contacts(both.id, mesh, {turn, shift}, 0.0, found);
    both.bruteForce.queries().contacts(both.id, mesh, {turn, shift}, 0.0, truth);
    EXPECT_EQ(found.hash(), truth.hash());
    const bool touch = featuresTouch(body.positions, placed(tool.positions, turn, shift));
    EXPECT_EQ(found.validity().atEnd > 0, touch) << i;
    const auto expectZero = [](const auto& contacts) {
      for (const auto& contact : contacts) EXPECT_EQ(contact.distance, 0.0);
    };
    expectZero(found.vertexTriangle());
    expectZero(found.triangleVertex());
    expectZero(found.edgeEdge());
    (touch ? touching : apart) += 1;
  }
  EXPECT_GE(touching, leastOf(100));
  EXPECT_GE(apart, leastOf(100));
}

}  // namespace
}  // namespace palpate::testing
