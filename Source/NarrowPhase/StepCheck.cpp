#include "NarrowPhase/StepCheck.h"

#include "Math/ClosestPoint.h"
#include "Math/MotionBound.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

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
  recordVertices(features, firstId, secondId, m_out.facts.verticesA, m_out.facts.verticesB);
  return false;
}

template <Kind kind>
void StepCheck::recordVertices(const Features<kind>& features, std::uint32_t firstId,
                               std::uint32_t secondId, Buffer<std::uint32_t>& listA,
                               Buffer<std::uint32_t>& listB) {
  const auto vertices = features.vertices(firstId, secondId);
  for (int i = 0; i < 4; ++i) {
    const bool ofB = !m_pair.self() && &features.meshOf(i) == &m_pair.b;
    (ofB ? listB : listA).push_back(vertices[i]);
  }
}

/// Whether a plane with this normal separates the features by the distance at a time of the step.
/// The normal leads from the second feature to the first.
template <Kind kind>
static bool isSeparating(const ImpactQuery& query, double time, const Vector3d& normal,
                         double distance) {
  constexpr int kFirst = kind == Kind::VertexTriangle ? 1 : 2;
  for (int i = 0; i < kFirst; ++i)
    for (int j = kFirst; j < 4; ++j) {
      const auto &p = query.vertices[i], &q = query.vertices[j];
      const Vector3d between = (1.0 - time) * (p.before - q.before) + time * (p.now - q.now);
      const double error = kMotionError * (between.lpNorm<1>() + (p.now - q.now).lpNorm<1>() +
                                           (p.before - q.before).lpNorm<1>());
      if (!(normal.dot(between) > (distance + error) * normal.norm())) return false;
    }
  return true;
}

/// From the second feature to the first, at their closest points at a time of the step.
template <Kind kind>
static Vector3d differenceAt(const ImpactQuery& query, double time) {
  const auto at = [&](int i) -> Vector3d {
    return (1.0 - time) * query.vertices[i].before + time * query.vertices[i].now;
  };
  if constexpr (kind == Kind::VertexTriangle)
    return finiteVertexTriangleDistance(at(0), at(1), at(2), at(3)).difference;
  else
    return finiteEdgeEdgeDistance(at(0), at(1), at(2), at(3)).difference;
}

/// Whether features may come within their radii between two times of the step. They do not if one
/// plane separates them at both: the vertices move in straight lines. The interval is halved a few
/// times. first, last: unit, between the closest points at both times.
template <Kind kind>
static bool mayMeet(const ImpactQuery& query, double begin, double end, const Vector3d& first,
                    const Vector3d& last, double radii, int halvings) {
  for (const Vector3d& normal : {Vector3d(first + last), last, first})
    if (isSeparating<kind>(query, end, normal, radii) &&
        isSeparating<kind>(query, begin, normal, radii))
      return false;
  if (halvings == 0) return true;
  const double middle = 0.5 * (begin + end);
  const Vector3d between = stableUnit(differenceAt<kind>(query, middle));
  return mayMeet<kind>(query, begin, middle, first, between, radii, halvings - 1) ||
         mayMeet<kind>(query, middle, end, between, last, radii, halvings - 1);
}

/// Whether features may come within their radii after a time of the step.
template <Kind kind>
static bool mayMeet(const ImpactQuery& query, double time, const Vector3d& difference,
                    double radii) {
  const Vector3d first = stableUnit(difference);
  if (isSeparating<kind>(query, 1.0, first, radii) && isSeparating<kind>(query, time, first, radii))
    return false;
  constexpr int kHalvings = 3;
  return mayMeet<kind>(query, time, 1.0, first, stableUnit(differenceAt<kind>(query, 1.0)), radii,
                       kHalvings);
}

template <Kind kind>
void StepCheck::recordImpact(const Features<kind>& features, std::uint32_t firstId,
                             std::uint32_t secondId, double time, double distance,
                             const Vector3d& difference) {
  const StepPlan& step = m_pair.step;
  PALPATE_ASSERT(time >= 0.0 && time <= 1.0 && distance >= 0.0);
  const double rounding = step.motionWithRounding - step.motion;
  double &clearance = m_out.facts.clearance, &gap = m_out.facts.gapAtStart;
  if (time == 0.0)
    gap = std::min(gap, distance - (m_pair.a.largestRadius + m_pair.b.largestRadius) - rounding);
  const double radii = m_pair.a.largestRadius + m_pair.b.largestRadius;
  const bool findsMeetings = m_pair.reportsDistinct();
  if (clearance == 0.0 && !step.reportsImpacts && !findsMeetings) return;
  double left = (1.0 - time) * step.motion + rounding;
  const bool isNear = distance <= left;
  double own = left;  // a bound for these features
  if (isNear || (findsMeetings && distance <= left + radii))
    own = (1.0 - time) * motionBound<kind>(features.query(firstId, secondId)) + rounding;
  if (findsMeetings && distance <= own + radii &&
      mayMeet<kind>(features.query(firstId, secondId), time, difference, radii))
    recordVertices(features, firstId, secondId, m_out.facts.metA, m_out.facts.metB);
  if (clearance == 0.0 && !step.reportsImpacts) return;
  if (isNear) left = own;
  clearance = std::min(clearance, std::max(0.0, distance - left));
  if (step.reportsImpacts && distance <= left)
    recordVertices(features, firstId, secondId, m_out.facts.verticesA, m_out.facts.verticesB);
}

