#include "Common/BallTruth.h"
#include "Common/QueryCalls.h"
#include "Common/Sanitized.h"
#include "Unit/Queries/QueryTruth.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <vector>

// findInsideVertices() of bodies that are not closed, against the sum of all solid angles.

namespace palpate::testing {
namespace {

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

TEST(WindingNumber, MatchesExactContainmentInClosedBodies) {
  Random random(1);
  for (int run = 0; run < 6; ++run) {
    Mesh body = lump(random, 12, 16);
    if (run % 3 == 1)  // with a hollow
      append(body, insideOut(sphere(9, 12, {0.1, 0, 0}, 0.5)));
    if (run % 3 == 2) body = insideOut(body);
    Positions points = pointsAround(random, 200, 1.1);
    points.insert(points.end(), body.positions.begin(), body.positions.end());  // on it
    for (const Vector3d& p : body.positions) points.push_back(0.999 * p);
    const double scale = run % 2 ? 1e-3 : 1, far = run % 2 ? 1e3 : 0;
    for (Positions* positions : {&points, &body.positions})
      for (Vector3d& p : *positions) p = scale * p + Vector3d(far, -far, far);
    const std::vector<InsideVertex> exact = insideOf(points, body);
    EXPECT_EQ(insideOf(points, body, byNumber()), exact);
    EXPECT_EQ(insideOf(points, body, byNumber(0.4)), exact);
    EXPECT_EQ(insideOf(points, body, byNumber(), settingsOf(Engine::BruteForce)), exact);
    EXPECT_GT(exact.size(), 50u);
  }
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

TEST(WindingNumber, DoesNotDependOnTheOctree) {
  Random random(5);
  Mesh body = lump(random, 30, 40);
  body.triangles.resize(body.triangles.size() - 200);
  const Positions points = pointsAround(random, 300, 1.2);
  OctreeBasedCD detection(settingsOf(Engine::Octree));
  const GeometryId asked = detection.addPointSet(points),
                   id = detection.addTriangleMesh(body.positions, body.triangles);
  detection.update();
  for (int frame = 0; frame < 3; ++frame) {
    for (Vector3d& p : body.positions) p += randomPoint(random, -0.02, 0.02);
    detection.setPositions(id, body.positions);
    const auto found = insideVertices(detection, asked, id, byNumber(0.1));
    EXPECT_EQ(std::vector<InsideVertex>(found.begin(), found.end()),
              insideOf(points, body, byNumber(0.1)));
  }
  const double angle = 0.7;
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, Vector3d(1, 2, 3).normalized()).matrix();
  detection.setTransform(id, {turn, {0.1, 0.2, 0.3}});
  Mesh moved = body;
  for (Vector3d& p : moved.positions)
    p = (turn.col(0) * p[0] + turn.col(1) * p[1]) + turn.col(2) * p[2] + Vector3d(0.1, 0.2, 0.3);
  const auto found = insideVertices(detection, asked, id, byNumber());
  EXPECT_EQ(std::vector<InsideVertex>(found.begin(), found.end()),
            insideOf(points, moved, byNumber()));
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
