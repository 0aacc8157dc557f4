#include "Queries/NearestElements.h"

#include <algorithm>
#include <array>
#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Queries/NearestElements.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

constexpr std::size_t kSide = 16;  ///< elements tested together

/// The quotient clamped to [0, 1]; 0 if the divisor is not positive.
template <class D, class V>
HWY_ATTR HWY_INLINE V clampedQuotient(D d, V dividend, V divisor) {
  const V quotient = dividend / divisor;
  const V clamped = hn::Min(hn::Max(quotient, hn::Zero(d)), hn::Set(d, 1.0f));
  return hn::IfThenElseZero(hn::Gt(divisor, hn::Zero(d)), clamped);
}

/// Bounds of the distances of up to sixteen triangles from the origin.
///
/// q is a point of the triangle near the closest one, however rounded. |q| is an upper bound. No
/// point of the triangle is nearer than its least corner along q, which gives the lower bound. Both
/// hold for any q. With R the distance of the furthest corner, all roundings together are less than
/// 2^-20 R.
template <class D>
HWY_ATTR HWY_INLINE void boundDistances(D d, const float (*corners)[3][kSide], std::size_t i,
                                        float slack, float* lower, float* upper) {
  using V = hn::Vec<D>;
  const auto load = [&](int corner) HWY_ATTR {
    return Vector3<V>{hn::Load(d, &corners[corner][0][i]), hn::Load(d, &corners[corner][1][i]),
                      hn::Load(d, &corners[corner][2][i])};
  };
  const Vector3<V> a = load(0), b = load(1), c = load(2);
  const Vector3<V> ab = b - a, ac = c - a, bc = c - b;
  const V zero = hn::Zero(d);
  const V ba = hn::Neg(dot(a, ab)), ca = hn::Neg(dot(a, ac)), cb = hn::Neg(dot(b, bc));
  const V bb = dot(ab, ab), cc = dot(ac, ac), both = dot(ab, ac);
  // The nearest of the closest points of the three edges, and of the face if it is inside.
  Vector3<V> q = a + clampedQuotient(d, ba, bb) * ab;
  V square = dot(q, q);
  const auto take = [&](const Vector3<V>& other, const auto& valid) HWY_ATTR {
    const V otherSquare = dot(other, other);
    const auto nearer = hn::And(valid, hn::Lt(otherSquare, square));
    square = hn::IfThenElse(nearer, otherSquare, square);
    q.x = hn::IfThenElse(nearer, other.x, q.x);
    q.y = hn::IfThenElse(nearer, other.y, q.y);
    q.z = hn::IfThenElse(nearer, other.z, q.z);
  };
  const auto all = hn::Ge(bb, zero);
  take(a + clampedQuotient(d, ca, cc) * ac, all);
  take(b + clampedQuotient(d, cb, dot(bc, bc)) * bc, all);
  const V determinant = bb * cc - both * both;
  const V s = cc * ba - both * ca, t = bb * ca - both * ba;
  const auto inside =
      hn::And(hn::And(hn::Gt(s, zero), hn::Gt(t, zero)), hn::Lt(s + t, determinant));
  const V inverse = hn::Set(d, 1.0f) / determinant;
  take(a + (s * inverse) * ab + (t * inverse) * ac, inside);

  const V furthest = hn::Sqrt(hn::Max(dot(a, a), hn::Max(dot(b, b), dot(c, c))));
  const V error = furthest * hn::Set(d, 0x1p-20f) + hn::Set(d, slack);
  const V length = hn::Sqrt(square);
  const V along = hn::Min(dot(a, q), hn::Min(dot(b, q), dot(c, q))) / length;
  // Comparisons with NaN are false: the lower bound is then 0, and the upper one infinite.
  const V low = along - error, high = length + error;
  hn::Store(hn::IfThenElseZero(hn::Gt(low, zero), low), d, lower + i);
  hn::Store(
      hn::IfThenElse(hn::Ge(high, zero), high, hn::Set(d, std::numeric_limits<float>::infinity())),
      d, upper + i);
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
    const Octree& octree = m_search.octree;
    const FloatBox point = m_search.point.box();
    struct Entry {
      float square;
      OctreeNode node;
    };
    // Seven siblings remain on each of at most 61 levels.
    std::array<Entry, 512> entries;
    std::size_t count = 0;
    alignas(64) float squares[kSide];
    const auto within = [&](auto d, const auto& boxes, std::size_t i) HWY_ATTR {
      const auto distances = boxes.distanceFrom(point);
      hn::Store(distances, d, squares + i);
      return hn::Le(distances, hn::Set(d, m_limit));
    };
    entries[count++] = {0, 0};
    while (count > 0) {
      const Entry entry = entries[--count];
      if (entry.square > m_limit) continue;
      const auto [begin, end] = octree.ownRange(entry.node);
      for (std::uint32_t i = begin; i < end; i += kSide) {
        const std::size_t size = std::min<std::size_t>(kSide, end - i);
        for (std::uint32_t bits = near(LeafTag(), octree.boxes(), i, size, within); bits;
             bits &= bits - 1)
          add(i + static_cast<std::uint32_t>(std::countr_zero(bits)));
      }
      if (begin < end) test();
      const OctreeNode child = octree.firstChild(entry.node);
      if (child == 0) continue;
      // The nearest one goes last, because the last entry is taken first. The others stay unsorted:
      // once it has lowered the bound, most of them are skipped.
      Entry nearest{std::numeric_limits<float>::infinity(), 0};
      for (std::uint32_t bits = near(NodeTag(), octree.blocks()[child >> 3], 0, 8, within); bits;
           bits &= bits - 1) {
        const auto slot = static_cast<std::uint32_t>(std::countr_zero(bits));
        const Entry next{squares[slot], child + slot};
        const bool isNearer = next.square < nearest.square;
        entries[count] = isNearer ? nearest : next;
        nearest = isNearer ? next : nearest;
        count += entries[count].node != 0;
      }
      if (nearest.node != 0) entries[count++] = nearest;
    }
    if (m_candidates.size > 0) flush();
  }

 private:
  /// The bits of boxes that `within` accepts, of at most `size` boxes from `first` on.
  template <class D, class Boxes, class Within>
  HWY_ATTR HWY_INLINE static std::uint32_t near(D d, const Boxes& from, std::size_t first,
                                                std::size_t size, Within&& within) {
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < size; i += hn::Lanes(d)) {
      const auto boxes = BoxLanes<D>::load(from, first + i);
      bits |= bitsOf(d, hn::And(hn::FirstN(d, size - i), within(d, boxes, i))) << i;
    }
    return bits;
  }

  /// A box at a squared distance above m_limit holds nothing that the bound allows. Computed
  /// squares are off by less than 2^-20 of themselves.
  void setLimit() {
    const float reach = m_bound + m_search.tolerance + m_search.slack;
    m_limit = OutwardRounding::up(reach * reach * (1.0f + 0x1p-19f));
    if (!(m_limit >= 0)) m_limit = std::numeric_limits<float>::infinity();
  }
  void lower(float bound) {
    if (!(bound < m_bound)) return;
    m_bound = bound;
    setLimit();
  }

  HWY_ATTR HWY_INLINE void add(std::uint32_t place) {
    const Triangle& corners = m_search.ordered[place];
    const FloatPoint& p = m_search.point;
    for (int k = 0; k < 3; ++k) {
      const FloatPoint& corner = m_search.floats[corners[static_cast<std::size_t>(k)]];
      m_corners[k][0][m_pending] = corner.x - p.x;
      m_corners[k][1][m_pending] = corner.y - p.y;
      m_corners[k][2][m_pending] = corner.z - p.z;
    }
    m_places[m_pending] = place;
    if (++m_pending == kSide) test();
  }

  /// Tests the pending elements.
  HWY_ATTR HWY_INLINE void test() {
    alignas(64) float lowers[kSide], uppers[kSide];
    const auto bound = [&](auto d) HWY_ATTR {
      for (std::size_t i = 0; i < m_pending; i += hn::Lanes(d))
        boundDistances(d, m_corners, i, m_search.slack, lowers, uppers);
    };
    if (m_pending <= hn::Lanes(NodeTag()))
      bound(NodeTag());
    else
      bound(LeafTag());
    for (std::size_t i = 0; m_count > 0 && i < m_pending; ++i) keepLeast(uppers[i]);
    for (std::size_t i = 0; i < m_pending; ++i) {
      if (lowers[i] > m_bound + m_search.tolerance) continue;
      if (m_candidates.size == NearCandidates::kCapacity) makeRoom();
      m_candidates.at[m_candidates.size++] = {m_places[i], lowers[i], uppers[i]};
    }
    m_pending = 0;
  }

  /// Keeps the least upper bounds, ascending.
  HWY_INLINE void keepLeast(float upper) {
    if (m_kept == m_count) {
      if (!(upper < m_uppers[m_kept - 1])) return;
      --m_kept;
    }
    std::size_t place = m_kept++;
    for (; place > 0 && m_uppers[place - 1] > upper; --place) m_uppers[place] = m_uppers[place - 1];
    m_uppers[place] = upper;
    if (m_kept == m_count) lower(m_uppers[m_kept - 1]);
  }

  /// Drops candidates beyond the bound. If most remain, they are taken.
  void makeRoom() {
    prune();
    if (m_candidates.size > NearCandidates::kCapacity / 2) flush();
  }
  void prune() {
    const float most = m_bound + m_search.tolerance;
    const auto end = std::remove_if(m_candidates.at, m_candidates.at + m_candidates.size,
                                    [&](const NearCandidate& c) { return c.lower > most; });
    m_candidates.size = static_cast<std::size_t>(end - m_candidates.at);
  }
  void flush() {
    prune();
    lower(m_take(m_context, m_candidates.at, m_candidates.size));
    m_candidates.size = 0;
  }

  const NearestSearch& m_search;
  const std::size_t m_count;
  void* const m_context;
  const TakeCandidates m_take;
  float m_bound;  ///< of distances
  float m_limit;  ///< of computed squared distances of boxes
  std::size_t m_kept = 0;
  float m_uppers[kMaxCount];
  std::size_t m_pending = 0;
  std::uint32_t m_places[kSide];
  alignas(64) float m_corners[3][3][kSide] = {};
  NearCandidates m_candidates;
};

HWY_ATTR void searchNearestKernel(const NearestSearch& search, float bound, std::size_t count,
                                  void* context, TakeCandidates take) {
  Search(search, bound, count, context, take).run();
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(searchNearestKernel);

void searchNearest(const NearestSearch& search, float bound, std::size_t count, void* context,
                   TakeCandidates take) {
  search.octree.requireBuilt();
  HWY_DYNAMIC_DISPATCH(searchNearestKernel)(search, bound, count, context, take);
}

}  // namespace palpate
#endif
