#pragma once

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <numeric>
#include <vector>

namespace palpate::scenes {

// A stitch that a guide sews and ties: it draws a thread through two holes in the plane z = 0 and
// around the thread's other end, then pulls the overhand knot tight. Lengths in mm.

inline constexpr std::uint32_t kStitchVertices = 214;
/// Where the thread's centre line goes down, and where it comes up.
inline const std::array<Eigen::Vector3d, 2> kStitchHoles{{{-1.547, 0, 0}, {1.547, 0, 0}}};

/// The thread's vertices from its tip to its other end. time: [0, 1] of the whole story.
std::vector<Eigen::Vector3d> stitchAt(double time);

/// The tip has left the second hole. Until it has gone around, it is not in the knot's loop.
inline constexpr double kKnotBegins = 0.58;
inline std::vector<std::uint32_t> stitchPart(std::uint32_t first, std::uint32_t last) {
  std::vector<std::uint32_t> vertices(last - first + 1);
  std::iota(vertices.begin(), vertices.end(), first);
  return vertices;
}
/// The part of the thread that goes through the knot's loop.
inline std::vector<std::uint32_t> knotEnd() { return stitchPart(0, 48); }
/// The knot's loop: the rest of the thread but a few vertices. It begins in the middle, so that its
/// surface is away from knotEnd().
inline std::vector<std::uint32_t> knotLoop() {
  std::vector<std::uint32_t> loop = stitchPart(143, kStitchVertices - 1);
  const std::vector<std::uint32_t> rest = stitchPart(73, 142);
  loop.insert(loop.end(), rest.begin(), rest.end());
  return loop;
}

}  // namespace palpate::scenes
