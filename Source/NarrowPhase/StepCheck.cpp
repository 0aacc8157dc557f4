#include "NarrowPhase/StepCheck.h"

#include "Contact/ContactLists.h"
#include "Math/ClosestPoint.h"
#include "Math/MotionBound.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/Stopping.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <span>

namespace palpate {

using Eigen::Vector3d;
using Kind = ImpactQuery::Kind;

template <Kind kind>
bool StepCheck::mayTouchInStep(const Features<kind>& features, std::uint32_t firstId,
                               std::uint32_t secondId, double distance) const {
  const StepPlan& step = m_pair.step;
  return step.motion != 0.0 && !(distance > touchDistance()) &&
         mayHaveTouched<kind>(features.query(firstId, secondId), distance - step.arcDeviation,
                              step.motion);
}

template <Kind kind>
bool StepCheck::addImpactIfTouched(const Features<kind>& features, std::uint32_t firstId,
                                   std::uint32_t secondId, bool swapped, double distance) {
  if (!mayTouchInStep(features, firstId, secondId, distance)) return false;
  if (m_pair.step.reportsImpacts)
    return addImpact(m_pair, features, firstId, secondId, swapped, m_out);
  m_out.facts.clearance = 0.0;
  recordVertices(features, firstId, secondId);
  return false;
}

template <Kind kind>
void StepCheck::recordVertices(const Features<kind>& features, std::uint32_t firstId,
                               std::uint32_t secondId) {
  const auto vertices = features.vertices(firstId, secondId);
  for (int i = 0; i < 4; ++i) {
    const bool ofB = !m_pair.self() && &features.meshOf(i) == &m_pair.b;
    (ofB ? m_out.facts.verticesB : m_out.facts.verticesA).push_back(vertices[i]);
  }
}

template <Kind kind>
void StepCheck::recordImpact(const Features<kind>& features, std::uint32_t firstId,
                             std::uint32_t secondId, double time, double distance) {
  const StepPlan& step = m_pair.step;
  PALPATE_ASSERT(time >= 0.0 && time <= 1.0 && distance >= 0.0);
  const double rounding = step.motionWithRounding - step.motion;
  double &clearance = m_out.facts.clearance, &gap = m_out.facts.gapAtStart;
  if (time == 0.0)
    gap = std::min(gap, distance - (m_pair.a.largestRadius + m_pair.b.largestRadius) - rounding);
  if (clearance == 0.0 && !step.reportsImpacts) return;
  double left = (1.0 - time) * step.motion + rounding;
  if (distance <= left)
    left = (1.0 - time) * motionBound<kind>(features.query(firstId, secondId)) + rounding;
  clearance = std::min(clearance, std::max(0.0, distance - left));
  if (step.reportsImpacts && distance <= left) recordVertices(features, firstId, secondId);
}

void replaceByImpacts(const MeshPair& pair, const StepFacts& touched, ContactBuffers& found,
                      ContactBuffers& out) {
  TimeCheck check(32);
  const std::array touchedOf{std::span(touched.verticesA),
                             std::span(pair.self() ? touched.verticesA : touched.verticesB)};
  PALPATE_ASSERT(std::all_of(touchedOf.begin(), touchedOf.end(), [](const auto& ids) {
    return std::is_sorted(ids.begin(), ids.end());
  }));
  const auto isTouched = [&](ContactKind kind, const std::array<std::uint32_t, 4>& vertices) {
    for (std::size_t i = 0; i < 4; ++i) {
      const auto& sorted = touchedOf[sidesOf(kind)[i]];
      if (std::binary_search(sorted.begin(), sorted.end(), vertices[i])) return true;
    }
    return false;
  };
  forEachMeshList(found, [&](ContactKind kind, auto& list) {
    std::erase_if(list, [&](const auto& contact) {
      check();
      return contact.timeOfImpact == 1.0 && isTouched(kind, verticesOf(contact)) &&
             addImpactOf(pair, kind, contact, out);
    });
  });
}

template <Kind kind>
bool StepCheck::proximitySuffices(const Features<kind>& features, std::uint32_t firstId,
                                  std::uint32_t secondId) const {
  const ImpactQuery query = features.query(firstId, secondId);
  const double motion = motionBound<kind>(query);
  if (motion <= m_pair.step.slowMotion) return true;
  const auto at = [&](int i) -> const Vector3d& { return query.vertices[i].at(1); };
  double distance;
  if constexpr (kind == Kind::VertexTriangle)
    distance = finiteVertexTriangleDistance(at(0), at(1), at(2), at(3)).distance;
  else
    distance = finiteEdgeEdgeDistance(at(0), at(1), at(2), at(3)).distance;
  if (distance > m_pair.thicknessAtEnd()) return false;
  // Edges whose closest points are ends were measured only up to checkedEdgeDistance().
  return distance > motion || kind == Kind::VertexTriangle;
}

template void StepCheck::recordImpact(const Features<Kind::VertexTriangle>&, std::uint32_t,
                                      std::uint32_t, double, double);
template void StepCheck::recordImpact(const Features<Kind::EdgeEdge>&, std::uint32_t, std::uint32_t,
                                      double, double);
template bool StepCheck::addImpactIfTouched(const Features<Kind::VertexTriangle>&, std::uint32_t,
                                            std::uint32_t, bool, double);
template bool StepCheck::addImpactIfTouched(const Features<Kind::EdgeEdge>&, std::uint32_t,
                                            std::uint32_t, bool, double);
template bool StepCheck::proximitySuffices(const Features<Kind::VertexTriangle>&, std::uint32_t,
                                           std::uint32_t) const;
template bool StepCheck::proximitySuffices(const Features<Kind::EdgeEdge>&, std::uint32_t,
                                           std::uint32_t) const;

}  // namespace palpate
