#pragma once

#include <palpate/Tracking.h>
#include <palpate/Types.h>

namespace palpate {

/// A passage from which the features have not returned, with the features between which they are
/// now.
struct PassedSide {
  Crossing passage;
  Triangle corners;  ///< of the triangle
};

inline bool isEdges(const Crossing& passage) { return passage.kind == ContactKind::EdgeEdge; }

}  // namespace palpate
