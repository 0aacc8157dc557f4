#pragma once

#include "Math/ImpactQuery.h"

#include <Eigen/Core>

namespace palpate {

/// Whether two features may come within their radii after a time of the step.
///
/// normal   unit, from the second feature's closest point to the first's at that time. It is not
///          used if the distance is at most the radii.
/// distance L: of these points.
/// radii    L: the sum of both.
/// Law      false is certain: planes separate the features until the end. True may be wrong where
///          the features turn far around each other.
/// Cost     at most eight distances, none where one plane separates the features.
bool mayMeetAfter(const ImpactQuery&, double time, const Eigen::Vector3d& normal, double distance,
                  double radii);

}  // namespace palpate
