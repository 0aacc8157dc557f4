#pragma once

#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>

#include <array>
#include <memory>
#include <vector>

namespace palpate::scenes {

struct ToolPose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< L
};

/// The surface between the steps of the simulation: each step is played as a motion from its start
/// to its end. The surface then moves without jumps, and stays behind the simulation by `delay`.
class SurfacePlayer {
 public:
  /// delay, step: s; `step` is that of the simulation.
  SurfacePlayer(double delay, double step) : m_delay(delay), m_step(step) {}

  /// Plays on towards `time - delay`, at most at twice the speed. Stops where the latest snapshot
  /// ends. Returns whether there is a snapshot.
  bool advance(std::shared_ptr<const Snapshot> latest, double time, double tick);
  const Snapshot& snapshot() const { return *m_held[0]; }
  double share() const { return m_share; }  ///< of the step that was played: 0 at its start
  double played() const { return m_played / m_step; }  ///< share of a step, by advance()

 private:
  double m_delay, m_step, m_time = 0, m_share = 1, m_played = 0;
  std::array<std::shared_ptr<const Snapshot>, 8> m_held;  ///< the one that is played, later ones
  std::size_t m_count = 0;
};

/// A blade whose proxy stays outside an organ while the device is inside: a god object with six
/// degrees of freedom. A spring between both gives force and torque.
///
/// In each tick the proxy moves towards the device, as far as the contacts allow: the motion with
/// the least distance to the wanted one, in the norm sqrt(v² + (lever w)²), that brings no contact
/// nearer than the skin.
///
/// Source   Ortega, Redon, Coquillart, A six degree-of-freedom god-object method for haptic display
///          of rigid bodies with surface properties (2007). Difference: the constraints are those
///          of all near features, solved by projected Gauss-Seidel.
class VirtualTool {
 public:
  struct Answer {
    Eigen::Vector3d force = Eigen::Vector3d::Zero(), torque = Eigen::Vector3d::Zero();
    std::size_t contacts = 0;
    double distance = kInfinity;  ///< L: of the proxy from the surface, before it moved
    double motion = 0;            ///< L: bounds how far any point of the device's tool moved
  };

  explicit VirtualTool(GeometryId organ);
  /// The proxy starts at the device.
  void start(const ToolPose& device) { m_proxy = m_device = device; }
  /// One tick with the surface at `share` of the snapshot's step, of which this tick played
  /// `played`. The spring's length changes by at most the motion of the tool and of the surface
  /// near it: where the proxy could jump further, as off a ridge, it slides there in several ticks.
  Answer step(const Snapshot&, double share, double played, const ToolPose& device);

  static constexpr double kStiffness = 0.5, kTurnStiffness = 200;  ///< N/mm, N mm
  static constexpr double kLever = 10;  ///< mm, makes turns comparable to moves
  static constexpr std::array<double, 3> kHalfExtents{14, 4, 1.5};  ///< mm

 private:
  struct Row {
    Eigen::Vector3d normal, moment;
    double gap, multiplier;
  };
  void addRows(const Snapshot&, double share);
  void solve(Eigen::Vector3d& move, Eigen::Vector3d& turn);

  GeometryId m_organ;
  AnalyticalGeometry m_blade;
  ToolPose m_proxy, m_device;
  std::vector<ShapeContact> m_contacts;
  std::vector<Row> m_rows;
  std::array<std::uint32_t, 3> m_nearest{};  ///< vertices of the nearest feature of the last tick
  Eigen::Vector3d m_weights = Eigen::Vector3d::Zero();
  double m_speed = 0;  ///< L / step: of the fastest point of the surface near the blade
  double m_least = kInfinity;
};

/// The rotation vector of a rotation.
Eigen::Vector3d turnOf(const Eigen::Matrix3d& rotation);

}  // namespace palpate::scenes
