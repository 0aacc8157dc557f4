#pragma once

#include "Claims.h"
#include "Scenes.h"

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace palpate::accuracy {

/// One position array for each mesh of a scene.
using Positions = std::vector<std::vector<Eigen::Vector3d>>;

/// A method at work on a scene, frame after frame.
class Run {
 public:
  virtual ~Run() = default;
  /// Runs one step, from the positions of the last frame to `now`. The first step starts at
  /// `start`. Returns milliseconds of wall time, from positions to contacts.
  virtual double step(const Positions& now) = 0;
  /// The claims of the last step. This is not timed.
  virtual Claims claims(std::size_t pair) const = 0;
};

struct Contestant {
  std::string family, setting;
  bool slow = false;  ///< timed once only
  std::function<std::unique_ptr<Run>(const scenes::Scene&, const Positions& start)> run;
};

/// Every method of the chart, one line each.
std::vector<Contestant> contestants();

/// FCL's collide() on two BVHModel<OBBRSS>, refitted to each frame's positions.
Contestant fclCollide();

}  // namespace palpate::accuracy
