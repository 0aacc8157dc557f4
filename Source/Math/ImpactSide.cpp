#include "Math/ClosestPoint.h"
#include "Exact/CubicRoot.h"
#include "Exact/ExactVector.h"
#include "Math/ImpactQuery.h"
#include "Math/RelativeMotion.h"
#include "Math/Tolerances.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate {

namespace {

/// Sign of det(A, B, C) at a multiple of 2^-53 of the step.
int exactSideAt(const ImpactQuery& query, double time) {
  const auto elapsed = static_cast<unsigned long>(std::ldexp(time, 53)),
             remaining = (1ul << 53) - elapsed;
  std::array<exact::Vector<Integer>, 3> rows;
  const auto axes = ImpactQuery::axes(query.kind);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) {
      const auto coordinate = [&](int vertex) -> Integer {
        const ImpactQuery::Step& step = query.vertices[vertex];
        return scaledInteger(step.before[k]) * remaining + scaledInteger(step.now[k]) * elapsed;
      };
      rows[i][k] = coordinate(axes[i][0]) - coordinate(axes[i][1]);
    }
  const auto& [a, b, c] = rows;
  return exact::signOf(exact::volumeOf(a, b, c));
}

/// The first side that is not zero at times further and further before the impact.
int exactSide(const ImpactQuery& query, double time, std::size_t* exactDecisions) {
  if (exactDecisions) ++*exactDecisions;
  for (double back = kFirstStepBack;; back *= 0x1p8) {
    const double t = std::max(time - back, 0.0);
    const int sign = exactSideAt(query, t);
    if (sign != 0 || t == 0.0) return sign;
  }
}

template <ImpactQuery::Kind kind>
int side(const ImpactQuery& query, double time, std::size_t* exactDecisions) {
  RelativeMotion<kind> motion(query);
  for (auto* ends : {&motion.a, &motion.b, &motion.c}) {
    const double largest =
        std::max((*ends)[0].cwiseAbs().maxCoeff(), (*ends)[1].cwiseAbs().maxCoeff());
    if (!(largest > 0.0 && std::isfinite(largest))) return exactSide(query, time, exactDecisions);
    for (Eigen::Vector3d& end : *ends) end /= largest;
  }
  // Goes further and further back until the side is beyond rounding.
  for (double back = kFirstStepBack;; back *= 0x1p8) {
    const double t = std::max(time - back, 0.0);
    const double volume = at(t, motion.a).cross(at(t, motion.b)).dot(at(t, motion.c));
    if (volume > kSideError) return 1;
    if (volume < -kSideError) return -1;
    if (t == 0.0) return exactSide(query, time, exactDecisions);
  }
}

}  // namespace

int sideBefore(const ImpactQuery& query, double time, std::size_t* exactDecisions) {
  return query.kind == ImpactQuery::Kind::VertexTriangle
             ? side<ImpactQuery::Kind::VertexTriangle>(query, time, exactDecisions)
             : side<ImpactQuery::Kind::EdgeEdge>(query, time, exactDecisions);
}

std::array<Eigen::Vector3d, 4> positionsAt(const ImpactQuery& query, double time) {
  std::array<Eigen::Vector3d, 4> p;
  const auto place = [&](const Eigen::Vector3d& start, const Eigen::Vector3d& end) {
    for (int i = 0; i < 4; ++i)
      p[i] =
          (1.0 - time) * (query.vertices[i].at(0) - start) + time * (query.vertices[i].at(1) - end);
  };
  place(query.vertices[0].at(0), query.vertices[0].at(1));
  const bool finite = std::all_of(
      p.begin(), p.end(), [](const Eigen::Vector3d& position) { return position.allFinite(); });
  if (!finite) place(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  return p;
}

Eigen::Vector3d normalOfTouch(const ImpactQuery& query, double time,
                              const std::array<Eigen::Vector3d, 4>& p,
                              std::size_t& exactDecisions) {
  const Eigen::Vector3d normal = query.kind == ImpactQuery::Kind::VertexTriangle
                                     ? windingNormal(p[1], p[2], p[3])
                                     : normalOfCrossing(p[0], p[1], p[0], p[0] + (p[3] - p[2]));
  return sideBefore(query, time, &exactDecisions) < 0 ? Eigen::Vector3d(-normal) : normal;
}

}  // namespace palpate
