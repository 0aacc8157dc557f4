#include "Queries/BodyPair.h"

#include "Queries/Containment.h"
#include "Queries/GeometryDistances.h"
#include "Queries/VertexSearch.h"
#include "Mesh/Corners.h"
#include "Math/RayCrossing.h"
#include "Math/Tolerances.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

void BodyVertices::assign(const Body& geometry) {
  TimeCheck check(512);
  const auto& now = geometry.mesh.now;
  positions.resize(now.size());
  for (std::size_t v = 0; v < now.size(); ++v) {
    check();
    positions[v] = now[v];
  }
  triangleOf.assign(now.size(), kNoElement);
  partOf.resize(now.size());
  std::iota(partOf.begin(), partOf.end(), 0u);
  const auto root = [&](std::uint32_t v) {
    while (partOf[v] != v) v = partOf[v] = partOf[partOf[v]];
    return v;
  };
  box.setEmpty();
  const auto& triangles = geometry.mesh.topology.elements;
  geometry.mesh.topology.forEachElement([&](std::uint32_t t) {
    check();
    for (const std::uint32_t v : triangles[t]) {
      if (triangleOf[v] == kNoElement) triangleOf[v] = t, box.extend(positions[v]);
      const std::uint32_t first = root(triangles[t][0]), second = root(v);
      partOf[std::max(first, second)] = std::min(first, second);
    }
  });
  parts.clear();
  for (std::uint32_t v = 0; v < now.size(); ++v) {
    partOf[v] = partOf[partOf[v]];  // a lower vertex, which has been visited
    if (partOf[v] == v && triangleOf[v] != kNoElement) parts.push_back(v);
  }
}

double BodyVertices::magnitude() const {
  return std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff());
}

double unitOf(double magnitude) { return std::exp2(-std::ilogb(std::max(magnitude, 0x1p-1000))); }

Vector3d BodyVertices::furthest(const Vector3d& direction) const {
  TimeCheck check(1024);
  double most = -std::numeric_limits<double>::infinity();
  std::size_t best = 0;
  for (std::size_t v = 0; v < positions.size(); ++v) {
    check();
    const double height = direction[0] * positions[v][0] + direction[1] * positions[v][1] +
                          direction[2] * positions[v][2];
    if (triangleOf[v] == kNoElement || !(height > most)) continue;
    most = height;
    best = v;
  }
  return positions[best];
}

BodyPair::BodyPair(const Body& a, const Body& b, Engine engine, BodyPairScratch& scratch,
                   Moved moved)
    : m_a(a),
      m_b(b),
      m_engine(engine),
      m_movesTransform(moved == Moved::Body && a.isPlaced()),
      m_scratch(scratch) {
  scratch.a.assign(a);
  scratch.b.assign(b);
  m_magnitude = std::max(scratch.a.magnitude(), scratch.b.magnitude());
}

Vector3d BodyPair::moved(std::uint32_t vertex, const Vector3d& shift) const {
  if (!m_movesTransform) return m_scratch.a.positions[vertex] + shift;
  const Positions& now = m_a.mesh.now;
  Pose transform = now.transform();
  transform.translation += shift;
  return transform(now.body()[vertex]);
}

Corners BodyPair::cornersOfA(std::uint32_t element, const Vector3d& shift) const {
  const Triangle& t = m_a.mesh.topology.elements[element];
  return {moved(t[0], shift), moved(t[1], shift), moved(t[2], shift)};
}

Corners BodyPair::cornersOfB(std::uint32_t element) const {
  return cornersOf(m_b.mesh.topology.elements[element], m_scratch.b.positions);
}