void replaceByImpacts(const MeshPair& pair, const StepFacts& touched, ContactBuffers& found,
                      ContactBuffers& out) {
  TimeCheck check(out.deadline, 32);
  const auto isTouched = [&](const Buffer<std::uint32_t>& sorted, auto... vertices) {
    return (std::binary_search(sorted.begin(), sorted.end(), vertices) || ...);
  };
  const auto &ofA = touched.verticesA, &ofB = pair.self() ? ofA : touched.verticesB;
  PALPATE_ASSERT(std::is_sorted(ofA.begin(), ofA.end()) && std::is_sorted(ofB.begin(), ofB.end()));
  const auto moveImpacts = [&](Buffer<VertexTriangleContact>& list, bool swapped) {
    const Features<Kind::VertexTriangle> features{swapped ? pair.b : pair.a,
                                                  swapped ? pair.a : pair.b};
    const auto &vertices = swapped ? ofB : ofA, &corners = swapped ? ofA : ofB;
    std::erase_if(list, [&](const VertexTriangleContact& c) {
      check();
      return c.timeOfImpact == 1.0 &&
             (isTouched(vertices, c.vertex) ||
              isTouched(corners, c.vertices[0], c.vertices[1], c.vertices[2])) &&
             addImpact(pair, features, c.vertex, c.triangle, swapped, out);
    });
  };
  moveImpacts(found.vertexTriangle, false);
  moveImpacts(found.triangleVertex, true);
  const Features<Kind::EdgeEdge> edges{pair.a, pair.b};
  std::erase_if(found.edgeEdge, [&](const EdgeEdgeContact& c) {
    check();
    return c.timeOfImpact == 1.0 &&
           (isTouched(ofA, c.edgeA[0], c.edgeA[1]) || isTouched(ofB, c.edgeB[0], c.edgeB[1])) &&
           addImpact(pair, edges, pair.a.topology.edgeOf(c.edgeA), pair.b.topology.edgeOf(c.edgeB),
                     false, out);
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

void StepCheck::recordTriangle(std::uint32_t triangle, bool isOfB, const Vector3d& a,
                               const Vector3d& b, const Vector3d& c) {
  const Vector3d u = b - a, v = c - a;
  if (!(isOfB ? m_pair.b : m_pair.a).topology.hasFaces()) return;  // a segment or a point
  if (u.cross(v).squaredNorm() > kFlatSquare * u.squaredNorm() * v.squaredNorm() ||
      hasArea(a, b, c))
    return;
  (isOfB && !m_pair.self() ? m_out.facts.degenerateB : m_out.facts.degenerateA).push_back(triangle);
}

void StepCheck::recordEdges(const Segment& p, const Segment& q) {
  const auto recordIfDegenerate = [](const TriangleMesh& mesh, const Segment& edge, auto& list) {
    if (mesh.topology.hasFaces() && mesh.now[edge[0]] == mesh.now[edge[1]])
      list.push_back(mesh.topology.edgeTriangles[mesh.topology.edgeOf(edge)].front());
  };
  recordIfDegenerate(m_pair.a, p, m_out.facts.degenerateA);
  recordIfDegenerate(m_pair.b, q,
                     m_pair.self() ? m_out.facts.degenerateA : m_out.facts.degenerateB);
}

template void StepCheck::recordImpact(const Features<Kind::VertexTriangle>&, std::uint32_t,
                                      std::uint32_t, double, double, const Vector3d&);
template void StepCheck::recordImpact(const Features<Kind::EdgeEdge>&, std::uint32_t, std::uint32_t,
                                      double, double, const Vector3d&);
template bool StepCheck::addImpactIfTouched(const Features<Kind::VertexTriangle>&, std::uint32_t,
                                            std::uint32_t, bool, double);
template bool StepCheck::addImpactIfTouched(const Features<Kind::EdgeEdge>&, std::uint32_t,
                                            std::uint32_t, bool, double);
template bool StepCheck::proximitySuffices(const Features<Kind::VertexTriangle>&, std::uint32_t,
                                           std::uint32_t) const;
template bool StepCheck::proximitySuffices(const Features<Kind::EdgeEdge>&, std::uint32_t,
                                           std::uint32_t) const;

}  // namespace palpate
