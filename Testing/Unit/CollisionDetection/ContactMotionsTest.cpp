#include <palpate/ConstraintRows.h>

#include "Common/ExpectRefused.h"
#include "Common/TestGeometry.h"

#include <numbers>

namespace palpate::testing {
namespace {

constexpr double pi = std::numbers::pi;

/// One pair: its step from the positions before to the positions now, with its rows and motions.
struct Moved {
  CollisionData contacts;
  std::vector<ConstraintRow> rows;
  std::vector<ContactMotion> motions;
  Positions before, now;  ///< positions of both, in the numbering of the rows
};

Moved step(Random& random, const TestGeometry& a, const TestGeometry& b, const PairSettings& pair,
           double most) {
  const Positions nowA = moved(random, a.positions, most), nowB = moved(random, b.positions, most);
  Moved result{
      answer(settingsOf(Engine::Octree), a, b, pair, nowA, nowB), {}, {}, a.positions, nowA};
  result.before.insert(result.before.end(), b.positions.begin(), b.positions.end());
  result.now.insert(result.now.end(), nowB.begin(), nowB.end());
  const SolverVertices first{0, a.positions, nowA},
      second{static_cast<std::uint32_t>(nowA.size()), b.positions, nowB};
  appendRows(result.contacts, first, second, result.rows);
  appendMotions(result.contacts, {first, a.radii}, {second, b.radii}, result.motions);
  return result;
}

TEST(ContactMotions, PointsMatchDistancesAndDisplacementsMatchGapChanges) {
  Random random(191);
  const TestGeometry sheets = testGeometry(sheet(6, 0.5, 0.3)),
                     triangles = testGeometry(soup(random, 60, 0.1)),
                     line = thread(random, 60, 0.1, 0.01, false),
                     points = particles(random, 60, 0.02),
                     cone = tapered(random, thread(random, 60, 0.1, 0, false), 0.02);
  const Pairs pairs{{&sheets, &triangles}, {&triangles, &sheets}, {&sheets, &line},
                    {&line, &sheets},      {&line, &points},      {&points, &line},
                    {&points, &sheets},    {&cone, &sheets},      {&points, &cone}};
  for (const auto& [a, b] : pairs) {
    for (const Method method : {Method::Proximity, Method::Continuous}) {
      const bool isTapered = a == &cone || b == &cone;
      if (isTapered && method == Method::Continuous)
        continue;  // its distances take the largest radii
      const Moved found = step(random, *a, *b, {method, 0.1, Contacts::All}, 0.05);
      ASSERT_EQ(found.motions.size(), found.rows.size());
      EXPECT_GT(found.motions.size(), 10u);
      std::vector<double> distances;
      forEachContact(found.contacts, [&](const auto& c) { distances.push_back(c.distance); });
      for (std::size_t i = 0; i < found.motions.size(); ++i) {
        const auto& [point, opposite, relative] = found.motions[i];
        const ConstraintRow& row = found.rows[i];
        EXPECT_LT((point - opposite - distances[i] * row.normal).norm(), 1e-13);
        EXPECT_NEAR(row.normal.dot(relative), row.gap(found.now) - row.gap(found.before), 1e-14);
      }
    }
  }
}

TEST(ContactMotions, AreExactForADropOverATriangle) {
  const TestGeometry drop{GeometryType::Points, {{0.25, 0.25, 1}}, {}, {}, {0.25}},
      floor{GeometryType::Triangles, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}, {}, {}};
  const Positions dropNow{{0.375, 0.25, 0.5}}, floorNow{{0, 1, 0}, {1, 1, 0}, {0, 2, 0}};
  for (const bool dropFirst : {true, false}) {
    const TestGeometry &a = dropFirst ? drop : floor, &b = dropFirst ? floor : drop;
    const Positions &nowA = dropFirst ? dropNow : floorNow, &nowB = dropFirst ? floorNow : dropNow;
    const CollisionData contacts =
        answer(settingsOf(Engine::Octree), a, b, {Method::Proximity, 2.0}, nowA, nowB);
    std::vector<ContactMotion> motions;
    appendMotions(contacts, {{0, a.positions, nowA}, a.radii}, {{0, b.positions, nowB}, b.radii},
                  motions);
    ASSERT_EQ(motions.size(), 1u);
    // The drop is beside the floor's edge, whose nearest point is (0.375, 1, 0).
    const Vector3d centre(0.375, 0.25, 0.5), foot(0.375, 1, 0);
    const Vector3d surface = centre + 0.25 * (foot - centre).normalized();
    EXPECT_LT((motions[0].point - surface).norm(), 1e-15);
    EXPECT_LT((motions[0].opposite - foot).norm(), 1e-15);
    EXPECT_LT((motions[0].relativeDisplacement - Vector3d(0.125, -1, -0.5)).norm(), 1e-15);
  }
}

Eigen::Matrix3d turn(const Vector3d& by) {
  return Eigen::AngleAxisd(by.norm(), by.normalized()).toRotationMatrix();
}

const std::vector<AnalyticalGeometry> kShapes{
    Sphere{{0.1, 0, 0}, 0.3}, Capsule{{-0.2, 0, 0}, {0.2, 0.1, 0}, 0.2},
    Box{{0, 0, 0}, {0.3, 0.2, 0.25}}, Plane{{0, 0, 0}, {0.1, 0.2, 1}}};

TEST(ContactMotions, AreDerivativesOfDistancesToShapes) {
  Random random(193);
  const TestGeometry drops = particles(random, 300, 0.02),
                     line = thread(random, 200, 0.1, 0.01, false);
  constexpr double kStep = 0x1p-16;
  for (const TestGeometry* elements : {&drops, &line})
    for (const AnalyticalGeometry& geometry : kShapes)
      for (const bool shapeFirst : {true, false}) {
        const Vector3d middle(0.5, 0.5, 0.5), spin(0.3, -0.7, 0.5), slide(-0.6, 0.2, 0.4);
        const Eigen::Matrix3d tilt = turn({0.4, 0.3, -0.2});
        const RigidMotion motion{{tilt, middle},
                                 {turn(kStep * spin) * tilt, middle + kStep * slide}};
        const Positions now = moved(random, elements->positions, kStep);
        OctreeBasedCD detection;
        const GeometryId soft = elements->addTo(detection),
                         shape = detection.addAnalyticalGeometry(geometry);
        const GeometryId a = shapeFirst ? shape : soft, b = shapeFirst ? soft : shape;
        detection.addCollisionPair(a, b, {Method::Proximity, 0.1, Contacts::All});
        const auto detect = [&](const Positions& at, const Eigen::Matrix3d& rotation,
                                const Vector3d& translation) {
          detection.setPositions(soft, at);
          detection.setTransform(shape, {rotation, translation});
          detection.detectCollision();
          return detection.collisionData(a, b);
        };
        const CollisionData start = detect(elements->positions, tilt, middle),
                            end = detect(now, motion.now.rotation, motion.now.translation);
        std::vector<ContactMotion> motions;
        const ContactSide mesh{{0, elements->positions, now}, elements->radii},
            tool{{}, {}, motion};
        appendMotions(end, shapeFirst ? tool : mesh, shapeFirst ? mesh : tool, motions);
        ASSERT_EQ(motions.size(), end.shape().size());
        std::size_t compared = 0;
        for (std::size_t i = 0; i < motions.size(); ++i) {
          const ShapeContact& contact = end.shape()[i];
          EXPECT_LT(
              (motions[i].point - motions[i].opposite - contact.distance * contact.normal).norm(),
              1e-13);
          // An edge is deepest in a box where two faces are equally near: the depth has a kink.
          if (std::holds_alternative<Box>(geometry) && contact.element == ShapeElement::Edge &&
              contact.distance + elements->radii[0] < 0)
            continue;
          for (const ShapeContact& other : start.shape()) {
            if (other.element != contact.element || other.vertices != contact.vertices) continue;
            // With the same features, the normal turns by at most the step over their distance, and
            // the closest points slide as little.
            const double apart = std::abs(contact.distance + elements->radii[0]);
            if ((other.normal - contact.normal).norm() > 10 * kStep / apart ||
                (other.weights - contact.weights).norm() > 1000 * kStep)
              continue;
            EXPECT_NEAR(contact.normal.dot(motions[i].relativeDisplacement),
                        contact.distance - other.distance, (100 + 20 / apart) * kStep * kStep);
            ++compared;
          }
        }
        EXPECT_GT(compared, 10u);
      }
}

TEST(ContactMotions, AreDerivativesOfDistancesBetweenShapes) {
  constexpr double kStep = 0x1p-16;
  const Eigen::Matrix3d tilt = turn({0.4, 0.3, -0.2}), other = turn({-0.1, 0.5, 0.6});
  const RigidMotion first{
      {tilt, {0, 0, 0}},
      {turn(kStep * Vector3d(0.3, -0.7, 0.5)) * tilt, kStep * Vector3d(0.1, 0.9, -0.3)}},
      second{{other, {0.5, 0.6, 0.7}},
             {turn(kStep * Vector3d(-0.8, 0.2, 0.1)) * other,
              Vector3d(0.5, 0.6, 0.7) + kStep * Vector3d(-0.5, 0.1, 0.7)}};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      OctreeBasedCD detection;
      const GeometryId a = detection.addAnalyticalGeometry(kShapes[i]),
                       b = detection.addAnalyticalGeometry(kShapes[j]);
      detection.addCollisionPair(a, b, {Method::Proximity, 10});
      detection.setTransform(a, first.before);
      detection.setTransform(b, second.before);
      detection.detectCollision();
      const double before = detection.collisionData(a, b).shapeShape()[0].distance;
      detection.setTransform(a, first.now);
      detection.setTransform(b, second.now);
      detection.detectCollision();
      const CollisionData& contacts = detection.collisionData(a, b);
      const ShapeShapeContact& contact = contacts.shapeShape()[0];
      std::vector<ContactMotion> motions;
      appendMotions(contacts, {{}, {}, first}, {{}, {}, second}, motions);
      ASSERT_EQ(motions.size(), 1u);
      EXPECT_EQ(motions[0].point, contact.pointA);
      EXPECT_EQ(motions[0].opposite, contact.pointB);
      EXPECT_NEAR(contact.normal.dot(motions[0].relativeDisplacement), contact.distance - before,
                  100 * kStep * kStep);
    }
}

