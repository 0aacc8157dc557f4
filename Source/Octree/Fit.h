#pragma once

#include "Octree/Octree.h"

#include <cstdint>

namespace palpate {

/// Carries the fitted boxes of blocks [begin, end) to their parents' slots, last block first.
/// A parent's slot with elements of its own already holds their box and is widened, any other is
/// overwritten.
void fitBlocks(OctreeBlock* blocks, const OctreeNode* parents, std::size_t begin, std::size_t end);

}  // namespace palpate
