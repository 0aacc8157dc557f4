#include "Common/ExpectRefused.h"
#include "Common/Renamed.h"
#include "Common/Solids.h"
#include "Common/TestGeometry.h"

#include <palpate/Capture.h>

#include <numeric>

// replaceTriangles() and replaceTetrahedra(). Random histories (Common/History.h) compare contacts
// after cuts with those of objects to which the mesh is handed anew.

namespace palpate::testing {
namespace {

/// A mesh of which elements were removed, with the ids that cuts gave.
template <class Element>
struct CutMesh {
  CutMesh(const Positions& positions, std::vector<Element> all)
      : rest(positions), before(positions), now(positions), elements(std::move(all)) {}

  Positions rest, before, now;
  std::vector<Element> elements;  ///< by id, with removed ones
  Ids removed;                    ///< ascending

  Ids ids() const { return idsWithout(elements.size(), removed); }
  std::vector<Element> left() const {
    std::vector<Element> all;
    for (const std::uint32_t id : ids()) all.push_back(elements[id]);
    return all;
  }
  void apply(const Ids& gone, const std::vector<Element>& added, const Positions& positions) {
    removed.insert(removed.end(), gone.begin(), gone.end());
    std::ranges::sort(removed);
    elements.insert(elements.end(), added.begin(), added.end());
    for (Positions* all : {&rest, &before, &now})
      all->insert(all->end(), positions.begin(), positions.end());
  }
};

/// Unit/Mesh/TetrahedraCutTest.cpp compares topologies. Some tetrahedra go, and some become four.
TEST(Cuts, PointsAreFoundInTheTetrahedraThatAreLeft) {
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(casesOf(12)); ++seed) {
    Random random(seed);
    const bool few = seed % 3 == 1;  // so that the topology is not computed anew
    const Solid start = cells(few ? 4 : 2, random);
    CutMesh<Tetrahedron> solid(start.positions, start.tetrahedra);
    OctreeBasedCD collisions;
    const GeometryId id = collisions.addTetrahedralMesh(start.positions, start.tetrahedra);
    for (int step = 0; step < 8; ++step) {
      Ids gone;
      std::vector<Tetrahedron> added;
      Positions middles;
      for (const std::uint32_t i : solid.ids()) {
        if (random() % (few ? 150 : 8)) continue;
        gone.push_back(i);
        if (random() % 2) continue;
        const Tetrahedron& t = solid.elements[i];
        for (int corner = 0; corner < 4; ++corner) {
          added.push_back(t);
          added.back()[corner] = static_cast<std::uint32_t>(solid.now.size() + middles.size());
        }
        middles.push_back((solid.now[t[0]] + solid.now[t[1]] + solid.now[t[2]] + solid.now[t[3]]) /
                          4);
      }
      collisions.replaceTetrahedra(id, gone, added, middles);
      solid.apply(gone, added, middles);
      solid.now = moved(random, solid.now, 0.02);
      collisions.setPositions(id, solid.now);
      OctreeBasedCD anew;
      const GeometryId fresh = anew.addTetrahedralMesh(solid.rest, solid.left());
      anew.setPositions(fresh, solid.now);
      const Ids left = solid.ids();
      for (int i = 0; i < 50; ++i) {
        const Vector3d p = randomPoint(random, -0.2, 2.2);
        const auto found = collisions.queries().findTetrahedron(id, p),
                   truth = anew.queries().findTetrahedron(fresh, p);
        ASSERT_EQ(found.has_value(), truth.has_value());
        if (!found) continue;
        EXPECT_EQ(found->tetrahedron, left[truth->tetrahedron]);
        EXPECT_EQ(found->weights, truth->weights);
      }
    }
  }
}

/// Two sheets one above the other. Cuts of the lower one raise tips, some of them through the upper
/// one, and remove others.
TEST(Cuts, NewElementsAreCheckedWhereTheStepStarts) {
  std::array<std::size_t, 2> started{};
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(casesOf(40)); ++seed) {
    Random random(seed);
    const Mesh lower = sheet(5, 0.0, 0), upper = sheet(5, 0.2, 0);
    const PairSettings settings{
        .method = std::array{Method::Proximity, Method::Continuous, Method::Auto}[seed % 3],
        .thickness = 0.05};
    const GeometryId a{0}, b{1};
    CutMesh<Triangle> mesh(lower.positions, lower.triangles);
    const auto setUp = [&] {
      OctreeBasedCD collisions;
      collisions.addTriangleMesh(mesh.rest, mesh.left());
      addMesh(collisions, upper);
      collisions.addCollisionPair(a, b, settings);
      collisions.addCollisionPair(a, a, settings);
      return collisions;
    };
    OctreeBasedCD collisions = setUp();
    collisions.detectCollision();
    for (int step = 0; step < 20; ++step) {
      if (random() % 4) collisions.advance(), mesh.before = mesh.now;
      const std::size_t cuts = random() % 3;
      for (std::size_t cut = 0; cut < cuts; ++cut) {
        const Ids ids = mesh.ids(), removed{ids[random() % ids.size()]};
        const Triangle t = mesh.elements[removed[0]];
        std::vector<Triangle> added;
        Positions tips;
        if (const auto height = random() % 4; height > 0) {
          tips.push_back((mesh.now[t[0]] + mesh.now[t[1]] + mesh.now[t[2]]) / 3 +
                         Vector3d(0, 0, 0.07 * height));
          const auto m = static_cast<std::uint32_t>(mesh.now.size());
          added = {{t[0], t[1], m}, {t[1], t[2], m}, {t[2], t[0], m}};
        }
        collisions.replaceTriangles(a, removed, added, tips);
        mesh.apply(removed, added, tips);
      }
      mesh.now = moved(random, mesh.now, 1e-3);
      if (random() % 4 == 0) {
        mesh.before = moved(random, mesh.before, 1e-3);
        collisions.setPositions(a, mesh.before, mesh.now);
      } else {
        collisions.setPositions(a, mesh.now);
      }
      collisions.detectCollision();
      OctreeBasedCD anew = setUp();
      anew.setPositions(a, mesh.before, mesh.now);
      anew.detectCollision();
      for (const GeometryId other : {a, b}) {
        const Validity &found = collisions.collisionData(a, other).validity(),
                       &truth = anew.collisionData(a, other).validity();
        EXPECT_LE(found.startedApart, truth.startedApart) << seed << " " << step;
        if (cuts == 0) continue;
        EXPECT_EQ(found.startedApart, truth.startedApart) << seed << " " << step;
        EXPECT_EQ(found.trusted, truth.trusted);
        ++started[found.startedApart];
      }
    }
  }
  for (const std::size_t count : started) EXPECT_GT(count, kShareOfCases > 1 ? 10u : 50u);
}

