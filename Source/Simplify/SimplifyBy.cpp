#include "Simplify/SimplifyBy.h"

#include <palpate/Error.h>
#include <palpate/SpatialQueries.h>

#include "Simplify/SimplifyRounds.h"
#include "Queries/ClosedBody.h"
#include "Bodies/Body.h"
#include "Bodies/InputChecks.h"
#include "Core/Assert.h"
#include "Core/FloatingPoint.h"
#include "Core/Text.h"
#include "Core/Threads.h"

#include <algorithm>
#include <string>

namespace palpate {

namespace {

/// Of maxDistance, relative to the largest coordinate. A corner of the result is then resolved to
/// 2^-23 of maxDistance.
constexpr double kLeastDistance = 0x1p-30;
/// L: squares of areas are doubles within these.
constexpr double kShortestSide = 0x1p-200, kLongestSide = 0x1p200;

/// Returns the largest coordinate.
double checkSize(const TriangleMeshView& mesh, double maxDistance) {
  double largest = 0.0;
  Eigen::Vector3d low = Eigen::Vector3d::Constant(kInfinity), high = -low;
  for (const Triangle& triangle : mesh.triangles)
    for (const std::uint32_t v : triangle) {
      const Eigen::Vector3d& p = mesh.positions[v];
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
      largest = std::max(largest, p.cwiseAbs().maxCoeff());
    }
  const double longest = (high - low).maxCoeff();
  if (!(longest >= kShortestSide && longest <= kLongestSide))
    throw Error(ErrorCode::InvalidSettings,
                "geometry 0: the longest side of its box is " + textOf(longest) +
                    "; simplify() needs one in [2^-200, 2^200]",
                GeometryId{0});
  const double least = kLeastDistance * std::max(largest, longest);
  if (!(maxDistance >= least && maxDistance <= kLongestSide))
    throw Error(ErrorCode::InvalidSettings, "maxDistance is " + textOf(maxDistance) +
                                                "; it must be in [" + textOf(least) +
                                                ", 2^200] for this mesh");
  return largest;
}

}  // namespace

SimplifiedMesh simplifyBy(CollapseEdges collapse, const TriangleMeshView& mesh,
                          const SimplifySettings& settings) {
  PALPATE_ASSERT(collapse != nullptr);
  const StandardFloatingPoint standard;
  checkPositive(settings.maxDistance, "maxDistance");
  checkThreads(settings.threads);
  const Threads threads(settings.threads);
  Body body(GeometryId{0});
  makeClosedBody(mesh, threads, body);
  const double largest = checkSize(mesh, settings.maxDistance);
  return simplifyInRounds(collapse, body, settings, largest, threads);
}

}  // namespace palpate
