#include "DistanceField/FieldMinimum.h"

#include <palpate/DistanceField.h>

#include "Common/Sanitized.h"
#include "Common/FieldMeshes.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

namespace palpate::testing {
namespace {

using Eigen::Vector3d;

/// Calls f(weights) for weights of a regular grid over an edge or a triangle.
template <class F>
void forEachWeight(std::size_t corners, int steps, F&& f) {
  for (int i = 0; i <= steps; ++i)
    for (int j = 0; j <= (corners == 3 ? steps - i : 0); ++j) {
      const double s = double(i) / steps, t = double(j) / steps;
      f(Vector3d(1.0 - s - t, s, t));
    }
}

struct Feature {
  std::vector<Vector3d> corners;
  std::vector<double> radii;

  double valueAt(const DistanceField& field, const Vector3d& weights) const {
    Vector3d point = Vector3d::Zero();
    double radius = 0.0;
    for (std::size_t i = 0; i < corners.size(); ++i)
      point += weights[i] * corners[i], radius += weights[i] * radii[i];
    return field.value(point) - radius;
  }
};

/// The law of findDeepPoint(), against values at many points of the feature.
void checkDeepPoint(const DistanceField& field, const Feature& feature, double target,
                    double tolerance, std::size_t& found) {
  const auto deep = findDeepPoint(DistanceField::Implementation::lookupOf(field), feature.corners,
                                  feature.radii, target, tolerance);
  const double rounding = 0x1p-19 * field.band();  // neighbouring cells differ by half of it

  if (deep) {
    ++found;
    ASSERT_GE(deep->weights.minCoeff(), 0.0);
    ASSERT_NEAR(deep->weights.sum(), 1.0, 1e-12);
    ASSERT_LE(deep->value, target);
    ASSERT_NEAR(deep->value, feature.valueAt(field, deep->weights), rounding);
  }
  const double least = (deep ? deep->value : target) - tolerance - rounding;
  forEachWeight(feature.corners.size(), feature.corners.size() == 3 ? 25 : 200,
                [&](const Vector3d& weights) {
                  ASSERT_GE(feature.valueAt(field, weights), least) << weights.transpose();
                });
}

}  // namespace

TEST(FieldMinimum, FindsTheDeepestPoint) {
  Random random(1);
  std::size_t number = 0, found = 0;
  for (const auto& [name, mesh] : fieldMeshes(random)) {
    if (isLeftOut(number++)) continue;
    SCOPED_TRACE(name);
    Eigen::AlignedBox3d box;
    for (const Vector3d& p : mesh.positions) box.extend(p);
    const double size = box.diagonal().norm();
    const DistanceField field =
        DistanceField::build({mesh.positions, mesh.triangles},
                             {.errorBound = 0.01 * size, .band = 0.1 * size, .threads = 1});
    for (int i = 0; i < casesOf(120); ++i) {
      Feature feature;
      const std::size_t corners = 2 + random() % 2;
      const double reach = size * std::array{0.01, 0.1, 0.5}[random() % 3];
      const Vector3d middle = mesh.positions[random() % mesh.positions.size()];
      for (std::size_t c = 0; c < corners; ++c) {
        feature.corners.push_back(middle + randomPoint(random, -reach, reach));
        feature.radii.push_back(corners == 2 ? uniform(random, 0, 0.02 * size) : 0.0);
      }
      const double tolerance = size * std::array{0.002, 1e-4}[random() % 2];
      double ends = std::numeric_limits<double>::infinity();
      for (std::size_t c = 0; c < corners; ++c)
        ends = std::min(ends, feature.valueAt(field, Vector3d::Unit(static_cast<int>(c))));
      const double target = std::min(ends - tolerance, size * uniform(random, -0.05, 0.07));
      checkDeepPoint(field, feature, target, tolerance, found);
      if (HasFatalFailure()) return;
    }
  }
  EXPECT_GE(found, leastOf(150));
}

/// Corners on the borders of cells, and features within the planes between them.
TEST(FieldMinimum, FindsTheDeepestPointOnBordersOfCells) {
  const Mesh mesh = boxMesh({-1, -0.5, -0.25}, {1, 0.5, 0.25});
  const DistanceField field = DistanceField::build({mesh.positions, mesh.triangles},
                                                   {.errorBound = 0.01, .band = 0.3, .threads = 1});
  const FieldCells& cells = DistanceField::Implementation::lookupOf(field).cells();
  const double unit = std::ldexp(1.0, cells.exponent);
  Random random(2);
  std::size_t found = 0;
  for (int i = 0; i < casesOf(2000); ++i) {
    Feature feature;
    const std::size_t corners = 2 + random() % 2;
    const double side = std::ldexp(unit, -static_cast<int>(random() % 4));
    for (std::size_t c = 0; c < corners; ++c) {
      Vector3d p;
      for (int k = 0; k < 3; ++k)
        p[k] = side * std::round(uniform(random, -1.4, 1.4) * (k == 0 ? 1.0 : 0.6) / side);
      feature.corners.push_back(p);
      feature.radii.push_back(0.0);
    }
    checkDeepPoint(field, feature, uniform(random, -0.2, 0.2), 0.005, found);
    if (HasFatalFailure()) return;
  }
  EXPECT_GE(found, leastOf(300));
}

}  // namespace palpate::testing
