#pragma once

#include <palpate/TimeOfImpact.h>

#include "ImpactOracle.h"
#include "TrianglePairs.h"

#include <Eigen/Core>

#include <cmath>
#include <optional>

namespace palpate {

/// A query as the tests hold it.
struct ImpactCase {
  bool edges;
  oracle::Positions positions;

  std::optional<double> time(const TimeOfImpactSettings& settings = {}) const {
    const auto& p = positions;
    return (edges ? edgeEdgeTimeOfImpact : vertexTriangleTimeOfImpact)(p[0], p[1], p[2], p[3], p[4],
                                                                       p[5], p[6], p[7], settings);
  }
  /// Vertex i is the old order[i].
  ImpactCase permuted(const std::array<int, 4>& order) const {
    ImpactCase result = *this;
    for (int i = 0; i < 4; ++i)
      for (int end = 0; end < 2; ++end)
        result.positions[4 * end + i] = positions[4 * end + order[i]];
    return result;
  }
  ImpactCase reversed() const {
    ImpactCase result = *this;
    for (int i = 0; i < 4; ++i) std::swap(result.positions[i], result.positions[4 + i]);
    return result;
  }
  template <class F>
  ImpactCase mapped(F&& f) const {
    ImpactCase result = *this;
    for (Eigen::Vector3d& p : result.positions) p = f(p);
    return result;
  }
};

/// Whole coordinates from -range to range, and often vertices that coincide, move together or not
/// at all, and steps in one plane or on one line, so that degenerate queries are common.
inline ImpactCase randomGridCase(test::Random& random, bool edges, int range) {
  const auto pick = [&](int count) { return random.below(count); };
  ImpactCase result{edges, {}};
  auto& p = result.positions;
  for (Eigen::Vector3d& position : p)
    for (int k = 0; k < 3; ++k) position[k] = pick(2 * range + 1) - range;
  if (pick(4) == 0) p[pick(8)] = p[pick(8)];
  if (pick(6) == 0) {
    const int from = pick(4), to = pick(4);
    p[to] = p[from];
    p[4 + to] = p[4 + from];
  }
  if (pick(6) == 0)
    for (int i = 0; i < 4; ++i)
      if (pick(2)) p[4 + i] = p[i];
  if (pick(3) == 0) {
    const int flat = pick(3), alsoFlat = pick(3);
    for (Eigen::Vector3d& position : p) position[flat] = 1.0;
    if (pick(4) == 0)
      for (Eigen::Vector3d& position : p) position[alsoFlat] = position[flat];
  }
  if (pick(8) == 0) {
    const Eigen::Vector3d move = p[4] - p[0];
    for (int i = 0; i < 4; ++i) p[4 + i] = p[i] + (pick(4) ? move : Eigen::Vector3d::Zero());
  }
  return result;
}

/// Coordinates with all their bits, in [-1, 1].
inline ImpactCase randomCase(test::Random& random, bool edges) {
  ImpactCase result{edges, {}};
  for (Eigen::Vector3d& position : result.positions) position = random.inCube();
  return result;
}

}  // namespace palpate
