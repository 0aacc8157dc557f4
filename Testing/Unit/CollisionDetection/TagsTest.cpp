#include "Common/ExpectRefused.h"
#include "Common/Solids.h"
#include "Common/TestGeometry.h"

#include <palpate/Capture.h>

// OctreeBasedCD::setTags(), beside tags that are looked up in the elements as they were given.

namespace palpate::testing {
namespace {

using Tags = std::vector<std::uint32_t>;

/// A geometry with tags, and which of its elements are enabled.
struct Tagged {
  std::vector<Triangle> elements;
  Tags tags;
  std::vector<bool> enabled;

  /// That of the lowest enabled element with all of these vertices.
  template <class Vertices>
  std::uint32_t of(const Vertices& vertices) const {
    if (tags.empty()) return 0;
    for (std::size_t i = 0; i < elements.size(); ++i)
      if (enabled[i] && std::all_of(vertices.begin(), vertices.end(), [&](std::uint32_t v) {
            return std::find(elements[i].begin(), elements[i].end(), v) != elements[i].end();
          }))
        return tags[i];
    return 0;
  }
  std::uint32_t of(std::uint32_t vertex) const { return of(std::array{vertex}); }
  std::uint32_t ofElement(std::uint32_t i) const { return tags.empty() ? 0 : tags[i]; }
};

Tags randomTags(Random& random, std::size_t count) {
  Tags tags;
  for (std::size_t i = 0; i < count; ++i) tags.push_back(static_cast<std::uint32_t>(random()));
  return tags;
}

Tagged tagged(Random& random, const TestGeometry& geometry) {
  Tagged all{geometry.elements(), {}, {}};
  all.enabled.assign(all.elements.size(), true);
  if (random() % 4) all.tags = randomTags(random, all.elements.size());
  for (std::size_t i = 0; i < all.enabled.size(); ++i) all.enabled[i] = random() % 4 != 0;
  return all;
}

void expectTags(const CollisionData& data, const Tagged& a, const Tagged& b) {
  const bool hasTags = !a.tags.empty() || !b.tags.empty();
  const auto expectList = [&](ContactKind kind, const auto& list, auto&& tagsOf) {
    const auto found = data.tags(kind);
    ASSERT_EQ(found.size(), hasTags ? list.size() : 0);
    for (std::size_t i = 0; i < list.size(); ++i) {
      const ContactTags truth = hasTags ? tagsOf(list[i]) : ContactTags{};
      if (hasTags) {
        EXPECT_EQ(found[i], truth);
      }
      EXPECT_EQ(data.tagsOf(list[i]), truth);
    }
  };
  expectList(ContactKind::VertexTriangle, data.vertexTriangle(), [&](const auto& c) {
    return ContactTags{a.of(c.vertex), b.ofElement(c.triangle)};
  });
  expectList(ContactKind::TriangleVertex, data.triangleVertex(), [&](const auto& c) {
    return ContactTags{a.ofElement(c.triangle), b.of(c.vertex)};
  });
  expectList(ContactKind::EdgeEdge, data.edgeEdge(), [&](const auto& c) {
    return ContactTags{a.of(c.edgeA), b.of(c.edgeB)};
  });
}

TEST(Tags, AreThoseOfTheLowestEnabledElementThatHoldsTheFeature) {
  Random random(1);
  std::size_t contacts = 0;
  for (int round = 0; round < 4; ++round) {
    const auto all = geometriesOfEveryType(random);
    for (const TestGeometry& first : all)
      for (const TestGeometry& second : all) {
        OctreeBasedCD collisions(settingsOf(Engine::Octree, 1 + round % 2));
        const bool self = &first == &second;
        const GeometryId a = first.addTo(collisions), b = self ? a : second.addTo(collisions);
        const Tagged ofA = tagged(random, first), ofB = self ? ofA : tagged(random, second);
        const auto set = [&](GeometryId id, const Tagged& geometry) {
          collisions.setTags(id, geometry.tags);
          EXPECT_TRUE(std::ranges::equal(collisions.tags(id), geometry.tags));
          Tags disabled;
          for (std::uint32_t i = 0; i < geometry.enabled.size(); ++i)
            if (!geometry.enabled[i]) disabled.push_back(i);
          collisions.setDisabledElements(id, disabled);
        };
        set(a, ofA);
        if (!self) set(b, ofB);
        collisions.addCollisionPair(a, b, {.method = Method::Proximity, .thickness = 0.05});
        collisions.detectCollision();
        const CollisionData& data = collisions.collisionData(a, b);
        contacts += collisions.statistics().contacts;
        expectTags(data, ofA, ofB);
      }
  }
  EXPECT_GT(contacts, 1000u);
}

TEST(Tags, BelongToTheListOfTheContact) {
  // Both meshes are one: contacts of both lists are equal, and only their places tell them apart.
  const Mesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
  OctreeBasedCD collisions;
  const GeometryId a = addMesh(collisions, mesh), b = addMesh(collisions, mesh);
  collisions.setTags(a, Tags{7});
  collisions.setTags(b, Tags{8});
  collisions.addCollisionPair(
      a, b, {.method = Method::Proximity, .thickness = 0.1, .contacts = Contacts::All});
  collisions.detectCollision();
  const CollisionData& data = collisions.collisionData(a, b);
  ASSERT_FALSE(data.vertexTriangle().empty());
  ASSERT_FALSE(data.triangleVertex().empty());
  ASSERT_FALSE(data.edgeEdge().empty());
  for (const auto& c : data.vertexTriangle()) EXPECT_EQ(data.tagsOf(c), (ContactTags{7, 8}));
  for (const auto& c : data.triangleVertex()) EXPECT_EQ(data.tagsOf(c), (ContactTags{7, 8}));
  const CollisionData copy = data;
  EdgeEdgeContact contact = data.edgeEdge().front();
  EXPECT_EQ(copy.tagsOf(contact), (ContactTags{7, 8}));
  contact.distance += 1.0;  // no contact of this answer
  EXPECT_EQ(copy.tagsOf(contact), ContactTags{});
}

TEST(Tags, OfShapesAndTetrahedra) {
  Random random(2);
  const Solid solid = cells(1, random);
  OctreeBasedCD collisions;
  const GeometryId tissue = collisions.addTetrahedralMesh(solid.positions, solid.tetrahedra),
                   tool = collisions.addAnalyticalGeometry(Sphere{{0.5, 0.5, 1.1}, 0.2}),
                   other = collisions.addAnalyticalGeometry(Sphere{{0.5, 0.5, 1.4}, 0.2});
  const Tags tags = randomTags(random, solid.tetrahedra.size());
  collisions.setTags(tissue, tags);
  collisions.setTags(tool, Tags{5});
  const PairSettings settings{.method = Method::Proximity, .thickness = 0.3};
  collisions.addCollisionPair(tool, tissue, settings);
  collisions.addCollisionPair(tool, other, settings);
  collisions.detectCollision();
  const CollisionData& data = collisions.collisionData(tool, tissue);
  const TetrahedralSurface surface = collisions.surface(tissue);
  Tagged ofTissue{{surface.triangles.begin(), surface.triangles.end()}, {}, {}};
  for (const std::uint32_t owner : surface.tetrahedra) ofTissue.tags.push_back(tags[owner]);
  ofTissue.enabled.assign(ofTissue.elements.size(), true);
  ASSERT_FALSE(data.shape().empty());
  for (std::size_t i = 0; i < data.shape().size(); ++i) {
    const ShapeContact& c = data.shape()[i];
    const std::uint32_t tag =
        c.element == ShapeElement::Face ? ofTissue.ofElement(c.id) : ofTissue.of(c.vertices);
    EXPECT_EQ(data.tagsOf(c), (ContactTags{5, tag}));
    EXPECT_EQ(data.tags(ContactKind::Shape)[i], (ContactTags{5, tag}));
  }
  const CollisionData& shapes = collisions.collisionData(tool, other);
  ASSERT_EQ(shapes.shapeShape().size(), 1u);
  EXPECT_EQ(shapes.tagsOf(shapes.shapeShape()[0]), (ContactTags{5, 0}));
}

TEST(Tags, AreInSnapshotsAndProblems) {
  Random random(4);
  const Solid solid = cells(1, random);
  OctreeBasedCD collisions;
  const GeometryId mesh = addMesh(collisions, sheet(2, 0.5, 0)),
                   tissue = collisions.addTetrahedralMesh(solid.positions, solid.tetrahedra);
  const Tags ofMesh = randomTags(random, 8), ofTissue = randomTags(random, solid.tetrahedra.size());
  collisions.setTags(mesh, ofMesh);
  collisions.publish();
  const auto first = collisions.latestSnapshot();
  collisions.setTags(mesh, {});
  collisions.setTags(tissue, ofTissue);
  collisions.publish();
  const auto second = collisions.latestSnapshot();
  EXPECT_TRUE(std::ranges::equal(first->tags(mesh), ofMesh));
  EXPECT_TRUE(first->tags(tissue).empty());
  EXPECT_TRUE(second->tags(mesh).empty());
  EXPECT_TRUE(std::ranges::equal(second->tags(tissue), ofTissue));
  const OctreeBasedCD copy = setUp(collisions.problem());
  EXPECT_TRUE(std::ranges::equal(copy.tags(tissue), ofTissue));
}

TEST(Tags, TopologiesAndOtherNumbersOfThem) {
  OctreeBasedCD collisions;
  const Mesh mesh = sheet(2, 0.5, 0);
  const GeometryId id = addMesh(collisions, mesh),
                   tool = collisions.addAnalyticalGeometry(Sphere{{0, 0, 0}, 1.0});
  collisions.setTags(id, Tags(8, 3));
  expectRefused(
      ErrorCode::InvalidSettings, "geometry 0: 7 tags given, but it has 8 elements",
      [&] { collisions.setTags(id, Tags(7, 3)); }, id);
  expectRefused(
      ErrorCode::InvalidSettings, "geometry 1: 2 tags given, but it has 1 element",
      [&] { collisions.setTags(tool, Tags(2, 3)); }, tool);
  EXPECT_EQ(collisions.tags(id).size(), 8u);
  collisions.setTriangles(id, mesh.positions, mesh.triangles);
  EXPECT_TRUE(collisions.tags(id).empty());
}

}  // namespace
}  // namespace palpate::testing
