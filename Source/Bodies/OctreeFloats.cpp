#include "Bodies/OctreeFloats.h"

#include "Core/Assert.h"

namespace palpate {

static void computeFloats(std::span<const Eigen::Vector3d> positions, const FloatFrame& frame,
                          FloatPoint* floats, const Threads& threads) {
  constexpr std::size_t kGrain = 1024;
  threads.forChunks(positions.size(), kGrain, [&](std::size_t, std::size_t from, std::size_t to) {
    toFloats(positions.subspan(from, to - from), frame, floats + from);
  });
}

void OctreeFloats::set(const TriangleMesh& mesh, const FloatFrame& frame, bool swept,
                       const Threads& threads) {
  m_frame = frame;
  m_isSwept = swept;
  resizeSparingly(m_now, mesh.now.size());
  computeFloats(mesh.now.body(), frame, m_now.data(), threads);
  if (!swept) return;
  resizeSparingly(m_before, mesh.before.size());
  computeFloats(mesh.before.body(), frame, m_before.data(), threads);
}

void OctreeFloats::follow(const TriangleMesh& mesh, VertexRange changed, const Threads& threads) {
  const std::size_t known = m_now.size(), size = mesh.now.size();
  PALPATE_ASSERT(known <= size);
  if (m_now.capacity() < size) m_now.reserve(withSpare(size));
  m_now.resize(size);
  for (const VertexRange& range : {changed, VertexRange{known, size}})
    computeFloats(mesh.now.body().subspan(range.begin, range.end - range.begin), m_frame,
                  m_now.data() + range.begin, threads);
}

void OctreeFloats::copy(const OctreeFloats& other) {
  m_frame = other.m_frame;
  m_isSwept = false;
  resizeSparingly(m_now, other.m_now.size());
  std::copy(other.m_now.begin(), other.m_now.end(), m_now.begin());
}

void OctreeFloats::releaseMemory() {
  if (!m_isSwept) m_before.clear();
  releaseSpare(m_now);
  releaseSpare(m_before);
}

}  // namespace palpate
