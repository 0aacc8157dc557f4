#include "Diagnostics/Audit.h"

#include <palpate/OctreeBasedCD.h>

#include "CollisionDetection/PairTable.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

namespace palpate {
namespace {

using testing::Mesh;
using testing::Random;
using List = AuditFailure::List;
using Fault = AuditFailure::Fault;

const AuditSettings kEverything{.features = 1 << 20};
constexpr PairSettings kPairSettings[]{
    {.method = Method::Intersection},
    {.method = Method::Proximity, .thickness = 0.05},
    {.method = Method::Proximity, .thickness = 0.05, .contacts = Contacts::All},
    {.method = Method::Continuous},
    {.method = Method::Continuous, .thickness = 0.05},
    {.method = Method::Continuous, .thickness = 0.05, .contacts = Contacts::All}};

TriangleMesh movingMesh(Random& random, const Mesh& mesh) {
  std::vector<Eigen::Vector3d> now = mesh.positions;
  for (Eigen::Vector3d& p : now) p += testing::randomPoint(random, -0.05, 0.05);
  return {MeshTopology(mesh.positions.size(), mesh.triangles), now, mesh.positions};
}

/// Two geometries, and their pair as a frame leaves it.
struct AuditedPair {
  Geometry a{GeometryId{0}}, b{GeometryId{1}};
  PairRecord record;

  AuditedPair(const CollisionPair& pair, PairKind kind) {
    record.pair = pair;
    record.a = &a;
    record.b = pair.a == pair.b ? &a : &b;
    PairPlan plan;
    plan.kind = kind;
    plan.method = pair.settings.method;
    record.ask(plan);
  }
  std::vector<AuditFailure> failures(const CollisionData::Contents& contents,
                                     const AuditSettings& settings = kEverything,
                                     std::uint64_t frame = 1) const {
    std::vector<AuditFailure> out;
    CollisionData data;
    CollisionData::Contents::of(data) = contents;
    audit(*record.question, record.found.sidesAreKnown, data, settings, frame, out);
    return out;
  }
};

/// Two meshes in contact, their contacts, and the internal function that audits other contacts than
/// these.
struct AuditedScene {
  Mesh first, second;
  PairSettings settings;
  bool self;
  CollisionPair pair{GeometryId{0}, GeometryId{self ? 0u : 1u}, settings};
  AuditedPair audited{pair, PairKind::Meshes};
  OctreeBasedCD detection{Settings{.threads = 1}};

  AuditedScene(Random& random, const PairSettings& pairSettings, bool withItself)
      : first(testing::soup(random, 30, 0.3)),
        second(testing::soup(random, 30, 0.3)),
        settings(pairSettings),
        self(withItself) {
    audited.a.body.mesh = movingMesh(random, first);
    audited.b.body.mesh = movingMesh(random, second);
    detection.addTriangleMesh(first.positions, first.triangles);
    detection.addTriangleMesh(second.positions, second.triangles);
    detection.setPositions(GeometryId{0}, a().before.all(), a().now.all());
    detection.setPositions(GeometryId{1}, b().before.all(), b().now.all());
    detection.addCollisionPair(pair.a, pair.b, settings);
    detection.detectCollision();
    detection.advance();
  }

