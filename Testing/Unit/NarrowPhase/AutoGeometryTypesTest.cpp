#include <palpate/OctreeBasedCD.h>

#include "Common/ContactRows.h"
#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Common/TestGeometry.h"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <utility>
#include <vector>

// Method::Auto, the default, for every pair of geometry types. It is accepted where any other
// method is. Its contacts are those of Method::Continuous where features move, and of
// Method::Proximity where they rest.

namespace palpate::testing {
namespace {

using Eigen::Matrix3d;

/// A geometry of any type, shapes and tetrahedra too, with both ends of a step.
struct Body {
  std::string name;
  std::function<GeometryId(OctreeBasedCD&)> add;
  Positions before, now;  ///< empty for a shape
  Vector3d movedBy = Vector3d::Zero();
  Matrix3d turnedBy = Matrix3d::Identity();

  bool isShape() const { return before.empty(); }
  void place(OctreeBasedCD& collisions, GeometryId id, bool moves) const {
    if (isShape()) {
      const Matrix3d one = Matrix3d::Identity();
      collisions.setTransform(id, {one, Vector3d::Zero()});
      if (!moves) return;
      collisions.advance();
      collisions.setTransform(id, {turnedBy, movedBy});
    } else {
      collisions.setPositions(id, before, moves ? now : before);
    }
  }
};

Body bodyOf(Random& random, std::string name, TestGeometry geometry) {
  Body body{std::move(name), {}, geometry.positions, moved(random, geometry.positions, 0.08)};
  body.add = [geometry](OctreeBasedCD& collisions) { return geometry.addTo(collisions); };
  return body;
}

Body bodyOf(std::string name, const AnalyticalGeometry& shape) {
  Body body{std::move(name), {}, {}, {}};
  body.add = [shape](OctreeBasedCD& c) { return c.addAnalyticalGeometry(shape); };
  body.movedBy = {0.1, -0.05, 0.08};
  body.turnedBy << 0.8, -0.6, 0, 0.6, 0.8, 0, 0, 0, 1;
  return body;
}

Body tetrahedra(Random& random) {
  Positions positions;
  std::vector<Tetrahedron> all;
  for (std::uint32_t t = 0; t < 12; ++t) {
    const Vector3d centre = randomPoint(random, 0.2, 0.8);
    for (int i = 0; i < 4; ++i) positions.push_back(centre + randomPoint(random, -0.2, 0.2));
    all.push_back({4 * t, 4 * t + 1, 4 * t + 2, 4 * t + 3});
  }
  Body body{"tetrahedra", {}, positions, moved(random, positions, 0.08)};
  body.add = [positions, all](OctreeBasedCD& c) { return c.addTetrahedralMesh(positions, all); };
  return body;
}

std::vector<Body> bodies(Random& random) {
  std::vector<Body> all;
  all.push_back(bodyOf(random, "triangles", testGeometry(sphere(6, 8, {0.5, 0.5, 0.5}, 0.35))));
  all.push_back(bodyOf(random, "lines", thread(random, 40, 0.15, 0.0, false)));
  all.push_back(bodyOf(random, "thick lines", thread(random, 40, 0.15, 0.02, true)));
  all.push_back(bodyOf(random, "points", particles(random, 80, 0.0)));
  all.push_back(bodyOf(random, "thick points", particles(random, 60, 0.03)));
  all.push_back(
      bodyOf(random, "tapered lines", tapered(random, thread(random, 40, 0.15, 0, false), 0.04)));
  all.push_back(tetrahedra(random));
  all.push_back(bodyOf("sphere", Sphere{{0.5, 0.5, 0.5}, 0.2}));
  all.push_back(bodyOf("plane", Plane{{0.5, 0.5, 0.4}, {0, 0, 1}}));
  all.push_back(bodyOf("box", Box{{0.45, 0.5, 0.4}, {0.15, 0.2, 0.1}}));
  all.push_back(bodyOf("cylinder", Cylinder{{0.5, 0.5, 0.2}, {0.5, 0.5, 0.7}, 0.15}));
  return all;
}

/// One pair in one step.
class Pair {
 public:
  Pair(const Body& a, const Body& b, const PairSettings& settings, Engine engine = Engine::Octree,
       int threads = 1)
      : m_self(&a == &b), m_first(a), m_second(b), m_collisions(settingsOf(engine, threads)) {
    m_a = a.add(m_collisions);
    m_b = m_self ? m_a : b.add(m_collisions);
    m_collisions.addCollisionPair(m_a, m_b, settings);
  }
  const CollisionData& detect(bool moves) {
    if (m_first.isShape() || m_second.isShape()) {
      // Shapes are placed before the step and in it. For other geometries both ends are set.
      for (const auto& [body, id] : both()) body->place(m_collisions, id, false);
      m_collisions.advance();
      for (const auto& [body, id] : both()) {
        if (!moves) continue;
        if (body->isShape())
          m_collisions.setTransform(id, {body->turnedBy, body->movedBy});
        else
          m_collisions.setPositions(id, body->before, body->now);
      }
    } else {
      for (const auto& [body, id] : both()) body->place(m_collisions, id, moves);
    }
    m_collisions.detectCollision();
    return m_collisions.collisionData(m_a, m_b);
  }

