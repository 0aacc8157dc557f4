#include "Queries/GeometryDistances.h"

#include "Queries/ElementDistance.h"
#include "Queries/PairTraversal.h"
#include "Queries/PointDistances.h"
#include "Octree/BoxMap.h"
#include "Math/ClosestPoint.h"
#include "Math/ConvexMinimum.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace palpate {

using Eigen::Vector3d;

namespace {

SurfacePoint surfacePoint(const Body& geometry, std::uint32_t element, const Vector3d& weights,
                          double distance) {
  const Triangle& vertices = geometry.mesh.topology.triangles[element];
  Vector3d position = Vector3d::Zero();
  for (int i = 0; i < 3; ++i)
    position += weights[i] * geometry.mesh.now[vertices[static_cast<std::size_t>(i)]];
  return {geometry.id, element, vertices, weights, position, distance};
}

SurfacePoint noPoint(GeometryId id) {
  return {id, kNoElement, {}, Vector3d::Zero(), Vector3d::Zero(), kInfinity};
}

Eigen::Matrix3d rotationOf(const Body& geometry) {
  return geometry.isPlaced() ? geometry.mesh.now.transform().rotation
                             : Eigen::Matrix3d::Identity().eval();
}

/// The sum of the coordinates that positions in the world come from.
double magnitudeOf(const Body& geometry) {
  return worldOrigin(geometry).cwiseAbs().sum() + geometry.tree.frame().origin.cwiseAbs().sum();
}

float up(double value) { return OutwardRounding::up(static_cast<float>(value)); }

/// A direction in the frame of a geometry's floats.
std::array<float, 3> inFloats(const Body& geometry, const Vector3d& direction) {
  const Vector3d inBody = rotationOf(geometry).transpose() * direction;
  return {static_cast<float>(inBody[0]), static_cast<float>(inBody[1]),
          static_cast<float>(inBody[2])};
}

/// Bounds the error of heights in a geometry's floats, and of their offset. Positions and direction
/// are off by 2^-24 along each axis, and there are four more roundings.
double heightsErrorOf(const Body& geometry) {
  const FloatBox root = geometry.tree.octree().box(0);
  if (root.mayBeClamped()) return kInfinity;
  float largest = 0;
  for (std::size_t k = 0; k < 3; ++k)
    largest = std::max({largest, std::abs(root.lower[k]), std::abs(root.upper[k])});
  return 2.0 * kFloatPointError * largest + OutwardRounding::kAbsolute +
         kNearestError * geometry.tree.frame().scale * magnitudeOf(geometry);
}

double sizeOf(const FloatBox& box) {
  double size = 0;
  for (std::size_t k = 0; k < 3; ++k) size += double{box.upper[k]} - box.lower[k];
  return size;
}

}  // namespace

BoxMap mapBetween(const Body& a, const Body& b, const Vector3d& shift) {
  BoxMap map;
  const double scale = a.tree.frame().scale;
  const Eigen::Matrix3d toA = rotationOf(a).transpose(), rotation = toA * rotationOf(b);
  const Vector3d offset = toA * ((worldOrigin(b) - worldOrigin(a)) - shift) * scale;
  std::array<std::array<double, 3>, 3> matrix;
  for (int k = 0; k < 3; ++k)
    for (int j = 0; j < 3; ++j) matrix[k][j] = rotation(k, j);
  setEnd(map.ends[0], matrix, {offset[0], offset[1], offset[2]}, 0.0,
         4 * kPlacedError * scale * (magnitudeOf(a) + magnitudeOf(b) + shift.cwiseAbs().sum()));
  map.count = 1;
  return map;
}

PairSide sideOf(const Body& geometry, const BoxMap& map) {
  return {geometry.tree.octree(), geometry.tree.floats(), geometry.tree.ordered().data(), map};
}

double boxErrorOf(const Body& a, const Body& b) {
  return 4 * kOrthonormal * (sizeOf(a.tree.octree().box(0)) + sizeOf(b.tree.octree().box(0)));
}

namespace {

/// The nearest pair of elements that was found so far.
class NearestPair {
 public:
  NearestPair(const Body& a, const Body& b)
      : m_a(a), m_b(b), m_radii(a.mesh.largestRadius + b.mesh.largestRadius) {}

