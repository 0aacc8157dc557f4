#pragma once

#include "CollisionDetection/PairTable.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Queries/BodyPenetration.h"

#include <cstdint>
#include <span>

namespace palpate {

/// Auto: the contacts of two closed bodies where a step begins in intersection, or with one body
/// inside the other. The surface of a closed body has an outer side, which the step does not know.
class BodyContacts {
 public:
  /// Buffers of contacts that one pair has in a frame.
  using Buffers = std::span<ContactBuffers* const>;

  /// Decides at the step's end. Returns whether the bodies are deep in each other. contacts() then
  /// stand for all contacts of the pair: all have the direction of penetrationOf() as their normal.
  ///
  /// Bodies are deep in each other if a vertex is behind a triangle by more than the thickness and
  /// 1/64 of the smaller body, if local contacts push against each other, if only edges intersect,
  /// or if one body is wholly inside the other.
  ///
  /// local    the contacts of Intersection at the end, with the triangles that intersect.
  /// step     the other contacts. Those on an inner side are removed: features that are inside the
  ///          other body at the end, or that leave it within the step.
  bool find(const PairRecord&, Engine, bool startsIntersecting, Buffers local, Buffers step);
  ContactBuffers& contacts() { return m_contacts; }
  /// Whether the last find() removed contacts of `step`.
  bool hasRemoved() const { return m_hasRemoved; }

 private:
  void addContacts(const PairRecord&, Engine, const Penetration&, Buffers local);
  void addVertices(const BodyPair&, bool ofA, const Penetration&, double thickness);
  void addEdges(const Penetration&);

  PenetrationScratch m_scratch;
  ContactBuffers m_contacts;
  bool m_hasRemoved = false;
};

}  // namespace palpate
