#include "Core/LoopsOnExecutor.h"

#include <palpate/Error.h>

#include "Core/Assert.h"

#include <algorithm>
#include <condition_variable>

namespace palpate {

/// The executor gets runs, each of which takes indices one by one until none is left. The order of
/// the runs does not matter, nor how often each one is called. A run that is called too late finds
/// the loop closed.
class LoopsOnExecutor::Loop {
 public:
  Loop* nextAbandoned = nullptr;

  /// Whether no run of the last loop can still be called.
  bool isFree() {
    const std::lock_guard guard(m_lock);
    return !m_open && m_begun >= m_runs;
  }

  void run(Executor& executor, std::size_t runs, std::size_t size, LoopBody& body) {
    open(runs, size, body);
    try {
      executor.run(runs, task, this);
    } catch (...) {
      close();
      throw;
    }
    if (!close())
      throw Error(ErrorCode::InvalidSettings,
                  "the executor's run() returned before it had run all tasks");
  }

 private:
  static void task(void* loop, std::size_t) noexcept { static_cast<Loop*>(loop)->takeAll(); }

  void open(std::size_t runs, std::size_t size, LoopBody& body) {
    const std::lock_guard guard(m_lock);
    m_body = &body;
    m_size = size;
    m_next = 0;
    m_runs = runs;
    m_begun = 0;
    m_open = true;
  }

  /// Waits for the runs that have begun. Returns false if some run has not begun.
  bool close() {
    std::unique_lock guard(m_lock);
    const bool all = m_begun >= m_runs;
    m_open = false;
    if (!all) m_next = m_size;
    m_ended.wait(guard, [&] { return m_active == 0; });
    return all;
  }

  void takeAll() noexcept {
    {
      const std::lock_guard guard(m_lock);
      ++m_begun;
      if (!m_open) return;
      ++m_active;
    }
    for (std::size_t i; (i = m_next++) < m_size;) m_body->runOne(i);
    const std::lock_guard guard(m_lock);
    if (--m_active == 0) m_ended.notify_all();
  }

  std::mutex m_lock;
  std::condition_variable m_ended;
  LoopBody* m_body = nullptr;
  std::size_t m_size = 0, m_runs = 0, m_begun = 0, m_active = 0;
  std::atomic<std::size_t> m_next{0};
  bool m_open = false;
};

LoopsOnExecutor::LoopsOnExecutor() = default;

LoopsOnExecutor::~LoopsOnExecutor() {
  PALPATE_ASSERT(m_idle.size() == m_all.size());
  // A list of all abandoned loops tells leak checkers that this is intended.
  static std::atomic<Loop*> abandoned{nullptr};
  for (auto& loop : m_all)
    if (!loop->isFree()) {
      loop->nextAbandoned = abandoned;
      while (!abandoned.compare_exchange_weak(loop->nextAbandoned, loop.get())) {
      }
      static_cast<void>(loop.release());
    }
}

void LoopsOnExecutor::run(Executor& executor, std::size_t runs, std::size_t size, LoopBody& body) {
  PALPATE_ASSERT(runs > 0 && runs <= size);
  Loop* const loop = take();
  const struct Return {
    LoopsOnExecutor& loops;
    Loop* loop;
    ~Return() { loops.putBack(loop); }
  } atEnd{*this, loop};
  loop->run(executor, runs, size, body);
}

LoopsOnExecutor::Loop* LoopsOnExecutor::take() {
  const std::lock_guard guard(m_lock);
  const auto found =
      std::find_if(m_idle.begin(), m_idle.end(), [](Loop* loop) { return loop->isFree(); });
  if (found == m_idle.end()) {
    m_idle.reserve(m_all.size() + 1);  // so that putting it back cannot fail
    return m_all.emplace_back(std::make_unique<Loop>()).get();
  }
  Loop* const loop = *found;
  m_idle.erase(found);
  return loop;
}

void LoopsOnExecutor::putBack(Loop* loop) {
  const std::lock_guard guard(m_lock);
  PALPATE_ASSERT(m_idle.size() < m_idle.capacity());
  m_idle.push_back(loop);
}

}  // namespace palpate