  /// Tests the elements at two places of the octrees' orders.
  void test(std::uint32_t placeA, std::uint32_t placeB) {
    test(placeA, elementOf(m_a, placeA), placeB, elementOf(m_b, placeB));
  }
  /// Tests pairs of elements.
  void test(const NearElements& elements) {
    if (m_lowestA.empty() &&
        m_tests > kTestsPerElement * (m_a.tree.ordered().size() + m_b.tree.ordered().size())) {
      m_lowestA = lowestOfCoincident(m_a);
      m_lowestB = lowestOfCoincident(m_b);
      findVertices();
    }
    std::array<Element, NearElements::kSide> all;
    std::uint32_t read = 0;
    for (std::uint32_t i = 0; i < NearElements::kSide; ++i) {
      if (elements.near[i] == 0) continue;
      m_tests += kTestsPerPairs;
      if (!m_lowestA.empty() && !m_lowestA[elements.placeA + i]) continue;
      const Element a = elementOf(m_a, elements.placeA + i);
      for (std::uint32_t bits = elements.near[i]; bits; bits &= bits - 1) {
        const auto j = static_cast<std::uint32_t>(std::countr_zero(bits));
        if (!m_lowestB.empty() && !m_lowestB[elements.placeB + j]) continue;
        if (!(read >> j & 1)) all[j] = elementOf(m_b, elements.placeB + j);
        read |= 1u << j;
        test(elements.placeA + i, a, elements.placeB + j, all[j]);
      }
    }
  }

  /// L, between the elements' surfaces; infinite if there is none.
  double distance() const { return m_best.distance; }
  /// From a to b: unit, or 0.
  const Vector3d& direction() const { return m_direction; }
  GeometryDistance result() const {
    return {surfacePoint(m_a, m_elementA, m_best.weightsA, m_best.distance),
            surfacePoint(m_b, m_elementB, m_best.weightsB, m_best.distance), m_best.distance};
  }

 private:
  /// After so many tests of pairs for each element, elements that coincide with a lower one are
  /// skipped: they are equally near, and the lower one counts. To find them costs about one test
  /// for each element.
  static constexpr double kTestsPerElement = 4.0;
  /// A row of pairs of boxes costs some hundredth of a test.
  static constexpr double kTestsPerPairs = 0x1p-6;

  /// By place: whether no lower element has the same corners and radii.
  static std::vector<std::uint8_t> lowestOfCoincident(const Body& geometry) {
    using Key = std::array<std::array<double, 4>, 3>;  // positions and radius of the corners
    std::vector<std::pair<Key, std::uint32_t>> keys;
    const auto& ordered = geometry.tree.ordered();
    const auto& order = geometry.tree.octree().order();
    for (std::uint32_t place = 0; place < ordered.size(); ++place) {
      Key key;
      for (std::size_t i = 0; i < 3; ++i) {
        const Vector3d p = geometry.mesh.now[ordered[place][i]];
        key[i] = {p[0], p[1], p[2], geometry.mesh.radius(ordered[place][i])};
      }
      // The order of a triangle's corners changes no distance.
      if (geometry.mesh.topology.hasFaces()) std::sort(key.begin(), key.end());
      keys.emplace_back(key, place);
    }
    std::sort(keys.begin(), keys.end(), [&](const auto& l, const auto& r) {
      return l.first < r.first || (l.first == r.first && order[l.second] < order[r.second]);
    });
    std::vector<std::uint8_t> lowest(keys.size(), 1);
    for (std::size_t i = 1; i < keys.size(); ++i)
      lowest[keys[i].second] = keys[i].first != keys[i - 1].first;
    return lowest;
  }

  /// Whether an element has a corner at the vertex of the nearest pair, and lies behind the plane
  /// through it across the way to the other vertex, decided exactly. Two such elements are as near
  /// as the vertices are. place: in the octree's order.
  struct AtVertex {
    std::optional<Vector3d> at{};
    enum class Answer : std::uint8_t { Unknown, No, Yes };
    std::vector<Answer> known{};  ///< by place

