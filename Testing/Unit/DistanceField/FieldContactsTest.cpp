#include <palpate/Capture.h>
#include <palpate/ConstraintRows.h>
#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Common/PairRun.h"
#include "DistanceField/FieldContacts.h"
#include "Common/FieldMeshes.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
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

/// A sphere that overlaps the ring's wall.
Mesh ballAtWall() { return sphere(12, 16, {1.0, 0, 0.6}, 0.35); }

/// A mesh, and the ring with its field attached, paired in this order.
struct RingScene {
  OctreeBasedCD detection{Settings{.threads = 1}};
  GeometryId other, ring;

  explicit RingScene(const Mesh& mesh, const PairSettings& settings = byField())
      : other(addMesh(detection, mesh)), ring(addMesh(detection, bodyMesh())) {
    detection.attachDistanceField(ring, bodyField());
    detection.addCollisionPair(other, ring, settings);
  }
  const CollisionData& detect() {
    detection.detectCollision();
    return detection.collisionData(other, ring);
  }
};

/// One detection of a geometry with an added field. Returns the pair's contacts.
CollisionData contactsWith(const Field& field, const Pose& pose,
                           const std::function<GeometryId(OctreeBasedCD&)>& addOther,
                           const PairSettings& settings = byField()) {
  OctreeBasedCD detection(Settings{.threads = 1});
  const GeometryId body = detection.addDistanceField(field), other = addOther(detection);
  detection.setTransform(body, pose);
  detection.addCollisionPair(other, body, settings);
  detection.detectCollision();
  return detection.collisionData(other, body);
}

}  // namespace

