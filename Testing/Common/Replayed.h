#pragma once

#include <palpate/Capture.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <unistd.h>

namespace palpate::testing {

/// Whether a capture file can hold the problem: it has no distance fields and no leaves of proxies.
inline bool fitsFile(const CollisionProblem& problem) {
  return std::none_of(problem.geometries.begin(), problem.geometries.end(),
                      [](const auto& geometry) { return geometry.field || geometry.proxy; });
}

/// Writes the last frame's problem to a file, reads it back and computes it again. Every pair has
/// the same contacts.
inline OctreeBasedCD replayed(const OctreeBasedCD& detection) {
  const auto path = std::filesystem::temp_directory_path() /
                    ("palpate-replayed-" + std::to_string(::getpid()) + ".capture");
  capture(detection, path);
  OctreeBasedCD again = setUp(readCapture(path));
  std::filesystem::remove(path);
  again.detectCollision();
  for (const CollisionPair& pair : detection.pairs())
    EXPECT_EQ(again.collisionData(pair.a, pair.b).hash(),
              detection.collisionData(pair.a, pair.b).hash());
  return again;
}

}  // namespace palpate::testing
