#pragma once

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace palpate {

// iMSTK's headers are compiled as C++17, Palpate's as C++20. This header is both's: an
// OctreeBasedCD and a StepGuard behind plain types. Errors are those of OctreeBasedCD, thrown as
// std::exception.

/// Vertices of a contact that particles move, rigid bodies move as a whole, and none moves.
enum class BodyRole { Particles, Rigid, Fixed };

struct ShapeMeasures {
  /// A plane is the half-space below y = 0.
  enum class Kind { Sphere, Capsule, Cylinder, Box, Plane } kind;
  double radius = 0.0;
  double length = 0.0;                                    ///< along y
  Eigen::Vector3d halfExtents = Eigen::Vector3d::Zero();  ///< of a box
};

struct MeshArrays {
  const Eigen::Vector3d* positions;  ///< in the world, or of a rigid body in its frame
  std::size_t vertices;
  const int* cells;  ///< none of points
  std::size_t cellCount;
  int verticesPerCell;  ///< 1: points, 2: lines, 3: triangles, 4: tetrahedra
};

struct BodyPose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  friend bool operator==(const BodyPose& a, const BodyPose& b) {
    return a.rotation == b.rotation && a.translation == b.translation;
  }
};

/// gap = normal . (sum of weights times positions) - offset: without contact while positive.
struct StepRow {
  struct Term {
    int body;
    int vertex;  ///< -1: a point of a rigid body
    double weight;
    Eigen::Vector3d local;  ///< that point in the body's frame
  };
  std::array<Term, 4> terms;
  int termCount = 0;
  Eigen::Vector3d normal;
  double offset;  ///< with bodies that no row moves
  /// Weighted, of those bodies in the step, as the program moved them: without what held them.
  Eigen::Vector3d fixedDisplacement;
};

/// One side of an element of iMSTK: ids of vertices, or a point.
struct StepElement {
  int idCount;  ///< 0: a point, 1: a vertex, 2: an edge, 3: a triangle
  std::array<int, 3> ids;
  Eigen::Vector3d point, direction;
  double depth;
};

class CollisionStep {
 public:
  enum class Method { Auto, Intersection, Proximity, Continuous };
  struct Pair {
    Method method;
    double thickness, restDistance;
    bool guarded;
    bool all;  ///< every pair of features is a contact, not the closest ones alone
  };

  explicit CollisionStep(int threads);
  ~CollisionStep();

  /// Both begin the step where they end it. The body of a mesh with a pose is in its frame.
  int addMesh(BodyRole, const MeshArrays&, double radius, const BodyPose&, const std::string& name);
  int addShape(BodyRole, const ShapeMeasures&, const BodyPose&, const std::string& name);
  /// Replaces cells and positions.
  void replaceMesh(int body, const MeshArrays&);
  int addPair(int a, int b, const Pair&);
  void setGuarded(int pair, bool);

  /// Positions in the world of a mesh that is not rigid.
  void setPositions(int body, const Eigen::Vector3d* before, const Eigen::Vector3d* now,
                    std::size_t vertices);
  void setPose(int body, const BodyPose& before, const BodyPose& now);
  /// At the step's start and end. Valid until the next call that is not const.
  const std::vector<Eigen::Vector3d>& before(int body) const;
  const std::vector<Eigen::Vector3d>& now(int body) const;
  const BodyPose& poseBefore(int body) const;
  const BodyPose& poseNow(int body) const;

  void detect();
  bool trusted() const;
  /// Whether the bodies of a pair may have touched or crossed when the detected step began.
  bool mayCross(int pair) const;
  /// Whether surfaces pierce each other, or a shape overlaps by more than the guard's slack; of a
  /// pair that `was` crossed, whether it is still not apart by that. At rest: after advance().
  bool isCrossed(int pair, bool was);
  void appendRows(int pair, std::vector<StepRow>& rows) const;
  void appendElements(int pair, std::vector<StepElement>& a, std::vector<StepElement>& b) const;
  /// Shortens the step; returns how many vertices and bodies. Pairs that touched when the step
  /// began, as the lips of a cut do, are not guarded from then on, and appended to leftOut.
  std::size_t hold(std::vector<int>& leftOut);
  void stay(int body);      ///< a placed body ends the step where it began it
  void restoreFixedEnds();  ///< undoes hold() for bodies that nothing but the program moves
  void advance();

 private:
  struct Implementation;
  std::unique_ptr<Implementation> m_implementation;
};

}  // namespace palpate
