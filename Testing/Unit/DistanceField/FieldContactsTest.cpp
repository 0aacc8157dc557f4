#include <palpate/Capture.h>
#include <palpate/ConstraintRows.h>
#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Common/StepBodies.h"
#include "DistanceField/FieldContacts.h"
#include "Common/FieldMeshes.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <vector>

namespace palpate::testing {
namespace {

using Eigen::Vector3d;
using Field = std::shared_ptr<const DistanceField>;

constexpr double kErrorBound = 0.02, kBand = 0.4, kThickness = 0.1;

Field fieldOf(const Mesh& mesh, double errorBound = kErrorBound) {
  return std::make_shared<const DistanceField>(DistanceField::build(
      {mesh.positions, mesh.triangles}, {.errorBound = errorBound, .band = kBand, .threads = 1}));
}

const Mesh& bodyMesh() {
  static const Mesh mesh = torusMesh(24, 12);
  return mesh;
}
const Field& bodyField() {
  static const Field field = fieldOf(bodyMesh());
  return field;
}

PairSettings byField(Contacts contacts = Contacts::Distinct) {
  return {.method = Method::DistanceField, .thickness = kThickness, .contacts = contacts};
}

/// Meshes, lines and points near the body.
std::vector<StepBody> others(std::uint64_t seed) {
  Random random(seed);
  std::vector<StepBody> all = bodiesOfEveryType(random, 0.0);
  std::erase_if(all, [](const StepBody& body) { return body.type == GeometryType::Shape; });
  return all;
}

struct FieldScene {
  OctreeBasedCD detection;
  GeometryId other, body;

  const CollisionData& data() const { return detection.collisionData(other, body); }
};

/// attached: the field is attached to the body's mesh. Else it is a geometry.
FieldScene sceneOf(std::uint64_t seed, const StepBody& other, bool attached,
                   const Settings& settings, Contacts contacts) {
  Random random(seed);
  FieldScene scene{OctreeBasedCD(settings), {}, {}};
  OctreeBasedCD& detection = scene.detection;
  scene.other = other.add(detection);
  if (attached) {
    scene.body = detection.addTriangleMesh(bodyMesh().positions, bodyMesh().triangles);
    detection.attachDistanceField(scene.body, bodyField());
  } else {
    scene.body = detection.addDistanceField(bodyField());
  }
  if (seed % 3 > 0)
    detection.setTransform(scene.body, {randomTurn(random), randomPoint(random, -0.3, 0.3)});
  if (seed % 4 == 3)
    detection.setTransform(scene.other, {randomTurn(random), randomPoint(random, -0.1, 0.1)});
  if (seed % 5 == 4) detection.setDisabledElements(scene.other, std::array{3u, 7u});
  detection.addCollisionPair(scene.other, scene.body, byField(contacts));
  detection.detectCollision();
  return scene;
}

void expectSame(const CollisionData& l, const CollisionData& r) {
  expectSameContacts(l, r);
  EXPECT_EQ(l.hash(), r.hash());
  EXPECT_EQ(l.validity(), r.validity());
}

}  // namespace

TEST(FieldContacts, EqualThoseOfBruteForce) {
  std::array<std::size_t, 3> found{};
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(casesOf(12)); ++seed)
    for (const StepBody& other : others(seed))
      for (const Contacts contacts : {Contacts::Distinct, Contacts::All}) {
        SCOPED_TRACE(other.name);
        const bool attached = seed % 2 > 0;
        const FieldScene octree =
            sceneOf(seed, other, attached, {.threads = 1, .audit = {.features = 50}}, contacts);
        const FieldScene truth =
            sceneOf(seed, other, attached, {.engine = Engine::BruteForce, .threads = 1}, contacts);
        expectSame(octree.data(), truth.data());
        EXPECT_TRUE(octree.detection.auditFailures().empty());
        for (const ShapeContact& c : octree.data().shape())
          ++found[static_cast<std::size_t>(c.element)];
      }
  for (const std::size_t count : found) EXPECT_GE(count, leastOf(300));
}

