#include "NarrowPhase/Order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace palpate {
namespace {

// Few and many pairs for the number of first triangles, so that both ways of sorting run on one
// scratch.
TEST(OrderPairs, MatchesStdSort) {
  std::mt19937 random(3);
  PairOrderScratch scratch;
  for (const std::size_t firsts : {1u, 7u, 1000u}) {
    for (const std::size_t size : {0u, 1u, 2u, 100u, 5000u}) {
      Buffer<ElementPair> pairs(size);
      for (ElementPair& pair : pairs)
        pair = {static_cast<std::uint32_t>(random() % firsts),
                static_cast<std::uint32_t>(random())};
      std::vector<ElementPair> expected(pairs.begin(), pairs.end());
      std::sort(expected.begin(), expected.end());
      orderPairs(pairs, firsts, scratch);
      EXPECT_TRUE(std::equal(pairs.begin(), pairs.end(), expected.begin(), expected.end()))
          << size << " pairs of " << firsts;
    }
  }
}

}  // namespace
}  // namespace palpate
