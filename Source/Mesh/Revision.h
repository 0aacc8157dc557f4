#pragma once

#include "Core/CountedVector.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

namespace palpate {

/// Identifies one state of an object that changes: equal revisions mean equal states.
class Revision {
 public:
  class Counter;
  Revision() = default;  ///< the initial state, before any change
  friend bool operator==(Revision, Revision) = default;

 private:
  explicit Revision(std::uint64_t number) : m_number(number) {}
  std::uint64_t m_number = 0;
};

/// Creates revisions, each of them once. Revisions of different counters are not comparable.
class Revision::Counter {
 public:
  Counter() = default;
  explicit Counter(std::uint64_t last) : m_last(last) {}  ///< begins above this number
  Revision next() { return Revision(++m_last); }

 private:
  std::uint64_t m_last = 0;
};

/// The elements of a geometry: their topology with the shape at rest, and which are enabled.
struct ElementsState {
  Revision topology, enabled;
  friend bool operator==(const ElementsState&, const ElementsState&) = default;
};

/// Positions at one end of a step: those in the body's frame, and the transform.
struct PositionsState {
  Revision body, transform;
  friend bool operator==(const PositionsState&, const PositionsState&) = default;
};

/// The cuts of a geometry since its last detection, as long as nothing else changed its elements.
struct CutsSince {
  ElementsState before, after;   ///< the elements before the first of these cuts, and now
  std::uint32_t firstAdded = 0;  ///< elements from here on are new
  /// Elements that are no more, ascending, with their vertices.
  CountedVector<std::pair<std::uint32_t, std::array<std::uint32_t, 3>>> gone{};
  /// Positions to which vertices were appended: their revisions now and before these cuts.
  CountedVector<std::array<Revision, 2>> positions{};
  Revision positionsBefore(Revision now) const {
    for (const auto& known : positions)
      if (known[0] == now) return known[1];
    return now;
  }
  void append(Revision last, Revision now) {
    const auto known = std::find_if(positions.begin(), positions.end(),
                                    [&](const auto& each) { return each[0] == last; });
    if (known != positions.end())
      (*known)[0] = now;
    else
      positions.push_back({now, last});
  }
};

/// The state that a derived value was computed from, of named revisions: the one place that
/// compares them.
///
/// Code that computes the value calls invalidate() before the first change to it and commit() after
/// the last one. If a computation fails, the value therefore counts as outdated.
template <class State>
class DerivedFrom {
 public:
  bool isCurrent(const State& state) const { return m_isValid && m_state == state; }
  bool isValid() const { return m_isValid; }
  const State& state() const { return m_state; }  ///< of the last commit()
  void invalidate() { m_isValid = false; }
  void commit(const State& state) {
    m_state = state;
    m_isValid = true;
  }

 private:
  State m_state{};
  bool m_isValid = false;
};

}  // namespace palpate
