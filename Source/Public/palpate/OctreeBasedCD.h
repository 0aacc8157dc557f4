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

#include <chrono>
#include <concepts>
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

struct CollisionPair {
  GeometryId a, b;
  PairSettings settings;
};

/// Collision detection of deforming meshes, lines, points, and of analytical shapes. Call in each
/// step setPositions(), detectCollision(), collisionData() and advance().
/// Step     vertices move in straight lines from `before` to `now`. advance() turns `now` into
///          `before` for all geometries; what is not set afterwards is at rest.
/// Units    L is the length unit of the positions; all lengths are in L.
/// Errors   UnknownGeometry, UnknownPair. NonFinitePosition for positions, also beyond
///          kLargestMeasure; IndexOutOfRange for elements; TooLarge beyond 2^28 vertices or
///          elements, 2^26 tetrahedra, or if no ids are left. MemoryLimit by Settings::memoryLimit.
///          InvalidCall after a move, or from a predicate or callback. An exception that ends a
///          frame leaves the last answers readable.
/// Valid    returned spans and references: until the next call that is not const, if not said.
/// Threads  const functions may run at once while no other function does.
/// Floating point  the caller's rounding mode, traps and treatment of denormals change no result.
class PALPATE_EXPORT OctreeBasedCD {
 public:
  /// Errors   InvalidSettings for a setting out of range or an audit folder that does not exist.
  explicit OctreeBasedCD(const Settings& = {});
  OctreeBasedCD(OctreeBasedCD&&) noexcept;
  OctreeBasedCD& operator=(OctreeBasedCD&&) noexcept;
  ~OctreeBasedCD();

  /// Adds a copy. Any set of triangles is valid: with borders, non-manifold edges, or no area.
  GeometryId addTriangleMesh(std::span<const Eigen::Vector3d> positions,
                             std::span<const Triangle> triangles);
  /// Every pair and method treats its surface() as a triangle mesh with the same vertex ids.
  /// Errors   SharedFace for a face of more than two; IndexOutOfRange, too, for equal vertices.
  GeometryId addTetrahedralMesh(std::span<const Eigen::Vector3d> positions,
                                std::span<const Tetrahedron> tetrahedra);
  /// Radii: L, in [0, kLargestMeasure], one for all or one per vertex, linear along segments.
  /// Features are a contact by the thickness and the radii where their centre lines come closest.
  /// Errors   InvalidRadius, also for their number; IndexOutOfRange, too, for equal ends.
  GeometryId addLineMesh(std::span<const Eigen::Vector3d> positions,
                         std::span<const Segment> segments, double radius = 0.0);
  GeometryId addLineMesh(std::span<const Eigen::Vector3d> positions,
                         std::span<const Segment> segments, std::span<const double> radii);
  /// Point i is vertex i. Radii and their errors are those of addLineMesh().
  GeometryId addPointSet(std::span<const Eigen::Vector3d> positions, double radius = 0.0);
  GeometryId addPointSet(std::span<const Eigen::Vector3d> positions, std::span<const double> radii);
  /// setTransform() places it. Throws InvalidShape for a measure out of range.
  GeometryId addAnalyticalGeometry(const AnalyticalGeometry&);
  /// setTransform() places it. Only DistanceField and Auto answer its pairs.
  /// Errors   InvalidSettings for null.
  GeometryId addDistanceField(std::shared_ptr<const DistanceField>);
  /// Attaches a field, in the body's frame, to a rigid triangle or tetrahedral mesh; null detaches
  /// it. Calls that change positions, topology or disabled elements then throw UnsupportedMethod.
  /// Errors   UnsupportedMethod for another type, disabled elements, or if a pair needs the old
  ///          field or its larger band; InvalidSettings, with the vertex, if the field there
  ///          exceeds its error bound.
  /// Cost     one look-up for each vertex.
  void attachDistanceField(GeometryId mesh, std::shared_ptr<const DistanceField>);
  /// Like attachDistanceField(), with leaves of Method::Proxy, for Auto; none detaches them.
  /// Errors   UnsupportedMethod for another type; InvalidSettings; TooLarge as Method::Proxy.
  /// Cost     seconds of processor time for half a million triangles, on all threads.
  void attachSurfaceProxy(GeometryId mesh, const std::optional<SurfaceProxySettings>&);
  void removeGeometry(GeometryId);  ///< with all its pairs