TEST(FieldContacts, DoNotDependOnThreads) {
  const Mesh fine = sphere(60, 90, {0.9, 0, 0}, 0.3);
  std::vector<std::uint64_t> hashes;
  for (const int threads : {1, 2, 5}) {
    OctreeBasedCD detection(Settings{.threads = threads});
    const GeometryId mesh = detection.addTriangleMesh(fine.positions, fine.triangles),
                     field = detection.addDistanceField(bodyField());
    detection.addCollisionPair(field, mesh, byField(Contacts::All));
    detection.detectCollision();
    hashes.push_back(detection.collisionData(field, mesh).hash());
    EXPECT_GT(detection.collisionData(field, mesh).shape().size(), 1000u);
  }
  EXPECT_EQ(hashes[0], hashes[1]);
  EXPECT_EQ(hashes[0], hashes[2]);
}

/// The laws of contacts, against exact distances and against values at many points.
TEST(FieldContacts, AreWithinTheErrorBound) {
  const double tolerance = depthToleranceOf(*bodyField());
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(casesOf(6)); ++seed) {
    Random random(seed);
    const Mesh mesh =
        seed % 2 ? sphere(12, 16, randomPoint(random, -0.6, 0.6), 0.6) : soup(random, 60, 0.5);
    OctreeBasedCD detection(Settings{.threads = 1});
    const GeometryId other = detection.addTriangleMesh(mesh.positions, mesh.triangles),
                     body = detection.addTriangleMesh(bodyMesh().positions, bodyMesh().triangles);
    detection.attachDistanceField(body, bodyField());
    const Eigen::Matrix3d rotation = randomTurn(random);
    const Vector3d translation = randomPoint(random, -0.2, 0.2);
    detection.setTransform(body, {rotation, translation});
    detection.addCollisionPair(other, body, byField());
    detection.detectCollision();
    const CollisionData& data = detection.collisionData(other, body);
    EXPECT_EQ(data.errorBound(), bodyField()->errorBound());
    const SpatialQueries queries = detection.queries();
    const auto exactAt = [&](const Vector3d& x) {
      return queries.signedDistance(body, x).distance;
    };

    std::vector<bool> isContact(mesh.positions.size(), false);
    std::vector<std::uint32_t> outside, near;
    for (std::uint32_t i = 0; i < data.shape().size(); ++i) {
      const ShapeContact& c = data.shape()[i];
      const double exact = exactAt(c.point);
      if (std::abs(exact) <= kBand) {
        EXPECT_NEAR(c.distance, exact, kErrorBound * (1 + 1e-9));
      }
      EXPECT_LE(c.distance, kThickness);
      EXPECT_NEAR(c.normal.norm(), 1.0, 1e-12);
      EXPECT_NEAR((c.point - c.pointOnShape - c.distance * c.normal).norm(), 0.0, 1e-12);
      Vector3d point = Vector3d::Zero();
      for (int k = 0; k < 3; ++k)
        if (c.weights[k] > 0) point += c.weights[k] * mesh.positions[c.vertices[k]];
      EXPECT_NEAR((point - c.point).norm(), 0.0, 1e-12);
      if (c.element == ShapeElement::Vertex) isContact[c.id] = true;
      if (c.distance <= -(kBand - kErrorBound)) outside.push_back(i);
      if (kThickness - c.distance < kErrorBound) near.push_back(i);
    }
    EXPECT_EQ(data.validity().outsideBand, outside);
    EXPECT_EQ(data.validity().nearThreshold, near);
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
      const double exact = exactAt(mesh.positions[v]);
      if (exact < kThickness - kErrorBound) {
        EXPECT_TRUE(isContact[v]) << v;
      }
      if (exact > kThickness + kErrorBound) {
        EXPECT_FALSE(isContact[v]) << v;
      }
    }
    // Each point of a triangle that is deeper than the tolerance has a contact of the triangle, its
    // edges or its vertices that is as deep, to within the tolerance.
    const auto valueAt = [&](const Vector3d& x) {
      return bodyField()->value(rotation.transpose() * (x - translation));
    };
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      const auto& [a, b, c] = mesh.triangles[t];
      const auto holds = [&, &corners = mesh.triangles[t]](std::uint32_t v) {
        return std::find(corners.begin(), corners.end(), v) != corners.end();
      };
      double deepest = 1.0, sampled = 1.0;
      for (const ShapeContact& contact : data.shape())
        if (contact.element == ShapeElement::Face
                ? contact.id == t
                : std::all_of(contact.vertices.begin(), contact.vertices.end(), holds))
          deepest = std::min(deepest, contact.distance);
      for (int i = 0; i <= 20; ++i)
        for (int j = 0; i + j <= 20; ++j)
          sampled = std::min(sampled, valueAt(mesh.positions[a] +
                                              i / 20.0 * (mesh.positions[b] - mesh.positions[a]) +
                                              j / 20.0 * (mesh.positions[c] - mesh.positions[a])));
      if (sampled <= kThickness - tolerance) {
        EXPECT_LE(deepest, sampled + tolerance + 1e-9) << t;
      }
    }
    // With all contacts, none is less deep than a vertex of its element.
    detection.setPairSettings(other, body, byField(Contacts::All));
    detection.detectCollision();
    std::size_t edges = 0;
    for (const ShapeContact& c : detection.collisionData(other, body).shape()) {
      edges += c.element == ShapeElement::Edge;
      for (const std::uint32_t v : c.vertices)
        EXPECT_LE(c.distance, valueAt(mesh.positions[v]) + 1e-9) << static_cast<int>(c.element);
    }
    EXPECT_GT(edges, 10u);
  }
}

