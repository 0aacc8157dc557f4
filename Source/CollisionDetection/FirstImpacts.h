#pragma once

#include <palpate/CollisionData.h>

#include "NarrowPhase/Order.h"
#include "Math/NormalCone.h"
#include "Core/Buffer.h"

#include <array>
#include <cstdint>
#include <optional>
#include <span>

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

/// Sorted vertices of features that may meet in the step, by the side of the pair.
using MetVertices = std::array<std::span<const std::uint32_t>, 2>;

/// Calls f(list, number) for the three lists of contacts between meshes.
template <class Lists, class F>
void forEachImpactList(Lists&& lists, F&& f) {
  f(lists.vertexTriangle, 0), f(lists.triangleVertex, 1), f(lists.edgeEdge, 2);
}

/// Contacts::Distinct for impacts: keeps the earliest of all impacts between the same two features.
/// Of equally early impacts it keeps the first by the order of the lists vertexTriangle,
/// triangleVertex and edgeEdge, and within a list by the order there.
///
/// Laws     (1) A contact that this rule drops has the features of the contact that is kept for it,
///          which is not later. (2) So each vertex, edge and triangle interior keeps the earliest
///          time at which it holds a closest point, but for ExcludedImpacts. (3) A second call
///          changes nothing.
/// Cost     n log n in the number of contacts with shared features.
///
/// Also finds what the rows of the impacts say at the step's end at least
/// (CollisionData::Contents::Step::endGaps). A row is linearised at its time, and may ask for more
/// than the features need at the end: where they slide past an edge, the row of the plane behind it
/// knows nothing of the edge. An impact that stays stands for itself and for the dropped impacts
/// that it replaces. If none of these features' vertices may have met others in the step, its
/// features kept their sides, and their least distance at the step's end is what its row says at
/// least.
class FirstImpacts {
 public:
  /// Call after orderContacts() has filled the contents with this scratch. Contacts from its
  /// preferred buffers are kept, and so are contacts with a time of impact of at least `end`. No
  /// contact is dropped because of one of these. Drops ExcludedImpacts first: they stand for no
  /// other.
  void keep(const MeshPair&, double end, const MetVertices&, const OrderScratch&,
            CollisionData::Contents&);

 private:
  struct Entry {
    ImpactFeatures features;
    double time;
    std::uint32_t list, index;
  };
  struct Place {
    std::uint32_t list, index;
  };
  void dropExcluded(const MeshPair&, double end, const OrderScratch&,
                    const CollisionData::Contents&);
  void drop(Place dropped, Place standIn);
  void findEndGaps(const MeshPair&, double end, const MetVertices&, const OrderScratch&,
                   const CollisionData::Contents&);

  /// An impact that is not excluded, and the side of the element that it holds.
  struct Holder {
    std::uint32_t list, index;
    std::size_t side;
  };
  Buffer<Entry> m_entries;
  Buffer<Holder> m_holders;                       ///< by the first vertex of the element
  Buffer<TangentPlane> m_planes;                  ///< of m_holders
  Buffer<std::uint32_t> m_starts;                 ///< of each vertex, in m_holders
  std::array<Buffer<std::uint8_t>, 3> m_dropped;  ///< by list and index
  std::array<Buffer<Place>, 3> m_standIns;        ///< of dropped contacts, by list and index
  std::array<Buffer<double>, 3> m_endGaps;        ///< L: by list and index
};

}  // namespace palpate
