#include "DistanceField/ProxyItems.h"

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "DistanceField/ProxyItems.cpp"
#include "Core/Simd.h"

#ifndef PALPATE_PROXY_ITEMS_CPP
#define PALPATE_PROXY_ITEMS_CPP
namespace palpate {

/// Twice a triangle's area, in squares of its longest edge: thinner triangles are used without
/// their normal.
constexpr double kThinnestProxyTriangle = 0x1p-20;
constexpr Buffer<double> ProxyItems::*kProxyArrays[] = {
    &ProxyItems::x,       &ProxyItems::y,       &ProxyItems::z,       &ProxyItems::radius,
    &ProxyItems::normalX, &ProxyItems::normalY, &ProxyItems::normalZ, &ProxyItems::triangle};

/// For each mask of eight lanes: the lanes that are set, in ascending order, then lane 0.
/// hn::Compress() has such tables, but g++ 12 copies them to the stack in each call.
constexpr std::array<std::array<std::int64_t, 8>, 256> kSetLanes = [] {
  std::array<std::array<std::int64_t, 8>, 256> lanes{};
  for (unsigned mask = 0; mask < 256; ++mask)
    for (unsigned lane = 0, count = 0; lane < 8; ++lane)
      if (mask >> lane & 1) lanes[mask][count++] = lane;
  return lanes;
}();

}  // namespace palpate
#endif

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using ItemTag = hn::CappedTag<double, 8>;
using ItemV = hn::Vec<ItemTag>;

HWY_ATTR HWY_INLINE Vector3<ItemV> spreadAxis(const Eigen::Vector3d& a) {
  const ItemTag d;
  return {hn::Set(d, a.data()[0]), hn::Set(d, a.data()[1]), hn::Set(d, a.data()[2])};
}
HWY_ATTR HWY_INLINE Vector3<ItemV> centresFrom(const ProxyItems& items, std::size_t i,
                                               const Vector3<ItemV>& point) {
  const ItemTag d;
  return Vector3<ItemV>{hn::LoadU(d, items.x.data() + i), hn::LoadU(d, items.y.data() + i),
                        hn::LoadU(d, items.z.data() + i)} -
         point;
}

HWY_ATTR NearestItem nearestItemKernel(const ProxyItems& items, const Eigen::Vector3d& point,
                                       double near) {
  const ItemTag d;
  const Vector3<ItemV> middle = spreadAxis(point);
  const ItemV infinite = hn::Set(d, std::numeric_limits<double>::infinity()),
              limit = hn::Set(d, near);
  ItemV least = infinite;
  auto isNear = hn::Lt(infinite, infinite);
  for (std::size_t i = 0; i < items.size; i += hn::Lanes(d)) {
    const auto isUsed = hn::FirstN(d, items.size - i);
    const Vector3<ItemV> from = centresFrom(items, i, middle);
    const ItemV square = hn::IfThenElse(isUsed, dot(from, from), infinite),
                reach = limit + hn::LoadU(d, items.radius.data() + i);
    least = hn::Min(least, square);
    isNear = hn::Or(isNear, hn::And(isUsed, hn::Le(square, reach * reach)));
  }
  const NearestItem found{hn::GetLane(hn::MinOfLanes(d, least)), !hn::AllFalse(d, isNear)};
  leaveLanes();
  return found;
}

HWY_ATTR std::size_t keepWithinKernel(const ProxyItems& from, const Eigen::Vector3d& point,
                                      double reach, double leastSquare, ProxyItems& to) {
  const ItemTag d;
  const Vector3<ItemV> middle = spreadAxis(point);
  const ItemV limit = hn::Set(d, reach), least = hn::Set(d, leastSquare);
  constexpr std::size_t kNone = ~std::size_t{0};
  std::size_t nearest = kNone, count = 0;
  for (std::size_t i = 0; i < from.size; i += hn::Lanes(d)) {
    const Vector3<ItemV> way = centresFrom(from, i, middle);
    const ItemV radius = hn::LoadU(d, from.radius.data() + i), square = dot(way, way);
    const ItemV most = limit + radius;
    const auto isKept = hn::And(hn::FirstN(d, from.size - i), hn::Le(square, most * most));
    if (hn::AllFalse(d, isKept)) continue;
    const std::uint32_t kept = bitsOf(d, isKept);
    if (nearest == kNone) {
      const std::uint32_t bits = bitsOf(d, hn::And(isKept, hn::Eq(square, least)));
      if (bits != 0)
        nearest = count + static_cast<std::size_t>(std::popcount(kept & ((bits & -bits) - 1)));
    }
    const auto order = hn::SetTableIndices(d, kSetLanes[kept].data());
    const auto keep = [&](const Buffer<double>& source, Buffer<double>& target) HWY_ATTR {
      hn::StoreU(hn::TableLookupLanes(hn::LoadU(d, source.data() + i), order), d,
                 target.data() + count);
    };
    for (const auto each : kProxyArrays) keep(from.*each, to.*each);
    count += static_cast<std::size_t>(std::popcount(kept));
  }
  to.size = count;
  leaveLanes();
  return nearest;
}

