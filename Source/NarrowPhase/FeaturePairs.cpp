#include "NarrowPhase/FeaturePairs.h"

#include "Math/Box.h"

#include <algorithm>
#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "NarrowPhase/FeaturePairs.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Four floats: one vector, or four where there is no SIMD.
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

HWY_ATTR HWY_INLINE Bounds triangleBounds(const FloatPoint* now, const Triangle& triangle) {
  return joined(joined(boundsOf(now[triangle[0]]), boundsOf(now[triangle[1]])),
                boundsOf(now[triangle[2]]));
}

/// Into b's frame, inflated, outward.
HWY_ATTR HWY_INLINE Bounds shifted(const Bounds& bounds, const FloatPair& floats) {
  const D d;
  const V relative = hn::Set(d, OutwardRounding::kRelative),
          absolute = hn::Set(d, OutwardRounding::kAbsolute);
  Bounds moved;
  for (std::size_t k = 0; k < kVectors; ++k) {
    const V lower = hn::Add(bounds.lower[k], hn::LoadU(d, floats.shiftLower.data() + k * kLanes));
    const V upper = hn::Add(bounds.upper[k], hn::LoadU(d, floats.shiftUpper.data() + k * kLanes));
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

/// Triangle pairs side by side: their corners' floats, those of a first, and what is to be
/// compared.
struct Batch {
  static constexpr std::size_t kSize = 16;
  alignas(64) FloatPoint now[6][kSize];
  alignas(64) FloatPoint before[6][kSize];
  alignas(
      64) std::uint32_t choices[kSize];  ///< bits 0-2: corners of a, 3-5: of b, 6 + 3 i + j: edges
  TrianglePair pairs[kSize];
  std::size_t size = 0;
};
constexpr int kTests = 15;

using WideTag = hn::CappedTag<float, Batch::kSize>;
using Wide = hn::Vec<WideTag>;

/// One bound of one feature, lane by lane, in three axes; and both bounds.
struct WideBounds {
  Wide lower[3], upper[3];
};

HWY_ATTR HWY_INLINE WideBounds joined(const WideBounds& s, const WideBounds& t) {
  WideBounds bounds;
  for (int k = 0; k < 3; ++k) {
    bounds.lower[k] = hn::Min(s.lower[k], t.lower[k]);
    bounds.upper[k] = hn::Max(s.upper[k], t.upper[k]);
  }
  return bounds;
}

enum class Sweep { None, Step, PartOfStep };

/// A vertex, or its way through the step or the first part of it. The float nearest to where it is
/// at upTo is within the margin: the ends and that float are off by 2^-24 of themselves each, the
/// three operations by as much again. (Clamped ends say nothing of what is between.)
template <Sweep sweep>
HWY_ATTR HWY_INLINE WideBounds cornerBounds(const Batch& batch, int corner, std::size_t lane,
                                            float upTo) {
  const WideTag d;
  Wide p[3], q[3], unused;
  hn::LoadInterleaved4(d, &batch.now[corner][lane].x, p[0], p[1], p[2], unused);
  WideBounds bounds;
  for (int k = 0; k < 3; ++k) bounds.lower[k] = bounds.upper[k] = p[k];
  if constexpr (sweep == Sweep::None) return bounds;
  hn::LoadInterleaved4(d, &batch.before[corner][lane].x, q[0], q[1], q[2], unused);
  for (int k = 0; k < 3; ++k) {
    if constexpr (sweep == Sweep::PartOfStep) {
      const Wide reach = hn::Add(hn::Abs(p[k]), hn::Abs(q[k]));
      const Wide margin =
          hn::Add(hn::Mul(reach, hn::Set(d, 0x1p-21f)), hn::Set(d, OutwardRounding::kAbsolute));
      const Wide moved = hn::Add(q[k], hn::Mul(hn::Set(d, upTo), hn::Sub(p[k], q[k])));
      const auto inRange = hn::Lt(reach, hn::Set(d, kLargestFloat));
      bounds.lower[k] = hn::IfThenElse(inRange, hn::Sub(moved, margin), p[k]);
      bounds.upper[k] = hn::IfThenElse(inRange, hn::Add(moved, margin), p[k]);
    }
    bounds.lower[k] = hn::Min(bounds.lower[k], q[k]);
    bounds.upper[k] = hn::Max(bounds.upper[k], q[k]);
  }
  return bounds;
}

/// Into b's frame, inflated, outward; monotone, so that boxes of shifted corners are shifted boxes.
HWY_ATTR HWY_INLINE WideBounds shifted(const WideBounds& bounds, const FloatPair& floats) {
  const WideTag d;
  const Wide relative = hn::Set(d, OutwardRounding::kRelative),
             absolute = hn::Set(d, OutwardRounding::kAbsolute);
  WideBounds moved;
  for (int k = 0; k < 3; ++k) {
    const Wide lower = hn::Add(bounds.lower[k], hn::Set(d, floats.shiftLower[k]));
    const Wide upper = hn::Add(bounds.upper[k], hn::Set(d, floats.shiftUpper[k]));
    moved.lower[k] = hn::Sub(lower, hn::Add(hn::Mul(hn::Abs(lower), relative), absolute));
    moved.upper[k] = hn::Add(upper, hn::Add(hn::Mul(hn::Abs(upper), relative), absolute));
  }
  return moved;
}

/// Adds to `bits` of a test the lanes that chose it and whose two boxes overlap.
HWY_ATTR HWY_INLINE void compare(const WideBounds& s, const WideBounds& t,
                                 const std::uint32_t* choices, int test, std::size_t lane,
                                 std::uint32_t* bits) {
  const WideTag d;
  const hn::RebindToUnsigned<WideTag> du;
  auto mask = hn::RebindMask(d, hn::TestBit(hn::Load(du, choices + lane), hn::Set(du, 1u << test)));
  for (int k = 0; k < 3; ++k)
    mask = hn::And(mask, hn::And(hn::Le(s.lower[k], t.upper[k]), hn::Le(t.lower[k], s.upper[k])));
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, mask, bytes);
  bits[test] |= (bytes[0] | static_cast<std::uint32_t>(bytes[1]) << 8) << lane;
}

/// bits[test]: the pairs of the batch that chose the test and whose boxes overlap.
template <Sweep sweep>
HWY_ATTR void compareBatch(const Batch& batch, const FloatPair& floats, std::uint32_t* bits) {
  for (std::size_t lane = 0; lane < Batch::kSize; lane += hn::Lanes(WideTag())) {
    WideBounds cornersA[3], cornersB[3];
    for (int i = 0; i < 3; ++i)
      cornersA[i] = shifted(cornerBounds<sweep>(batch, i, lane, floats.upTo), floats);
    for (int j = 0; j < 3; ++j) cornersB[j] = cornerBounds<sweep>(batch, 3 + j, lane, floats.upTo);
    const WideBounds edgesA[3] = {joined(cornersA[0], cornersA[1]),
                                  joined(cornersA[1], cornersA[2]),
                                  joined(cornersA[2], cornersA[0])};
    const WideBounds allA = joined(edgesA[0], cornersA[2]);
    for (int j = 0; j < 3; ++j) {
      const WideBounds edgeB = joined(cornersB[j], cornersB[(j + 1) % 3]);
      for (int i = 0; i < 3; ++i)
        compare(edgesA[i], edgeB, batch.choices, 6 + 3 * i + j, lane, bits);
      compare(allA, cornersB[j], batch.choices, 3 + j, lane, bits);
    }
    const WideBounds allB = joined(joined(cornersB[0], cornersB[1]), cornersB[2]);
    for (int i = 0; i < 3; ++i) compare(cornersA[i], allB, batch.choices, i, lane, bits);
  }
}

/// Grows a list by what is written behind its end: no test for room at each element.
class Appender {
 public:
  Appender(Buffer<FeaturePair>& list, std::size_t most) : m_list(list), m_size(list.size()) {
    list.resize(m_size + most);
  }
  ~Appender() { m_list.resize(m_size); }
  void append(std::uint32_t a, std::uint32_t b) { m_list[m_size++] = {a, b}; }

 private:
  Buffer<FeaturePair>& m_list;
  std::size_t m_size;
};

/// Feature pairs of two triangles, as bits. corners: i with the other triangle; edges: 3 i + j.
struct Choice {
  unsigned cornersOfA, cornersOfB, edges;
};
constexpr unsigned kColumn = 0111;  ///< bit 3 i of each row i; times three bits: those in every row
constexpr unsigned kRows[8] = {0, 07, 070, 077, 0700, 0707, 0770, 0777};

/// Those that have a vertex in common.
inline Choice sharing(const Triangle& a, const Triangle& b) {
  unsigned same = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) same |= static_cast<unsigned>(a[i] == b[j]) << (3 * i + j);
  if (same == 0) return {};
  Choice choice{};
  for (int i = 0; i < 3; ++i) {
    choice.cornersOfA |= static_cast<unsigned>((same & 07u << 3 * i) != 0) << i;
    choice.cornersOfB |= static_cast<unsigned>((same & kColumn << i) != 0) << i;
  }
  // Edge i has corners i and i + 1 mod 3.
  const unsigned ofEdgesA = same | same >> 3 | (same << 6 & 0700);
  choice.edges = ofEdgesA | (ofEdgesA >> 1 & 0333) | (ofEdgesA << 2 & 0444);
  return choice;
}

