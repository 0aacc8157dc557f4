#pragma once

#include "Mesh/FloatPositions.h"
#include "Mesh/TriangleMesh.h"
#include "Core/Buffer.h"
#include "Core/Threads.h"

namespace palpate {

/// The positions of a geometry as floats of one frame, which the boxes of its octree come from.
class OctreeFloats {
 public:
  /// The positions now, and with `swept` those before.
  void set(const TriangleMesh&, const FloatFrame&, bool swept, const Threads&);
  /// Vertices changed since, and others were perhaps appended.
  void follow(const TriangleMesh&, VertexRange changed, const Threads&);
  void copy(const OctreeFloats& other);  ///< without those before
  void releaseMemory();                  ///< keeps the floats

  const FloatFrame& frame() const { return m_frame; }
  const FloatPoint* now() const { return m_now.data(); }
  bool isSwept() const { return m_isSwept; }
  const FloatPoint* before() const { return m_isSwept ? m_before.data() : nullptr; }
  const FloatPoint* atStart() const { return (m_isSwept ? m_before : m_now).data(); }
  std::size_t bytes() const {
    return (m_now.capacity() + m_before.capacity()) * sizeof(FloatPoint);
  }

 private:
  FloatFrame m_frame;
  Buffer<FloatPoint> m_now, m_before;
  bool m_isSwept = false;
};

}  // namespace palpate
