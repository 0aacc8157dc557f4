#pragma once

#include "Octree/Octree.h"
#include "Mesh/FloatPositions.h"
#include "Mesh/PieceMotion.h"
#include "Mesh/TriangleMesh.h"
#include "Core/Buffer.h"
#include "Core/CountedVector.h"

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

/// Consecutive groups of an octree in slices, whose boxes are fitted together: the boxes of a part
/// of the tree follow the positions. They are of one Octree::layout().
class OctreeSlices {
 public:
  /// What slices are of.
  struct Tree {
    const TriangleMesh& mesh;
    std::span<const Triangle> ordered;  ///< the elements in the octree's order
    const FloatFrame& frame;            ///< of the boxes
    Octree& octree;
  };

  /// Makes the slices, unless there are those of the octree's layout.
  void make(const Tree&);
  /// After Octree::replace() of an octree with the layout `before`. Slices with one of these
  /// groups, which ascend, are due: the next fit of any kind fits their boxes.
  void follow(const Tree&, std::uint64_t before, std::span<const std::uint32_t> changed);
  void setFitted();  ///< the boxes of all elements were fitted
  /// Fits the boxes of slices that hold one of these vertices, or are due.
  void fitChanged(const Tree&, VertexRange changed);
  /// Fits the boxes of so many slices, in turn, that lag() is at most `most`. motion: from the last
  /// fit of any kind. Returns the number of slices.
  std::size_t fitLagging(const Tree&, const PieceMotion& motion, double most);
  /// L: no coordinate of a position is further outside of the boxes of its elements.
  double lag() const { return m_lag; }
  bool isLoose() const { return m_isLoose; }  ///< fits made the tree so loose that it must be built
  void releaseMemory() { m_scratch = {}; }    ///< keeps the slices
  std::size_t bytes() const { return m_slices.capacity() * sizeof(Slice) + m_pieces.bytes(); }

 private:
  struct Slice {
    std::uint32_t firstGroup, endGroup;
    double moved;  ///< L: of a coordinate, at most, since the boxes were fitted; infinity: due
  };
  void refit(const Tree&, Slice&);
  void measureLooseness(Octree&);

  CountedVector<Slice> m_slices;
  IndexLists m_pieces;         ///< of PieceMotion, for each slice
  std::uint64_t m_layout = 0;  ///< 0: there are no slices
  std::size_t m_next = 0;      ///< the slice whose turn it is
  std::size_t m_refitted = 0;  ///< slices that fitChanged() fitted since looseness was measured
  double m_lag = 0;
  bool m_isLoose = false;
  struct Scratch {
    Buffer<Eigen::Vector3d> corners;
    Buffer<FloatPoint> floats;
    Buffer<Triangle> triangles;
  } m_scratch;
};

}  // namespace palpate
