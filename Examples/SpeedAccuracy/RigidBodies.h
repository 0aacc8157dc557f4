#pragma once

#include "Figures.h"

#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace palpate::accuracy {

struct RigidOptions {
  int triangles = 1'000'000;  ///< of the bone, about
  int particles = 200'000;
  int frames = 12;
  int repetitions = 3;
};

/// The columns of measureRigidBodies().
report::Figures emptyRigidFigures();

/// The scene and the method of each row.
std::vector<std::pair<std::string, std::string>> rigidRows();

/// Measures the methods for rigid bodies: a tool, a deforming organ and particles at a generated
/// bone. Skips rows that the figures have and those that `isChosen` rejects by scene and method.
/// Calls `save` after each row.
void measureRigidBodies(
    const RigidOptions&,
    const std::function<bool(const std::string& scene, const std::string& method)>& isChosen,
    report::Figures&, const std::function<void()>& save);

}  // namespace palpate::accuracy
