#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Math/IntersectionOracle.h"
#include "Unit/Queries/QueryTruth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

// Elements in shapes. Spheres and capsules are compared with rational distances, polytopes with
// exact intersections of triangles, and other shapes with a search for the least distance.
namespace palpate::testing {
namespace {

std::vector<std::uint32_t> overlapping(const Both& both, const PlacedShape& shape) {
  std::vector<std::uint32_t> found{7}, truth;
  both.octree.queries().overlapping(both.id, shape.geometry, {shape.rotation, shape.translation},
                                    found);
  both.bruteForce.queries().overlapping(both.id, shape.geometry,
                                        {shape.rotation, shape.translation}, truth);
  EXPECT_EQ(found, truth);
  EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
  return found;
}

/// Expects that the elements found are those with a gap of at most 0. Gaps below `error` in
/// magnitude are not judged.
std::size_t expectGaps(const Both& both, const PlacedShape& shape,
                       const std::vector<Triangle>& elements, double error,
                       const std::function<long double(const Triangle&)>& gapOf) {
  const std::vector<std::uint32_t> found = overlapping(both, shape);
  for (std::uint32_t e = 0; e < elements.size(); ++e) {
    const auto gap = static_cast<double>(gapOf(elements[e]));
    if (error > 0 && std::abs(gap) <= error) continue;
    EXPECT_EQ(std::binary_search(found.begin(), found.end(), e), gap <= 0) << e << ' ' << gap;
  }
  return found.size();
}

// ---- Spheres and capsules: rational distances ----

/// The squared distance of a segment from an element, where an element with a face may hold a part
/// of the segment.
Rational squaredFromSegment(const Vector3d& p, const Vector3d& q, const Positions& at,
                            const Triangle& t) {
  Rational least = std::min(squaredDistance(p, at, t), squaredDistance(q, at, t));
  for (std::size_t i = 0; i < 3; ++i)
    least = std::min(least, oracle::edgeEdge(p, q, at[t[i]], at[t[(i + 1) % 3]]).square);
  std::array<oracle::Vector, 3> corners;
  for (std::size_t i = 0; i < 3; ++i) corners[i] = oracle::toRational(at[t[i]]);
  std::vector<RationalHit> hits;
  if (p != q) hits = hitsOf({p, q - p, 0.0, 1.0}, at, std::span(&t, 1));
  return hits.empty() ? least : Rational(0);
}

/// On a lattice shapes touch elements exactly: these are in the shape.
TEST(ShapeOverlap, SpheresAndCapsulesOnALattice) {
  Random random(501);
  std::size_t found = 0, touching = 0;
  for (int round = 0; round < casesOf(12); ++round) {
    const TestGeometry soup = latticeSoup(random, 60, 8);
    const Both both(soup);
    for (int i = 0; i < 12; ++i) {
      const Vector3d p = onLattice(random, 8), q = i % 2 ? p : onLattice(random, 8);
      const double radius = static_cast<double>(random() % 4);
      const PlacedShape shape{i % 2 ? AnalyticalGeometry(Sphere{p, radius})
                                    : AnalyticalGeometry(Capsule{p, q, radius})};
      found += expectGaps(both, shape, soup.triangles, 0.0, [&](const Triangle& t) {
        const Rational square = squaredFromSegment(p, q, soup.positions, t);
        touching += square == Rational(radius * radius);
        return sgn(Rational(square - radius * radius));
      });
    }
  }
  EXPECT_GE(found, leastOf(500));
  EXPECT_GE(touching, leastOf(50));
}

TEST(ShapeOverlap, SpheresAndCapsulesForEveryGeometryType) {
  Random random(502);
  const TestGeometry geometries[] = {testGeometry(sphere(12, 16, {0.5, 0.5, 0.5}, 0.4)),
                                     testGeometry(soup(random, 200, 0.1)),
                                     thread(random, 150, 0.1, 0.0, true),
                                     thread(random, 150, 0.1, 0.03, false),
                                     particles(random, 200, 0.04),
                                     tapered(random, particles(random, 200, 0.0), 0.1)};
  for (const TestGeometry& geometry : geometries) {
    Both both(geometry);
    const std::vector<Triangle> elements = geometry.elements();
    std::size_t found = 0;
    for (int i = 0; i < casesOf(6); ++i) {
      const Vector3d near = geometry.positions[random() % geometry.positions.size()],
                     p = near + randomPoint(random, -0.15, 0.15),
                     q = i % 2 ? p : Vector3d(p + randomPoint(random, -0.4, 0.4));
      const double radius = uniform(random, 0.0, 0.25);
      const PlacedShape shape{i % 2 ? AnalyticalGeometry(Sphere{p, radius})
                                    : AnalyticalGeometry(Capsule{p, q, radius})};
      found += expectGaps(both, shape, elements, 1e-13, [&](const Triangle& t) {
        const Rational square = squaredFromSegment(p, q, geometry.positions, t);
        return oracle::root(square).get_d() - radius - geometry.radius(t[0]);
      });
    }
    EXPECT_GE(found, leastOf(10));
  }
}

/// Radii that differ from an element's distance by less than its rounding.
TEST(ShapeOverlap, SpheresAreDecidedExactly) {
  Random random(506);
  for (const TestGeometry& geometry :
       {testGeometry(soup(random, 80, 0.2)), thread(random, 80, 0.1, 0.0, true),
        tapered(random, particles(random, 80, 0.0), 0.01)}) {
    const Both both(geometry);
    const std::vector<Triangle> elements = geometry.elements();
    for (std::uint32_t e = 0; e < elements.size(); ++e) {
      const Vector3d centre = randomPoint(random, -1, 2);
      const Rational square = squaredDistance(centre, geometry.positions, elements[e]),
                     own = geometry.radius(elements[e][0]);
      const double radius = mpf_class(oracle::root(square) - mpf_class(own, 400)).get_d();
      for (const double each : {std::nextafter(radius, 0.0), radius, std::nextafter(radius, 9.0)}) {
        const Rational reach = own + each;
        const auto found = overlapping(both, {Sphere{centre, each}});
        EXPECT_EQ(std::binary_search(found.begin(), found.end(), e), square <= reach * reach);
      }
    }
  }
}

// ---- Boxes and hulls: the triangles of their surfaces, in exact arithmetic ----

/// A box or a hull as the triangles of its surface. scale: about the middle of its corners.
class SurfaceTruth {
 public:
  explicit SurfaceTruth(const PlacedShape& shape, double scale = 1.0)
      : m_facets(scaledCorners(shape, scale)) {}

