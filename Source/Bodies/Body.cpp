#include "Bodies/Body.h"

#include <palpate/Error.h>

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

namespace palpate {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

/// One end of a map. error: of the offset and of the positions in the boxes. All are in units of
/// the floats.
struct MapEnd {
  std::array<std::array<double, 3>, 3> matrix;
  std::array<double, 3> offset;
  double thickness, error;

  MapEnd(const Matrix3d& rotation, const Vector3d& by, double newThickness, double newError)
      : offset{by[0], by[1], by[2]}, thickness(newThickness), error(newError) {
    for (int k = 0; k < 3; ++k)
      for (int j = 0; j < 3; ++j) matrix[k][j] = rotation(k, j);
  }
  void addTo(BoxMap& map) const { setEnd(map.ends[map.count++], matrix, offset, thickness, error); }
  /// dops: of the boxes that are mapped.
  void addTo(DopMap& map, const OctreeDops& dops) const {
    map.directions = dops.directions;
    setEnd(map.ends[map.count++], dops, matrix, offset, thickness, error);
  }
};

bool mayBeClamped(const GeometryOctree& tree) {
  return tree.octree().isBuilt() && tree.octree().box(0).mayBeClamped();
}

/// Whether forEachBodyEnd() can be used. If b turns in the step, positions move on curves in its
/// body.
bool hasBodyMap(const Body& a, const Body& b, bool wholeStep) {
  const Positions &now = b.mesh.now, &before = b.mesh.before;
  return a.isPlaced() && b.isPlaced() &&
         (!wholeStep || now.transform().rotation == before.transform().rotation) &&
         a.tree.isCompact() && b.tree.isCompact();
}

Matrix3d inverseOf(const Matrix3d& m) {
  const Vector3d x = m.col(1).cross(m.col(2)), y = m.col(2).cross(m.col(0)),
                 z = m.col(0).cross(m.col(1));
  Matrix3d inverse;
  inverse << x.transpose(), y.transpose(), z.transpose();
  return inverse / m.col(0).dot(x);
}

/// Calls f with each end of the map from boxes of a's octree into the frame of b's octree. A
/// position p of the world is at inverse (p - t) in b's body, where t is b's translation.
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
/// length of the inverse's product with a unit vector exceeds 1 by less than 2 kOrthonormal. So
/// does the thickness along a direction of b's body.
template <class F>
void forEachBodyEnd(const Body& a, const Body& b, double thickness, bool wholeStep, F&& f) {
  const FloatFrame &from = a.tree.frame(), &to = b.tree.frame();
  const auto largest = [](const Vector3d& v) { return v.cwiseAbs().maxCoeff(); };
  const double sizes =
      2.0 * (largest(from.origin) + a.tree.reach() + largest(to.origin) + b.tree.reach());
  const Matrix3d inverse = inverseOf(b.mesh.now.transform().rotation);
  const auto add = [&](const RigidTransform& ofA, const RigidTransform& ofB) {
    const double size = sizes + largest(ofA.translation) + largest(ofB.translation);
    f(MapEnd(inverse * ofA.rotation,
             (inverse * (ofA(from.origin) - ofB.translation) - to.origin) * to.scale,
             thickness * (1.0 + 2.0 * kOrthonormal) * to.scale,
             4.0 * kPlacedError * size * to.scale));
  };
  const Positions &nowA = a.mesh.now, &nowB = b.mesh.now, &beforeA = a.mesh.before,
                  &beforeB = b.mesh.before;
  add(nowA.transform(), nowB.transform());
  if (wholeStep &&
      !(nowA.transform() == beforeA.transform() && nowB.transform() == beforeB.transform()))
    add(beforeA.transform(), beforeB.transform());
}

/// Sets the map of boxes, and that of k-DOPs if both octrees have them. The boxes of the roots
/// decide first, because the map of k-DOPs takes longer.
void setBodyMap(TreePair& trees, BoxMap& map, const Body& a, const Body& b, double thickness,
                bool wholeStep) {
  forEachBodyEnd(a, b, thickness, wholeStep, [&](const MapEnd& end) { end.addTo(map); });
  const Octree &ofA = a.tree.octree(), &ofB = b.tree.octree();
  if (&a == &b || ofA.dops().directions == 3 || ofA.dops().directions != ofB.dops().directions ||
      !map(ofA.box(0)).overlaps(ofB.box(0)))
    return;
  forEachBodyEnd(a, b, thickness, wholeStep,
                 [&](const MapEnd& end) { end.addTo(trees.dops, ofA.dops()); });
}

}  // namespace

