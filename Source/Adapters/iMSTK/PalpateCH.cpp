#include <palpate/imstk/PalpateCH.h>

#include "iMSTK/SceneStep.h"
#include "iMSTK/TissueSweeps.h"

#include <imstkPbdContactConstraint.h>
#include <imstkPbdModel.h>
#include <imstkPbdModelConfig.h>
#include <imstkPbdSolver.h>

#include <algorithm>
#include <string>
#include <utility>

namespace palpate {

namespace {

constexpr int kVelocitySweeps = 10;

// Pushes until the gap is there. It takes back what it pushed too far in the step, and never pulls.
// A PbdContactConstraint, so that iMSTK's classes find its force.
class RowConstraint : public imstk::PbdContactConstraint {
 public:
  RowConstraint(const ParticleRow& row, double gap)
      : PbdContactConstraint(static_cast<int>(row.terms.size())), m_row(row), m_gap(gap) {
    for (std::size_t i = 0; i < row.terms.size(); ++i) {
      m_particles[i] = row.terms[i].particle;
      m_dcdx[i] = row.terms[i].weight * row.normal;
    }
    m_compliance = 0;
  }
  const std::string getTypeName() const override { return "PalpateRowConstraint"; }

  // Restitution starts from the velocity before the solver. Slower contacts rest.
  void setBounce(imstk::PbdState& bodies, double restitution, double slowest, double dt) {
    if (restitution <= 0 || dt == 0) return;
    const double approach = -m_row.normal.dot(velocityIn(bodies, dt));
    if (approach > slowest) m_bounce = restitution * approach;
  }

  bool computeValueAndGradient(imstk::PbdState& bodies, double& c,
                               std::vector<imstk::Vec3d>& dcdx) override {
    c = -m_row.offset - m_gap;
    for (std::size_t i = 0; i < m_row.terms.size(); ++i) {
      const ParticleRow::Term& term = m_row.terms[i];
      m_r[i] = arm(bodies, term);
      c += term.weight * m_row.normal.dot(bodies.getPosition(term.particle) + m_r[i]);
      dcdx[i] = term.weight * m_row.normal;
    }
    return c < 0 || m_lambda > 0;
  }

