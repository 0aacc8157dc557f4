#pragma once

#include "Core/Assert.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace palpate {

/// Disjoint sets of numbers. A set is named by its lowest number, so that names do not depend on
/// the order in which sets were joined.
class DisjointSets {
 public:
  /// Makes one set of each number below `size`.
  void start(std::size_t size) {
    m_parent.resize(size);
    std::iota(m_parent.begin(), m_parent.end(), 0u);
  }
  std::uint32_t find(std::uint32_t i) const {
    PALPATE_ASSERT(i < m_parent.size());
    while (m_parent[i] != i) i = m_parent[i] = m_parent[m_parent[i]];
    return i;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    const auto [low, high] = std::minmax({find(a), find(b)});
    m_parent[high] = low;
  }

 private:
  mutable std::vector<std::uint32_t> m_parent;  ///< at most the number itself
};

}  // namespace palpate
