#pragma once

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// A vertex of a thread or loop in a step.
struct PathVertex {
  std::uint64_t number;               ///< different for different vertices
  std::array<Eigen::Vector3d, 2> at;  ///< L: before, now
};

/// How often the thread passes through the loop at the step's start (end 0) or end (1). The surface
/// of the loop is the fan of triangles at its first vertex. Exact, with perturbedSide().
int countPassages(std::span<const PathVertex> thread, std::span<const PathVertex> loop, int end);

/// Something that changed the count within the step.
struct LoopPassage {
  double time;                          ///< [0, 1], as Crossing::time
  int change;                           ///< of the count
  std::array<std::size_t, 2> ofThread;  ///< places of the edge's vertices, or twice the end's
  std::array<std::size_t, 2> ofLoop;    ///< of the side, or of the surface twice 0
  bool ofEnd;                           ///< an end passed through the surface; else edges passed
};
/// Appends what passed within the step, by time. Where vertices pass exactly through edges, the
/// changes may not sum to that of the counts.
void appendPassages(std::span<const PathVertex> thread, std::span<const PathVertex> loop,
                    std::vector<LoopPassage>&);
/// Appends the passages of edges of one thread through edges of another, by time. A passage counts
/// 1 where the volume of (p, q, a, b) becomes positive, p q and a b the edges; else -1.
void appendEdgePassages(std::span<const PathVertex> thread, std::span<const PathVertex> other,
                        std::vector<LoopPassage>&);

}  // namespace palpate
