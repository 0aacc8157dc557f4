#include "Queries/GeometryDistances.h"

#include <palpate/Intersection.h>

#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"
#include "Octree/BoxMap.h"
#include "Queries/PointDistances.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Queries/GeometryDistances.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

#ifndef PALPATE_PAIR_SEARCH
#define PALPATE_PAIR_SEARCH
namespace palpate {

/// A search for the pairs of elements of two octrees that are nearest to each other.
struct PairSearch {
  const Octree &a, &b;
  BoxMap mapA, mapB;  ///< to common floats
};
/// Tests the elements at two places. Returns a bound in the common floats: pairs of boxes that are
/// further apart are skipped.
using TestPair = float (*)(void* context, std::uint32_t placeA, std::uint32_t placeB);

}  // namespace palpate
#endif

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

class PairDescent {
 public:
  PairDescent(const PairSearch& search, void* context, TestPair test)
      : m_search(search), m_context(context), m_test(test) {}

  HWY_ATTR void run(float bound) {
    setBound(bound);
    push(0.0f, 0, 0);
    while (m_count > 0) {
      const Entry entry = m_entries[--m_count];
      if (entry.square > m_limit) continue;
      const FloatBox boxA = boxOf(m_search.a, m_search.mapA, entry.a),
                     boxB = boxOf(m_search.b, m_search.mapB, entry.b);
      const OctreeNode childA = childOf(m_search.a, entry.a), childB = childOf(m_search.b, entry.b);
      if (childA != 0 && (childB == 0 || sizeOf(boxA) >= sizeOf(boxB)))
        expand(m_search.a, m_search.mapA, entry.a, childA, boxB, entry.square,
               [&](float square, OctreeNode node) { push(square, node, entry.b); });
      else if (childB != 0)
        expand(m_search.b, m_search.mapB, entry.b, childB, boxA, entry.square,
               [&](float square, OctreeNode node) { push(square, entry.a, node); });
      else
        testElements(entry.a & ~kOwn, entry.b & ~kOwn);
    }
  }

 private:
  /// The bit of a node of which only its own elements are left, without its children.
  static constexpr OctreeNode kOwn = 0x80000000u;
  struct Entry {
    float square;
    OctreeNode a, b;
  };

  void setBound(float bound) {
    // Computed squares are off by less than 2^-20 of themselves.
    m_limit = OutwardRounding::up(bound * bound * (1.0f + 0x1p-19f));
    if (!(m_limit >= 0)) m_limit = std::numeric_limits<float>::infinity();
  }
  void push(float square, OctreeNode a, OctreeNode b) { m_entries[m_count++] = {square, a, b}; }
  static OctreeNode childOf(const Octree& octree, OctreeNode node) {
    return node & kOwn ? 0 : octree.firstChild(node);
  }
  HWY_ATTR static FloatBox boxOf(const Octree& octree, const BoxMap& map, OctreeNode node) {
    return BoxLanes<BoxTag>::of(octree.box(node & ~kOwn)).mapped(map).first();
  }
  static float sizeOf(const FloatBox& box) {
    return (box.upper[0] - box.lower[0]) + (box.upper[1] - box.lower[1]) +
           (box.upper[2] - box.lower[2]);
  }

