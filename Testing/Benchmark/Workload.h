#pragma once

#include "BroadPhase.h"

#include <string>
#include <vector>

namespace palpate::benchmark {

/// A scene with its positions computed before any clock starts, boxes inflated by a twentieth of
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

/// frames = 0: as many consecutive ones as keep the workload near three million triangles, 4 to
/// 120. Any "sheets-<number>K" or "sheets-<number>M" is understood.
Workload makeWorkload(const std::string& name, std::size_t frames, const std::string& sharedData);

/// One more triangle in the first mesh, a million scene sizes away.
void flingTriangle(Workload&);

}  // namespace palpate::benchmark
