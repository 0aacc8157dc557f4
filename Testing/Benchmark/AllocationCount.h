#pragma once

#include <cstddef>

namespace palpate::benchmark {

/// Calls of malloc, calloc, realloc and aligned_alloc in this process, from any library and thread.
struct AllocationCount {
  std::size_t own = 0;
  std::size_t oneTbb = 0;  ///< called by libtbb itself
};

AllocationCount allocationCount();

}  // namespace palpate::benchmark