  bool has(GeometryId) const;                 ///< whether the geometry exists; any id is valid
  std::size_t vertexCount(GeometryId) const;  ///< 0 for a shape
  /// L, now; in the body's frame if setTransform() placed the geometry. Empty for a shape.
  std::span<const Eigen::Vector3d> positions(GeometryId) const;
  /// L: the box in the world around all vertices now, with radii, or a shape, up to rounding. Empty
  /// without vertices; infinite for a plane. Linear in the vertices.
  Eigen::AlignedBox3d bounds(GeometryId) const;

  /// `now` becomes `before`; results stay readable. Throws as detectCollision() if a pair with
  /// PairSettings::rememberSides changed since it was last called.
  void advance();

  /// Sets positions, one per vertex, in linear time. Only two arrays and advance() set `before`; in
  /// the step in which the geometry is added or its topology set, one array does, too.
  /// Errors   WrongPositionCount, also for a shape.
  void setPositions(GeometryId, std::span<const Eigen::Vector3d> now);
  void setPositions(GeometryId, std::span<const Eigen::Vector3d> before,
                    std::span<const Eigen::Vector3d> now);
  /// Sets the positions now of vertices from `first` on. The others keep theirs, which are neither
  /// read nor compared again if few vertices change in each step.
  /// Errors   WrongPositionCount if there are not as many vertices, or for a shape.
  template <std::integral Index>
  void setPositions(GeometryId geometry, Index first, std::span<const Eigen::Vector3d> now) {
    setSomePositions(geometry, static_cast<std::size_t>(first), now);
  }
  /// Sets the topology and the positions at both ends of the step. Enables all elements.
  /// Errors   UnsupportedMethod for another type; TooLarge for restDistance; as addTriangleMesh().
  void setTriangles(GeometryId, std::span<const Eigen::Vector3d> positions,
                    std::span<const Triangle>);
  /// The same, with the errors of addTetrahedralMesh().
  void setTetrahedra(GeometryId, std::span<const Eigen::Vector3d> positions,
                     std::span<const Tetrahedron>);
  /// A cut: removes triangles, appends vertices at rest in this step, and adds triangles, which may
  /// name them. Returns the ids of those. No other id changes, and what belongs to other elements
  /// stays: positions at both ends, disabled elements, tags, tracked contacts. Removed ids are not
  /// used again before setTriangles(): Docs/HowTo/Cuts.md.
  /// Cost     of a small cut by its size; with the next detection, at most about that of a new
  ///          object of what is left, and a pass over what is removed.
  /// rest: L, of the new vertices for restDistance; empty: newPositions.
  /// Errors   UnsupportedMethod for another type or an attached field; IndexOutOfRange, too, for an
  ///          id that is named twice or was removed; WrongPositionCount for rest; TooLarge.
  std::vector<std::uint32_t> replaceTriangles(GeometryId, std::span<const std::uint32_t> removed,
                                              std::span<const Triangle> added,
                                              std::span<const Eigen::Vector3d> newPositions,
                                              std::span<const Eigen::Vector3d> rest = {});
  /// The same with ids of tetrahedra. Triangles of surface() that stay keep their ids.
  /// rest also gives the winding of new tetrahedra. Throws SharedFace, too.
  std::vector<std::uint32_t> replaceTetrahedra(GeometryId, std::span<const std::uint32_t> removed,
                                               std::span<const Tetrahedron> added,
                                               std::span<const Eigen::Vector3d> newPositions,
                                               std::span<const Eigen::Vector3d> rest = {});
  /// Ids of triangles that cuts removed, of tetrahedral meshes those of surface(), ascending.
  std::span<const std::uint32_t> removedElements(GeometryId) const;
  /// The triangles that collide, and removedElements(). Valid until a cut, setTetrahedra() or
  /// removal.
  /// Errors   UnsupportedMethod for another type.
  TetrahedralSurface surface(GeometryId) const;

