#include <palpate/OctreeBasedCD.h>

#include "Common/BallTruth.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Common/TestGeometry.h"
#include "Unit/Queries/QueryTruth.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <vector>

// Signs of distances: the winding number by rational rays, for meshes that cross themselves, too;
// tetrahedra by rational volumes; normals of the closest points. Bodies that are not closed,
// against the sum of all solid angles.
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
  int number = 0;
  for (const Mesh& mesh : closedMeshes(random)) {
    SCOPED_TRACE(number);
    // Near self-crossings, pseudonormals give wrong signs.
    const int count = number++ == 1 ? 120 : isLongRun() ? 48 : 16;
    Both both(testGeometry(mesh));
    const Positions points = hardPoints(random, mesh.positions, mesh.triangles, casesOf(count));
    EXPECT_GE(expectSigns(both, mesh.positions, mesh.triangles, points),
              leastOf(points.size() / 20));
    const Matrix3d turn = randomTurn(random);
    const Vector3d shift(1e3, 0.2, -30);
    both.change([&](OctreeBasedCD& each) { each.setTransform(both.id, {turn, shift}); });
    const Positions world = placed(mesh.positions, turn, shift);
    expectSigns(both, world, mesh.triangles,
                hardPoints(random, world, mesh.triangles, casesOf(12)));
    ASSERT_FALSE(HasFailure());
  }
}

