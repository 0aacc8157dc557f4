#pragma once

#include "Bodies/Body.h"
#include "Octree/PointQueries.h"
#include "Core/Threads.h"

#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// Converts points in the world to float boxes, for comparison with the boxes of a geometry's
/// octree after map().
class PointFrame {
 public:
  explicit PointFrame(const Body& geometry)
      : m_frame{worldOrigin(geometry), geometry.tree.frame().scale},
        m_map(worldMap(geometry, m_frame.origin, 0.0, false)) {}

  const BoxMap& map() const { return m_map; }
  FloatBox boxOf(const Eigen::Vector3d& p) const {
    return OutwardRounding::outward(m_frame(p).box());
  }

 private:
  FloatFrame m_frame;  ///< of boxes in the world
  BoxMap m_map;        ///< from the octree's boxes to m_frame
};

/// Scratch of searchVertices(), which remembers its peak.
template <class Result>
struct VertexSearch {
  struct Part {
    PointQueryStack stack;
    CountedVector<Result> found;
  };
  CountedVector<Part> parts;
};

/// Calls query(vertex) for each vertex of a geometry that is in an element, enabled or not, and
/// collects the results in `out`, by ascending vertices. makeQuery(stack) makes `query` for a range
/// of vertices; query(vertex) returns a std::optional<Result>.
template <class Result, class MakeQuery>
void searchVertices(const MeshTopology& topology, const Threads& threads,
                    VertexSearch<Result>& scratch, std::vector<Result>& out,
                    MakeQuery&& makeQuery) {
  constexpr std::size_t kGrain = 256;
  auto& parts = scratch.parts;
  const std::size_t count = (topology.vertexCount + kGrain - 1) / kGrain;
  if (parts.size() < count) parts.resize(count);
  threads.forChunks(topology.vertexCount, kGrain,
                    [&](std::size_t chunk, std::size_t begin, std::size_t end) {
                      auto& part = parts[chunk];
                      part.found.clear();
                      auto query = makeQuery(part.stack);
                      for (std::size_t v = begin; v < end; ++v)
                        if (topology.isUsed[v])
                          if (const auto result = query(static_cast<std::uint32_t>(v)))
                            part.found.push_back(*result);
                    });
  std::size_t size = 0;
  for (std::size_t i = 0; i < count; ++i) size += parts[i].found.size();
  out.reserve(size);  // nothing below throws
  out.clear();
  for (std::size_t i = 0; i < count; ++i)
    out.insert(out.end(), parts[i].found.begin(), parts[i].found.end());
}

}  // namespace palpate
