#include "Fcl/Differences.h"

#include <ccd/ccd.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::testing {

namespace {

AnalyticalGeometry shapeOf(Random& random, const std::string& type, double size, bool aligned) {
  const auto length = [&] {
    const double any = uniform(random, 0.1, 0.5);
    return size * (aligned ? std::ceil(4 * any) / 4 : any);
  };
  const Vector3d zero = Vector3d::Zero();
  if (type == "sphere") return Sphere{zero, length()};
  if (type == "capsule") {
    const double half = length();
    return Capsule{{0, 0, -half}, {0, 0, half}, length()};
  }
  if (type == "cylinder") {
    const double half = length();
    return Cylinder{{0, 0, -half}, {0, 0, half}, length()};
  }
  if (type == "box") {
    const double x = length(), y = length();
    return Box{zero, {x, y, length()}};
  }
  if (type == "hull") {
    ConvexHull hull;
    for (int i = 0; i < 8; ++i) {
      Vector3d p = randomPoint(random, -0.5, 0.5);
      if (aligned) p = (4 * p).array().round() / 4;
      hull.points.push_back(size * p);
    }
    return hull;
  }
  return Plane{zero, aligned ? Vector3d::UnitZ().eval() : randomPoint(random, -1, 1),
               type == "two-sided plane"};
}

/// The shape in FCL, as FclEngine makes it.
bool hasDistance(const std::string& a, const std::string& b) {
  if (a != "sphere" && b == "sphere") return hasDistance(b, a);
  if (a == "capsule") return b == "capsule";
  return a == "sphere" && b != "hull" && b != "plane" && b != "two-sided plane";
}

bool isPlane(const AnalyticalGeometry& shape) { return std::holds_alternative<Plane>(shape); }

PlacedShape placed(Random& random, const AnalyticalGeometry& shape, double size, bool aligned) {
  if (!aligned) return {shape, randomTurn(random), size * randomPoint(random, -0.5, 0.5)};
  const Vector3d at = (4 * randomPoint(random, -0.7, 0.7)).array().round() / 4;
  Matrix3d turn = Matrix3d::Identity();
  for (auto turns = random() % 3; turns > 0; --turns)  // x to y to z
    turn = (Matrix3d() << 0, 0, 1, 1, 0, 0, 0, 1, 0).finished() * turn;
  return {shape, turn, size * at};
}

Vector3d refined(const PlacedShape& a, const PlacedShape& b, Vector3d best) {
  double most = apartAlong(a, b, best);
  Random random(5);
  for (double step = 0.1; step > 1e-9; step *= 0.5)
    for (int tries = 0; tries < 12; ++tries) {
      const Vector3d next = (best + step * randomPoint(random, -1, 1)).normalized();
      const double its = apartAlong(a, b, next);
      if (its > most) most = its, best = next, tries = 0;
    }
  return best;
}

}  // namespace

const std::vector<std::string>& shapeTypes() {
  static const std::vector<std::string> types{"sphere", "capsule",        "box", "cylinder", "hull",
                                              "plane",  "two-sided plane"};
  return types;
}

double searchedDistance(const PlacedShape& a, const PlacedShape& b,
                        const std::vector<Vector3d>& hints) {
  std::vector<Vector3d> directions = hints;
  for (const PlacedShape* shape : {&a, &b})
    if (const auto* plane = std::get_if<Plane>(&shape->geometry))
      for (const double side : {1.0, -1.0})
        directions.push_back(side * (shape->rotation * plane->normal).normalized());
  if (!isPlane(a.geometry) && !isPlane(b.geometry)) {
    for (int i = 0; i < 1000; ++i) {  // evenly over the sphere
      const double z = (2 * i + 1) / 1000.0 - 1, angle = 2.399963229728653 * i;
      directions.push_back(Vector3d(std::cos(angle), std::sin(angle), 0) * std::sqrt(1 - z * z) +
                           Vector3d(0, 0, z));
    }
    const std::vector<Vector3d> facets = facetDirections(a, b);
    directions.insert(directions.end(), facets.begin(), facets.end());
  }
  std::erase_if(directions, [](const Vector3d& m) { return !(std::abs(m.norm() - 1) < 1e-6); });
  std::vector<std::pair<double, std::size_t>> order;
  for (std::size_t i = 0; i < directions.size(); ++i)
    order.emplace_back(-apartAlong(a, b, directions[i]), i);
  const std::size_t kept = std::min<std::size_t>(order.size(), 6);
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(kept), order.end());
  double most = -order[0].first;
  if (isPlane(a.geometry) || isPlane(b.geometry)) return most;
  for (std::size_t i = 0; i < kept; ++i)
    most = std::max(most, apartAlong(a, b, refined(a, b, directions[order[i].second])));
  return most;
}

