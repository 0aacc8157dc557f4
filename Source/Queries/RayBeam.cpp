#include "Queries/RayBeam.h"

#include "Octree/Walk.h"
#include "Core/Assert.h"

#include <algorithm>
#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Queries/RayBeam.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

using RayTag = hn::CappedTag<double, 8>;

/// Boxes whose bounds are in rows, against a beam.
class BeamTest {
 public:
  explicit BeamTest(const RayBeam& beam) : m_beam(beam) {}

  /// rows: lower and upper bounds by axis. Returns the boxes from the i-th on that the beam may
  /// meet at w up to wMax, and in `enter` the w from which on it may.
  template <class D>
  HWY_ATTR HWY_INLINE hn::Mask<D> meets(D d, const float* const (&lower)[3],
                                        const float* const (&upper)[3], std::size_t i, float wMax,
                                        hn::Vec<D>& enter) const {
    using V = hn::Vec<D>;
    const V sign = hn::Set(d, m_beam.sign), begin = hn::Set(d, m_beam.begin);
    const bool ascends = m_beam.sign > 0;
    const std::size_t w = m_beam.axes[2];
    const V first = hn::Max(sign * hn::LoadU(d, (ascends ? lower : upper)[w] + i), begin),
            last = hn::Min(sign * hn::LoadU(d, (ascends ? upper : lower)[w] + i), hn::Set(d, wMax));
    auto mask = hn::Le(first, last);
    const V fromBegin = first - begin, toEnd = last - begin;
    for (std::size_t k = 0; k < 2; ++k) {
      // The least and the largest of a line over [first, last] are at its ends.
      const float down = m_beam.lowerSlope[k], up = m_beam.upperSlope[k];
      const V least =
                  hn::Set(d, m_beam.lower[k]) + hn::Set(d, down) * (down >= 0 ? fromBegin : toEnd),
              most = hn::Set(d, m_beam.upper[k]) + hn::Set(d, up) * (up >= 0 ? toEnd : fromBegin);
      const std::size_t axis = m_beam.axes[k];
      mask = hn::And(mask, hn::Le(least, hn::LoadU(d, upper[axis] + i)));
      mask = hn::And(mask, hn::Ge(most, hn::LoadU(d, lower[axis] + i)));
    }
    enter = first;
    return mask;
  }

 private:
  const RayBeam& m_beam;
};

class BeamSearch {
 public:
  HWY_ATTR HWY_INLINE BeamSearch(const Octree& octree, const RayBeam& beam,
                                 const BeamElements& elements, bool eager, void* context,
                                 TakePairs take)
      : m_beam(beam),
        m_test(beam),
        m_elements(elements),
        m_blocks(octree.blocks()),
        m_eager(eager),
        m_context(context),
        m_take(take),
        m_wMax(beam.end) {
    for (std::size_t k = 0; k < 3; ++k) {
      m_lower[k] = octree.boxes().lower[k].data();
      m_upper[k] = octree.boxes().upper[k].data();
    }
    // The octant that the beam passes last.
    m_lastOctant = beam.sign > 0 ? std::size_t{1} << beam.axes[2] : 0;
    for (std::size_t k = 0; k < 2; ++k)
      if (beam.lowerSlope[k] > 0) m_lastOctant |= std::size_t{1} << beam.axes[k];
  }

  HWY_ATTR void run() {
    m_enters[0] = m_beam.begin;
    m_begins[0] = m_blocks[0].begin[0];
    m_links[0] = m_blocks[0].child[0];
    m_count = 1;
    while (m_count > 0) {
      if (--m_count; m_enters[m_count] > m_wMax) continue;
      const std::uint32_t begin = m_begins[m_count], link = m_links[m_count];
      if (link & OctreeBlock::kLeaf)
        visitElements(begin, begin + (link & ~OctreeBlock::kLeaf));
      else
        visitNode(begin, m_blocks[link]);
    }
    flush();
  }

 private:
  static constexpr std::size_t kPairs = 4 * RayBeam::kSize * 16;

  HWY_ATTR HWY_INLINE void visitNode(std::uint32_t begin, const OctreeBlock& block) {
    const NodeTag d;
    const hn::RebindToUnsigned<NodeTag> du;
    constexpr std::size_t kLanes = hn::MaxLanes(d);
    const float* const lower[3] = {block.lower[0], block.lower[1], block.lower[2]};
    const float* const upper[3] = {block.upper[0], block.upper[1], block.upper[2]};
    // In the order of octants, the nearest last, because the last entry is taken first.
    const std::size_t withinVector = m_lastOctant & (kLanes - 1),
                      ofVector = m_lastOctant & ~(kLanes - 1);
    const auto order = hn::IndicesFromVec(
        d, hn::Xor(hn::Iota(du, 0), hn::Set(du, static_cast<std::uint32_t>(withinVector))));
    for (std::size_t i = 0; i < kChildren; i += kLanes) {
      const std::size_t slot = i ^ ofVector;
      hn::Vec<NodeTag> enter;
      const auto met = m_test.meets(d, lower, upper, slot, m_wMax, enter);
      const auto entered = hn::MaskFromVec(hn::TableLookupLanes(hn::VecFromMask(d, met), order));
      hn::StoreU(hn::Compress(hn::TableLookupLanes(enter, order), entered), d, m_enters + m_count);
      const auto push = [&](const std::uint32_t* from, std::uint32_t* to) HWY_ATTR {
        const auto values = hn::TableLookupLanes(hn::BitCast(d, hn::LoadU(du, from + slot)), order);
        hn::StoreU(hn::BitCast(du, hn::Compress(values, entered)), du, to + m_count);
      };
      push(block.begin, m_begins);
      push(block.child, m_links);
      m_count += hn::CountTrue(d, entered);
    }
    if (begin < block.begin[0]) visitElements(begin, block.begin[0]);
  }