TEST(ContactMotions, UseThePoseAtTheImpactWithAShape) {
  Random random(194);
  const TestGeometry drops = particles(random, 300, 0.02);
  const RigidMotion motion{{turn({0.4, 0.3, -0.2}), {0.5, 0.5, 0.2}},
                           {turn({0.1, 0.6, 0.3}), {0.5, 0.5, 0.9}}};
  for (std::size_t s = 0; s < 3; ++s) {
    OctreeBasedCD detection;
    const GeometryId points = drops.addTo(detection),
                     shape = detection.addAnalyticalGeometry(kShapes[s]);
    detection.addCollisionPair(points, shape, {Method::Continuous, 0.01});
    detection.setTransform(shape, motion.before, motion.now);
    detection.detectCollision();
    const CollisionData& contacts = detection.collisionData(points, shape);
    std::vector<ContactMotion> motions;
    appendMotions(contacts, {{0, drops.positions, drops.positions}, drops.radii}, {{}, {}, motion},
                  motions);
    ASSERT_EQ(motions.size(), contacts.shape().size());
    EXPECT_GT(motions.size(), 20u);
    for (std::size_t i = 0; i < motions.size(); ++i) {
      // The shape's point moves in a straight line: back from the contact to its place before, and
      // ahead to its place now. In both poses it is the same point of the body.
      const double time = contacts.shape()[i].timeOfImpact;
      const Vector3d way = -motions[i].relativeDisplacement,
                     start = motions[i].opposite - time * way, end = start + way;
      const Vector3d bodyBefore =
          motion.before.rotation.transpose() * (start - motion.before.translation);
      const Vector3d bodyNow = motion.now.rotation.transpose() * (end - motion.now.translation);
      EXPECT_LT((bodyBefore - bodyNow).norm(), 1e-14);
    }
  }
}

