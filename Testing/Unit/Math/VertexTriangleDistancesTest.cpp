#include "Math/VertexTriangleDistances.h"

#include "Common/Sanitized.h"
#include "Core/SimdPath.h"
#include "Math/ClosestPoint.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <random>
#include <vector>

// Lanes have the bits of finiteVertexTriangleDistance().
namespace palpate {
namespace {

using Eigen::Vector3d;
using Four = std::array<Vector3d, 4>;  // p a b c

class Cases {
 public:
  static constexpr int kKinds = 11;

  Four next(int kind) {
    Four x = {vector(), vector(), vector(), vector()};
    switch (kind) {
      case 1:  // far from the origin
        for (Vector3d& v : x) v += Vector3d(1e6, -2e6, 3e5);
        break;
      case 2:  // a sliver
        x[3] = x[1] + real() * (x[2] - x[1]) + smallPower() * vector();
        break;
      case 3:  // a small grid: distances of zero, ties of edges, points without an extent
        for (Vector3d& v : x) v = Vector3d(below(4), below(4), below(4));
        break;
      case 4:  // near the face
        x[0] = x[1] + real() * (x[2] - x[1]) + real() * (x[3] - x[1]) + smallPower() * vector();
        break;
      case 5:  // near an edge
        x[0] = x[1] + real() * (x[2] - x[1]) + smallPower() * vector();
        break;
      case 6:  // a segment or a point
        x[3] = x[2];
        if (below(2) == 0) x[1] = x[2];
        break;
      case 7:  // of any size
        for (Vector3d& v : x) v *= std::ldexp(1.0, below(2040) - 1020);
        break;
      case 8:  // far away
        x[0] *= 1 / smallPower();
        break;
      case 9:  // at a corner
        x[0] = x[1 + below(3)];
        if (below(2) == 0) x[0] += smallPower() * vector();
        break;
      case 10: {  // next to the middle of the longest edge, where two weights are 1/2
        x[1] = 0.5 * (x[2] + x[3]) + 0.3 * x[1];
        const Vector3d normal = (x[2] - x[1]).cross(x[3] - x[1]);
        x[0] = 0.5 * (x[2] + x[3]) + 0x1p-53 * vector() + real() * smallPower() * normal;
        break;
      }
    }
    return x;
  }

 private:
  double real() { return std::uniform_real_distribution<double>(-1, 1)(m_engine); }
  int below(int n) { return static_cast<int>(m_engine() % static_cast<unsigned>(n)); }
  double smallPower() { return std::pow(10.0, -below(18)); }
  Vector3d vector() { return {real(), real(), real()}; }

  std::mt19937_64 m_engine{21};
};

bool isSame(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}
bool isSame(const Vector3d& a, const Vector3d& b) {
  return isSame(a[0], b[0]) && isSame(a[1], b[1]) && isSame(a[2], b[2]);
}

TEST(VertexTriangleDistances, HaveTheBitsOfEachDistanceOnEverySimdPath) {
  for (const std::string& path : simdPaths()) {
    useSimdPath(path);
    Cases cases;
    for (int i = 0; i < testing::casesOf(20'000); ++i) {
      const std::size_t count = 1 + i % TriangleBatch::kSize;
      std::array<Four, TriangleBatch::kSize> x;
      TriangleBatch batch;
      for (std::size_t k = 0; k < count; ++k) {
        x[k] = cases.next(i / 10 % Cases::kKinds);
        batch.set(k, x[k][1], x[k][2], x[k][3]);
      }
      const Vector3d p = x[0][0];
      const VertexTriangleDistances lanes(p, batch, count);
      for (std::size_t k = 0; k < count; ++k) {
        const VertexTriangleDistance expected =
            finiteVertexTriangleDistance(p, x[k][1], x[k][2], x[k][3]);
        const VertexTriangleDistance found = lanes[k];
        ASSERT_EQ(found.feature, expected.feature) << path << i;
        ASSERT_TRUE(isSame(found.weights, expected.weights)) << path << i;
        ASSERT_TRUE(isSame(found.difference, expected.difference)) << path << i;
        ASSERT_TRUE(isSame(found.normal, expected.normal)) << path << i;
        ASSERT_TRUE(isSame(found.distance, expected.distance)) << path << i;
      }
    }
  }
  useSimdPath("");
}

}  // namespace
}  // namespace palpate