/// Inside, boundary included: in a tetrahedron, of any winding.
TEST(SignedDistances, TetrahedralMeshes) {
  Random random(406);
  Solid solid = cells(3, random, [](const auto& c) { return c[0] != 1 || c[1] == 0; });
  Both both(solid);
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

using Eigen::Vector3d;

/// The sum of the normals of all triangles that hold the point, at a vertex weighted by their
/// angles.
Vector3d truthOf(const Mesh& mesh, const SurfacePoint& at) {
  Vector3d sum = Vector3d::Zero();
  for (const Triangle& t : mesh.triangles) {
    bool holds = true;
    double angle = 1.0;
    for (int i = 0; i < 3; ++i) {
      if (at.weights[i] == 0.0) continue;
      const auto found = std::find(t.begin(), t.end(), at.vertices[static_cast<std::size_t>(i)]);
      if (found == t.end()) {
        holds = false;
        break;
      }
      if (at.weights[i] != 1.0) continue;
      const auto corner = static_cast<std::size_t>(found - t.begin());
      const Vector3d u = mesh.positions[t[(corner + 1) % 3]] - mesh.positions[t[corner]],
                     v = mesh.positions[t[(corner + 2) % 3]] - mesh.positions[t[corner]];
      angle = std::atan2(u.cross(v).norm(), u.dot(v));
    }
    if (!holds) continue;
    const Vector3d a = mesh.positions[t[0]];
    sum += angle * (mesh.positions[t[1]] - a).cross(mesh.positions[t[2]] - a).normalized();
  }
  return sum.normalized();
}

/// A bumpy closed body, seen from points on, near and far from it. The normals tell inside from
/// outside (Baerentzen and Aanaes).
TEST(SurfaceNormals, AreAngleWeightedAndTellTheSide) {
  Random random(301);
  Mesh body = sphere(10, 14, {0.5, 0.5, 0.5}, 0.4);
  for (Vector3d& p : body.positions) p += randomPoint(random, -0.02, 0.02);
  OctreeBasedCD collisions;
  const GeometryId id = collisions.addTriangleMesh(body.positions, body.triangles);
  const SpatialQueries queries = collisions.queries();
  std::array<std::size_t, 4> features{};
  const auto compare = [&](const Vector3d& point) {
    const SignedDistance signedDistance = queries.signedDistance(id, point);
    const SurfacePoint& found = signedDistance.nearest;
    EXPECT_EQ(found.normal, queries.closestPoint(id, point)->normal);
    ++features[static_cast<std::size_t>((found.weights.array() != 0.0).count())];
    EXPECT_NEAR(found.normal.norm(), 1.0, 1e-15);
    EXPECT_LE((found.normal - truthOf(body, found)).norm(), 1e-11);
    if (found.distance > 1e-9) {
      EXPECT_EQ(found.normal.dot(point - found.position) > 0.0, signedDistance.distance > 0.0);
    }
    return found.distance;
  };
  for (int repeat = 0; repeat < casesOf(2000); ++repeat) {
    compare(randomPoint(random, -0.5, 1.5));
    compare(randomPoint(random, 0, 1));
  }
  for (const Vector3d& vertex : body.positions) EXPECT_EQ(compare(vertex), 0.0);
  EXPECT_GE(features[1], leastOf(100));
  EXPECT_GE(features[2], leastOf(50));
  EXPECT_GE(features[3], leastOf(50));
}

TEST(SurfaceNormals, OfLinesPointsAndShapes) {
  OctreeBasedCD collisions;
  const std::vector<Vector3d> ends{{0, 0, 0}, {2, 0, 0}};
  const GeometryId line = collisions.addLineMesh(ends, std::vector<Segment>{{0, 1}}, 0.1),
                   points = collisions.addPointSet(ends, 0.1),
                   box = collisions.addAnalyticalGeometry(Box{{0, 0, 0}, {1, 1, 1}});
  collisions.setTransform(box, {Eigen::Matrix3d::Identity(), {10, 0, 0}});
  const SpatialQueries queries = collisions.queries();
  EXPECT_EQ(queries.closestPoint(line, {1, 0, 3})->normal, Vector3d(0, 0, 1));
  const Vector3d across = queries.closestPoint(line, {1, 0, 0})->normal;
  EXPECT_EQ(across.norm(), 1.0);
  EXPECT_EQ(across.x(), 0.0);
  EXPECT_EQ(queries.closestPoint(points, {0, -3, 0})->normal, Vector3d(0, -1, 0));
  EXPECT_EQ(queries.closestPoint(points, {0, 0, 0})->normal.norm(), 1.0);
  EXPECT_EQ(queries.closestPoint(box, {12, 0, 0})->normal, Vector3d(1, 0, 0));
  const GeometryDistance found = queries.distance(line, box);
  EXPECT_EQ(found.a.normal, Vector3d(1, 0, 0));
  EXPECT_EQ(found.b.normal, Vector3d(-1, 0, 0));
}

/// Faces back to back cancel, and a triangle without area has no normal: there is a unit one still.
TEST(SurfaceNormals, OfDegenerateMeshes) {
  OctreeBasedCD collisions;
  const std::vector<Vector3d> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {2, 0, 0}};
  const GeometryId doubled = collisions.addTriangleMesh(
                       corners, std::vector<Triangle>{{0, 1, 2}, {0, 2, 1}}),
                   flat = collisions.addTriangleMesh(corners, std::vector<Triangle>{{0, 1, 3}});
  const SpatialQueries queries = collisions.queries();
  for (const Vector3d& p : {Vector3d(0, 0, 0), Vector3d(0.5, -1, 0), Vector3d(0.2, 0.2, 1)}) {
    EXPECT_EQ(queries.closestPoint(doubled, p)->normal, Vector3d(0, 0, 1));
    EXPECT_EQ(queries.closestPoint(flat, p)->normal.norm(), 1.0);
  }
}

/// The solid angle by the angles of the spherical triangle, in 64 bits.
long double solidAngle(const Wide& a, const Wide& b, const Wide& c) {
  const long double volume = a.dot(b.cross(c));
  const auto corner = [&](const Wide& u, const Wide& v, const Wide& w) {
    return std::atan2(u.norm() * std::abs(volume), u.cross(v).dot(u.cross(w)));
  };
  const long double excess =
      corner(a, b, c) + corner(b, c, a) + corner(c, a, b) - std::numbers::pi_v<long double>;
  return volume > 0 ? excess : volume < 0 ? -excess : 0;
}