namespace {

/// A shape as libccd needs it, around the origin of its frame.
void support(const void* shape, const ccd_vec3_t* direction, ccd_vec3_t* result) {
  const auto& placed = *static_cast<const PlacedShape*>(shape);
  const Vector3d along = Eigen::Map<const Vector3d>(direction->v).stableNormalized();
  double radius = 0;
  std::vector<Vector3d> corners = cornersOf(placed, radius);
  if (const auto* c = std::get_if<Cylinder>(&placed.geometry)) {
    const Vector3d axis = placed.rotation * (c->p1 - c->p0).normalized();
    const Vector3d rim = c->radius * (along - axis.dot(along) * axis).stableNormalized();
    for (const Vector3d& end : {c->p0, c->p1})
      corners.push_back(placed.rotation * end + placed.translation + rim);
  }
  Eigen::Map<Vector3d>(result->v) = *std::max_element(corners.begin(), corners.end(),
                                                      [&](const Vector3d& p, const Vector3d& q) {
                                                        return p.dot(along) < q.dot(along);
                                                      }) +
                                    radius * along;
}

void centre(const void* shape, ccd_vec3_t* result) {
  const auto& placed = *static_cast<const PlacedShape*>(shape);
  Vector3d middle = Vector3d::Zero();
  if (const auto* hull = std::get_if<ConvexHull>(&placed.geometry))
    for (const Vector3d& p : hull->points) middle += p / static_cast<double>(hull->points.size());
  Eigen::Map<Vector3d>(result->v) = placed.rotation * middle + placed.translation;
}

void compareLibccd(const PlacedShape& a, const PlacedShape& b, double size, double distance,
                   Tally& tally) {
  ccd_t ccd;
  CCD_INIT(&ccd);
  ccd.support1 = ccd.support2 = support;
  ccd.center1 = ccd.center2 = centre;
  ccd.max_iterations = 1000;
  ccd.epa_tolerance = ccd.mpr_tolerance = 1e-6 * size;
  const auto count = [&](auto* penetration, int& missed, int& wrong, double& worst) {
    ccd_real_t depth = 0;
    ccd_vec3_t direction, position;
    const bool overlap = penetration(&a, &b, &ccd, &depth, &direction, &position) == 0;
    if (std::abs(distance) > kTolerance * size && overlap != (distance < 0)) ++missed;
    if (!overlap || distance > 0) return;
    const double error = std::abs(depth + distance) / size;
    wrong += error > kTolerance;
    worst = std::max(worst, error);
  };
  count(ccdGJKPenetration, tally.epaWrongOverlap, tally.epaWrong, tally.worstEpa);
  count(ccdMPRPenetration, tally.mprWrongOverlap, tally.mprWrong, tally.worstMpr);
}

}  // namespace

Tally compare(const std::string& typeA, const std::string& typeB, Layout layout,
              int configurations) {
  const double size = layout == Layout::Small ? 1e-3 : 1, tolerance = kTolerance * size;
  const bool aligned = layout == Layout::Grid;
  Random random(7);
  Tally tally;
  while (tally.configurations < configurations) {
    const AnalyticalGeometry shapeA = shapeOf(random, typeA, size, aligned),
                             shapeB = shapeOf(random, typeB, size, aligned);
    ShapePair<OctreeBasedCD> palpate(shapeA, shapeB, 100 * size);
    const double thickness = hasDistance(typeA, typeB) ? 100 * size : 0;
    ShapePair<FclEngine> fcl(shapeA, shapeB, thickness), exchanged(shapeB, shapeA, thickness);
    for (int i = 0; i < 20 && tally.configurations < configurations; ++i) {
      const PlacedShape a = placed(random, shapeA, size, aligned),
                        b = placed(random, shapeB, size, aligned);
      ++tally.configurations;
      const ShapeShapeContact ours = *palpate.at(a, b);
      tally.overlaps += ours.distance < 0;
      if (!isPlane(shapeA) && !isPlane(shapeB)) compareLibccd(a, b, size, ours.distance, tally);
      const auto theirs = fcl.at(a, b), back = exchanged.at(b, a);
      if (!theirs && ours.distance > -tolerance) continue;  // without a thickness
      const double its = theirs ? theirs->distance : 0, other = back ? back->distance : 0;
      tally.exchanged += std::abs(its - other) > tolerance;
      if (std::abs(its - ours.distance) <= tolerance) continue;
      ++tally.differ;
      std::vector<Vector3d> hints{ours.normal};
      if (theirs) hints.push_back(theirs->normal);
      const double truth = searchedDistance(a, b, hints);
      const double fclError = std::abs(its - truth) / size,
                   palpateError = std::abs(ours.distance - truth) / size;
      tally.fclWrong += fclError > kTolerance;
      tally.palpateWrong += palpateError > kTolerance;
      tally.worstFcl = std::max(tally.worstFcl, fclError);
      tally.worstPalpate = std::max(tally.worstPalpate, palpateError);
    }
  }
  return tally;
}

}  // namespace palpate::testing
