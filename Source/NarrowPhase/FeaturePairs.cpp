#include "NarrowPhase/FeaturePairs.h"

#include "Math/Box.h"

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

/// A vertex, or its way through the step.
template <bool kSwept>
HWY_ATTR HWY_INLINE Bounds vertexBounds(const FloatPoint* now, const FloatPoint* before,
                                        std::uint32_t vertex) {
  if constexpr (kSwept) return joined(boundsOf(now[vertex]), boundsOf(before[vertex]));
  return boundsOf(now[vertex]);
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

/// A triangle's features as boxes: corners, edges (i joins corners i and i + 1), and the whole.
struct Features {
  Bounds corners[3], edges[3], all;
};

template <bool kSwept>
HWY_ATTR HWY_INLINE Features featuresOf(const FloatPoint* now, const FloatPoint* before,
                                        const Triangle& triangle) {
  Features features;
  for (int i = 0; i < 3; ++i) features.corners[i] = vertexBounds<kSwept>(now, before, triangle[i]);
  for (int i = 0; i < 3; ++i)
    features.edges[i] = joined(features.corners[i], features.corners[(i + 1) % 3]);
  features.all = joined(features.edges[0], features.corners[2]);
  return features;
}

/// Grows a list by what is written behind its end: no test for room at each element.
class Appender {
 public:
  Appender(Buffer<FeaturePair>& list, std::size_t most) : m_list(list), m_size(list.size()) {
    list.resize(m_size + most);
  }
  ~Appender() { m_list.resize(m_size); }
  void append(std::uint32_t a, std::uint32_t b, bool keep) {
    m_list[m_size] = {a, b};
    m_size += keep;
  }

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

template <bool kFloats, bool kSwept>
HWY_ATTR void findFeaturePairsOf(const MeshTopology& a, const MeshTopology& b,
                                 const FloatPair* floats, std::span<const TrianglePair> pairs,
                                 FeaturePairs& out) {
  const bool self = &a == &b;
  Appender vertexTriangle(out.vertexTriangle, pairs.size() * (self ? 6 : 3));
  Appender triangleVertex(out.triangleVertex, self ? 0 : pairs.size() * 3);
  Appender edgeEdge(out.edgeEdge, pairs.size() * 9);
  // Most pairs come in runs with the same a.
  std::uint32_t last = 0xffffffffu;
  Features s, t;
  for (const TrianglePair& pair : pairs) {
    const unsigned ownedA = a.owned[pair.a], ownedB = b.owned[pair.b];
    if ((ownedA | ownedB) == 0) continue;
    const Triangle &cornersA = a.triangles[pair.a], &cornersB = b.triangles[pair.b];
    if constexpr (kFloats) {
      if (pair.a != last) {
        s = featuresOf<kSwept>(floats->a, floats->beforeA, cornersA);
        for (int i = 0; i < 3; ++i) {
          s.corners[i] = shifted(s.corners[i], *floats);
          s.edges[i] = shifted(s.edges[i], *floats);
        }
        s.all = shifted(s.all, *floats);
        last = pair.a;
      }
      t = featuresOf<kSwept>(floats->b, floats->beforeB, cornersB);
    }
    Choice choice{ownedA & 7, ownedB & 7, kRows[ownedA >> 3] & (ownedB >> 3) * kColumn};
    if (self) {
      const Choice shared = sharing(cornersA, cornersB);
      choice.cornersOfA &= ~shared.cornersOfA;
      choice.cornersOfB &= ~shared.cornersOfB;
      choice.edges &= ~shared.edges;
    }
    out.owned += static_cast<std::size_t>(
        std::popcount(choice.cornersOfA | choice.cornersOfB << 3 | choice.edges << 6));
    for (; choice.cornersOfA; choice.cornersOfA &= choice.cornersOfA - 1) {
      const int i = std::countr_zero(choice.cornersOfA);
      vertexTriangle.append(cornersA[i], pair.b, !kFloats || overlap(s.corners[i], t.all));
    }
    for (; choice.cornersOfB; choice.cornersOfB &= choice.cornersOfB - 1) {
      const int i = std::countr_zero(choice.cornersOfB);
      const bool keep = !kFloats || overlap(s.all, t.corners[i]);
      if (self)
        vertexTriangle.append(cornersB[i], pair.a, keep);
      else
        triangleVertex.append(pair.a, cornersB[i], keep);
    }
    for (; choice.edges; choice.edges &= choice.edges - 1) {
      const int bit = std::countr_zero(choice.edges), i = bit / 3, j = bit % 3;
      const std::uint32_t edgeA = a.triangleEdges[pair.a][i], edgeB = b.triangleEdges[pair.b][j];
      const bool turned = self && edgeB < edgeA;
      edgeEdge.append(turned ? edgeB : edgeA, turned ? edgeA : edgeB,
                      !kFloats || overlap(s.edges[i], t.edges[j]));
    }
  }
}

HWY_ATTR void findFeaturePairsKernel(const MeshTopology& a, const MeshTopology& b,
                                     const FloatPair* floats, std::span<const TrianglePair> pairs,
                                     FeaturePairs& out) {
  if (!floats)
    findFeaturePairsOf<false, false>(a, b, floats, pairs, out);
  else if (!floats->beforeA && !floats->beforeB)
    findFeaturePairsOf<true, false>(a, b, floats, pairs, out);
  else
    findFeaturePairsOf<true, true>(a, b, floats, pairs, out);
}

HWY_ATTR void keepOverlappingKernel(const MeshTopology& a, const MeshTopology& b,
                                    const FloatPair& floats, Buffer<TrianglePair>& pairs) {
  std::size_t kept = 0;
  for (const TrianglePair& pair : pairs) {
    const Features s = featuresOf<false>(floats.a, nullptr, a.triangles[pair.a]);
    const Features t = featuresOf<false>(floats.b, nullptr, b.triangles[pair.b]);
    pairs[kept] = pair;
    kept += overlap(shifted(s.all, floats), t.all);
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
