#include "Math/PassageFilter.h"

#include "Common/EverySimdPath.h"
#include "Common/Sanitized.h"
#include "Core/SimdPath.h"
#include "ImpactCheck.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cstdint>

// PassagesTest compares findPassages() of one query with rational arithmetic. Here blocks of eight
// queries are compared with it, bit by bit and on every SIMD path.

namespace palpate {
namespace {

using Eight = std::array<ImpactCase, ImpactBlock::kLanes>;

struct Counts {
  std::size_t queries = 0, known = 0, passing = 0;
};

void expectSame(const Eight& eight, double tolerance, Counts& counts) {
  ImpactBlock block;
  std::array<Passages, ImpactBlock::kLanes> all;
  for (std::size_t lane = 0; lane < eight.size(); ++lane) {
    const ImpactQuery query = eight[lane].query();
    all[lane] = findPassages(query, tolerance);
    for (int i = 0; i < 4; ++i) {
      const auto& vertex = query.vertices[static_cast<std::size_t>(i)];
      block.set(static_cast<int>(lane), i, vertex.before, vertex.now);
    }
  }
  for (const std::string& path : testing::EverySimdPath()) {
    const BlockPassages found = findPassages(eight[0].query().kind, block, tolerance);
    for (std::size_t lane = 0; lane < eight.size(); ++lane) {
      ++counts.queries;
      const bool passes = found.passes >> lane & 1;
      if (!(found.isKnown >> lane & 1)) {
        ASSERT_FALSE(passes);
        continue;
      }
      ++counts.known;
      counts.passing += passes;
      const Passages& one = all[lane];
      ASSERT_FALSE(one.exact) << path << ", " << text(eight[lane]);
      ASSERT_EQ(one.count, passes ? 1 : 0) << path << ", " << text(eight[lane]);
      if (!passes) continue;
      ASSERT_EQ(one.all[0].forward, static_cast<bool>(found.forward >> lane & 1)) << path;
      ASSERT_EQ(std::bit_cast<std::uint64_t>(one.all[0].time),
                std::bit_cast<std::uint64_t>(found.times[lane]))
          << path << ", " << text(eight[lane]);
    }
  }
}

TEST(PassageFilter, HasTheBitsOfOneQuery) {
  HardCases hard(5);
  test::Random random(6);
  Counts counts;
  for (int i = 0; i < testing::casesOf(2400) && !::testing::Test::HasFailure(); ++i) {
    const auto kind = static_cast<ImpactKind>(i % static_cast<int>(ImpactKind::Count));
    Eight eight;
    const bool isScaled = kind < ImpactKind::ScaledAxes && random.below(4) == 0;
    for (ImpactCase& query : eight) {
      query = hard.next(kind, i / 2 % 2);
      const int exponent = random.between(-700, 700);
      if (isScaled)
        query = query.mapped([&](const Eigen::Vector3d& p) { return test::scaled(p, exponent); });
    }
    for (const double tolerance : {0x1p-50, 1e-6}) expectSame(eight, tolerance, counts);
  }
  EXPECT_GT(counts.known, counts.queries / 20);
  EXPECT_GT(counts.passing, counts.queries / 500);
}

/// What findPassages() of one query decides without exact arithmetic is rarely left to it.
TEST(PassageFilter, KnowsNearlyAllPlainQueries) {
  test::Random random(8);
  Counts counts;
  std::size_t decided = 0;
  for (int i = 0; i < testing::casesOf(1500) && !::testing::Test::HasFailure(); ++i) {
    Eight eight;
    for (ImpactCase& query : eight) {
      query.edges = i % 2;
      for (std::size_t v = 0; v < 4; ++v) {
        query.positions[v] = random.inCube();
        query.positions[4 + v] = query.positions[v] + 0.5 * random.inCube();
      }
      decided += simdPaths().size() * !findPassages(query.query(), 1e-6).exact;
    }
    expectSame(eight, 1e-6, counts);
  }
  EXPECT_GT(counts.passing, counts.queries / 50);
  EXPECT_GT(counts.known, decided - decided / 10);
}

}  // namespace
}  // namespace palpate
