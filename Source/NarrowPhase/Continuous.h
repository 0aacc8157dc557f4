#pragma once

#include "Math/ImpactQuery.h"
#include "NarrowPhase/NarrowPhase.h"

#include <array>
#include <span>

namespace palpate {

/// Method::Continuous of findContacts(): every vertex-triangle and edge-edge pair with an impact in
/// the step from `before` to `now`, with the thickness as its minimum distance.
///
/// timeOfImpact is not after the first impact and at most the settings' timeTolerance before it;
/// all else is of that time.
/// The normal, at thickness 0: the contact plane's, on the side where the vertex, or edge a, was
/// before; where it was always in that plane, the triangle's winding normal or the cross product of
/// the edges; of degenerate elements the axis that distances use. With a thickness: that of the
/// distance.
void findContinuous(const MeshPair&, std::span<const ElementPair> candidates, ContactBuffers& out);

/// The two meshes that feature pairs of one kind come from: vertices of the first with triangles of
/// the second, or edges of each.
template <ImpactQuery::Kind kind>
struct Features {
  const TriangleMesh& first;
  const TriangleMesh& second;

  std::array<std::uint32_t, 4> vertices(std::uint32_t inFirst, std::uint32_t inSecond) const {
    if constexpr (kind == ImpactQuery::Kind::VertexTriangle) {
      const auto& [a, b, c] = second.topology.triangles[inSecond];
      return {inFirst, a, b, c};
    } else {
      const Segment &p = first.topology.edges[inFirst], &q = second.topology.edges[inSecond];
      return {p[0], p[1], q[0], q[1]};
    }
  }
  const TriangleMesh& meshOf(int vertex) const {
    return vertex < (kind == ImpactQuery::Kind::VertexTriangle ? 1 : 2) ? first : second;
  }
  ImpactQuery query(std::uint32_t inFirst, std::uint32_t inSecond) const {
    const auto ids = vertices(inFirst, inSecond);
    ImpactQuery result{kind, {}};
    for (int i = 0; i < 4; ++i)
      result.vertices[i] = {meshOf(i).before[ids[i]], meshOf(i).now[ids[i]]};
    return result;
  }
};

/// One feature pair of Method::Continuous; returns whether it is a contact. ofSecond: the first
/// feature is of the pair's second mesh.
template <ImpactQuery::Kind kind>
bool addImpact(const MeshPair&, const Features<kind>&, std::uint32_t inFirst,
               std::uint32_t inSecond, bool ofSecond, ContactBuffers& out);

/// Method::Auto: impacts of those feature pairs that proximity at the step's end does not answer.
void findFastImpacts(const MeshPair&, std::span<const ElementPair> candidates, ContactBuffers& out);

/// The earliest timeOfImpact that findContinuous() would report, or upTo if that is earlier;
/// infinity is a good first upTo. Impacts after it cost little, so passing the smallest time of
/// earlier candidates makes later ones cheap. The smallest over all candidates has the same bits
/// whatever their order, batches and upTo. counts: featurePairs and exactDecisions only.
double findEarliestImpact(const MeshPair&, std::span<const ElementPair> candidates, double upTo,
                          ContactBuffers& counts);

}  // namespace palpate
