#pragma once

#include <palpate/AnalyticalGeometry.h>
#include <palpate/CollisionData.h>
#include <palpate/Error.h>
#include <palpate/Export.h>
#include <palpate/FrameStatistics.h>
#include <palpate/LooseOctree.h>
#include <palpate/Meshes.h>
#include <palpate/Settings.h>
#include <palpate/Snapshot.h>
#include <palpate/SpatialQueries.h>
#include <palpate/Types.h>

#include <Eigen/Geometry>

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

namespace palpate {

class DistanceField;
class StepSource;
struct AuditFailure;
struct CollisionProblem;

/// A pair of geometries that is tested in each frame, with its settings.
struct CollisionPair {
  GeometryId a, b;
  PairSettings settings;
};

/// Collision detection of deforming triangle and tetrahedral meshes, lines and points, and of
/// analytical shapes. Add geometries and pairs once. Then call in each step setPositions(),
/// detectCollision(), collisionData() and advance().
/// Step     a step runs from the positions `before` to the positions `now`; each vertex moves in a
///          straight line. advance() ends the step: `now` becomes `before`, for positions and
///          transforms of all geometries. A geometry that is not set after advance() is at rest.
///          Within a step you may make all calls any number of times and in any order. Contacts
///          depend only on the last values. Validity may know less than in a new object
///          (Docs/Guarantees.md, "Reproducibility").
/// Units    L is the length unit of the positions. All lengths are in L.
/// Errors   a function that takes data throws palpate::Error for invalid data and changes nothing.
///          Each function lists its error codes. In addition, every function that takes a
///          GeometryId, except has(), throws UnknownGeometry for a geometry that was never
///          added or was removed.
///          If an exception ends a frame, the last answers stay readable and the object is ready
///          for the next frame. Such exceptions come from memory, predicates, callbacks and
///          executors. Exact arithmetic may use GMP, which ends the process if it gets no memory.
///          After a move every function except assignment and destruction throws InvalidCall. A
///          call from a predicate or callback to the object that calls it throws InvalidCall, too.
/// Memory   with Settings::memoryLimit, a function that needs more memory throws MemoryLimit.
/// Valid    spans and references that functions return are valid until the next call that is not
///          const, unless a function says more.
/// Threads  const functions are safe from any number of threads while no other function runs. Two
///          objects share nothing but an executor.
/// Floating point  the caller's rounding mode, traps and treatment of denormals change no result.
class PALPATE_EXPORT OctreeBasedCD {
 public:
  /// Errors   InvalidSettings for a setting outside its range, an audit folder that does not exist,
  ///          or an executor whose concurrency() is below 1.
  explicit OctreeBasedCD(const Settings& = {});
  OctreeBasedCD(OctreeBasedCD&&) noexcept;
  OctreeBasedCD& operator=(OctreeBasedCD&&) noexcept;
  ~OctreeBasedCD();

