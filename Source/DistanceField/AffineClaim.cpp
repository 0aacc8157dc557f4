#include "DistanceField/AffineClaim.h"

#include "Octree/Walk.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <bit>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "DistanceField/AffineClaim.cpp"
#include "Core/Simd.h"
#include "Math/TriangleLanes.h"

#ifndef PALPATE_AFFINE_CLAIM_CPP
#define PALPATE_AFFINE_CLAIM_CPP
namespace palpate {

/// What a search needs besides the claim.
struct ClaimSearch {
  const Octree& octree;
  const Triangle* ordered;
  const Eigen::Vector3d* positions;
  const FloatFrame& frame;
};

}  // namespace palpate
#endif

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
namespace affine_claim {

using SetTag = hn::CappedTag<double, 8>;  ///< up to eight boxes or triangles
using V = hn::Vec<SetTag>;
using Mask = hn::Mask<SetTag>;
using Triangles = TrianglesInLanes<SetTag>;
using Vectors = Triangles::Vectors;

HWY_ATTR HWY_INLINE Vectors absolute(const Vectors& a) {
  return {hn::Abs(a.x), hn::Abs(a.y), hn::Abs(a.z)};
}
HWY_ATTR HWY_INLINE V sumOfMagnitudes(const Vectors& a) {
  return (hn::Abs(a.x) + hn::Abs(a.y)) + hn::Abs(a.z);
}
HWY_ATTR HWY_INLINE Vectors spread(const std::array<double, 3>& a) {
  const SetTag d;
  return {hn::Set(d, a[0]), hn::Set(d, a[1]), hn::Set(d, a[2])};
}
/// Of length 1. NaN for a vector without a direction; comparisons with it are false.
HWY_ATTR HWY_INLINE Vectors normalized(const Vectors& a) {
  const SetTag d;
  const V square = dot(a, a);
  const V length =
      hn::IfThenElseZero(hn::Gt(square, hn::Set(d, kShortestDirection)), hn::Sqrt(square));
  const V nan = hn::Zero(d) / hn::Zero(d);
  const V inverse = hn::IfThenElse(hn::Gt(length, hn::Zero(d)), hn::Set(d, 1.0) / length, nan);
  return inverse * a;
}

// Convex sets relative to the centre of the cell. along(w): the largest component along w.

struct BoxesInLanes {
  Vectors middle, halfSides;

  HWY_ATTR HWY_INLINE V along(const Vectors& w) const {
    return dot(w, middle) + dot(absolute(w), halfSides);
  }
};

/// A side of the claim, the same in each lane.
class SideInLanes {
 public:
  HWY_ATTR HWY_INLINE SideInLanes(const AffineClaim& claim, const AffineClaim::Side& side)
      : m_normal(spread(side.normal)),
        m_halfSide(hn::Set(d, claim.halfSide)),
        m_atCentre(hn::Set(d, side.atCentre)),
        m_level(hn::Set(d, claim.level)),
        m_error(hn::Set(d, claim.error)) {}

