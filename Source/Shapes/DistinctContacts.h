#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Settings.h>

#include "Core/Buffer.h"
#include "Mesh/TriangleMesh.h"
#include "Shapes/Shape.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

/// Contacts::Distinct for a mesh and a shape: drops contacts of vertices and edges whose normal the
/// elements around them exclude.
///
/// A triangle at a vertex or an edge excludes the direction to the shape if it leads into the
/// triangle: the triangle then comes nearer to the shape than the vertex or edge. So does a segment
/// at a vertex. The triangle itself, or another vertex or edge of it that is earlier, or as early
/// and nearer, is then a contact that stands for this one, and this one is dropped.
///
/// The direction at the step's end must be excluded as well: a surface that a solver has bent
/// around the shape needs all its contacts.
///
/// It stays if a vertex or edge that stands for it has the same normal, and no triangle excludes
/// that one. Both are then over the same flat face of the shape, and none of them is tilted. A
/// sheet that lies on a box needs the contacts of all its vertices. Contacts with a plane all have
/// one normal, and all stay.
///
/// Laws     (1) A contact of a triangle stays. In each connected part of the mesh the first and
///          nearest contact stays, or a triangle that is at most timeTolerance later stands for it.
///          (2) What is dropped does not depend on the order of the pair, nor on how the contacts
///          were found.
/// Cost     n log n in the number of contacts.
class DistinctContacts {
 public:
  /// contacts: all of one pair, in the order of CollisionData::shape(). Returns how many of them
  /// stay, at the front and in the same order.
  std::size_t keep(const TriangleMesh&, const Shape&, const PairSettings&,
                   std::span<ShapeContact> contacts);

 private:
  /// Proper: no triangle excludes it, or a proper one that stands for it has its normal. Alone: no
  /// contact stands for it, though a triangle excludes it.
  enum class State : std::uint8_t { Proper, Alone, Dropped };
  struct Search;
  Buffer<std::uint32_t> m_order;  ///< contacts that need a search, the first and nearest first
  Buffer<State> m_states;         ///< per contact
  /// Per id, of each ShapeElement: its first contact, or kNoElement. Between calls all are that.
  std::array<Buffer<std::uint32_t>, 3> m_firsts;
};

}  // namespace palpate
