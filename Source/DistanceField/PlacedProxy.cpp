#include "DistanceField/PlacedProxy.h"

#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "DistanceField/PlacedProxy.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Takes points into the body's frame, and finds their cells. size: a multiple of the lanes.
/// bricks: -1 for points outside all cells.
HWY_ATTR void locateKernel(const Eigen::Vector3d* points, std::size_t size, const ProxyMap& map,
                           double* bodyX, double* bodyY, double* bodyZ, std::int32_t* bricks,
                           std::int32_t* cells) {
  const hn::CappedTag<double, 8> d;
  const hn::Rebind<std::int32_t, decltype(d)> di;
  using V = hn::Vec<decltype(d)>;
  const Vector3<V> translation{hn::Set(d, map.translation[0]), hn::Set(d, map.translation[1]),
                               hn::Set(d, map.translation[2])},
      lower{hn::Set(d, map.lower[0]), hn::Set(d, map.lower[1]), hn::Set(d, map.lower[2])};
  const auto row = [&](int k) HWY_ATTR {
    return Vector3<V>{hn::Set(d, map.rotation[k][0]), hn::Set(d, map.rotation[k][1]),
                      hn::Set(d, map.rotation[k][2])};
  };
  const Vector3<V> row0 = row(0), row1 = row(1), row2 = row(2);
  const auto zero = hn::Zero(d), end = hn::Set(d, map.units), perLength = hn::Set(d, map.perLength);
  const auto perRow = hn::Set(di, map.bricks), three = hn::Set(di, 3);
  const auto indexOf = [&](auto x, auto y, auto z) HWY_ATTR {
    return hn::ShiftLeft<4>(hn::And(z, three)) + hn::ShiftLeft<2>(hn::And(y, three)) +
           hn::And(x, three);
  };
  for (std::size_t i = 0; i < size; i += hn::Lanes(d)) {
    Vector3<V> p;
    hn::LoadInterleaved3(d, points[i].data(), p.x, p.y, p.z);
    p = p - translation;
    p = {dot(row0, p), dot(row1, p), dot(row2, p)};
    hn::StoreU(p.x, d, bodyX + i);
    hn::StoreU(p.y, d, bodyY + i);
    hn::StoreU(p.z, d, bodyZ + i);
    const Vector3<V> at = perLength * (p - lower);
    const auto inside = hn::And(hn::And(hn::And(hn::Ge(at.x, zero), hn::Lt(at.x, end)),
                                        hn::And(hn::Ge(at.y, zero), hn::Lt(at.y, end))),
                                hn::And(hn::Ge(at.z, zero), hn::Lt(at.z, end)));
    const auto x = hn::DemoteTo(di, hn::IfThenElse(inside, at.x, hn::Set(d, -1.0))),
               y = hn::DemoteTo(di, hn::IfThenElseZero(inside, at.y)),
               z = hn::DemoteTo(di, hn::IfThenElseZero(inside, at.z));
    const auto brick =
        (hn::ShiftRight<4>(z) * perRow + hn::ShiftRight<4>(y)) * perRow + hn::ShiftRight<4>(x);
    hn::StoreU(hn::Or(brick, hn::ShiftRight<31>(x)), di, bricks + i);
    const auto cell = indexOf(hn::ShiftRight<2>(x), hn::ShiftRight<2>(y), hn::ShiftRight<2>(z));
    hn::StoreU(hn::Or(cell, hn::ShiftLeft<6>(indexOf(x, y, z))), di, cells + i);
  }
  leaveLanes();
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(locateKernel);

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::size_t kBlockSize = 128;
static_assert(ProxyPlace::kOutside == static_cast<std::uint32_t>(-1));

Matrix3d inverseOf(const Matrix3d& m) {
  const Vector3d a = m.col(0), b = m.col(1), c = m.col(2);
  const double determinant = a.dot(b.cross(c));
  Matrix3d inverse;
  inverse.row(0) = b.cross(c) / determinant;
  inverse.row(1) = c.cross(a) / determinant;
  inverse.row(2) = a.cross(b) / determinant;
  return inverse;
}

std::array<std::array<double, 3>, 3> rowsOf(const Matrix3d& m) {
  std::array<std::array<double, 3>, 3> rows;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) rows[i][k] = m(i, k);
  return rows;
}

