#include "Common/TestGeometry.h"
#include "Shapes/Polytope.h"
#include "Exact/Predicates.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

// Hulls of point clouds are closed, convex and around every point, by exact predicates. Distances
// are compared with every triangle.

namespace palpate::testing {
namespace {

using Eigen::Vector3d;

/// Whether the triangles are closed, wound outward, and have every point behind them or on them.
void expectHullOf(const Polytope& hull, const Positions& cloud) {
  SignCounts counts;
  std::map<std::array<std::uint32_t, 2>, int> edges;
  std::vector<bool> used(hull.points().size(), false);
  const auto at = [&](std::uint32_t v) -> const Vector3d& { return hull.points()[v]; };
  for (std::uint32_t f = 0; f < hull.faceCount(); ++f) {
    const auto& [a, b, c] = hull.corners(f);
    for (const auto& [u, v] : {std::pair{a, b}, {b, c}, {c, a}}) ++edges[{u, v}], used[u] = true;
    const OrientedPlane plane(at(a), at(b), at(c));
    bool hasBehind = false;
    for (const Vector3d& p : cloud) {
      const int side = plane.side(p, counts);
      EXPECT_LE(side, 0);
      hasBehind |= side < 0;
    }
    EXPECT_TRUE(hasBehind);  // also that the triangle has an area
  }
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_TRUE(edges.contains({edge[1], edge[0]}));
  }
  EXPECT_TRUE(std::all_of(used.begin(), used.end(), [](bool u) { return u; }));
  EXPECT_EQ(hull.points().size() + hull.faceCount(), edges.size() / 2 + 2);
  for (const Vector3d& p : hull.points())
    EXPECT_NE(std::find(cloud.begin(), cloud.end(), p), cloud.end());
}

Positions onSphere(Random& random, int count) {
  Positions points;
  for (int i = 0; i < count; ++i) points.push_back(randomPoint(random, -1, 1).normalized());
  return points;
}

/// Clouds with a volume, most of them with many points in one plane, on one line, or doubled.
std::vector<Positions> clouds(Random& random) {
  std::vector<Positions> all;
  for (const int count : {4, 5, 9, 40, 200}) {
    Positions inside, grid, thin, far, turned;
    for (int i = 0; i < count; ++i) {
      inside.push_back(randomPoint(random, 0, 1));
      grid.push_back((3 * randomPoint(random, 0, 1)).array().floor());
      thin.push_back(randomPoint(random, 0, 1).cwiseProduct(Vector3d(1, 1e-3, 1e-16)));
      far.push_back(randomPoint(random, 0, 1e-9) + Vector3d(1e6, -3e5, 7e5));
      const Vector3d g =
          grid.back() / 3;  // nearly coplanar: rounding moves the points off their planes
      turned.push_back({0.6 * g[0] - 0.8 * g[1], 0.8 * g[0] + 0.6 * g[1], g[2] + 0.1 * g[0]});
    }
    all.insert(all.end(), {inside, grid, thin, far, turned, onSphere(random, count)});
  }
  std::erase_if(all, [](const Positions& points) { return spanOf(points).size() < 4; });
  return all;
}

TEST(Polytope, IsTheHullOfItsPoints) {
  Random random(1);
  int count = 0;
  for (const Positions& cloud : clouds(random)) {
    expectHullOf(Polytope(cloud), cloud);
    ++count;
  }
  EXPECT_GT(count, 24);
}

/// Many points: in the order of their places as in a mesh, all on the surface, mostly inside, near
/// one plane, and with two apexes that are visible from many faces.
TEST(Polytope, IsTheHullOfManyPoints) {
  Random random(5);
  constexpr int kCount = 1500;
  Positions sorted, ball = onSphere(random, kCount), shell, lattice, nearPlane, spindle, doubled;
  for (int i = 0; i < kCount; ++i) {
    sorted.push_back({1e-3 * i, uniform(random, 0, 1), uniform(random, 0, 1)});
    shell.push_back(randomPoint(random, -1, 1).normalized());
    shell.back() *= uniform(random, 0.5, 1);
    lattice.push_back(Vector3d(i % 12, i / 12 % 12, i / 144));
    nearPlane.push_back({uniform(random, 0, 1), uniform(random, 0, 1), uniform(random, 0, 1e-15)});
    const double angle = 2 * EIGEN_PI * i / kCount;
    spindle.push_back({std::cos(angle), std::sin(angle), uniform(random, -1e-6, 1e-6)});
    doubled.push_back(ball[static_cast<std::size_t>(i) / 3]);
  }
  spindle.push_back({0, 0, 1});
  spindle.push_back({0, 0, -1});
  for (const Positions& cloud : {sorted, ball, shell, lattice, nearPlane, spindle, doubled}) {
    const Polytope hull(cloud);
    expectHullOf(hull, cloud);
    Polytope pointByPoint;  // another way to the same body
    pointByPoint.start(spanOf(cloud));
    for (const Vector3d& p : cloud) pointByPoint.add(p);
    SignCounts counts;
    for (std::uint32_t f = 0; f < pointByPoint.faceCount(); ++f) {
      const auto& [a, b, c] = pointByPoint.corners(f);
      if (!pointByPoint.hasFace(f)) continue;
      const auto& at = pointByPoint.points();
      const OrientedPlane plane(at[a], at[b], at[c]);
      for (const Vector3d& p : hull.points()) EXPECT_LE(plane.side(p, counts), 0);
    }
    Positions mirrored = cloud;  // in another order, as exact
    std::reverse(mirrored.begin(), mirrored.end());
    expectHullOf(Polytope(mirrored), cloud);
  }
  EXPECT_EQ(Polytope(ball).points().size(), std::size_t{kCount});
  EXPECT_EQ(Polytope(doubled).points().size(), std::size_t{kCount / 3});
}

/// 64 times as many points take less than 64 * 64 / 8 times the CPU time. With n log n the factor
/// is about 100, with n squared 4096.
TEST(Polytope, HullOfManyPointsTakesNLogNTime) {
  Random random(6);
  const auto secondsFor = [&](int count) {
    const Positions cloud = onSphere(random, count);
    const std::clock_t start = std::clock();
    const Polytope hull(cloud);
    const double time = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    EXPECT_EQ(hull.faceCount(), 2 * static_cast<std::size_t>(count) - 4);
    RecordProperty("secondsFor" + std::to_string(count), std::to_string(time));
    return time;
  };
  secondsFor(1000);
  const double small = secondsFor(1000), large = secondsFor(64000);
  EXPECT_LT(large, 512 * small) << small << " s and " << large << " s";
}

TEST(Polytope, HullGrowsPointByPoint) {
  Random random(2);
  for (int run = 0; run < 30; ++run) {
    Positions cloud = onSphere(random, 20);
    Polytope hull;
    hull.start(spanOf(cloud));
    const Polytope whole(cloud);
    for (const Vector3d& p : cloud) hull.add(p);
    for (const Vector3d& p : cloud) EXPECT_FALSE(hull.add(p));
    for (int i = 0; i < 20; ++i) {
      const Vector3d x = randomPoint(random, -1.5, 1.5);
      EXPECT_NEAR(hull.signedDistance(x, 0).distance, whole.signedDistance(x, 0).distance, 1e-15);
    }
  }
}

TEST(Polytope, PlatesHaveTwoSides) {
  Random random(3);
  for (int run = 0; run < 20; ++run) {
    Positions cloud;
    for (int i = 0; i < 3 + run; ++i) {
      const Vector3d p = (4 * randomPoint(random, 0, 1)).array().floor();
      cloud.push_back({p[0], p[1], 2 * p[0] - p[1] + 3});
    }
    if (spanOf(cloud).size() < 3) continue;
    const Polytope plate(cloud);
    std::map<std::array<std::uint32_t, 2>, int> edges;
    for (std::uint32_t f = 0; f < plate.faceCount(); ++f) {
      const auto& [a, b, c] = plate.corners(f);
      for (const auto& [u, v] : {std::pair{a, b}, {b, c}, {c, a}}) ++edges[{u, v}];
    }
    for (const auto& [edge, number] : edges) {
      const auto back = edges.find({edge[1], edge[0]});
      ASSERT_NE(back, edges.end());
      EXPECT_EQ(number, back->second);
    }
    for (const Vector3d& p : cloud) EXPECT_NEAR(plate.signedDistance(p, 1e-14).distance, 0, 1e-14);
    const Vector3d up = Vector3d(-2, 1, 1).normalized(), middle = (cloud[0] + cloud[1]) / 2;
    for (const double height : {0.5, -0.5})
      EXPECT_NEAR(plate.signedDistance(middle + height * up, 1e-14).distance, 0.5, 1e-14);
  }
}

TEST(Polytope, DistanceMatchesTheNearestTriangle) {
  Random random(4);
  std::vector<Positions> all = clouds(random);
  Positions needle = onSphere(random, 100);
  for (Vector3d& p : needle) p = p.cwiseProduct(Vector3d(1, 0.01, 0.01));
  all.push_back(needle);
  for (const Positions& cloud : all) {
    const Polytope hull(cloud);
    double size = 0;
    for (const Vector3d& p : cloud) size = std::max(size, p.cwiseAbs().maxCoeff());
    const Vector3d low = cloud[0], high = cloud[1];
    const double tie = 0x1p-48 * size, extent = std::max((high - low).norm(), 1e-3 * size);
    for (int i = 0; i < 40; ++i) {
      const Vector3d x = low + extent * randomPoint(random, -1.5, 1.5);
      double nearest = std::numeric_limits<double>::infinity(), highest = -nearest;
      for (std::uint32_t f = 0; f < hull.faceCount(); ++f) {
        const auto& [a, b, c] = hull.corners(f);
        const auto& points = hull.points();
        const auto on = vertexTriangleDistance(x, points[a], points[b], points[c]);
        nearest = std::min(nearest, on.distance);
        const auto flat = vertexTriangleDistance(points[a], points[a], points[b], points[c]);
        highest = std::max(highest, flat.normal.dot(x - points[a]));
      }
      const PointShapeDistance found = hull.signedDistance(x, tie);
      EXPECT_NEAR(std::abs(found.distance), nearest, 8 * tie);
      EXPECT_NEAR(found.normal.norm(), 1, 1e-14);
      EXPECT_TRUE(std::abs(highest) <= 1e-6 * size || (found.distance < 0) == (highest < 0));
    }
  }
}

}  // namespace
}  // namespace palpate::testing
