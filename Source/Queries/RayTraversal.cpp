#include "Queries/RayTraversal.h"

#include "Octree/Walk.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Queries/RayTraversal.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
namespace ray_traversal {

constexpr std::size_t kSide = 16;  ///< elements tested together

/// A ray, for boxes whose bounds are in arrays.
class BoxTest {
 public:
  BoxTest() = default;
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

/// What a traversal visits next.
enum Visit : std::size_t { kNode, kElements, kTriangles, kNothing };

/// One traversal, visit by visit.
class RaySearch {
 public:
  /// Where it is. The caller's, so that a single traversal can keep it in registers.
  struct Cursor {
    std::size_t count;         ///< entries on the stack
    std::uint32_t begin, end;  ///< elements to visit
  };

  /// Begins at the root. `task` must stay until the end.
  HWY_ATTR HWY_INLINE Visit start(const Octree& octree, const RayTask& task, Cursor& at) {
    m_blocks = octree.blocks();
    PALPATE_ASSERT(task.ray.slack >= 0 && task.ray.tMax >= 0);
    m_task = &task;
    m_boxTest = BoxTest(task.ray);
    m_tMax = task.ray.tMax;
    m_lastOctant = 7;
    for (std::size_t k = 0; k < 3; ++k) {
      const bool isBackward = task.ray.inverse[k] < 0;
      if (isBackward) m_lastOctant ^= std::size_t{1} << k;
      const OctreeBlock& first = m_blocks[0];
      const float *const lower = octree.boxes().lower[k].data(), *const upper =
                                                                     octree.boxes().upper[k].data();
      m_near[k] = isBackward ? upper : lower;
      m_far[k] = isBackward ? lower : upper;
      m_nearRow[k] = (isBackward ? first.upper[k] : first.lower[k]) - first.lower[0];
      m_farRow[k] = (isBackward ? first.lower[k] : first.upper[k]) - first.lower[0];
    }
    m_enters[0] = 0;
    m_begins[0] = m_blocks[0].begin[0];
    m_links[0] = m_blocks[0].child[0];
    at.count = 1;
    return next(at);
  }

  HWY_ATTR HWY_INLINE Visit visitNode(Cursor& at) {
    using D = NodeTag;
    const D d;
    const hn::RebindToUnsigned<D> du;
    constexpr std::size_t kLanes = hn::MaxLanes(d);
    const std::uint32_t begin = m_begins[at.count];
    const OctreeBlock& block = m_blocks[m_links[at.count]];
    // Siblings are stored in the order of octants in which the ray passes them, the nearest last,
    // because the last entry is taken first.
    const std::size_t withinVector = m_lastOctant & (kLanes - 1),
                      ofVector = m_lastOctant & ~(kLanes - 1);
    const auto octants =
        hn::Xor(hn::Iota(du, 0), hn::Set(du, static_cast<std::uint32_t>(withinVector)));
    const auto order = hn::IndicesFromVec(d, octants);
    const auto inOrder = [&](const auto& values)
                             HWY_ATTR { return hn::TableLookupLanes(values, order); };
    const float* const rows = block.lower[0];
    const float* const near[3] = {rows + m_nearRow[0], rows + m_nearRow[1], rows + m_nearRow[2]};
    const float* const far[3] = {rows + m_farRow[0], rows + m_farRow[1], rows + m_farRow[2]};
    for (std::size_t i = 0; i < kChildren; i += kLanes) {
      const std::size_t slot = i ^ ofVector;
      hn::Vec<D> enter, leave;
      m_boxTest.intersect(d, near, far, slot, m_tMax, enter, leave);
      enter = inOrder(enter);
      const auto entered = hn::Le(enter, inOrder(leave));
      const auto push = [&](const std::uint32_t* from, std::uint32_t* to) HWY_ATTR {
        const auto values = inOrder(hn::BitCast(d, hn::LoadU(du, from + slot)));
        hn::StoreU(hn::BitCast(du, hn::Compress(values, entered)), du, to + at.count);
      };
      hn::StoreU(hn::Compress(enter, entered), d, m_enters + at.count);
      push(block.begin, m_begins);
      push(block.child, m_links);
      at.count += hn::CountTrue(d, entered);
    }
    at.begin = begin;
    at.end = block.begin[0];
    return at.begin < at.end ? kElements : next(at);
  }
  HWY_ATTR HWY_INLINE Visit visitElements(Cursor& at) {
    m_first = at.begin;
    m_met = findElements(at.begin, at.end);
    at.begin += kSide;
    return m_met != 0 ? kTriangles : at.begin < at.end ? kElements : next(at);
  }
  HWY_ATTR HWY_INLINE Visit visitTriangles(Cursor& at) {
    testTriangles(m_first, m_met);
    return at.begin < at.end && m_tMax >= 0 ? kElements : next(at);
  }
  /// The same visits to elements and their triangles, one after the other.
  HWY_ATTR HWY_INLINE Visit visitAllElements(Cursor& at) {
    testElements(at.begin, at.end);
    return next(at);
  }

