#include "Mesh/PieceMotion.h"

#include "Core/Assert.h"

#include <algorithm>
#include <utility>

namespace palpate {

void PieceMotion::advanceTo(const Positions& now) {
  const std::size_t size = now.size();
  m_ranges.resize(pieceCount(size));
  m_isKnown = m_to && m_to->size() <= size;
  m_from = m_isKnown ? m_to->bodyRevision() : now.bodyRevision();
  if (m_isKnown && !m_to->hasSameBody(now)) {
    const auto before = m_to->body(), after = now.body();
    const VertexRange changed =
        now.changesSince(m_to->bodyRevision()).value_or(VertexRange{0, size});
    for (std::size_t piece = 0; piece < m_ranges.size(); ++piece) {
      const std::size_t begin = std::min(piece * kPiece, before.size()),
                        count = std::min(kPiece, before.size() - begin);
      m_ranges[piece] = changed.overlaps({begin, begin + count})
                            ? motionRange(before.subspan(begin, count), after.subspan(begin, count))
                            : MotionRange{.isEmpty = false};
    }
  } else {
    std::fill(m_ranges.begin(), m_ranges.end(), MotionRange{.isEmpty = false});
  }
  m_to = now;
}

IndexLists piecesOf(std::span<const Triangle> elements,
                    std::span<const std::pair<std::uint32_t, std::uint32_t>> ranges,
                    std::size_t vertexCount) {
  CountedVector<std::uint32_t> offsets{0}, items;
  CountedVector<std::size_t> lastRange(vertexCount / PieceMotion::kPiece + 1, 0);
  std::size_t number = 0;
  for (const auto& [begin, end] : ranges) {
    PALPATE_ASSERT(begin <= end && end <= elements.size());
    ++number;
    for (std::uint32_t i = begin; i < end; ++i)
      for (const std::uint32_t vertex : elements[i]) {
        const std::uint32_t piece = vertex / static_cast<std::uint32_t>(PieceMotion::kPiece);
        if (std::exchange(lastRange[piece], number) != number) items.push_back(piece);
      }
    offsets.push_back(static_cast<std::uint32_t>(items.size()));
  }
  return {offsets, std::move(items)};
}

}  // namespace palpate
