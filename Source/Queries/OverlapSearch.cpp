#include "Queries/OverlapSearch.h"

#include "Octree/Walk.h"

#include <algorithm>
#include <array>
#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Queries/OverlapSearch.cpp"
#include "Core/Simd.h"
#include "Octree/BoxLanes.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
namespace overlap_search {

constexpr std::size_t kSide = 16;  ///< elements tested together

/// Bits of boxes or triangles that are certainly outside the shape, or certainly meet it. A box
/// that meets it lies inside as a whole.
struct Verdict {
  std::uint32_t outside = 0, meeting = 0;
};

template <class D>
HWY_ATTR HWY_INLINE Verdict verdictOf(D d, hn::Mask<D> outside, hn::Mask<D> meeting) {
  return {bitsOf(d, outside), bitsOf(d, meeting)};
}

inline bool isBall(const FloatConvex& shape) {
  return shape.slabCount == 0 && shape.inverseSquare == 0.0f;
}
/// 0 for a negative length: nothing is nearer.
inline float squareOf(float length) { return length > 0.0f ? length * length : 0.0f; }

/// The parameter of the segment's point closest to a point.
template <class D>
HWY_ATTR HWY_INLINE hn::Vec<D> along(D d, const FloatConvex& shape,
                                     const Vector3<hn::Vec<D>>& fromStart) {
  const Vector3<hn::Vec<D>> u{hn::Set(d, shape.along[0]), hn::Set(d, shape.along[1]),
                              hn::Set(d, shape.along[2])};
  return hn::Min(hn::Max(dot(fromStart, u) * hn::Set(d, shape.inverseSquare), hn::Zero(d)),
                 hn::Set(d, 1.0f));
}

template <class D>
HWY_ATTR HWY_INLINE Vector3<hn::Vec<D>> setAll(D d, const float (&v)[3]) {
  return {hn::Set(d, v[0]), hn::Set(d, v[1]), hn::Set(d, v[2])};
}

template <class D>
HWY_ATTR HWY_INLINE Verdict testBoxes(D d, const FloatConvex& shape, const BoxLanes<D>& boxes) {
  using V = hn::Vec<D>;
  if (isBall(shape)) {
    const V zero = hn::Zero(d);
    V nearest = zero, furthest = zero;  // squares
    for (int k = 0; k < 3; ++k) {
      const V centre = hn::Set(d, shape.start[k]);
      const V below = boxes.lower[k] - centre, above = centre - boxes.upper[k];
      const V outside = hn::Max(hn::Max(below, above), zero);
      const V across = hn::Max(hn::Neg(below), hn::Neg(above));
      nearest = nearest + outside * outside;
      furthest = furthest + across * across;
    }
    return verdictOf(d, hn::Gt(nearest, hn::Set(d, squareOf(shape.radius + shape.slack))),
                     hn::Lt(furthest, hn::Set(d, squareOf(shape.radius - shape.slack))));
  }
  const V middle = hn::Set(d, 0.5f), slack = hn::Set(d, shape.slack);
  const Vector3<V> centre{middle * (boxes.lower[0] + boxes.upper[0]),
                          middle * (boxes.lower[1] + boxes.upper[1]),
                          middle * (boxes.lower[2] + boxes.upper[2])};
  const Vector3<V> half{middle * (boxes.upper[0] - boxes.lower[0]),
                        middle * (boxes.upper[1] - boxes.lower[1]),
                        middle * (boxes.upper[2] - boxes.lower[2])};
  if (shape.slabCount == 0) {
    const Vector3<V> u = setAll(d, shape.along), from = centre - setAll(d, shape.start);
    const Vector3<V> w = from - along(d, shape, from) * u;
    const V length = hn::Sqrt(dot(w, w)), radius = hn::Set(d, shape.radius);
    // The plane across w separates the segment from what lies further along w.
    const V reach = hn::Abs(w.x) * half.x + hn::Abs(w.y) * half.y + hn::Abs(w.z) * half.z;
    const V extent = hn::Sqrt(dot(half, half));
    return verdictOf(d, hn::Gt(length - reach / length, radius + slack),
                     hn::Lt(length + extent, radius - slack));
  }
  auto outside = hn::Lt(slack, hn::Zero(d)), inside = hn::Ge(slack, hn::Zero(d));
  for (std::size_t i = 0; i < shape.slabCount; ++i) {
    const auto& slab = shape.slabs[i];
    const Vector3<V> n = setAll(d, slab.normal);
    const V height = hn::Abs(dot(n, centre) - hn::Set(d, slab.middle));
    const V reach = hn::Abs(n.x) * half.x + hn::Abs(n.y) * half.y + hn::Abs(n.z) * half.z;
    const V halfWidth = hn::Set(d, slab.halfWidth);
    outside = hn::Or(outside, hn::Gt(height - reach, halfWidth + slack));
    inside = hn::And(inside, hn::Lt(height + reach, halfWidth - slack));
  }
  return verdictOf(d, outside, inside);
}

/// A triangle's point near the segment, as the vector from a point of the segment. Any such vector
/// bounds the distance from above by its length, and from below by the gap along it.
template <class D>
class NearestToSegment {
 public:
  using V = hn::Vec<D>;
  HWY_ATTR HWY_INLINE NearestToSegment(D tag, const FloatConvex& shape) : d(tag), m_shape(shape) {}

