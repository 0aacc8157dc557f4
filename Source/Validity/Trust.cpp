#include "Validity/Trust.h"

#include "Validity/IntersectionAtEnd.h"
#include "NarrowPhase/Meeting.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace palpate {

namespace {

/// The initial intersection check tests all candidates at the step's start. It may take half of a
/// frame, with earliestTimeOnly two thirds. Methods other than Auto therefore run it once in
/// kFramesPerCheck frames on average. Up to four checks that were not needed are saved for later,
/// with earliestTimeOnly one. Auto runs it whenever the start is unknown.
constexpr int kFramesPerCheck = 16, kMaxCheckCredit = 4 * kFramesPerCheck;

/// Intersecting triangle pairs that are classified together. Of most bodies that overlap one of the
/// first pairs pierces.
constexpr std::size_t kTogether = 64;

/// Appends vertices that may have moved further than the limit relative to the other mesh, until
/// `out` has Validity::kMaxFastVertices.
void addFastVertices(std::vector<std::uint32_t>& out, const GeometryInStep& mesh,
                     const GeometryInStep& other, double displacementLimit) {
  const MotionRange& range = other.range;
  const Eigen::Vector3d centre = 0.5 * (range.lower + range.upper), extent = range.upper - centre;
  for (std::uint32_t v = 0; v < mesh.mesh.now.size(); ++v) {
    const Eigen::Vector3d moved =
        (mesh.mesh.now[v] - mesh.mesh.before[v] - centre).cwiseAbs() + extent;
    if (!(moved.squaredNorm() <= displacementLimit * displacementLimit)) out.push_back(v);
    if (out.size() == Validity::kMaxFastVertices) return;
  }
}

/// Whether the pair uses Auto's motion tolerance.
bool usesMotionTolerance(const PairSettings& settings, const GeometryInStep& a,
                         const GeometryInStep& b) {
  return settings.method == Method::Auto && haveTriangles(a, b);
}

/// L: Validity::displacementLimit.
double displacementLimitOf(const PairSettings& settings, const GeometryInStep& a,
                           const GeometryInStep& b, const PairPlan& plan) {
  if (usesMotionTolerance(settings, a, b)) return plan.motionTolerance;
  if (plan.method == Method::Continuous || plan.method == Method::DistanceField)
    return std::numeric_limits<double>::infinity();
  return plan.method == Method::Intersection ? std::min(a.smallestHeight, b.smallestHeight)
                                             : settings.thickness;
}

/// Whether no two enabled triangles share a vertex, and some would if positions that were equal
/// when the topology was set were joined. Those that move to the same place later are not one
/// vertex.
bool isUnwelded(const TriangleMesh& mesh) {
  const MeshTopology& topology = mesh.topology;
  if (!topology.hasFaces()) return false;
  for (std::uint32_t v = 0; v < topology.vertexCount; ++v)
    if (topology.vertexTriangles[v].size() > 1) return false;
  const Welded welded = weld(mesh.rest, topology.elements);
  std::vector<std::uint32_t> holders(welded.positions.size(), kNoElement);
  for (std::uint32_t t = 0; t < welded.triangles.size(); ++t) {
    if (!topology.isEnabled(t)) continue;
    for (const std::uint32_t v : welded.triangles[t])
      if (const std::uint32_t holder = std::exchange(holders[v], t);
          holder != kNoElement && holder != t)
        return true;
  }
  return false;
}

/// L: rounding errors of distances.
double roundingOf(const StepPlan& step) { return step.motionWithRounding - step.motion; }

/// Whether lines, points and shapes, less their radii, are known to be apart where the step starts.
/// Each step measures it. Proximity also requires that they stay apart throughout; with a shape it
/// knows only the motion of all.
bool measuredApart(const MeshPair& meshes, const PairPlan& plan, const StepFacts& facts,
                   double earliestTime) {
  if (plan.kind == PairKind::AttachedProxy) return false;
  if (plan.method == Method::Continuous) {
    // Earliest times come without distances, and without features that a filter refuses.
    if (meshes.settings.continuous.earliestTimeOnly)
      return earliestTime > 0.0 && !meshes.hasFilters();
    return facts.gapAtStart > 0.0;
  }
  if (plan.method != Method::Proximity) return false;
  const double moved = plan.motion + plan.arcDeviation,
               left = meshes.has(GeometryType::Shape) ? moved : 0.0;
  return moved <= meshes.settings.thickness && facts.clearance > left + roundingOf(plan.step);
}

/// Whether the step met the method's conditions, if vertices move in straight lines. validity:
/// startedApart and displacementLimit must be set. foundOrFar: triangles intersect at the end, or
/// no boxes of triangles are within the displacement of each other there.
bool meetsConditions(const PairSettings& settings, const GeometryInStep& a, const GeometryInStep& b,
                     const PairPlan& plan, const StepFacts& facts, const Validity& validity,
                     bool foundOrFar) {
  if (plan.method == Method::DistanceField) return false;
  if (!haveTriangles(a, b))
    return validity.startedApart && (settings.continuous.earliestTimeOnly || !facts.sideUnknown);
  if (settings.method == Method::Auto)
    return plan.method == Method::Intersection || validity.startedApart;
  const bool isWithinLimit = plan.motion <= validity.displacementLimit;
  switch (plan.method) {
    case Method::Intersection:
      return plan.motion == 0.0 || (isWithinLimit && foundOrFar);
    case Method::Proximity:
      return plan.motion + plan.arcDeviation <= validity.displacementLimit &&
             validity.startedApart && facts.verticesA.empty() && facts.verticesB.empty();
    default:
      return validity.startedApart;
  }
}

/// Writes the lists of features. reportsImpacts: vertices that touched have impacts, and are
/// trusted.
void listFeatures(const PairSettings& settings, const StepFacts& facts, bool reportsImpacts,
                  Validity& validity) {
  const auto take = [](std::vector<std::uint32_t>& out, const Buffer<std::uint32_t>& ids) {
    out.assign(ids.begin(), ids.end());
  };
  validity.degenerateTrianglesA.clear();
  validity.degenerateTrianglesB.clear();
  if (!settings.continuous.earliestTimeOnly) {  // else there are no contacts
    take(validity.degenerateTrianglesA, facts.degenerateA);
    take(validity.degenerateTrianglesB, facts.degenerateB);
  }
  validity.untrustedVerticesA.clear();
  validity.untrustedVerticesB.clear();
  if (reportsImpacts) return;
  take(validity.untrustedVerticesA, facts.verticesA);
  take(validity.untrustedVerticesB, facts.verticesB);
}

/// Whether a distance field proves that the meshes are apart at both ends of the step.
bool provesApart(const GeometryInStep& a, const GeometryInStep& b, const PairPlan& plan) {
  return plan.reason == MethodReason::AllowedError && plan.motion > 0.0 && haveTriangles(a, b);
}

}  // namespace

