#pragma once

#include "NarrowPhase/NarrowPhase.h"

#include <cstdint>
#include <vector>

namespace palpate {

/// Features that brute force tests against all of the other mesh: triangles for Intersection,
/// otherwise vertices and edges. Of a pair with a shape: elements of the mesh, in trianglesOfA.
struct FeatureLists {
  std::vector<std::uint32_t> verticesOfA, verticesOfB;
  std::vector<std::uint32_t> edgesOfA,
      trianglesOfA;  ///< self-collision: against those of higher id
};

/// All features that the pair's method tests. Vertices in no element are left out.
FeatureLists everyFeature(const MeshPair&);

/// The reference: vertices against every element and edges against every edge, without candidate
/// pairs and without owners. With every feature the contacts are those of findContacts() for
/// complete candidate pairs.
void findContactsByBruteForce(const MeshPair&, const FeatureLists&, ContactBuffers& out);
inline void findContactsByBruteForce(const MeshPair& pair, ContactBuffers& out) {
  findContactsByBruteForce(pair, everyFeature(pair), out);
}

}  // namespace palpate
