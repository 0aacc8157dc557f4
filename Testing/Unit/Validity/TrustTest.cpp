#include <palpate/FeaturePairs.h>
#include <palpate/SpatialQueries.h>

#include "Common/ShapeTruth.h"
#include "Common/TestGeometry.h"

#include <map>
#include <numbers>

// Trust of pairs with lines, points and shapes. The truth is sampled: SpatialQueries::distance() at
// many times of the step, where bodies that turn are on their arcs.

namespace palpate::testing {
namespace {

constexpr int kSamples = 48;

/// One geometry of a pair and its step, in which a placed body turns evenly about an axis and
/// slides along it.
struct Body {
  std::optional<AnalyticalGeometry> shape;
  TestGeometry geometry;
  bool placed = false;
  Positions before, now;  ///< in the body's frame
  Place pose;             ///< before the step
  Vector3d axis = Vector3d::UnitX(), through = Vector3d::Zero(), slide = Vector3d::Zero();
  double angle = 0;

  GeometryId addTo(OctreeBasedCD& collisions) const {
    return shape ? collisions.addAnalyticalGeometry(*shape) : geometry.addTo(collisions);
  }
  Place poseAt(double s) const { return pose.then(axis, s * angle, through, s * slide); }
  /// Places it where it is at the time s of its step.
  void placeAt(double s, OctreeBasedCD& collisions, GeometryId id) const {
    if (placed) {
      const Place at = poseAt(s);
      collisions.setTransform(id, at.pose());
      return;
    }
    Positions positions = before;
    for (std::size_t v = 0; v < before.size(); ++v) positions[v] = (1 - s) * before[v] + s * now[v];
    collisions.setPositions(id, positions);
  }
  /// A vertex on the straight way that the library takes.
  Vector3d at(std::uint32_t v, double s) const {
    if (!placed) return (1 - s) * before[v] + s * now[v];
    return (1 - s) * pose(before[v]) + s * poseAt(1)(before[v]);
  }
  Triangle element(std::uint32_t id) const { return geometry.elements()[id]; }
};

constexpr std::array<const char*, 9> kKinds{"triangles", "lines", "points",   "sphere", "capsule",
                                            "plane",     "box",   "cylinder", "hull"};

Body randomBody(Random& random, int kind) {
  Body body;
  if (kind >= 3) {
    const std::vector<AnalyticalGeometry> shapes = shapesOfEveryKind(random);
    do body.shape = shapes[random() % shapes.size()];
    while (static_cast<int>(body.shape->index()) != kind - 3);
    body.placed = true;
    body.pose = {randomTurn(random), randomPoint(random, 0, 1)};
    return body;
  }
  const double radius = random() % 3 == 0 ? 0.0 : uniform(random, 0, 0.06);
  if (kind == 0) body.geometry = testGeometry(soup(random, 4, 0.3));
  if (kind == 1) body.geometry = thread(random, 4, 0.4, radius, false);
  if (kind == 2) body.geometry = particles(random, 3, radius);
  if (kind != 0 && random() % 4 == 0)
    body.geometry = tapered(random, body.geometry, uniform(random, 0.01, 0.06));
  body.placed = random() % 3 == 0;
  body.before = body.now = body.geometry.positions;
  if (body.placed) body.pose = {randomTurn(random), randomPoint(random, -0.3, 0.3)};
  return body;
}

void move(Random& random, Body& body, double most) {
  if (body.placed) {
    body.axis = randomPoint(random, -1, 1);
    body.through = randomPoint(random, 0, 1);
    body.slide = uniform(random, -most, most) * body.axis.normalized();
    body.angle = random() % 3 == 0 ? 0.0 : uniform(random, -2, 2) * most;
    return;
  }
  const Vector3d all = randomPoint(random, -most, most);
  body.now = body.before;
  for (Vector3d& p : body.now) p += all + randomPoint(random, -0.2, 0.2) * most;
}

/// Moves everything to a coarse grid, where features touch, are parallel and move within planes.
void snap(Body& body) {
  const auto toGrid = [](Vector3d& p) { p = (8 * p).array().round().matrix() / 8; };
  for (Positions* positions : {&body.before, &body.now, &body.geometry.positions})
    for (Vector3d& p : *positions) toGrid(p);
  if (!body.placed) return;
  body.angle = 0;
  body.pose.rotation = Matrix3d::Identity();
  toGrid(body.pose.translation), toGrid(body.slide);
}

void endStep(Body& body) {
  if (body.placed) body.pose = body.poseAt(1);
  body.before = body.now;
}

/// What happened in a step, at sampled times.
struct Truth {
  bool startedApart = true;
  std::vector<std::pair<double, std::array<std::uint32_t, 2>>> touches;  ///< time and elements
};

Truth truthOf(const Body& a, const Body& b) {
  OctreeBasedCD collisions(settingsOf(Engine::BruteForce));
  const GeometryId idA = a.addTo(collisions), idB = b.addTo(collisions);
  Truth truth;
  for (int i = 0; i <= kSamples; ++i) {
    const double s = double(i) / kSamples;
    a.placeAt(s, collisions, idA);
    b.placeAt(s, collisions, idB);
    const GeometryDistance nearest = collisions.queries().distance(idA, idB);
    if (nearest.distance > 0) continue;
    if (i == 0) truth.startedApart = false;
    truth.touches.push_back({s, {nearest.a.element, nearest.b.element}});
  }
  return truth;
}

bool contain(const Triangle& element, std::span<const std::uint32_t> vertices) {
  return std::all_of(vertices.begin(), vertices.end(), [&](std::uint32_t v) {
    return std::find(element.begin(), element.end(), v) != element.end();
  });
}

/// Whether a contact is of features of these two elements.
bool isReported(const CollisionData& data, const Body& a, const Body& b,
                const std::array<std::uint32_t, 2>& elements) {
  if (a.shape && b.shape) return !data.shapeShape().empty();
  if (a.shape || b.shape) {
    const Body& mesh = a.shape ? b : a;
    const auto element = mesh.element(elements[a.shape ? 1 : 0]);
    return std::any_of(data.shape().begin(), data.shape().end(),
                       [&](const auto& c) { return contain(element, c.vertices); });
  }
  const auto ofA = a.element(elements[0]), ofB = b.element(elements[1]);
  const auto any = [](const auto& list, auto&& isOne) {
    return std::any_of(list.begin(), list.end(), isOne);
  };
  return any(data.vertexTriangle(),
             [&](const auto& c) {
               return contain(ofA, {{c.vertex}}) && contain(ofB, c.vertices);
             }) ||
         any(data.triangleVertex(),
             [&](const auto& c) {
               return contain(ofB, {{c.vertex}}) && contain(ofA, c.vertices);
             }) ||
         any(data.edgeEdge(),
             [&](const auto& c) { return contain(ofA, c.edgeA) && contain(ofB, c.edgeB); });
}

/// A normal is right if the features did not pass each other before the contact's time, and it
/// leads from one to the other where they are then, or just before.
void expectSides(const CollisionData& data, const Body& a, const Body& b, bool isAtEnd) {
  using Features = std::array<Vector3d, 4>;
  const auto expectSide = [&](const auto& contact, auto&& featuresAt, auto&& timeOfImpact,
                              auto&& distanceAt) {
    const double t = isAtEnd ? 1.0 : std::max(0.0, contact.timeOfImpact - 1e-6);
    const Features x = featuresAt(0.0), y = featuresAt(1.0), z = featuresAt(t);
    const auto passed =
        timeOfImpact(x[0], x[1], x[2], x[3], y[0], y[1], y[2], y[3], TimeOfImpactSettings{});
    EXPECT_TRUE(!passed || *passed > t - 1e-5) << *passed << " " << t;
    const auto at = distanceAt(z[0], z[1], z[2], z[3]);
    EXPECT_GT(contact.normal.dot(at.difference), 0.0) << at.distance;
  };
  const auto expectVertex = [&](const VertexTriangleContact& c, const Body& of, const Body& other) {
    const auto featuresAt = [&](double s) {
      return Features{of.at(c.vertex, s), other.at(c.vertices[0], s), other.at(c.vertices[1], s),
                      other.at(c.vertices[2], s)};
    };
    expectSide(c, featuresAt, vertexTriangleTimeOfImpact, vertexTriangleDistance);
  };
  for (const VertexTriangleContact& c : data.vertexTriangle()) expectVertex(c, a, b);
  for (const VertexTriangleContact& c : data.triangleVertex()) expectVertex(c, b, a);
  for (const EdgeEdgeContact& c : data.edgeEdge()) {
    const auto featuresAt = [&](double s) {
      return Features{a.at(c.edgeA[0], s), a.at(c.edgeA[1], s), b.at(c.edgeB[0], s),
                      b.at(c.edgeB[1], s)};
    };
    expectSide(c, featuresAt, edgeEdgeTimeOfImpact, edgeEdgeDistance);
  }
  for (const ShapeContact& c : data.shape()) EXPECT_GT(c.distance, -1e-9);
  for (const ShapeShapeContact& c : data.shapeShape()) EXPECT_GT(c.distance, -1e-9);
}

/// Steps by a method, and how many of those that are right are trusted.
struct Tally {
  std::size_t right = 0, trusted = 0, withContacts = 0;
};

PairSettings randomSettings(Random& random) {
  constexpr std::array kMethods{Method::Auto, Method::Continuous, Method::Proximity};
  constexpr std::array kThicknesses{0.0, 0.02, 0.1};
  PairSettings settings{kMethods[random() % 3], kThicknesses[random() % 3]};
  settings.contacts = random() % 2 ? Contacts::All : Contacts::Distinct;
  return settings;
}

void runHistory(Random& random, int kindA, int kindB, std::map<Method, Tally>& tallies) {
  Body a = randomBody(random, kindA), b = randomBody(random, kindB);
  const PairSettings settings = randomSettings(random);
  const bool onGrid = random() % 4 == 0;
  if (onGrid) snap(a), snap(b);
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  const GeometryId idA = a.addTo(collisions), idB = b.addTo(collisions);
  try {
    collisions.addCollisionPair(idA, idB, settings);
  } catch (const Error&) {
    return;  // per-vertex radii by Continuous, Proximity without any distance
  }
  const double most = onGrid ? 0.3 : std::pow(10.0, uniform(random, -4, -0.5));
  for (int step = 0; step < 4; ++step) {
    for (auto [body, id] : {std::pair(&a, idA), std::pair(&b, idB)}) {
      if (random() % 4 == 0 && !body->placed)  // a solver corrected it
        for (Vector3d& p : body->before) p += randomPoint(random, -0.01, 0.01);
      body->angle = 0, body->slide.setZero(), body->now = body->before;
      if (random() % 5 != 0) move(random, *body, most);
      if (onGrid) snap(*body);
      if (body->placed) {
        const Place end = body->poseAt(1);
        collisions.setTransform(id, body->pose.pose(), end.pose());
      } else {
        collisions.setPositions(id, body->before, body->now);
      }
    }
    collisions.detectCollision();
    const CollisionData& data = collisions.collisionData(idA, idB);
    const Validity& validity = data.validity();
    const Truth truth = truthOf(a, b);
    SCOPED_TRACE(::testing::Message()
                 << kKinds[kindA] << " " << kKinds[kindB] << ", method "
                 << toString(settings.method) << ", thickness " << settings.thickness << ", step "
                 << step << ", motion " << most << ", arc " << validity.arcDeviation);
    const bool byProximity = validity.method == Method::Proximity;
    const std::size_t contacts = validity.atEnd + validity.atImpact;
    Tally& tally = tallies[settings.method];
    tally.right += truth.startedApart && validity.arcDeviation <= settings.thickness &&
                   !(byProximity && !truth.touches.empty());
    tally.trusted += validity.trusted;
    tally.withContacts += validity.trusted && contacts > 0;
    EXPECT_EQ(validity.sideMayBeWrong, !validity.trusted);
    if (validity.startedApart) {
      EXPECT_TRUE(truth.startedApart);
    }
    if (!truth.startedApart) {
      EXPECT_FALSE(validity.trusted);
    }
    if (validity.trusted) {
      if (byProximity) {
        EXPECT_TRUE(truth.touches.empty());
      }
      for (const auto& [time, elements] : truth.touches) {
        EXPECT_GT(contacts, 0u);
        if (settings.contacts == Contacts::All) {
          EXPECT_TRUE(isReported(data, a, b, elements)) << "time " << time;
        }
      }
      expectSides(data, a, b, byProximity);
    }
    collisions.advance();
    endStep(a);
    endStep(b);
    if (::testing::Test::HasFailure()) return;
  }
}

TEST(TrustOfTypes, IsNeverGivenToAnAnswerThatMissesATouchOrHasAWrongSide) {
  Random random(7);
  std::map<Method, Tally> tallies;
  for (int kindA = 0; kindA < 9; ++kindA)
    for (int kindB = std::max(1, kindA); kindB < 9; ++kindB) {
      if (kindA == 5 && kindB == 5) continue;  // two planes
      for (int history = 0; history < casesOf(60, 20); ++history) {
        const bool swapped = random() % 2;
        runHistory(random, swapped ? kindB : kindA, swapped ? kindA : kindB, tallies);
        ASSERT_FALSE(HasFailure());
      }
    }
  for (const auto& [method, tally] : tallies) {
    EXPECT_GT(tally.trusted, tally.right / 3) << toString(method);
    EXPECT_GE(tally.withContacts, leastOf(50, 15)) << toString(method);
  }
}

/// Data/cases: a point on an arm of length 10 turns about y, and a wire crosses its arc after 15
/// degrees. Its straight way passes the wire at a distance of 10 (1 - cos(15 degrees)).
struct TurningTip {
  OctreeBasedCD collisions;
  GeometryId tip = collisions.addPointSet(Positions{{10, 0, 0}}, 0.3), wire;

