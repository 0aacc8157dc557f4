#pragma once

#include "Mesh/AngleSeries.h"
#include "Mesh/Corners.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstddef>

namespace palpate {

/// A triangle as seen from one of its corners.
class FaceAtCorner {
 public:
  FaceAtCorner(const Corners& p, std::size_t corner)
      : m_corners(p),
        m_u(p[(corner + 1) % 3] - p[corner]),
        m_v(p[(corner + 2) % 3] - p[corner]),
        m_across(m_u.cross(m_v)),
        m_ofU(m_u.squaredNorm()),
        m_ofV(m_v.squaredNorm()),
        m_square(m_across.squaredNorm()) {}

  /// Its unit normal, within 2^-44; zero without area.
  Eigen::Vector3d normal() const;
  /// Its unit normal times the angle at the corner, in rad.
  Eigen::Vector3d weightedNormal() const;
  /// Whether its size and angle are moderate, so that the cross product of the rounded edges is
  /// within 2^-44 of its length.
  bool isPlain() const {
    const auto isModerate = [](double square) {
      return square > kLeastPlainSquare && square < kMostPlainSquare;
    };
    return isModerate(m_ofU) && isModerate(m_ofV) && m_square > kLeastPlainSine * m_ofU * m_ofV;
  }

 private:
  const Corners& m_corners;
  const Eigen::Vector3d m_u, m_v, m_across;
  const double m_ofU, m_ofV, m_square;  ///< squared lengths
};

}  // namespace palpate
