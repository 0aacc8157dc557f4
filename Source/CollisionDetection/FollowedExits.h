#pragma once

#include <palpate/ClosedMesh.h>

#include "CollisionDetection/VertexSearch.h"

#include <map>
#include <span>
#include <utility>
#include <vector>

namespace palpate {

/// Ways out of bodies from call to call: see followInsideVertices().
class FollowedExits {
 public:
  /// inside: those of now, with the nearest exits. Octrees must be of the positions now. step:
  /// number of the step. Directions are followed from the last earlier step in which they were
  /// asked for, however often they are asked for in this one.
  std::span<const FollowedVertex> follow(const Geometry& vertices, const Geometry& body,
                                         std::span<const InsideVertex> inside, std::uint64_t step,
                                         Engine, const Threads&);
  void forget(GeometryId);  ///< a geometry was removed

 private:
  /// A vertex and its exit, as they were.
  struct Place {
    std::uint32_t vertex, triangle;
    Eigen::Vector3d barycentric, direction;
    double depth;
    Eigen::Vector3d position;  ///< of the vertex
    std::array<Eigen::Vector3d, 3> triangleAt;
  };
  struct Pair {
    DerivedFrom<2> lastOf, nowOf;  ///< topology of the vertices' geometry and of the body
    std::uint64_t step = 0;        ///< in which `now` was computed
    std::vector<Place> last, now;  ///< ascending vertices
    std::vector<FollowedVertex> found;
    std::vector<PointQueryStack> stacks;
  };
  class Following;

  std::map<std::pair<GeometryId, GeometryId>, Pair> m_pairs;
};

}  // namespace palpate
