#pragma once

#include <palpate/Export.h>
#include <palpate/FeaturePairs.h>
#include <palpate/Tracking.h>
#include <palpate/Types.h>
#include <palpate/Validity.h>

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

namespace palpate {

struct ConstraintRow;

// Contacts of every method satisfy one law. With the positions at timeOfImpact, the sum of the
// positions of stencil() times their weights is (distance + radii) * normal, with the radii at the
// closest points. Of a ShapeContact, point - pointOnShape is (distance + radius) * normal.
// Error    32 ulp of the largest coordinate difference of the vertices, and the rounding of
//          positions at that time. Continuous adds timeTolerance times the relative motion.
// Time     contacts by Proximity and Intersection, also in Auto, are at the step's end: time 1.
// Sign     a distance is negative where (1) radii overlap, (2) a shape overlaps, (3) by
//          Intersection a vertex is behind the triangle or edges have crossed, (4) Side applies,
//          (5) by rememberSides features have passed through each other in an earlier step.
// Depth    Intersection: a vertex is behind a surface if an edge leaves the surface towards it. It
//          has one contact of negative distance: with the nearest feature around the triangles
//          that its edges pierce, in the lowest triangle of that feature behind which it is. In
//          the interior its normal is the winding normal, else on that side along the line through
//          the closest points. Another local minimum of the distance has the contact if the
//          vertex and the places where these edges pierce leave there by a shorter distance: at the
//          end of a blunt tool.
// Touch    at distance 0, or for an impact without a thickness, the normal can separate the
//          surfaces, as far as such a normal exists: that of a triangle at either feature, else
//          the cross product of two edges there, else where features came from. The step,
//          otherwise a closed surface, tells its side.
// Side     by Proximity, that of the positions at the end; of an impact, where its features came
//          from. Steps of Auto that begin in intersection: Docs/HowTo/Validity.md.
// Bodies   Auto parts closed bodies deep in each other along one direction:
//          Docs/Algorithms/Validity.md.

/// A contact of a vertex with a triangle, a segment {p, q} as {p, q, q}, or a point p as {p, p, p}.
struct VertexTriangleContact {
  std::uint32_t vertex, triangle;         ///< indices; `triangle` may be a segment or a point
  std::array<std::uint32_t, 3> vertices;  ///< of the triangle, segment or point
  Eigen::Vector3d weights;                ///< of these vertices at the closest point
  Eigen::Vector3d normal;  ///< unit, to the vertex; from it where it is behind the surface
  double distance;      ///< L, at timeOfImpact, between the surfaces of the radii; sign: see above.
  double timeOfImpact;  ///< [0, 1] of the step; 1 for methods that test the step's end.
  /// The part that vertices with weights other than 0 span. Of a segment: EdgeAB or a corner.
  TriangleFeature feature = TriangleFeature::Face;
  friend bool operator==(const VertexTriangleContact&, const VertexTriangleContact&) = default;
};

struct EdgeEdgeContact {
  std::array<std::uint32_t, 2> edgeA, edgeB;  ///< vertex indices, lower first
  double weightA, weightB;                    ///< closest point = p0 + weight (p1 - p0)
  Eigen::Vector3d normal;  ///< unit, from edge b to edge a; reversed where they crossed
  double distance;         ///< L, at timeOfImpact; negative where radii overlap or edges crossed.
  double timeOfImpact;     ///< [0, 1] of the step; 1 for methods that test the step's end
  /// The parts that hold the closest points: an end if the weight is 0 or 1.
  EdgeFeature featureA = EdgeFeature::Interior, featureB = EdgeFeature::Interior;
  friend bool operator==(const EdgeEdgeContact&, const EdgeEdgeContact&) = default;
};

enum class ShapeElement : std::uint32_t { Vertex, Edge, Face };
PALPATE_EXPORT const char* toString(ShapeElement) noexcept;  ///< its name, or "unknown"

/// An element with an analytical shape, or with a body by DistanceField or Proxy, at timeOfImpact.
/// Field    distance: the field's value at `point` less the radius; normal: along its gradient, or
///          the field's last axis where that is 0. pointOnShape follows from both.
/// Proxy    the surface is a plane or triangle within CollisionData::errorBound(); particles of
///          Auto that may touch within the step have the exact method's contacts.
struct ShapeContact {
  ShapeElement element;
  std::uint32_t id;  ///< Index of the vertex or triangle; for an edge its lower vertex.
  /// {v, v, v} of a vertex, {p, q, q} with p < q of an edge, or the triangle's corners.
  std::array<std::uint32_t, 3> vertices;
  Eigen::Vector3d weights;       ///< Weights of the vertices at `point`; sum 1.
  Eigen::Vector3d point;         ///< L: on the element; for lines and points on the centre line.
  Eigen::Vector3d pointOnShape;  ///< L: on the shape's surface.
  Eigen::Vector3d normal;        ///< Unit, out of the shape towards the element.
  double distance;               ///< L: less the element's radius; negative: the depth inside.
  double timeOfImpact = 1.0;     ///< [0, 1]; 1 at the step's end
  friend bool operator==(const ShapeContact&, const ShapeContact&) = default;
};

/// At timeOfImpact the points are closest; overlapping, the normal is the direction of the shortest
/// translation that separates.
/// Error    pointA - pointB equals distance * normal, to 2e-3 of the sizes if a cylinder overlaps.
struct ShapeShapeContact {
  Eigen::Vector3d pointA, pointB;  ///< L, on the surfaces of the first and of the second shape
  Eigen::Vector3d normal;          ///< unit, from shape b to shape a
  double distance;            ///< L; negative: a moved by -distance along the normal just touches b
  double timeOfImpact = 1.0;  ///< [0, 1] of the step; 1 for Proximity
  friend bool operator==(const ShapeShapeContact&, const ShapeShapeContact&) = default;
};

/// Of the first and of the second geometry.
using ContactTags = std::array<std::uint32_t, 2>;

/// The weighted sum of the positions is the vector between the closest points.
struct Stencil {
  std::array<std::uint32_t, 4> vertices;
  std::array<double, 4> weights;
};

/// The vertex with weight 1, then the triangle's with the negative weights.
inline Stencil stencil(const VertexTriangleContact& contact) {
  return {{contact.vertex, contact.vertices[0], contact.vertices[1], contact.vertices[2]},
          {1.0, -contact.weights[0], -contact.weights[1], -contact.weights[2]}};
}

/// The ends of edge a with weights of at least 0, then those of b with weights of at most 0.
PALPATE_EXPORT Stencil stencil(const EdgeEdgeContact& contact);

/// The contacts of one pair of geometries in the last frame. No function throws palpate::Error.
/// Order    vertexTriangle by (vertex, triangle), triangleVertex by (triangle, vertex), edgeEdge by
///          (edgeA, edgeB), intersectingTriangles by (a, b), shape by (element, id, vertices).
/// Valid    as all results of OctreeBasedCD, with the spans. A copy stays as it is.
class PALPATE_EXPORT CollisionData {
 public:
  /// Of an answer by another engine, in the order above.
  struct Parts {
    std::span<const VertexTriangleContact> vertexTriangle{}, triangleVertex{};
    std::span<const EdgeEdgeContact> edgeEdge{};
    std::span<const ElementPair> intersectingTriangles{};
    std::span<const ShapeContact> shape{};
    std::span<const ShapeShapeContact> shapeShape{};
    /// Of a contact in no list, by ContinuousSettings::earliestTimeOnly.
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
  /// Elements of the first geometry with vertices of the second; empty for self-collision.
  std::span<const VertexTriangleContact> triangleVertex() const;
  std::span<const EdgeEdgeContact> edgeEdge() const;  ///< of both geometries
  /// Those that intersect at the step's end, from Intersection, also in Auto. Each has a contact of
  /// its own or of a vertex behind the surface, but for predicates and neighbours of one mesh.
  std::span<const ElementPair> intersectingTriangles() const;
  /// Elements with a shape, or with a body by DistanceField or Proxy; other lists are then empty.
  std::span<const ShapeContact> shape() const;
  /// One contact if two shapes are at most the thickness apart, by Continuous at any time.
  std::span<const ShapeShapeContact> shapeShape() const;
  /// The least timeOfImpact, also with earliestTimeOnly, or infinity. Linear in the contacts.
  double earliestTimeOfImpact() const;

