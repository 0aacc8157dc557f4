#pragma once

#include <palpate/CollisionData.h>

#include "Search/ExcludedImpacts.h"
#include "Contact/Contents.h"
#include "Contact/Order.h"
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
/// Laws     (1) A contact that this rule drops has the features of the contact that is kept for it,
///          which is not later. (2) So each vertex, edge and triangle interior keeps the earliest
///          time at which it holds a closest point, but for ExcludedImpacts. (3) A second call
///          changes nothing.
/// Cost     n log n in the number of contacts with shared features.
///
/// Also finds rows of impacts at the step's end (CollisionData::Contents::Step::endRows). A row is
/// linearised at its time, and may ask for more than the features need at the end: where they slide
/// past an edge, the row of the plane behind it knows nothing of the edge. An impact that stays
/// stands for itself and for the dropped impacts that it replaces. If no vertex of it may have met
/// the other mesh in the step, its features kept their sides. If its row asks for more than they
/// need, the row at the end has the gap of the nearest pair for which it stands. It is that pair's,
/// if it is one of the same vertex or edges and no element excludes its normal at the end.
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
  struct Place {
    std::uint32_t list, index;
  };
  struct StandIn {
    Place dropped, kept;
  };
  /// An impact that stays, whose row asks for more than its features need.
  struct Candidate {
    Place place;
    double gap;  ///< L: at the step's end
  };
  void dropExcluded(const MeshPair&, double end, const OrderScratch&,
                    const CollisionData::Contents&);
  void findEndRows(const MeshPair&, double end, const OrderScratch&,
                   const CollisionData::Contents&);

  /// An impact that is not excluded, and the side of the element that it holds.
  struct Holder {
    std::uint32_t list, index, side;
    bool isOfFace;
    double time, distance;
    ImpactElement element;
    std::uint32_t plane;  ///< of m_planes; kNoPlane: not needed yet
  };
  Buffer<Entry> m_entries;
  Buffer<Holder> m_holders;                       ///< by the bucket of the element's first vertex
  Buffer<TangentPlane> m_planes;                  ///< of some m_holders
  Buffer<std::uint32_t> m_starts;                 ///< of each bucket and size, in m_holders
  std::array<Buffer<std::uint8_t>, 3> m_dropped;  ///< by list and index
  /// By list and index, of contacts that are dropped for another one with their features: that one.
  std::array<Buffer<Place>, 3> m_sameFeatures;
  Buffer<StandIn> m_standIns;                       ///< of all dropped contacts
  std::array<Buffer<std::uint32_t>, 3> m_endRowOf;  ///< by list and index: in m_endRows
  Buffer<CollisionData::Contents::Step::EndRow> m_endRows;
  Buffer<Candidate> m_candidates;
  /// By side and vertex: whether the vertex of a candidate may have met the other mesh. Between
  /// calls all are unknown.
  std::array<Buffer<std::uint8_t>, 2> m_met;
  bool m_isMarked = false;             ///< not all are
  Buffer<Place> m_nearest;             ///< of m_endRows: the pair with this gap
  Buffer<std::uint32_t> m_listOfRows;  ///< of m_endRows
};

}  // namespace palpate
