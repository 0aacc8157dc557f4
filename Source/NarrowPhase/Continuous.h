#pragma once

#include "NarrowPhase/NarrowPhase.h"

#include <span>

namespace palpate {

/// Method::Continuous of findContacts(): every vertex-triangle and edge-edge pair with an impact in
/// the step from `before` to `now`, with the thickness as its minimum distance.
///
/// timeOfImpact is not after the first impact and at most 1e-6 before it; all else is of that time.
/// The normal, at thickness 0: the contact plane's, on the side where the vertex, or edge a, was
/// before; where it was always in that plane, the triangle's winding normal or the cross product of
/// the edges; of degenerate elements the axis that distances use. With a thickness: that of the
/// distance.
void findContinuous(const MeshPair&, std::span<const TrianglePair> candidates, ContactBuffers& out);

/// Method::Continuous of findContactsByBruteForce().
void findContinuousByBruteForce(const MeshPair&, const FeatureLists&, ContactBuffers& out);

/// The earliest timeOfImpact that findContinuous() would report, or upTo if that is earlier;
/// infinity is a good first upTo. Impacts after it cost little, so passing the smallest time of
/// earlier candidates makes later ones cheap. The smallest over all candidates has the same bits
/// whatever their order, batches and upTo. counts: featurePairs and exactDecisions only.
double findEarliestImpact(const MeshPair&, std::span<const TrianglePair> candidates, double upTo,
                          ContactBuffers& counts);

}  // namespace palpate
