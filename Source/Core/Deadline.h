#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>

namespace palpate {

/// Thrown where work ends because its time is over. An exception takes 0.03 ms, as its tables are
/// not in the caches: long loops end without one.
struct OutOfTime {};

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

/// Whether there is a deadline that is over.
inline bool isOver(const Deadline* deadline) { return deadline && deadline->isOver(); }

/// Throws OutOfTime if there is a deadline that is over.
inline void checkTime(const Deadline* deadline) {
  if (isOver(deadline)) throw OutOfTime();
}

/// Looks at the deadline in one of so many calls.
class TimeCheck {
 public:
  TimeCheck(const Deadline* deadline, unsigned calls) : m_deadline(deadline), m_calls(calls) {}
  bool isOver() { return m_deadline && ++m_count % m_calls == 0 && m_deadline->isOver(); }
  /// Throws OutOfTime if it is over.
  void operator()() {
    if (isOver()) throw OutOfTime();
  }

 private:
  const Deadline* m_deadline;
  unsigned m_calls, m_count = 0;
};

/// std::sort() until the deadline, if there is one.
template <class Iterator, class Less>
void sortUntil(const Deadline* deadline, Iterator begin, Iterator end, Less&& less) {
  if (!deadline) return std::sort(begin, end, less);
  TimeCheck check(deadline, 512);
  std::sort(begin, end, [&](const auto& l, const auto& r) {
    check();
    return less(l, r);
  });
}

/// Calls use(part) for the items in order: for all at once, or with a deadline for few at a time,
/// until it is over. Returns whether it was called for all. use: its result must not depend on how
/// items are divided.
template <class Span, class Use>
bool forEachPart(const Deadline* deadline, const Span& items, Use&& use) {
  constexpr std::size_t kPart = 16;  // takes some microseconds
  if (!deadline) {
    use(items);
    return true;
  }
  for (std::size_t begin = 0; begin < items.size(); begin += kPart) {
    if (deadline->isOver()) return false;
    use(items.subspan(begin, begin + kPart < items.size() ? kPart : items.size() - begin));
  }
  return true;
}

}  // namespace palpate
