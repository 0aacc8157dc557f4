#include "Math/MotionBound.h"

#include "Unit/Math/TrianglePairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace palpate::test {
namespace {

using Extended = Eigen::Matrix<long double, 3, 1>;

template <ImpactQuery::Kind kind>
void checkMotion(Random& random) {
  for (int repeat = 0; repeat < 3000; ++repeat) {
    ImpactQuery query{kind, {}};
    const double motion = std::ldexp(1.0, -random.below(60));
    for (ImpactQuery::Step& step : query.vertices) {
      step.before = random.inCube();
      step.now = step.before + motion * random.inCube();
    }
    // Motions of differences of the features' points are means of those of corners.
    long double most = 0, size = 0;
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) {
        const bool first = kind == ImpactQuery::Kind::EdgeEdge ? i < 2 : i < 1,
                   second = kind == ImpactQuery::Kind::EdgeEdge ? j >= 2 : j >= 1;
        if (!first || !second) continue;
        const auto at = [&](int v, int end) -> Extended {
          return query.vertices[static_cast<std::size_t>(v)].at(end).template cast<long double>();
        };
        most = std::max(most, ((at(i, 1) - at(j, 1)) - (at(i, 0) - at(j, 0))).norm());
        size = std::max(size, (at(i, 1) - at(j, 1)).template lpNorm<Eigen::Infinity>());
      }
    }
    const double bound = motionBound<kind>(query);
    // Positions are rounded by up to 2^-53 of the size where differences are formed.
    ASSERT_GT(bound, static_cast<double>(most + size * 0x1p-50L)) << repeat;
    ASSERT_LT(bound, static_cast<double>(most * 1.0001L + size * 0x1p-44L)) << repeat;
    const double limit = 2 * bound;
    EXPECT_TRUE(mayHaveTouched<kind>(query, bound, limit));
    EXPECT_FALSE(mayHaveTouched<kind>(query, bound * 1.01, limit));
    EXPECT_TRUE(mayHaveTouched<kind>(query, 0.5 * bound, 0.5 * bound));
    if (most > 0x1p-30L) {
      EXPECT_FALSE(mayHaveTouched<kind>(query, bound, bound / 2));
    }
    // The limit is widened by the rounding of distances, too.
    const double narrow = 0.5 * bound, widened = narrow + static_cast<double>(size) * 0x1p-50;
    EXPECT_TRUE(mayHaveTouched<kind>(query, std::min(widened, bound), narrow));
  }
}

TEST(MotionBound, HoldsTheMotionOfEveryPointAndLittleMore) {
  Random random(3);
  checkMotion<ImpactQuery::Kind::VertexTriangle>(random);
  checkMotion<ImpactQuery::Kind::EdgeEdge>(random);
}

}  // namespace
}  // namespace palpate::test