  void projectConstraint(imstk::PbdState& bodies, const double dt,
                         const SolverType& type) override {
    double c = 0;
    const bool acts = computeValueAndGradient(bodies, c, m_dcdx);
    const bool yields = type == SolverType::xPBD && dt > 0;
    const double compliance = yields ? m_compliance / (dt * dt) : 0.0;
    c += compliance * m_lambda;
    m_C = std::min(c, 0.0);  // for SceneStep
    if (!acts) return;
    const double mobility = mobilityIn(bodies, m_row.normal);
    if (mobility == 0) return;
    const double change = std::max(-c / (mobility + compliance), -m_lambda);
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

  // PbdModel calls each row once. The first corrects with all rows of its pair, so that the
  // corners of a body agree.
  void correctVelocity(imstk::PbdState& bodies, const double dt) override {
    if (m_rows == nullptr || dt == 0) return;
    for (int sweep = 0; sweep < kVelocitySweeps; ++sweep)
      for (const auto& row : *m_rows) static_cast<RowConstraint&>(*row).correct(bodies, dt);
  }
  void correctAll(const std::vector<std::unique_ptr<imstk::PbdConstraint>>& rows) {
    m_rows = &rows;
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
  // The relative velocity at the contact.
  imstk::Vec3d velocityIn(const imstk::PbdState& bodies, double dt) const {
    imstk::Vec3d velocity = m_row.fixedDisplacement / dt;
    for (const ParticleRow::Term& term : m_row.terms) {
      velocity += term.weight * bodies.getVelocity(term.particle);
      if (term.rigid)
        velocity += term.weight * bodies.getAngularVelocity(term.particle).cross(arm(bodies, term));
    }
    return velocity;
  }
  void push(imstk::PbdState& bodies, const imstk::Vec3d& impulse) const {
    for (const ParticleRow::Term& term : m_row.terms) {
      const imstk::Vec3d change = term.weight * impulse;
      const imstk::Vec3d turn = turnBy(bodies, term, change);
      bodies.getVelocity(term.particle) += bodies.getInvMass(term.particle) * change;
      if (term.rigid) bodies.getAngularVelocity(term.particle) += turn;
    }
  }

  // Newton's restitution along the normal. Coulomb's friction along the surface: its impulse is at
  // most the coefficient times the normal one, m_lambda / dt.
  void correct(imstk::PbdState& bodies, double dt) {
    if (m_lambda == 0) return;
    if (m_bounce > 0) {
      const double missing = m_bounce - m_row.normal.dot(velocityIn(bodies, dt));
      const double along = mobilityIn(bodies, m_row.normal);
      const double change = along > 0 ? std::max(missing / along, -m_bounceImpulse) : 0.0;
      m_bounceImpulse += change;
      push(bodies, change * m_row.normal);
    }
    if (m_friction == 0) return;
    imstk::Vec3d sliding = velocityIn(bodies, dt);
    sliding -= m_row.normal.dot(sliding) * m_row.normal;
    const double speed = sliding.norm();
    const double along = speed > 0 ? mobilityIn(bodies, sliding / speed) : 0.0;
    if (along == 0) return;
    imstk::Vec3d impulse = m_frictionImpulse - sliding / along;
    const double most = m_friction * m_lambda / dt;
    if (impulse.norm() > most) impulse *= most / impulse.norm();
    push(bodies, impulse - m_frictionImpulse);
    m_frictionImpulse = impulse;
  }

  ParticleRow m_row;
  double m_gap;
  double m_bounce = 0;  // speed after the contact
  double m_bounceImpulse = 0;
  imstk::Vec3d m_frictionImpulse = imstk::Vec3d::Zero();
  const std::vector<std::unique_ptr<imstk::PbdConstraint>>* m_rows = nullptr;  // of the first row
};

}  // namespace

PalpateCH::PalpateCH(std::shared_ptr<PalpateCD> detection)
    : m_detection(std::move(detection)), m_sweeps(std::make_unique<TissueSweeps>()) {
  setRigidBodyCompliance(0);
  setDeformableStiffnessA(1);
  setDeformableStiffnessB(1);
}
PalpateCH::~PalpateCH() = default;

void PalpateCH::handle(const std::vector<imstk::CollisionElement>&,
                       const std::vector<imstk::CollisionElement>&) {
  m_collisionConstraints.clear();
  m_owned.clear();
  const std::shared_ptr<SceneStep>& step = m_detection->step();
  if (step == nullptr || m_detection->pair() < 0 || !step->isEnabled(m_detection->pair())) return;
  imstk::PbdModel* model = step->modelOf(m_detection->pair());
  if (model == nullptr) return;
  warnOfChanges(*step);
  appendRows();
  model->getSolver()->addConstraints(&m_collisionConstraints);
  if (!m_collisionConstraints.empty() && step->sweepsFurther(m_detection->pair()))
    m_sweeps->begin(*model, m_collisionConstraints);
  step->addHandler(this);
}

void PalpateCH::appendRows() {
  const std::shared_ptr<SceneStep>& step = m_detection->step();
  std::vector<ParticleRow> rows;
  step->appendRows(m_detection->pair(), rows);
  const double gap = step->gapOf(m_detection->pair());
  imstk::PbdModel& model = *step->modelOf(m_detection->pair());
  const double dt = model.getTimeStep();
  for (const ParticleRow& from : rows) {
    auto row = std::make_unique<RowConstraint>(from, gap);
    if (step->hasRigidBody(m_detection->pair())) row->setCompliance(getRigidBodyCompliance());
    if (getUseCorrectVelocity()) {
      row->setFriction(getFriction());
      // What gravity gives in two steps does not bounce.
      row->setBounce(model.getBodies(), getRestitution(),
                     2 * model.getConfig()->m_gravity.norm() * dt, dt);
    }
    if (m_owned.empty()) row->correctAll(m_owned);
    m_collisionConstraints.push_back(row.get());
    m_owned.push_back(std::move(row));
  }
}

// Once for each handler.
void PalpateCH::warnOfChanges(SceneStep& step) {
  if (m_hasWarned) return;
  const std::string name = "PalpateCH of " + step.nameOf(m_detection->pair());
  if (getDeformableStiffnessA() != 1 || getDeformableStiffnessB() != 1) {
    step.note(name + " does not use its stiffness: contacts of deformable bodies are rigid.");
    m_hasWarned = true;
  }
  if (getFriction() != 0 && !step.hasRigidBody(m_detection->pair())) {
    step.note(name +
              " takes its friction as Coulomb's coefficient, not as the share of the "
              "sliding that a contact ends in a step.");
    m_hasWarned = true;
  }
}

}  // namespace palpate
