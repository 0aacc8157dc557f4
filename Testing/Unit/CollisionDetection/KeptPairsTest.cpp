#include "Common/DegenerateCases.h"
#include "Common/TestGeometry.h"

// Candidates that are kept from one detection to the next save tests of features, also of bodies of
// several parts and after cuts. Random histories (Common/History.h) compare the answers.

namespace palpate {
namespace {

using namespace testing;

struct SlowScene {
  std::string name;
  std::vector<TestGeometry> bodies;
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  double edge;  ///< L: about the length of an edge
  PairSettings settings{.method = Method::Proximity, .thickness = 0.02};
};

TestGeometry sheetAt(std::uint32_t n, double height, double phase) {
  return testGeometry(sheet(n, height, phase));
}

SlowScene twoSheets() {
  return {"sheets", {sheetAt(16, 0.5, 0.0), sheetAt(16, 0.52, 1.0)}, {{0, 1}}, 1.0 / 16};
}

std::vector<SlowScene> slowScenes() {
  Random random(77);
  const double edge = 1.0 / 16;
  const TestGeometry lower = sheetAt(16, 0.5, 0.0), soups = testGeometry(soup(random, 300, edge)),
                     line = thread(random, 300, 0.05, 0.005, false),
                     points = particles(random, 400, 0.01);
  SlowScene withItself{"soup, rest distance", {soups}, {{0, 0}}, edge};
  withItself.settings.restDistance = 0.08;
  return {twoSheets(),
          withItself,
          {"thread", {line, lower}, {{0, 1}, {0, 0}}, 0.02},
          {"particles", {points, lower}, {{0, 1}}, edge}};
}

/// An object that keeps its candidates, and one that searches from scratch.
class KeptAndSearched {
 public:
  KeptAndSearched(const SlowScene& scene, int threads) {
    for (const bool keeps : {true, false}) {
      Settings settings = settingsOf(Engine::Octree, keeps ? threads : 1);
      settings.octree.keepsPairs = keeps;
      m_objects.emplace_back(settings);
    }
    forBoth([&](OctreeBasedCD& object) {
      m_ids.clear();
      for (const TestGeometry& body : scene.bodies) m_ids.push_back(body.addTo(object));
      for (const auto& [a, b] : scene.pairs) {
        PairSettings settings = scene.settings;
        if (a != b) settings.restDistance = 0.0;
        object.addCollisionPair(m_ids[a], m_ids[b], settings);
      }
    });
    for (const TestGeometry& body : scene.bodies) {
      m_positions.push_back(body.positions);
      m_triangles.push_back(body.triangles);
    }
  }
  template <class F>
  void forBoth(F&& f) {
    for (OctreeBasedCD& object : m_objects) f(object);
  }
  /// Moves all vertices of a body together, and each a little by itself.
  void move(Random& random, std::size_t body, double length) {
    const Vector3d together = randomPoint(random, -length, length);
    for (Vector3d& p : m_positions[body])
      p += together + randomPoint(random, -0.2 * length, 0.2 * length);
    forBoth([&](OctreeBasedCD& object) { object.setPositions(m_ids[body], m_positions[body]); });
  }
  void shift(std::size_t body, const Vector3d& by) {
    for (Vector3d& p : m_positions[body]) p += by;
    forBoth([&](OctreeBasedCD& object) { object.setPositions(m_ids[body], m_positions[body]); });
  }
  /// Removes up to four triangles of a random body, with consecutive ids, and mostly adds them
  /// again.
  void cutSome(Random& random) {
    const std::size_t body = random() % 2;
    std::vector<Triangle>& triangles = m_triangles[body];
    const std::size_t first = random() % triangles.size();
    std::vector<std::uint32_t> removed;
    std::vector<Triangle> added;
    for (std::size_t id = first; id < std::min(first + 4, triangles.size()); ++id) {
      if (triangles[id] == kRemoved) continue;
      removed.push_back(static_cast<std::uint32_t>(id));
      if (first % 4 > 0) added.push_back(triangles[id]);
      triangles[id] = kRemoved;
    }
    forBoth(
        [&](OctreeBasedCD& object) { object.replaceTriangles(m_ids[body], removed, added, {}); });
    triangles.insert(triangles.end(), added.begin(), added.end());
  }
  void detect() {
    forBoth([](OctreeBasedCD& object) { object.detectCollision(); });
    const OctreeBasedCD &kept = m_objects[0], &searched = m_objects[1];
    for (const CollisionPair& pair : searched.pairs()) {
      const CollisionData &found = kept.collisionData(pair.a, pair.b),
                          &truth = searched.collisionData(pair.a, pair.b);
      expectSameContacts(found, truth);
      EXPECT_EQ(found.hash(), truth.hash());
      EXPECT_TRUE(found.validity() == truth.validity());
    }
    if (m_asksStatistics) compareStatistics();
    EXPECT_EQ(kept.statistics().contacts, searched.statistics().contacts);
    m_tested[0] += kept.statistics().featurePairs;
    m_tested[1] += searched.statistics().featurePairs;
    m_contacts += searched.statistics().contacts;
  }
  void compareStatistics() const {
    const OctreeBasedCD &kept = m_objects[0], &searched = m_objects[1];
    // With itself, rounding may decide for some pairs.
    for (const CollisionPair& pair : searched.pairs())
      EXPECT_NEAR(static_cast<double>(kept.pairStatistics(pair.a, pair.b).candidatePairs),
                  static_cast<double>(searched.pairStatistics(pair.a, pair.b).candidatePairs),
                  pair.a == pair.b ? 4.0 : 0.0);
  }
  void advance() {
    forBoth([](OctreeBasedCD& object) { object.advance(); });
  }
  OctreeBasedCD& kept() { return m_objects[0]; }
  GeometryId id(std::size_t body) const { return m_ids[body]; }
  std::size_t testedByKept() const { return m_tested[0]; }
  std::size_t testedBySearched() const { return m_tested[1]; }
  std::size_t contacts() const { return m_contacts; }
  /// Whether the last detection tested fewer features than a search.
  bool testsFewer() const {
    return m_objects[0].statistics().featurePairs < m_objects[1].statistics().featurePairs;
  }
  void setAsksStatistics(bool asks) { m_asksStatistics = asks; }

