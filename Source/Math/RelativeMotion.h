#pragma once

#include "Math/ImpactFormulas.h"
#include "Math/ImpactQuery.h"

#include <Eigen/Geometry>

#include <array>
#include <cmath>

namespace palpate {

struct Interval {
  double low, high;
  bool empty() const { return !(low <= high); }
};

/// The largest magnitude of each component over the step.
inline Eigen::Vector3d largestOf(const std::array<Eigen::Vector3d, 2>& ends) {
  return ends[0].cwiseAbs().cwiseMax(ends[1].cwiseAbs());
}

inline Eigen::Vector3d at(double t, const std::array<Eigen::Vector3d, 2>& ends) {
  return (1.0 - t) * ends[0] + t * ends[1];
}

/// A fixed direction along which all corners may lie on one side of zero at time t. If the
/// direction is right, the least of their coordinates along it, divided by the length, is the
/// features' distance. Zero if no direction was found.
struct Separation {
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  double length = 0.0;
  double nearest = INFINITY;  ///< L: the distance of two points on the features' borders
};
/// An ImpactQuery's A, B, C, and the corners of C - x A - y B, at both ends of the step, in
/// doubles. Each component is the exact value rounded once, and has the exact sign.
template <ImpactQuery::Kind kind>
struct RelativeMotion {
  static constexpr bool kSquare = kind == ImpactQuery::Kind::EdgeEdge;
  static constexpr int kCorners = kSquare ? 4 : 3;
  using Ends = std::array<Eigen::Vector3d, 2>;

  Ends a, b, c;
  std::array<Ends, kCorners> corner;

  explicit RelativeMotion(const ImpactQuery& query) {
    constexpr auto kAxes = ImpactQuery::axes(kind);
    constexpr auto kCornerDifferences = ImpactQuery::corners(kind);
    for (int end = 0; end < 2; ++end) {
      const auto difference = [&](const ImpactQuery::Difference& d) -> Eigen::Vector3d {
        return query.vertices[d[0]].at(end) - query.vertices[d[1]].at(end);
      };
      a[end] = difference(kAxes[0]);
      b[end] = difference(kAxes[1]);
      c[end] = difference(kAxes[2]);
      for (int i = 0; i < kCorners; ++i) corner[i][end] = difference(kCornerDifferences[i]);
    }
  }

  /// Multiplies all by a power of two.
  void scale(double by) {
    const auto scaleEnds = [=](Ends& ends) { ends = {ends[0] * by, ends[1] * by}; };
    for (Ends* ends : {&a, &b, &c}) scaleEnds(*ends);
    for (Ends& ends : corner) scaleEnds(ends);
  }

  /// Whether some coordinate has the same strict sign at every corner and both ends, and therefore
  /// throughout the step. Exact.
  bool boxesSeparate() const {
    for (int k = 0; k < 3; ++k) {
      double least = corner[0][0][k], most = least;
      for (const Ends& ends : corner)
        for (const Eigen::Vector3d& position : ends) {
          least = position[k] < least ? position[k] : least;
          most = position[k] > most ? position[k] : most;
        }
      if (least > 0.0 || most < 0.0) return true;
    }
    return false;
  }

  /// The largest magnitude of each coordinate, over the corners and the step.
  Eigen::Vector3d largestDifference() const {
    Eigen::Vector3d largest = Eigen::Vector3d::Zero();
    for (const Ends& ends : corner)
      for (const Eigen::Vector3d& position : ends) largest = largest.cwiseMax(position.cwiseAbs());
    return largest;
  }

  CoplanarityOf<double> coplanarity() const {
    struct Components {
      double x, y, z;
    };
    const auto of = [](const Eigen::Vector3d& v) { return Components{v[0], v[1], v[2]}; };
    const Components ofA[2] = {of(a[0]), of(a[1])}, ofB[2] = {of(b[0]), of(b[1])},
                     ofC[2] = {of(c[0]), of(c[1])};
    return coplanarityOf(ofA, ofB, ofC, of(largestOf(a)), of(largestOf(b)), of(largestOf(c)), 3.0);
  }
  /// The permanent of the largest magnitudes: no term of det(A, B, C) exceeds one of its six.
  double permanent() const { return coplanarity().permanent; }

  Separation bestSeparation(double t) const;

  /// The interval of times around t during which all corners are certainly further than `distance`
  /// along the direction. It is an interval because the corners move linearly. Empty if this does
  /// not hold at t itself. largest is largestDifference().
  Interval separatedAround(double t, const Eigen::Vector3d& largest, const Separation&,
                           double distance) const;

  /// Whether all corners are certainly further than `distance` from t0 to t1, along a direction
  /// that changes linearly from one separation's to the other's.
  bool separatedBetween(double t0, const Separation&, double t1, const Separation&,
                        const Eigen::Vector3d& largest, double distance) const;

  /// Whether the plane of A and B certainly stays further than `distance` from C. The plane goes
  /// through one feature, or along both edges; C goes through the other.
  bool separatedByPlane(double t0, double t1, double distance) const;
};

}  // namespace palpate
