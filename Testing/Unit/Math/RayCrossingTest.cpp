#include "Math/RayCrossing.h"

#include "Common/DegenerateCases.h"

#include <gtest/gtest.h>

#include <optional>

// The winding number of a closed mesh, counted along the rays of all six directions. Tetrahedra
// with small integer coordinates, many of them flat, put most rays on edges and corners.

namespace palpate {
namespace {

using Eigen::Vector3d;

/// Empty on the surface.
std::optional<int> windingNumber(int axis, bool against, const Vector3d& p,
                                 const testing::Mesh& mesh) {
  SignCounts counts;
  int number = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const auto& x = mesh.positions;
    const RayCrossing crossing = crossRay(axis, against, p, x[a], x[b], x[c], counts);
    if (crossing == RayCrossing::OnTriangle) return {};
    number += static_cast<int>(crossing);
  }
  return number;
}

/// Tetrahedra that cross each other and themselves, each with any orientation.
testing::Mesh tetrahedra(testing::Random& random, int count) {
  std::uniform_int_distribution<int> coordinate(-2, 2);
  testing::Mesh mesh;
  for (int i = 0; i < count; ++i) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (int k = 0; k < 4; ++k)
      for (double& x : mesh.positions.emplace_back()) x = coordinate(random);
    for (const Triangle& t : {Triangle{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}})
      mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  return mesh;
}

TEST(RayCrossing, AllDirectionsCountTheSameWindingNumber) {
  testing::Random random(3);
  std::uniform_int_distribution<int> coordinate(-5, 5);
  std::size_t inside = 0, outside = 0, on = 0;
  for (int round = 0; round < 2000; ++round) {
    const testing::Mesh mesh = tetrahedra(random, 1 + round % 3);
    for (int i = 0; i < 20; ++i) {
      Vector3d p;
      for (double& x : p) x = 0.5 * coordinate(random);
      const std::optional<int> number = windingNumber(0, false, p, mesh);
      ++(!number ? on : *number != 0 ? inside : outside);
      for (int axis = 0; axis < 3; ++axis)
        for (const bool against : {false, true})
          ASSERT_EQ(windingNumber(axis, against, p, mesh), number)
              << "axis " << axis << (against ? ", against it" : "") << ", round " << round
              << ", point " << p.transpose();
    }
  }
  EXPECT_GT(inside, 300u);
  EXPECT_GT(on, 500u);
  EXPECT_GT(outside, 10000u);
}

}  // namespace
}  // namespace palpate
