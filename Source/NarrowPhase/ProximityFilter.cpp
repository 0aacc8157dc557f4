#include "NarrowPhase/ProximityFilter.h"

#include "NarrowPhase/FeatureTests.h"
#include "Core/Assert.h"

// The coordinates of every pair are taken relative to its corner a0, scaled by a power of two to
// below 2, and rounded to floats. The errors that follow, in units of e = 2^-22:
//
// clang-format off
//   coordinate difference              e per component: two coordinates off by e / 4 each, and one
//                                      rounding of a number below 4
//   n = u x v                          8.8 e L, |u|, |v| <= L: two factors off by sqrt(3) e, three
//                                      roundings of L², and L < 7
//   n . r                              111 e L, |r| < 7
//   (n x u) . r                        160 e L²
//   (v . u)(v . r) - (v . v)(u . r)    320 e |v| L
//   n . n, compared with it            280 e |v| L
// clang-format on
//
// The thresholds below are these errors, rounded up, times 1 + thickness. The factor covers the
// effect of the same errors on |n| and |u| in products with the thickness. A comparison with NaN is
// false, and drops no feature pair.
//
// The thresholds also cover underflow. A value of degree d in the edges is at most 14 |u|^d, and
// its threshold at least 2^-15 |u|^(d - 1). Where the value is larger, edges are longer than 2^-19,
// and what their products lose (2^-149 each) is far below the threshold.

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "NarrowPhase/ProximityFilter.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
namespace proximity_filter {

namespace hn = hwy::HWY_NAMESPACE;

using Batch = TrianglePairBatch;
constexpr int kSize = Batch::kSize, kRows = Batch::kRows;
constexpr int kFirstRow = Batch::rowOfA(1, 0);  // the first row after those of a0

/// A batch in floats: coordinates relative to a0, scaled to below 2.
struct ScaledBatch {
  alignas(64) float coordinates[kRows][kSize];  // those of a0, the origin, stay unused
  alignas(64) float thickness[kSize], checkedEdgeDistance[kSize];
};

HWY_ATTR void scaleBatch(const TrianglePairBatch& batch, double thickness,
                         double checkedEdgeDistance, ScaledBatch& scaled) {
  const hn::CappedTag<double, kSize> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  const hn::Rebind<float, decltype(d)> df;
  for (int i = 0; i < kSize; i += static_cast<int>(hn::Lanes(d))) {
    hn::Vec<decltype(d)> relative[kRows], most = hn::Zero(d);
    for (int row = kFirstRow; row < kRows; ++row) {
      relative[row] =
          hn::Load(d, batch.coordinates[row] + i) - hn::Load(d, batch.coordinates[row % 3] + i);
      most = hn::Max(most, hn::Abs(relative[row]));
    }
    // 2^-e for 2^e <= most < 2^(e + 1), by its exponent bits.
    const auto exponent = hn::And(hn::BitCast(du, most), hn::Set(du, 0x7ff0000000000000u));
    const auto scale = hn::BitCast(d, hn::Set(du, 0x7fe0000000000000u) - exponent);
    const auto isFinite = hn::Lt(most, hn::Set(d, 0x1p1023));
    const auto store = [&](double length, float* out) HWY_ATTR {
      const auto scaledLength = hn::IfThenElse(isFinite, hn::Set(d, length) * scale,
                                               hn::BitCast(d, hn::Set(du, 0x7ff8000000000000u)));
      hn::Store(hn::DemoteTo(df, scaledLength) * hn::Set(df, 1.0f + 0x1p-20f), df, out + i);
    };
    store(thickness, scaled.thickness);
    store(checkedEdgeDistance, scaled.checkedEdgeDistance);
    for (int row = kFirstRow; row < kRows; ++row)
      hn::Store(hn::DemoteTo(df, relative[row] * scale), df, scaled.coordinates[row] + i);
  }
}

/// A triangle with the values that several of its tests share.
template <class V>
struct TriangleFrame {
  Vector3<V> corner[3], edge[3];
  V square[3];                   // of the edges
  V length;                      // of the longest edge
  Vector3<V> normal, inward[3];  // inward: perpendicular to each edge, in the plane
  V height, beyond[3];           // thresholds: over the plane, and (negative) beyond each edge

