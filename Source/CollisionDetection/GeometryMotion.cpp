#include "CollisionDetection/Geometry.h"

namespace palpate {

namespace {

std::array<Revision, 4> ends(const Positions& from, const Positions& to) {
  return {from.bodyRevision(), from.transformRevision(), to.bodyRevision(), to.transformRevision()};
}

}  // namespace

void GeometryMotion::take(const TriangleMesh& mesh, const MotionRange& motion) {
  m_range = motion;
  m_rangeOf.commit(ends(mesh.before, mesh.now));
}

void GeometryMotion::update(const Geometry& geometry) {
  m_isUsed = true;
  const TriangleMesh& mesh = geometry.mesh;
  const std::array<Revision, 4> step = ends(mesh.before, mesh.now);
  if (!m_rangeOf.isCurrent(step)) {
    m_rangeOf.invalidate();
    if (mesh.before.isSameAs(mesh.now)) {
      m_range = {};
      m_range.isEmpty = mesh.now.size() == 0;
    } else if (geometry.isPlaced() && mesh.now.hasSameBody(mesh.before)) {
      m_range = m_search.motion(geometry);
    } else {
      m_range = motionRange(mesh.before, mesh.now);
    }
    m_rangeOf.commit(step);
  }
  if (!m_arcOf.isCurrent(step)) {
    m_arcOf.invalidate();
    m_arcDeviation = m_search.arcDeviation(geometry);
    m_arcOf.commit(step);
  }
  const std::array<Revision, 4> given = ends(geometry.step.detected(), mesh.before);
  if (!m_correctionOf.isCurrent(given)) {
    m_correctionOf.invalidate();
    m_correction = geometry.step.detected().isSameAs(mesh.before)
                       ? MotionRange{}
                       : motionRange(geometry.step.detected(), mesh.before);
    m_correctionOf.commit(given);
  }
}

}  // namespace palpate
