#pragma once

#include "Contact/Contents.h"
#include "Contact/ImpactPlaces.h"
#include "Contact/MeshPair.h"
#include "Core/Buffer.h"

#include <array>
#include <cstdint>

namespace palpate {

/// Finds rows of impacts at the step's end (CollisionData::Contents::Step::endRows). A row is
/// linearised at its time, and may ask for more than the features need at the end: where they slide
/// past an edge, the row of the plane behind it knows nothing of the edge. An impact that stays
/// stands for itself and for the dropped impacts that it replaces. If no vertex of it may have met
/// the other mesh in the step, its features kept their sides. If its row asks for more than they
/// need, the row at the end has the gap of the nearest pair for which it stands. It is that pair's,
/// if it is one of the same vertex or edges and no element excludes its normal at the end.
///
/// The scratch remembers its peak.
class EndRows {
 public:
  using EndRow = CollisionData::Contents::Step::EndRow;

  void find(const MeshPair&, const Impacts&, const DroppedImpacts&);
  /// Null if the contact's own row serves.
  const EndRow* of(const ImpactPlace& place) const {
    const std::uint32_t row = m_rowOf[place];
    return row == kNoRow ? nullptr : &m_rows[row];
  }

 private:
  static constexpr std::uint32_t kNoRow = 0xffffffffu;
  /// Of a vertex: whether it may have met the other mesh.
  enum Met : std::uint8_t { kUnknown, kAsked, kMet };
  /// An impact that stays, whose row asks for more than its features need.
  struct Candidate {
    ImpactPlace place;
    double gap;  ///< L: at the step's end
  };

  template <class Contact, class F>
  bool anyVertex(const Contact&, ContactKind, F&&);
  void startVertices(const MeshPair&);
  void findCandidates(const MeshPair&, const Impacts&, const DroppedImpacts&);
  void findMet(const MeshPair&, const Impacts&);
  void makeRows(const Impacts&);
  void takeNearest(const MeshPair&, const Impacts&, const DroppedImpacts&);
  void takeNormals(const MeshPair&, const Impacts&);

  PerImpact<std::uint32_t> m_rowOf;
  Buffer<EndRow> m_rows;
  Buffer<ContactKind> m_kinds;    ///< of m_rows
  Buffer<ImpactPlace> m_nearest;  ///< of m_rows: the pair with this gap
  Buffer<Candidate> m_candidates;
  bool m_self = false;
  /// By side and vertex: whether the vertex of a candidate may have met the other mesh. Between
  /// calls all are unknown.
  std::array<Buffer<std::uint8_t>, 2> m_met;
  bool m_isMarked = false;  ///< not all are
};

}  // namespace palpate
