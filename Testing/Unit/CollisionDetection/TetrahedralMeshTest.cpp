#include "Common/ExpectRefused.h"
#include "Common/Solids.h"
#include "Common/TestGeometry.h"

#include <map>

namespace palpate::testing {
namespace {

using Point = std::array<std::int64_t, 3>;

Point pointOf(const Vector3d& p) {
  return {static_cast<std::int64_t>(p[0]), static_cast<std::int64_t>(p[1]),
          static_cast<std::int64_t>(p[2])};
}

/// Six times the volume, exactly: positions are small integers.
std::int64_t volume(const Solid& solid, const std::array<std::uint32_t, 4>& at) {
  const Point o = pointOf(solid.positions[at[0]]);
  std::array<Point, 3> e;
  for (int i = 0; i < 3; ++i) {
    e[i] = pointOf(solid.positions[at[i + 1]]);
    for (int k = 0; k < 3; ++k) e[i][k] -= o[k];
  }
  return e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) +
         e[0][1] * (e[1][2] * e[2][0] - e[1][0] * e[2][2]) +
         e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
}

struct Surface {
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> tetrahedra;
};

Surface surfaceOf(const Solid& solid) {
  OctreeBasedCD detection(settingsOf(Engine::Octree));
  const auto [triangles, tetrahedra] =
      detection.surface(detection.addTetrahedralMesh(solid.positions, solid.tetrahedra));
  return {{triangles.begin(), triangles.end()}, {tetrahedra.begin(), tetrahedra.end()}};
}

Triangle sorted(Triangle t) {
  std::sort(t.begin(), t.end());
  return t;
}

/// From the definition: the faces, their tetrahedra, their order, and their winding.
void expectDefined(const Solid& solid, const Surface& surface) {
  std::map<Triangle, int> uses;
  const auto without = [&](const Tetrahedron& t, int corner) {
    Triangle face{};
    for (int i = 0, k = 0; i < 4; ++i)
      if (i != corner) face[k++] = t[i];
    return sorted(face);
  };
  for (const Tetrahedron& t : solid.tetrahedra)
    for (int corner = 0; corner < 4; ++corner) ++uses[without(t, corner)];
  std::size_t next = 0;
  for (std::uint32_t t = 0; t < solid.tetrahedra.size(); ++t)
    for (int corner = 0; corner < 4; ++corner) {
      const Triangle face = without(solid.tetrahedra[t], corner);
      if (uses[face] != 1) continue;
      ASSERT_LT(next, surface.triangles.size());
      const Triangle found = surface.triangles[next];
      EXPECT_EQ(sorted(found), face);
      EXPECT_EQ(surface.tetrahedra[next], t);
      EXPECT_LE(volume(solid, {found[0], found[1], found[2], solid.tetrahedra[t][corner]}), 0);
      ++next;
    }
  EXPECT_EQ(next, surface.triangles.size());
  EXPECT_EQ(next, surface.tetrahedra.size());
}

TEST(TetrahedralMesh, SurfaceIsTheFacesOfOneTetrahedronWoundOutward) {
  Random random(1);
  for (int run = 0; run < 20; ++run) {
    Solid solid = cells(3, random, [&](const auto&) { return run == 0 || random() % 3 > 0; });
    const Surface surface = surfaceOf(solid);
    expectDefined(solid, surface);
    if (run == 0) {
      EXPECT_EQ(surface.triangles.size(), 6u * 9 * 2);
    }
    EXPECT_TRUE(findMeshDefects(surface.triangles).flipped.empty());
    EXPECT_TRUE(findMeshDefects(surface.triangles).open.empty());
    // Anywhere on the grid: folded, inverted, flat.
    for (Vector3d& p : solid.positions)
      for (int k = 0; k < 3; ++k) p[k] = static_cast<double>(random() % 4);
    expectDefined(solid, surfaceOf(solid));
  }
}

TEST(TetrahedralMesh, TetrahedraWithoutVolumeAreWoundAsTheirNeighbours) {
  Random random(2);
  for (int run = 0; run < 40; ++run) {
    Solid solid = cells(3, random);
    const Surface whole = surfaceOf(solid);
    // Flat tetrahedra on its surface: each covers two triangles of a square with the other two. The
    // next one covers them back again.
    std::map<Segment, std::vector<Triangle>> byEdge;
    for (const Triangle& t : whole.triangles)
      for (int i = 0; i < 3; ++i) {
        const std::uint32_t p = t[i], q = t[(i + 1) % 3];
        byEdge[{std::min(p, q), std::max(p, q)}].push_back(t);
      }
    std::set<std::uint32_t> covered;
    std::vector<Tetrahedron> flat;
    for (const auto& [edge, both] : byEdge) {
      Tetrahedron corners{edge[0], edge[1]};
      for (int i = 0; i < 2; ++i)
        for (const std::uint32_t v : both[i])
          if (v != edge[0] && v != edge[1]) corners[2 + i] = v;
      if (volume(solid, corners) != 0) continue;
      if (std::any_of(corners.begin(), corners.end(),
                      [&](std::uint32_t v) { return covered.contains(v); }))
        continue;
      covered.insert(corners.begin(), corners.end());
      std::shuffle(corners.begin(), corners.end(), random);
      flat.push_back(corners);
    }
    EXPECT_GT(flat.size(), 2u);
    solid.tetrahedra.insert(solid.tetrahedra.end(), flat.begin(), flat.end());
    std::shuffle(solid.tetrahedra.begin(), solid.tetrahedra.end(), random);
    const Surface surface = surfaceOf(solid);
    expectDefined(solid, surface);
    EXPECT_EQ(surface.triangles.size(), whole.triangles.size());
    EXPECT_TRUE(findMeshDefects(surface.triangles).closed());
  }
  // All are flat. The first keeps its winding, and the others follow it, so that the surface has no
  // flipped edges.
  Solid plate = cells(2, random);
  for (Vector3d& p : plate.positions) p[2] = 0;
  EXPECT_TRUE(findMeshDefects(surfaceOf(plate).triangles).closed());
  const Surface one = surfaceOf({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}, {{0, 1, 2, 3}}});
  EXPECT_EQ(one.triangles, (std::vector<Triangle>{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}));
  EXPECT_EQ(surfaceOf({}).triangles.size(), 0u);
}

