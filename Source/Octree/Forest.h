#pragma once

#include <palpate/LooseOctree.h>

#include "Octree/Octree.h"

#include <cstdint>
#include <string>
#include <vector>

namespace palpate {

/// What a LooseOctree shows: the trees of all geometries, each in its own float frame.
struct LooseOctree::State {
  struct Tree {
    GeometryId geometry;
    const Octree* octree;
    Eigen::Vector3d origin;  ///< position = origin + float / scale
    double scale;
    Update lastUpdate;
    std::size_t otherBytes;       ///< the geometry's floats
    std::uint32_t firstNode = 0;  ///< node ids of this tree start here
  };
  std::vector<Tree> trees;  ///< by ascending geometry id; those without elements left out
};

/// Sentences about each invariant that does not hold. `cells`: also that elements are where a
/// rebuild puts them.
std::vector<std::string> validate(const Octree&, bool cells);

/// The cell of a node and its depth.
struct CellOfNode {
  Cube cube;
  int depth;
};
CellOfNode cellOf(const Octree&, OctreeNode);

}  // namespace palpate