  /// Loads what a visit reads.
  HWY_ATTR HWY_INLINE void prefetch(Visit visit, const Cursor& at) const {
    if (visit == kNode) {
      const char* const block = reinterpret_cast<const char*>(m_blocks + m_links[at.count]);
      for (std::size_t i = 0; i < sizeof(OctreeBlock); i += 64) hwy::Prefetch(block + i);
    } else if (visit == kElements) {
      for (std::size_t k = 0; k < 3; ++k) {
        hwy::Prefetch(m_near[k] + at.begin);
        hwy::Prefetch(m_far[k] + at.begin);
        hwy::Prefetch(m_task->elements.ordered + at.begin + 5 * k);
      }
    } else if (visit == kTriangles) {
      const auto& [ordered, positions, line] = m_task->elements;
      for (std::uint32_t bits = m_met; bits; bits &= bits - 1)
        for (const std::uint32_t corner :
             ordered[m_first + static_cast<std::uint32_t>(std::countr_zero(bits))])
          hwy::Prefetch(positions + corner);
    }
  }

 private:
  /// Finds elements whose boxes the ray meets, among the first kSide. Bit i: element begin + i.
  HWY_ATTR HWY_INLINE std::uint32_t findElements(std::uint32_t begin, std::uint32_t end) const {
    const LeafTag d;
    const std::size_t size = std::min<std::size_t>(kSide, end - begin);
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < size; i += hn::Lanes(d)) {
      hn::Vec<LeafTag> enter, leave;
      m_boxTest.intersect(d, m_near, m_far, begin + i, m_tMax, enter, leave);
      bits |= bitsOf(d, hn::And(hn::FirstN(d, size - i), hn::Le(enter, leave))) << i;
    }
    return bits;
  }
  HWY_ATTR HWY_INLINE void testTriangles(std::uint32_t begin, std::uint32_t bits) {
    const auto& [ordered, positions, line] = m_task->elements;
    std::uint32_t places[kSide];
    // Without a branch for each, the tests overlap.
    std::size_t size = 0;
    for (; bits; bits &= bits - 1) {
      places[size] = begin + static_cast<std::uint32_t>(std::countr_zero(bits));
      const auto& [a, b, c] = ordered[places[size]];
      size += !line.misses(positions[a], positions[b], positions[c]);
    }
    for (std::size_t i = 0; i < size && m_tMax >= 0; ++i)
      m_tMax = m_task->test(m_task->context, places[i]);
  }
  HWY_ATTR HWY_NOINLINE void testElements(std::uint32_t begin, std::uint32_t end) {
    for (; begin < end && m_tMax >= 0; begin += kSide) {
      // Their corners, and the boxes that are next.
      for (std::size_t i = 0; i < 3; ++i) hwy::Prefetch(m_task->elements.ordered + begin + 5 * i);
      const std::size_t next = std::min<std::size_t>(begin + 2 * kSide - 1, end);
      for (std::size_t k = 0; k < 3; ++k) {
        hwy::Prefetch(m_near[k] + next);
        hwy::Prefetch(m_far[k] + next);
      }
      testTriangles(begin, findElements(begin, end));
    }
  }

