#include "Common/ExpectRefused.h"
#include "Common/TestGeometry.h"

#include <palpate/DistanceField.h>

#include <iterator>
#include <map>
#include <unordered_set>

// PairSettings::trackContacts, beside maps over the keys of contacts that brute force finds.

namespace palpate {
namespace {

using namespace testing;

using VertexSet = std::set<std::uint32_t>;
using FeatureVertices = std::array<VertexSet, 2>;
constexpr VertexSet::value_type kShapeSide = kNoElement;

struct KnownContact {
  FeatureVertices features;
  std::uint32_t age = 0;
  std::uint64_t data = 0;
  std::optional<ContactKey> predecessor{};
};
using KeyedContacts = std::map<ContactKey, KnownContact>;

/// The contacts of all lists, written out anew.
KeyedContacts keyedContacts(const CollisionData& data) {
  KeyedContacts all;
  const auto add = [&](const ContactKey& key, const FeatureVertices& features) {
    EXPECT_TRUE(all.emplace(key, KnownContact{features}).second);
  };
  const auto corners = [](const Triangle& t) { return VertexSet(t.begin(), t.end()); };
  for (const auto& c : data.vertexTriangle())
    add({ContactKind::VertexTriangle, {c.vertex, c.triangle, kNoElement, kNoElement}},
        {VertexSet{c.vertex}, corners(c.vertices)});
  for (const auto& c : data.triangleVertex())
    add({ContactKind::TriangleVertex, {c.triangle, c.vertex, kNoElement, kNoElement}},
        {corners(c.vertices), VertexSet{c.vertex}});
  for (const auto& c : data.edgeEdge())
    add({ContactKind::EdgeEdge, {c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]}},
        {VertexSet{c.edgeA[0], c.edgeA[1]}, VertexSet{c.edgeB[0], c.edgeB[1]}});
  for (const auto& c : data.shape())
    add({ContactKind::Shape,
         {static_cast<std::uint32_t>(c.element), c.id, c.vertices[1], c.vertices[2]}},
        {corners(c.vertices), VertexSet{kShapeSide}});
  for (std::size_t i = 0; i < data.shapeShape().size(); ++i)
    add({ContactKind::ShapeShape, {kNoElement, kNoElement, kNoElement, kNoElement}},
        {VertexSet{kShapeSide}, VertexSet{kShapeSide}});
  return all;
}

std::size_t commonVertices(const VertexSet& a, const VertexSet& b) {
  return static_cast<std::size_t>(
      std::count_if(a.begin(), a.end(), [&](std::uint32_t v) { return b.contains(v); }));
}

/// The number of vertices in common, or 0 unless both features have one.
std::size_t commonVertices(const FeatureVertices& a, const FeatureVertices& b, bool self) {
  const auto inOrder = [&](int first) {
    const std::size_t p = commonVertices(a[0], b[first]), q = commonVertices(a[1], b[1 - first]);
    return p > 0 && q > 0 ? p + q : 0;
  };
  return std::max(inOrder(0), self ? inOrder(1) : 0);
}

class TrackingOracle {
 public:
  explicit TrackingOracle(bool self) : m_self(self) {}
  std::size_t slides = 0, lasting = 0, ends = 0;

