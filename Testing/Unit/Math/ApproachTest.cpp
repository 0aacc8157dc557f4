#include "DistanceAtTime.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

// Impacts with a minimum distance. Rational arithmetic decides the distances.

namespace palpate {
namespace {

using oracle::Rational;

/// e of <palpate/FeaturePairs.h>, rounded upward.
double statedError(const ImpactCase& query, const TimeOfImpactSettings& settings) {
  double displacement = 0.0, largest = 0.0;
  const auto& p = query.positions;
  for (std::size_t i = 0; i < (query.edges ? 2 : 1); ++i)
    for (std::size_t j = query.edges ? 2 : 1; j < 4; ++j) {
      displacement = std::max(displacement, ((p[4 + i] - p[4 + j]) - (p[i] - p[j])).stableNorm());
      for (std::size_t end = 0; end < 8; end += 4)
        largest = std::max(largest, (p[end + i] - p[end + j]).cwiseAbs().maxCoeff());
    }
  return (settings.timeTolerance * displacement + 0x1p-35 * (largest + settings.minimumDistance)) *
         (1.0 + 0x1p-40);
}

/// A distance that is hard for the query: far from it, or near its own distance at some time.
double someDistance(const ImpactCase& query, test::Random& random) {
  double size = 1e-300;
  for (std::size_t i = 1; i < 8; ++i)
    size = std::max(size, (query.positions[i] - query.positions[0]).cwiseAbs().maxCoeff());
  if (random.below(2)) return random.ldexp(size * random.unit(), -39, 0);
  const double own = oracle::rootAbove(oracle::squareDistanceAt(query, random.below(5) / 4.0));
  const double factor = 1.0 + random.ldexp(random.unit() - 0.5, -51, 0);
  return std::clamp(own * factor, 1e-300, 1e300);
}

/// At a reported time, the features are within the stated error. At earlier times, and at any time
/// if none is reported, they are farther apart than the distance.
void expectTrue(const ImpactCase& query, const TimeOfImpactSettings& settings,
                test::Random& random) {
  const std::optional<double> time = query.time(settings);
  if (time) {
    const Rational reach =
        Rational(settings.minimumDistance) + Rational(statedError(query, settings));
    EXPECT_TRUE(oracle::FeaturesAtTime(query, *time).isAtMost(reach * reach))
        << "false positive at " << *time;
  }
  const double end = time.value_or(1.0);
  const Rational distance(settings.minimumDistance);
  for (int i = 0; i < 12; ++i) {
    double t = end * (1.0 - random.ldexp(random.unit(), -29, 0));
    if (i < 5) t = end * i / 4.0;
    if (time && t >= *time) continue;
    EXPECT_TRUE(oracle::FeaturesAtTime(query, t).isAbove(distance * distance))
        << (time ? "late, or nearer at " : "false negative at ") << t;
  }
}

TEST(Approach, HasNoLateTimesFalseNegativesOrFalsePositives) {
  const char* cases = std::getenv("PALPATE_IMPACT_CASES");
  const long count = cases ? std::atol(cases) : 3000;
  HardCases hard(21);
  test::Random random(22);
  constexpr int kKinds = static_cast<int>(ImpactKind::Count);
  long impacts = 0;
  for (long i = 0; i < count; ++i) {
    const ImpactCase query = hard.next(static_cast<ImpactKind>(i % kKinds));
    const TimeOfImpactSettings settings{someDistance(query, random),
                                        i % 3 ? 1e-6 : std::ldexp(1.0, -random.below(51))};
    expectTrue(query, settings, random);
    if (HasFailure()) FAIL() << "case " << i << " of kind " << i % kKinds;
    impacts += query.time(settings).has_value();
  }
  EXPECT_GT(impacts, count / 8);
  EXPECT_LT(impacts, count * 7 / 8);
}

/// Positions whose differences or displacements overflow have the times of the same query in
/// smaller units, within the tolerance.
TEST(Approach, DifferencesMayOverflow) {
  test::Random random(27);
  int impacts = 0, overflows = 0;
  for (int i = 0; i < 2000; ++i) {
    const ImpactCase query = randomCase(random, i % 2);
    const auto scaled = [&](double by) {
      return query.mapped([by](const Eigen::Vector3d& p) -> Eigen::Vector3d { return by * p; });
    };
    const double size = i % 4 < 2 ? 0x1.8p1023 : 0x1.8p1022;
    const ImpactCase large = scaled(size);
    for (const Eigen::Vector3d& p : large.positions)
      overflows += std::isinf((p - large.positions[0]).cwiseAbs().maxCoeff());
    const double distance = 0.5 * random.unit();
    const std::optional<double> time = large.time({distance * size, 1e-6});
    const std::optional<double> other = query.time({distance, 1e-6});
    ASSERT_EQ(time.has_value(), other.has_value()) << i;
    if (!time) continue;
    EXPECT_NEAR(*time, *other, 1.001e-6) << i;
    ++impacts;
  }
  EXPECT_GT(overflows, 500);
  EXPECT_GT(impacts, 500);
}

/// Slivers, and distances far below the features' size, where directions in plain doubles fail.
TEST(Approach, HoldsForSliversAndSmallDistances) {
  test::Random random(23);
  int impacts = 0, misses = 0;
  for (int i = 0; i < 1500; ++i) {
    ImpactCase query = randomCase(random, i % 2);
    auto& p = query.positions;
    const double thin = std::ldexp(1.0, -random.below(50)),
                 gap = std::ldexp(1.0, -random.below(50));
    const std::size_t last = 3, first = query.edges ? 2 : 1;
    // Parallel edges or a sliver, and the other feature a small gap away from a point in them.
    for (std::size_t end = 0; end < 8; end += 4) {
      if (query.edges) {
        p[end + 3] = p[end + 2] + random.unit() * (p[end + 1] - p[end]);
        p[end + 3] += thin * random.inCube();
        Eigen::Vector3d move = p[end] + random.unit() * (p[end + 1] - p[end]) - p[end + first];
        move += gap * random.inCube();
        p[end + first] += move;
        p[end + last] += move;
      } else {
        p[end + 3] = p[end + 1] + random.unit() * (p[end + 2] - p[end + 1]);
        p[end + 3] += thin * random.inCube();
        p[end] = p[end + 1] + random.unit() * (p[end + 2] - p[end + 1]);
        p[end] += gap * random.inCube();
      }
    }
    const TimeOfImpactSettings settings{gap * random.unit(), i % 3 ? 1e-6 : 0x1p-40};
    expectTrue(query, settings, random);
    ASSERT_FALSE(HasFailure()) << "case " << i;
    ++(query.time(settings) ? impacts : misses);
  }
  EXPECT_GT(impacts, 100);
  EXPECT_GT(misses, 100);
}

}  // namespace
}  // namespace palpate
