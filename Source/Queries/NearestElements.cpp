#include "Queries/NearestElements.h"

#include "Core/Assert.h"

#include <algorithm>
#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Queries/NearestElements.cpp"
#include "Core/Simd.h"
#include "Math/TriangleLanes.h"
#include "Octree/WalkLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
namespace nearest_elements {

constexpr std::size_t kSide = 16;  ///< elements tested together

/// Bounds of the distances of up to sixteen triangles from p.
///
/// q is a point of the triangle near the closest one, less p, however rounded. |q| is an upper
/// bound. No point of the triangle is nearer than its least corner along q, which gives the lower
/// bound. Both hold for any q. With R the distance of the furthest corner, all roundings together
/// are less than 2^-20 R.
template <class D>
HWY_ATTR HWY_INLINE void boundDistances(D d, const FloatPoint& p,
                                        const FloatPoint (&corners)[3][kSide], std::size_t i,
                                        float slack, float* lower, float* upper) {
  using V = hn::Vec<D>;
  const auto load = [&](int corner) HWY_ATTR {
    V x, y, z, unused;
    hn::LoadInterleaved4(d, &corners[corner][i].x, x, y, z, unused);
    return Vector3<V>{x - hn::Set(d, p.x), y - hn::Set(d, p.y), z - hn::Set(d, p.z)};
  };
  const TrianglesInLanes<D> triangles{load(0), load(1), load(2)};
  const Vector3<V> q = triangles.nearest();
  const V length = hn::Sqrt(dot(q, q)), zero = hn::Zero(d);
  const V error = triangles.furthest() * hn::Set(d, 0x1p-20f) + hn::Set(d, slack);
  // Comparisons with NaN are false: the lower bound is then 0, and the upper one infinite.
  const V low = triangles.leastAlong(q) / length - error, high = length + error;
  hn::Store(hn::IfThenElseZero(hn::Gt(low, zero), low), d, lower);
  hn::Store(
      hn::IfThenElse(hn::Ge(high, zero), high, hn::Set(d, std::numeric_limits<float>::infinity())),
      d, upper);
}

/// One search.
class Search {
 public:
  HWY_ATTR Search(const NearestSearch& search, float bound, std::size_t count, void* context,
                  TakeCandidates take)
      : m_search(search),
        m_count(count > kMaxCount ? 0 : count),
        m_context(context),
        m_take(take),
        m_bound(bound) {
    setLimit();
  }

  HWY_ATTR void run() {
    walkAround(
        m_search.octree, m_search.point.box(),
        [&](std::uint32_t begin, std::uint32_t end) HWY_ATTR { addElements(begin, end); },
        [&] { return m_limitKey; });
    test();
    if (m_candidates.size > 0) flush();
    leaveLanes();
  }

 private:
  /// Tests elements whose boxes are within the bound.
  HWY_ATTR HWY_INLINE void addElements(std::uint32_t begin, std::uint32_t end) {
    const LeafTag d;
    const FloatBox point = m_search.point.box();
    __builtin_prefetch(m_search.ordered + begin);
    for (std::uint32_t first = begin; first < end; first += kSide) {
      const std::size_t size = std::min<std::size_t>(kSide, end - first);
      std::uint32_t bits = 0;
      for (std::size_t i = 0; i < size; i += hn::Lanes(d)) {
        const auto boxes = BoxLanes<LeafTag>::load(m_search.octree.boxes(), first + i);
        const auto within = hn::Le(boxes.distanceFrom(point), hn::Set(d, m_limit));
        bits |= bitsOf(d, hn::And(hn::FirstN(d, size - i), within)) << i;
      }
      for (; bits; bits &= bits - 1)
        add(first + static_cast<std::uint32_t>(std::countr_zero(bits)));
    }
    if (m_pending >= 8 || (m_kept < m_count && begin < end)) test();
  }

  /// A box at a squared distance above m_limit holds nothing that the bound allows. Computed
  /// squares are off by less than 2^-20 of themselves.
  void setLimit() {
    const float reach = m_bound + m_search.tolerance + m_search.slack;
    m_limit = OutwardRounding::up(reach * reach * (1.0f + 0x1p-19f));
    if (!(m_limit >= 0)) m_limit = std::numeric_limits<float>::infinity();
    m_limitKey = WaitingSiblings::keyOf(m_limit);
  }
  void lower(float bound) {
    if (!(bound < m_bound)) return;
    m_bound = bound;
    setLimit();
  }

  HWY_ATTR HWY_INLINE void add(std::uint32_t place) {
    const Triangle& corners = m_search.ordered[place];
    for (std::size_t k = 0; k < 3; ++k) m_corners[k][m_pending] = m_search.floats[corners[k]];
    m_places[m_pending] = place;
    if (++m_pending == kSide) test();
  }

