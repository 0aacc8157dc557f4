#pragma once

#include <palpate/OctreeBasedCD.h>

#include <vector>

namespace palpate::testing {

// Queries of the positions now, as values.

inline std::vector<InsideVertex> insideVertices(const OctreeBasedCD& collisions,
                                                GeometryId vertices, GeometryId body,
                                                const InsideSettings& settings = {}) {
  std::vector<InsideVertex> found;
  collisions.queries().findInsideVertices(vertices, body, found, settings);
  return found;
}

inline std::vector<EmbeddedVertex> embeddedVertices(const OctreeBasedCD& collisions,
                                                    GeometryId vertices, GeometryId body) {
  std::vector<EmbeddedVertex> found;
  collisions.queries().findEmbeddedVertices(vertices, body, found);
  return found;
}

}  // namespace palpate::testing
