#pragma once

#include "Bodies/OctreeFloats.h"
#include "Octree/Octree.h"
#include "Mesh/TriangleMesh.h"
#include "Core/Buffer.h"
#include "Core/ReusableMemory.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

/// Elements in the order of an octree, in memory that holds the keys while the octree is built. It
/// computes their boxes.
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
  /// Brings the elements into the octree's order after Octree::replace().
  void follow(const MeshTopology&, const Octree&, std::span<const Octree::Move>,
              std::span<const Octree::Joining>);
  void releaseMemory();  ///< keeps the elements

  /// What boxes are computed from, where they are, and the times, which grow.
  struct Boxes {
    const OctreeFloats& floats;
    Octree& octree;
    double &boxMilliseconds, &octreeMilliseconds;
  };
  /// Lays out the octree over the elements, whose order is then lost. bulk: as of Octree::build().
  void build(const Boxes&, double bulk, const OctreeSettings&, const Threads&);
  /// Fits all boxes. unordered: first brings these elements into the octree's order.
  void fit(const Boxes&, const OctreeSettings&, const Threads&,
           const MeshTopology* unordered = nullptr);

 private:
  void compute(const Boxes&, std::span<const std::uint32_t> groups, FloatBox* groupBoxes,
               std::size_t grain, const Threads&, const MeshTopology* unordered);

  std::span<Triangle> m_triangles;
  ReusableMemory m_memory;  ///< of m_triangles, or of the keys during a build
  struct {
    Buffer<std::uint32_t> groups;
    Buffer<FloatBox> boxes;
  } m_bounds;  ///< scratch of build()
};

}  // namespace palpate
