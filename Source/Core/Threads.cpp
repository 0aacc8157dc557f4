#include "Core/Threads.h"

#include <algorithm>
#include <thread>

#ifdef PALPATE_THREADS_TBB
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#else
#include <atomic>
#include <barrier>
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

/// Whether this thread is in a run: one within a run has no pool of its own and runs where it is.
static thread_local bool isRunning = false;

/// A plain pool: the caller and count - 1 workers meet, take indices from one counter, and meet
/// again.
struct Threads::Pool {
  explicit Pool(int count) : meeting(count) {
    for (int i = 1; i < count; ++i) workers.emplace_back([this] { work(); });
  }
  ~Pool() {
    call = nullptr;
    meeting.arrive_and_wait();
    for (std::thread& worker : workers) worker.join();
  }

  void run(std::size_t newSize, void (*newCall)(void*, std::size_t), void* newFunction) {
    size = newSize;
    call = newCall;
    function = newFunction;
    next = 0;
    failure = nullptr;
    meeting.arrive_and_wait();
    takeAll();
    meeting.arrive_and_wait();
    if (failure) std::rethrow_exception(failure);
  }

  void takeAll() {
    isRunning = true;
    for (std::size_t i = next++; i < size; i = next++) {
      try {
        call(function, i);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!failure) failure = std::current_exception();
      }
    }
    isRunning = false;
  }

  void work() {
    for (meeting.arrive_and_wait(); call != nullptr; meeting.arrive_and_wait()) {
      takeAll();
      meeting.arrive_and_wait();
    }
  }

  std::vector<std::thread> workers;
  std::barrier<> meeting;
  std::mutex mutex;  ///< of the failure
  std::atomic<std::size_t> next{0};
  std::size_t size = 0;
  void (*call)(void*, std::size_t) = nullptr;  ///< none: no more will come
  void* function = nullptr;
  std::exception_ptr failure;
};

void Threads::run(std::size_t size, void (*call)(void*, std::size_t), void* function) const {
  if (isRunning) {
    for (std::size_t i = 0; i < size; ++i) call(function, i);
  } else {
    m_pool->run(size, call, function);
  }
}

#endif

Threads::Threads(int count)
    : m_count(resolved(count)), m_pool(m_count > 1 ? std::make_unique<Pool>(m_count) : nullptr) {}
Threads::~Threads() = default;
Threads::Threads(Threads&&) noexcept = default;
Threads& Threads::operator=(Threads&&) noexcept = default;

}  // namespace palpate
