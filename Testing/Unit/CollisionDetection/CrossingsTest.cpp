#include "Common/ExpectRefused.h"
#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Common/TestGeometry.h"
#include "Unit/Math/ImpactOracle.h"

#include <palpate/Error.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <set>
#include <tuple>
#include <vector>

// PairSettings::reportCrossings: exactly the passages that rational arithmetic finds for every two
// features.

namespace palpate {
namespace {

using namespace testing;

using CrossingRow = std::tuple<ContactKind, std::array<std::uint32_t, 4>, bool>;
using KeyFilter = std::function<bool(const ContactKey&)>;  ///< null: all

struct CrossingStep {
  const TestGeometry &a, &b;
  Positions nowA, nowB;
  bool self() const { return &a == &b; }
};

/// In the order of CollisionData::crossings().
std::vector<CrossingRow> crossingTruth(const CrossingStep& step, const KeyFilter& filter) {
  std::vector<CrossingRow> all;
  const auto add = [&](const ContactKey& key, bool edges, const auto& first, const auto& second,
                       bool swapped) {
    if (filter && !filter(key)) return;
    impact::Positions p;
    std::size_t i = 0;
    const auto put = [&](const auto& vertices, bool ofB) {
      ofB = ofB && !step.self();
      for (const std::uint32_t v : vertices) {
        p[i] = (ofB ? step.b : step.a).positions[v];
        p[4 + i++] = (ofB ? step.nowB : step.nowA)[v];
      }
    };
    put(first, swapped);
    put(second, !swapped);
    for (const auto& passage : impact::Query(edges, p).passages())
      all.push_back({key.kind, key.ids, passage.forward});
  };
  const auto vertices = [&](bool swapped) {
    const TestGeometry &own = swapped ? step.b : step.a, &other = swapped ? step.a : step.b;
    std::set<std::uint32_t> used;
    for (const Triangle& t : own.elements()) used.insert(t.begin(), t.end());
    for (const std::uint32_t v : used)
      for (std::uint32_t t = 0; t < other.triangles.size(); ++t) {
        const Triangle& corners = other.triangles[t];
        if (step.self() && std::find(corners.begin(), corners.end(), v) != corners.end()) continue;
        const ContactKey key =
            swapped ? ContactKey{ContactKind::TriangleVertex, {t, v, kNoElement, kNoElement}}
                    : ContactKey{ContactKind::VertexTriangle, {v, t, kNoElement, kNoElement}};
        add(key, false, std::array{v}, corners, swapped);
      }
  };
  vertices(false);
  if (!step.self()) vertices(true);
  for (const Segment& e : step.a.edges())
    for (const Segment& f : step.b.edges()) {
      if (step.self() && (f <= e || std::set{e[0], e[1], f[0], f[1]}.size() < 4)) continue;
      add({ContactKind::EdgeEdge, {e[0], e[1], f[0], f[1]}}, true, e, f, false);
    }
  // Several passages of two features have ascending times: a stable order keeps them.
  std::stable_sort(all.begin(), all.end(), [](const CrossingRow& l, const CrossingRow& r) {
    return std::tie(std::get<0>(l), std::get<1>(l)) < std::tie(std::get<0>(r), std::get<1>(r));
  });
  return all;
}

/// Returns how many there are.
std::size_t expectCrossings(const CrossingStep& step, double thickness,
                            const KeyFilter& filter = {}) {
  const std::vector<CrossingRow> truth = crossingTruth(step, filter);
  std::vector<Settings> all = octreeSettings();
  all.push_back(testing::settingsOf(Engine::BruteForce));
  std::vector<Crossing> first;
  for (const Settings& settings : all) {
    OctreeBasedCD collisions(settings);
    const GeometryId a = step.a.addTo(collisions), b = step.self() ? a : step.b.addTo(collisions);
    collisions.addCollisionPair(
        a, b, {.method = Method::Continuous, .thickness = thickness, .reportCrossings = true});
    if (filter)
      collisions.setContactPredicate(a, b, [&](const ContactFeatures& f) {
        switch (f.kind) {
          case ContactFeatures::Kind::VertexTriangle:
            return filter({ContactKind::VertexTriangle, {f.a[0], f.b[0], kNoElement, kNoElement}});
          case ContactFeatures::Kind::TriangleVertex:
            return filter({ContactKind::TriangleVertex, {f.a[0], f.b[0], kNoElement, kNoElement}});
          case ContactFeatures::Kind::EdgeEdge:
            break;
        }
        return filter({ContactKind::EdgeEdge, {f.a[0], f.a[1], f.b[0], f.b[1]}});
      });
    collisions.setPositions(a, step.a.positions, step.nowA);
    if (!step.self()) collisions.setPositions(b, step.b.positions, step.nowB);
    collisions.detectCollision();
    const auto crossings = collisions.collisionData(a, b).crossings();
    std::vector<CrossingRow> found;
    for (const Crossing& c : crossings) found.push_back({c.kind, c.ids, c.forward});
    EXPECT_EQ(found, truth) << nameOf(settings);
    if (first.empty()) first.assign(crossings.begin(), crossings.end());
    EXPECT_TRUE(std::ranges::equal(first, crossings)) << nameOf(settings);
  }
  return truth.size();
}

TEST(Crossings, AreThoseOfRationalArithmetic) {
  Random random(8);
  const TestGeometry soupA = testGeometry(soup(random, 40, 0.3)),
                     soupB = testGeometry(soup(random, 40, 0.3)),
                     line = thread(random, 40, 0.3, 0.0, false),
                     points = particles(random, 60, 0.0);
  const Pairs pairs{{&soupA, &soupB}, {&soupA, &soupA}, {&soupA, &line},
                    {&line, &soupA},  {&line, &line},   {&points, &soupA}};
  std::size_t passages = 0, number = 0;
  for (const double motion : {0.05, 0.5})
    for (const double thickness : {0.0, 0.02})
      for (const auto& [a, b] : pairs) {
        if (isLeftOut(number++, 5)) continue;
        const CrossingStep step{*a, *b, moved(random, a->positions, motion),
                                moved(random, b->positions, motion)};
        passages += expectCrossings(step, thickness);
        const auto everyThird = [](const ContactKey& key) {
          return (key.ids[0] + key.ids[1] + key.ids[2] + key.ids[3]) % 3 == 0;
        };
        expectCrossings(step, thickness, everyThird);
      }
  EXPECT_GE(passages, leastOf(500, 80));
}

/// All positions have small whole coordinates: features pass through borders, and planes hold
/// vertices at the step's ends.
TEST(Crossings, AreThoseOfRationalArithmeticOnAGrid) {
  Random random(2);
  const auto grid = [&](std::size_t count) {
    Positions all(count);
    for (Vector3d& p : all)
      for (int k = 0; k < 3; ++k) p[k] = static_cast<double>(random() % 4);
    return all;
  };
  std::size_t passages = 0;
  for (int i = 0; i < casesOf(12, 3); ++i) {
    TestGeometry a = testGeometry(soup(random, 12, 1)), b = testGeometry(soup(random, 12, 1));
    a.positions = grid(a.positions.size());
    b.positions = grid(b.positions.size());
    passages += expectCrossings({a, b, grid(a.positions.size()), grid(b.positions.size())}, 0.0);
    passages += expectCrossings({a, a, grid(a.positions.size()), {}}, 0.0);
  }
  EXPECT_GE(passages, leastOf(1000, 200));
}

TEST(Crossings, NeedContinuousWithContacts) {
  OctreeBasedCD collisions;
  const Mesh cube = testing::cube(0, 1);
  const GeometryId a = addMesh(collisions, cube), b = addMesh(collisions, cube),
                   ball = collisions.addAnalyticalGeometry(Sphere{{0, 0, 0}, 1});
  const auto refuse = [&](GeometryId second, const PairSettings& settings) {
    testing::expectRefused(
        ErrorCode::UnsupportedMethod, "pair (0, ",
        [&] { collisions.addCollisionPair(a, second, settings); }, a);
  };
  for (const Method method : {Method::Auto, Method::Proximity, Method::Intersection})
    refuse(b, {.method = method, .thickness = 0.1, .reportCrossings = true});
  refuse(ball, {.method = Method::Continuous, .reportCrossings = true});
  refuse(b, {.method = Method::Continuous,
             .reportCrossings = true,
             .continuous = {.earliestTimeOnly = true}});
  // They go with the setting.
  collisions.addCollisionPair(a, b, {.method = Method::Continuous, .reportCrossings = true});
  Positions moved = cube.positions;
  for (Vector3d& p : moved) p += Vector3d(3, 0.2, 0.1);
  collisions.setPositions(b, moved);
  collisions.advance();
  for (Vector3d& p : moved) p -= Vector3d(6, 0, 0);
  collisions.setPositions(b, moved);
  collisions.detectCollision();
  EXPECT_FALSE(collisions.collisionData(a, b).crossings().empty());
  collisions.setPairSettings(a, b, {.method = Method::Continuous});
  collisions.detectCollision();
  EXPECT_TRUE(collisions.collisionData(a, b).crossings().empty());
}

}  // namespace
}  // namespace palpate
