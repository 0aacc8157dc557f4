#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <utility>

namespace palpate {

/// Thrown where work ends because its time is over.
struct OutOfTime {};

[[noreturn]] void throwOutOfTime();

/// The end of a detection's budget, or an earlier cancel. Once it is over, it stays over. Any
/// thread may ask.
class Deadline {
 public:
  using Time = std::chrono::steady_clock::time_point;
  using Clock = std::function<Time()>;

  /// clock: of tests; empty: the system's.
  Deadline(Time end, const std::atomic<bool>& isCancelled, const Clock& clock)
      : m_end(end), m_isCancelled(&isCancelled), m_clock(&clock) {}

  bool isOver() const {
    if (m_isOver.load(std::memory_order_relaxed)) return true;
    if (!m_isCancelled->load(std::memory_order_relaxed) && now() < m_end) return false;
    m_isOver.store(true, std::memory_order_relaxed);
    return true;
  }
  /// Throws OutOfTime if it is over.
  void check() const {
    if (isOver()) throwOutOfTime();
  }

  static Time now(const Clock& clock) { return clock ? clock() : std::chrono::steady_clock::now(); }
  static Time after(Time start, std::chrono::microseconds budget) {
    using std::chrono::microseconds;
    const auto most = std::chrono::duration_cast<microseconds>(Time::max() - start);
    return start + std::clamp(budget, microseconds(0), most);
  }

 private:
  Time now() const { return now(*m_clock); }

  Time m_end;
  const std::atomic<bool>* m_isCancelled;
  const Clock* m_clock;
  mutable std::atomic<bool> m_isOver{false};
};

/// The deadline of what this thread does, while this object exists. Threads carries it to the
/// threads of a loop, and asks it before each index. Code of the caller, such as a predicate, runs
/// without one: it may use other objects of the library. The token is not in a Threads object,
/// because a frame shares that with queries, which no budget ends.
class StopScope {
 public:
  using Token = const Deadline*;  ///< null: none

  explicit StopScope(Token token) : m_before(std::exchange(s_current, token)) {}
  ~StopScope() { s_current = m_before; }
  StopScope(const StopScope&) = delete;
  StopScope& operator=(const StopScope&) = delete;

  static Token current() { return s_current; }

 private:
  static inline constinit thread_local Token s_current = nullptr;
  const Token m_before;
};

/// Whether a deadline may end what this thread does. Work then has small parts, in the order of
/// urgency. Results do not depend on the parts.
inline bool isTimed() { return StopScope::current() != nullptr; }

/// Throws OutOfTime if there is a deadline that is over.
inline void checkTime() {
  if (const StopScope::Token token = StopScope::current()) token->check();
}

/// Calls f. Returns false if OutOfTime ended it.
template <class F>
bool endsInTime(F&& f) {
  try {
    f();
    return true;
  } catch (const OutOfTime&) {
    return false;
  }
}

/// checkTime() in one of so many calls, for a loop on one thread.
class TimeCheck {
 public:
  explicit TimeCheck(unsigned calls) : m_calls(calls) {}
  void operator()() {
    if (m_token && ++m_count % m_calls == 0) m_token->check();
  }

 private:
  const StopScope::Token m_token = StopScope::current();
  unsigned m_calls, m_count = 0;
};

/// std::sort() that throws OutOfTime if there is a deadline that is over.
template <class Iterator, class Less>
void sortInTime(Iterator begin, Iterator end, Less&& less) {
  if (!isTimed()) return std::sort(begin, end, less);
  TimeCheck check(512);
  std::sort(begin, end, [&](const auto& l, const auto& r) {
    check();
    return less(l, r);
  });
}

/// Calls use(part) for all items in order. Without a deadline there is one part. Else parts are
/// small, and OutOfTime is thrown before a part if the deadline is over. The result of use must not
/// depend on how items are divided.
template <class Span, class Use>
void forEachPart(const Span& items, Use&& use) {
  constexpr std::size_t kPart = 16;  // takes some microseconds
  const StopScope::Token token = StopScope::current();
  if (!token) return use(items);
  for (std::size_t begin = 0; begin < items.size(); begin += kPart) {
    token->check();
    use(items.subspan(begin, begin + kPart < items.size() ? kPart : items.size() - begin));
  }
}

}  // namespace palpate
