#include "Common/ExpectRefused.h"
#include "Common/PairRun.h"
#include "Common/Renamed.h"
#include "Common/Solids.h"
#include "Common/TemporaryFolder.h"
#include "Common/TestGeometry.h"

#include <palpate/Capture.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

// replaceTriangles() and replaceTetrahedra(), beside objects to which the mesh is handed anew.
// Random histories (Common/History.h) cut as well, among all other calls.

namespace palpate::testing {
namespace {

/// A mesh of which elements were removed, with the ids that cuts gave.
template <class Element>
struct Model {
  Positions rest, before, now;
  std::vector<Element> elements;  ///< by id, with removed ones
  Ids removed;                    ///< ascending

  Ids ids() const { return idsWithout(elements.size(), removed); }
  std::vector<Element> left() const {
    std::vector<Element> all;
    for (const std::uint32_t id : ids()) all.push_back(elements[id]);
    return all;
  }
  void apply(const Ids& gone, const std::vector<Element>& added, const Positions& positions,
             const Positions& atRest) {
    removed.insert(removed.end(), gone.begin(), gone.end());
    std::sort(removed.begin(), removed.end());
    elements.insert(elements.end(), added.begin(), added.end());
    rest.insert(rest.end(), atRest.begin(), atRest.end());
    before.insert(before.end(), positions.begin(), positions.end());
    now.insert(now.end(), positions.begin(), positions.end());
  }
};

struct Difference {
  Ids removed;
  std::vector<Triangle> added;
  Positions positions, rest;
};

/// A cut along a line through a sheet: triangles around it become smaller ones, some with a vertex
/// of their own, and some go.
Difference randomCut(Random& random, const Model<Triangle>& mesh) {
  Difference cut;
  const Vector3d at = mesh.now[random() % mesh.now.size()];
  const auto first = static_cast<std::uint32_t>(mesh.now.size());
  const auto addVertex = [&](const Vector3d& now, const Vector3d& rest) {
    cut.positions.push_back(now);
    cut.rest.push_back(rest);
    return first + static_cast<std::uint32_t>(cut.positions.size()) - 1;
  };
  for (const std::uint32_t id : mesh.ids()) {
    const auto& [a, b, c] = mesh.elements[id];
    const Vector3d middle = (mesh.now[a] + mesh.now[b] + mesh.now[c]) / 3.0;
    if ((middle - at).norm() > 0.15) continue;
    cut.removed.push_back(id);
    const auto action = random() % 4;
    if (action == 0) continue;
    const std::uint32_t m = addVertex(middle, (mesh.rest[a] + mesh.rest[b] + mesh.rest[c]) / 3.0);
    const std::uint32_t own =
        action == 1 ? addVertex(mesh.now[a] + Vector3d(0, 0, 0.01), mesh.rest[a]) : a;
    cut.added.insert(cut.added.end(), {{a, b, m}, {b, c, m}, {c, own, m}});
  }
  return cut;
}

/// Whether the mesh has the features of a contact of the mesh with itself or, if it is the first of
/// two, its own feature.
class Features {
 public:
  explicit Features(const Model<Triangle>& mesh) {
    for (const std::uint32_t id : mesh.ids()) {
      m_triangles.insert(id);
      const Triangle& t = mesh.elements[id];
      for (int i = 0; i < 3; ++i) {
        m_vertices.insert(t[i]);
        m_edges.insert(std::minmax(t[i], t[(i + 1) % 3]));
      }
    }
  }
  bool have(const ContactKey& key, bool self) const {
    const auto& ids = key.ids;
    switch (key.kind) {
      case ContactKind::VertexTriangle:
        return m_vertices.contains(ids[0]) && (!self || m_triangles.contains(ids[1]));
      case ContactKind::TriangleVertex:
        return m_triangles.contains(ids[0]);
      default:
        return m_edges.contains({ids[0], ids[1]}) && (!self || m_edges.contains({ids[2], ids[3]}));
    }
  }

