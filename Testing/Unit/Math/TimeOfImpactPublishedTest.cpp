// Published queries with exact labels, made to break continuous detection. (Erleben, Methodology
// for assessing mesh-based contact point methods, 2018; Wang et al., A large-scale benchmark and an
// inclusion-based algorithm for continuous collision detection, 2021.)
#include "Common/PublishedQueries.h"
#include "ImpactCheck.h"

#include <gtest/gtest.h>

namespace palpate {

namespace {

const std::vector<testing::PublishedQueries>& published() {
  static const auto sets = testing::publishedQueries(PALPATE_SHARED_DATA);
  return sets;
}

TEST(TimeOfImpactPublished, EveryLabelHoldsInEveryOrderAndDirection) {
  if (published().empty()) GTEST_SKIP() << "no ccd-queries in PALPATE_SHARED_DATA";
  std::size_t queries = 0, impacts = 0;
  for (const auto& set : published()) {
    for (std::size_t i = 0; i < set.queries.size(); ++i) {
      const ImpactCase query{set.edges, set.queries[i].positions};
      const bool impact = set.queries[i].impact;
      const std::array<int, 4> order = set.edges ? std::array{3, 2, 0, 1} : std::array{0, 3, 1, 2};
      EXPECT_EQ(query.time().has_value(), impact) << set.name << ", query " << i;
      EXPECT_EQ(query.reversed().time().has_value(), impact) << set.name << ", query " << i;
      EXPECT_EQ(query.permuted(order).time().has_value(), impact) << set.name << ", query " << i;
      impacts += impact;
    }
    queries += set.queries.size();
  }
  EXPECT_GT(queries, 2000u);
  EXPECT_GT(impacts, 200u);
}

/// All impacts and some misses, because the oracle is slow.
TEST(TimeOfImpactPublished, TimesMatchTheOracle) {
  if (published().empty()) GTEST_SKIP() << "no ccd-queries in PALPATE_SHARED_DATA";
  for (const auto& set : published())
    for (std::size_t i = 0; i < set.queries.size(); ++i) {
      const auto& [positions, impact] = set.queries[i];
      if (!impact && i % 10 != 0) continue;
      SCOPED_TRACE(set.name + ", query " + std::to_string(i));
      int impacts = 0;
      expectTrue({set.edges, positions}, 1e-6, impacts);
      EXPECT_EQ(impacts, impact);
    }
}

}  // namespace

}  // namespace palpate