Vector3d turned(const std::array<std::array<double, 3>, 3>& rows, double x, double y, double z) {
  const auto row = [&](int k) { return rows[k][0] * x + rows[k][1] * y + rows[k][2] * z; };
  return {row(0), row(1), row(2)};
}

}  // namespace

/// Points that are looked up together, so that memory is fetched ahead.
struct PlacedProxy::Block {
  alignas(64) std::array<double, kBlockSize> x, y, z;  ///< in the body's frame
  alignas(64) std::array<std::int32_t, kBlockSize> bricks, cells;
  std::array<std::uint32_t, kBlockSize> leaves;
};

PlacedProxy::PlacedProxy(const SurfaceProxy& proxy, const TriangleMesh& body, double thickness)
    : m_proxy(&proxy),
      m_body(&body),
      m_thickness(thickness),
      m_outerSideOnly(body.outerSideOnly && !proxy.isClosed()) {
  PALPATE_ASSERT(thickness >= 0.0);
  Matrix3d rotation = Matrix3d::Identity();
  Vector3d translation = Vector3d::Zero();
  if (body.now.isPlaced()) {
    rotation = body.now.transform().rotation;
    translation = body.now.transform().translation;
  }
  const Matrix3d excess = rotation.transpose() * rotation - Matrix3d::Identity();
  m_stretch = excess.norm();
  m_translation = translation.cwiseAbs().maxCoeff();
  m_turn = rowsOf(rotation - 0.5 * rotation * excess);  // the nearest rotation, to excess^2
  m_map.rotation = rowsOf(inverseOf(rotation));
  for (int k = 0; k < 3; ++k) {
    m_map.translation[k] = translation[k];
    m_map.lower[k] = proxy.lower()[k];
  }
  m_map.perLength = 1.0 / proxy.unit();
  m_map.units = proxy.unitCount();
  m_map.bricks = static_cast<std::int32_t>(proxy.unitCount() / 16);
}

double PlacedProxy::totalError(double error) const {
  PALPATE_ASSERT(error >= 0.0);
  const double lengths = 2.0 * m_proxy->depth() + error;
  return error + m_stretch * lengths + kProxyRounding * (m_proxy->magnitude() + m_translation);
}

void PlacedProxy::locate(const Vector3d* points, std::size_t size, Block& block) const {
  PALPATE_ASSERT(size <= kBlockSize);
  std::array<Vector3d, kBlockSize> padded;
  if (size < kBlockSize) {
    std::copy(points, points + size, padded.begin());
    std::fill(padded.begin() + static_cast<std::ptrdiff_t>(size), padded.end(), Vector3d::Zero());
    points = padded.data();
  }
  HWY_DYNAMIC_DISPATCH(locateKernel)
  (points, kBlockSize, m_map, block.x.data(), block.y.data(), block.z.data(), block.bricks.data(),
   block.cells.data());
}

void PlacedProxy::findLeaves(std::size_t size, bool byBruteForce, Block& block) const {
  const auto placeOf = [&](std::size_t i) {
    return ProxyPlace{static_cast<std::uint32_t>(block.bricks[i]),
                      static_cast<std::uint32_t>(block.cells[i])};
  };
  if (byBruteForce) {
    for (std::size_t i = 0; i < size; ++i)
      block.leaves[i] = m_proxy->leafAtByBruteForce(placeOf(i));
    return;
  }
  for (std::size_t i = 0; i < size; ++i)
    if (block.bricks[i] >= 0) hwy::Prefetch(m_proxy->brick(placeOf(i).brick));
  const auto cellOf = [&](std::size_t i) -> const std::uint32_t* {
    if (block.bricks[i] < 0) return nullptr;
    const ProxyPlace place = placeOf(i);
    return m_proxy->within(*m_proxy->brick(place.brick), place.cell);
  };
  for (std::size_t i = 0; i < size; ++i)
    if (const std::uint32_t* cell = cellOf(i)) hwy::Prefetch(cell);
  for (std::size_t i = 0; i < size; ++i)
    if (const std::uint32_t* cell = cellOf(i))
      if (const std::uint32_t* unit = m_proxy->within(*cell, placeOf(i).cell >> 6))
        hwy::Prefetch(unit);
  const SurfaceProxy::Leaf* const leaves = m_proxy->leaves().data();
  for (std::size_t i = 0; i < size; ++i) {
    block.leaves[i] = m_proxy->leafAt(placeOf(i));
    if (block.leaves[i] != SurfaceProxy::kNoLeaf) hwy::Prefetch(leaves + block.leaves[i]);
  }
}

