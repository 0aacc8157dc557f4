#include "Mesh/RestDistance.h"

#include <palpate/Error.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

namespace palpate {

namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();
constexpr std::size_t kMostPairs = std::size_t{1} << 28;

/// Shortest paths from one vertex after another. (Dijkstra, A note on two problems in connexion
/// with graphs, Numerische Mathematik 1, 1959.)
class ShortestWays {
 public:
  ShortestWays(const MeshTopology& topology, std::span<const Eigen::Vector3d> rest, double distance)
      : m_edges(topology.edges),
        m_rest(rest),
        m_distance(distance),
        m_edgesAt(listsByKey(topology.vertexCount,
                             [&](auto&& incidence) {
                               for (std::uint32_t e = 0; e < m_edges.size(); ++e)
                                 for (const std::uint32_t vertex : m_edges[e]) incidence(vertex, e);
                             })),
        m_way(topology.vertexCount, kFar) {}

  /// The vertices within the distance, ascending, including `from`. Valid until the next call.
  std::span<const std::uint32_t> reachedFrom(std::uint32_t from) {
    for (const std::uint32_t vertex : m_reached) m_way[vertex] = kFar;
    m_reached.clear();
    reach(from, 0.0);
    while (!m_next.empty()) {
      const auto [way, vertex] = m_next.top();
      m_next.pop();
      if (way > m_way[vertex]) continue;
      for (const std::uint32_t edge : m_edgesAt[vertex]) {
        const auto [p, q] = m_edges[edge];
        reach(p == vertex ? q : p, way + (m_rest[p] - m_rest[q]).norm());
      }
    }
    std::sort(m_reached.begin(), m_reached.end());
    return m_reached;
  }

 private:
  void reach(std::uint32_t vertex, double way) {
    if (!(way < m_distance && way < m_way[vertex])) return;
    if (m_way[vertex] == kFar) m_reached.push_back(vertex);
    m_way[vertex] = way;
    m_next.push({way, vertex});
  }

  using Entry = std::pair<double, std::uint32_t>;
  std::span<const Segment> m_edges;
  std::span<const Eigen::Vector3d> m_rest;
  double m_distance;
  IndexLists m_edgesAt;
  std::vector<double> m_way;
  std::vector<std::uint32_t> m_reached;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> m_next;
};

}  // namespace

IndexLists verticesWithin(const MeshTopology& topology, std::span<const Eigen::Vector3d> rest,
                          double distance) {
  ShortestWays ways(topology, rest, distance);
  IndexLists lists;
  for (std::uint32_t vertex = 0; vertex < topology.vertexCount; ++vertex) {
    const auto reached = ways.reachedFrom(vertex);
    lists.items.insert(lists.items.end(), std::upper_bound(reached.begin(), reached.end(), vertex),
                       reached.end());
    lists.offsets.push_back(static_cast<std::uint32_t>(lists.items.size()));
    if (lists.items.size() > kMostPairs)
      throw Error(ErrorCode::TooLarge,
                  "restDistance: more than 2^28 pairs of vertices are nearer than it");
  }
  return lists;
}

}  // namespace palpate
