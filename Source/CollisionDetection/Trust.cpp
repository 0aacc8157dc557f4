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

/// From the last frame's positions to this step's start.
MotionRange correctionOf(const Geometry& geometry) {
  if (geometry.setThisFrame) return geometry.correction;
  MotionRange back;
  back.lower = -geometry.motion.upper;
  back.upper = -geometry.motion.lower;
  return back;
}

/// Vertices that may have moved further than `reach` relative to the other mesh.
void addFarMovers(std::vector<std::uint32_t>& out, const Geometry& mesh, const Geometry& other,
                  double reach) {
  const Eigen::Vector3d centre = 0.5 * (other.motion.lower + other.motion.upper),
                        extent = other.motion.upper - centre;
  for (std::uint32_t v = 0; v < mesh.mesh.now.size(); ++v) {
    const Eigen::Vector3d moved =
        (mesh.mesh.now[v] - mesh.mesh.before[v] - centre).cwiseAbs() + extent;
    if (!(moved.squaredNorm() <= reach * reach)) out.push_back(v);
    if (out.size() == Validity::kMostFarMovers) return;
  }
}

/// L: along the longest axis; of a body that may be turned, along any.
double extentOf(const Geometry& geometry) {
  if (geometry.octree.size() == 0) return 0.0;
  const FloatBox box = geometry.octree.blocks()[0].box(0);
  double longest = 0.0;
  for (int k = 0; k < 3; ++k)
    longest = std::max(longest, double{box.upper[k]} - double{box.lower[k]});
  return (geometry.isPlaced() ? 2.0 : 1.0) * longest / geometry.frame.scale;
}

}  // namespace

/// Bounds on motion are of triangles, which have no radius.
static bool knowsSides(const Geometry& a, const Geometry& b) {
  return a.mesh.topology.hasFaces() && b.mesh.topology.hasFaces();
}

PairPlan planOf(const PairSettings& settings, const Geometry& a, const Geometry& b, bool moves) {
  PairPlan plan;
  plan.method = settings.method;
  StepPlan& step = plan.step;
  const double thickness = settings.thickness;
  plan.motion = moves ? largestMotion(a.motion, b.motion) : 0.0;
  if (!knowsSides(a, b)) return plan;
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
    } else if (smallestMotion(a.motion, b.motion) > plan.tolerance ||
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

void Trust::start(const PairSettings& settings, const Geometry& a, const Geometry& b,
                  std::uint64_t frame, PairPlan& plan) {
  const MotionRange ofA = correctionOf(a), ofB = correctionOf(b);
  const double correction = largestMotion(ofA, ofB);
  const bool corrected = !ofA.isZero() || !ofB.isZero();
  // No two features within the thickness are further apart, in any coordinate, than both meshes.
  const double size = extentOf(a) + extentOf(b) + settings.thickness + plan.step.extra;
  plan.step.certain = plan.step.motion + 2.0 * kMotionError * (plan.step.motion + size);
  const bool changed = m_topologyA != a.topologyRevision || m_topologyB != b.topologyRevision;
  const bool known = frame == m_frame + 1 && !changed;
  m_startsApart = known && m_end == End::Apart && (!corrected || correction < m_clearance);
  m_startsIntersecting = known && m_end == End::Intersecting && !corrected;
  plan.startsIntersecting = m_startsIntersecting;
  const int most = settings.contacts == Contacts::Earliest ? kLook : kMostSaved;
  m_saved = changed ? most : std::min(m_saved + 1, most);
  m_frame = frame;
  m_topologyA = a.topologyRevision;
  m_topologyB = b.topologyRevision;
  if (!knowsSides(a, b) || m_startsApart || plan.method == Method::Intersection ||
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
  validity.startedApart = m_startsApart || (plan.step.start && !facts.startsIntersecting);
  if (settings.method == Method::Auto) {
    validity.reach = plan.tolerance;
    validity.trusted = plan.method == Method::Intersection || validity.startedApart;
  } else if (plan.method == Method::Continuous) {
    validity.reach = std::numeric_limits<double>::infinity();
    validity.trusted = validity.startedApart;
  } else {
    const bool proximity = plan.method == Method::Proximity;
    validity.reach = proximity ? settings.thickness : std::min(a.smallestHeight, b.smallestHeight);
    const bool within = plan.motion <= validity.reach;
    if (!within) {
      addFarMovers(validity.verticesBeyondA, a, b, validity.reach);
      if (&a != &b) addFarMovers(validity.verticesBeyondB, b, a, validity.reach);
    }
    validity.trusted =
        proximity
            ? within && validity.startedApart && facts.verticesA.empty() && facts.verticesB.empty()
            : plan.motion == 0.0 || (within && !(nearby && contents.intersectingTriangles.empty()));
  }
  const bool trusted = validity.trusted && knowsSides(a, b);  // as vertices move, in straight lines
  validity.arcDeviation = a.arcDeviation + b.arcDeviation;
  validity.trusted = trusted && validity.arcDeviation <= settings.thickness;
  validity.sideMayBeWrong = plan.method != Method::Intersection && !validity.trusted;
  m_end = End::Unknown;
  m_clearance = std::min(facts.clearance, settings.thickness);
  if (!contents.intersectingTriangles.empty()) {
    m_end = End::Intersecting;
    m_witness = contents.intersectingTriangles.front();
  } else if (plan.method == Method::Intersection) {
    if (plan.motion == 0.0 && facts.clearance > 0.0) m_end = End::Apart;
  } else if (trusted && facts.clearance > 0.0) {
    m_end = End::Apart;
  } else if (plan.step.motion > 0.0 && settings.method != Method::Proximity) {
    findEnd(plan, facts, meshes, contents, counts);
  }
}

void Trust::findEnd(const PairPlan& plan, const StepFacts& facts, const MeshPair& meshes,
                    const CollisionData::Contents& contents, ContactBuffers& counts) {
  m_clearance = 0.0;
  if (plan.overlaps && facts.startsIntersecting) {  // Intersection has looked, and found none
    if (!meshes.near) m_end = End::Apart;
    return;
  }
  // Of an earliest time there are no contacts, and of what filters leave out neither.
  if (meshes.settings.contacts == Contacts::Earliest || meshes.filters()) return;
  EndOfStep end;
  if (m_startsIntersecting && intersect(meshes, false, m_witness, counts))
    end.intersecting = m_witness;
  else
    end = lookAtEnd(meshes, contents, counts);
  if (end.intersecting) {
    m_end = End::Intersecting;
    m_witness = *end.intersecting;
  } else if (contents.validity.startedApart && end.isKnown) {
    m_end = End::Apart;
  }
}

}  // namespace palpate
