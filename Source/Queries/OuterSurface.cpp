#include "Queries/OuterSurface.h"

#include <palpate/FeaturePairs.h>

#include "Queries/GeometryDistances.h"
#include "Queries/PairTraversal.h"
#include "Math/ClosestPoint.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <memory>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// Planes at a point in front of which the outside is looked for, and between three of which. At
/// most points few faces meet. At the tip of a fan one is enough.
constexpr std::size_t kMostNormals = 32, kFewNormals = 6;

/// Calls f(direction) for a direction on each combination of sides of three planes, until it is
/// true. Returns whether it was.
template <class F>
bool anySector(const Vector3d& n1, const Vector3d& n2, const Vector3d& n3, F&& f) {
  const Vector3d dual[] = {n2.cross(n3), n3.cross(n1), n1.cross(n2)};
  const double volume = n1.dot(dual[0]);
  if (!(std::abs(volume) > 0x1p-20)) return false;  // two planes have the same sectors
  for (unsigned sides = 0; sides < 8; ++sides) {
    Vector3d direction = Vector3d::Zero();
    for (int k = 0; k < 3; ++k) direction += (sides >> k & 1 ? -1.0 : 1.0) / volume * dual[k];
    if (f(direction)) return true;
  }
  return false;
}

/// Along the line in which two triangles intersect, all points of both, or one. The ends are
/// within rounding.
void addCommonPoints(const Corners& a, const Corners& b, const TriangleIntersection& found,
                     std::vector<Vector3d>& points) {
  const auto addCrossings = [&](const Corners& edges, unsigned bits, const Corners& triangle) {
    const Vector3d normal = windingNormal(triangle[0], triangle[1], triangle[2]);
    for (std::size_t i = 0; i < 3; ++i) {
      if (!(bits >> i & 1)) continue;
      const Vector3d &p = edges[i], &q = edges[(i + 1) % 3];
      const double atP = normal.dot(p - triangle[0]), atQ = normal.dot(q - triangle[0]),
                   t = atP / (atP - atQ);
      points.push_back(p + (t >= 0.0 && t <= 1.0 ? t : 0.5) * (q - p));
    }
  };
  addCrossings(a, found.edgesOfAThroughB, b);
  addCrossings(b, found.edgesOfBThroughA, a);
  for (std::size_t i = 0; i < 3; ++i) {
    if (found.cornersOfAOnB >> i & 1) points.push_back(a[i]);
    if (found.cornersOfBOnA >> i & 1) points.push_back(b[i]);
    for (std::size_t j = 0; j < 3; ++j)
      if (found.touchingEdges &
          TriangleIntersection::edgesBit(static_cast<int>(i), static_cast<int>(j))) {
        const EdgeEdgeDistance touch =
            finiteEdgeEdgeDistance(a[i], a[(i + 1) % 3], b[j], b[(j + 1) % 3]);
        points.push_back(a[i] + touch.weightA * (a[(i + 1) % 3] - a[i]));
      }
  }
}

Vector3d closestOnSegment(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const VertexTriangleDistance found = finiteVertexTriangleDistance(p, a, b, b);
  return p - found.difference;
}

}  // namespace

OuterSurface::OuterSurface(const Body& geometry, bool bruteForce)
    : m_geometry(geometry), m_bruteForce(bruteForce) {}

Corners OuterSurface::cornersOf(std::uint32_t element) const {
  return palpate::cornersOf(m_geometry.mesh.topology.elements[element], m_geometry.mesh.now);
}

/// L: how far beside the surface winding numbers are asked for.
double OuterSurface::aside(const Vector3d& p) const {
  const OctreeFrame frame(m_geometry);
  return kOuterAside *
         (m_geometry.tree.reach() + frame.origin().cwiseAbs().maxCoeff() + p.cwiseAbs().maxCoeff());
}

bool OuterSurface::isOutside(const Vector3d& q, const Vector3d& direction,
                             const WindingNumber& windingNumber) const {
  const double length = stableLength(direction);
  return length > 0.0 && windingNumber(q + aside(q) / length * direction) == 0;
}

bool OuterSurface::holds(const Vector3d& p, const PointDistances::Near& near, int number,
                         const WindingNumber& windingNumber) const {
  const Vector3d q = p - near.closest.difference;
  if (!(aside(q) > 0x1p-900)) return true;  // nothing can be told so near to the smallest double
  return holdsPoint(q, p, number, windingNumber);
}

