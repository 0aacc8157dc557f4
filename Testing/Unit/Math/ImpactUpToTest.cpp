#include "ImpactCases.h"
#include "Math/ImpactQuery.h"

#include <gtest/gtest.h>

// Searches that end before the step does, like those for the earliest impact. Their result does not
// depend on where they end.

namespace palpate {
namespace {

ImpactResult find(const ImpactCase& query, double distance, double upTo) {
  return findImpact(query.query(), {.minimumDistance = distance}, upTo);
}

/// Grids, small displacements between features that pass at about the distance, and random queries.
ImpactCase someCase(test::Random& random, double distance) {
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
    const ImpactCase query = someCase(random, distance);
    const ImpactResult whole = find(query, distance, 1.0);
    for (int k = 0; k < 4; ++k) {
      const double upTo = k < 2           ? random.unit()
                          : !whole.impact ? 0x1p-5
                          : k == 2        ? whole.time
                                          : std::min(1.0, whole.time + 1e-6);
      const ImpactResult part = find(query, distance, upTo);
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

}  // namespace
}  // namespace palpate
