#include "Reference.h"

#include <palpate/FeaturePairs.h>
#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace palpate::accuracy {

namespace {

using Eigen::Vector3d;
using Kind = FeaturePair::Kind;

Vector3d between(const Vector3d& before, const Vector3d& now, double t) {
  return (1 - t) * before + t * now;
}

/// The four moving vertices of a feature pair, with their common plane and closest points.
class Motion {
 public:
  Motion(const FeaturePair& pair, const Step& step) : m_edges(pair.kind == Kind::EdgeEdge) {
    const auto& [i, j, k, l] = pair.ids;
    const auto ofA = [&](std::uint32_t v) { add(step.aBefore[v], step.aNow[v]); };
    const auto ofB = [&](std::uint32_t v) { add(step.bBefore[v], step.bNow[v]); };
    if (m_edges) {
      ofA(i), ofA(j), ofB(k), ofB(l);
    } else if (pair.kind == Kind::VertexTriangle) {
      ofA(i);
      for (const std::uint32_t corner : step.b.triangles[j]) ofB(corner);
    } else {
      ofB(j);
      for (const std::uint32_t corner : step.a.triangles[i]) ofA(corner);
    }
  }

  std::optional<double> firstTouch() const {
    const auto& [a, b, c, d] = m_before;
    const auto& [p, q, r, s] = m_now;
    const TimeOfImpactSettings finest{.minimumDistance = 0, .timeTolerance = 0x1p-50};
    return m_edges ? edgeEdgeTimeOfImpact(a, b, c, d, p, q, r, s, finest)
                   : vertexTriangleTimeOfImpact(a, b, c, d, p, q, r, s, finest);
  }

  std::array<Vector3d, 4> at(double t) const {
    std::array<Vector3d, 4> positions;
    for (int i = 0; i < 4; ++i) positions[i] = between(m_before[i], m_now[i], t);
    return positions;
  }

  /// Unit normal of the common plane. Zero if the sine of the spanning angle is below 1e-6.
  Vector3d normalAt(double t) const {
    const auto [p, q, r, s] = at(t);
    const Vector3d u = m_edges ? Vector3d(q - p) : Vector3d(r - q),
                   v = m_edges ? Vector3d(s - r) : Vector3d(s - q), normal = u.cross(v);
    if (normal.norm() < 1e-6 * u.norm() * v.norm()) return Vector3d::Zero();
    return normal.normalized();
  }

  /// Height of the vertex over the triangle's plane, or of edge a over edge b, times an area.
  double heightAt(double t) const {
    const auto [p, q, r, s] = at(t);
    return m_edges ? (q - p).cross(s - r).dot(p - r) : (r - q).cross(s - q).dot(p - q);
  }

  /// Difference of the two points that touch at t, from the second feature to the first: before,
  /// now.
  std::array<Vector3d, 2> differencesOfPointsThatTouchAt(double t) const {
    const auto [p, q, r, s] = at(t);
    Eigen::Vector4d weights;  // of the four vertices, in the difference
    if (m_edges) {
      const Vector3d u = q - p, v = s - r, w = u.cross(v);
      const double onP = (r - p).cross(v).dot(w) / w.squaredNorm(),
                   onQ = (r - p).cross(u).dot(w) / w.squaredNorm();
      weights << 1 - onP, onP, onQ - 1, -onQ;
    } else {
      const Vector3d w = (r - q).cross(s - q);
      const double onR = (p - q).cross(s - q).dot(w) / w.squaredNorm(),
                   onS = (r - q).cross(p - q).dot(w) / w.squaredNorm();
      weights << 1, onR + onS - 1, -onR, -onS;
    }
    std::array<Vector3d, 2> sums{Vector3d::Zero(), Vector3d::Zero()};
    for (int i = 0; i < 4; ++i) {  // relative to the first vertex: exact enough far from the origin
      sums[0] += weights[i] * (m_before[i] - m_before[0]);
      sums[1] += weights[i] * (m_now[i] - m_now[0]);
    }
    return sums;
  }

 private:
  void add(const Vector3d& before, const Vector3d& now) {
    m_before[m_count] = before;
    m_now[m_count++] = now;
  }