  HWY_ATTR HWY_INLINE void takeCorner(const Vector3<V>& corner) {
    take(corner - along(d, m_shape, corner) * setAll(d, m_shape.along));
  }
  HWY_ATTR HWY_INLINE void takeEdge(const Vector3<V>& p, const Vector3<V>& q) {
    const Vector3<V> u = setAll(d, m_shape.along), v = q - p;
    if (m_shape.inverseSquare == 0.0f) {  // a ball
      const V vv = dot(v, v), zero = hn::Zero(d);
      const V t = hn::Min(hn::Max(hn::Neg(dot(v, p)) / vv, zero), hn::Set(d, 1.0f));
      return take(p + hn::IfThenElseZero(hn::Gt(vv, zero), t) * v);
    }
    const V uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), up = dot(u, p), vp = dot(v, p);
    const V one = hn::Set(d, 1.0f), zero = hn::Zero(d);
    const V determinant = uu * vv - uv * uv;
    V t = hn::Min(hn::Max((uv * up - uu * vp) / determinant, zero), one);  // along the edge
    t = hn::IfThenElse(hn::Gt(determinant, zero), t, zero);
    const V s = along(d, m_shape, p + t * v);
    t = hn::Min(hn::Max((s * uv - vp) / vv, zero), one);
    t = hn::IfThenElse(hn::Gt(vv, zero), t, zero);
    take(p + t * v - along(d, m_shape, p + t * v) * u);
  }
  /// end: a point of the segment, relative to its start.
  HWY_ATTR HWY_INLINE void takeFace(const Vector3<V>& end, const Vector3<V>& a, const Vector3<V>& b,
                                    const Vector3<V>& c) {
    const Vector3<V> u = b - a, v = c - a, from = end - a;
    const V uu = dot(u, u), vv = dot(v, v), uv = dot(u, v), fu = dot(from, u), fv = dot(from, v);
    const V determinant = uu * vv - uv * uv, s = vv * fu - uv * fv, t = uu * fv - uv * fu;
    const V zero = hn::Zero(d);
    const auto inside =
        hn::And(hn::And(hn::Gt(s, zero), hn::Gt(t, zero)), hn::Lt(s + t, determinant));
    const V inverse = hn::Set(d, 1.0f) / determinant;
    take((s * inverse) * u + (t * inverse) * v - from, inside);
  }
  const Vector3<V>& vector() const { return m_vector; }

 private:
  HWY_ATTR HWY_INLINE void take(const Vector3<V>& w) { take(w, hn::Ge(dot(w, w), hn::Zero(d))); }
  HWY_ATTR HWY_INLINE void take(const Vector3<V>& w, hn::Mask<D> valid) {
    const V square = dot(w, w);
    const auto nearer = hn::And(valid, hn::Lt(square, m_square));
    m_square = hn::IfThenElse(nearer, square, m_square);
    m_vector = {hn::IfThenElse(nearer, w.x, m_vector.x), hn::IfThenElse(nearer, w.y, m_vector.y),
                hn::IfThenElse(nearer, w.z, m_vector.z)};
  }

  const D d;
  const FloatConvex& m_shape;
  V m_square = hn::Set(d, std::numeric_limits<float>::infinity());
  Vector3<V> m_vector{hn::Zero(d), hn::Zero(d), hn::Zero(d)};
};

/// Elements that are tested together.
struct Elements {
  alignas(64) FloatPoint corners[3][kSide] = {};
  std::uint32_t places[kSide];
  std::size_t size = 0;

  template <class D>
  HWY_ATTR HWY_INLINE Vector3<hn::Vec<D>> corner(D d, int number, std::size_t i) const {
    Vector3<hn::Vec<D>> p;
    hn::Vec<D> unused;
    hn::LoadInterleaved4(d, &corners[number][i].x, p.x, p.y, p.z, unused);
    return p;
  }
};

