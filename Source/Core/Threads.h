#pragma once

#include <palpate/Executor.h>

#include "Core/Assert.h"
#include "Core/Stopping.h"

#include <cstddef>
#include <memory>
#include <type_traits>

namespace palpate {

class LoopsOnExecutor;

/// The one place for threads: a pool of std::thread, oneTBB where PALPATE_THREADS=TBB, or the
/// caller's executor.
///
/// Work is divided into chunks whose bounds depend on its size only, never on the number of
/// threads. Results written per chunk are therefore the same for any number.
///
/// Exceptions  The exception of the lowest index that throws is rethrown, as with one thread.
///             Indices above it may be skipped. The object stays usable.
/// Stopping    A loop asks the calling thread's token (StopScope) before each index, and throws
///             OutOfTime once it is over, unless an index threw something else. Functions run with
///             that token, and code of an executor without one.
/// Memory      Loops allocate nothing on the library's pool, and nothing after the first ones on an
///             executor.
/// Waiting     Threads spin for 20 to 80 microseconds. At the end of a loop they then yield for
///             half a millisecond. Finally they block, so that a thread with real-time priority
///             cannot keep another from the core that it waits for. Tested for std::thread: a
///             SCHED_FIFO thread on one core with a SCHED_OTHER worker (ThreadsTest.cpp). Where
///             oneTBB is the pool, its own rules hold.
/// fork()      In the child, loops run on the calling thread, and destruction leaks the pool's
///             memory instead of joining its threads. A Threads object made in the child has
///             threads of its own, except with oneTBB, which starts none there. fork() inside a
///             task is for exec() only: in the child the loop throws, or with oneTBB waits without
///             end.
class Threads {
 public:
  /// Uses at most `count` threads (0: all cores) of its own pool, or of the executor (0: all). If
  /// the system refuses to start so many, count() returns the number that exist.
  explicit Threads(int count, std::shared_ptr<Executor> executor = nullptr);
  ~Threads();
  Threads(Threads&&) noexcept;  ///< the moved-from object has one thread
  Threads& operator=(Threads&&) noexcept;

  int count() const { return m_count; }

  /// Calls f(chunk, begin, end) for each chunk of at most `grain` indices of [0, size). Returns
  /// when all are done. An exception from f is rethrown here.
  template <class F>
  void forChunks(std::size_t size, std::size_t grain, F&& f) const {
    PALPATE_ASSERT(grain > 0);
    if (size == 0) return;
    const std::size_t chunks = (size + grain - 1) / grain;
    forEach(chunks, [&](std::size_t chunk) {
      const std::size_t begin = chunk * grain;
      f(chunk, begin, begin + grain < size ? begin + grain : size);
    });
  }

  /// Calls f(i) for each i in [0, size), one task each, in the default floating-point environment.
  /// With one thread, the caller's environment is used.
  template <class F>
  void forEach(std::size_t size, F&& f) const {
    if (m_count == 1 || size <= 1) {
      const StopScope::Token token = StopScope::current();
      for (std::size_t i = 0; i < size; ++i) {
        if (token) token->check();
        f(i);
      }
      return;
    }
    using Function = std::remove_reference_t<F>;
    run(
        size, [](void* function, std::size_t i) { (*static_cast<Function*>(function))(i); },
        const_cast<void*>(static_cast<const void*>(std::addressof(f))));
  }

 private:
  void run(std::size_t size, void (*call)(void*, std::size_t), void* function) const;

  std::shared_ptr<Executor> m_executor;  ///< null: one thread
  std::unique_ptr<LoopsOnExecutor>
      m_loops;  ///< null if the executor is the library's pool with all its threads
  int m_count;
};

/// Throws InvalidSettings unless a number of threads is in [0, 1024].
void checkThreads(int threads);

}  // namespace palpate