  /// Puts all positions of a geometry in a body's frame, at the pose now or at both ends of the
  /// step. A vertex is rounded as Pose does, and moves straight between the ends. If R^T R is off
  /// the identity by over 1e-9, the nearest rotation counts.
  /// Errors   InvalidTransform: R^T R is off by over 1e-5, the determinant is not positive, an
  ///          entry not finite, or the translation beyond kLargestMeasure. UnsupportedMethod for a
  ///          geometry with a pair with itself.
  /// Cost     that of turning the corners of a ConvexHull; none that grows with a mesh.
  void setTransform(GeometryId, const Pose& now);
  void setTransform(GeometryId, const Pose& before, const Pose& now);
  Pose transform(GeometryId) const;  ///< now, with the rotation that counts; default: identity
  /// A name in messages: `geometry 3 "liver"`. A null character throws InvalidSettings.
  void setName(GeometryId, std::string name);
  const std::string& name(GeometryId) const;
  /// A pair that filters separate has no contacts and is not trusted.
  /// Errors   InvalidSettings for Sidedness::Outer of lines, points and shapes.
  void setCollisionFilter(GeometryId, const CollisionFilter&);
  /// Gives each element a number: each triangle, segment or point, of a tetrahedral mesh each
  /// tetrahedron, or one for a shape or field. Contacts carry it (CollisionData::tagsOf()), and
  /// cuts keep it. None: all tags are 0, as those of new elements are.
  /// Errors   InvalidSettings for another number of tags.
  void setTags(GeometryId, std::span<const std::uint32_t> perElement);
  std::span<const std::uint32_t> tags(GeometryId) const;  ///< one per element, or none
  /// Disables these elements (of tetrahedral meshes, of surface()) and enables all others, in
  /// linear time. A vertex or edge is tested while an enabled element holds it.
  void setDisabledElements(GeometryId, std::span<const std::uint32_t> elements);

  /// Adds a pair; its order is that of ids in results. a == b: self-collision, in which features
  /// with a common vertex are no contacts.
  /// Errors   UnsupportedMethod for types that the method does not answer, and for a placed
  ///          geometry with itself; InvalidSettings; DuplicatePair; TooLarge for restDistance.
  void addCollisionPair(GeometryId a, GeometryId b, const PairSettings& = {});
  /// Replaces the settings; (a, b) in either order. Throws as addCollisionPair().
  void setPairSettings(GeometryId a, GeometryId b, const PairSettings&);
  /// Features that it refuses are no contacts and suppress none; intersectingTriangles() and
  /// validity() do not use it. Empty: refuses nothing. (a, b) is in the order of the addition.
  /// Errors   UnsupportedMethod for a pair with a shape or by a field or proxy.
  void setContactPredicate(GeometryId a, GeometryId b, ContactPredicate);
  void removeCollisionPair(GeometryId a, GeometryId b);  ///< in either order
  std::span<const CollisionPair> pairs() const;          ///< in the order in which they were added
  /// The settings passed last; (a, b) in the order of the addition.
  const PairSettings& pairSettings(GeometryId a, GeometryId b) const;

  void update();  ///< brings octrees to the positions now
  /// Finds the contacts of every pair; what did not change keeps its answer. Steady frames allocate
  /// nothing, except for integers of exact arithmetic.
  /// Errors   those of a predicate. Also of update(), forEachCandidate() and queries(): those of an
  ///          executor; InvalidSettings if run() returns too early; NotAvailable after fork() in a
  ///          task.
  void detectCollision();
  /// The same within a budget of time, which begins with the call. Pairs go in this order: those of
  /// the highest PairSettings::priority; those that were unfinished before, by age; higher
  /// priority; those with contacts in their last answer, then those whose boxes are nearest, less
  /// the motion in the step. A pair that exceeds the budget gives way every second time. Pairs that
  /// are not finished keep their last answer, and FrameStatistics::unfinishedPairs names them.
  /// Returns   whether everything was finished.
  /// Overrun   octrees are always updated; beyond that by one part of the work
  ///           (Docs/HowTo/Deadlines.md).
  bool detectCollision(std::chrono::microseconds budget);
  /// Ends a detectCollision() with a budget that is running as if its time were over. Otherwise it
  /// does nothing.
  /// Threads  safe except during construction, destruction and a move.
  void cancelDetection() const;

  /// Passes candidate pairs in batches to f(std::span<const ElementPair>): all pairs of enabled
  /// elements whose boxes overlap, and some more by rounding. Boxes are inflated by half of
  /// Validity::effectiveThickness and the largest radius, and enclose the step if the method does.
  /// Order    none; (a, b) in either order. `a` of ElementPair is of the pair's first geometry; in
  ///          self-collision a < b, no common vertex.
  /// Threads  calls of f come one at a time, from several threads.
  /// Errors   NotAvailable for a pair with a shape or by a field or proxy; those of f.
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
  /// Every pair without a shape: f(const CollisionPair&, std::span<const ElementPair>).
  template <class F>
  void forEachCandidate(F&& f) {
    forEachCandidateBatch(
        nullptr,
        [](void* function, const CollisionPair& pair, std::span<const ElementPair> batch) {
          (*static_cast<std::remove_reference_t<F>*>(function))(pair, batch);
        },
        const_cast<void*>(static_cast<const void*>(std::addressof(f))));
  }

  std::vector<ElementPair> candidatePairs(GeometryId a, GeometryId b);  ///< ascending

  /// Queries at the positions now. Updates octrees, which no other thread may read meanwhile.
  SpatialQueries queries() const;