/// Whether a corner is certainly inside a shape without slabs.
template <class D>
HWY_ATTR HWY_INLINE hn::Mask<D> hasCornerInside(D d, const FloatConvex& shape,
                                                const Elements& elements, std::size_t i) {
  using V = hn::Vec<D>;
  V least = hn::Set(d, std::numeric_limits<float>::infinity());
  for (int k = 0; k < 3; ++k) {
    const Vector3<V> from = elements.corner(d, k, i) - setAll(d, shape.start);
    const Vector3<V> w = from - along(d, shape, from) * setAll(d, shape.along);
    least = hn::Min(least, dot(w, w));
  }
  return hn::Lt(least, hn::Set(d, squareOf(shape.radius - shape.slack)));
}

template <class D>
HWY_ATTR HWY_INLINE Verdict testTriangles(D d, const FloatConvex& shape, const Elements& elements,
                                          std::size_t i) {
  using V = hn::Vec<D>;
  const Vector3<V> a = elements.corner(d, 0, i), b = elements.corner(d, 1, i),
                   c = elements.corner(d, 2, i);
  const V slack = hn::Set(d, shape.slack), zero = hn::Zero(d);
  if (shape.slabCount == 0) {
    const Vector3<V> start = setAll(d, shape.start), u = setAll(d, shape.along);
    const Vector3<V> p = a - start, q = b - start, r = c - start;
    NearestToSegment<D> nearest(d, shape);
    nearest.takeCorner(p);
    nearest.takeCorner(q);
    nearest.takeCorner(r);
    nearest.takeEdge(p, q);
    nearest.takeEdge(q, r);
    nearest.takeEdge(r, p);
    nearest.takeFace({zero, zero, zero}, p, q, r);
    if (shape.inverseSquare > 0.0f) nearest.takeFace(u, p, q, r);
    const Vector3<V>& w = nearest.vector();
    const V length = hn::Sqrt(dot(w, w)), radius = hn::Set(d, shape.radius);
    const V gap = hn::Min(dot(w, p), hn::Min(dot(w, q), dot(w, r))) - hn::Max(dot(w, u), zero);
    return verdictOf(d, hn::Gt(gap / length, radius + slack), hn::Lt(length, radius - slack));
  }
  const auto all = hn::Ge(slack, zero);
  auto outside = hn::Lt(slack, zero), ofA = all, ofB = all, ofC = all;
  for (std::size_t k = 0; k < shape.slabCount; ++k) {
    const auto& slab = shape.slabs[k];
    const Vector3<V> n = setAll(d, slab.normal);
    const V middle = hn::Set(d, slab.middle), halfWidth = hn::Set(d, slab.halfWidth);
    const V atA = dot(n, a) - middle, atB = dot(n, b) - middle, atC = dot(n, c) - middle;
    const V least = hn::Min(atA, hn::Min(atB, atC)), most = hn::Max(atA, hn::Max(atB, atC));
    outside = hn::Or(outside, hn::Gt(hn::Max(least, hn::Neg(most)), halfWidth + slack));
    const V within = halfWidth - slack;
    ofA = hn::And(ofA, hn::Lt(hn::Abs(atA), within));
    ofB = hn::And(ofB, hn::Lt(hn::Abs(atB), within));
    ofC = hn::And(ofC, hn::Lt(hn::Abs(atC), within));
  }
  return verdictOf(d, outside, hn::Or(ofA, hn::Or(ofB, ofC)));
}

class OverlapDescent {
 public:
  OverlapDescent(const OverlapSearch& search, std::vector<std::uint32_t>& elements,
                 Buffer<std::uint32_t>& undecided)
      : m_search(search), m_elements(elements), m_undecided(undecided) {}

  HWY_ATTR void run() {
    // Marked nodes lie inside.
    for (Walk walk(m_search.octree); walk.next();) {
      addRange(walk.begin(), walk.end(), walk.isMarked());
      if (!walk.hasChildren()) continue;
      const OctreeBlock& block = walk.children();
      Verdict verdict;
      if (walk.isMarked())
        verdict.meeting = kAllChildren;
      else
        verdict = test(NodeTag(), block, 0, kChildren);
      std::uint32_t entered = 0;
      for (std::uint32_t bits = ~verdict.outside & kAllChildren; bits; bits &= bits - 1) {
        const auto slot = static_cast<unsigned>(std::countr_zero(bits));
        if (block.isLeaf(slot))  // need not wait
          addRange(block.begin[slot], block.begin[slot] + block.count(slot),
                   verdict.meeting >> slot & 1);
        else
          entered |= 1u << slot;
      }
      walk.enter(entered, verdict.meeting);
    }
    testPending();
    decide(m_open);
    leaveLanes();
  }

