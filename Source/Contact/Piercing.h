#pragma once

#include "Contact/ContactBuffers.h"
#include "Contact/MeshPair.h"
#include "Math/TriangleIntersection.h"
#include "Core/Buffer.h"

#include <Eigen/Geometry>

#include <array>
#include <compare>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <span>

namespace palpate {

/// Appends the crossings of two intersecting triangles at the step's start or at its end. See
/// PiercingContacts.
void recordCrossings(const MeshPair&, bool atStart, const ElementPair&, const TriangleIntersection&,
                     Buffer<EdgeCrossing>& out);

/// The contacts of triangles that pierce each other, without touching features. They depend on all
/// crossings of a pair of meshes, and are therefore found after the last batch.
///
/// Crossing an edge crosses a triangle if its ends are strictly on different sides of the
///          triangle's plane and it meets the triangle, borders included. Crossings of one edge
///          through one face, edge or vertex count once.
/// Leaving  through a face, an edge leaves the surface from behind to the front. Through an edge or
///          a vertex around which the surface is closed, it leaves if it is strictly inside before
///          and not behind (FeatureStar): along the surface it is not inside. Through a border, it
///          leaves if it leaves all triangles that it crosses there, and runs along none.
/// Behind   the end from which an edge leaves more often than it enters is behind the surface. Of a
///          closed surface that does not cross itself, this end is inside and the other is not.
/// Depth    a vertex behind a surface has one contact, with the nearest of the triangles that such
///          edges cross, or with a nearer one. The search goes on from the feature with the
///          closest point to all triangles that hold it, as long as one of them is nearer. It
///          enters only triangles behind which the vertex is. The contact names the lowest of these
///          that hold the closest feature. If the feature is an edge or a vertex, the normal leads
///          from the vertex to the closest point.
/// Exit     distance of a feature: how far the vertex and the places where such edges cross the
///          surface must move along the normal to be in front of the plane through the closest
///          point. The wall of a blunt tool may be the nearest feature, but the tool's end has the
///          shorter exit distance. Of this feature and all others from which the search goes no
///          further, the one with the shortest exit distance has the contact; of those that differ
///          by rounding, the first one, and then the nearest. Triangles whose boxes are at most 1.5
///          times the first exit distance from the vertex must connect the feature with the first
///          one, or one that such an edge crosses: the vertex does not leave through another sheet.
/// Pairs    triangles that pierce each other have the contact of IntersectionContacts.h, unless one
///          of a vertex behind stands for them. Such a vertex is an end of one of the crossing
///          edges, or a corner of which an edge crosses the surface next to the other triangle.
/// Ridges   the convex edges at the corners of a crossed triangle. An edge is below the nearest one
///          that it has crossed, if both closest points are between the ends.
/// Below    an edge that enters the surface through one triangle and leaves it through another one
///          is below a ridge of these that is no further away than its two crossings are apart. The
///          contact of both stands for the pair. If the two triangles have a vertex in common that
///          is behind the other surface, this vertex' contact does.
/// Rim      the contact of a vertex holds the vertex only. An edge from it may cross the surface
///          elsewhere and deeper: a box that hangs over the edge of a table crosses the table's
///          side. If such a crossing is at least half as deep below the plane through the closest
///          point as the vertex, the edge has a contact with the ridge that it is below. The ridge
///          must be at most 1.5 times that depth away, and lead out within 45 degrees of the
///          vertex' normal.
/// Border   a vertex behind an open surface may be beyond its border: this is nearest, and not
///          along the normal of a triangle there. A box that hangs over the edge of a sheet has
///          corners there, and the way to the border is as long as they hang over. If the vertex'
///          edges that cross the surface pass below borders at corners of the crossed triangles and
///          of those that hold the nearest feature, their contacts with these stand for that of the
///          vertex: such a border is no further away than the vertex, and leads out within 45
///          degrees of the mean normal at the feature. If the other surface is closed, and vertices
///          of the nearest feature are behind it, theirs do.
/// Law      the results do not depend on the order of crossings and pairs, nor on repeated ones.
/// Cost     n log n in the crossings; a vertex behind measures the connected triangles that are at
///          most 1.5 times its first exit distance from it. Scratch memory of 4 bytes for each
///          triangle and vertex.
class PiercingContacts {
 public:
  /// Appends all contacts at the step's end.
  void find(const MeshPair&, std::span<ContactBuffers* const> found, ContactBuffers& out);
  /// Appends the contacts of vertices that are behind a surface at the step's start, unfiltered.
  void findAtStart(const MeshPair&, std::span<ContactBuffers* const> found, ContactBuffers& out);