  const TriangleMesh& a() const { return audited.a.body.mesh; }
  const TriangleMesh& b() const { return audited.b.body.mesh; }
  CollisionData::Contents found() const {
    CollisionData data = detection.collisionData(pair.a, pair.b);
    return CollisionData::Contents::of(data);
  }
  std::vector<AuditFailure> failures(const CollisionData::Contents& contents,
                                     const AuditSettings& auditSettings = kEverything,
                                     std::uint64_t frame = 1) const {
    return audited.failures(contents, auditSettings, frame);
  }
};

template <class F>
void forEachScene(F&& f) {
  Random random(11);
  for (const PairSettings& settings : kPairSettings)
    for (const bool self : {false, true}) {
      SCOPED_TRACE(static_cast<int>(settings.method) * 10 + self);
      AuditedScene scene(random, settings, self);
      f(scene);
    }
}

void expectOne(const std::vector<AuditFailure>& failures, const AuditedScene& scene, Fault fault,
               List list, const AuditFailure::Contact& expected,
               const AuditFailure::Contact& found) {
  ASSERT_EQ(failures.size(), 1u);
  EXPECT_EQ(failures[0].fault, fault);
  EXPECT_EQ(failures[0].list, list);
  EXPECT_EQ(failures[0].a, scene.pair.a);
  EXPECT_EQ(failures[0].b, scene.pair.b);
  EXPECT_EQ(failures[0].frame, 1u);
  EXPECT_TRUE(failures[0].expected == expected);
  EXPECT_TRUE(failures[0].found == found);
}

/// Values that no frame gives.
void falsify(VertexTriangleContact& c) { c.distance = std::nextafter(c.distance, 2.0); }
void falsify(EdgeEdgeContact& c) { c.normal = -c.normal; }
/// Ids that no frame gives: the last ones.
void rename(VertexTriangleContact& c) { c.vertex = c.triangle = 29; }
void rename(EdgeEdgeContact& c) { c.edgeA = {0, 1}, c.edgeB = {88, 89}; }
void rename(ElementPair& pair) { pair = {28, 29}; }

/// Removes each contact of a list in turn, or changes it, or adds another one beside it. It must be
/// the only failure.
template <class Contact>
void expectEachFault(const AuditedScene& scene, List list,
                     CountedVector<Contact> CollisionData::Contents::*member) {
  const CollisionData::Contents good = scene.found();
  for (std::size_t i = 0; i < (good.*member).size(); ++i) {
    if (testing::isLeftOut(i)) continue;
    const Contact& contact = (good.*member)[i];
    CollisionData::Contents faulty = good;
    (faulty.*member).erase((faulty.*member).begin() + static_cast<std::ptrdiff_t>(i));
    expectOne(scene.failures(faulty), scene, Fault::FalseNegative, list, contact, {});
    if (i % 5 != 0) continue;
    faulty = good;
    (faulty.*member).push_back(contact);
    expectOne(scene.failures(faulty), scene, Fault::FalsePositive, list, {}, contact);
    Contact other = contact;
    rename(other);
    if (std::find((good.*member).begin(), (good.*member).end(), other) == (good.*member).end()) {
      (faulty.*member).back() = other;
      expectOne(scene.failures(faulty), scene, Fault::FalsePositive, list, {}, other);
    }
    if constexpr (requires { falsify(other); }) {
      faulty = good;
      other = contact;
      falsify(other);
      (faulty.*member)[i] = other;
      expectOne(scene.failures(faulty), scene, Fault::Different, list, contact, other);
    }
  }
}

TEST(Audit, FindsFaultsBetweenTwoShapes) {
  const PairSettings settings{.method = Method::Proximity, .thickness = 1};
  const CollisionPair pair{GeometryId{0}, GeometryId{1}, settings};
  AuditedPair audited(pair, PairKind::Shapes);
  audited.a.body.shape.emplace(Box{{0, 0, 0}, {1, 1, 1}});
  audited.b.body.shape.emplace(Box{{0, 0, 2.5}, {1, 1, 1}});
  OctreeBasedCD detection;
  detection.addAnalyticalGeometry(Box{{0, 0, 0}, {1, 1, 1}});
  detection.addAnalyticalGeometry(Box{{0, 0, 2.5}, {1, 1, 1}});
  detection.addCollisionPair(pair.a, pair.b, settings);
  detection.detectCollision();
  CollisionData data = detection.collisionData(pair.a, pair.b);
  const CollisionData::Contents good = CollisionData::Contents::of(data);
  ASSERT_EQ(good.shapeShape.size(), 1u);
  EXPECT_TRUE(audited.failures(good).empty());
  const auto expectFault = [&](const CollisionData::Contents& faulty, Fault fault) {
    const std::vector<AuditFailure> failures = audited.failures(faulty);
    ASSERT_EQ(failures.size(), 1u);
    EXPECT_EQ(failures[0].fault, fault);
    EXPECT_EQ(failures[0].list, List::ShapeShape);
  };
  expectFault({}, Fault::FalseNegative);
  CollisionData::Contents faulty = good;
  faulty.shapeShape[0].distance = 0.25;
  expectFault(faulty, Fault::Different);
  faulty = good;
  faulty.shapeShape.push_back(good.shapeShape[0]);
  expectFault(faulty, Fault::FalsePositive);
}

TEST(Audit, FindsEachRemovedAddedOrChangedContact) {
  std::size_t contacts = 0, ofTriangles = 0;
  forEachScene([&](const AuditedScene& scene) {
    EXPECT_TRUE(scene.failures(scene.found()).empty());
    expectEachFault(scene, List::VertexTriangle, &CollisionData::Contents::vertexTriangle);
    expectEachFault(scene, List::TriangleVertex, &CollisionData::Contents::triangleVertex);
    expectEachFault(scene, List::EdgeEdge, &CollisionData::Contents::edgeEdge);
    expectEachFault(scene, List::IntersectingTriangles,
                    &CollisionData::Contents::intersectingTriangles);
    EXPECT_GT(scene.found().vertexTriangle.size(), 0u);
    const std::size_t edges = scene.found().edgeEdge.size();
    // Of triangles that pierce each other, edges have a contact if no vertex is behind.
    if (scene.settings.method == Method::Intersection)
      ofTriangles += edges;
    else
      EXPECT_GT(edges, 0u);
    contacts += edges;
  });
  EXPECT_GT(ofTriangles, 0u);
  EXPECT_GT(contacts, 50u);
}

TEST(Audit, FindsAnImpactBeforeTheEarliest) {
  Random random(4);
  const AuditedScene scene(
      random,
      {.method = Method::Continuous, .thickness = 0.001, .continuous = {.earliestTimeOnly = true}},
      false);
  CollisionData::Contents contents = scene.found();
  EXPECT_TRUE(scene.failures(contents).empty());
  const double earliest = contents.earliestTimeOfImpact;
  ASSERT_LT(earliest, 1.0);
  contents.earliestTimeOfImpact = std::nextafter(earliest, 1.0);
  const std::vector<AuditFailure> failures = scene.failures(contents);
  ASSERT_GT(failures.size(), 0u);
  for (const AuditFailure& failure : failures) {
    EXPECT_EQ(failure.list, List::Earliest);
    std::visit(
        [&](const auto& contact) {
          if constexpr (requires { contact.timeOfImpact; })
            EXPECT_EQ(contact.timeOfImpact, earliest);
          else
            ADD_FAILURE();
        },
        failure.expected);
  }
}

TEST(Audit, SmallSamplesFindAFaultWithinSomeFrames) {
  forEachScene([&](const AuditedScene& scene) {
    CollisionData::Contents faulty = scene.found();
    const bool byTriangles = scene.settings.method == Method::Intersection;
    if (byTriangles)
      faulty.vertexTriangle.pop_back();
    else
      faulty.edgeEdge.pop_back();
    std::size_t fired = 0;
    for (std::uint64_t frame = 1; frame <= 400; ++frame) {
      const auto failures = scene.failures(faulty, {.features = 5, .seed = 3}, frame);
      EXPECT_LE(failures.size(), 1u);
      fired += failures.size();
    }
    // All contacts of Intersection are compared, whatever the sample.
    EXPECT_GT(fired, byTriangles ? 399u : 0u);
    EXPECT_LT(fired, byTriangles ? 401u : 200u);
  });
}

/// The vertices of triangles that intersect the other mesh, at the start or at the end.
std::array<std::set<std::uint32_t>, 2> intersectingVertices(const AuditedScene& scene) {
  std::array<std::set<std::uint32_t>, 2> vertices;
  for (const bool atStart : {true, false}) {
    OctreeBasedCD detection{Settings{.threads = 1}};
    const GeometryId a = detection.addTriangleMesh(scene.first.positions, scene.first.triangles),
                     b = detection.addTriangleMesh(scene.second.positions, scene.second.triangles);
    detection.setPositions(a, (atStart ? scene.a().before : scene.a().now).all());
    detection.setPositions(b, (atStart ? scene.b().before : scene.b().now).all());
    detection.addCollisionPair(a, b, {.method = Method::Intersection});
    detection.detectCollision();
    for (const auto& [s, t] : detection.collisionData(a, b).intersectingTriangles()) {
      vertices[0].insert(scene.first.triangles[s].begin(), scene.first.triangles[s].end());
      vertices[1].insert(scene.second.triangles[t].begin(), scene.second.triangles[t].end());
    }
  }
  return vertices;
}

/// Where a step begins in intersection, Auto may leave out contacts of vertices whose side it
/// knows.
TEST(Audit, ComparesWithAutoWhatKnownSidesDoNotConcern) {
  Random random(7);
  AuditedScene scene(random, {.method = Method::Proximity, .thickness = 0.05}, false);
  PairRecord& record = scene.audited.record;
  record.pair.settings.method = Method::Auto;
  const auto missing = [&](bool sidesAreKnown) {
    record.found.sidesAreKnown = sidesAreKnown;
    return scene.failures({});
  };
  const auto intersecting = intersectingVertices(scene);
  const auto &ofA = intersecting[0], &ofB = intersecting[1];
  const auto concerns = [&](const AuditFailure& failure) {
    const auto any = [](const auto& vertices, const std::set<std::uint32_t>& known) {
      return std::any_of(vertices.begin(), vertices.end(),
                         [&](std::uint32_t v) { return known.contains(v); });
    };
    if (const auto* c = std::get_if<EdgeEdgeContact>(&failure.expected))
      return any(c->edgeA, ofA) || any(c->edgeB, ofB);
    const auto& c = std::get<VertexTriangleContact>(failure.expected);
    const bool swapped = failure.list == List::TriangleVertex;
    return (swapped ? ofB : ofA).contains(c.vertex) || any(c.vertices, swapped ? ofA : ofB);
  };
  std::vector<AuditFailure> expected = missing(false);
  const std::size_t all = expected.size();
  EXPECT_EQ(all, scene.found().vertexTriangle.size() + scene.found().triangleVertex.size() +
                     scene.found().edgeEdge.size());
  std::erase_if(expected, concerns);
  EXPECT_GT(expected.size(), 0u);
  EXPECT_LT(expected.size(), all);
  const std::vector<AuditFailure> found = missing(true);
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i)
    EXPECT_TRUE(found[i].list == expected[i].list && found[i].expected == expected[i].expected);
}

std::vector<std::size_t> sizesOf(const FeatureLists& lists) {
  return {lists.verticesOfA.size(), lists.verticesOfB.size(), lists.edgesOfA.size(),
          lists.trianglesOfA.size()};
}

TEST(Audit, DrawsFeaturesUniformlyBySeedFrameAndPair) {
  forEachScene([&](AuditedScene& scene) {
    const FeatureLists every = everyFeature(*scene.audited.record.question);
    std::size_t all = 0;
    for (const std::size_t size : sizesOf(every)) all += size;
    const auto listsOf = [](const FeatureLists& lists) {
      return std::array{lists.verticesOfA, lists.verticesOfB, lists.edgesOfA, lists.trianglesOfA};
    };
    const auto allLists = listsOf(every);
    std::array<std::multiset<std::uint32_t>, 4> times;
    const int most = static_cast<int>(all);
    for (const int features : {1, 2, 7, most / 2, most - 1, most, most + 1}) {
      for (std::uint64_t frame = 1; frame <= 50; ++frame) {
        const AuditSettings settings{.features = features, .seed = 9};
        const FeatureLists drawn = drawFeatures(*scene.audited.record.question, settings, frame);
        std::size_t total = 0;
        for (std::size_t list = 0; list < 4; ++list) {
          const std::vector<std::uint32_t> ids = listsOf(drawn)[list];
          const std::vector<std::uint32_t> from = listsOf(every)[list];
          total += ids.size();
          EXPECT_TRUE(std::is_sorted(ids.begin(), ids.end()));
          EXPECT_EQ(std::adjacent_find(ids.begin(), ids.end()), ids.end());
          EXPECT_TRUE(std::includes(from.begin(), from.end(), ids.begin(), ids.end()));
          if (features == most / 2) times[list].insert(ids.begin(), ids.end());
        }
        EXPECT_EQ(total, std::min<std::size_t>(all, static_cast<std::size_t>(features)));
        EXPECT_EQ(listsOf(drawn),
                  listsOf(drawFeatures(*scene.audited.record.question, settings, frame)));
      }
    }
    // A sample is half of all, in each of 50 frames: 25 times each on average. 8 is more than 4
    // sigma away.
    for (std::size_t list = 0; list < 4; ++list)
      for (const std::uint32_t id : allLists[list]) EXPECT_GT(times[list].count(id), 7u);

    const auto draw = [&](std::uint64_t seed, std::uint64_t frame, std::uint32_t b) {
      scene.audited.record.pair.b = GeometryId{b};
      return listsOf(
          drawFeatures(*scene.audited.record.question, {.features = 8, .seed = seed}, frame));
    };
    EXPECT_NE(draw(1, 1, 1), draw(2, 1, 1));
    EXPECT_NE(draw(1, 1, 1), draw(std::uint64_t{1} << 32, 1, 1));
    EXPECT_NE(draw(1, 1, 1), draw(1, 2, 1));
    EXPECT_NE(draw(1, 1, 1), draw(1, 1, 2));
  });
}

}  // namespace
}  // namespace palpate
