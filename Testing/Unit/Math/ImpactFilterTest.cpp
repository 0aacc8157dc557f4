#include "Math/ImpactFilter.h"

#include "Core/SimdPath.h"
#include "DistanceAtTime.h"

#include <gtest/gtest.h>

#include <array>

// Rational arithmetic checks the pairs that the filter discards, on every SIMD path.

namespace palpate {
namespace {

using Eight = std::array<ImpactCase, ImpactBlock::kLanes>;
constexpr int kKinds = static_cast<int>(ImpactKind::Count);

/// Any power of two.
void rescale(ImpactCase& query, test::Random& random) {
  constexpr int kExponents[] = {-1040, -700, -500, -230, -100, 0, 100, 190, 230, 500, 900};
  const int exponent = kExponents[random.below(static_cast<int>(std::size(kExponents)))];
  query = query.mapped([&](const Eigen::Vector3d& p) { return test::scaled(p, exponent); });
}

Eight someOf(ImpactKind kind, HardCases& hard, test::Random& random, bool edges) {
  Eight eight;
  for (ImpactCase& query : eight) {
    query = hard.next(kind, edges);
    if (kind != ImpactKind::MixedSizes && kind != ImpactKind::Denormal && random.below(3) == 0)
      rescale(query, random);
  }
  return eight;
}

/// The lanes that some path discards.
unsigned leftOut(const Eight& eight, const TimeOfImpactSettings& settings) {
  ImpactBlock block;
  for (int lane = 0; lane < ImpactBlock::kLanes; ++lane)
    for (int i = 0; i < 4; ++i) {
      const auto& p = eight[static_cast<std::size_t>(lane)].positions;
      block.set(lane, i, p[static_cast<std::size_t>(i)], p[static_cast<std::size_t>(4 + i)]);
    }
  unsigned out = 0;
  for (const std::string& path : simdPaths()) {
    useSimdPath(path);
    out |= ~mayImpact(eight[0].query().kind, block, settings) & 255u;
  }
  useSimdPath("");
  return out;
}

TEST(ImpactFilter, KeepsEveryQueryThatTouches) {
  HardCases hard(11);
  test::Random random(12);
  int dropped = 0, plainDropped = 0, count = 0;
  for (int i = 0; i < 12 * kKinds; ++i) {
    const auto kind = static_cast<ImpactKind>(i % kKinds);
    const Eight eight = someOf(kind, hard, random, i / kKinds % 2);
    const unsigned out = leftOut(eight, {});
    for (std::size_t lane = 0; lane < eight.size(); ++lane) {
      if (!(out >> lane & 1)) continue;
      ++dropped;
      plainDropped += kind == ImpactKind::FullDoubles;
      ASSERT_FALSE(impact::Query(eight[lane].edges, eight[lane].positions).firstTouch())
          << "kind " << i % kKinds << ", block " << i;
    }
    count += kind == ImpactKind::FullDoubles ? static_cast<int>(eight.size()) : 0;
  }
  EXPECT_GT(dropped, 200);
  EXPECT_GT(plainDropped, count / 4);
}

/// The distance of the features at some time, exactly or a little above it.
TEST(ImpactFilter, KeepsEveryQueryThatComesWithinTheDistance) {
  HardCases hard(13);
  test::Random random(14);
  for (int i = 0; i < 40 * kKinds; ++i) {
    const auto kind = static_cast<ImpactKind>(i % kKinds);
    Eight eight = someOf(kind, hard, random, i / kKinds % 2);
    eight.fill(eight[0]);
    oracle::Rational least = oracle::squareDistanceAt(eight[0], 0.0);
    for (const double t : {1.0, random.below(65) / 64.0, random.unit()})
      least = std::min(least, oracle::squareDistanceAt(eight[0], t));
    if (least > oracle::Rational(0x1p1023) * oracle::Rational(0x1p1023)) continue;
    const double distance = std::max(oracle::rootAbove(least), 5e-324);
    ASSERT_EQ(leftOut(eight, {distance}), 0u) << "kind " << i % kKinds << ", case " << i;
  }
}

/// Brute force does not use the filter. With a distance, the search may report pairs that do not
/// quite come within it.
TEST(ImpactFilter, KeepsEveryImpactThatTheSearchReports) {
  HardCases hard(15);
  test::Random random(16);
  int found = 0, dropped = 0;
  for (int i = 0; i < 200 * kKinds; ++i) {
    const auto kind = static_cast<ImpactKind>(i % kKinds);
    const Eight eight = someOf(kind, hard, random, i / kKinds % 2);
    double size = 0.0;
    for (const Eigen::Vector3d& p : eight[0].positions)
      size = std::max(size, p.cwiseAbs().maxCoeff());
    TimeOfImpactSettings settings{std::ldexp(random.unit() * size, -random.below(30)), 1e-6};
    if (i % 3 == 0) {
      const oracle::Rational square = oracle::squareDistanceAt(eight[0], random.below(3) / 2.0);
      if (square != 0 && square < oracle::Rational(0x1p1000))
        settings.minimumDistance =
            oracle::rootAbove(square) * (1.0 - std::ldexp(1.0, -random.below(50)));
    }
    if (i % 5 == 0) settings.timeTolerance = std::ldexp(1.0, -random.below(50));
    const unsigned out = leftOut(eight, settings);
    for (std::size_t lane = 0; lane < eight.size(); ++lane) {
      const bool impact = findImpact(eight[lane].query(), settings).impact;
      ASSERT_FALSE(impact && (out >> lane & 1)) << "kind " << i % kKinds << ", block " << i;
      found += impact;
      dropped += out >> lane & 1;
    }
  }
  EXPECT_GT(found, 2000);
  EXPECT_GT(dropped, 2000);
}

}  // namespace
}  // namespace palpate
