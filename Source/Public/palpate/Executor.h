#pragma once

#include <palpate/Export.h>

#include <cstddef>
#include <memory>
#include <string>

namespace palpate {

/// Runs the library's work on threads. Several OctreeBasedCD objects and the program itself may
/// share one executor: see Settings::executor. Derive from it to use your own threads.
/// Needs    run() must accept calls from any thread, from several threads at once, and from inside
///          a task. In each case the calling thread or a free thread must make progress. Calling
///          threads should run tasks, too.
/// Laws     (1) results do not depend on the executor. Tasks may run in any order and on any
///          thread, also all on the calling thread.
/// Errors   An exception that run() throws reaches the caller of the library after all tasks that
///          had begun have ended. If run() returns before it has run every task, the library throws
///          InvalidSettings. A task that runs later than that does nothing; it must run before the
///          OctreeBasedCD is destroyed, or never.
class PALPATE_EXPORT Executor {
 public:
  using Task = void (*)(void* context, std::size_t index) noexcept;

  virtual ~Executor();

  /// The number of tasks that can run at the same time, including one on the calling thread. It is
  /// at least 1 and never changes during the life of the executor.
  virtual int concurrency() const noexcept = 0;

  /// Calls task(context, index) once for each index in [0, count), and returns when all calls have
  /// ended. Everything that the caller wrote before is visible to every task. Everything that the
  /// tasks wrote is visible to the caller afterwards.
  virtual void run(std::size_t count, Task task, void* context) = 0;

 protected:
  Executor() = default;
  Executor(const Executor&) = default;
  Executor& operator=(const Executor&) = default;
};

/// Makes the library's own thread pool (oneTBB where the library is built with it).
///
/// threads: how many threads run tasks at once, including the caller of run(), in [1, 1024]; 0: one
/// per core. If the system refuses to start so many, concurrency() returns the smaller number. A
/// thread that waits for the end of its own loop may run a task of another loop meanwhile. In the
/// child of a fork() the pool has no threads, and run() calls all tasks on the calling thread.
/// Errors   InvalidSettings if `threads` is out of range. In the child of a fork() that a task
///          called, run() throws NotAvailable if other threads had begun tasks of its loop.
PALPATE_EXPORT std::shared_ptr<Executor> makeThreadPool(int threads = 0);

/// The instruction set that the library uses in this process: "AVX-512", "AVX2", "SSE4" or
/// "Scalar". The library selects it at run time. Results do not depend on it.
PALPATE_EXPORT std::string simdPath();

}  // namespace palpate
