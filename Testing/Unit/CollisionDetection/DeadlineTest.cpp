// detectCollision() with a budget, and cancelDetection().
#include <palpate/Capture.h>

#include "CollisionDetection/OctreeBasedCDImplementation.h"

#include "Common/Answers.h"
#include "Common/SupportedMethods.h"
#include "Common/TemporaryFolder.h"

#include <atomic>
#include <future>
#include <thread>

namespace palpate::testing {
namespace {

using std::chrono::microseconds;

/// An explicit instantiation may name private members: tests reach the clock so.
template <auto member>
struct Reached {
  friend auto& implementationOf(OctreeBasedCD& collisions) { return *(collisions.*member); }
};
auto& implementationOf(OctreeBasedCD&);
template struct Reached<&OctreeBasedCD::m_implementation>;

/// A clock on which each look takes a microsecond: a budget of n allows n looks.
class LooksClock {
 public:
  explicit LooksClock(OctreeBasedCD& collisions) {
    implementationOf(collisions).timed.clock = [this] {
      return Deadline::Time(microseconds(m_looks.fetch_add(1) + 1));
    };
  }
  std::int64_t looks() const { return m_looks; }

 private:
  std::atomic<std::int64_t> m_looks{0};
};

std::vector<CollisionData> answersOf(const OctreeBasedCD& collisions) {
  std::vector<CollisionData> all;
  for (const CollisionPair& pair : collisions.pairs())
    all.push_back(collisions.collisionData(pair.a, pair.b));
  return all;
}

void expectSameAnswers(const OctreeBasedCD& found, const std::vector<CollisionData>& truth) {
  const std::vector<CollisionData> all = answersOf(found);
  ASSERT_EQ(all.size(), truth.size());
  for (std::size_t i = 0; i < all.size(); ++i) expectSame(all[i], truth[i], Knowledge::Same);
}

const UnfinishedPair* findUnfinished(const OctreeBasedCD& collisions, const CollisionPair& pair) {
  const auto& all = collisions.statistics().unfinishedPairs;
  const auto found = std::find_if(all.begin(), all.end(), [&](const UnfinishedPair& unfinished) {
    return unfinished.a == pair.a && unfinished.b == pair.b;
  });
  return found == all.end() ? nullptr : &*found;
}

/// Cubes in a row, each in touch with the next one.
struct Row {
  explicit Row(std::size_t count, const PairSettings& pair, const Settings& settings = {})
      : collisions(settings) {
    const Mesh cube = testing::cube(-0.5, 0.5);
    for (std::size_t i = 0; i < count; ++i) {
      meshes.push_back(cube);
      for (Vector3d& x : meshes.back().positions) x[0] += 1.015625 * static_cast<double>(i);
      ids.push_back(addMesh(collisions, meshes.back()));
      if (i > 0) collisions.addCollisionPair(ids[i - 1], ids[i], pair);
    }
  }
  /// Moves a mesh, so that its pairs are outdated.
  void move(std::size_t i, const Vector3d& shift) {
    for (Vector3d& x : meshes[i].positions) x += shift;
    collisions.setPositions(ids[i], meshes[i].positions);
  }
  void moveAll(const Vector3d& shift) {
    for (std::size_t i = 0; i < meshes.size(); ++i) move(i, shift);
  }
  /// The pairs in the order in which they are finished with ever larger budgets.
  std::vector<GeometryId> order() {
    LooksClock clock(collisions);
    std::vector<GeometryId> finished;
    for (std::int64_t budget = 0; finished.size() < collisions.pairs().size(); ++budget) {
      collisions.detectCollision();
      collisions.advance();
      moveAll({0, 1e-3, 0});
      collisions.detectCollision(microseconds(budget));
      for (const CollisionPair& pair : collisions.pairs())
        if (!findUnfinished(collisions, pair) &&
            std::find(finished.begin(), finished.end(), pair.a) == finished.end())
          finished.push_back(pair.a);
      EXPECT_LT(budget, 10'000);
      if (budget == 10'000) break;
    }
    return finished;
  }

  OctreeBasedCD collisions;
  std::vector<Mesh> meshes;
  std::vector<GeometryId> ids;
};

const PairSettings kTouching{.method = Method::Proximity, .thickness = 0.02};

/// Expects of each pair the complete answer, or the one before and the marks of an answer that was
/// kept. Returns how many were not finished.
std::size_t expectAnswers(OctreeBasedCD& found, const std::vector<CollisionData>& before,
                          const std::vector<CollisionData>& complete, bool newStep) {
  const auto pairs = found.pairs();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    SCOPED_TRACE("pair " + std::to_string(i));
    const CollisionData& now = found.collisionData(pairs[i].a, pairs[i].b);
    const UnfinishedPair* const unfinished = findUnfinished(found, pairs[i]);
    if (!unfinished) {
      expectSame(now, complete[i], Knowledge::Same);
      continue;
    }
    EXPECT_EQ(now.hash(), before[i].hash());
    EXPECT_FALSE(now.validity().trusted);
    EXPECT_TRUE(now.validity().sideMayBeWrong);
    EXPECT_EQ(now.validity().reason, MethodReason::OutOfTime);
    EXPECT_EQ(now.validity().age, before[i].validity().age + 1);
    EXPECT_EQ(unfinished->age, now.validity().age);
    EXPECT_EQ(now.validity().atEnd, before[i].validity().atEnd);
    EXPECT_TRUE(now.crossings().empty());
    std::vector<TrackedContact> tracked = allTracked(before[i]);
    if (newStep)
      for (TrackedContact& contact : tracked) contact.predecessor.reset();
    EXPECT_EQ(allTracked(now), tracked);
    EXPECT_TRUE(newStep ? now.ended().empty() : std::ranges::equal(now.ended(), before[i].ended()));
  }
  return found.statistics().unfinishedPairs.size();
}

class DeadlineWith : public ::testing::TestWithParam<Settings> {};

/// A detection may end at each look at the clock. Afterwards a complete one continues as if that
/// had not been. Random histories (Common/History.h) end detections so with all features.
TEST_P(DeadlineWith, EveryPlaceOfStopping) {
  const PairSettings pair{.method = Method::Continuous,
                          .thickness = 0.02,
                          .freeMotionReach = 0.1,
                          .trackContacts = true,
                          .reportCrossings = true};
  Row row(12, pair, GetParam()), reference(12, pair, GetParam());
  OctreeBasedCD &found = row.collisions, &truth = reference.collisions;
  LooksClock clock(found);
  const auto expectComplete = [&] {
    expectSameAnswers(found, answersOf(truth));
    EXPECT_TRUE(found.auditFailures().empty());
    EXPECT_TRUE(found.statistics().unfinishedPairs.empty());
  };
  const auto expectFreeMotions = [&] {
    const FrameStatistics& statistics = found.statistics();
    const bool isComplete = statistics.unfinishedPairs.empty() && !statistics.freeMotionUnfinished;
    for (const GeometryId id : row.ids) {
      const auto now = found.freeMotion(id), exact = truth.freeMotion(id);
      ASSERT_EQ(now.size(), exact.size());
      for (std::size_t v = 0; v < now.size(); ++v)
        EXPECT_TRUE(isComplete ? now[v] == exact[v] : now[v] <= exact[v] * (1 + 1e-12)) << v;
    }
  };
  for (OctreeBasedCD* each : {&found, &truth}) each->detectCollision();
  expectComplete();
  EXPECT_GT(truth.statistics().contacts, 50u);
  bool isComplete = false;
  std::size_t stops = 0, seenPartly = 0;
  const std::size_t share = shareOfCases(3);
  for (std::int64_t budget = 0; !isComplete; budget += static_cast<std::int64_t>(share)) {
    SCOPED_TRACE("budget " + std::to_string(budget));
    const bool rests = stops % 3 == 2;
    for (Row* each : {&row, &reference}) {
      each->collisions.advance();
      if (!rests) each->moveAll({0, stops % 3 == 0 ? 1e-3 : -1e-3, 0});
    }
    const std::vector<CollisionData> before = answersOf(found);
    truth.detectCollision();
    isComplete = found.detectCollision(microseconds(budget));
    const std::size_t unfinished = expectAnswers(found, before, answersOf(truth), true);
    EXPECT_EQ(isComplete, unfinished == 0 && !found.statistics().freeMotionUnfinished);
    isComplete = isComplete && !rests;
    EXPECT_TRUE(found.auditFailures().empty());
    expectFreeMotions();
    seenPartly += unfinished > 0 && unfinished < found.pairs().size();
    ++stops;
    if (budget % 5 == 0) {  // twice out of time in a step
      const std::vector<CollisionData> kept = answersOf(found);
      found.detectCollision(microseconds(budget / 2));
      expectAnswers(found, kept, answersOf(truth), false);
    }
    found.detectCollision();
    expectComplete();
    expectFreeMotions();
    if (HasFailure()) return;
  }
  EXPECT_GT(stops * share, 40u);
  EXPECT_GT(seenPartly, 10u / share);
}

INSTANTIATE_TEST_SUITE_P(Engines, DeadlineWith,
                         ::testing::Values(Settings{.threads = 1, .audit = {.features = 5}},
                                           settingsOf(Engine::Octree, 3),
                                           settingsOf(Engine::BruteForce, 1)),
                         [](const auto& settings) {
                           return toString(settings.param.engine) +
                                  std::to_string(settings.param.threads);
                         });

TEST(Deadline, PrioritiesDecideTheOrder) {
  Row row(5, kTouching, {.threads = 1});
  for (std::size_t i = 0; i < 4; ++i) {
    PairSettings pair = kTouching;
    pair.priority = i == 2   ? std::numeric_limits<int>::max()
                    : i == 0 ? std::numeric_limits<int>::min()
                             : static_cast<int>(i);
    row.collisions.setPairSettings(row.ids[i], row.ids[i + 1], pair);
  }
  EXPECT_EQ(row.order(), (std::vector{row.ids[2], row.ids[3], row.ids[1], row.ids[0]}));
}

/// Without priorities: contacts, then near boxes.
TEST(Deadline, ContactsAndNearPairsComeFirst) {
  Row row(5, kTouching, {.threads = 1});
  row.move(4, {0.5, 0, 0});  // further from 3
  row.move(0, {-0.2, 0, 0});
  std::vector<GeometryId> order = row.order();
  std::sort(order.begin(), order.begin() + 2);  // they are as near
  EXPECT_EQ(order, (std::vector{row.ids[1], row.ids[2], row.ids[0], row.ids[3]}));
}

/// Pairs of the highest priority are finished in every detection, whichever they are and however
/// long others wait. The others go on in turn.
TEST(Deadline, TheHighestPriorityIsServedInEveryFrame) {
  constexpr std::size_t kPairs = 12;
  for (std::size_t chosen = 0; chosen < 2 * kPairs; ++chosen) {
    SCOPED_TRACE(chosen);
    Row row(kPairs + 1, kTouching, {.threads = chosen % 3 == 0 ? 3 : 1});
    const std::size_t first = chosen % kPairs,
                      second = chosen < kPairs ? first : (first + 5) % kPairs;  // two of them
    for (const std::size_t i : {first, second}) {
      PairSettings pair = kTouching;
      pair.priority = 7;
      row.collisions.setPairSettings(row.ids[i], row.ids[i + 1], pair);
    }
    row.collisions.detectCollision();
    LooksClock clock(row.collisions);
    row.moveAll({0, 1e-3, 0});
    row.collisions.detectCollision(microseconds::max());
    const std::int64_t budget = clock.looks() / 2;
    std::size_t unfinished = 0;
    for (int frame = 0; frame < 40; ++frame) {
      row.collisions.advance();
      row.moveAll({0, frame % 2 == 0 ? 1e-3 : -1e-3, 0});
      row.collisions.detectCollision(microseconds(budget));
      for (std::size_t i = 0; i < kPairs; ++i) {
        const UnfinishedPair* const found =
            findUnfinished(row.collisions, row.collisions.pairs()[i]);
        unfinished += found != nullptr;
        if (!found) continue;
        EXPECT_TRUE(i != first && i != second) << frame;
        EXPECT_LT(found->age, 12u) << frame;
      }
    }
    EXPECT_GT(unfinished, 40u);
  }
}

/// A pair for which a whole budget is not enough says so, whatever the priorities. It does not keep
/// the others from being finished, and with a budget that is large enough it is.
TEST(Deadline, APairThatExceedsTheBudgetSaysSo) {
  enum class First { None, ASmallPair, TheLargePair };
  for (const First first : {First::None, First::ASmallPair, First::TheLargePair}) {
    SCOPED_TRACE(static_cast<int>(first));
    Row row(4, kTouching, {.threads = 1});
    const Mesh large = sphere(40, 60, {0, 0, 0}, 5.0);
    const GeometryId a = addMesh(row.collisions, large), b = addMesh(row.collisions, large);
    PairSettings urgent = kTouching;
    urgent.priority = 1;
    row.collisions.addCollisionPair(a, b, first == First::TheLargePair ? urgent : kTouching);
    if (first == First::ASmallPair) row.collisions.setPairSettings(row.ids[0], row.ids[1], urgent);
    row.collisions.detectCollision();
    LooksClock clock(row.collisions);
    std::size_t said = 0;
    for (int i = 0; i < 12; ++i) {
      row.moveAll({0, 1e-3, 0});
      auto positions = large.positions;
      for (Vector3d& x : positions) x[2] += 1e-4 * (i + 1);
      row.collisions.setPositions(a, positions);
      row.collisions.detectCollision(microseconds(60));
      for (std::size_t p = 0; p < 3; ++p) {
        const UnfinishedPair* const small =
            findUnfinished(row.collisions, row.collisions.pairs()[p]);
        EXPECT_FALSE(small && small->exceedsBudget);
        EXPECT_FALSE(small && small->age > 2);
      }
      const UnfinishedPair* const found = findUnfinished(row.collisions, row.collisions.pairs()[3]);
      ASSERT_TRUE(found);
      said += found->exceedsBudget;
      row.collisions.advance();
    }
    EXPECT_GE(said, 5u);
    EXPECT_LT(said, 12u);
    row.moveAll({0, 1e-3, 0});
    EXPECT_TRUE(row.collisions.detectCollision(microseconds(1'000'000)));
  }
}

/// The least distance of two bodies at a time of their step, of which the first is shifted;
/// infinite beyond the reach. A contact's distance is less radii.
double leastDistanceAt(double time, const StepBody& a, const Vector3d& shift, const StepBody& b,
                       double reach) {
  OctreeBasedCD probe({.threads = 1});
  const std::array ids{a.add(probe), b.add(probe)};
  probe.addCollisionPair(
      ids[0], ids[1], {.method = Method::Proximity, .thickness = reach, .contacts = Contacts::All});
  for (const std::size_t i : {0, 1}) {
    const StepBody& body = i == 0 ? a : b;
    if (body.before.empty()) {  // a shape, whose step begins at the origin
      body.move(probe, ids[i]);
      Pose pose = probe.transform(ids[i]);
      pose.translation *= time;
      probe.setTransform(ids[i], pose);
      continue;
    }
    Positions between = body.before;
    for (std::size_t v = 0; v < between.size(); ++v)
      between[v] = (1.0 - time) * between[v] + time * body.now[v] + (i == 0) * shift;
    probe.setPositions(ids[i], between);
  }
  probe.detectCollision();
  const CollisionData& data = probe.collisionData(ids[0], ids[1]);
  double least = leastDistance(data);
  for (const ShapeContact& c : data.shape()) least = std::min(least, c.distance);
  for (const ShapeShapeContact& c : data.shapeShape()) least = std::min(least, c.distance);
  return least;
}

/// The bound of every pair at once: nothing nearer is found at five times of the step.
TEST(Deadline, DistanceBoundsHold) {
  Random random(3);
  std::vector<StepBody> bodies = bodiesOfEveryType(random, 0.3);
  std::size_t positive = 0, pairs = 0, nearest = 0;
  const auto expectBound = [&](const StepBody& a, const Vector3d& shift, const StepBody& b,
                               Method method) {
    SCOPED_TRACE(a.name + " with " + b.name + " by " + toString(method));
    const bool self = &a == &b;
    OctreeBasedCD collisions({.threads = 1});
    const GeometryId first = a.add(collisions), second = self ? first : b.add(collisions);
    collisions.addCollisionPair(first, second, {.method = method, .thickness = 0.01});
    a.move(collisions, first);
    if (!self) b.move(collisions, second);
    if (shift != Vector3d::Zero()) {
      Positions before = a.before, now = a.now;
      for (Positions* all : {&before, &now})
        for (Vector3d& x : *all) x += shift;
      collisions.setPositions(first, before, now);
    }
    EXPECT_FALSE(collisions.detectCollision(microseconds(0)));
    const double bound = collisions.statistics().unfinishedPairs.at(0).distanceBound;
    EXPECT_GE(bound, 0.0);
    ++pairs, positive += bound > 0.0;
    if (self) {
      EXPECT_EQ(bound, 0.0);
      return;
    }
    for (const double time : {1.0, 0.0, 0.25, 0.5, 0.75}) {
      if (method == Method::Proximity && time < 1.0) break;  // it answers for the end
      const double least = leastDistanceAt(time, a, shift, b, 1.2 * bound + 0.05);
      nearest += std::isfinite(least);
      EXPECT_GE(std::max(0.0, least), bound);
    }
  };
  for (std::size_t i = 0; i < bodies.size(); ++i)
    for (std::size_t j = i; j < bodies.size(); ++j)
      for (const double away : {0.0, 0.9, 2.0})
        for (const Method method : {Method::Proximity, Method::Continuous, Method::Auto}) {
          const StepBody &a = bodies[i], &b = bodies[j];
          if (away > 0.0 && (i == j || a.before.empty() || a.name.starts_with("placed"))) continue;
          const SupportedPairs* const row = supportOf(method, a.type, b.type, i == j);
          if (row && answers(*row, a, b)) expectBound(a, away * Vector3d(0.6, 0.5, 0.7), b, method);
        }
  EXPECT_GT(positive, pairs / 4);
  EXPECT_GT(nearest, pairs / 4);
}

/// After a change of topology there is no answer to keep. Contacts that the new topology still has
/// have not begun anew.
TEST(Deadline, ChangedTopology) {
  PairSettings pair = kTouching;
  pair.trackContacts = true;
  Row row(2, pair, {.threads = 1}), reference(2, pair, {.threads = 1});
  const auto dataOf = [](Row& r) -> const CollisionData& {
    return r.collisions.collisionData(r.ids[0], r.ids[1]);
  };
  for (Row* each : {&row, &reference}) {
    each->collisions.detectCollision();
    each->collisions.advance();
    auto triangles = each->meshes[1].triangles;
    std::rotate(triangles.begin(), triangles.end() - 1, triangles.end());
    triangles.pop_back();
    each->collisions.setTriangles(each->ids[1], each->meshes[1].positions, triangles);
  }
  EXPECT_GT(Rows(dataOf(row)).contacts(), 0u);
  for (int i = 0; i < 2; ++i) {
    EXPECT_FALSE(row.collisions.detectCollision(microseconds(0)));
    EXPECT_EQ(Rows(dataOf(row)).contacts(), 0u);
    EXPECT_TRUE(dataOf(row).trackedVertexTriangle().empty());
    EXPECT_FALSE(dataOf(row).validity().trusted);
    EXPECT_EQ(dataOf(row).validity().reason, MethodReason::OutOfTime);
    if (i == 0) {
      row.collisions.advance();
      reference.collisions.advance();
    }
  }
  for (Row* each : {&row, &reference}) each->collisions.detectCollision();
  expectSame(dataOf(row), dataOf(reference), Knowledge::Same);
  EXPECT_GT(dataOf(row).trackedVertexTriangle().size() + dataOf(row).trackedEdgeEdge().size(), 0u);
  EXPECT_EQ(dataOf(row).validity().age, 0u);
}

/// Loops over all vertices of a body look at the clock as well.
TEST(Deadline, LargeBodiesThatOverlap) {
  const Mesh large = sphere(100, 150, {0, 0, 0}, 1.0);
  OctreeBasedCD collisions({.threads = 1});
  const GeometryId a = addMesh(collisions, large),
                   b = addMesh(collisions, sphere(6, 8, {0.4, 0.1, 0.2}, 0.1));
  collisions.addCollisionPair(a, b, {.method = Method::Auto, .thickness = 0.02});
  collisions.detectCollision();
  const PairRecord& record = *implementationOf(collisions).pairs.records()[0];
  std::size_t looks = 0;
  const Deadline::Clock clock = [&] { return ++looks, Deadline::Time(); };
  const std::atomic<bool> isCancelled = false;
  const Deadline deadline(Deadline::Time::max(), isCancelled, clock);
  PenetrationScratch scratch;
  const StopScope scope(&deadline);
  const BodyPair pair(record.a->body, record.b->body, Engine::Octree, scratch.pair, kQuick.moved);
  const std::size_t vertices = large.positions.size(), loops = vertices / 1024;
  EXPECT_GE(looks, (vertices + large.triangles.size()) / 512);
  looks = 0;
  const Vector3d direction(0, 0, 1);
  pair.vertices(true).furthest(direction);
  EXPECT_EQ(looks, loops);
}

/// Queries, snapshots, candidates and captures see the positions now, whatever pairs were not
/// finished.
TEST(Deadline, WhatElseReadsTheFrame) {
  const PairSettings pair{.method = Method::Continuous, .thickness = 0.02, .priority = -7};
  Row row(3, pair, {.threads = 1}), reference(3, pair, {.threads = 1});
  LooksClock clock(row.collisions);
  for (Row* each : {&row, &reference}) {
    each->collisions.detectCollision();
    each->collisions.advance();
    each->move(1, {0.3, 0.1, 0.0});
  }
  EXPECT_FALSE(row.collisions.detectCollision(microseconds(2)));
  reference.collisions.detectCollision();
  const auto distanceIn = [](Row& r) {
    r.collisions.publish();
    return r.collisions.latestSnapshot()->queries().distance(r.ids[0], r.ids[1]).distance;
  };
  EXPECT_EQ(distanceIn(row), distanceIn(reference));
  EXPECT_EQ(row.collisions.octree().validate(), std::vector<std::string>{});
  EXPECT_EQ(row.collisions.candidatePairs(row.ids[0], row.ids[1]),
            reference.collisions.candidatePairs(row.ids[0], row.ids[1]));

  const TemporaryFolder folder;
  const auto file = folder.path / "unfinished.capture";
  writeCapture(row.collisions.problem(), file);
  const CollisionProblem problem = readCapture(file);
  EXPECT_EQ(problem.pairs[0].settings.priority, -7);
  OctreeBasedCD replay = setUp(problem);
  replay.detectCollision();
  EXPECT_EQ(answersOf(replay)[0].hash(), answersOf(reference.collisions)[0].hash());
}

/// cancelDetection() from another thread, while the detection waits for it in a predicate.
TEST(Deadline, AnotherThreadCancels) {
  for (const int threads : {1, 3}) {
    Row row(6, kTouching, {.threads = threads});
    row.collisions.cancelDetection();  // nothing runs
    EXPECT_TRUE(row.collisions.detectCollision(microseconds::max()));
    row.moveAll({0, 1e-3, 0});
    std::atomic<bool> isCancelled = false;
    row.collisions.setContactPredicate(row.ids[2], row.ids[3], [&](const ContactFeatures&) {
      if (!isCancelled.exchange(true))
        std::async(std::launch::async, [&] { row.collisions.cancelDetection(); }).get();
      return true;
    });
    EXPECT_FALSE(row.collisions.detectCollision(microseconds::max()));
    EXPECT_TRUE(isCancelled);
    EXPECT_TRUE(findUnfinished(row.collisions, row.collisions.pairs()[2]));
    EXPECT_LE(row.collisions.statistics().unfinishedPairs.size(), 5u);
    // The next one is not cancelled, nor is one without a budget.
    isCancelled = false;
    row.moveAll({0, 1e-3, 0});
    row.collisions.detectCollision();
    EXPECT_TRUE(isCancelled);
    EXPECT_TRUE(row.collisions.statistics().unfinishedPairs.empty());
    EXPECT_TRUE(row.collisions.detectCollision(microseconds::max()));
  }
}

/// A predicate may use other objects, whose work no budget of its own detection ends.
TEST(Deadline, PredicatesUseOtherObjects) {
  const Mesh large = sphere(30, 40, {0, 0, 0}, 1.0), small = sphere(16, 20, {0.7, 0.1, 0.2}, 0.4);
  const auto begin = [&](OctreeBasedCD& other) {
    const std::array ids{addMesh(other, large), addMesh(other, small)};
    other.addCollisionPair(ids[0], ids[1], {.method = Method::Auto, .thickness = 0.02});
    return ids;
  };
  for (const int threads : {1, 3}) {
    OctreeBasedCD truth({.threads = 1});
    const auto exact = begin(truth);
    truth.detectCollision();
    const double depth = truth.queries().penetration(exact[0], exact[1]).depth;
    Row row(4, kTouching, {.threads = threads});
    row.collisions.detectCollision();
    row.moveAll({0, 1e-3, 0});
    std::atomic<bool> isCancelled = false, hasEnded = false;
    row.collisions.setContactPredicate(row.ids[0], row.ids[1], [&](const ContactFeatures&) {
      if (isCancelled.exchange(true)) return true;
      row.collisions.cancelDetection();
      OctreeBasedCD other({.threads = threads});
      const auto ids = begin(other);
      other.detectCollision();
      expectSameAnswers(other, answersOf(truth));
      EXPECT_GT(other.statistics().contacts, 10u);
      EXPECT_EQ(other.queries().penetration(ids[0], ids[1]).depth, depth);
      hasEnded = true;
      return true;
    });
    EXPECT_FALSE(row.collisions.detectCollision(microseconds::max()));
    EXPECT_TRUE(hasEnded);
    EXPECT_GT(row.collisions.statistics().unfinishedPairs.size(), 0u);
  }
}

/// Errors of a predicate end a detection with a budget as any other.
TEST(Deadline, ErrorsOfPredicates) {
  Row row(3, kTouching, {.threads = 1});
  row.collisions.setContactPredicate(row.ids[0], row.ids[1],
                                     [](const ContactFeatures&) -> bool { throw 7; });
  EXPECT_THROW(row.collisions.detectCollision(microseconds::max()), int);
  row.collisions.setContactPredicate(row.ids[0], row.ids[1], {});
  EXPECT_TRUE(row.collisions.detectCollision(microseconds::max()));
  OctreeBasedCD moved = std::move(row.collisions);
  EXPECT_THROW(row.collisions.detectCollision(microseconds(1)), Error);
  EXPECT_THROW(row.collisions.cancelDetection(), Error);
}

}  // namespace
}  // namespace palpate::testing