  /// L: by how much distances may be off; 0 for methods exact up to rounding.
  /// Field    that of the field, for each contact's point in the band. The least distance of an
  ///          edge or triangle may be lower by half of it, or missing if as near as that to the
  ///          thickness.
  /// Proxy    what is proven of the planes that answered, and rounding. A particle is missing, or
  ///          in excess, only within this of the limit.
  double errorBound() const;

  const Validity& validity() const;

  /// With PairSettings::trackContacts one for each contact, in the same order; else empty.
  std::span<const TrackedContact> trackedVertexTriangle() const;
  std::span<const TrackedContact> trackedTriangleVertex() const;
  std::span<const TrackedContact> trackedEdgeEdge() const;
  std::span<const TrackedContact> trackedShape() const;
  std::span<const TrackedContact> trackedShapeShape() const;
  /// Contacts at the last advance() that are neither here now nor the predecessor of one that is.
  /// Order    by key.
  std::span<const TrackedContact> ended() const;

  /// With PairSettings::reportCrossings every passage within the step; else empty.
  /// Order    by kind, ids, time.
  std::span<const Crossing> crossings() const;

  /// OctreeBasedCD::setTags(): the tags of the first and of the second geometry's feature. Vertices
  /// and edges have that of the lowest enabled element that holds them. One for each contact of a
  /// list, in the same order; empty if neither geometry has tags.
  std::span<const ContactTags> tags(ContactKind) const;
  /// The same of one contact of these lists, 0 for what has none. Copies are searched.
  ContactTags tagsOf(const VertexTriangleContact&) const;
  ContactTags tagsOf(const EdgeEdgeContact&) const;
  ContactTags tagsOf(const ShapeContact&) const;
  ContactTags tagsOf(const ShapeShapeContact&) const;

