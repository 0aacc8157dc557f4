#include "Common/ExpectRefused.h"
#include "Common/PairRun.h"
#include "Common/TestGeometry.h"

#include <palpate/Error.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

// reportCrossings and rememberSides by Method::Auto: the passages and sides are those of
// Continuous, and the contacts those of Auto without them, or of Continuous where Auto chose it.

namespace palpate {
namespace {

using namespace testing;

/// One pair in an object of its own.
class PassageRun {
 public:
  PassageRun(const Settings& settings, const TestGeometry& a, const TestGeometry& b, bool self,
             const PairSettings& pair)
      : m_collisions(settings) {
    m_a = a.addTo(m_collisions);
    m_b = self ? m_a : b.addTo(m_collisions);
    m_collisions.addCollisionPair(m_a, m_b, pair);
    m_collisions.advance();  // the first step is at rest
  }
  void set(const Positions& a, const Positions& b) {
    m_collisions.setPositions(m_a, a);
    if (m_a != m_b) m_collisions.setPositions(m_b, b);
  }
  const CollisionData& detect() {
    m_collisions.detectCollision();
    return data();
  }
  const CollisionData& data() const { return m_collisions.collisionData(m_a, m_b); }
  void advance() { m_collisions.advance(); }

 private:
  OctreeBasedCD m_collisions;
  GeometryId m_a, m_b;
};

void expectSameContacts(const CollisionData& one, const CollisionData& two) {
  EXPECT_TRUE(std::ranges::equal(one.vertexTriangle(), two.vertexTriangle()));
  EXPECT_TRUE(std::ranges::equal(one.triangleVertex(), two.triangleVertex()));
  EXPECT_TRUE(std::ranges::equal(one.edgeEdge(), two.edgeEdge()));
  EXPECT_TRUE(std::ranges::equal(one.intersectingTriangles(), two.intersectingTriangles()));
}

/// Counts of what the histories held.
struct PassageCounts {
  std::size_t crossings = 0, sides = 0;
  std::map<Method, std::size_t> methods;  ///< that Auto chose
  std::size_t asPlain = 0, asContinuous = 0;
};

void runPassageHistory(Random& random, TestGeometry a, TestGeometry b, bool self, double thickness,
                       Contacts contacts, Engine engine, double scale, PassageCounts& counts) {
  const auto pairOf = [&](Method method, bool crossings, bool sides) {
    return PairSettings{.method = method,
                        .thickness = thickness,
                        .contacts = contacts,
                        .reportCrossings = crossings,
                        .rememberSides = sides};
  };
  const Settings settings = testing::settingsOf(engine);
  PassageRun byContinuous(settings, a, b, self, pairOf(Method::Continuous, true, true)),
      byAuto(settings, a, b, self, pairOf(Method::Auto, true, true)),
      crossingsOnly(settings, a, b, self, pairOf(Method::Auto, true, false)),
      plain(settings, a, b, self, pairOf(Method::Auto, false, false)),
      plainContinuous(settings, a, b, self, pairOf(Method::Continuous, false, false));
  const std::array<PassageRun*, 5> all{&byContinuous, &byAuto, &crossingsOnly, &plain,
                                       &plainContinuous};
  for (int step = 0; step < 12; ++step) {
    SCOPED_TRACE("step " + std::to_string(step));
    constexpr double kMotions[] = {0.0, 0.004, 0.3, 0.03};
    const double motion = scale * kMotions[random() % 4];
    for (Positions* positions : {&a.positions, &b.positions})
      if (random() % 3 != 0)  // else at rest
        *positions = moved(random, *positions, motion);
    for (PassageRun* run : all) run->set(a.positions, b.positions);
    // Without a detection advance() finds the sides; with one before the last positions, too.
    if (random() % 4 == 0) {
      if (random() % 2 == 0)
        for (PassageRun* run : all) run->detect();
      a.positions = moved(random, a.positions, motion);
      for (PassageRun* run : all) run->set(a.positions, b.positions), run->advance();
      continue;
    }
    const CollisionData &data = byAuto.detect(), &truth = byContinuous.detect(),
                        &only = crossingsOnly.detect(), &without = plain.detect(),
                        &continuous = plainContinuous.detect();
    EXPECT_TRUE(std::ranges::equal(data.crossings(), truth.crossings()));
    EXPECT_TRUE(std::ranges::equal(only.crossings(), truth.crossings()));
    EXPECT_TRUE(std::ranges::equal(data.rememberedSides(), truth.rememberedSides()));
    EXPECT_EQ(data.validity().method, only.validity().method);
    counts.crossings += truth.crossings().size();
    counts.sides += truth.rememberedSides().size();
    ++counts.methods[only.validity().method];
    if (only.validity().method == without.validity().method) {
      expectSameContacts(only, without);
      ++counts.asPlain;
    } else if (only.intersectingTriangles().empty() && only.validity().startedApart) {
      EXPECT_EQ(only.validity().method, Method::Continuous);
      expectSameContacts(only, continuous);
      ++counts.asContinuous;
    }
    EXPECT_EQ(data.validity().atImpact + data.validity().atEnd,
              data.vertexTriangle().size() + data.triangleVertex().size() + data.edgeEdge().size());
    for (PassageRun* run : all) run->advance();
  }
}

TEST(AutoPassages, AreThoseOfContinuous) {
  Random random(61);
  PassageCounts counts;
  std::size_t number = 0;
  for (int round = 0; round < casesOf(4, 2); ++round) {
    const TestGeometry soupA = testGeometry(soup(random, 20, 0.3)),
                       membrane = testGeometry(sheet(5, 0.5, uniform(random, 0, 6))),
                       low = testGeometry(testing::cube(0.3, 0.4)),
                       high = testGeometry(testing::cube(0.56, 0.7)),
                       line = thread(random, 20, 0.3, 0.01, false),
                       points = particles(random, 30, 0.01);
    const Pairs pairs{{&low, &membrane}, {&high, &membrane}, {&soupA, &soupA},    {&soupA, &line},
                      {&line, &line},    {&points, &soupA},  {&points, &membrane}};
    for (const auto& [a, b] : pairs)
      for (const double thickness : {0.0, 0.02}) {
        SCOPED_TRACE(std::to_string(number));
        runPassageHistory(
            random, *a, *b, a == b, thickness, number % 3 == 0 ? Contacts::All : Contacts::Distinct,
            number % 5 == 0 ? Engine::BruteForce : Engine::Octree, a == &high ? 0.1 : 1.0, counts);
        ++number;
      }
  }
  EXPECT_GE(counts.crossings, leastOf(1000, 200));
  EXPECT_GE(counts.sides, leastOf(300, 60));
  EXPECT_GE(counts.asPlain, leastOf(100, 20));
  EXPECT_GE(counts.asContinuous, leastOf(9, 3));
  EXPECT_GE(counts.methods[Method::Continuous], leastOf(50, 10));
  EXPECT_GE(counts.methods[Method::Proximity], leastOf(20, 4));
  EXPECT_GT(counts.methods[Method::Intersection], 0u);
}

TEST(AutoPassages, AreRefusedWhereContinuousDoesNotAnswer) {
  Random random(3);
  OctreeBasedCD collisions;
  const GeometryId line =
                       tapered(random, thread(random, 5, 0.2, 0.01, false), 0.02).addTo(collisions),
                   sheetId = testGeometry(sheet(2, 0.5, 0)).addTo(collisions);
  for (const bool crossings : {true, false})
    testing::expectRefused(
        ErrorCode::UnsupportedMethod, "need one radius for all vertices",
        [&] {
          collisions.addCollisionPair(
              line, sheetId,
              {.thickness = 0.1, .reportCrossings = crossings, .rememberSides = !crossings});
        },
        line);
}

}  // namespace
}  // namespace palpate
