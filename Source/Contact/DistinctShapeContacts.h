#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Settings.h>

#include "Shapes/Shape.h"
#include "Mesh/TriangleMesh.h"
#include "Core/Buffer.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

/// Contacts::Distinct for a mesh and a shape: drops contacts of vertices and edges whose normal the
/// elements around them exclude, if another contact stands for them.
///
/// A triangle at a vertex or an edge excludes the direction to the shape if it leads into the
/// triangle: the triangle then comes nearer to the shape than the vertex or edge. So does a segment
/// at a vertex. A contact that is excluded is dropped if a contact that is not
/// (1) is earlier, or as early and nearer; a triangle may be up to timeTolerance later,
/// (2) has a tangent plane that contains the vertex or edge at the step's end,
/// (3) holds the shape in front of that plane: no point of the shape is nearer to the plane, at the
///     step's end, than its row, or a row of another contact with the plane, says, and
/// (4) the vertex or edge is on no ridge or border of a mesh with faces, unless the shape is a
///     sphere.
/// So the rows that stay keep the shape away from the vertex or edge, by the law of hasRidge().
/// Ridges, also around a tool within the step, keep all their contacts.
///
/// A contact stays if it has the normal of the one that stands for it, at another point of the
/// shape. A body that lies on a floor needs contacts at all its corners.
///
/// Where a box, a cylinder or a hull has sunk into the mesh, no row holds it in front of a plane. A
/// contact that is excluded, and around which all elements lie in one plane, is then also dropped
/// if a contact that is not, in which the shape is inside the mesh, (1) is in time, as above, (2)
/// has its vertices in that plane, and (3) leads out of it more steeply.
///
/// Laws     (1) The first and nearest contact stays, or a triangle that is at most timeTolerance
///          later stands for it. (2) What is dropped does not depend on the order of the pair, nor
///          on how the contacts were found.
/// Cost     linear in the contacts for each of at most kMostPlanes planes: those of the first and
///          nearest contacts. Where the shape has sunk in, also the product of the planes of the
///          mesh in which contacts are excluded and the contacts that are sunk, some nanoseconds
///          each.
class DistinctShapeContacts {
 public:
  static constexpr int kMostPlanes = 8;

  /// contacts: all of one pair, in the order of CollisionData::shape(). before, now: poses of the
  /// shape, which is at the step's end. Returns how many of them stay, at the front and in the same
  /// order.
  std::size_t keep(const TriangleMesh&, const Shape&, const Pose& before, const Pose& now,
                   const PairSettings&, std::span<ShapeContact> contacts);

 private:
  /// Proper: not excluded. OnPlane: the same, and its tangent plane has been used.
  enum class State : std::uint8_t { Proper, OnPlane, Excluded, Dropped };
  class Step;
  /// A plane of the mesh.
  struct FlatPart {
    Eigen::Vector3d normal;
    double height;  ///< L
  };
  /// A contact that is not excluded, in which the shape is inside the mesh.
  struct Sunk {
    std::size_t contact;
    Eigen::Vector3d vertex;  ///< one of the contact's
  };
  struct Leading {
    double steepness;  ///< cosine of the angle between the contact's normal and the part's
    std::size_t contact;
  };
  void dropAlongFlatParts(const Step&, std::span<const ShapeContact>);

  Buffer<State> m_states;  ///< per contact
  Buffer<FlatPart> m_parts;
  Buffer<std::array<std::size_t, 2>> m_flat;  ///< a flat part, and an excluded contact of it
  Buffer<Sunk> m_sunk;
  Buffer<Leading> m_leading;  ///< sunk contacts with all vertices in one part
};

}  // namespace palpate
