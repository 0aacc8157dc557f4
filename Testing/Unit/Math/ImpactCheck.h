#pragma once

#include "ImpactCases.h"
#include "Math/ImpactQuery.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <optional>
#include <string>

/// Times of impact compared with rational arithmetic. Failures are GoogleTest's.
namespace palpate {

inline std::string text(const ImpactCase& query) {
  std::string result = query.edges ? "edges" : "vertex and triangle";
  for (const Eigen::Vector3d& p : query.positions) {
    char line[100];
    std::snprintf(line, sizeof line, "\n  %a %a %a", p[0], p[1], p[2]);
    result += line;
  }
  return result;
}

/// The oracle's decision; a time that is not late, and early by at most the tolerance. For both
/// paths.
inline void expectTrue(const ImpactCase& query, double tolerance, int& impacts) {
  std::optional<impact::Real> truth = impact::Query(query.edges, query.positions).firstTouch();
  const auto check = [&](bool impact, double time, const char* path) {
    ASSERT_EQ(impact, truth.has_value()) << path << ", " << text(query);
    if (!impact) return;
    EXPECT_GE(time, 0.0) << path << ", " << text(query);
    EXPECT_GE(truth->compare(time), 0) << path << " late at " << time << ", " << text(query);
    EXPECT_LE(truth->compare(impact::Rational(time) + impact::Rational(tolerance)), 0)
        << path << " early at " << time << ", " << text(query);
  };
  const std::optional<double> time = query.time({0.0, tolerance});
  check(time.has_value(), time.value_or(0.0), "findTouch");
  const ImpactResult exact = findTouchExactly(query.query(), tolerance);
  check(exact.impact, exact.time, "findTouchExactly");
  impacts += truth.has_value();
}

}  // namespace palpate
