#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Queries/QueryTruth.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

// Signs of distances: the winding number by rational rays, for meshes that cross themselves, too;
// tetrahedra by rational volumes. WindingNumberTest has meshes with holes.
namespace palpate::testing {
namespace {

/// The winding number about a point that is not on the surface, by a rational ray that meets no
/// edge.
int windingNumber(Random& random, const Positions& positions, std::span<const Triangle> triangles,
                  const Vector3d& p) {
  for (;;) {
    const Ray ray{p, 16 * onLattice(random, 1 << 20) / (1 << 20) - Vector3d(8, 8, 8)};
    const oracle::Vector direction = oracle::toRational(ray.direction);
    int number = 0;
    bool isGeneric = true;
    for (const auto& t : triangles) {
      if (certainlyMisses(ray, positions, t)) continue;
      std::array<Rational, 3> sides;
      std::array<oracle::Vector, 3> corners;
      for (std::size_t i = 0; i < 3; ++i) {
        corners[i] = oracle::toRational(positions[t[i]]);
        for (std::size_t k = 0; k < 3; ++k) corners[i][k] -= p[static_cast<int>(k)];
      }
      for (std::size_t i = 0; i < 3; ++i)
        sides[i] = oracle::dot(direction, oracle::cross(corners[i], corners[(i + 1) % 3]));
      const int a = sgn(sides[0]), b = sgn(sides[1]), c = sgn(sides[2]);
      if ((a > 0 || b > 0 || c > 0) && (a < 0 || b < 0 || c < 0)) continue;
      if (a == 0 || b == 0 || c == 0) {
        isGeneric = false;
        break;
      }
      // The line passes through the inside. The ray does if the plane is ahead.
      const Rational height = oracle::dot(corners[0], oracle::cross(corners[1], corners[2]));
      if (sgn(height) == a) number += a;
    }
    if (isGeneric) return number;
  }
}

bool isOnSurface(const Positions& positions, std::span<const Triangle> triangles,
                 const Vector3d& p) {
  return std::any_of(triangles.begin(), triangles.end(),
                     [&](const Triangle& t) { return squaredDistance(p, positions, t) == 0; });
}

/// Expects the signs of rational rays, and the distances of closestPoint(). Returns how many points
/// are inside.
std::size_t expectSigns(const Both& both, const Positions& positions,
                        std::span<const Triangle> triangles, std::span<const Vector3d> points) {
  Random random(401);
  const SpatialQueries fast = both.octree.queries(), truth = both.bruteForce.queries();
  std::vector<SignedDistance> batch(points.size());
  fast.signedDistances(both.id, points, batch);
  std::size_t inside = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vector3d& p = points[i];
    const SignedDistance found = fast.signedDistance(both.id, p);
    EXPECT_TRUE(isSame(found, batch[i]));
    EXPECT_TRUE(isSame(found, truth.signedDistance(both.id, p)));
    EXPECT_TRUE(isSame(found.nearest, *fast.closestPoint(both.id, p)));
    EXPECT_EQ(std::abs(found.distance), found.nearest.distance);
    const bool contained = fast.contains(both.id, p);
    EXPECT_EQ(truth.contains(both.id, p), contained);
    EXPECT_EQ(std::signbit(found.distance), contained);
    const bool expected = !isOnSurface(positions, triangles, p) &&
                          windingNumber(random, positions, triangles, p) != 0;
    EXPECT_EQ(contained, expected) << i;
    inside += contained;
  }
  return inside;
}

/// Points around the mesh, near its surface, and on its vertices, edges and faces.
Positions probesOf(Random& random, const Positions& positions, std::span<const Triangle> triangles,
                   int count) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : positions) box.extend(p);
  Positions points;
  for (int i = 0; i < casesOf(count); ++i) {
    const Triangle& t = triangles[random() % triangles.size()];
    const Vector3d a = positions[t[0]], b = positions[t[1]], c = positions[t[2]];
    const double size = 1e-3 * box.sizes().maxCoeff();
    switch (i % 6) {
      case 0:
        points.push_back(a);
        break;
      case 1:
        points.push_back(0.5 * (a + b));
        break;
      case 2:
        points.push_back(0.25 * a + 0.25 * b + 0.5 * c);
        break;
      case 3:
        points.push_back(0.3 * a + 0.5 * b + 0.2 * c + size * randomPoint(random, -1, 1));
        break;
      default:
        points.push_back(box.min() + randomPoint(random, -0.1, 1.1).cwiseProduct(box.sizes()));
    }
  }
  return points;
}

