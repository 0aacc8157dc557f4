#include "Math/VertexTriangleDistances.h"

#include "Exact/ErrorBounds.h"
#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Math/VertexTriangleDistances.cpp"
#include "Core/Simd.h"
#include "Math/CompensatedLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// The arithmetic of Foot.cpp, operation by operation, and thus with the same bits. A lane that
// would leave the straight path there is undecided.

template <class V>
HWY_INLINE Vector3<V> operator/(const Vector3<V>& a, const V& divisor) {
  return {a.x / divisor, a.y / divisor, a.z / divisor};
}
template <class M, class V>
HWY_INLINE Vector3<V> select(const M& mask, const Vector3<V>& yes, const Vector3<V>& no) {
  return {hn::IfThenElse(mask, yes.x, no.x), hn::IfThenElse(mask, yes.y, no.y),
          hn::IfThenElse(mask, yes.z, no.z)};
}

template <class V>
HWY_INLINE V combination(V m, V mLow, V s, V u, V uLow) {
  const auto [high, low] = splitInHalves(u);
  const auto all = exactSum(m, s * high);
  return all.value + (all.error + (mLow + (s * low + s * uLow)));
}
template <class V>
HWY_INLINE V combination(V m, V mLow, V s, V u, V uLow, V t, V v, V vLow) {
  const auto [uHigh, uRest] = splitInHalves(u);
  const auto [vHigh, vRest] = splitInHalves(v);
  const auto plane = exactSum(s * uHigh, t * vHigh);
  const auto all = exactSum(m, plane.value);
  const V rest = (s * uRest + t * vRest) + (s * uLow + t * vLow);
  return all.value + ((all.error + plane.error) + (mLow + rest));
}
/// The feet of one vertex on the triangles of as many lanes as D has.
template <class D>
class Feet {
 public:
  using V = hn::Vec<D>;
  using Vectors = Vector3<V>;
  using Mask = hn::Mask<D>;

  HWY_ATTR HWY_INLINE Feet(const double (&p)[3], const TriangleBatch& batch, std::size_t i)
      : m_p{hn::Set(d, p[0]), hn::Set(d, p[1]), hn::Set(d, p[2])} {
    for (int k = 0; k < 3; ++k)
      m_corner[k] = {hn::Load(d, &batch.corners[k][0][i]), hn::Load(d, &batch.corners[k][1][i]),
                     hn::Load(d, &batch.corners[k][2][i])};
    for (int k = 0; k < 3; ++k) {
      m_edge[k] = m_corner[(k + 1) % 3] - m_corner[k];
      m_from[k] = m_p - m_corner[k];
    }
  }

  HWY_ATTR HWY_INLINE void store(VertexTriangleDistances::Lanes& lanes, std::size_t i) {
    classify();
    const V zero = hn::Zero(d), one = hn::Set(d, 1.0);
    // A corner.
    Vectors difference =
        select(m_isCorner[0], m_from[0], select(m_isCorner[1], m_from[1], m_from[2]));
    V distance = hn::Sqrt(dot(difference, difference));
    Vectors normal = difference / distance;
    Mask decided = hn::And(isModerate(largest(difference)),
                           hn::Or(m_isCorner[0], hn::Or(m_isCorner[1], m_isCorner[2])));
    V weights[3], feature = zero;
    for (int k = 0; k < 3; ++k) {
      weights[k] = hn::IfThenElseZero(m_isCorner[k], one);
      feature = feature + hn::IfThenElseZero(m_isCorner[k], hn::Set(d, k));
    }
    const auto take = [&](const Foot& foot, const Mask& mask) HWY_ATTR {
      difference = select(mask, foot.difference, difference);
      normal = select(mask, foot.normal, normal);
      distance = hn::IfThenElse(mask, foot.distance, distance);
      decided = hn::Or(decided, hn::And(mask, foot.decided));
    };
    const Mask isEdge = hn::Or(m_isEdge[0], hn::Or(m_isEdge[1], m_isEdge[2]));
    const Foot onEdge = footOnEdge();
    take(onEdge, isEdge);
    for (int k = 0; k < 3; ++k) {
      const V first = hn::IfThenElseZero(m_isEdge[k], one - onEdge.s);
      const V second = hn::IfThenElseZero(m_isEdge[k], onEdge.s);
      weights[k] = weights[k] + first;
      weights[(k + 1) % 3] = weights[(k + 1) % 3] + second;
      feature = feature + hn::IfThenElseZero(m_isEdge[k], hn::Set(d, 3 + k));
    }
    V onFaceWeights[3];
    take(footOnFace(onFaceWeights), m_isFace);
    for (int k = 0; k < 3; ++k) weights[k] = hn::IfThenElse(m_isFace, onFaceWeights[k], weights[k]);
    feature = hn::IfThenElse(m_isFace, hn::Set(d, 6.0), feature);

    for (int k = 0; k < 3; ++k) hn::Store(weights[k], d, &lanes.weights[k][i]);
    store(difference, lanes.difference, i);
    store(normal, lanes.normal, i);
    hn::Store(distance, d, &lanes.distance[i]);
    hn::Store(hn::IfThenElse(decided, feature, hn::Set(d, -1.0)), d, &lanes.feature[i]);
    hn::Store(hn::Max(largest(m_from[0]), hn::Max(largest(m_from[1]), largest(m_from[2]))), d,
              &lanes.reach[i]);
  }

