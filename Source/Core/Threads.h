#pragma once

#include <palpate/Executor.h>

#include <cstddef>
#include <memory>
#include <type_traits>

namespace palpate {

/// The one place for threads: a pool of std::thread, oneTBB where PALPATE_THREADS=TBB, or the
/// caller's executor.
///
/// Work is cut into chunks whose bounds depend on its size only, never on the number of threads, so
/// results written per chunk are the same for any number.
///
/// Exceptions  The exception of the lowest index that throws is rethrown, as one thread would.
///             Indices above it may be left out. The object stays usable.
/// Memory      Loops allocate nothing on the library's pool, and nothing after the first ones on an
///             executor.
/// Waiting     Threads spin for 20 to 80 microseconds, at the end of a loop then yield for half a
///             millisecond, and block in the end, so that one with
///             real-time priority cannot keep another from the core that it waits for. Tested for
///             std::thread: a SCHED_FIFO thread on one core with a SCHED_OTHER worker
///             (ThreadsTest.cpp). Where oneTBB is the pool, its own rules hold.
/// fork()      In the child loops run on the calling thread, and destruction gives up the pool's
///             memory without touching its threads. A Threads made in the child has threads of its
///             own, except with oneTBB, which starts none there. fork() inside a task is for exec()
///             only: in the child the loop throws, or waits without end with oneTBB.
class Threads {
 public:
  /// At most `count` threads (0: all cores) of a pool of its own, or of the executor (0: all).
  /// Where the system refuses to start so many, count() says how many there are.
  explicit Threads(int count, std::shared_ptr<Executor> executor = nullptr);
  ~Threads();
  Threads(Threads&&) noexcept;  ///< what was moved from has one thread
  Threads& operator=(Threads&&) noexcept;

  int count() const { return m_count; }

  /// f(chunk, begin, end) for each chunk of at most `grain` of [0, size); returns when all are
  /// done. An exception from f is rethrown here.
  template <class F>
  void forChunks(std::size_t size, std::size_t grain, F&& f) const {
    if (size == 0) return;
    const std::size_t chunks = (size + grain - 1) / grain;
    forEach(chunks, [&](std::size_t chunk) {
      const std::size_t begin = chunk * grain;
      f(chunk, begin, begin + grain < size ? begin + grain : size);
    });
  }

  /// f(i) for each i in [0, size), one task each, in the default floating-point environment; with
  /// one thread, in the caller's.
  template <class F>
  void forEach(std::size_t size, F&& f) const {
    if (m_count == 1 || size <= 1) {
      for (std::size_t i = 0; i < size; ++i) f(i);
      return;
    }
    using Function = std::remove_reference_t<F>;
    run(
        size, [](void* function, std::size_t i) { (*static_cast<Function*>(function))(i); },
        const_cast<void*>(static_cast<const void*>(std::addressof(f))));
  }

 private:
  struct LoopsOnExecutor;

  void run(std::size_t size, void (*call)(void*, std::size_t), void* function) const;

  std::shared_ptr<Executor> m_executor;  ///< null: one thread
  std::unique_ptr<LoopsOnExecutor>
      m_loops;  ///< where the executor is not the library's, whole pool
  int m_count;
};

}  // namespace palpate
