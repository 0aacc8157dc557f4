#include "NarrowPhase/PassageFinder.h"

#include "NarrowPhase/Continuous.h"
#include "Contact/Filters.h"
#include "NarrowPhase/Surroundings.h"
#include "Math/PassageFilter.h"

#include <functional>
#include <utility>

namespace palpate {

using Kind = ImpactQuery::Kind;

namespace {

template <Kind kind>
Features<kind> featuresOf(const MeshPair& pair, bool swapped) {
  if (swapped) return {pair.b, pair.a};
  return {pair.a, pair.b};
}

}  // namespace

template <Kind kind>
void PassageFinder::append(const WaitingPair& features, const Passages& passages) {
  const auto [firstId, secondId, swapped] = features;
  m_out.exactDecisions += passages.exact;
  if (passages.count == 0) return;
  Crossing crossing;
  if constexpr (kind == Kind::VertexTriangle) {
    if (rejectsVertex(m_pair, firstId, secondId, swapped)) return;
    const bool ofSecond = swapped && !m_pair.self();
    crossing.kind = ofSecond ? ContactKind::TriangleVertex : ContactKind::VertexTriangle;
    crossing.ids = {firstId, secondId, kNoElement, kNoElement};
    if (ofSecond) std::swap(crossing.ids[0], crossing.ids[1]);
  } else {
    if (rejectsEdges(m_pair, firstId, secondId)) return;
    crossing.kind = ContactKind::EdgeEdge;
    crossing.ids = featuresOf<kind>(m_pair, swapped).vertices(firstId, secondId);
  }
  for (int i = 0; i < passages.count; ++i) {
    crossing.time = passages.all[static_cast<std::size_t>(i)].time;
    crossing.forward = passages.all[static_cast<std::size_t>(i)].forward;
    m_out.passages.push_back(crossing);
  }
}

template <Kind kind>
void PassageFinder::find() {
  Waiting& waiting = m_waiting[static_cast<std::size_t>(kind)];
  const std::size_t count = std::exchange(waiting.count, 0);
  BlockPassages known{};
  // A block takes as long as two pairs.
  if (count > 2) {
    ImpactBlock block;
    for (std::size_t lane = 0; lane < count; ++lane) {
      const auto [firstId, secondId, swapped] = waiting.pairs[lane];
      const Features<kind> features = featuresOf<kind>(m_pair, swapped);
      const auto ids = features.vertices(firstId, secondId);
      for (int i = 0; i < 4; ++i) {
        const TriangleMesh& mesh = features.meshOf(i);
        block.set(static_cast<int>(lane), i, mesh.before[ids[i]], mesh.now[ids[i]]);
      }
    }
    known = findPassages(kind, block, m_tolerance);
  }
  for (std::size_t lane = 0; lane < count; ++lane) {
    const WaitingPair& features = waiting.pairs[lane];
    Passages passages;
    if (!(known.isKnown >> lane & 1)) {
      const Features<kind> both = featuresOf<kind>(m_pair, features.swapped);
      const auto findAround = [&](std::array<int, 2> touch, const PlaceOnSegment& place,
                                  TouchSurroundings& around) {
        findSurroundings(both, features.firstId, features.secondId, touch, place, around);
      };
      const Surroundings around{std::ref(findAround), features.swapped};
      passages =
          findPassages(both.query(features.firstId, features.secondId), m_tolerance, &around);
    } else if (known.passes >> lane & 1) {
      passages.all[passages.count++] = {known.times[lane], (known.forward >> lane & 1) != 0};
    }
    append<kind>(features, passages);
  }
}
template void PassageFinder::find<Kind::VertexTriangle>();
template void PassageFinder::find<Kind::EdgeEdge>();

void PassageFinder::finish() {
  find<Kind::VertexTriangle>();
  find<Kind::EdgeEdge>();
}

}  // namespace palpate
