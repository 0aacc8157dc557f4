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

/// The two meshes of feature pairs of one kind: vertices of `first` with triangles of `second`, or
/// edges of `first` with edges of `second`. firstId, secondId: the features' ids in these meshes.
template <ImpactQuery::Kind kind>
struct Features {
  const TriangleMesh& first;
  const TriangleMesh& second;

  std::array<std::uint32_t, 4> vertices(std::uint32_t firstId, std::uint32_t secondId) const {
    if constexpr (kind == ImpactQuery::Kind::VertexTriangle) {
      const auto& [a, b, c] = second.topology.elements[secondId];
      return {firstId, a, b, c};
    } else {
      const Segment &p = first.topology.edges[firstId], &q = second.topology.edges[secondId];
      return {p[0], p[1], q[0], q[1]};
    }
  }
  const TriangleMesh& meshOf(int vertex) const {
    return vertex < (kind == ImpactQuery::Kind::VertexTriangle ? 1 : 2) ? first : second;
  }
  ImpactQuery query(std::uint32_t firstId, std::uint32_t secondId) const {
    return query(vertices(firstId, secondId));
  }
  ImpactQuery query(const std::array<std::uint32_t, 4>& ids) const {
    ImpactQuery result{kind, {}};
    for (int i = 0; i < 4; ++i)
      result.vertices[i] = {meshOf(i).before[ids[i]], meshOf(i).now[ids[i]]};
    return result;
  }
};

/// Tests one feature pair as Method::Continuous does and appends its contact. Returns whether there
/// was one. swapped: Features::first is MeshPair::b.
template <ImpactQuery::Kind kind>
bool addImpact(const MeshPair&, const Features<kind>&, std::uint32_t firstId,
               std::uint32_t secondId, bool swapped, ContactBuffers& out);

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
