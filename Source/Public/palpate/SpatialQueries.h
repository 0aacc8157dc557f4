#pragma once

#include <palpate/AnalyticalGeometry.h>
#include <palpate/CollisionData.h>
#include <palpate/Export.h>
#include <palpate/Meshes.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace palpate {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A point of a geometry's surface.
struct SurfacePoint {
  GeometryId geometry;
  std::uint32_t element = kNoElement;     ///< triangle, segment or point; kNoElement for a shape
  std::array<std::uint32_t, 3> vertices;  ///< {p, q, q} of a segment, {p, p, p} of a point
  Eigen::Vector3d weights;                ///< of the vertices; at least 0, sum 1
  /// L: on the triangle, the centre line or the point. If radii differ between a segment's ends, it
  /// is the centre of the nearest ball.
  Eigen::Vector3d position;
  /// L, less the radius of lines and points: negative inside the radius.
  double distance;
  /// Unit, out of the surface, also at distance 0. Of a triangle mesh the winding normal of the
  /// face that holds the point, or the sum of the normals around its edge or vertex, weighted by
  /// the angles there. Of lines and points it leads away from the centre line or point. 0 where
  /// there is no surface point.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
};

/// The distance of a point from the surface of a body, negative inside.
struct SignedDistance {
  SurfacePoint nearest;  ///< nearest.distance is not negative
  double distance;       ///< L
};

/// The points origin + t direction with a finite t in [tMin, tMax], both included. What the ray
/// meets only beyond the largest double is no hit.
struct Ray {
  Eigen::Vector3d origin, direction;  ///< L; the direction has any length but 0
  double tMin = 0.0, tMax = kInfinity;
};

/// One connected part of what a ray and a surface share: its smallest t, on the lowest element
/// there. A ray along an edge, or in the plane of triangles, has one hit there. Lines and points
/// with radii, and analytical shapes, have a hit where the ray enters them and one where it leaves
/// them; overlapping elements are one body. A ray that starts on their surface and goes outward
/// leaves them there. A ray that only touches them has one hit that does not cross. A ray that lies
/// in a face of a box or a hull enters and leaves it, while a mesh of the same faces has one hit.
struct RayHit {
  GeometryId geometry;
  std::uint32_t element = kNoElement;
  std::array<std::uint32_t, 3> vertices;  ///< as in SurfacePoint
  /// As in SurfacePoint, also where vertices have the same position; 0 for a shape.
  Eigen::Vector3d weights;
  double t;        ///< finite, unless firstHits() finds no hit
  bool frontFace;  ///< whether the ray comes against the winding normal
  /// Whether the ray changes from one side of the surface to the other. From inside a closed mesh
  /// the number of such hits is odd, if the winding number there is odd. A hit at tMin or tMax
  /// crosses if the endless ray does. If tMin or tMax cuts a part in which the ray lies in the
  /// surface, only the elements within the range count.
  bool crosses;
};

/// What a ray selects: its first hit, and the vertex and the edge of the element that are nearest
/// to the hit. Both are kNoElement for a shape. A point has the edge {p, p}.
struct Pick {
  RayHit hit;
  std::uint32_t vertex;
  std::array<std::uint32_t, 2> edge;  ///< lower vertex first
};

/// A small rigid mesh, such as a tool, that SpatialQueries::contacts() places. It keeps the mesh's
/// octree and the memory of the query.
/// Threads  one at a time. Threads that share a tool need a RigidMesh each.
class PALPATE_EXPORT RigidMesh {
 public:
  /// positions: L, in the mesh's own frame.
  /// Errors   those of OctreeBasedCD::addTriangleMesh(). They name the mesh as geometry 0.
  RigidMesh(std::span<const Eigen::Vector3d> positions, std::span<const Triangle> triangles);
  RigidMesh(RigidMesh&&) noexcept;
  RigidMesh& operator=(RigidMesh&&) noexcept;
  ~RigidMesh();

