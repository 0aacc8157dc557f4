#include "Common/History.h"
#include "Common/Sanitized.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

// Random histories against a model that keeps only the last values: see Common/History.h.

namespace palpate::testing {
namespace {

constexpr int kLives = casesOf(20), kFrames = 500;

std::size_t live(std::uint64_t seed, int frames) {
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
  EXPECT_GT(live(static_cast<std::uint64_t>(GetParam()), kFrames),
            static_cast<std::size_t>(kFrames));
}

INSTANTIATE_TEST_SUITE_P(Lives, History, ::testing::Range(0, kLives));

/// PALPATE_HISTORY_LIVES more histories of 1,000 frames each; none unless it is set.
TEST(LongHistory, ContactsDependOnTheLastValuesOnly) {
  const char* const lives = std::getenv("PALPATE_HISTORY_LIVES");
  if (!lives) GTEST_SKIP() << "skipped: PALPATE_HISTORY_LIVES is not set";
  std::size_t contacts = 0;
  for (int seed = 0; seed < std::stoi(lives) && !HasFailure(); ++seed)
    contacts += live(1000 + static_cast<std::uint64_t>(seed), 1000);
  EXPECT_GT(contacts, 0u);
}

}  // namespace
}  // namespace palpate::testing
