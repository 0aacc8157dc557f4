#pragma once

#include <palpate/Export.h>
#include <palpate/FeaturePairs.h>
#include <palpate/Types.h>
#include <palpate/Validity.h>

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>

namespace palpate {

// Contacts of every method satisfy one law. Take the positions at the contact's timeOfImpact. The
// sum of the positions of its stencil() times their weights equals (distance + radii) * normal,
// with the radii interpolated at the closest points. A ShapeContact has two points instead of a
// stencil: point - pointOnShape equals (distance + radius) * normal.
//
// Error    32 ulp of the largest coordinate difference among the four vertices, and the rounding of
//          the positions at that time. Method::Continuous adds timeTolerance times the vertices'
//          relative motion.
// Time     Proximity and Intersection test the step's end. Their contacts, and Auto's contacts from
//          them, have the time 1.
// Sign     A distance is negative in five cases. (1) Radii overlap. (2) An element is inside a
//          shape, or two shapes overlap. (3) A vertex-triangle contact of Method::Intersection,
//          also as part of Auto, has its vertex behind the triangle; the winding normal points to
//          the front. The normal of Intersection's vertex-triangle contacts is the winding normal
//          if the triangle's interior holds the closest point. If an edge or a corner holds it, the
//          normal lies along the line through both closest points, on the winding normal's side.
//          (4) Two edges that pierce the triangles at each other have crossed, by Intersection:
//          each of the closest points is below the surface at the other. (5) Auto, in a step that
//          begins in intersection, turned a contact (Side).
// Depth    A vertex is behind a surface if it is the end from which an edge leaves the surface. Of
//          Intersection it has one contact of negative distance, with the nearest feature around
//          the triangles that its edges pierce: a face, an edge or a vertex. It names the lowest
//          triangle that holds this feature and behind which the vertex is.
// Touch    If the centres are at distance 0, or for an impact without a thickness, the normal can
//          separate the surfaces: no triangle at the first feature lies on its back side,
//          and none at the second one on its front side, as far as such a normal exists. It is
//          the normal of a triangle at either feature, else the cross product of two edges there,
//          else the direction from which the features came. Where the step tells that side, the
//          normal is on it; otherwise closed surfaces tell it.
// Side     A contact at the step's end by Proximity has the normal of the positions there. If the
//          features have crossed, it is on the wrong side. An impact has the side from which its
//          features came. If a step of Auto begins in intersection, contacts of vertices that are
//          behind the other surface at its end, and impacts of those that leave it, have the side
//          on which they leave. Then with Contacts::Distinct, vertices behind a surface have the
//          contacts of Intersection only. Validity says whether sides are certified.
// Bodies   Where a step of Auto begins with two closed bodies deep in each other, all contacts have
//          one direction along which the bodies leave each other. The distance is measured along
//          it, to where the vertex leaves the other body; it is negative until then.

/// A contact of a vertex with a triangle. A contact of a vertex with the segment {p, q} has the
/// vertices {p, q, q}. A contact of a vertex with the point p has the vertices {p, p, p}.
struct VertexTriangleContact {
  std::uint32_t vertex, triangle;         ///< indices; `triangle` may be a segment or a point
  std::array<std::uint32_t, 3> vertices;  ///< of the triangle, segment or point
  Eigen::Vector3d weights;                ///< of these vertices at the closest point
  /// Unit. It points from the triangle to the vertex, or from the vertex to the triangle where the
  /// vertex is behind the surface, and the distance negative without radii.
  Eigen::Vector3d normal;
  double distance;      ///< L, at timeOfImpact, between the surfaces of the radii; sign: see above.
  double timeOfImpact;  ///< [0, 1] of the step; 1 for methods that test the step's end.
  /// The part that holds the closest point at that time: the corner, edge or face that the
  /// vertices with weights other than 0 span. A segment has EdgeAB, CornerA or CornerB, a point
  /// CornerA.
  TriangleFeature feature = TriangleFeature::Face;
  friend bool operator==(const VertexTriangleContact&, const VertexTriangleContact&) = default;
};

/// A contact of two edges.
struct EdgeEdgeContact {
  std::array<std::uint32_t, 2> edgeA, edgeB;  ///< vertex indices, lower first
  double weightA, weightB;                    ///< closest point = p0 + weight (p1 - p0)
  /// Unit, from edge b to edge a; from a to b where the edges have crossed.
  Eigen::Vector3d normal;
  double distance;      ///< L, at timeOfImpact; negative where radii overlap or edges crossed.
  double timeOfImpact;  ///< [0, 1] of the step; 1 for methods that test the step's end
  /// The part that holds each closest point at that time: an end if the weight is 0 or 1.
  EdgeFeature featureA = EdgeFeature::Interior, featureB = EdgeFeature::Interior;
  friend bool operator==(const EdgeEdgeContact&, const EdgeEdgeContact&) = default;
};

/// The type of feature that touches an analytical shape or a distance field.
enum class ShapeElement : std::uint32_t { Vertex, Edge, Face };
PALPATE_EXPORT const char* toString(ShapeElement) noexcept;  ///< its name, or "unknown"

/// A contact of a vertex, edge or triangle with an analytical shape, or with a body by
/// Method::DistanceField or Method::Proxy. All values are those at timeOfImpact.
/// Field    `distance` is the field's value at `point` less the radius. `normal` has the direction
///          of the field's gradient there; where that is 0, it is the last axis of the field's
///          frame. pointOnShape follows from both.
/// Proxy    the surface is the plane or the triangle that answers. `distance` is within
///          CollisionData::errorBound() of the exact one. By Auto, particles that may touch the
///          body within the step have the contacts of the exact method, at their timeOfImpact.
struct ShapeContact {
  ShapeElement element;
  std::uint32_t id;  ///< Index of the vertex or triangle; for an edge its lower vertex.
  /// Vertex indices: {v, v, v} for a vertex, {p, q, q} with p < q for an edge, or the corners of
  /// the triangle.
  std::array<std::uint32_t, 3> vertices;
  Eigen::Vector3d weights;       ///< Weights of the vertices at `point`; sum 1.
  Eigen::Vector3d point;         ///< L: on the element; for lines and points on the centre line.
  Eigen::Vector3d pointOnShape;  ///< L: on the shape's surface.
  Eigen::Vector3d normal;        ///< Unit, out of the shape towards the element.
  double distance;               ///< L: less the element's radius; negative: the depth inside.
  /// [0, 1] of the step; 1 for methods that test the step's end.
  double timeOfImpact = 1.0;
  friend bool operator==(const ShapeContact&, const ShapeContact&) = default;
};

/// A contact of two analytical shapes. All values are those at timeOfImpact: with
/// Method::Continuous the time at which the shapes first come near enough. If the shapes are apart,
/// the points are the closest points. If they overlap, the normal is the direction of the shortest
/// translation that separates them.
/// Error    pointA - pointB equals distance * normal. Where a cylinder overlaps another shape, the
///          two differ by up to 2e-3 of the two sizes.
struct ShapeShapeContact {
  Eigen::Vector3d pointA, pointB;  ///< L, on the surfaces of the first and of the second shape
  Eigen::Vector3d normal;          ///< unit, from shape b to shape a
  /// L. Negative: if shape a moves by -distance along the normal, it just touches shape b.
  double distance;
  double timeOfImpact = 1.0;  ///< [0, 1] of the step; 1 for Proximity
  friend bool operator==(const ShapeShapeContact&, const ShapeShapeContact&) = default;
};

/// Four vertices with signed weights. The weighted sum of their positions is the vector between the
/// two closest points. A contact force along the normal acts on vertex i with weight i.
struct Stencil {
  std::array<std::uint32_t, 4> vertices;
  std::array<double, 4> weights;
};

/// The vertex with weight 1, then the triangle's vertices with the negative weights.
inline Stencil stencil(const VertexTriangleContact& contact) {
  return {{contact.vertex, contact.vertices[0], contact.vertices[1], contact.vertices[2]},
          {1.0, -contact.weights[0], -contact.weights[1], -contact.weights[2]}};
}

/// The two ends of edge a with weights of at least 0, then those of edge b with weights of at most
/// 0.
PALPATE_EXPORT Stencil stencil(const EdgeEdgeContact& contact);

/// The contacts of one pair of geometries in the last frame.
/// Order    vertexTriangle by (vertex, triangle), triangleVertex by (triangle, vertex), edgeEdge by
///          (edgeA, edgeB), intersectingTriangles by (a, b), shape by (element, id, vertices).
/// Valid    a reference from OctreeBasedCD::collisionData(), and the spans of that object, are
///          valid until the next call on the OctreeBasedCD that is not const. A copy stays as it
///          is.
/// Errors   none.
class PALPATE_EXPORT CollisionData {
 public:
  /// The parts of an answer, for engines of your own. Lists are in the order above.
  struct Parts {
    std::span<const VertexTriangleContact> vertexTriangle{}, triangleVertex{};
    std::span<const EdgeEdgeContact> edgeEdge{};
    std::span<const ElementPair> intersectingTriangles{};
    std::span<const ShapeContact> shape{};
    std::span<const ShapeShapeContact> shapeShape{};
    /// Of a contact that no list has: ContinuousSettings::earliestTimeOnly.
    double earliestTimeOfImpact = std::numeric_limits<double>::infinity();
    double errorBound = 0.0;
    Validity validity{};
  };