/// Whether some point beside q is outside. Tried are the one beyond q, those in front of the
/// triangles at q, and those on either side of pairs and triples of their planes.
bool OuterSurface::holdsPoint(const Vector3d& q, const Vector3d& from, int number,
                              const WindingNumber& windingNumber) const {
  if (isOutside(q, q - from, windingNumber)) return true;
  std::vector<std::uint32_t> elements;
  PointDistances(m_geometry, q, m_bruteForce).within(kExitSlack / kOuterAside * aside(q), elements);
  std::sort(elements.begin(), elements.end());
  std::vector<Vector3d> normals;
  Vector3d sum = Vector3d::Zero();
  for (const std::uint32_t element : elements) {
    const auto [a, b, c] = cornersOf(element);
    const Vector3d normal = windingNormal(a, b, c);
    const auto isKnown = [&](const Vector3d& other) {
      return (normal - other).squaredNorm() < 0x1p-40;
    };
    if (std::any_of(normals.begin(), normals.end(), isKnown)) continue;
    normals.push_back(normal);
    sum += normal;
  }
  // A body that is inside out has its outside behind its faces.
  const double side = number > 0 ? 1.0 : -1.0;
  if (isOutside(q, side * sum, windingNumber)) return true;
  if (normals.size() < 2) return false;
  for (std::size_t i = 0; i < std::min(normals.size(), kMostNormals); ++i)
    if (isOutside(q, side * normals[i], windingNumber)) return true;
  if (normals.size() > kFewNormals) return false;
  const auto outside = [&](const Vector3d& way) { return isOutside(q, way, windingNumber); };
  for (std::size_t i = 0; i < normals.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const Vector3d &m = normals[i], &n = normals[j];
      for (const Vector3d& way : {Vector3d(m + n), Vector3d(m - n), Vector3d(n - m)})
        if (outside(way)) return true;
      for (std::size_t k = 0; k < j; ++k)
        if (anySector(m, n, normals[k], outside)) return true;
    }
  return false;
}

namespace {

/// The features of two triangles that a common corner makes meet. Calls f(corner of a) for each.
template <class F>
ExcludedFeatures commonCorners(const Triangle& a, const Triangle& b, F&& f) {
  ExcludedFeatures excluded;
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t l = 0; l < 3; ++l) {
      if (a[k] != b[l]) continue;
      f(k);
      excluded.cornersOfA |= static_cast<std::uint8_t>(1u << k);
      excluded.cornersOfB |= static_cast<std::uint8_t>(1u << l);
      for (const std::size_t edgeOfA : {k, (k + 2) % 3})
        for (const std::size_t edgeOfB : {l, (l + 2) % 3})
          excluded.edges |= static_cast<std::uint16_t>(
              TriangleIntersection::edgesBit(static_cast<int>(edgeOfA), static_cast<int>(edgeOfB)));
    }
  return excluded;
}

}  // namespace

/// Finds the triangles that have points in common with others, besides common vertices. Triangles
/// with a common edge have others only if they are in one plane.
void OuterSurface::findCreases() const {
  m_parts = {};  // an earlier call may have found no memory
  SignCounts counts;
  const auto test = [&](std::uint32_t first, std::uint32_t second) {
    // Not in the octree's order, on which rounding would depend.
    const auto [i, j] = std::minmax(first, second);
    const Triangle &a = m_geometry.mesh.topology.elements[i],
                   &b = m_geometry.mesh.topology.elements[j];
    const Corners ofA = cornersOf(i), ofB = cornersOf(j);
    std::vector<Vector3d> common;
    const ExcludedFeatures excluded =
        commonCorners(a, b, [&](std::size_t corner) { common.push_back(ofA[corner]); });
    if (common.size() > 1) return;
    const TriangleIntersection found = intersectTriangles(ofA, ofB, counts, excluded);
    if (!found.intersect()) return;
    addCommonPoints(ofA, ofB, found, common);
    m_parts.mixed.push_back(i);
    m_parts.mixed.push_back(j);
    const Vector3d along =
        windingNormal(ofA[0], ofA[1], ofA[2]).cross(windingNormal(ofB[0], ofB[1], ofB[2]));
    // Triangles in one plane have an area in common. Its outline ends at these points.
    if (found.touch())
      for (const Vector3d& point : common) m_parts.creases.push_back({i, {point, point}});
    const auto [start, end] = std::minmax_element(
        common.begin(), common.end(),
        [&](const Vector3d& l, const Vector3d& r) { return along.dot(l) < along.dot(r); });
    m_parts.creases.push_back({i, {*start, *end}});
  };
  const std::span<const std::uint32_t> order = m_geometry.tree.octree().order();
  if (m_bruteForce) {
    for (std::size_t i = 0; i < order.size(); ++i)
      for (std::size_t j = i + 1; j < order.size(); ++j) test(order[i], order[j]);
  } else {
    const auto scratch = std::make_unique<PairScratch>();
    PairBound bound;
    bound.distance = boxErrorOf(m_geometry, m_geometry);
    const PairSide side(m_geometry);
    forNearElements(side, side, bound, *scratch, [&](const NearElements& near) {
      for (std::uint32_t i = 0; i < NearElements::kSide; ++i)
        for (std::uint32_t bits = near.near[i]; bits; bits &= bits - 1) {
          const std::uint32_t a = near.placeA + i,
                              b = near.placeB + static_cast<std::uint32_t>(std::countr_zero(bits));
          if (a < b) test(order[a], order[b]);
        }
      return bound;
    });
  }
  std::sort(m_parts.mixed.begin(), m_parts.mixed.end());
  m_parts.mixed.erase(std::unique(m_parts.mixed.begin(), m_parts.mixed.end()), m_parts.mixed.end());
  std::sort(m_parts.creases.begin(), m_parts.creases.end(), [](const Crease& l, const Crease& r) {
    const auto keyOf = [](const Crease& c) {
      return std::tuple(c.element, c.ends[0][0], c.ends[0][1], c.ends[0][2], c.ends[1][0],
                        c.ends[1][1], c.ends[1][2]);
    };
    return keyOf(l) < keyOf(r);
  });
}

