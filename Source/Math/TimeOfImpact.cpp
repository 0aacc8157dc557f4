// Part of <palpate/FeaturePairs.h>: times of impact.
#include <palpate/FeaturePairs.h>

#include "Math/ImpactQuery.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/FloatingPoint.h"

#include <algorithm>

namespace palpate {

ImpactResult findImpact(const ImpactQuery& query, const TimeOfImpactSettings& settings,
                        double upTo) {
  // A tolerance of NaN counts as the smallest one.
  const double tolerance = settings.timeTolerance > kSmallestTimeTolerance
                               ? std::min(settings.timeTolerance, 1.0)
                               : kSmallestTimeTolerance;
  const ImpactResult result = settings.minimumDistance > 0.0
                                  ? findApproach(query, settings.minimumDistance, tolerance, upTo)
                                  : findTouch(query, tolerance, upTo);
  PALPATE_ASSERT(!result.impact || (result.time >= 0.0 && result.time <= 1.0));
  return result;
}

namespace {

std::optional<double> timeOf(const ImpactQuery& query, const TimeOfImpactSettings& settings) {
  const StandardFloatingPoint standard;
  const ImpactResult result = findImpact(query, settings);
  return standard.evaluated(result.impact ? std::optional(result.time) : std::nullopt);
}

}  // namespace

std::optional<double> vertexTriangleTimeOfImpact(
    const Eigen::Vector3d& vBefore, const Eigen::Vector3d& aBefore, const Eigen::Vector3d& bBefore,
    const Eigen::Vector3d& cBefore, const Eigen::Vector3d& vNow, const Eigen::Vector3d& aNow,
    const Eigen::Vector3d& bNow, const Eigen::Vector3d& cNow,
    const TimeOfImpactSettings& settings) {
  return timeOf({ImpactQuery::Kind::VertexTriangle,
                 {{{vBefore, vNow}, {aBefore, aNow}, {bBefore, bNow}, {cBefore, cNow}}}},
                settings);
}

std::optional<double> edgeEdgeTimeOfImpact(
    const Eigen::Vector3d& p0Before, const Eigen::Vector3d& p1Before,
    const Eigen::Vector3d& q0Before, const Eigen::Vector3d& q1Before, const Eigen::Vector3d& p0Now,
    const Eigen::Vector3d& p1Now, const Eigen::Vector3d& q0Now, const Eigen::Vector3d& q1Now,
    const TimeOfImpactSettings& settings) {
  return timeOf({ImpactQuery::Kind::EdgeEdge,
                 {{{p0Before, p0Now}, {p1Before, p1Now}, {q0Before, q0Now}, {q1Before, q1Now}}}},
                settings);
}

}  // namespace palpate
