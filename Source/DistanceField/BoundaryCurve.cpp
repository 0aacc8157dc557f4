#include "DistanceField/BoundaryCurve.h"

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

namespace palpate {

using Eigen::Vector3d;

namespace {

constexpr std::uint32_t kEdgesPerLeaf = 4;
/// The distance, in radii of a node, from which its edges are bounded together.
constexpr double kFarRadii = 2.0;
/// Rounding of the bound: sums of positive terms.
constexpr double kSteepnessSlack = 1.0 + 0x1p-20;

/// For each vertex, the lowest one in order of coordinates that is at the same place.
std::vector<std::uint32_t> placesOf(const Positions& positions) {
  std::vector<std::uint32_t> order(positions.size()), places(positions.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto coordinates = [&](std::uint32_t v) {
    const Vector3d p = positions[v];
    return std::array{p[0], p[1], p[2]};
  };
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return coordinates(a) < coordinates(b); });
  for (std::size_t i = 0; i < order.size(); ++i)
    places[order[i]] = i > 0 && coordinates(order[i]) == coordinates(order[i - 1])
                           ? places[order[i - 1]]
                           : order[i];
  return places;
}

double distanceOf(const Vector3d& p, const Vector3d& start, const Vector3d& end) {
  const Vector3d along = end - start;
  const double t = (p - start).dot(along) / along.squaredNorm();
  return (p - start - std::clamp(t, 0.0, 1.0) * along).norm();
}

}  // namespace

BoundaryCurve::BoundaryCurve(const TriangleMesh& mesh) {
  struct Passage {
    Segment ends;  ///< ascending
    int count;     ///< 1 or -1: the direction
  };
  const std::vector<std::uint32_t> places = placesOf(mesh.now);
  std::vector<Passage> passages;
  passages.reserve(3 * mesh.topology.elements.size());
  for (const Triangle& corners : mesh.topology.elements)
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t a = places[corners[i]], b = places[corners[(i + 1) % 3]];
      if (a != b) passages.push_back({{std::min(a, b), std::max(a, b)}, a < b ? 1 : -1});
    }
  std::sort(passages.begin(), passages.end(),
            [](const Passage& a, const Passage& b) { return a.ends < b.ends; });
  for (std::size_t i = 0; i < passages.size();) {
    const Segment ends = passages[i].ends;
    int count = 0;
    for (; i < passages.size() && passages[i].ends == ends; ++i) count += passages[i].count;
    if (count == 0) continue;
    const std::size_t first = count > 0 ? 0 : 1;
    m_edges.push_back({mesh.now[ends[first]], mesh.now[ends[1 - first]], std::abs(double(count))});
    m_largest = std::max({m_largest, m_edges.back().start.cwiseAbs().maxCoeff(),
                          m_edges.back().end.cwiseAbs().maxCoeff()});
  }
  if (!m_edges.empty()) addNode(0, static_cast<std::uint32_t>(m_edges.size()));
}

/// Adds the tree of some edges. Each node halves its edges along the longest side of their box.
void BoundaryCurve::addNode(std::uint32_t begin, std::uint32_t end) {
  PALPATE_ASSERT(begin < end && end <= m_edges.size());
  Eigen::AlignedBox3d box;
  double length = 0.0;
  for (std::uint32_t i = begin; i < end; ++i) {
    box.extend(m_edges[i].start).extend(m_edges[i].end);
    length += m_edges[i].count * (m_edges[i].end - m_edges[i].start).norm();
  }
  const std::size_t index = m_nodes.size();
  m_nodes.push_back({box.center(), 0.5 * box.diagonal().norm(), length, begin, end});
  if (end - begin <= kEdgesPerLeaf) return;
  Eigen::Index axis = 0;
  box.sizes().maxCoeff(&axis);
  std::stable_sort(m_edges.begin() + begin, m_edges.begin() + end,
                   [axis](const Edge& a, const Edge& b) {
                     return a.start[axis] + a.end[axis] < b.start[axis] + b.end[axis];
                   });
  const std::uint32_t middle = begin + (end - begin) / 2;
  addNode(begin, middle);
  m_nodes[index].second = static_cast<std::uint32_t>(m_nodes.size());
  addNode(middle, end);
}

double BoundaryCurve::steepness(const Vector3d& centre, double radius, double most) const {
  PALPATE_ASSERT(radius >= 0.0 && most >= 0.0);
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  const double magnitude = m_largest + centre.cwiseAbs().maxCoeff() + radius,
               reach = radius + kFieldError * magnitude;
  if (!(magnitude < kOverflowGuard)) return kInfinite;
  const double mostSum = most * (4.0 * std::numbers::pi);
  double sum = 0.0;
  std::array<std::uint32_t, 64> stack;  // halving ends before
  std::size_t depth = 0;
  if (!isEmpty()) stack[depth++] = 0;
  while (depth > 0) {
    if (sum > mostSum) return kInfinite;
    const std::uint32_t index = stack[--depth];
    const Node& node = m_nodes[index];
    const double gap = (centre - node.centre).norm() - node.radius - reach;
    if (gap > kFarRadii * node.radius) {
      sum += node.length / gap / gap;
    } else if (node.second != 0) {
      PALPATE_ASSERT(depth + 2 <= stack.size() && node.second > index + 1);
      stack[depth++] = node.second;
      stack[depth++] = index + 1;
    } else {
      for (std::uint32_t i = node.begin; i < node.end; ++i) {
        const auto& [start, end, count] = m_edges[i];
        const double distance = distanceOf(centre, start, end) - reach;
        if (!(distance > 0.0)) return kInfinite;
        // Of a whole line, the integral of dl / r² is pi / distance.
        sum += count * std::min((end - start).norm() / distance, std::numbers::pi) / distance;
      }
    }
  }
  return kSteepnessSlack * sum / (4.0 * std::numbers::pi);
}

SolidAngleShare BoundaryCurve::fanNumber(const Vector3d& p) const {
  SolidAngleShare sum{0.0, kWindingSlack * static_cast<double>(m_edges.size())};
  if (isEmpty()) return sum;
  const Vector3d& apex = m_nodes[0].centre;
  for (const auto& [start, end, count] : m_edges) {
    const SolidAngleShare share = solidAngleShare(p, apex, start, end);
    sum.add({count * share.value, count * share.error});
  }
  return sum;
}

}  // namespace palpate