  void detect(const CollisionData& data) {
    KeyedContacts next = keyedContacts(data);
    m_ended = m_before;
    std::vector<ContactKey> begun;
    for (auto& [key, contact] : next) {
      const auto found = m_before.find(key);
      if (found == m_before.end() || found->second.features != contact.features) {
        begun.push_back(key);
        continue;
      }
      contact.age = found->second.age + 1;
      contact.data = found->second.data;
      m_ended.erase(key);
      ++lasting;
    }
    std::set<std::tuple<int, ContactKey, ContactKey>> candidates;
    for (const ContactKey& key : begun)
      for (const auto& [before, ended] : m_ended)
        if (const auto shared = commonVertices(next[key].features, ended.features, m_self))
          candidates.insert({-static_cast<int>(shared), key, before});
    for (const auto& [shared, key, before] : candidates) {
      if (next[key].predecessor || !m_ended.contains(before)) continue;
      next[key].predecessor = before;
      next[key].age = m_ended[before].age + 1;
      next[key].data = m_ended[before].data;
      m_ended.erase(before);
      ++slides;
    }
    for (const ContactKey& key : begun)
      if (const auto given = m_given.find(key); given != m_given.end())
        next[key].data = given->second;
    ends += m_ended.size();
    m_now = next;
  }
  void advance() {
    m_before = m_now;
    m_given.clear();
  }
  void setUserData(const ContactKey& key, std::uint64_t data) {
    m_now.at(key).data = data;
    if (m_before.contains(key))
      m_before[key].data = data;
    else
      m_given[key] = data;
  }
  void expect(const CollisionData& data) const {
    const std::vector<TrackedContact> found = allTracked(data);
    ASSERT_EQ(found.size(), m_now.size());
    auto expected = m_now.begin();
    for (const TrackedContact& contact : found) {
      EXPECT_EQ(contact.key, expected->first);
      EXPECT_EQ(contact.age, expected->second.age);
      EXPECT_EQ(contact.userData, expected->second.data);
      EXPECT_EQ(contact.predecessor, expected->second.predecessor);
      EXPECT_EQ(contact.end, ContactEnd::None);
      ++expected;
    }
    ASSERT_EQ(data.ended().size(), m_ended.size());
    auto ended = m_ended.begin();
    for (const TrackedContact& contact : data.ended()) {
      EXPECT_EQ(contact.key, ended->first);
      EXPECT_EQ(contact.age, ended->second.age);
      EXPECT_EQ(contact.userData, ended->second.data);
      EXPECT_EQ(contact.end, ContactEnd::Apart);
      ++ended;
    }
  }

