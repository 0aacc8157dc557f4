#pragma once

#include "NarrowPhase/NarrowPhase.h"
#include "Math/ImpactQuery.h"

#include <array>
#include <span>

namespace palpate {

/// Implements Method::Continuous of findContacts(): appends every vertex-triangle and edge-edge
/// pair with an impact in the step from `before` to `now`. An impact is a distance of at most the
/// thickness.
///
/// timeOfImpact is not after the first impact and at most the settings' timeTolerance before it.
/// All other members of a contact describe that time.
/// With a thickness, the normal is that of the distance. With thickness 0, and at distance 0, it is
/// touchNormal(): on the side where the vertex, or edge a, was before.
void findContinuous(const MeshPair&, std::span<const ElementPair> candidates, ContactBuffers& out);

/// Tests one feature pair as Method::Continuous does and appends its contact. Returns whether there
/// was one. swapped: Features::first is MeshPair::b.
template <ImpactQuery::Kind kind>
bool addImpact(const MeshPair&, const Features<kind>&, std::uint32_t firstId,
               std::uint32_t secondId, bool swapped, ContactBuffers& out);

/// Calls addImpact() for the features of a contact of the step's end.
bool addImpactOf(const MeshPair&, ContactKind, const VertexTriangleContact&, ContactBuffers& out);
bool addImpactOf(const MeshPair&, ContactKind, const EdgeEdgeContact&, ContactBuffers& out);

/// Method::Auto: appends the impacts of feature pairs for which proximity at the step's end does
/// not suffice (StepCheck::proximitySuffices()).
void findFastImpacts(const MeshPair&, std::span<const ElementPair> candidates, ContactBuffers& out);

/// Returns the earliest timeOfImpact that findContinuous() would report, or upTo if that is
/// earlier. Pass infinity first, then the smallest time of earlier candidates: impacts after upTo
/// cost little. The smallest time over all candidates has the same bits for every order, batch size
/// and upTo. counts: receives featurePairs and exactDecisions; facts.clearance becomes 0 where an
/// impact was checked against the user's filters.
double findEarliestImpact(const MeshPair&, std::span<const ElementPair> candidates, double upTo,
                          ContactBuffers& counts);

}  // namespace palpate
