#include "Common/ExpectRefused.h"
#include "Common/QueryCalls.h"
#include "Unit/Queries/QueryTruth.h"

#include <gtest/gtest.h>

#include <limits>
#include <optional>
#include <set>

namespace palpate::testing {
namespace {

using Point = std::array<std::int64_t, 3>;

/// Six times the volume of integer positions, exactly.
std::int64_t volume(const std::array<Vector3d, 4>& at) {
  std::array<Point, 3> e;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) e[i][k] = static_cast<std::int64_t>(at[i + 1][k] - at[0][k]);
  return e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) +
         e[0][1] * (e[1][2] * e[2][0] - e[1][0] * e[2][2]) +
         e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
}

/// The lowest tetrahedron that contains p, from the definition, with its four volumes.
struct Held {
  std::uint32_t tetrahedron;
  std::array<std::int64_t, 4> volumes;
};
std::optional<Held> holder(const Vector3d& p, const Solid& solid) {
  for (std::uint32_t t = 0; t < solid.tetrahedra.size(); ++t) {
    std::array<std::int64_t, 4> volumes;
    std::int64_t least = 0, most = 0;
    for (int i = 0; i < 4; ++i) {
      std::array<Vector3d, 4> at;
      for (int k = 0; k < 4; ++k) at[k] = solid.positions[solid.tetrahedra[t][k]];
      at[i] = p;
      volumes[i] = volume(at);
      least = std::min(least, volumes[i]);
      most = std::max(most, volumes[i]);
    }
    if ((least < 0) == (most > 0)) continue;  // on both sides of faces, or no volume at all
    return Held{t, volumes};
  }
  return {};
}

std::vector<TestGeometry> lattices(int n) {
  return {lattice(GeometryType::Points, n, 1), lattice(GeometryType::Lines, n, 1),
          lattice(GeometryType::Triangles, n, 1)};
}

std::vector<EmbeddedVertex> embedded(const Settings& settings, const TestGeometry& probes,
                                     const Solid& solid) {
  OctreeBasedCD detection(settings);
  const GeometryId body = detection.addTetrahedralMesh(solid.positions, solid.tetrahedra),
                   other = probes.addTo(detection);
  const auto found = testing::embeddedVertices(detection, other, body);
  for (const EmbeddedVertex& v : found)
    EXPECT_EQ(detection.queries().findTetrahedron(body, probes.positions[v.vertex]), v.at);
  return found;
}

TEST(EmbeddedVertices, MatchExactVolumesOnAGrid) {
  Random random(1);
  std::size_t inside = 0, onBoundary = 0, inverted = 0;
  for (int run = 0; run < 12; ++run) {
    constexpr int n = 3;
    Solid solid = cells(n, random, [&](const auto&) { return random() % 4 > 0; });
    // As given, folded, and at random positions, so that inverted and flat tetrahedra occur, too.
    for (Vector3d& p : solid.positions)
      for (int k = 0; k < 3 && run % 3 > 0; ++k)
        p[k] = run % 3 == 1 ? p[k] + static_cast<double>(random() % 3) - 1.0
                            : static_cast<double>(random() % (n + 1));
    for (const TestGeometry& probes : lattices(n)) {
      std::size_t next = 0;
      const auto found = embedded(settingsOf(Engine::Octree, 2), probes, solid);
      for (std::uint32_t v = 0; v < probes.positions.size(); ++v) {
        const auto truth = holder(probes.positions[v], solid);
        if (!truth) continue;
        ASSERT_LT(next, found.size());
        const EmbeddedVertex& e = found[next++];
        EXPECT_EQ(e.vertex, v);
        EXPECT_EQ(e.at.tetrahedron, truth->tetrahedron);
        EXPECT_EQ(e.at.vertices, solid.tetrahedra[truth->tetrahedron]);
        std::int64_t sum = 0;
        for (const std::int64_t volume : truth->volumes) sum += volume;
        for (int i = 0; i < 4; ++i)
          EXPECT_EQ(e.at.weights[i],
                    static_cast<double>(truth->volumes[i]) / static_cast<double>(sum));
        ++inside;
        onBoundary += std::count(truth->volumes.begin(), truth->volumes.end(), 0) > 0;
        inverted += sum < 0;
      }
      EXPECT_EQ(next, found.size());
      EXPECT_EQ(embedded(settingsOf(Engine::BruteForce), probes, solid), found);
    }
  }
  EXPECT_GT(inside, 500u);
  EXPECT_GT(onBoundary, 300u);
  EXPECT_GT(inverted, 100u);
}

