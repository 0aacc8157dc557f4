#include "Common/History.h"
#include "Common/Sanitized.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

// Random histories against a model that keeps only the last values: see Common/History.h.

namespace palpate::testing {
namespace {

constexpr int kHistories = casesOf(20), kFrames = 500;

std::size_t runHistory(std::uint64_t seed, int frames) {
  RandomHistory history(seed);
  for (int frame = 0; frame < frames; ++frame) {
    history.frame();
    if (::testing::Test::HasFailure()) {
      ADD_FAILURE() << "seed " << seed << ", frame " << frame;
      return 0;
    }
  }
  return history.contacts();
}

class History : public ::testing::TestWithParam<int> {};

TEST_P(History, ContactsDependOnTheLastValuesOnly) {
  EXPECT_GT(runHistory(static_cast<std::uint64_t>(GetParam()), kFrames),
            static_cast<std::size_t>(kFrames));
}

INSTANTIATE_TEST_SUITE_P(Seeds, History, ::testing::Range(0, kHistories));

/// PALPATE_HISTORIES more histories of 1,000 frames each; none unless it is set.
TEST(LongHistory, ContactsDependOnTheLastValuesOnly) {
  const char* const histories = std::getenv("PALPATE_HISTORIES");
  if (!histories) GTEST_SKIP() << "skipped: PALPATE_HISTORIES is not set";
  std::size_t contacts = 0;
  for (int seed = 0; seed < std::stoi(histories) && !HasFailure(); ++seed)
    contacts += runHistory(1000 + static_cast<std::uint64_t>(seed), 1000);
  EXPECT_GT(contacts, 0u);
}

}  // namespace
}  // namespace palpate::testing
