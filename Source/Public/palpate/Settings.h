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

/// How an octree follows its geometry. Contacts do not depend on it.
enum class OctreeUpdate {
  Auto,    ///< keep the tree and refit its boxes while they stay tight, else rebuild the tree
  Rebuild  ///< rebuild the tree from sorted keys in every update
};
PALPATE_EXPORT const char* toString(OctreeUpdate) noexcept;  ///< its name, or "unknown"

/// By what octrees of placed bodies bound elements and nodes. Contacts do not depend on it.
enum class OctreeBounds {
  Box,    ///< axis-aligned boxes in the body's frame
  Dop14,  ///< boxes cut along 4 further directions, the diagonals of a cube
  Dop18   ///< boxes cut along 6 further directions, the diagonals of a cube's faces
};
PALPATE_EXPORT const char* toString(OctreeBounds) noexcept;  ///< its name, or "unknown"

struct OctreeSettings {
  int maxDepth = 32;            ///< deepest level, in [1, 60]; the root has level 0
  int maxElementsPerLeaf = 32;  ///< in [1, 1024]; cells with more elements are split
  OctreeUpdate update = OctreeUpdate::Auto;
  OctreeBounds bounds = OctreeBounds::Box;  ///< for pairs of two bodies that do not deform
  /// Slow meshes keep candidates of Proximity for later detections, where that costs less than to
  /// search them again. Contacts do not depend on it.
  bool keepsPairs = true;
};

/// How candidates are found. Contacts do not depend on it.
enum class Engine {
  Octree,     ///< pooled loose octrees
  BruteForce  ///< every element against every other: the reference for tests, and very slow
};
PALPATE_EXPORT const char* toString(Engine) noexcept;  ///< its name, or "unknown"

/// After each detection, features of a sample are tested against the whole other geometry.
struct AuditSettings {
  int features = 0;        ///< number per pair and frame; 0: no audit
  std::uint64_t seed = 0;  ///< the sample depends only on the seed, the frame number and the pair
  /// An existing folder for a capture of each failing pair and frame. No file is overwritten.
  std::filesystem::path folder{};
  int maxFiles = 100;  ///< most files over the life of an OctreeBasedCD, at least 0
};

/// Of an OctreeBasedCD for its life. A value out of range throws InvalidSettings. Results do not
/// depend on threads, trace and executor; captures hold none of trace, executor, memory limit.
struct Settings {
  OctreeSettings octree{};
  Engine engine = Engine::Octree;
  /// In [0, 1024]; 0: one per core, or the executor's concurrency. The system may refuse some.
  int threads = 0;
  AuditSettings audit{};
  /// Number of detections that OctreeBasedCD::writeTrace() writes, in [0, 10000]; 0: no cost.
  int traceFrames = 0;
  /// Runs the work on at most `threads` threads. Objects may share it. Null: an own thread pool.
  std::shared_ptr<Executor> executor{};
  /// Bytes that the object may allocate (Docs/Memory.md); more throws MemoryLimit. 0: no limit.
  std::size_t memoryLimit = 0;
};

/// The definition of a contact. Docs/SupportMatrix.md lists the methods of each pair of types.
enum class Method {
  /// Chosen in each frame from the others, for all pairs that any method answers. No impact is
  /// missing where Continuous answers the types and radii.
  Auto,
  Intersection,  ///< triangles that intersect at the step's end, exact; touching counts
  /// Features at most the thickness and their radii apart at the step's end. After a crossing,
  /// normals are on the wrong side.
  Proximity,
  /// Features at most the thickness and their radii apart at some time of the step (CCD).
  Continuous,
  /// Elements within the thickness and their radii of a body with a DistanceField, at the step's
  /// end, in CollisionData::shape(). Distances are within errorBound(). Impacts may be missing.
  DistanceField,
  /// A point set, first, with a rigid triangle or tetrahedral mesh, in CollisionData::shape():
  /// particles at most the thickness and radius away at the step's end, within errorBound(). Around
  /// closed meshes distances have a sign, down to Validity::proxyDepth.
  /// Cost     of the first detection after setTriangles() or new settings: seconds for 500,000
  ///          triangles.
  /// Errors   UnsupportedMethod if the body's positions changed, TooLarge for too many leaves.
  /// Source   octree proxies: Fan et al. (2013). The proof of the error: Docs/SurfaceProxies.md.
  Proxy
};
PALPATE_EXPORT const char* toString(Method) noexcept;  ///< its name, or "unknown"

enum class Contacts {
  /// One per pair of closest features: vertices, edges, triangles' interiors. Proximity: those that
  /// hold the smallest distance. Impacts: the earliest; every vertex with weight keeps its earliest
  /// time. Docs/SupportMatrix.md has the rules.
  Distinct,
  All  ///< every feature pair that the method's definition includes
};
PALPATE_EXPORT const char* toString(Contacts) noexcept;  ///< its name, or "unknown"

