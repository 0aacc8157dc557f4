#pragma once

#include "Octree/Octree.h"
#include "Mesh/TriangleMesh.h"
#include "Core/ReusableMemory.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

/// Elements in the order of an octree, in memory that holds the keys while the octree is built.
class OrderedElements {
 public:
  /// Readable BoxArrays::kPadding past their end. Empty during a build.
  std::span<Triangle> triangles() { return m_triangles; }
  std::span<const Triangle> triangles() const { return m_triangles; }
  std::size_t size() const { return m_triangles.size(); }
  std::size_t bytes() const { return m_memory.bytes(); }

  /// Starts so many elements, with indeterminate values.
  void start(std::size_t size);
  /// Copies the elements of a range of the octree's order.
  void fill(const MeshTopology&, const Octree&, std::size_t from, std::size_t to);
  /// As many keys as there were elements, which are lost.
  std::span<std::uint64_t> startKeys();
  /// Brings the elements into the octree's order after Octree::replace().
  void follow(const MeshTopology&, const Octree&, std::span<const Octree::Move>,
              std::span<const Octree::Joining>);
  void releaseMemory();  ///< keeps the elements

 private:
  std::span<Triangle> m_triangles;
  ReusableMemory m_memory;  ///< of m_triangles, or of the keys during a build
};

}  // namespace palpate