TEST(ContactMotions, BadVerticesThrowAndNothingIsAdded) {
  Random random(195);
  const TestGeometry line = thread(random, 40, 0.1, 0.01, false),
                     sheets = testGeometry(sheet(6, 0.5, 0.3));
  const CollisionData contacts = answer(line, sheets, {Method::Proximity, 0.1, Contacts::All});
  OctreeBasedCD detection;
  const GeometryId thread = line.addTo(detection),
                   ball = detection.addAnalyticalGeometry(Sphere{{0.5, 0.5, 0.5}, 0.4});
  detection.addCollisionPair(thread, ball, {Method::Proximity, 0.1, Contacts::All});
  detection.detectCollision();
  const CollisionData& ofShape = detection.collisionData(thread, ball);
  ASSERT_FALSE(ofShape.shape().empty());
  std::vector<ContactMotion> motions(3);
  const SolverVertices all{0, line.positions, line.positions},
      other{0, sheets.positions, sheets.positions};
  const std::span<const Vector3d> one(line.positions.data(), 1);
  const std::vector<double> two(2, 0.01);
  using enum ErrorCode;
  struct Bad {
    ErrorCode code;
    const CollisionData& data;
    ContactSide a, b;
  };
  for (const Bad& bad :
       {Bad{WrongPositionCount, contacts, {{0, one, line.positions}}, {other}},
        Bad{WrongPositionCount, contacts, {{0, line.positions, one}}, {other}},
        Bad{WrongPositionCount, contacts, {all}, {}},
        Bad{WrongPositionCount, ofShape, {{0, one, one}}, {}},
        Bad{WrongPositionCount, ofShape, {}, {}}, Bad{InvalidRadius, contacts, {all, two}, {other}},
        Bad{InvalidRadius, contacts, {all}, {other, two}}}) {
    expectRefused(bad.code, "", [&] { appendMotions(bad.data, bad.a, bad.b, motions); });
    EXPECT_EQ(motions.size(), 3u);
  }
  appendMotions(contacts, {all}, {other}, motions);
  EXPECT_GT(motions.size(), 3u);
}