 private:
  friend class SpatialQueries;
  struct Implementation;
  std::unique_ptr<Implementation> m_implementation;
};

/// The least distance of two geometries, with their closest points. It is 0 if they have a common
/// point. Both positions then are such a point, up to rounding; those of lines and points with
/// radii are on their centre lines.
struct GeometryDistance {
  SurfacePoint a, b;  ///< both have this distance
  double distance;    ///< L, less the radii of lines and points; never negative
};

/// How two bodies are separated by a translation of one of them.
struct Penetration {
  bool intersecting;  ///< the bodies' insides have a common point, decided exactly for meshes
  Eigen::Vector3d direction;  ///< unit; 0 if not intersecting
  double depth;  ///< L: moving a by depth * direction separates the bodies; 0 if not intersecting
  /// The points that meet last: a.position + depth * direction is at b.position. Their distance is
  /// the depth. Both have element kNoElement if the bodies do not intersect.
  SurfacePoint a, b;
  bool minimal;  ///< no shorter translation separates the bodies, within the stated error
};

/// A part of a path that is in a body. Its ends are arc lengths, in L.
struct PathInterval {
  GeometryId body;
  double enter, leave;
  /// Where the path enters and leaves. kNoElement for a shape, where the path starts or ends
  /// inside, and of a tetrahedral mesh where the path meets no surface.
  std::uint32_t entryElement, exitElement;
};

/// The least distance of a path to a body that it does not enter.
struct PathClearance {
  GeometryId body;
  double distance;       ///< L, that of distance() less the path's radius; 0: it touches
  double at;             ///< arc length, in L
  SurfacePoint nearest;  ///< has this distance; kNoElement for a shape, or if there is no surface
};

/// Spatial queries over the geometries of one OctreeBasedCD, at their positions now. A segment
/// whose radii differ between its ends is the hull of the balls there, in every query. Get the
/// object from OctreeBasedCD::queries(). Collision filters do not apply. Queries search disabled
/// elements, too. Docs/HowTo/Queries.md has examples.
/// Valid    until positions, transforms, topology or geometries change, or advance() is called. A
///          detection leaves it valid. Copies are cheap and valid as long.
/// Threads  all functions are safe from any number of threads.
/// Returns  lists go to the caller's vectors and replace their content. If a function throws, the
///          vector is unchanged.
/// Errors   every function throws InvalidCall if the object is no longer valid or was moved from,
///          or if a predicate or callback calls it while the OctreeBasedCD computes;
///          UnknownGeometry; NonFinitePosition also for what is beyond kLargestMeasure.
class PALPATE_EXPORT SpatialQueries {
 public:
  /// Finds the point of a geometry's surface that is nearest to a point, decided exactly. Of
  /// several equally near elements it is on the lowest. Returns nothing if no surface point is
  /// within maxDistance.
  /// Units    point, maxDistance: L; both are in the world.
  /// Errors   NonFinitePosition; InvalidSettings if maxDistance is negative or NaN.
  /// Cost     about logarithmic in the elements. Allocates nothing but the integers that compare
  ///          almost equal distances.
  std::optional<SurfacePoint> closestPoint(GeometryId, const Eigen::Vector3d& point,
                                           double maxDistance = kInfinity) const;
  /// The same for many points, on all threads. Points without an answer have an infinite distance
  /// and element kNoElement. As every answer for a shape has that element, only the distance tells.
  /// Errors   InvalidSettings, too, if `out` has another size than `points`. Messages name the
  ///          point, such as "point 3".
  void closestPoints(GeometryId, std::span<const Eigen::Vector3d> points,
                     std::span<SurfacePoint> out, double maxDistance = kInfinity) const;
  /// Finds the k elements that are nearest to a point, or all if there are fewer, with their
  /// closest points.
  /// Order    by distance, then by element, decided exactly.
  /// Errors   those of closestPoint(); InvalidSettings if k is below 1.
  void nearestElements(GeometryId, const Eigen::Vector3d& point, int k,
                       std::vector<SurfacePoint>& out, double maxDistance = kInfinity) const;
  /// Whether a point is inside a body, by the rule in InsideSettings. With
  /// InsideRule::WindingNumber a number that the margin or rounding leaves open counts as inside.
  /// With InsideRule::Closed, points on the surface of a triangle mesh are not inside; points on
  /// the boundary of a tetrahedron are.
  /// Errors   those of findInsideVertices(); NonFinitePosition.
  /// Cost     the first call prepares the body, and each copy of it in a Snapshot: a triangle mesh
  ///          once for each topology, by InsideRule::Closed; otherwise after each change.
  bool contains(GeometryId body, const Eigen::Vector3d& point, const InsideSettings& = {}) const;
  /// The distance from a body's surface, negative where contains() holds.
  /// Errors   those of contains(); NotClosed for a body without elements.
  SignedDistance signedDistance(GeometryId body, const Eigen::Vector3d& point,
                                const InsideSettings& = {}) const;
  /// The same for many points, on all threads.
  /// Errors   InvalidSettings, too, if `out` has another size than `points`. Messages name the
  ///          point, such as "point 3".
  void signedDistances(GeometryId body, std::span<const Eigen::Vector3d> points,
                       std::span<SignedDistance> out, const InsideSettings& = {}) const;
  /// Finds the elements with a point within a radius, decided exactly.
  /// Order    ascending.
  /// Errors   NonFinitePosition; InvalidSettings if the radius is not in [0, kLargestMeasure].
  void elementsWithin(GeometryId, const Eigen::Vector3d& point, double radius,
                      std::vector<std::uint32_t>& elements) const;