/// Appends the places of lanes that are set, from the place of the first lane.
HWY_ATTR HWY_INLINE void appendPlaces(hn::Mask<ItemTag> isSet, std::size_t first,
                                      std::uint32_t* places, std::size_t& count) {
  for (std::uint32_t bits = bitsOf(ItemTag(), isSet); bits != 0; bits &= bits - 1)
    places[count++] =
        static_cast<std::uint32_t>(first) + static_cast<std::uint32_t>(std::countr_zero(bits));
}

HWY_ATTR std::size_t placesWithinKernel(const ProxyItems& items, const Eigen::Vector3d& point,
                                        double reach, std::uint32_t* places) {
  const ItemTag d;
  const Vector3<ItemV> middle = spreadAxis(point);
  const ItemV limit = hn::Set(d, reach);
  std::size_t count = 0;
  for (std::size_t i = 0; i < items.size; i += hn::Lanes(d)) {
    const Vector3<ItemV> from = centresFrom(items, i, middle);
    const ItemV most = limit + hn::LoadU(d, items.radius.data() + i);
    const auto isNear =
        hn::And(hn::FirstN(d, items.size - i), hn::Le(dot(from, from), most * most));
    appendPlaces(isNear, i, places, count);
  }
  leaveLanes();
  return count;
}

/// Spheres with a triangle, about the centre of a window.
class ItemsInWindow {
 public:
  HWY_ATTR HWY_INLINE ItemsInWindow(const ProxyItems& items, std::size_t i,
                                    const Vector3<ItemV>& centre, const Vector3<ItemV>& up)
      : from(centresFrom(items, i, centre)), radius(hn::LoadU(d, items.radius.data() + i)) {
    normal = {hn::LoadU(d, items.normalX.data() + i), hn::LoadU(d, items.normalY.data() + i),
              hn::LoadU(d, items.normalZ.data() + i)};
    height = dot(from, up);
    cosine = dot(normal, up);
    const ItemV square = hn::Set(d, 1.0 + kProxySlack) - cosine * cosine;
    rise = radius * (hn::Sqrt(square) + hn::Set(d, kProxyNormalError));
  }

  static constexpr ItemTag d{};
  Vector3<ItemV> from, normal;
  ItemV radius, height, cosine;
  ItemV
      rise;  ///< by which heights of the triangle differ from that of the sphere's centre, at most
};

HWY_ATTR std::size_t boundHeightsKernel(const ProxyItems& items, const ProxyWindow& window,
                                        double leastCosine, double rounded, std::uint32_t* places,
                                        double* lows, double* highs) {
  const ItemTag d;
  const Vector3<ItemV> centre = spreadAxis(window.cube.centre), axisU = spreadAxis(window.u),
                       axisV = spreadAxis(window.v), up = spreadAxis(window.normal);
  const ItemV infinite = hn::Set(d, std::numeric_limits<double>::infinity()),
              halfU = hn::Set(d, window.half[0]), halfV = hn::Set(d, window.half[1]),
              rounding = hn::Set(d, rounded), cone = hn::Set(d, leastCosine),
              steep = hn::Set(d, 0.5), normalError = hn::Set(d, 4.0 * kProxyNormalError);
  std::size_t count = 0;
  alignas(64) double low[8], high[8];
  for (std::size_t i = 0; i < items.size; i += hn::Lanes(d)) {
    const ItemsInWindow item(items, i, centre, up);
    const ItemV u = dot(item.from, axisU), v = dot(item.from, axisV);
    const ItemV reach = item.radius + rounding;
    const auto isInside =
        hn::And(hn::FirstN(d, items.size - i),
                hn::And(hn::Le(hn::Abs(u), halfU + reach), hn::Le(hn::Abs(v), halfV + reach)));
    std::uint32_t bits = bitsOf(d, isInside);
    if (bits == 0) continue;
    // The triangle's plane above the part of the window about the sphere.
    const auto part = [&](ItemV at, ItemV half, const Vector3<ItemV>& axis, ItemV& height,
                          ItemV& rise) HWY_ATTR {
      const ItemV begin = hn::Max(at - reach, hn::Neg(half)), end = hn::Min(at + reach, half),
                  slope = dot(item.normal, axis) / item.cosine;
      height = height - slope * (hn::Set(d, 0.5) * (begin + end) - at);
      rise = rise + (hn::Abs(slope) + normalError) * (hn::Set(d, 0.5) * (end - begin));
    };
    ItemV middle = item.height, rise = normalError * item.radius + rounding;
    part(u, halfU, axisU, middle, rise);
    part(v, halfV, axisV, middle, rise);
    const auto isSteep = hn::Not(hn::Gt(item.cosine, steep));
    const ItemV least = hn::IfThenElse(isSteep, hn::Neg(infinite), middle - rise),
                most = hn::IfThenElse(isSteep, infinite, middle + rise);
    const auto isOutsideCone = hn::Not(hn::Gt(item.cosine, cone));
    hn::Store(hn::IfThenElse(isOutsideCone, hn::Neg(infinite),
                             hn::Max(least, item.height - item.rise - rounding)),
              d, low);
    hn::Store(
        hn::IfThenElse(isOutsideCone, infinite, hn::Min(most, item.height + item.rise + rounding)),
        d, high);
    for (; bits != 0; bits &= bits - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
      places[count] = static_cast<std::uint32_t>(i + lane);
      lows[count] = low[lane];
      highs[count++] = high[lane];
    }
  }
  leaveLanes();
  return count;
}

