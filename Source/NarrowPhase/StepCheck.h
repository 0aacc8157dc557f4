#pragma once

#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/NarrowPhase.h"

#include <algorithm>
#include <optional>
#include <span>

namespace palpate {

/// What a pair's step means for features that were measured at its end.
class StepCheck {
 public:
  StepCheck(const MeshPair& pair, ContactBuffers& out) : m_pair(pair), m_out(out) {}

  /// L: edges up to this far apart matter, even where their ends are nearest to each other.
  double edgeReach() const {
    const StepPlan& step = m_pair.step;
    return std::min(step.motion, step.impacts ? step.extra : m_pair.settings.thickness);
  }

  /// Of a feature pair at most thicknessAtEnd() apart.
  void noteDistance(double distance) {
    m_out.facts.clearance = std::min(m_out.facts.clearance, distance);
  }
  /// The same pair, where the step may have brought it together: appends its impact if the step
  /// asks for impacts, else notes its vertices. Returns whether an impact was appended, which takes
  /// the place of a contact at the end. ofSecond: the first feature is of the second mesh.
  template <ImpactQuery::Kind kind>
  bool addImpactIfTouched(const Features<kind>&, std::uint32_t inFirst, std::uint32_t inSecond,
                          bool ofSecond, double distance);

  /// Auto: whether proximity at the step's end says all there is to say of a feature pair.
  template <ImpactQuery::Kind kind>
  bool isAnsweredAtEnd(const Features<kind>&, std::uint32_t inFirst, std::uint32_t inSecond) const;

  /// Of an impact that is reported: what the rest of the step leaves of the distance.
  template <ImpactQuery::Kind kind>
  void noteImpact(const Features<kind>&, std::uint32_t inFirst, std::uint32_t inSecond, double time,
                  double distance);

  /// Triangles of contacts: notes those without area.
  void noteTriangle(std::uint32_t triangle, bool ofSecond, const Eigen::Vector3d& a,
                    const Eigen::Vector3d& b, const Eigen::Vector3d& c);
  void noteEdges(const Segment& p, const Segment& q);

 private:
  /// Whether the step may have brought features together that are so far apart at its end.
  template <ImpactQuery::Kind kind>
  bool mayTouchInStep(const Features<kind>&, std::uint32_t inFirst, std::uint32_t inSecond,
                      double distance) const;
  template <ImpactQuery::Kind kind>
  void noteVertices(const Features<kind>&, std::uint32_t inFirst, std::uint32_t inSecond);

  const MeshPair& m_pair;
  ContactBuffers& m_out;
};

/// Auto: of the contacts at the step's end those that share a vertex with features that may have
/// touched (`touched`, sorted) are moved to `out` as their impacts, if they have one. A vertex that
/// came through one triangle is on the wrong side of the next, too.
void answerByImpact(const MeshPair&, const StepFacts& touched, ContactBuffers& found,
                    ContactBuffers& out);

/// Whether triangles intersect at the step's start, or its end; exactly. counts: exactDecisions.
bool intersect(const MeshPair&, bool atStart, const ElementPair&, ContactBuffers& counts);
/// One of the candidates that does. counts: validityPairs too, and a scratch.
std::optional<ElementPair> anyIntersecting(const MeshPair&, bool atStart,
                                           std::span<const ElementPair> candidates,
                                           ContactBuffers& counts);

}  // namespace palpate
