#include "Mesh/RestDistance.h"

#include <palpate/Error.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

namespace palpate {

namespace {

constexpr double kUnreached = std::numeric_limits<double>::infinity();
constexpr std::size_t kMaxPairs = std::size_t{1} << 28;

/// Shortest paths from one vertex after another. (Dijkstra, A note on two problems in connexion
/// with graphs, Numerische Mathematik 1, 1959.)
class ShortestPaths {
 public:
  ShortestPaths(const MeshTopology& topology, std::span<const Eigen::Vector3d> rest,
                double distance)
      : m_edges(topology.edges),
        m_rest(rest),
        m_distance(distance),
        m_edgesAt(listsByKey(topology.vertexCount,
                             [&](auto&& incidence) {
                               for (std::uint32_t e = 0; e < m_edges.size(); ++e)
                                 for (const std::uint32_t vertex : m_edges[e]) incidence(vertex, e);
                             })),
        m_pathLength(topology.vertexCount, kUnreached) {}

  /// The vertices within the distance, ascending, including `from`. Valid until the next call.
  std::span<const std::uint32_t> reachedFrom(std::uint32_t from) {
    for (const std::uint32_t vertex : m_reached) m_pathLength[vertex] = kUnreached;
    m_reached.clear();
    relax(from, 0.0);
    while (!m_next.empty()) {
      const auto [length, vertex] = m_next.top();
      m_next.pop();
      if (length > m_pathLength[vertex]) continue;
      for (const std::uint32_t edge : m_edgesAt[vertex]) {
        const auto [p, q] = m_edges[edge];
        relax(p == vertex ? q : p, length + (m_rest[p] - m_rest[q]).norm());
      }
    }
    std::sort(m_reached.begin(), m_reached.end());
    return m_reached;
  }

 private:
  void relax(std::uint32_t vertex, double length) {
    if (!(length < m_distance && length < m_pathLength[vertex])) return;
    if (m_pathLength[vertex] == kUnreached) m_reached.push_back(vertex);
    m_pathLength[vertex] = length;
    m_next.push({length, vertex});
  }

  using Entry = std::pair<double, std::uint32_t>;
  std::span<const Segment> m_edges;
  std::span<const Eigen::Vector3d> m_rest;
  double m_distance;
  IndexLists m_edgesAt;
  std::vector<double> m_pathLength;
  std::vector<std::uint32_t> m_reached;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> m_next;
};

}  // namespace

IndexLists verticesWithin(const MeshTopology& topology, std::span<const Eigen::Vector3d> rest,
                          double distance) {
  ShortestPaths paths(topology, rest, distance);
  IndexLists lists;
  for (std::uint32_t vertex = 0; vertex < topology.vertexCount; ++vertex) {
    const auto reached = paths.reachedFrom(vertex);
    lists.items.insert(lists.items.end(), std::upper_bound(reached.begin(), reached.end(), vertex),
                       reached.end());
    lists.offsets.push_back(static_cast<std::uint32_t>(lists.items.size()));
    if (lists.items.size() > kMaxPairs)
      throw Error(ErrorCode::TooLarge,
                  "restDistance: more than 2^28 pairs of vertices are nearer than this distance");
  }
  return lists;
}

}  // namespace palpate
