#pragma once

#include <palpate/Executor.h>

#include "Core/FloatingPoint.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopping.h"

#include <atomic>
#include <cstddef>
#include <exception>
#include <limits>
#include <memory>
#include <mutex>
#include <vector>

namespace palpate {

/// A loop's function, and the exception of the lowest index that threw one. Once the deadline of
/// the thread that runs the loop is over, no index begins: that costs no exception for each.
class LoopBody {
 public:
  LoopBody(void (*call)(void*, std::size_t), void* function)
      : m_call(call),
        m_function(function),
        m_memory(MemoryScope::current()),
        m_token(StopScope::current()) {}

  void runOne(std::size_t i) noexcept {
    if (i > m_lowestFailed.load(std::memory_order_relaxed)) return;
    const StandardFloatingPoint standard;
    const MemoryScope memory(m_memory);
    const StopScope scope(m_token);
    if (m_token && m_token->isOver()) return m_isStopped.store(true, std::memory_order_relaxed);
    try {
      m_call(m_function, i);
    } catch (const OutOfTime&) {
      m_isStopped.store(true, std::memory_order_relaxed);
    } catch (...) {
      // current_exception() is never null here: without memory it returns std::bad_alloc.
      const std::lock_guard guard(m_lock);
      if (i > m_lowestFailed) return;
      m_lowestFailed = i;
      m_exception = std::current_exception();
    }
  }
  static void task(void* body, std::size_t i) noexcept { static_cast<LoopBody*>(body)->runOne(i); }

  /// OutOfTime gives precedence to other exceptions.
  void rethrow() const {
    if (m_exception) std::rethrow_exception(m_exception);
    if (m_isStopped) throwOutOfTime();
  }

 private:
  void (*m_call)(void*, std::size_t);
  void* m_function;
  const MemoryScope::Place m_memory;
  const StopScope::Token m_token;
  std::atomic<bool> m_isStopped{false};
  std::atomic<std::size_t> m_lowestFailed{std::numeric_limits<std::size_t>::max()};
  std::mutex m_lock;
  std::exception_ptr m_exception;
};

/// Loops on an executor that may be faulty: each loop object is used again once the executor holds
/// none of its runs.
class LoopsOnExecutor {
 public:
  LoopsOnExecutor();
  /// A loop of which the executor still holds a run is never freed, because the run may still be
  /// called.
  ~LoopsOnExecutor();
  LoopsOnExecutor(const LoopsOnExecutor&) = delete;
  LoopsOnExecutor& operator=(const LoopsOnExecutor&) = delete;

  /// Passes `runs` runs to the executor, which together take the indices below `size` one by one.
  /// Throws InvalidSettings if the executor returns before it has called each run.
  void run(Executor&, std::size_t runs, std::size_t size, LoopBody&);

 private:
  class Loop;
  Loop* take();
  void putBack(Loop*);

  std::mutex m_lock;
  std::vector<std::unique_ptr<Loop>> m_all;
  std::vector<Loop*> m_idle;
};

}  // namespace palpate
