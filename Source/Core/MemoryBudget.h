#pragma once

#include <palpate/FrameStatistics.h>

#include "Core/CountedVector.h"

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

namespace palpate {

/// For what memory is allocated: the members of MemoryUse, in their order.
enum class MemoryStage : std::uint32_t {
  Geometries,
  Octrees,
  Pairs,
  NarrowPhase,
  Results,
  Queries,
  Snapshots
};

/// The bytes that one OctreeBasedCD holds, and their limit.
///
/// allocateCounted() charges the budget of the MemoryScope of its thread before it allocates, and
/// keeps the budget until the memory is freed.
/// Threads  safe. What is refused depends only on the bytes that are in use at that time.
class MemoryBudget {
 public:
  /// limit: bytes; 0: none.
  static std::shared_ptr<MemoryBudget> make(std::size_t limit);

  /// Throws MemoryLimit, and then charges nothing.
  void charge(MemoryStage, std::size_t bytes);
  void discharge(MemoryStage, std::size_t bytes) noexcept;
  MemoryUse now() const;
  MemoryUse peak() const;  ///< each member's own largest value since startPeak()
  void startPeak();

 private:
  /// Bytes now, and the most since startPeak().
  struct Count {
    std::atomic<std::size_t> now{0}, peak{0};
    void raisePeak(std::size_t bytes);
  };
  static constexpr std::size_t kStages = static_cast<std::size_t>(MemoryStage::Snapshots) + 1;

  explicit MemoryBudget(std::size_t limit) : m_limit(limit) {}
  [[noreturn]] void refuse(MemoryStage, std::size_t bytes, std::size_t now) const;
  MemoryUse read(std::atomic<std::size_t> Count::*) const;
  void leave() noexcept;

  const std::size_t m_limit;
  Count m_total;
  std::array<Count, kStages> m_stages;
  std::atomic<std::size_t> m_users{1};  ///< the owners together, and each allocation
};

/// What the memory that this thread allocates is for, while this object exists. Threads carries it
/// to the threads of a loop.
class MemoryScope {
 public:
  struct Place {
    MemoryBudget* budget = nullptr;  ///< null: the memory counts toward nothing
    MemoryStage stage = MemoryStage::Geometries;
  };

  explicit MemoryScope(const Place&);
  MemoryScope(const std::shared_ptr<MemoryBudget>& budget, MemoryStage stage)
      : MemoryScope(Place{budget.get(), stage}) {}
  /// Of the present budget.
  explicit MemoryScope(MemoryStage stage) : MemoryScope(Place{current().budget, stage}) {}
  ~MemoryScope();
  MemoryScope(const MemoryScope&) = delete;
  MemoryScope& operator=(const MemoryScope&) = delete;

  static Place current();

 private:
  const Place m_before;
};

/// Base of objects that `new` makes, so that they are counted like a CountedVector.
struct CountedObject {
  static void* operator new(std::size_t bytes) {
    return allocateCounted(bytes, __STDCPP_DEFAULT_NEW_ALIGNMENT__);
  }
  static void* operator new(std::size_t bytes, std::align_val_t alignment) {
    return allocateCounted(bytes, static_cast<std::size_t>(alignment));
  }
  static void operator delete(void* memory, std::size_t bytes) {
    freeCounted(memory, bytes, __STDCPP_DEFAULT_NEW_ALIGNMENT__);
  }
  static void operator delete(void* memory, std::size_t bytes, std::align_val_t alignment) {
    freeCounted(memory, bytes, static_cast<std::size_t>(alignment));
  }
};

}  // namespace palpate