void BodyPair::forEachIntersecting(
    const Vector3d& shift, const std::function<bool(const IntersectingTriangles&)>& f) const {
  SignCounts counts;
  IntersectingTriangles both;
  TimeCheck check(16);
  const auto test = [&](std::uint32_t elementB) {
    check();
    both.elementB = elementB;
    both.b = cornersOfB(elementB);
    both.found = intersectTriangles(both.a, both.b, counts);
    m_scratch.stack.exactDecisions += std::exchange(counts.undecided, 0);
    return !both.found.intersect() || f(both);
  };
  const auto setA = [&](std::uint32_t elementA) {
    both.elementA = elementA;
    both.a = cornersOfA(elementA, shift);
  };
  const std::span<const std::uint32_t> orderA = m_a.tree.octree().order(),
                                       orderB = m_b.tree.octree().order();
  if (m_engine == Engine::BruteForce) {
    for (const std::uint32_t i : orderA) {
      setA(i);
      for (const std::uint32_t j : orderB)
        if (!test(j)) return;
    }
    return;
  }
  if (!m_scratch.pairs) m_scratch.pairs = std::make_unique<PairScratch>();
  PairBound bound;
  bound.distance = boxErrorOf(m_a, m_b);
  forNearElements(
      PairSide(m_a), PairSide(m_b, mapBetween(m_a, m_b, shift)), bound, *m_scratch.pairs,
      [&](const NearElements& near) {
        for (std::uint32_t i = 0; i < NearElements::kSide; ++i) {
          if (near.near[i]) setA(orderA[near.placeA + i]);
          for (std::uint32_t bits = near.near[i]; bits; bits &= bits - 1)
            if (!test(orderB[near.placeB + static_cast<std::uint32_t>(std::countr_zero(bits))])) {
              bound.heights = -std::numeric_limits<float>::infinity();  // nothing is that low
              return bound;
            }
        }
        return bound;
      });
}

int BodyPair::windingNumberOf(bool ofA, const Vector3d& p) const {
  checkTime();
  return windingNumber(geometry(ofA), p, m_engine, m_scratch.stack);
}

bool BodyPair::isInside(bool ofA, std::uint32_t vertex) const {
  const Vector3d& p = vertices(ofA).positions[vertex];
  return vertices(!ofA).box.contains(p) && windingNumberOf(!ofA, p) != 0;
}

bool BodyPair::isInB(const Vector3d& p) const {
  return m_scratch.b.box.contains(p) && windingNumberOf(false, p) != 0;
}

/// The octree of a where it is not moved finds the triangles that a ray from the point may meet.
bool BodyPair::isInMovedA(const Vector3d& p, const Vector3d& shift) const {
  // Of a where it is moved to, with its roundings.
  const Vector3d slack =
      Vector3d::Constant(kExitSlack * (m_magnitude + shift.cwiseAbs().maxCoeff()));
  const Eigen::AlignedBox3d box(m_scratch.a.box.min() + shift - slack,
                                m_scratch.a.box.max() + shift + slack);
  if (!box.contains(p)) return false;
  if (shift.isZero(0.0)) return windingNumberOf(true, p) != 0;
  const std::span<const std::uint32_t> order = m_a.tree.octree().order();
  Buffer<std::uint32_t>& found = m_scratch.stack.found;
  if (m_engine == Engine::BruteForce) {
    found.resize(order.size());
    std::iota(found.begin(), found.end(), 0u);
  } else {
    const PointFrame frame(m_a);
    FloatBox ray = frame.boxOf(p - shift - slack);
    ray.upper = frame.boxOf(p - shift + slack).upper;
    ray.upper[0] = std::numeric_limits<float>::infinity();
    findOverlapping(m_a.tree.octree(), frame.map(), ray, m_scratch.stack);
  }
  SignCounts counts;
  TimeCheck check(256);
  const auto cornersAt = [&](std::size_t i) {
    check();
    return cornersOfA(order[found[i]], shift);
  };
  const int number = windingNumber(found.size(), cornersAt, p, counts);
  m_scratch.stack.exactDecisions += counts.undecided;
  return number != 0;
}

std::optional<BodyPair::Exit> BodyPair::lastExitOf(const PartVertex& vertex,
                                                   const Vector3d& direction, double begin,
                                                   double end) const {
  const Vector3d& p = vertices(vertex.ofA).positions[vertex.vertex];
  RayHits hits(geometry(!vertex.ofA), {p, direction, begin, end}, m_engine == Engine::BruteForce,
               m_scratch.met);
  std::optional<Exit> last;
  hits.forAllParts([&](const RayHits::Part& part) {
    if (part.last > begin) last = Exit{part.last, part.exitElement};
  });
  m_scratch.stack.exactDecisions += hits.exactDecisions();
  return last;
}

}  // namespace palpate
