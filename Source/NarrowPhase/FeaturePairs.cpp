#include "NarrowPhase/FeaturePairs.h"

#include "NarrowPhase/FeatureTests.h"
#include "Math/Box.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "NarrowPhase/FeaturePairs.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {
namespace feature_pairs {

namespace hn = hwy::HWY_NAMESPACE;

/// Four floats are held in one vector, or in four where there is no SIMD.
constexpr std::size_t kLanes = HWY_TARGET == HWY_SCALAR ? 1 : 4, kVectors = 4 / kLanes;
using D = hn::FixedTag<float, kLanes>;
using V = hn::Vec<D>;

struct Bounds {
  V lower[kVectors], upper[kVectors];
};

HWY_ATTR HWY_INLINE Bounds boundsOf(const FloatPoint& p) {
  const D d;
  Bounds bounds;
  for (std::size_t k = 0; k < kVectors; ++k)
    bounds.lower[k] = bounds.upper[k] = hn::Load(d, &p.x + k * kLanes);
  return bounds;
}

HWY_ATTR HWY_INLINE Bounds joined(const Bounds& s, const Bounds& t) {
  Bounds bounds;
  for (std::size_t k = 0; k < kVectors; ++k) {
    bounds.lower[k] = hn::Min(s.lower[k], t.lower[k]);
    bounds.upper[k] = hn::Max(s.upper[k], t.upper[k]);
  }
  return bounds;
}

/// The shift that moves boxes into the frame in which they are compared.
struct Shift {
  std::array<float, 4> lower{}, upper{};
};

HWY_ATTR HWY_INLINE Bounds triangleBounds(const FloatPoint* now, const Triangle& triangle) {
  return joined(joined(boundsOf(now[triangle[0]]), boundsOf(now[triangle[1]])),
                boundsOf(now[triangle[2]]));
}

/// Adds the shift and rounds outward.
HWY_ATTR HWY_INLINE Bounds shifted(const Bounds& bounds, const Shift& shift) {
  const D d;
  const V relative = hn::Set(d, OutwardRounding::kRelative),
          absolute = hn::Set(d, OutwardRounding::kAbsolute);
  Bounds moved;
  for (std::size_t k = 0; k < kVectors; ++k) {
    const V lower = hn::Add(bounds.lower[k], hn::LoadU(d, shift.lower.data() + k * kLanes));
    const V upper = hn::Add(bounds.upper[k], hn::LoadU(d, shift.upper.data() + k * kLanes));
    moved.lower[k] = hn::Sub(lower, hn::Add(hn::Mul(hn::Abs(lower), relative), absolute));
    moved.upper[k] = hn::Add(upper, hn::Add(hn::Mul(hn::Abs(upper), relative), absolute));
  }
  return moved;
}

HWY_ATTR HWY_INLINE bool overlap(const Bounds& s, const Bounds& t) {
  const D d;
  bool all = true;
  for (std::size_t k = 0; k < kVectors; ++k)
    all &= hn::AllTrue(d, hn::And(hn::Le(s.lower[k], t.upper[k]), hn::Le(t.lower[k], s.upper[k])));
  return all;
}

/// The features of a triangle, in the order of NarrowPhase/FeatureTests.h.
struct alignas(64) FeatureRow {
  float bounds[3][2 * kFeatures];    ///< of each axis: lower, then upper
  std::uint32_t ids[kFeatures];      ///< of the vertices, the edges and the triangle
  std::uint16_t ownedByA, ownedByB;  ///< owned tests if this is triangle a, or triangle b
};
static_assert(sizeof(FeatureRow) == 256, "three lines of bounds, one of the rest");

enum class Sweep { None, Step, PartOfStep };

/// One of two meshes.
struct Side {
  const MeshTopology& topology;
  const FloatPoint *now, *before;
  Shift shift;
  float upTo;
};

/// Bounds of a vertex at the step's end, over the step, or over the step's part up to upTo. The
/// float nearest to the vertex's position at upTo is within the margin: both ends and that float
/// have a relative error of 2^-24 each, and so has each of the three operations. Where an end is
/// clamped to the largest float, the position at upTo is unknown, and the bounds enclose both ends.
template <Sweep sweep>
HWY_ATTR HWY_INLINE Bounds cornerBounds(const Side& side, std::uint32_t vertex) {
  const D d;
  Bounds bounds = boundsOf(side.now[vertex]);
  if constexpr (sweep == Sweep::None) return bounds;
  for (std::size_t k = 0; k < kVectors; ++k) {
    const V p = bounds.lower[k], q = hn::Load(d, &side.before[vertex].x + k * kLanes);
    if constexpr (sweep == Sweep::PartOfStep) {
      const V extent = hn::Add(hn::Abs(p), hn::Abs(q));
      const V margin =
          hn::Add(hn::Mul(extent, hn::Set(d, 0x1p-21f)), hn::Set(d, OutwardRounding::kAbsolute));
      const V moved = hn::Add(q, hn::Mul(hn::Set(d, side.upTo), hn::Sub(p, q)));
      const auto inRange = hn::Lt(extent, hn::Set(d, kLargestFloat));
      bounds.lower[k] = hn::IfThenElse(inRange, hn::Sub(moved, margin), p);
      bounds.upper[k] = hn::IfThenElse(inRange, hn::Add(moved, margin), p);
    }
    bounds.lower[k] = hn::Min(bounds.lower[k], q);
    bounds.upper[k] = hn::Max(bounds.upper[k], q);
  }
  return bounds;
}

/// Outward rounding is monotone. The box around shifted corners is therefore the shifted box.
template <Sweep sweep>
HWY_ATTR HWY_INLINE void setBounds(const Side& side, const Triangle& corners, FeatureRow& row) {
  Bounds boxes[kFeatures];
  for (int i = 0; i < 3; ++i) boxes[i] = shifted(cornerBounds<sweep>(side, corners[i]), side.shift);
  boxes[kEdge0] = joined(boxes[0], boxes[1]);
  boxes[kEdge1] = joined(boxes[1], boxes[2]);
  boxes[kEdge2] = boxes[kEdge2Again] = joined(boxes[2], boxes[0]);
  boxes[kTriangle] = joined(boxes[kEdge0], boxes[2]);
  const D d;
  alignas(64) float points[2 * kFeatures][4];
  for (int i = 0; i < kFeatures; ++i)
    for (std::size_t k = 0; k < kVectors; ++k) {
      hn::Store(boxes[i].lower[k], d, points[i] + k * kLanes);
      hn::Store(boxes[i].upper[k], d, points[kFeatures + i] + k * kLanes);
    }
  for (std::size_t i = 0; i < 2 * kFeatures; i += kLanes) {
    V x, y, z, unused;
    hn::LoadInterleaved4(d, points[i], x, y, z, unused);
    hn::Store(x, d, row.bounds[0] + i);
    hn::Store(y, d, row.bounds[1] + i);
    hn::Store(z, d, row.bounds[2] + i);
  }
}

template <Sweep sweep>
HWY_ATTR HWY_NOINLINE void makeRow(const Side& side, std::uint32_t triangle, FeatureRow& row) {
  const Triangle& corners = side.topology.elements[triangle];
  const auto& edges = side.topology.triangleEdges[triangle];
  const std::uint8_t owned = side.topology.owned[triangle];
  const std::uint32_t ids[kFeatures] = {corners[0], corners[1], corners[2], edges[2],
                                        edges[0],   edges[1],   triangle,   edges[2]};
  std::copy_n(ids, kFeatures, row.ids);
  row.ownedByA = kOwnedByA[owned];
  row.ownedByB = kOwnedByB[owned];
  if (side.now) return setBounds<sweep>(side, corners, row);
  for (auto& bounds : row.bounds) {
    std::fill_n(bounds, kFeatures, -kLargestFloat);
    std::fill_n(bounds + kFeatures, kFeatures, kLargestFloat);
  }
}

using TestTag = hn::CappedTag<float, kTestPlaces>;
constexpr std::size_t kTestLanes = hn::MaxLanes(TestTag());

/// Where a vector of tests finds the lower or upper bounds of its features: the start of a window
/// in the row, and the places in that window.
template <const TestFeatures& features>
struct Places {
  std::array<std::size_t, kTestPlaces> window{};
  alignas(64) std::array<std::int32_t, kTestPlaces> lower{}, upper{};
  constexpr Places() {
    constexpr std::size_t kWindow = std::min<std::size_t>(kTestLanes, kFeatures);
    for (std::size_t test = 0; test < kTestPlaces; ++test) {
      window[test] = features[test / kTestLanes * kTestLanes] / kWindow * kWindow;
      lower[test] = static_cast<std::int32_t>(features[test] - window[test]);
      upper[test] = lower[test] + (kTestLanes > kFeatures ? kFeatures : 0);
    }
  }
};

/// Gathers from a row one value for each test, from `test` on.
template <const TestFeatures& features, class DT>
HWY_ATTR HWY_INLINE hn::Vec<DT> valuesOf(DT d, const hn::TFromD<DT>* row, std::size_t test,
                                         bool upper = false) {
  static constexpr Places<features> kPlaces;
  const auto window =
      hn::Load(d, row + kPlaces.window[test] + (upper && kTestLanes <= kFeatures ? kFeatures : 0));
  return hn::TableLookupLanes(
      window, hn::SetTableIndices(d, (upper ? kPlaces.upper : kPlaces.lower).data() + test));
}

/// Tests whose two boxes overlap.
HWY_ATTR HWY_INLINE unsigned overlappingTests(const FeatureRow& a, const FeatureRow& b) {
  const TestTag d;
  unsigned tests = 0;
  for (std::size_t i = 0; i < kTestPlaces; i += kTestLanes) {
    auto mask = hn::FirstN(d, kTestLanes);
    for (int k = 0; k < 3; ++k) {
      mask = hn::And(mask, hn::Le(valuesOf<kFeatureOfA>(d, a.bounds[k], i),
                                  valuesOf<kFeatureOfB>(d, b.bounds[k], i, true)));
      mask = hn::And(mask, hn::Le(valuesOf<kFeatureOfB>(d, b.bounds[k], i),
                                  valuesOf<kFeatureOfA>(d, a.bounds[k], i, true)));
    }
    tests |= bitsOf(d, mask) << i;
  }
  return tests;
}

/// Tests of features with a vertex in common.
HWY_ATTR HWY_INLINE unsigned sharingTests(const FeatureRow& a, const FeatureRow& b) {
  const hn::RebindToUnsigned<TestTag> d;
  unsigned same = 0;
  for (std::size_t i = 0; i < kCornerPairs; i += kTestLanes)
    same |= bitsOf(d, hn::Eq(valuesOf<kCornerOfA>(d, a.ids, i), valuesOf<kCornerOfB>(d, b.ids, i)))
            << i;
  return kSharingTests[same % kSharingTests.size()];
}

/// A cache of rows. Neighbours in the octree come up again soon: 19 of 20 requests find their row
/// here.
template <Sweep sweep>
class RowCache {
 public:
  RowCache(const Side& a, const Side& b)
      : m_sides{a, b}, m_secondMeshBit(&a.topology == &b.topology ? 0 : 0x80000000u) {
    std::fill(std::begin(m_keys), std::end(m_keys), kNoKey);
  }
  struct RowPair {
    const FeatureRow &a, &b;
  };
  HWY_ATTR HWY_INLINE RowPair rows(const ElementPair& pair) {
    const std::uint32_t keyA = pair.a, keyB = pair.b ^ m_secondMeshBit;
    const std::size_t placeA = place(keyA), placeB = place(keyB);
    const FeatureRow& a = row(m_sides[0], pair.a, keyA, placeA);
    return {a, row(m_sides[1], pair.b, keyB, placeB == placeA ? kSpare : placeB)};
  }

