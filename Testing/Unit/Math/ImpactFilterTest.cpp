#include "Math/ImpactFilter.h"

#include "Common/EverySimdPath.h"
#include "Common/Sanitized.h"
#include "DistanceAtTime.h"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <new>

// Rational arithmetic checks the pairs that the filter discards, on every SIMD path.

namespace palpate {
namespace {

using Eight = std::array<ImpactCase, ImpactBlock::kLanes>;
constexpr int kKinds = static_cast<int>(ImpactKind::Count);

/// Any power of two.
void rescale(ImpactCase& query, test::Random& random) {
  constexpr int kExponents[] = {-1040, -700, -500, -360, -350, -230, -100,
                                0,     100,  190,  230,  500,  900};
  const int exponent = kExponents[random.below(static_cast<int>(std::size(kExponents)))];
  query = query.mapped([&](const Eigen::Vector3d& p) { return test::scaled(p, exponent); });
}

Eight someOf(ImpactKind kind, HardCases& hard, test::Random& random, bool edges) {
  Eight eight;
  for (ImpactCase& query : eight) {
    query = hard.next(kind, edges);
    if (kind < ImpactKind::ScaledAxes && random.below(3) == 0) rescale(query, random);
  }
  return eight;
}

/// The lanes that are discarded, the same on every path.
unsigned leftOut(const Eight& eight, const TimeOfImpactSettings& settings) {
  ImpactBlock block;
  for (int lane = 0; lane < ImpactBlock::kLanes; ++lane)
    for (int i = 0; i < 4; ++i) {
      const auto& p = eight[static_cast<std::size_t>(lane)].positions;
      block.set(lane, i, p[static_cast<std::size_t>(i)], p[static_cast<std::size_t>(4 + i)]);
    }
  const auto out = [&] { return ~mayImpact(eight[0].query().kind, block, settings) & 255u; };
  const unsigned best = out();
  for (const std::string& path : testing::EverySimdPath()) {
    EXPECT_EQ(out(), best) << path;
  }
  return best;
}

/// Features that are apart along the vector between their borders, but not along the axes or the
/// normal.
TEST(ImpactFilter, DropsFeaturesThatAreApartBesideEachOther) {
  test::Random random(17);
  for (int i = 0; i < 500; ++i) {
    Eight eight;
    for (ImpactCase& query : eight) {
      const Eigen::Vector3d u = random.inCube().normalized(),
                            v = random.inCube().cross(u).normalized();
      // A long edge, and beside it the vertex, or the end of an edge across it.
      Eigen::Vector3d beside = 0.3 * random.inCube().x() * u;
      beside += (0.01 + random.unit()) * v;
      auto& p = query.positions;
      query.edges = i % 2;
      if (query.edges)
        p = {beside, beside + 2.0 * v + 0.1 * random.inCube(), -4.0 * u, 4.0 * u};
      else
        p = {beside, -4.0 * u, 4.0 * u, 0.5 * u - 2.0 * v};
      for (std::size_t k = 0; k < 4; ++k) p[4 + k] = p[k] + 1e-4 * random.inCube();
    }
    ASSERT_EQ(leftOut(eight, {}), 255u) << i;
    ASSERT_EQ(leftOut(eight, {1e-4}), 255u) << i;
  }
}

/// A page that cannot be read follows.
TEST(ImpactFilter, ReadsNothingBeyondTheBlock) {
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  ASSERT_LE(sizeof(ImpactBlock), page);
  void* const pages =
      mmap(nullptr, 2 * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(pages, MAP_FAILED);
  ASSERT_EQ(mprotect(static_cast<char*>(pages) + page, page, PROT_NONE), 0);
  const ImpactBlock& block =
      *new (static_cast<char*>(pages) + page - sizeof(ImpactBlock)) ImpactBlock;
  for (const std::string& path : testing::EverySimdPath()) {
    for (const auto kind : {ImpactQuery::Kind::VertexTriangle, ImpactQuery::Kind::EdgeEdge})
      EXPECT_EQ(mayImpact(kind, block, {}), 255u) << path;
  }
  munmap(pages, 2 * page);
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

/// On grids so small that products of differences are less than the smallest double. Some are large
/// along one axis.
TEST(ImpactFilter, KeepsEveryTouchWhereProductsUnderflow) {
  HardCases hard(19);
  test::Random random(19);
  for (int i = 0; i < testing::casesOf(3000); ++i) {
    constexpr ImpactKind kTouches[] = {ImpactKind::TouchAtStart, ImpactKind::TouchAtEnd,
                                       ImpactKind::TouchHalfway};
    const int axis = i % 2 ? random.below(3) : 3,
              exponent = i % 2 ? random.between(-550, -530) : random.between(-366, -345);
    Eight eight;
    for (ImpactCase& query : eight)
      query = hard.next(kTouches[i % 3], i / 2 % 2).mapped([&](Eigen::Vector3d p) {
        for (int k = 0; k < 3; ++k) p[k] = std::ldexp(p[k], k == axis ? 900 : exponent);
        return p;
      });
    ASSERT_EQ(leftOut(eight, {}), 0u) << i;
  }
}

/// One vertex is so far away along one axis that sums of products overflow.
TEST(ImpactFilter, KeepsEveryTouchBesideOneHugeCoordinate) {
  test::Random random(23);
  for (int i = 0; i < testing::casesOf(2000); ++i) {
    constexpr std::size_t kFar[2][2] = {{2, 3}, {1, 3}};
    const std::size_t far = kFar[i % 2][random.below(2)];
    const int axis = random.below(3);
    Eight eight;
    for (ImpactCase& query : eight) {
      query.edges = i % 2;
      for (std::size_t vertex = 0; vertex < 4; ++vertex) {
        const double size = std::ldexp(1.0, -random.below(4));
        for (std::size_t end = 0; end < 2; ++end) {
          Eigen::Vector3d& p = query.positions[4 * end + vertex];
          p = size * random.inCube();
          if (vertex == far) {
            const double least = random.below(2) ? 0x1p1023 : -0x1p1023;
            p[axis] = least * (1.0 + random.unit());
          }
        }
      }
    }
    const unsigned out = leftOut(eight, {});
    for (std::size_t lane = 0; lane < eight.size(); ++lane)
      if (out >> lane & 1) {
        ASSERT_FALSE(impact::Query(eight[lane].edges, eight[lane].positions).firstTouch()) << i;
      }
  }
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
    TimeOfImpactSettings settings{random.ldexp(random.unit() * size, -29, 0), 1e-6};
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
