#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace palpate {

/// Identifies one state of an object that changes: equal revisions mean equal states.
class Revision {
 public:
  Revision() = default;  ///< the initial state, before any change
  friend bool operator==(Revision, Revision) = default;

 private:
  friend class RevisionCounter;
  explicit Revision(std::uint64_t number) : m_number(number) {}
  std::uint64_t m_number = 0;
};

/// Creates revisions, each of them once. Revisions of different counters are not comparable.
class RevisionCounter {
 public:
  Revision next() { return Revision(++m_last); }

 private:
  std::uint64_t m_last = 0;
};

/// The states that a derived value was computed from: the one place that compares revisions.
///
/// Code that computes the value calls invalidate() before the first change to it and commit() after
/// the last one. If a computation fails, the value therefore counts as outdated.
template <std::size_t count>
class DerivedFrom {
 public:
  using Sources = std::array<Revision, count>;

  bool isCurrent(const Sources& sources) const { return m_isValid && m_sources == sources; }
  bool isValid() const { return m_isValid; }
  const Sources& sources() const { return m_sources; }
  void invalidate() { m_isValid = false; }
  void commit(const Sources& sources) {
    m_sources = sources;
    m_isValid = true;
  }

 private:
  Sources m_sources{};
  bool m_isValid = false;
};

}  // namespace palpate