/// A small cut keeps the octree's nodes, until they become too full.
TEST(Cuts, SmallOnesSeldomRebuildTheOctree) {
  const Mesh mesh = sheet(40, 0.1, 0);
  OctreeBasedCD collisions;
  const GeometryId id = addMesh(collisions, mesh);
  collisions.detectCollision();
  std::size_t rebuilt = 0, seldom = 0;
  Ids cut(20);
  std::iota(cut.begin(), cut.end(), 1600u);
  for (int step = 0; step < 30; ++step) {
    std::vector<Triangle> added;
    Positions positions;
    const CollisionProblem problem = collisions.problem();
    const CollisionProblem::Geometry& now = problem.geometries[0];
    for (const std::uint32_t element : cut) {
      const auto& [p, q, r] = now.triangles[element];
      const auto middle = static_cast<std::uint32_t>(now.now.size() + positions.size());
      positions.push_back((now.now[p] + now.now[q]) / 2);
      added.insert(added.end(), {{p, middle, r}, {middle, q, r}});
    }
    collisions.advance();
    const auto ids = collisions.replaceTriangles(id, cut, added, positions);
    collisions.detectCollision();
    EXPECT_EQ(collisions.octree().validate(), std::vector<std::string>{});
    rebuilt += collisions.statistics().rebuiltOctrees;
    // At first elsewhere in each step, then in the same place, which becomes ever finer.
    if (step < 15) {
      for (std::uint32_t& element : cut) element += 20;
      seldom = rebuilt;
    } else {
      cut.assign(ids.begin(), ids.begin() + 20);
    }
  }
  EXPECT_LT(seldom, 5u);
  EXPECT_GT(rebuilt, seldom);
}

TEST(Cuts, LeaveMeshesOpenOrClosed) {
  const Mesh ball = sphere(6, 8, {0, 0, 0}, 1);
  OctreeBasedCD collisions;
  const GeometryId id = addMesh(collisions, ball),
                   points = collisions.addPointSet(Positions{{0, 0, 0}, {2, 0, 0}});
  const auto inside = [&] {
    std::vector<InsideVertex> found;
    collisions.queries().findInsideVertices(points, id, found);
    return found.size();
  };
  EXPECT_EQ(inside(), 1u);
  const Ids one{3};
  collisions.replaceTriangles(id, one, {}, {});
  expectRefused(ErrorCode::NotClosed, "3 edges belong to one triangle only", inside, id);
  const std::vector<Triangle> lid{ball.triangles[3]};
  EXPECT_EQ(collisions.replaceTriangles(id, {}, lid, {}),
            Ids{static_cast<std::uint32_t>(ball.triangles.size())});
  EXPECT_EQ(inside(), 1u);
  Ids all(ball.triangles.size() + 1);
  std::iota(all.begin(), all.end(), 0u);
  std::erase(all, 3u);
  collisions.replaceTriangles(id, all, {}, {});
  EXPECT_FALSE(collisions.queries().closestPoint(id, {0, 0, 0}));
  collisions.detectCollision();
  EXPECT_EQ(collisions.statistics().triangles, 0u);
}

