#pragma once

#include "Core/Stopping.h"

#include <algorithm>
#include <cstddef>

namespace palpate {

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
