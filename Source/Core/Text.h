#pragma once

#include <Eigen/Core>

#include <cstdio>
#include <string>

namespace palpate {

/// Text with six significant digits: 0.25 or (0, 0.25, nan).
inline std::string textOf(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}
inline std::string textOf(const Eigen::Vector3d& v) {
  char text[96];
  std::snprintf(text, sizeof text, "(%g, %g, %g)", v[0], v[1], v[2]);
  return text;
}

}  // namespace palpate
