#pragma once

#include <palpate/AnalyticalGeometry.h>

#include <cmath>

namespace palpate {

// The range of lengths that calls accept (kLargestMeasure). NaN is outside.

inline bool isWithinRange(double length) { return std::abs(length) <= kLargestMeasure; }
inline bool isWithinRange(const Eigen::Vector3d& coordinates) {
  return (coordinates.array().abs() <= kLargestMeasure).all();
}

/// What a message says about a value outside.
inline constexpr const char* kRangeRule = "finite and at most 1e+300 in magnitude";
inline constexpr const char* kLengthRule = "finite, not negative and at most 1e+300";

}  // namespace palpate
