#pragma once

#include <atomic>

namespace palpate {

/// Lowers a value on any thread. The least of all remains, in whatever order they come.
inline void lower(double& least, double value) {
  std::atomic_ref<double> shared(least);
  double known = shared.load(std::memory_order_relaxed);
  while (value < known && !shared.compare_exchange_weak(known, value, std::memory_order_relaxed)) {
  }
}

/// The value so far. It is not below the least of all.
inline double leastSoFar(double& least) {
  return std::atomic_ref<double>(least).load(std::memory_order_relaxed);
}

}  // namespace palpate