  template <class D>
  HWY_INLINE void set(D d, V thickness) {
    for (int i = 0; i < 3; ++i) {
      edge[i] = corner[(i + 1) % 3] - corner[i];
      square[i] = dot(edge[i], edge[i]);
    }
    length = hn::Sqrt(hn::Max(hn::Max(square[0], square[1]), square[2]));
    normal = cross(edge[0], edge[1]);
    const V normalSquare = dot(normal, normal);
    const V slack = (hn::Set(d, 1.0f) + thickness) * hn::Set(d, 0x1p-22f);
    height = thickness * hn::Sqrt(normalSquare) + hn::Set(d, 128.0f) * slack * length;
    const V side = hn::Set(d, 192.0f) * slack * (length * length);
    for (int i = 0; i < 3; ++i) {
      inward[i] = cross(normal, edge[i]);
      beyond[i] = hn::Neg(thickness * hn::Sqrt(normalSquare * square[i]) + side);
    }
  }
};

/// Adds a test to the sets of those pairs for which it is not ruled out.
template <class V, class M>
HWY_INLINE V withTest(V tests, int test, M isOut) {
  const hn::DFromV<V> du;
  return hn::Or(tests, hn::IfThenZeroElse(hn::RebindMask(du, isOut), hn::Set(du, 1u << test)));
}

template <bool kOpposite, class V>
HWY_INLINE V along(const Vector3<V>& a, const Vector3<V>& b) {
  return kOpposite ? hn::Neg(dot(a, b)) : dot(a, b);
}

/// Whether a vertex is too far from a triangle. from0 to from2: the vectors from the triangle's
/// corners to the vertex; kOpposite: the opposite vectors.
template <bool kOpposite, class V>
HWY_INLINE auto isTooFar(const TriangleFrame<V>& triangle, const Vector3<V>& from0,
                         const Vector3<V>& from1, const Vector3<V>& from2) {
  auto isOut = hn::Gt(hn::Abs(dot(triangle.normal, from0)), triangle.height);
  isOut = hn::Or(isOut, hn::Lt(along<kOpposite>(triangle.inward[0], from0), triangle.beyond[0]));
  isOut = hn::Or(isOut, hn::Lt(along<kOpposite>(triangle.inward[1], from1), triangle.beyond[1]));
  return hn::Or(isOut, hn::Lt(along<kOpposite>(triangle.inward[2], from2), triangle.beyond[2]));
}

/// Triangle pairs whose boxes are further apart than `distance`.
template <class V>
HWY_INLINE auto areBoxesApart(const TriangleFrame<V>& a, const TriangleFrame<V>& b, V distance) {
  auto isApart = hn::FirstN(hn::DFromV<V>(), 0);
  for (const auto axis : {&Vector3<V>::x, &Vector3<V>::y, &Vector3<V>::z}) {
    const auto lower = [axis](const TriangleFrame<V>& of) HWY_ATTR {
      return hn::Min(hn::Min(of.corner[0].*axis, of.corner[1].*axis), of.corner[2].*axis);
    };
    const auto upper = [axis](const TriangleFrame<V>& of) HWY_ATTR {
      return hn::Max(hn::Max(of.corner[0].*axis, of.corner[1].*axis), of.corner[2].*axis);
    };
    const V gap = hn::Max(lower(a) - upper(b), lower(b) - upper(a));
    isApart = hn::Or(isApart, hn::Gt(gap, distance));
  }
  return isApart;
}

/// kKeepsNearEdges: keeps edge pairs within checkedEdgeDistance even if their closest points are
/// not inside both edges.
template <bool kDistinct, bool kKeepsNearEdges>
HWY_ATTR void filterScaled(const ScaledBatch& scaled, std::uint32_t (&possible)[kSize]) {
  const hn::CappedTag<float, kSize> d;
  using D = decltype(d);
  using V = hn::Vec<D>;
  for (int lane = 0; lane < kSize; lane += static_cast<int>(hn::Lanes(d))) {
    const V thickness = hn::Load(d, scaled.thickness + lane);
    TriangleFrame<V> a, b;
    for (int i = 0; i < 3; ++i) {
      const auto load = [&](int row) { return hn::Load(d, scaled.coordinates[row] + lane); };
      a.corner[i] = {load(Batch::rowOfA(i, 0)), load(Batch::rowOfA(i, 1)),
                     load(Batch::rowOfA(i, 2))};
      b.corner[i] = {load(Batch::rowOfB(i, 0)), load(Batch::rowOfB(i, 1)),
                     load(Batch::rowOfB(i, 2))};
    }
    a.corner[0] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
    a.set(d, thickness);
    b.set(d, thickness);
    // A triangle much smaller than the other one has no directions in floats, so that no other test
    // drops its features.
    constexpr float kTiny = 0x1p-10f;
    auto isApart = hn::Lt(hn::Min(a.length, b.length), hn::Set(d, kTiny));
    if (!hn::AllFalse(d, isApart)) {
      const V distance = hn::Max(thickness, hn::Load(d, scaled.checkedEdgeDistance + lane));
      // A coordinate difference is off by e. The rest covers the rounding of distance and sum.
      const V error = (hn::Set(d, 1.0f) + distance) * hn::Set(d, 0x1p-21f);
      isApart = hn::And(isApart, areBoxesApart(a, b, distance + error));
      if (hn::AllTrue(d, isApart)) {
        hn::StoreU(hn::Zero(hn::RebindToUnsigned<D>()), hn::RebindToUnsigned<D>(), possible + lane);
        continue;
      }
    }
    Vector3<V> from[3][3];  // from b's corner j to a's corner i
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) from[i][j] = a.corner[i] - b.corner[j];

    auto tests = hn::Zero(hn::RebindToUnsigned<D>());
    for (int i = 0; i < 3; ++i) {
      tests =
          withTest(tests, cornerTestOfA(i), isTooFar<false>(b, from[i][0], from[i][1], from[i][2]));
      tests =
          withTest(tests, cornerTestOfB(i), isTooFar<true>(a, from[0][i], from[1][i], from[2][i]));
    }

    const V slack = (hn::Set(d, 1.0f) + thickness) * hn::Set(d, 0x1p-22f);
    const V longest = hn::Max(a.length, b.length) * slack;
    const V heightError = hn::Set(d, 128.0f) * longest;
    const V sError = hn::Set(d, 640.0f) * longest * b.length;
    const V tError = hn::Set(d, 640.0f) * longest * a.length;
    const V thicknessSquare = thickness * thickness;
    V distanceA[3], distanceB[3];  // edges' lengths times checkedEdgeDistance
    for (int i = 0; i < 3 && kKeepsNearEdges; ++i) {
      const V distance = hn::Load(d, scaled.checkedEdgeDistance + lane);
      distanceA[i] = distance * hn::Sqrt(a.square[i]);
      distanceB[i] = distance * hn::Sqrt(b.square[i]);
    }
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        const Vector3<V>&u = a.edge[i], &v = b.edge[j], &r = from[i][j];
        const Vector3<V> n = cross(u, v);
        const V normalSquare = dot(n, n);
        const V height = hn::Max(hn::Abs(dot(n, r)) - heightError, hn::Zero(d));
        auto isOut = hn::Gt(height * height, thicknessSquare * normalSquare);
        if constexpr (kDistinct) {
          const V uv = dot(u, v), ur = dot(u, r), vr = dot(v, r);
          const V s = uv * vr - b.square[j] * ur;
          const V t = a.square[i] * vr - uv * ur;
          V sBeyond = sError, tBeyond = tError;
          if constexpr (kKeepsNearEdges) {
            // Let the closest point of an edge's line be x beyond the edge's end. That end, and the
            // whole edge, are then further than x |n| / (|u| |v|) from the other edge's line.
            const V normal = hn::Sqrt(normalSquare);
            sBeyond = sError + normal * distanceB[j];
            tBeyond = tError + normal * distanceA[i];
          }
          isOut = hn::Or(isOut, hn::Lt(s, hn::Neg(sBeyond)));
          isOut = hn::Or(isOut, hn::Lt(t, hn::Neg(tBeyond)));
          isOut = hn::Or(isOut, hn::Gt(s - normalSquare, sBeyond));
          isOut = hn::Or(isOut, hn::Gt(t - normalSquare, tBeyond));
        }
        tests = withTest(tests, edgeTest(i, j), isOut);
      }
    }
    tests = hn::IfThenZeroElse(hn::RebindMask(hn::RebindToUnsigned<D>(), isApart), tests);
    hn::StoreU(tests, hn::RebindToUnsigned<D>(), possible + lane);
  }
}

HWY_ATTR void filterKernel(const TrianglePairBatch& batch, double thickness, bool distinct,
                           double checkedEdgeDistance, std::uint32_t (&possible)[kSize]) {
  ScaledBatch scaled;
  scaleBatch(batch, thickness, checkedEdgeDistance, scaled);
  if (!distinct)
    filterScaled<false, false>(scaled, possible);
  else if (checkedEdgeDistance > 0.0)
    filterScaled<true, true>(scaled, possible);
  else
    filterScaled<true, false>(scaled, possible);
}

}  // namespace proximity_filter

using proximity_filter::filterKernel;

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(filterKernel);

void findPossibleProximity(const TrianglePairBatch& batch, double thickness, bool distinct,
                           double checkedEdgeDistance,
                           std::uint32_t (&possible)[TrianglePairBatch::kSize]) {
  PALPATE_ASSERT(thickness >= 0.0 && checkedEdgeDistance >= 0.0);
  HWY_DYNAMIC_DISPATCH(filterKernel)(batch, thickness, distinct, checkedEdgeDistance, possible);
}

}  // namespace palpate
#endif
