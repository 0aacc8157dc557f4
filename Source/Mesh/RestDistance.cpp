#include "Mesh/RestDistance.h"

#include <palpate/Error.h>

#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <utility>

namespace palpate {

namespace {

constexpr double kUnreached = std::numeric_limits<double>::infinity();
constexpr std::size_t kMaxPairs = std::size_t{1} << 28;
constexpr std::size_t kGrain = 64;  ///< vertices of one task
/// Rings are half a mean edge wide, but the longest edge crosses at most so many.
constexpr double kMostRings = 256.0;

/// Where squares leave the range of doubles, lengths are scaled first.
double lengthOf(const Eigen::Vector3d& edge) {
  const double square = edge.squaredNorm();
  return square > kSmallestSlowSquare && square < 1 / kSmallestSlowSquare ? std::sqrt(square)
                                                                          : stableLength(edge);
}

/// The edges shorter than the distance, in lists for each vertex.
struct EdgeLists {
  struct Edge {
    std::uint32_t neighbour;
    double length;
  };
  CountedVector<std::uint32_t> offsets;
  CountedVector<Edge> edges;
  double longest = 0.0, mean = 0.0;

  EdgeLists(std::size_t vertexCount, std::span<const Segment> all,
            std::span<const Eigen::Vector3d> rest, double distance)
      : offsets(vertexCount + 1, 0) {
    CountedVector<double> lengths;
    lengths.reserve(all.size());
    for (const auto& [p, q] : all) lengths.push_back(lengthOf(rest[p] - rest[q]));
    const auto forEachShort = [&](auto&& f) {
      for (std::size_t e = 0; e < lengths.size(); ++e)
        if (lengths[e] < distance) f(all[e], lengths[e]);
    };
    forEachShort([&](const Segment& edge, double length) {
      for (const std::uint32_t end : edge) ++offsets[end + 1];
      longest = std::max(longest, length);
    });
    for (std::size_t v = 0; v < vertexCount; ++v) offsets[v + 1] += offsets[v];
    edges.resize(offsets.back());
    CountedVector<std::uint32_t> next(offsets.begin(), offsets.end() - 1);
    forEachShort([&](const Segment& edge, double length) {
      edges[next[edge[0]]++] = {edge[1], length};
      edges[next[edge[1]]++] = {edge[0], length};
      mean += length / static_cast<double>(edges.size()) * 2.0;
    });
  }
  /// Calls f(neighbour, length) for the edges of a vertex.
  template <class F>
  void forEach(std::uint32_t vertex, F&& f) const {
    for (std::uint32_t i = offsets[vertex]; i < offsets[vertex + 1]; ++i)
      f(edges[i].neighbour, edges[i].length);
  }
};

/// Edges around a cut, before it or afterwards.
class CutEdges {
 public:
  CutEdges(const MeshTopology& before, const EdgeChange& change,
           std::span<const Eigen::Vector3d> rest)
      : m_before(before), m_change(change), m_rest(rest) {
    for (const std::uint32_t t : before.disabled)
      for (const std::uint32_t e : before.triangleEdges[t])
        if (e != kNoEdge) addTo(m_disabled, before.edges[e]);
    for (const Segment& edge : change.added) addTo(m_added, edge);
    std::sort(m_disabled.begin(), m_disabled.end());
    std::sort(m_added.begin(), m_added.end());
  }
  void setAfter(bool after) { m_isAfter = after; }

  template <class F>
  void forEach(std::uint32_t vertex, F&& f) const {
    const auto visit = [&](std::uint32_t other) {
      const Segment edge{std::min(vertex, other), std::max(vertex, other)};
      if (m_isAfter && std::binary_search(m_change.gone.begin(), m_change.gone.end(), edge)) return;
      f(other, lengthOf(m_rest[edge[0]] - m_rest[edge[1]]));
    };
    const auto visitAll = [&](const CountedVector<Segment>& edges) {
      for (auto e = std::lower_bound(edges.begin(), edges.end(), Segment{vertex, 0});
           e != edges.end() && (*e)[0] == vertex; ++e)
        visit((*e)[1]);
    };
    if (vertex < m_before.vertexCount)
      for (const std::uint32_t t : m_before.vertexTriangles[vertex])
        for (const std::uint32_t other : m_before.elements[t])
          if (other != vertex) visit(other);
    visitAll(m_disabled);
    if (m_isAfter) visitAll(m_added);
  }

 private:
  /// From both ends.
  static void addTo(CountedVector<Segment>& edges, const Segment& edge) {
    edges.push_back(edge);
    edges.push_back({edge[1], edge[0]});
  }

