#include "Math/Box.h"

#include "Common/EverySimdPath.h"
#include "Unit/Math/TrianglePairs.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "Unit/Math/BoxRoundingTest.cpp"
#include "Core/Simd.h"
#include "Math/BoxRounding.h"

HWY_BEFORE_NAMESPACE();
namespace palpate::HWY_NAMESPACE {

HWY_ATTR void roundOutwardKernel(const float* values, float* down, float* up) {
  const hn::CappedTag<float, 16> d;
  for (std::size_t i = 0; i < 16; i += hn::Lanes(d)) {
    hn::Store(roundedDown(hn::Load(d, values + i)), d, down + i);
    hn::Store(roundedUp(hn::Load(d, values + i)), d, up + i);
  }
}

}  // namespace palpate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace palpate {

HWY_EXPORT(roundOutwardKernel);

namespace {

TEST(BoxRounding, LanesHaveTheBitsOfSingleBoundsOnEverySimdPath) {
  for (const std::string& path : testing::EverySimdPath()) {
    test::Random random(9);
    for (int repeat = 0; repeat < 200; ++repeat) {
      alignas(64) std::array<float, 16> values, down, up;
      for (float& value : values) {
        value = static_cast<float>(2 * random.unit() - 1);
        value = std::ldexp(value, random.between(-149, 120));
        if (random.below(8) == 0) value = 0.0f;
      }
      HWY_DYNAMIC_DISPATCH(roundOutwardKernel)(values.data(), down.data(), up.data());
      for (std::size_t i = 0; i < values.size(); ++i) {
        ASSERT_EQ(down[i], OutwardRounding::down(values[i])) << path << ", " << values[i];
        ASSERT_EQ(up[i], OutwardRounding::up(values[i])) << path << ", " << values[i];
      }
    }
  }
}

}  // namespace
}  // namespace palpate
#endif
