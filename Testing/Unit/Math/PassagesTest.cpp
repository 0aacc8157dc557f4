// findPassages() against rational arithmetic.
#include "Common/PublishedQueries.h"
#include "Common/Sanitized.h"
#include "ImpactCheck.h"

#include <gtest/gtest.h>

namespace palpate {
namespace {

void expectPassages(const ImpactCase& query, double tolerance, const Passages& found,
                    std::vector<impact::Query::Passage>& truth) {
  EXPECT_EQ(static_cast<std::size_t>(found.count), truth.size()) << text(query);
  if (static_cast<std::size_t>(found.count) != truth.size()) return;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const auto& [time, forward] = found.all[i];
    EXPECT_EQ(forward, truth[i].forward) << text(query);
    EXPECT_GE(truth[i].time.compare(time), 0) << time << ", " << text(query);
    EXPECT_LE(truth[i].time.compare(impact::Rational(time) + impact::Rational(tolerance)), 0)
        << time << ", " << text(query);
  }
}

/// Both paths. Returns the number of passages.
std::size_t expectPassages(const ImpactCase& query) {
  auto truth = impact::Query(query.edges, query.positions).passages();
  for (const double tolerance : {0x1p-50, 1e-6}) {
    expectPassages(query, tolerance, findPassages(query.query(), tolerance), truth);
    expectPassages(query, tolerance, findPassagesExactly(query.query(), tolerance), truth);
  }
  return truth.size();
}

/// By how often the first feature passes forward more than back.
int netOf(const ImpactCase& query) {
  const Passages found = findPassages(query.query(), 0x1p-50);
  int net = 0;
  for (int i = 0; i < found.count; ++i)
    net += found.all[static_cast<std::size_t>(i)].forward ? 1 : -1;
  return net;
}

TEST(Passages, AgreeWithTheOracleOnHardCases) {
  HardCases cases(11);
  std::array<std::size_t, 4> byCount{};
  for (int kind = 0; kind < static_cast<int>(ImpactKind::Count); ++kind)
    for (int i = 0; i < testing::casesOf(300); ++i) {
      const ImpactCase query = cases.next(static_cast<ImpactKind>(kind));
      ++byCount[expectPassages(query)];
      if (::testing::Test::HasFailure()) return;
    }
  EXPECT_GE(byCount[1], testing::leastOf(300));
  EXPECT_GE(byCount[2], testing::leastOf(10));
}

/// Most cases touch at borders, several times, or at an end.
TEST(Passages, AgreeWithTheOracleOnSmallGrids) {
  test::Random random(3);
  std::array<std::size_t, 4> byCount{};
  for (int i = 0; i < testing::casesOf(20000); ++i) {
    const ImpactCase query = randomGridCase(random, i % 2 == 0, 1 + i % 3);
    ++byCount[expectPassages(query)];
    if (::testing::Test::HasFailure()) return;
  }
  EXPECT_GE(byCount[1], testing::leastOf(1000));
  EXPECT_GE(byCount[2], testing::leastOf(30));
  EXPECT_GE(byCount[3], testing::leastOf(1));
}

TEST(Passages, AgreeWithTheOracleOnPublishedQueries) {
  const auto published = testing::publishedQueries(PALPATE_SHARED_DATA);
  if (published.empty()) GTEST_SKIP() << "no ccd-queries in PALPATE_SHARED_DATA";
  std::size_t passages = 0;
  for (const auto& set : published)
    for (std::size_t i = 0; i < set.queries.size(); ++i) {
      SCOPED_TRACE(set.name + ", query " + std::to_string(i));
      passages += expectPassages({set.edges, set.queries[i].positions});
      if (!set.queries[i].impact) {
        EXPECT_EQ(findPassages(ImpactCase{set.edges, set.queries[i].positions}.query(), 1e-6).count,
                  0);
      }
    }
  EXPECT_GT(passages, 100u);
}

/// A vertex that keeps clear of the triangle's border passes as often as its side changes, over
/// all steps. It starts and stops in the triangle's plane.
TEST(Passages, NoneIsLostBetweenSteps) {
  test::Random random(5);
  for (const bool edges : {false, true}) {
    int side = 1, sum = 0, zeros = 0, changes = 0;
    double height = 1.0;
    for (int step = 0; step < 2000; ++step) {
      const double next = random.below(5) - 2;
      const Eigen::Vector3d at(edges ? -8 : 1, edges ? 0 : 1, 0), u(0, 0, 1);
      ImpactCase query{edges,
                       {at + height * u,
                        {0, 0, 0},
                        {4, 0, 0},
                        {0, 4, 0},
                        at + next * u,
                        {0, 0, 0},
                        {4, 0, 0},
                        {0, 4, 0}}};
      if (edges)
        for (const std::size_t end : {0, 4}) {
          query.positions[end + 1] = query.positions[end] + Eigen::Vector3d(16, 0, 0);
          query.positions[end + 2] = {0, -8, 0};
          query.positions[end + 3] = {0, 8, 0};
        }
      const int net = netOf(query);
      sum += net;
      changes += net != 0;
      zeros += next == 0;
      height = next;
      side = next < 0 ? -1 : 1;
      ASSERT_EQ(sum, side > 0 ? 0 : -1);
    }
    EXPECT_GT(zeros, 100);
    EXPECT_GT(changes, 100);
  }
}

}  // namespace
}  // namespace palpate
