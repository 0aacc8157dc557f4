#include "Limits.h"

#include <palpate/Capture.h>

#include "Common/History.h"
#include "Common/Replayed.h"

#include <gtest/gtest.h>

namespace palpate::fuzz {

/// The life of an OctreeBasedCD, and a capture of its end if a file can hold it.
void history(Bytes bytes) {
  constexpr int kMostFrames = 16;
  testing::RandomHistory history(bytes);
  for (int frame = 0; frame < kMostFrames && !history.isOver(); ++frame) history.frame();
  const CollisionProblem problem = history.problem();
  if (!testing::fitsFile(problem)) return;
  const std::filesystem::path path = fileWith("");
  writeCapture(problem, path);
  const std::string written = contentOf(path);
  writeCapture(readCapture(path), path);
  EXPECT_EQ(contentOf(path), written);
}

}  // namespace palpate::fuzz
