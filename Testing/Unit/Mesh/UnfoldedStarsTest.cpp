#include "Mesh/UnfoldedStars.h"

#include <palpate/FeaturePairs.h>

#include "Common/EverySimdPath.h"
#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

// Pairs that an unfolded star excludes are checked by the exact times of impact of all their
// features, on every SIMD path.

namespace palpate {
namespace {

using Eigen::Vector3d;
using Positions = std::vector<Vector3d>;
constexpr double kPi = 3.14159265358979323846;

struct Step {
  Positions before, now;
  MeshTopology topology;
  Step(const testing::Mesh& mesh, const Positions& end)
      : before(mesh.positions), now(end), topology(before.size(), mesh.triangles) {}
};

bool share(const Triangle& a, const Triangle& b) {
  return std::any_of(a.begin(), a.end(),
                     [&](std::uint32_t v) { return std::find(b.begin(), b.end(), v) != b.end(); });
}

/// Pairs of neighbours that need no test: the same on every path and with any number of threads.
std::vector<ElementPair> answered(const Step& step) {
  const SampledExtent extent = sampleExtent(step.now);
  const FloatFrame frame{extent.median, frameScale(extent.spread)};
  std::vector<FloatPoint> before(step.before.size()), now(before.size());
  toFloats(step.before, frame, before.data());
  toFloats(step.now, frame, now.data());
  std::vector<std::uint32_t> order(step.topology.elements.size());
  std::iota(order.begin(), order.end(), 0u);
  std::vector<Triangle> first;
  for (const std::string& path : testing::EverySimdPath()) {
    for (const int threads : {1, 3}) {
      UnfoldedStars stars;
      stars.find(step.topology, order, step.topology.elements, before.data(), now.data(),
                 Threads(threads));
      const std::vector<Triangle> found(stars.triangles(),
                                        stars.triangles() + step.topology.elements.size());
      if (first.empty()) first = found;
      EXPECT_EQ(found, first) << path;
    }
  }
  std::vector<ElementPair> pairs;
  for (std::uint32_t a = 0; a < first.size(); ++a)
    for (std::uint32_t b = a + 1; b < first.size(); ++b)
      if (share(first[a], first[b])) pairs.push_back({a, b});
  return pairs;
}

/// Whether features of the two triangles with no vertex in common touch in the step.
bool touch(const Step& step, const ElementPair& pair) {
  const Triangle &a = step.topology.elements[pair.a], &b = step.topology.elements[pair.b];
  const Positions &p = step.before, &q = step.now;
  const auto corners = [&](const Triangle& s, const Triangle& t) {
    return std::any_of(s.begin(), s.end(), [&](std::uint32_t v) {
      return !share({v, v, v}, t) && vertexTriangleTimeOfImpact(p[v], p[t[0]], p[t[1]], p[t[2]],
                                                                q[v], q[t[0]], q[t[1]], q[t[2]]);
    });
  };
  bool found = corners(a, b) || corners(b, a);
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const std::uint32_t s = a[i], t = a[(i + 1) % 3], u = b[j], v = b[(j + 1) % 3];
      found |= !shareVertex({s, t}, {u, v}) &&
               edgeEdgeTimeOfImpact(p[s], p[t], p[u], p[v], q[s], q[t], q[u], q[v]).has_value();
    }
  return found;
}

/// Returns how many of the neighbours are excluded.
double expectRight(const Step& step) {
  const std::vector<ElementPair> pairs = answered(step);
  for (const ElementPair& pair : pairs)
    EXPECT_FALSE(touch(step, pair)) << pair.a << " and " << pair.b;
  double neighbours = 0;
  const auto& triangles = step.topology.elements;
  for (std::uint32_t a = 0; a < triangles.size(); ++a)
    for (std::uint32_t b = a + 1; b < triangles.size(); ++b)
      neighbours += share(triangles[a], triangles[b]);
  return static_cast<double>(pairs.size()) / std::max(neighbours, 1.0);
}

Positions moved(const Positions& positions, testing::Random& random, double by) {
  Positions out = positions;
  for (Vector3d& p : out) p += testing::randomPoint(random, -by, by);
  return out;
}

TEST(UnfoldedStars, ExcludedNeighboursDoNotTouch) {
  testing::Random random(41);
  std::size_t touching = 0;
  for (int round = 0; round < 60; ++round) {
    const double cell = 1.0 / 6, noise = cell * (round % 4) / 3, motion = cell * (round % 5) / 4;
    testing::Mesh mesh = round % 3 == 2 ? testing::sphere(5, 6, Vector3d::Zero(), 0.3)
                                        : testing::sheet(6, 0.2, round);
    mesh.positions = moved(mesh.positions, random, noise);
    if (round % 2)
      for (Vector3d& p : mesh.positions) p = (p * 16).array().round() / 16;
    for (Triangle& t : mesh.triangles) std::rotate(t.begin(), t.begin() + random() % 3, t.end());
    if (round % 7 == 3) mesh.triangles.push_back(mesh.triangles[random() % 20]);
    if (round % 7 == 5) std::swap(mesh.triangles[30][0], mesh.triangles[30][1]);
    const Step step(mesh, moved(mesh.positions, random, motion));
    expectRight(step);
    for (std::uint32_t t = 1; t < mesh.triangles.size(); ++t)
      touching += share(mesh.triangles[t - 1], mesh.triangles[t]) && touch(step, {t - 1, t});
  }
  EXPECT_GT(touching, 100u);
}

TEST(UnfoldedStars, ExcludeMostNeighboursOfASmoothMesh) {
  testing::Random random(43);
  const testing::Mesh mesh = testing::sheet(12, 0.0, 0.3);
  const auto turned = [&](const Vector3d& p) {
    return Vector3d(0.6 * p[0] - 0.8 * p[2], p[1], 0.8 * p[0] + 0.6 * p[2]);
  };
  testing::Mesh placed = mesh;
  for (const double far : {0.0, 1e3, 1e9}) {
    for (std::size_t i = 0; i < mesh.positions.size(); ++i)
      placed.positions[i] = turned(mesh.positions[i]) + Vector3d(far, -far, far);
    EXPECT_GT(expectRight({placed, moved(placed.positions, random, 0.01)}), 0.85) << far;
  }
}

/// Stars so small in their frame that the errors of floats are about their size.
TEST(UnfoldedStars, AreCorrectWhereFloatsAreImprecise) {
  testing::Random random(47);
  for (int round = 0; round < 40; ++round) {
    testing::Mesh mesh = testing::sheet(5, 0.0, 0.3);
    const double size = std::ldexp(1.0, -15 - round % 8);
    for (Vector3d& p : mesh.positions)
      p = size * (p + testing::randomPoint(random, -0.1, 0.1)) + Vector3d(0.7, 0.6, 0.5);
    for (int i = 0; i < 200; ++i) mesh.positions.push_back(testing::randomPoint(random, -1, 1));
    expectRight({mesh, moved(mesh.positions, random, 0.1 * size)});
  }
}

/// Floats are clamped, so that a vertex near the x axis seems to be halfway to the y axis.
TEST(UnfoldedStars, AreCorrectBeyondTheRangeOfFloats) {
  testing::Mesh mesh{{Vector3d::Zero()}, {}};
  for (const Vector3d& p : {Vector3d(1, -1, 0), Vector3d(2, 1, 0), Vector3d(0x1p140, 0x1p125, 0),
                            Vector3d(-1, 1, 0), Vector3d(-1, -1, 0)})
    mesh.positions.push_back(p);
  for (std::uint32_t i = 0; i < 5; ++i) mesh.triangles.push_back({0, 1 + i, 1 + (i + 1) % 5});
  testing::Random random(48);
  for (int i = 0; i < 200; ++i) mesh.positions.push_back(testing::randomPoint(random, -1, 1));
  expectRight({mesh, mesh.positions});
  EXPECT_TRUE(answered({mesh, mesh.positions}).empty());
}

/// n triangles around vertex 0. Their rim winds around it `turns` times.
testing::Mesh fan(std::uint32_t n, int turns, double height) {
  testing::Mesh mesh{{Vector3d::Zero()}, {}};
  for (std::uint32_t i = 0; i < n; ++i) {
    const double angle = 2 * kPi * turns * (i + 0.1) / n;
    mesh.positions.push_back({std::cos(angle), std::sin(angle), height * i});
    mesh.triangles.push_back({0, 1 + i, 1 + (i + 1) % n});
  }
  return mesh;
}

bool isAnswered(const testing::Mesh& mesh, const Positions& now) {
  return !answered({mesh, now}).empty();
}

TEST(UnfoldedStars, WindOnceAroundTheVertex) {
  for (const std::uint32_t n : {3u, 4u, 7u, 255u}) {
    const testing::Mesh once = fan(n, 1, 0.01), twice = fan(2 * n + 1, 2, 0.01);
    EXPECT_TRUE(isAnswered(once, once.positions)) << n;
    EXPECT_FALSE(isAnswered(twice, twice.positions)) << n;
  }
  const testing::Mesh large = fan(1000, 1, 0.001);
  EXPECT_TRUE(isAnswered(large, large.positions));
  // Two fans with one apex, one above the other.
  testing::Mesh both = fan(5, 1, 0.0);
  const testing::Mesh other = fan(6, 1, 0.0);
  for (std::size_t i = 1; i < other.positions.size(); ++i)
    both.positions.push_back(other.positions[i] + Vector3d(0, 0, 0.5));
  for (const Triangle& t : other.triangles) both.triangles.push_back({0, t[1] + 5, t[2] + 5});
  EXPECT_FALSE(isAnswered(both, both.positions));
}

TEST(UnfoldedStars, StayUnfoldedThroughoutTheStep) {
  const testing::Mesh mesh = fan(6, 1, 0.0);
  const auto ending = [&](double scale) {
    Positions now = mesh.positions;
    for (Vector3d& p : now) p *= scale;
    return now;
  };
  EXPECT_TRUE(isAnswered(mesh, ending(0.1)));
  EXPECT_FALSE(isAnswered(mesh, ending(0.0)));   // ends in a point
  EXPECT_FALSE(isAnswered(mesh, ending(-1.0)));  // seen from above at both ends, a point halfway
  Positions over = mesh.positions;
  over[2] = {0.0, -2.0, 0.0};
  EXPECT_FALSE(isAnswered(mesh, over));
  over[2] = {std::numeric_limits<double>::max(), 1.0, 0.0};
  EXPECT_FALSE(isAnswered(mesh, over));
}

TEST(UnfoldedStars, MustBeClosedAndOfOneWinding) {
  const testing::Mesh whole = fan(6, 1, 0.1);
  const auto closed = [](const testing::Mesh& mesh, std::vector<std::uint32_t> disabled = {}) {
    MeshTopology topology(mesh.positions.size(), mesh.triangles);
    topology.disable(disabled);
    return topology.hasClosedStar;
  };
  EXPECT_EQ(closed(whole), (CountedVector<std::uint8_t>{1, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(closed(whole, {3})[0], 0);
  testing::Mesh open = whole, twice = whole, turned = whole;
  open.triangles.pop_back();
  twice.triangles.push_back(whole.triangles[2]);
  std::swap(turned.triangles[2][1], turned.triangles[2][2]);
  for (const testing::Mesh& mesh : {open, twice, turned}) {
    EXPECT_EQ(closed(mesh)[0], 0);
    EXPECT_FALSE(isAnswered(mesh, mesh.positions));
  }
  const testing::Mesh body = testing::sphere(4, 5, Vector3d::Zero(), 1.0);
  for (const std::uint8_t vertex : closed(body)) EXPECT_EQ(vertex, 1);
}

}  // namespace
}  // namespace palpate
