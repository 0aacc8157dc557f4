#include "Queries/RayTraversal.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Queries/RayTraversal.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

constexpr std::size_t kSide = 16;  ///< elements tested together

/// A ray, for boxes whose bounds are in arrays.
class BoxTest {
 public:
  explicit BoxTest(const FloatRay& ray) {
    for (std::size_t k = 0; k < 3; ++k) {
      const float grow = std::copysign(ray.slack, ray.inverse[k]);
      m_nearOrigin[k] = ray.origin[k] + grow;
      m_farOrigin[k] = ray.origin[k] - grow;
      m_inverse[k] = ray.inverse[k];
    }
  }

  /// The ray is in the boxes from the i-th on for t in [enter, leave], or misses them if enter >
  /// leave. near, far: for each axis, the bounds at which the ray enters and leaves.
  template <class D, class V = hn::Vec<D>>
  HWY_ATTR HWY_INLINE void intersect(D d, const float* const (&near)[3],
                                     const float* const (&far)[3], std::size_t i, float tMax,
                                     V& enter, V& leave) const {
    V first[3], last[3];
    for (std::size_t k = 0; k < 3; ++k) {
      const V inverse = hn::Set(d, m_inverse[k]);
      first[k] = (hn::LoadU(d, near[k] + i) - hn::Set(d, m_nearOrigin[k])) * inverse;
      last[k] = (hn::LoadU(d, far[k] + i) - hn::Set(d, m_farOrigin[k])) * inverse;
    }
    enter = hn::Max(hn::Max(hn::Zero(d), first[0]), hn::Max(first[1], first[2]));
    leave = hn::Min(hn::Min(hn::Set(d, tMax), last[0]), hn::Min(last[1], last[2]));
  }

 private:
  float m_nearOrigin[3], m_farOrigin[3], m_inverse[3];
};

/// One traversal.
class RaySearch {
 public:
  HWY_ATTR RaySearch(const Octree& octree, const RayElements& elements, const FloatRay& ray,
                     void* context, TestElement test)
      : m_blocks(octree.blocks()),
        m_elements(elements),
        m_boxTest(ray),
        m_tMax(ray.tMax),
        m_context(context),
        m_test(test) {
    for (std::size_t k = 0; k < 3; ++k) {
      const bool isBackward = ray.inverse[k] < 0;
      if (isBackward) m_lastOctant ^= std::size_t{1} << k;
      const OctreeBlock& first = m_blocks[0];
      const float *const lower = octree.boxes().lower[k].data(), *const upper =
                                                                     octree.boxes().upper[k].data();
      m_near[k] = isBackward ? upper : lower;
      m_far[k] = isBackward ? lower : upper;
      m_nearRow[k] = (isBackward ? first.upper[k] : first.lower[k]) - first.lower[0];
      m_farRow[k] = (isBackward ? first.lower[k] : first.upper[k]) - first.lower[0];
    }
  }