  /// Whether the set is where the claim needs nothing of it: H is below the level.
  template <class Set>
  HWY_ATTR HWY_INLINE Mask isBelow(const Set& set) const {
    return hn::Lt(set.along(m_normal) + m_atCentre, m_level - m_error);
  }
  template <class Set>
  HWY_ATTR HWY_INLINE Mask meetsLevel(const Set& set) const {
    const Vectors down{hn::Neg(m_normal.x), hn::Neg(m_normal.y), hn::Neg(m_normal.z)};
    return hn::Le(m_atCentre - set.along(down), m_level + m_error);
  }
  /// Whether all points of the set have a distance of at least H(x) - level from each point x of
  /// the cell. For any unit vector w the distance of x and y is at least w (x - y). The best w
  /// leads from y to the point of the cell where the distance less H is least. way: w times any
  /// length, by which both sides are multiplied.
  template <class Set>
  HWY_ATTR HWY_INLINE Mask isFar(const Set& set, const Vectors& way) const {
    const V square = dot(way, way), length = hn::Sqrt(square);
    const V least = hn::Neg(m_halfSide * sumOfMagnitudes(way - length * m_normal)) -
                    m_atCentre * length - set.along(way);
    return hn::And(hn::Gt(square, hn::Set(d, kShortestDirection)),
                   hn::Ge(least, (m_error - m_level) * length));
  }
  HWY_ATTR HWY_INLINE Vectors wayFrom(const Vectors& point) const {
    const Vectors above = point - dot(m_normal, point) * m_normal;
    const V low = hn::Neg(m_halfSide);
    const Vectors nearest{hn::Min(hn::Max(above.x, low), m_halfSide),
                          hn::Min(hn::Max(above.y, low), m_halfSide),
                          hn::Min(hn::Max(above.z, low), m_halfSide)};
    return nearest - point;
  }
  /// Whether the set is beside the cell's shadow along the normal: separated by a direction across
  /// the normal and an axis.
  HWY_ATTR HWY_INLINE Mask isBeside(const BoxesInLanes& set) const {
    const V zero = hn::Zero(d);
    const auto [x, y, z] = m_normal;
    return hn::Or(
        isBeside(set, {zero, z, hn::Neg(y)}),
        hn::Or(isBeside(set, {hn::Neg(z), zero, x}), isBeside(set, {y, hn::Neg(x), zero})));
  }
  /// Only the part of a triangle near the plane H = level counts: a thin polygon.
  HWY_ATTR HWY_INLINE Mask isBeside(const Triangles& set) const {
    const V zero = hn::Zero(d), one = hn::Set(d, 1.0);
    const Vectors corners[3] = {set.a, set.b, set.c};
    Vectors points[6];
    Mask isPart[3];
    for (int i = 0; i < 3; ++i) {
      const Vectors &p = corners[i], edge = corners[(i + 1) % 3] - p;
      const V start = dot(m_normal, p) + m_atCentre - m_level,
              rise = dot(m_normal, corners[(i + 1) % 3]) + m_atCentre - m_level - start;
      // The edge's points p + t edge with |start + t rise| <= error.
      const Mask isFlat = hn::Eq(rise, zero);
      const V first = (hn::Neg(m_error) - start) / rise, second = (m_error - start) / rise;
      const V low = hn::IfThenElse(isFlat, zero, hn::Max(zero, hn::Min(first, second)));
      const V high = hn::IfThenElse(isFlat, one, hn::Min(one, hn::Max(first, second)));
      isPart[i] =
          hn::And(hn::Le(low, high), hn::Or(hn::Not(isFlat), hn::Le(hn::Abs(start), m_error)));
      points[2 * i] = p + low * edge;
      points[2 * i + 1] = p + high * edge;
    }
    const auto isApart = [&](const Vectors& across) HWY_ATTR {
      const V infinite = hn::Set(d, std::numeric_limits<double>::infinity());
      V least = infinite, most = hn::Neg(infinite);
      for (int i = 0; i < 6; ++i) {
        const V along = dot(across, points[i]);
        least = hn::IfThenElse(isPart[i / 2], hn::Min(least, along), least);
        most = hn::IfThenElse(isPart[i / 2], hn::Max(most, along), most);
      }
      const V reach = m_halfSide * sumOfMagnitudes(across) + m_error;
      return hn::Or(hn::Gt(least, reach), hn::Lt(most, hn::Neg(reach)));
    };
    const auto [x, y, z] = m_normal;
    const Mask faces =
        hn::Or(isApart({zero, z, hn::Neg(y)}),
               hn::Or(isApart({hn::Neg(z), zero, x}), isApart({y, hn::Neg(x), zero})));
    const Vectors up = normalized(cross(set.b - set.a, set.c - set.a));
    return hn::Or(faces, isApart(up - dot(m_normal, up) * m_normal));
  }

 private:
  HWY_ATTR HWY_INLINE Mask isBeside(const BoxesInLanes& set, const Vectors& across) const {
    const V most = m_halfSide * sumOfMagnitudes(across) + m_error;
    const V middle = dot(across, set.middle), half = dot(absolute(across), set.halfSides);
    return hn::Gt(hn::Abs(middle) - half, most);
  }

