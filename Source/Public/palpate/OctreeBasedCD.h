#pragma once

#include <palpate/AnalyticalGeometry.h>
#include <palpate/Audit.h>
#include <palpate/CollisionData.h>
#include <palpate/CollisionProblem.h>
#include <palpate/Error.h>
#include <palpate/Export.h>
#include <palpate/FrameStatistics.h>
#include <palpate/LooseOctree.h>
#include <palpate/Settings.h>
#include <palpate/SpatialQueries.h>
#include <palpate/TetrahedralMesh.h>
#include <palpate/Types.h>

#include <Eigen/Geometry>

#include <cstddef>
#include <memory>
#include <span>
#include <type_traits>

namespace palpate {

struct CollisionPair {
  GeometryId a, b;
  PairSettings settings;
};

/// Collision detection over deforming triangle meshes, lines, points and analytical shapes. Add
/// geometries and pairs once. Then, in each step: setPositions(), detectCollision(), read
/// collisionData(), advance().
///
/// Step     a step runs from the positions `before` to the positions `now`; each vertex moves in a
///          straight line. advance() ends the step: `now` becomes `before`, for positions and
///          transforms of all geometries. A geometry that is not set after advance() is at rest.
///          Within a step all calls may be made any number of times and in any order; an answer
///          depends only on the last values.
/// Errors   every function that takes data throws palpate::Error and changes nothing. An exception
///          while a frame is computed (memory, a predicate or callback that throws) leaves the last
///          answers readable and the object ready for the next frame. Exact arithmetic on integers
///          of any size is GMP's, which ends the process where it gets no memory.
///          After a move everything but assignment and destruction throws InvalidCall; so does a
///          call from a predicate or callback to the object that calls it.
/// Threads  const functions are safe from many threads while no other function runs. Two objects
///          share nothing.
/// Floating point  the caller's rounding mode, traps and treatment of denormals change nothing.
class PALPATE_EXPORT OctreeBasedCD {
 public:
  explicit OctreeBasedCD(const Settings& = {});
  OctreeBasedCD(OctreeBasedCD&&) noexcept;
  OctreeBasedCD& operator=(OctreeBasedCD&&) noexcept;
  ~OctreeBasedCD();

  /// Any soup: several components, borders, non-manifold edges, no triangles at all. Copied in.
  GeometryId addTriangleMesh(std::span<const Eigen::Vector3d> positions,
                             std::span<const Triangle> triangles);
  /// A solid, deforming or not: its surface() is a triangle mesh to every pair and method, with
  /// the solid's vertex ids. No face may be of more than two tetrahedra, no vertex twice in one.
  GeometryId addTetrahedralMesh(std::span<const Eigen::Vector3d> positions,
                                std::span<const Tetrahedron> tetrahedra);
  /// A thread of any shape: open, closed, branching, several. radius: L, of all, or one for each
  /// vertex and linear between; finite, not negative. No segment may join a vertex with itself.
  ///
  /// Edges meet triangles' edges and other lines' edges in edgeEdge(), vertices meet triangles;
  /// points meet its segments in vertexTriangle() or triangleVertex(): segment {p, q} is triangle
  /// {p, q, q}. Features touch where centre lines come closest, if their distance there is at most
  /// the thickness and the radii there. Docs/Pairs.md has what each pair of kinds answers.
  GeometryId addLineMesh(std::span<const Eigen::Vector3d> positions,
                         std::span<const Segment> segments, double radius = 0.0);
  GeometryId addLineMesh(std::span<const Eigen::Vector3d> positions,
                         std::span<const Segment> segments, std::span<const double> radii);
  /// Point i is vertex i. Points meet triangles, segments and points: point p is triangle {p, p,
  /// p}. Of two point sets the first has the vertices, of one with itself the lower point is the
  /// vertex.
  GeometryId addPointSet(std::span<const Eigen::Vector3d> positions, double radius = 0.0);
  GeometryId addPointSet(std::span<const Eigen::Vector3d> positions, std::span<const double> radii);
  /// A tool, a needle's tip, a table: placed by setTransform(). Meets triangles, lines and points
  /// in CollisionData::shape(), and other shapes in shapeShape(), each by Method::Auto, Proximity
  /// and Continuous. The thickness may be 0.
  ///
  ///   const GeometryId tool = detection.addAnalyticalGeometry(Capsule{{0, 0, 0}, {0, 0,
  ///   80}, 2.5}); detection.addCollisionPair(organ, tool, {Method::Proximity, 0.5});
  ///   detection.setTransform(tool, rotation, tip);
  ///   detection.detectCollision();
  ///   for (const ShapeContact& c : detection.collisionData(organ, tool).shape())
  ///     push(c.vertices, c.weights, c.normal, 0.5 - c.distance);
  GeometryId addAnalyticalGeometry(const AnalyticalGeometry&);
  void removeGeometry(GeometryId);  ///< and its pairs

