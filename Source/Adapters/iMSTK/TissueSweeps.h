#pragma once

#include <imstkMath.h>
#include <imstkPbdConstraint.h>

#include <memory>
#include <string>
#include <vector>

namespace imstk {
class PbdModel;
}  // namespace imstk

namespace palpate {

/// Further sweeps, in each iteration of PbdSolver, over the contacts and the internal constraints
/// around them. PbdSolver begins each step with multipliers of 0: few iterations do not build up
/// the stress around a small tool, which then feels softer tissue.
/// Around   the constraints that share a particle with a contact, then those that share one with
///          these, and so on, up to a tenth of the solver's constraints.
/// Law      the solver's constraints are projected more often. What its iterations converge to is
///          the same.
/// Stops    once a sweep changes the multipliers of the contacts by at most a hundredth of their
///          sum, and after ten sweeps: at most about the cost of the solver's own iterations,
///          unless the contacts alone have more than a tenth of the constraints. Sweeps run in one
///          thread.
class TissueSweeps : public imstk::PbdConstraint {
 public:
  const std::string getTypeName() const override { return "PalpateTissueSweeps"; }

  /// For the next solve, after `contacts` were added to the model's solver. They stay until then.
  void begin(imstk::PbdModel& model, const std::vector<imstk::PbdConstraint*>& contacts);

  bool computeValueAndGradient(imstk::PbdState&, double&, std::vector<imstk::Vec3d>&) override {
    return false;
  }
  /// All sweeps of an iteration. None with plain PBD, whose iterations make a body stiffer.
  void projectConstraint(imstk::PbdState& bodies, double dt, const SolverType& type) override;

 private:
  using Constraints = std::vector<std::shared_ptr<imstk::PbdConstraint>>;

  Constraints m_near;
  const std::vector<imstk::PbdConstraint*>* m_contacts = nullptr;
  std::vector<imstk::PbdConstraint*> m_list{this};  // for the solver
};

}  // namespace palpate