 private:
  struct Foot {
    Vectors difference, normal;
    V distance, s;
    Mask decided;
  };

  HWY_ATTR HWY_INLINE void store(const Vectors& from, double (&to)[3][TriangleBatch::kSize],
                                 std::size_t i) const {
    hn::Store(from.x, d, &to[0][i]);
    hn::Store(from.y, d, &to[1][i]);
    hn::Store(from.z, d, &to[2][i]);
  }
  HWY_ATTR HWY_INLINE Mask isModerate(V extent) const {
    return hn::And(hn::Gt(extent, hn::Set(d, kSmallestModerate)),
                   hn::Lt(extent, hn::Set(d, kLargestModerate)));
  }

  /// The feature that holds the closest point, where the signs are certain: see FilteredSigns.h.
  HWY_ATTR HWY_INLINE void classify() {
    const V zero = hn::Zero(d), guard = hn::Set(d, kUnderflowGuard);
    const Vectors normal = cross(m_edge[0], m_edge[1]);
    const V magnitude = sumOfMagnitudes(m_edge[0]) * sumOfMagnitudes(m_edge[1]);
    const V most = hn::Set(d, kSquareOverflowGuard);
    Mask inwards[3], outwards[3], afterStart[3], beforeStart[3], beforeEnd[3], afterEnd[3];
    for (int k = 0; k < 3; ++k) {
      const V own = sumOfMagnitudes(m_edge[k]) * sumOfMagnitudes(m_from[k]);
      const V error =
          hn::Set(d, kTripleError) * own * magnitude + (hn::Set(d, 1.0) + own + magnitude) * guard;
      const V side = dot(cross(m_edge[k], m_from[k]), normal);
      const Mask valid = hn::And(hn::Lt(own, most), hn::Lt(magnitude, most));
      inwards[k] = hn::And(valid, hn::Gt(side, error));
      outwards[k] = hn::And(valid, hn::Lt(side, hn::Neg(error)));
      const Mask isPoint = hn::Eq(largest(m_edge[k]), zero);
      const auto decide = [&](const Vectors& from, Mask& along, Mask& against) HWY_ATTR {
        const Vectors& u = m_edge[k];
        const V sum = (hn::Abs(from.x * u.x) + hn::Abs(from.y * u.y)) + hn::Abs(from.z * u.z);
        const Mask isFinite = hn::Lt(sum, hn::Set(d, kOverflowGuard));
        const V bound = hn::Set(d, kDotError) * sum + guard, value = dot(from, u);
        along = hn::And(isFinite, hn::Gt(value, bound));
        against = hn::And(isFinite, hn::Lt(value, hn::Neg(bound)));
      };
      decide(m_from[k], afterStart[k], beforeStart[k]);
      decide(m_from[(k + 1) % 3], afterEnd[k], beforeEnd[k]);
      beforeStart[k] = hn::Or(beforeStart[k], isPoint);
      afterEnd[k] = hn::Or(afterEnd[k], isPoint);
    }
    m_isFace = hn::And(inwards[0], hn::And(inwards[1], inwards[2]));
    for (int k = 0; k < 3; ++k) {
      m_isEdge[k] = hn::And(outwards[k], hn::And(afterStart[k], beforeEnd[k]));
      m_isCorner[k] = hn::And(beforeStart[k], afterEnd[(k + 2) % 3]);
    }
    // A segment or a point counts as its first corner where several are equally near.
    m_isCorner[1] = hn::AndNot(m_isCorner[0], m_isCorner[1]);
    m_isCorner[2] = hn::AndNot(hn::Or(m_isCorner[0], m_isCorner[1]), m_isCorner[2]);
  }

