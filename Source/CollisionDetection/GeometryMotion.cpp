// Part of CollisionDetection/Geometry.h: how a geometry moves.
#include "CollisionDetection/Geometry.h"

#include <Eigen/Geometry>

#include <algorithm>

namespace palpate {

namespace {

std::array<PositionsState, 2> ends(const Positions& from, const Positions& to) {
  return {from.state(), to.state()};
}

/// L: an upper bound of the extent along any axis of the world, at both ends of the step. A placed
/// body may be turned, so the longest side of its box is doubled.
double extentOf(const Body& body) {
  const TriangleMesh& mesh = body.mesh;
  if (mesh.topology.count() == 0) return 0.0;
  const Eigen::AlignedBox3d bounds = mesh.now.bounds().merged(mesh.before.bounds());
  return (body.isPlaced() ? 2.0 : 1.0) * bounds.sizes().maxCoeff();
}

}  // namespace

GeometryInStep Geometry::inStep() const {
  return {body.mesh,
          smallestHeight.value,
          motion.range(),
          motion.correction(),
          motion.arcDeviation(),
          extentOf(body),
          body.revisions.elements,
          step.detected(),
          step.cutsSinceDetection(),
          body.field.get()};
}

GeometryMotion::Step GeometryMotion::stepOf(const Geometry& geometry) {
  return {ends(geometry.body.mesh.before, geometry.body.mesh.now),
          geometry.body.revisions.elements.topology};
}

void GeometryMotion::set(const Geometry& geometry, const MotionRange& motion) {
  m_range = motion;
  m_rangeVersion.commit(stepOf(geometry));
}

void GeometryMotion::update(const Geometry& geometry) {
  m_isUsed = true;
  const TriangleMesh& mesh = geometry.body.mesh;
  const Step step = stepOf(geometry);
  if (!m_rangeVersion.isCurrent(step)) {
    m_rangeVersion.invalidate();
    if (mesh.before.isSameAs(mesh.now)) {
      m_range = {};
      m_range.isEmpty = mesh.now.size() == 0;
    } else if (geometry.body.isPlaced() && mesh.now.hasSameBody(mesh.before)) {
      m_range = m_search.motion(geometry);
    } else {
      m_range = motionRange(mesh.before, mesh.now);
    }
    m_rangeVersion.commit(step);
  }
  if (!m_arcVersion.isCurrent(step)) {
    m_arcVersion.invalidate();
    m_arcDeviation = m_search.arcDeviation(geometry);
    m_arcVersion.commit(step);
  }
  const auto correctionEnds = ends(geometry.step.detected(), mesh.before);
  if (!m_correctionVersion.isCurrent(correctionEnds)) {
    m_correctionVersion.invalidate();
    m_correction = geometry.step.detected().isSameAs(mesh.before)
                       ? MotionRange{}
                       : motionRange(geometry.step.detected(), mesh.before);
    m_correctionVersion.commit(correctionEnds);
  }
}

}  // namespace palpate