  /// Adds a triangle mesh. The library copies it. Any set of triangles is valid: several
  /// components, borders, non-manifold edges, triangles without area, no triangles at all.
  /// Errors   NonFinitePosition; IndexOutOfRange for a vertex index; TooLarge for more than 2^28
  ///          vertices or triangles, or if no geometry ids are left, as all functions that add one.
  GeometryId addTriangleMesh(std::span<const Eigen::Vector3d> positions,
                             std::span<const Triangle> triangles);
  /// Adds a tetrahedral mesh. Every pair and method treats its surface() as a triangle mesh, with
  /// the vertex ids of the tetrahedral mesh.
  /// Errors   NonFinitePosition; IndexOutOfRange for a vertex index, or a tetrahedron that has one
  ///          vertex twice; SharedFace for a face of more than two tetrahedra; TooLarge for more
  ///          than 2^28 vertices or 2^26 tetrahedra.
  GeometryId addTetrahedralMesh(std::span<const Eigen::Vector3d> positions,
                                std::span<const Tetrahedron> tetrahedra);
  /// Adds a line mesh: open, closed or branching, of any number of parts. radius: L, of all
  /// vertices. radii: L, one per vertex, linear along each segment. Radii are in
  /// [0, kLargestMeasure]. They never change.
  /// Lists    edgeEdge() has its segments with edges of triangles and with segments of line meshes.
  ///          vertexTriangle() or triangleVertex() has its vertices with triangles, and points with
  ///          its segments: segment {p, q} is the triangle {p, q, q} there. Features are a contact
  ///          where their centre lines come closest, if the distance there is at most the thickness
  ///          and the radii there. Docs/SupportMatrix.md has the contacts of each pair of types.
  /// Errors   NonFinitePosition; IndexOutOfRange for a vertex index, or a segment that joins a
  ///          vertex with itself; InvalidRadius, also if there is not one per vertex; TooLarge for
  ///          more than 2^28 vertices or segments.
  GeometryId addLineMesh(std::span<const Eigen::Vector3d> positions,
                         std::span<const Segment> segments, double radius = 0.0);
  GeometryId addLineMesh(std::span<const Eigen::Vector3d> positions,
                         std::span<const Segment> segments, std::span<const double> radii);
  /// Adds a point set. Point i is vertex i. Radii are as in addLineMesh().
  /// Lists    vertexTriangle() or triangleVertex() has its points with triangles, segments and
  ///          other points: point p is the triangle {p, p, p} there. For two point sets the points
  ///          of the first set are the vertices. For a point set with itself the lower point is the
  ///          vertex.
  /// Errors   NonFinitePosition; InvalidRadius, also if there is not one per point; TooLarge for
  ///          more than 2^28 points.
  GeometryId addPointSet(std::span<const Eigen::Vector3d> positions, double radius = 0.0);
  GeometryId addPointSet(std::span<const Eigen::Vector3d> positions, std::span<const double> radii);
  /// Adds an analytical shape, which setTransform() places. CollisionData::shape() has its contacts
  /// with triangles, lines and points, shapeShape() those with another shape. Method::Auto,
  /// Proximity and Continuous answer such pairs, also with a thickness of 0.
  /// Errors   InvalidShape if a measure is out of range (<palpate/AnalyticalGeometry.h>).
  GeometryId addAnalyticalGeometry(const AnalyticalGeometry&);
  /// Adds the surface of a distance field. setTransform() places it. Its pairs with triangle,
  /// tetrahedral and line meshes and with point sets need Method::DistanceField, which is the only
  /// one that accepts it. The geometry has no vertices and no elements. Queries refuse it.
  /// Errors   InvalidSettings for null.
  GeometryId addDistanceField(std::shared_ptr<const DistanceField>);
  /// Attaches a distance field to a triangle or tetrahedral mesh that is rigid. Pairs of the mesh
  /// may then use Method::DistanceField, and Auto may (PairSettings::allowedError). The field is in
  /// the body's frame. Null detaches it. A body with a field keeps its shape: setPositions(),
  /// setTriangles(), setTetrahedra() and setDisabledElements() throw UnsupportedMethod.
  /// Errors   UnsupportedMethod for another geometry type, for a mesh with disabled elements, or if
  ///          a pair by Method::DistanceField still needs the field that this call replaces by
  ///          null or by one with a smaller band; InvalidSettings if the field is not of this mesh:
  ///          if its value at a vertex of a triangle exceeds the error bound. The message names the
  ///          vertex.
  /// Cost     one look-up for each vertex.
  void attachDistanceField(GeometryId mesh, std::shared_ptr<const DistanceField>);
  /// Builds the leaves of Method::Proxy for a triangle or tetrahedral mesh that is rigid, and
  /// attaches them. Pairs by Auto of a point set, first, and the mesh may then use them
  /// (PairSettings::allowedError). None detaches them. A body with leaves keeps its shape, as with
  /// attachDistanceField().
  /// Errors   UnsupportedMethod for another geometry type; InvalidSettings; TooLarge as
  ///          Method::Proxy.
  /// Cost     some seconds of processor time for half a million triangles, shared by the threads.
  void attachSurfaceProxy(GeometryId mesh, const std::optional<SurfaceProxySettings>&);
  /// Removes a geometry and all its pairs.
  void removeGeometry(GeometryId);

  /// Whether the geometry was added and not removed. Any id is valid.
  bool has(GeometryId) const;
  std::size_t vertexCount(GeometryId) const;  ///< 0 for a shape
  /// L: the positions now, as setPositions() gave them. If setTransform() has placed the geometry,
  /// they are in the body's frame. Empty for a shape.
  std::span<const Eigen::Vector3d> positions(GeometryId) const;
  /// L: the axis-aligned box in the world around all vertices now with their radii, or around a
  /// shape. Empty if there are no vertices; infinite for a plane. Exact up to rounding.
  /// Cost     linear in the vertices.
  Eigen::AlignedBox3d bounds(GeometryId) const;

  /// Ends the step of all geometries: `now` becomes `before`. Results stay readable.
  /// Cost     does not grow with the number of vertices.
  void advance();

