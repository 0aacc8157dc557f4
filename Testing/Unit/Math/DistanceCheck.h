#pragma once

#include "Math/ClosestPoint.h"
#include "DistanceCases.h"
#include "Math/ExactClosestPoint.h"
#include "RationalOracle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

/// Results of Distance.h compared with rational arithmetic. Failures are GoogleTest's.
namespace palpate::oracle {

inline constexpr double kAllowedUlp = 8.0;

inline bool isDegenerate(const Four& x) {
  const Vector a = toRational(x[1]);
  const Vector normal = cross(toRational(x[2]) - a, toRational(x[3]) - a);
  return dot(normal, normal) == 0;
}

inline void expectWithin(const Errors& errors) {
  EXPECT_LE(errors.distance, kAllowedUlp);
  EXPECT_LE(errors.difference, kAllowedUlp);
  EXPECT_LE(errors.witness, kAllowedUlp);
  EXPECT_LE(errors.normal, kAllowedUlp);
}

/// The normal of touching features: along the exact direction. The sum of squares, the root and the
/// quotient round.
inline void expectDirection(const Eigen::Vector3d& normal, const Vector& along) {
  const mpf_class length = root(dot(along, along));
  if (length == 0) return;
  for (int i = 0; i < 3; ++i)
    EXPECT_LE(std::abs(mpf_class(normal[i] - mpf_class(along[i], 400) / length).get_d()), 0x1p-51);
}

inline bool hasUlp(double ulp) { return std::isfinite(ulp) && ulp > 0.0; }

inline Errors checkVertexTriangle(const Four& x) {
  const VertexTriangleDistance answer = vertexTriangleDistance(x[0], x[1], x[2], x[3]);
  const Closest truth = vertexTriangle(x[0], x[1], x[2], x[3]);
  Vector difference = toRational(x[0]);
  Rational sum = 0;
  for (int i = 0; i < 3; ++i) {
    const Rational weight(answer.weights[i]);
    EXPECT_TRUE(weight >= 0);
    sum += weight;
    difference = difference - weight * toRational(x[i + 1]);
  }
  EXPECT_TRUE(sum == 1);
  EXPECT_NEAR(answer.normal.norm(), 1.0, 1e-15);
  const int feature = static_cast<int>(answer.feature);
  EXPECT_EQ(feature == 6, truth.interior);
  if (!truth.interior && !isDegenerate(x)) {
    for (int i = 0; i < 3; ++i) {
      const bool holds = feature < 3 ? feature == i : feature - 3 == i || (feature - 2) % 3 == i;
      EXPECT_EQ(truth.weights[i] != 0, holds) << "corner " << i << " of feature " << feature;
    }
  }
  if (truth.square == 0) {
    const Vector a = toRational(x[1]);
    expectDirection(answer.normal, cross(toRational(x[2]) - a, toRational(x[3]) - a));
  }
  const double ulp = ulpOfLargestDifference(x);
  if (!hasUlp(ulp)) return {};
  const Errors errors =
      errorsOf(truth, difference, answer.difference, answer.normal, answer.distance, ulp);
  expectWithin(errors);
  return errors;
}

inline Errors checkEdgeEdge(const Four& x) {
  const EdgeEdgeDistance answer = edgeEdgeDistance(x[0], x[1], x[2], x[3]);
  const Closest truth = edgeEdge(x[0], x[1], x[2], x[3]);
  const Vector p0 = toRational(x[0]), q0 = toRational(x[2]);
  const Vector difference = p0 + Rational(answer.weightA) * (toRational(x[1]) - p0) - q0 -
                            Rational(answer.weightB) * (toRational(x[3]) - q0);
  EXPECT_GE(std::min(answer.weightA, answer.weightB), 0.0);
  EXPECT_LE(std::max(answer.weightA, answer.weightB), 1.0);
  EXPECT_NEAR(answer.normal.norm(), 1.0, 1e-15);
  const bool interior = !answer.parallel && answer.featureA == EdgeFeature::Interior &&
                        answer.featureB == EdgeFeature::Interior;
  EXPECT_EQ(interior, truth.interior);
  EXPECT_EQ(crossingEdgesDistance(x[0], x[1], x[2], x[3]).has_value(), truth.interior);
  if (truth.square == 0)
    expectDirection(answer.normal, cross(toRational(x[1]) - p0, toRational(x[3]) - q0));
  const double ulp = ulpOfLargestDifference(x);
  if (!hasUlp(ulp)) return {};
  const Errors errors =
      errorsOf(truth, difference, answer.difference, answer.normal, answer.distance, ulp);
  expectWithin(errors);
  return errors;
}

}  // namespace palpate::oracle
