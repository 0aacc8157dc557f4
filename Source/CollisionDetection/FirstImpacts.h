#pragma once

#include <palpate/CollisionData.h>

#include "CollisionDetection/Order.h"
#include "Core/Buffer.h"

#include <array>
#include <cstdint>
#include <optional>

namespace palpate {

/// The two features that hold an impact's closest points, as a key: an edge by its vertices, lower
/// first, a vertex twice. `self`: the contact is of one mesh with itself, and the features come in
/// ascending order.
/// Returns  nothing for the interior of a triangle and for the interiors of two edges: no other
///          contact has the same features.
using ImpactFeatures = std::array<std::uint64_t, 2>;
std::optional<ImpactFeatures> sharedFeatures(const VertexTriangleContact&, bool ofSecond,
                                             bool self);
std::optional<ImpactFeatures> sharedFeatures(const EdgeEdgeContact&, bool self);

/// f(list, number) of the three lists of contacts between meshes.
template <class Lists, class F>
void forEachImpactList(Lists&& lists, F&& f) {
  f(lists.vertexTriangle, 0), f(lists.triangleVertex, 1), f(lists.edgeEdge, 2);
}

/// Contacts::Distinct of impacts: of all impacts between the same two features the earliest stays;
/// of equally early ones the first of the lists vertexTriangle, triangleVertex and edgeEdge, and in
/// one list the first.
///
/// Laws     (1) a dropped contact has the same features as the contact that stands for it, which is
///          not later. (2) So each vertex, edge and triangle interior keeps the earliest time at
///          which it holds a closest point, and the earliest time of all stays. (3) keeping twice
///          is keeping once.
/// Cost     n log n in the number of contacts with shared features.
class FirstImpacts {
 public:
  /// Of contents that orderContacts() has just filled with this scratch. Contacts of its preferred
  /// buffers stay, and so do those whose time of impact is at least `end`; no contact is dropped
  /// for one of these.
  void keep(bool self, double end, const OrderScratch&, CollisionData::Contents&);

 private:
  struct Entry {
    ImpactFeatures features;
    double time;
    std::uint32_t list, index;
  };
  Buffer<Entry> m_entries;
  std::array<Buffer<std::uint8_t>, 3> m_dropped;  ///< by list and index
};

}  // namespace palpate
