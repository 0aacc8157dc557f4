#include "Queries/SearchableGeometry.h"

#include <palpate/Error.h>

#include "Math/Tolerances.h"

#include <array>
#include <cstddef>

namespace palpate {

using Eigen::Vector3d;

Vector3d worldOrigin(const SearchableGeometry& geometry) {
  const Vector3d& origin = geometry.tree.frame().origin;
  return geometry.isPlaced() ? geometry.mesh.now.transform()(origin) : origin;
}

BoxMap worldMap(const SearchableGeometry& geometry, const Vector3d& origin, double thickness,
                bool wholeStep) {
  BoxMap map;
  if (!geometry.isPlaced()) return map;
  const FloatFrame& frame = geometry.tree.frame();
  const auto addEnd = [&](const RigidTransform& transform) {
    std::array<std::array<double, 3>, 3> matrix;
    for (int k = 0; k < 3; ++k)
      for (int j = 0; j < 3; ++j) matrix[k][j] = transform.rotation(k, j);
    const Vector3d offset = (transform(frame.origin) - origin) * frame.scale;
    const double error =
        kPlacedError * frame.scale *
        (2.0 * frame.origin.cwiseAbs().maxCoeff() + transform.translation.cwiseAbs().maxCoeff() +
         origin.cwiseAbs().maxCoeff());
    setEnd(map.ends[map.count++], matrix, {offset[0], offset[1], offset[2]}, thickness, error);
  };
  const RigidTransform &now = geometry.mesh.now.transform(),
                       &before = geometry.mesh.before.transform();
  addEnd(now);
  if (wholeStep && !(now == before)) addEnd(before);
  return map;
}

TreePair treesOf(const SearchableGeometry& a, const SearchableGeometry& b, double thickness,
                 bool wholeStep) {
  TreePair trees{&a.tree.octree(), &b.tree.octree()};
  const double scale = a.tree.frame().scale;
  const Vector3d origin = worldOrigin(b), offset = (worldOrigin(a) - origin) * scale;
  setShift(trees, {offset[0], offset[1], offset[2]}, thickness * scale);
  trees.mapA = worldMap(a, origin, thickness * scale, wholeStep);
  trees.mapB = worldMap(b, origin, 0.0, wholeStep);
  return trees;
}

std::string nameOf(GeometryId id) {
  return "geometry " + std::to_string(static_cast<std::uint32_t>(id));
}

std::string nameOf(GeometryType type) {
  constexpr const char* kNames[] = {"a triangle mesh", "a line mesh", "a point set", "a shape"};
  return kNames[static_cast<std::size_t>(type)];
}

void checkMeshType(const SearchableGeometry& geometry, bool tetrahedra, const char* call) {
  if (geometry.mesh.topology.hasFaces() && (geometry.solid != nullptr) == tetrahedra) return;
  throw Error(ErrorCode::UnsupportedMethod,
              nameOf(geometry.id) + " is " +
                  (geometry.solid ? "a tetrahedral mesh" : nameOf(geometry.mesh.topology.type)) +
                  "; " + call,
              geometry.id);
}

}  // namespace palpate
