#include "iMSTK/TissueSweeps.h"

#include <imstkPbdConstraintContainer.h>
#include <imstkPbdModel.h>
#include <imstkPbdSolver.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace palpate {

namespace {

constexpr int kMostSweeps = 10;
constexpr double kChangeLeft = 0.01;    // share of the sum of the contacts' multipliers
constexpr std::size_t kShareNear = 10;  // at most one of so many constraints, or one ring

}  // namespace

void TissueSweeps::begin(imstk::PbdModel& model,
                         const std::vector<imstk::PbdConstraint*>& contacts) {
  m_contacts = &contacts;
  m_near.clear();
  Constraints others = model.getConstraints()->getConstraints();
  for (const Constraints& part : model.getConstraints()->getPartitionedConstraints())
    others.insert(others.end(), part.begin(), part.end());
  const std::size_t most = others.size() / kShareNear;
  std::vector<std::vector<bool>> isTouched;  // of each particle of each body
  for (const auto& body : model.getBodies().m_bodies)
    isTouched.emplace_back(static_cast<std::size_t>(body->vertices->size()));
  const auto touched = [&](const imstk::PbdParticleId& particle) {
    return isTouched[static_cast<std::size_t>(particle.first)]
                    [static_cast<std::size_t>(particle.second)];
  };
  const auto touch = [&](imstk::PbdConstraint& constraint) {
    for (const imstk::PbdParticleId& particle : constraint.getParticles()) touched(particle) = true;
  };
  for (imstk::PbdConstraint* contact : contacts) touch(*contact);
  for (;;) {
    const auto ring = std::stable_partition(others.begin(), others.end(), [&](const auto& one) {
      return std::none_of(one->getParticles().begin(), one->getParticles().end(), touched);
    });
    const auto size = static_cast<std::size_t>(others.end() - ring);
    if (size == 0 || (!m_near.empty() && m_near.size() + size > most)) break;
    for (auto one = ring; one != others.end(); ++one) touch(**one);
    m_near.insert(m_near.end(), ring, others.end());
    others.erase(ring, others.end());
  }
  model.getSolver()->addConstraints(&m_list);
}

void TissueSweeps::projectConstraint(imstk::PbdState& bodies, double dt, const SolverType& type) {
  if (type != SolverType::xPBD || m_near.empty()) return;
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    for (const auto& constraint : m_near) constraint->projectConstraint(bodies, dt, type);
    double sum = 0, change = 0;
    for (imstk::PbdConstraint* contact : *m_contacts) {
      const double before = contact->getLambda();
      contact->projectConstraint(bodies, dt, type);
      sum += contact->getLambda();
      change += std::abs(contact->getLambda() - before);
    }
    // Not a number ends the sweeps, too.
    if (!(change > kChangeLeft * sum)) return;
  }
}

}  // namespace palpate
