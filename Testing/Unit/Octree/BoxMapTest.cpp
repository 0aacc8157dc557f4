#include "Octree/BoxMap.h"

#include "BoxOctree.h"
#include "Common/Sanitized.h"
#include "Octree/Dops.h"

#include <gmpxx.h>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace palpate {
namespace {

using testing::casesOf;
using testing::Random;
using testing::uniform;
using TurnMatrix = std::array<std::array<double, 3>, 3>;

/// Of any magnitude between two powers of two, and either sign.
double ofAnySize(Random& random, int least, int most) {
  const auto range = static_cast<unsigned>(most - least + 1);
  const double fraction = uniform(random, -1, 1);
  return std::ldexp(fraction, least + static_cast<int>(random() % range));
}

/// Rotations about any axis, or of the axes.
TurnMatrix anyRotation(Random& random) {
  const double angle = random() % 4 == 0 ? static_cast<double>(random() % 4) * std::acos(0.0)
                                         : uniform(random, 0, 6);
  const Eigen::Vector3d axis = random() % 2 ? testing::randomPoint(random, -1, 1).normalized()
                                            : Eigen::Vector3d(Eigen::Vector3d::UnitZ());
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
  TurnMatrix matrix;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      matrix[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] = rotation(i, j);
  return matrix;
}

mpq_class rowTimes(const std::array<double, 3>& row, const FloatBox& box, int corner) {
  mpq_class sum = 0;
  for (std::size_t j = 0; j < 3; ++j)
    sum += mpq_class(row[j]) * mpq_class((corner >> j & 1 ? box.upper : box.lower)[j]);
  return sum;
}

/// A bound that a shift moves, and that is then rounded outward, is beyond the exact one, and not
/// far beyond.
TEST(BoxMap, ShiftsEncloseTheExactBounds) {
  Random random(71);
  for (int i = 0; i < casesOf(20000); ++i) {
    const double offset = ofAnySize(random, -20, 20);
    double thickness = std::abs(ofAnySize(random, -40, 10));
    if (random() % 4 == 0) thickness = 0;
    float lower, upper;
    setShift(lower, upper, offset, thickness);
    const auto bound = static_cast<float>(random() % 2 ? ofAnySize(random, -20, 20) : -offset);
    const mpq_class low = mpq_class(bound) + mpq_class(offset) - mpq_class(thickness),
                    high = mpq_class(bound) + mpq_class(offset) + mpq_class(thickness);
    const float down = OutwardRounding::down(bound + lower),
                up = OutwardRounding::up(bound + upper);
    EXPECT_TRUE(mpq_class(down) <= low) << offset << ' ' << thickness << ' ' << bound;
    EXPECT_TRUE(mpq_class(up) >= high) << offset << ' ' << thickness << ' ' << bound;
    // Not by rounding to nearest alone: the shift itself has a margin.
    EXPECT_TRUE(mpq_class(lower) < mpq_class(offset) - mpq_class(thickness));
    EXPECT_TRUE(mpq_class(upper) > mpq_class(offset) + mpq_class(thickness));
    const mpq_class margin = mpq_class(0x1p-20) * mpq_class(std::abs(offset) + thickness +
                                                            std::abs(double{bound}) + 0x1p-100);
    EXPECT_TRUE(low - mpq_class(down) <= margin);
    EXPECT_TRUE(mpq_class(up) - high <= margin);
  }
}

/// A mapped box encloses the exact images of its corners, also where large terms cancel, and
/// exceeds them by little.
TEST(BoxMap, MappedBoxesEncloseTheirCorners) {
  Random random(72);
  for (int i = 0; i < casesOf(6000); ++i) {
    const TurnMatrix matrix = anyRotation(random);
    const bool isTiny = i % 5 == 0;
    const int scale = isTiny ? -135 : static_cast<int>(random() % 40) - 20;
    FloatBox box;
    for (std::size_t k = 0; k < 3; ++k) {
      box.lower[k] = static_cast<float>(ofAnySize(random, scale - 5, scale));
      box.upper[k] =
          box.lower[k] +
          static_cast<float>(std::abs(ofAnySize(random, scale - 30, scale - (i % 2 ? 25 : 0))));
    }
    std::array<double, 3> offset;
    for (std::size_t k = 0; k < 3; ++k)
      offset[k] = i % 3 == 0   ? 0.0
                  : i % 3 == 1 ? -rowTimes(matrix[k], box, 0).get_d()
                               : ofAnySize(random, scale - 10, scale + 10);
    const double thickness = i % 4 == 0 ? std::abs(ofAnySize(random, scale - 20, scale)) : 0.0,
                 error = i % 7 == 0 ? std::abs(ofAnySize(random, scale - 20, scale)) : 0.0;
    BoxMap map;
    map.count = 1;
    setEnd(map.ends[0], matrix, offset, thickness, error);
    const FloatBox mapped = map(box);
    for (std::size_t k = 0; k < 3; ++k) {
      mpq_class low = rowTimes(matrix[k], box, 0), high = low, size = 0;
      for (int corner = 1; corner < 8; ++corner) {
        const mpq_class at = rowTimes(matrix[k], box, corner);
        low = std::min(low, at);
        high = std::max(high, at);
      }
      for (std::size_t j = 0; j < 3; ++j)
        size += std::max(std::abs(box.lower[j]), std::abs(box.upper[j]));
      const mpq_class around = mpq_class(thickness) + mpq_class(error);
      low += mpq_class(offset[k]) - around;
      high += mpq_class(offset[k]) + around;
      size += abs(mpq_class(offset[k])) + around;
      EXPECT_TRUE(mpq_class(mapped.lower[k]) <= low) << i << ", axis " << k;
      EXPECT_TRUE(mpq_class(mapped.upper[k]) >= high) << i << ", axis " << k;
      const mpq_class margin = mpq_class(0x1p-17) * size + mpq_class(0x1p-101);
      EXPECT_TRUE(low - mpq_class(mapped.lower[k]) <= margin) << i;
      EXPECT_TRUE(mpq_class(mapped.upper[k]) - high <= margin) << i;
    }
  }
}

/// Of two ends, the box of both images; of a box clamped to the range of float, everything.
TEST(BoxMap, TwoEndsGiveBothImagesAndClampedBoxesReachAnywhere) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Random random(73);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d centre = testing::randomPoint(random, -2, 2);
    const FloatBox box = testing::boxAbout({centre.x(), centre.y(), centre.z()}, 0.5);
    BoxMap map, single[2];
    map.count = 2;
    for (std::size_t end = 0; end < 2; ++end) {
      const Eigen::Vector3d offset = testing::randomPoint(random, -3, 3);
      setEnd(map.ends[end], anyRotation(random), {offset.x(), offset.y(), offset.z()}, 0.01, 0.0);
      single[end].count = 1;
      single[end].ends[0] = map.ends[end];
    }
    FloatBox both = single[0](box);
    both.add(single[1](box));
    const FloatBox mapped = map(box);
    EXPECT_EQ(mapped.lower, both.lower);
    EXPECT_EQ(mapped.upper, both.upper);
    EXPECT_EQ(BoxMap()(box).lower, box.lower);
    EXPECT_EQ(map(FloatBox()).lower, FloatBox().lower);
    EXPECT_EQ(map(FloatBox()).upper, FloatBox().upper);
    const std::size_t axis = random() % 3;
    FloatBox low = box, high = box;
    low.lower[axis] = -kLargestFloat;
    high.upper[axis] = kLargestFloat;
    for (const FloatBox& clamped : {low, high}) {
      const FloatBox all = map(clamped);
      for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_EQ(all.lower[k], -kInfinity);
        EXPECT_EQ(all.upper[k], kInfinity);
      }
    }
  }
}