/// Whether no triangle at a lateral distance is nearer to the node than the plane less the error.
HWY_ATTR HWY_INLINE hn::Mask<ItemTag> isFarAside(ItemV lateral, ItemV side, ItemV height,
                                                 ItemV error) {
  const ItemTag d;
  const ItemV most = hn::Min(height, side),
              square = (most - error) * (hn::Set(d, 2.0) * side - most - error);
  return hn::Or(hn::Not(hn::And(hn::Gt(side, error), hn::Gt(height, error))),
                hn::And(hn::Gt(lateral, hn::Zero(d)),
                        hn::Ge(lateral * lateral, square * hn::Set(d, 1.0 + kProxySlack))));
}

HWY_ATTR std::size_t raiseErrorKernel(const ProxyItems& items, const ProxyWindow& window,
                                      double height, double mostError, double rounded,
                                      double& error, std::uint32_t* places) {
  const ItemTag d;
  const Vector3<ItemV> centre = spreadAxis(window.cube.centre), axisU = spreadAxis(window.u),
                       axisV = spreadAxis(window.v), up = spreadAxis(window.normal);
  const double* const footprint = window.footprint.data();
  const ItemV footU = hn::Set(d, footprint[0]), footV = hn::Set(d, footprint[1]),
              front = hn::Set(d, footprint[2] - height), back = hn::Set(d, footprint[2] + height),
              middle = hn::Set(d, height), least = hn::Set(d, error), most = hn::Set(d, mostError),
              rounding = hn::Set(d, rounded), more = hn::Set(d, window.more), zero = hn::Zero(d),
              steep = hn::Set(d, 0.5), half = hn::Set(d, window.cube.half * (1.0 + kProxySlack)),
              slack = hn::Set(d, 1.0 - kProxySlack);
  std::size_t count = 0;
  ItemV needed = least;
  for (std::size_t i = 0; i < items.size; i += hn::Lanes(d)) {
    const ItemsInWindow item(items, i, centre, up);
    const ItemV high = item.height + item.rise - middle + rounding,
                low = middle - item.height + item.rise + rounding;
    auto isOpen = hn::And(hn::FirstN(d, items.size - i), hn::Gt(hn::Max(high, low), least));
    if (hn::AllFalse(d, isOpen)) continue;
    const ItemV gapU = hn::Max(zero, hn::Abs(dot(item.from, axisU)) - item.radius - footU),
                gapV = hn::Max(zero, hn::Abs(dot(item.from, axisV)) - item.radius - footV),
                lateral = hn::Max(more, hn::Sqrt(gapU * gapU + gapV * gapV)) * slack - rounding;
    // The triangle's plane above the node.
    const Vector3<ItemV> turn = item.normal - up;
    const ItemV above = dot(item.from, item.normal) - middle,
                loss = half * (hn::Abs(turn.x) + hn::Abs(turn.y) + hn::Abs(turn.z)) +
                       hn::Set(d, kProxyNormalError) * item.radius + rounding + rounding;
    const auto isFacing = hn::Gt(item.cosine, steep);
    const auto needOf = [&](ItemV side, ItemV rise, ItemV plane) HWY_ATTR {
      return hn::IfThenZeroElse(isFarAside(lateral, side, rise, least),
                                hn::IfThenElse(isFacing, hn::Min(rise, plane), rise));
    };
    const ItemV need = hn::IfThenElseZero(
        isOpen, hn::Max(needOf(front, high, loss + above), needOf(back, low, loss - above)));
    isOpen = hn::Gt(need, most);
    needed = hn::Max(needed, hn::IfThenElse(isOpen, zero, need));
    appendPlaces(isOpen, i, places, count);
  }
  error = hn::GetLane(hn::MaxOfLanes(d, needed));
  leaveLanes();
  return count;
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(nearestItemKernel);
HWY_EXPORT(keepWithinKernel);
HWY_EXPORT(placesWithinKernel);
HWY_EXPORT(boundHeightsKernel);
HWY_EXPORT(raiseErrorKernel);

using Eigen::Vector3d;

namespace {

/// Vectors of lanes are loaded and stored whole.
constexpr std::size_t kPadding = 8;

}  // namespace

void ProxyItems::reserve(std::size_t count) {
  for (const auto each : kProxyArrays)
    if ((this->*each).size() < count + kPadding) (this->*each).resize(count + count / 8 + kPadding);
}

void ProxyItems::append(const ProxyItems& from, std::size_t i) {
  PALPATE_ASSERT(i < from.size && size < x.size());
  for (const auto each : kProxyArrays) (this->*each)[size] = (from.*each)[i];
  ++size;
}

NearestItem nearestOf(const ProxyItems& items, const Vector3d& point, double near) {
  return HWY_DYNAMIC_DISPATCH(nearestItemKernel)(items, point, near);
}

std::size_t keepWithin(const ProxyItems& from, const Vector3d& point, double reach,
                       double leastSquare, ProxyItems& to) {
  PALPATE_ASSERT(&from != &to);
  to.reserve(from.size);
  const std::size_t nearest =
      HWY_DYNAMIC_DISPATCH(keepWithinKernel)(from, point, reach, leastSquare, to);
  PALPATE_ASSERT(nearest < to.size);
  return nearest;
}

std::size_t placesWithin(const ProxyItems& items, const Vector3d& point, double reach,
                         std::uint32_t* places) {
  return HWY_DYNAMIC_DISPATCH(placesWithinKernel)(items, point, reach, places);
}

std::size_t boundHeights(const ProxyItems& items, const ProxyWindow& window, double leastCosine,
                         double rounding, std::uint32_t* places, double* lows, double* highs) {
  return HWY_DYNAMIC_DISPATCH(boundHeightsKernel)(items, window, leastCosine, rounding, places,
                                                  lows, highs);
}

std::size_t raiseError(const ProxyItems& items, const ProxyWindow& window, double height,
                       double most, double rounding, double& error, std::uint32_t* places) {
  PALPATE_ASSERT(error <= most);
  const std::size_t count =
      HWY_DYNAMIC_DISPATCH(raiseErrorKernel)(items, window, height, most, rounding, error, places);
  PALPATE_ASSERT(error <= most);
  return count;
}

bool hasClosedStars(const MeshTopology& topology, std::uint32_t triangle) {
  const Triangle& corners = topology.elements[triangle];
  return std::all_of(corners.begin(), corners.end(),
                     [&](std::uint32_t v) { return topology.hasClosedStar[v] != 0; });
}

ProxyItems itemsOf(const MeshTopology& topology, std::span<const Vector3d> positions,
                   double rounding) {
  ProxyItems all;
  all.reserve(topology.elements.size());
  for (std::uint32_t t = 0; t < topology.elements.size(); ++t) {
    if (!topology.isEnabled(t)) continue;
    const Triangle& corners = topology.elements[t];
    const Vector3d &a = positions[corners[0]], &b = positions[corners[1]],
                   &c = positions[corners[2]];
    const Vector3d centre = (a + b + c) / 3.0;
    const double square = std::max(
        {(a - centre).squaredNorm(), (b - centre).squaredNorm(), (c - centre).squaredNorm()});
    const double edge =
        std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    const Vector3d across = (b - a).cross(c - a);
    const double area = across.norm();
    Vector3d normal = Vector3d::Zero();
    if (hasClosedStars(topology, t) && area > kThinnestProxyTriangle * edge) normal = across / area;
    const std::size_t i = all.size++;
    all.x[i] = centre[0], all.y[i] = centre[1], all.z[i] = centre[2];
    all.radius[i] = std::sqrt(square) * (1.0 + kProxySlack) + rounding;
    all.normalX[i] = normal[0], all.normalY[i] = normal[1], all.normalZ[i] = normal[2];
    all.triangle[i] = t;
  }
  return all;
}

}  // namespace palpate
#endif
