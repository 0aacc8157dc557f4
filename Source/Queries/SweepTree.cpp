#include "Queries/SweepTree.h"

#include "Math/ClosestPoint.h"
#include "Math/Tolerances.h"
#include "Core/Stopping.h"

#include <Eigen/Geometry>

#include <bit>
#include <cmath>
#include <functional>

namespace palpate {

using Eigen::Vector3d;

namespace {

constexpr double kRaySlack = kExitSlack;  ///< in units: more than the rounding of a ray

void enclose(SweepTree::Box& box, const SweepTree::Box& other) {
  for (std::size_t k = 0; k < 4; ++k) {
    box.lower[k] = std::min(box.lower[k], other.lower[k]);
    box.upper[k] = std::max(box.upper[k], other.upper[k]);
  }
}

void enclose(SweepTree::Box& box, const Vector3d& p, const Vector3d& axis) {
  const std::array<double, 4> heights{p[0], p[1], p[2], axis.dot(p)};
  for (std::size_t k = 0; k < 4; ++k) {
    box.lower[k] = std::min(box.lower[k], heights[k]);
    box.upper[k] = std::max(box.upper[k], heights[k]);
  }
}

/// Where a ray meets boxes first.
class RayToBox {
 public:
  RayToBox(const Vector3d& start, const Vector3d& along) : m_start(start) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double slope = along[static_cast<Eigen::Index>(k)];
      m_inverse[k] = std::abs(slope) > kAlongPlane ? 1.0 / slope : 0.0;
    }
  }
  /// At `end` at the latest, else never.
  double operator()(const auto& box, double end) const {
    if (box.lower[0] > box.upper[0]) return kInfinity;  // no triangles
    double first = 0, last = end;
    for (std::size_t k = 0; k < 3; ++k) {
      const double start = m_start[static_cast<Eigen::Index>(k)];
      const double low = box.lower[k] - kRaySlack - start, high = box.upper[k] + kRaySlack - start;
      if (m_inverse[k] == 0.0) {
        if (low > 0 || high < 0) return kInfinity;
        continue;
      }
      const double atLow = low * m_inverse[k], atHigh = high * m_inverse[k];
      first = std::max(first, std::min(atLow, atHigh));
      last = std::min(last, std::max(atLow, atHigh));
    }
    return first <= last ? first : kInfinity;
  }

 private:
  Vector3d m_start;
  std::array<double, 3> m_inverse{};  ///< of the components; 0: along the planes
};

}  // namespace

/// The order depends on positions and numbers only, unlike that of an octree that was refitted: it
/// decides which of equally late contacts is the last.
void SweepTree::load(const MeshTopology& topology, const BodyVertices& vertices,
                     const SweepFrame& frame) {
  TimeCheck check(256);
  order.clear();
  topology.forEachElement([&](std::uint32_t element) {
    check();
    const auto [p, q, r] = cornersOf(topology.elements[element], vertices.positions);
    if (!hasArea(p, q, r)) return;  // its edges are those of other triangles
    const Corners at{frame(p), frame(q), frame(r)};
    const Vector3d lower = at[0].cwiseMin(at[1]).cwiseMin(at[2]),
                   upper = at[0].cwiseMax(at[1]).cwiseMax(at[2]);
    order.push_back({lower + upper, upper - lower, element});
  });
  leaves = std::bit_ceil(std::max<std::size_t>(1, (order.size() + kLeaf - 1) / kLeaf));
  divide(0, leaves);
  corners.clear();
  for (const Place& place : order) {
    const Corners p = cornersOf(topology.elements[place.element], vertices.positions);
    corners.push_back({frame(p[0]), frame(p[1]), frame(p[2])});
  }
}

/// Divides the triangles of some leaves at the middle along the axis along which they are spread
/// furthest, in proportion to their extents: of plates, for instance, only the order across them
/// tells which triangles are near each other.
void SweepTree::divide(std::size_t leaf, std::size_t count) {
  const auto begin = order.begin() + static_cast<std::ptrdiff_t>(placeOf(leaf)),
             end = order.begin() + static_cast<std::ptrdiff_t>(placeOf(leaf + count));
  const auto byElement = [](const Place& l, const Place& r) { return l.element < r.element; };
  checkTime();
  if (count == 1 || begin == end) return std::sort(begin, end, byElement);
  Vector3d lower = Vector3d::Constant(kInfinity), upper = -lower, extents = Vector3d::Zero();
  for (auto place = begin; place != end; ++place) {
    lower = lower.cwiseMin(place->middle);
    upper = upper.cwiseMax(place->middle);
    extents += place->extents;
  }
  const Vector3d spread = 0.5 * static_cast<double>(end - begin) * (upper - lower);
  int axis = 0;
  for (const int k : {1, 2}) {
    const double here = spread[k] * (spread[axis] + extents[axis]),
                 best = spread[axis] * (spread[k] + extents[k]);
    if (here > best || (here == best && spread[k] > spread[axis])) axis = k;
  }
  std::nth_element(begin, order.begin() + static_cast<std::ptrdiff_t>(placeOf(leaf + count / 2)),
                   end, [&](const Place& l, const Place& r) {
                     return l.middle[axis] < r.middle[axis] ||
                            (l.middle[axis] == r.middle[axis] && byElement(l, r));
                   });
  divide(leaf, count / 2);
  divide(leaf + count / 2, count / 2);
}