/// A spike of the body through the middle of a large triangle, far from its edges.
TEST(FieldContacts, FindASpikeInATriangle) {
  Mesh spike;
  spike.positions = {{-0.1, -0.1, 0}, {0.1, -0.1, 0}, {0, 0.1, 0}, {0.01, 0.02, 1}};
  spike.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  OctreeBasedCD detection(Settings{.threads = 1});
  const std::array<Vector3d, 3> corners{{{-3, -2, 0.8}, {3, -2, 0.9}, {0, 3, 0.9}}};
  const GeometryId field = detection.addDistanceField(fieldOf(spike, 0.005)),
                   mesh = detection.addTriangleMesh(corners, std::vector<Triangle>{{0, 1, 2}});
  detection.addCollisionPair(mesh, field, {.method = Method::DistanceField, .thickness = 0.01});
  detection.detectCollision();
  const auto contacts = detection.collisionData(mesh, field).shape();
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_EQ(contacts[0].element, ShapeElement::Face);
  EXPECT_LT(contacts[0].distance, 0.0);
  EXPECT_LT(contacts[0].point.head<2>().norm(), 0.05);
}

TEST(FieldContacts, FollowTheBody) {
  const Mesh mesh = sphere(20, 30, {0.9, 0.1, 0.2}, 0.4);
  // With this turn no vertex is on a face of cells, where gradients jump.
  const Eigen::Matrix3d rotation =
      Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const Vector3d translation(3, -2, 5);
  std::vector<Vector3d> moved;
  for (const Vector3d& p : mesh.positions) moved.push_back(rotation * p + translation);
  OctreeBasedCD detection(Settings{.threads = 1});
  const GeometryId other = detection.addTriangleMesh(mesh.positions, mesh.triangles),
                   field = detection.addDistanceField(bodyField());
  detection.addCollisionPair(other, field, byField());
  detection.detectCollision();
  const CollisionData before = detection.collisionData(other, field);
  detection.advance();
  detection.setTransform(field, {rotation, translation});
  detection.setPositions(other, moved);
  detection.detectCollision();
  const auto now = detection.collisionData(other, field).shape();
  ASSERT_EQ(now.size(), before.shape().size());
  EXPECT_GT(now.size(), 50u);
  for (std::size_t i = 0; i < now.size(); ++i) {
    EXPECT_EQ(now[i].vertices, before.shape()[i].vertices);
    EXPECT_NEAR(now[i].distance, before.shape()[i].distance, 1e-9);
    // The deepest points of edges and triangles often lie on faces of cells, where gradients jump.
    if (now[i].element == ShapeElement::Vertex) {
      EXPECT_NEAR((now[i].normal - rotation * before.shape()[i].normal).norm(), 0.0, 1e-6);
    }
  }
  detection.advance();
  detection.setTransform(field, {Eigen::Matrix3d::Identity(), {100, 0, 0}});
  detection.detectCollision();
  EXPECT_TRUE(detection.collisionData(other, field).shape().empty());
}