 private:
  bool m_self;
  std::map<ContactKey, std::uint64_t> m_given;
  KeyedContacts m_before, m_now, m_ended;
};

/// Two bodies; the second slides over the first. Of a body with itself, both are the same.
struct SlidingScene {
  std::string name;
  std::function<std::array<GeometryId, 2>(OctreeBasedCD&)> add;
  std::function<void(OctreeBasedCD&, const std::array<GeometryId, 2>&, double time)> move;
  PairSettings settings;
};

SlidingScene slidingMeshes(std::string name, const TestGeometry& a, const TestGeometry& b,
                           const PairSettings& settings) {
  const bool self = &a == &b;
  return {std::move(name),
          [=](OctreeBasedCD& collisions) {
            const GeometryId first = a.addTo(collisions);
            return std::array{first, self ? first : b.addTo(collisions)};
          },
          [=](OctreeBasedCD& collisions, const auto& ids, double t) {
            Positions now = b.positions;
            for (Vector3d& p : now) {
              p += Vector3d(0.03 * t, 0.02 * t,
                            0.01 * std::sin(t + 9 * p.x()) + 0.02 * std::sin(3 * t));
              if (self) p.z() *= std::cos(7 * p.x() + 0.1 * t);  // folds
            }
            collisions.setPositions(ids[1], now);
          },
          settings};
}

std::vector<SlidingScene> slidingScenes() {
  Random random(5);
  const TestGeometry ball = testGeometry(sphere(8, 12, {0.5, 0.5, 0.5}, 0.3)),
                     floor = testGeometry(sheet(9, 0.25, 0.4)),
                     line = thread(random, 60, 0.15, 0.02, false),
                     points = particles(random, 80, 0.03);
  std::vector<SlidingScene> all;
  for (const Method method : {Method::Auto, Method::Proximity, Method::Continuous})
    for (const Contacts contacts : {Contacts::Distinct, Contacts::All}) {
      const PairSettings settings{method, 0.05, contacts};
      all.push_back(slidingMeshes("ball on floor", floor, ball, settings));
      all.push_back(slidingMeshes("line on floor", floor, line, settings));
      all.push_back(slidingMeshes("points on floor", points, floor, settings));
      all.push_back(slidingMeshes("lines", line, line, settings));
    }
  all.push_back(slidingMeshes("floor with itself", floor, floor, {Method::Proximity, 0.1}));
  all.push_back({"shape",
                 [=](OctreeBasedCD& collisions) {
                   return std::array{floor.addTo(collisions),
                                     collisions.addAnalyticalGeometry(
                                         Capsule{{0.3, 0.4, 0.3}, {0.5, 0.4, 0.35}, 0.1})};
                 },
                 [](OctreeBasedCD& collisions, const auto& ids, double t) {
                   collisions.setTransform(
                       ids[1], {.translation = {0.05 * t, 0.02 * t, 0.04 * std::sin(3 * t)}});
                 },
                 {Method::Proximity, 0.02}});
  all.push_back({"shapes",
                 [](OctreeBasedCD& collisions) {
                   return std::array{collisions.addAnalyticalGeometry(Sphere{{0, 0, 0}, 0.3}),
                                     collisions.addAnalyticalGeometry(Sphere{{0.6, 0, 0}, 0.3})};
                 },
                 [](OctreeBasedCD& collisions, const auto& ids, double t) {
                   collisions.setTransform(ids[1], {.translation = {0.05 * std::sin(t), 0, 0}});
                 },
                 {Method::Proximity, 0.01}});
  return all;
}

/// Steps with several detections each, and some without, with user data that is set between them.
TEST(ContactsOverTime, AreThoseOfMapsOverKeys) {
  std::size_t slides = 0, lasting = 0, ends = 0, number = 0;
  std::set<std::string> sliding;
  for (const SlidingScene& scene : slidingScenes()) {
    if (isLeftOut(number++)) continue;
    SCOPED_TRACE(scene.name + " by " + toString(scene.settings.method));
    // The reference tracks nothing.
    OctreeBasedCD tracking, reference(testing::settingsOf(Engine::BruteForce));
    const std::array<GeometryId, 2> ids = scene.add(tracking);
    scene.add(reference);
    PairSettings pair = scene.settings;
    reference.addCollisionPair(ids[0], ids[1], pair);
    pair.trackContacts = true;
    tracking.addCollisionPair(ids[0], ids[1], pair);
    TrackingOracle oracle(ids[0] == ids[1]);
    Random random(3);
    const int steps = kShareOfCases > 1 ? 7 : 12;  // with one that detects nothing
    for (int step = 0; step < steps; ++step) {
      const int rounds = step == 5 ? 0 : 1 + step % 3;
      for (int round = 0; round < rounds; ++round) {
        for (OctreeBasedCD* each : {&reference, &tracking}) {
          if (step % 4 != 3) scene.move(*each, ids, step + 0.3 * round);
          each->detectCollision();
        }
        const CollisionData& truth = reference.collisionData(ids[0], ids[1]);
        EXPECT_TRUE(truth.trackedVertexTriangle().empty() && truth.ended().empty());
        oracle.detect(truth);
        oracle.expect(tracking.collisionData(ids[0], ids[1]));
        for (const auto& [key, contact] : keyedContacts(truth))
          if (random() % 4 == 0) {
            const std::uint64_t value = random();
            tracking.setUserData(ids[0], ids[1], key, value);
            oracle.setUserData(key, value);
          }
      }
      if (rounds > 0) oracle.advance();
      reference.advance();
      tracking.advance();
    }
    if (oracle.slides > 0) sliding.insert(scene.name);
    EXPECT_GT(oracle.lasting, 0u);
    slides += oracle.slides, lasting += oracle.lasting, ends += oracle.ends;
  }
  EXPECT_GE(slides, leastOf(1000));
  EXPECT_GE(lasting, leastOf(10000));
  EXPECT_GE(ends, leastOf(1000));
  EXPECT_GE(sliding.size(), leastOf(6));
}

/// A point over a floor, in contact with it when the step ended.
struct ContactEnds : ::testing::Test {
  Mesh floor = sheet(6, 0, 0);
  Positions tool{{0.45, 0.4, 0.05}};
  OctreeBasedCD collisions;
  GeometryId a = testing::addMesh(collisions, floor), b = collisions.addPointSet(tool);

