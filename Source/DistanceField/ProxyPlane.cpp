#include "DistanceField/ProxyPlane.h"

#include "Math/Tolerances.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "DistanceField/ProxyPlane.cpp"
#include "Core/Simd.h"

#ifndef PALPATE_PROXY_PLANE_CPP
#define PALPATE_PROXY_PLANE_CPP
namespace palpate {

/// Twice a triangle's area, in squares of its longest edge: thinner triangles are used without
/// their normal.
constexpr double kThinnestProxyTriangle = 0x1p-20;
/// rad. A cross product of two edges has an error below 2^-50 of the square of the longest edge, so
/// that the direction has one below 2^-30.
constexpr double kProxyNormalError = 0x1p-30;

/// The column in which a plane is looked for, about a node's centre: axes u and v, and the normal.
struct ProxyPlanes::Window {
  ProxyCube cube;
  Eigen::Vector3d u, v, normal;
  Eigen::Vector3d footprint;   ///< L: half sizes of the node along the axes
  double more;                 ///< L, by which the window exceeds the footprint
  std::array<double, 2> half;  ///< L: half sizes of the window
};

/// A claim about heights above a window's centre, for lanes.
struct ProxyLaneClaim {
  Eigen::Vector3d centre, u, v, normal;
  std::array<double, 3> footprint;
  std::array<double, 2> half;
  double more, cubeHalf, rounding, cosine, middle, most;
};

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
    keep(from.x, to.x);
    keep(from.y, to.y);
    keep(from.z, to.z);
    keep(from.radius, to.radius);
    keep(from.normalX, to.normalX);
    keep(from.normalY, to.normalY);
    keep(from.normalZ, to.normalZ);
    keep(from.triangle, to.triangle);
    count += static_cast<std::size_t>(std::popcount(kept));
  }
  to.size = count;
  leaveLanes();
  return nearest;
}

/// Places of the items within `reach` of a point.
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
    for (std::uint32_t bits = bitsOf(d, isNear); bits != 0; bits &= bits - 1)
      places[count++] =
          static_cast<std::uint32_t>(i) + static_cast<std::uint32_t>(std::countr_zero(bits));
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

