#include "Common/ExpectRefused.h"
#include "Common/Solids.h"
#include "Common/TestGeometry.h"

#include <palpate/OctreeBasedCD.h>

#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <string>

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

/// Contacts of a pair over three frames, in which the solid is deformed, moved and cut.
std::vector<Rows> contactsOver(const Settings& settings, const Solid& solid, const Solid& cut,
                               bool asTriangles, const TestGeometry& other,
                               const PairSettings& pair) {
  Random random(3);
  OctreeBasedCD detection(settings);
  const Surface before = surfaceOf(solid), after = surfaceOf(cut);
  const GeometryId body = asTriangles
                              ? detection.addTriangleMesh(solid.positions, before.triangles)
                              : detection.addTetrahedralMesh(solid.positions, solid.tetrahedra),
                   second = other.addTo(detection);
  detection.addCollisionPair(body, second, pair);
  std::vector<Rows> rows;
  const auto frame = [&] {
    detection.detectCollision();
    detection.advance();
    EXPECT_EQ(detection.octree().validate(), std::vector<std::string>{});
    EXPECT_TRUE(detection.auditFailures().empty());
    rows.emplace_back(detection.collisionData(body, second));
  };
  frame();
  detection.setPositions(body, moved(random, solid.positions, 0.2));
  frame();
  asTriangles ? detection.setTriangles(body, cut.positions, after.triangles)
              : detection.setTetrahedra(body, cut.positions, cut.tetrahedra);
  frame();
  detection.setTransform(
      body, {Eigen::AngleAxisd(0.1, Vector3d::UnitX()).toRotationMatrix(), {0.01, 0, 0}});
  frame();
  return rows;
}

TEST(TetrahedralMesh, CollidesAsItsSurfaceWithEveryGeometryTypeByEveryMethod) {
  Random random(4);
  Solid solid = cells(3, random), cut = solid;
  for (Vector3d& p : solid.positions) p = p / 3 + randomPoint(random, -0.02, 0.02);
  for (Vector3d& p : cut.positions) p /= 3;
  std::erase_if(cut.tetrahedra, [&](const Tetrahedron&) { return random() % 5 == 0; });
  const TestGeometry kinds[] = {testGeometry(sphere(8, 12, {0.9, 0.5, 0.5}, 0.4)),
                                thread(random, 60, 0.3, 0.01, false), particles(random, 100, 0.02)};
  Settings audited = settingsOf(Engine::Octree, 2);
  audited.audit.features = 20;
  std::size_t contacts = 0;
  for (const TestGeometry& geometry : kinds) {
    std::vector<PairSettings> settings = settingsFor(0.02);
    if (geometry.type == GeometryType::Triangles) {
      settings.push_back({Method::Intersection, 0.0});
      settings.push_back({Method::Auto, 0.02});
    }
    for (const PairSettings& pair : settings) {
      const auto rows = contactsOver(audited, solid, cut, false, geometry, pair);
      expectSame(rows, contactsOver(audited, solid, cut, true, geometry, pair));
      for (const Rows& r : rows) contacts += r.contacts();
    }
  }
  EXPECT_GT(contacts, 1000u);
}

TEST(TetrahedralMesh, BadInputThrowsErrorsThatNameIt) {
  const Positions some{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}, {2, 1, 1}};
  using Tetrahedra = std::vector<Tetrahedron>;
  OctreeBasedCD detection(settingsOf(Engine::Octree));
  const GeometryId mesh = detection.addTriangleMesh(some, std::vector<Triangle>{{0, 1, 2}}),
                   solid = detection.addTetrahedralMesh(some, Tetrahedra{{0, 1, 2, 3}});
  for (const bool again : {false, true}) {
    const std::string name = again ? "geometry 1" : "geometry 2";
    const auto give = [&](const Positions& positions, const Tetrahedra& tetrahedra) {
      if (again)
        detection.setTetrahedra(solid, positions, tetrahedra);
      else
        detection.addTetrahedralMesh(positions, tetrahedra);
    };
    expectRefused(
        ErrorCode::IndexOutOfRange,
        name + ", tetrahedron 1: vertex index 6 is out of range; the mesh has 6 vertices",
        [&] {
          give(some, {{0, 1, 2, 3}, {1, 2, 3, 6}});
        },
        {}, 1);
    expectRefused(
        ErrorCode::IndexOutOfRange, name + ", tetrahedron 0 has vertex 3 twice",
        [&] {
          give(some, {{3, 1, 2, 3}});
        },
        {}, 0);
    expectRefused(
        ErrorCode::SharedFace,
        name +
            ", tetrahedron 3: its face with vertices 0, 1 and 2 already belongs to "
            "tetrahedra 0 and 1",
        [&] {
          give(some, {{0, 1, 2, 3}, {4, 2, 1, 0}, {1, 2, 3, 5}, {5, 0, 1, 2}});
        },
        {}, 3);
    Positions bad = some;
    bad[4][1] = std::numeric_limits<double>::quiet_NaN();
    expectRefused(
        ErrorCode::NonFinitePosition,
        name +
            ", vertex 4: position is (1, nan, 1); positions must be finite and at most "
            "1e+300 in magnitude",
        [&] {
          give(bad, {{0, 1, 2, 3}});
        },
        {}, 4);
  }
  expectRefused(ErrorCode::UnsupportedMethod,
                "geometry 1 is a tetrahedral mesh; setTriangles() is for triangle meshes",
                [&] { detection.setTriangles(solid, some, {}); });
  expectRefused(ErrorCode::UnsupportedMethod,
                "geometry 0 is a triangle mesh; setTetrahedra() is for tetrahedral meshes",
                [&] { detection.setTetrahedra(mesh, some, {}); });
  expectRefused(ErrorCode::UnsupportedMethod,
                "geometry 0 is a triangle mesh; surface() is for tetrahedral meshes",
                [&] { detection.surface(mesh); });
  expectRefused(ErrorCode::WrongPositionCount,
                "geometry 1: 5 positions given, but it has 6 vertices; setTetrahedra() changes "
                "their number",
                [&] { detection.setPositions(solid, Positions(5, Vector3d::Zero())); });
  EXPECT_EQ(detection.surface(solid).triangles.size(), 4u);
  EXPECT_EQ(detection.addPointSet(some), GeometryId{2});  // refused calls used no id
}

}  // namespace
}  // namespace palpate::testing