std::array<Trust::SurfaceState, 2> Trust::statesOf(const GeometryInStep& a, const Positions& ofA,
                                                   const GeometryInStep& b, const Positions& ofB) {
  return {{{a.elements, ofA.state()}, {b.elements, ofB.state()}}};
}

Trust::SurfaceState Trust::beforeCuts(const GeometryInStep& of, const Positions& positions) {
  if (of.cuts.after != of.elements) return {of.elements, positions.state()};
  PositionsState state = positions.state();
  state.body = of.cuts.positionsBefore(state.body);
  return {of.cuts.before, state};
}

/// Whether what is left of both meshes after cuts is known to be apart where the step starts.
bool Trust::wereApartBeforeCuts(const GeometryInStep& a, const GeometryInStep& b) const {
  const auto isKnown = [&](const KnownState& known, const Positions& ofA, const Positions& ofB) {
    return known.meeting == Meeting::Apart &&
           known.version.isCurrent({beforeCuts(a, ofA), beforeCuts(b, ofB)});
  };
  return isKnown(m_atStart, a.mesh.before, b.mesh.before) ||
         isKnown(m_atEnd, a.mesh.before, b.mesh.before) ||
         (isKnown(m_atEnd, a.detected, b.detected) &&
          largestMotion(a.correction, b.correction) < m_atEnd.clearance);
}

void Trust::forget() {
  m_topologies.invalidate();
  for (KnownState* known : {&m_atStart, &m_atEnd}) known->version.invalidate();
}