    bool holds(std::uint32_t place, const Body& geometry, const Vector3d& other) {
      if (known[place] == Answer::Unknown) {
        const Triangle& corners = geometry.tree.ordered()[place];
        const bool isBehind = cornerAt(geometry, place, *at) < 3 &&
                              std::none_of(corners.begin(), corners.end(), [&](std::uint32_t v) {
                                const Vector3d corner = geometry.mesh.now[v];
                                return corner != *at && comesNearer(other, *at, corner);
                              });
        known[place] = isBehind ? Answer::Yes : Answer::No;
      }
      return known[place] == Answer::Yes;
    }
  };
  /// The first corner of an element at this position; 3: none.
  static Eigen::Index cornerAt(const Body& geometry, std::uint32_t place, const Vector3d& at) {
    const Triangle& corners = geometry.tree.ordered()[place];
    return std::find_if(corners.begin(), corners.end(),
                        [&](std::uint32_t v) { return geometry.mesh.now[v] == at; }) -
           corners.begin();
  }
  /// Sets the vertices of the nearest pair, if its points are vertices without radii.
  void findVertices() {
    if (m_lowestA.empty() || m_radii > 0.0 || !std::isfinite(m_best.distance)) return;
    const auto set = [](AtVertex& side, const Body& geometry, std::uint32_t element,
                        const Vector3d& weights) {
      Eigen::Index corner = 0;
      const bool isVertex = weights.maxCoeff(&corner) == 1.0;
      std::optional<Vector3d> at;
      if (isVertex)
        at = geometry.mesh
                 .now[geometry.mesh.topology.triangles[element][static_cast<std::size_t>(corner)]];
      return std::exchange(side.at, at) != at;
    };
    const bool a = set(m_atA, m_a, m_elementA, m_best.weightsA),
               b = set(m_atB, m_b, m_elementB, m_best.weightsB);
    if (!a && !b) return;
    m_atA.known.assign(m_a.tree.ordered().size(), AtVertex::Answer::Unknown);
    m_atB.known.assign(m_b.tree.ordered().size(), AtVertex::Answer::Unknown);
  }
  bool areAtVertices(std::uint32_t placeA, std::uint32_t placeB) {
    return m_atA.at && m_atB.at && m_atA.holds(placeA, m_a, *m_atB.at) &&
           m_atB.holds(placeB, m_b, *m_atA.at);
  }

  static Element elementOf(const Body& geometry, std::uint32_t place) {
    return {geometry.mesh, geometry.tree.ordered()[place]};
  }
  void test(std::uint32_t placeA, const Element& a, std::uint32_t placeB, const Element& b) {
    const std::uint32_t elementA = m_a.tree.octree().order()[placeA],
                        elementB = m_b.tree.octree().order()[placeB];
    const auto precedes = [&] {
      return std::pair(elementA, elementB) < std::pair(m_elementA, m_elementB);
    };
    if (m_best.distance == 0.0 && !precedes()) return;
    if (areAtVertices(placeA, placeB)) {
      if (!precedes()) return;
      m_best.weightsA = Vector3d::Unit(cornerAt(m_a, placeA, *m_atA.at));
      m_best.weightsB = Vector3d::Unit(cornerAt(m_b, placeB, *m_atB.at));
      m_elementA = elementA;
      m_elementB = elementB;
      return;
    }
    if (isFurther(a, b)) return;
    ++m_tests;
    const ElementDistance found = elementDistance(a, b);
    if (!(found.distance < m_best.distance || (found.distance == m_best.distance && precedes())))
      return;
    m_best = found;
    m_elementA = elementA;
    m_elementB = elementB;
    findVertices();
    m_direction = b.point(found.weightsB) - a.point(found.weightsA);
    const double length = stableLength(m_direction);
    if (length > 0 && std::isfinite(length))
      m_direction /= length;
    else
      m_direction.setZero();
  }

  /// Whether a plane between the elements shows that they are further apart than the nearest ones.
  /// The first plane is across the direction of the nearest ones. Each further one is across a
  /// shorter difference of the elements' points.
  /// Source   Gilbert, An iterative procedure for computing the minimum of a quadratic form (1966).
  bool isFurther(const Element& a, const Element& b) const {
    constexpr int kMostPlanes = 5;
    double size = 0;
    for (std::size_t i = 0; i < 3; ++i)
      size = std::max(
          {size, (a[i] - a[0]).cwiseAbs().maxCoeff(), (b[i] - a[0]).cwiseAbs().maxCoeff()});
    const double needed = m_best.distance + m_radii + kNearestError * size;
    Vector3d normal = ((b[0] - a[0]) + (b[1] - a[1])) + (b[2] - a[2]),
             difference = Vector3d::Zero();
    for (int plane = 0; plane < kMostPlanes; ++plane) {
      const Vector3d nearest = b.furthest(-normal) - a.furthest(normal);
      const double length = normal.norm();
      if (length > kShortestDirection && normal.dot(nearest) > needed * length) return true;
      const Vector3d change = nearest - difference;
      const double square = change.squaredNorm();
      if (plane == 0)
        difference = nearest;
      else if (square > 0)
        difference += std::clamp(-difference.dot(change) / square, 0.0, 1.0) * change;
      normal = difference;
    }
    return false;
  }