  bool contains(GeometryId) const;            ///< whether it was added and not removed
  std::size_t vertexCount(GeometryId) const;  ///< 0 of a shape
  /// The positions now, as setPositions() gave them: of a geometry that setTransform() has placed,
  /// in the body's frame. Empty for a shape. The span lives until the next call that is not const.
  std::span<const Eigen::Vector3d> positions(GeometryId) const;
  /// L: an axis-aligned box in the world around all vertices now, with their radii, or around a
  /// shape. Empty where there are no vertices; infinite for a plane. Exact but for rounding.
  /// Cost     linear in the vertices.
  Eigen::AlignedBox3d bounds(GeometryId) const;

  /// Ends the step of all geometries: `now` becomes `before`. Results stay readable. Loops that
  /// never call it sweep from where they began: see Validity::displacement.
  ///
  /// Cost     does not grow with vertices.
  void advance();

  /// One array sets `now`; two arrays set both ends of the step. Only the second form and advance()
  /// set `before`. In the step in which a geometry is added, or its topology is set, `before`
  /// follows `now` unless it is given.
  void setPositions(GeometryId, std::span<const Eigen::Vector3d> now);
  void setPositions(GeometryId, std::span<const Eigen::Vector3d> before,
                    std::span<const Eigen::Vector3d> now);
  /// Sets a new topology, as after a cut, and the positions at both ends of the step. Triangle
  /// meshes only.
  void setTriangles(GeometryId, std::span<const Eigen::Vector3d> positions,
                    std::span<const Triangle>);
  /// The same of tetrahedral meshes only.
  void setTetrahedra(GeometryId, std::span<const Eigen::Vector3d> positions,
                     std::span<const Tetrahedron>);
  /// Of a tetrahedral mesh; the spans live until it is changed or removed.
  TetrahedralSurface surface(GeometryId) const;

  /// Moves a geometry as a whole, from now on: a point x of its body's frame is at rotation x +
  /// translation, which of vertices is the double ((r0 x + r1 y) + r2 z) + t. The positions given
  /// before, and by later setPositions() and setTriangles(), are in the body's frame, and so is its
  /// octree, which stays as it is. The step is as with setPositions(): one pose sets `now`, two
  /// poses set both ends. Positions and transform are set independently of each other. Vertices
  /// move in straight lines between the two ends (Validity::arcDeviation).
  ///
  /// Errors   InvalidTransform unless the rotation is one within 1e-9 and all is finite, below
  ///          2^1000; UnsupportedMethod where the geometry has a pair with itself.
  /// Cost     does not grow with the geometry.
  void setTransform(GeometryId, const Eigen::Matrix3d& rotation,
                    const Eigen::Vector3d& translation);
  void setTransform(GeometryId, const Eigen::Matrix3d& rotationBefore,
                    const Eigen::Vector3d& translationBefore, const Eigen::Matrix3d& rotation,
                    const Eigen::Vector3d& translation);
  /// Two geometries meet where each is in a group that the other's mask has; a pair that does not
  /// has no contacts, no candidates and no cost, and is not trusted.
  void setCollisionFilter(GeometryId, const CollisionFilter&);
  /// Switches triangles, segments or points off, and all others on: they are no candidates. A
  /// vertex or edge is on while anything that holds it is. SpatialQueries ask all.
  void setDisabledElements(GeometryId, std::span<const std::uint32_t> elements);

