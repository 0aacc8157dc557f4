#pragma once

#include "BroadPhase.h"

#include <string>
#include <vector>

namespace palpate::benchmark {

/// A scene with its positions computed before any clock starts, and a thickness of a tenth of
/// the mean edge.
struct Workload {
  std::string name;
  Task task;
  std::vector<Positions> frames;  ///< consecutive frames of the scene's motion
  std::size_t triangles() const;
};

/// The table's columns in order: organs, cloth, uneven, sheets-16K ... sheets-1M, folded-cloth,
/// twisted-rods, and where the published frames are present, cloth-funnel and rod-twist.
std::vector<std::string> workloadNames(const std::string& sharedData);

/// `frames` 0 means 4 to 120 consecutive frames, near three million triangles in all. Any
/// "sheets-<number>K" or "sheets-<number>M" is a valid name.
Workload makeWorkload(const std::string& name, std::size_t frames, const std::string& sharedData);

/// Adds a triangle to the first mesh, a million scene sizes away.
void addFarTriangle(Workload&);

}  // namespace palpate::benchmark