  TurningTip(double radius, double thickness) {
    const Vector3d at = turned(15) * Vector3d(radius, 0, 0);
    const Positions ends{at - Vector3d::UnitY(), at + Vector3d::UnitY()};
    wire = collisions.addLineMesh(ends, std::vector<Segment>{{0, 1}});
    collisions.addCollisionPair(tip, wire, {.thickness = thickness});
    collisions.setTransform(tip, {turned(0), Vector3d::Zero()});
    collisions.advance();
  }
  static Matrix3d turned(double degrees) {
    return Eigen::AngleAxisd(degrees * std::numbers::pi / 180, Vector3d::UnitY())
        .toRotationMatrix();
  }
  /// Contacts, and whether they are trusted.
  std::pair<std::size_t, bool> turnTo(double degrees) {
    collisions.setTransform(tip, {turned(degrees), Vector3d::Zero()});
    collisions.detectCollision();
    const CollisionData& data = collisions.collisionData(tip, wire);
    const std::pair answer(data.vertexTriangle().size(), data.validity().trusted);
    collisions.advance();
    return answer;
  }
};

TEST(TrustOfTypes, TellsAStepWhoseArcMissesAWireFromOneThatIsShortEnough) {
  using Answer = std::pair<std::size_t, bool>;
  // The chord misses the first wire, and hits one that the arc misses.
  EXPECT_EQ(TurningTip(10, 0).turnTo(30), Answer(0, false));
  EXPECT_EQ(TurningTip(10.25, 0).turnTo(30), Answer(0, false));
  EXPECT_EQ(TurningTip(9.5, 0).turnTo(30), Answer(1, false));
  EXPECT_EQ(TurningTip(10, 0.1).turnTo(30), Answer(1, false));
  EXPECT_EQ(TurningTip(10, 0.35).turnTo(30), Answer(1, true));
  EXPECT_EQ(TurningTip(10.25, 0.35).turnTo(30), Answer(1, true));
  // Half of the step is right, and trusted with a thickness of its arcDeviation, 0.086.
  for (const double thickness : {0.0, 0.08, 0.09}) {
    const bool isTrusted = thickness > 0.086;
    EXPECT_EQ(TurningTip(10, thickness).turnTo(15), Answer(1, isTrusted));
    EXPECT_EQ(TurningTip(10.25, thickness).turnTo(15), Answer(1, isTrusted));
    TurningTip away(9.5, thickness);
    EXPECT_EQ(away.turnTo(15), Answer(0, isTrusted));
    EXPECT_EQ(away.turnTo(30), Answer(0, isTrusted));
  }
}

/// A capsule without a thickness, as a shape and as a line with a radius, over a cloth.
TEST(TrustOfTypes, ACapsuleInAClothIsSeenInEachStep) {
  Mesh cloth = sheet(20, 0, 0);
  for (Vector3d& x : cloth.positions) x.z() = 0;
  const Vector3d p(0.31, 0.43, 0), q(0.72, 0.57, 0);
  constexpr double kRadius = 0.05;
  for (const bool isShape : {true, false})
    for (const Method method : {Method::Auto, Method::Continuous})
      for (const double height : {0.06, 0.045, 0.01, -0.04}) {
        SCOPED_TRACE(::testing::Message() << isShape << " " << height);
        OctreeBasedCD collisions;
        const GeometryId sheet = addMesh(collisions, cloth);
        const GeometryId tool =
            isShape
                ? collisions.addAnalyticalGeometry(Capsule{p, q, kRadius})
                : collisions.addLineMesh(Positions{p, q}, std::vector<Segment>{{0, 1}}, kRadius);
        collisions.addCollisionPair(sheet, tool, {.method = method});
        collisions.setTransform(tool, {.translation = {0, 0, height}});
        collisions.advance();
        for (int step = 1; step <= 3; ++step) {
          collisions.setTransform(tool, {.translation = {0, 0, height - 0.001 * step}});
          collisions.detectCollision();
          const CollisionData& data = collisions.collisionData(sheet, tool);
          const bool apart = height > kRadius;
          EXPECT_EQ(data.validity().startedApart, apart);
          EXPECT_EQ(data.validity().trusted, apart);
          EXPECT_EQ(data.validity().sideMayBeWrong, !apart);
          double deepest = 0, time = 0;
          const auto take = [&](const auto& contacts) {
            for (const auto& contact : contacts)
              if (contact.distance < deepest)
                deepest = contact.distance, time = contact.timeOfImpact;
          };
          take(data.shape()), take(data.vertexTriangle()), take(data.triangleVertex());
          take(data.edgeEdge());
          const double depth = kRadius - std::abs(height - 0.001 * (step - 1));
          EXPECT_NEAR(deepest, apart ? 0.0 : -depth, 1e-12);
          EXPECT_EQ(time, 0.0);
          collisions.advance();
        }
      }
}

/// Without thickness and radii. Something falls onto a line along y, and the normals are known.
TEST(TrustOfTypes, NeedsASideWhereNothingHasAThickness) {
  const auto fall = [](TestGeometry falling) {
    const TestGeometry line{GeometryType::Lines, {{0, -1, 0}, {0, 1, 0}}, {}, {{0, 1}}};
    const PairSettings settings{Method::Continuous, 0};
    Positions end = falling.positions;
    for (Vector3d& p : falling.positions) p.z() += 1;
    for (Vector3d& p : end) p.z() -= 1;
    const CollisionData data =
        answer(settingsOf(Engine::Octree), falling, line, settings, end, line.positions);
    const Validity& validity = data.validity();
    EXPECT_TRUE(validity.startedApart);
    EXPECT_EQ(data.vertexTriangle().size() + data.triangleVertex().size() + data.edgeEdge().size(),
              1u);
    for (const auto& c : data.vertexTriangle())
      EXPECT_TRUE(!validity.trusted || c.normal.z() > 0.5) << c.normal.transpose();
    for (const auto& c : data.edgeEdge())
      EXPECT_TRUE(!validity.trusted || c.normal.z() > 0.5) << c.normal.transpose();
    return validity.trusted;
  };
  EXPECT_TRUE(fall({GeometryType::Lines, {{-1, 0, 0}, {1, 0, 0}}, {}, {{0, 1}}}));
  EXPECT_TRUE(fall({GeometryType::Lines, {{-1, 0.5, -0.5}, {1, 0.25, 0.5}}, {}, {{0, 1}}}));
  fall({GeometryType::Lines, {{0, -0.5, 0}, {0, 0.5, 0}}, {}, {{0, 1}}});  // parallel
  fall({GeometryType::Lines, {{0, -0.5, 0}, {0, 0.5, 1}}, {}, {{0, 1}}});  // in one plane
  fall({GeometryType::Points, {{0, 0.25, 0}}, {}, {}});
  fall({GeometryType::Points, {{0, 1, 0}}, {}, {}});  // onto the end
}

}  // namespace
}  // namespace palpate::testing
