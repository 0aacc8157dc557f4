#pragma once

#include <palpate/Types.h>

#include "Simplify/SimplifyCertificate.h"
#include "Bodies/Body.h"

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate {

/// The connected components of a closed mesh. A component is named by its lowest vertex.
struct Shells {
  std::vector<std::uint32_t> componentOf;  ///< per vertex
  /// Per component's lowest vertex: as for outwardWays(), or 0 for a shell inside the mesh.
  std::vector<std::int8_t> sides;
  std::vector<Eigen::Vector3d> normals;  ///< per vertex, of any length

  std::int8_t sideOf(const Triangle& triangle) const { return sides[componentOf[triangle[0]]]; }
};

/// Looks at both sides of the largest triangle of each component. A wrong answer is no danger: the
/// certificate then fails. The certificate must be that of the body.
Shells shellsOf(const Body&, const SimplifyCertificate&);

/// The component of each vertex.
std::vector<std::uint32_t> componentsOf(std::size_t vertices, std::span<const Triangle>);

}  // namespace palpate
