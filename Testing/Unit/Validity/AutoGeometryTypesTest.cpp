#include <palpate/OctreeBasedCD.h>

#include "Common/Sanitized.h"
#include "Common/StepBodies.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

// Method::Auto, the default, for every pair of geometry types. Its contacts are those of
// Method::Continuous where features move, and of Method::Proximity where they rest.

namespace palpate::testing {
namespace {

bool accepts(const StepBody& a, const StepBody& b, const PairSettings& settings) {
  OctreeBasedCD collisions;
  const GeometryId first = a.add(collisions), second = &a == &b ? first : b.add(collisions);
  try {
    collisions.addCollisionPair(first, second, settings);
    a.move(collisions, first);
    return true;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::UnsupportedMethod);
    return false;
  }
}

/// The bodies at rest, and the same in a step.
std::array<std::vector<StepBody>, 2> restingAndMoving() {
  std::array<std::vector<StepBody>, 2> all;
  for (const std::size_t moves : {0, 1}) {
    Random random(5);
    all[moves] = bodiesOfEveryType(random, 0.08 * static_cast<double>(moves));
  }
  return all;
}

/// Calls f(a, b) with the indices of all pairs but those of two triangle meshes (AutoTest.cpp).
template <class F>
void forEachPair(const std::vector<StepBody>& all, F&& f) {
  for (std::size_t a = 0; a < all.size(); ++a)
    for (std::size_t b = 0; b < all.size(); ++b) {
      if (all[a].type == GeometryType::Triangles && all[b].type == all[a].type) continue;
      SCOPED_TRACE(all[a].name + " and " + all[b].name);
      f(a, b);
      if (::testing::Test::HasFailure()) return;
    }
}

TEST(AutoGeometryTypes, ContactsMatchTheReportedMethod) {
  std::size_t number = 0, contacts = 0, continuous = 0,
              proximity = 0;  // the last two: pairs with contacts
  const auto bodies = restingAndMoving();
  forEachPair(bodies[0], [&](std::size_t first, std::size_t second) {
    for (const bool moves : {false, true})
      for (const double thickness : {0.0, 0.05})
        for (const Contacts which : {Contacts::Distinct, Contacts::All}) {
          const StepBody &a = bodies[moves][first], &b = bodies[moves][second];
          if (isLeftOut(number++)) continue;
          PairSettings settings{Method::Proximity, thickness, which};
          const bool hasProximity = accepts(a, b, settings);
          settings.method = Method::Continuous;
          const bool hasContinuous = accepts(a, b, settings);
          settings.method = Method::Auto;
          ASSERT_EQ(accepts(a, b, settings), hasProximity || hasContinuous);
          if (!hasProximity && !hasContinuous) continue;
          const CollisionData found = stepOf({}, a, b, settings);
          const Validity& validity = found.validity();
          settings.method =
              (moves && hasContinuous) || !hasProximity ? Method::Continuous : Method::Proximity;
          EXPECT_EQ(validity.method, settings.method);
          EXPECT_EQ(validity.reason,
                    !moves && hasProximity ? MethodReason::Still : MethodReason::NoAlternative);
          EXPECT_EQ(validity.displacement > 0.0, moves);
          const CollisionData byName = stepOf({}, a, b, settings);
          expectSameContacts(found, byName);
          EXPECT_EQ(validity.trusted, byName.validity().trusted);
          EXPECT_EQ(validity.sideMayBeWrong, !validity.trusted);
          const std::size_t count =
              Rows(found).contacts() + found.shape().size() + found.shapeShape().size();
          contacts += count;
          (settings.method == Method::Continuous ? continuous : proximity) += count > 0;
        }
  });
  EXPECT_GT(contacts, leastOf(5000));
  EXPECT_GT(continuous, leastOf(50));
  EXPECT_GT(proximity, leastOf(50));
}

/// The method changes from frame to frame, and with it the boxes of the octrees.
TEST(AutoGeometryTypes, MethodMayChangeFromFrameToFrame) {
  const auto bodies = restingAndMoving();
  const PairSettings automatic{Method::Auto, 0.05};
  std::size_t number = 0;
  forEachPair(bodies[0], [&](std::size_t first, std::size_t second) {
    if (isLeftOut(number++) || !accepts(bodies[1][first], bodies[1][second], automatic)) return;
    OctreeBasedCD collisions;
    const GeometryId a = bodies[0][first].add(collisions),
                     b = first == second ? a : bodies[0][second].add(collisions);
    collisions.addCollisionPair(a, b, automatic);
    for (const bool moves : {false, true, true, false, true, false}) {
      bodies[moves][first].move(collisions, a);
      if (a != b) bodies[moves][second].move(collisions, b);
      collisions.detectCollision();
      expectSameContacts(collisions.collisionData(a, b),
                         stepOf({}, bodies[moves][first], bodies[moves][second], automatic));
    }
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
