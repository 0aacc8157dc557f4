#pragma once

#include "Search/Question.h"
#include "NarrowPhase/NarrowPhase.h"

#include <cstdint>
#include <vector>

namespace palpate {

/// Features that brute force tests against the whole other mesh: triangles for Intersection,
/// otherwise vertices and edges. For a pair with a shape, trianglesOfA lists the mesh's elements.
struct FeatureLists {
  std::vector<std::uint32_t> verticesOfA, verticesOfB;
  std::vector<std::uint32_t> edgesOfA,
      trianglesOfA;  ///< self-collision: tested against those of higher id
};

/// All features that the pair's method tests, without vertices that are in no element.
FeatureLists everyFeature(const MeshPair&);
FeatureLists everyFeature(const Question&);

/// The reference: tests vertices against every element and edges against every edge, without
/// candidate pairs and without owners. With everyFeature() the contacts equal those of
/// findContacts() for all candidate pairs.
void findContactsByBruteForce(const MeshPair&, const FeatureLists&, ContactBuffers& out);
inline void findContactsByBruteForce(const MeshPair& pair, ContactBuffers& out) {
  findContactsByBruteForce(pair, everyFeature(pair), out);
}
/// The same for a pair with a shape or a field, or for two meshes.
void findContactsByBruteForce(const Question&, const FeatureLists&, ContactBuffers& out);

}  // namespace palpate