 private:
  std::vector<std::pair<const Body*, GeometryId>> both() const {
    if (m_self) return {{&m_first, m_a}};
    return {{&m_first, m_a}, {&m_second, m_b}};
  }

  bool m_self;
  const Body &m_first, &m_second;
  OctreeBasedCD m_collisions;
  GeometryId m_a{}, m_b{};
};

bool accepts(const Body& a, const Body& b, const PairSettings& settings) {
  try {
    Pair(a, b, settings);
    return true;
  } catch (const Error&) {
    return false;
  }
}

void expectSameContacts(const CollisionData& found, const CollisionData& truth) {
  expectSameRows(Rows(found), Rows(truth));
  EXPECT_TRUE(std::equal(found.shape().begin(), found.shape().end(), truth.shape().begin(),
                         truth.shape().end()));
  EXPECT_TRUE(std::equal(found.shapeShape().begin(), found.shapeShape().end(),
                         truth.shapeShape().begin(), truth.shapeShape().end()));
}

bool isOfTriangles(const Body& body) {
  return body.name == "triangles" || body.name == "tetrahedra";
}

template <class F>
void forEachPair(F&& f) {
  Random random(5);
  const std::vector<Body> all = bodies(random);
  for (const Body& a : all)
    for (const Body& b : all) {
      SCOPED_TRACE(a.name + " and " + b.name);
      f(a, b);
      if (::testing::Test::HasFailure()) return;
    }
}

TEST(AutoGeometryTypes, AutoIsAcceptedWhereAnyOtherMethodIs) {
  std::size_t refused = 0;
  forEachPair([&](const Body& a, const Body& b) {
    for (const double thickness : {0.0, 0.1}) {
      bool any = false;
      for (const Method method : {Method::Proximity, Method::Continuous, Method::Intersection})
        any |= accepts(a, b, {method, method == Method::Intersection ? 0.0 : thickness});
      EXPECT_EQ(accepts(a, b, {Method::Auto, thickness}), any);
      refused += !any;
    }
  });
  EXPECT_EQ(refused, 2u * 4u);  // each shape with itself
}

TEST(AutoGeometryTypes, ContactsMatchTheReportedMethod) {
  std::size_t number = 0, contacts = 0, continuous = 0,
              proximity = 0;  // the last two: pairs with contacts
  forEachPair([&](const Body& a, const Body& b) {
    if (isOfTriangles(a) && isOfTriangles(b)) return;  // AutoTest.cpp
    for (const double thickness : {0.0, 0.05})
      for (const Contacts which : {Contacts::Distinct, Contacts::All}) {
        const PairSettings automatic{Method::Auto, thickness, which};
        if (!accepts(a, b, automatic)) continue;
        for (const bool moves : {false, true}) {
          if (isLeftOut(number++)) continue;
          Pair pair(a, b, automatic);
          const CollisionData found = pair.detect(moves);
          const Validity& validity = found.validity();
          PairSettings named = automatic;
          named.method = Method::Proximity;
          const bool hasProximity = accepts(a, b, named);
          named.method = Method::Continuous;
          const bool hasContinuous = accepts(a, b, named);
          named.method =
              (moves && hasContinuous) || !hasProximity ? Method::Continuous : Method::Proximity;
          EXPECT_EQ(validity.method, named.method);
          EXPECT_EQ(validity.reason,
                    !moves && hasProximity ? MethodReason::Still : MethodReason::NoAlternative);
          EXPECT_EQ(validity.displacement > 0.0, moves);
          const CollisionData byName = Pair(a, b, named).detect(moves);
          expectSameContacts(found, byName);
          EXPECT_EQ(validity.trusted, byName.validity().trusted);
          EXPECT_EQ(validity.sideMayBeWrong, !validity.trusted);
          expectSameContacts(found, Pair(a, b, automatic, Engine::BruteForce).detect(moves));
          expectSameContacts(found, Pair(a, b, automatic, Engine::Octree, 8).detect(moves));
          const std::size_t count =
              Rows(found).contacts() + found.shape().size() + found.shapeShape().size();
          contacts += count;
          (named.method == Method::Continuous ? continuous : proximity) += count > 0;
        }
      }
  });
  EXPECT_GE(contacts, leastOf(5000));
  EXPECT_GE(continuous, leastOf(50));
  EXPECT_GE(proximity, leastOf(50));
}

/// The method changes from frame to frame, and with it the boxes of the octrees.
TEST(AutoGeometryTypes, MethodMayChangeFromFrameToFrame) {
  forEachPair([&](const Body& a, const Body& b) {
    if (isOfTriangles(a) && isOfTriangles(b)) return;
    const PairSettings automatic{Method::Auto, 0.05};
    if (!accepts(a, b, automatic) || a.isShape() || b.isShape()) return;
    Pair pair(a, b, automatic);
    for (const bool moves : {false, true, true, false, true, false})
      expectSameContacts(pair.detect(moves), Pair(a, b, automatic).detect(moves));
  });
}

/// The motion tolerance belongs to Auto. Other methods refuse it by name, unless it is negative.
TEST(AutoGeometryTypes, OtherMethodsRefuseAMotionTolerance) {
  OctreeBasedCD collisions;
  const Mesh organ = sheet(2, 0.0, 0.0);
  const GeometryId a = collisions.addTriangleMesh(organ.positions, organ.triangles),
                   b = collisions.addTriangleMesh(organ.positions, organ.triangles);
  const std::pair<Method, std::string> methods[] = {{Method::Intersection, "Intersection"},
                                                    {Method::Proximity, "Proximity"},
                                                    {Method::Continuous, "Continuous"}};
  for (const auto& [method, name] : methods)
    for (const double tolerance : {0.0, 0.25}) {
      try {
        collisions.addCollisionPair(a, b,
                                    {.method = method,
                                     .thickness = 0.1,
                                     .contacts = Contacts::Distinct,
                                     .automatic = {.motionTolerance = tolerance}});
        ADD_FAILURE() << name << " accepts a tolerance";
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::InvalidSettings);
        EXPECT_NE(std::string(error.what()).find("motionTolerance is "), std::string::npos);
        EXPECT_NE(std::string(error.what()).find("Method::" + name), std::string::npos);
      }
      EXPECT_TRUE(collisions.pairs().empty());
    }
  collisions.addCollisionPair(a, b,
                              {.method = Method::Proximity,
                               .thickness = 0.1,
                               .contacts = Contacts::Distinct,
                               .automatic = {.motionTolerance = -2.0}});
  collisions.setPairSettings(a, b,
                             {.method = Method::Auto,
                              .thickness = 0.1,
                              .contacts = Contacts::Distinct,
                              .automatic = {.motionTolerance = 0.25}});
  EXPECT_THROW(collisions.setPairSettings(a, b,
                                          {.method = Method::Continuous,
                                           .thickness = 0.1,
                                           .contacts = Contacts::Distinct,
                                           .automatic = {.motionTolerance = 0.25}}),
               Error);
  EXPECT_EQ(collisions.pairs()[0].settings.automatic.motionTolerance, 0.25);
}

/// A first pair of a new user: a suture against itself and against an organ, with default settings.
TEST(AutoGeometryTypes, SutureNeedsNoSettings) {
  OctreeBasedCD collisions;
  const Mesh organ = sheet(6, 0.0, 0.0);
  const GeometryId tissue = collisions.addTriangleMesh(organ.positions, organ.triangles);
  const Positions above{{0.2, 0.2, 0.5}, {0.5, 0.5, 0.5}, {0.8, 0.2, 0.5}};
  const GeometryId suture = collisions.addLineMesh(above, std::vector<Segment>{{0, 1}, {1, 2}});
  collisions.addCollisionPair(suture, tissue);
  collisions.addCollisionPair(suture, suture);
  Positions pulled = above;
  pulled[1][2] = -0.5;
  collisions.setPositions(suture, above, pulled);
  collisions.detectCollision();
  const CollisionData& data = collisions.collisionData(suture, tissue);
  ASSERT_FALSE(data.vertexTriangle().empty());
  EXPECT_EQ(data.vertexTriangle()[0].vertex, 1u);
  EXPECT_EQ(data.validity().method, Method::Continuous);
  EXPECT_EQ(data.validity().reason, MethodReason::NoAlternative);
}

}  // namespace
}  // namespace palpate::testing
