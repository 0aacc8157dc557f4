#include "Validity/MethodChoice.h"

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>

namespace palpate {

bool haveTriangles(const GeometryInStep& a, const GeometryInStep& b) {
  return a.mesh.topology.hasFaces() && b.mesh.topology.hasFaces();
}

bool mayPierce(const GeometryInStep& a, const GeometryInStep& b) {
  const auto hasEdges = [](const GeometryInStep& each) {
    return each.mesh.topology.hasFaces() || each.mesh.topology.type == GeometryType::Lines;
  };
  return (a.mesh.topology.hasFaces() && hasEdges(b)) || (b.mesh.topology.hasFaces() && hasEdges(a));
}

bool answers(Method method, double thickness, const GeometryInStep& a, const GeometryInStep& b) {
  const SupportedPairs* const row = supportOf(method, a.type(), b.type(), &a.mesh == &b.mesh);
  return row && (!row->has(kOneRadius) || (a.mesh.radii.empty() && b.mesh.radii.empty())) &&
         (!row->has(kNeedsReach) ||
          thickness + (a.mesh.largestRadius + b.mesh.largestRadius) > 0.0);
}

/// Whether the pair asks for passages, which Continuous alone finds. At rest there are none.
static bool asksForPassages(const PairSettings& settings) {
  return settings.reportCrossings || settings.rememberSides;
}

/// Auto with lines, points or shapes. At rest it chooses Proximity, which costs least. In a step
/// that moves features it chooses Continuous, which alone misses no impact, if the pair supports
/// it.
static void chooseMethod(const PairSettings& settings, const GeometryInStep& a,
                         const GeometryInStep& b, PairPlan& plan) {
  const bool still = plan.motion == 0.0 && answers(Method::Proximity, settings.thickness, a, b);
  plan.method = still || !answers(Method::Continuous, settings.thickness, a, b)
                    ? Method::Proximity
                    : Method::Continuous;
  plan.reason = still ? MethodReason::Still : MethodReason::NoAlternative;
}

/// Auto: the largest share of pairs that move further than the tolerance, for which Proximity of
/// the others pays off.
constexpr double kMostFast = 0.4;

static double motionToleranceOf(const PairSettings& settings) {
  return settings.automatic.motionTolerance < 0 ? settings.thickness / 2
                                                : settings.automatic.motionTolerance;
}

/// L: features that come within the thickness in a step in which they move this far are at its end
/// at most this much further apart.
static double extraThicknessOf(const PairSettings& settings, double motion) {
  return motion * (1.0 + kMotionSlack * settings.continuous.timeTolerance);
}

/// Features that touched in the step are at its end within their motion, and what arcs add.
/// Proximity measures them if that is at most the thickness. Otherwise the result cannot be
/// trusted, and the step need not be examined.
static void examineProximity(double thickness, PairPlan& plan) {
  plan.step.motion = plan.motion + plan.arcDeviation <= thickness ? plan.motion : 0.0;
  plan.step.arcDeviation = plan.arcDeviation;
}

PairPlan planOf(const SupportedPairs& support, const PairSettings& settings,
                const GeometryInStep& a, const GeometryInStep& b, bool moves) {
  PALPATE_ASSERT(&support == supportOf(settings.method, a.type(), b.type(), &a.mesh == &b.mesh));
  PairPlan plan;
  plan.kind = support.kind;
  plan.method = settings.method;
  StepPlan& step = plan.step;
  const double thickness = settings.thickness;
  if (moves) {
    plan.motion = largestMotion(a.range, b.range);
    plan.arcDeviation = a.arcDeviation + b.arcDeviation;
  }
  if (plan.kind == PairKind::Field) {
    if (settings.method == Method::Auto) plan.reason = MethodReason::NoAlternative;
    plan.method = Method::DistanceField;
    return plan;
  }
  if (!haveTriangles(a, b)) {
    if (settings.method == Method::Auto) chooseMethod(settings, a, b, plan);
    if (plan.method == Method::Proximity)
      examineProximity(thickness, plan);
    else if (mayPierce(a, b))
      step.motion = plan.motion;
    return plan;
  }
  step.motion = plan.motion;
  if (settings.method == Method::Auto) {
    plan.motionTolerance = step.slowMotion = motionToleranceOf(settings);
    if (plan.motion == 0.0) {
      plan.method = thickness > 0.0 ? Method::Proximity : Method::Intersection;
      plan.reason = MethodReason::Still;
    } else if (asksForPassages(settings)) {
      plan.method = Method::Continuous;
      plan.reason = MethodReason::NoAlternative;
    } else if (thickness == 0.0 || settings.contacts == Contacts::All) {
      plan.method = Method::Continuous;
      plan.reason = MethodReason::Cheapest;
    } else if (plan.motion <= plan.motionTolerance) {
      plan.method = Method::Proximity;
      plan.reason = MethodReason::Slow;
    } else if (smallestMotion(a.range, b.range) > plan.motionTolerance ||
               fastShare(a.mesh, b.mesh, plan.motionTolerance) > kMostFast) {
      plan.method = Method::Continuous;
      plan.reason = MethodReason::Fast;
    } else {
      plan.reason = MethodReason::Mixed;
    }
    step.reportsImpacts = plan.method == Method::Proximity || plan.method == Method::Auto;
    if (step.reportsImpacts)
      step.extraThickness = extraThicknessOf(settings, std::min(plan.motion, plan.motionTolerance));
  } else if (settings.method == Method::Intersection) {
    plan.searchDistance =
        plan.motion <= std::min(a.smallestHeight, b.smallestHeight) ? plan.motion : 0.0;
  } else if (settings.method == Method::Proximity) {
    examineProximity(thickness, plan);
  }
  return plan;
}

bool isWithinBand(const DistanceField& field, double thickness, double largestRadius) {
  PALPATE_ASSERT(thickness >= 0.0 && largestRadius >= 0.0);
  return thickness + largestRadius < field.band() - field.errorBound();
}

std::optional<PairPlan> planByField(const PairSettings& settings, const GeometryInStep& a,
                                    const GeometryInStep& b, const PairPlan& exact) {
  PALPATE_ASSERT(exact.motion >= 0.0);
  const GeometryInStep& body = answersByFieldOfSecond(a.type(), b.field) ? b : a;
  const GeometryInStep& other = &body == &b ? a : b;
  if (settings.method != Method::Auto || asksForPassages(settings) ||
      exact.kind != PairKind::Meshes || !body.field ||
      !supportOf(Method::DistanceField, a.type(), b.type(), &a.mesh == &b.mesh) ||
      !(settings.allowedError > 0.0 && body.field->errorBound() <= settings.allowedError))
    return {};
  // A field knows only sides of its own.
  if (other.mesh.outerSideOnly || (body.mesh.outerSideOnly && !body.field->isClosed())) return {};
  const double tolerance = motionToleranceOf(settings);
  const bool isAnswered =
      exact.motion == 0.0
          ? exact.method == Method::Proximity
          : answers(Method::Proximity, settings.thickness, a, b) && exact.motion <= tolerance;
  PairPlan plan;
  plan.kind = PairKind::Field;
  plan.method = Method::DistanceField;
  plan.reason = MethodReason::AllowedError;
  plan.motion = exact.motion;
  plan.arcDeviation = exact.arcDeviation;
  plan.motionTolerance = tolerance;
  plan.step.extraThickness = extraThicknessOf(settings, exact.motion);
  if (!isAnswered || !isWithinBand(*body.field, settings.thickness + plan.step.extraThickness,
                                   other.mesh.largestRadius))
    return {};
  return plan;
}

PairPlan planByProxy(const PairSettings& settings, PairPlan exact) {
  PALPATE_ASSERT(exact.kind == PairKind::Meshes);
  exact.kind = PairKind::AttachedProxy;
  exact.motionTolerance = motionToleranceOf(settings);
  exact.proxyThickness = settings.thickness +
                         extraThicknessOf(settings, std::min(exact.motion, exact.motionTolerance));
  return exact;
}

}  // namespace palpate
