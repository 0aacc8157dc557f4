#pragma once

#include <palpate/Executor.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>

namespace palpate {

/// How `update()` brings an octree to the positions now.
enum class OctreeUpdate {
  Auto,    ///< keep the tree and refit its boxes while that stays tight, else rebuild
  Rebuild  ///< always rebuild from sorted keys
};

struct OctreeSettings {
  int maxDepth = 32;  ///< deepest level, root = 0. [1, 60]. Cells too full at this level stay so.
  /// a cell with more is split. [1, 1024]. Fewer: more nodes, tighter boxes.
  int maxElementsPerLeaf = 32;
  OctreeUpdate update = OctreeUpdate::Auto;  ///< contacts do not depend on it
};

enum class Engine {
  Octree,     ///< pooled loose octrees
  BruteForce  ///< every triangle against every other: the oracle, behind the same calls
};

/// A check of the library by itself, in any build: after each detectCollision() a sample of
/// features is tested against all of the other mesh, with no octree.
struct AuditSettings {
  /// Features tested per pair and frame: vertices and edges, or triangles for Intersection. At
  /// least 0; 0: no audit, at no cost. Each costs a test against every triangle or edge.
  int features = 0;
  std::uint64_t seed = 0;  ///< same seed, frame number and pair: same sample
  /// Where to keep a file (see <palpate/Capture.h>) for each pair and frame with failures: a folder
  /// that is there. Empty: none are kept. Files that are there stay as they are.
  std::filesystem::path folder{};
  int mostFiles = 100;  ///< over the life of an OctreeBasedCD, at least 0
};

struct Settings {
  OctreeSettings octree{};
  Engine engine = Engine::Octree;
  /// Threads of a frame, in [0, 1024]; 0: one for each core, or the executor's concurrency. Results
  /// do not depend on it. Where the system refuses to start so many, those that it started do the
  /// work.
  int threads = 0;
  /// detectCollision() also fills candidatePairs(); costs their memory and a sort
  bool keepCandidates = false;
  AuditSettings audit{};
  /// Runs the work of a frame, on at most `threads` of its threads; several objects may share one.
  /// Null: a pool of the object's own. Results do not depend on it. It is no part of a
  /// CollisionProblem or a capture.
  std::shared_ptr<Executor> executor{};
};

enum class Method { Auto, Intersection, Proximity, Continuous };

enum class Contacts {
  /// One per pair of closest features. Proximity: where the distance is smallest. Continuous, and
  /// impacts of Auto: of all impacts between the same two features (vertex, edge or interior of a
  /// triangle, by the weights other than 0) the earliest; of equally early ones the first in
  /// vertexTriangle(), triangleVertex(), edgeEdge(). So a dropped contact is never the first impact
  /// of its features, every vertex with a weight other than 0 keeps its earliest time, and
  /// earliestTimeOfImpact() is that of All. Docs/Pairs.md has the reasons.
  Distinct,
  All  ///< every pair that the method's definition includes
};

struct PairSettings {
  /// Auto: per frame Proximity, Continuous, or each for the features it suits. It answers every
  /// pair that any method answers, and misses no impact within the step of any pair that Continuous
  /// answers. See <palpate/Validity.h>.
  Method method = Method::Auto;
  /// L, finite, not negative. Proximity needs it positive, or radii. Intersection's contacts do not
  /// depend on it.
  double thickness = 0.0;
  /// Intersection reports all.
  Contacts contacts = Contacts::Distinct;
  /// L. For Auto only: any other method refuses it unless it is negative. Two triangle or
  /// tetrahedral meshes, Distinct with a thickness: features that move at most this far, relative
  /// to each other, are tested at the step's end, with up to this added to the thickness; others
  /// for impacts. Larger: faster, more contacts that are further apart. Negative: half the
  /// thickness.
  double motionTolerance = -1.0;
  /// L, finite, not negative. A triangle or line mesh with itself: features that are nearer than
  /// this along its edges, in the shape that it was added in or that setTriangles() gave, are no
  /// contacts. 0: only features with a common vertex.
  double restDistance = 0.0;
  /// Of the step, in [2^-50, 1]: reported times of impact are at most this early, never late. With
  /// a thickness features are reported, too, that come within it and this part of their motion;
  /// without, the same ones whatever this is. No effect on Proximity and Intersection, which look
  /// at one time.
  double timeTolerance = 1e-6;
  /// Method::Continuous only: no contacts, only CollisionData::earliestTimeOfImpact(), which is
  /// that of all contacts; much cheaper. `contacts` has no effect then.
  bool earliestTimeOnly = false;
};

/// From where a triangle mesh is touched.
enum class Sidedness {
  Both,
  /// Only from where its triangles' winding normals point. A contact whose direction, from the
  /// feature of this mesh that holds the closest point, points inward is none. Intersection's
  /// contacts are on surfaces that cross: none of them points inward.
  Outer
};

/// What of a geometry takes part in its pairs.
struct CollisionFilter {
  std::uint32_t groups = 1;  ///< bits: the groups that it is in
  std::uint32_t mask =
      0xffffffff;  ///< bits: the groups that it meets. Both must ask for each other
  Sidedness sidedness = Sidedness::Both;  ///< Outer: of triangle meshes only
  friend bool operator==(const CollisionFilter&, const CollisionFilter&) = default;
};

/// Two features that are about to be a contact, of the pair's first and second geometry.
struct ContactFeatures {
  enum class Kind { VertexTriangle, TriangleVertex, EdgeEdge } kind;
  /// a vertex or a triangle (twice the same number), or an edge's vertices, lower first
  std::array<std::uint32_t, 2> a, b;
};

/// Whether two features may be a contact. Called by several threads at once, in any order, only for
/// features near enough; must answer the same each time in a frame. An exception ends the
/// frame, which throws it.
using ContactPredicate = std::function<bool(const ContactFeatures&)>;

}  // namespace palpate
