#include "Math/MotionBound.h"

#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// The largest coordinate difference between the two features.
template <ImpactQuery::Kind kind>
double sizeAtEnd(const ImpactQuery& query) {
  double size = 0.0;
  for (const ImpactQuery::Difference& d : ImpactQuery::corners(kind))
    size = std::max(size, (query.vertices[d[0]].at(1) - query.vertices[d[1]].at(1))
                              .template lpNorm<Eigen::Infinity>());
  return size;
}

}  // namespace

template <ImpactQuery::Kind kind>
double motionBound(const ImpactQuery& query) {
  const auto motionOf = [&](const ImpactQuery::Difference& d) -> Vector3d {
    return (query.vertices[d[0]].at(1) - query.vertices[d[1]].at(1)) -
           (query.vertices[d[0]].at(0) - query.vertices[d[1]].at(0));
  };
  double square = 0.0;
  for (const ImpactQuery::Difference& d : ImpactQuery::corners(kind))
    square = std::max(square, motionOf(d).squaredNorm());
  double motion = 0.0;
  if (square > kSmallestSlowSquare && std::isfinite(square))
    motion = std::sqrt(square);
  else
    for (const ImpactQuery::Difference& d : ImpactQuery::corners(kind))
      motion = std::max(motion, stableLength(motionOf(d)));
  return motion + kMotionError * (motion + sizeAtEnd<kind>(query));
}

template <ImpactQuery::Kind kind>
bool mayHaveTouched(const ImpactQuery& query, double distance, double motionLimit) {
  PALPATE_ASSERT(motionLimit >= 0.0);
  return distance <= motionLimit + kMotionError * (motionLimit + sizeAtEnd<kind>(query)) &&
         distance <= motionBound<kind>(query);
}

template double motionBound<ImpactQuery::Kind::VertexTriangle>(const ImpactQuery&);
template double motionBound<ImpactQuery::Kind::EdgeEdge>(const ImpactQuery&);
template bool mayHaveTouched<ImpactQuery::Kind::VertexTriangle>(const ImpactQuery&, double, double);
template bool mayHaveTouched<ImpactQuery::Kind::EdgeEdge>(const ImpactQuery&, double, double);

}  // namespace palpate
