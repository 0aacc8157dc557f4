#pragma once

#include <palpate/Distance.h>
#include <palpate/Export.h>
#include <palpate/Types.h>
#include <palpate/Validity.h>

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace palpate {

// Contacts of every method satisfy one law. With the positions at the contact's timeOfImpact, the
// sum of the positions of its stencil() times their weights is (distance + radii) * normal, with
// the radii interpolated at the closest points; of a ShapeContact this is point - pointOnShape.
//
// Error    32 ulp of the largest coordinate difference among the four vertices, and the rounding of
//          the positions at that time. Method::Continuous adds timeTolerance times the vertices'
//          relative motion.
// Time     methods that look at the step's end (Proximity, Intersection, Auto's contacts from them)
//          give 1.
// Sign     distances are negative by radii, of shapes inside them, and for vertex-triangle contacts
//          of Method::Intersection, also as part of Auto, where the vertex lies behind the triangle
//          as its winding normal points. The normal of these is the winding normal where the
//          triangle's interior holds the closest point. Where an edge or a corner holds it, the
//          normal is along the line through both closest points, on the winding normal's side.
// Touching centres at distance 0 have the winding normal, or the cross product of the edges, as
//          <palpate/Distance.h> states. Method::Continuous without a thickness turns it to the side
//          from which the features came.

/// A vertex against a triangle; a point against a segment {p, q} is one with the corners {p, q, q},
/// and against another point {p, p, p}.
struct VertexTriangleContact {
  std::uint32_t vertex, triangle;
  std::array<std::uint32_t, 3> corners;  ///< the triangle's vertices
  Eigen::Vector3d barycentric;           ///< of the closest point, in the triangle's corner order
  /// unit, from the triangle towards the vertex; turned round where Intersection's vertex lies
  /// behind
  Eigen::Vector3d normal;
  double distance;      ///< L, less the radii, at timeOfImpact; sign: see above
  double timeOfImpact;  ///< [0, 1] of the step; 1 for methods that look at its end
  /// What holds the closest point at that time: what the corners with weights other than 0 span. Of
  /// a segment EdgeAB, CornerA or CornerB, of a point CornerA.
  TriangleFeature feature = TriangleFeature::Face;
  friend bool operator==(const VertexTriangleContact&, const VertexTriangleContact&) = default;
};

/// An edge against an edge.
struct EdgeEdgeContact {
  std::array<std::uint32_t, 2> edgeA, edgeB;  ///< vertex indices, lower first
  double weightA, weightB;                    ///< closest point = p0 + weight (p1 - p0)
  Eigen::Vector3d normal;                     ///< unit, from b towards a
  double distance, timeOfImpact;              ///< L, negative by radii only; as above
  /// What holds each closest point at that time: an end where the weight is 0 or 1.
  EdgeFeature featureA = EdgeFeature::Interior, featureB = EdgeFeature::Interior;
  friend bool operator==(const EdgeEdgeContact&, const EdgeEdgeContact&) = default;
};

enum class ShapeElement : std::uint32_t { Vertex, Edge, Face };

/// An element of a mesh against an analytical shape.
struct ShapeContact {
  ShapeElement element;
  std::uint32_t id;  ///< vertex or triangle; of an edge its lower vertex
  /// The element's: {v, v, v}, {p, q, q} with the lower first, or the triangle's corners.
  std::array<std::uint32_t, 3> vertices;
  Eigen::Vector3d weights;       ///< of the vertices; sum 1
  Eigen::Vector3d point;         ///< L, of the element: of lines and points on their centre line
  Eigen::Vector3d pointOnShape;  ///< L
  Eigen::Vector3d normal;        ///< unit, out of the shape, towards the element
  double distance;               ///< L, less the element's radius; negative: as deep inside
  double timeOfImpact = 1.0;     ///< [0, 1] of the step, and all else then; 1 for Proximity
  friend bool operator==(const ShapeContact&, const ShapeContact&) = default;
};

/// Two analytical shapes where they are nearest, or, if they overlap, where they leave each other
/// by the shortest way; with Method::Continuous at the time at which they first come near enough.
/// Where a cylinder overlaps another shape, distance and points fit within 2e-3 of the two sizes.
struct ShapeShapeContact {
  Eigen::Vector3d pointA, pointB;  ///< L, on the surfaces of the first and of the second
  Eigen::Vector3d normal;          ///< unit, from b towards a
  /// L: pointA - pointB is the normal times this; negative: moved so far along it a just touches b
  double distance;
  double timeOfImpact = 1.0;  ///< [0, 1] of the step, and all else then; 1 for Proximity
  friend bool operator==(const ShapeShapeContact&, const ShapeShapeContact&) = default;
};

/// Four vertices with signed weights: their weighted sum of positions is the vector between the two
/// closest points, and weight i times a force along the normal is the force on vertex i.
struct Stencil {
  std::array<std::uint32_t, 4> vertices;
  std::array<double, 4> weights;
};

/// vertices: the vertex (weight 1), then the triangle's corners (weights -barycentric).
inline Stencil stencil(const VertexTriangleContact& contact) {
  return {{contact.vertex, contact.corners[0], contact.corners[1], contact.corners[2]},
          {1.0, -contact.barycentric[0], -contact.barycentric[1], -contact.barycentric[2]}};
}

/// vertices: edge a's two ends (positive weights), then edge b's (negative weights).
PALPATE_EXPORT Stencil stencil(const EdgeEdgeContact& contact);

/// The contacts of one pair of geometries in the last frame, sorted by element ids.
///
/// Order    vertexTriangle by (vertex, triangle), triangleVertex by (triangle, vertex), edgeEdge by
///          (edgeA, edgeB), intersectingTriangles by (a, b).
/// Shapes   spans live until the next call that is not const on their OctreeBasedCD.
class PALPATE_EXPORT CollisionData {
 public:
  struct Contents {
    std::vector<VertexTriangleContact> vertexTriangle, triangleVertex;
    std::vector<EdgeEdgeContact> edgeEdge;
    std::vector<ElementPair> intersectingTriangles;
    std::vector<ShapeContact> shape;
    std::vector<ShapeShapeContact> shapeShape;
    double earliestTimeOfImpact =
        std::numeric_limits<double>::infinity();  ///< with PairSettings::earliestTimeOnly
    Validity validity;
  };

  CollisionData() = default;
  explicit CollisionData(Contents contents) : m_contents(std::move(contents)) {}

  /// Vertices of the first geometry, triangles of the second.
  std::span<const VertexTriangleContact> vertexTriangle() const {
    return m_contents.vertexTriangle;
  }
  /// Triangles of the first geometry, vertices of the second; empty for self-collision.
  std::span<const VertexTriangleContact> triangleVertex() const {
    return m_contents.triangleVertex;
  }
  std::span<const EdgeEdgeContact> edgeEdge() const { return m_contents.edgeEdge; }
  /// Filled by Method::Intersection. Each pair has a contact, but for two triangles of one mesh
  /// with a common vertex that meet only where an edge pierces the other.
  std::span<const ElementPair> intersectingTriangles() const {
    return m_contents.intersectingTriangles;
  }
  /// Elements with an analytical shape, which have no other contacts; by (element, id, vertices).
  std::span<const ShapeContact> shape() const { return m_contents.shape; }
  /// Of two analytical shapes: one, if they are at most the thickness apart.
  std::span<const ShapeShapeContact> shapeShape() const { return m_contents.shapeShape; }
  /// Infinity if there is no contact. Contacts of methods that look at the step's end have 1.
  double earliestTimeOfImpact() const;

  /// Whether to believe it.
  const Validity& validity() const { return m_contents.validity; }

  /// Same answer, same bits, same hash: over ids, weights, normals, distances, times and features,
  /// in order.
  std::uint64_t hash() const;

  /// For the engine that fills it.
  Contents& contents() { return m_contents; }

 private:
  Contents m_contents;
};

}  // namespace palpate