  /// Tests the pending elements.
  HWY_ATTR void test() {
    const NodeTag d;  // division takes longer in wider lanes
    alignas(64) float lowers[kSide], uppers[kSide];
    for (std::size_t i = 0; i < m_pending; i += hn::Lanes(d))
      boundDistances(d, m_search.point, m_corners, i, m_search.slack, lowers + i, uppers + i);
    const auto bitsBelow = [&](const float* values, float most) HWY_ATTR {
      std::uint32_t bits = 0;
      for (std::size_t i = 0; i < m_pending; i += hn::Lanes(d))
        bits |= bitsOf(d, hn::And(hn::FirstN(d, m_pending - i),
                                  hn::Le(hn::Load(d, values + i), hn::Set(d, most))))
                << i;
      return bits;
    };
    if (m_count > 0) keepLeast(uppers, bitsBelow(uppers, m_bound));
    for (std::uint32_t bits = bitsBelow(lowers, m_bound + m_search.tolerance); bits;
         bits &= bits - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(bits));
      if (m_candidates.size == NearCandidates::kCapacity) makeRoom();
      m_candidates.at[m_candidates.size++] = {m_places[i], lowers[i], uppers[i]};
    }
    m_pending = 0;
  }

  /// Keeps the least upper bounds, ascending: those that it has, and new ones. Their lowest bits,
  /// rounded up, number them, so that all differ. The number of lower ones is then the new place.
  HWY_ATTR HWY_INLINE void keepLeast(const float* uppers, std::uint32_t bits) {
    if (bits == 0) return;
    const hn::RebindToSigned<NodeTag> d;
    std::size_t size = m_kept;
    for (; bits; bits &= bits - 1, ++size)
      m_uppers[size] = (std::bit_cast<std::int32_t>(uppers[std::countr_zero(bits)]) & ~kNumber) +
                       kNumber + 1 + static_cast<std::int32_t>(size);
    hn::StoreU(hn::Set(d, std::numeric_limits<std::int32_t>::max()), d, m_uppers + size);
    alignas(32) std::int32_t sorted[kMaxCount + kSide];
    for (std::size_t i = 0; i < size; ++i) {
      const auto upper = hn::Set(d, m_uppers[i]);
      std::size_t place = 0;
      for (std::size_t k = 0; k < size; k += hn::Lanes(d))
        place += hn::CountTrue(d, hn::Lt(hn::Load(d, m_uppers + k), upper));
      sorted[place] = (m_uppers[i] & ~kNumber) + static_cast<std::int32_t>(place);
    }
    m_kept = std::min(size, m_count);
    std::copy_n(sorted, m_kept, m_uppers);
    PALPATE_ASSERT(std::is_sorted(m_uppers, m_uppers + m_kept));
    if (m_kept == m_count) lower(std::bit_cast<float>(m_uppers[m_kept - 1] | kNumber));
  }

  /// Drops candidates beyond the bound. If most remain, they are taken.
  void makeRoom() {
    prune();
    if (m_candidates.size > NearCandidates::kCapacity / 2) flush();
  }
  void prune() {
    const float most = m_bound + m_search.tolerance;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < m_candidates.size; ++i) {
      m_candidates.at[kept] = m_candidates.at[i];
      kept += !(m_candidates.at[i].lower > most);
    }
    m_candidates.size = kept;
  }
  void flush() {
    prune();
    leaveLanes();
    lower(m_take(m_context, m_candidates.at, m_candidates.size));
    m_candidates.size = 0;
  }

  const NearestSearch& m_search;
  const std::size_t m_count;
  void* const m_context;
  const TakeCandidates m_take;
  float m_bound;  ///< of distances
  float m_limit;  ///< of computed squared distances of boxes
  std::uint32_t m_limitKey;
  std::size_t m_kept = 0;
  static constexpr std::int32_t kNumber = 63;
  alignas(32) std::int32_t m_uppers[kMaxCount + kSide + 8];  ///< bits of floats; see keepLeast()
  std::size_t m_pending = 0;
  std::uint32_t m_places[kSide];
  alignas(64) FloatPoint m_corners[3][kSide] = {};
  NearCandidates m_candidates;
};

HWY_ATTR void searchNearestKernel(const NearestSearch& search, float bound, std::size_t count,
                                  void* context, TakeCandidates take) {
  Search(search, bound, count, context, take).run();
}

}  // namespace nearest_elements

using nearest_elements::searchNearestKernel;

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(searchNearestKernel);

void searchNearest(const NearestSearch& search, float bound, std::size_t count, void* context,
                   TakeCandidates take) {
  search.octree.requireBuilt();
  PALPATE_ASSERT(search.slack >= 0 && search.tolerance >= 0);
  HWY_DYNAMIC_DISPATCH(searchNearestKernel)(search, bound, count, context, take);
}

}  // namespace palpate
#endif