  /// a == b: self-collision, adjacent features excluded. Kinds and methods that cannot be tested
  /// are refused: UnsupportedMethod.
  void addCollisionPair(GeometryId a, GeometryId b, const PairSettings& = {});
  void setPairSettings(GeometryId a, GeometryId b, const PairSettings&);
  /// Features that it refuses are no contacts and hide none; intersectingTriangles() and validity()
  /// do not ask it. In the order in which the pair was added; an empty one refuses nothing.
  void setContactPredicate(GeometryId a, GeometryId b, ContactPredicate);
  void removeCollisionPair(GeometryId a, GeometryId b);
  std::span<const CollisionPair> pairs() const;  ///< in the order added
  /// As they were given last; (a, b) in the order in which the pair was added. The reference lives
  /// until the next call that is not const.
  const PairSettings& pairSettings(GeometryId a, GeometryId b) const;

  void update();  ///< boxes and octrees for the positions now
  /// broad phase only, for a narrow phase of your own; fills candidatePairs()
  void collectCandidates();
  void detectCollision();  ///< broad and narrow phase of every pair; updates if needed

  /// Hands candidate pairs to f(std::span<const ElementPair>) in batches, unsorted, one at a time,
  /// not all from the calling thread; memory does not grow with their number. Updates if needed.
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
  /// Those of every pair to f(const CollisionPair&, std::span<const ElementPair>).
  template <class F>
  void forEachCandidate(F&& f) {
    forEachCandidateBatch(
        nullptr,
        [](void* function, const CollisionPair& pair, std::span<const ElementPair> batch) {
          (*static_cast<std::remove_reference_t<F>*>(function))(pair, batch);
        },
        const_cast<void*>(static_cast<const void*>(std::addressof(f))));
  }

  /// Searches of the positions now. Updates octrees where they are not of these positions; a
  /// LooseOctree that another thread reads at that time changes.
  ///
  /// Cost     nothing but the update, which the next detection then need not do.
  SpatialQueries queries() const;

  /// The answer of the last detectCollision(); (a, b) in the order in which the pair was added.
  /// Errors   NotAvailable before the first detection of the pair.
  const CollisionData& collisionData(GeometryId a, GeometryId b) const;
  /// Sorted by (a, b): every element pair whose boxes, inflated by half the pair's thickness and
  /// largest radii each, overlap; more only by outward rounding. (a, a): each unordered pair once,
  /// a < b, sharing no vertex. After detectCollision() only with Settings::keepCandidates.
  std::span<const ElementPair> candidatePairs(GeometryId a, GeometryId b) const;
  const LooseOctree& octree() const;  ///< as of the last update()
  /// Of the last detectCollision() or collectCandidates(), with the updates before it, or of an
  /// update() since. Queries do not change it.
  const FrameStatistics& statistics() const;
  const Settings& settings() const;
  /// With Settings::audit, where the last detectCollision() and brute force differ, as far as its
  /// sample of features shows: empty unless this library is at fault. Never an exception: a file
  /// that could not be written is said in its failures.
  std::span<const AuditFailure> auditFailures() const;
  /// What detectCollision() would be given now, copied out; straight after a frame, that frame's.
  CollisionProblem problem() const;

 private:
  using BatchFunction = void (*)(void*, const CollisionPair&, std::span<const ElementPair>);
  /// `only`: null: of every pair.
  void forEachCandidateBatch(const CollisionPair* only, BatchFunction, void* function);

  struct Implementation;
  const Implementation& read() const;  ///< throws InvalidCall
  std::unique_ptr<Implementation> m_implementation;
};

/// One call from two meshes to their contacts, over the same code; static methods only.
PALPATE_EXPORT CollisionData detectCollision(const TriangleMeshView& a, const TriangleMeshView& b,
                                             const PairSettings& = {});

}  // namespace palpate
