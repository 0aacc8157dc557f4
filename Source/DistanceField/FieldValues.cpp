// Part of DistanceField/FieldCells.h: FieldLookup::values().
#include "DistanceField/FieldCells.h"

#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "DistanceField/FieldValues.cpp"
#include "Core/Simd.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// FieldLookup::value() in lanes, operation by operation, and thus with the same bits.
class ValuesInLanes {
 public:
  using D = hn::CappedTag<double, 8>;
  using V = hn::Vec<D>;
  using Integers = hn::Rebind<std::int32_t, D>;

  HWY_ATTR ValuesInLanes(const FieldCells& cells, const FieldFrame& frame)
      : m_frame(frame),
        m_roots(reinterpret_cast<const std::int32_t*>(cells.roots.data())),
        m_blocks(reinterpret_cast<const std::int32_t*>(cells.blocks.data())),
        m_leaves(reinterpret_cast<const float*>(cells.leaves.data())) {}

  /// coordinates: of as many points as D has lanes, for each axis. Returns the lanes of points
  /// outside the domain, as bits. Their values are not to be used.
  HWY_ATTR HWY_INLINE std::uint32_t at(const double (&coordinates)[3][8], double* out) const {
    const V zero = hn::Zero(d), one = hn::Set(d, 1.0);
    V t[3];
    auto isOutside = hn::Lt(zero, zero);
    auto index = hn::Zero(di);
    for (int k = 2; k >= 0; --k) {
      const V size = hn::Set(d, m_frame.size[k]);
      const V u = (hn::Load(d, coordinates[k]) - hn::Set(d, m_frame.origin[k])) *
                  hn::Set(d, m_frame.toUnits);
      const V in = hn::Min(hn::IfThenElseZero(hn::Gt(u, zero), u), size);
      isOutside = hn::Or(isOutside, hn::Ne(u, in));
      const auto cells = hn::DemoteTo(di, size);
      const auto root = hn::Min(hn::DemoteTo(di, in), cells - hn::Set(di, 1));
      t[k] = in - hn::PromoteTo(d, root);
      index = index * cells + root;
    }
    auto entry = hn::GatherIndex(di, m_roots, index);
    for (;;) {
      const auto isBlock = hn::Eq(kindOf(entry), hn::Zero(di));
      if (hn::AllFalse(di, isBlock)) break;
      const V active = hn::PromoteTo(d, hn::IfThenElseZero(isBlock, hn::Set(di, 1)));
      const auto isActive = hn::Gt(active, zero);
      V octant = zero;
      for (int k = 0; k < 3; ++k) {
        const V doubled = hn::Set(d, 2.0) * t[k];
        const auto isUpper = hn::Ge(doubled, one);
        octant = octant + hn::IfThenElseZero(isUpper, hn::Set(d, 1 << k));
        t[k] = hn::IfThenElse(isActive, doubled - hn::IfThenElseZero(isUpper, one), t[k]);
      }
      const auto child = hn::ShiftLeft<3>(indexOf(entry)) + hn::DemoteTo(di, octant);
      // A lane without a block reads the first one.
      const auto next = hn::GatherIndex(di, m_blocks, hn::IfThenElseZero(isBlock, child));
      entry = hn::IfThenElse(isBlock, next, entry);
    }
    const auto kind = kindOf(entry);
    const auto isLeaf = hn::Eq(kind, hn::Set(di, 1));
    const auto leaf = hn::IfThenElseZero(isLeaf, hn::ShiftLeft<3>(indexOf(entry)));
    const V kinds = hn::PromoteTo(d, kind);
    const auto corner = [&](int i) HWY_ATTR {
      const hn::Rebind<float, D> df;
      return hn::PromoteTo(d, hn::GatherIndex(df, m_leaves + i, leaf));
    };
    const auto mix = [](V a, V b, V s) HWY_ATTR { return a + s * (b - a); };
    const V lower = mix(mix(corner(0), corner(1), t[0]), mix(corner(2), corner(3), t[0]), t[1]);
    const V upper = mix(mix(corner(4), corner(5), t[0]), mix(corner(6), corner(7), t[0]), t[1]);
    const V band = hn::Set(d, m_frame.band), inside = hn::Neg(band);
    const V beyond = hn::IfThenElse(hn::Gt(kinds, hn::Set(d, 2.0)), inside, band);
    const V value = hn::IfThenElse(hn::Eq(kinds, one), mix(lower, upper, t[2]), beyond);
    const V atMost = hn::IfThenElse(hn::Gt(value, band), band, value);
    const V clamped = hn::IfThenElse(hn::Lt(value, inside), inside, atMost);
    hn::Store(hn::Set(d, m_frame.unit) * clamped, d, out);
    return bitsOf(d, isOutside);
  }

  static constexpr D d{};

 private:
  using Entries = hn::Vec<Integers>;

  HWY_ATTR HWY_INLINE static Entries kindOf(Entries entry) {
    const hn::RebindToUnsigned<Integers> du;
    return hn::BitCast(di, hn::ShiftRight<CellEntry::kKindShift>(hn::BitCast(du, entry)));
  }
  HWY_ATTR HWY_INLINE static Entries indexOf(Entries entry) {
    return hn::And(entry, hn::Set(di, CellEntry::kMostIndices - 1));
  }

  static constexpr Integers di{};
  const FieldFrame& m_frame;
  const std::int32_t *m_roots, *m_blocks;
  const float* m_leaves;
};

HWY_ATTR void fieldValuesKernel(const FieldCells& cells, const FieldFrame& frame,
                                const FieldLookup& lookup, const Eigen::Vector3d* points,
                                std::size_t count, double* out,
                                double (*value)(const FieldLookup&, const Eigen::Vector3d&)) {
  const ValuesInLanes lanes(cells, frame);
  const std::size_t size = hn::Lanes(ValuesInLanes::d);
  alignas(64) double coordinates[3][8] = {}, values[8];
  for (std::size_t i = 0; i < count; i += size) {
    const std::size_t some = count - i < size ? count - i : size;
    for (std::size_t lane = 0; lane < some; ++lane) {
      const double* const point = points[i + lane].data();
      for (int k = 0; k < 3; ++k) coordinates[k][lane] = point[k];
    }
    std::uint32_t bits = lanes.at(coordinates, values) & ((1u << some) - 1);
    for (std::size_t lane = 0; lane < some; ++lane) out[i + lane] = values[lane];
    if (bits == 0) continue;
    leaveLanes();
    for (; bits != 0; bits &= bits - 1) {
      const std::size_t outside = i + static_cast<std::size_t>(std::countr_zero(bits));
      out[outside] = value(lookup, points[outside]);
    }
  }
  leaveLanes();
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(fieldValuesKernel);

void FieldLookup::values(std::span<const Eigen::Vector3d> points, double* out) const {
  // Lanes index numbers with 31 bits.
  constexpr std::size_t kMost = std::size_t{1} << 28;
  if (m_cells.leaves.empty() || m_cells.leaves.size() >= kMost || m_cells.blocks.size() >= kMost) {
    for (std::size_t i = 0; i < points.size(); ++i) out[i] = value(points[i]);
    return;
  }
  const auto one = [](const FieldLookup& lookup, const Eigen::Vector3d& point) {
    return lookup.value(point);
  };
  HWY_DYNAMIC_DISPATCH(fieldValuesKernel)
  (m_cells, m_frame, *this, points.data(), points.size(), out, one);
}

}  // namespace palpate
#endif
