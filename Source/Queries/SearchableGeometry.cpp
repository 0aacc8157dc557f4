#include "Queries/SearchableGeometry.h"

#include <palpate/Error.h>

#include "Math/Tolerances.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cstddef>

namespace palpate {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

/// error: of the offset and of the positions in the boxes. All are in units of the floats.
void addEnd(BoxMap& map, const Matrix3d& rotation, const Vector3d& offset, double thickness,
            double error) {
  std::array<std::array<double, 3>, 3> matrix;
  for (int k = 0; k < 3; ++k)
    for (int j = 0; j < 3; ++j) matrix[k][j] = rotation(k, j);
  setEnd(map.ends[map.count++], matrix, {offset[0], offset[1], offset[2]}, thickness, error);
}

/// L: the largest coordinate of an octree's boxes about the origin of its frame.
double reachOf(const GeometryOctree& tree) {
  const FloatBox box = tree.octree().box(0);
  float reach = 0;
  for (int k = 0; k < 3; ++k) reach = std::max({reach, -box.lower[k], box.upper[k]});
  return reach / tree.frame().scale;
}

bool mayBeClamped(const GeometryOctree& tree) {
  return tree.octree().isBuilt() && tree.octree().box(0).mayBeClamped();
}

/// Whether rounding errors of the furthest vertices are much smaller than most boxes. It implies
/// that no position is clamped to the range of floats.
bool isCompact(const GeometryOctree& tree) {
  return tree.octree().isBuilt() && reachOf(tree) <= 0x1p20 * tree.spread();
}

/// Whether bodyMap() can be used. If b turns in the step, positions move on curves in its body.
bool hasBodyMap(const SearchableGeometry& a, const SearchableGeometry& b, bool wholeStep) {
  const Positions &now = b.mesh.now, &before = b.mesh.before;
  return a.isPlaced() && b.isPlaced() &&
         (!wholeStep || now.transform().rotation == before.transform().rotation) &&
         isCompact(a.tree) && isCompact(b.tree);
}

Matrix3d inverseOf(const Matrix3d& m) {
  const Vector3d x = m.col(1).cross(m.col(2)), y = m.col(2).cross(m.col(0)),
                 z = m.col(0).cross(m.col(1));
  Matrix3d inverse;
  inverse << x.transpose(), y.transpose(), z.transpose();
  return inverse / m.col(0).dot(x);
}

/// The map from boxes of a's octree into the frame of b's octree. A position p of the world is at
/// inverse (p - t) in b's body, where t is b's translation.
///
/// All positions move in straight lines, and the inverse does not change in the step. Positions of
/// a therefore move in straight lines in b's body, too, and the boxes of both ends enclose them.
///
/// Rounding. Let u be 2^-53, and |x| the largest coordinate of x. A and B are the origins of the
/// two float frames, and the reaches r and q of the boxes are about them. s and t are the
/// translations of a and b. The magnitudes in a row of a rotation sum up to sqrt(3) at most. In b's
/// body, errors are at most
///   7 u (sqrt(3) (|A| + r) + |s|)        of a's vertices, 4 u of the same in the world;
///   7 u (sqrt(3) (|B| + q) + |t|)        of b's vertices;
///   75 u r                               of the product of both rotations, 25 u an entry;
///   50 u (sqrt(3) |A| + |s| + |t|) + u |B|   of the offset.
/// Together they are less than 128 u = 4 kPlacedError times 2 (|A| + r + |B| + q) + |s| + |t|. The
/// length of a row of the inverse exceeds 1 by less than kOrthonormal. So does the thickness along
/// an axis of b's body.
BoxMap bodyMap(const SearchableGeometry& a, const SearchableGeometry& b, double thickness,
               bool wholeStep) {
  const FloatFrame &from = a.tree.frame(), &to = b.tree.frame();
  const auto largest = [](const Vector3d& v) { return v.cwiseAbs().maxCoeff(); };
  const double sizes =
      2.0 * (largest(from.origin) + reachOf(a.tree) + largest(to.origin) + reachOf(b.tree));
  const Matrix3d inverse = inverseOf(b.mesh.now.transform().rotation);
  BoxMap map;
  const auto add = [&](const RigidTransform& ofA, const RigidTransform& ofB) {
    const double size = sizes + largest(ofA.translation) + largest(ofB.translation);
    addEnd(map, inverse * ofA.rotation,
           (inverse * (ofA(from.origin) - ofB.translation) - to.origin) * to.scale,
           thickness * (1.0 + kOrthonormal) * to.scale, 4.0 * kPlacedError * size * to.scale);
  };
  const Positions &nowA = a.mesh.now, &nowB = b.mesh.now, &beforeA = a.mesh.before,
                  &beforeB = b.mesh.before;
  add(nowA.transform(), nowB.transform());
  if (wholeStep &&
      !(nowA.transform() == beforeA.transform() && nowB.transform() == beforeB.transform()))
    add(beforeA.transform(), beforeB.transform());
  return map;
}

}  // namespace

Vector3d worldOrigin(const SearchableGeometry& geometry) {
  const Vector3d& origin = geometry.tree.frame().origin;
  return geometry.isPlaced() ? geometry.mesh.now.transform()(origin) : origin;
}

BoxMap worldMap(const SearchableGeometry& geometry, const Vector3d& origin, double thickness,
                bool wholeStep) {
  BoxMap map;
  if (!geometry.isPlaced()) return map;
  const FloatFrame& frame = geometry.tree.frame();
  const auto add = [&](const RigidTransform& transform) {
    const double error =
        kPlacedError * frame.scale *
        (2.0 * frame.origin.cwiseAbs().maxCoeff() + transform.translation.cwiseAbs().maxCoeff() +
         origin.cwiseAbs().maxCoeff());
    addEnd(map, transform.rotation, (transform(frame.origin) - origin) * frame.scale, thickness,
           error);
  };
  const RigidTransform &now = geometry.mesh.now.transform(),
                       &before = geometry.mesh.before.transform();
  add(now);
  if (wholeStep && !(now == before)) add(before);
  return map;
}

TreePair treesOf(const SearchableGeometry& a, const SearchableGeometry& b, double thickness,
                 bool wholeStep, BoxFrame frame) {
  TreePair trees{&a.tree.octree(), &b.tree.octree()};
  trees.isClamped = mayBeClamped(a.tree) || mayBeClamped(b.tree);
  if (frame == BoxFrame::Body && hasBodyMap(a, b, wholeStep)) {
    trees.mapA = bodyMap(a, b, thickness, wholeStep);
    return trees;
  }
  if (frame == BoxFrame::Body && hasBodyMap(b, a, wholeStep)) {
    trees.mapB = bodyMap(b, a, thickness, wholeStep);
    return trees;
  }
  const double scale = a.tree.frame().scale;
  const Vector3d origin = worldOrigin(b), offset = a.tree.frame().scaled(origin, worldOrigin(a));
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
