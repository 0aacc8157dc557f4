#pragma once

#include "Bodies/OctreeFrame.h"
#include "Octree/PointQueries.h"
#include "Core/Assert.h"
#include "Core/Threads.h"

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// Finds the elements of a body's octree whose boxes hold a point of the world.
class PointFrame {
 public:
  explicit PointFrame(const Body& geometry) : m_frame(geometry), m_map(m_frame.toWorld()) {}

  const BoxMap& map() const { return m_map; }
  FloatBox boxOf(const Eigen::Vector3d& p) const { return m_frame.boxInWorld(p); }

 private:
  OctreeFrame m_frame;
  BoxMap m_map;
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
  PALPATE_ASSERT(std::is_sorted(out.begin(), out.end(), [](const Result& l, const Result& r) {
    return l.vertex < r.vertex;
  }));
}

}  // namespace palpate
