#pragma once

#include <palpate/AnalyticalGeometry.h>
#include <palpate/CollisionData.h>
#include <palpate/Export.h>
#include <palpate/Meshes.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace palpate {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct SurfacePoint {
  GeometryId geometry;
  std::uint32_t element = kNoElement;     ///< triangle, segment or point; kNoElement for a shape
  std::array<std::uint32_t, 3> vertices;  ///< {p, q, q} of a segment, {p, p, p} of a point
  Eigen::Vector3d weights;                ///< of the vertices; at least 0, sum 1
  /// L: on the triangle, centre line or point; if radii differ, the nearest ball's centre.
  Eigen::Vector3d position;
  double distance;  ///< L, less the radius of lines and points
  /// Unit, outward, also at distance 0: of the face, or angle-weighted around its edge or vertex;
  /// away from the centre line or point. 0 without a surface point.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
};

struct SignedDistance {
  SurfacePoint nearest;  ///< nearest.distance is not negative
  double distance;       ///< L
};

/// The points origin + t direction with a finite t in [tMin, tMax], both included.
struct Ray {
  Eigen::Vector3d origin, direction;  ///< L; the direction has any length but 0
  double tMin = 0.0, tMax = kInfinity;
};

/// A connected part of what a ray and a surface share: its smallest t, on the lowest element there.
/// Radii, as one body, and shapes have a hit where the ray enters and one where it leaves.
struct RayHit {
  GeometryId geometry;
  std::uint32_t element = kNoElement;
  std::array<std::uint32_t, 3> vertices;  ///< as in SurfacePoint
  Eigen::Vector3d weights;                ///< as in SurfacePoint; 0 for a shape
  double t;                               ///< finite, unless firstHits() finds no hit
  bool frontFace;                         ///< whether the ray comes against the winding normal
  /// Whether the ray changes sides; at tMin and tMax the endless ray decides. Of a part in the
  /// surface only elements within the range count.
  bool crosses;
};

/// The first hit with its element's nearest vertex and edge; kNoElement for a shape.
struct Pick {
  RayHit hit;
  std::uint32_t vertex;
  std::array<std::uint32_t, 2> edge;  ///< lower vertex first
};

/// A small rigid mesh with its octree, for SpatialQueries::contacts(). One thread at a time.
class PALPATE_EXPORT RigidMesh {
 public:
  /// positions: L, in its own frame. Throws as OctreeBasedCD::addTriangleMesh(), for geometry 0.
  RigidMesh(std::span<const Eigen::Vector3d> positions, std::span<const Triangle> triangles);
  RigidMesh(RigidMesh&&) noexcept;
  RigidMesh& operator=(RigidMesh&&) noexcept;
  ~RigidMesh();

 private:
  friend class SpatialQueries;
  struct Implementation;
  std::unique_ptr<Implementation> m_implementation;
};

/// The least distance of two geometries. At a common point it is 0, and both positions are such a
/// point up to rounding, or on the centre lines of radii.
struct GeometryDistance {
  SurfacePoint a, b;  ///< both have this distance
  double distance;    ///< L, less the radii of lines and points; never negative
};

struct Penetration {
  bool intersecting;  ///< the bodies' insides have a common point, decided exactly for meshes
  Eigen::Vector3d direction;  ///< unit; 0 if not intersecting
  double depth;  ///< L: moving a by depth * direction separates the bodies; 0 if not intersecting
  /// Points that meet last: a.position + depth * direction is at b.position. If the bodies do not
  /// intersect, both have kNoElement.
  SurfacePoint a, b;
  bool minimal;  ///< no shorter translation separates the bodies, within the stated error
};

/// A part of a path that is in a body, by arc lengths in L.
struct PathInterval {
  GeometryId body;
  double enter, leave;
  /// kNoElement for a shape, at a path's end inside, and in a tetrahedral mesh off its surface.
  std::uint32_t entryElement, exitElement;
};

/// The least distance of a path to a body that it does not enter.
struct PathClearance {
  GeometryId body;
  double distance;       ///< L, that of distance() less the path's radius; 0: it touches
  double at;             ///< arc length, in L
  SurfacePoint nearest;  ///< has this distance; kNoElement for a shape, or if there is no surface
};

