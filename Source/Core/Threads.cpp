#include "Core/Stopping.h"
#include "Core/Threads.h"

#include <palpate/Error.h>

#include "Core/Assert.h"
#include "Core/LoopsOnExecutor.h"
#include "Core/Spin.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <new>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#ifndef _WIN32
#include <pthread.h>
#endif

#ifdef PALPATE_THREADS_TBB
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#endif

namespace palpate {

namespace {

constexpr int kMaxThreads = 1024;

int threadCount(int count) {
  if (count > 0) return count;
  const unsigned cores = std::thread::hardware_concurrency();
  return cores == 0 ? 1 : static_cast<int>(cores);
}

/// The number of forks between this process and the first one that made a pool. A pool compares it
/// with the number at which its threads started, because threads do not exist in the child of a
/// fork(). getpid() would tell as much for 0.2 microseconds in each loop.
std::atomic<unsigned> forks{0};

unsigned watchForks() {
#ifndef _WIN32  // which has no fork()
  static const bool watching = [] {
    const auto count = +[] { forks.fetch_add(1, std::memory_order_relaxed); };
    if (pthread_atfork(nullptr, nullptr, count) != 0) throw std::bad_alloc();
    return true;
  }();
  static_cast<void>(watching);
#endif
  return forks;
}

#ifdef PALPATE_THREADS_TBB

/// At most as many workers as the process may have. oneTBB has no more, and prints a warning if
/// more are requested.
class Workers {
 public:
  explicit Workers(int count) : m_count(count), m_arena(std::min(count, allowed())) {}
  int count() const { return m_count; }

  void run(std::size_t size, Executor::Task task, void* context, unsigned) {
    m_arena.execute([&] {
      tbb::parallel_for(
          std::size_t{0}, size, [&](std::size_t i) { task(context, i); },
          tbb::simple_partitioner());
    });
  }

 private:
  static int allowed() {
    return static_cast<int>(
        tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
  }
  int m_count;
  tbb::task_arena m_arena;
};

#else

/// A lock that is held for a few instructions at a time. It finally blocks, because the thread that
/// holds it may need this core.
class BriefLock {
 public:
  void lock() {
    for (Spin spin; !mutex.try_lock(); spin.wait())
      if (spin.isOver()) {
        mutex.lock();
        return;
      }
  }
  void unlock() { mutex.unlock(); }

  std::mutex mutex;
};

/// A plain pool. Threads take the indices of a loop one by one: the thread that runs the loop from
/// the first one on, threads that join it from the last one on. From loop to loop, a thread
/// therefore works on the same data. Both workers and threads that wait for the last indices of
/// their own loop join. Loops within loops are therefore shared too.
class Workers {
 public:
  /// Starts as many threads as the system permits.
  explicit Workers(int count) {
    m_threads.reserve(static_cast<std::size_t>(count - 1));
    try {
      for (int i = 1; i < count; ++i) m_threads.emplace_back([this] { work(); });
    } catch (const std::system_error&) {
    } catch (const std::bad_alloc&) {
    }
  }
  ~Workers() {
    {
      const std::lock_guard guard(m_lock);
      m_isStopping = true;
      ++m_posted;
    }
    m_wake.notify_all();
    for (std::thread& thread : m_threads) thread.join();
  }
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  int count() const { return static_cast<int>(m_threads.size()) + 1; }

  void run(std::size_t size, Executor::Task task, void* context, unsigned forksBefore) {
    Loop loop{size, task, context};
    post(loop);
    while (takeOne(loop, false)) {
    }
    if (forks.load(std::memory_order_relaxed) != forksBefore) {
      // A task called fork(), and this is the child. A thread that does not exist here may hold the
      // lock, and may have taken indices.
      if (loop.joined > 0)
        throw Error(ErrorCode::NotAvailable,
                    "a task called fork() while other threads ran tasks of the same loop; the "
                    "child process cannot finish the loop");
      return;
    }
    {
      const std::lock_guard guard(m_lock);
      (loop.newer ? loop.newer->older : m_newest) = loop.older;
      if (loop.older) loop.older->newer = loop.newer;
    }
    waitForOthers(loop);
  }