/// Where the surface is not closed and oriented, and where it is turned inside out.
TEST(EmbeddedVertices, InsideMeansInATetrahedronAndNotOnTheSurface) {
  Random random(6);
  std::size_t found = 0;
  for (int run = 0; run < 8; ++run) {
    constexpr int n = 3;
    Solid solid = cells(n, random, [&](const auto&) { return random() % 2 > 0; });
    for (Vector3d& p : solid.positions)
      for (int k = 0; k < 3; ++k)
        p[k] = run % 2 ? 2 * p[k] : static_cast<double>(random() % (2 * n + 1));
    const TestGeometry probes = lattices(2 * n)[0];
    OctreeBasedCD detection(settingsOf(Engine::Octree));
    const GeometryId body = detection.addTetrahedralMesh(solid.positions, solid.tetrahedra),
                     points = probes.addTo(detection);
    detection.addCollisionPair(points, body, {Method::Proximity, 100.0});
    detection.detectCollision();
    std::vector<double> nearest(probes.positions.size(), 1e9);
    for (const auto& c : detection.collisionData(points, body).vertexTriangle())
      nearest[c.vertex] = std::min(nearest[c.vertex], c.distance);
    const auto all = testing::insideVertices(detection, points, body);
    std::size_t next = 0;
    for (std::uint32_t v = 0; v < probes.positions.size(); ++v) {
      if (!holder(probes.positions[v], solid) || nearest[v] == 0) continue;
      ASSERT_LT(next, all.size());
      EXPECT_EQ(all[next].vertex, v);
      EXPECT_EQ(all[next].depth, nearest[v]);
      ++next;
    }
    EXPECT_EQ(next, all.size());
    found += next;
  }
  EXPECT_GT(found, 50u);
}

TEST(EmbeddedVertices, FewTetrahedraHaveTheirVertices) {
  Random random(7);
  const Solid solid = cells(1, random);
  OctreeBasedCD detection(settingsOf(Engine::Octree));
  const GeometryId body = addTo(detection, solid), points = addTo(detection, solid.positions);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expectRefused(ErrorCode::NonFinitePosition,
                "geometry 0: the point is (nan, 0, 0); it must be finite and at most 1e+300 in "
                "magnitude",
                [&] {
                  detection.queries().findTetrahedron(body, {nan, 0, 0});
                });
  EXPECT_FALSE(detection.queries().findTetrahedron(body, {2, 0, 0}));
  EXPECT_TRUE(detection.queries().findTetrahedron(body, {1, 1, 1}));
  // No tetrahedra at all, and only surface that is on both sides.
  const GeometryId empty = detection.addTetrahedralMesh(solid.positions, {});
  EXPECT_TRUE(testing::embeddedVertices(detection, points, empty).empty());
  EXPECT_TRUE(testing::insideVertices(detection, points, empty).empty());
  const Tetrahedron one = solid.tetrahedra[0];
  const GeometryId twice =
      detection.addTetrahedralMesh(solid.positions, std::vector<Tetrahedron>{one, one});
  EXPECT_TRUE(detection.surface(twice).triangles.empty());
  EXPECT_EQ(testing::embeddedVertices(detection, points, twice).size(), 4u);
}

}  // namespace
}  // namespace palpate::testing