  HWY_ATTR HWY_INLINE V toCoarse(V value) const {
    const V one = hn::Set(d, 1.0), grid = hn::Set(d, kCoarseWeight);
    return (hn::Min(hn::Max(value, hn::Neg(one)), one) + grid) - grid;
  }
  HWY_ATTR HWY_INLINE V toGrid(V value) const {
    const V grid = hn::Set(d, 0.75);
    return (value + grid) - grid;
  }
  HWY_ATTR HWY_INLINE V toUnit(V value) const {
    return hn::Min(hn::Max(value, hn::Zero(d)), hn::Set(d, 1.0));
  }
  HWY_ATTR HWY_INLINE Mask isFine(V weight) const {
    return hn::Lt(hn::Abs(weight), hn::Set(d, kFineWeight));
  }

  HWY_ATTR HWY_INLINE Foot footOnEdge() const {
    const V half = hn::Set(d, 0.5);
    const auto ofEdge = [&](int shift) HWY_ATTR {
      return select(m_isEdge[0], m_corner[shift % 3],
                    select(m_isEdge[1], m_corner[(1 + shift) % 3], m_corner[(2 + shift) % 3]));
    };
    const Vectors a = ofEdge(0), b = ofEdge(1);
    DifferenceInLanes<V> m = sum(exactSum(m_p, m_p), exactSum(-a, -b)), u = exactSum(b, -a);
    m = {half * m.high, half * m.low};
    u = {half * u.high, half * u.low};
    const V extent = hn::Max(largest(m.high), largest(u.high));
    const V square = dot(u.high, u.high);
    const V coarse = toCoarse(dot(m.high, u.high) / square), against = hn::Neg(coarse);
    const Vectors residual{combination(m.high.x, m.low.x, against, u.high.x, u.low.x),
                           combination(m.high.y, m.low.y, against, u.high.y, u.low.y),
                           combination(m.high.z, m.low.z, against, u.high.z, u.low.z)};
    const V fine = dot(residual, u.high) / square;
    const Vectors difference = residual - fine * u.high;
    const V length = hn::Sqrt(dot(difference, difference));
    const V s = toUnit(half * (hn::Set(d, 1.0) + coarse) + toGrid(half * fine));
    const Mask apart = hn::Gt(largest(difference), hn::Set(d, kTouching) * extent);
    return {difference, difference / length, length, s,
            hn::And(isModerate(extent), hn::And(isFine(fine), apart))};
  }

