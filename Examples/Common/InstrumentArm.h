#pragma once

#include "Meshes.h"

#include <palpate/AnalyticalGeometry.h>

#include <Eigen/Geometry>

#include <array>
#include <string>

namespace palpate::scenes {

/// A surgical instrument's arm of rigid links: a shaft through its port, an elbow, a wrist and two
/// jaws; lengths in mm.
class InstrumentArm {
 public:
  static constexpr int kLinks = 5;
  /// Yaw and pitch about the port, depth, elbow, wrist, opening of the jaws. All in radians but the
  /// depth.
  using Joints = Eigen::Matrix<double, 6, 1>;

  struct Link {
    std::string name;
    AnalyticalGeometry shape;
    SceneMesh drawn;  ///< closed, its vertices on the shape's surface
  };
  static std::array<Link, kLinks> makeLinks();
  /// Whether these two links meet at a joint.
  static bool areJoined(int a, int b);

  /// port: z points into the body.
  InstrumentArm(const Eigen::Isometry3d& port, const Joints& joints) : m_port(port) {
    bend(joints);
  }
  void bend(const Joints&);
  const Joints& joints() const { return m_joints; }
  const Eigen::Isometry3d& link(int link) const { return m_links[link]; }
  /// The motion of a link's point along a direction, in mm for each joint's unit.
  Joints slope(int link, const Eigen::Vector3d& point, const Eigen::Vector3d& direction) const;
  /// mm: the largest motion of the arm's points for each joint's unit.
  static Joints reach() { return (Joints() << 100, 100, 1, 50, 28, 15).finished(); }

 private:
  struct Axis {
    Eigen::Vector3d direction, through;
    bool slides;
  };
  Eigen::Isometry3d m_port;
  Joints m_joints;
  std::array<Eigen::Isometry3d, kLinks> m_links;
  std::array<Axis, 6> m_axes;
};

}  // namespace palpate::scenes
