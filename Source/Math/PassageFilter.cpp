#include "Math/PassageFilter.h"

#include "Math/Tolerances.h"
#include "Exact/ErrorBounds.h"
#include "Core/Assert.h"

#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Math/PassageFilter.cpp"
#include "Core/Simd.h"
#include "Math/ImpactFormulas.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
namespace passage_filter {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<double, ImpactBlock::kLanes>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;
using Point = Vector3<V>;
using Ends = Point[2];

HWY_INLINE V set(double value) { return hn::Set(D(), value); }
HWY_INLINE Point largest(const Ends& ends) {
  const auto of = [](V a, V b) HWY_ATTR { return hn::Max(hn::Abs(a), hn::Abs(b)); };
  return {of(ends[0].x, ends[1].x), of(ends[0].y, ends[1].y), of(ends[0].z, ends[1].z)};
}
HWY_INLINE V largest(const Point& p) { return hn::Max(p.x, hn::Max(p.y, p.z)); }

// As those of Exact/CubicRoot.h, with the same roundings.
HWY_INLINE V interpolate(V l, V r, V t) { return (set(1.0) - t) * l + t * r; }
HWY_INLINE V quadraticAt(V t, V b0, V b1, V b2) {
  return interpolate(interpolate(b0, b1, t), interpolate(b1, b2, t), t);
}
HWY_INLINE V cubicAt(V t, const V (&b)[4]) {
  return quadraticAt(t, interpolate(b[0], b[1], t), interpolate(b[1], b[2], t),
                     interpolate(b[2], b[3], t));
}
HWY_INLINE Point at(V t, const Ends& ends) {
  return {interpolate(ends[0].x, ends[1].x, t), interpolate(ends[0].y, ends[1].y, t),
          interpolate(ends[0].z, ends[1].z, t)};
}

/// approximateRoot() in [0, 1] of cubics that rise, in the given lanes.
HWY_INLINE V approximateRoots(const V (&b)[4], M lanes) {
  const D d;
  const V three = set(3.0), half = set(0.5);
  const V slope[3] = {three * (b[1] - b[0]), three * (b[2] - b[1]), three * (b[3] - b[2])};
  V low = hn::Zero(d), high = set(1.0), t = half, root = t;
  for (int i = 0; i < 64 && !hn::AllFalse(d, lanes); ++i) {
    const V value = cubicAt(t, b);
    const M isRoot = hn::Eq(value, hn::Zero(d)), isAbove = hn::Gt(value, hn::Zero(d));
    high = hn::IfThenElse(isAbove, t, high);
    low = hn::IfThenElse(isAbove, low, t);
    const V next = t - hn::Div(value, quadraticAt(t, slope[0], slope[1], slope[2]));
    const M ends = hn::Or(isRoot, hn::Lt(hn::Abs(next - t), set(kRootStep)));
    V last = hn::IfThenElse(hn::Lt(next, low), low, next);
    last = hn::IfThenElse(hn::Lt(high, next), high, last);
    t = hn::IfThenElse(hn::And(hn::Gt(next, low), hn::Lt(next, high)), next, half * (low + high));
    root = hn::IfThenElse(lanes, hn::IfThenElse(isRoot, root, hn::IfThenElse(ends, last, t)), root);
    lanes = hn::AndNot(ends, lanes);
  }
  return root;
}

/// Signs at a root: of x, y and the rest, where they all are certain.
struct Domain {
  M isInside, isOutside;
};

/// Whether C = x A + y B is in the domain at a time within a bracket of at most kWidestPassage, as
/// ImpactSearch::classify() decides it at its middle t. What is certain here is certain there: see
/// kPassageError. sizeA, sizeB, sizeC: the largest magnitudes over the step.
template <ImpactQuery::Kind kind>
HWY_INLINE Domain classify(V t, const Ends& a, const Ends& b, const Ends& c, V sizeA, V sizeB,
                           V sizeC) {
  const D d;
  const Point atA = at(t, a), atB = at(t, b), atC = at(t, c);
  const Point ofNormal = cross(atA, atB), ofX = cross(atC, atB), ofY = cross(atA, atC);
  const M takesY = hn::Gt(hn::Abs(ofNormal.y), hn::Abs(ofNormal.x)),
          takesZ = hn::Gt(hn::Abs(ofNormal.z), hn::Max(hn::Abs(ofNormal.x), hn::Abs(ofNormal.y)));
  const auto component = [&](const Point& p) HWY_ATTR {
    return hn::IfThenElse(takesZ, p.z, hn::IfThenElse(takesY, p.y, p.x));
  };
  const V signedNormal = component(ofNormal);
  const auto turned = [&](V v) HWY_ATTR {
    return hn::IfThenElse(hn::Lt(signedNormal, hn::Zero(d)), hn::Neg(v), v);
  };
  const V normal = turned(signedNormal), x = turned(component(ofX)), y = turned(component(ofY));
  const V scale = set(kPassageError), least = set(kPassageUnderflow);
  const V errorOfNormal = scale * (sizeA * sizeB) + least,
          errorOfX = scale * (sizeC * sizeB) + least, errorOfY = scale * (sizeA * sizeC) + least;
  const M isPlane = hn::Gt(normal, errorOfNormal);
  M isInside = isPlane, isOutside = hn::Lt(normal, normal);  // none
  const auto needs = [&](V value, V error) HWY_ATTR {
    isInside = hn::And(isInside, hn::Gt(value, error));
    isOutside = hn::Or(isOutside, hn::Lt(value, hn::Neg(error)));
  };
  needs(x, errorOfX);
  needs(y, errorOfY);
  if constexpr (kind == ImpactQuery::Kind::EdgeEdge) {
    needs(normal - x, errorOfNormal + errorOfX);
    needs(normal - y, errorOfNormal + errorOfY);
  } else {
    needs(normal - x - y, errorOfNormal + errorOfX + errorOfY);
  }
  return {isInside, hn::And(isOutside, isPlane)};
}

template <ImpactQuery::Kind kind>
HWY_INLINE void findPassagesOf(const ImpactBlock& block, int lane, double tolerance,
                               BlockPassages& found) {
  const D d;
  constexpr auto kAxes = ImpactQuery::axes(kind);
  const auto difference = [&](const ImpactQuery::Difference& vertices, int end) HWY_ATTR -> Point {
    const auto coordinate = [&](int k) HWY_ATTR {
      return hn::Load(d, &block.positions[vertices[0]][end][k][lane]) -
             hn::Load(d, &block.positions[vertices[1]][end][k][lane]);
    };
    return {coordinate(0), coordinate(1), coordinate(2)};
  };
  const Ends a{difference(kAxes[0], 0), difference(kAxes[0], 1)},
      b{difference(kAxes[1], 0), difference(kAxes[1], 1)},
      c{difference(kAxes[2], 0), difference(kAxes[2], 1)};
  const Point p = largest(a), q = largest(b), r = largest(c);
  const V sizeA = largest(p), sizeB = largest(q), sizeC = largest(r);
  // All corners are then at most kLargestImpactDifference from each other.
  const M isInRange =
      hn::Le(hn::Max(sizeA, hn::Max(sizeB, sizeC)), set(0.25 * kLargestImpactDifference));

  const auto [f, permanent] = coplanarityOf(a, b, c, p, q, r, set(3.0));
  const V least = hn::Min(hn::Min(f[0], f[1]), hn::Min(f[2], f[3])),
          most = hn::Max(hn::Max(f[0], f[1]), hn::Max(f[2], f[3]));
  const V errorOfForm = permanent * set(kCoplanarityError) + set(kImpactUnderflow);
  const M neverFlat = hn::Or(hn::Gt(least, errorOfForm), hn::Lt(most, hn::Neg(errorOfForm)));

  // The cubic is turned so that it rises through its only root.
  const V error = errorOfForm + set(kBlossomError) * hn::Max(hn::Abs(least), hn::Abs(most));
  const M rises = hn::Gt(f[3], hn::Zero(d));
  const auto turned = [&](V v) HWY_ATTR { return hn::IfThenElse(rises, v, hn::Neg(v)); };
  const V cubic[4] = {turned(f[0]), turned(f[1]), turned(f[2]), turned(f[3])};
  const M crosses = hn::And(hn::Gt(cubic[3], error), hn::Lt(cubic[0], hn::Neg(error)));
  const M once = hn::Or(hn::Lt(cubic[1], hn::Neg(error)), hn::Gt(cubic[2], error));
  const M hasOneRoot = hn::And(hn::AndNot(neverFlat, isInRange), hn::And(crosses, once));

  M isKnown = hn::And(isInRange, neverFlat), passes = hn::Lt(error, error);  // none
  if (!hn::AllFalse(d, hasOneRoot)) {
    const V root = approximateRoots(cubic, hasOneRoot);
    V low = root, high = root;
    M isBracketed = passes;
    for (double width = kNarrowestBracket;
         width <= 0.5 * tolerance && 2.0 * width <= kWidestPassage; width *= kBracketGrowth) {
      const V lower = hn::Max(root - set(width), hn::Zero(d)),
              upper = hn::Min(root + set(width), set(1.0));
      const M isCertain = hn::And(hn::Lt(cubicAt(lower, cubic), hn::Neg(error)),
                                  hn::Gt(cubicAt(upper, cubic), error));
      low = hn::IfThenElse(isBracketed, low, lower);
      high = hn::IfThenElse(isBracketed, high, upper);
      isBracketed = hn::Or(isBracketed, isCertain);
    }
    const Domain domain = classify<kind>(set(0.5) * (low + high), a, b, c, sizeA, sizeB, sizeC);
    isBracketed = hn::And(isBracketed, hasOneRoot);
    passes = hn::And(isBracketed, domain.isInside);
    isKnown = hn::Or(isKnown, hn::Or(passes, hn::And(isBracketed, domain.isOutside)));
    hn::StoreU(low, d, found.times.data() + lane);
  }
  const auto add = [&](std::uint8_t& lanes, M mask) HWY_ATTR {
    lanes = static_cast<std::uint8_t>(lanes | bitsOf(d, mask) << lane);
  };
  add(found.isKnown, isKnown);
  add(found.passes, passes);
  add(found.forward, rises);
}

HWY_ATTR void findPassagesKernel(ImpactQuery::Kind kind, const ImpactBlock& block, double tolerance,
                                 BlockPassages& found) {
  for (int lane = 0; lane < ImpactBlock::kLanes; lane += static_cast<int>(hn::Lanes(D())))
    if (kind == ImpactQuery::Kind::VertexTriangle)
      findPassagesOf<ImpactQuery::Kind::VertexTriangle>(block, lane, tolerance, found);
    else
      findPassagesOf<ImpactQuery::Kind::EdgeEdge>(block, lane, tolerance, found);
  leaveLanes();
}

}  // namespace passage_filter

using passage_filter::findPassagesKernel;

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(findPassagesKernel);

BlockPassages findPassages(ImpactQuery::Kind kind, const ImpactBlock& block, double tolerance) {
  PALPATE_ASSERT(tolerance >= kSmallestTimeTolerance && tolerance <= 1.0);
  BlockPassages found;
  found.isKnown = found.passes = found.forward = 0;
  HWY_DYNAMIC_DISPATCH(findPassagesKernel)(kind, block, tolerance, found);
  return found;
}

}  // namespace palpate
#endif
