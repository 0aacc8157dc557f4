#pragma once

#include <palpate/LooseOctree.h>

#include "Octree/Octree.h"
#include "Core/CountedVector.h"

#include <cstdint>
#include <string>
#include <vector>

namespace palpate {

/// The trees of all geometries that a LooseOctree gives access to, each in its own float frame.
struct LooseOctree::State {
  struct Tree {
    GeometryId geometry;
    const Octree* octree;
    Eigen::Vector3d origin;  ///< position = origin + float / scale
    double scale;
    Update lastUpdate;
    std::size_t otherBytes;  ///< memory of the geometry's floats
  };
  CountedVector<Tree> trees;  ///< by ascending geometry id; only built trees with elements
  const LooseOctree view{*this};
};

/// Describes each invariant that does not hold in a sentence. cells: also check that elements are
/// in the cells where a rebuild would put them.
std::vector<std::string> validate(const Octree&, bool cells);

/// The cell of a node and its depth.
struct CellOfNode {
  Cube cube;
  int depth;
};
CellOfNode cellOf(const Octree&, OctreeNode);

}  // namespace palpate