void Trust::start(const PairSettings& settings, const GeometryInStep& a, const GeometryInStep& b,
                  PairPlan& plan) {
  // Coordinates of two features within the thickness differ by at most this size.
  const double size = a.extent + b.extent + settings.thickness + plan.step.extraThickness +
                      (a.mesh.largestRadius + b.mesh.largestRadius);
  plan.step.motionWithRounding = plan.step.motion + 2.0 * kMotionError * (plan.step.motion + size);

  PALPATE_ASSERT(plan.step.motionWithRounding >= plan.step.motion);
  const auto before = statesOf(a, a.mesh.before, b, b.mesh.before);
  const auto firstNew = [](const GeometryInStep& of) {
    return of.cuts.after == of.elements ? of.cuts.firstAdded : kNoElement;
  };
  if (wereApartBeforeCuts(a, b)) plan.step.apartBelow = {firstNew(a), firstNew(b)};
  if (!m_atStart.version.isCurrent(before)) {
    m_atStart = {};
    if (m_atEnd.version.isCurrent(before)) {
      m_atStart = m_atEnd;
    } else if (m_atEnd.version.isCurrent(statesOf(a, a.detected, b, b.detected)) &&
               m_atEnd.meeting == Meeting::Apart &&
               largestMotion(a.correction, b.correction) < m_atEnd.clearance) {
      m_atStart.meeting = Meeting::Apart;
      m_atStart.version.commit(before);
    }
  }
  const bool startsApart = m_atStart.meeting == Meeting::Apart;
  plan.startsIntersecting = m_atStart.meeting == Meeting::Piercing;

  const std::array topologies{a.elements, b.elements};
  const int most = settings.continuous.earliestTimeOnly ? kFramesPerCheck : kMaxCheckCredit;
  if (m_topologies.isCurrent(topologies)) {
    m_checkCredit = std::min(m_checkCredit + 1, most);
  } else {
    m_checkCredit = most;
    m_isUnwelded = &a.mesh == &b.mesh && isUnwelded(a.mesh);
    m_topologies.commit(topologies);
  }
  if (!mayPierce(a, b) || startsApart || plan.method == Method::Intersection ||
      plan.method == Method::DistanceField ||
      (plan.method == Method::Proximity && plan.motion > 0.0 && plan.step.motion == 0.0))
    return;
  const bool isAuto = settings.method == Method::Auto;
  plan.runsIntersection = isAuto && haveTriangles(a, b);
  plan.step.checksStart = !m_atStart.meeting && (isAuto || m_checkCredit >= kFramesPerCheck);
  PALPATE_ASSERT(m_checkCredit <= most);
  // The result cannot be trusted, so the step need not be examined.
  if (plan.method == Method::Proximity && settings.method == plan.method && !plan.step.checksStart)
    plan.step.motion = 0.0;
}

void Trust::finish(const PairSettings& settings, const GeometryInStep& a, const GeometryInStep& b,
                   const PairPlan& plan, const StepFacts& facts, bool nearby,
                   const MeshPair& meshes, CollisionData::Contents& contents,
                   ContactBuffers& counts) {
  PALPATE_ASSERT(m_topologies.isValid());
  Validity& validity = contents.validity;
  const bool byProxy = plan.kind == PairKind::AttachedProxy;
  validity.method = byProxy ? Method::Proxy : plan.method;
  validity.reason = byProxy ? MethodReason::AllowedError : plan.reason;
  validity.displacement = plan.motion;
  validity.age = 0;
  validity.effectiveThickness = byProxy ? plan.proxyThickness
                                : plan.method == Method::Intersection
                                    ? 0.0
                                    : settings.thickness + plan.step.extraThickness;
  listFeatures(settings, facts, plan.step.reportsImpacts, validity);
  if (plan.step.checksStart) {
    m_checkCredit = std::max(m_checkCredit - kFramesPerCheck, 0);
    m_atStart = {};
    m_atStart.meeting = facts.atStart;
    m_atStart.version.commit(statesOf(a, a.mesh.before, b, b.mesh.before));
  }
  const bool isProvenApart = provesApart(a, b, plan);
  if (isProvenApart) {
    m_atStart = {};
    m_atStart.meeting = Meeting::Apart;
    m_atStart.version.commit(statesOf(a, a.mesh.before, b, b.mesh.before));
  }
  const bool surfacesApart = m_atStart.meeting == Meeting::Apart;
  validity.startedApart =
      (surfacesApart || !mayPierce(a, b)) &&
      (haveTriangles(a, b) || measuredApart(meshes, plan, facts, contents.earliestTimeOfImpact));
  validity.displacementLimit = displacementLimitOf(settings, a, b, plan);
  const bool listsFastVertices = !usesMotionTolerance(settings, a, b) &&
                                 plan.method != Method::Continuous &&
                                 !meshes.has(GeometryType::Shape);
  if (listsFastVertices && !(plan.motion <= validity.displacementLimit)) {
    addFastVertices(validity.untrustedVerticesA, a, b, validity.displacementLimit);
    if (&a.mesh != &b.mesh)
      addFastVertices(validity.untrustedVerticesB, b, a, validity.displacementLimit);
  }
  const bool trustedIfStraight = meetsConditions(
      settings, a, b, plan, facts, validity, !nearby || !contents.intersectingTriangles.empty());
  validity.arcDeviation = plan.arcDeviation;
  validity.unwelded = m_isUnwelded;
  validity.trusted =
      trustedIfStraight && validity.arcDeviation <= settings.thickness && !validity.unwelded;
  validity.sideMayBeWrong = plan.method != Method::Intersection && !validity.trusted;
  findEnd(settings, plan, facts, meshes, contents, trustedIfStraight, isProvenApart, counts);
  PALPATE_ASSERT(!m_atEnd.witness || m_atEnd.meeting == Meeting::Piercing);
  m_atEnd.version.commit(statesOf(a, a.mesh.now, b, b.mesh.now));
}

