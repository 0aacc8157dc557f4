#pragma once

#include "NarrowPhase/FeatureTests.h"
#include "NarrowPhase/NarrowPhase.h"
#include "NarrowPhase/ProximityFilter.h"

#include <bit>
#include <cstdint>
#include <utility>

namespace palpate {

/// The feature tests that pairs of elements own, in batches for findPossibleProximity().
class OwnedTests {
 public:
  explicit OwnedTests(const MeshPair& pair)
      : m_pair(pair), m_allowed(allowedTests(pair.a.topology, pair.b.topology)) {}

  /// The tests of one pair of elements. In self-collision none has features with a common vertex.
  std::uint32_t of(const ElementPair& candidate) const {
    const MeshTopology &a = m_pair.a.topology, &b = m_pair.b.topology;
    const std::uint32_t tests =
        kOwnedByA[a.owned[candidate.a]] & kOwnedByB[b.owned[candidate.b]] & m_allowed;
    if (!m_pair.self()) return tests;
    return tests & ~kSharingTests[sameCorners(a.elements[candidate.a], b.elements[candidate.b])];
  }

  void add(const ElementPair& candidate, std::uint32_t tests) {
    m_tests[m_size] = tests;
    m_candidates[m_size] = candidate;
    const Triangle &s = m_pair.a.topology.elements[candidate.a],
                   &t = m_pair.b.topology.elements[candidate.b];
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d p = m_pair.a.now[s[i]], q = m_pair.b.now[t[i]];
      for (int k = 0; k < 3; ++k) {
        m_batch.coordinates[TrianglePairBatch::rowOfA(i, k)][m_size] = p[k];
        m_batch.coordinates[TrianglePairBatch::rowOfB(i, k)][m_size] = q[k];
      }
    }
    ++m_size;
  }
  bool isFull() const { return m_size == TrianglePairBatch::kSize; }

  /// Empties the batch. Calls test(candidate, number) for each test that may be within the
  /// distance.
  template <class Test>
  void flush(double distance, bool distinct, double checkedEdgeDistance, Test&& test) {
    if (m_size == 0) return;
    std::uint32_t possible[TrianglePairBatch::kSize];
    findPossibleProximity(m_batch, distance, distinct, checkedEdgeDistance, possible);
    const int size = std::exchange(m_size, 0);
    for (int i = 0; i < size; ++i)
      for (std::uint32_t left = m_tests[i] & possible[i]; left != 0; left &= left - 1)
        test(m_candidates[i], std::countr_zero(left));
  }

 private:
  const MeshPair& m_pair;
  const std::uint32_t m_allowed;  ///< tests that apply to the meshes' geometry types
  int m_size = 0;
  std::uint32_t m_tests[TrianglePairBatch::kSize];
  ElementPair m_candidates[TrianglePairBatch::kSize];
  TrianglePairBatch m_batch{};
};

}  // namespace palpate
