#pragma once

#include "Vtk/Glyphs.h"

#include <palpate/Capture.h>
#include <palpate/OctreeBasedCD.h>

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

namespace palpate::vtk {

/// The vertices of the two features of a contact, each with its geometry.
struct FeaturePair {
  std::array<std::pair<const CollisionProblem::Geometry*, std::vector<std::uint32_t>>, 2> features;
  double depth;  ///< L, along the view
};

/// Glyphs of the last answers of all pairs.
struct ContactGlyphs {
  Glyphs spheres, arrows;                ///< contacts and normals; values: distances
  Glyphs untrusted;                      ///< vertices that validity() names
  std::optional<FeaturePair> nearest{};  ///< the contact of two meshes nearest to the camera

  /// indices: of the geometries in the problem. size: L, of what is in view.
  /// towards: the direction of the view. section: nothing out of its half-space is collected.
  void collect(const OctreeBasedCD&, const CollisionProblem&,
               const std::map<GeometryId, std::size_t>& indices, double size,
               const Eigen::Vector3d& towards, const std::optional<Plane>& section);
};

/// The node that holds the element of each feature, and the node above it.
std::vector<LooseOctree::Node> cellsOf(const LooseOctree&, const FeaturePair&);

/// All nodes that hold elements themselves.
std::vector<LooseOctree::Node> cellsWithElements(const LooseOctree&);

}  // namespace palpate::vtk
