#include "Mesh/UnfoldedStars.h"

#include "Math/Box.h"

#include <algorithm>
#include <array>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Mesh/UnfoldedStars.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
namespace unfolded_stars {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 16>;
using V = hn::Vec<D>;
using Point = Vector3<V>;

HWY_INLINE V coordinate(const Point& p, int k) { return k == 0 ? p.x : k == 1 ? p.y : p.z; }

/// The views of triangles, as sets of ViewBit, by the triangles' ids.
///
/// Rounding: let R be at least the size of a coordinate of any corner, S that of both edges from
/// corner 0 together, at most R. A float is off by 2^-23 R, an edge by E = 2^-21 R. A component of
/// the cross product of two edges, or the sum of two such components, is off by less than 4 (E_i
/// S_j + S_i E_j) + 16 E_i E_j.
HWY_ATTR void viewsKernel(const Triangle* triangles, const std::uint32_t* ids, std::size_t size,
                          const FloatPoint* before, const FloatPoint* now, std::uint32_t* views) {
  constexpr float kLargest = 0x1p60f;  // products are in range, and no float was clamped
  const D d;
  const hn::RebindToUnsigned<D> du;
  constexpr std::size_t kLanes = hn::MaxLanes(D());
  alignas(64) FloatPoint corners[2][3][kLanes];
  alignas(64) std::uint32_t bits[kLanes];
  for (std::size_t begin = 0; begin < size; begin += kLanes) {
    const std::size_t count = std::min(kLanes, size - begin);
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      for (int i = 0; i < 3; ++i) {
        const std::uint32_t vertex = triangles[begin + std::min(lane, count - 1)][i];
        corners[0][i][lane] = before[vertex];
        corners[1][i][lane] = now[vertex];
      }
    Point p[2][3];
    for (int end = 0; end < 2; ++end)
      for (int i = 0; i < 3; ++i) {
        V unused;
        hn::LoadInterleaved4(d, &corners[end][i][0].x, p[end][i].x, p[end][i].y, p[end][i].z,
                             unused);
      }
    const Point a = p[0][1] - p[0][0], b = p[0][2] - p[0][0], c = p[1][1] - p[1][0],
                e = p[1][2] - p[1][0];
    const Point first = cross(a, b), middle = cross(a, e) + cross(c, b), last = cross(c, e);
    V extent[3], error[3], largest = hn::Zero(d);
    for (int k = 0; k < 3; ++k) {
      const auto most = [&](const Point& s, const Point& t) HWY_ATTR {
        return hn::Max(hn::Abs(coordinate(s, k)), hn::Abs(coordinate(t, k)));
      };
      extent[k] = most(a, c) + most(b, e);
      const V farthest = most(p[0][0], p[1][0]) + extent[k];
      error[k] = farthest * hn::Set(d, 0x1p-19f) + hn::Set(d, OutwardRounding::kAbsolute);
      largest = hn::Max(largest, farthest);
    }
    const auto inRange = hn::Lt(largest, hn::Set(d, kLargest));
    auto view = hn::Zero(du);
    const auto add = [&](auto mask, std::uint32_t bit) HWY_ATTR {
      view = hn::Or(view, hn::IfThenElseZero(hn::RebindMask(du, mask), hn::Set(du, bit)));
    };
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      const V limit = error[i] * (extent[j] + error[j]) + error[j] * extent[i] +
                      hn::Set(d, OutwardRounding::kAbsolute);
      const V x = coordinate(first, k), y = coordinate(middle, k), z = coordinate(last, k);
      add(hn::And(inRange, hn::Gt(hn::Min(x, hn::Min(y, z)), limit)), ViewBit::fromAbove(k));
      add(hn::And(inRange, hn::Lt(hn::Max(x, hn::Max(y, z)), hn::Neg(limit))),
          ViewBit::fromBelow(k));
      for (int corner = 0; corner < 3; ++corner) {
        const V at = coordinate(p[0][corner], k);
        add(hn::And(hn::Lt(coordinate(p[0][(corner + 1) % 3], k), at),
                    hn::Ge(coordinate(p[0][(corner + 2) % 3], k), at)),
            ViewBit::comesUp(corner, k));
      }
    }
    hn::Store(view, du, bits);
    for (std::size_t lane = 0; lane < count; ++lane) views[ids[begin + lane]] = bits[lane];
  }
}

}  // namespace unfolded_stars

using unfolded_stars::viewsKernel;

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(viewsKernel);

namespace {

constexpr std::size_t kGrain = 2048;

/// Whether the closed star is visible from one side along an axis, and goes around the vertex once.
/// The number of times that another coordinate rises to the vertex's value counts the turns.
bool isUnfolded(const MeshTopology& topology, const Buffer<std::uint32_t>& views,
                std::size_t vertex) {
  const auto star = topology.vertexTriangles[vertex];
  std::uint32_t common = ~0u;  // bits that all views have
  std::array<std::size_t, 3> crossings{};
  for (const std::uint32_t t : star) {
    const Triangle& corners = topology.elements[t];
    const int corner = (corners[1] == vertex) + 2 * (corners[2] == vertex);
    common &= views[t];
    for (int k = 0; k < 3; ++k) crossings[k] += (views[t] & ViewBit::comesUp(corner, k)) != 0;
  }
  for (int k = 0; k < 3; ++k)
    if (common & (ViewBit::fromAbove(k) | ViewBit::fromBelow(k)) && crossings[(k + 1) % 3] == 1)
      return true;
  return false;
}

}  // namespace

void UnfoldedStars::find(const MeshTopology& topology, std::span<const std::uint32_t> order,
                         std::span<const Triangle> ordered, const FloatPoint* before,
                         const FloatPoint* now, const Threads& threads) {
  m_views.resize(topology.elements.size());
  threads.forChunks(ordered.size(), kGrain, [&](std::size_t, std::size_t from, std::size_t to) {
    HWY_DYNAMIC_DISPATCH(viewsKernel)
    (ordered.data() + from, order.data() + from, to - from, before, now, m_views.data());
  });
  const auto forAll = [&](std::size_t size, auto&& f) {
    threads.forChunks(size, kGrain, [&](std::size_t, std::size_t from, std::size_t to) {
      for (std::size_t i = from; i < to; ++i) f(i);
    });
  };
  m_unfolded.resize(topology.vertexCount);
  forAll(topology.vertexCount, [&](std::size_t v) {
    m_unfolded[v] = topology.hasClosedStar[v] && isUnfolded(topology, m_views, v);
  });
  m_triangles.reserve(ordered.size() + BoxArrays::kPadding);
  m_triangles.resize(ordered.size());
  forAll(ordered.size(), [&](std::size_t i) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::uint32_t vertex = ordered[i][corner];
      m_triangles[i][corner] =
          m_unfolded[vertex] ? vertex : ~static_cast<std::uint32_t>(3 * i + corner);
    }
  });
}

}  // namespace palpate
#endif