double truth(const Mesh& body, const Vector3d& p) {
  long double sum = 0;
  for (const auto& [a, b, c] : body.triangles) {
    const auto from = [&](std::uint32_t v) -> Wide {
      return body.positions[v].cast<long double>() - p.cast<long double>();
    };
    sum += solidAngle(from(a), from(b), from(c));
  }
  return static_cast<double>(std::abs(sum) / (4 * std::numbers::pi_v<long double>));
}

constexpr InsideSettings byNumber(double margin = 0) { return {InsideRule::WindingNumber, margin}; }

Positions pointsAround(Random& random, std::size_t count, double half) {
  Positions points(count);
  for (Vector3d& p : points) p = randomPoint(random, -half, half);
  return points;
}

/// The vertices and `decided` match the exact values, except within rounding. Brute force and any
/// threads give the same. Returns how many are found.
std::size_t expectTrue(const Positions& points, const Mesh& body, double margin = 0) {
  const std::vector<InsideVertex> found = insideOf(points, body, byNumber(margin));
  EXPECT_EQ(insideOf(points, body, byNumber(margin), settingsOf(Engine::BruteForce)), found);
  EXPECT_EQ(insideOf(points, body, byNumber(margin), settingsOf(Engine::Octree, 3)), found);
  const Both both(body);
  const SpatialQueries fast = both.octree.queries(), slow = both.bruteForce.queries();
  auto next = found.begin();
  for (std::uint32_t v = 0; v < points.size(); ++v) {
    const bool isFound = next != found.end() && next->vertex == v;
    const double number = truth(body, points[v]), off = std::abs(number - 0.5) - margin;
    if (std::abs(number - (0.5 - margin)) > 1e-9) {
      EXPECT_EQ(isFound, number > 0.5 - margin) << v << ": " << number;
    }
    if (isFound && std::abs(off) > 1e-9) {
      EXPECT_EQ(next->decided, off > 0) << v << ": " << number;
    }
    const SignedDistance signedDistance = fast.signedDistance(both.id, points[v], byNumber(margin));
    EXPECT_TRUE(isSame(signedDistance, slow.signedDistance(both.id, points[v], byNumber(margin))));
    EXPECT_EQ(signedDistance.distance < 0, isFound);
    EXPECT_EQ(fast.contains(both.id, points[v], byNumber(margin)), isFound);
    next += isFound;
  }
  EXPECT_EQ(next, found.end());
  return found.size();
}

/// A sphere of radius 1 with bumps.
Mesh lump(Random& random, std::uint32_t rings, std::uint32_t segments) {
  Mesh mesh = sphere(rings, segments, {0, 0, 0}, 1);
  for (Vector3d& p : mesh.positions) p *= uniform(random, 0.85, 1);
  return mesh;
}

TEST(WindingNumber, FewerPointsAreInsideAsHolesGrow) {
  Random random(2);
  const Mesh whole = lump(random, 24, 30);
  const Positions points = pointsAround(random, 150, 1.1);
  std::size_t before = points.size();
  for (const double height : {0.8, 0.7, 0.5, 0.0, -0.5, -0.8}) {
    Mesh open = whole;
    std::erase_if(open.triangles, [&](const Triangle& t) {
      return std::all_of(t.begin(), t.end(),
                         [&](std::uint32_t v) { return open.positions[v].z() > height; });
    });
    ASSERT_LT(open.triangles.size(), whole.triangles.size());
    const std::size_t found = expectTrue(points, open);
    EXPECT_LE(found, before);
    before = found;
    const std::vector<InsideVertex> deep =
        insideOf(Positions{{0, 0, height - 0.5}}, open, byNumber());
    EXPECT_EQ(deep.size(), height >= 0 ? 1u : 0u) << height;
  }
}