/// A row's gap is the distance at the step's end. The body's side is left empty.
TEST(FieldContacts, MakeRows) {
  const Mesh mesh = sphere(12, 16, {1.0, 0, 0.6}, 0.35);
  OctreeBasedCD detection(Settings{.threads = 1});
  const GeometryId body = detection.addTriangleMesh(bodyMesh().positions, bodyMesh().triangles),
                   other = detection.addTriangleMesh(mesh.positions, mesh.triangles);
  detection.attachDistanceField(body, bodyField());
  detection.addCollisionPair(body, other, byField());
  detection.detectCollision();
  const CollisionData& data = detection.collisionData(body, other);
  const SolverVertices ofMesh{0, mesh.positions, mesh.positions},
      ofBody{0, bodyMesh().positions, bodyMesh().positions};
  std::vector<ConstraintRow> rows;
  appendRows(data, {}, ofMesh, rows);
  ASSERT_EQ(rows.size(), data.shape().size());
  ASSERT_FALSE(rows.empty());
  for (std::size_t i = 0; i < rows.size(); ++i)
    EXPECT_NEAR(rows[i].gap(mesh.positions), data.shape()[i].distance, 1e-12);
  expectRefused(ErrorCode::WrongPositionCount, "both sides have positions",
                [&] { appendRows(data, ofBody, ofMesh, rows); });
  std::vector<ContactMotion> motions;
  expectRefused(ErrorCode::WrongPositionCount, "both sides have positions",
                [&] { appendMotions(data, {.vertices = ofBody}, {.vertices = ofMesh}, motions); });
}

/// Beyond the band inside, the field is constant: the normal is the last axis of its frame.
TEST(FieldContacts, HaveTheLastAxisWhereTheFieldIsConstant) {
  const Mesh box = boxMesh({-1, -1, -1}, {1, 1, 1});
  OctreeBasedCD detection(Settings{.threads = 1});
  const GeometryId field = detection.addDistanceField(fieldOf(box, 0.05)),
                   point = detection.addPointSet(std::array{Vector3d(0.1, 0.2, 0.3)});
  Eigen::Matrix3d rotation;
  rotation << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  detection.setTransform(field, {rotation, Vector3d::Zero()});
  detection.addCollisionPair(point, field, byField());
  detection.detectCollision();
  const CollisionData& data = detection.collisionData(point, field);
  ASSERT_EQ(data.shape().size(), 1u);
  EXPECT_EQ(data.shape()[0].normal, Vector3d(1, 0, 0));
  EXPECT_EQ(data.shape()[0].distance, -kBand);
  EXPECT_EQ(data.validity().outsideBand, std::vector<std::uint32_t>{0});
  EXPECT_EQ(data.validity().method, Method::DistanceField);
  EXPECT_FALSE(data.validity().trusted);
}

TEST(FieldContacts, OfTheSecondBodyWhereBothHaveAField) {
  const Mesh small = boxMesh({0.9, -0.2, 0.2}, {1.3, 0.2, 0.6});
  OctreeBasedCD detection(Settings{.threads = 1});
  const GeometryId box = detection.addTriangleMesh(small.positions, small.triangles),
                   ring = detection.addTriangleMesh(bodyMesh().positions, bodyMesh().triangles);
  detection.attachDistanceField(box, fieldOf(small));
  detection.attachDistanceField(ring, bodyField());
  detection.addCollisionPair(box, ring, byField());
  detection.detectCollision();
  const auto contacts = detection.collisionData(box, ring).shape();
  ASSERT_FALSE(contacts.empty());
  for (const ShapeContact& c : contacts)
    for (const std::uint32_t v : c.vertices) EXPECT_LT(v, small.positions.size());
}

