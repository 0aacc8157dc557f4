#include "Math/DistanceBounds.h"

#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Core/SimdPath.h"

#include <gtest/gtest.h>

#include <cmath>

namespace palpate::testing {

/// Triangles of any shape: with narrow angles, tiny, and without area.
TriangleBatch randomTriangles(Random& random) {
  TriangleBatch batch;
  for (std::size_t i = 0; i < TriangleBatch::kSize; ++i) {
    const double length = std::pow(10.0, uniform(random, -8, 0)),
                 width = std::pow(10.0, uniform(random, -12, 0));
    const Eigen::Vector3d a = randomPoint(random, -1, 1),
                          b = a + length * randomPoint(random, -1, 1),
                          along = uniform(random, -1, 2) * (b - a);
    batch.set(i, a, b, a + along + width * length * randomPoint(random, -1, 1));
  }
  return batch;
}

TEST(DistanceBounds, EncloseTheDistanceOnEveryPath) {
  for (const std::string& path : simdPaths()) {
    useSimdPath(path);
    Random random(1);
    for (int i = 0; i < casesOf(5000); ++i) {
      const TriangleBatch batch = randomTriangles(random);
      Eigen::Vector3d p = randomPoint(random, -2, 2);
      if (i % 3 == 0) p = 0.5 * (batch.corner(0, 0) + batch.corner(0, 1));
      if (i % 7 == 0) p = batch.corner(1, 2);
      const DistanceBounds bounds(p, batch, TriangleBatch::kSize);
      const VertexTriangleDistances exact(p, batch, TriangleBatch::kSize);
      for (std::size_t k = 0; k < TriangleBatch::kSize; ++k) {
        const double distance = exact[k].distance;
        ASSERT_LE(bounds.lower[k], distance) << path;
        ASSERT_LE(distance, bounds.distance[k] + bounds.error[k]) << path;
      }
    }
  }
  useSimdPath("");
}

}  // namespace palpate::testing
