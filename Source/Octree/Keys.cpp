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

/// Inserts three zero bits between each two of the low eight bits.
template <class V>
HWY_INLINE V spreadBits(V v) {
  const hn::DFromV<V> d;
  v = hn::And(hn::Or(v, hn::ShiftLeft<12>(v)), hn::Set(d, 0x000f000f));
  v = hn::And(hn::Or(v, hn::ShiftLeft<6>(v)), hn::Set(d, 0x03030303));
  return hn::And(hn::Or(v, hn::ShiftLeft<3>(v)), hn::Set(d, 0x11111111));
}

HWY_ATTR void octreeKeysKernel(const BoxArrays& boxes, const std::uint64_t* slots,
                               std::uint32_t first, std::size_t size, const Cube& cube, int levels,
                               std::uint64_t* keys) {
  const hn::CappedTag<float, 16> d;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::RebindToUnsigned<decltype(d)> du;
  const std::size_t lanes = hn::Lanes(d);
  constexpr int kCells = 1 << Key::kLevels;
  const float cells = kCells;
  const auto cellsPerUnit = hn::Set(d, static_cast<float>(cells / cube.edge));
  const auto slack = hn::Set(d, 1.0f + 0x1p-10f);
  const auto half = hn::Set(d, 0.5f);
  // The biased exponent of the cube's edge, a power of two.
  const auto edgeExponent = hn::Set(
      di,
      static_cast<std::int32_t>(std::bit_cast<std::uint32_t>(static_cast<float>(cube.edge)) >> 23));
  const auto deepest = hn::Set(di, levels);
  const auto zero = hn::Zero(di), lastCell = hn::Set(di, kCells - 1);
  // If the slots are not consecutive, boxes are gathered well before they are loaded as vectors. A
  // wide load from freshly written narrower values would stall.
  constexpr std::size_t kGathered = 64;
  alignas(64) float gathered[6][kGathered];
  alignas(64) std::int32_t gatheredSlots[kGathered];
  alignas(64) std::int32_t packed[32];
  bool isGathered = false;

  for (std::size_t i = 0; i < size; i += lanes) {
    const std::size_t count = size - i < lanes ? size - i : lanes, place = i % kGathered;
    if (slots && place == 0) {
      const std::size_t last = (size - i < kGathered ? size - i : kGathered) - 1;
      // Slots ascend, because equal keys stay in order.
      first = Key::slot(slots[i]) - static_cast<std::uint32_t>(i);
      isGathered = Key::slot(slots[i + last]) - first != i + last;
      for (std::size_t next = 0; isGathered && next <= last; ++next) {
        const std::uint32_t slot = Key::slot(slots[i + next]);
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
          hn::LoadU(d, isGathered ? gathered[k] + place : boxes.lower[k].data() + first + i);
      const auto upper =
          hn::LoadU(d, isGathered ? gathered[3 + k] + place : boxes.upper[k].data() + first + i);
      longest = hn::Max(longest, upper - lower);
      // The cube's corner is split into two floats. Near it, the differences are then practically
      // exact.
      const float corner = static_cast<float>(cube.lower[k]);
      const auto high = hn::Set(d, corner),
                 low = hn::Set(d, static_cast<float>(cube.lower[k] - corner));
      const auto fromCorner = (lower - high - low) * half + (upper - high - low) * half;
      const auto scaled =
          hn::Min(hn::Max(fromCorner * cellsPerUnit, hn::Zero(d)), hn::Set(d, cells));
      cell[k] = hn::Min(hn::ConvertTo(di, scaled), lastCell);
    }
    // ceil(log2(size)): the exponent of size, plus one if any bit of its fraction is set.
    const auto sizeBits = hn::BitCast(di, longest * slack);
    const auto sizeExponent = hn::ShiftRight<23>(sizeBits + hn::Set(di, 0x7fffff));
    const auto level = hn::Min(hn::Max(edgeExponent - sizeExponent, zero), deepest);
    // Eight levels are in the key's upper half, and the ninth is in its lower half, above the slot.
    static_assert(Key::kLevels == 9 && Key::kDigitBits == 4 && Key::kSlotBits == 28);
    const auto octants = [&](auto x, auto y, auto z) {
      return hn::Or(hn::Or(x, hn::ShiftLeft<1>(y)), hn::ShiftLeft<2>(z));
    };
    const auto digits = hn::Or(hn::Set(du, 0x88888888u),
                               hn::BitCast(du, octants(spreadBits(hn::ShiftRight<1>(cell[0])),
                                                       spreadBits(hn::ShiftRight<1>(cell[1])),
                                                       spreadBits(hn::ShiftRight<1>(cell[2])))));
    // Shifts by half of the digits' bits twice, because a single shift by 32 would shift nothing.
    const auto halfBits = hn::BitCast(du, level + level);
    const auto tooSmall = hn::Shr(hn::Shr(hn::Set(du, ~0u), halfBits), halfBits);
    const auto key = hn::BitCast(di, hn::AndNot(tooSmall, digits));
    const auto one = hn::Set(di, 1);
    const auto last = hn::Or(hn::Set(di, 8), octants(hn::And(cell[0], one), hn::And(cell[1], one),
                                                     hn::And(cell[2], one)));
    const auto ninth = hn::IfThenElseZero(hn::Eq(level, hn::Set(di, Key::kLevels)),
                                          hn::ShiftLeft<Key::kSlotBits>(last));
    const auto slot = isGathered ? hn::LoadU(di, gatheredSlots + place)
                                 : hn::Iota(di, static_cast<std::int32_t>(first + i));
    const auto low = hn::Or(ninth, slot);
    // Keys are 64-bit integers. Only copying may write bytes of other types to them.
    static_assert(std::endian::native == std::endian::little);
    hn::StoreInterleaved2(low, key, di, packed);
    if (count == lanes)
      std::memcpy(keys + i, packed, hn::Lanes(d) * sizeof(std::uint64_t));
    else
      std::memcpy(keys + i, packed, count * sizeof(std::uint64_t));
  }
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(octreeKeysKernel);

void octreeKeys(const BoxArrays& boxes, const std::uint64_t* slots, std::uint32_t first,
                std::size_t size, const Cube& cube, int levels, std::uint64_t* keys) {
  PALPATE_ASSERT(!slots || std::is_sorted(slots, slots + size, [](auto l, auto r) {
    return Key::slot(l) < Key::slot(r);
  }));
  HWY_DYNAMIC_DISPATCH(octreeKeysKernel)(boxes, slots, first, size, cube, levels, keys);
}

}  // namespace palpate
#endif