TEST(FieldContacts, ByAutoWhereTheErrorIsAllowedAndNothingMoves) {
  const Mesh mesh = sphere(12, 16, {1.0, 0, 0.6}, 0.35);
  OctreeBasedCD detection(Settings{.threads = 1});
  const GeometryId other = detection.addTriangleMesh(mesh.positions, mesh.triangles),
                   body = detection.addTriangleMesh(bodyMesh().positions, bodyMesh().triangles);
  detection.attachDistanceField(body, bodyField());
  PairSettings settings{.thickness = kThickness};
  detection.addCollisionPair(other, body, settings);
  const auto methodFor = [&](double allowedError) {
    settings.allowedError = allowedError;
    detection.setPairSettings(other, body, settings);
    detection.detectCollision();
    return detection.collisionData(other, body).validity();
  };
  EXPECT_EQ(methodFor(0.0).method, Method::Proximity);
  EXPECT_EQ(methodFor(0.99 * kErrorBound).method, Method::Proximity);
  EXPECT_EQ(methodFor(kErrorBound).method, Method::DistanceField);
  EXPECT_EQ(methodFor(kErrorBound).reason, MethodReason::AllowedError);
  EXPECT_GT(detection.collisionData(other, body).shape().size(), 0u);
  // An impact within the step: the sphere passes through the ring's wall.
  std::vector<Vector3d> before = mesh.positions, now = mesh.positions;
  for (Vector3d& p : before) p.z() += 0.6;
  for (Vector3d& p : now) p.z() -= 1.8;
  detection.setPositions(other, before, now);
  EXPECT_EQ(methodFor(kErrorBound).method, Method::Continuous);
  EXPECT_LT(detection.collisionData(other, body).earliestTimeOfImpact(), 1.0);
  detection.setPositions(other, mesh.positions, mesh.positions);
  detection.setContactPredicate(other, body, [](const ContactFeatures&) { return true; });
  EXPECT_EQ(methodFor(kErrorBound).method, Method::Proximity);
}

/// No other method answers an added field: Auto has the contacts of Method::DistanceField.
TEST(FieldContacts, ByAutoOfAnAddedField) {
  const Mesh mesh = sphere(12, 16, {1.0, 0, 0}, 0.35);
  for (const Engine engine : {Engine::Octree, Engine::BruteForce}) {
    std::vector<std::uint64_t> hashes;
    for (const Method method : {Method::DistanceField, Method::Auto}) {
      OctreeBasedCD detection(Settings{.engine = engine, .threads = 1});
      const GeometryId field = detection.addDistanceField(bodyField()),
                       other = detection.addTriangleMesh(mesh.positions, mesh.triangles);
      detection.addCollisionPair(other, field, {.method = method, .thickness = 0.1});
      for (const double height : {0.6, -0.55}) {
        std::vector<Vector3d> positions = mesh.positions;
        for (Vector3d& p : positions) p.z() += height;
        detection.setPositions(other, positions);
        detection.detectCollision();
        const CollisionData& data = detection.collisionData(other, field);
        EXPECT_EQ(data.validity().method, Method::DistanceField);
        EXPECT_EQ(data.validity().reason,
                  method == Method::Auto ? MethodReason::NoAlternative : MethodReason::Requested);
        EXPECT_FALSE(data.validity().trusted);
        EXPECT_EQ(detection.pairSettings(other, field).method, method);
        EXPECT_GT(data.shape().size(), 0u);
        hashes.push_back(data.hash());
        detection.advance();
      }
    }
    EXPECT_EQ(hashes[0], hashes[2]);
    EXPECT_EQ(hashes[1], hashes[3]);
  }
}

