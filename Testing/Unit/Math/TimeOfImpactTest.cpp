#include <palpate/FeaturePairs.h>

#include "Common/PublishedQueries.h"
#include "Common/Sanitized.h"
#include "ImpactCheck.h"
#include "Math/ImpactQuery.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

namespace palpate {
namespace {

/// Cases and seed from the environment: the long run of `ctest -L long` has millions.
long fromEnvironment(const char* name, long otherwise) {
  const char* value = std::getenv(name);
  return value ? std::atol(value) : otherwise;
}

TEST(TimeOfImpact, AgreesWithOracleOnHardCases) {
  const long cases = fromEnvironment("PALPATE_IMPACT_CASES", testing::casesOf(2000));
  HardCases hard(static_cast<std::uint64_t>(fromEnvironment("PALPATE_IMPACT_SEED", 1)));
  constexpr int kKinds = static_cast<int>(ImpactKind::Count);
  constexpr double kTolerances[] = {1e-6, 1e-2, 0x1p-50};
  int impacts[kKinds] = {};
  for (long i = 0; i < cases; ++i) {
    const auto kind = static_cast<int>(i % kKinds);
    expectTrue(hard.next(static_cast<ImpactKind>(kind)), kTolerances[i / kKinds % 3],
               impacts[kind]);
    if (HasFailure()) FAIL() << "case " << i << " of kind " << kind;
  }
  for (int kind = 0; kind < kKinds; ++kind) {
    RecordProperty("impactsOfKind" + std::to_string(kind), impacts[kind]);
    if (testing::kShareOfCases == 1) {
      EXPECT_GT(impacts[kind], cases / kKinds / 100) << kind;
    }
  }
}

/// Exact arithmetic is slower by orders of magnitude.
TEST(TimeOfImpact, OrdinaryQueriesNeedNoExactArithmetic) {
  test::Random random(41);
  const int cases = testing::casesOf(20000);
  for (const bool edges : {false, true}) {
    int impacts = 0, exact = 0;
    for (int i = 0; i < cases; ++i) {
      const ImpactResult result = findTouch(randomCase(random, edges).query(), 1e-6);
      impacts += result.impact;
      exact += result.exact;
    }
    EXPECT_GT(impacts, cases / 50) << edges;
    EXPECT_LT(exact, cases / 1000) << edges;
  }
}

/// Random queries that `change` makes hard. Some have impacts, and some have none.
template <class Change>
void expectTrueOfChanged(test::Random& random, Change&& change) {
  int impacts = 0;
  const int cases = testing::casesOf(3000);
  for (int i = 0; i < cases; ++i) {
    ImpactCase query = randomCase(random, i % 2);
    change(query);
    expectTrue(query, 1e-6, impacts);
    ASSERT_FALSE(::testing::Test::HasFailure()) << "case " << i;
  }
  EXPECT_GT(impacts, cases / 10);
  EXPECT_LT(impacts, cases * 9 / 10);
}

/// At some time the features touch, up to rounding, at the border of one or at a corner of both.
/// Many coordinates are zero at one end of the step.
TEST(TimeOfImpact, AgreesWithOracleAtTheBordersOfFeatures) {
  test::Random random(15);
  expectTrueOfChanged(random, [&](ImpactCase& query) {
    auto& p = query.positions;
    for (Eigen::Vector3d& at : p)
      for (double& x : at)
        if (random.below(3) == 0) x = 0.0;
    const double time = random.unit(), s = random.below(4) ? random.unit() : random.below(2);
    const auto at = [&](std::size_t vertex) -> Eigen::Vector3d {
      return (1.0 - time) * p[vertex] + time * p[4 + vertex];
    };
    const std::size_t moved = query.edges ? random.below(2) : 0,
                      from = query.edges ? 2 : 1 + random.below(2);
    const Eigen::Vector3d border = at(from) + s * (at(from + 1) - at(from));
    p[4 + moved] = (border - (1.0 - time) * p[moved]) / time;
  });
}

/// The vertex, or an edge's end, stays above an edge, up to rounding. Along it, both are near the
/// edge's other end at one end of the step, and far away at the other.
TEST(TimeOfImpact, AgreesWithOracleAboveAnEdge) {
  test::Random random(17);
  expectTrueOfChanged(random, [&](ImpactCase& query) {
    auto& p = query.positions;
    const Eigen::Vector3d edge = random.inCube().cwiseProduct(Eigen::Vector3d(1, 1, 0));
    const std::size_t first = query.edges ? 0 : 1, passing = query.edges ? 2 : 0;
    for (std::size_t end = 0; end < 8; end += 4) {
      for (std::size_t k = 0; k < 4; ++k) p[end + k].z() = 0.0;
      p[end + first].setZero();
      p[end + first + 1] = random.ldexp(0.5 + random.unit(), -15, 15) * edge;
      p[end + passing] = random.ldexp(0.5 + random.unit(), -15, 15) * edge;
      p[end + passing].z() = end == 0 ? random.unit() : -random.unit();
      if (query.edges) p[end + 3].z() = p[end + 2].z();
    }
  });
}

/// On a grid whose steps along one axis are about the smallest double.
TEST(TimeOfImpact, FindsEveryTouchOfFeaturesThatAreNearlyFlat) {
  HardCases hard(18);
  test::Random random(18);
  for (int i = 0; i < testing::casesOf(20000); ++i) {
    constexpr ImpactKind kTouches[] = {ImpactKind::TouchAtStart, ImpactKind::TouchAtEnd,
                                       ImpactKind::TouchHalfway};
    const int axis = random.below(3), exponent = random.between(-1074, -1060),
              across = -random.below(12);
    const ImpactCase query = hard.next(kTouches[i % 3]).mapped([&](Eigen::Vector3d p) {
      for (int k = 0; k < 3; ++k) p[k] = std::ldexp(p[k], k == axis ? exponent : across);
      return p;
    });
    ASSERT_TRUE(query.time()) << text(query);
  }
}

/// A vertex passes a corner or an edge's end within a few of the smallest doubles.
TEST(TimeOfImpact, AgreesWithOracleWhereCoordinatesAreDenormal) {
  test::Random random(16);
  expectTrueOfChanged(random, [&](ImpactCase& query) {
    auto& p = query.positions;
    for (Eigen::Vector3d& at : p) at.z() = 0.0;
    // Vertex 1 is the corner, or vertex 2 the end of an edge, and stays at the origin.
    const std::size_t corner = query.edges ? 2 : 1;
    p[corner] = p[4 + corner] = Eigen::Vector3d::Zero();
    const auto near = [&] { return std::ldexp(random.between(-4, 4), -1074); };
    p[0] = {near(), near(), random.unit()};
    p[4] = {near(), near(), -random.unit()};
    if (query.edges) {
      // The other end of the edge that passes by.
      p[1].z() = p[0].z();
      p[5].z() = p[4].z();
    }
  });
}

/// The same decision, and times within a tolerance of each other, because both are within one of
/// the exact time.
void expectSame(const ImpactCase& l, const ImpactCase& r) {
  const std::optional<double> left = l.time(), right = r.time();
  ASSERT_EQ(left.has_value(), right.has_value()) << text(l) << "\nand " << text(r);
  EXPECT_NEAR(left.value_or(0.0), right.value_or(0.0), 1e-6) << text(l);
}

/// Vertex 0 stays in a vertex-triangle query; edges keep their ends together.
std::vector<std::array<int, 4>> orders(bool edges) {
  if (edges)
    return {{1, 0, 2, 3}, {0, 1, 3, 2}, {1, 0, 3, 2}, {2, 3, 0, 1},
            {3, 2, 0, 1}, {2, 3, 1, 0}, {3, 2, 1, 0}};
  return {{0, 1, 3, 2}, {0, 2, 1, 3}, {0, 2, 3, 1}, {0, 3, 1, 2}, {0, 3, 2, 1}};
}

TEST(TimeOfImpact, IsNotEarlierThanTheToleranceWhereRoundingHidesTheRoot) {
  // Large triangles against a vertex that moves little, from Testing/Stability. The brackets of
  // their roots are as wide as possible. Times were 1.02e-6 and 1.002e-6 before the impact.
  const auto still = [](const Eigen::Vector3d& v, const Eigen::Vector3d& vNow,
                        const std::array<Eigen::Vector3d, 3>& t) {
    return ImpactCase{false, {v, t[0], t[1], t[2], vNow, t[0], t[1], t[2]}};
  };
  int impacts = 0;
  test::Random random(14);
  for (int i = 0; i < 400; ++i) {
    const double size = std::exp2(20 + 10 * random.unit());
    std::array<Eigen::Vector3d, 3> triangle;
    for (Eigen::Vector3d& corner : triangle) corner = size * random.inCube();
    const Eigen::Vector3d inside = 0.3 * triangle[0] + 0.3 * triangle[1] + 0.4 * triangle[2];
    const Eigen::Vector3d towards =
        (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).normalized();
    const Eigen::Vector3d by = 0.02 * (towards + 0.3 * random.inCube());
    const double above = random.unit(), below = random.unit();
    const ImpactCase query = still(inside + above * by, inside - below * by, triangle);
    for (const double tolerance : {1e-6, 1e-4, 0.3}) expectTrue(query, tolerance, impacts);
  }
  EXPECT_GT(impacts, 600);
}

/// In other orders, at other sizes and origins, and backwards. Coordinates of sizes from the
/// smallest to the largest double in one query are ordered by exact arithmetic only.
TEST(TimeOfImpact, EquivalentQueriesHaveTheSameDecisionAndTime) {
  test::Random random(3);
  int impacts = 0;
  const int cases = testing::casesOf(1600);
  for (int i = 0; i < cases && !::testing::Test::HasFatalFailure(); ++i) {
    ImpactCase query =
        i % 4 < 3 ? randomGridCase(random, i % 8 < 4, 2) : randomCase(random, i % 8 < 4);
    const bool isMixed = i % 4 == 2;
    for (Eigen::Vector3d& p : query.positions)
      for (int k = 0; k < 3 && isMixed; ++k)
        if (random.below(3) == 0) p[k] = std::ldexp(p[k], random.between(-1074, 1021));
    impacts += query.time().has_value();
    ASSERT_EQ(query.time().has_value(), query.reversed().time().has_value()) << text(query);
    for (const auto& order : orders(query.edges)) expectSame(query, query.permuted(order));
    if (i % 4 > 1) continue;
    for (const int exponent : {-1074, -1073, -900, -300, -150, 100, 180, 400, 1000, 1020})
      expectSame(query,
                 query.mapped([&](const Eigen::Vector3d& p) { return test::scaled(p, exponent); }));
    for (const double offset : {1e3, 1e6, 0x1p51})
      expectSame(query, query.mapped([&](const Eigen::Vector3d& p) -> Eigen::Vector3d {
        return p + Eigen::Vector3d(offset, -offset, 3 * offset);
      }));
  }
  EXPECT_GT(impacts, cases / 20);
}

TEST(TimeOfImpact, TakesAnyToleranceAndDistanceThatIsNotPositive) {
  const Eigen::Vector3d a(-1, -1, 0), b(2, -1, 0), c(-1, 2, 0);
  const ImpactCase query{false, {Eigen::Vector3d(0, 0, 1), a, b, c, {0, 0, -2}, a, b, c}};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double tolerance : {0.0, -1.0, nan, 1e-300, 1e-6, 1.0, 5.0}) {
    for (const double distance : {0.0, -0.0, -1.0, nan}) {
      const std::optional<double> time = query.time({distance, tolerance});
      ASSERT_TRUE(time);
      EXPECT_LE(*time, 1.0 / 3.0);
      EXPECT_GE(*time, 1.0 / 3.0 - (tolerance > 0x1p-50 ? tolerance : 0x1p-50));
    }
  }
}

// ---- Searches that end before the step does, like those for the earliest impact ----

ImpactResult findUpTo(const ImpactCase& query, double distance, double upTo) {
  return findImpact(query.query(), {.minimumDistance = distance}, upTo);
}

/// Grids, small displacements between features that pass at about the distance, and random queries.
ImpactCase nearDistance(test::Random& random, double distance) {
  const bool edges = random.below(2);
  if (random.below(3) == 0) return randomGridCase(random, edges, 2);
  ImpactCase query = randomCase(random, edges);
  if (random.below(2)) return query;
  // The first feature glides along at the distance, up to the error of the search.
  const int moving = edges ? 2 : 1;
  for (int i = 0; i < 4; ++i) {
    Eigen::Vector3d &before = query.positions[i], &now = query.positions[4 + i];
    if (i < moving) {
      before.z() = distance * (1 + 1e-6 * (random.unit() - 0.5));
      const double size = random.unit();
      now = before + size * random.inCube().cwiseProduct(Eigen::Vector3d(1, 1, 1e-6));
    } else {
      before.z() = random.below(2) ? 0.0 : -random.unit();
      now = before;
    }
  }
  return query;
}

TEST(ImpactUpTo, FindsTheSameTimeWhereverTheSearchEnds) {
  test::Random random(8);
  int found = 0, leftOut = 0;
  for (int i = 0; i < 20000; ++i) {
    const double distance = i % 3 == 0 ? 0.0 : 0.1 * random.unit();
    const ImpactCase query = nearDistance(random, distance);
    const ImpactResult whole = findUpTo(query, distance, 1.0);
    for (int k = 0; k < 4; ++k) {
      const double upTo = k < 2           ? random.unit()
                          : !whole.impact ? 0x1p-5
                          : k == 2        ? whole.time
                                          : std::min(1.0, whole.time + 1e-6);
      const ImpactResult part = findUpTo(query, distance, upTo);
      if (part.impact) {
        ASSERT_TRUE(whole.impact) << i;
        ASSERT_EQ(part.time, whole.time) << i << ", up to " << upTo;
        ++found;
      } else if (whole.impact) {
        // Within a tolerance after the end, an impact is reported, too: the exact time may be that
        // late.
        ASSERT_TRUE(distance > 0.0 ? whole.time > upTo : whole.time + 1e-6 > upTo)
            << i << ", up to " << upTo;
        ++leftOut;
      }
    }
  }
  EXPECT_GT(found, 5000);
  EXPECT_GT(leftOut, 1000);
}

// ---- Published queries ----

// With exact labels, made to break continuous detection. (Erleben, Methodology for assessing
// mesh-based contact point methods, 2018; Wang et al., A large-scale benchmark and an
// inclusion-based algorithm for continuous collision detection, 2021.)

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