template <bool kFloats, Sweep sweep>
HWY_ATTR void findFeaturePairsOf(const MeshTopology& a, const MeshTopology& b,
                                 const FloatPair* floats, std::span<const TrianglePair> pairs,
                                 FeaturePairs& out) {
  const bool self = &a == &b;
  Appender vertexTriangle(out.vertexTriangle, pairs.size() * (self ? 6 : 3));
  Appender triangleVertex(out.triangleVertex, self ? 0 : pairs.size() * 3);
  Appender edgeEdge(out.edgeEdge, pairs.size() * 9);
  const auto append = [&](const TrianglePair& pair, int test) {
    if (test < 3) return vertexTriangle.append(a.triangles[pair.a][test], pair.b);
    if (test < 6) {
      const std::uint32_t vertex = b.triangles[pair.b][test - 3];
      return self ? vertexTriangle.append(vertex, pair.a) : triangleVertex.append(pair.a, vertex);
    }
    const std::uint32_t edgeA = a.triangleEdges[pair.a][(test - 6) / 3],
                        edgeB = b.triangleEdges[pair.b][(test - 6) % 3];
    const bool turned = self && edgeB < edgeA;
    edgeEdge.append(turned ? edgeB : edgeA, turned ? edgeA : edgeB);
  };
  Batch batch;
  const auto flush = [&]() HWY_ATTR {
    std::uint32_t bits[kTests] = {};
    compareBatch<sweep>(batch, *floats, bits);
    for (int test = 0; test < kTests; ++test)
      for (; bits[test]; bits[test] &= bits[test] - 1)
        append(batch.pairs[std::countr_zero(bits[test])], test);
    std::fill_n(batch.choices, Batch::kSize, 0u);
    batch.size = 0;
  };
  if constexpr (kFloats) {
    std::fill_n(batch.choices, Batch::kSize, 0u);
    std::fill_n(&batch.now[0][0], 6 * Batch::kSize, FloatPoint{});
    std::fill_n(&batch.before[0][0], 6 * Batch::kSize, FloatPoint{});
  }
  for (const TrianglePair& pair : pairs) {
    const unsigned ownedA = a.owned[pair.a], ownedB = b.owned[pair.b];
    const Triangle &cornersA = a.triangles[pair.a], &cornersB = b.triangles[pair.b];
    unsigned choice =
        (ownedA & 7) | (ownedB & 7) << 3 | (kRows[ownedA >> 3] & (ownedB >> 3) * kColumn) << 6;
    if (self && choice) {
      const Choice shared = sharing(cornersA, cornersB);
      choice &= ~(shared.cornersOfA | shared.cornersOfB << 3 | shared.edges << 6);
    }
    if (choice == 0) continue;
    out.owned += static_cast<std::size_t>(std::popcount(choice));
    if constexpr (!kFloats) {
      for (; choice; choice &= choice - 1) append(pair, std::countr_zero(choice));
      continue;
    }
    const std::size_t lane = batch.size;
    for (int i = 0; i < 3; ++i) {
      batch.now[i][lane] = floats->a[cornersA[i]];
      batch.now[3 + i][lane] = floats->b[cornersB[i]];
      if constexpr (sweep != Sweep::None) {
        batch.before[i][lane] = floats->beforeA[cornersA[i]];
        batch.before[3 + i][lane] = floats->beforeB[cornersB[i]];
      }
    }
    batch.choices[lane] = choice;
    batch.pairs[lane] = pair;
    if (++batch.size == Batch::kSize) flush();
  }
  if (batch.size > 0) flush();
}