TEST(FieldContacts, RefuseWhatTheyDoNotSupport) {
  const Mesh mesh = sphere(8, 10, {0, 0, 0}, 0.5);
  OctreeBasedCD detection(Settings{.threads = 1});
  const auto addMesh = [&](const Mesh& each) {
    return detection.addTriangleMesh(each.positions, each.triangles);
  };
  const GeometryId field = detection.addDistanceField(bodyField()),
                   second = detection.addDistanceField(bodyField()), other = addMesh(mesh),
                   body = addMesh(bodyMesh()), disabled = addMesh(bodyMesh()),
                   shape = detection.addAnalyticalGeometry(Sphere{{0, 0, 0}, 1.0}),
                   points = detection.addPointSet(mesh.positions, 0.35);
  const auto add = [&](GeometryId a, GeometryId b, const PairSettings& settings) {
    return [&detection, a, b, settings] { detection.addCollisionPair(a, b, settings); };
  };
  const ErrorCode unsupported = ErrorCode::UnsupportedMethod, invalid = ErrorCode::InvalidSettings;
  expectRefused(invalid, "geometry 7: the field is null",
                [&] { detection.addDistanceField(nullptr); });
  expectRefused(unsupported, "accepts only Auto and Method::DistanceField, not Proximity",
                add(other, field, {.method = Method::Proximity, .thickness = 0.1}));
  expectRefused(invalid, "less than the band", add(other, field, {.thickness = 0.39}));
  expectRefused(unsupported, "two distance fields", add(field, second, byField()));
  expectRefused(unsupported, "with a shape", add(field, shape, byField()));
  expectRefused(unsupported, "with itself", add(field, field, byField()));
  expectRefused(unsupported, "needs a field", add(other, body, byField()));
  expectRefused(invalid, "less than the band",
                add(other, field, {.method = Method::DistanceField, .thickness = 0.39}));
  expectRefused(invalid, "less than the band", add(points, field, byField()));
  PairSettings settings = byField();
  settings.allowedError = 0.1;
  expectRefused(invalid, "only Auto and Proxy use it", add(other, field, settings));
  settings = {.allowedError = -1.0};
  expectRefused(invalid, "allowedError is -1", add(other, body, settings));

  expectRefused(invalid, "is not of this mesh",
                [&] { detection.attachDistanceField(other, bodyField()); });
  expectRefused(unsupported, "is a point set",
                [&] { detection.attachDistanceField(points, bodyField()); });
  detection.setDisabledElements(disabled, std::array{1u});
  expectRefused(unsupported, "has disabled elements",
                [&] { detection.attachDistanceField(disabled, bodyField()); });
  detection.attachDistanceField(body, bodyField());
  const Mesh& same = bodyMesh();
  expectRefused(unsupported, "geometry 3 has a distance field attached, so that setPositions()",
                [&] { detection.setPositions(body, same.positions); });
  expectRefused(unsupported, "setTriangles()",
                [&] { detection.setTriangles(body, same.positions, same.triangles); });
  expectRefused(unsupported, "setDisabledElements()",
                [&] { detection.setDisabledElements(body, std::array{1u}); });
  expectRefused(ErrorCode::WrongPositionCount, "is a distance field",
                [&] { detection.setPositions(field, {}); });

  detection.addCollisionPair(other, body, byField());
  expectRefused(unsupported, "needs a field",
                [&] { detection.attachDistanceField(body, nullptr); });
  expectRefused(unsupported, "predicates", [&] {
    detection.setContactPredicate(other, body, [](const ContactFeatures&) { return true; });
  });
  detection.detectCollision();
  expectRefused(ErrorCode::NotAvailable, "no candidate pairs",
                [&] { (void)detection.candidatePairs(other, body); });
  expectRefused(unsupported, "which queries do not support", [&] {
    (void)detection.queries().closestPoint(field, {0, 0, 0}, 1.0);
  });
  const GeometryId thread =
      detection.addLineMesh(mesh.positions, std::vector<Segment>{{0, 1}}, 0.25);
  detection.addCollisionPair(thread, body, byField());
  const auto narrow = std::make_shared<const DistanceField>(DistanceField::build(
      {same.positions, same.triangles}, {.errorBound = kErrorBound, .band = 0.3, .threads = 1}));
  expectRefused(invalid, "less than the band",
                [&] { detection.attachDistanceField(body, narrow); });
  detection.removeCollisionPair(thread, body);
  detection.attachDistanceField(body, narrow);
  detection.setPairSettings(other, body, {.thickness = 0.1});
  detection.attachDistanceField(body, nullptr);
  detection.setPositions(body, same.positions);
}

TEST(FieldContacts, ReplayFromAProblemButNotFromACapture) {
  for (const bool attached : {false, true}) {
    const FieldScene scene = sceneOf(5, others(5)[1], attached, {.threads = 1}, Contacts::All);
    OctreeBasedCD again = setUp(scene.detection.problem());
    again.detectCollision();
    EXPECT_GT(scene.data().shape().size(), 0u);
    expectSame(again.collisionData(GeometryId{0}, GeometryId{1}), scene.data());
    expectRefused(ErrorCode::NotAvailable, "geometry 1 has a distance field",
                  [&] { capture(scene.detection, "field.capture"); });
  }
}

}  // namespace palpate::testing