  /// With PairSettings::smoothNormals one unit normal for each contact, in the same order; else
  /// empty. It is interpolated between the angle-weighted normals of the mesh's vertices, with the
  /// contact's weights and at its time, and is on the side of the contact's normal. For two edges
  /// both meshes count, for a vertex only that of the triangle. It is the contact's normal where
  /// both are over 60 degrees apart, without a triangle, and of an impact whose features come
  /// nearer along the smooth normal alone: they slide, and no row holds them back.
  std::span<const Eigen::Vector3d> smoothVertexTriangle() const;
  std::span<const Eigen::Vector3d> smoothTriangleVertex() const;
  std::span<const Eigen::Vector3d> smoothEdgeEdge() const;
  std::span<const Eigen::Vector3d> smoothShape() const;

  /// With PairSettings::rememberSides the passages from which features had not returned when this
  /// step began. Each names the features that were nearest then; its time is 0.
  /// Order    by kind, ids.
  std::span<const Crossing> rememberedSides() const;

  /// Appends the rows of palpate::appendRows() (<palpate/ConstraintRows.h>) with the positions and
  /// poses of the detected step, which Palpate has. Call it before the step changes: before
  /// advance(), and before `before` or a topology is set. A copy made until then keeps its rows.
  /// firstOfA, firstOfB: the solver's numbers of vertex 0 of both geometries; of a shape any.
  /// Errors   InvalidCall if the step is over, and NotAvailable for contacts of Parts. No row is
  ///          added then.
  void appendRows(std::vector<ConstraintRow>& rows, std::uint32_t firstOfA = 0,
                  std::uint32_t firstOfB = 0) const;

  /// Of all contacts in their order, without validity(), tracking, tags and smooth normals: the
  /// same bits on every machine.
  std::uint64_t hash() const;

  struct Contents;  ///< not part of the interface

 private:
  const Contents& read() const;

  std::unique_ptr<Contents> m_contents;  ///< null: no contacts
};

}  // namespace palpate