/// Spatial queries at the positions now, from OctreeBasedCD::queries(). Collision filters do not
/// apply, and disabled elements are searched. A segment is the hull of the balls at its ends.
/// Valid    until positions, transforms, topology or geometries change, or advance(); so are
///          copies.
/// Threads  all functions are safe from any number of threads; batches use all.
/// Returns  lists replace the content of the caller's vector, which stays if a function throws.
/// Errors   InvalidCall if not valid or moved from, or from a predicate or callback;
///          UnknownGeometry; NonFinitePosition, also beyond kLargestMeasure; InvalidSettings for
///          two equal geometries, `out` of another size, a radius or thickness outside [0,
///          kLargestMeasure], and a negative maxDistance. Batches name the item at fault: "point
///          3".
/// Cost     of a point or ray about logarithmic in the elements. Only exact comparisons allocate.
class PALPATE_EXPORT SpatialQueries {
 public:
  /// The nearest surface point within maxDistance (L), on the lowest of equal elements. Exact.
  std::optional<SurfacePoint> closestPoint(GeometryId, const Eigen::Vector3d& point,
                                           double maxDistance = kInfinity) const;
  /// closestPoint() of many points; without an answer the distance is infinite, with kNoElement.
  void closestPoints(GeometryId, std::span<const Eigen::Vector3d> points,
                     std::span<SurfacePoint> out, double maxDistance = kInfinity) const;
  /// The k nearest elements, or all if there are fewer. InvalidSettings for k < 1.
  /// Order    by distance, then by element, decided exactly.
  void nearestElements(GeometryId, const Eigen::Vector3d& point, int k,
                       std::vector<SurfacePoint>& out, double maxDistance = kInfinity) const;
  /// Whether a point is inside, or its winding number undecided. With Closed the surface of a
  /// triangle mesh is outside, the boundary of a tetrahedron inside. Throws as
  /// findInsideVertices().
  /// Cost     the first call after a change prepares the body, also in a Snapshot; of a closed
  ///          triangle mesh only after a change of topology.
  bool contains(GeometryId body, const Eigen::Vector3d& point, const InsideSettings& = {}) const;
  /// The distance from the surface, negative where contains() holds. NotClosed without elements.
  SignedDistance signedDistance(GeometryId body, const Eigen::Vector3d& point,
                                const InsideSettings& = {}) const;
  void signedDistances(GeometryId body, std::span<const Eigen::Vector3d> points,
                       std::span<SignedDistance> out, const InsideSettings& = {}) const;
  /// The elements with a point within the radius (L), ascending, decided exactly.
  void elementsWithin(GeometryId, const Eigen::Vector3d& point, double radius,
                      std::vector<std::uint32_t>& elements) const;

  /// The first hit. Rays are watertight: none passes between triangles with a common vertex.
  /// Errors   InvalidSettings for a direction of length 0, a tMin not finite, or above tMax.
  std::optional<RayHit> firstHit(GeometryId, const Ray&) const;
  std::optional<RayHit> firstHit(const Ray&) const;  ///< of all; lowest if equal
  bool anyHit(GeometryId, const Ray&) const;         ///< whether there is a hit
  /// firstHit() of many rays; without a hit t is infinite and the element kNoElement.
  void firstHits(GeometryId, std::span<const Ray> rays, std::span<RayHit> out) const;
  void allHits(GeometryId, const Ray&, std::vector<RayHit>& out) const;  ///< by ascending t
  /// allHits() of many rays, one after the other. Those of ray i are from begins[i] to before
  /// begins[i + 1].
  void allHits(GeometryId, std::span<const Ray> rays, std::vector<RayHit>& out,
               std::vector<std::size_t>& begins) const;
  /// Among all geometries. frontFacesOnly excludes other hits, also lines and points of radius 0.
  std::optional<Pick> pick(const Ray&, bool frontFacesOnly = false) const;

  /// The elements with a point in the solid shape, ascending.
  /// Accuracy exact for spheres, and for boxes and hulls with elements without radius, on the
  ///          placed and rounded corners. Otherwise up to the rounding of distances.
  /// Errors   InvalidShape, InvalidTransform; UnsupportedMethod if the geometry is a shape.
  void overlapping(GeometryId, const AnalyticalGeometry& shape, const Pose&,
                   std::vector<std::uint32_t>& elements) const;
  /// The contacts that a pair of both would have by Method::Proximity and Contacts::Distinct, in
  /// the order of CollisionData::shape(). Throws as overlapping().
  /// Cost     follows the elements near the shape. Only another box or hull allocates again.
  void contacts(GeometryId, const AnalyticalGeometry& shape, const Pose&, double thickness,
                std::vector<ShapeContact>& out) const;
  /// The same of a pair (geometry, mesh), without disabled elements. Of filters only Sidedness
  /// applies. With thickness 0, features that touch have contacts; an edge that only pierces a
  /// triangle has none. validity() has only method, thickness and numbers of contacts.
  /// Errors   InvalidSettings; InvalidTransform; InvalidCall if the mesh was moved from.
  /// Cost     follows the elements near the mesh. Another size of geometry may rebuild the mesh's
  ///          octree; a repeated call allocates nothing.
  void contacts(GeometryId, RigidMesh& mesh, const Pose&, double thickness,
                CollisionData& out) const;

