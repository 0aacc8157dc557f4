#pragma once

#include "Search/Question.h"
#include "Queries/BodyPenetration.h"
#include "NarrowPhase/NarrowPhase.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

/// Auto: the contacts of two closed bodies where a step begins in intersection, or with one body
/// inside the other, and local contacts do not separate them.
class BodyContacts {
 public:
  /// Buffers of contacts that one pair has in a frame.
  using Buffers = std::span<ContactBuffers* const>;

  /// Decides at the step's end. Returns whether the bodies are deep in each other. contacts() then
  /// stand for all contacts of the pair: all have the direction of penetrationOf() as their normal.
  ///
  /// Bodies are deep in each other if contacts of Intersection push by more than 60 degrees away
  /// from the mean of its vertex-triangle contacts, if there are none of these, or if one body is
  /// wholly inside the other. Where a body that was inside is outside at the end, impacts within
  /// the step that would pull it back are turned: they push it on out.
  ///
  /// local  the contacts of Intersection at the end, with the triangles that intersect
  /// step   the other contacts
  /// Cost   of bodies that are deep in each other: that of penetrationOf(), on one thread
  bool find(const Question&, Engine, bool startsIntersecting, Buffers local, Buffers step);
  ContactBuffers& contacts() { return m_contacts; }
  /// Of the last find(): the number of decisions by exact arithmetic.
  std::size_t exactDecisions() const { return m_scratch.pair.stack.exactDecisions; }
  /// Whether the last find() turned contacts of `step`.
  bool hasTurned() const { return m_hasTurned; }

 private:
  void addContacts(const BodyPair&, const Penetration&, double thickness, Buffers local);
  void addVertices(const BodyPair&, bool ofA, const Penetration&, double thickness);
  void addEdges(const Penetration&);

  PenetrationScratch m_scratch;
  ContactBuffers m_contacts;
  bool m_hasTurned = false;
};

}  // namespace palpate