  /// Finds the first hit of a ray on a geometry. Rays are watertight: no ray passes between
  /// triangles that share an edge or vertex.
  /// Errors   NonFinitePosition for an origin or direction; InvalidSettings for a direction of
  ///          length 0, or if tMin is not finite or not at most tMax.
  /// Cost     about logarithmic in the elements.
  std::optional<RayHit> firstHit(GeometryId, const Ray&) const;
  /// The first hit of all geometries. Of equally early hits, that on the lowest geometry.
  std::optional<RayHit> firstHit(const Ray&) const;
  bool anyHit(GeometryId, const Ray&) const;  ///< whether there is a hit
  /// First hits of many rays, on all threads. Rays without a hit have an infinite t and element
  /// kNoElement. As every hit on a shape has that element, only t tells.
  /// Errors   InvalidSettings, too, if `out` has another size than `rays`. Messages name the ray,
  ///          such as "ray 3".
  void firstHits(GeometryId, std::span<const Ray> rays, std::span<RayHit> out) const;
  /// All hits.
  /// Order    by ascending t.
  void allHits(GeometryId, const Ray&, std::vector<RayHit>& out) const;
  /// What a ray selects among all geometries. frontFacesOnly: other hits do not count, and so it
  /// selects no line or point without a radius.
  std::optional<Pick> pick(const Ray&, bool frontFacesOnly = false) const;

