#include "Common/StepBodies.h"

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
  EXPECT_GE(contacts, leastOf(5000));
  EXPECT_GE(continuous, leastOf(50));
  EXPECT_GE(proximity, leastOf(50));
}

}  // namespace
}  // namespace palpate::testing
