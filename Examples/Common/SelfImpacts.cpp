#include "SelfImpacts.h"

#include <palpate/FeaturePairs.h>

#include <Eigen/Geometry>

#include <vector>

namespace palpate::scenes {

std::size_t countSelfImpacts(std::span<const Eigen::Vector3d> before,
                             std::span<const Eigen::Vector3d> now) {
  std::vector<Eigen::AlignedBox3d> boxes;
  for (std::size_t i = 0; i + 1 < now.size(); ++i) {
    Eigen::AlignedBox3d box(before[i]);
    boxes.push_back(box.extend(before[i + 1]).extend(now[i]).extend(now[i + 1]));
  }
  std::size_t impacts = 0;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    for (std::size_t j = i + 2; j < boxes.size(); ++j) {
      if (!boxes[i].intersects(boxes[j])) continue;
      impacts += edgeEdgeTimeOfImpact(before[i], before[i + 1], before[j], before[j + 1], now[i],
                                      now[i + 1], now[j], now[j + 1])
                     .has_value();
    }
  }
  return impacts;
}

}  // namespace palpate::scenes