TEST(WindingNumber, CountsDoubledAndFlippedTriangles) {
  Random random(3);
  const Positions points = pointsAround(random, 150, 1.1);
  Mesh doubled = lump(random, 20, 24), flipped = doubled;
  for (std::size_t t = 0; t < 500; t += 7) {
    doubled.triangles.push_back(doubled.triangles[t]);
    if (t % 3 == 0) std::swap(flipped.triangles[t][0], flipped.triangles[t][2]);
  }
  EXPECT_GT(expectTrue(points, doubled), 30u);
  EXPECT_GT(expectTrue(points, flipped), 30u);
  EXPECT_GT(expectTrue(points, flipped, 0.2), 30u);
}

TEST(WindingNumber, WorksOnATriangleSoup) {
  Random random(4);
  const Mesh whole = sphere(24, 30, {0, 0, 0}, 1);
  Mesh soup;
  for (const Triangle& t : whole.triangles) {
    const Vector3d off = randomPoint(random, -0.02, 0.02);
    for (const std::uint32_t v : t) soup.positions.push_back(whole.positions[v] + off);
    const auto last = static_cast<std::uint32_t>(soup.positions.size());
    soup.triangles.push_back({last - 3, last - 2, last - 1});
  }
  EXPECT_GT(findMeshDefects(soup.triangles).open.size(), 1000u);
  const Positions points = pointsAround(random, 200, 1.2);
  expectTrue(points, soup);
  expectTrue(points, soup, 0.25);
  std::set<std::uint32_t> found;
  for (const InsideVertex& v : insideOf(points, soup, byNumber())) found.insert(v.vertex);
  for (std::uint32_t v = 0; v < points.size(); ++v)
    if (std::abs(points[v].norm() - 1) > 0.1) {
      EXPECT_EQ(found.contains(v), points[v].norm() < 1) << points[v].norm();
    }
}

/// From the middle of an open face, a cube covers exactly half of all directions.
TEST(WindingNumber, NearOneHalfIsUndecided) {
  Mesh cube;
  for (int v = 0; v < 8; ++v) cube.positions.push_back(Vector3d(v & 1, v >> 1 & 1, v >> 2));
  const auto face = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    cube.triangles.push_back({a, b, c});
    cube.triangles.push_back({a, c, d});
  };
  face(0, 2, 3, 1), face(0, 1, 5, 4), face(1, 3, 7, 5), face(3, 2, 6, 7), face(2, 0, 4, 6);
  const Positions points{
      {0.5, 0.5, 1}, {0.5, 0.5, 1 - 1e-6}, {0.5, 0.5, 1 + 1e-6}, {0.5, 0.5, 0.9}};
  const std::vector<InsideVertex> found = insideOf(points, cube, byNumber());
  ASSERT_EQ(found.size(), 3u);
  for (const InsideVertex& v : found) EXPECT_EQ(v.decided, v.vertex != 0);
  EXPECT_EQ(found[0].depth, 0.5);
  const std::vector<InsideVertex> within = insideOf(points, cube, byNumber(0.01));
  ASSERT_EQ(within.size(), 4u);
  for (const InsideVertex& v : within) EXPECT_EQ(v.decided, v.vertex == 3);
}

TEST(WindingNumber, WorksAtAnySizeAndWithoutArea) {
  Random random(6);
  for (const double scale : {0x1p-1000, 0x1p-400, 0x1p-100, 0x1p100, 0x1p300}) {
    Mesh body = lump(random, 8, 10);
    const Positions points = pointsAround(random, 60, 1.1);
    const std::vector<InsideVertex> truth = insideOf(points, body, byNumber());
    Positions scaled = points;
    body.triangles.push_back({3, 3, 3});
    body.triangles.push_back({3, 9, 3});
    for (Positions* positions : {&scaled, &body.positions})
      for (Vector3d& p : *positions) p *= scale;
    const std::vector<InsideVertex> found = insideOf(scaled, body, byNumber());
    ASSERT_EQ(found.size(), truth.size());
    for (std::size_t i = 0; i < truth.size(); ++i) EXPECT_EQ(found[i].vertex, truth[i].vertex);
  }
  Mesh flat;
  flat.positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  flat.triangles = {{0, 1, 2}};
  EXPECT_TRUE(insideOf(Positions{{0, 1, 0}, {3, 0, 0}, {0.5, 0, 0}}, flat, byNumber()).empty());
}