  CollisionData() noexcept;              ///< no contacts
  explicit CollisionData(const Parts&);  ///< copies them
  CollisionData(const CollisionData&);
  CollisionData(CollisionData&&) noexcept;
  CollisionData& operator=(const CollisionData&);
  CollisionData& operator=(CollisionData&&) noexcept;
  ~CollisionData();

  Parts parts() const;  ///< the spans are those of the functions below

  /// Vertices of the first geometry with triangles, segments or points of the second.
  std::span<const VertexTriangleContact> vertexTriangle() const;
  /// Triangles, segments or points of the first geometry with vertices of the second. Empty for a
  /// geometry with itself.
  std::span<const VertexTriangleContact> triangleVertex() const;
  /// Edges of the first geometry with edges of the second.
  std::span<const EdgeEdgeContact> edgeEdge() const;
  /// Pairs of triangles that intersect at the step's end, from Method::Intersection, also as part
  /// of Auto. Each pair has a contact unless a predicate refuses it: its own, or that of a vertex
  /// behind the surface, which may be with another triangle. There is one exception for a mesh with
  /// itself: two triangles with a common vertex that intersect only where an edge of one pierces
  /// the other have no contact of their own.
  std::span<const ElementPair> intersectingTriangles() const;
  /// Vertices, edges and triangles with an analytical shape, or with a body by
  /// Method::DistanceField or Method::Proxy. Such an answer has no other contacts. If Auto answers
  /// by Proxy, a particle that touches several triangles in the step may have several contacts.
  std::span<const ShapeContact> shape() const;
  /// Two analytical shapes with each other: one contact if they are at most the thickness apart,
  /// with Method::Continuous at some time of the step.
  std::span<const ShapeShapeContact> shapeShape() const;
  /// Fraction of the step: the least timeOfImpact of all contacts, or infinity without contacts. 1
  /// if all contacts come from methods that test the step's end. With
  /// ContinuousSettings::earliestTimeOnly it is the time of the first contact, although no list has
  /// it.
  /// Cost     linear in the contacts.
  double earliestTimeOfImpact() const;

  /// L: by how much the distances may be off; 0 for methods that are exact up to rounding.
  ///
  /// DistanceField  that of the field. It bounds the distance of each contact's point from the
  ///                body, in the field's band. The least distance of an edge or a triangle may be
  ///                lower by another half of it, and features between the thickness and that far
  ///                below it may be missing.
  /// Proxy          the largest proven distance between the planes that answered and the surface,
  ///                and what rounding adds. A particle is missing or reported in excess only if its
  ///                distance is within this of the limit.
  double errorBound() const;

  /// Whether this answer can be trusted, and why not.
  const Validity& validity() const;

  /// Two answers with the same bits have the same hash, on every machine. It includes the ids,
  /// weights, normals, distances, times and features of all contacts in their order, and no part of
  /// validity().
  std::uint64_t hash() const;

  struct Contents;  ///< not part of the interface

 private:
  const Contents& read() const;

  std::unique_ptr<Contents> m_contents;  ///< null: no contacts
};

}  // namespace palpate