  HWY_ATTR HWY_INLINE Foot footOnFace(V (&weights)[3]) const {
    // The corner opposite the longest edge comes first.
    const V opposite[] = {dot(m_edge[1], m_edge[1]), dot(m_edge[2], m_edge[2]),
                          dot(m_edge[0], m_edge[0])};
    const Mask isB = hn::And(hn::Gt(opposite[1], opposite[0]), hn::Gt(opposite[1], opposite[2]));
    const Mask isC = hn::And(hn::Gt(opposite[2], opposite[0]), hn::Gt(opposite[2], opposite[1]));
    const Mask isA = hn::And(hn::Gt(opposite[0], opposite[1]), hn::Gt(opposite[0], opposite[2]));
    const auto rotated = [&](int k) HWY_ATTR {
      return select(isA, m_corner[k], select(isB, m_corner[(1 + k) % 3], m_corner[(2 + k) % 3]));
    };
    const Vectors a = rotated(0), b = rotated(1), c = rotated(2);
    const DifferenceInLanes<V> m = exactSum(m_p, -a), u = exactSum(a, -b), v = exactSum(a, -c);
    const V extent = hn::Max(largest(m.high), hn::Max(largest(u.high), largest(v.high)));
    const V square = dot(u.high, u.high) * dot(v.high, v.high);
    Vectors normal = cross(u.high, v.high);
    V normalSquare = dot(normal, normal);
    Mask decided = hn::And(hn::Or(isA, hn::Or(isB, isC)), isModerate(extent));
    decided = hn::And(decided, hn::Gt(normalSquare, hn::Set(d, kNarrowAngleSquare) * square));
    decided = hn::And(decided, hn::Gt(normalSquare, hn::Set(d, kUnderflowGuardOfProducts)));
    const auto sOf = [&](const Vectors& from) HWY_ATTR {
      return hn::Neg(dot(cross(from, v.high), normal)) / normalSquare;
    };
    const auto tOf = [&](const Vectors& from) HWY_ATTR {
      return hn::Neg(dot(cross(u.high, from), normal)) / normalSquare;
    };
    const V s = toCoarse(sOf(m.high)), t = toCoarse(tOf(m.high));
    const auto residualOf = [&](V mHigh, V mLow, V uHigh, V uLow, V vHigh, V vLow) HWY_ATTR {
      return combination(mHigh, mLow, s, uHigh, uLow, t, vHigh, vLow);
    };
    const Vectors residual{residualOf(m.high.x, m.low.x, u.high.x, u.low.x, v.high.x, v.low.x),
                           residualOf(m.high.y, m.low.y, u.high.y, u.low.y, v.high.y, v.low.y),
                           residualOf(m.high.z, m.low.z, u.high.z, u.low.z, v.high.z, v.low.z)};
    V length = hn::Sqrt(normalSquare), height = dot(normal, residual) / length;
    const V factors = hn::Sqrt(square);
    const Mask plain =
        hn::Lt(hn::Abs(height) * (hn::Set(d, 5.0) * factors + hn::Set(d, 4.0) * length),
               hn::Set(d, 7.0) * extent * length);
    if (!hn::AllTrue(d, hn::Or(plain, hn::Not(m_isFace)))) {
      const Vectors accurate = cross(u, v).high;
      normal = select(plain, normal, accurate);
      normalSquare = dot(normal, normal);
      length = hn::Sqrt(normalSquare);
      height = dot(normal, residual) / length;
    }
    const Vectors tangential = residual - (dot(normal, residual) / normalSquare) * normal;
    const V sFine = sOf(tangential), tFine = tOf(tangential);
    decided = hn::And(decided, hn::And(isFine(sFine), isFine(tFine)));
    decided = hn::And(decided, hn::Gt(hn::Abs(height), hn::Set(d, kTouching) * extent));
    Foot foot;
    foot.normal = normal / hn::IfThenElse(hn::Lt(height, hn::Zero(d)), hn::Neg(length), length);
    foot.distance = hn::Abs(height);
    foot.difference = foot.distance * foot.normal;
    foot.decided = decided;
    // The weights of b and c, of which the larger one gives way if the sum exceeds 1.
    const V one = hn::Set(d, 1.0);
    V wb = toUnit(s + toGrid(sFine)), wc = toUnit(t + toGrid(tFine));
    const V excess = hn::Max(hn::Zero(d), wb - (one - wc));
    foot.decided = hn::And(foot.decided, hn::Le(excess, hn::Set(d, kWeightStep)));
    const Mask ofB = hn::Gt(wb, wc);
    wb = hn::IfThenElse(ofB, wb - excess, wb);
    wc = hn::IfThenElse(ofB, wc, wc - excess);
    const V wa = (one - wb) - wc;
    weights[0] = hn::IfThenElse(isA, wa, hn::IfThenElse(isB, wc, wb));
    weights[1] = hn::IfThenElse(isA, wb, hn::IfThenElse(isB, wa, wc));
    weights[2] = hn::IfThenElse(isA, wc, hn::IfThenElse(isB, wb, wa));
    return foot;
  }

  static constexpr D d{};
  Vectors m_p, m_corner[3], m_edge[3], m_from[3];
  Mask m_isCorner[3], m_isEdge[3], m_isFace;
};

HWY_ATTR void vertexTriangleDistancesKernel(const double (&p)[3], const TriangleBatch& batch,
                                            std::size_t count,
                                            VertexTriangleDistances::Lanes& lanes) {
  const hn::CappedTag<double, TriangleBatch::kSize> d;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d))
    Feet<hn::CappedTag<double, TriangleBatch::kSize>>(p, batch, i).store(lanes, i);
  leaveLanes();
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(vertexTriangleDistancesKernel);

VertexTriangleDistances::VertexTriangleDistances(const Eigen::Vector3d& p,
                                                 const TriangleBatch& triangles, std::size_t count)
    : m_p(p), m_triangles(triangles) {
  const double coordinates[] = {p[0], p[1], p[2]};
  HWY_DYNAMIC_DISPATCH(vertexTriangleDistancesKernel)(coordinates, triangles, count, m_lanes);
}

VertexTriangleDistance VertexTriangleDistances::operator[](std::size_t i) const {
  if (m_lanes.feature[i] < 0)
    return finiteVertexTriangleDistance(m_p, m_triangles.corner(i, 0), m_triangles.corner(i, 1),
                                        m_triangles.corner(i, 2));
  const auto at = [&](const double(&values)[3][TriangleBatch::kSize]) {
    return Eigen::Vector3d(values[0][i], values[1][i], values[2][i]);
  };
  return {at(m_lanes.weights),
          at(m_lanes.difference),
          at(m_lanes.normal),
          m_lanes.distance[i],
          static_cast<TriangleFeature>(static_cast<int>(m_lanes.feature[i])),
          false};
}

}  // namespace palpate
#endif