/// Places of the triangles that may reach into the window, with bounds of their heights there;
/// infinite bounds where the normal may be outside the cone.
HWY_ATTR std::size_t windowKernel(const ProxyItems& items, const ProxyLaneClaim& claim,
                                  std::uint32_t* places, double* lows, double* highs) {
  const ItemTag d;
  const Vector3<ItemV> centre = spreadAxis(claim.centre), axisU = spreadAxis(claim.u),
                       axisV = spreadAxis(claim.v), up = spreadAxis(claim.normal);
  const ItemV infinite = hn::Set(d, std::numeric_limits<double>::infinity()),
              halfU = hn::Set(d, claim.half[0]), halfV = hn::Set(d, claim.half[1]),
              rounding = hn::Set(d, claim.rounding), cone = hn::Set(d, claim.cosine),
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

/// Raises `error` as far as the triangles' spheres and normals need it for condition 4. Returns the
/// places of those that need more than claim.most.
HWY_ATTR std::size_t outsideKernel(const ProxyItems& items, const ProxyLaneClaim& claim,
                                   double& error, std::uint32_t* places) {
  const ItemTag d;
  const Vector3<ItemV> centre = spreadAxis(claim.centre), axisU = spreadAxis(claim.u),
                       axisV = spreadAxis(claim.v), up = spreadAxis(claim.normal);
  const ItemV footU = hn::Set(d, claim.footprint[0]), footV = hn::Set(d, claim.footprint[1]),
              front = hn::Set(d, claim.footprint[2] - claim.middle),
              back = hn::Set(d, claim.footprint[2] + claim.middle),
              middle = hn::Set(d, claim.middle), least = hn::Set(d, error),
              most = hn::Set(d, claim.most), rounding = hn::Set(d, claim.rounding),
              more = hn::Set(d, claim.more), zero = hn::Zero(d), steep = hn::Set(d, 0.5),
              half = hn::Set(d, claim.cubeHalf * (1.0 + kProxySlack)),
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
    const auto needOf = [&](ItemV side, ItemV height, ItemV plane) HWY_ATTR {
      return hn::IfThenZeroElse(isFarAside(lateral, side, height, least),
                                hn::IfThenElse(isFacing, hn::Min(height, plane), height));
    };
    const ItemV need = hn::IfThenElseZero(
        isOpen, hn::Max(needOf(front, high, loss + above), needOf(back, low, loss - above)));
    isOpen = hn::Gt(need, most);
    needed = hn::Max(needed, hn::IfThenElse(isOpen, zero, need));
    for (std::uint32_t bits = bitsOf(d, isOpen); bits != 0; bits &= bits - 1)
      places[count++] =
          static_cast<std::uint32_t>(i) + static_cast<std::uint32_t>(std::countr_zero(bits));
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
HWY_EXPORT(windowKernel);
HWY_EXPORT(outsideKernel);

using Eigen::Vector3d;

namespace {

/// Vectors of lanes are loaded and stored whole.
constexpr std::size_t kPadding = 8;
/// Of windows around footprints, in half edges of the node. They are tried one after another.
constexpr std::array kMargins{0.0, 0.125, 0.5, 1.0};
constexpr double kInfinite = std::numeric_limits<double>::infinity();

}  // namespace

void ProxyItems::reserve(std::size_t count) {
  for (Buffer<double>* each : {&x, &y, &z, &radius, &normalX, &normalY, &normalZ, &triangle})
    if (each->size() < count + kPadding) each->resize(count + count / 8 + kPadding);
}

void ProxyItems::append(const ProxyItems& from, std::size_t i) {
  constexpr auto kAll = std::array{&ProxyItems::x,       &ProxyItems::y,       &ProxyItems::z,
                                   &ProxyItems::radius,  &ProxyItems::normalX, &ProxyItems::normalY,
                                   &ProxyItems::normalZ, &ProxyItems::triangle};
  for (const auto each : kAll) (this->*each)[size] = (from.*each)[i];
  ++size;
}

NearestItem nearestOf(const ProxyItems& items, const Vector3d& point, double near) {
  return HWY_DYNAMIC_DISPATCH(nearestItemKernel)(items, point, near);
}

std::size_t keepWithin(const ProxyItems& from, const Vector3d& point, double reach,
                       double leastSquare, ProxyItems& to) {
  to.reserve(from.size);
  return HWY_DYNAMIC_DISPATCH(keepWithinKernel)(from, point, reach, leastSquare, to);
}

ProxyPlanes::ProxyPlanes(const MeshTopology& topology, std::span<const Vector3d> positions,
                         double allowedError, double normalCone, double rounding)
    : m_topology(topology),
      m_positions(positions),
      m_allowedError(allowedError),
      m_cosine(std::cos(normalCone)),
      m_rounding(rounding) {
  for (const auto& [i, j, k] : m_topology.triangles)
    m_normals.push_back((m_positions[j] - m_positions[i]).cross(m_positions[k] - m_positions[i]));
}

ProxyItems ProxyPlanes::itemsOfAll() const {
  ProxyItems all;
  all.reserve(m_topology.triangles.size());
  for (std::uint32_t t = 0; t < m_topology.triangles.size(); ++t) {
    if (!m_topology.isEnabled(t)) continue;
    const Triangle& corners = m_topology.triangles[t];
    const Vector3d &a = m_positions[corners[0]], &b = m_positions[corners[1]],
                   &c = m_positions[corners[2]];
    const Vector3d centre = (a + b + c) / 3.0;
    const double square = std::max(
        {(a - centre).squaredNorm(), (b - centre).squaredNorm(), (c - centre).squaredNorm()});
    const double edge =
        std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    const double area = m_normals[t].norm();
    const bool isClosed = std::all_of(corners.begin(), corners.end(), [&](std::uint32_t v) {
      return m_topology.hasClosedStar[v] != 0;
    });
    Vector3d normal = Vector3d::Zero();
    if (isClosed && area > kThinnestProxyTriangle * edge) normal = m_normals[t] / area;
    const std::size_t i = all.size++;
    all.x[i] = centre[0], all.y[i] = centre[1], all.z[i] = centre[2];
    all.radius[i] = std::sqrt(square) * (1.0 + kProxySlack) + m_rounding;
    all.normalX[i] = normal[0], all.normalY[i] = normal[1], all.normalZ[i] = normal[2];
    all.triangle[i] = t;
  }
  return all;
}

/// A triangle about a node's centre: two coordinates along a plane, and the height.
struct ProxyPlanes::Shadow {
  std::array<Vector3d, 3> corners;
  Vector3d low, high;
};

ProxyPlanes::Shadow ProxyPlanes::shadowOf(std::uint32_t triangle, const Window& window) const {
  Shadow shadow;
  for (int i = 0; i < 3; ++i) {
    const Vector3d p = m_positions[m_topology.triangles[triangle][i]] - window.cube.centre;
    shadow.corners[i] = {window.u.dot(p), window.v.dot(p), window.normal.dot(p)};
  }
  const auto& [a, b, c] = shadow.corners;
  shadow.low = a.cwiseMin(b).cwiseMin(c);
  shadow.high = a.cwiseMax(b).cwiseMax(c);
  return shadow;
}

namespace {

/// Extends [low, high] by the heights of the part of a triangle in the window. Returns whether
/// there is such a part.
bool addHeights(const std::array<Vector3d, 3>& corners, const Vector3d& least, const Vector3d& most,
                const std::array<double, 2>& window, double& low, double& high) {
  std::array<Vector3d, 8> polygon, next;
  std::copy(corners.begin(), corners.end(), polygon.begin());
  std::size_t size = 3;
  for (int k = 0; k < 2; ++k)
    for (const double sign : {1.0, -1.0}) {
      if (sign > 0 ? most[k] <= window[k] : least[k] >= -window[k]) continue;
      std::size_t count = 0;
      for (std::size_t i = 0; i < size; ++i) {
        const Vector3d &p = polygon[i], &q = polygon[(i + 1) % size];
        const double fromP = window[k] - sign * p[k], fromQ = window[k] - sign * q[k];
        if (fromP >= 0.0) next[count++] = p;
        if ((fromP < 0.0) != (fromQ < 0.0) && fromP != fromQ)
          next[count++] = p + fromP / (fromP - fromQ) * (q - p);
      }
      polygon = next;
      size = count;
      if (size == 0) return false;
    }
  for (std::size_t i = 0; i < size; ++i) {
    low = std::min(low, polygon[i][2]);
    high = std::max(high, polygon[i][2]);
  }
  return true;
}

}  // namespace

/// The mean normal near the nearest point; zero if the normals there are not within the cone.
Vector3d ProxyPlanes::normalNear(const Surroundings& around, Scratch& scratch) const {
  const std::size_t count = HWY_DYNAMIC_DISPATCH(placesWithinKernel)(
      around.items, around.nearest, around.cube.halfDiagonal, scratch.places.data());
  const Vector3d* first = nullptr;
  const double widest = 2.0 * m_cosine * m_cosine - 1.0;  // of twice the angle
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3d& normal = m_normals[around.items.triangleAt(scratch.places[i])];
    if (!first) first = &normal;
    const double along = first->dot(normal);
    if (widest > 0.0 &&
        !(along > 0.0 &&
          along * along >= 0.99 * widest * widest * first->squaredNorm() * normal.squaredNorm()))
      return Vector3d::Zero();
    sum += normal;
  }
  const double length = sum.norm();
  return length > 0.0 ? Vector3d(sum / length) : Vector3d::Zero();
}

bool ProxyPlanes::isInCone(std::uint32_t triangle, const Vector3d& normal) const {
  const Vector3d& of = m_normals[triangle];
  const double along = normal.dot(of), least = m_cosine * (1.0 + kProxySlack);
  if (!(along > 0.0 && along * along >= least * least * of.squaredNorm())) return false;
  const Triangle& corners = m_topology.triangles[triangle];
  return std::all_of(corners.begin(), corners.end(),
                     [&](std::uint32_t v) { return m_topology.hasClosedStar[v] != 0; });
}

/// The least and the greatest height of the surface in the window. Returns false if their
/// difference or a normal allows no plane.
bool ProxyPlanes::findHeights(const Surroundings& around, const Window& window, double& low,
                              double& high, Scratch& scratch) const {
  const ProxyCube& cube = around.cube;
  const ProxyLaneClaim claim{cube.centre, window.u,
                             window.v,    window.normal,
                             {},          window.half,
                             window.more, cube.half,
                             m_rounding,  m_cosine * (1.0 + kProxySlack) + kProxyNormalError,
                             0,           0};
  const std::size_t count = HWY_DYNAMIC_DISPATCH(windowKernel)(
      around.items, claim, scratch.places.data(), scratch.low.data(), scratch.high.data());
  low = kInfinite, high = -kInfinite;
  const auto add = [&](std::size_t i) {
    if (scratch.low[i] >= low && scratch.high[i] <= high) return true;
    const std::uint32_t triangle = around.items.triangleAt(scratch.places[i]);
    const Shadow shadow = shadowOf(triangle, window);
    for (int k = 0; k < 2; ++k)
      if (shadow.high[k] < -window.half[k] || shadow.low[k] > window.half[k]) return true;
    if (!addHeights(shadow.corners, shadow.low, shadow.high, window.half, low, high)) return true;
    return isInCone(triangle, window.normal) && high - low <= 2.0 * m_allowedError;
  };
  if (count == 0) return false;
  // The extremes come first. They let most others be left out.
  const auto end = static_cast<std::ptrdiff_t>(count);
  const auto lowest = std::min_element(scratch.low.begin(), scratch.low.begin() + end),
             highest = std::max_element(scratch.high.begin(), scratch.high.begin() + end);
  if (!add(static_cast<std::size_t>(lowest - scratch.low.begin())) ||
      !add(static_cast<std::size_t>(highest - scratch.high.begin())))
    return false;
  for (std::size_t i = 0; i < count; ++i)
    if (!add(i)) return false;
  return low <= high;
}

bool ProxyPlanes::find(const Surroundings& around, Plane& plane, Scratch& scratch) const {
  for (Buffer<double>* each : {&scratch.low, &scratch.high})
    if (each->size() < around.items.size) each->resize(around.items.size);
  if (scratch.places.size() < around.items.size) scratch.places.resize(around.items.size);
  const Vector3d normal = normalNear(around, scratch);
  if (normal.isZero(0.0)) return false;
  int least = 0;
  normal.cwiseAbs().minCoeff(&least);
  Window window{around.cube, normal.cross(Vector3d::Unit(least)).normalized(), {}, normal, {}, 0,
                {}};
  window.v = normal.cross(window.u);
  const auto extentAlong = [&](const Vector3d& axis) {
    return around.cube.half * axis.cwiseAbs().sum() * (1.0 + kProxySlack) + m_rounding;
  };
  window.footprint = {extentAlong(window.u), extentAlong(window.v), extentAlong(normal)};
  const Vector3d toNearest = around.nearest - around.cube.centre;
  const std::array<double, 2> nearest{window.u.dot(toNearest), window.v.dot(toNearest)};
  for (const double margin : kMargins) {
    window.more = margin * around.cube.half;
    window.half = {window.footprint[0] + window.more, window.footprint[1] + window.more};
    double low, high;
    if (!findHeights(around, window, low, high, scratch)) return false;
    const double middle = 0.5 * low + 0.5 * high;
    double error = (0.5 * high - 0.5 * low) * (1.0 + kProxySlack) + m_rounding;
    if (!(error <= m_allowedError)) return false;
    if (!(std::abs(nearest[0]) + m_rounding <= window.half[0] &&
          std::abs(nearest[1]) + m_rounding <= window.half[1]))
      continue;
    if (!isNearestInside(around, window, middle, error, scratch)) continue;
    const double height = std::abs(middle) + error,
                 corner = std::sqrt(height * height + window.half[0] * window.half[0] +
                                    window.half[1] * window.half[1]);
    if (!(corner * (1.0 + kProxySlack) + m_rounding <= around.reach)) return false;
    plane = {normal, normal.dot(around.cube.centre) + middle, error};
    return true;
  }
  return false;
}

/// Whether points of the node have no surface outside the window that is nearer to them than the
/// plane less the error. Raises the error if this is needed. middle: the plane's height above the
/// centre.
bool ProxyPlanes::isNearestInside(const Surroundings& around, const Window& window, double middle,
                                  double& error, Scratch& scratch) const {
  const Vector3d& footprint = window.footprint;
  const ProxyLaneClaim claim{around.cube.centre,
                             window.u,
                             window.v,
                             window.normal,
                             {footprint[0], footprint[1], footprint[2]},
                             window.half,
                             window.more,
                             around.cube.half,
                             m_rounding,
                             0,
                             middle,
                             m_allowedError};
  const std::size_t count =
      HWY_DYNAMIC_DISPATCH(outsideKernel)(around.items, claim, error, scratch.places.data());
  return std::all_of(
      scratch.places.begin(), scratch.places.begin() + static_cast<std::ptrdiff_t>(count),
      [&](std::uint32_t place) {
        return isFarEnough(shadowOf(around.items.triangleAt(place), window), window, middle, error);
      });
}

/// The same of one triangle, by its corners.
bool ProxyPlanes::isFarEnough(const Shadow& shadow, const Window& window, double middle,
                              double error) const {
  const Vector3d& footprint = window.footprint;
  const double high = shadow.high[2] - middle + m_rounding,
               low = shadow.low[2] - middle - m_rounding;
  if (!(high > error || low < -error)) return true;
  double square = 0;
  for (int k = 0; k < 2; ++k) {
    const double gap =
        std::max({0.0, shadow.low[k] - footprint[k], -footprint[k] - shadow.high[k]});
    square += gap * gap;
  }
  const double lateral =
      std::max(window.more, std::sqrt(square)) * (1.0 - kProxySlack) - m_rounding;
  if (!(lateral > 0.0)) return false;
  const auto isFar = [&](double side, double height) {
    if (!(side > error && height > error)) return true;
    const double most = std::min(height, side);
    const double limit = (most - error) * (2.0 * side - most - error);
    return lateral * lateral >= limit * (1.0 + kProxySlack);
  };
  return isFar(footprint[2] - middle, high) && isFar(footprint[2] + middle, -low);
}

}  // namespace palpate
#endif