 private:
  std::vector<OctreeBasedCD> m_objects;
  std::vector<GeometryId> m_ids;
  std::vector<Positions> m_positions;
  std::vector<std::vector<Triangle>> m_triangles;
  static constexpr Triangle kRemoved{};
  std::array<std::size_t, 2> m_tested{};
  std::size_t m_contacts = 0;
  bool m_asksStatistics = true;
};

TEST(KeptPairs, SlowFramesTestFewFeatures) {
  for (const SlowScene& scene : slowScenes())
    for (const int threads : {1, 8}) {
      SCOPED_TRACE(scene.name + ", " + std::to_string(threads) + " threads");
      Random random(5);
      KeptAndSearched both(scene, threads);
      for (int frame = 0; frame < casesOf(60, 30); ++frame) {
        both.setAsksStatistics(frame % 3 != 1);
        both.advance();
        for (std::size_t body = 0; body < scene.bodies.size(); ++body)
          if (frame % 7 != 3 || body == 0) both.move(random, body, 0.0005 * scene.edge);
        both.detect();
        if (HasFailure()) return;
      }
      EXPECT_GT(both.contacts(), 0u);
      if (kShareOfCases > 1) continue;
      EXPECT_LT(both.testedByKept(), 0.8 * both.testedBySearched());
    }
}

/// Slow frames until candidates are kept.
void runUntilKept(KeptAndSearched& both, Random& random, double edge, std::size_t body = 1) {
  for (int frame = 0; frame < 30; ++frame) {
    both.advance();
    both.move(random, body, 0.001 * edge);
    both.detect();
  }
  EXPECT_TRUE(both.testsFewer());
}

TEST(KeptPairs, ListsAreMadeAlongWithSearches) {
  Random random(9);
  SlowScene scene = twoSheets();
  scene.bodies = {sheetAt(48, 0.5, 0.0), sheetAt(48, 0.52, 1.0)};  // of several parts
  scene.settings.thickness = 0.002;
  KeptAndSearched both(scene, 1);
  int searches = 0;
  for (int frame = 0; frame < 30; ++frame) {
    both.advance();
    both.move(random, 1, 0.001 * scene.edge);
    both.detect();
    searches += !both.testsFewer();
  }
  EXPECT_GT(searches, 8);
  EXPECT_LT(searches, 25);
}

/// Features that were far apart when lists were made come near, though each step is short.
TEST(KeptPairs, OneSheetSlidesOverHalfOfAnother) {
  for (const std::size_t body : {0, 1}) {
    SlowScene scene = twoSheets();
    scene.edge = 1.0 / 24;
    for (TestGeometry& each : scene.bodies) each = testGeometry(flat(24, 0.5));
    for (Vector3d& p : scene.bodies[body].positions) p += Vector3d(0.5, 0, 0.2 * scene.edge);
    scene.settings.thickness = 0.25 * scene.edge;
    KeptAndSearched both(scene, 1);
    both.setAsksStatistics(false);
    std::size_t fewer = 0;
    for (int frame = 0; frame < 100; ++frame) {
      both.advance();
      both.shift(body, scene.edge * Vector3d(-0.035, 0.003, 0));
      both.detect();
      if (HasFailure()) return;
      fewer += both.testsFewer();
    }
    EXPECT_GT(both.contacts(), 0u);
    EXPECT_GT(fewer, 30u);
  }
}

/// Two sheets of several parts, with each other and the upper one with itself.
SlowScene largeSheets() {
  SlowScene scene{
      "large sheets", {sheetAt(48, 0.5, 0.0), sheetAt(48, 0.52, 1.0)}, {{0, 1}, {1, 1}}, 1.0 / 48};
  scene.settings.thickness = 0.008;
  scene.settings.restDistance = 0.03;
  return scene;
}

TEST(KeptPairs, CutsKeepTheListsOfOtherElements) {
  Random random(10);
  const SlowScene scene = largeSheets();
  KeptAndSearched both(scene, 4);
  both.setAsksStatistics(false);
  runUntilKept(both, random, scene.edge);
  int frames = 0, fewer = 0;
  for (int frame = 0; frame < casesOf(60); ++frame) {
    SCOPED_TRACE("frame " + std::to_string(frame));
    both.advance();
    if (frame % 5 == 4) both.move(random, 1, 0.001 * scene.edge);
    for (int i = 0; i < frame % 4 - 1; ++i) both.cutSome(random);
    if (frame % 16 == 3) both.kept().queries().closestPoint(both.id(1), {0.5, 0.5, 0.5});
    if (frame % 5 != 4) both.move(random, 1, 0.001 * scene.edge);
    if (frame % 3 == 2) both.move(random, 0, 0.001 * scene.edge);
    both.detect();
    if (HasFailure()) return;
    ++frames, fewer += both.testsFewer();
  }
  EXPECT_GT(4 * fewer, 3 * frames);
}

TEST(KeptPairs, CandidatesAreCountedAfterCuts) {
  Random random(15);
  const SlowScene scene = largeSheets();
  KeptAndSearched both(scene, 1);
  runUntilKept(both, random, scene.edge);
  both.advance();
  both.move(random, 1, 0.001 * scene.edge);
  both.forBoth([](OctreeBasedCD& object) { object.detectCollision(); });
  for (int i = 0; i < 5; ++i) both.cutSome(random);
  both.compareStatistics();
}

TEST(KeptPairs, ADetectionThatThrowsLeavesTheCountsThatWereAskedFor) {
  Random random(9);
  const SlowScene scene = twoSheets();
  KeptAndSearched both(scene, 1);
  runUntilKept(both, random, scene.edge);
  const std::size_t before = both.kept().statistics().candidatePairs;
  both.kept().setContactPredicate(both.id(0), both.id(1),
                                  [](const ContactFeatures&) -> bool { throw 1; });
  both.advance();
  both.move(random, 1, 0.001 * scene.edge);
  EXPECT_THROW(both.kept().detectCollision(), int);
  EXPECT_EQ(both.kept().statistics().candidatePairs, before);
  both.kept().setContactPredicate(both.id(0), both.id(1), {});
  both.detect();
}

}  // namespace
}  // namespace palpate
