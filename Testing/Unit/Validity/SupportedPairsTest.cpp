#include "Validity/Support.h"

#include "Common/SupportedMethods.h"

// The table of support: what it has is accepted, and every row answers as brute force does, with
// any number of threads. A new row gets these tests.

namespace palpate::testing {
namespace {

class SupportedPairsOf : public ::testing::TestWithParam<std::size_t> {};

TEST_P(SupportedPairsOf, AnswerAsBruteForceWithAnyNumberOfThreads) {
  const SupportedPairs& row = kSupport[GetParam()];
  // A surface proxy takes a tenth of a second to build, so that fewer cases of it run.
  const std::size_t step = row.kind == PairKind::Proxy ? 7 : 1;
  std::size_t number = 0, contacts = 0;
  for (const double motion : {0.0, 0.05}) {
    Random random(91);
    std::vector<StepBody> all = bodiesOfEveryType(random, motion);
    for (StepBody& body : bodiesWithField(Vector3d::Constant(-motion)))
      all.push_back(std::move(body));
    for (const StepBody& a : all)
      for (const StepBody& b : all) {
        if (!answers(row, a, b)) continue;
        for (int i = 0; i < 2; ++i, ++number) {
          if (number % step != 0 || isLeftOut(number / step)) continue;
          SCOPED_TRACE(a.name + " with " + b.name + ", motion " + std::to_string(motion) +
                       ", case " + std::to_string(number));
          const CollisionData truth = expectEveryEngine(a, b, caseOf(row, number));
          contacts += Rows(truth).contacts() + truth.shape().size() + truth.shapeShape().size() +
                      (truth.earliestTimeOfImpact() <= 1);
          if (HasFailure()) return;
        }
      }
  }
  EXPECT_GE(contacts, leastOf(50));
}

INSTANTIATE_TEST_SUITE_P(EveryRow, SupportedPairsOf,
                         ::testing::Range(std::size_t{0}, std::size(kSupport)),
                         [](const auto& row) {
                           return std::string(toString(kSupport[row.param].method)) +
                                  std::to_string(row.param);
                         });

/// Every method and every two geometries without a field. Two planes are refused, and radii of
/// vertices where the row needs one.
TEST(SupportedPairs, AreThoseThatTheCodeAccepts) {
  Random random(1);
  const std::vector<StepBody> all = bodiesOfEveryType(random, 0.0);
  for (const Method method :
       {Method::Intersection, Method::Proximity, Method::Continuous, Method::Proxy, Method::Auto})
    for (const StepBody& a : all)
      for (const StepBody& b : all) {
        SCOPED_TRACE(std::string(toString(method)) + ": " + a.name + " with " + b.name);
        const bool itself = &a == &b;
        OctreeBasedCD detection;
        const GeometryId first = a.add(detection), second = itself ? first : b.add(detection);
        PairSettings settings{method, 1.0};
        if (method == Method::Proxy) settings.allowedError = 1.0;
        bool isAccepted = true;
        try {
          detection.addCollisionPair(first, second, settings);
        } catch (const Error& error) {
          EXPECT_EQ(error.code(), ErrorCode::UnsupportedMethod);
          isAccepted = false;
        }
        const SupportedPairs* const row = supportOf(method, a.type, b.type, itself);
        const bool arePlanes = a.name.ends_with("plane") && b.name.ends_with("plane"),
                   hasOneRadius = a.radii.size() < 2 && b.radii.size() < 2;
        EXPECT_EQ(isAccepted, row && !arePlanes && (hasOneRadius || !row->has(kOneRadius)));
      }
}

/// Auto, the default, answers every pair that any other method answers.
TEST(SupportedPairs, AutoAnswersAll) {
  constexpr GeometryType kTypes[] = {GeometryType::Triangles, GeometryType::Lines,
                                     GeometryType::Points, GeometryType::Shape,
                                     GeometryType::Field};
  for (const SupportedPairs& row : kSupport)
    for (const GeometryType a : kTypes)
      for (const GeometryType b : kTypes)
        for (const bool itself : {false, true})
          if (supportOf(row.method, a, b, itself)) {
            EXPECT_TRUE(supportOf(Method::Auto, a, b, itself)) << toString(row.method);
          }
}

}  // namespace
}  // namespace palpate::testing
