#include "Core/Threads.h"

#include "Core/Spin.h"

#include <algorithm>
#include <thread>

#ifdef PALPATE_THREADS_TBB
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#else
#include <atomic>
#include <cstdint>
#include <exception>
#include <mutex>
#include <vector>
#endif

namespace palpate {

namespace {

int resolved(int count) {
  if (count > 0) return count;
  const unsigned cores = std::thread::hardware_concurrency();
  return cores == 0 ? 1 : static_cast<int>(cores);
}

}  // namespace

#ifdef PALPATE_THREADS_TBB

/// At most as many workers as the process may have: oneTBB has no more, and prints a warning when
/// asked.
struct Threads::Pool {
  explicit Pool(int count) : arena(std::min(count, allowed())) {}
  static int allowed() {
    return static_cast<int>(
        tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism));
  }
  tbb::task_arena arena;
};

void Threads::run(std::size_t size, void (*call)(void*, std::size_t), void* function) const {
  m_pool->arena.execute([&] {
    tbb::parallel_for(
        std::size_t{0}, size, [&](std::size_t i) { call(function, i); }, tbb::simple_partitioner());
  });
}

#else

namespace {

void waitOrYield(Spin& spin) {
  if (spin.isOver())
    std::this_thread::yield();
  else
    spin.wait();
}

/// Held for a few instructions at a time.
struct BriefLock {
  void lock() {
    for (Spin spin; flag.test_and_set(std::memory_order_acquire);) waitOrYield(spin);
  }
  void unlock() { flag.clear(std::memory_order_release); }
  std::atomic_flag flag;
};

}  // namespace

/// A plain pool. Indices of a loop are taken one by one, from the first on by the thread that runs
/// it, from the last on by whoever joins, so that from loop to loop a thread meets the same data:
/// workers join, and threads that wait for the last indices of a loop of their own. So loops within
/// loops are shared too.
struct Threads::Pool {
  explicit Pool(int count) {
    loops.reserve(4 * static_cast<std::size_t>(count));
    for (int i = 1; i < count; ++i) workers.emplace_back([this] { work(); });
  }
  ~Pool() {
    over = true;
    ++posted;
    posted.notify_all();
    for (std::thread& worker : workers) worker.join();
  }

  struct Loop {
    std::size_t size;
    void (*call)(void*, std::size_t);
    void* function;
    std::uint64_t number = 0;
    std::size_t first = 0;                       ///< taken by the thread that runs it
    std::atomic<std::size_t> last{0}, taken{0};  ///< by those who joined; by all
    std::atomic<int> joined{0};
    std::exception_ptr failure{};
  };

  void run(std::size_t size, void (*call)(void*, std::size_t), void* function) {
    Loop loop{size, call, function};
    post(loop);
    while (takeOne(loop, false)) {
    }
    {
      const std::lock_guard guard(lock);
      std::erase(loops, &loop);
    }
    // Others are at its last indices; what they wait for is in newer loops.
    for (Spin spin; loop.joined.load(std::memory_order_acquire) > 0; waitOrYield(spin))
      if (Loop* newer = join(loop.number)) {
        takeOne(*newer, true);
        leave(*newer);
        spin = {};
      }
    if (loop.failure) std::rethrow_exception(loop.failure);
  }

  void post(Loop& loop) {
    {
      const std::lock_guard guard(lock);
      loop.number = ++lastNumber;
      loops.push_back(&loop);
    }
    ++posted;
    for (std::size_t i = 1; i < std::min(loop.size, workers.size() + 1); ++i) posted.notify_one();
  }

  /// The newest loop after the one numbered that has indices left; it stays until left.
  Loop* join(std::uint64_t after) {
    const std::lock_guard guard(lock);
    for (auto loop = loops.rbegin(); loop != loops.rend() && (*loop)->number > after; ++loop)
      if ((*loop)->taken < (*loop)->size) {
        ++(*loop)->joined;
        return *loop;
      }
    return nullptr;
  }

  static void leave(Loop& loop) { loop.joined.fetch_sub(1, std::memory_order_release); }

  bool takeOne(Loop& loop, bool joined) {
    if (loop.taken++ >= loop.size) return false;
    const std::size_t i = joined ? loop.size - ++loop.last : loop.first++;
    try {
      loop.call(loop.function, i);
    } catch (...) {
      const std::lock_guard guard(lock);
      if (!loop.failure) loop.failure = std::current_exception();
    }
    return true;
  }

  void work() {
    for (int seen = posted; !over; seen = posted) {
      while (Loop* loop = join(0)) {
        while (takeOne(*loop, true)) {
        }
        leave(*loop);
      }
      for (Spin spin; posted == seen && !spin.isOver();) spin.wait();
      posted.wait(seen);
    }
  }

  BriefLock lock;
  std::vector<Loop*> loops;  ///< oldest first; under the lock
  std::uint64_t lastNumber = 0;
  std::atomic<int> posted{0};  ///< counts posts: workers sleep until it changes
  std::atomic<bool> over{false};
  std::vector<std::thread> workers;
};

void Threads::run(std::size_t size, void (*call)(void*, std::size_t), void* function) const {
  m_pool->run(size, call, function);
}

#endif

Threads::Threads(int count)
    : m_count(resolved(count)), m_pool(m_count > 1 ? std::make_unique<Pool>(m_count) : nullptr) {}
Threads::~Threads() = default;
Threads::Threads(Threads&&) noexcept = default;
Threads& Threads::operator=(Threads&&) noexcept = default;

}  // namespace palpate