  /// A vertex behind a triangle that one of its edges crosses. ofB: of MeshPair::b.
  struct Behind {
    bool ofB;
    std::uint32_t vertex, triangle, edge;
    auto operator<=>(const Behind&) const = default;
  };
  /// A triangle near a vertex, or an edge near another one.
  struct Near {
    double distance;  ///< L
    std::uint32_t id;
    auto operator<=>(const Near&) const = default;
  };
  /// Of one vertex.
  struct Scratch {
    Buffer<Eigen::Vector3d> crossings;  ///< L: from the vertex to each Behind of it; or NaN
    Buffer<Near> nearer;
    Buffer<std::uint32_t> reached;  ///< vertices of the surface
    /// For each triangle and vertex of the surface the last turn in which it was reached.
    Buffer<std::uint32_t> triangleTurns, vertexTurns;
    std::uint32_t turn = 0;
  };

 private:
  void collect(std::span<ContactBuffers* const> found, Buffer<EdgeCrossing> ContactBuffers::*list);
  void findBehind(const MeshPair&, bool atStart, ContactBuffers& out);
  void addDepths(const MeshPair&, bool atStart, ContactBuffers& out);
  /// Of m_behind.
  std::span<const Behind> behindOf(bool ofB, std::uint32_t vertex) const;
  /// Whether contacts of vertices stand for a pair of triangles (Pairs).
  bool isRepresented(const MeshPair&, const PiercedPair&) const;
  std::span<const EdgeCrossing> crossingsOf(bool ofB, std::uint32_t edge) const;
  bool addBelow(const MeshPair&, const PiercedPair&, ContactBuffers& out);
  /// The contacts of a vertex' edges with a border that it is beyond. Returns whether there are
  /// any.
  bool addBorders(const MeshPair&, std::span<const Behind>, const VertexTriangleContact& nearest,
                  const Eigen::Vector3d& outward, ContactBuffers& out);
  /// Edges at corners of the triangles, the nearest first, whose closest points to the edge are
  /// between the ends of both. isAllowed(other edge, from the edge to it, its length) chooses among
  /// these. ofB, wayOut: see addRidge().
  template <class IsAllowed>
  std::span<const Near> findEdgesAbove(const MeshPair&, bool ofB, std::uint32_t edge,
                                       std::span<const std::uint32_t> triangles,
                                       const Eigen::Vector3d* wayOut, IsAllowed&& isAllowed);
  /// Adds the contact of an edge and the nearest ridge that it is below, of the ridges at corners
  /// of the triangles. isAllowed(from the edge to the ridge, its length) chooses among these.
  /// Returns whether there is one. ofB: the edge is of MeshPair::b, and the ridge is not. wayOut:
  /// if there is one, isAllowed() is false outside of kSameWayOut of this direction.
  template <class IsAllowed>
  bool addRidge(const MeshPair&, bool ofB, std::uint32_t edge,
                std::initializer_list<std::uint32_t> triangles, const Eigen::Vector3d* wayOut,
                ContactBuffers& out, IsAllowed&& isAllowed);

  Buffer<EdgeCrossing> m_crossings;
  Buffer<Behind> m_behind;
  Scratch m_scratch;
};

}  // namespace palpate
