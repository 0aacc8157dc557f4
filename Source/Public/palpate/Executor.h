#pragma once

#include <palpate/Export.h>

#include <cstddef>
#include <memory>

namespace palpate {

/// Threads that several OctreeBasedCD objects, and the program itself, may share: see
/// Settings::executor. Derive from it to run the library's work on your own threads.
///
/// Needs    run() may be called from any thread, from several at once, and from inside a task: the
///          caller, or a thread that is free, must make progress then. It is best to run tasks on
///          the calling thread too.
/// Laws     (1) results do not depend on the executor: tasks may run in any order and on any thread,
///          also all on the calling thread.
/// Errors   An exception that run() throws passes on to the caller of the library, after all tasks
///          that had begun have ended. A run() that returns before it has run every task is refused
///          with ErrorCode::InvalidSettings. A task that is run later than that does nothing; it
///          must run before the OctreeBasedCD is destroyed, or never.
class PALPATE_EXPORT Executor {
 public:
  using Task = void (*)(void* context, std::size_t index) noexcept;

  virtual ~Executor();

  /// How many tasks can run at the same time, including the calling thread's. At least 1, and the
  /// same for the whole life of the executor.
  virtual int concurrency() const noexcept = 0;

  /// Calls task(context, index) once for each index in [0, count), and returns when all have ended.
  /// What the caller wrote before is visible to every task, and what tasks wrote is visible to the
  /// caller afterwards.
  virtual void run(std::size_t count, Task task, void* context) = 0;

 protected:
  Executor() = default;
  Executor(const Executor&) = default;
  Executor& operator=(const Executor&) = default;
};

/// The library's own pool of threads (oneTBB where the library is built with it).
///
/// threads: how many run tasks at once, including the caller of run(), in [1, 1024]; 0: one for
/// each core. Where the system refuses to start so many, concurrency() says how many there are.
/// A thread that waits for the end of its own loop may run a task of another loop meanwhile.
/// In the child of a fork() the pool has no threads: run() calls all tasks on the calling thread.
/// Errors   InvalidSettings
PALPATE_EXPORT std::shared_ptr<Executor> makeThreadPool(int threads = 0);

}  // namespace palpate