void PlacedProxy::find(const TriangleMesh& points, std::size_t begin, std::size_t end,
                       bool byBruteForce, const ProxyStep* step, ProxyHits& out) const {
  PALPATE_ASSERT(begin <= end && end <= points.now.size());
  out.normals.clear();
  out.others.clear();
  out.error = 0;
  out.answered = out.count = 0;
  out.hits.resize(end - begin);
  const bool isPlaced = points.now.isPlaced();
  Block block;
  for (std::size_t first = begin; first < end; first += kBlockSize) {
    const std::size_t size = std::min(kBlockSize, end - first);
    const Vector3d* world = points.now.body().data() + first;
    if (isPlaced) {
      out.world.resize(kBlockSize);
      for (std::size_t i = 0; i < size; ++i) out.world[i] = points.now[first + i];
      world = out.world.data();
    }
    locate(world, size, block);
    findLeaves(size, byBruteForce, block);
    addHits(points, static_cast<std::uint32_t>(first), size, block, step, out);
  }
}

/// Adds what the leaves of a block answer for its points, of which the first is given.
void PlacedProxy::addHits(const TriangleMesh& points, std::uint32_t first, std::size_t size,
                          const Block& block, const ProxyStep* step, ProxyHits& out) const {
  const bool isSigned = m_proxy->isClosed();
  const double deepest = isSigned          ? -m_proxy->depth()
                         : m_outerSideOnly ? 0.0
                                           : -std::numeric_limits<double>::infinity();
  const SurfaceProxy::Leaf* const leaves = m_proxy->leaves().data();
  /// distance: L, a lower bound. isFar: whether no leaf answers.
  const auto mayHaveImpact = [&](std::uint32_t point, double distance, bool isFar) {
    if (!step) return false;
    const Vector3d moved = points.now[point] - points.before[point];
    const double motion = largestMotion({moved, moved, false}, step->body);
    const bool isSlow = !isFar && motion <= step->slowMotion;
    return motion > 0.0 &&
           !(distance - points.radius(point) > motion + (isSlow ? 0.0 : step->thickness));
  };
  for (std::size_t i = 0; i < size; ++i) {
    const auto point = static_cast<std::uint32_t>(first + i);
    const std::uint32_t index = block.leaves[i];
    if (!points.topology.isEnabled(point)) continue;
    if (index == SurfaceProxy::kNoLeaf) {
      if (mayHaveImpact(point, m_proxy->depth() - totalError(0.0), true))
        out.others.push_back(point);
      continue;
    }
    const SurfaceProxy::Leaf& leaf = leaves[index];
    const double limit = m_thickness + points.radius(point);
    ++out.answered;
    if (!leaf.hasPlane()) {
      const Nearest nearest = nearestAmong(leaf, {block.x[i], block.y[i], block.z[i]});
      if (mayHaveImpact(point, std::abs(nearest.distance) - totalError(0.0), false)) {
        out.others.push_back(point);
      } else if (!nearest.isHidden && nearest.distance <= limit &&
                 nearest.distance >= -m_proxy->depth()) {
        out.hits[out.count++] = {
            point, ProxyHits::kListed | static_cast<std::uint32_t>(out.normals.size()),
            nearest.distance};
        out.normals.push_back(nearest.normal);
      }
      continue;
    }
    const double distance = leaf.distance(block.x[i], block.y[i], block.z[i]);
    if (mayHaveImpact(point, std::abs(distance) - totalError(leaf.error), false)) {
      out.others.push_back(point);
      continue;
    }
    out.error = std::max(out.error, leaf.error);
    out.hits[out.count] = {point, index, distance};
    out.count += ((isSigned ? distance : std::abs(distance)) <= limit) & (distance >= deepest);
  }
}

