#include "DistanceField/SurfaceSign.h"

#include "Queries/Containment.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <cmath>
#include <limits>
#include <numbers>

namespace palpate {

using Eigen::Vector3d;

namespace {

constexpr double kMostDefect = 0.375;  ///< of the winding number, from an integer, where reliable
constexpr double kNumberError = 1.0 / 64.0;
/// A fan over more edges takes longer than the sum over clusters of triangles.
constexpr std::size_t kMostFanEdges = 512;

/// In radii of the ball: from its centre to the point at which the winding number is evaluated.
/// Centres of cells often lie on the surface, this point does not.
const Vector3d kAside{0.0131, 0.0277, 0.0193};

}  // namespace

SurfaceSign::SurfaceSign(const Body& body, bool isClosed) : m_body(body), m_isClosed(isClosed) {
  PALPATE_ASSERT(body.tree.octree().isBuilt());
  if (!isClosed) m_boundary.emplace(body.mesh);
}

bool SurfaceSign::isInside(const Vector3d& point, PointQueryStack& stack) const {
  const InsideRule rule = m_isClosed ? InsideRule::Closed : InsideRule::WindingNumber;
  return palpate::isInside(m_body, point, {.rule = rule}, Engine::Octree, stack);
}

SurfaceSign::Reliability SurfaceSign::in(const Vector3d& centre, double radius) const {
  PALPATE_ASSERT(radius >= 0.0);
  if (m_isClosed || m_boundary->isEmpty()) return Reliability::Reliable;
  const double way = (1.0 + kAside.norm()) * radius,
               change = way * m_boundary->steepness(centre, radius, kMostDefect / way);
  if (!(change < kMostDefect)) return Reliability::Unknown;
  const Vector3d aside = centre + radius * kAside;
  SolidAngleShare number{0.0, std::numeric_limits<double>::infinity()};
  if (m_boundary->size() <= kMostFanEdges) number = m_boundary->fanNumber(aside);
  if (!(number.error <= kNumberError))
    number = m_body.prepared->windingNumbers.value(m_body, aside, kNumberError);
  const double defect = std::abs(number.value - std::round(number.value)),
               doubt = change + number.error + kFieldError;
  if (defect + doubt < kMostDefect) return Reliability::Reliable;
  return defect - doubt > kMostDefect ? Reliability::Unreliable : Reliability::Unknown;
}

double SurfaceSign::reach() const {
  PALPATE_ASSERT(m_isClosed || m_boundary.has_value());
  // Along a way that leads straight away from the set, the distance D from the boundary grows. The
  // winding number falls to 0, and its change is at most the integral of length / 4 pi D².
  return m_isClosed
             ? 0.0
             : (1.0 + kFieldError) * m_boundary->length() / (4.0 * std::numbers::pi * kMostDefect);
}

}  // namespace palpate
