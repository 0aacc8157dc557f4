#include "Common/ExpectRefused.h"
#include "Common/QueryCalls.h"
#include "Common/RandomMeshes.h"
#include "Common/Solids.h"

#include <palpate/OctreeBasedCD.h>
#include <palpate/PenetrationTracker.h>

#include <gtest/gtest.h>

#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

// Validity of SpatialQueries, their output, and the threads and callbacks that may call them. The
// tests of each query compare its results with brute force.
namespace palpate::testing {
namespace {

using Positions = std::vector<Eigen::Vector3d>;

/// A closed ball, a cube of tetrahedra, an open sheet, and points around them.
struct Scene {
  explicit Scene(const Settings& settings = {}) : collisions(settings) {
    Random random(3);
    const Mesh sphereMesh = sphere(12, 16, {0.5, 0.5, 0.5}, 0.4), sheetMesh = sheet(8, 0.5, 0);
    ballRest = sphereMesh.positions;
    ballTriangles = sphereMesh.triangles;
    ball = collisions.addTriangleMesh(sphereMesh.positions, sphereMesh.triangles);
    open = collisions.addTriangleMesh(sheetMesh.positions, sheetMesh.triangles);
    Solid cube = cells(2, random);
    for (Eigen::Vector3d& p : cube.positions) p *= 0.4;
    solid = collisions.addTetrahedralMesh(cube.positions, cube.tetrahedra);
    for (int i = 0; i < 400; ++i) probes.push_back(randomPoint(random, 0, 1));
    points = collisions.addPointSet(probes);
  }

