#include "Limits.h"

#include <palpate/Capture.h>
#include <palpate/Error.h>

#include <gtest/gtest.h>

#include <optional>
#include <string>

namespace palpate::fuzz {

/// What is read can be written, and then reads and writes the same.
void captureFile(Bytes bytes) {
  const std::filesystem::path path = fileWith(textOf(bytes));
  std::optional<CollisionProblem> problem;
  withinLimits(bytes.size(), [&] {
    try {
      problem = readCapture(path);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::File);
      expectShort(error.what());
    }
  });
  if (!problem) return;
  writeCapture(*problem, path);
  const std::string written = contentOf(path);
  writeCapture(readCapture(path), path);
  EXPECT_EQ(contentOf(path), written);
}

}  // namespace palpate::fuzz