/// The shifts along each direction hold the offset, the thickness along a unit vector, and the
/// error along each axis.
TEST(DopMap, ShiftsHoldOffsetThicknessAndError) {
  Random random(74);
  OctreeDops dops;
  dops.halfWidths.fill(1.0);
  for (int i = 0; i < 200; ++i) {
    dops.directions = i % 2 ? 9 : 7;
    const Eigen::Vector3d offset = testing::randomPoint(random, -3, 3);
    const double thickness = i % 3 ? uniform(random, 0, 1) : 0.0,
                 error = i % 5 ? uniform(random, 0, 1) : 0.0;
    DopMap::End end;
    setEnd(end, dops, anyRotation(random), {offset.x(), offset.y(), offset.z()}, thickness, error);
    for (int k = 0; k < dops.directions; ++k) {
      const DopDirection& at = dopDirections(dops.directions)[static_cast<std::size_t>(k)];
      const Eigen::Vector3d direction(at[0], at[1], at[2]);
      const double middle = direction.dot(offset),
                   around = direction.norm() * thickness + direction.cwiseAbs().sum() * error;
      EXPECT_LT(end.shiftLower[k], middle - around);
      EXPECT_GT(end.shiftUpper[k], middle + around);
      EXPECT_NEAR(end.shiftLower[k], middle - around, 1e-5);
      EXPECT_NEAR(end.shiftUpper[k], middle + around, 1e-5);
    }
  }
}

}  // namespace
}  // namespace palpate
