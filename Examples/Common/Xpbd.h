#pragma once

#include <palpate/ConstraintRows.h>

#include <Eigen/Core>

#include <cstdint>
#include <span>
#include <vector>

namespace palpate::scenes {

/// Keeps two particles at a distance.
struct DistanceConstraint {
  std::uint32_t a, b;
  double rest;        ///< L
  double compliance;  ///< L / force; 0: stiff
};

/// Keeps a particle in the middle of two others, so that a thread straightens. It acts on small
/// angles, too, which distances between second neighbours hardly resist.
struct BendConstraint {
  std::uint32_t a, middle, b;
  double compliance;  ///< L / force; 0: stiff
};

/// Keeps the volume of a closed surface.
struct VolumeConstraint {
  std::uint32_t first, count;       ///< the surface's particles
  std::vector<Triangle> triangles;  ///< of the surface's own vertices 0, 1, ...; outward winding
  double rest;                      ///< L³
  double compliance;                ///< L⁵ / force; 0: stiff
};

/// Particles that keep distances, volumes and gaps: extended position-based dynamics.
///
/// Errors   none: constraints must name particles that are there.
/// Order    constraints are met one after another as they were added, so a run repeats bit by bit.
/// Source   Macklin, Müller and Chentanez, XPBD (2016).
class Xpbd {
 public:
  std::vector<Eigen::Vector3d> before, now, velocities;
  std::vector<double> inverseMasses;  ///< 0: stays, or is moved by hand
  std::vector<DistanceConstraint> distances;
  std::vector<BendConstraint> bends;
  std::vector<VolumeConstraint> volumes;

  /// Returns the number of the first particle.
  std::uint32_t add(std::span<const Eigen::Vector3d> positions, double inverseMass);

  /// now = before + the effect of velocities and acceleration. damping: share of velocity lost.
  void predict(double seconds, const Eigen::Vector3d& acceleration, double damping);
  /// Corrects `now`. Rows only push. Returns the rows' multipliers: each is a force times seconds².
  std::span<const double> solve(double seconds, std::span<const ConstraintRow> rows,
                                int iterations);
  /// Sets velocities from the result of the step, and before = now.
  void commit(double seconds);

 private:
  void solveDistance(std::size_t index, double seconds);
  void solveBend(std::size_t index, double seconds);
  void solveVolume(std::size_t index, double seconds);
  void solveRow(const ConstraintRow& row, double& multiplier);

  std::vector<double> m_distanceMultipliers, m_volumeMultipliers, m_rowMultipliers;
  std::vector<Eigen::Vector3d> m_bendMultipliers, m_gradients;
};

double volumeOf(std::span<const Eigen::Vector3d> positions, std::span<const Triangle> triangles);

}  // namespace palpate::scenes
