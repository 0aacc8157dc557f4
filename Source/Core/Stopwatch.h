#pragma once

#include <chrono>

namespace palpate {

/// Milliseconds since construction or the last lap().
class Stopwatch {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double milliseconds = std::chrono::duration<double, std::milli>(now - m_start).count();
    m_start = now;
    return milliseconds;
  }

 private:
  std::chrono::steady_clock::time_point m_start = std::chrono::steady_clock::now();
};

/// Adds the milliseconds of its life to a sum, also where an exception ends it.
class AddedTime {
 public:
  explicit AddedTime(double& sum) : m_sum(sum) {}
  ~AddedTime() { m_sum += m_watch.lap(); }
  AddedTime(const AddedTime&) = delete;
  AddedTime& operator=(const AddedTime&) = delete;

 private:
  double& m_sum;
  Stopwatch m_watch;
};

}  // namespace palpate
