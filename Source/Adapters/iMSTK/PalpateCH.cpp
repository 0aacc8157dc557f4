#include <palpate/imstk/PalpateCH.h>

#include "iMSTK/SceneStep.h"

#include <imstkPbdModel.h>
#include <imstkPbdSolver.h>

#include <algorithm>
#include <string>
#include <utility>

namespace palpate {

namespace {

// Pushes until the gap is there. It takes back what it pushed too far in the step, and never pulls.
class RowConstraint : public imstk::PbdConstraint {
 public:
  RowConstraint(const ParticleRow& row, double gap)
      : PbdConstraint(row.terms.size()), m_row(row), m_gap(gap) {
    for (std::size_t i = 0; i < row.terms.size(); ++i) m_particles[i] = row.terms[i].particle;
  }
  const std::string getTypeName() const override { return "PalpateRowConstraint"; }

  bool computeValueAndGradient(imstk::PbdState& bodies, double& c,
                               std::vector<imstk::Vec3d>& dcdx) override {
    c = -m_row.offset - m_gap;
    for (std::size_t i = 0; i < m_row.terms.size(); ++i) {
      const ParticleRow::Term& term = m_row.terms[i];
      c += term.weight * m_row.normal.dot(bodies.getPosition(term.particle) + arm(bodies, term));
      dcdx[i] = term.weight * m_row.normal;
    }
    return c < 0 || m_lambda > 0;
  }

  void projectConstraint(imstk::PbdState& bodies, const double, const SolverType&) override {
    double c = 0;
    const bool acts = computeValueAndGradient(bodies, c, m_dcdx);
    m_C = std::min(c, 0.0);  // for SceneStep
    if (!acts) return;
    const double mobility = mobilityIn(bodies, m_row.normal);
    if (mobility == 0) return;
    const double change = std::max(-c / mobility, -m_lambda);
    m_lambda += change;
    for (const ParticleRow::Term& term : m_row.terms) {
      const imstk::Vec3d impulse = change * term.weight * m_row.normal;
      const imstk::Vec3d turn = turnBy(bodies, term, impulse);
      bodies.getPosition(term.particle) += bodies.getInvMass(term.particle) * impulse;
      if (!term.rigid) continue;
      imstk::Quatd& q = bodies.getOrientation(term.particle);
      q.coeffs() += 0.5 * (imstk::Quatd(0, turn[0], turn[1], turn[2]) * q).coeffs();
      q.normalize();
    }
  }

  // Coulomb: the tangential impulse is at most the coefficient times the normal one, m_lambda / dt.
  void correctVelocity(imstk::PbdState& bodies, const double dt) override {
    if (m_friction == 0 || m_lambda == 0 || dt == 0) return;
    imstk::Vec3d sliding = m_row.fixedDisplacement / dt;
    for (const ParticleRow::Term& term : m_row.terms) {
      sliding += term.weight * bodies.getVelocity(term.particle);
      if (term.rigid)
        sliding += term.weight * bodies.getAngularVelocity(term.particle).cross(arm(bodies, term));
    }
    sliding -= m_row.normal.dot(sliding) * m_row.normal;
    const double speed = sliding.norm();
    if (speed == 0) return;
    const imstk::Vec3d tangent = sliding / speed;
    const double along = mobilityIn(bodies, tangent);
    if (along == 0) return;
    const double impulse = std::min(speed / along, m_friction * m_lambda / dt);
    for (const ParticleRow::Term& term : m_row.terms) {
      const imstk::Vec3d change = -impulse * term.weight * tangent;
      const imstk::Vec3d turn = turnBy(bodies, term, change);
      bodies.getVelocity(term.particle) += bodies.getInvMass(term.particle) * change;
      if (term.rigid) bodies.getAngularVelocity(term.particle) += turn;
    }
  }

 private:
  static imstk::Vec3d arm(const imstk::PbdState& bodies, const ParticleRow::Term& term) {
    if (!term.rigid) return imstk::Vec3d::Zero();
    return bodies.getOrientation(term.particle) * term.local;
  }
  // The rotation that an impulse at the term's point makes. Inertia is that of the body's frame.
  static imstk::Vec3d turnBy(const imstk::PbdState& bodies, const ParticleRow::Term& term,
                             const imstk::Vec3d& impulse) {
    if (!term.rigid) return imstk::Vec3d::Zero();
    const imstk::Quatd& q = bodies.getOrientation(term.particle);
    const imstk::Vec3d torque = q.inverse() * arm(bodies, term).cross(impulse);
    return q * imstk::Vec3d(bodies.getInvInertia(term.particle) * torque);
  }
  double mobilityIn(const imstk::PbdState& bodies, const imstk::Vec3d& direction) const {
    double mobility = 0;
    for (const ParticleRow::Term& term : m_row.terms) {
      const imstk::Vec3d impulse = term.weight * direction;
      mobility += bodies.getInvMass(term.particle) * impulse.squaredNorm() +
                  turnBy(bodies, term, impulse).dot(arm(bodies, term).cross(impulse));
    }
    return mobility;
  }

  ParticleRow m_row;
  double m_gap;
};

}  // namespace

PalpateCH::PalpateCH(std::shared_ptr<PalpateCD> detection) : m_detection(std::move(detection)) {}
PalpateCH::~PalpateCH() = default;

void PalpateCH::handle(const std::vector<imstk::CollisionElement>&,
                       const std::vector<imstk::CollisionElement>&) {
  m_rows.clear();
  m_owned.clear();
  const std::shared_ptr<SceneStep>& step = m_detection->step();
  if (step == nullptr || m_detection->pair() < 0 || !step->isEnabled(m_detection->pair())) return;
  imstk::PbdModel* model = step->modelOf(m_detection->pair());
  if (model == nullptr) return;
  warnOfUnused(*step);
  appendRows();
  model->getSolver()->addConstraints(&m_rows);
  step->addHandler(this);
}

void PalpateCH::appendRows() {
  const std::shared_ptr<SceneStep>& step = m_detection->step();
  std::vector<ParticleRow> rows;
  step->appendRows(m_detection->pair(), rows);
  const double gap = step->gapOf(m_detection->pair());
  for (const ParticleRow& row : rows) {
    m_owned.push_back(std::make_unique<RowConstraint>(row, gap));
    m_owned.back()->setFriction(getUseCorrectVelocity() ? getFriction() : 0.0);
    m_rows.push_back(m_owned.back().get());
  }
}

// Once for each handler.
void PalpateCH::warnOfUnused(SceneStep& step) {
  if (m_hasWarned) return;
  const imstk::PbdCollisionHandling defaults;
  std::string unused;
  const auto add = [&](bool isSet, const char* name) {
    if (isSet) unused += (unused.empty() ? "" : ", ") + std::string(name);
  };
  add(getRestitution() != defaults.getRestitution(), "restitution");
  add(getDeformableStiffnessA() != defaults.getDeformableStiffnessA() ||
          getDeformableStiffnessB() != defaults.getDeformableStiffnessB(),
      "stiffness");
  add(getRigidBodyCompliance() != defaults.getRigidBodyCompliance(), "compliance");
  if (unused.empty()) return;
  m_hasWarned = true;
  step.note("PalpateCH of " + step.nameOf(m_detection->pair()) + " does not use its " + unused +
            ": contacts are rigid and do not bounce.");
}

}  // namespace palpate
