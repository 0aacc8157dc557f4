#pragma once

#include "Meshes.h"
#include "Xpbd.h"

#include <palpate/OctreeBasedCD.h>
#include <palpate/StepGuard.h>

#include <functional>
#include <string>
#include <vector>

namespace palpate::scenes {

/// Bodies that one solver moves and one OctreeBasedCD tests for contacts. A step of a scene's loop:
///
///   world.predict(seconds, {});      // where velocities lead
///   ...                              // tools go where hands lead: positions(tool), place(tool)
///   for (int round = 0; round < rounds; ++round) {
///     world.detect();                // before and now, contacts as rows
///     world.solve(iterations);       // corrects now
///   }
///   world.hold();                    // what would still pass through stops before
///   world.commit();                  // ends the step
class World {
 public:
  using BodyId = std::size_t;

  struct Body {
    std::string name;
    GeometryId id;
    GeometryType type;
    std::uint32_t first, count;       ///< its particles; a shape has none
    std::vector<Triangle> triangles;  ///< removed ones are {0, 0, 0}
    std::vector<Segment> segments;
    double radius;    ///< of lines and points
    SceneMesh drawn;  ///< of a shape, in its own frame
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Eigen::Vector3d translation = Eigen::Vector3d::Zero();
    std::vector<Eigen::Vector3d> rest{};  ///< of a mesh that place() moves, in its own frame
  };

  /// Milliseconds since resetTimes().
  struct Times {
    double boxes = 0, octree = 0, pairs = 0, narrowPhase = 0, order = 0;
    double collision = 0;  ///< wall clock from setPositions() to contacts, and to rows of detect()
    double hold = 0, solver = 0, cut = 0;
    std::size_t contacts = 0;  ///< of the last detection
    std::size_t held = 0;      ///< particles
  };

  explicit World(int threads) : m_detection(Settings{.threads = threads}), m_guard(m_detection) {}

  BodyId addMesh(std::string name, const SceneMesh& mesh, double inverseMass);
  /// Rigid: place() moves it, its octree stays as it is.
  BodyId addRigidMesh(std::string name, const SceneMesh& mesh);
  /// A polyline.
  BodyId addThread(std::string name, std::span<const Eigen::Vector3d> positions, double radius,
                   double inverseMass);
  /// Particles: blood, debris.
  BodyId addPoints(std::string name, std::span<const Eigen::Vector3d> positions, double radius,
                   double inverseMass);
  BodyId addShape(std::string name, const AnalyticalGeometry&, SceneMesh drawn);
  /// Tetrahedra, which collide by their surface.
  BodyId addSolid(std::string name, std::span<const Eigen::Vector3d> positions,
                  std::span<const Tetrahedron> tetrahedra, double inverseMass);
  /// Keeps distances along each edge of a mesh and across it between the opposite corners. For a
  /// thread: distances along each segment, and each vertex in the middle of its neighbours.
  void addStiffness(BodyId, double edgeCompliance, double bendingCompliance);
  void addVolume(BodyId, double compliance);
  /// Particles inside a body, which keep their distances to each other and to its surface; pinned
  /// ones stay at their places.
  void addInside(BodyId, double kilograms, const std::function<bool(const Eigen::Vector3d&)>& isIn,
                 const std::function<bool(const Eigen::Vector3d&)>& isPinned);
  /// Vertices for which this holds stay at their places, or are moved by hand.
  void pin(BodyId, const std::function<bool(const Eigen::Vector3d&)>&);
  /// The first vertices of a body make one fraction of their steps in hold().
  void addRigid(BodyId, std::uint32_t count);

  /// gap: L, the distance that the solver keeps.
  void addPair(BodyId a, BodyId b, const PairSettings&, double gap);
  /// The bodies of this pair never pass through each other: hold() prevents it.
  void addGuard(BodyId a, BodyId b);
  /// Disables these triangles, as where something pierced them. All others are enabled.
  void disable(BodyId, std::span<const std::uint32_t> triangles);
  /// OctreeBasedCD::replaceTetrahedra(), before predict(). Only for the body that was added last.
  std::vector<std::uint32_t> cut(BodyId, std::span<const std::uint32_t> removed,
                                 std::span<const Tetrahedron> added,
                                 std::span<const Eigen::Vector3d> newPositions,
                                 std::span<const Eigen::Vector3d> rest, double inverseMass);
  /// Places a shape or a rigid mesh.
  void place(BodyId, const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation);

  void predict(double seconds, const Eigen::Vector3d& acceleration, double damping);
  void detect();
  void detectOnly();  ///< contacts without rows, where nothing responds
  void solve(int iterations);
  void hold();  ///< StepGuard::hold() of all guarded bodies
  void commit();

  std::span<Eigen::Vector3d> positions(BodyId);  ///< now
  std::span<const Eigen::Vector3d> before(BodyId) const;
  /// The fraction of its step that the last hold() let a vertex make.
  double fraction(BodyId, std::uint32_t vertex) const;
  /// Forces on a body in the last step, along the normals of its contacts.
  Eigen::Vector3d force(BodyId) const;
  /// Whether these meshes intersect now, decided exactly and apart from the pairs.
  bool intersect(BodyId a, BodyId b);

  const std::vector<Body>& bodies() const { return m_bodies; }
  const CollisionData& contacts(BodyId a, BodyId b) const {
    return m_detection.collisionData(m_bodies[a].id, m_bodies[b].id);
  }
  Xpbd& solver() { return m_solver; }
  OctreeBasedCD& detection() { return m_detection; }
  const Times& times() const { return m_times; }
  void resetTimes() { m_times = {}; }

  struct Pair {
    BodyId a, b;
    double gap;
  };
  const std::vector<Pair>& pairs() const { return m_pairs; }

 private:
  BodyId add(Body, std::span<const Eigen::Vector3d> positions, double inverseMass);
  SolverVertices vertices(BodyId) const;
  void passPositions();  ///< of all bodies that deform, to the detection

  Xpbd m_solver;
  OctreeBasedCD m_detection;
  StepGuard m_guard;
  std::vector<Body> m_bodies;
  std::vector<Pair> m_pairs;
  std::vector<ConstraintRow> m_rows;
  std::vector<std::size_t> m_rowPairs;
  std::vector<Eigen::Vector3d> m_forces;  ///< by body
  double m_seconds = 0;
  bool m_hasStarted = false;  ///< predict() was called
  Times m_times;
};

}  // namespace palpate::scenes
