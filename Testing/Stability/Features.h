#pragma once

#include "Case.h"
#include "Claims.h"

#include <array>
#include <vector>

namespace palpate::stability {

using accuracy::FeaturePair;

/// The fifteen feature pairs of two triangles, and the four vertices of each.
const std::vector<FeaturePair>& everyFeaturePair();
std::array<Eigen::Vector3d, 4> positionsOf(const FeaturePair&, const Case::Frame&);

}  // namespace palpate::stability
