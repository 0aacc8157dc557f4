#include "Contact/ExcludedImpacts.h"

#include "Core/Stopping.h"

#include <bit>
#include <numeric>

namespace palpate {

void ExcludedSearch::find(const MeshPair& meshes, const Impacts& impacts, DroppedImpacts& dropped) {
  const ExcludedImpacts rule(meshes);
  PerImpact<std::uint8_t>& isExcluded = dropped.isDropped;  // until each is looked up
  std::size_t excluded = 0;
  impacts.forEach([&](const auto& contact, const ImpactPlace& place) {
    excluded += isExcluded[place] = rule.isExcluded(SidedImpact(place.kind, contact));
  });
  if (excluded == 0) return;
  m_self = meshes.self();
  listHolders(rule, impacts, isExcluded);
  impacts.forEach([&](const auto& contact, const ImpactPlace& place) {
    if (!isExcluded[place]) return;
    isExcluded[place] = 0;
    dropIfHeld(rule, impacts, SidedImpact(place.kind, contact), place, dropped);
  });
}

/// A mesh with itself has each of its elements on both sides.
std::size_t ExcludedSearch::bucketOf(std::size_t side, std::uint32_t vertex) const {
  return (side == 1 && !m_self ? vertex + m_buckets / 2 : vertex) & (m_buckets - 1);
}

/// Lists the impacts that are not excluded by the first vertex and the size of the element that
/// they hold.
void ExcludedSearch::listHolders(const ExcludedImpacts& rule, const Impacts& impacts,
                                 const PerImpact<std::uint8_t>& excluded) {
  std::size_t stay = 0;
  impacts.forEach([&](const auto&, const ImpactPlace& place) { stay += !excluded[place]; });
  m_buckets = std::bit_ceil(stay + 1);
  const auto forEachHolder = [&](auto&& f) {
    impacts.forEach([&](const auto& contact, const ImpactPlace& place) {
      if (excluded[place]) return;
      const SidedImpact impact(place.kind, contact);
      rule.anyHeldSide(impact, [&](std::size_t side) {
        const ImpactElement& element = impact.elements[side];
        f(3 * bucketOf(side, element.ids[0]) + element.size - 1,
          Holder{place, static_cast<std::uint32_t>(side), impact.isOfFace, impact.time,
                 impact.distance, element, kNoPlane});
        return false;
      });
    });
  };
  // A counting sort: m_starts[n + 1] becomes the end of the holders with key n.
  m_starts.assign(3 * m_buckets + 2, 0);
  std::size_t holders = 0;
  forEachHolder([&](std::size_t n, const Holder&) {
    ++m_starts[n + 2];
    ++holders;
  });
  std::partial_sum(m_starts.begin(), m_starts.end(), m_starts.begin());
  m_holders.resize(holders);
  forEachHolder(
      [&](std::size_t n, const Holder& holder) { m_holders[m_starts[n + 1]++] = holder; });
  m_planes.clear();
}

TangentPlane ExcludedSearch::planeOf(const ExcludedImpacts& rule, const Impacts& impacts,
                                     Holder& holder) {
  if (holder.plane == kNoPlane) {
    holder.plane = static_cast<std::uint32_t>(m_planes.size());
    impacts.with(holder.place, [&](const auto& contact) {
      m_planes.push_back(rule.planeOf(SidedImpact(holder.place.kind, contact), holder.side));
    });
  }
  return m_planes[holder.plane];
}

/// Calls f(holder) for the holders of parts of an impact's element that `isAsked`, until it returns
/// true. Begins at the closest vertex: an impact of it mostly stands for this one.
template <class IsAsked, class F>
bool ExcludedSearch::anyHolder(const SidedImpact& c, std::size_t side, IsAsked&& isAsked, F&& f) {
  const ImpactElement& element = c.elements[side];
  const auto anyAt = [&](std::uint32_t vertex) {
    const std::size_t n = 3 * bucketOf(side, vertex);
    for (std::uint32_t i = m_starts[n]; i < m_starts[n + element.size]; ++i) {
      Holder& holder = m_holders[i];
      if (holder.element.ids[0] == vertex && (m_self || holder.side == side) && isAsked(holder) &&
          holder.element.isIn(element) && f(holder))
        return true;
    }
    return false;
  };
  const std::uint32_t first = c.closest[side].ids[0];
  if (anyAt(first)) return true;
  const auto vertices = element.vertices();
  return std::any_of(vertices.begin(), vertices.end(),
                     [&](std::uint32_t vertex) { return vertex != first && anyAt(vertex); });
}

void ExcludedSearch::dropIfHeld(const ExcludedImpacts& rule, const Impacts& impacts,
                                const SidedImpact& c, const ImpactPlace& place,
                                DroppedImpacts& dropped) {
  rule.anyHeldSide(c, [&](std::size_t side) {
    ExcludedImpacts::Held held(rule, c, side);
    const auto lowestGap = [&](const TangentPlane& plane) {
      double gap = plane.gap;
      const auto isLower = [&](Holder& other) {
        const TangentPlane its = planeOf(rule, impacts, other);
        if (its.gap < gap && plane.isSameAs(its)) gap = its.gap;
        return false;
      };
      anyHolder(
          c, side, [](const Holder&) { return true; }, isLower);
      return gap;
    };
    const auto isInTime = [&](const Holder& holder) {
      return rule.isInTime(holder.isOfFace, holder.time, holder.distance, c);
    };
    const auto stands = [&](Holder& holder) {
      const TangentPlane plane = planeOf(rule, impacts, holder);
      if (!held.isBeside(plane) || !held.isReplacedBy(holder.element, plane, lowestGap))
        return false;
      dropped.drop(place, holder.place);
      return true;
    };
    return anyHolder(c, side, isInTime, stands) && c.vertexSide < 2;  // of two edges, both are held
  });
}

}  // namespace palpate