/// Angles at corners weight the normals of a corner's triangles. (Baerentzen and Aanaes, Signed
/// distance computation using the angle weighted pseudonormal, 2005.)
bool PlacedProxy::isInFront(std::uint32_t triangle, TriangleFeature feature,
                            const Vector3d& difference) const {
  const MeshTopology& topology = m_body->topology;
  const auto positions = m_body->now.body();
  const auto sideOf = [&](std::uint32_t t, std::uint32_t corner, bool byAngle) {
    const Triangle& corners = topology.elements[t];
    int i = 0;
    while (i < 2 && corners[i] != corner) ++i;
    PALPATE_ASSERT(corners[i] == corner);
    const Vector3d &a = positions[corners[i]], u = positions[corners[(i + 1) % 3]] - a,
                   v = positions[corners[(i + 2) % 3]] - a, normal = u.cross(v);
    const double area = normal.norm();
    if (!(area > 0.0)) return 0.0;
    const double side = normal.dot(difference) / area;
    return byAngle ? std::atan2(area, u.dot(v)) * side : side;
  };
  const Triangle& corners = topology.elements[triangle];
  const int kind = static_cast<int>(feature);
  double side = 0;
  if (feature == TriangleFeature::Face) {
    side = sideOf(triangle, corners[0], false);
  } else if (kind < 3) {
    for (const std::uint32_t t : topology.vertexTriangles[corners[kind]])
      side += sideOf(t, corners[kind], true);
  } else {
    const std::uint32_t edge = topology.triangleEdges[triangle][kind - 3];
    if (edge == kNoEdge) return true;
    for (const std::uint32_t t : topology.edgeTriangles[edge])
      side += sideOf(t, corners[kind - 3], false);
  }
  return side >= 0.0;
}

PlacedProxy::Nearest PlacedProxy::nearestAmong(const SurfaceProxy::Leaf& leaf,
                                               const Vector3d& p) const {
  const auto positions = m_body->now.body();
  const auto triangles = m_proxy->trianglesOf(leaf);
  PALPATE_ASSERT(!triangles.empty());
  const auto squareFrom = [&](const SurfaceProxy::Listed& t) {
    const double dx = p[0] - t.x, dy = p[1] - t.y, dz = p[2] - t.z;
    return dx * dx + dy * dy + dz * dz;
  };
  VertexTriangleDistance nearest{};
  nearest.distance = std::numeric_limits<double>::infinity();
  std::uint32_t triangle = 0;
  const auto test = [&](std::uint32_t t) {
    const auto& [a, b, c] = m_body->topology.elements[t];
    const VertexTriangleDistance found =
        finiteVertexTriangleDistance(p, positions[a], positions[b], positions[c]);
    if (found.distance < nearest.distance || (found.distance == nearest.distance && t < triangle))
      nearest = found, triangle = t;
  };
  // The triangle whose sphere is nearest comes first. It lets most others be left out.
  const auto first =
      std::min_element(triangles.begin(), triangles.end(),
                       [&](const auto& l, const auto& r) { return squareFrom(l) < squareFrom(r); });
  test(first->triangle);
  for (const SurfaceProxy::Listed& other : triangles) {
    const double reach = (nearest.distance + other.radius) * (1.0 + kProxySlack);
    if (other.triangle != first->triangle && squareFrom(other) <= reach * reach)
      test(other.triangle);
  }
  const bool isBehind = (m_proxy->isClosed() || m_outerSideOnly) &&
                        !isInFront(triangle, nearest.feature, nearest.difference);
  if (isBehind) return {-nearest.normal, -nearest.distance, m_outerSideOnly};
  return {nearest.normal, nearest.distance, false};
}

void PlacedProxy::write(const TriangleMesh& points, const ProxyHits& found,
                        ShapeContact* out) const {
  const SurfaceProxy::Leaf* const leaves = m_proxy->leaves().data();
  const bool isSigned = m_proxy->isClosed();
  for (std::size_t i = 0; i < found.count; ++i) {
    const auto& [point, source, hitDistance] = found.hits[i];
    PALPATE_ASSERT(i == 0 || found.hits[i - 1].point < point);
    double distance = hitDistance;
    Vector3d normal;
    if (source & ProxyHits::kListed) {
      const Vector3d& n = found.normals[source & ~ProxyHits::kListed];
      normal = turned(m_turn, n[0], n[1], n[2]);
    } else {
      const auto& [x, y, z] = leaves[source].normal;
      normal = turned(m_turn, x, y, z);
      if (!isSigned && distance < 0) distance = -distance, normal = -normal;
    }
    const Vector3d position = points.now[point];
    out[i] = {ShapeElement::Vertex,
              point,
              {point, point, point},
              Vector3d::UnitX(),
              position,
              position - distance * normal,
              normal,
              distance - points.radius(point),
              1.0};
  }
}

}  // namespace palpate
#endif