/// Moves each vertex so that its faces move inward by the depth, at most by kMost of it.
void SweepInset::make(const SweepTree& tree, const MeshTopology& topology, const BodyVertices& own,
                      const SweepFrame& frame, double depth) {
  constexpr double kWide = 0.25;
  constexpr int kTurns = 8;
  normals.assign(topology.elements.size(), Vector3d::Zero());
  TimeCheck check(256);
  const Vector3d centre = frame(own.box.center());
  double volume = 0;
  for (std::size_t i = 0; i < tree.corners.size(); ++i) {
    check();
    const auto& [p, q, r] = tree.corners[i];
    const Vector3d across = (q - p).cross(r - p);
    volume += across.dot(p - centre);
    const double length = across.norm();
    if (length > 0) normals[tree.order[i].element] = across / length;
  }
  const double outward = volume < 0 ? -1.0 : 1.0;
  vertices.resize(own.positions.size());
  for (std::uint32_t v = 0; v < vertices.size(); ++v) {
    check();
    vertices[v] = frame(own.positions[v]);
    const auto around = topology.vertexTriangles[v];
    Vector3d way = Vector3d::Zero();
    for (const std::uint32_t t : around) way += normals[t];
    // Turns towards the faces along which it leads least.
    double least = 0;
    for (int turn = 0;; ++turn) {
      const double length = way.norm();
      if (length > 0) way /= length;
      least = 1;
      std::uint32_t worst = kNoElement;
      for (const std::uint32_t t : around) {
        if (normals[t].isZero(0.0) || !(normals[t].dot(way) < least)) continue;
        least = normals[t].dot(way);
        worst = t;
      }
      if (least > kWide || worst == kNoElement || turn == kTurns) break;
      way += normals[worst];
    }
    vertices[v] -= outward * depth / std::max(least, 1.0 / kMost) * way;
  }
  triangles.resize(tree.corners.size());
  for (std::size_t i = 0; i < triangles.size(); ++i)
    triangles[i] = cornersOf(topology.elements[tree.order[i].element], vertices);
}

void SweepTree::makeBoxes(const Vector3d& axis, const SweepInset* inset, bool closed) {
  const Box empty{{kInfinity, kInfinity, kInfinity, kInfinity},
                  {-kInfinity, -kInfinity, -kInfinity, -kInfinity}};
  boxes.assign(2 * leaves, empty);
  own.assign(corners.size(), empty);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    Box& box = own[i];
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector3d& p = corners[i][k];
      enclose(box, p, axis);
      if (!inset) continue;
      const Vector3d& q = inset->triangles[i][k];
      enclose(box, q, axis);
      if (closed) enclose(box, p + p - q, axis);
    }
  }
  for (std::size_t leaf = 0; leaf < leaves; ++leaf)
    for (std::size_t i = placeOf(leaf); i < placeOf(leaf + 1); ++i)
      enclose(boxes[leaves + leaf], own[i]);
  for (std::size_t node = leaves - 1; node > 0; --node)
    for (const std::size_t child : {2 * node, 2 * node + 1}) enclose(boxes[node], boxes[child]);
}

/// Edges are widened by kExitWeight, so that nothing passes between triangles. A triangle at the
/// start counts, even if it is behind it within rounding.
std::optional<SweepTree::Hit> SweepTree::firstHit(const Vector3d& start, const Vector3d& along,
                                                  double end) const {
  const RayToBox entryAt(start, along);
  double t = end;
  std::uint32_t element = kNoElement;
  const auto entryOf = [&](const Box& box) { return entryAt(box, t); };
  const auto test = [&](std::size_t i) {
    const auto& [a, b, c] = corners[i];
    const Vector3d u = b - a, v = c - a, normal = u.cross(v), from = start - a;
    const double slope = normal.dot(along);
    if (slope == 0) return;
    const double at = -normal.dot(from) / slope;
    if (!(at >= -kRaySlack && at < t)) return;
    const Vector3d across = along.cross(from);
    const double x = v.dot(across) / slope, y = -u.dot(across) / slope;
    if (!(x >= -kExitWeight && y >= -kExitWeight && x + y <= 1 + kExitWeight)) return;
    t = std::max(at, 0.0);
    element = order[i].element;
  };
  struct Entry {
    std::uint32_t node;
    double at;
  };
  std::array<Entry, 64> stack;
  std::size_t size = 0;
  stack[size++] = {1, entryOf(boxes[1])};
  while (size > 0) {
    const auto [node, at] = stack[--size];
    if (!(at <= t)) continue;
    if (node < leaves) {
      Entry near{2 * node, entryOf(boxes[2 * node])},
          far{2 * node + 1, entryOf(boxes[2 * node + 1])};
      if (far.at < near.at) std::swap(near, far);
      if (far.at < kInfinity) stack[size++] = far;
      if (near.at < kInfinity) stack[size++] = near;
      continue;
    }
    const auto [begin, behind] = trianglesOf(node);
    for (std::size_t i = begin; i < behind; ++i) test(i);
  }
  if (element == kNoElement) return {};
  return Hit{t, element};
}

}  // namespace palpate