 private:
  static constexpr int kBits = 9;
  static constexpr std::size_t kSpare = 1u << kBits;
  static constexpr std::uint32_t kNoKey = 0xffffffffu;

  static std::size_t place(std::uint32_t key) { return key * 0x9e3779b1u >> (32 - kBits); }
  HWY_ATTR HWY_INLINE const FeatureRow& row(const Side& side, std::uint32_t triangle,
                                            std::uint32_t key, std::size_t place) {
    if (m_keys[place] != key) {
      m_keys[place] = key;
      makeRow<sweep>(side, triangle, m_rows[place]);
    }
    return m_rows[place];
  }

  const Side m_sides[2];
  const std::uint32_t m_secondMeshBit;
  std::uint32_t m_keys[kSpare + 1];
  FeatureRow m_rows[kSpare + 1];
};

/// Triangle pairs with their chosen tests, which listPairs() turns into feature pairs. Tests of
/// corners and tests of edges are kept apart.
struct ChosenTests {
  static constexpr std::size_t kMost = 128;
  alignas(64) std::uint32_t ids[kMost * 2 * kFeatures];  ///< of both rows
  alignas(8) std::uint8_t corners[kMost];
  alignas(8) std::uint16_t edges[kMost];

  void set(std::size_t i, const FeatureRow& a, const FeatureRow& b, unsigned tests) {
    std::uint32_t* const both = ids + 2 * kFeatures * i;
    std::copy_n(a.ids, kFeatures, both);
    std::copy_n(b.ids, kFeatures, both + kFeatures);
    corners[i] = tests & (kCornerTestsOfA | kCornerTestsOfB);
    edges[i] = static_cast<std::uint16_t>(tests & kEdgeTests);
  }
};

/// For each bit of a 64-bit word of tests, the index in ChosenTests::ids of the test's feature. A
/// word holds the tests of several triangle pairs.
using IdPlaces = std::array<std::uint8_t, 64>;
template <class Tests>
constexpr IdPlaces idPlaces(const TestFeatures& features, int offset) {
  constexpr int kBits = 8 * sizeof(Tests);
  IdPlaces places{};
  for (int i = 0; i < 64; ++i)
    places[i] = static_cast<std::uint8_t>(i / kBits * 2 * kFeatures + features[i % kBits] + offset);
  return places;
}

/// Writes the feature pairs of those chosen tests of `size` triangle pairs that are in `mask`, and
/// returns their number. ordered: the lower id first.
template <class Tests>
inline std::size_t listPairs(const ChosenTests& chosen, const Tests* tests, std::size_t size,
                             unsigned mask, const IdPlaces& firstIn, const IdPlaces& secondIn,
                             bool ordered, FeaturePair* out) {
  constexpr std::size_t kPairs = 8 / sizeof(Tests);
  std::size_t count = 0;
  for (std::size_t i = 0; i < size; i += kPairs) {
    std::uint64_t bits;
    std::memcpy(&bits, tests + i, sizeof bits);
    for (bits &= mask * (~std::uint64_t{0} / static_cast<Tests>(-1)); bits; bits &= bits - 1) {
      const auto bit = static_cast<unsigned>(std::countr_zero(bits));
      const std::uint32_t* const ids = chosen.ids + 2 * kFeatures * i;
      const std::uint64_t first = ids[firstIn[bit]], second = ids[secondIn[bit]];
      // Without a branch: which id is lower cannot be predicted.
      const std::uint64_t pair = std::rotl(first | second << 32, 32 * (ordered & (second < first)));
      std::memcpy(out + count++, &pair, sizeof pair);
    }
  }
  return count;
}

constexpr IdPlaces kEdgeInA = idPlaces<std::uint16_t>(kFeatureOfA, 0),
                   kEdgeInB = idPlaces<std::uint16_t>(kFeatureOfB, kFeatures);
constexpr IdPlaces kCornerInA = idPlaces<std::uint8_t>(kFeatureOfA, 0),
                   kCornerInB = idPlaces<std::uint8_t>(kFeatureOfB, kFeatures);
/// The vertex and the triangle of a corner's test, for corners of a and of b alike.
constexpr IdPlaces kVertexIn = idPlaces<std::uint8_t>(
                       {kCorner0, kCorner1, kCorner2, 0, kFeatures + kCorner0, kFeatures + kCorner1,
                        kFeatures + kCorner2},
                       0),
                   kTriangleIn = idPlaces<std::uint8_t>(
                       {kFeatures + kTriangle, kFeatures + kTriangle, kFeatures + kTriangle, 0,
                        kTriangle, kTriangle, kTriangle},
                       0);

template <Sweep sweep>
HWY_ATTR void findFeaturePairsOf(const Side& a, const Side& b, std::span<const ElementPair> pairs,
                                 FeaturePairs& out) {
  const bool self = &a.topology == &b.topology;
  const unsigned excluded = self ? ~0u : 0u;
  const unsigned allowed = allowedTests(a.topology, b.topology);
  out.vertexTriangle.resize(pairs.size() * (self ? 6 : 3));
  out.triangleVertex.resize(self ? 0 : pairs.size() * 3);
  out.edgeEdge.resize(pairs.size() * 9);
  std::size_t owned = 0, vertexTriangle = 0, triangleVertex = 0, edgeEdge = 0;
  RowCache<sweep> cache(a, b);
  ChosenTests chosen;
  for (std::size_t begin = 0; begin < pairs.size(); begin += ChosenTests::kMost) {
    std::size_t size = 0;
    for (const ElementPair& pair :
         pairs.subspan(begin, std::min(ChosenTests::kMost, pairs.size() - begin))) {
      const auto [rowA, rowB] = cache.rows(pair);
      unsigned tests = rowA.ownedByA & rowB.ownedByB & allowed;
      tests &= ~(sharingTests(rowA, rowB) & excluded);
      owned += static_cast<std::size_t>(std::popcount(tests));
      tests &= overlappingTests(rowA, rowB);
      chosen.set(size++, rowA, rowB, tests);
    }
    std::fill(chosen.corners + size, std::end(chosen.corners), std::uint8_t{0});
    std::fill(chosen.edges + size, std::end(chosen.edges), std::uint16_t{0});
    edgeEdge += listPairs(chosen, chosen.edges, size, kEdgeTests, kEdgeInA, kEdgeInB, self,
                          out.edgeEdge.data() + edgeEdge);
    FeaturePair* const corners = out.vertexTriangle.data() + vertexTriangle;
    if (self) {
      vertexTriangle += listPairs(chosen, chosen.corners, size, 255, kVertexIn, kTriangleIn,
                                  a.topology.type == GeometryType::Points, corners);
    } else {
      vertexTriangle += listPairs(chosen, chosen.corners, size, kCornerTestsOfA, kCornerInA,
                                  kCornerInB, false, corners);
      triangleVertex += listPairs(chosen, chosen.corners, size, kCornerTestsOfB, kCornerInA,
                                  kCornerInB, false, out.triangleVertex.data() + triangleVertex);
    }
  }
  out.owned = owned;
  out.vertexTriangle.resize(vertexTriangle);
  out.triangleVertex.resize(triangleVertex);
  out.edgeEdge.resize(edgeEdge);
}

HWY_ATTR void findFeaturePairsKernel(const MeshTopology& a, const MeshTopology& b,
                                     const FloatPair& floats, std::span<const ElementPair> pairs,
                                     FeaturePairs& out) {
  Side sideA{a, floats.a, floats.beforeA, {floats.shiftLower, floats.shiftUpper}, floats.upTo};
  Side sideB{b, floats.b, floats.beforeB, {}, floats.upTo};
  if (&a == &b) {  // half to each, so that a row is the same on both sides
    for (float& shift : sideA.shift.lower) shift /= 2;
    for (float& shift : sideA.shift.upper) shift /= 2;
    sideB.shift = sideA.shift;
  }
  if (!floats.beforeA)
    findFeaturePairsOf<Sweep::None>(sideA, sideB, pairs, out);
  else if (floats.upTo >= 1.0f)
    findFeaturePairsOf<Sweep::Step>(sideA, sideB, pairs, out);
  else
    findFeaturePairsOf<Sweep::PartOfStep>(sideA, sideB, pairs, out);
}

HWY_ATTR void keepOverlappingKernel(const MeshTopology& a, const MeshTopology& b,
                                    const FloatPair& floats, Buffer<ElementPair>& pairs) {
  const Shift shift{floats.shiftLower, floats.shiftUpper};
  std::size_t kept = 0;
  for (const ElementPair& pair : pairs) {
    pairs[kept] = pair;
    kept += overlap(shifted(triangleBounds(floats.a, a.elements[pair.a]), shift),
                    triangleBounds(floats.b, b.elements[pair.b]));
  }
  pairs.resize(kept);
}

}  // namespace feature_pairs

