#pragma once

#include <palpate/CollisionData.h>

#include "Contact/ContactBuffers.h"
#include "Contact/MeshPair.h"
#include "Core/Buffer.h"

#include <Eigen/Core>

#include <cstdint>
#include <span>
#include <utility>

namespace palpate {

/// Auto, in a step that begins in intersection: what Intersection's contacts tell about the sides
/// of other contacts.
///
/// Sides    a vertex that is behind the other surface leaves it along the normal of its contact
///          with a negative distance, or, beyond a border, along the mean normal of the triangles
///          at the nearest feature. A contact is on the wrong side if it moves the vertices of its
///          closest points against that, by the weighted sum. That of a vertex beyond a border with
///          the border is on no wrong side: both are apart.
/// Rule     (1) Of vertices that are behind at the step's end: Contacts::Distinct drops all other
///          contacts of these vertices, because Intersection's contact stands for them.
///          Contacts::All turns those that are on the wrong side: the normal is reversed and the
///          distance becomes negative.
///          (2) Of vertices that are behind at the step's start and not at its end, which leave:
///          an impact on the wrong side is turned. Contacts::Distinct drops impacts of a vertex
///          for which another one stands: one in which the vertex meets a triangle, and other
///          vertices that leave do not disagree.
///          (3) Of vertices whose edges cross nothing: each that is next to one of (1) or (2), or
///          to another one of these, and whose own contact is below the surface and not beyond a
///          border, is behind as well. This contact, at the end or an impact, is turned, and those
///          of its edges are that are on the wrong side.
class KnownSides {
 public:
  /// atEnd, atStart: Intersection's contacts.
  void apply(const MeshPair&, std::span<ContactBuffers* const> atEnd, const ContactBuffers& atStart,
             std::span<ContactBuffers* const> others);

 private:
  struct Side : LeavingVertex {
    bool isRepresented = false;  ///< an impact stands for the vertex
    bool isReached = false;      ///< by edges from a vertex behind
  };
  /// What the sides of a contact's vertices say about it.
  struct Opinion {
    bool isKnown = false, isRepresented = false;
    double agreement = 0.0;  ///< negative: the contact is on the wrong side
  };
  static void add(const ContactBuffers&, Buffer<Side>&);
  static void sort(Buffer<Side>&);
  static std::span<Side> sidesAt(Buffer<Side>& sorted, bool ofB, std::uint32_t vertex);
  /// Whether a vertex of the stencil of a contact between meshes is of MeshPair::b.
  bool isOfB(ContactKind kind, std::size_t place) const;
  void findBeside(const MeshPair&, bool atStart, std::span<ContactBuffers* const> others,
                  Buffer<Side>& known, Buffer<Side>& beside);
  void keepReached(const MeshPair&, const Buffer<Side>& known, Buffer<Side>& beside);
  Opinion ask(Buffer<Side>& sorted, ContactKind, const Stencil&, const Eigen::Vector3d& normal);
  bool represents(ContactKind, const VertexTriangleContact&);
  bool represents(ContactKind, const EdgeEdgeContact&) { return false; }
  template <class Contact>
  bool settle(const MeshPair&, ContactKind, Contact&, bool drops);

  bool m_self = false;
  Buffer<Side> m_atEnd, m_atStart;
  Buffer<Side> m_besideAtEnd, m_besideAtStart;
  Buffer<std::pair<bool, std::uint32_t>> m_reached;  ///< scratch: vertices, and whether of b
};

}  // namespace palpate
