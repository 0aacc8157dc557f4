#pragma once

#include "NarrowPhase/NarrowPhase.h"
#include "Math/ImpactFilter.h"
#include "Math/ImpactQuery.h"

#include <array>
#include <cstdint>

namespace palpate {

/// Appends the passages of features that have an impact (PairSettings::reportCrossings), unless a
/// filter suppresses them. Feature pairs wait until a block is full.
class PassageFinder {
 public:
  PassageFinder(const MeshPair& pair, double tolerance, ContactBuffers& out)
      : m_pair(pair), m_tolerance(tolerance), m_out(out) {}

  /// The ids of Features. swapped: Features::first is MeshPair::b.
  template <ImpactQuery::Kind kind>
  void add(std::uint32_t firstId, std::uint32_t secondId, bool swapped) {
    Waiting& waiting = m_waiting[static_cast<std::size_t>(kind)];
    waiting.pairs[waiting.count++] = {firstId, secondId, swapped};
    if (waiting.count == ImpactBlock::kLanes) find<kind>();
  }
  /// Call after the last pair.
  void finish();

 private:
  struct WaitingPair {
    std::uint32_t firstId, secondId;
    bool swapped;
  };
  struct Waiting {
    std::array<WaitingPair, ImpactBlock::kLanes> pairs;
    std::size_t count = 0;
  };
  template <ImpactQuery::Kind kind>
  void find();
  template <ImpactQuery::Kind kind>
  void append(const WaitingPair&, const Passages&);

  const MeshPair& m_pair;
  const double m_tolerance;
  ContactBuffers& m_out;
  std::array<Waiting, 2> m_waiting;
};

}  // namespace palpate