  /// Sets the positions, one per vertex. One array sets `now`; two arrays set both ends of the
  /// step. Only the second form and advance() set `before`. In the step in which a geometry is
  /// added, or its topology is set, `before` follows `now` unless you pass it.
  /// Errors   WrongPositionCount, also for a shape; NonFinitePosition, also for a coordinate beyond
  ///          kLargestMeasure, as all functions that take positions.
  /// Cost     linear in the vertices.
  void setPositions(GeometryId, std::span<const Eigen::Vector3d> now);
  void setPositions(GeometryId, std::span<const Eigen::Vector3d> before,
                    std::span<const Eigen::Vector3d> now);
  /// Sets the topology of a triangle mesh, as after a cut, and its positions at both ends of the
  /// step. All elements are enabled afterwards.
  /// Errors   UnsupportedMethod for another geometry type; IndexOutOfRange and TooLarge as in
  ///          addTriangleMesh(), TooLarge for restDistance, too; NonFinitePosition.
  void setTriangles(GeometryId, std::span<const Eigen::Vector3d> positions,
                    std::span<const Triangle>);
  /// The same for a tetrahedral mesh.
  /// Errors   UnsupportedMethod for another geometry type; IndexOutOfRange, SharedFace and TooLarge
  ///          as in addTetrahedralMesh(), TooLarge for restDistance, too; NonFinitePosition.
  void setTetrahedra(GeometryId, std::span<const Eigen::Vector3d> positions,
                     std::span<const Tetrahedron>);
  /// The triangles with which a tetrahedral mesh collides. The spans are valid until
  /// setTetrahedra() changes the mesh, or until it is removed.
  /// Errors   UnsupportedMethod for another geometry type.
  TetrahedralSurface surface(GeometryId) const;

  /// Places a geometry as a whole, from now on. Its positions, earlier and later ones, and its
  /// octree are in the body's frame. A vertex in the world is the double ((r0 x + r1 y) + r2 z) +
  /// t. One pose sets `now`, two poses set both ends of the step. Vertices move in straight lines
  /// between the two ends (Validity::arcDeviation). If an entry of R^T R is off the identity by
  /// more than 1e-9, the nearest rotation counts instead.
  /// Errors   InvalidTransform if an entry of R^T R is off the identity by more than 1e-5, if the
  ///          determinant is not positive, if an entry is not finite, or if the translation is
  ///          beyond kLargestMeasure. UnsupportedMethod if the geometry has a pair with itself.
  /// Cost     that of turning the corners of a ConvexHull; none that grows with a mesh.
  void setTransform(GeometryId, const Pose& now);
  void setTransform(GeometryId, const Pose& before, const Pose& now);
  /// The pose now, with the rotation that counts; the identity if setTransform() has not placed the
  /// geometry.
  Pose transform(GeometryId) const;
  /// Names a geometry in messages: `geometry 3 "liver"`. Any text; none by default. A capture file
  /// does not hold it.
  /// Errors   InvalidSettings for a name with a null character.
  void setName(GeometryId, std::string name);
  const std::string& name(GeometryId) const;
  /// Sets which geometries this one collides with, and from which sides. Two geometries collide
  /// only if the mask of each contains a group of the other. A pair that does not collide has no
  /// contacts, no candidates and no cost, and is not trusted.
  /// Errors   InvalidSettings for a value that Sidedness does not have, and for Sidedness::Outer of
  ///          lines, points and shapes.
  void setCollisionFilter(GeometryId, const CollisionFilter&);
  /// Disables these elements and enables all others. An element is a triangle, a segment or a
  /// point; of a tetrahedral mesh a triangle of surface(). Disabled elements are in no candidate
  /// pair. A vertex or edge is tested as long as an enabled element holds it. SpatialQueries search
  /// disabled elements, too.
  /// Errors   IndexOutOfRange.
  /// Cost     linear in the elements. The octree stays as it is.
  void setDisabledElements(GeometryId, std::span<const std::uint32_t> elements);

