#include "CollisionDetection/Trust.h"

#include "NarrowPhase/StepCheck.h"
#include "Math/Tolerances.h"

#include <algorithm>
#include <limits>

namespace palpate {

namespace {

/// A look at all candidates at the step's start may take half a frame, of Contacts::Earliest two
/// thirds. So many frames earn one, and up to four are saved, or one.
constexpr int kLook = 16, kMostSaved = 4 * kLook;

/// Vertices that may have moved further than `reach` relative to the other mesh.
void addFarMovers(std::vector<std::uint32_t>& out, const Geometry& mesh, const Geometry& other,
                  double reach) {
  const MotionRange& range = other.motion.range();
  const Eigen::Vector3d centre = 0.5 * (range.lower + range.upper), extent = range.upper - centre;
  for (std::uint32_t v = 0; v < mesh.mesh.now.size(); ++v) {
    const Eigen::Vector3d moved =
        (mesh.mesh.now[v] - mesh.mesh.before[v] - centre).cwiseAbs() + extent;
    if (!(moved.squaredNorm() <= reach * reach)) out.push_back(v);
    if (out.size() == Validity::kMostFarMovers) return;
  }
}

/// L: along the longest axis; of a body that may be turned, along any.
double extentOf(const Geometry& geometry) {
  if (geometry.tree.octree().size() == 0) return 0.0;
  const FloatBox box = geometry.tree.octree().blocks()[0].box(0);
  double longest = 0.0;
  for (int k = 0; k < 3; ++k)
    longest = std::max(longest, double{box.upper[k]} - double{box.lower[k]});
  return (geometry.isPlaced() ? 2.0 : 1.0) * longest / geometry.tree.frame().scale;
}

}  // namespace

/// Bounds on motion are of triangles, which have no radius.
static bool knowsSides(const Geometry& a, const Geometry& b) {
  return a.mesh.topology.hasFaces() && b.mesh.topology.hasFaces();
}

bool hasContinuous(const Geometry& a, const Geometry& b) {
  return a.mesh.radii.empty() && b.mesh.radii.empty();
}

bool hasProximity(const Geometry& a, const Geometry& b, double thickness) {
  return a.shape || b.shape || thickness + (a.mesh.largestRadius + b.mesh.largestRadius) > 0.0;
}

/// Auto with lines, points or shapes: at rest Proximity, which costs least; in a step that moves
/// features Continuous, which alone misses no impact.
static void chooseMethod(const PairSettings& settings, const Geometry& a, const Geometry& b,
                         PairPlan& plan) {
  const bool proximity = hasProximity(a, b, settings.thickness);
  const bool still = plan.motion == 0.0 && proximity;
  plan.method = still || !hasContinuous(a, b) ? Method::Proximity : Method::Continuous;
  plan.reason = still ? MethodReason::Still : MethodReason::Only;
}

PairPlan planOf(const PairSettings& settings, const Geometry& a, const Geometry& b, bool moves) {
  PairPlan plan;
  plan.method = settings.method;
  StepPlan& step = plan.step;
  const double thickness = settings.thickness;
  if (moves) {
    plan.motion = largestMotion(a.motion.range(), b.motion.range());
    plan.arcDeviation = a.motion.arcDeviation() + b.motion.arcDeviation();
  }
  if (!knowsSides(a, b)) {
    if (settings.method == Method::Auto) chooseMethod(settings, a, b, plan);
    return plan;
  }
  step.motion = plan.motion;
  if (settings.method == Method::Auto) {
    plan.tolerance = step.slow = settings.tolerance < 0 ? thickness / 2 : settings.tolerance;
    if (plan.motion == 0.0) {
      plan.method = thickness > 0.0 ? Method::Proximity : Method::Intersection;
      plan.reason = MethodReason::Still;
    } else if (thickness == 0.0 || settings.contacts == Contacts::All) {
      plan.method = Method::Continuous;
      plan.reason = MethodReason::Cheapest;
    } else if (plan.motion <= plan.tolerance) {
      plan.method = Method::Proximity;
      plan.reason = MethodReason::Slow;
    } else if (smallestMotion(a.motion.range(), b.motion.range()) > plan.tolerance ||
               meanMotion(a.mesh, b.mesh) > plan.tolerance) {
      plan.method = Method::Continuous;
      plan.reason = MethodReason::Fast;
    } else {
      plan.reason = MethodReason::Mixed;
    }
    step.impacts = plan.method == Method::Proximity || plan.method == Method::Auto;
    if (step.impacts)
      step.extra =
          std::min(plan.motion, plan.tolerance) * (1.0 + kMotionSlack * settings.timeTolerance);
  } else if (settings.method == Method::Intersection) {
    plan.nearby = plan.motion <= std::min(a.smallestHeight, b.smallestHeight) ? plan.motion : 0.0;
  } else if (settings.method == Method::Proximity && plan.motion > thickness) {
    step.motion = 0.0;  // not to be trusted, whatever is found
  }
  return plan;
}

namespace {

std::array<Revision, 8> statesOf(const Geometry& a, const Positions& ofA, const Geometry& b,
                                 const Positions& ofB) {
  return {a.revisions.topology, a.revisions.enabled, ofA.bodyRevision(), ofA.transformRevision(),
          b.revisions.topology, b.revisions.enabled, ofB.bodyRevision(), ofB.transformRevision()};
}

/// Auto, and the pair has its tolerance.
bool hasTolerance(const PairSettings& settings, const Geometry& a, const Geometry& b) {
  return settings.method == Method::Auto && knowsSides(a, b);
}

/// L: Validity::reach.
double reachOf(const PairSettings& settings, const Geometry& a, const Geometry& b,
               const PairPlan& plan) {
  if (hasTolerance(settings, a, b)) return plan.tolerance;
  if (plan.method == Method::Continuous) return std::numeric_limits<double>::infinity();
  return plan.method == Method::Proximity ? settings.thickness
                                          : std::min(a.smallestHeight, b.smallestHeight);
}

/// Whether the step met the method's conditions, which are about vertices that move in straight
/// lines. validity: with startedApart and reach. foundOrFar: triangles intersect at the end, or no
/// boxes came near each other.
bool meetsConditions(const PairSettings& settings, const Geometry& a, const Geometry& b,
                     const PairPlan& plan, const StepFacts& facts, const Validity& validity,
                     bool foundOrFar) {
  if (!knowsSides(a, b)) return false;
  if (settings.method == Method::Auto)
    return plan.method == Method::Intersection || validity.startedApart;
  const bool withinReach = plan.motion <= validity.reach;
  switch (plan.method) {
    case Method::Intersection:
      return plan.motion == 0.0 || (withinReach && foundOrFar);
    case Method::Proximity:
      return withinReach && validity.startedApart && facts.verticesA.empty() &&
             facts.verticesB.empty();
    default:
      return validity.startedApart;
  }
}

}  // namespace

void Trust::forget() {
  m_topologies.invalidate();
  for (Known* known : {&m_atStart, &m_atEnd}) known->of.invalidate();
}

void Trust::start(const PairSettings& settings, const Geometry& a, const Geometry& b,
                  PairPlan& plan) {
  // No two features within the thickness are further apart, in any coordinate, than both meshes.
  const double size = extentOf(a) + extentOf(b) + settings.thickness + plan.step.extra;
  plan.step.certain = plan.step.motion + 2.0 * kMotionError * (plan.step.motion + size);

  const auto before = statesOf(a, a.mesh.before, b, b.mesh.before);
  if (!m_atStart.of.isCurrent(before)) {
    m_atStart = {};
    if (m_atEnd.of.isCurrent(before)) {
      m_atStart = m_atEnd;
    } else if (m_atEnd.of.isCurrent(statesOf(a, a.step.detected(), b, b.step.detected())) &&
               m_atEnd.position == Position::Apart &&
               largestMotion(a.motion.correction(), b.motion.correction()) < m_atEnd.clearance) {
      m_atStart.position = Position::Apart;
      m_atStart.of.commit(before);
    }
  }
  const bool startsApart = m_atStart.position == Position::Apart;
  plan.startsIntersecting = m_atStart.position == Position::Intersecting;

  const std::array<Revision, 4> topologies{a.revisions.topology, a.revisions.enabled,
                                           b.revisions.topology, b.revisions.enabled};
  const int most = settings.contacts == Contacts::Earliest ? kLook : kMostSaved;
  m_saved = m_topologies.isCurrent(topologies) ? std::min(m_saved + 1, most) : most;
  m_topologies.commit(topologies);
  if (!knowsSides(a, b) || startsApart || plan.method == Method::Intersection ||
      (plan.method == Method::Proximity && plan.motion > 0.0 && plan.step.motion == 0.0))
    return;
  plan.overlaps = settings.method == Method::Auto;
  plan.step.start = !plan.startsIntersecting && (plan.overlaps || m_saved >= kLook);
  if (plan.step.start) m_saved = std::max(m_saved - kLook, 0);
  // It will not be trusted, whatever is seen of the step.
  if (plan.method == Method::Proximity && settings.method == plan.method && !plan.step.start)
    plan.step.motion = 0.0;
}

void Trust::finish(const PairSettings& settings, const Geometry& a, const Geometry& b,
                   const PairPlan& plan, const StepFacts& facts, bool nearby,
                   const MeshPair& meshes, CollisionData::Contents& contents,
                   ContactBuffers& counts) {
  Validity& validity = contents.validity;
  validity.method = plan.method;
  validity.reason = plan.reason;
  validity.displacement = plan.motion;
  validity.thickness =
      plan.method == Method::Intersection ? 0.0 : settings.thickness + plan.step.extra;
  const auto take = [](std::vector<std::uint32_t>& out, const Buffer<std::uint32_t>& ids) {
    out.assign(ids.begin(), ids.end());
  };
  take(validity.degenerateTrianglesA, facts.degenerateA);
  take(validity.degenerateTrianglesB, facts.degenerateB);
  validity.verticesBeyondA.clear();
  validity.verticesBeyondB.clear();
  if (!plan.step.impacts) {
    take(validity.verticesBeyondA, facts.verticesA);
    take(validity.verticesBeyondB, facts.verticesB);
  }
  if (plan.step.start) {
    m_atStart = {};
    m_atStart.position = facts.startsIntersecting ? Position::Intersecting : Position::Apart;
    m_atStart.of.commit(statesOf(a, a.mesh.before, b, b.mesh.before));
  }
  validity.startedApart = m_atStart.position == Position::Apart;
  validity.reach = reachOf(settings, a, b, plan);
  const bool listsFarMovers =
      !hasTolerance(settings, a, b) && plan.method != Method::Continuous && !meshes.hasShape();
  if (listsFarMovers && !(plan.motion <= validity.reach)) {
    addFarMovers(validity.verticesBeyondA, a, b, validity.reach);
    if (&a != &b) addFarMovers(validity.verticesBeyondB, b, a, validity.reach);
  }
  const bool trustedIfStraight = meetsConditions(
      settings, a, b, plan, facts, validity, !nearby || !contents.intersectingTriangles.empty());
  validity.arcDeviation = plan.arcDeviation;
  validity.trusted = trustedIfStraight && validity.arcDeviation <= settings.thickness;
  validity.sideMayBeWrong = plan.method != Method::Intersection && !validity.trusted;
  m_atEnd = {};
  // Intersection measures no distances: meshes that do not intersect may be as near as they like.
  m_atEnd.clearance =
      plan.method == Method::Intersection ? 0.0 : std::min(facts.clearance, settings.thickness);
  if (!contents.intersectingTriangles.empty()) {
    m_atEnd.position = Position::Intersecting;
    m_atEnd.witness = contents.intersectingTriangles.front();
  } else if (plan.method == Method::Intersection) {
    if (plan.motion == 0.0 && facts.clearance > 0.0) m_atEnd.position = Position::Apart;
  } else if (trustedIfStraight && (facts.clearance > 0.0 || plan.motion == 0.0)) {
    m_atEnd.position = Position::Apart;
  } else if (plan.step.motion > 0.0 && settings.method != Method::Proximity) {
    findEnd(plan, facts, meshes, contents, counts);
  }
  m_atEnd.of.commit(statesOf(a, a.mesh.now, b, b.mesh.now));
}

void Trust::findEnd(const PairPlan& plan, const StepFacts& facts, const MeshPair& meshes,
                    const CollisionData::Contents& contents, ContactBuffers& counts) {
  m_atEnd.clearance = 0.0;
  if (plan.overlaps && facts.startsIntersecting) {  // Intersection has tested all, and found none
    if (!meshes.near) m_atEnd.position = Position::Apart;
    return;
  }
  // Earliest times come without contacts, and filtered features are not among the contacts.
  if (meshes.settings.contacts == Contacts::Earliest || meshes.filters()) return;
  EndOfStep end;
  if (m_atStart.position == Position::Intersecting && m_atStart.witness &&
      intersect(meshes, false, *m_atStart.witness, counts))
    end.intersecting = m_atStart.witness;
  else
    end = lookAtEnd(meshes, contents, counts);
  if (end.intersecting) {
    m_atEnd.position = Position::Intersecting;
    m_atEnd.witness = end.intersecting;
  } else if (contents.validity.startedApart && end.isKnown) {
    m_atEnd.position = Position::Apart;
  }
}

}  // namespace palpate