  /// Pushes the node's own elements and its children near the box, the nearest last.
  template <class Push>
  HWY_ATTR HWY_INLINE void expand(const Octree& octree, const BoxMap& map, OctreeNode node,
                                  OctreeNode child, const FloatBox& other, float square,
                                  Push&& push) {
    const std::size_t first = m_count;
    alignas(64) float squares[8];
    std::uint32_t bits = 0;
    const NodeTag d;
    for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
      const auto distances =
          BoxLanes<NodeTag>::load(octree.blocks()[child >> 3], i).mapped(map).distanceFrom(other);
      hn::Store(distances, d, squares + i);
      bits |= bitsOf(d, hn::Le(distances, hn::Set(d, m_limit))) << i;
    }
    for (; bits; bits &= bits - 1) {
      const auto slot = static_cast<std::uint32_t>(std::countr_zero(bits));
      if (octree.isEmpty(child + slot)) continue;
      push(squares[slot], child + slot);
      for (std::size_t i = m_count - 1; i > first && m_entries[i - 1].square < squares[slot]; --i)
        std::swap(m_entries[i], m_entries[i - 1]);
    }
    const auto [begin, end] = octree.ownRange(node);
    if (begin < end) push(square, node | kOwn);
  }

  HWY_ATTR void testElements(OctreeNode a, OctreeNode b) {
    const LeafTag d;
    constexpr std::size_t kSide = 16;
    alignas(64) float squares[kSide];
    const auto [beginA, endA] = m_search.a.ownRange(a);
    const auto [beginB, endB] = m_search.b.ownRange(b);
    for (std::uint32_t i = beginA; i < endA; ++i) {
      const FloatBox box =
          BoxLanes<BoxTag>::of(m_search.a.boxes()[i]).mapped(m_search.mapA).first();
      for (std::uint32_t j = beginB; j < endB; j += kSide) {
        const std::size_t size = std::min<std::size_t>(kSide, endB - j);
        std::uint32_t bits = 0;
        for (std::size_t k = 0; k < size; k += hn::Lanes(d)) {
          const auto distances = BoxLanes<LeafTag>::load(m_search.b.boxes(), j + k)
                                     .mapped(m_search.mapB)
                                     .distanceFrom(box);
          hn::Store(distances, d, squares + k);
          bits |=
              bitsOf(d, hn::And(hn::FirstN(d, size - k), hn::Le(distances, hn::Set(d, m_limit))))
              << k;
        }
        for (; bits; bits &= bits - 1) {
          const auto lane = static_cast<std::uint32_t>(std::countr_zero(bits));
          if (squares[lane] <= m_limit) setBound(m_test(m_context, i, j + lane));
        }
      }
    }
  }

  const PairSearch& m_search;
  void* const m_context;
  const TestPair m_test;
  float m_limit = 0;  ///< of computed squared distances of boxes
  std::size_t m_count = 0;
  // Eight entries remain on each of at most 61 levels of each octree.
  std::array<Entry, 1024> m_entries;
};

