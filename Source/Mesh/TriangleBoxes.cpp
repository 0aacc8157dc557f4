#include "Mesh/TriangleBoxes.h"

#include "Core/Assert.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Mesh/TriangleBoxes.cpp"
#include "Core/Simd.h"
#include "Math/BoxRounding.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

constexpr std::size_t kChunk = 64;

/// Boxes of one chunk, rounded to nearest, a point of four floats per bound.
struct Chunk {
  alignas(64) float lower[4 * kChunk];
  alignas(64) float upper[4 * kChunk];
};

/// Rounds outward and transposes points of four floats into one array per axis.
HWY_ATTR void storeRounded(const Chunk& chunk, std::size_t begin, BoxArrays& boxes) {
  const hn::CappedTag<float, 8> d;
  for (std::size_t i = 0; i < kChunk; i += hn::Lanes(d)) {
    hn::Vec<decltype(d)> v[3], unused;
    hn::LoadInterleaved4(d, chunk.lower + 4 * i, v[0], v[1], v[2], unused);
    for (int k = 0; k < 3; ++k) hn::StoreU(roundedDown(v[k]), d, boxes.lower[k].data() + begin + i);
    hn::LoadInterleaved4(d, chunk.upper + 4 * i, v[0], v[1], v[2], unused);
    for (int k = 0; k < 3; ++k) hn::StoreU(roundedUp(v[k]), d, boxes.upper[k].data() + begin + i);
  }
}

template <bool kSwept>
HWY_ATTR void triangleBoxesOf(const FloatPoint* HWY_RESTRICT vertices,
                              const FloatPoint* HWY_RESTRICT before,
                              const Triangle* HWY_RESTRICT triangles,
                              std::span<const std::uint32_t> groups, BoxArrays& boxes,
                              FloatBox* HWY_RESTRICT groupBoxes) {
  const hn::FixedTag<float, HWY_TARGET == HWY_SCALAR ? 1 : 4> d4;
  constexpr std::size_t kLanes = HWY_TARGET == HWY_SCALAR ? 1 : 4, kVectors = 4 / kLanes;
  using V = hn::Vec<decltype(d4)>;
  const V empty = hn::Set(d4, FloatBox::kEmptyLower);
  Chunk chunk;
  std::size_t chunkBegin = groups.front(), fill = 0;
  for (std::size_t g = 0; g + 1 < groups.size(); ++g) {
    if (groups[g] == groups[g + 1]) {
      groupBoxes[g] = FloatBox();
      continue;
    }
    V groupLower[kVectors], groupUpper[kVectors];
    for (std::size_t k = 0; k < kVectors; ++k) {
      groupLower[k] = empty;
      groupUpper[k] = hn::Neg(empty);
    }
    for (std::size_t t = groups[g]; t < groups[g + 1]; ++t) {
      const Triangle& corners = triangles[t - groups.front()];
      for (std::size_t k = 0; k < kVectors; ++k) {
        const V a = hn::Load(d4, &vertices[corners[0]].x + k * kLanes);
        const V b = hn::Load(d4, &vertices[corners[1]].x + k * kLanes);
        const V c = hn::Load(d4, &vertices[corners[2]].x + k * kLanes);
        V lower = hn::Min(hn::Min(a, b), c), upper = hn::Max(hn::Max(a, b), c);
        if constexpr (kSwept) {
          const V p = hn::Load(d4, &before[corners[0]].x + k * kLanes);
          const V q = hn::Load(d4, &before[corners[1]].x + k * kLanes);
          const V r = hn::Load(d4, &before[corners[2]].x + k * kLanes);
          lower = hn::Min(lower, hn::Min(hn::Min(p, q), r));
          upper = hn::Max(upper, hn::Max(hn::Max(p, q), r));
        }
        hn::Store(lower, d4, chunk.lower + 4 * fill + k * kLanes);
        hn::Store(upper, d4, chunk.upper + 4 * fill + k * kLanes);
        groupLower[k] = hn::Min(groupLower[k], lower);
        groupUpper[k] = hn::Max(groupUpper[k], upper);
      }
      if (++fill == kChunk) {
        storeRounded(chunk, chunkBegin, boxes);
        chunkBegin += kChunk;
        fill = 0;
      }
    }
    for (std::size_t k = 0; k < kVectors; ++k) {
      hn::Store(roundedDown(groupLower[k]), d4, groupBoxes[g].lower.data() + k * kLanes);
      hn::Store(roundedUp(groupUpper[k]), d4, groupBoxes[g].upper.data() + k * kLanes);
    }
  }
  // The rest is written one by one, because a whole vector would overwrite values that another
  // thread may have written behind it.
  for (std::size_t i = 0; i < fill; ++i)
    for (int k = 0; k < 3; ++k) {
      boxes.lower[k][chunkBegin + i] = OutwardRounding::down(chunk.lower[4 * i + k]);
      boxes.upper[k][chunkBegin + i] = OutwardRounding::up(chunk.upper[4 * i + k]);
    }
}

HWY_ATTR void triangleBoxesKernel(const FloatPoint* vertices, const FloatPoint* before,
                                  const Triangle* triangles, std::span<const std::uint32_t> groups,
                                  BoxArrays& boxes, FloatBox* groupBoxes) {
  if (before)
    triangleBoxesOf<true>(vertices, before, triangles, groups, boxes, groupBoxes);
  else
    triangleBoxesOf<false>(vertices, before, triangles, groups, boxes, groupBoxes);
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(triangleBoxesKernel);

void triangleBoxes(const FloatPoint* vertices, const FloatPoint* before, const Triangle* triangles,
                   std::span<const std::uint32_t> groups, BoxArrays& boxes, FloatBox* groupBoxes) {
  if (groups.size() < 2) return;
  PALPATE_ASSERT(std::is_sorted(groups.begin(), groups.end()));
  HWY_DYNAMIC_DISPATCH(triangleBoxesKernel)(vertices, before, triangles, groups, boxes, groupBoxes);
}

}  // namespace palpate
#endif
