#pragma once

#include "Core/SimdPath.h"

#include <string>
#include <vector>

namespace palpate::testing {

/// `for (const std::string& path : EverySimdPath())` runs its body on each SIMD path of the build
/// and machine. Afterwards the best one is used again, also if the loop ends early.
class EverySimdPath {
 public:
  EverySimdPath() = default;
  EverySimdPath(const EverySimdPath&) = delete;
  EverySimdPath& operator=(const EverySimdPath&) = delete;
  ~EverySimdPath() { useSimdPath(""); }

  class Iterator {
   public:
    explicit Iterator(std::vector<std::string>::const_iterator at) : m_at(at) {}
    const std::string& operator*() const {
      useSimdPath(*m_at);
      return *m_at;
    }
    Iterator& operator++() {
      ++m_at;
      return *this;
    }
    bool operator!=(const Iterator& other) const { return m_at != other.m_at; }

   private:
    std::vector<std::string>::const_iterator m_at;
  };
  Iterator begin() const { return Iterator(m_paths.begin()); }
  Iterator end() const { return Iterator(m_paths.end()); }

 private:
  const std::vector<std::string> m_paths = simdPaths();
};

}  // namespace palpate::testing