 private:
  template <class D, class Boxes>
  HWY_ATTR HWY_INLINE Verdict test(D d, const Boxes& from, std::size_t first,
                                   std::size_t size) const {
    Verdict all;
    for (std::size_t i = 0; i < size; i += hn::Lanes(d)) {
      const Verdict part = testBoxes(d, m_search.shape, BoxLanes<D>::load(from, first + i));
      all.outside |= part.outside << i;
      all.meeting |= part.meeting << i;
    }
    return all;
  }

  HWY_ATTR HWY_INLINE void addRange(std::uint32_t begin, std::uint32_t end, bool isInside) {
    const auto order = m_search.octree.order();
    if (isInside) {
      m_elements.insert(m_elements.end(), order.begin() + begin, order.begin() + end);
      return;
    }
    for (std::uint32_t i = begin; i < end; i += kSide)
      addElements(i, std::min<std::size_t>(kSide, end - i));
  }
  HWY_ATTR HWY_INLINE void addElements(std::uint32_t first, std::size_t size) {
    const Verdict verdict = test(LeafTag(), m_search.octree.boxes(), first, size);
    for (std::uint32_t bits = ~verdict.outside & ((1u << size) - 1); bits; bits &= bits - 1) {
      const auto lane = static_cast<std::uint32_t>(std::countr_zero(bits));
      if (verdict.meeting >> lane & 1)
        m_elements.push_back(m_search.octree.order()[first + lane]);
      else
        addPending(first + lane);
    }
  }
  HWY_ATTR HWY_INLINE void addPending(std::uint32_t place) {
    const Triangle& corners = m_search.ordered[place];
    for (std::size_t k = 0; k < 3; ++k)
      m_pending.corners[k][m_pending.size] = m_search.floats[corners[k]];
    m_pending.places[m_pending.size] = place;
    if (++m_pending.size == kSide) testPending();
  }
  HWY_ATTR void testPending() {
    const LeafTag d;
    if (m_search.shape.slabCount > 0) return decide(m_pending);
    std::uint32_t inside = 0;
    for (std::size_t i = 0; i < m_pending.size; i += hn::Lanes(d))
      inside |= bitsOf(d, hasCornerInside(d, m_search.shape, m_pending, i)) << i;
    for (std::size_t i = 0; i < m_pending.size; ++i) {
      if (inside >> i & 1) {
        m_elements.push_back(m_search.octree.order()[m_pending.places[i]]);
        continue;
      }
      for (std::size_t k = 0; k < 3; ++k) m_open.corners[k][m_open.size] = m_pending.corners[k][i];
      m_open.places[m_open.size] = m_pending.places[i];
      if (++m_open.size == kSide) decide(m_open);
    }
    m_pending.size = 0;
  }
  HWY_ATTR void decide(Elements& elements) {
    const LeafTag d;
    for (std::size_t i = 0; i < elements.size; i += hn::Lanes(d)) {
      const Verdict verdict = testTriangles(d, m_search.shape, elements, i);
      const std::size_t size = std::min(hn::Lanes(d), elements.size - i);
      for (std::uint32_t bits = ~verdict.outside & ((1u << size) - 1); bits; bits &= bits - 1) {
        const auto lane = static_cast<std::size_t>(std::countr_zero(bits));
        const std::uint32_t place = elements.places[i + lane];
        if (verdict.meeting >> lane & 1)
          m_elements.push_back(m_search.octree.order()[place]);
        else
          m_undecided.push_back(place);
      }
    }
    elements.size = 0;
  }

  const OverlapSearch& m_search;
  std::vector<std::uint32_t>& m_elements;
  Buffer<std::uint32_t>& m_undecided;
  Elements m_pending;
  Elements m_open;  ///< without a corner inside a shape without slabs
};

HWY_ATTR void searchOverlappingKernel(const OverlapSearch& search,
                                      std::vector<std::uint32_t>& elements,
                                      Buffer<std::uint32_t>& undecided) {
  OverlapDescent(search, elements, undecided).run();
}

}  // namespace overlap_search

using overlap_search::searchOverlappingKernel;

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(searchOverlappingKernel);

void searchOverlapping(const OverlapSearch& search, std::vector<std::uint32_t>& elements,
                       Buffer<std::uint32_t>& undecided) {
  search.octree.requireBuilt();
  HWY_DYNAMIC_DISPATCH(searchOverlappingKernel)(search, elements, undecided);
}

}  // namespace palpate
#endif