std::vector<Mesh> closedMeshes(Random& random) {
  std::vector<Mesh> all{sphere(8, 12, {0, 0, 0}, 1.0)};
  // Pushed through itself: a part has the winding number -1.
  all.push_back(sphere(10, 14, {0, 0, 0}, 1.0));
  for (Vector3d& p : all.back().positions)
    if (p.z() > 0.3) p.z() = 0.6 - 1.8 * p.z();
  // Crumpled.
  all.push_back(sphere(8, 12, {0, 0, 0}, 1.0));
  for (Vector3d& p : all.back().positions) p += randomPoint(random, -0.5, 0.5);
  // Two bodies that cross: numbers of 2. A body in a body, and the hollow in it.
  all.push_back(joined(sphere(8, 10, {0, 0, 0}, 1), sphere(8, 10, {0.7, 0.2, 0.1}, 0.8)));
  all.push_back(joined(sphere(8, 10, {0, 0, 0}, 1), sphere(8, 10, {0, 0, 0}, 0.5)));
  const Mesh hollow = insideOut(sphere(8, 10, {0, 0, 0}, 0.5));
  all.push_back(joined(sphere(8, 10, {0, 0, 0}, 1), hollow));
  // Inside out.
  all.push_back(hollow);
  // On a lattice, with triangles in one plane, upon each other and without area.
  all.push_back(sphere(8, 12, {0, 0, 0}, 3.0));
  for (Vector3d& p : all.back().positions)
    for (double& x : p) x = std::round(x);
  return all;
}

TEST(SignedDistances, SignsAreThoseOfRationalRays) {
  Random random(402);
  std::size_t number = 0;
  for (const Mesh& mesh : closedMeshes(random)) {
    SCOPED_TRACE(number++);
    Both both(testGeometry(mesh));
    const Positions points =
        probesOf(random, mesh.positions, mesh.triangles, isLongRun() ? 48 : 16);
    EXPECT_GE(expectSigns(both, mesh.positions, mesh.triangles, points),
              leastOf(points.size() / 20));
    const Matrix3d turn = randomTurn(random);
    const Vector3d shift(1e3, 0.2, -30);
    both.change([&](OctreeBasedCD& each) { each.setTransform(both.id, {turn, shift}); });
    const Positions world = placed(mesh.positions, turn, shift);
    expectSigns(both, world, mesh.triangles, probesOf(random, world, mesh.triangles, 12));
    ASSERT_FALSE(HasFailure());
  }
}

/// Points near the crossings: pseudonormals give wrong signs there.
TEST(SignedDistances, NoWrongSignNearSelfCrossings) {
  Random random(403);
  const Mesh mesh = closedMeshes(random)[1];
  const Both both(testGeometry(mesh));
  Positions points;
  for (int i = 0; i < casesOf(150); ++i) {
    points.push_back(mesh.positions[random() % mesh.positions.size()]);
    points.back() += randomPoint(random, -0.05, 0.05);
  }
  EXPECT_GE(expectSigns(both, mesh.positions, mesh.triangles, points), leastOf(50));
}

/// Inside, boundary included: in a tetrahedron, of any winding.
TEST(SignedDistances, TetrahedralMeshes) {
  Random random(406);
  Solid solid = cells(3, random, [](const auto& c) { return c[0] != 1 || c[1] == 0; });
  Both both([&](OctreeBasedCD& each) {
    return each.addTetrahedralMesh(solid.positions, solid.tetrahedra);
  });
  for (const double by : {0.0, 0.05, 0.6}) {  // 0.6: tetrahedra are inverted and overlap
    const Positions now = moved(random, solid.positions, by);
    both.change([&](OctreeBasedCD& each) { each.setPositions(both.id, now); });
    const SpatialQueries queries = both.octree.queries();
    std::size_t inside = 0;
    for (int i = 0; i < casesOf(150); ++i) {
      Vector3d p = randomPoint(random, -0.2, 3.2);
      if (i % 3 == 0) p = 0.5 * onLattice(random, 7);
      if (i % 3 == 1) p = now[random() % now.size()];
      const bool expected =
          std::any_of(solid.tetrahedra.begin(), solid.tetrahedra.end(), [&](const Tetrahedron& t) {
            return oracle::tetrahedronWeights(p, {now[t[0]], now[t[1]], now[t[2]], now[t[3]]})
                .has_value();
          });
      EXPECT_EQ(queries.contains(both.id, p), expected) << i;
      EXPECT_EQ(both.bruteForce.queries().contains(both.id, p), expected);
      const SignedDistance found = queries.signedDistance(both.id, p);
      EXPECT_TRUE(isSame(found, both.bruteForce.queries().signedDistance(both.id, p)));
      EXPECT_EQ(std::signbit(found.distance), expected);
      EXPECT_TRUE(isSame(found.nearest, *queries.closestPoint(both.id, p)));
      inside += expected;
    }
    EXPECT_GE(inside, leastOf(20));
  }
}

}  // namespace
}  // namespace palpate::testing