// Tangents ---------------------------------------------------------------------------------------

void expectFrame(const Tangents& tangents, const Vector3d& normal) {
  constexpr double kUlps = 4 * std::numeric_limits<double>::epsilon();
  for (const Vector3d& tangent : tangents) {
    EXPECT_NEAR(tangent.norm(), 1, kUlps);
    EXPECT_NEAR(tangent.dot(normal), 0, kUlps);
  }
  EXPECT_NEAR(tangents[0].dot(tangents[1]), 0, kUlps);
  EXPECT_LT((tangents[0].cross(tangents[1]) - normal).norm(), 2 * kUlps);
}

double change(const Tangents& a, const Tangents& b) {
  return std::max((a[0] - b[0]).norm(), (a[1] - b[1]).norm());
}

Vector3d direction(double polar, double azimuth) {
  return {std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth),
          std::cos(polar)};
}

TEST(Tangents, AreRightHandedForEveryNormal) {
  Random random(196);
  for (int i = 0; i < 20000; ++i) {
    const Vector3d normal = randomPoint(random, -1, 1).normalized();
    expectFrame(tangentsOf(normal), normal);
  }
  for (double away = 1; away > 1e-320; away /= 7)  // towards the normal -z
    for (int azimuth = 0; azimuth < 12; ++azimuth) {
      Vector3d normal = away * direction(pi / 2, azimuth * pi / 6 + 0.1);
      normal.z() = -1;
      normal /= normal.norm();
      expectFrame(tangentsOf(normal), normal);
    }
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {1.0, -1.0})
      expectFrame(tangentsOf(sign * Vector3d::Unit(axis)), sign * Vector3d::Unit(axis));
  EXPECT_EQ(tangentsOf(Vector3d::UnitZ()), (Tangents{Vector3d::UnitX(), Vector3d::UnitY()}));
  EXPECT_EQ(tangentsOf(-Vector3d::UnitZ()), (Tangents{-Vector3d::UnitX(), Vector3d::UnitY()}));
}