/// Points within ulps of the faces, edges and vertices of closed meshes: the vertices are those of
/// InsideRule::Closed, which exact predicates decide, and all are decided.
TEST(WindingNumber, PointsWithinRoundingOfAClosedSurfaceAreDecidedExactly) {
  Random random(11);
  std::size_t inside = 0, outside = 0;
  for (int run = 0; run < (kShareOfCases == 1 ? 8 : 4); ++run) {
    Mesh body = lump(random, 6, 8);
    const Vector3d offset = run % 2 ? randomPoint(random, -100, 100) : Vector3d(0, 0, 0);
    if (run % 3 == 1)  // with a hollow
      append(body, insideOut(sphere(6, 8, {0.1, 0, 0}, 0.5)));
    for (Vector3d& p : body.positions) p += offset;
    if (run % 4 > 1) body = insideOut(body);
    Positions points;
    for (const Triangle& t : body.triangles)
      for (int kind = 0; kind < 3; ++kind)
        for (int i = 0; i < 12; ++i) {
          Vector3d w = randomPoint(random, 0, 1);
          if (kind > 0) w[0] = 0;
          if (kind > 1) w[1] = 0;
          w /= w.sum();
          Vector3d p = w[0] * body.positions[t[0]] + w[1] * body.positions[t[1]] +
                       w[2] * body.positions[t[2]];
          for (double& x : p)
            for (std::size_t ulps = random() % 5, up = random() % 2; ulps > 0; --ulps)
              x = std::nextafter(x, up ? 1e9 : -1e9);
          points.push_back(p);
        }
    const std::vector<InsideVertex> truth = insideOf(points, body),
                                    found = insideOf(points, body, byNumber());
    ASSERT_EQ(found, truth) << run;
    ASSERT_EQ(insideOf(points, body, byNumber(0.25)), truth) << run;
    ASSERT_EQ(insideOf(points, body, byNumber(), settingsOf(Engine::BruteForce)), truth) << run;
    inside += truth.size();
    outside += points.size() - truth.size();
  }
  EXPECT_GE(inside, leastOf(5000));
  EXPECT_GE(outside, leastOf(5000));
}

/// Without a face the mesh is open. Faces far from the hole decide the side of points within
/// rounding of them by exact signs, too: none is decided wrongly.
TEST(WindingNumber, PointsWithinRoundingOfAnOpenSurfaceAreNotDecidedWrongly) {
  Random random(12);
  const Mesh closed = lump(random, 6, 8);
  Mesh open = closed;
  open.triangles.erase(open.triangles.begin());
  Positions points;
  for (std::size_t i = open.triangles.size() / 2; i < open.triangles.size(); ++i)
    for (int k = 0; k < 40; ++k) {
      const auto& [a, b, c] = open.triangles[i];
      Vector3d w = randomPoint(random, 0.1, 1);
      w /= w.sum();
      Vector3d p = w[0] * open.positions[a] + w[1] * open.positions[b] + w[2] * open.positions[c];
      for (double& x : p) x += (static_cast<int>(random() % 5) - 2) * std::abs(x) * 0x1p-52;
      points.push_back(p);
    }
  const std::vector<InsideVertex> truth = insideOf(points, closed),
                                  found = insideOf(points, open, byNumber());
  std::vector<std::uint32_t> expected, decided;
  for (const InsideVertex& each : truth) expected.push_back(each.vertex);
  for (const InsideVertex& each : found)
    if (each.decided) decided.push_back(each.vertex);
  EXPECT_EQ(decided, expected);
  EXPECT_GT(decided.size(), points.size() / 4);
}

}  // namespace
}  // namespace palpate::testing
