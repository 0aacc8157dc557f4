#pragma once

#include <palpate/Export.h>

#include <cstddef>
#include <memory>
#include <string>

namespace palpate {

/// Runs the library's work on your threads. Several objects and the program may share it.
/// Needs    run() accepts calls from any thread, from several at once, and from inside a task; in
///          each case the calling thread or a free one makes progress. Tasks may run in any order.
/// Errors   an exception of run() reaches the caller after all tasks that began have ended. If
///          run() returns before all tasks ran, the library throws InvalidSettings. A later task
///          does nothing, and must not run after the OctreeBasedCD is destroyed.
class PALPATE_EXPORT Executor {
 public:
  using Task = void (*)(void* context, std::size_t index) noexcept;

  virtual ~Executor();

  /// How many tasks can run at once, with one on the calling thread: at least 1, constant.
  virtual int concurrency() const noexcept = 0;

  /// Calls task(context, index) once for each index in [0, count) and returns when all have ended.
  /// Memory writes of caller and tasks are visible to each other.
  virtual void run(std::size_t count, Task task, void* context) = 0;

 protected:
  Executor() = default;
  Executor(const Executor&) = default;
  Executor& operator=(const Executor&) = default;
};

/// The library's own pool, by oneTBB if built with it. threads: how many run tasks, with the caller
/// of run(), in [1, 1024]; 0: one per core. concurrency() may be smaller. In the child of a fork()
/// the calling thread runs all tasks.
/// Errors   InvalidSettings for `threads`. In the child of a fork() in a task, run() throws
///          NotAvailable if other threads had begun its tasks.
PALPATE_EXPORT std::shared_ptr<Executor> makeThreadPool(int threads = 0);

/// The instruction set in use: "AVX-512", "AVX2", "SSE4" or "Scalar". Results do not depend on it.
PALPATE_EXPORT std::string simdPath();

}  // namespace palpate
