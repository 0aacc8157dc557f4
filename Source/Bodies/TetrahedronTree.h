#pragma once

#include <palpate/Settings.h>
#include <palpate/Types.h>

#include "Octree/Octree.h"
#include "Mesh/FloatPositions.h"
#include "Mesh/TetrahedralTopology.h"
#include "Core/Buffer.h"
#include "Core/Threads.h"

#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// An octree over the boxes of tetrahedra, for point-in-tetrahedron queries. It is refitted until
/// it has become loose, and then rebuilt.
class TetrahedronTree {
 public:
  /// Each update must have the same tetrahedra. floats: the positions of the vertices. bulk: the
  /// extent of most of them, in the same frame.
  void update(const TetrahedralTopology&, const FloatPoint* floats, double bulk,
              const OctreeSettings&, const Threads&);

  const Octree& octree() const { return m_octree; }
  /// In the octree's order.
  std::span<const Tetrahedron> ordered() const { return m_ordered; }

 private:
  void fit(const FloatPoint* floats, const Threads&);

  Octree m_octree;
  CountedVector<Tetrahedron> m_ordered;
  Buffer<std::uint64_t> m_keys;  ///< scratch
  bool m_isBuilt = false;        ///< the tree is built, and the last update did not throw
};

}  // namespace palpate