HWY_ATTR void searchPairsKernel(const PairSearch& search, float bound, void* context,
                                TestPair test) {
  PairDescent(search, context, test).run(bound);
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(searchPairsKernel);

namespace {

using Eigen::Vector3d;

/// The closest points of two elements.
struct ElementDistance {
  double distance = std::numeric_limits<double>::infinity();  ///< L, less the radii; never negative
  Vector3d weightsA = Vector3d::Zero(), weightsB = Vector3d::Zero();
};

/// The corners of an element, whose positions are read once.
class Element {
 public:
  Element(const SearchableGeometry& geometry, std::uint32_t element)
      : m_mesh(&geometry.mesh), m_vertices(geometry.mesh.topology.triangles[element]) {
    for (std::size_t i = 0; i < 3; ++i) m_corners[i] = m_mesh->now[m_vertices[i]];
  }
  /// A segment without a radius.
  Element(const Vector3d& p, const Vector3d& q) : m_vertices{0, 1, 1}, m_corners{p, q, q} {}

  const Vector3d& operator[](std::size_t i) const { return m_corners[i % 3]; }
  Vector3d point(const Vector3d& weights) const {
    return weights[0] * m_corners[0] + weights[1] * m_corners[1] + weights[2] * m_corners[2];
  }
  double radius(const Vector3d& weights) const {
    return m_mesh ? m_mesh->radius(m_vertices, weights) : 0.0;
  }
  double largestRadius() const { return m_mesh ? m_mesh->largestRadius : 0.0; }
  bool isPoint() const { return m_vertices[0] == m_vertices[1] && m_vertices[1] == m_vertices[2]; }
  /// Whether corner i repeats an earlier one, and edge i an earlier edge.
  bool repeatsCorner(std::size_t i) const {
    return (i > 0 && m_vertices[i] == m_vertices[0]) || (i > 1 && m_vertices[2] == m_vertices[1]);
  }
  bool hasEdge(std::size_t i) const {
    return m_vertices[i] != m_vertices[(i + 1) % 3] &&
           !(i == 2 && m_vertices[1] == m_vertices[2]);  // {p, q, q} has one edge
  }

 private:
  const TriangleMesh* m_mesh = nullptr;
  Triangle m_vertices;
  std::array<Vector3d, 3> m_corners;
};

Vector3d cornerWeights(std::size_t i) { return Vector3d::Unit(static_cast<Eigen::Index>(i)); }
Vector3d edgeWeights(std::size_t i, double weight) {
  Vector3d weights = Vector3d::Zero();
  weights[static_cast<Eigen::Index>(i)] = 1.0 - weight;
  weights[static_cast<Eigen::Index>((i + 1) % 3)] = weight;
  return weights;
}

/// The nearest of all feature pairs. Features that cross meet in an edge and a face, which no
/// feature pair is near to: then the exact test decides.
ElementDistance elementDistance(const Element& a, const Element& b) {
  ElementDistance best;
  const auto take = [&](double distance, const Vector3d& weightsA, const Vector3d& weightsB) {
    const double least = std::max(0.0, distance - a.radius(weightsA) - b.radius(weightsB));
    if (least < best.distance) best = {least, weightsA, weightsB};
  };
  for (std::size_t i = 0; i < 3; ++i) {
    if (!a.repeatsCorner(i)) {
      const auto found = finiteVertexTriangleDistance(a[i], b[0], b[1], b[2]);
      take(found.distance, cornerWeights(i), found.barycentric);
    }
    if (!b.repeatsCorner(i)) {
      const auto found = finiteVertexTriangleDistance(b[i], a[0], a[1], a[2]);
      take(found.distance, found.barycentric, cornerWeights(i));
    }
    for (std::size_t j = 0; j < 3 && a.hasEdge(i); ++j) {
      if (!b.hasEdge(j)) continue;
      const auto found = finiteEdgeEdgeDistance(a[i], a[i + 1], b[j], b[j + 1]);
      take(found.distance, edgeWeights(i, found.weightA), edgeWeights(j, found.weightB));
    }
  }
  return best;
}

/// A common point of two triangles that intersect: where an edge of one crosses the other.
std::optional<ElementDistance> crossing(const Element& a, const Element& b) {
  if (!trianglesIntersect(a[0], a[1], a[2], b[0], b[1], b[2])) return {};
  const auto edgeIn = [](const Element& edges, const Element& face, ElementDistance& found,
                         bool exchanged) {
    const Vector3d normal = (face[1] - face[0]).cross(face[2] - face[0]);
    for (std::size_t i = 0; i < 3; ++i) {
      if (!trianglesIntersect(edges[i], edges[i + 1], edges[i + 1], face[0], face[1], face[2]))
        continue;
      const double from = normal.dot(edges[i] - face[0]), to = normal.dot(edges[i + 1] - face[0]);
      const double weight = from == to ? 0.5 : std::clamp(from / (from - to), 0.0, 1.0);
      const Vector3d point = edges[i] + weight * (edges[i + 1] - edges[i]);
      const Vector3d onFace =
          finiteVertexTriangleDistance(point, face[0], face[1], face[2]).barycentric;
      found = {0.0, edgeWeights(i, weight), onFace};
      if (exchanged) std::swap(found.weightsA, found.weightsB);
      return true;
    }
    return false;
  };
  ElementDistance found;
  if (edgeIn(a, b, found, false) || edgeIn(b, a, found, true)) return found;
  return {};
}

SurfacePoint surfacePoint(const SearchableGeometry& geometry, std::uint32_t element,
                          const Vector3d& weights, double distance) {
  const Triangle& vertices = geometry.mesh.topology.triangles[element];
  Vector3d position = Vector3d::Zero();
  for (int i = 0; i < 3; ++i)
    position += weights[i] * geometry.mesh.now[vertices[static_cast<std::size_t>(i)]];
  return {geometry.id, element, vertices, weights, position, distance};
}

SurfacePoint noPoint(GeometryId id) {
  return {id, kNoElement, {}, Vector3d::Zero(), Vector3d::Zero(), kInfinity};
}

/// The map of a geometry's boxes to floats about an origin in the world.
BoxMap mapAbout(const SearchableGeometry& geometry, const Vector3d& origin) {
  if (geometry.isPlaced() || worldOrigin(geometry) == origin)
    return worldMap(geometry, origin, 0.0, false);
  const FloatFrame& frame = geometry.tree.frame();
  const Vector3d offset = (frame.origin - origin) * frame.scale;
  BoxMap map;
  map.count = 1;
  setEnd(map.ends[0], {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, {offset[0], offset[1], offset[2]}, 0.0,
         kPlacedError * frame.scale *
             (frame.origin.cwiseAbs().maxCoeff() + origin.cwiseAbs().maxCoeff()));
  return map;
}

/// The nearest pair of elements that was found so far.
class NearestPair {
 public:
  NearestPair(const SearchableGeometry& a, const SearchableGeometry& b) : m_a(a), m_b(b) {}

  void test(std::uint32_t elementA, std::uint32_t elementB) {
    const auto precedes = [&] {
      return std::pair(elementA, elementB) < std::pair(m_elementA, m_elementB);
    };
    if (m_best.distance == 0.0 && !precedes()) return;
    const Element a(m_a, elementA), b(m_b, elementB);
    if (isFurther(a, b)) return;
    ElementDistance found = elementDistance(a, b);
    if (mayCross(a, b))
      if (const auto common = crossing(a, b)) found = *common;
    if (!(found.distance < m_best.distance || (found.distance == m_best.distance && precedes())))
      return;
    m_best = found;
    m_elementA = elementA;
    m_elementB = elementB;
    m_direction = b.point(found.weightsB) - a.point(found.weightsA);
    if (const double length = m_direction.stableNorm(); length > 0) m_direction /= length;
  }

  /// L, between the elements' surfaces; infinite if there is none.
  double distance() const { return m_best.distance; }
  GeometryDistance result() const {
    return {surfacePoint(m_a, m_elementA, m_best.weightsA, m_best.distance),
            surfacePoint(m_b, m_elementB, m_best.weightsB, m_best.distance), m_best.distance};
  }

 private:
  /// Whether a plane across the direction between the nearest elements shows that these ones are
  /// further apart.
  bool isFurther(const Element& a, const Element& b) const {
    double most = -std::numeric_limits<double>::infinity(), least = -most, size = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3d fromA = a[i] - a[0], fromB = b[i] - a[0];
      most = std::max(most, m_direction.dot(fromA));
      least = std::min(least, m_direction.dot(fromB));
      size = std::max({size, fromA.cwiseAbs().maxCoeff(), fromB.cwiseAbs().maxCoeff()});
    }
    return least - most - a.largestRadius() - b.largestRadius() >
           m_best.distance + kNearestError * size;
  }
  static bool mayCross(const Element& a, const Element& b) {
    for (int k = 0; k < 3; ++k)
      if (std::min({a[0][k], a[1][k], a[2][k]}) > std::max({b[0][k], b[1][k], b[2][k]}) ||
          std::min({b[0][k], b[1][k], b[2][k]}) > std::max({a[0][k], a[1][k], a[2][k]}))
        return false;
    return true;
  }

  const SearchableGeometry &m_a, &m_b;
  ElementDistance m_best;
  std::uint32_t m_elementA = kNoElement, m_elementB = kNoElement;
  Vector3d m_direction = Vector3d::Zero();  ///< from a to b: unit, or 0 if they touch
};

/// Two elements near each other: each geometry's element nearest to a point of the other one, in
/// turn.
void startNear(const SearchableGeometry& a, const SearchableGeometry& b, NearestPair& nearest) {
  constexpr int kRounds = 4;
  std::uint32_t placeA = 0, placeB = 0;
  Vector3d point = worldOrigin(b);
  for (int round = 0; round < kRounds; ++round) {
    const auto onA = PointDistances(a, point, false).nearest(kInfinity, placeA);
    const auto onB =
        PointDistances(b, point - onA->closest.difference, false).nearest(kInfinity, placeB);
    const bool isSame = round > 0 && placeA == onA->place && placeB == onB->place;
    point -= onA->closest.difference;
    point -= onB->closest.difference;
    placeA = onA->place;
    placeB = onB->place;
    if (isSame) break;
  }
  nearest.test(a.tree.octree().order()[placeA], b.tree.octree().order()[placeB]);
}

/// Visits the elements of a geometry, nearest boxes first. bound(centre, half): a lower bound of
/// what test(element) would find in the box with this centre and these half extents, in L, in the
/// world. test returns the least distance that was found so far.
template <class Bound, class Test>
void descend(const SearchableGeometry& geometry, bool bruteForce, double best, Bound&& bound,
             Test&& test) {
  const Octree& octree = geometry.tree.octree();
  if (bruteForce) {
    for (std::uint32_t i = 0; i < geometry.mesh.topology.triangles.size(); ++i) test(i);
    return;
  }
  octree.requireBuilt();
  const Vector3d origin = worldOrigin(geometry);
  const BoxMap map = worldMap(geometry, origin, 0.0, false);
  const double unit = 1.0 / geometry.tree.frame().scale;
  const auto boundOf = [&](const FloatBox& stored) {
    const FloatBox box = map(stored);
    if (box.mayBeClamped()) return -kInfinity;
    Vector3d lower, upper;
    for (int k = 0; k < 3; ++k) {
      lower[k] = box.lower[static_cast<std::size_t>(k)];
      upper[k] = box.upper[static_cast<std::size_t>(k)];
    }
    const Vector3d half = 0.5 * unit * (upper - lower), middle = 0.5 * unit * (upper + lower);
    const Vector3d centre = middle + origin;
    return bound(centre, half) - kNearestError * (half.sum() + middle.cwiseAbs().sum()) -
           kShapeBoundError * (centre.cwiseAbs().sum() + origin.cwiseAbs().sum());
  };
  struct Entry {
    double bound;
    OctreeNode node;
  };
  std::array<Entry, 512> entries;  // seven siblings remain on each of at most 61 levels
  std::size_t count = 0;
  entries[count++] = {-kInfinity, 0};
  while (count > 0) {
    const Entry entry = entries[--count];
    if (entry.bound > best) continue;
    const auto [begin, end] = octree.ownRange(entry.node);
    for (std::uint32_t i = begin; i < end; ++i)
      if (!(boundOf(octree.boxes()[i]) > best)) best = test(octree.order()[i]);
    const OctreeNode child = octree.firstChild(entry.node);
    const std::size_t first = count;
    for (unsigned slot = 0; child != 0 && slot < 8; ++slot) {
      if (octree.isEmpty(child + slot)) continue;
      const double least = boundOf(octree.box(child + slot));
      if (least > best) continue;
      std::size_t place = count++;
      for (; place > first && entries[place - 1].bound < least; --place)
        entries[place] = entries[place - 1];
      entries[place] = {least, child + slot};
    }
  }
}

}  // namespace

GeometryDistance distanceBetween(const SearchableGeometry& a, const SearchableGeometry& b,
                                 bool bruteForce) {
  NearestPair nearest(a, b);
  const std::size_t sizeA = a.tree.ordered().size(), sizeB = b.tree.ordered().size();
  if (sizeA == 0 || sizeB == 0) return {noPoint(a.id), noPoint(b.id), kInfinity};
  if (bruteForce) {
    for (std::uint32_t i = 0; i < sizeA; ++i)
      for (std::uint32_t j = 0; j < sizeB; ++j) nearest.test(i, j);
    return nearest.result();
  }
  startNear(a, b, nearest);
  const Vector3d origin = worldOrigin(a);
  const PairSearch search{a.tree.octree(), b.tree.octree(), mapAbout(a, origin),
                          mapAbout(b, origin)};
  const double radii = a.mesh.largestRadius + b.mesh.largestRadius,
               scale = a.tree.frame().scale * (1.0 + kNearestError);
  const auto boundOf = [&] {
    return OutwardRounding::up(static_cast<float>((nearest.distance() + radii) * scale));
  };
  const auto test = [&](std::uint32_t placeA, std::uint32_t placeB) {
    nearest.test(search.a.order()[placeA], search.b.order()[placeB]);
    return boundOf();
  };
  const auto call = [](void* context, std::uint32_t placeA, std::uint32_t placeB) {
    return (*static_cast<std::remove_const_t<decltype(test)>*>(context))(placeA, placeB);
  };
  search.a.requireBuilt();
  search.b.requireBuilt();
  auto context = test;
  HWY_DYNAMIC_DISPATCH(searchPairsKernel)(search, boundOf(), &context, call);
  return nearest.result();
}

GeometryDistance distanceBetween(const SearchableGeometry& geometry, GeometryId id,
                                 const Shape& shape, bool bruteForce) {
  std::uint32_t best = kNoElement;
  NearestToShape nearest{Vector3d::Zero(), Vector3d::Zero(), kInfinity, false};
  descend(
      geometry, bruteForce, kInfinity,
      [&](const Vector3d& centre, const Vector3d& half) {
        const PointShapeDistance at = shape.signedDistance(centre);
        return std::max(0.0, at.distance - at.normal.cwiseAbs().dot(half) -
                                 geometry.mesh.largestRadius -
                                 kShapeBoundError * shape.magnitude());
      },
      [&](std::uint32_t element) {
        const Element corners(geometry, element);
        const auto take = [&](const NearestToShape& found, const Vector3d& weights) {
          const double distance = std::max(0.0, found.distance - corners.radius(weights));
          if (!(distance < nearest.distance || (distance == nearest.distance && element < best)))
            return;
          best = element;
          nearest = found;
          nearest.weights = weights;
          nearest.distance = distance;
        };
        for (std::size_t i = 0; i < 3; ++i) {
          if (!corners.hasEdge(i)) continue;
          const NearestToShape found = shape.nearestOfEdge(corners[i], corners[i + 1]);
          take(found, edgeWeights(i, found.weights[1]));
        }
        if (corners.isPoint()) {
          const PointShapeDistance at = shape.signedDistance(corners[0]);
          take({Vector3d::UnitX(), at.normal, at.distance, false}, cornerWeights(0));
        }
        if (geometry.mesh.topology.hasFaces())
          if (const auto found = shape.nearestInTriangle(corners[0], corners[1], corners[2]))
            take(*found, found->weights);
        return nearest.distance;
      });
  if (best == kNoElement) return {noPoint(geometry.id), noPoint(id), kInfinity};
  GeometryDistance out{surfacePoint(geometry, best, nearest.weights, nearest.distance), noPoint(id),
                       nearest.distance};
  out.b.distance = nearest.distance;
  // The witness of a common point is the element's point, which the shape holds.
  const PointShapeDistance at = shape.signedDistance(out.a.position);
  out.b.position =
      at.distance > 0.0 ? Vector3d(out.a.position - at.distance * at.normal) : out.a.position;
  return out;
}

SegmentDistance distanceFromSegment(const SearchableGeometry& geometry, const Vector3d& p,
                                    const Vector3d& q, double maxDistance, bool bruteForce) {
  ElementDistance best;
  best.distance = maxDistance;
  std::uint32_t nearest = kNoElement;
  const Element segment(p, q);
  descend(
      geometry, bruteForce, maxDistance,
      [&](const Vector3d& centre, const Vector3d& half) {
        return finiteVertexTriangleDistance(centre, p, q, q).distance - half.norm() -
               geometry.mesh.largestRadius;
      },
      [&](std::uint32_t element) {
        const Element other(geometry, element);
        ElementDistance found = elementDistance(segment, other);
        if (const auto common = crossing(segment, other)) found = *common;
        if (found.distance < best.distance ||
            (found.distance == best.distance && element < nearest)) {
          best = found;
          nearest = element;
        }
        return best.distance;
      });
  if (nearest == kNoElement) return {0.0, noPoint(geometry.id)};
  return {best.weightsA[1] + best.weightsA[2],
          surfacePoint(geometry, nearest, best.weightsB, best.distance)};
}

}  // namespace palpate
#endif
