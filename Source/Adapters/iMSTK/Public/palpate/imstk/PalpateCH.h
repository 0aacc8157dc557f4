#pragma once

#include <palpate/Export.h>
#include <palpate/imstk/PalpateCD.h>

#include <imstkMacros.h>
#include <imstkPbdCollisionHandling.h>

#include <memory>
#include <vector>

namespace palpate {

class TissueSweeps;

/// Handles the contacts of a PalpateCD by one-sided constraints, which only push: each keeps the
/// gap of PalpateSettings. iMSTK's own constraints are equalities, which pull bodies together that
/// are within a thickness and do not touch. Vertices that a PointwiseMap maps move the particles
/// they come from. Rigid PbdObjects move and turn. Other objects do not move.
/// Friction of PbdObjectCollision::setFriction(): Coulomb's coefficient, on the velocities of the
///          step. For deformable bodies iMSTK's own handler takes the number as the share of the
///          sliding that a contact ends: a warning says so. An object that no solver moves slides
///          as the program moves it.
/// Restitution: the share of the speed of approach with which bodies part, of contacts that are
///          faster than gravity makes a body in two steps.
/// Compliance: of pairs with a rigid PbdObject, 0 by default. The guard keeps bodies apart.
/// Tool     While a force from outside the solver, as that of a PbdObjectController, acts on a
///          rigid PbdObject within the thickness of a deformable one, each iteration of xPBD sweeps
///          further over the contacts and the internal constraints around them. The tool then feels
///          nearly the force of many iterations. The sweeps of an iteration end once one changes
///          the contact forces by at most 1 %, and after ten. No other pair is swept further,
///          and none with PalpateSettings::furtherSweeps = false.
/// Unused   stiffness, 1 by default: a warning names it if it was set.
///          With setUseCorrectVelocity(false) there is no friction and no restitution.
class PALPATE_EXPORT PalpateCH : public imstk::PbdCollisionHandling {
 public:
  explicit PalpateCH(std::shared_ptr<PalpateCD> detection);
  ~PalpateCH() override;
  IMSTK_TYPE_NAME(PalpateCH)

  /// For the scene's step: adds rows of the last detection to getConstraints(), in the order of
  /// palpate::appendRows().
  void appendRows();
  int pair() const { return m_detection->pair(); }

 protected:
  void handle(const std::vector<imstk::CollisionElement>& elementsA,
              const std::vector<imstk::CollisionElement>& elementsB) override;

 private:
  void warnOfChanges(SceneStep& step);

  std::shared_ptr<PalpateCD> m_detection;
  bool m_hasWarned = false;
  std::vector<std::unique_ptr<imstk::PbdConstraint>> m_owned;
  std::unique_ptr<TissueSweeps> m_sweeps;
};

}  // namespace palpate