Vector3d worldOrigin(const Body& geometry) {
  const Vector3d& origin = geometry.tree.frame().origin;
  return geometry.isPlaced() ? geometry.mesh.now.transform()(origin) : origin;
}

BoxMap worldMap(const Body& geometry, const Vector3d& origin, double thickness, bool wholeStep) {
  PALPATE_ASSERT(geometry.tree.frame().scale > 0.0);
  BoxMap map;
  if (!geometry.isPlaced()) return map;
  const FloatFrame& frame = geometry.tree.frame();
  const auto add = [&](const RigidTransform& transform) {
    const double error =
        kPlacedError * frame.scale *
        (2.0 * frame.origin.cwiseAbs().maxCoeff() + transform.translation.cwiseAbs().maxCoeff() +
         origin.cwiseAbs().maxCoeff());
    MapEnd(transform.rotation, (transform(frame.origin) - origin) * frame.scale, thickness, error)
        .addTo(map);
  };
  const RigidTransform &now = geometry.mesh.now.transform(),
                       &before = geometry.mesh.before.transform();
  add(now);
  if (wholeStep && !(now == before)) add(before);
  return map;
}

TreePair treesOf(const Body& a, const Body& b, double thickness, bool wholeStep, BoxFrame frame) {
  PALPATE_ASSERT(a.tree.isValid() && b.tree.isValid());
  PALPATE_ASSERT(a.tree.frame().scale == b.tree.frame().scale);
  TreePair trees{&a.tree.octree(), &b.tree.octree()};
  trees.isClamped = mayBeClamped(a.tree) || mayBeClamped(b.tree);
  if (frame == BoxFrame::Body && hasBodyMap(a, b, wholeStep)) {
    setBodyMap(trees, trees.mapA, a, b, thickness, wholeStep);
    return trees;
  }
  if (frame == BoxFrame::Body && hasBodyMap(b, a, wholeStep)) {
    setBodyMap(trees, trees.mapB, b, a, thickness, wholeStep);
    trees.swapped = trees.dops.count > 0;
    if (trees.swapped) std::swap(trees.a, trees.b);
    return trees;
  }
  const double scale = a.tree.frame().scale;
  const Vector3d origin = worldOrigin(b), offset = a.tree.frame().scaled(origin, worldOrigin(a));
  setShift(trees, {offset[0], offset[1], offset[2]}, thickness * scale);
  trees.mapA = worldMap(a, origin, thickness * scale, wholeStep);
  trees.mapB = worldMap(b, origin, 0.0, wholeStep);
  return trees;
}

std::string GeometryLabel::number() const {
  const std::string number = std::to_string(static_cast<std::uint32_t>(id));
  return name.empty() ? number : number + " \"" + std::string(name) + "\"";
}

std::string nameOf(const GeometryLabel& label) { return "geometry " + label.number(); }

void makeBody(std::span<const Eigen::Vector3d> positions, std::span<const Triangle> triangles,
              const Threads& threads, Body& out) {
  out.mesh.now = Positions(std::vector(positions.begin(), positions.end()));
  out.mesh.before = out.mesh.now;
  out.mesh.topology.vertexCount = positions.size();
  out.mesh.topology.triangles.assign(triangles.begin(), triangles.end());
  out.revisions.elements.topology = out.revisions.counter.next();
  const double spread = out.tree.sampleFrame(out.mesh, out.revisions.elements.topology);
  out.tree.update(out.mesh, out.revisions.elements.topology, frameScale(spread), {}, threads);
}

const Body& searchable(const Body& geometry) {
  if (!geometry.isField()) return geometry;
  throw Error(ErrorCode::UnsupportedMethod,
              nameOf(geometry) +
                  " is a distance field, which queries do not support; use DistanceField::value()",
              geometry.id);
}

std::string nameOf(GeometryType type) {
  constexpr const char* kNames[] = {"a triangle mesh", "a line mesh", "a point set", "a shape",
                                    "a distance field"};
  return kNames[static_cast<std::size_t>(type)];
}

void checkMeshType(const Body& geometry, bool tetrahedra, const char* call) {
  if (geometry.mesh.topology.hasFaces() && (geometry.solid != nullptr) == tetrahedra) return;
  throw Error(ErrorCode::UnsupportedMethod,
              nameOf(geometry) + " is " +
                  (geometry.solid ? "a tetrahedral mesh" : nameOf(geometry.mesh.topology.type)) +
                  "; " + call,
              geometry.id);
}

}  // namespace palpate