  const MeshTopology& m_before;
  const EdgeChange& m_change;
  std::span<const Eigen::Vector3d> m_rest;
  CountedVector<Segment> m_disabled, m_added;
  bool m_isAfter = false;
};

/// Shortest paths from one vertex after another. Vertices are visited in rings of path lengths, and
/// again where a shorter path is found. Sums of lengths are monotone, so that the least lengths do
/// not depend on the order.
/// Source   Meyer and Sanders, Delta-stepping: a parallelizable shortest path algorithm, Journal of
///          Algorithms 49 (2003). Difference: one thread for each search, and no distinction of
///          short and long edges.
template <class Edges>
class ShortestPaths {
 public:
  /// ringWidth: any will do. longest: of the edges that are shorter than the distance.
  ShortestPaths(const Edges& edges, std::size_t vertexCount, double distance, double ringWidth,
                double longest)
      : m_edges(edges),
        m_distance(distance),
        m_ringWidth(ringWidth),
        m_rings(ringWidth > 0.0 ? static_cast<std::size_t>(longest / ringWidth) + 3 : 1),
        m_pathLength(vertexCount, kUnreached) {}

  void setDistance(double distance) { m_distance = distance; }  ///< at most as large as before

  /// Appends the vertices behind `from` that are within the distance, ascending.
  void addReached(std::uint32_t from, CountedVector<std::uint32_t>& out) {
    search(from);
    const std::size_t begin = out.size(), all = m_pathLength.size();
    if (m_reached.size() > all / 16) {  // sorting would take longer
      for (std::uint32_t v = from + 1; v < all; ++v)
        if (m_pathLength[v] != kUnreached) out.push_back(v);
    } else {
      for (const std::uint32_t v : m_reached)
        if (v > from) out.push_back(v);
      std::sort(out.begin() + static_cast<std::ptrdiff_t>(begin), out.end());
    }
    reset();
  }
  /// Calls f(vertex) for all that are within the distance, in any order.
  template <class F>
  void forEachReached(std::uint32_t from, F&& f) {
    search(from);
    for (const std::uint32_t v : m_reached) f(v);
    reset();
  }

 private:
  void reset() {
    PALPATE_ASSERT(m_waiting == 0);
    for (const std::uint32_t v : m_reached) m_pathLength[v] = kUnreached;
    m_reached.clear();
  }
  void search(std::uint32_t from) {
    relax(from, 0.0);
    for (std::size_t ring = 0; m_waiting > 0; ++ring) {
      CountedVector<Entry>& entries = m_rings[ring % m_rings.size()];
      for (std::size_t i = 0; i < entries.size(); ++i) {  // the ring may grow
        const auto [length, vertex] = entries[i];
        if (length != m_pathLength[vertex]) continue;  // a shorter path was found
        m_edges.forEach(vertex, [&, from = length](std::uint32_t neighbour, double along) {
          relax(neighbour, from + along);
        });
      }
      m_waiting -= entries.size();
      entries.clear();
    }
  }
  void relax(std::uint32_t vertex, double length) {
    if (!(length < m_distance && length < m_pathLength[vertex])) return;
    if (m_pathLength[vertex] == kUnreached) m_reached.push_back(vertex);
    m_pathLength[vertex] = length;
    const std::size_t ring = m_ringWidth > 0.0 ? static_cast<std::size_t>(length / m_ringWidth) : 0;
    m_rings[ring % m_rings.size()].push_back({length, vertex});
    ++m_waiting;
  }