  /// Finds the elements that have a point in a shape, interior included. The poses are those of
  /// OctreeBasedCD::setTransform(). A frustum is a ConvexHull.
  /// Order    ascending.
  /// Accuracy decided exactly for spheres, and for boxes and hulls if elements have no radius: on
  ///          the shape's corners, rounded when it is placed. Otherwise up to rounding errors of
  ///          the distance.
  /// Errors   InvalidShape, InvalidTransform; UnsupportedMethod if the geometry is a shape itself.
  void overlapping(GeometryId, const AnalyticalGeometry& shape, const Pose&,
                   std::vector<std::uint32_t>& elements) const;
  /// Finds the contacts that a pair of the geometry and the shape would have with Method::Proximity
  /// and Contacts::Distinct, with the shape at this pose. All have the time 1.
  /// Order    that of CollisionData::shape().
  /// Errors   those of overlapping(); InvalidSettings for a thickness outside [0, kLargestMeasure].
  /// Cost     follows the elements near the shape. A repeated call allocates nothing, unless a box or
  ///          a hull differs from the last one.
  void contacts(GeometryId, const AnalyticalGeometry& shape, const Pose&, double thickness,
                std::vector<ShapeContact>& out) const;
  /// Finds the contacts that a pair (a, b) of the geometry and the mesh would have with
  /// Method::Proximity and Contacts::Distinct, with the mesh at this pose. A thickness of 0 finds
  /// features that touch; an edge that only passes through a triangle's inside has no contact.
  /// Disabled elements have no contacts. Of the collision filter only Sidedness applies. validity()
  /// has the method, the thickness and the number of contacts only.
  /// Lists    vertexTriangle() has vertices of the geometry with triangles of the mesh.
  ///          triangleVertex() has elements of the geometry with vertices of the mesh. The normals
  ///          of edgeEdge() point from the mesh to the geometry.
  /// Order    that of CollisionData.
  /// Errors   InvalidTransform; UnsupportedMethod if the geometry is a shape; InvalidSettings if the
  ///          thickness is not in [0, kLargestMeasure]; InvalidCall if the mesh was moved from.
  /// Cost     follows the elements near the mesh. The first call for a geometry of another size may
  ///          build the mesh's octree again. A repeated call allocates nothing.
  void contacts(GeometryId, RigidMesh& mesh, const Pose&, double thickness,
                CollisionData& out) const;

  /// The least distance of two geometries. Meshes count as surfaces: a mesh inside another one has
  /// the distance of their surfaces. Lines and points with radii, and shapes, are solid. Of equally
  /// near pairs of elements, by computed distance, the one with the lowest element of a counts,
  /// then with that of b. If a mesh has no elements, the distance is infinite and the element is
  /// kNoElement.
  ///
  /// Accuracy whether triangles, lines and points without radii have a common point is decided
  ///          exactly. Distances have the accuracy of edgeEdgeDistance().
  /// Errors   InvalidSettings if both geometries are the same; UnsupportedMethod for two planes.
  /// Cost     follows the pairs of elements that are almost as near as the nearest pair: about 2 us
  ///          for each. Elements that coincide count once.
  GeometryDistance distance(GeometryId a, GeometryId b) const;
  /// Finds a translation of a that separates two bodies: it leaves no common point of their
  /// insides. Bodies are closed triangle meshes, tetrahedral meshes and shapes. A mesh's inside is
  /// where the winding number of its surface is not 0; a tetrahedral mesh counts as its surface
  /// does. Bodies that only touch, or are apart, do not intersect. A body wholly inside another
  /// does.
  ///
  /// Meshes are tested after the translation: their surfaces then have no common point, and neither
  /// is inside the other. These tests are exact for what you get by the translation: positions +
  /// depth * direction, or of a body that setTransform() placed, its translation + depth *
  /// direction. The depth is therefore larger than where the surfaces last touch, by about 2^-40 of
  /// the largest coordinate.
  ///
  /// minimal  is true for two convex meshes or shapes, and for a plane. No translation is then
  ///          shorter by more than 2^-36 of the largest coordinate. Meshes are convex up to 2^-40
  ///          of it. The depth of other bodies is an upper bound. The search is local from some
  ///          hundred directions, so that the bound is near the least depth as a rule.
  /// Accuracy of a sphere, capsule or cylinder and a mesh: the distance of the shape decides after
  ///          the translation, not an exact test. intersecting is then false for depths below 2^-36
  ///          of the largest coordinate.
  /// Errors   NotClosed for what has no inside: the message names the first edge of a mesh, as in
  ///          findInsideVertices(); lines, points and two-sided planes; InvalidSettings if both
  ///          geometries are the same; UnsupportedMethod for two planes.
  /// Cost     some hundred rays and some ten searches of the intersecting triangles of both. Two
  ///          organs of 3,000 triangles each take some milliseconds.
  Penetration penetration(GeometryId a, GeometryId b) const;
  /// Follows a ball along a polyline, as a needle or a drill moves, and finds where it is in each
  /// body. With radius 0 it is a point.
  ///
  /// A ball is in a body from where it first touches the surface until it touches it no more and is
  /// outside by contains(). A point that only touches the surface of a body with an inside is not
  /// in it. Bodies are closed triangle meshes, tetrahedral meshes and shapes. Other meshes have no
  /// inside: the ball is in them while it touches them.
  /// inside   by ascending `enter`, then in the order of `bodies`.
  /// outside  for each body without an interval, in the order of `bodies`.
  /// Accuracy with radius 0, which triangles the path meets is decided exactly. Other arc lengths
  ///          are within 2^-40 of the largest coordinate, divided by the sine of the angle between
  ///          path and surface.
  /// Errors   NonFinitePosition; InvalidSettings for fewer than two points, for a radius that is
  ///          not in [0, kLargestMeasure], or if the path's length is not finite.
  /// Cost     for each body and segment of the path, that of a ray. A body without an interval also
  ///          costs about as much as distance() to a line mesh, for each segment.
  void path(std::span<const Eigen::Vector3d> polyline, double radius,
            std::span<const GeometryId> bodies, std::vector<PathInterval>& inside,
            std::vector<PathClearance>& outside) const;