/// Determines m_atEnd, but for its version.
void Trust::findEnd(const PairSettings& settings, const PairPlan& plan, const StepFacts& facts,
                    const MeshPair& meshes, const CollisionData::Contents& contents,
                    bool trustedIfStraight, bool isProvenApart, ContactBuffers& counts) {
  const bool findsImpacts = plan.swept() || plan.step.reportsImpacts,
             surfacesApart = m_atStart.meeting == Meeting::Apart;
  m_atEnd = {};
  // Intersection measures no distances: meshes that do not intersect may be arbitrarily near.
  m_atEnd.clearance =
      plan.method == Method::Intersection ? 0.0 : std::min(facts.clearance, settings.thickness);
  if (!contents.intersectingTriangles.empty()) {
    SurfaceMeeting found;
    std::span<const ElementPair> left(contents.intersectingTriangles);
    for (; !found.piercing && !left.empty();
         left = left.subspan(std::min(left.size(), kTogether))) {
      checkTime();
      found = meetingOf(meshes, false, left.first(std::min(left.size(), kTogether)), counts);
    }
    m_atEnd.meeting = found.piercing ? Meeting::Piercing : Meeting::Touching;
    m_atEnd.witness = found.piercing;
  } else if (plan.reason == MethodReason::AllowedError) {
    m_atEnd = m_atStart;
    m_atEnd.clearance = isProvenApart ? plan.motion : 0.0;
  } else if (plan.method == Method::Intersection) {
    if (plan.motion == 0.0 && facts.clearance > 0.0) m_atEnd.meeting = Meeting::Apart;
  } else if ((findsImpacts || plan.motion == 0.0 ? surfacesApart : trustedIfStraight) &&
             (facts.clearance > 0.0 || plan.motion == 0.0)) {
    m_atEnd.meeting = Meeting::Apart;
  } else if (plan.motion == 0.0 && m_atStart.meeting == Meeting::Touching) {
    m_atEnd.meeting = Meeting::Touching;
  } else if (plan.step.motion > 0.0 && findsImpacts) {
    followToEnd(plan, facts, meshes, contents, counts);
  }
}

void Trust::followToEnd(const PairPlan& plan, const StepFacts& facts, const MeshPair& meshes,
                        const CollisionData::Contents& contents, ContactBuffers& counts) {
  m_atEnd.clearance = 0.0;
  // Where Intersection ran, it has tested all pairs, and found none. With restDistance it has not
  // tested pairs that are near at rest.
  if (plan.runsIntersection && facts.startsPiercing()) {
    if (!meshes.nearAtRest) m_atEnd.meeting = Meeting::Apart;
    return;
  }
  // Earliest times come without contacts, and filtered features are not among the contacts.
  if (meshes.settings.continuous.earliestTimeOnly || meshes.hasFilters()) return;
  PALPATE_ASSERT(m_atStart.meeting.has_value() || !m_atStart.witness);
  IntersectionAtEnd end;
  if (m_atStart.meeting == Meeting::Piercing && m_atStart.witness &&
      meetingOf(meshes, false, *m_atStart.witness, counts) == Meeting::Piercing)
    end.piercing = m_atStart.witness;
  else
    end = checkEnd(meshes, contents, counts);
  if (end.piercing) {
    m_atEnd.meeting = Meeting::Piercing;
    m_atEnd.witness = end.piercing;
  } else if (m_atStart.meeting && m_atStart.meeting != Meeting::Piercing && end.isKnown) {
    m_atEnd.meeting = end.meeting;
  }
}

}  // namespace palpate
