#pragma once

#include "Bodies/Body.h"

#include <vector>

namespace palpate {

/// The least number of triangles that a node of the octree holds itself if it is searched for
/// copies. Fewer cost little.
constexpr std::uint32_t kFewestCoincident = 64;

/// The triangles of a mesh without copies: those whose corners are, in order, where those of a
/// lower element are. They change no distance. Only large nodes are searched. Empty if there are no
/// copies. The octree must be up to date.
std::vector<Triangle> withoutCopies(const Body&);

}  // namespace palpate
