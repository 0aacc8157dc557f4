#include "Mesh/FaceBlock.h"

#include "Common/EverySimdPath.h"
#include "Common/RandomMeshes.h"
#include "Mesh/FaceAtCorner.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <string>

// Blocks of triangles have the bits of FaceAtCorner, on every SIMD path.

namespace palpate {
namespace {

using Eigen::Vector3d;

TEST(FaceBlock, HasTheBitsOfOneTriangle) {
  testing::Random random(3);
  const auto below = [&](int size) {
    return static_cast<int>(random() % static_cast<unsigned>(size));
  };
  std::size_t plain = 0, others = 0;
  for (int i = 0; i < 4000; ++i) {
    FaceBlock block;
    std::array<Corners, FaceBlock::kLanes> corners;
    for (std::size_t lane = 0; lane < FaceBlock::kLanes; ++lane) {
      Corners& p = corners[lane];
      for (Vector3d& position : p) position = testing::randomPoint(random, -1.0, 1.0);
      if (below(3) == 0) p[2] = p[1] + std::ldexp(1.0, -below(60)) * p[2];
      if (below(8) == 0) p[static_cast<std::size_t>(below(3))] = p[0];
      if (below(4) == 0)
        for (Vector3d& position : p) position *= std::ldexp(1.0, 10 * below(60) - 300);
      block.set(lane, p[1] - p[0], p[2] - p[0]);
    }
    for (const std::string& path : testing::EverySimdPath()) {
      const FaceBlockNormals normals = weightedNormals(block);
      for (std::size_t lane = 0; lane < FaceBlock::kLanes; ++lane) {
        const FaceAtCorner face(corners[lane], 0);
        const bool isPlain = normals.isPlain >> lane & 1;
        ASSERT_EQ(isPlain, face.isPlain()) << path << ", block " << i;
        ++(isPlain ? plain : others);
        if (!isPlain) continue;
        const Vector3d expected = face.weightedNormal();
        for (int k = 0; k < 3; ++k)
          ASSERT_EQ(std::memcmp(&expected[k], &normals.weighted[k][lane], sizeof(double)), 0)
              << path << ", block " << i;
      }
    }
  }
  // Both kinds are common, however many SIMD paths the build has.
  EXPECT_GT(4 * plain, plain + others);
  EXPECT_GT(4 * others, plain + others);
}

}  // namespace
}  // namespace palpate