HWY_ATTR void findFeaturePairsKernel(const MeshTopology& a, const MeshTopology& b,
                                     const FloatPair* floats, std::span<const TrianglePair> pairs,
                                     FeaturePairs& out) {
  if (!floats)
    findFeaturePairsOf<false, Sweep::None>(a, b, floats, pairs, out);
  else if (!floats->beforeA && !floats->beforeB)
    findFeaturePairsOf<true, Sweep::None>(a, b, floats, pairs, out);
  else if (floats->upTo >= 1.0f)
    findFeaturePairsOf<true, Sweep::Step>(a, b, floats, pairs, out);
  else
    findFeaturePairsOf<true, Sweep::PartOfStep>(a, b, floats, pairs, out);
}

HWY_ATTR void keepOverlappingKernel(const MeshTopology& a, const MeshTopology& b,
                                    const FloatPair& floats, Buffer<TrianglePair>& pairs) {
  std::size_t kept = 0;
  for (const TrianglePair& pair : pairs) {
    pairs[kept] = pair;
    kept += overlap(shifted(triangleBounds(floats.a, a.triangles[pair.a]), floats),
                    triangleBounds(floats.b, b.triangles[pair.b]));
  }
  pairs.resize(kept);
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(findFeaturePairsKernel);
HWY_EXPORT(keepOverlappingKernel);

void findFeaturePairs(const MeshTopology& a, const MeshTopology& b, const FloatPair* floats,
                      std::span<const TrianglePair> pairs, FeaturePairs& out) {
  out.vertexTriangle.clear();
  out.triangleVertex.clear();
  out.edgeEdge.clear();
  out.owned = 0;
  HWY_DYNAMIC_DISPATCH(findFeaturePairsKernel)(a, b, floats, pairs, out);
}

void keepOverlapping(const MeshTopology& a, const MeshTopology& b, const FloatPair& floats,
                     Buffer<TrianglePair>& pairs) {
  HWY_DYNAMIC_DISPATCH(keepOverlappingKernel)(a, b, floats, pairs);
}

}  // namespace palpate
#endif
