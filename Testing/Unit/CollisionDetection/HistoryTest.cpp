#include <palpate/OctreeBasedCD.h>

#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"

#include <gtest/gtest.h>

#include <array>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

// Many frames: the contacts of a frame depend on its positions and pairs alone, not on earlier
// frames.

namespace palpate::testing {
namespace {

using Positions = std::vector<Eigen::Vector3d>;

Positions moved(Positions positions, const Eigen::Vector3d& by) {
  for (Eigen::Vector3d& p : positions) p += by;
  return positions;
}

/// Makes the same calls to several engines: octrees with different settings, and brute force.
class Engines {
 public:
  Engines() {
    for (const Settings& settings : octreeSettings()) m_all.emplace_back(settings);
    m_all.emplace_back(settingsOf(Engine::BruteForce));
  }
  /// Calls call(engine) on each engine. All must return the same.
  template <class Call>
  auto onAll(Call call) {
    const auto first = call(m_all.front());
    for (std::size_t i = 1; i < m_all.size(); ++i) EXPECT_EQ(call(m_all[i]), first) << i;
    return first;
  }
  template <class Call>
  void forAll(Call call) {
    for (OctreeBasedCD& engine : m_all) call(engine);
  }
  /// Runs a frame and expects the same contacts of every pair in all engines. Returns the number of
  /// contacts.
  std::size_t expectEqualFrames() {
    forAll([](OctreeBasedCD& engine) { engine.detectCollision(); });
    for (const CollisionPair& pair : m_all.front().pairs()) {
      const CollisionData& oracle = m_all.back().collisionData(pair.a, pair.b);
      for (const OctreeBasedCD& engine : m_all)
        EXPECT_EQ(engine.collisionData(pair.a, pair.b).hash(), oracle.hash());
    }
    for (const OctreeBasedCD& engine : m_all)
      EXPECT_EQ(engine.octree().validate(), std::vector<std::string>{});
    forAll([](OctreeBasedCD& engine) { engine.advance(); });
    return m_all.front().statistics().contacts;
  }

 private:
  std::vector<OctreeBasedCD> m_all;
};

/// Two soups in contact, in several engines, with the contacts of their first frame.
struct Meeting {
  Engines engines;
  Mesh a, b;
  GeometryId idA, idB;
  std::size_t contacts;

  Meeting() {
    Random random(7);
    a = soup(random, 60, 0.2);
    b = soup(random, 60, 0.2);
    idA = engines.onAll(
        [&](OctreeBasedCD& e) { return e.addTriangleMesh(a.positions, a.triangles); });
    idB = engines.onAll(
        [&](OctreeBasedCD& e) { return e.addTriangleMesh(b.positions, b.triangles); });
    engines.forAll([&](OctreeBasedCD& e) {
      e.addCollisionPair(idA, idB, {.method = Method::Proximity, .thickness = 0.02});
    });
    contacts = engines.expectEqualFrames();
  }
  std::size_t frameWith(const Positions& now) {
    engines.forAll([&](OctreeBasedCD& e) { e.setPositions(idB, now); });
    return engines.expectEqualFrames();
  }
};

TEST(History, BodiesThatLeaveAndComeBackGiveTheSameContacts) {
  Meeting meeting;
  ASSERT_GT(meeting.contacts, 50u);
  for (const double far : {3.0, 1e3, 1e9}) {
    for (int step = 1; step <= 3; ++step)
      EXPECT_EQ(meeting.frameWith(moved(meeting.b.positions, {far * step, -far, far})), 0u);
    EXPECT_EQ(meeting.frameWith(meeting.b.positions), meeting.contacts) << far;
  }
}

TEST(History, TriangleMayGrowPastTheSceneAndShrink) {
  Meeting meeting;
  for (const double size : {1.0, 4.0, 1e3, 1e9, 10.0}) {
    Positions grown = meeting.b.positions;
    const Eigen::Vector3d centre = (grown[0] + grown[1] + grown[2]) / 3;
    for (int i = 0; i < 3; ++i) grown[i] = centre + size * (grown[i] - centre).normalized();
    EXPECT_GT(meeting.frameWith(grown), 0u);
    EXPECT_EQ(meeting.frameWith(meeting.b.positions), meeting.contacts) << size;
  }
}

TEST(History, FrameWithoutNewPositionsGivesTheSameContacts) {
  Meeting meeting;
  for (int frame = 0; frame < 3; ++frame)
    EXPECT_EQ(meeting.engines.expectEqualFrames(), meeting.contacts);
}

TEST(History, ConstQueriesWorkFromManyThreads) {
  Random random(3);
  const Mesh a = soup(random, 300, 0.2), b = soup(random, 300, 0.2);
  OctreeBasedCD engine(settingsOf(Engine::Octree, 2));
  const GeometryId idA = engine.addTriangleMesh(a.positions, a.triangles);
  const GeometryId idB = engine.addTriangleMesh(b.positions, b.triangles);
  engine.addCollisionPair(idA, idB, {.thickness = 0.01});
  for (int frame = 0; frame < 10; ++frame) {
    engine.setPositions(idB, moved(b.positions, {0.01 * frame, 0, 0}));
    engine.detectCollision();
    std::array<std::size_t, 4> answers{};
    std::vector<std::thread> threads;
    for (std::size_t& answer : answers) {
      threads.emplace_back([&] {
        answer = engine.collisionData(idA, idB).hash() + engine.octree().nodes(idA).size() +
                 engine.octree().validate().size() + engine.statistics().contacts +
                 engine.pairs().size();
      });
    }
    for (std::thread& thread : threads) thread.join();
    for (std::size_t answer : answers) EXPECT_EQ(answer, answers[0]);
    engine.advance();
  }
}

}  // namespace
}  // namespace palpate::testing