  static constexpr SetTag d{};
  const Vectors m_normal;
  const V m_halfSide, m_atCentre, m_level, m_error;
};

/// One descent of the octree.
class ClaimProof {
 public:
  HWY_ATTR ClaimProof(const AffineClaim& claim, const ClaimSearch& search)
      : m_claim(claim), m_search(search) {}

  HWY_ATTR bool run() {
    if (!entered(m_search.octree.blocks()[0], 0, 1)) return true;
    for (Walk walk(m_search.octree); walk.next();) {
      if (!addElements(walk.begin(), walk.end())) return false;
      if (walk.hasChildren()) walk.enter(entered(walk.children(), 0, kChildren));
    }
    return m_count == 0 || test();
  }

 private:
  static constexpr std::size_t kBatch = 8;

  HWY_ATTR bool addElements(std::uint32_t begin, std::uint32_t end) {
    const BoxArrays& boxes = m_search.octree.boxes();
    for (std::uint32_t i = begin; i < end; i += 8)
      for (std::uint32_t bits = entered(boxes, i, std::min(end - i, 8u)); bits != 0;
           bits &= bits - 1) {
        const auto lane = static_cast<std::uint32_t>(std::countr_zero(bits));
        add(i + lane);
        if (m_count == kBatch && !test()) return false;
      }
    return true;
  }
  HWY_ATTR HWY_INLINE void add(std::uint32_t place) {
    const Triangle& triangle = m_search.ordered[place];
    const FloatFrame& frame = m_search.frame;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const double* const position = m_search.positions[triangle[corner]].data();
      for (int k = 0; k < 3; ++k)
        m_corners[corner][k][m_count] =
            (position[k] - frame.origin.data()[k]) * frame.scale - m_claim.centre[k];
    }
    ++m_count;
  }

  /// The boxes from the i-th on that may hold triangles that do not allow the claim, as bits.
  template <class Boxes>
  HWY_ATTR HWY_INLINE std::uint32_t entered(const Boxes& boxes, std::size_t i,
                                            std::uint32_t count) const {
    std::uint32_t bits = 0;
    for (std::uint32_t lane = 0; lane < count; lane += static_cast<std::uint32_t>(hn::Lanes(d)))
      bits |= enteredLanes(boxes, i + lane) << lane;
    return bits & ((1u << count) - 1);
  }
  template <class Boxes>
  HWY_ATTR HWY_INLINE std::uint32_t enteredLanes(const Boxes& boxes, std::size_t i) const {
    const hn::Rebind<float, SetTag> df;
    const V half = hn::Set(d, 0.5), largest = hn::Set(d, double{kLargestFloat}), zero = hn::Zero(d);
    BoxesInLanes set;
    V square = zero;
    Mask isMoved = hn::Lt(zero, zero), isFilled = isMoved;
    const auto take = [&](int k, V& middle, V& halfSide) HWY_ATTR {
      const V low = hn::PromoteTo(d, hn::LoadU(df, &boxes.lower[k][i])),
              high = hn::PromoteTo(d, hn::LoadU(df, &boxes.upper[k][i]));
      if (k == 0) isFilled = hn::Le(low, high);
      isMoved = hn::Or(isMoved, hn::Or(hn::Le(low, hn::Neg(largest)), hn::Ge(high, largest)));
      const V centre = hn::Set(d, m_claim.centre[k]);
      const V lower = low - centre, upper = high - centre;
      middle = half * (lower + upper);
      halfSide = half * (upper - lower);
      const V outside = hn::Max(hn::Max(lower, hn::Neg(upper)), zero);
      square = square + outside * outside;
    };
    take(0, set.middle.x, set.halfSides.x);
    take(1, set.middle.y, set.halfSides.y);
    take(2, set.middle.z, set.halfSides.z);
    const Mask isNear = hn::Le(square, hn::Set(d, m_claim.reach * m_claim.reach));
    Mask isEntered = hn::Lt(zero, zero);
    for (const AffineClaim::Side& side : m_claim.sides) {
      if (!side.isWanted || hn::AllFalse(d, isNear)) continue;
      const SideInLanes lanes(m_claim, side);
      const Mask isOpen = hn::AndNot(lanes.isBelow(set), isNear);
      if (hn::AllFalse(d, isOpen)) continue;
      if (side.needsCrossing) {
        const Mask meets = hn::And(isOpen, lanes.meetsLevel(set));
        if (!hn::AllFalse(d, meets))
          isEntered = hn::Or(isEntered, hn::AndNot(lanes.isBeside(set), meets));
      }
      if (side.needsDistance)
        isEntered =
            hn::Or(isEntered, hn::AndNot(lanes.isFar(set, lanes.wayFrom(set.middle)), isOpen));
    }
    // Boxes with coordinates that were clamped say nothing.
    isEntered = hn::And(isFilled, hn::Or(isEntered, isMoved));
    return bitsOf(d, isEntered);
  }