 private:
  /// A loop, which lives on the stack of the thread that runs it.
  struct Loop {
    std::size_t size;
    Executor::Task task;
    void* context;
    std::uint64_t number = 0;
    Loop *older = nullptr, *newer = nullptr;     ///< in the list; under the lock
    std::size_t first = 0;                       ///< taken by the thread that runs it
    std::atomic<std::size_t> last{0}, taken{0};  ///< taken by threads that joined; by all threads
    std::atomic<int> joined{0};
  };

  void post(Loop& loop) {
    std::size_t sleeping;
    {
      const std::lock_guard guard(m_lock);
      loop.number = ++m_lastNumber;
      loop.older = m_newest;
      if (m_newest) m_newest->newer = &loop;
      m_newest = &loop;
      ++m_posted;
      sleeping = m_sleeping;
      if (m_blocked > 0) m_changed.notify_all();
    }
    for (std::size_t i = 1; i < loop.size && i <= sleeping; ++i) m_wake.notify_one();
  }

  /// The newest loop with a number greater than `after` that has indices left. Call under the lock.
  Loop* findOpen(std::uint64_t after) const {
    for (Loop* loop = m_newest; loop && loop->number > after; loop = loop->older)
      if (loop->taken < loop->size) return loop;
    return nullptr;
  }

  /// findOpen(); the loop stays valid until leave().
  Loop* join(std::uint64_t after) {
    const std::lock_guard guard(m_lock);
    Loop* const loop = findOpen(after);
    if (loop) ++loop->joined;
    return loop;
  }

  /// The loop may end as soon as the last thread has left it. A thread that blocks increments
  /// m_blocked before it reads `joined`. At least one of the two therefore notices the other.
  void leave(Loop& loop) {
    if (--loop.joined > 0 || m_blocked == 0) return;
    const std::lock_guard guard(m_lock);
    m_changed.notify_all();
  }

  /// Waits while other threads work on the loop's last indices. These threads only wait for newer
  /// loops, so that no two threads can wait for each other.
  ///
  /// Waking a blocked thread takes a large part of the time of a small frame. The thread therefore
  /// first yields its core for a while, which is enough for most last indices.
  void waitForOthers(const Loop& loop) {
    using Clock = std::chrono::steady_clock;
    constexpr std::chrono::microseconds kMaxYielding{500};
    bool mustSearch = true;
    int lastPosted = 0;
    std::optional<Clock::time_point> yielding;
    for (Spin spin; loop.joined.load(std::memory_order_acquire) > 0;) {
      if (const int now = m_posted; mustSearch || now != lastPosted) {
        lastPosted = now;
        Loop* const newer = join(loop.number);
        mustSearch = newer != nullptr;
        if (newer) {
          takeOne(*newer, true);
          leave(*newer);
          spin = {};
          yielding.reset();
        }
      } else if (!spin.isOver()) {
        spin.wait();
      } else if (!yielding || Clock::now() - *yielding < kMaxYielding) {
        if (!yielding) yielding = Clock::now();
        std::this_thread::yield();
      } else {
        std::unique_lock guard(m_lock.mutex);
        ++m_blocked;
        m_changed.wait(guard, [&] { return loop.joined == 0 || findOpen(loop.number); });
        --m_blocked;
        mustSearch = true;
        spin = {};
        yielding.reset();
      }
    }
  }

  static bool takeOne(Loop& loop, bool joined) {
    if (loop.taken++ >= loop.size) return false;
    loop.task(loop.context, joined ? loop.size - ++loop.last : loop.first++);
    return true;
  }

  void work() {
    for (int lastPosted = m_posted; !m_isStopping; lastPosted = m_posted) {
      while (Loop* loop = join(0)) {
        while (takeOne(*loop, true)) {
        }
        leave(*loop);
      }
      for (Spin spin; m_posted == lastPosted && !spin.isOver();) spin.wait();
      if (m_posted != lastPosted) continue;
      std::unique_lock guard(m_lock.mutex);
      ++m_sleeping;
      m_wake.wait(guard, [&] { return m_posted != lastPosted; });
      --m_sleeping;
    }
  }