  struct Entry {
    double length;
    std::uint32_t vertex;
  };
  const Edges& m_edges;
  double m_distance, m_ringWidth;
  CountedVector<CountedVector<Entry>> m_rings;  ///< of path lengths, used in turn
  CountedVector<double> m_pathLength;
  CountedVector<std::uint32_t> m_reached;
  std::size_t m_waiting = 0;  ///< entries of all rings
};

void checkPairs(std::size_t pairs) {
  if (pairs > kMaxPairs)
    throw Error(ErrorCode::TooLarge,
                "restDistance: more than 2^28 pairs of vertices are nearer than this distance");
}

/// verticesWithin() along these edges.
IndexLists verticesAlong(std::span<const Segment> all, std::span<const Eigen::Vector3d> rest,
                         double distance, const Threads& threads) {
  const std::size_t count = rest.size(), tasks = (count + kGrain - 1) / kGrain;
  const EdgeLists edges(count, all, rest, distance);
  CountedVector<std::uint32_t> offsets(count + 1, 0);
  CountedVector<CountedVector<std::uint32_t>> found(tasks);
  std::atomic<std::size_t> nextTask = 0, pairs = 0;
  threads.forEach(std::min(tasks, static_cast<std::size_t>(threads.count())), [&](std::size_t) {
    ShortestPaths paths(edges, count, distance,
                        std::max(edges.mean / 2, edges.longest / kMostRings), edges.longest);
    for (std::size_t task; pairs <= kMaxPairs && (task = nextTask++) < tasks;) {
      const std::size_t end = std::min(count, (task + 1) * kGrain);
      for (std::size_t v = task * kGrain; v < end; ++v) {
        const std::size_t before = found[task].size();
        paths.addReached(static_cast<std::uint32_t>(v), found[task]);
        offsets[v + 1] = static_cast<std::uint32_t>(found[task].size() - before);
      }
      pairs += found[task].size();
    }
  });
  checkPairs(pairs);
  for (std::size_t v = 0; v < count; ++v) offsets[v + 1] += offsets[v];
  PALPATE_ASSERT(offsets.back() == pairs);
  CountedVector<std::uint32_t> items;
  items.reserve(pairs);
  for (CountedVector<std::uint32_t>& part : found) {
    items.insert(items.end(), part.begin(), part.end());
    part = {};
  }
  return {offsets, std::move(items)};
}

}  // namespace

IndexLists verticesWithin(const MeshTopology& topology, std::span<const Eigen::Vector3d> rest,
                          double distance, const Threads& threads) {
  PALPATE_ASSERT(distance > 0.0 && rest.size() == topology.vertexCount);
  CountedVector<Segment> edges;
  edges.reserve(topology.edges.size());
  topology.forEachEdge([&](std::uint32_t e) { edges.push_back(topology.edges[e]); });
  return verticesAlong(edges, rest, distance, threads);
}

ChangedLists verticesWithinAfterCut(const MeshTopology& topology, const EdgeChange& change,
                                    std::span<const Eigen::Vector3d> rest, double distance,
                                    const IndexLists& before, const Threads& threads) {
  PALPATE_ASSERT(distance > 0.0 && before.size() == topology.vertexCount &&
                 rest.size() >= topology.vertexCount);
  constexpr double kRings = 16.0;
  // Searches around a cut take about as long as so many of all.
  constexpr std::size_t kCostOfSearch = 4;
  const auto endsOf = [&](const CountedVector<Segment>& edges) {
    CountedVector<std::uint32_t> ends;
    for (const Segment& edge : edges) ends.insert(ends.end(), edge.begin(), edge.end());
    sortUnique(ends);
    return ends;
  };
  const auto all = [&] {
    CountedVector<Segment> edges(change.added);
    topology.forEachEdge([&](std::uint32_t e) {
      if (!std::binary_search(change.gone.begin(), change.gone.end(), topology.edges[e]))
        edges.push_back(topology.edges[e]);
    });
    return ChangedLists{{}, verticesAlong(edges, rest, distance, threads), true};
  };
  const CountedVector<std::uint32_t> gone = endsOf(change.gone), added = endsOf(change.added);
  if (2 * kCostOfSearch * (gone.size() + added.size()) > rest.size()) return all();
  // A search from the other end of a path adds its lengths in another order.
  const double reach = distance * (1.0 + 0x1p-30);
  CutEdges edges(topology, change, rest);
  ShortestPaths paths(edges, rest.size(), reach, reach / kRings, reach);
  ChangedLists changed;
  const auto addReached = [&](const CountedVector<std::uint32_t>& ends) {
    for (const std::uint32_t end : ends)
      paths.forEachReached(end, [&](std::uint32_t v) { changed.vertices.push_back(v); });
  };
  addReached(gone);
  edges.setAfter(true);
  addReached(added);
  for (std::size_t v = topology.vertexCount; v < rest.size(); ++v)
    changed.vertices.push_back(static_cast<std::uint32_t>(v));
  sortUnique(changed.vertices);
  if (kCostOfSearch * changed.vertices.size() > rest.size()) return all();
  paths.setDistance(distance);
  std::size_t pairs = before.itemCount();
  CountedVector<std::uint32_t> list;
  for (const std::uint32_t v : changed.vertices) {
    list.clear();
    paths.addReached(v, list);
    changed.lists.append(list);
    pairs += list.size();
    if (v < before.size()) pairs -= before[v].size();
    checkPairs(pairs);
  }
  return changed;
}

void replaceLists(IndexLists& lists, ChangedLists& changed) noexcept {
  if (changed.areAll) {
    lists = std::move(changed.lists);
    return;
  }
  for (std::size_t i = 0; i < changed.vertices.size(); ++i)
    if (changed.vertices[i] < lists.size())
      lists.replace(changed.vertices[i], changed.lists[i]);
    else
      lists.append(changed.lists[i]);
}

}  // namespace palpate
