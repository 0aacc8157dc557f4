#pragma once

#include "CollisionDetection/GeometryTable.h"
#include "Core/Threads.h"
#include "Octree/PointQueries.h"

#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// Where points of the world are among the boxes of a geometry's octree, of a placed body too.
class PointFrame {
 public:
  explicit PointFrame(const Geometry& geometry)
      : m_frame{worldOrigin(geometry), geometry.tree.frame().scale},
        m_map(worldMap(geometry, m_frame.origin, 0.0, false)) {}

  const BoxMap& map() const { return m_map; }
  FloatBox boxOf(const Eigen::Vector3d& p) const {
    return OutwardRounding::outward(m_frame(p).box());
  }

 private:
  FloatFrame m_frame;  ///< of boxes in the world
  BoxMap m_map;        ///< that brings them there
};

/// Asks something about each vertex of a geometry that is in an element, enabled or not, and keeps
/// the answers in the order of the vertices. Scratch that remembers its peak.
template <class Answer>
class VertexSearch {
 public:
  /// start(stack): for some vertices; returns what is called with each, and gives a
  /// std::optional<Answer>.
  template <class Start>
  std::span<const Answer> find(const MeshTopology& topology, const Threads& threads,
                               Start&& start) {
    constexpr std::size_t kGrain = 256;
    const std::size_t parts = (topology.vertexCount + kGrain - 1) / kGrain;
    if (m_parts.size() < parts) m_parts.resize(parts);
    threads.forChunks(topology.vertexCount, kGrain,
                      [&](std::size_t chunk, std::size_t begin, std::size_t end) {
                        Part& part = m_parts[chunk];
                        part.found.clear();
                        auto ask = start(part.stack);
                        for (std::size_t v = begin; v < end; ++v)
                          if (topology.isUsed[v])
                            if (const auto answer = ask(static_cast<std::uint32_t>(v)))
                              part.found.push_back(*answer);
                      });
    m_found.clear();
    for (std::size_t i = 0; i < parts; ++i)
      m_found.insert(m_found.end(), m_parts[i].found.begin(), m_parts[i].found.end());
    return m_found;
  }

 private:
  struct Part {
    PointQueryStack stack;
    std::vector<Answer> found;
  };
  std::vector<Part> m_parts;
  std::vector<Answer> m_found;
};

}  // namespace palpate
