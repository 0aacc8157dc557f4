#include "Bodies/OctreeFrame.h"

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace palpate {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

double largest(const Vector3d& v) { return v.cwiseAbs().maxCoeff(); }

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
  void addTo(BoxMap& map) const {
    PALPATE_ASSERT(static_cast<std::size_t>(map.count) < std::size(map.ends));
    setEnd(map.ends[map.count++], matrix, offset, thickness, error);
  }
  /// dops: of the boxes that are mapped.
  void addTo(DopMap& map, const OctreeDops& dops) const {
    PALPATE_ASSERT(static_cast<std::size_t>(map.count) < std::size(map.ends));
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
/// LooseOctree.md derives the bound of the errors.
template <class F>
void forEachBodyEnd(const Body& a, const Body& b, double thickness, bool wholeStep, F&& f) {
  PALPATE_ASSERT(a.isPlaced() && b.isPlaced() && thickness >= 0.0);
  const FloatFrame &from = a.tree.frame(), &to = b.tree.frame();
  const double sizes =
      2.0 * (largest(from.origin) + a.tree.reach() + largest(to.origin) + b.tree.reach());
  const Matrix3d inverse = inverseOf(b.mesh.now.transform().rotation);
  const auto add = [&](const Pose& ofA, const Pose& ofB) {
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

OctreeFrame::OctreeFrame(const Body& body)
    : m_body(body),
      m_frame(body.tree.frame()),
      m_pose(body.isPlaced() ? &body.mesh.now.transform() : nullptr),
      m_origin(m_pose ? (*m_pose)(m_frame.origin) : m_frame.origin) {
  PALPATE_ASSERT(m_frame.scale > 0.0 && std::exp2(std::ilogb(m_frame.scale)) == m_frame.scale);
}

double OctreeFrame::error() const {
  return m_pose ? kPlacedPointError * m_frame.scale * magnitude() : 0.0;
}

float OctreeFrame::slackAt(const FloatPoint& position) const {
  const float largest = std::max(m_body.tree.octree().box(0).reach(), position.box().reach());
  return largest >= kLargestFloat ? std::numeric_limits<float>::infinity()
                                  : largest * kFloatPointError + OutwardRounding::up(error()) +
                                        OutwardRounding::kAbsolute;
}

BoxMap OctreeFrame::toWorld(const Vector3d& origin, double thickness, bool wholeStep) const {
  BoxMap map;
  if (!m_pose) return map;
  const auto add = [&](const Pose& transform) {
    const double error =
        kPlacedError * m_frame.scale *
        (2.0 * largest(m_frame.origin) + largest(transform.translation) + largest(origin));
    MapEnd(transform.rotation, (transform(m_frame.origin) - origin) * m_frame.scale, thickness,
           error)
        .addTo(map);
  };
  add(*m_pose);
  const Pose& before = m_body.mesh.before.transform();
  if (wholeStep && !(*m_pose == before)) add(before);
  return map;
}

BoxMap mapBetween(const Body& a, const Body& b, const Vector3d& shift) {
  const OctreeFrame from(b), to(a);
  PALPATE_ASSERT(from.scale() == to.scale());
  Matrix3d rotation = b.isPlaced() ? b.mesh.now.transform().rotation : Matrix3d::Identity();
  for (int k = 0; k < 3; ++k) rotation.col(k) = to.turned(rotation.col(k));
  BoxMap map;
  MapEnd(
      rotation, to.turned((from.origin() - to.origin()) - shift) * to.scale(), 0.0,
      4 * kPlacedError * to.scale() * (to.magnitude() + from.magnitude() + shift.cwiseAbs().sum()))
      .addTo(map);
  return map;
}

float boxErrorOf(const Body& a, const Body& b) {
  const auto sizeOf = [](const FloatBox& box) {
    double size = 0;
    for (std::size_t k = 0; k < 3; ++k) size += double{box.upper[k]} - box.lower[k];
    return size;
  };
  return OutwardRounding::up(4 * kOrthonormal *
                             (sizeOf(a.tree.octree().box(0)) + sizeOf(b.tree.octree().box(0))));
}

TreePair treesOf(const Body& a, const Body& b, double thickness, bool wholeStep, BoxFrame frame) {
  PALPATE_ASSERT(thickness >= 0.0);
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
  const OctreeFrame frameA(a), frameB(b);
  const Vector3d offset = a.tree.frame().scaled(frameB.origin(), frameA.origin());
  setShift(trees, {offset[0], offset[1], offset[2]}, thickness * frameA.scale());
  trees.mapA = frameA.toWorld(frameB.origin(), thickness * frameA.scale(), wholeStep);
  trees.mapB = frameB.toWorld(wholeStep);
  return trees;
}

}  // namespace palpate