  /// Adds a pair that each detection tests. a == b tests a geometry with itself (self-collision):
  /// features with a common vertex are no contacts. The order of a and b determines the order of
  /// ids in all results.
  /// Errors   UnsupportedMethod if the method does not exist for these geometries
  ///          (Docs/SupportMatrix.md), also for a geometry with itself that setTransform() has
  ///          placed; InvalidSettings; DuplicatePair; TooLarge for PairSettings::restDistance.
  void addCollisionPair(GeometryId a, GeometryId b, const PairSettings& = {});
  /// Replaces the settings of a pair. (a, b) may be in either order.
  /// Errors   UnknownPair; UnsupportedMethod, InvalidSettings and TooLarge as in
  ///          addCollisionPair().
  void setPairSettings(GeometryId a, GeometryId b, const PairSettings&);
  /// Sets a predicate that refuses contacts. Refused features are no contacts, and they suppress no
  /// other contact. intersectingTriangles() and validity() do not use the predicate. An empty
  /// predicate refuses nothing. (a, b) is in the order in which the pair was added.
  /// Errors   UnknownPair; UnsupportedMethod for a pair with a shape.
  void setContactPredicate(GeometryId a, GeometryId b, ContactPredicate);
  /// Removes a pair and its answer. (a, b) may be in either order.
  /// Errors   UnknownPair.
  void removeCollisionPair(GeometryId a, GeometryId b);
  std::span<const CollisionPair> pairs() const;  ///< in the order in which they were added
  /// The settings as you passed them last. (a, b) is in the order in which the pair was added.
  /// Errors   UnknownPair.
  const PairSettings& pairSettings(GeometryId a, GeometryId b) const;

  /// Brings boxes and octrees to the positions now. Functions that need them do this themselves.
  void update();
  /// Runs the broad phase and the narrow phase of every pair, and updates octrees if needed. Pairs
  /// for which nothing changed since the last detection keep their answer. A steady frame allocates
  /// no memory, except for integers of exact arithmetic (Docs/Guarantees.md, "Memory").
  /// Errors   whatever a predicate or executor throws; InvalidSettings if an executor's run()
  ///          returns too early; NotAvailable if a task called fork() (see makeThreadPool()).
  ///          Predicates apart, update(), forEachCandidate() and queries() throw the same.
  void detectCollision();

  /// Passes the candidate pairs of (a, b), for a narrow phase of your own, to
  /// f(std::span<const ElementPair>) in batches. They are all pairs of enabled elements whose boxes
  /// overlap, each box inflated by half the thickness and by the largest radius of its geometry.
  /// Auto may add to the thickness (Validity::effectiveThickness), and for Intersection it is 0. If
  /// the method needs the motion in the step, the boxes enclose the whole step. Outward rounding
  /// may add pairs. Updates octrees if needed. (a, b) may be in either order.
  /// Order    none. Of a pair, `a` is of the first geometry with which the pair was added. For a
  ///          geometry with itself each unordered pair once, a < b, and no pair with a common
  ///          vertex.
  /// Threads  calls of f come one at a time, but from several threads.
  /// Errors   UnknownPair; NotAvailable for a pair with a shape; InvalidCall if f calls a function
  ///          of this object; whatever f throws.
  /// Cost     with Engine::Octree memory does not grow with the number of pairs.
  template <class F>
  void forEachCandidate(GeometryId a, GeometryId b, F&& f) {
    const CollisionPair pair{a, b, {}};
    forEachCandidateBatch(
        &pair,
        [](void* function, const CollisionPair&, std::span<const ElementPair> batch) {
          (*static_cast<std::remove_reference_t<F>*>(function))(batch);
        },
        const_cast<void*>(static_cast<const void*>(std::addressof(f))));
  }
  /// The same for every pair, with f(const CollisionPair&, std::span<const ElementPair>). Pairs
  /// with a shape have no candidate pairs.
  template <class F>
  void forEachCandidate(F&& f) {
    forEachCandidateBatch(
        nullptr,
        [](void* function, const CollisionPair& pair, std::span<const ElementPair> batch) {
          (*static_cast<std::remove_reference_t<F>*>(function))(pair, batch);
        },
        const_cast<void*>(static_cast<const void*>(std::addressof(f))));
  }

  /// The pairs of forEachCandidate() as a list, ascending.
  std::vector<ElementPair> candidatePairs(GeometryId a, GeometryId b);

  /// Spatial queries at the positions now. Updates octrees if needed. While it does, the
  /// LooseOctree of octree() changes, so that no other thread may read it.
  /// Cost     none but the update, which the next detection then does not repeat.
  SpatialQueries queries() const;