  void SetUp() override {
    for (Vector3d& p : floor.positions) p.z() = 0;
    collisions.setPositions(a, floor.positions, floor.positions);
    collisions.addCollisionPair(
        a, b, {.method = Method::Proximity, .thickness = 0.1, .trackContacts = true});
    collisions.detectCollision();
    ASSERT_EQ(data().triangleVertex().size(), 1u);
    EXPECT_EQ(data().trackedTriangleVertex()[0].age, 0u);
    collisions.advance();
  }
  const CollisionData& data() { return collisions.collisionData(a, b); }
  void expectEnd(ContactEnd end) {
    for (int detection = 0; detection < 2; ++detection) {
      collisions.detectCollision();
      ASSERT_EQ(data().ended().size(), 1u);
      EXPECT_EQ(data().ended()[0].end, end);
      EXPECT_EQ(data().ended()[0].key.kind, ContactKind::TriangleVertex);
    }
    collisions.advance();
    collisions.detectCollision();
    EXPECT_TRUE(data().ended().empty());
  }
  void moveTool(const Vector3d& by) {
    tool[0] += by;
    collisions.setPositions(b, tool);
  }
};

TEST_F(ContactEnds, NameTheirReason) {
  const auto expectAfter = [&](const char* name, ContactEnd end, auto&& change, auto&& undo) {
    SCOPED_TRACE(name);
    change();
    expectEnd(end);
    undo();
    collisions.detectCollision();
    ASSERT_EQ(data().trackedTriangleVertex().size(), 1u);
    collisions.advance();
  };
  expectAfter(
      "apart", ContactEnd::Apart,
      [&] {
        moveTool({0, 0, 1});
      },
      [&] {
        moveTool({0, 0, -1});
      });
  expectAfter(
      "disabled", ContactEnd::Disabled,
      [&] { collisions.setDisabledElements(b, std::vector<std::uint32_t>{0}); },
      [&] { collisions.setDisabledElements(b, {}); });
  expectAfter(
      "groups", ContactEnd::Filtered,
      [&] { collisions.setCollisionFilter(b, {.groups = 2, .mask = 2}); },
      [&] { collisions.setCollisionFilter(b, {}); });
  expectAfter(
      "predicate", ContactEnd::Filtered,
      [&] { collisions.setContactPredicate(a, b, [](const ContactFeatures&) { return false; }); },
      [&] { collisions.setContactPredicate(a, b, {}); });
}

/// A cut keeps contacts of triangles that stay, and ends those of triangles that go.
TEST_F(ContactEnds, ByCuts) {
  const std::uint32_t touched = data().triangleVertex()[0].triangle;
  const auto remove = [&](std::uint32_t triangle, bool replaces) {
    floor.triangles[triangle] = {0, 0, 0};
    if (replaces)
      collisions.replaceTriangles(a, std::vector<std::uint32_t>{triangle}, {}, {});
    else
      collisions.setTriangles(a, floor.positions, floor.triangles);
  };
  for (const std::uint32_t i : {0u, 1u}) {
    remove(touched < 2 ? 2 + i : i, i == 1);
    collisions.detectCollision();
    ASSERT_EQ(data().trackedTriangleVertex().size(), 1u);
    EXPECT_EQ(data().trackedTriangleVertex()[0].age, 1 + i);
    collisions.advance();
  }
  remove(touched, true);
  moveTool({0, 0, 0.5});
  expectEnd(ContactEnd::Cut);
}

/// The triangles get other vertices. User data of a contact is not that of one that ended, whose
/// triangle had the same index.
TEST_F(ContactEnds, UserDataOfANewContactLeavesTheEndedOne) {
  const TrackedContact old = data().trackedTriangleVertex()[0];
  collisions.setUserData(a, b, old.key, 1);
  const auto count = static_cast<std::uint32_t>(floor.positions.size());
  for (std::uint32_t v = 0; v < count; ++v) floor.positions.push_back(floor.positions[v]);
  for (Triangle& triangle : floor.triangles)
    for (std::uint32_t& corner : triangle) corner += count;
  collisions.setTriangles(a, floor.positions, floor.triangles);
  for (const double time : {0.0, 0.001}) {  // two detections of one step
    moveTool({0, 0, time});
    collisions.detectCollision();
    ASSERT_EQ(data().ended().size(), 1u);
    const TrackedContact ended{old.key, {}, 0, 1, ContactEnd::Cut};
    EXPECT_EQ(data().ended()[0], ended);
    ASSERT_EQ(data().trackedTriangleVertex().size(), 1u);
    const TrackedContact begun = data().trackedTriangleVertex()[0];
    EXPECT_EQ(begun.key, old.key);
    EXPECT_EQ(begun.age, 0u);
    EXPECT_EQ(begun.userData, time == 0.0 ? 0u : 2u);
    collisions.setUserData(a, b, begun.key, 2);
  }
}

/// Vertices of one mesh touch the field of the other, then the other way round. Keys name neither
/// mesh, but a contact of another mesh's vertex is another contact.
TEST(ContactsOverTime, ElementsOfTheOtherMeshBeginAnew) {
  const Mesh cube = testing::cube(0, 1);
  const auto field = std::make_shared<const DistanceField>(DistanceField::build(
      {cube.positions, cube.triangles}, {.errorBound = 0.01, .band = 0.3, .threads = 1}));
  OctreeBasedCD collisions;
  const GeometryId a = addMesh(collisions, cube), b = addMesh(collisions, cube);
  // The faces x = 1 of both are opposite each other.
  const Eigen::Matrix3d half = Eigen::Vector3d(-1, -1, 1).asDiagonal();
  collisions.setTransform(b, {half, {2.02, 1, 0}});
  const PairSettings byField{
      .method = Method::DistanceField, .thickness = 0.1, .trackContacts = true};
  collisions.attachDistanceField(b, field);
  collisions.addCollisionPair(a, b, byField);
  collisions.detectCollision();
  const CollisionData& data = collisions.collisionData(a, b);
  std::set<ContactKey> ofA, ofB;
  for (const TrackedContact& contact : data.trackedShape()) ofA.insert(contact.key);
  collisions.advance();
  collisions.attachDistanceField(a, field);
  collisions.setPairSettings(a, b, {.thickness = 0.1, .trackContacts = true});
  collisions.attachDistanceField(b, nullptr);
  collisions.setPairSettings(a, b, byField);
  collisions.detectCollision();
  for (const TrackedContact& contact : data.trackedShape()) {
    ofB.insert(contact.key);
    EXPECT_EQ(contact.age, 0u);
    EXPECT_FALSE(contact.predecessor);
  }
  std::vector<ContactKey> both;
  std::ranges::set_intersection(ofA, ofB, std::back_inserter(both));
  EXPECT_GE(both.size(), 4u);
  EXPECT_EQ(data.ended().size(), ofA.size());
}

TEST_F(ContactEnds, ErrorsOfUserDataAndSettings) {
  PairSettings other = collisions.pairs()[0].settings;
  const ContactKey unknown{ContactKind::TriangleVertex, {0, 1, kNoElement, kNoElement}};
  const auto set = [&] { collisions.setUserData(a, b, unknown, 1); };
  testing::expectRefused(ErrorCode::NotAvailable, "no contact with this key", set);
  other.trackContacts = false;
  collisions.setPairSettings(a, b, other);
  collisions.detectCollision();
  EXPECT_TRUE(data().trackedTriangleVertex().empty() && data().ended().empty());
  testing::expectRefused(ErrorCode::NotAvailable, "trackContacts is not set", set);
  other = {.method = Method::Continuous, .trackContacts = true};
  other.continuous.earliestTimeOnly = true;
  testing::expectRefused(ErrorCode::UnsupportedMethod, "earliestTimeOnly reports none",
                         [&] { collisions.setPairSettings(a, b, other); });
}

TEST(ContactKey, HashesAndCompares) {
  std::unordered_set<ContactKey> keys;
  std::set<std::size_t> hashes;
  for (std::uint32_t i = 0; i < 20; ++i)
    for (std::uint32_t j = 0; j < 20; ++j)
      for (const auto kind : {ContactKind::VertexTriangle, ContactKind::TriangleVertex}) {
        const ContactKey key{kind, {i, j, kNoElement, kNoElement}};
        EXPECT_TRUE(keys.insert(key).second);
        EXPECT_FALSE(keys.insert(key).second);
        hashes.insert(std::hash<ContactKey>()(key));
      }
  EXPECT_EQ(hashes.size(), 800u);
  EXPECT_LT((ContactKey{ContactKind::VertexTriangle, {1, 2, 0, 0}}),
            (ContactKey{ContactKind::VertexTriangle, {1, 3, 0, 0}}));
}

}  // namespace
}  // namespace palpate
