#include "Geometry/Thread.h"

#include <algorithm>
#include <array>
#include <utility>

namespace palpate {

namespace {

constexpr std::uint32_t kNone = 0xffffffffu;

/// The edges of each vertex, at most two.
class ThreadWalk {
 public:
  ThreadWalk(std::span<const Segment> edges, std::span<const Eigen::Vector3d> positions)
      : m_edges(edges),
        m_positions(positions),
        m_edgesAt(positions.size(), {kNone, kNone}),
        m_arcs(edges.size(), {kNone}) {}

  bool connect() {
    for (std::uint32_t e = 0; e < m_edges.size(); ++e)
      for (const std::uint32_t v : m_edges[e]) {
        auto& [first, second] = m_edgesAt[v];
        if (second != kNone) return false;
        (first == kNone ? first : second) = e;
      }
    return true;
  }

  /// Open threads from an end, then what is left, which is closed.
  std::vector<ThreadArc> threads() {
    for (const bool closed : {false, true})
      for (std::uint32_t v = 0; v < m_edgesAt.size(); ++v)
        if (const auto [first, second] = m_edgesAt[v];
            first != kNone && (second != kNone) == closed && m_arcs[first].thread == kNone)
          follow(v, first, closed);
    return std::move(m_arcs);
  }

 private:
  void follow(std::uint32_t vertex, std::uint32_t edge, bool closed) {
    m_passed.clear();
    double length = 0.0;
    while (edge != kNone && m_arcs[edge].thread == kNone) {
      const auto [p, q] = m_edges[edge];
      const double end = length + (m_positions[q] - m_positions[p]).norm();
      m_arcs[edge] = {m_next, length, end};
      length = end;
      m_passed.push_back(edge);
      vertex = vertex == p ? q : p;
      const auto [first, second] = m_edgesAt[vertex];
      edge = first == edge ? second : first;
    }
    if (closed)
      for (const std::uint32_t passed : m_passed) m_arcs[passed].length = length;
    ++m_next;
  }

  std::span<const Segment> m_edges;
  std::span<const Eigen::Vector3d> m_positions;
  std::vector<std::array<std::uint32_t, 2>> m_edgesAt;
  std::vector<ThreadArc> m_arcs;
  std::vector<std::uint32_t> m_passed;
  std::uint32_t m_next = 0;
};

}  // namespace

double arcBetween(const ThreadArc& a, const ThreadArc& b) {
  if (a.thread != b.thread) return std::numeric_limits<double>::infinity();
  const double forth = std::max(a.begin, b.begin) - std::min(a.end, b.end);
  const double back = a.length - (std::max(a.end, b.end) - std::min(a.begin, b.begin));
  return std::max(0.0, std::min(forth, back));
}

std::vector<ThreadArc> threadArcs(std::span<const Segment> edges,
                                  std::span<const Eigen::Vector3d> positions) {
  ThreadWalk walk(edges, positions);
  if (!walk.connect()) return {};
  return walk.threads();
}

}  // namespace palpate