  const Body &m_a, &m_b;
  const double m_radii;  ///< L: the largest ones of both
  double m_tests = 0;
  std::vector<std::uint8_t> m_lowestA, m_lowestB;  ///< by place; empty: all are tested
  AtVertex m_atA, m_atB;
  ElementDistance m_best;
  std::uint32_t m_elementA = kNoElement, m_elementB = kNoElement;
  Vector3d m_direction = Vector3d::Zero();  ///< from a to b: unit, or 0
};

/// Two elements near each other: each geometry's element nearest to a point of the other one, in
/// turn.
void startNear(const Body& a, const Body& b, NearestPair& nearest) {
  constexpr int kRounds = 4;
  std::uint32_t placeA = 0, placeB = 0;
  Vector3d point = worldOrigin(b);
  for (int round = 0; round < kRounds; ++round) {
    const auto onA = PointDistances(a, point, false).nearest(kInfinity, placeA);
    const auto onB =
        onA ? PointDistances(b, point - onA->closest.difference, false).nearest(kInfinity, placeB)
            : std::nullopt;
    if (!onA || !onB) break;  // beyond double's range
    const bool isSame = round > 0 && placeA == onA->place && placeB == onB->place;
    point -= onA->closest.difference;
    point -= onB->closest.difference;
    placeA = onA->place;
    placeB = onB->place;
    if (isSame) break;
  }
  nearest.test(placeA, placeB);
}

/// Visits the elements of a geometry, nearest boxes first. bound(centre, half): a lower bound of
/// what test(element) would find in the box with this centre and these half extents, in L, in the
/// world. test returns the least distance that was found so far.
template <class Bound, class Test>
void descend(const Body& geometry, bool bruteForce, double best, Bound&& bound, Test&& test) {
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
  for (NearestWalk<double> walk(octree, -kInfinity); walk.next(best);) {
    for (std::uint32_t i = walk.begin(); i < walk.end(); ++i)
      if (!(boundOf(octree.boxes()[i]) > best)) best = test(octree.order()[i]);
    walk.forEachChild([&](OctreeNode child) {
      const double least = boundOf(octree.box(child));
      if (!(least > best)) walk.enter(child, least);
    });
  }
}

/// The centre of the ball of a tapered segment that is nearest to a shape.
NearestToShape nearestBallTo(const Shape& shape, const Element& segment) {
  const auto at = [&](double t) {
    return shape.signedDistance((1.0 - t) * segment[0] + t * segment[1]);
  };
  const double start = segment.radius(std::size_t{0}),
               change = segment.radius(std::size_t{1}) - start;
  const Vector3d along = segment[1] - segment[0];
  const Tangent least = leastTangent([&](double t) -> Tangent {
    const PointShapeDistance centre = at(t);
    return {t, centre.distance - (start + t * change), centre.normal.dot(along) - change};
  });
  const PointShapeDistance nearest = at(least.at);
  return {edgeWeights(0, least.at), nearest.normal, nearest.distance, false};
}

}  // namespace