  HWY_ATTR void run() {
    using D = NodeTag;
    const D d;
    const hn::RebindToUnsigned<D> du;
    constexpr std::size_t kLanes = hn::MaxLanes(d);
    // Seven siblings remain on each of at most 61 levels, and whole vectors are stored.
    constexpr std::size_t kStack = 7 * 61 + 8;
    float enters[kStack];
    std::uint32_t begins[kStack], links[kStack];  // as in OctreeBlock
    enters[0] = 0;
    begins[0] = m_blocks[0].begin[0];
    links[0] = m_blocks[0].child[0];
    // Siblings are stored in the order of octants in which the ray passes them, the nearest last,
    // because the last entry is taken first.
    const std::size_t withinVector = m_lastOctant & (kLanes - 1),
                      ofVector = m_lastOctant & ~(kLanes - 1);
    const auto octants =
        hn::Xor(hn::Iota(du, 0), hn::Set(du, static_cast<std::uint32_t>(withinVector)));
    const auto order = hn::IndicesFromVec(d, octants);
    const auto inOrder = [&](const auto& values)
                             HWY_ATTR { return hn::TableLookupLanes(values, order); };
    for (std::size_t count = 1; count-- > 0;) {
      if (enters[count] > m_tMax) continue;
      const std::uint32_t begin = begins[count], link = links[count];
      if (link & OctreeBlock::kLeaf) {
        if (!testElements(begin, begin + (link & ~OctreeBlock::kLeaf))) return;
        continue;
      }
      const OctreeBlock& block = m_blocks[link];
      if (begin < block.begin[0] && !testElements(begin, block.begin[0])) return;
      const float* const rows = block.lower[0];
      const float* const near[3] = {rows + m_nearRow[0], rows + m_nearRow[1], rows + m_nearRow[2]};
      const float* const far[3] = {rows + m_farRow[0], rows + m_farRow[1], rows + m_farRow[2]};
      for (std::size_t i = 0; i < 8; i += kLanes) {
        const std::size_t slot = i ^ ofVector;
        hn::Vec<D> enter, leave;
        m_boxTest.intersect(d, near, far, slot, m_tMax, enter, leave);
        enter = inOrder(enter);
        const auto entered = hn::Le(enter, inOrder(leave));
        const auto push = [&](const std::uint32_t* from, std::uint32_t* to) HWY_ATTR {
          const auto values = inOrder(hn::BitCast(d, hn::LoadU(du, from + slot)));
          hn::StoreU(hn::BitCast(du, hn::Compress(values, entered)), du, to + count);
        };
        hn::StoreU(hn::Compress(enter, entered), d, enters + count);
        push(block.begin, begins);
        push(block.child, links);
        count += hn::CountTrue(d, entered);
      }
    }
  }

 private:
  /// Returns false if the traversal ends.
  HWY_ATTR HWY_NOINLINE bool testElements(std::uint32_t begin, std::uint32_t end) {
    const LeafTag d;
    std::uint32_t places[kSide];
    for (std::uint32_t first = begin; first < end; first += kSide) {
      // Their corners, and the boxes that are next.
      for (std::size_t i = 0; i < 3; ++i) hwy::Prefetch(m_elements.ordered + first + 5 * i);
      const std::size_t next = std::min<std::size_t>(first + 2 * kSide - 1, end);
      for (std::size_t k = 0; k < 3; ++k) {
        hwy::Prefetch(m_near[k] + next);
        hwy::Prefetch(m_far[k] + next);
      }
      const std::size_t size = std::min<std::size_t>(kSide, end - first);
      std::uint32_t bits = 0;
      for (std::size_t i = 0; i < size; i += hn::Lanes(d)) {
        hn::Vec<LeafTag> enter, leave;
        m_boxTest.intersect(d, m_near, m_far, first + i, m_tMax, enter, leave);
        bits |= bitsOf(d, hn::And(hn::FirstN(d, size - i), hn::Le(enter, leave))) << i;
      }
      // Without a branch for each, the tests overlap.
      const auto& [ordered, positions, line] = m_elements;
      std::size_t count = 0;
      for (; bits; bits &= bits - 1) {
        places[count] = first + static_cast<std::uint32_t>(std::countr_zero(bits));
        const auto& [a, b, c] = ordered[places[count]];
        count += !line.misses(positions[a], positions[b], positions[c]);
      }
      for (std::size_t i = 0; i < count; ++i) {
        m_tMax = m_test(m_context, places[i]);
        if (m_tMax < 0) return false;
      }
    }
    return true;
  }

  const OctreeBlock* const m_blocks;
  const RayElements& m_elements;
  const BoxTest m_boxTest;
  const float *m_near[3], *m_far[3];         ///< bounds of elements at which the ray enters, leaves
  std::ptrdiff_t m_nearRow[3], m_farRow[3];  ///< the same in a block, from its first bound
  std::size_t m_lastOctant = 7;              ///< the octant that the ray passes last
  float m_tMax;
  void* const m_context;
  const TestElement m_test;
};

HWY_ATTR void traverseRayKernel(const Octree& octree, const RayElements& elements,
                                const FloatRay& ray, void* context, TestElement test) {
  RaySearch(octree, elements, ray, context, test).run();
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(traverseRayKernel);

void traverseRay(const Octree& octree, const RayElements& elements, const FloatRay& ray,
                 void* context, TestElement test) {
  octree.requireBuilt();
  HWY_DYNAMIC_DISPATCH(traverseRayKernel)(octree, elements, ray, context, test);
}

}  // namespace palpate
#endif
