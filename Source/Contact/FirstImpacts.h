#pragma once

#include "Contact/Contents.h"
#include "Contact/EndRows.h"
#include "Contact/ExcludedImpacts.h"
#include "Contact/ImpactPlaces.h"
#include "Contact/MeshPair.h"
#include "Contact/Order.h"
#include "Core/Buffer.h"

namespace palpate {

/// Contacts::Distinct for impacts: keeps the earliest of all impacts between the same two features.
/// Of equally early impacts it keeps the first by the order of the lists vertexTriangle,
/// triangleVertex and edgeEdge, and within a list by the order there.
///
/// Laws     (1) A contact that this rule drops has the features of the contact that is kept for it,
///          which is not later. (2) So each vertex, edge and triangle interior keeps the earliest
///          time at which it holds a closest point, but for ExcludedImpacts. (3) A second call
///          changes nothing.
/// Cost     n log n in the number of contacts with shared features.
class FirstImpacts {
 public:
  /// Call after orderContacts() has filled the contents with this scratch. Contacts from its
  /// preferred buffers are kept, and so are contacts with a time of impact of at least `end`. No
  /// contact is dropped because of one of these. Drops ExcludedImpacts first: they stand for no
  /// other. Writes the rows at the step's end (EndRows).
  void keep(const MeshPair&, double end, const OrderScratch&, CollisionData::Contents&);

 private:
  struct Entry {
    ImpactFeatures features;
    double time;
    ImpactPlace place;
  };
  void dropRepeated(bool self, const Impacts&);

  DroppedImpacts m_dropped;
  ExcludedSearch m_excluded;
  Buffer<Entry> m_entries;
  EndRows m_endRows;
};

}  // namespace palpate
