#pragma once

#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/PairTable.h"
#include "CollisionDetection/SeparateSearch.h"
#include "Core/Threads.h"

#include <functional>
#include <memory>
#include <span>
#include <vector>

namespace palpate {

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
  /// Within change(): writes the contacts of these searches. Those for which nothing changed keep
  /// them.
  virtual void detect(SeparateSearches) = 0;
};

}  // namespace palpate