  /// Makes the state now the latest snapshot, which other threads may query while this object
  /// changes. Updates octrees if needed. Objects from queries() stay valid. time: Snapshot::time().
  /// Errors   those of queries(). If it throws, the last snapshot stays the latest.
  /// Cost     copies the octrees and, after a change, the topology of geometries that changed since
  ///          the last publication. Geometries that did not move are shared with it. Allocates
  ///          nothing in a steady state: the memory of a snapshot returns when its last reader lets
  ///          go.
  void publish(double time = 0.0);
  /// The last state that was published; null before the first. The snapshot may outlive this
  /// object. Releasing it waits for nobody.
  /// Threads  safe from any thread at any time between construction and destruction, also while
  ///          another function runs; not during a move. It locks a std::mutex to copy one
  ///          shared_ptr. publish() locks the same mutex to swap one.
  std::shared_ptr<const Snapshot> latestSnapshot() const;

  /// The answer of the last detectCollision(). (a, b) is in the order in which the pair was added.
  /// Errors   UnknownPair; NotAvailable before the first detection of the pair.
  const CollisionData& collisionData(GeometryId a, GeometryId b) const;
  /// L: how far vertices may move from their positions in the last detectCollision(), one length
  /// for each; of a shape one for all its points. While no point of any geometry moves further than
  /// its own, on whatever path, features that were no contact come no nearer than the thickness and
  /// their radii, and features in contact do not pass through each other. It includes rounding, and
  /// excludes features that the pair's filters exclude. Only pairs with
  /// PairSettings::freeMotionReach count; a geometry without one has infinity. Valid until the next
  /// detection or change of the geometry. Docs/Algorithms/FreeMotion.md has the proof.
  ///
  /// Errors   UnknownGeometry; NotAvailable before a detection with these elements.
  std::span<const double> freeMotion(GeometryId) const;
  /// The octrees of all geometries, as of the last update. The reference is valid as long as this
  /// object; each update changes what it shows.
  const LooseOctree& octree() const;
  /// The memory that the object holds now, also after queries(), publish() and releaseMemory().
  MemoryUse memoryUse() const;
  /// Gives back memory that the object only keeps for the next frames. They allocate what they need
  /// again. Results, candidate pairs and the snapshots that somebody holds stay as they are.
  /// FrameStatistics::peakMemory starts again.
  /// Errors   none for lack of memory: what needs a smaller copy then stays as it is.
  void releaseMemory();
  /// Times and counts of the last detectCollision() with the updates before it, or of a later
  /// update(). queries() does not change them.
  const FrameStatistics& statistics() const;
  /// Time and counts of one pair in the last detectCollision(). (a, b) may be in either order.
  /// Errors   UnknownPair.
  PairStatistics pairStatistics(GeometryId a, GeometryId b) const;
  const Settings& settings() const;
  /// Writes the times of the last Settings::traceFrames detections: of each stage, pair and job, by
  /// thread. The file is JSON in the Trace Event Format, which https://ui.perfetto.dev and
  /// chrome://tracing show. An event names its geometries by their ids.
  /// Errors   NotAvailable if Settings::traceFrames is 0; File if the file cannot be written; an
  ///          existing file is then unchanged.
  void writeTrace(const std::filesystem::path&) const;
  /// The differences that the audit (Settings::audit) found between the last detectCollision() and
  /// brute force. They are faults of this library; the audit finds those in its sample of features.
  /// A capture that cannot be written is no exception: AuditFailure::fileError names the reason.
  std::span<const AuditFailure> auditFailures() const;
  /// A copy of everything that the next detectCollision() would compute its answers from. Directly
  /// after a frame it is the problem of that frame. It holds positions of placed deforming meshes
  /// in the world. Where these exceed kLargestMeasure, capture() and the functions of
  /// <palpate/Capture.h> that take a problem throw NonFinitePosition.
  CollisionProblem problem() const;

 private:
  friend class StepGuard;
  std::shared_ptr<StepSource> stepSource();
  using BatchFunction = void (*)(void*, const CollisionPair&, std::span<const ElementPair>);
  /// only: the pair, or null for every pair.
  void forEachCandidateBatch(const CollisionPair* only, BatchFunction, void* function);

  struct Implementation;
  const Implementation& read() const;  ///< throws InvalidCall
  std::unique_ptr<Implementation> m_implementation;
};

/// The contacts of two triangle meshes in one call, without a step. It runs the code of
/// OctreeBasedCD on one thread.
/// Errors   UnsupportedMethod for Method::Continuous, which needs a step; those of
///          addTriangleMesh() and addCollisionPair().
PALPATE_EXPORT CollisionData detectCollision(const TriangleMeshView& a, const TriangleMeshView& b,
                                             const PairSettings& = {});

}  // namespace palpate
