#include "Common/PairRun.h"
#include "Common/TestGeometry.h"

#include <gtest/gtest.h>

// Candidates that are kept from one detection to the next change no answer.

namespace palpate {
namespace {

using namespace testing;

struct SlowScene {
  std::string name;
  std::vector<TestGeometry> bodies;
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  double edge;  ///< L: about the length of an edge
  PairSettings settings;
};

TestGeometry sheetAt(std::uint32_t n, double height, double phase) {
  return testGeometry(sheet(n, height, phase));
}

std::vector<SlowScene> slowScenes() {
  Random random(77);
  const auto with = [](Method method, double thickness, Contacts contacts) {
    PairSettings settings;
    settings.method = method;
    settings.thickness = thickness;
    settings.contacts = contacts;
    return settings;
  };
  const double edge = 1.0 / 16;
  const TestGeometry lower = sheetAt(16, 0.5, 0.0), upper = sheetAt(16, 0.52, 1.0),
                     above = sheetAt(16, 0.515, 0.0), soups = testGeometry(soup(random, 300, edge));
  const Contacts distinct = Contacts::Distinct, all = Contacts::All;
  PairSettings rest = with(Method::Proximity, 0.03, distinct);
  rest.restDistance = 0.08;
  return {{"sheets", {lower, upper}, {{0, 1}}, edge, with(Method::Proximity, 0.02, distinct)},
          {"sheets, all", {lower, upper}, {{0, 1}}, edge, with(Method::Proximity, 0.02, all)},
          {"sheets, Auto", {lower, above}, {{0, 1}}, edge, with(Method::Auto, 0.02, distinct)},
          {"soup, itself", {soups}, {{0, 0}}, edge, with(Method::Proximity, 0.01, distinct)},
          {"soup, rest distance", {soups}, {{0, 0}}, edge, rest},
          {"three",
           {lower, upper, soups},
           {{0, 1}, {0, 2}, {2, 1}, {2, 2}},
           edge,
           with(Method::Proximity, 0.02, distinct)},
          {"thread",
           {thread(random, 300, 0.05, 0.005, false), lower},
           {{0, 1}, {0, 0}},
           0.02,
           with(Method::Proximity, 0.02, distinct)},
          {"tapered thread",
           {tapered(random, thread(random, 300, 0.05, 0.0, true), 0.01), upper},
           {{0, 1}},
           0.02,
           with(Method::Auto, 0.02, distinct)},
          {"particles",
           {particles(random, 400, 0.01), lower},
           {{0, 1}},
           edge,
           with(Method::Proximity, 0.02, distinct)}};
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
      for (const auto& [a, b] : scene.pairs)
        object.addCollisionPair(m_ids[a], m_ids[b], scene.settings);
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
  /// The same for a few vertices only.
  void moveSome(Random& random, std::size_t body, double length) {
    for (std::size_t v = 0; v < std::min<std::size_t>(20, m_positions[body].size()); ++v)
      m_positions[body][v] += randomPoint(random, -length, length);
    forBoth([&](OctreeBasedCD& object) { object.setPositions(m_ids[body], m_positions[body]); });
  }
  /// Splits up to four triangles with consecutive ids at new vertices, and removes one of them.
  void cut(Random& random, std::size_t body) { cut(body, random() % m_triangles[body].size(), 4); }
  void cut(std::size_t body, std::size_t first, std::size_t count) {
    const std::vector<Triangle>& triangles = m_triangles[body];
    const Positions& p = m_positions[body];
    std::vector<std::uint32_t> removed;
    std::vector<Triangle> added;
    std::vector<Vector3d> middles;
    for (std::size_t id = first; id < std::min(first + count, triangles.size()); ++id) {
      const auto [u, v, w] = triangles[id];
      if (u == v) continue;
      removed.push_back(static_cast<std::uint32_t>(id));
      if (id == first + 2) continue;
      const auto middle = static_cast<std::uint32_t>(p.size() + middles.size());
      middles.push_back((p[u] + p[v] + p[w]) / 3.0);
      for (const Triangle& t : {Triangle{u, v, middle}, {v, w, middle}, {w, u, middle}})
        added.push_back(t);
    }
    replace(body, removed, added, middles);
  }
  void replace(std::size_t body, const std::vector<std::uint32_t>& removed,
               const std::vector<Triangle>& added, const std::vector<Vector3d>& positions) {
    forBoth([&](OctreeBasedCD& object) {
      object.replaceTriangles(m_ids[body], removed, added, positions);
    });
    std::vector<Triangle>& triangles = m_triangles[body];
    for (const std::uint32_t id : removed) triangles[id] = {0, 0, 0};
    triangles.insert(triangles.end(), added.begin(), added.end());
    m_positions[body].insert(m_positions[body].end(), positions.begin(), positions.end());
  }
  /// Removes one triangle in `every`, from id `first` on. again: and adds the same ones.
  void scatter(std::size_t body, std::size_t first, std::size_t last, std::size_t every,
               bool again) {
    std::vector<std::uint32_t> removed;
    std::vector<Triangle> added;
    for (std::size_t id = first; id < std::min(last, m_triangles[body].size()); id += every) {
      const Triangle t = m_triangles[body][id];
      if (t[0] == t[1]) continue;
      removed.push_back(static_cast<std::uint32_t>(id));
      if (again) added.push_back(t);
    }
    replace(body, removed, added, {});
  }
  /// Vertices from this one on.
  void lift(std::size_t body, std::size_t first, double height) {
    for (std::size_t v = first; v < m_positions[body].size(); ++v)
      m_positions[body][v].z() += height;
    forBoth([&](OctreeBasedCD& object) { object.setPositions(m_ids[body], m_positions[body]); });
  }
  std::size_t vertexCount(std::size_t body) const { return m_positions[body].size(); }
  void detectOnly() {
    forBoth([](OctreeBasedCD& object) { object.detectCollision(); });
  }
  void detect() {
    forBoth([](OctreeBasedCD& object) { object.detectCollision(); });
    const OctreeBasedCD &kept = m_objects[0], &searched = m_objects[1];
    for (const CollisionPair& pair : searched.pairs()) {
      const CollisionData &found = kept.collisionData(pair.a, pair.b),
                          &truth = searched.collisionData(pair.a, pair.b);
      expectSameContacts(found, truth);
      EXPECT_EQ(found.hash(), truth.hash());
      const Validity &of = found.validity(), &expected = truth.validity();
      EXPECT_EQ(of.method, expected.method);
      EXPECT_EQ(of.trusted, expected.trusted);
      EXPECT_EQ(of.startedApart, expected.startedApart);
      EXPECT_EQ(of.displacement, expected.displacement);
      EXPECT_EQ(of.untrustedVerticesA, expected.untrustedVerticesA);
      EXPECT_EQ(of.untrustedVerticesB, expected.untrustedVerticesB);
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
  void setTopology(std::size_t body, const Mesh& mesh) {
    m_positions[body] = mesh.positions;
    m_triangles[body] = mesh.triangles;
    forBoth([&](OctreeBasedCD& object) {
      object.setTriangles(m_ids[body], mesh.positions, mesh.triangles);
    });
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
  std::vector<std::vector<Triangle>> m_triangles;  ///< {0, 0, 0}: removed
  std::array<std::size_t, 2> m_tested{};
  std::size_t m_contacts = 0;
  bool m_asksStatistics = true;
};

class KeptPairs : public ::testing::TestWithParam<SlowScene> {};

TEST_P(KeptPairs, SlowFramesHaveTheAnswersOfASearch) {
  for (const int threads : {1, 8})
    for (const double speed : {0.0005, 0.004, 0.015}) {
      SCOPED_TRACE(std::to_string(threads) + " threads, " + std::to_string(speed));
      Random random(5);
      KeptAndSearched both(GetParam(), threads);
      for (int frame = 0; frame < casesOf(60, 30); ++frame) {
        both.setAsksStatistics(frame % 3 != 1);
        both.advance();
        for (std::size_t body = 0; body < GetParam().bodies.size(); ++body)
          if (frame % 7 != 3 || body == 0) both.move(random, body, speed * GetParam().edge);
        both.detect();
        if (HasFailure()) return;
      }
      EXPECT_GT(both.contacts(), 0u);
      if (kShareOfCases > 1 || speed > 0.001) continue;
      EXPECT_LT(both.testedByKept(), 0.8 * both.testedBySearched());
    }
}

TEST_P(KeptPairs, ChangesBetweenFramesHaveTheAnswersOfASearch) {
  Random random(6);
  KeptAndSearched both(GetParam(), 2);
  const double edge = GetParam().edge;
  PairSettings settings = GetParam().settings;
  for (int frame = 0; frame < casesOf(240); ++frame) {
    SCOPED_TRACE("frame " + std::to_string(frame));
    if (frame % 4 != 1) both.advance();
    for (std::size_t body = 0; body < GetParam().bodies.size(); ++body) {
      if (frame % 9 == 4)
        both.moveSome(random, body, 0.01 * edge);
      else if (frame % 31 == 30)
        both.move(random, body, 2.0 * edge);  // a jump
      else
        both.move(random, body, 0.002 * edge);
    }
    switch (frame % 40) {
      case 6:
      case 7:
      case 20:
        if (GetParam().bodies[0].type == GeometryType::Triangles)
          for (int i = 0; i < frame % 3; ++i) both.cut(random, 0);
        break;
      case 11:  // octrees are updated to other positions, to which the body does not return
        both.move(random, 0, 0.3 * edge);
        both.kept().queries().closestPoint(both.id(0), {0.5, 0.5, 0.5});
        both.move(random, 0, 0.3 * edge);
        break;
      case 17:
        both.forBoth([&](OctreeBasedCD& object) {
          std::vector<std::uint32_t> disabled;
          for (std::uint32_t element = 0; element < 250; element += 5) disabled.push_back(element);
          object.setDisabledElements(both.id(0), disabled);
        });
        break;
      case 25:
        both.forBoth([&](OctreeBasedCD& object) { object.setDisabledElements(both.id(0), {}); });
        break;
      case 23:
        settings.thickness *= uniform(random, 0.8, 1.25);
        both.forBoth([&](OctreeBasedCD& object) {
          for (const auto& pair : std::vector(object.pairs().begin(), object.pairs().end()))
            object.setPairSettings(pair.a, pair.b, settings);
        });
        break;
      case 29:
        both.kept().releaseMemory();
        break;
      case 33:
        EXPECT_EQ(both.kept().octree().validate(), std::vector<std::string>{});
        break;
      case 37:
        if (GetParam().bodies[0].type == GeometryType::Triangles)
          both.setTopology(0, sheet(15 + static_cast<std::uint32_t>(frame / 40), 0.5, 0.3));
        break;
      default:
        break;
    }
    both.detect();
    if (HasFailure()) return;
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

TEST(KeptPairsOfTwoSheets, ListsAreMadeAlongWithSearches) {
  Random random(9);
  SlowScene scene = slowScenes().front();
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

/// Sheets of several parts, the second one above the first one, the third one close below it.
SlowScene largeSheets(double distance, double thickness, std::uint32_t n = 48) {
  SlowScene scene = slowScenes().front();
  scene.bodies = {sheetAt(n, 0.5, 0.0), sheetAt(n, 0.5 + distance, 0.0), sheetAt(n, 0.49, 0.0)};
  scene.pairs = {{0, 1}, {0, 2}};
  scene.edge = 1.0 / n;
  scene.settings.thickness = thickness;
  return scene;
}

TEST(KeptPairsOfTwoSheets, CutsKeepTheListsOfOtherElements) {
  for (const int threads : {1, 4}) {
    Random random(10);
    SlowScene scene = largeSheets(0.02, 0.008);
    scene.pairs = {{0, 1}, {1, 1}};
    scene.bodies[1] = sheetAt(48, 0.52, 1.0);
    KeptAndSearched both(scene, threads);
    PairSettings ofOne = scene.settings;
    ofOne.restDistance = 0.03;
    both.forBoth(
        [&](OctreeBasedCD& object) { object.setPairSettings(both.id(1), both.id(1), ofOne); });
    both.setAsksStatistics(false);
    runUntilKept(both, random, scene.edge);
    int frames = 0, fewer = 0;
    for (int frame = 0; frame < casesOf(80); ++frame) {
      SCOPED_TRACE("frame " + std::to_string(frame));
      both.advance();
      if (frame % 5 == 4) both.move(random, 1, 0.001 * scene.edge);
      for (int i = 0; i < frame % 4 - 1; ++i) both.cut(random, random() % 2);
      if (frame % 16 == 3) both.kept().queries().closestPoint(both.id(1), {0.5, 0.5, 0.5});
      if (frame % 5 != 4) both.move(random, 1, 0.001 * scene.edge);
      if (frame % 3 == 2) both.move(random, 0, 0.001 * scene.edge);
      both.detect();
      if (HasFailure()) return;
      ++frames, fewer += both.testsFewer();
    }
    EXPECT_GT(4 * fewer, 3 * frames) << threads << " threads";
  }
}

/// Groups, blocks and whole parts of the octree become empty, or it is built anew.
TEST(KeptPairsOfTwoSheets, ScatteredAndLargeCutsHaveTheAnswersOfASearch) {
  for (const int threads : {1, 4}) {
    Random random(17);
    SlowScene scene = largeSheets(0.02, 0.008);
    scene.pairs = {{0, 1}, {1, 1}};
    scene.bodies[1] = sheetAt(48, 0.52, 1.0);
    KeptAndSearched both(scene, threads);
    both.setAsksStatistics(false);
    int frames = 0, fewer = 0;
    const auto detect = [&](std::size_t moved) {
      if (moved < 2) both.move(random, moved, 0.001 * scene.edge);
      both.detect();
      ++frames, fewer += both.testsFewer();
      EXPECT_EQ(both.kept().octree().validate(), std::vector<std::string>{});
      both.advance();
    };
    for (const std::size_t every : {300u, 60u, 9u, 2u}) {
      if (kSanitized && every != 60u && every != 2u) continue;
      runUntilKept(both, random, scene.edge);
      both.advance();
      for (std::size_t cut = 0; cut < 6; ++cut) {
        SCOPED_TRACE("every " + std::to_string(every) + ", cut " + std::to_string(cut));
        if (cut == 5)
          both.scatter(1, 400 * every, 400 * every + 500, 1, false);
        else
          both.scatter(cut % 2, cut, 100000, every, cut % 3 != 0);
        detect(cut % 3);
        detect(random() % 3);
        if (HasFailure()) return;
      }
    }
    EXPECT_GT(3 * fewer, frames) << threads << " threads";
  }
}

TEST(KeptPairsOfTwoSheets, CutsGiveFeaturesToElementsOfOtherParts) {
  Random random(11);
  const SlowScene scene = largeSheets(0.01, 0.011);
  KeptAndSearched both(scene, 1);
  runUntilKept(both, random, scene.edge);
  for (int frame = 0; frame < casesOf(15); ++frame) {
    both.advance();
    for (int i = 0; i < 20; ++i) both.cut(random, random() % 2);
    both.detect();
    if (HasFailure()) return;
    EXPECT_TRUE(both.testsFewer());
  }
}

/// The octree of a body that lags is updated after a cut, even if its positions are as before.
TEST(KeptPairsOfTwoSheets, CutsOfBodiesAtRestHaveTheAnswersOfASearch) {
  Random random(16);
  const SlowScene scene = largeSheets(0.01, 0.0101, 24);
  KeptAndSearched both(scene, 1);
  runUntilKept(both, random, scene.edge, 0);
  constexpr std::uint32_t kSquares = 24 * 24, kStep = kShareOfCases > 1 ? 400 : 90;
  for (std::uint32_t square = 0; square < kSquares; square += kStep) {
    both.advance();
    // Two triangles of a square are replaced by others of its four corners.
    const Triangle &first = scene.bodies[0].triangles[2 * square],
                   &second = scene.bodies[0].triangles[2 * square + 1];
    const std::uint32_t other = *std::find_if(second.begin(), second.end(), [&](std::uint32_t v) {
      return std::find(first.begin(), first.end(), v) == first.end();
    });
    both.replace(0, {2 * square, 2 * square + 1},
                 {{first[0], first[1], other}, {first[1], first[2], other}}, {});
    both.detect();
    both.advance();
    both.move(random, 0, 0.001 * scene.edge);
    both.detect();
    if (HasFailure()) return;
  }
}

/// Sheets that are `distance` apart meet in steps: move(frame) changes both objects.
template <class F>
void runUntilMet(KeptAndSearched& both, double distance, double step, F&& move) {
  for (int frame = 0; frame * step < distance; ++frame) {
    both.advance();
    move(frame);
    both.detect();
    if (::testing::Test::HasFailure()) return;
  }
  EXPECT_GT(both.contacts(), 0u);
}

TEST(KeptPairsOfTwoSheets, MotionDuringCutsCounts) {
  Random random(12);
  const double distance = 0.08;
  const SlowScene scene = largeSheets(distance, 0.004);
  KeptAndSearched both(scene, 1);
  runUntilKept(both, random, scene.edge, 0);
  const double step = 0.03 * scene.edge;
  runUntilMet(both, distance, step, [&](int frame) {
    both.cut(1, 4 * static_cast<std::size_t>(frame), 4);
    both.lift(1, 0, -step);
  });
}

TEST(KeptPairsOfTwoSheets, NewVerticesMoveByThemselves) {
  Random random(13);
  const double distance = 0.03;
  const SlowScene scene = largeSheets(distance, 0.004);
  KeptAndSearched both(scene, 1);
  runUntilKept(both, random, scene.edge, 0);
  const std::size_t first = both.vertexCount(0);
  both.cut(0, 2000, 4);
  const double step = 0.01 * scene.edge;
  runUntilMet(both, distance, step, [&](int) { both.lift(0, first, step); });
}

TEST(KeptPairsOfTwoSheets, ANewTriangleMayReachFar) {
  Random random(14);
  const SlowScene scene = largeSheets(0.08, 0.004);
  for (const bool pierces : {false, true}) {
    KeptAndSearched both(scene, 1);
    runUntilKept(both, random, scene.edge, 0);
    both.advance();
    const auto tip = static_cast<std::uint32_t>(both.vertexCount(0));
    both.replace(0, {0}, {{0, 1, tip}}, {{0.45, 0.45, pierces ? 0.6 : 0.57}});
    both.detect();
    EXPECT_TRUE(both.testsFewer());
    both.advance();
    both.move(random, 1, 0.001 * scene.edge);
    both.detect();
  }
}

TEST(KeptPairsOfTwoSheets, CandidatesAreCountedAfterCuts) {
  Random random(15);
  const SlowScene scene = largeSheets(0.01, 0.004);
  KeptAndSearched both(scene, 1);
  runUntilKept(both, random, scene.edge);
  both.advance();
  both.move(random, 1, 0.001 * scene.edge);
  both.detectOnly();
  for (int i = 0; i < 5; ++i) both.cut(random, random() % 2);
  both.compareStatistics();
}

/// The octree of a body that lags has outdated boxes, by which its motion must not be measured.
TEST(KeptPairsOfTwoSheets, ATransformOfABodyThatLagsHasTheAnswerOfASearch) {
  Random random(9);
  const SlowScene scene = slowScenes().front();
  KeptAndSearched both(scene, 1);
  runUntilKept(both, random, scene.edge);
  both.advance();
  const Pose pose{Eigen::Matrix3d::Identity(), randomPoint(random, -1e-4, 1e-4)};
  both.forBoth([&](OctreeBasedCD& object) { object.setTransform(both.id(1), pose); });
  both.detect();
}

TEST(KeptPairsOfTwoSheets, ADetectionThatThrowsLeavesTheCountsThatWereAskedFor) {
  Random random(9);
  const SlowScene scene = slowScenes().front();
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

INSTANTIATE_TEST_SUITE_P(Scenes, KeptPairs, ::testing::ValuesIn(slowScenes()),
                         [](const auto& scene) {
                           std::string name = scene.param.name;
                           std::erase_if(name, [](char c) { return c == ' ' || c == ','; });
                           return name;
                         });

}  // namespace
}  // namespace palpate