/// Triangles that no others intersect are of one kind with their neighbours, where an edge has two.
CountedVector<std::uint32_t> OuterSurface::outerTriangles(
    const WindingNumber& windingNumber) const {
  const MeshTopology& topology = m_geometry.mesh.topology;
  enum class Kind : std::uint8_t { Unknown, Mixed, Outer, Inner };
  std::vector<Kind> kinds(topology.elements.size(), Kind::Unknown);
  for (const std::uint32_t element : m_parts.mixed) kinds[element] = Kind::Mixed;
  CountedVector<std::uint32_t> outer, open;
  topology.forEachElement([&](std::uint32_t first) {
    if (kinds[first] != Kind::Unknown) return;
    const auto [a, b, c] = cornersOf(first);
    const Vector3d middle = (a + b + c) / 3.0, normal = windingNormal(a, b, c);
    const bool isOuter =
        isOutside(middle, normal, windingNumber) || isOutside(middle, -normal, windingNumber);
    kinds[first] = isOuter ? Kind::Outer : Kind::Inner;
    open.push_back(first);
    while (!open.empty()) {
      const std::uint32_t element = open.back();
      open.pop_back();
      if (isOuter) outer.push_back(element);
      for (const std::uint32_t edge : topology.triangleEdges[element]) {
        if (edge == kNoEdge || topology.edgeTriangles[edge].size() != 2) continue;
        for (const std::uint32_t other : topology.edgeTriangles[edge]) {
          if (kinds[other] != Kind::Unknown) continue;
          kinds[other] = kinds[first];
          open.push_back(other);
        }
      }
    }
  });
  std::sort(outer.begin(), outer.end());
  return outer;
}

void OuterSurface::find(const WindingNumber& windingNumber) const {
  findCreases();
  m_parts.elementOf = outerTriangles(windingNumber);
  if (m_parts.elementOf.empty()) return;
  m_parts.outer = std::make_unique<Body>(m_geometry.id);
  std::vector<Triangle> triangles;
  for (const std::uint32_t element : m_parts.elementOf)
    triangles.push_back(m_geometry.mesh.topology.elements[element]);
  makeBody(m_geometry.mesh.now.all(), triangles, Threads(1), *m_parts.outer);
}

std::optional<OuterSurface::Near> OuterSurface::nearest(const Vector3d& p, int number,
                                                        const WindingNumber& windingNumber) const {
  if (!m_isFound.load(std::memory_order_acquire)) {
    const std::lock_guard guard(m_finding);
    if (!m_isFound.load(std::memory_order_relaxed)) find(windingNumber);
    m_isFound.store(true, std::memory_order_release);
  }
  std::optional<Near> best;
  double distance = kInfinity;
  if (m_parts.outer) {
    const auto near = PointDistances(*m_parts.outer, p, m_bruteForce).nearest(kInfinity, 0);
    PALPATE_ASSERT(near);
    best = Near{m_parts.elementOf[near->element], p - near->closest.difference};
    distance = near->closest.distance;
  }
  const auto add = [&](std::uint32_t element, const Vector3d& q) {
    const double length = stableLength(p - q);
    if (!(length < distance) || !holdsPoint(q, p, number, windingNumber)) return;
    best = Near{element, q};
    distance = length;
  };
  for (const std::uint32_t element : m_parts.mixed) {
    const auto [a, b, c] = cornersOf(element);
    const VertexTriangleDistance closest = finiteVertexTriangleDistance(p, a, b, c);
    if (!(closest.distance < distance)) continue;
    add(element, p - closest.difference);
    for (const auto& [start, end] : {std::pair(a, b), std::pair(b, c), std::pair(c, a)})
      add(element, closestOnSegment(p, start, end));
  }
  for (const Crease& crease : m_parts.creases)
    add(crease.element, closestOnSegment(p, crease.ends[0], crease.ends[1]));
  return best;
}

}  // namespace palpate