  /// Takes the next entry of the stack that the ray enters before m_tMax.
  HWY_ATTR HWY_INLINE Visit next(Cursor& at) {
    while (at.count > 0) {
      if (--at.count; m_enters[at.count] > m_tMax) continue;
      const std::uint32_t link = m_links[at.count];
      if (!(link & OctreeBlock::kLeaf)) return kNode;
      at.begin = m_begins[at.count];
      at.end = at.begin + (link & ~OctreeBlock::kLeaf);
      return kElements;
    }
    return kNothing;
  }

  const OctreeBlock* m_blocks;
  const RayTask* m_task;
  BoxTest m_boxTest;
  const float *m_near[3], *m_far[3];         ///< bounds of elements at which the ray enters, leaves
  std::ptrdiff_t m_nearRow[3], m_farRow[3];  ///< the same in a block, from its first bound
  std::size_t m_lastOctant;                  ///< the octant that the ray passes last
  float m_tMax;
  std::uint32_t m_first, m_met;  ///< bit i: element m_first + i is to be tested
  static constexpr std::size_t kStack = kMostWaiting;  // whole vectors are stored
  float m_enters[kStack];
  std::uint32_t m_begins[kStack], m_links[kStack];  ///< as in OctreeBlock
};

HWY_ATTR void traverseRayKernel(const Octree& octree, const RayTask& task) {
  RaySearch search;
  RaySearch::Cursor at;
  for (Visit visit = search.start(octree, task, at); visit != kNothing;)
    visit = visit == kNode ? search.visitNode(at) : search.visitAllElements(at);
}

HWY_ATTR void traverseRaysKernel(const Octree& octree, std::span<const RayTask> tasks,
                                 void* context, NextRay nextRay) {
  RaySearch searches[kRaysInFlight];
  RaySearch::Cursor at[kRaysInFlight];
  // For each kind of visit, the tasks that wait for it. Visits of one kind follow each other with
  // few branches that the processor cannot predict, so that they overlap.
  std::uint8_t waiting[4][kRaysInFlight] = {}, now[kRaysInFlight];
  std::size_t sizes[4] = {0, 0, 0, tasks.size()};
  for (std::size_t i = 0; i < tasks.size(); ++i)
    waiting[kNothing][i] = static_cast<std::uint8_t>(i);
  const auto wait = [&](std::uint8_t i, Visit visit) HWY_ATTR {
    searches[i].prefetch(visit, at[i]);
    waiting[visit][sizes[visit]++] = i;
  };
  const auto forAll = [&](Visit visit, auto&& f) HWY_ATTR {
    const std::size_t size = std::exchange(sizes[visit], 0);
    std::copy_n(waiting[visit], kRaysInFlight, now);
    for (std::size_t k = 0; k < size; ++k) f(now[k]);
  };
  while (sizes[kNode] + sizes[kElements] + sizes[kTriangles] + sizes[kNothing] > 0) {
    forAll(kNothing, [&](std::uint8_t i) HWY_ATTR {
      leaveLanes();
      if (nextRay(context, i)) wait(i, searches[i].start(octree, tasks[i], at[i]));
    });
    forAll(kNode, [&](std::uint8_t i) HWY_ATTR { wait(i, searches[i].visitNode(at[i])); });
    forAll(kElements, [&](std::uint8_t i) HWY_ATTR { wait(i, searches[i].visitElements(at[i])); });
    forAll(kTriangles,
           [&](std::uint8_t i) HWY_ATTR { wait(i, searches[i].visitTriangles(at[i])); });
  }
}

}  // namespace ray_traversal

using ray_traversal::traverseRayKernel;
using ray_traversal::traverseRaysKernel;

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(traverseRayKernel);
HWY_EXPORT(traverseRaysKernel);

void traverseRay(const Octree& octree, const RayTask& task) {
  octree.requireBuilt();
  HWY_DYNAMIC_DISPATCH(traverseRayKernel)(octree, task);
}

void traverseRays(const Octree& octree, std::span<const RayTask> tasks, void* context,
                  NextRay next) {
  octree.requireBuilt();
  PALPATE_ASSERT(tasks.size() <= kRaysInFlight);
  HWY_DYNAMIC_DISPATCH(traverseRaysKernel)(octree, tasks, context, next);
}

}  // namespace palpate
#endif
