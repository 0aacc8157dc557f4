#pragma once

#include <palpate/Export.h>
#include <palpate/Executor.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>

namespace palpate {

/// How an octree follows its geometry to the positions now. Contacts do not depend on it.
enum class OctreeUpdate {
  Auto,    ///< keep the tree and refit its boxes while they stay tight, else rebuild the tree
  Rebuild  ///< rebuild the tree from sorted keys in every update
};
PALPATE_EXPORT const char* toString(OctreeUpdate) noexcept;  ///< its name, or "unknown"

/// By what the octree of a body that setTransform() places bounds its elements and nodes. Contacts
/// do not depend on it.
enum class OctreeBounds {
  Box,    ///< axis-aligned boxes in the body's frame
  Dop14,  ///< boxes cut along 4 further directions, the diagonals of a cube
  Dop18   ///< boxes cut along 6 further directions, the diagonals of a cube's faces
};
PALPATE_EXPORT const char* toString(OctreeBounds) noexcept;  ///< its name, or "unknown"

struct OctreeSettings {
  /// Deepest level, in [1, 60]; the root has level 0. The library does not split cells of this
  /// level.
  int maxDepth = 32;
  /// The library splits a cell that holds more elements, in [1, 1024]. A smaller number gives more
  /// nodes and tighter boxes.
  int maxElementsPerLeaf = 32;
  OctreeUpdate update = OctreeUpdate::Auto;
  /// A pair of two placed bodies uses the further directions if neither deforms in the step, and if
  /// both have them. Dop14 and Dop18 make the search faster where such bodies are near or touch.
  /// Cost     made once when a body's positions were set; 32 or 48 bytes an element, and 256 or 384
  ///          a block of eight nodes, which has 256 without them
  OctreeBounds bounds = OctreeBounds::Box;
};

/// How the library finds candidates. Both engines give the same contacts.
enum class Engine {
  Octree,     ///< pooled loose octrees
  BruteForce  ///< every element against every other: the reference for tests, and very slow
};
PALPATE_EXPORT const char* toString(Engine) noexcept;  ///< its name, or "unknown"

/// The audit: a check of the library by itself, in any build. After each detectCollision() it tests
/// a sample of features against the whole other geometry, without an octree.
struct AuditSettings {
  /// Number of features that the audit tests per pair and frame, at least 0; 0: no audit and no
  /// cost. Features are vertices and edges, or triangles for Intersection. The cost of each feature
  /// is a test against every triangle or edge of the other geometry.
  int features = 0;
  std::uint64_t seed = 0;  ///< the sample depends only on the seed, the frame number and the pair
  /// An existing folder. The audit writes a capture (<palpate/Capture.h>) into it for each pair and
  /// frame with failures, and never overwrites a file. Empty: the audit writes no files.
  std::filesystem::path folder{};
  int maxFiles = 100;  ///< most files over the life of an OctreeBasedCD, at least 0
};

/// Settings of an OctreeBasedCD, for its whole life. Its constructor throws InvalidSettings for a
/// value outside its range, and for an audit folder that does not exist.
struct Settings {
  OctreeSettings octree{};
  Engine engine = Engine::Octree;
  /// Number of threads of a frame, in [0, 1024]; 0: one per core, or the executor's concurrency. If
  /// the system refuses to start so many, the threads that started do the work. Results do not
  /// depend on it.
  int threads = 0;
  AuditSettings audit{};
  /// Number of last detections whose times OctreeBasedCD::writeTrace() writes, in [0, 10000]; 0:
  /// none, and no cost. Results do not depend on it. A capture does not contain it.
  int traceFrames = 0;
  /// Runs the work of a frame on at most `threads` of its threads. Several objects may share one
  /// executor. Null: the object makes its own thread pool. Results do not depend on it. A
  /// CollisionProblem and a capture do not contain it.
  std::shared_ptr<Executor> executor{};
  /// Bytes, at least 0; 0: no limit. Limits what the object allocates: geometries, octrees,
  /// candidates, results, scratch, and snapshots as long as somebody holds them
  /// (Docs/Memory.md says what does not count). A call that needs more throws MemoryLimit. It
  /// leaves the last answers readable and the object ready for the next frame. A CollisionProblem
  /// and a capture do not contain it.
  std::size_t memoryLimit = 0;
};

/// The definition of a contact. Docs/SupportMatrix.md lists the methods of each pair of geometry
/// types.
enum class Method {
  /// The library chooses among the other methods in each frame, from the motion in the step. It
  /// answers every pair that any method answers. Wherever Continuous answers the pair, Auto misses
  /// no impact within the step. It may miss one if radii are given per vertex, where it answers by
  /// Proximity. See <palpate/Validity.h>.
  Auto,
  /// Triangles that intersect at the step's end, decided exactly. Touching counts.
  Intersection,
  /// Features whose distance at the step's end is at most the thickness and their radii. It does
  /// not know sides: once features have crossed, at any speed, the normal is on the wrong side. Two
  /// meshes are trusted only if all features within the thickness are further apart than they
  /// moved.
  Proximity,
  /// Features whose distance is at most the thickness and their radii at some time of the step,
  /// with the time of impact: continuous collision detection (CCD).
  Continuous,
  /// Vertices, edges and triangles within the thickness and their radii of a body that has a
  /// DistanceField, at the step's end. The distances are the field's, within its error bound
  /// (CollisionData::errorBound()). The contacts are in CollisionData::shape(). Impacts within the
  /// step may be missing.
  DistanceField,
  /// Particles against a rigid body, for a point set and a triangle or tetrahedral mesh in this
  /// order. In the leaves of an octree of the body, planes stand for its surface where their error
  /// is proven to be at most PairSettings::allowedError; elsewhere triangles answer. A particle
  /// whose distance at the step's end is at most the thickness and its radius is a ShapeContact,
  /// up to CollisionData::errorBound().
  /// Around a closed mesh distances have a sign, and particles up to Validity::proxyDepth behind
  /// the surface are contacts, too.
  /// Cost     the leaves are built once for the body's topology and the pair's settings, by the
  ///          first detection: some seconds of processor time for 500,000 triangles. A frame
  ///          makes no octree of the particles.
  /// Errors   detectCollision() throws UnsupportedMethod if the body's positions change after the
  ///          leaves were built. setTransform() moves the body, setTriangles() builds new leaves.
  /// Source   octree proxies: Fan et al. (2013). The proof of the error: Docs/SurfaceProxies.md.
  Proxy
};
PALPATE_EXPORT const char* toString(Method) noexcept;  ///< its name, or "unknown"

/// Which of several contacts at the same features the library reports.
enum class Contacts {
  /// One contact for each pair of closest features. A feature is a vertex, an edge or the interior
  /// of a triangle. Proximity reports the features that hold the smallest distance. Continuous, and
  /// the impacts of Auto, report the earliest of all impacts between the same two features. Among
  /// equally early impacts the first in the order vertexTriangle(), triangleVertex(), edgeEdge()
  /// remains. A dropped contact is therefore never the first impact of its features. Every vertex
  /// with a weight other than 0 keeps its earliest time, and earliestTimeOfImpact() is that of All.
  /// Docs/SupportMatrix.md has the reasons.
  ///
  /// Except: shapes, lines and points have no contacts with inner edges and vertices of flat parts
  /// of a mesh. Their normals would be tilted (Docs/Shapes.md, "Edges of flat floors").
  Distinct,
  All  ///< every feature pair that the method's definition includes
};
PALPATE_EXPORT const char* toString(Contacts) noexcept;  ///< its name, or "unknown"

/// What only Continuous uses, and Auto for impacts.
struct ContinuousSettings {
  /// Fraction of the step, in [2^-50, 1]. A reported time of impact is never late, and early by at
  /// most this. With a thickness, Continuous and Auto also report features that only come within
  /// the thickness and this fraction of their relative motion. Without a thickness the set of
  /// contacts does not depend on it. Proximity and Intersection test one time only and do not use
  /// it.
  double timeTolerance = 1e-6;
  /// Only Continuous accepts true. The pair then reports no contacts, only
  /// CollisionData::earliestTimeOfImpact(), which is that of all contacts. This is much cheaper.
  /// `contacts` has no effect then.
  bool earliestTimeOnly = false;
};

/// What only Auto uses.
struct AutoSettings {
  /// L, to 1e300. Only Auto accepts a value that is not negative. Negative: half the thickness. It
  /// has an effect for two triangle or tetrahedral meshes with Distinct and a positive thickness.
  /// Auto tests features that move at most this far, relative to each other, at the step's end. The
  /// thickness is up to this much larger there. Auto tests other features for impacts. A larger
  /// value is faster and gives more contacts of features that are further apart. For all geometries
  /// it also limits the motion with which an attached DistanceField or proxy answers.
  double motionTolerance = -1.0;
};

/// What only Proxy uses.
struct LeafSettings {
  /// rad, in (0, 1.5]. Proxy: the largest angle between the normal of a leaf's plane and those of
  /// the triangles that the plane stands for. Other leaves are divided or answered by triangles.
  double widestNormalCone = 0.25;
};

/// How one pair is tested. Docs/SupportMatrix.md lists which methods use which settings. A setting
/// that a method refuses, or a value outside its range, throws InvalidSettings.
struct PairSettings {
  Method method = Method::Auto;
  /// L, 0 to kLargestMeasure. The contact distance, which IPC users know as d-hat: features at most
  /// this far apart are contacts. Radii of lines and points add to it. Proximity needs a positive
  /// thickness, or radii, or an analytical shape. The contacts of Intersection do not depend on it.
  double thickness = 0.0;
  /// Intersection reports all contacts in either case.
  Contacts contacts = Contacts::Distinct;
  /// L, 0 to kLargestMeasure. Only a triangle, tetrahedral or line mesh with itself accepts a value
  /// other than 0. Features that are nearer to each other than this along the mesh's edges are no
  /// contacts. These distances are measured once, at the positions with which the mesh was added or
  /// its topology was set. More than 2^28 pairs of vertices that are so near throw TooLarge. 0:
  /// only features with a common vertex are no contacts.
  double restDistance = 0.0;
  /// L, 0 to kLargestMeasure. What an answer may be off by. Proxy needs a positive value: a larger
  /// one gives fewer and larger leaves, and fewer that triangles answer. Auto answers by an
  /// attached DistanceField or by the leaves of attachSurfaceProxy() if their error bound is at
  /// most this, but only where they prove that nothing touches in the step. Other methods accept 0
  /// only.
  double allowedError = 0.0;
  /// L, 0 to kLargestMeasure. Positive: detectCollision() also finds OctreeBasedCD::freeMotion()
  /// for the pair. Features that are further apart than their distance of contact and this limit a
  /// vertex to half of this. A larger value costs more. A distance field that is a geometry accepts
  /// only 0.
  double freeMotionReach = 0.0;
  ContinuousSettings continuous{};
  AutoSettings automatic{};
  LeafSettings proxy{};
};

/// The leaves that OctreeBasedCD::attachSurfaceProxy() builds for a rigid body.
struct SurfaceProxySettings {
  /// L, positive. The distance from the surface to which the leaves answer. At least the thickness
  /// and the largest radius of the particles. A particle that is further away and moves further
  /// than the difference is tested by exact methods.
  double reach = 0.0;
  /// L, positive. The largest proven error of a leaf's plane. A larger one gives fewer and larger
  /// leaves.
  double errorBound = 0.0;
  /// rad, in (0, 1.5]. As LeafSettings::widestNormalCone.
  double widestNormalCone = 0.25;
  friend bool operator==(const SurfaceProxySettings&, const SurfaceProxySettings&) = default;
};

/// From which sides other geometries can touch a triangle mesh.
enum class Sidedness {
  Both,
  /// Only from the side to which the winding normals point. The direction of a contact leads from
  /// the feature of this mesh that holds the closest point to the other closest point. If it points
  /// inward there, the contact is dropped. Contacts of Intersection, and contacts with analytical
  /// shapes, are never dropped.
  Outer
};
PALPATE_EXPORT const char* toString(Sidedness) noexcept;  ///< its name, or "unknown"

/// Which pairs a geometry takes part in, and from which sides.
struct CollisionFilter {
  std::uint32_t groups = 1;  ///< bits: the groups that the geometry belongs to
  /// bits: the groups that the geometry collides with. Two geometries collide only if the mask of
  /// each contains a group of the other.
  std::uint32_t mask = 0xffffffff;
  Sidedness sidedness = Sidedness::Both;  ///< Outer: triangle and tetrahedral meshes only
  friend bool operator==(const CollisionFilter&, const CollisionFilter&) = default;
};

/// Two features that may become a contact. `a` belongs to the pair's first geometry, `b` to the
/// second.
struct ContactFeatures {
  enum class Kind { VertexTriangle, TriangleVertex, EdgeEdge } kind;
  /// The index of a vertex or triangle, twice; or the two vertices of an edge, lower first.
  std::array<std::uint32_t, 2> a, b;
};
PALPATE_EXPORT const char* toString(ContactFeatures::Kind) noexcept;  ///< its name, or "unknown"

/// Returns whether two features may be a contact. The library calls it only for features that are
/// near enough, once or several times each. A call does not mean that the features are a contact.
/// Needs    within one frame it must always return the same for the same features.
/// Threads  several threads call it at once, in any order.
/// Errors   an exception ends the frame, and detectCollision() throws it.
using ContactPredicate = std::function<bool(const ContactFeatures&)>;

}  // namespace palpate