  bool m_edges;
  int m_count = 0;
  std::array<Vector3d, 4> m_before, m_now;
};

/// The side of the features shortly before t: the common sign 1e-2, 1e-3 and 1e-4 of the step
/// earlier, or 0 if these differ.
int sideBefore(const Motion& motion, double t) {
  int side = 0;
  for (const double earlier : {1e-2, 1e-3, 1e-4}) {
    const double height = motion.heightAt(std::max(0.0, t - earlier));
    const int sign = (height > 0) - (height < 0);
    if (sign == 0 || (side != 0 && sign != side)) return 0;
    side = sign;
  }
  return side;
}

std::optional<Impact> impactOf(const FeaturePair& pair, const Step& step) {
  const Motion motion(pair, step);
  const std::optional<double> time = motion.firstTouch();
  if (!time || *time < 1e-3) return {};
  const int side = sideBefore(motion, *time);
  Vector3d normal = motion.normalAt(*time);
  if (side == 0 || normal.isZero()) return {};
  normal *= side;  // towards the first vertex, or edge a
  const auto [before, now] = motion.differencesOfPointsThatTouchAt(*time);
  Impact impact{*time, normal, normal.dot(before), normal.dot(now)};
  if (pair.kind == Kind::TriangleVertex) impact.normal = -normal;
  return impact;
}

/// A detection of the two meshes of a step.
class Detection {
 public:
  Detection(const Step& step, Engine engine, Method method)
      : m_detection({.engine = engine, .threads = 1}),
        m_a(m_detection.addTriangleMesh(step.aBefore, step.a.triangles)),
        m_b(m_detection.addTriangleMesh(step.bBefore, step.b.triangles)) {
    m_detection.addCollisionPair(m_a, m_b, {.method = method, .contacts = Contacts::All});
    m_detection.setPositions(m_a, step.aBefore, step.aNow);
    m_detection.setPositions(m_b, step.bBefore, step.bNow);
  }
  /// Moves both meshes to a time of the step, at rest.
  void moveTo(const Step& step, double t) {
    const auto positions = [t](const auto& before, const auto& now) {
      std::vector<Vector3d> all(now.size());
      for (std::size_t i = 0; i < now.size(); ++i) all[i] = between(before[i], now[i], t);
      return all;
    };
    const std::vector<Vector3d> a = positions(step.aBefore, step.aNow),
                                b = positions(step.bBefore, step.bNow);
    m_detection.setPositions(m_a, a, a);
    m_detection.setPositions(m_b, b, b);
  }
  const CollisionData& detect() {
    m_detection.detectCollision();
    return m_detection.collisionData(m_a, m_b);
  }

 private:
  OctreeBasedCD m_detection;
  GeometryId m_a, m_b;
};

}  // namespace

Reference referenceOf(const Step& step, int substeps) {
  Reference reference;
  Claims contacts;
  const auto began = std::chrono::steady_clock::now();
  addClaims(Detection(step, Engine::BruteForce, Method::Continuous).detect(), 0, 1, contacts);
  reference.milliseconds =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - began).count();
  const Incidence a(step.a.triangles), b(step.b.triangles);
  for (const Claim& contact : contacts.claims) {
    reference.impacts.emplace(contact.features, impactOf(contact.features, step));
    Incidence::addTriangles(contact.features, a, b, reference.touching);
  }
  Detection start(step, Engine::BruteForce, Method::Intersection);
  start.moveTo(step, 0);  // pairs that touch at the start may have no impact within the step
  const auto atStart = start.detect().intersectingTriangles();
  reference.touchingAtStart.assign(atStart.begin(), atStart.end());
  reference.touching.insert(reference.touching.end(), atStart.begin(), atStart.end());
  sortUnique(reference.touching);
  Detection intersection(step, Engine::Octree, Method::Intersection);
  for (int i = 1; i <= substeps; ++i) {
    intersection.moveTo(step, static_cast<double>(i) / substeps);
    for (const ElementPair& pair : intersection.detect().intersectingTriangles())
      reference.contradictions +=
          !std::binary_search(reference.touching.begin(), reference.touching.end(), pair);
  }
  return reference;
}

}  // namespace palpate::accuracy
