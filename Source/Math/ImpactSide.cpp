#include "Math/CubicRoot.h"
#include "Math/ImpactQuery.h"
#include "Math/RelativeMotion.h"
#include "Math/Tolerances.h"

#include <algorithm>
#include <cmath>

namespace palpate {

namespace {

template <ImpactQuery::Kind kind>
int side(const ImpactQuery& query, double time) {
  RelativeMotion<kind> motion(query);
  for (auto* ends : {&motion.a, &motion.b, &motion.c}) {
    const double largest =
        std::max((*ends)[0].cwiseAbs().maxCoeff(), (*ends)[1].cwiseAbs().maxCoeff());
    if (!(largest > 0.0 && std::isfinite(largest))) return 0;
    for (Eigen::Vector3d& end : *ends) end /= largest;
  }
  // Ever further back, until rounding cannot hide the side.
  for (double back = 0x1p-44;; back *= 0x1p8) {
    const double t = std::max(time - back, 0.0);
    const double volume = at(t, motion.a).cross(at(t, motion.b)).dot(at(t, motion.c));
    if (volume > kSideError) return 1;
    if (volume < -kSideError) return -1;
    if (t == 0.0) return 0;
  }
}

}  // namespace

int sideBefore(const ImpactQuery& query, double time) {
  return query.kind == ImpactQuery::Kind::VertexTriangle
             ? side<ImpactQuery::Kind::VertexTriangle>(query, time)
             : side<ImpactQuery::Kind::EdgeEdge>(query, time);
}

}  // namespace palpate