  BriefLock m_lock;
  Loop* m_newest = nullptr;  ///< the head of the list of loops; under the lock
  std::uint64_t m_lastNumber = 0;
  std::condition_variable m_changed;  ///< a loop was posted, or the last thread left one
  std::atomic<int> m_blocked{0};      ///< threads that wait for m_changed
  // std::atomic::wait() of libstdc++ 12 may miss a notification where the system has no futex.
  std::condition_variable m_wake;  ///< m_posted changed
  std::size_t m_sleeping = 0;      ///< threads that wait for m_wake; under the lock
  std::atomic<int> m_posted{0};    ///< counts posts; changes under the lock
  std::atomic<bool> m_isStopping{false};
  std::vector<std::thread> m_threads;
};

#endif

class ThreadPool final : public Executor {
 public:
  explicit ThreadPool(int threads)
      : m_forks(watchForks()),
        m_workers(threads > 1 ? std::make_unique<Workers>(threads) : nullptr),
        m_concurrency(m_workers ? m_workers->count() : 1) {}
  ~ThreadPool() override {
    // Threads of the parent cannot be joined, and the library's or oneTBB's locks may be held.
    if (isInChild()) static_cast<void>(m_workers.release());
  }

  int concurrency() const noexcept override { return m_concurrency; }

  void run(std::size_t count, Task task, void* context) override {
    if (count > 1 && m_concurrency > 1 && !isInChild()) {
      m_workers->run(count, task, context, m_forks);
      return;
    }
    for (std::size_t i = 0; i < count; ++i) task(context, i);
  }

 private:
  bool isInChild() const { return forks.load(std::memory_order_relaxed) != m_forks; }

  const unsigned m_forks;
  std::unique_ptr<Workers> m_workers;
  int m_concurrency;
};

}  // namespace

Threads::Threads(int count, std::shared_ptr<Executor> executor)
    : m_executor(std::move(executor)), m_count(1) {
  if (!m_executor) {
    if (threadCount(count) > 1) m_executor = std::make_shared<ThreadPool>(threadCount(count));
    if (m_executor) m_count = m_executor->concurrency();
    return;
  }
  const int concurrency = m_executor->concurrency();
  if (concurrency < 1)
    throw Error(ErrorCode::InvalidSettings, "the executor's concurrency() is " +
                                                std::to_string(concurrency) +
                                                "; it must be at least 1");
  m_count = count > 0 ? std::min(count, concurrency) : concurrency;
  if (m_count < concurrency || !dynamic_cast<ThreadPool*>(m_executor.get()))
    m_loops = std::make_unique<LoopsOnExecutor>();
}

Threads::~Threads() = default;

Threads::Threads(Threads&& other) noexcept
    : m_executor(std::move(other.m_executor)),
      m_loops(std::move(other.m_loops)),
      m_count(std::exchange(other.m_count, 1)) {}

Threads& Threads::operator=(Threads&& other) noexcept {
  m_loops = std::move(other.m_loops);
  m_executor = std::move(other.m_executor);
  m_count = std::exchange(other.m_count, 1);
  return *this;
}

void Threads::run(std::size_t size, void (*call)(void*, std::size_t), void* function) const {
  PALPATE_ASSERT(m_executor && m_count > 1 && size > 1);
  LoopBody body(call, function);
  {
    const StopScope ofExecutor(nullptr);
    if (!m_loops)
      m_executor->run(size, LoopBody::task, &body);
    else
      m_loops->run(*m_executor, std::min(size, static_cast<std::size_t>(m_count)), size, body);
  }
  body.rethrow();
}

void throwOutOfTime() { throw OutOfTime(); }

void checkThreads(int threads) {
  if (threads < 0 || threads > kMaxThreads)
    throw Error(ErrorCode::InvalidSettings,
                "threads is " + std::to_string(threads) + "; it must be in [0, 1024]");
}

Executor::~Executor() = default;

std::shared_ptr<Executor> makeThreadPool(int threads) {
  checkThreads(threads);
  return std::make_shared<ThreadPool>(threadCount(threads));
}

}  // namespace palpate
