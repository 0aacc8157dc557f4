#pragma once

#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Core/Assert.h"

#include <algorithm>
#include <optional>
#include <span>

namespace palpate {

/// Checks whether features that were measured at the step's end may have touched in the step, and
/// records this in ContactBuffers::facts.
class StepCheck {
 public:
  StepCheck(const MeshPair& pair, ContactBuffers& out) : m_pair(pair), m_out(out) {
    PALPATE_ASSERT(pair.step.motion >= 0.0 && pair.step.motionWithRounding >= pair.step.motion);
  }

  /// L: edges up to this far apart are measured even where Contacts::Distinct reports no contact,
  /// because they may have touched in the step.
  double checkedEdgeDistance() const {
    const StepPlan& step = m_pair.step;
    if (step.motion == 0.0) return 0.0;
    const double rounding = step.motionWithRounding - step.motion;
    return std::min(touchDistance(), step.reportsImpacts ? step.extraThickness + rounding
                                                         : m_pair.settings.thickness);
  }

  /// Records a feature pair that is at most thicknessAtEnd() apart.
  void recordDistance(double distance) {
    PALPATE_ASSERT(distance <= m_pair.thicknessAtEnd());
    m_out.facts.clearance = std::min(m_out.facts.clearance, distance);
  }
  /// Checks the same pair for a touch in the step. If it may have touched, appends its impact where
  /// StepPlan::reportsImpacts is set, and otherwise records its vertices. Returns whether an impact
  /// was appended; it replaces the contact at the step's end. swapped: Features::first is
  /// MeshPair::b.
  template <ImpactQuery::Kind kind>
  bool addImpactIfTouched(const Features<kind>&, std::uint32_t firstId, std::uint32_t secondId,
                          bool swapped, double distance);
  /// The same for two edges whose radii may differ, at this distance less their largest radii. Only
  /// records.
  void recordGap(std::uint32_t edgeA, std::uint32_t edgeB, double gap) {
    if (!(gap <= m_pair.settings.thickness)) return;
    recordDistance(gap);
    addImpactIfTouched(Features<ImpactQuery::Kind::EdgeEdge>{m_pair.a, m_pair.b}, edgeA, edgeB,
                       false, gap);
  }

  /// Auto with Contacts::Distinct: whether proximity at the step's end suffices for a feature pair,
  /// so that no impact has to be computed.
  template <ImpactQuery::Kind kind>
  bool proximitySuffices(const Features<kind>&, std::uint32_t firstId,
                         std::uint32_t secondId) const;

  /// Records an impact: lowers the clearance to what the rest of the step may leave of the
  /// distance, and at the step's start the gap.
  template <ImpactQuery::Kind kind>
  void recordImpact(const Features<kind>&, std::uint32_t firstId, std::uint32_t secondId,
                    double time, double distance);

 private:
  /// L: features further apart at the step's end did not touch in the step.
  double touchDistance() const {
    return std::min(m_pair.step.motionWithRounding, m_pair.step.motionOfCandidates) +
           m_pair.step.arcDeviation;
  }
  /// Whether features at this distance at the step's end may have touched in the step.
  template <ImpactQuery::Kind kind>
  bool mayTouchInStep(const Features<kind>&, std::uint32_t firstId, std::uint32_t secondId,
                      double distance) const;
  template <ImpactQuery::Kind kind>
  void recordVertices(const Features<kind>&, std::uint32_t firstId, std::uint32_t secondId);

  const MeshPair& m_pair;
  ContactBuffers& m_out;
};

/// Auto: replaces contacts at the step's end by impacts. This applies to contacts that share a
/// vertex with features that may have touched (`touched`, sorted). If such a contact has an impact,
/// it is removed from `found` and the impact is added to `out`. Reason: a vertex that passed
/// through one triangle is on the wrong side of the neighbouring triangles, too.
void replaceByImpacts(const MeshPair&, const StepFacts& touched, ContactBuffers& found,
                      ContactBuffers& out);

}  // namespace palpate
