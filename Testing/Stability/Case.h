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

/// Two triangles and their motion, which is straight within each frame.
struct Case {
  struct Frame {
    Corners a, b;
  };
  std::vector<Frame> frames;  ///< the first has the start positions
  double thickness;
  /// The triangles intersect at the start. The correct side of a vertex is that of the triangle's
  /// normal.
  bool startsInside = false;
};

/// The case as a scene, which every method accepts.
scenes::Scene sceneOf(const Case&);
std::vector<std::vector<Eigen::Vector3d>> positionsOf(const Case::Frame&);

/// The same case with noise: each coordinate moves by up to `noise` times its triangle's extent.
Case neighbourOf(const Case&, double noise, testing::Random&);

/// Cases in which one property becomes more difficult from step to step.
struct Sweep {
  std::string name;
  std::string quantity;        ///< the quantity of the values, with unit or ratio
  std::vector<double> values;  ///< easiest first
  std::function<Case(double value, testing::Random&)> make;
  bool startsInside = false;  ///< intersections at the start, which Continuous does not report
};

std::vector<Sweep> sweeps();

}  // namespace palpate::stability
