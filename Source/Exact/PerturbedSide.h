#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>

namespace palpate {

/// A point with a number of its own.
struct NumberedPoint {
  std::uint64_t number;
  Eigen::Vector3d position;
};

/// orient3d() of points that are moved by (n, n^2, n^3) e, n their numbers and e infinitesimal:
/// never 0 for four different numbers. Answers for the same points therefore agree with each other.
/// Simulation of Simplicity (Edelsbrunner and Mücke, ACM Transactions on Graphics 9, 1990) moves
/// them otherwise.
int perturbedSide(const NumberedPoint& a, const NumberedPoint& b, const NumberedPoint& c,
                  const NumberedPoint& d);

}  // namespace palpate
