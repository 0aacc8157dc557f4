#pragma once

#include <palpate/CollisionData.h>

#include "NarrowPhase/Order.h"
#include "Math/NormalCone.h"
#include "Core/Buffer.h"

#include <array>
#include <cstdint>
#include <optional>

namespace palpate {

/// The two features that hold an impact's closest points, as a key. An edge is given by its two
/// vertices, the lower first, and a vertex by its id twice. swapped: the contact's vertex is of the
/// pair's second mesh. self: the contact is of one mesh with itself, and the two features are in
/// ascending order.
/// Returns  nothing for the interior of a triangle and for the interiors of two edges: no other
///          contact has the same features.
using ImpactFeatures = std::array<std::uint64_t, 2>;
std::optional<ImpactFeatures> sharedFeatures(const VertexTriangleContact&, bool swapped, bool self);
std::optional<ImpactFeatures> sharedFeatures(const EdgeEdgeContact&, bool self);

/// Calls f(list, number) for the three lists of contacts between meshes.
template <class Lists, class F>
void forEachImpactList(Lists&& lists, F&& f) {
  f(lists.vertexTriangle, 0), f(lists.triangleVertex, 1), f(lists.edgeEdge, 2);
}

/// Contacts::Distinct for impacts: keeps the earliest of all impacts between the same two features.
/// Of equally early impacts it keeps the first by the order of the lists vertexTriangle,
/// triangleVertex and edgeEdge, and within a list by the order there.
///
/// Laws     (1) A dropped contact has the same features as the contact that is kept for it, which is
///          not later. (2) So each vertex, edge and triangle interior keeps the earliest time at
///          which it holds a closest point, and the earliest time of all is kept. (3) A second call
///          changes nothing.
/// Cost     n log n in the number of contacts with shared features.
class FirstImpacts {
 public:
  /// Call after orderContacts() has filled the contents with this scratch. Contacts from its
  /// preferred buffers are kept, and so are contacts with a time of impact of at least `end`. No
  /// contact is dropped because of one of these. Drops ExcludedImpacts first: they stand for no
  /// other.
  void keep(const MeshPair&, double end, const OrderScratch&, CollisionData::Contents&);

 private:
  struct Entry {
    ImpactFeatures features;
    double time;
    std::uint32_t list, index;
  };
  void dropExcluded(const MeshPair&, double end, const OrderScratch&,
                    const CollisionData::Contents&);

  struct Place {
    std::uint32_t list, index;
  };
  Buffer<Entry> m_entries;
  Buffer<Place> m_proper;                         ///< impacts that are not excluded, by vertex
  Buffer<TangentPlane> m_planes;                  ///< of m_proper
  Buffer<std::uint32_t> m_starts;                 ///< of each vertex, in m_proper
  std::array<Buffer<std::uint8_t>, 3> m_dropped;  ///< by list and index
};

}  // namespace palpate
