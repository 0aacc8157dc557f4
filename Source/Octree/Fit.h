#pragma once

#include "Octree/Octree.h"

#include <cstdint>

namespace palpate {

/// Writes the box of each block in [begin, end) to its parent's slot, last block first. If the
/// parent's slot has elements of its own, it already holds their box and is widened. Any other slot
/// is overwritten.
void fitBlocks(OctreeBlock* blocks, const OctreeNode* parents, std::size_t begin, std::size_t end);

}  // namespace palpate