TEST(Cuts, RefusedOnesChangeNothing) {
  Random random(5);
  const Mesh mesh = sheet(3, 0.2, 0);
  const Solid solid = cells(1, random);
  OctreeBasedCD collisions;
  const GeometryId a = addMesh(collisions, mesh),
                   b = collisions.addTetrahedralMesh(solid.positions, solid.tetrahedra),
                   points = collisions.addPointSet(mesh.positions);
  collisions.addCollisionPair(a, b, {.method = Method::Proximity, .thickness = 0.3});
  collisions.addCollisionPair(a, a,
                              {.method = Method::Proximity, .thickness = 0.3, .restDistance = 0.5});
  const Ids first{2, 5};
  collisions.replaceTriangles(a, first, {}, {});
  collisions.setDisabledElements(a, Ids{1});
  collisions.setTags(a, Ids(mesh.triangles.size(), 3));
  collisions.detectCollision();
  const std::vector<std::byte> before = collisions.save();
  const std::uint64_t hash = collisions.collisionData(a, b).hash();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Positions one{{0, 0, 1}}, bad{{0, nan, 1}};
  const auto cut = [&](ErrorCode code, const std::string& words, const Ids& removed,
                       const std::vector<Triangle>& added, const Positions& positions,
                       const Positions& rest, std::optional<std::size_t> element) {
    expectRefused(
        code, words, [&] { collisions.replaceTriangles(a, removed, added, positions, rest); }, a,
        element);
  };
  using enum ErrorCode;
  cut(IndexOutOfRange, "triangle 7 is removed twice", {7, 8, 7}, {}, {}, {}, 7);
  cut(IndexOutOfRange, "triangle 5 was removed before", {7, 5}, {}, {}, {}, 5);
  cut(IndexOutOfRange, "triangle 18 is out of range; there are 18", {18}, {}, {}, {}, 18);
  cut(IndexOutOfRange, "triangle 18: vertex index 17 is out of range", {7}, {{0, 1, 17}}, one, {},
      18);
  cut(NonFinitePosition, "vertex 16: position is", {7}, {{0, 1, 16}}, bad, {}, 16);
  cut(NonFinitePosition, "vertex 16: position at rest is", {7}, {{0, 1, 16}}, one, bad, 16);
  cut(WrongPositionCount, "2 positions at rest given for 1 new vertices", {7}, {}, one,
      {{0, 0, 0}, {1, 0, 0}}, {});
  for (const GeometryId id : {b, points})
    expectRefused(
        UnsupportedMethod, "replaceTriangles() is for triangle meshes",
        [&] { collisions.replaceTriangles(id, {}, {}, {}); }, id);
  const auto cutTetrahedra = [&](ErrorCode code, const std::string& words, GeometryId id,
                                 const Ids& removed, const std::vector<Tetrahedron>& added) {
    expectRefused(
        code, words, [&] { collisions.replaceTetrahedra(id, removed, added, {}); }, id);
  };
  const Tetrahedron again = solid.tetrahedra[0];
  cutTetrahedra(UnsupportedMethod, "replaceTetrahedra() is for tetrahedral meshes", a, {}, {});
  cutTetrahedra(IndexOutOfRange, "tetrahedron 1 is removed twice", b, {1, 1}, {});
  cutTetrahedra(SharedFace, "already belongs to tetrahedra", b, {}, {again, again});
  cutTetrahedra(IndexOutOfRange, "tetrahedron 6 has vertex 1 twice", b, {}, {{0, 1, 1, 2}});
  EXPECT_TRUE(collisions.save() == before);
  collisions.detectCollision();
  EXPECT_EQ(collisions.collisionData(a, b).hash(), hash);
  EXPECT_EQ(collisions.statistics().rebuiltOctrees, 0u);
  collisions.replaceTetrahedra(b, Ids{0}, {}, {});
  CollisionProblem wrong = collisions.problem();
  std::vector<Triangle>& surface = wrong.geometries[1].triangles;
  std::swap(surface.back()[0], surface.back()[1]);
  expectRefused(InvalidSettings, "the triangles are not the surface", [&] { setUp(wrong); });
}

}  // namespace
}  // namespace palpate::testing
