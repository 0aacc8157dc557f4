#pragma once

#include "Truth.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace palpate::accuracy {

/// Of errors, each not negative.
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

/// What a method got wrong over the steps that were added.
class Score {
 public:
  void add(const Truth&, const Claims&, const Incidence& a, const Incidence& b);

  double missedPercent() const { return percent(m_missed, m_touching); }
  /// Of the pairs that were apart at the step's start.
  double newMissedPercent() const { return percent(m_missed - m_oldMissed, m_touching - m_old); }
  double inventedPercent() const { return percent(m_invented, m_claimed); }
  double meanEdge = 1;                     ///< L, to which distances are relative
  ErrorStatistics distance, normal, time;  ///< % of the mean edge, degrees, % of the step
  std::size_t claims = 0;
  /// Of answers: trusted ones that are wrong, and others that are right. Wrong: features that touch
  /// within the step are not among the claims, or a claim's normal points to the other side; of a
  /// method that speaks of triangles, that nothing touches although something does.
  std::size_t silentFailures = 0;
  double falseAlarmsPercent() const {
    return m_judged == 0 ? NAN : percent(m_falseAlarms, m_judged);
  }

 private:
  static double percent(std::size_t part, std::size_t whole) {
    return whole == 0 ? 0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
  }
  void addErrors(const Claim&, const Impact&);

  std::size_t m_touching = 0, m_missed = 0, m_old = 0, m_oldMissed = 0, m_judged = 0,
              m_falseAlarms = 0, m_claimed = 0, m_invented = 0;
};

}  // namespace palpate::accuracy
