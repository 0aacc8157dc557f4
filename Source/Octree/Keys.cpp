#include "Octree/Keys.h"

#include "Core/Assert.h"

#include <algorithm>
#include <bit>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Octree/Keys.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Puts two zero bits between each two of the low ten bits.
template <class V>
HWY_INLINE V spreadBits(V v) {
  const hn::DFromV<V> d;
  v = hn::And(hn::Or(v, hn::ShiftLeft<16>(v)), hn::Set(d, 0x030000ff));
  v = hn::And(hn::Or(v, hn::ShiftLeft<8>(v)), hn::Set(d, 0x0300f00f));
  v = hn::And(hn::Or(v, hn::ShiftLeft<4>(v)), hn::Set(d, 0x030c30c3));
  return hn::And(hn::Or(v, hn::ShiftLeft<2>(v)), hn::Set(d, 0x09249249));
}

HWY_ATTR void octreeKeysKernel(const BoxArrays& boxes, const std::uint64_t* slots,
                               std::uint32_t first, std::size_t size, const Cube& cube,
                               KeyLayout layout, std::uint64_t* keys) {
  const hn::CappedTag<float, 16> d;
  const hn::RebindToSigned<decltype(d)> di;
  const std::size_t lanes = hn::Lanes(d);
  const float cells = static_cast<float>(1 << layout.levels);
  const auto cellsPerUnit = hn::Set(d, static_cast<float>(cells / cube.edge));
  const auto slack = hn::Set(d, 1.0f + 0x1p-10f);
  const auto half = hn::Set(d, 0.5f);
  // The biased exponent of the cube's edge, a power of two.
  const auto edgeExponent = hn::Set(
      di,
      static_cast<std::int32_t>(std::bit_cast<std::uint32_t>(static_cast<float>(cube.edge)) >> 23));
  const auto deepest = hn::Set(di, layout.levels);
  const auto zero = hn::Zero(di), lastCell = hn::Set(di, (1 << layout.levels) - 1);
  // Gathered, unless the slots are consecutive, well before it is read as vectors: a load that
  // spans fresh narrower stores waits for them.
  constexpr std::size_t kGathered = 64;
  alignas(64) float gathered[6][kGathered];
  alignas(64) std::int32_t gatheredSlots[kGathered];
  alignas(64) std::int32_t made[32];
  bool gathers = false;

  for (std::size_t i = 0; i < size; i += lanes) {
    const std::size_t count = size - i < lanes ? size - i : lanes, place = i % kGathered;
    if (slots && place == 0) {
      const std::size_t last = (size - i < kGathered ? size - i : kGathered) - 1;
      // They ascend: equal keys stay in order.
      first = static_cast<std::uint32_t>(slots[i]) - static_cast<std::uint32_t>(i);
      gathers = static_cast<std::uint32_t>(slots[i + last]) - first != i + last;
      for (std::size_t next = 0; gathers && next <= last; ++next) {
        const auto slot = static_cast<std::uint32_t>(slots[i + next]);
        gatheredSlots[next] = static_cast<std::int32_t>(slot);
        for (int k = 0; k < 3; ++k) {
          gathered[k][next] = boxes.lower[k][slot];
          gathered[3 + k][next] = boxes.upper[k][slot];
        }
      }
    }
    hn::Vec<decltype(di)> cell[3];
    auto longest = hn::Zero(d);
    for (int k = 0; k < 3; ++k) {
      const auto lower =
          hn::LoadU(d, gathers ? gathered[k] + place : boxes.lower[k].data() + first + i);
      const auto upper =
          hn::LoadU(d, gathers ? gathered[3 + k] + place : boxes.upper[k].data() + first + i);
      longest = hn::Max(longest, upper - lower);
      // The cube's corner in two floats: the differences are as good as exact near it.
      const float corner = static_cast<float>(cube.lower[k]);
      const auto high = hn::Set(d, corner),
                 low = hn::Set(d, static_cast<float>(cube.lower[k] - corner));
      const auto fromCorner = (lower - high - low) * half + (upper - high - low) * half;
      const auto scaled =
          hn::Min(hn::Max(fromCorner * cellsPerUnit, hn::Zero(d)), hn::Set(d, cells));
      cell[k] = hn::Min(hn::ConvertTo(di, scaled), lastCell);
    }
    // ceil(log2(size)): the exponent of size, one more if any bit of its fraction is set.
    const auto sizeBits = hn::BitCast(di, longest * slack);
    const auto sizeExponent = hn::ShiftRight<23>(sizeBits + hn::Set(di, 0x7fffff));
    const auto level = hn::Min(hn::Max(edgeExponent - sizeExponent, zero), deepest);
    const auto coarse = deepest - level;
    for (int k = 0; k < 3; ++k) cell[k] = spreadBits(hn::Shl(hn::Shr(cell[k], coarse), coarse));
    const auto morton =
        hn::Or(cell[0], hn::Or(hn::ShiftLeft<1>(cell[1]), hn::ShiftLeft<2>(cell[2])));
    // Slot and key side by side are a little-endian key << 32 | slot.
    const auto key = hn::Or(hn::ShiftLeft<KeyLayout::kLevelBits>(morton), level);
    const auto slot = gathers ? hn::LoadU(di, gatheredSlots + place)
                              : hn::Iota(di, static_cast<std::int32_t>(first + i));
    auto* out = reinterpret_cast<std::int32_t*>(keys + i);
    if (count == lanes) {
      hn::StoreInterleaved2(slot, key, di, out);
    } else {
      hn::StoreInterleaved2(slot, key, di, made);
      std::memcpy(out, made, count * sizeof(std::uint64_t));
    }
  }
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(octreeKeysKernel);

void octreeKeys(const BoxArrays& boxes, const std::uint64_t* slots, std::uint32_t first,
                std::size_t size, const Cube& cube, KeyLayout layout, std::uint64_t* keys) {
  PALPATE_ASSERT(!slots || std::is_sorted(slots, slots + size, [](auto l, auto r) {
    return static_cast<std::uint32_t>(l) < static_cast<std::uint32_t>(r);
  }));
  HWY_DYNAMIC_DISPATCH(octreeKeysKernel)(boxes, slots, first, size, cube, layout, keys);
}

}  // namespace palpate
#endif