using feature_pairs::findFeaturePairsKernel;
using feature_pairs::keepOverlappingKernel;

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(findFeaturePairsKernel);
HWY_EXPORT(keepOverlappingKernel);

void findFeaturePairs(const MeshTopology& a, const MeshTopology& b, const FloatPair* floats,
                      std::span<const ElementPair> pairs, FeaturePairs& out) {
  PALPATE_ASSERT(!floats || (!floats->a == !floats->b && !floats->beforeA == !floats->beforeB &&
                             floats->upTo >= 0.0f && floats->upTo <= 1.0f));
  HWY_DYNAMIC_DISPATCH(findFeaturePairsKernel)(a, b, floats ? *floats : FloatPair{}, pairs, out);
  if (&a == &b && a.hasAddedEdges())
    for (FeaturePair& edges : out.edgeEdge)
      if (a.precedes(edges.b, edges.a)) std::swap(edges.a, edges.b);
  PALPATE_ASSERT(out.vertexTriangle.size() + out.triangleVertex.size() + out.edgeEdge.size() <=
                 out.owned);
}

void keepOverlapping(const MeshTopology& a, const MeshTopology& b, const FloatPair& floats,
                     Buffer<ElementPair>& pairs) {
  PALPATE_ASSERT(floats.a && floats.b);
  HWY_DYNAMIC_DISPATCH(keepOverlappingKernel)(a, b, floats, pairs);
}

}  // namespace palpate
#endif
