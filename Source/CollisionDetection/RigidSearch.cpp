#include "CollisionDetection/RigidSearch.h"

#include "CollisionDetection/Geometry.h"
#include "Octree/PointQueries.h"
#include "Octree/Traversal.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

}  // namespace

/// The step of one body, with the search for the vertices that move furthest in it.
class RigidSearch::Step {
 public:
  Step(const Geometry& geometry, RigidSearch& search)
      : m_geometry(geometry),
        m_before(geometry.body.mesh.before.transform()),
        m_now(geometry.body.mesh.now.transform()),
        m_matrix(m_now.rotation - m_before.rotation),
        m_vector(m_now.translation - m_before.translation) {
    const Revision body = geometry.body.mesh.now.bodyRevision();
    if (!search.m_largestVersion.isCurrent(body)) {
      search.m_largest = 0.0;
      for (const Vector3d& p : geometry.body.mesh.now.body())
        search.m_largest = std::max(search.m_largest, p.cwiseAbs().maxCoeff());
      search.m_largestVersion.commit(body);
    }
    m_slack = kPlacedError * (4.0 * search.m_largest + m_before.translation.cwiseAbs().maxCoeff() +
                              m_now.translation.cwiseAbs().maxCoeff());
  }

  const Pose& before() const { return m_before; }
  const Pose& now() const { return m_now; }
  const Matrix3d& matrix() const { return m_matrix; }

  /// An upper bound of size(displacement) over all vertices, of a mesh those that its elements
  /// have, which alone are in the octree, or 0 without any: the largest value plus twice the slack
  /// for rounding errors. In a box of positions, size(displacement) is at most its value at the
  /// centre plus, for each axis, growth(axis) times half the box's edge. The result depends neither
  /// on the octree nor on the vertex with which the search begins.
  template <class Size>
  double largest(std::uint32_t& vertex, const Vector3d& growth, Size&& size) {
    const std::span<const Vector3d> body = m_geometry.body.mesh.now.body();
    const auto sizeOf = [&](std::uint32_t v) { return size(m_now(body[v]) - m_before(body[v])); };
    const CountedVector<bool>& isUsed = m_geometry.body.mesh.topology.isUsed;
    if (body.empty() || (!isUsed.empty() && m_geometry.body.mesh.topology.count() == 0)) return 0.0;
    if (vertex >= body.size()) vertex = 0;
    // Where the body does not turn about an axis that matters, all vertices move alike.
    const Eigen::AlignedBox3d& bounds = m_geometry.body.mesh.now.bounds();
    if (const double spread = growth.dot(0.5 * bounds.sizes()); spread <= m_slack)
      return size(m_matrix * bounds.center() + m_vector) + spread + 2.0 * m_slack;
    constexpr double kNone = -std::numeric_limits<double>::infinity();
    const auto counts = [&](std::uint32_t v) { return isUsed.empty() || isUsed[v]; };
    double best = counts(vertex) ? sizeOf(vertex) : kNone;
    const auto testOne = [&](std::uint32_t v) {
      if (!counts(v)) return;
      const double other = sizeOf(v);
      if (other > best) best = other, vertex = v;
    };
    const GeometryOctree& tree = m_geometry.body.tree;
    const auto mayExceed = [&](const FloatBox& floats) {
      if (floats.empty()) return false;
      const auto box = tree.frame().lengthsOf(floats);
      if (!box) return true;
      const Vector3d centre = box->center() + tree.frame().origin;
      const double most = size(m_matrix * centre + m_vector) + growth.dot(0.5 * box->sizes());
      return !(most + 2.0 * m_slack <= best);
    };
    if (tree.encloses(m_geometry.body.mesh, m_geometry.body.revisions.elements.topology)) {
      forEachOverlapping(tree.octree(), mayExceed, [&](std::uint32_t begin, std::uint32_t end) {
        for (std::uint32_t i = begin; i < end; ++i)
          if (mayExceed(tree.octree().boxes()[i]))
            for (const std::uint32_t v : tree.ordered()[i]) testOne(v);
      });
    } else {
      for (std::uint32_t v = 0; v < body.size(); ++v) testOne(v);
    }
    return best == kNone ? 0.0 : best + 2.0 * m_slack;
  }

 private:
  const Geometry& m_geometry;
  const Pose &m_before, &m_now;
  Matrix3d m_matrix;  ///< a position x in the body's frame is displaced by m_matrix x + m_vector
  Vector3d m_vector;
  double m_slack;
};

MotionRange RigidSearch::motion(const Geometry& geometry) {
  Step step(geometry, *this);
  MotionRange range;
  range.isEmpty = geometry.body.mesh.now.size() == 0;
  if (step.before() == step.now()) return range;
  for (int k = 0; k < 3; ++k) {
    const Vector3d growth = step.matrix().row(k).cwiseAbs();
    range.upper[k] =
        step.largest(m_furthest[k], growth, [&](const Vector3d& moved) { return moved[k]; });
    range.lower[k] =
        -step.largest(m_furthest[3 + k], growth, [&](const Vector3d& moved) { return -moved[k]; });
  }
  if (geometry.body.shape && geometry.body.shape->now.isCylinder()) {
    const Shape &before = geometry.body.shape->before, &now = geometry.body.shape->now;
    const double turned = (now.axes().col(2) - before.axes().col(2)).norm() + kPlacedError;
    const Vector3d ofRim = Vector3d::Constant(turned * now.radius());
    range.lower -= ofRim;
    range.upper += ofRim;
  }
  return range;
}

double RigidSearch::arcDeviation(const Geometry& geometry) {
  if (!geometry.body.isPlaced()) return 0.0;
  Step step(geometry, *this);
  if (step.before().rotation == step.now().rotation) return 0.0;
  const Matrix3d turn = step.now().rotation * step.before().rotation.transpose();
  const Eigen::Quaterniond half = Eigen::Quaterniond(turn).normalized();
  const double sine = half.vec().norm();
  if (sine == 0.0) return 0.0;
  if (geometry.body.shape && geometry.body.shape->now.isPlane())
    return std::numeric_limits<double>::infinity();
  const Vector3d axis = half.vec() / sine;
  const auto across = [&](const Vector3d& v) -> Vector3d { return v - axis.dot(v) * axis; };
  Vector3d growth;
  for (int j = 0; j < 3; ++j) growth[j] = across(step.matrix().col(j)).norm();
  const double deviation = 0.5 * sine / (1.0 + std::abs(half.w())) *
                           step.largest(m_furthest[6], growth, [&](const Vector3d& moved) {
                             return across(moved).norm();
                           });
  if (!(geometry.body.shape && geometry.body.shape->now.isCylinder() && deviation > 0.0))
    return deviation;
  const std::span<const Vector3d> ends = geometry.body.shape->now.corners();
  const double slope = 4.0 * deviation / stableLength(ends[1] - ends[0]);
  return deviation + slope * geometry.body.shape->now.radius();
}

}  // namespace palpate