  /// Finds the vertices of one geometry that are inside another, the body. It finds them at any
  /// depth, also in concave bodies, and where no triangles intersect.
  ///
  /// A vertex is inside by the rule in InsideSettings, and does not lie on the surface. With
  /// InsideRule::Closed a vertex is inside a triangle mesh if the mesh's winding number about it is
  /// not 0. It is inside a tetrahedral mesh if it is in a tetrahedron. Both are decided exactly.
  /// InsideRule::WindingNumber also takes bodies with holes, and any set of triangles.
  ///
  /// Each vertex comes with its surface point: the nearest point of the surface, of several equally
  /// near ones that on the lowest triangle. Where parts of a closed body overlap, it is the nearest
  /// point of the outer surface, beside which the winding number is 0. If more than two parts meet
  /// in one point, a nearer one may be missed. Depth and surface point have the accuracy of
  /// vertexTriangleDistance(). Where two triangles intersect they are computed in double, and are
  /// less accurate if the triangles are almost parallel.
  /// Order    by vertex, ascending.
  /// Errors   NotClosed if the body has no inside: it is not a mesh, or with InsideRule::Closed it
  ///          is a triangle mesh with defects (the message names the first edge); InvalidSettings
  ///          if both geometries are the same, or if a setting is out of range; UnsupportedMethod
  ///          if `vertices` is a shape.
  void findInsideVertices(GeometryId vertices, GeometryId body, std::vector<InsideVertex>& out,
                          const InsideSettings& = {}) const;
  /// Finds the vertices of one geometry that are in a tetrahedron of another, or on its boundary,
  /// decided exactly. A vertex that several tetrahedra contain is in the lowest of them. Inverted
  /// tetrahedra contain points as others do; tetrahedra without volume contain none.
  /// Order    by vertex, ascending, each vertex once.
  /// Errors   UnsupportedMethod if the body is no tetrahedral mesh or if `vertices` is a shape;
  ///          InvalidSettings if both geometries are the same.
  void findEmbeddedVertices(GeometryId vertices, GeometryId body,
                            std::vector<EmbeddedVertex>& out) const;
  /// The same for one point, in L in the world. Returns nothing if no tetrahedron contains it.
  /// Errors   UnsupportedMethod if the body is no tetrahedral mesh; NonFinitePosition.
  std::optional<TetrahedronPoint> findTetrahedron(GeometryId body,
                                                  const Eigen::Vector3d& point) const;

  class Source;  ///< not part of the interface

 private:
  explicit SpatialQueries(std::shared_ptr<Source>);
  Source& valid() const;  ///< throws InvalidCall

  std::shared_ptr<Source> m_source;
  std::uint64_t m_state;  ///< Source::state() when this object was made
};

}  // namespace palpate