TEST(TetrahedralMesh, BadInputThrowsErrorsThatNameIt) {
  using enum ErrorCode;
  using Tetrahedra = std::vector<Tetrahedron>;
  const Positions some{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}, {2, 1, 1}};
  Positions bad = some;
  bad[4][1] = std::numeric_limits<double>::quiet_NaN();
  OctreeBasedCD detection;
  const GeometryId mesh = detection.addTriangleMesh(some, std::vector<Triangle>{{0, 1, 2}}),
                   solid = detection.addTetrahedralMesh(some, Tetrahedra{{0, 1, 2, 3}});
  struct Bad {
    ErrorCode code;
    std::size_t element;
    const char* words;
    const Positions& positions;
    Tetrahedra tetrahedra;
  };
  const std::vector<Bad> all{
      {IndexOutOfRange,
       1,
       ", tetrahedron 1: vertex index 6 is out of range; the mesh has 6 vertices",
       some,
       {{0, 1, 2, 3}, {1, 2, 3, 6}}},
      {IndexOutOfRange, 0, ", tetrahedron 0 has vertex 3 twice", some, {{3, 1, 2, 3}}},
      {SharedFace,
       3,
       ", tetrahedron 3: its face with vertices 0, 1 and 2 already belongs to tetrahedra 0 and 1",
       some,
       {{0, 1, 2, 3}, {4, 2, 1, 0}, {1, 2, 3, 5}, {5, 0, 1, 2}}},
      {NonFinitePosition,
       4,
       ", vertex 4: position is (1, nan, 1); positions must be finite and at most 1e+300 in "
       "magnitude",
       bad,
       {{0, 1, 2, 3}}}};
  for (const Bad& one : all) {
    const std::string words = one.words;
    expectRefused(
        one.code, "geometry 2" + words,
        [&] { detection.addTetrahedralMesh(one.positions, one.tetrahedra); }, {}, one.element);
    expectRefused(
        one.code, "geometry 1" + words,
        [&] { detection.setTetrahedra(solid, one.positions, one.tetrahedra); }, {}, one.element);
  }
  expectRefused(UnsupportedMethod,
                "geometry 1 is a tetrahedral mesh; setTriangles() is for triangle meshes",
                [&] { detection.setTriangles(solid, some, {}); });
  expectRefused(UnsupportedMethod,
                "geometry 0 is a triangle mesh; setTetrahedra() is for tetrahedral meshes",
                [&] { detection.setTetrahedra(mesh, some, {}); });
  expectRefused(UnsupportedMethod,
                "geometry 0 is a triangle mesh; surface() is for tetrahedral meshes",
                [&] { detection.surface(mesh); });
  expectRefused(WrongPositionCount,
                "geometry 1: 5 positions given, but it has 6 vertices; setTetrahedra() changes "
                "their number",
                [&] { detection.setPositions(solid, Positions(5, Vector3d::Zero())); });
  EXPECT_EQ(detection.surface(solid).triangles.size(), 4u);
  EXPECT_EQ(detection.addPointSet(some), GeometryId{2});  // refused calls used no id
}

}  // namespace
}  // namespace palpate::testing
