#include "Common/ExpectRefused.h"
#include "Common/TestGeometry.h"

#include <palpate/ConstraintRows.h>

// PairSettings::smoothNormals.

namespace palpate {
namespace {

using namespace testing;

constexpr double kPi = 3.14159265358979323846;
const Mesh coarse = sphere(7, 8, {0, 0, 0}, 1.0);

double angleBetween(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / kPi;
}

/// The largest angles in degrees: from one step to the next, and to the sphere's own normal.
struct Angles {
  double jump = 0.0, error = 0.0;
  void add(const Vector3d& last, const Vector3d& normal, const Vector3d& own) {
    if (last != Vector3d::Zero()) jump = std::max(jump, angleBetween(last, normal));
    error = std::max(error, angleBetween(own, normal));
  }
};

/// The index of the nearest contact.
template <class Contacts>
std::size_t nearestOf(const Contacts& contacts) {
  const auto isNearer = [](const auto& l, const auto& r) { return l.distance < r.distance; };
  return static_cast<std::size_t>(std::ranges::min_element(contacts, isNearer) - contacts.begin());
}

/// A geometry slides around the coarse sphere in small steps.
template <class Place, class Contact, class Smooth>
std::pair<Angles, Angles> slide(OctreeBasedCD& collisions, Place&& place, Contact&& contactOf,
                                Smooth&& smoothOf) {
  constexpr int kSteps = 360;
  std::pair<Angles, Angles> angles;
  Vector3d lastRaw = Vector3d::Zero(), lastSmooth = lastRaw;
  for (int step = 0; step < kSteps; ++step) {
    const double phi = 2 * kPi * step / kSteps;
    const Vector3d u = Vector3d(1, 0.3, 0.2).normalized(), v = Vector3d(-0.3, 1, 0.8),
                   w = (v - v.dot(u) * u).normalized();
    const Vector3d own = std::cos(phi) * u + std::sin(phi) * w;
    place(own);
    collisions.detectCollision();
    const auto contact = contactOf();
    angles.first.add(lastRaw, contact.normal, own);
    const Vector3d smooth = smoothOf();
    angles.second.add(lastSmooth, smooth, own);
    lastRaw = contact.normal, lastSmooth = smooth;
    EXPECT_NEAR(smooth.norm(), 1, 1e-12);
    collisions.advance();
  }
  return angles;
}

TEST(SmoothNormals, OfAVertexThatSlidesOverACoarseSphereDoNotJump) {
  OctreeBasedCD collisions;
  const GeometryId tip = collisions.addPointSet(Positions{{0, 0, 2}}),
                   ball = addMesh(collisions, coarse);
  for (const Method method : {Method::Proximity, Method::Continuous, Method::Auto}) {
    const PairSettings pair{.method = method, .thickness = 0.3, .smoothNormals = true};
    if (method == Method::Proximity)
      collisions.addCollisionPair(tip, ball, pair);
    else
      collisions.setPairSettings(tip, ball, pair);
    const auto data = [&]() -> const CollisionData& { return collisions.collisionData(tip, ball); };
    const auto [raw, smooth] = slide(
        collisions,
        [&](const Vector3d& own) {
          collisions.setPositions(tip, Positions{1.02 * own}, Positions{1.02 * own});
        },
        [&] { return data().vertexTriangle()[nearestOf(data().vertexTriangle())]; },
        [&] { return data().smoothVertexTriangle()[nearestOf(data().vertexTriangle())]; });
    // The path turns by 1 degree a step.
    EXPECT_GT(raw.jump, 30);
    EXPECT_GT(raw.error, 20);
    EXPECT_LT(smooth.jump, 1.5);
    EXPECT_LT(smooth.error, 2);
  }
}

TEST(SmoothNormals, OfAShapeThatSlidesOverACoarseSphereDoNotJump) {
  OctreeBasedCD collisions;
  const GeometryId ball = addMesh(collisions, coarse),
                   tool = collisions.addAnalyticalGeometry(Sphere{{0, 0, 0}, 0.1});
  collisions.addCollisionPair(
      ball, tool, {.method = Method::Proximity, .thickness = 0.3, .smoothNormals = true});
  const auto data = [&]() -> const CollisionData& { return collisions.collisionData(ball, tool); };
  const auto [raw, smooth] = slide(
      collisions,
      [&](const Vector3d& own) { collisions.setTransform(tool, {.translation = 1.12 * own}); },
      [&] {
        ShapeContact contact = data().shape()[nearestOf(data().shape())];  // out of the tool
        contact.normal = -contact.normal;
        return contact;
      },
      [&] { return Vector3d(-data().smoothShape()[nearestOf(data().shape())]); });
  EXPECT_GT(raw.error, 10);
  EXPECT_LT(smooth.jump, 2.5);
  EXPECT_LT(smooth.error, 3.5);
}

/// Lists are parallel, and gone without the setting. Contacts are those without it.
TEST(SmoothNormals, AreParallelToTheContacts) {
  Random random(4);
  const TestGeometry a = testGeometry(sphere(9, 12, {0.5, 0.5, 0.5}, 0.4)),
                     b = testGeometry(sheet(9, 0.5, 0.0)),
                     line = thread(random, 80, 0.1, 0.01, false);
  for (const auto& [first, second] : Pairs{{&a, &b}, {&line, &b}, {&b, &line}, {&b, &b}}) {
    PairSettings pair{.method = Method::Proximity, .thickness = 0.08, .contacts = Contacts::All};
    if (first == second) pair.thickness = 0.2;
    const CollisionData plain = answer(*first, *second, pair);
    EXPECT_TRUE(plain.smoothVertexTriangle().empty() && plain.smoothEdgeEdge().empty());
    pair.smoothNormals = true;
    const CollisionData one = answer(*first, *second, pair);
    EXPECT_EQ(one.hash(), plain.hash());
    ASSERT_EQ(one.smoothVertexTriangle().size(), one.vertexTriangle().size());
    ASSERT_EQ(one.smoothTriangleVertex().size(), one.triangleVertex().size());
    ASSERT_EQ(one.smoothEdgeEdge().size(), one.edgeEdge().size());
    EXPECT_GT(one.edgeEdge().size(), 10u);
    for (std::size_t i = 0; i < one.edgeEdge().size(); ++i)
      EXPECT_GE(one.smoothEdgeEdge()[i].dot(one.edgeEdge()[i].normal), 0.5 - 1e-12);
  }
}

/// At the border of an open surface, and on the other side of it.
TEST(SmoothNormals, AreOnTheSideOfTheContact) {
  const std::vector<Triangle> triangles{{0, 1, 2}, {1, 3, 2}};
  const Positions corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, -0.4}};
  for (const auto& [tip, isRaw] : std::vector<std::pair<Vector3d, bool>>{
           {{0.3, 0.3, 0.1}, false}, {{0.3, 0.3, -0.1}, false}, {{-0.1, 0.5, 0}, true}}) {
    OctreeBasedCD collisions;
    const GeometryId point = collisions.addPointSet(Positions{tip}),
                     sheet = collisions.addTriangleMesh(corners, triangles);
    collisions.addCollisionPair(
        point, sheet, {.method = Method::Proximity, .thickness = 0.2, .smoothNormals = true});
    collisions.detectCollision();
    const CollisionData& data = collisions.collisionData(point, sheet);
    ASSERT_EQ(data.vertexTriangle().size(), 1u);
    const Vector3d raw = data.vertexTriangle()[0].normal, smooth = data.smoothVertexTriangle()[0];
    EXPECT_EQ(smooth == raw, isRaw);
    EXPECT_GE(smooth.dot(raw), 0.5);
    // Rows have the smooth normal, and the contact's gap.
    std::vector<ConstraintRow> rows;
    appendRows(data, {0, Positions{tip}, Positions{tip}}, {1, corners, corners}, rows);
    ASSERT_EQ(rows.size(), 1u);
    EXPECT_EQ(rows[0].normal, smooth);
    const Positions all{tip, corners[0], corners[1], corners[2], corners[3]};
    EXPECT_NEAR(rows[0].gap(all), data.vertexTriangle()[0].distance, 1e-15);
  }
}

TEST(SmoothNormals, NeedAMeshAndContacts) {
  OctreeBasedCD collisions;
  const GeometryId ball = addMesh(collisions, coarse), tip = collisions.addPointSet(Positions(1)),
                   other = collisions.addPointSet(Positions(1));
  const auto refuse = [&](GeometryId a, GeometryId b, PairSettings pair) {
    pair.smoothNormals = true;
    expectRefused(
        ErrorCode::UnsupportedMethod, "smoothNormals is for contacts of a triangle",
        [&] { collisions.addCollisionPair(a, b, pair); }, a);
  };
  refuse(tip, other, {.method = Method::Proximity, .thickness = 0.1});
  refuse(tip, ball, {.method = Method::Continuous, .continuous = {.earliestTimeOnly = true}});
  refuse(tip, ball, {.method = Method::DistanceField, .thickness = 0.1});
  refuse(tip, ball, {.method = Method::Proxy, .thickness = 0.1, .allowedError = 0.01});
}

}  // namespace
}  // namespace palpate
