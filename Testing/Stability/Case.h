#pragma once

#include <palpate/Types.h>

#include "Common/RandomMeshes.h"
#include "Scenes.h"

#include <array>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace palpate::stability {

using Corners = std::array<Eigen::Vector3d, 3>;

/// Two triangles and how they move: frame by frame, straight within each.
struct Case {
  struct Frame {
    Corners a, b;
  };
  std::vector<Frame> frames;  ///< the first is where they start
  double thickness;
  /// They start in each other: vertices are judged to belong on the side of the triangle's normal.
  bool startsInside = false;
};

/// As the same scene's frames, which every method takes.
scenes::Scene sceneOf(const Case&);
std::vector<std::vector<Eigen::Vector3d>> positionsOf(const Case::Frame&);

/// The same with every coordinate moved by up to `noise` of the extent of the triangle it is of.
Case neighbourOf(const Case&, double noise, testing::Random&);

/// From comfortable to hopeless along one line.
struct Sweep {
  std::string name;
  std::string difficulty;      ///< what the values are, with unit
  std::vector<double> values;  ///< comfortable first
  std::function<Case(double value, testing::Random&)> make;
  bool startsInside = false;  ///< which Continuous does not promise to tell
};

std::vector<Sweep> sweeps();

}  // namespace palpate::stability