/// What only Continuous uses, and Auto for impacts.
struct ContinuousSettings {
  /// Fraction of the step, in [2^-50, 1]. A time of impact is never late, and early by at most
  /// this. With a thickness, what comes within it and this fraction of the motion may be reported.
  double timeTolerance = 1e-6;
  /// Of Continuous alone: no contacts, only CollisionData::earliestTimeOfImpact().
  bool earliestTimeOnly = false;
};

struct AutoSettings {
  /// L, to 1e300; negative: half the thickness. Other methods accept negative only. Features of two
  /// meshes that move at most this are tested at the step's end, with a thickness up to this
  /// larger. It also limits the motion with which an attached field or proxy answers.
  double motionTolerance = -1.0;
};

/// What only Proxy uses.
struct LeafSettings {
  /// rad, in (0, 1.5]: the largest angle between the normals of a leaf's plane and triangles.
  double widestNormalCone = 0.25;
};

/// How one pair is tested. A value out of range, or refused by the method, throws InvalidSettings.
/// Lengths are in L, from 0 to kLargestMeasure. See Docs/SupportMatrix.md.
struct PairSettings {
  Method method = Method::Auto;
  /// Features at most this far apart, plus radii, are contacts (d-hat of IPC). Proximity needs a
  /// positive value, radii or a shape. The contacts of Intersection do not depend on it.
  double thickness = 0.0;
  Contacts contacts = Contacts::Distinct;  ///< Intersection reports all
  /// For a mesh or lines with themselves, else 0: features nearer than this along edges, at rest,
  /// are no contacts. Over 2^28 pairs of vertices: TooLarge.
  double restDistance = 0.0;
  /// What distances may be off by. Proxy needs a positive value, Auto uses an attached field or
  /// proxy within it where nothing touches in the step. Others accept 0.
  double allowedError = 0.0;
  /// Positive: detections find OctreeBasedCD::freeMotion(), at most half of this, at growing cost.
  /// A distance field that is a geometry accepts only 0.
  double freeMotionReach = 0.0;
  /// Contacts have an identity from step to step: CollisionData::trackedVertexTriangle() and so on.
  bool trackContacts = false;
  /// Of meshes, lines and points by Auto or Continuous: CollisionData::crossings(). Auto then
  /// chooses Continuous for every step that moves the pair.
  bool reportCrossings = false;
  /// With a triangle or tetrahedral mesh: CollisionData::smoothVertexTriangle() and so on.
  bool smoothNormals = false;
  /// By the same methods: features that passed through each other in an earlier step have contacts
  /// that lead back, until they have returned. advance() then detects crossings up to positions
  /// that were set after the last detection.
  bool rememberSides = false;
  ContinuousSettings continuous{};
  AutoSettings automatic{};
  LeafSettings proxy{};
  /// detectCollision() with a budget begins with the pairs of the highest priority. Any number.
  int priority = 0;
};

/// Leaves of OctreeBasedCD::attachSurfaceProxy().
struct SurfaceProxySettings {
  /// L, positive, at least the thickness and largest radius: leaves answer up to it. Particles
  /// further away that move by more than the difference are tested exactly.
  double reach = 0.0;
  double errorBound = 0.0;         ///< L, positive: the largest proven error of a leaf's plane
  double widestNormalCone = 0.25;  ///< rad, in (0, 1.5], as LeafSettings
  friend bool operator==(const SurfaceProxySettings&, const SurfaceProxySettings&) = default;
};

/// From which sides other geometries can touch a triangle mesh.
enum class Sidedness {
  Both,
  /// The side of winding normals. A contact that leads inward from the closest feature of this mesh
  /// is dropped, but none of Intersection or with shapes.
  Outer
};
PALPATE_EXPORT const char* toString(Sidedness) noexcept;  ///< its name, or "unknown"

/// Two geometries collide only if the mask of each contains a group of the other.
struct CollisionFilter {
  std::uint32_t groups = 1;               ///< bits: the groups that the geometry belongs to
  std::uint32_t mask = 0xffffffff;        ///< bits: the groups that the geometry collides with
  Sidedness sidedness = Sidedness::Both;  ///< Outer: triangle and tetrahedral meshes only
  friend bool operator==(const CollisionFilter&, const CollisionFilter&) = default;
};

/// Features that may become a contact: `a` of the pair's first geometry, `b` of the second.
struct ContactFeatures {
  enum class Kind { VertexTriangle, TriangleVertex, EdgeEdge } kind;
  /// The index of a vertex or triangle, twice; or the two vertices of an edge, lower first.
  std::array<std::uint32_t, 2> a, b;
  std::uint32_t tagA = 0, tagB = 0;  ///< as CollisionData::tags()
};
PALPATE_EXPORT const char* toString(ContactFeatures::Kind) noexcept;  ///< its name, or "unknown"

/// Whether two features that are near enough may be a contact: the same each time in a frame.
/// Several threads call it at once, in any order. detectCollision() throws its exception.
using ContactPredicate = std::function<bool(const ContactFeatures&)>;

}  // namespace palpate