GeometryDistance distanceBetween(const Body& a, const Body& b, bool bruteForce,
                                 std::unique_ptr<PairScratch>& scratch) {
  NearestPair nearest(a, b);
  const std::size_t sizeA = a.tree.ordered().size(), sizeB = b.tree.ordered().size();
  if (sizeA == 0 || sizeB == 0) return {noPoint(a.id), noPoint(b.id), kInfinity};
  if (bruteForce) {
    for (std::uint32_t i = 0; i < sizeA; ++i)
      for (std::uint32_t j = 0; j < sizeB; ++j) nearest.test(i, j);
    return nearest.result();
  }
  startNear(a, b, nearest);
  const PairSide sideA = sideOf(a, {}), sideB = sideOf(b, mapBetween(a, b));
  const Vector3d offset = worldOrigin(b) - worldOrigin(a);
  // The error covers that of computed distances. If positions are clamped to the floats' range, it
  // is so large that no pair of boxes is skipped.
  const double radii = a.mesh.largestRadius + b.mesh.largestRadius, scale = a.tree.frame().scale,
               error = boxErrorOf(a, b), heightsError = heightsErrorOf(a) + heightsErrorOf(b);
  const auto boundOf = [&] {
    const double distance = (nearest.distance() + radii) * scale * (1.0 + 4 * kOrthonormal) + error;
    PairBound bound{up(distance)};
    const Vector3d& direction = nearest.direction();
    // Without radii, the direction between two points that meet is no more than rounding.
    if (direction == Vector3d::Zero() || nearest.distance() + radii == 0.0) return bound;
    bound.heights = up(distance - direction.dot(offset) * scale + heightsError);
    bound.alongA = inFloats(a, -direction);
    bound.alongB = inFloats(b, direction);
    return bound;
  };
  if (!scratch) scratch = std::make_unique<PairScratch>();
  forNearElements(sideA, sideB, boundOf(), *scratch, [&](const NearElements& elements) {
    nearest.test(elements);
    return boundOf();
  });
  return nearest.result();
}

GeometryDistance distanceBetween(const Body& geometry, GeometryId id, const Shape& shape,
                                 bool bruteForce) {
  if (geometry.tree.ordered().empty()) return {noPoint(geometry.id), noPoint(id), kInfinity};
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
        const Element corners(geometry.mesh, geometry.mesh.topology.triangles[element]);
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
          const NearestToShape found = corners.isTapered()
                                           ? nearestBallTo(shape, corners)
                                           : shape.nearestOfEdge(corners[i], corners[i + 1]);
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
  GeometryDistance out{surfacePoint(geometry, best, nearest.weights, nearest.distance), noPoint(id),
                       nearest.distance};
  out.b.distance = nearest.distance;
  // The witness of a common point is the element's point, which the shape holds.
  const PointShapeDistance at = shape.signedDistance(out.a.position);
  out.b.position =
      at.distance > 0.0 ? Vector3d(out.a.position - at.distance * at.normal) : out.a.position;
  return out;
}

namespace {

/// A common point of two shapes that overlap: each in turn moves the point to its own nearest one.
Vector3d commonPoint(const Shape& a, const Shape& b, Vector3d point) {
  constexpr int kMostSteps = 1000;  // usually one
  const double tolerance = kOnSurface * (a.magnitude() + b.magnitude());
  bool isCommon = false;
  for (int step = 0; step < kMostSteps && !isCommon; ++step) {
    isCommon = true;
    for (const Shape* shape : {&a, &b}) {
      const PointShapeDistance at = shape->signedDistance(point);
      if (!(at.distance > tolerance)) continue;
      point -= at.distance * at.normal;
      isCommon = false;
    }
  }
  return point;
}

}  // namespace

GeometryDistance distanceBetween(GeometryId idA, const Shape& a, GeometryId idB, const Shape& b,
                                 ShapePairScratch& scratch) {
  const ShapePairDistance found = a.distanceFrom(b, scratch);
  GeometryDistance out{noPoint(idA), noPoint(idB), std::max(0.0, found.distance)};
  out.a.distance = out.b.distance = out.distance;
  out.a.position = found.pointA;
  out.b.position = found.pointB;
  if (found.distance <= 0.0) out.a.position = out.b.position = commonPoint(a, b, found.pointA);
  return out;
}

SegmentDistance distanceFromSegment(const Body& geometry, const Vector3d& p, const Vector3d& q,
                                    double maxDistance, bool bruteForce) {
  ElementDistance best;
  best.distance = maxDistance;
  std::uint32_t nearest = kNoElement;
  const Element segment(p, q);
  descend(
      geometry, bruteForce, maxDistance,
      [&](const Vector3d& centre, const Vector3d& half) {
        return finiteVertexTriangleDistance(centre, p, q, q).distance - half.norm() -
               geometry.mesh.largestRadius -
               kNearestError * ((centre - p).cwiseAbs().sum() + (centre - q).cwiseAbs().sum());
      },
      [&](std::uint32_t element) {
        const Element other(geometry.mesh, geometry.mesh.topology.triangles[element]);
        const ElementDistance found = elementDistance(segment, other);
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