  bool overlaps(const Positions& at, const Triangle& t) const {
    const Vector3d &a = at[t[0]], &b = at[t[1]], &c = at[t[2]];
    const Eigen::AlignedBox3d box(a.cwiseMin(b).cwiseMin(c), a.cwiseMax(b).cwiseMax(c));
    if (m_facets.isBody && m_facets.signedDistance(a) < 0) return true;
    return std::ranges::any_of(m_facets.all, [&](const Facets::Facet& facet) {
      const auto& [p, q, r] = facet.corners;
      return box.intersects({p.cwiseMin(q).cwiseMin(r), p.cwiseMax(q).cwiseMax(r)}) &&
             intersection::trianglesIntersect({p, q, r, a, b, c});
    });
  }

 private:
  static Positions scaledCorners(const PlacedShape& shape, double scale) {
    double radius = 0;
    Positions corners = cornersOf(shape, radius);
    Vector3d middle = Vector3d::Zero();
    for (const Vector3d& p : corners) middle += p / static_cast<double>(corners.size());
    for (Vector3d& p : corners)
      if (scale != 1.0) p = middle + scale * (p - middle);
    return corners;
  }
  Facets m_facets;
};

/// Expects the elements of exact arithmetic. Those that only a body larger or smaller by the error
/// overlaps are not judged. Returns how many are found.
std::size_t expectOverlaps(const Both& both, const PlacedShape& shape, const Positions& at,
                           const std::vector<Triangle>& elements, double error) {
  const std::vector<std::uint32_t> found = overlapping(both, shape);
  const SurfaceTruth inner(shape, 1 - error), outer(shape, 1 + error);
  for (std::uint32_t e = 0; e < elements.size(); ++e) {
    const bool isFound = std::binary_search(found.begin(), found.end(), e);
    EXPECT_TRUE(isFound ? outer.overlaps(at, elements[e]) : !inner.overlaps(at, elements[e])) << e;
  }
  return found.size();
}

Positions frustum() {
  Positions corners;
  for (const double x : {-1, 1})
    for (const double y : {-1, 1}) {
      corners.push_back({0.1 * x, 0.08 * y, -0.1});
      corners.push_back({0.4 * x, 0.3 * y, 0.5});
    }
  return corners;
}

/// Elements that just touch a shape are in it. Boxes and hulls may be flat.
TEST(ShapeOverlap, BoxesAndHullsOnALattice) {
  Random random(503);
  std::size_t found = 0, touching = 0;
  for (int round = 0; round < casesOf(8); ++round) {
    const TestGeometry soup = latticeSoup(random, 50, 7);
    const Both both(soup);
    for (int i = 0; i < 8; ++i) {
      AnalyticalGeometry geometry = Box{onLattice(random, 7), onLattice(random, 3)};
      if (i % 2) {
        ConvexHull hull;
        for (int k = 0; k < 3 + i; ++k) hull.points.push_back(onLattice(random, 7));
        geometry = hull;
      }
      const PlacedShape shape{geometry};
      found += expectOverlaps(both, shape, soup.positions, soup.triangles, 0.0);
      const SurfaceTruth inner(shape, 1 - 1e-9), whole(shape);
      touching += std::ranges::count_if(soup.triangles, [&](const Triangle& t) {
        return whole.overlaps(soup.positions, t) && !inner.overlaps(soup.positions, t);
      });
    }
  }
  EXPECT_GE(found, leastOf(300));
  EXPECT_GE(touching, leastOf(30));
}

TEST(ShapeOverlap, BoxesHullsAndFrustumsPlacedAnywhere) {
  Random random(504);
  const TestGeometry geometries[] = {
      testGeometry(sphere(10, 14, {0.5, 0.5, 0.5}, 0.4)), testGeometry(soup(random, 150, 0.1)),
      thread(random, 100, 0.1, 0.0, true), particles(random, 150, 0.0)};
  for (const TestGeometry& geometry : geometries) {
    Both both(geometry);
    const std::vector<Triangle> elements = geometry.elements();
    std::size_t found = 0;
    const auto test = [&](const Positions& now, const Vector3d& offset, double error) {
      for (int i = 0; i < casesOf(6); ++i) {
        AnalyticalGeometry tool = Box{{0.02, 0, 0}, {0.3, 0.15, 0.05}};
        if (i % 3 == 1) tool = ConvexHull{frustum()};
        if (i % 3 == 2) {
          ConvexHull hull;
          for (int k = 0; k < 6; ++k) hull.points.push_back(randomPoint(random, -0.3, 0.3));
          tool = hull;
        }
        const PlacedShape shape{tool, randomTurn(random), randomPoint(random, 0.1, 0.9) + offset};
        found += expectOverlaps(both, shape, now, elements, error);
      }
    };
    test(geometry.positions, {0, 0, 0}, 1e-12);
    const Positions now = moved(random, geometry.positions, 0.05);
    both.change([&](OctreeBasedCD& each) { each.setPositions(both.id, now); });
    test(now, {0, 0, 0}, 1e-12);
    const Matrix3d turn = Eigen::AngleAxisd(0.4, Vector3d(1, -2, 3).normalized()).matrix();
    const Vector3d shift(1e3, 0, -1e3);
    both.change([&](OctreeBasedCD& each) { each.setTransform(both.id, {turn, shift}); });
    test(placed(now, turn, shift), shift, 1e-10);
    EXPECT_GE(found, leastOf(10));
  }
}

/// Planes of triangles that are a million times as large as a box pass by one of its corners.
TEST(ShapeOverlap, LargeTrianglesAtACornerOfABox) {
  Random random(509);
  std::size_t found = 0, left = 0;
  for (int round = 0; round < casesOf(40); ++round) {
    const Vector3d half = randomPoint(random, 0.1, 1.0), centre = randomPoint(random, -1, 1);
    TestGeometry large;
    for (std::uint32_t i = 0; i < 30; ++i) {
      const Vector3d normal = randomPoint(random, -1, 1).normalized(), u = normal.unitOrthogonal(),
                     v = normal.cross(u);
      const Vector3d corner = centre + Vector3d(half.array() * normal.array().sign());
      const double side = uniform(random, -1, 1);
      const Vector3d at = corner + side * std::exp2(uniform(random, -40, -26)) * normal;
      for (int k = 0; k < 3; ++k) {
        const double angle = 2.1 * k + uniform(random, 0, 0.5);
        large.positions.push_back(at + 1e6 * (std::cos(angle) * u + std::sin(angle) * v));
      }
      large.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    const Both both(large);
    const PlacedShape shape{AnalyticalGeometry(Box{centre, half})};
    const std::size_t count = expectOverlaps(both, shape, large.positions, large.triangles, 1e-10);
    found += count;
    left += large.triangles.size() - count;
  }
  EXPECT_GE(found, leastOf(300));
  EXPECT_GE(left, leastOf(300));
}

/// Elements wholly inside, and a shape wholly between elements.
TEST(ShapeOverlap, InsideAndBetween) {
  const TestGeometry ball = testGeometry(sphere(10, 14, {0, 0, 0}, 1.0));
  const Both both(ball);
  for (const AnalyticalGeometry& shape :
       {AnalyticalGeometry(Sphere{{0, 0, 0}, 0.8}),
        AnalyticalGeometry(Box{{0, 0, 0}, {.5, .5, .5}}),
        AnalyticalGeometry(Capsule{{-0.5, 0, 0}, {0.5, 0, 0}, 0.3}),
        AnalyticalGeometry(ConvexHull{frustum()})})
    EXPECT_EQ(overlapping(both, {shape}).size(), 0u);
  for (const AnalyticalGeometry& shape :
       {AnalyticalGeometry(Sphere{{0, 0, 0}, 1.2}), AnalyticalGeometry(Box{{0, 0, 0}, {2, 2, 2}}),
        AnalyticalGeometry(Capsule{{-0.5, 0, 0}, {0.5, 0, 0}, 1.5}),
        AnalyticalGeometry(Plane{{0, 0, 2}, {0, 0, 1}, false}),
        AnalyticalGeometry(Cylinder{{0, 0, -2}, {0, 0, 2}, 2})})
    EXPECT_EQ(overlapping(both, {shape}).size(), ball.triangles.size());
}

// ---- Planes and cylinders: a search for the least distance ----

/// Triangles with a vertex twice are segments, whichever vertex it is.
TEST(ShapeOverlap, TrianglesWithAVertexTwiceAreSegments) {
  const std::vector<Vector3d> ends{{0, 0, 0}, {10, 0, 0}};
  const AnalyticalGeometry shapes[] = {Sphere{{5, 0, 0}, 1},
                                       Capsule{{5, -3, 0}, {5, 3, 0}, 0.5},
                                       Plane{{5, 0, 0}, {1, 0, 0}, true},
                                       Box{{5, 0, 0}, {1, 1, 1}},
                                       Box{{5, 0, 0}, {0, 1, 0}},
                                       Cylinder{{5, -3, 0}, {5, 3, 0}, 0.5},
                                       ConvexHull{{{5, -1, 0}, {5, 1, 0}}}};
  for (const Engine engine : {Engine::Octree, Engine::BruteForce})
    for (const Triangle& triangle :
         {Triangle{0, 0, 1}, {0, 1, 0}, {1, 0, 0}, {0, 1, 1}, {1, 0, 1}, {1, 1, 0}}) {
      OctreeBasedCD collisions({.engine = engine, .threads = 1});
      const GeometryId mesh = collisions.addTriangleMesh(ends, {&triangle, 1});
      for (const AnalyticalGeometry& shape : shapes) {
        std::vector<std::uint32_t> found;
        collisions.queries().overlapping(mesh, shape,
                                         {Eigen::Matrix3d::Identity(), Vector3d::Zero()}, found);
        EXPECT_EQ(found.size(), 1u)
            << shape.index() << ": " << triangle[0] << triangle[1] << triangle[2];
      }
    }
}

TEST(ShapeOverlap, PlanesAndCylinders) {
  Random random(505);
  const TestGeometry geometries[] = {testGeometry(soup(random, 40, 0.15)),
                                     thread(random, 60, 0.1, 0.0, true),
                                     particles(random, 80, 0.0)};
  for (const TestGeometry& geometry : geometries) {
    const Both both(geometry);
    std::size_t found = 0;
    for (int i = 0; i < 6; ++i) {
      const Vector3d p0 = randomPoint(random, -0.3, 0.3), p1 = randomPoint(random, -0.3, 0.3);
      const MeasuredShape shape{i < 3 ? AnalyticalGeometry(Plane{p0, p1, i == 2})
                                      : AnalyticalGeometry(Cylinder{p0, p1, 0.2}),
                                randomTurn(random), randomPoint(random, 0.3, 0.7)};
      found += expectGaps(both, shape, geometry.elements(), 1e-6, [&](const Triangle& t) {
        const auto& [a, b, c] = t;
        const Positions& at = geometry.positions;
        const auto height = [&](std::uint32_t v) {
          return p1.dot(shape.rotation.transpose() * (at[v] - shape.translation) - p0);
        };
        const auto [low, high] = std::minmax({height(a), height(b), height(c)});
        if (i == 2 && low < 0 && high > 0) return -1.0;  // corners on both sides
        return leastOn(shape, at[a], at[b], at[c]);
      });
    }
    EXPECT_GE(found, leastOf(20));
  }
}

// ---- Lines whose radii differ between their ends: the hulls of two balls ----

/// The least gap between a shape and the balls along a segment. The distance from the shape is that
/// of its own closest point.
double gapOfBalls(const SpatialQueries& queries, GeometryId shape, const TestGeometry& line,
                  const Triangle& t) {
  return minimumOf([&](double s) {
    const Vector3d centre = (1 - s) * line.positions[t[0]] + s * line.positions[t[1]];
    return queries.closestPoint(shape, centre)->distance -
           ((1 - s) * line.radius(t[0]) + s * line.radius(t[1]));
  });
}

TEST(ShapeOverlap, TaperedLinesAreHullsOfBalls) {
  Random random(507);
  TestGeometry line = tapered(random, thread(random, 80, 0.25, 0.0, false), 0.2);
  for (std::size_t v = 0; v < line.radii.size(); v += 2) line.radii[v] *= 0.05;
  for (const std::size_t v : {10u, 30u, 50u}) line.positions[v] = line.positions[v - 1];
  const Both both(line);
  const std::vector<Triangle> elements = line.elements();
  std::size_t found = 0, beyondClosest = 0;
  for (const AnalyticalGeometry& geometry : shapesOfEveryKind(random))
    for (int i = 0; i < casesOf(12); ++i) {
      const Vector3d& near = line.positions[random() % line.positions.size()];
      const PlacedShape shape{geometry, randomTurn(random), near + randomPoint(random, -0.2, 0.2)};
      OctreeBasedCD alone;
      const GeometryId id = alone.addAnalyticalGeometry(shape.geometry);
      alone.setTransform(id, {shape.rotation, shape.translation});
      const SpatialQueries queries = alone.queries();
      found += expectGaps(both, shape, elements, 1e-9, [&](const Triangle& t) -> long double {
        const double gap = gapOfBalls(queries, id, line, t);
        const auto* sphere = std::get_if<Sphere>(&geometry);
        if (sphere && gap < -1e-9) {
          const auto onLine = oracle::vertexTriangle(shape.translation, line.positions[t[0]],
                                                     line.positions[t[1]], line.positions[t[1]]);
          const double weight = onLine.weights[1].get_d() + onLine.weights[2].get_d();
          beyondClosest += oracle::root(onLine.square).get_d() - sphere->radius >
                           (1 - weight) * line.radius(t[0]) + weight * line.radius(t[1]) + 1e-9;
        }
        return gap;
      });
    }
  EXPECT_GE(found, leastOf(300));
  EXPECT_GE(beyondClosest, leastOf(3));
}

}  // namespace
}  // namespace palpate::testing