 private:
  std::set<std::uint32_t> m_vertices, m_triangles;
  std::set<std::pair<std::uint32_t, std::uint32_t>> m_edges;
};

class CutSequence : public ::testing::TestWithParam<int> {};

/// A sheet that folds, with itself and with a ball that moves through it, is cut in most steps.
TEST_P(CutSequence, IsAsIfTheMeshWereHandedOverAnew) {
  Random random(static_cast<std::uint64_t>(GetParam()));
  constexpr std::array kMethods{Method::Auto, Method::Intersection, Method::Proximity,
                                Method::Continuous};
  const PairSettings settings{.method = kMethods[GetParam() % 4],
                              .thickness = 0.03,
                              .contacts = GetParam() / 4 % 2 ? Contacts::All : Contacts::Distinct,
                              .trackContacts = true};
  PairSettings withItself = settings;
  withItself.restDistance = 0.15;
  const Mesh ball = sphere(8, 12, {0, 0, 0}, 0.2);
  Mesh sheetMesh = sheet(9, 0.1, 0);
  Model<Triangle> mesh{
      sheetMesh.positions, sheetMesh.positions, sheetMesh.positions, sheetMesh.triangles, {}};
  Ids disabled, tags;
  const auto setUp = [&](const Settings& how, const Positions& rest,
                         const std::vector<Triangle>& triangles) {
    OctreeBasedCD collisions(how);
    const GeometryId a = collisions.addTriangleMesh(rest, triangles), b = addMesh(collisions, ball);
    collisions.addCollisionPair(a, b, settings);
    collisions.addCollisionPair(a, a, withItself);
    return collisions;
  };
  OctreeBasedCD collisions =
      setUp(settingsOf(Engine::Octree, 1 + GetParam() % 3), mesh.rest, mesh.elements);
  const GeometryId a{0}, b{1};
  std::size_t contacts = 0, endedByCuts = 0, lasting = 0;
  Positions ballBefore = ball.positions, ballNow = ball.positions;
  for (int step = 0; step < 16; ++step) {
    const bool cuts = step % 4 != 3 && mesh.ids().size() < 300;
    std::map<ContactKey, std::uint32_t> agesBefore[2];
    const auto tracked = [&](GeometryId other, auto&& f) {
      const CollisionData& data = collisions.collisionData(a, other);
      for (const auto list :
           {data.trackedVertexTriangle(), data.trackedTriangleVertex(), data.trackedEdgeEdge()})
        for (const TrackedContact& contact : list) f(contact);
    };
    if (step > 0) {
      for (int i = 0; i < 2; ++i)
        tracked(i ? a : b, [&](const TrackedContact& c) { agesBefore[i][c.key] = c.age; });
      collisions.advance();
      mesh.before = mesh.now;
      ballBefore = ballNow;
    }
    if (cuts) {
      const Difference cut = randomCut(random, mesh);
      const auto ids =
          collisions.replaceTriangles(a, cut.removed, cut.added, cut.positions, cut.rest);
      Ids expected(cut.added.size());
      std::iota(expected.begin(), expected.end(), static_cast<std::uint32_t>(mesh.elements.size()));
      EXPECT_EQ(ids, expected);
      mesh.apply(cut.removed, cut.added, cut.positions, cut.rest);
      if (!tags.empty()) tags.resize(mesh.elements.size(), 0);
    }
    if (step % 5 == 2) {
      tags.clear();
      for (std::size_t i = 0; i < mesh.elements.size(); ++i)
        tags.push_back(static_cast<std::uint32_t>(random() % 9));
      collisions.setTags(a, tags);
    }
    if (step % 6 == 1) {
      disabled.clear();
      for (const std::uint32_t id : mesh.ids())
        if (random() % 10 == 0) disabled.push_back(id);
      collisions.setDisabledElements(a, disabled);
    }
    for (Vector3d& p : mesh.now) p = 0.97 * p + Vector3d(0.01, 0.01, 0.02 * std::sin(5 * p[0]));
    for (Vector3d& p : mesh.now) p += randomPoint(random, -0.005, 0.005);
    const Vector3d to{0.2 + 0.02 * step, 0.4, 0.3 - 0.03 * step};
    for (std::size_t v = 0; v < ballNow.size(); ++v) ballNow[v] = ball.positions[v] + to;
    if (step == 0) mesh.before = mesh.now, ballBefore = ballNow;
    collisions.setPositions(a, mesh.now);
    collisions.setPositions(b, ballNow);
    collisions.detectCollision();
    EXPECT_EQ(collisions.octree().validate(), std::vector<std::string>{});

    const Ids ids = mesh.ids();
    Ids ownTags, places;
    for (std::uint32_t i = 0; i < ids.size(); ++i) {
      if (!tags.empty()) ownTags.push_back(tags[ids[i]]);
      if (std::find(disabled.begin(), disabled.end(), ids[i]) != disabled.end())
        places.push_back(i);
    }
    Ids ballIds(ball.triangles.size());
    std::iota(ballIds.begin(), ballIds.end(), 0u);
    for (const Engine engine : {Engine::Octree, Engine::BruteForce}) {
      if (engine == Engine::BruteForce && step % 8 != 4) continue;
      OctreeBasedCD anew = setUp(settingsOf(engine), mesh.rest, mesh.left());
      anew.setPositions(a, mesh.before, mesh.now);
      anew.setPositions(b, ballBefore, ballNow);
      anew.setDisabledElements(a, places);
      anew.setTags(a, ownTags);
      anew.detectCollision();
      for (const GeometryId other : {a, b}) {
        const CollisionData& found = collisions.collisionData(a, other);
        const CollisionData truth =
            renamed(anew.collisionData(a, other), ids, other == a ? ids : ballIds);
        expectSameRows(Rows(found), Rows(truth));
        if (engine == Engine::Octree && cuts) {
          EXPECT_EQ(found.validity().trusted, truth.validity().trusted);
          EXPECT_EQ(found.validity().startedApart, truth.validity().startedApart);
        } else if (engine == Engine::Octree) {
          EXPECT_LE(found.validity().trusted, truth.validity().trusted);
        }
        for (const ContactKind kind :
             {ContactKind::VertexTriangle, ContactKind::TriangleVertex, ContactKind::EdgeEdge})
          EXPECT_TRUE(
              std::ranges::equal(found.tags(kind), anew.collisionData(a, other).tags(kind)));
        contacts += Rows(found).contacts();
      }
    }
    const Features features(mesh);
    for (int i = 0; i < 2; ++i) {
      const GeometryId other = i ? a : b;
      tracked(other, [&](const TrackedContact& c) {
        const auto before = agesBefore[i].find(c.key);
        if (before == agesBefore[i].end() || !features.have(c.key, other == a)) return;
        EXPECT_EQ(c.age, before->second + 1);
        ++lasting;
      });
      for (const TrackedContact& c : collisions.collisionData(a, other).ended()) {
        EXPECT_EQ(c.end == ContactEnd::Cut, !features.have(c.key, other == a));
        endedByCuts += c.end == ContactEnd::Cut;
      }
    }
  }
  EXPECT_GT(contacts, 200u);
  if (settings.method != Method::Intersection) {
    EXPECT_GT(lasting, 50u);
    EXPECT_GT(endedByCuts, 0u);
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, CutSequence, ::testing::Range(0, casesOf(8)));

/// Cuts of any size and shape, some with several calls: the next ones of a random history.
std::vector<Difference> anyCuts(Random& random, const Model<Triangle>& mesh,
                                const std::vector<Triangle>& original) {
  std::vector<Difference> cuts(1);
  Difference& cut = cuts.front();
  const Ids ids = mesh.ids();
  const auto removeOneIn = [&](std::size_t every, bool again) {
    for (const std::uint32_t id : ids) {
      if (random() % every) continue;
      cut.removed.push_back(id);
      if (again) cut.added.push_back(mesh.elements[id]);
    }
  };
  if (ids.size() < original.size() / 4) {  // back to where it began
    cut.removed = ids;
    cut.added = original;
    return cuts;
  }
  const auto kind = random() / 2;
  const bool again = random() % 2;
  switch (kind / 4 % 9) {
    case 0:
      return {};
    case 1:
      return {randomCut(random, mesh)};
    case 2:
    case 3:
      removeOneIn(std::array{200, 100, 50, 20}[kind % 4], again);
      break;
    case 4:
      removeOneIn(2, again);
      break;
    case 5:
      removeOneIn(1, again);
      break;
    case 6:  // in one call each
      cuts.clear();
      for (std::size_t i = 0; i < 12; ++i) {
        Difference& one = cuts.emplace_back();
        one.removed = {ids[i * ids.size() / 12]};
        if (random() % 2) one.added = {mesh.elements[one.removed[0]]};
      }
      break;
    case 7:  // triangles with consecutive ids
      for (std::size_t i = random() % ids.size(), left = 1 + random() % 150;
           i < ids.size() && left > 0; ++i, --left)
        cut.removed.push_back(ids[i]);
      break;
    default:  // only added: one that is there a second time, and one that was removed
      cut.added = {mesh.elements[ids[random() % ids.size()]], original[random() % original.size()]};
  }
  return cuts;
}

class AnyCuts : public ::testing::TestWithParam<int> {};

/// Two sheets of one mesh, with itself and with a ball. The mesh moves as a whole, in part, slowly
/// or not at all, so that its octree follows by each of its strategies.
TEST_P(AnyCuts, AreAsIfTheMeshWereHandedOverAnew) {
  Random random(static_cast<std::uint64_t>(100 + GetParam()));
  constexpr std::array kMethods{Method::Auto, Method::Proximity, Method::Continuous,
                                Method::Intersection};
  constexpr double kEdge = 1.0 / 20;
  PairSettings settings{.method = kMethods[GetParam() % 4],
                        .thickness = 0.015,
                        .contacts = GetParam() / 4 % 2 ? Contacts::All : Contacts::Distinct};
  const bool isSlow = GetParam() / 2 % 2;
  PairSettings withItself = settings;
  if (GetParam() % 3) withItself.restDistance = 2.5 * kEdge;
  const Mesh ball = sphere(8, 12, {0.5, 0.5, 0.1}, 0.2);
  Mesh sheets = sheet(20, 0.1, 0);
  const auto half = static_cast<std::uint32_t>(sheets.positions.size());
  for (std::uint32_t v = 0; v < half; ++v)
    sheets.positions.push_back(sheets.positions[v] + Vector3d(0, 0, 0.02));
  for (std::size_t t = 0, count = sheets.triangles.size(); t < count; ++t) {
    Triangle above = sheets.triangles[t];
    for (std::uint32_t& v : above) v += half;
    sheets.triangles.push_back(above);
  }
  Model<Triangle> mesh{sheets.positions, sheets.positions, sheets.positions, sheets.triangles, {}};
  const auto setUp = [&](const Settings& how, const std::vector<Triangle>& triangles) {
    OctreeBasedCD collisions(how);
    const GeometryId a = collisions.addTriangleMesh(mesh.rest, triangles),
                     b = addMesh(collisions, ball);
    collisions.addCollisionPair(a, b, settings);
    collisions.addCollisionPair(a, a, withItself);
    return collisions;
  };
  OctreeBasedCD collisions = setUp(settingsOf(Engine::Octree, 1 + GetParam() % 3), mesh.elements);
  const GeometryId a{0}, b{1};
  std::size_t contacts = 0, rebuilt = 0, refitted = 0;
  for (int step = 0; step < 24; ++step) {
    if (step > 0) {
      collisions.advance();
      mesh.before = mesh.now;
    }
    // At first the mesh is as it was, so that slow pairs are kept.
    const auto cuts =
        step > 6 ? anyCuts(random, mesh, sheets.triangles) : std::vector<Difference>();
    for (const Difference& cut : cuts) {
      collisions.replaceTriangles(a, cut.removed, cut.added, cut.positions, cut.rest);
      mesh.apply(cut.removed, cut.added, cut.positions, cut.rest);
    }
    const double motion = isSlow ? 2e-4 : 5e-3;
    switch (random() % 4) {
      case 0:
      case 1:
        for (Vector3d& p : mesh.now) p += randomPoint(random, -motion, motion);
        if (step == 0) mesh.before = mesh.now;
        collisions.setPositions(a, mesh.now);
        break;
      case 2: {
        const std::size_t first = random() % (mesh.now.size() - 10);
        for (std::size_t v = first; v < first + 10; ++v)
          mesh.now[v] += randomPoint(random, -motion, motion);
        if (step == 0) mesh.before = mesh.now;
        collisions.setPositions(a, first, std::span(mesh.now).subspan(first, 10));
        break;
      }
      default:
        break;
    }
    collisions.detectCollision();
    rebuilt += collisions.statistics().rebuiltOctrees;
    refitted += collisions.statistics().refittedOctrees;
    if (step % 5 == 4) {
      EXPECT_EQ(collisions.octree().validate(), std::vector<std::string>{});
    }
    OctreeBasedCD anew = setUp(settingsOf(Engine::Octree), mesh.left());
    anew.setPositions(a, mesh.before, mesh.now);
    anew.detectCollision();
    const Ids ids = mesh.ids();
    Ids ballIds(ball.triangles.size());
    std::iota(ballIds.begin(), ballIds.end(), 0u);
    for (const GeometryId other : {a, b}) {
      const CollisionData& found = collisions.collisionData(a, other);
      const CollisionData truth =
          renamed(anew.collisionData(a, other), ids, other == a ? ids : ballIds);
      expectSameRows(Rows(found), Rows(truth));
      contacts += Rows(found).contacts();
    }
    if (HasFailure()) FAIL() << "step " << step;
  }
  EXPECT_GT(rebuilt, 2u);
  EXPECT_GT(refitted, 5u);
  if (settings.method != Method::Intersection) {
    EXPECT_GT(contacts, 1000u);
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, AnyCuts, ::testing::Range(0, casesOf(24)));

/// Surface triangles with the tetrahedra that they belong to.
using Faces = std::set<std::pair<Triangle, std::uint32_t>>;

Faces facesOf(const TetrahedralSurface& surface, const Ids& tetrahedra) {
  Faces faces;
  for (std::size_t i = 0; i < surface.triangles.size(); ++i)
    if (surface.tetrahedra[i] != kNoElement)
      faces.emplace(surface.triangles[i],
                    tetrahedra.empty() ? surface.tetrahedra[i] : tetrahedra[surface.tetrahedra[i]]);
  return faces;
}

TEST(CutSolids, AreAsIfHandedOverAnew) {
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(casesOf(12)); ++seed) {
    Random random(seed);
    const bool few = seed % 3 == 1;  // so that the topology is not computed anew
    const Solid start = cells(few ? 4 : 2, random);
    Model<Tetrahedron> solid{
        start.positions, start.positions, start.positions, start.tetrahedra, {}};
    const Mesh ball = sphere(6, 8, {1.0, 1.0, few ? 4.1 : 2.1}, 0.8);
    const PairSettings settings{.method = seed % 2 ? Method::Auto : Method::Proximity,
                                .thickness = 0.05,
                                .contacts = seed % 3 ? Contacts::Distinct : Contacts::All};
    OctreeBasedCD collisions(settingsOf(Engine::Octree, 1 + static_cast<int>(seed % 2)));
    const GeometryId a = collisions.addTetrahedralMesh(start.positions, start.tetrahedra),
                     b = addMesh(collisions, ball);
    collisions.addCollisionPair(a, b, settings);
    collisions.addCollisionPair(a, a, settings);
    Ids tags;
    std::size_t contacts = 0;
    for (int step = 0; step < 8; ++step) {
      if (step > 0) collisions.advance();
      solid.before = solid.now;
      if (step == 1) {
        for (std::size_t i = 0; i < solid.elements.size(); ++i)
          tags.push_back(static_cast<std::uint32_t>(i * i % 17));
        collisions.setTags(a, tags);
      }
      const TetrahedralSurface last = collisions.surface(a);
      const std::vector<Triangle> trianglesBefore(last.triangles.begin(), last.triangles.end());
      const Faces facesBefore = facesOf(last, {});
      Ids gone;
      std::vector<Tetrahedron> added;
      Positions positions;
      for (const std::uint32_t id : solid.ids()) {
        if (random() % (few ? 150 : 8)) continue;
        gone.push_back(id);
        if (random() % 2) continue;
        const Tetrahedron& t = solid.elements[id];
        const auto middle = static_cast<std::uint32_t>(solid.now.size() + positions.size());
        positions.push_back(
            (solid.now[t[0]] + solid.now[t[1]] + solid.now[t[2]] + solid.now[t[3]]) / 4);
        for (int corner = 0; corner < 4; ++corner) {
          added.push_back(t);
          added.back()[corner] = middle;
        }
      }
      std::shuffle(gone.begin(), gone.end(), random);
      const auto ids = collisions.replaceTetrahedra(a, gone, added, positions);
      ASSERT_EQ(ids.size(), added.size());
      if (!ids.empty()) {
        EXPECT_EQ(ids.front(), solid.elements.size());
      }
      solid.apply(gone, added, positions, positions);
      if (!tags.empty()) tags.resize(solid.elements.size(), 0);
      for (Vector3d& p : solid.now) p += randomPoint(random, -0.02, 0.02);
      if (step == 0) solid.before = solid.now;  // new geometries are at rest
      collisions.setPositions(a, solid.now);
      collisions.detectCollision();
      EXPECT_EQ(collisions.octree().validate(), std::vector<std::string>{});

      const Ids left = solid.ids();
      const TetrahedralSurface surface = collisions.surface(a);
      OctreeBasedCD anew;
      const GeometryId fresh = anew.addTetrahedralMesh(solid.rest, solid.left());
      anew.setPositions(fresh, solid.before, solid.now);
      EXPECT_EQ(facesOf(surface, {}), facesOf(anew.surface(fresh), left));
      const auto removed = collisions.removedElements(a);
      Model<Triangle> faces{solid.rest,
                            solid.before,
                            solid.now,
                            {surface.triangles.begin(), surface.triangles.end()},
                            {removed.begin(), removed.end()}};
      for (std::uint32_t i = 0; i < faces.elements.size(); ++i) {
        const bool isRemoved = surface.tetrahedra[i] == kNoElement;
        EXPECT_EQ(isRemoved, std::binary_search(removed.begin(), removed.end(), i));
        // What stays keeps its id, and a removed id is not used again.
        if (i < trianglesBefore.size() && !isRemoved) {
          EXPECT_EQ(faces.elements[i], trianglesBefore[i]);
        }
        if (i >= trianglesBefore.size()) {
          EXPECT_FALSE(facesBefore.contains({faces.elements[i], surface.tetrahedra[i]}));
        }
      }
      for (const bool bruteForce : {false, true}) {
        OctreeBasedCD asTriangles(settingsOf(bruteForce ? Engine::BruteForce : Engine::Octree));
        asTriangles.addTriangleMesh(solid.rest, faces.left());
        addMesh(asTriangles, ball);
        asTriangles.setPositions(a, solid.before, solid.now);
        asTriangles.addCollisionPair(a, b, settings);
        asTriangles.addCollisionPair(a, a, settings);
        asTriangles.detectCollision();
        Ids ballIds(ball.triangles.size());
        std::iota(ballIds.begin(), ballIds.end(), 0u);
        for (const GeometryId other : {a, b})
          expectSameRows(Rows(collisions.collisionData(a, other)),
                         Rows(renamed(asTriangles.collisionData(a, other), faces.ids(),
                                      other == a ? faces.ids() : ballIds)));
      }
      for (const VertexTriangleContact& c : collisions.collisionData(a, b).triangleVertex())
        EXPECT_EQ(collisions.collisionData(a, b).tagsOf(c)[0],
                  tags.empty() ? 0 : tags[surface.tetrahedra[c.triangle]]);
      contacts += collisions.statistics().contacts;
      for (int i = 0; i < 50; ++i) {
        const Vector3d p = randomPoint(random, -0.2, 2.2);
        const auto found = collisions.queries().findTetrahedron(a, p),
                   truth = anew.queries().findTetrahedron(fresh, p);
        ASSERT_EQ(found.has_value(), truth.has_value());
        if (!found) continue;
        EXPECT_EQ(found->tetrahedron, left[truth->tetrahedron]);
        EXPECT_EQ(found->weights, truth->weights);
      }
    }
    EXPECT_GT(contacts, 20u);
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
    const auto setUp = [&](const Positions& rest, const std::vector<Triangle>& triangles) {
      OctreeBasedCD collisions;
      const GeometryId a = collisions.addTriangleMesh(rest, triangles),
                       b = addMesh(collisions, upper);
      collisions.addCollisionPair(a, b, settings);
      collisions.addCollisionPair(a, a, settings);
      return collisions;
    };
    Model<Triangle> mesh{lower.positions, lower.positions, lower.positions, lower.triangles, {}};
    OctreeBasedCD collisions = setUp(mesh.rest, mesh.elements);
    const GeometryId a{0}, b{1};
    collisions.detectCollision();
    for (int step = 0; step < 20; ++step) {
      if (random() % 4) collisions.advance(), mesh.before = mesh.now;
      const std::size_t cuts = random() % 3;
      for (std::size_t cut = 0; cut < cuts; ++cut) {
        Difference change;
        const Ids ids = mesh.ids();
        change.removed.push_back(ids[random() % ids.size()]);
        const Triangle t = mesh.elements[change.removed[0]];
        if (const auto height = random() % 4; height > 0) {
          const Vector3d tip = (mesh.now[t[0]] + mesh.now[t[1]] + mesh.now[t[2]]) / 3 +
                               Vector3d(0, 0, 0.07 * height);
          change.positions = change.rest = {tip};
          const auto m = static_cast<std::uint32_t>(mesh.now.size());
          change.added = {{t[0], t[1], m}, {t[1], t[2], m}, {t[2], t[0], m}};
        }
        collisions.replaceTriangles(a, change.removed, change.added, change.positions, change.rest);
        mesh.apply(change.removed, change.added, change.positions, change.rest);
      }
      for (Vector3d& p : mesh.now) p += randomPoint(random, -1e-3, 1e-3);
      if (random() % 4 == 0) {
        for (Vector3d& p : mesh.before) p += randomPoint(random, -1e-3, 1e-3);
        collisions.setPositions(a, mesh.before, mesh.now);
      } else {
        collisions.setPositions(a, mesh.now);
      }
      collisions.detectCollision();
      OctreeBasedCD anew = setUp(mesh.rest, mesh.left());
      anew.setPositions(a, mesh.before, mesh.now);
      anew.detectCollision();
      for (const GeometryId other : {a, b}) {
        const Validity &found = collisions.collisionData(a, other).validity(),
                       &truth = anew.collisionData(a, other).validity();
        if (cuts > 0) {
          EXPECT_EQ(found.startedApart, truth.startedApart) << seed << " " << step;
          EXPECT_EQ(found.trusted, truth.trusted);
          ++started[found.startedApart];
        } else {
          EXPECT_LE(found.startedApart, truth.startedApart) << seed << " " << step;
        }
      }
    }
  }
  for (const std::size_t count : started) EXPECT_GT(count, kShareOfCases > 1 ? 10u : 50u);
}

/// A vertex that had no element moves a body further from the cut on, also in the same step.
TEST(Cuts, PlacedBodiesMoveAsFarAsTheirElements) {
  Mesh body = sheet(2, 0, 0);
  const auto far = static_cast<std::uint32_t>(body.positions.size());
  body.positions.push_back({50, 0, 0});
  const Mesh floor = sheet(2, -1, 0);
  const Pose turned{Eigen::AngleAxisd(0.1, Vector3d::UnitZ()).toRotationMatrix(), {0, 0, 0}};
  const auto setUp = [&] {
    OctreeBasedCD collisions;
    const GeometryId a = addMesh(collisions, body), b = addMesh(collisions, floor);
    collisions.addCollisionPair(a, b, {.method = Method::Proximity, .thickness = 0.1});
    collisions.setTransform(a, Pose{});
    collisions.detectCollision();
    collisions.advance();
    collisions.setTransform(a, turned);
    return collisions;
  };
  OctreeBasedCD late = setUp(), early = setUp();
  const GeometryId a{0}, b{1};
  const auto cut = [&](OctreeBasedCD& collisions) {
    collisions.replaceTriangles(a, Ids{0}, std::vector<Triangle>{{0, 1, far}}, {});
  };
  late.detectCollision();
  const double before = late.collisionData(a, b).validity().displacement;
  cut(late), cut(early);
  late.detectCollision(), early.detectCollision();
  const Validity &found = late.collisionData(a, b).validity(),
                 &truth = early.collisionData(a, b).validity();
  EXPECT_LT(before, 1.0);
  EXPECT_GT(truth.displacement, 4.0);
  EXPECT_EQ(found.displacement, truth.displacement);
  EXPECT_EQ(found.arcDeviation, truth.arcDeviation);
}

TEST(Cuts, NewVerticesAreAtRestInTheStepOfTheCut) {
  OctreeBasedCD collisions;
  const GeometryId id = addMesh(collisions, sheet(1, 0, 0));
  collisions.advance();
  const Positions moved(4, Vector3d(1, 2, 3));
  collisions.setPositions(id, moved);
  const std::vector<Triangle> added{{0, 1, 4}};
  const Positions position{{5, 6, 7}};
  collisions.replaceTriangles(id, {}, added, position);
  CollisionProblem::Geometry mesh = collisions.problem().geometries[0];
  EXPECT_EQ(mesh.before.back(), position[0]);
  EXPECT_EQ(mesh.now.back(), position[0]);
  EXPECT_EQ(mesh.before.front(), sheet(1, 0, 0).positions.front());
  EXPECT_EQ(mesh.now.front(), moved.front());
  collisions.setPositions(id, Positions(5, Vector3d(0, 0, 1)));
  mesh = collisions.problem().geometries[0];
  EXPECT_EQ(mesh.before.back(), position[0]);
  EXPECT_EQ(mesh.now.back(), Vector3d(0, 0, 1));
}

/// A small cut keeps the octree's nodes, until they become too full.
TEST(Cuts, SmallOnesSeldomRebuildTheOctree) {
  const Mesh mesh = sheet(40, 0.1, 0), ball = sphere(8, 12, {0.5, 0.5, 0.1}, 0.2);
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  Settings rebuilding = settingsOf(Engine::Octree);
  rebuilding.octree.update = OctreeUpdate::Rebuild;
  OctreeBasedCD truth(rebuilding);
  for (OctreeBasedCD* each : {&collisions, &truth}) {
    const GeometryId a = addMesh(*each, mesh), b = addMesh(*each, ball);
    each->addCollisionPair(a, b, {.method = Method::Proximity, .thickness = 0.03});
    each->detectCollision();
  }
  const GeometryId a{0}, b{1};
  int rebuilt = 0, seldom = 0;
  std::size_t contacts = 0;
  Ids cut(20);
  std::iota(cut.begin(), cut.end(), 1600u);
  for (int step = 0; step < 30; ++step) {
    std::vector<Triangle> added;
    Positions positions;
    const TriangleMeshView view{collisions.positions(a), mesh.triangles};
    const CollisionProblem problem = collisions.problem();
    for (const std::uint32_t id : cut) {
      const auto& [p, q, r] = problem.geometries[0].triangles[id];
      const auto middle = static_cast<std::uint32_t>(view.positions.size() + positions.size());
      positions.push_back((view.positions[p] + view.positions[q]) / 2);
      added.insert(added.end(), {{p, middle, r}, {middle, q, r}});
    }
    Ids ids;
    for (OctreeBasedCD* each : {&collisions, &truth}) {
      each->advance();
      ids = each->replaceTriangles(a, cut, added, positions);
      each->detectCollision();
      EXPECT_EQ(each->octree().validate(), std::vector<std::string>{});
    }
    rebuilt += static_cast<int>(collisions.statistics().rebuiltOctrees);
    if (step == 0) {
      EXPECT_EQ(rebuilt, 0);
    }
    EXPECT_EQ(truth.statistics().rebuiltOctrees, 1u);
    EXPECT_EQ(collisions.collisionData(a, b).hash(), truth.collisionData(a, b).hash());
    EXPECT_EQ(collisions.candidatePairs(a, b), truth.candidatePairs(a, b));
    contacts += collisions.statistics().contacts;
    // At first elsewhere in each step, then in the same place, which becomes ever finer.
    if (step < 15) {
      for (std::uint32_t& id : cut) id += 20;
      seldom = rebuilt;
    } else {
      cut.assign(ids.begin(), ids.begin() + 20);
    }
  }
  EXPECT_LT(seldom, 5);
  EXPECT_GT(rebuilt, seldom);
  EXPECT_GT(contacts, 100u);
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
  const auto stateOf = [&] {
    TemporaryFolder folder;
    const auto file = folder.path / "state";
    capture(collisions, file);
    return contentOf(file);
  };
  const std::string before = stateOf();
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
  expectRefused(
      UnsupportedMethod, "replaceTriangles() is for triangle meshes",
      [&] { collisions.replaceTriangles(b, {}, {}, {}); }, b);
  expectRefused(
      UnsupportedMethod, "replaceTriangles() is for triangle meshes",
      [&] { collisions.replaceTriangles(points, {}, {}, {}); }, points);
  expectRefused(
      UnsupportedMethod, "replaceTetrahedra() is for tetrahedral meshes",
      [&] { collisions.replaceTetrahedra(a, {}, {}, {}); }, a);
  expectRefused(
      IndexOutOfRange, "tetrahedron 1 is removed twice",
      [&] {
        collisions.replaceTetrahedra(b, Ids{1, 1}, {}, {});
      },
      b, 1);
  const std::vector<Tetrahedron> again{solid.tetrahedra[0], solid.tetrahedra[0]};
  expectRefused(
      SharedFace, "already belongs to tetrahedra",
      [&] { collisions.replaceTetrahedra(b, {}, again, {}); }, b);
  const std::vector<Tetrahedron> flat{{0, 1, 1, 2}};
  expectRefused(
      IndexOutOfRange, "has vertex 1 twice", [&] { collisions.replaceTetrahedra(b, {}, flat, {}); },
      b, 6);
  EXPECT_EQ(stateOf(), before);
  collisions.detectCollision();
  EXPECT_EQ(collisions.collisionData(a, b).hash(), hash);
  EXPECT_EQ(collisions.statistics().rebuiltOctrees, 0u);
}

TEST(Cuts, AreInCaptures) {
  Random random(6);
  const Mesh mesh = sheet(6, 0.2, 0);
  const Solid solid = cells(2, random);
  OctreeBasedCD collisions;
  const GeometryId a = addMesh(collisions, mesh),
                   b = collisions.addTetrahedralMesh(solid.positions, solid.tetrahedra);
  collisions.addCollisionPair(a, b, {.method = Method::Proximity, .thickness = 0.3});
  for (std::uint32_t cut = 0; cut < 4; ++cut) {
    const auto last = static_cast<std::uint32_t>(collisions.vertexCount(a));
    const std::vector<Triangle> added{{cut, cut + 1, last}, {cut + 2, cut, last}};
    collisions.replaceTriangles(a, Ids{5 * cut, 5 * cut + 2}, added,
                                Positions{{0.1 * cut, 0.5, 0.1}});
    collisions.replaceTetrahedra(b, Ids{7 * cut, 7 * cut + 1}, {}, {});
    const std::vector<Tetrahedron> back{solid.tetrahedra[7 * cut]};
    collisions.replaceTetrahedra(b, {}, back, {});
  }
  collisions.setTags(b, Ids(solid.tetrahedra.size() + 4, 2));
  collisions.setDisabledElements(a, Ids{1, 40, 73});
  collisions.detectCollision();
  TemporaryFolder folder;
  const auto file = folder.path / "cut";
  capture(collisions, file);
  OctreeBasedCD copy = setUp(readCapture(file));
  copy.detectCollision();
  ASSERT_GT(collisions.statistics().contacts, 5u);
  EXPECT_EQ(copy.collisionData(a, b).hash(), collisions.collisionData(a, b).hash());
  EXPECT_TRUE(std::ranges::equal(copy.removedElements(b), collisions.removedElements(b)));
  EXPECT_TRUE(std::ranges::equal(copy.tags(b), collisions.tags(b)));
  const auto second = folder.path / "again";
  capture(copy, second);
  EXPECT_EQ(contentOf(second), contentOf(file));
  CollisionProblem wrong = collisions.problem();
  std::swap(wrong.geometries[1].triangles.back(), wrong.geometries[1].triangles[30]);
  std::swap(wrong.geometries[1].triangles.back()[0], wrong.geometries[1].triangles.back()[1]);
  expectRefused(ErrorCode::InvalidSettings, "the triangles are not the surface",
                [&] { setUp(wrong); });
}

}  // namespace
}  // namespace palpate::testing
