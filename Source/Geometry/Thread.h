#pragma once

#include <palpate/Types.h>

#include <Eigen/Core>

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace palpate {

/// Where an edge of a line mesh lies along its thread.
struct ThreadArc {
  std::uint32_t thread = 0;
  double begin = 0, end = 0;                                ///< L, from the thread's first vertex
  double length = std::numeric_limits<double>::infinity();  ///< L: of a closed thread
};

/// L: along the thread from the nearest end of one edge to that of the other; infinity between
/// threads.
double arcBetween(const ThreadArc&, const ThreadArc&);

/// Per edge, of threads that lie as positions say. Empty where lines branch.
std::vector<ThreadArc> threadArcs(std::span<const Segment> edges,
                                  std::span<const Eigen::Vector3d> positions);

}  // namespace palpate