TEST(Tangents, FixedRuleBoundsTheirChange) {
  // Along circles of latitude, where they change most, along meridians, and at random.
  Random random(197);
  double sharpest = 0;
  for (double polar = 0.01; polar < pi - 0.001; polar += 0.01)
    for (int i = 0; i < 20; ++i) {
      const double azimuth = uniform(random, -pi, pi);
      const Vector3d normal = direction(polar, azimuth);
      const double e = 1e-5 * (normal + Vector3d::UnitZ()).norm();
      for (const Vector3d& next :
           {direction(polar + e, azimuth), direction(polar, azimuth + e / std::sin(polar)),
            Vector3d((normal + e * randomPoint(random, -0.5, 0.5)).normalized())}) {
        const double angle = (next - normal).norm();
        const double bound = 2 * angle / (normal + Vector3d::UnitZ()).norm();
        const double found = change(tangentsOf(normal), tangentsOf(next));
        EXPECT_LT(found, 1.001 * bound + 1e-15);
        sharpest = std::max(sharpest, found / bound);
      }
    }
  EXPECT_GT(sharpest, 0.99) << "the bound is attained";
}

TEST(Tangents, CarriedOverTheyTurnAtMostAsTheNormalDoes) {
  // A spiral over all directions from z to -z and back, its speed uneven.
  Tangents tangents = tangentsOf(Vector3d::UnitZ());
  Vector3d normal = Vector3d::UnitZ();
  Random random(198);
  constexpr int kFrames = 40000;
  for (int frame = 1; frame <= kFrames; ++frame) {
    const double polar = 2 * pi * frame / kFrames;
    const Vector3d next =
        (direction(polar, 200 * polar) + 1e-3 * (frame % 3) * randomPoint(random, -1, 1))
            .normalized();
    const Tangents carried = tangentsOf(next, tangents);
    expectFrame(carried, next);
    EXPECT_LE(change(carried, tangents), (next - normal).norm() + 0x1p-40);
    tangents = carried;
    normal = next;
  }
  // Any two normals, opposite and nearly opposite ones among them.
  for (int i = 0; i < 20000; ++i) {
    const Vector3d from = randomPoint(random, -1, 1).normalized();
    const double off = i % 4 == 0 ? 2 : std::ldexp(1.0, -(i % 60));
    const Vector3d to =
        i == 3 ? Vector3d(-from) : Vector3d((off * randomPoint(random, -1, 1) - from).normalized());
    const Tangents start = tangentsOf(from), end = tangentsOf(to, start);
    expectFrame(end, to);
    EXPECT_LE(change(end, start), (to - from).norm() + 0x1p-40);
  }
}

TEST(Tangents, TurnByTheSolidAngleOfALoop) {
  // x to y to z to x, an eighth of the sphere.
  Tangents tangents{Vector3d::UnitY(), Vector3d::UnitZ()};
  const std::array<Vector3d, 4> corners{Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ(),
                                        Vector3d::UnitX()};
  for (std::size_t leg = 0; leg < 3; ++leg)
    for (int i = 1; i <= 50; ++i) {
      const double angle = i * pi / 100;
      tangents =
          tangentsOf(std::cos(angle) * corners[leg] + std::sin(angle) * corners[leg + 1], tangents);
    }
  EXPECT_LT((tangents[0] - Vector3d::UnitZ()).norm(), 1e-13);
  EXPECT_LT((tangents[1] + Vector3d::UnitY()).norm(), 1e-13);
}

TEST(Tangents, WithoutPreviousTangentsTheFixedRuleApplies) {
  const Vector3d normal = Vector3d(0.3, -0.5, 0.2).normalized();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Vector3d& none : {Vector3d(0, 0, 0), Vector3d(nan, nan, nan)})
    EXPECT_EQ(tangentsOf(normal, {none, none}), tangentsOf(normal));
  // Opposite: the first stays and the second turns.
  const Tangents start = tangentsOf(normal), end = tangentsOf(-normal, start);
  EXPECT_LT((end[0] - start[0]).norm(), 1e-15);
  EXPECT_LT((end[1] + start[1]).norm(), 1e-15);
}

}  // namespace
}  // namespace palpate::testing
