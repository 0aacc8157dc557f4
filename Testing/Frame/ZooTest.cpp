#include "Common/PairRun.h"
#include "Common/Zoo.h"

#include <gtest/gtest.h>

// Each specimen of the degenerate zoo through whole frames, by every method: octrees answer as
// brute force does, bit for bit, whatever the threads and the octree's way of updating.

namespace palpate {
namespace {

using namespace testing;

/// Two frames, there and back, so that octrees are refitted.
struct Truth {
  std::vector<Rows> there, back;
};

void stepThere(PairRun& run, const Specimen& specimen) {
  run.step(specimen.aBefore(), specimen.a.positions, specimen.bBefore(), specimen.b.positions);
}
void stepBack(PairRun& run, const Specimen& specimen) {
  run.step(specimen.a.positions, specimen.aBefore(), specimen.b.positions, specimen.bBefore());
}

Truth truthOf(const Specimen& specimen, const PairSettings& settings) {
  PairRun run(settingsOf(Engine::BruteForce), specimen.a, specimen.b, settings, !specimen.large);
  Truth truth;
  stepThere(run, specimen);
  run.expectWellFormed(specimen.a, specimen.b);
  truth.there = run.answers();
  stepBack(run, specimen);
  truth.back = run.answers();
  return truth;
}

void expectTruth(PairRun& run, const Specimen& specimen, const Truth& truth) {
  stepThere(run, specimen);
  expectSame(run.answers(), truth.there);
  run.detect();  // without new positions both stay
  expectSame(run.answers(), truth.there);
  stepBack(run, specimen);
  expectSame(run.answers(), truth.back);
}

class Zoo : public ::testing::TestWithParam<MethodCase> {
 protected:
  static PairSettings settingsFor(const Specimen& specimen) {
    PairSettings settings = GetParam().settings;
    settings.thickness *= specimen.thickness;
    return settings;
  }
};

TEST_P(Zoo, EachSpecimenIsAnsweredAsByBruteForce) {
  std::size_t met = 0;
  for (const Specimen& specimen : zoo()) {
    SCOPED_TRACE(specimen.name);
    const PairSettings settings = settingsFor(specimen);
    const Truth truth = truthOf(specimen, settings);
    met += truth.there.front().anything();
    for (const Settings& octree : octreeSettings()) {
      SCOPED_TRACE(nameOf(octree));
      PairRun run(octree, specimen.a, specimen.b, settings, !specimen.large);
      expectTruth(run, specimen, truth);
    }
  }
  EXPECT_GT(met, 20u);
}

TEST_P(Zoo, TopologyChangesFromSpecimenToSpecimen) {
  for (const OctreeUpdate update : {OctreeUpdate::Auto, OctreeUpdate::Rebuild}) {
    PairRun run(settingsOf(Engine::Octree, 2, update), {}, {}, GetParam().settings);
    PairRun oracle(settingsOf(Engine::BruteForce), {}, {}, GetParam().settings);
    for (const Specimen& specimen : zoo()) {
      if (specimen.large) continue;
      SCOPED_TRACE(specimen.name);
      for (PairRun* each : {&run, &oracle}) {
        each->setTriangles(specimen.a, specimen.b);
        each->setPairSettings(settingsFor(specimen));
        stepThere(*each, specimen);
      }
      expectSame(run.answers(), oracle.answers());
    }
  }
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, Zoo, ::testing::ValuesIn(methodCases(1.0)),
                         [](const auto& method) { return method.param.name; });

/// What the definitions say of some specimens, so that both engines cannot be wrong alike.
TEST(ZooSpecimens, AnswerAsDefined) {
  for (const Specimen& specimen : zoo()) {
    SCOPED_TRACE(specimen.name);
    const auto rowsOf = [&](const PairSettings& settings) {
      PairRun run(settingsOf(Engine::Octree), specimen.a, specimen.b, settings, false);
      stepThere(run, specimen);
      return run.answers().front();
    };
    const Rows intersection = rowsOf({Method::Intersection, 0, Contacts::All}),
               distinct = rowsOf({Method::Proximity, specimen.thickness, Contacts::Distinct});
    if (specimen.name == "vertex exactly on face") {
      EXPECT_EQ(intersection.intersectingTriangles.size(), 3u);
      EXPECT_EQ(intersection.contacts(), 1u);
    } else if (specimen.name == "vertex exactly on vertex") {
      EXPECT_GE(intersection.contacts(), 6u);  // each way, and every edge at either
      EXPECT_EQ(distinct.vertexTriangle.size(), 1u);
    } else if (specimen.name == "one closed mesh inside another") {
      EXPECT_EQ(intersection.contacts() + distinct.contacts(), 0u);
    } else if (specimen.name == "one closed mesh inside another, reached") {
      EXPECT_EQ(intersection.contacts(), 0u);
      EXPECT_GT(distinct.contacts(), 0u);
    } else if (specimen.name == "empty mesh" || specimen.name == "two empty meshes") {
      EXPECT_EQ(intersection.contacts() + distinct.contacts(), 0u);
    } else if (specimen.name == "one triangle twice named") {
      EXPECT_EQ(intersection.intersectingTriangles.size(), 24u * 24u);
      EXPECT_EQ(distinct.vertexTriangle.size(), 3u);
      EXPECT_EQ(distinct.contacts(), 3u);
    }
  }
}

}  // namespace
}  // namespace palpate
