#pragma once

#include <palpate/CollisionData.h>

#include <algorithm>
#include <cstdint>
#include <vector>

namespace palpate::testing {

using Ids = std::vector<std::uint32_t>;

/// The ids below `count` without removed ones, which ascend.
inline Ids idsWithout(std::size_t count, const Ids& removed) {
  Ids all;
  for (std::uint32_t id = 0; id < count; ++id)
    if (!std::binary_search(removed.begin(), removed.end(), id)) all.push_back(id);
  return all;
}

/// The contacts of an object whose element i has the id ofA[i] or ofB[i].
inline CollisionData renamed(const CollisionData& data, const Ids& ofA, const Ids& ofB) {
  CollisionData::Parts parts = data.parts();
  std::vector<VertexTriangleContact> vertexTriangle(parts.vertexTriangle.begin(),
                                                    parts.vertexTriangle.end()),
      triangleVertex(parts.triangleVertex.begin(), parts.triangleVertex.end());
  std::vector<ElementPair> intersecting(parts.intersectingTriangles.begin(),
                                        parts.intersectingTriangles.end());
  std::vector<ShapeContact> shape(parts.shape.begin(), parts.shape.end());
  for (auto& c : vertexTriangle) c.triangle = ofB[c.triangle];
  for (auto& c : triangleVertex) c.triangle = ofA[c.triangle];
  for (auto& [a, b] : intersecting) a = ofA[a], b = ofB[b];
  for (auto& c : shape)
    if (c.element == ShapeElement::Face) c.id = (ofA.empty() ? ofB : ofA)[c.id];
  parts.vertexTriangle = vertexTriangle;
  parts.triangleVertex = triangleVertex;
  parts.intersectingTriangles = intersecting;
  parts.shape = shape;
  return CollisionData(parts);
}

}  // namespace palpate::testing
