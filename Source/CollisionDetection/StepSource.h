#pragma once

#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/PairTable.h"
#include "Core/Threads.h"

#include <functional>
#include <memory>
#include <span>
#include <vector>

namespace palpate {

/// Pairs of a StepGuard, in the order of the table's pairs that they guard.
using GuardedPairs = std::vector<std::unique_ptr<PairRecord>>;

/// The step of an OctreeBasedCD, for a StepGuard that may outlive it. Every function throws
/// InvalidCall once it was destroyed.
class StepSource {
 public:
  virtual ~StepSource() = default;
  /// Calls the function as one call of the OctreeBasedCD that changes it; twice if it exceeded
  /// Settings::memoryLimit and memory could be given back.
  virtual void change(const std::function<void()>&) = 0;
  virtual GeometryTable& geometries() const = 0;
  virtual const PairTable& pairs() const = 0;
  virtual const Threads& threads() const = 0;
  /// Within change(): writes the contacts of these pairs to their records. Pairs for which nothing
  /// changed keep them.
  virtual void detect(const GuardedPairs&) = 0;
};

}  // namespace palpate