  HWY_ATTR HWY_NOINLINE void visitElements(std::uint32_t begin, std::uint32_t end) {
    const LeafTag d;
    for (; begin < end; begin += 16) {
      const std::size_t size = std::min<std::size_t>(16, end - begin);
      std::uint32_t bits = 0;
      for (std::size_t i = 0; i < size; i += hn::Lanes(d)) {
        hn::Vec<LeafTag> enter;
        const auto met = m_test.meets(d, m_lower, m_upper, begin + i, m_wMax, enter);
        bits |= bitsOf(d, hn::And(hn::FirstN(d, size - i), met)) << i;
      }
      for (; bits; bits &= bits - 1)
        addPairs(begin + static_cast<std::uint32_t>(std::countr_zero(bits)));
      if (m_pairCount > 0 && (m_eager || m_pairCount + 16 * RayBeam::kSize > kPairs)) flush();
    }
  }

  /// LineFilter::misses() of each ray.
  HWY_ATTR HWY_INLINE void addPairs(std::uint32_t place) {
    using V = hn::Vec<RayTag>;
    const RayTag d;
    const Triangle& triangle = m_elements.ordered[place];
    double corners[2][3], above[3];
    for (std::size_t i = 0; i < 3; ++i) {
      const double* const at = m_elements.positions[triangle[i]].data();
      corners[0][i] = at[m_beam.axes[0]];
      corners[1][i] = at[m_beam.axes[1]];
      above[i] = at[m_beam.axes[2]] - m_beam.height;
    }
    std::uint32_t bits = 0;
    for (std::size_t lane = 0; lane < RayBeam::kSize; lane += hn::Lanes(d)) {
      V x[3], y[3];
      for (std::size_t i = 0; i < 3; ++i) {
        const auto project = [&](std::size_t k) HWY_ATTR {
          return (hn::Set(d, corners[k][i]) - hn::Load(d, m_beam.origin[k] + lane)) -
                 hn::Load(d, m_beam.slope[k] + lane) * hn::Set(d, above[i]);
        };
        x[i] = project(0);
        y[i] = project(1);
      }
      const V ab = x[0] * y[1] - x[1] * y[0], bc = x[1] * y[2] - x[2] * y[1],
              ca = x[2] * y[0] - x[0] * y[2];
      const V most = hn::Max(ab, hn::Max(bc, ca)), least = hn::Min(ab, hn::Min(bc, ca));
      bits |= bitsOf(d, hn::Not(hn::Gt(hn::Min(most, hn::Neg(least)), hn::Set(d, m_beam.error))))
              << lane;
    }
    for (bits &= m_beam.used; bits; bits &= bits - 1)
      m_pairs[m_pairCount++] = {place, static_cast<std::uint32_t>(std::countr_zero(bits))};
  }

  HWY_ATTR void flush() {
    if (m_pairCount == 0) return;
    leaveLanes();
    m_wMax = std::min(m_wMax, m_take(m_context, {m_pairs, m_pairCount}));
    m_pairCount = 0;
  }

  const RayBeam& m_beam;
  const BeamTest m_test;
  const BeamElements m_elements;
  const OctreeBlock* const m_blocks;
  const bool m_eager;
  void* const m_context;
  const TakePairs m_take;
  const float *m_lower[3], *m_upper[3];
  std::size_t m_lastOctant, m_count, m_pairCount = 0;
  float m_wMax;
  static constexpr std::size_t kStack = kMostWaiting + kChildren;  // whole vectors are stored
  float m_enters[kStack];
  std::uint32_t m_begins[kStack], m_links[kStack];  ///< as in OctreeBlock
  RayPair m_pairs[kPairs];
};

HWY_ATTR void traverseBeamKernel(const Octree& octree, const RayBeam& beam,
                                 const BeamElements& elements, bool eager, void* context,
                                 TakePairs take) {
  BeamSearch search(octree, beam, elements, eager, context, take);
  search.run();
  leaveLanes();
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(traverseBeamKernel);

void traverseBeam(const Octree& octree, const RayBeam& beam, const BeamElements& elements,
                  bool eager, void* context, TakePairs take) {
  octree.requireBuilt();
  HWY_DYNAMIC_DISPATCH(traverseBeamKernel)(octree, beam, elements, eager, context, take);
}

}  // namespace palpate
#endif