  /// Whether the triangles of the batch allow the claim. Empties it.
  HWY_ATTR bool test() {
    const std::size_t count = m_count;
    m_count = 0;
    for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
      const Triangles set = Triangles::load(m_corners, i);
      const Mask isUsed = hn::FirstN(d, count - i);
      for (const AffineClaim::Side& side : m_claim.sides)
        if (side.isWanted && !isAllowed(set, isUsed, side)) return false;
    }
    return true;
  }
  HWY_ATTR bool isAllowed(const Triangles& set, const Mask& isUsed,
                          const AffineClaim::Side& side) const {
    const SideInLanes lanes(m_claim, side);
    const Mask isBelow = lanes.isBelow(set);
    if (side.needsDistance) {
      Mask open = hn::AndNot(isBelow, isUsed);
      const auto closes = [&](const Vectors& w) HWY_ATTR {
        open = hn::AndNot(lanes.isFar(set, w), open);
        return hn::AllFalse(d, open);
      };
      const auto isFar = [&]() HWY_ATTR {
        if (hn::AllFalse(d, open)) return true;
        const V third = hn::Set(d, 1.0 / 3.0);
        if (closes(lanes.wayFrom(third * (set.a + set.b + set.c)))) return true;
        const Vectors normal = cross(set.b - set.a, set.c - set.a);
        if (closes(normal) || closes({hn::Neg(normal.x), hn::Neg(normal.y), hn::Neg(normal.z)}))
          return true;
        return closes(lanes.wayFrom(set.nearest()));
      };
      if (!isFar()) return false;
    }
    if (!side.needsCrossing) return true;
    const Mask meets = hn::AndNot(isBelow, hn::And(isUsed, lanes.meetsLevel(set)));
    return hn::AllFalse(d, meets) || hn::AllFalse(d, hn::AndNot(lanes.isBeside(set), meets));
  }

  static constexpr SetTag d{};
  const AffineClaim& m_claim;
  const ClaimSearch& m_search;
  std::size_t m_count = 0;
  alignas(64) double m_corners[3][3][kBatch] = {};  ///< corner, axis, triangle
};

HWY_ATTR bool proveClaimKernel(const AffineClaim& claim, const ClaimSearch& search) {
  ClaimProof proof(claim, search);
  const bool holds = proof.run();
  leaveLanes();
  return holds;
}

}  // namespace affine_claim

using affine_claim::proveClaimKernel;

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(proveClaimKernel);

bool AffineClaim::holds(const Body& geometry) const {
  PALPATE_ASSERT(halfSide > 0.0 && level > 0.0 && error >= 0.0 && reach >= 0.0);
  const Octree& octree = geometry.tree.octree();
  octree.requireBuilt();
  const ClaimSearch search{octree, geometry.tree.ordered().data(), geometry.mesh.now.body().data(),
                           geometry.tree.frame()};
  return HWY_DYNAMIC_DISPATCH(proveClaimKernel)(*this, search);
}

}  // namespace palpate
#endif