  /// Makes the state now the latest snapshot. Objects from queries() stay valid. If it throws, as
  /// queries() does, the last snapshot stays the latest.
  /// Cost     copies octrees and topologies that changed. Steady publications allocate nothing.
  void publish(double time = 0.0);
  /// The last published snapshot, or null. It may outlive this object.
  /// Threads  safe except during construction, destruction and a move; waits for a pointer's copy.
  std::shared_ptr<const Snapshot> latestSnapshot() const;

  /// The answer of the last detectCollision(); (a, b) in the order of the addition.
  /// Errors   NotAvailable before the first detection of the pair.
  const CollisionData& collisionData(GeometryId a, GeometryId b) const;
  /// Gives 64 bits to a contact of the last detection, for as long as it lasts and then to its
  /// successor. (a, b) in the order of the addition.
  /// Errors   NotAvailable if the detection has no such contact, or does not track contacts.
  void setUserData(GeometryId a, GeometryId b, const ContactKey&, std::uint64_t);
  /// Replaces CollisionData::rememberedSides() of the present step; none forgets all sides. Times
  /// do not count. (a, b) is in the order of the addition; vertices of edges are in any order.
  /// Errors   NotAvailable without PairSettings::rememberSides; IndexOutOfRange for a feature that
  ///          does not exist.
  void setRememberedSides(GeometryId a, GeometryId b, std::span<const Crossing>);
  /// L, one per vertex, or one for a shape. While no point has moved further since the last
  /// detection, no new contact or crossing exists, rounding included
  /// (Docs/Algorithms/FreeMotion.md). Infinity without PairSettings::freeMotionReach. Valid until
  /// the next detection or change of the geometry.
  /// Errors   NotAvailable before a detection with these elements.
  std::span<const double> freeMotion(GeometryId) const;
  /// Valid as long as this object; updates change it. Updates octrees that lag.
  const LooseOctree& octree() const;
  MemoryUse memoryUse() const;  ///< now, with queries and snapshots
  /// Gives back what is only kept for next frames, but no result or held snapshot, and resets
  /// FrameStatistics::peakMemory. Lack of memory is no error.
  void releaseMemory();
  const FrameStatistics& statistics() const;  ///< of the last detection or update()
  PairStatistics pairStatistics(GeometryId a, GeometryId b) const;  ///< of it; in either order
  const Settings& settings() const;
  /// Writes times of the last Settings::traceFrames detections as JSON in the Trace Event Format.
  /// Errors   NotAvailable if traceFrames is 0; File, and an existing file is then unchanged.
  void writeTrace(const std::filesystem::path&) const;
  /// Where the audit of the last detection differs from brute force: faults of this library.
  std::span<const AuditFailure> auditFailures() const;
  /// A copy of all that the next detection reads, with placed deforming meshes in the world.
  CollisionProblem problem() const;

  /// The state as bytes: geometries and pairs with their ids, both ends of the step, the last
  /// answers, and what is known of contacts and sides from step to step.
  /// Cost     linear in the state.
  std::vector<std::byte> save() const;
  /// Goes back to a state of this or another object with the same Settings::engine. The next calls
  /// give the same bits as they gave after save(), except times and counts of work.
  /// Kept     Settings, snapshots, contact predicates and distance fields. Geometries and pairs
  ///          that had one must have it here, under the same ids. Objects that use this one, such
  ///          as a StepGuard or PenetrationTracker, keep their own state.
  /// Errors   File, with the byte or the fault, for other or changed bytes; NotAvailable without
  ///          such a predicate or field. An exception changes nothing.
  /// Cost     linear in the state; geometries whose elements differ from those here are built anew.
  void restore(std::span<const std::byte>);

 private:
  friend class StepGuard;
  friend class ThreadTopology;
  friend struct ProblemGeometries;
  std::shared_ptr<StepSource> stepSource();
  void setSomePositions(GeometryId, std::size_t first, std::span<const Eigen::Vector3d> now);
  using BatchFunction = void (*)(void*, const CollisionPair&, std::span<const ElementPair>);
  /// null: every pair
  void forEachCandidateBatch(const CollisionPair* only, BatchFunction, void* function);

  struct Implementation;
  const Implementation& read() const;  ///< throws InvalidCall
  std::unique_ptr<Implementation> m_implementation;
};

/// The contacts of two meshes without a step, on one thread. UnsupportedMethod for Continuous.
PALPATE_EXPORT CollisionData detectCollision(const TriangleMeshView& a, const TriangleMeshView& b,
                                             const PairSettings& = {});

}  // namespace palpate