/// The laws of contacts, against exact distances and against values at many points.
TEST(FieldContacts, AreWithinTheErrorBound) {
  const double tolerance = depthToleranceOf(*bodyField());
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(casesOf(6)); ++seed) {
    Random random(seed);
    const Mesh mesh =
        seed % 2 ? sphere(12, 16, randomPoint(random, -0.6, 0.6), 0.6) : soup(random, 60, 0.5);
    RingScene scene(mesh);
    const Eigen::Matrix3d rotation = randomTurn(random);
    const Vector3d translation = randomPoint(random, -0.2, 0.2);
    scene.detection.setTransform(scene.ring, {rotation, translation});
    const CollisionData data = scene.detect();
    EXPECT_EQ(data.errorBound(), bodyField()->errorBound());
    const SpatialQueries queries = scene.detection.queries();
    const auto exactAt = [&](const Vector3d& x) {
      return queries.signedDistance(scene.ring, x).distance;
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
    scene.detection.setPairSettings(scene.other, scene.ring, byField(Contacts::All));
    std::size_t edges = 0;
    for (const ShapeContact& c : scene.detect().shape()) {
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
  const std::array<Vector3d, 3> corners{{{-3, -2, 0.8}, {3, -2, 0.9}, {0, 3, 0.9}}};
  const CollisionData data =
      contactsWith(fieldOf(spike, 0.005), {},
                   [&](OctreeBasedCD& detection) {
                     return detection.addTriangleMesh(corners, std::vector<Triangle>{{0, 1, 2}});
                   },
                   {.method = Method::DistanceField, .thickness = 0.01});
  const auto contacts = data.shape();
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_EQ(contacts[0].element, ShapeElement::Face);
  EXPECT_LT(contacts[0].distance, 0.0);
  EXPECT_LT(contacts[0].point.head<2>().norm(), 0.05);
}

/// A short way from one end, a long segment is nearest to a small ball. Neither end is a contact.
TEST(FieldContacts, FindABallNearEitherEndOfASegment) {
  const Mesh ball = sphere(16, 24, Vector3d::Zero(), 0.05);
  const Field field = fieldOf(ball, 0.002);
  for (const bool isReversed : {false, true}) {
    std::vector<Vector3d> ends{{-0.05, 0.055, 0}, {0.4, 0.055, 0}};
    if (isReversed) std::swap(ends[0], ends[1]);
    const CollisionData data =
        contactsWith(field, {},
                     [&](OctreeBasedCD& detection) {
                       return detection.addLineMesh(ends, std::vector<Segment>{{0, 1}});
                     },
                     {.method = Method::DistanceField, .thickness = 0.01});
    ASSERT_EQ(data.shape().size(), 1u);
    EXPECT_NEAR(data.shape()[0].distance, 0.005, 0.002);
    EXPECT_NEAR(data.shape()[0].point.x(), 0.0, 0.02);
  }
}

/// A row's gap is the distance at the step's end. The body's side is left empty.
TEST(FieldContacts, MakeRows) {
  const Mesh mesh = ballAtWall();
  RingScene scene(mesh);
  const CollisionData& data = scene.detect();
  const SolverVertices ofMesh{0, mesh.positions, mesh.positions},
      ofBody{0, bodyMesh().positions, bodyMesh().positions};
  std::vector<ConstraintRow> rows;
  appendRows(data, ofMesh, {}, rows);
  ASSERT_EQ(rows.size(), data.shape().size());
  ASSERT_FALSE(rows.empty());
  for (std::size_t i = 0; i < rows.size(); ++i)
    EXPECT_NEAR(rows[i].gap(mesh.positions), data.shape()[i].distance, 1e-12);
  expectRefused(ErrorCode::WrongPositionCount, "both sides have positions",
                [&] { appendRows(data, ofMesh, ofBody, rows); });
  std::vector<ContactMotion> motions;
  expectRefused(ErrorCode::WrongPositionCount, "both sides have positions",
                [&] { appendMotions(data, {.vertices = ofMesh}, {.vertices = ofBody}, motions); });
}

/// Beyond the band inside, the field is constant: the normal is the last axis of its frame.
TEST(FieldContacts, HaveTheLastAxisWhereTheFieldIsConstant) {
  Eigen::Matrix3d rotation;
  rotation << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  const CollisionData data =
      contactsWith(fieldOf(boxMesh({-1, -1, -1}, {1, 1, 1}), 0.05), {rotation, Vector3d::Zero()},
                   [](OctreeBasedCD& detection) {
                     return detection.addPointSet(std::array{Vector3d(0.1, 0.2, 0.3)});
                   });
  ASSERT_EQ(data.shape().size(), 1u);
  EXPECT_EQ(data.shape()[0].normal, Vector3d(1, 0, 0));
  EXPECT_EQ(data.shape()[0].distance, -kBand);
  EXPECT_EQ(data.validity().outsideBand, std::vector<std::uint32_t>{0});
  EXPECT_EQ(data.validity().method, Method::DistanceField);
  EXPECT_FALSE(data.validity().trusted);
}

TEST(FieldContacts, OfTheSecondBodyWhereBothHaveAField) {
  const Mesh small = boxMesh({0.9, -0.2, 0.2}, {1.3, 0.2, 0.6});
  RingScene scene(small);
  scene.detection.attachDistanceField(scene.other, fieldOf(small));
  const CollisionData data = scene.detect();
  const auto contacts = data.shape();
  ASSERT_FALSE(contacts.empty());
  for (const ShapeContact& c : contacts)
    for (const std::uint32_t v : c.vertices) EXPECT_LT(v, small.positions.size());
}

TEST(FieldContacts, ByAutoWhereTheErrorIsAllowedAndNothingMoves) {
  const Mesh mesh = ballAtWall();
  PairSettings settings{.thickness = kThickness};
  RingScene scene(mesh, settings);
  auto& [detection, other, body] = scene;
  const auto methodFor = [&](double allowedError) {
    settings.allowedError = allowedError;
    scene.detection.setPairSettings(scene.other, scene.ring, settings);
    return scene.detect().validity();
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

TEST(FieldContacts, RefuseWhatTheyDoNotSupport) {
  const Mesh mesh = sphere(8, 10, {0, 0, 0}, 0.5);
  OctreeBasedCD detection(Settings{.threads = 1});
  const GeometryId field = detection.addDistanceField(bodyField()),
                   second = detection.addDistanceField(bodyField()),
                   other = addMesh(detection, mesh), body = addMesh(detection, bodyMesh()),
                   disabled = addMesh(detection, bodyMesh()),
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

/// No other method answers an added field: Auto has the contacts of Method::DistanceField.
TEST(FieldContacts, ByAutoOfAnAddedField) {
  const auto answer = [](Method method) {
    return contactsWith(bodyField(), {},
                        [](OctreeBasedCD& detection) { return addMesh(detection, ballAtWall()); },
                        {.method = method, .thickness = kThickness});
  };
  const CollisionData data = answer(Method::Auto);
  EXPECT_EQ(data.validity().method, Method::DistanceField);
  EXPECT_EQ(data.validity().reason, MethodReason::NoAlternative);
  EXPECT_FALSE(data.validity().trusted);
  EXPECT_GT(data.shape().size(), 0u);
  EXPECT_EQ(data.hash(), answer(Method::DistanceField).hash());
}

TEST(FieldContacts, ReplayFromAProblemButNotFromACapture) {
  RingScene scene(ballAtWall());
  const CollisionData& data = scene.detect();
  OctreeBasedCD again = setUp(scene.detection.problem());
  again.detectCollision();
  EXPECT_GT(data.shape().size(), 0u);
  EXPECT_EQ(again.collisionData(scene.other, scene.ring).hash(), data.hash());
  expectRefused(ErrorCode::NotAvailable, "geometry 1 has a distance field",
                [&] { capture(scene.detection, "field.capture"); });
}

}  // namespace palpate::testing
