#pragma once

#include "Reference.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace palpate::accuracy {

/// Worst and RMS of errors that are not negative.
class ErrorStatistics {
 public:
  void add(double error) {
    m_worst = m_count == 0 ? error : std::max(m_worst, error);
    m_squares += error * error;
    ++m_count;
  }
  double worst() const { return m_count == 0 ? kNone : m_worst; }
  double rms() const {
    return m_count == 0 ? kNone : std::sqrt(m_squares / static_cast<double>(m_count));
  }

 private:
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  double m_worst = 0, m_squares = 0;
  std::size_t m_count = 0;
};

/// The errors of a method, over all steps that were added.
class Score {
 public:
  void add(const Reference&, const Claims&, const Incidence& a, const Incidence& b);

  /// Share of the touching pairs that are not reported.
  double falseNegativesPercent() const { return percent(m_falseNegatives, m_touching); }
  /// The same for pairs that do not intersect at the step's start.
  double newFalseNegativesPercent() const {
    return percent(m_falseNegatives - m_falseNegativesAtStart, m_touching - m_touchingAtStart);
  }
  /// Share of the reported pairs that do not touch.
  double falsePositivesPercent() const { return percent(m_falsePositives, m_claimed); }
  double meanEdge = 1;                     ///< L: unit of the distance errors
  ErrorStatistics distance, normal, time;  ///< % of the mean edge, degrees, % of the step
  std::size_t claims = 0;
  /// Answers that are wrong and trusted. An answer is wrong if it lacks features that touch within
  /// the step, or if a normal points to the wrong side. An answer of triangles is wrong if it has
  /// none although triangles touch.
  std::size_t wrongTrusted = 0;
  /// Share of the answers that are right and not trusted.
  double rightUntrustedPercent() const {
    return m_judged == 0 ? NAN : percent(m_rightUntrusted, m_judged);
  }

 private:
  static double percent(std::size_t part, std::size_t whole) {
    return whole == 0 ? 0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
  }
  void addErrors(const Claim&, const Impact&);

  std::size_t m_touching = 0, m_touchingAtStart = 0, m_falseNegatives = 0,
              m_falseNegativesAtStart = 0, m_claimed = 0, m_falsePositives = 0, m_judged = 0,
              m_rightUntrusted = 0;
};

}  // namespace palpate::accuracy
