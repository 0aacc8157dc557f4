#pragma once

#include "Mesh/Motion.h"
#include "Mesh/Positions.h"
#include "Mesh/Revision.h"
#include "Mesh/TriangleMesh.h"
#include "Core/CountedVector.h"

#include <cstdint>
#include <optional>
#include <span>
#include <utility>

namespace palpate {

/// How far the vertices of a geometry move from one detection to the next, by pieces of consecutive
/// vertices. Where vertices that are near each other have near numbers, a part of a mesh that does
/// not move has pieces that do not.
class PieceMotion {
 public:
  static constexpr std::size_t kPiece = 128;  ///< vertices; any number will do
  static std::size_t pieceCount(std::size_t vertices) { return (vertices + kPiece - 1) / kPiece; }

  /// Call before advanceTo(), which then does not throw.
  void reserve(std::size_t vertices) { m_ranges.reserve(pieceCount(vertices)); }
  /// Measures the motion from the positions that were given last. Vertices that were appended since
  /// then are still. Without any positions, or with more of them before, all is.
  /// Cost     reads both positions once; none where they are the same.
  void advanceTo(const Positions& now);
  /// Forgets the positions, so that their memory can be used again.
  void forget() { m_to.reset(); }
  bool isAt(const Positions& positions) const { return m_to && m_to->hasSameBody(positions); }
  /// Takes these in the place of those that were given last, to which vertices were appended.
  void continueAt(const Positions& appended) noexcept { m_to = appended; }

  Revision from() const { return m_from; }  ///< the bodies of the last advanceTo()
  Revision to() const { return m_to ? m_to->bodyRevision() : Revision(); }
  bool isKnown() const { return m_isKnown; }                        ///< the motion was measured
  std::span<const MotionRange> ranges() const { return m_ranges; }  ///< of each piece
  MotionRange of(std::span<const std::uint32_t> pieces) const {
    MotionRange all;
    for (const std::uint32_t piece : pieces) all.add(m_ranges[piece]);
    return all;
  }

 private:
  std::optional<Positions> m_to;
  Revision m_from;
  bool m_isKnown = false;
  CountedVector<MotionRange> m_ranges;
};

/// The pieces of the vertices of each range of elements [first, second).
IndexLists piecesOf(std::span<const Triangle> elements,
                    std::span<const std::pair<std::uint32_t, std::uint32_t>> ranges,
                    std::size_t vertexCount);

/// Finds the pieces of those ranges of groups again that hold one of `changed`, and calls found(i)
/// for each. groups: the first element of each, and the number of elements. pieces: of each range.
/// rangeOf(i): its groups, which ascend. changed: groups, ascending.
template <class RangeOf, class F>
void findPiecesAgain(std::span<const Triangle> elements, std::span<const std::uint32_t> groups,
                     std::span<const std::uint32_t> changed, std::size_t vertexCount,
                     IndexLists& pieces, RangeOf&& rangeOf, F&& found) {
  CountedVector<std::size_t> again;
  CountedVector<std::pair<std::uint32_t, std::uint32_t>> places;
  auto group = changed.begin();
  for (std::size_t i = 0; i < pieces.size() && group != changed.end(); ++i) {
    const std::pair<std::uint32_t, std::uint32_t> range = rangeOf(i);
    if (*group >= range.second) continue;
    while (group != changed.end() && *group < range.second) ++group;
    again.push_back(i);
    places.push_back({groups[range.first], groups[range.second]});
  }
  const IndexLists now = piecesOf(elements, places, vertexCount);
  pieces.reserveMore(0, now.itemCount());
  for (std::size_t i = 0; i < again.size(); ++i) {
    pieces.replace(again[i], now[i]);
    found(again[i]);
  }
}

}  // namespace palpate
