#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Common/DegenerateCases.h"

#include <gtest/gtest.h>

// Whole frames of each degenerate case, by every method. The contacts match brute force bit for
// bit, for any number of threads and every kind of octree update.

namespace palpate {
namespace {

using namespace testing;

/// Two frames, there and back, so that octrees are refitted.
struct Truth {
  std::vector<Rows> there, back;
};

void stepThere(PairRun& run, const DegenerateCase& input) {
  run.step(input.aBefore(), input.a.positions, input.bBefore(), input.b.positions);
}
void stepBack(PairRun& run, const DegenerateCase& input) {
  run.step(input.a.positions, input.aBefore(), input.b.positions, input.bBefore());
}

Truth truthOf(const DegenerateCase& input, const PairSettings& settings) {
  PairRun run(settingsOf(Engine::BruteForce), input.a, input.b, settings, !input.large);
  Truth truth;
  stepThere(run, input);
  run.expectWellFormed(input.a, input.b);
  truth.there = run.answers();
  stepBack(run, input);
  truth.back = run.answers();
  return truth;
}

void expectTruth(PairRun& run, const DegenerateCase& input, const Truth& truth) {
  stepThere(run, input);
  expectSame(run.answers(), truth.there);
  run.detect();  // without new positions both stay
  expectSame(run.answers(), truth.there);
  stepBack(run, input);
  expectSame(run.answers(), truth.back);
}

class DegenerateCases : public ::testing::TestWithParam<MethodCase> {
 protected:
  static PairSettings settingsFor(const DegenerateCase& input) {
    PairSettings settings = GetParam().settings;
    settings.thickness *= input.thickness;
    return settings;
  }
};

TEST_P(DegenerateCases, EachCaseMatchesBruteForce) {
  std::size_t met = 0, number = 0;
  for (const DegenerateCase& input : degenerateCases()) {
    SCOPED_TRACE(input.name);
    const PairSettings settings = settingsFor(input);
    if (isLeftOut(number++)) continue;
    const Truth truth = truthOf(input, settings);
    met += truth.there.front().anything();
    for (const Settings& octree : octreeSettings()) {
      SCOPED_TRACE(nameOf(octree));
      PairRun run(octree, input.a, input.b, settings, !input.large);
      expectTruth(run, input, truth);
    }
  }
  EXPECT_GE(met, leastOf(20));
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, DegenerateCases, ::testing::ValuesIn(methodCases(1.0)),
                         [](const auto& method) { return method.param.name; });

/// Counts that follow from the definitions of some cases, so that both engines cannot be wrong
/// alike.
TEST(DegenerateCaseDefinitions, MatchTheDefinition) {
  for (const DegenerateCase& input : degenerateCases()) {
    SCOPED_TRACE(input.name);
    const auto rowsOf = [&](const PairSettings& settings) {
      PairRun run(settingsOf(Engine::Octree), input.a, input.b, settings, false);
      stepThere(run, input);
      return run.answers().front();
    };
    const Rows intersection = rowsOf({Method::Intersection, 0, Contacts::All}),
               distinct = rowsOf({Method::Proximity, input.thickness, Contacts::Distinct});
    if (input.name == "vertex exactly on face") {
      EXPECT_EQ(intersection.intersectingTriangles.size(), 3u);
      EXPECT_EQ(intersection.contacts(), 1u);
    } else if (input.name == "vertex exactly on vertex") {
      EXPECT_GE(intersection.contacts(), 6u);  // both vertices, and edges of both
      EXPECT_EQ(distinct.vertexTriangle.size(), 1u);
    } else if (input.name == "one closed mesh inside another") {
      EXPECT_EQ(intersection.contacts() + distinct.contacts(), 0u);
    } else if (input.name == "one closed mesh inside another, reached") {
      EXPECT_EQ(intersection.contacts(), 0u);
      EXPECT_GT(distinct.contacts(), 0u);
    } else if (input.name == "empty mesh" || input.name == "two empty meshes") {
      EXPECT_EQ(intersection.contacts() + distinct.contacts(), 0u);
    } else if (input.name == "one triangle twice named") {
      EXPECT_EQ(intersection.intersectingTriangles.size(), 24u * 24u);
      EXPECT_EQ(distinct.vertexTriangle.size(), 3u);
      EXPECT_EQ(distinct.contacts(), 3u);
    }
  }
}

}  // namespace
}  // namespace palpate