  /// The least distance, between surfaces of meshes; lines and points with radii, and shapes, are
  /// solid. Of equally near pairs the lowest element of a counts, then that of b. Without elements
  /// it is infinite and the element kNoElement. UnsupportedMethod for two planes.
  /// Accuracy common points of elements without radii are exact, distances as edgeEdgeDistance().
  /// Cost     about 2 us for each pair of elements almost as near as the nearest.
  GeometryDistance distance(GeometryId a, GeometryId b) const;
  /// A translation after which the insides of a and b share no point. Bodies are closed triangle
  /// meshes, tetrahedral meshes (by their surfaces) and shapes. Bodies that only touch do not
  /// intersect; one inside another does. M is the largest coordinate.
  /// Laws     (1) that meshes are apart afterwards is tested exactly at positions + depth *
  ///          direction, or at a placed body's translation + that. The depth exceeds that of the
  ///          last touch by about 2^-40 M. A sphere, capsule or cylinder and a mesh are tested by
  ///          distance; intersecting is false for depths below 2^-36 M.
  ///          (2) minimal is true for two shapes or meshes that are convex to 2^-40 M, and for a
  ///          plane: no translation is shorter by 2^-36 M. Other depths are upper bounds.
  /// Errors   NotClosed, with the first edge, for what has no inside; UnsupportedMethod for two
  ///          planes.
  /// Cost     linear in the triangles and the pairs that touch: up to some 100 operations for each
  ///          triangle. Mostly 2 to 16 ms for 3,000 triangles, up to 65 ms in layers, and up to
  ///          300 ms where many triangles of both bodies lie in a common slanted plane.
  Penetration penetration(GeometryId a, GeometryId b) const;
  /// Whether two surfaces pierce each other in two of their elements; else they only touch there,
  /// or are apart. It is the decision by which Auto and Validity tell resting contact from
  /// intersection, and exact. a and b may be one mesh. Lines pierce surfaces.
  /// Errors   IndexOutOfRange; UnsupportedMethod for shapes and points.
  bool pierce(GeometryId a, std::uint32_t elementOfA, GeometryId b, std::uint32_t elementOfB) const;
  /// Follows a ball, of radius 0 a point, along a polyline. It is in a body from its first touch
  /// until it neither touches nor is inside by contains(). A point that only touches is not in it.
  /// Order    inside: by `enter`, then as `bodies`. outside: bodies without interval, as `bodies`.
  /// Accuracy which triangles a point meets is exact. Other arc lengths are within 2^-40 of the
  ///          largest coordinate, divided by the sine of the angle to the surface.
  /// Errors   InvalidSettings, too, for fewer than two points and a length that is not finite.
  /// Cost     for each body and segment a ray; without an interval also a distance() to a line.
  void path(std::span<const Eigen::Vector3d> polyline, double radius,
            std::span<const GeometryId> bodies, std::vector<PathInterval>& inside,
            std::vector<PathClearance>& outside) const;

  /// The vertices inside the body, ascending, at any depth, but none on its surface. The surface
  /// point is on the lowest of equally near triangles. Where parts of a closed body overlap, it is
  /// on the outer surface; where more than two meet in a point, a nearer one may be missed. Its
  /// accuracy is that of vertexTriangleDistance(), less where triangles intersect.
  /// Errors   NotClosed for a body that is no mesh, and with Closed for a triangle mesh with
  ///          defects, with the first edge; UnsupportedMethod if `vertices` is a shape.
  void findInsideVertices(GeometryId vertices, GeometryId body, std::vector<InsideVertex>& out,
                          const InsideSettings& = {}) const;
  /// The vertices in or on a tetrahedron, ascending, with the lowest that contains each, decided
  /// exactly. Inverted tetrahedra count, flat ones do not. UnsupportedMethod for other types.
  void findEmbeddedVertices(GeometryId vertices, GeometryId body,
                            std::vector<EmbeddedVertex>& out) const;
  /// The same for a point, L.
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