  OctreeBasedCD collisions;
  GeometryId ball, open, solid, points;
  Positions ballRest, probes;
  std::vector<Triangle> ballTriangles;
};

struct Answers {
  std::vector<InsideVertex> closed, byNumber;
  std::vector<EmbeddedVertex> embedded;
  std::optional<TetrahedronPoint> at;
  friend bool operator==(const Answers&, const Answers&) = default;
};

Answers ask(const Scene& scene, const SpatialQueries& queries) {
  Answers answers;
  queries.findInsideVertices(scene.points, scene.ball, answers.closed);
  queries.findInsideVertices(scene.points, scene.ball, answers.byNumber,
                             {.rule = InsideRule::WindingNumber});
  queries.findEmbeddedVertices(scene.points, scene.solid, answers.embedded);
  answers.at = queries.findTetrahedron(scene.solid, {0.1, 0.1, 0.1});
  EXPECT_GT(answers.closed.size(), 50u);
  EXPECT_EQ(answers.closed, answers.byNumber);
  EXPECT_GT(answers.embedded.size(), 50u);
  EXPECT_TRUE(answers.at);
  return answers;
}

void expectInvalid(const std::function<void()>& call, const std::string& words) {
  expectRefused(ErrorCode::InvalidCall, words, call);
}

TEST(SpatialQueries, LaterCallsDoNotChangeEarlierResults) {
  Scene scene;
  const SpatialQueries queries = scene.collisions.queries();
  std::vector<InsideVertex> first, second;
  queries.findInsideVertices(scene.points, scene.ball, first);
  const std::vector<InsideVertex> kept = first;
  queries.findInsideVertices(scene.open, scene.ball, second);
  EXPECT_EQ(first, kept);
  EXPECT_NE(first, second);
  // A call that throws leaves the vector unchanged, too.
  EXPECT_THROW(queries.findInsideVertices(scene.points, scene.open, first), Error);
  EXPECT_EQ(first, kept);
}

TEST(SpatialQueries, AreInvalidAfterAnyChangeOfTheirGeometries) {
  const Eigen::Matrix3d unit = Eigen::Matrix3d::Identity();
  const std::vector<std::pair<std::string, std::function<void(Scene&)>>> changes{
      {"setPositions", [](Scene& s) { s.collisions.setPositions(s.ball, s.ballRest); }},
      {"setTransform",
       [&](Scene& s) {
         s.collisions.setTransform(s.ball, {unit, {0, 0, 0.1}});
       }},
      {"setTriangles",
       [](Scene& s) { s.collisions.setTriangles(s.ball, s.ballRest, s.ballTriangles); }},
      {"add", [](Scene& s) { s.collisions.addPointSet(s.probes); }},
      {"addAnalyticalGeometry", [](Scene& s) { s.collisions.addAnalyticalGeometry(Sphere{}); }},
      {"remove", [](Scene& s) { s.collisions.removeGeometry(s.open); }},
      {"advance", [](Scene& s) { s.collisions.advance(); }}};
  for (const auto& [name, change] : changes) {
    SCOPED_TRACE(name);
    Scene scene;
    const SpatialQueries queries = scene.collisions.queries();
    ask(scene, queries);
    change(scene);
    expectInvalid(
        [&] {
          (void)queries.findTetrahedron(scene.solid, {0, 0, 0});
        },
        "call queries() again");
    // Queries that are requested now are valid. The earlier ones stay outdated.
    ask(scene, scene.collisions.queries());
    expectInvalid(
        [&] {
          (void)queries.findTetrahedron(scene.solid, {0, 0, 0});
        },
        "call queries() again");
  }
}

TEST(SpatialQueries, StayValidThroughDetectionsAndPairs) {
  Scene scene;
  const SpatialQueries queries = scene.collisions.queries();
  const Answers before = ask(scene, queries);
  OctreeBasedCD& collisions = scene.collisions;
  const std::vector<std::function<void()>> calls{
      [&] {
        collisions.addCollisionPair(scene.ball, scene.open, {Method::Continuous, 0.1});
      },
      [&] { collisions.detectCollision(); },
      [&] { collisions.forEachCandidate([](auto&&...) {}); },
      [&] { collisions.update(); },
      [&] {
        collisions.setDisabledElements(scene.ball, std::vector<std::uint32_t>{0, 1, 2});
      },
      [&] {
        collisions.setCollisionFilter(scene.ball, {2, 4});
      },
      [&] { collisions.detectCollision(); },
      [&] { collisions.removeCollisionPair(scene.ball, scene.open); },
      [&] { EXPECT_THROW(collisions.setPositions(scene.ball, scene.probes), Error); },
      [&] { (void)collisions.queries(); }};
  for (const auto& call : calls) {
    call();
    EXPECT_EQ(ask(scene, queries), before);
  }
  const SpatialQueries copy = queries;
  EXPECT_EQ(ask(scene, copy), before);
}

/// A frame that an exception ends leaves queries valid.
TEST(SpatialQueries, StayValidAfterAFrameThatThrows) {
  Scene scene;
  OctreeBasedCD& collisions = scene.collisions;
  collisions.addCollisionPair(scene.points, scene.ball, {Method::Proximity, 0.2});
  const SpatialQueries queries = collisions.queries();
  const Answers before = ask(scene, queries);
  collisions.setContactPredicate(scene.points, scene.ball, [](const ContactFeatures&) -> bool {
    throw std::runtime_error("no");
  });
  EXPECT_THROW(collisions.detectCollision(), std::runtime_error);
  EXPECT_EQ(ask(scene, queries), before);
}

TEST(SpatialQueries, MayOutliveAndMoveWithTheirOwner) {
  std::optional<Scene> scene(std::in_place);
  const SpatialQueries queries = scene->collisions.queries();
  const Answers before = ask(*scene, queries);
  OctreeBasedCD moved = std::move(scene->collisions);
  EXPECT_EQ(ask(*scene, queries), before);
  { const OctreeBasedCD last = std::move(moved); }
  expectInvalid([&] { (void)queries.findTetrahedron(scene->solid, {0, 0, 0}); }, "queries()");
  SpatialQueries empty = queries;
  const SpatialQueries taken = std::move(empty);
  expectInvalid([&] { (void)empty.findTetrahedron(scene->solid, {0, 0, 0}); }, "moved from");
}

TEST(SpatialQueries, ThrowWithinACallbackOfTheirOwner) {
  Scene scene;
  OctreeBasedCD& collisions = scene.collisions;
  collisions.addCollisionPair(scene.points, scene.ball, {Method::Proximity, 0.2});
  const SpatialQueries queries = collisions.queries();
  collisions.setContactPredicate(scene.points, scene.ball, [&](const ContactFeatures&) {
    return queries.findTetrahedron(scene.solid, {0.1, 0.1, 0.1}).has_value();
  });
  expectInvalid([&] { collisions.detectCollision(); }, "predicate or callback");
  collisions.setContactPredicate(scene.points, scene.ball, {});
  collisions.detectCollision();
  ask(scene, queries);
}

/// Outdated queries throw, also while another thread updates the octrees.
TEST(SpatialQueries, OutdatedOnesThrowBesideNewOnes) {
  Scene scene;
  for (int repeat = 0; repeat < 20; ++repeat) {
    const SpatialQueries old = scene.collisions.queries();
    Positions moved = scene.ballRest;
    for (Eigen::Vector3d& p : moved) p.x() += 1e-3 * repeat;
    scene.collisions.setPositions(scene.ball, moved);
    const std::jthread updating([&] { (void)scene.collisions.queries(); });
    for (int i = 0; i < 50; ++i)
      expectInvalid([&] { (void)old.findTetrahedron(scene.solid, {0, 0, 0}); }, "queries() again");
  }
}

TEST(SpatialQueries, ChangeNoStatisticsAndNoContacts) {
  Scene scene;
  OctreeBasedCD& collisions = scene.collisions;
  collisions.addCollisionPair(scene.points, scene.ball, {Method::Proximity, 0.1});
  collisions.detectCollision();
  const std::uint64_t hash = collisions.collisionData(scene.points, scene.ball).hash();
  const std::size_t contacts = collisions.statistics().contacts;
  EXPECT_GT(contacts, 0u);
  Positions moved = scene.ballRest;
  for (Eigen::Vector3d& p : moved) p.x() += 0.01;
  collisions.setPositions(scene.ball, moved);
  ask(scene, collisions.queries());
  EXPECT_EQ(collisions.statistics().contacts, contacts);
  EXPECT_EQ(collisions.collisionData(scene.points, scene.ball).hash(), hash);
}

/// The state of a tracker belongs to one object, and a call that throws leaves it unchanged.
TEST(PenetrationTracker, KeepsItsOwnState) {
  Scene first, second;
  PenetrationTracker one(first.points, first.ball), other(first.points, first.ball);
  const auto change = [](PenetrationTracker& tracker, Scene& scene) {
    const auto found = tracker.update(scene.collisions.queries());
    EXPECT_FALSE(found.empty());
    scene.collisions.advance();
    return found.front().change;
  };
  EXPECT_EQ(change(one, first), DirectionChange::Entered);
  EXPECT_EQ(change(one, first), DirectionChange::None);
  EXPECT_EQ(change(other, first), DirectionChange::Entered);
  EXPECT_EQ(change(one, second), DirectionChange::Entered);  // of another object
  EXPECT_EQ(change(one, second), DirectionChange::None);
  const SpatialQueries old = second.collisions.queries();
  second.collisions.advance();
  EXPECT_THROW(one.update(old), Error);
  EXPECT_EQ(change(one, second), DirectionChange::None);
  PenetrationTracker moved = std::move(one);
  EXPECT_EQ(change(moved, second), DirectionChange::None);
  expectInvalid([&] { one.update(second.collisions.queries()); }, "moved from");
}

}  // namespace
}  // namespace palpate::testing
