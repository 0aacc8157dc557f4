// detectCollision() with a budget, and cancelDetection().
#include <palpate/Capture.h>
#include <palpate/Error.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/StepGuard.h>

#include "CollisionDetection/OctreeBasedCDImplementation.h"

#include "Common/Sanitized.h"
#include "Common/StepBodies.h"
#include "Common/SupportedMethods.h"
#include "Common/TemporaryFolder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <future>
#include <limits>
#include <string>
#include <thread>
#include <vector>

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
    implementationOf(collisions).clock = [this] {
      return Deadline::Time(microseconds(m_looks.fetch_add(1) + 1));
    };
  }
  std::int64_t looks() const { return m_looks; }

 private:
  std::atomic<std::int64_t> m_looks{0};
};

struct Answer {
  std::uint64_t hash = 0;
  Validity validity{};
  std::vector<TrackedContact> tracked{}, ended{};
  std::vector<Crossing> crossings{};
  friend bool operator==(const Answer&, const Answer&) = default;
};

Answer answerOf(const CollisionData& data) {
  Answer answer{data.hash(), data.validity()};
  for (const auto list : {data.trackedVertexTriangle(), data.trackedTriangleVertex(),
                          data.trackedEdgeEdge(), data.trackedShape(), data.trackedShapeShape()})
    answer.tracked.insert(answer.tracked.end(), list.begin(), list.end());
  answer.ended.assign(data.ended().begin(), data.ended().end());
  answer.crossings.assign(data.crossings().begin(), data.crossings().end());
  return answer;
}

std::vector<Answer> answersOf(const OctreeBasedCD& collisions) {
  std::vector<Answer> all;
  for (const CollisionPair& pair : collisions.pairs())
    all.push_back(answerOf(collisions.collisionData(pair.a, pair.b)));
  return all;
}

std::size_t contactsOf(const OctreeBasedCD& collisions) {
  return collisions.statistics().contacts + collisions.statistics().intersectingTriangles;
}

const UnfinishedPair* findUnfinished(const OctreeBasedCD& collisions, const CollisionPair& pair) {
  const auto& all = collisions.statistics().unfinishedPairs;
  const auto found = std::find_if(all.begin(), all.end(), [&](const UnfinishedPair& unfinished) {
    return unfinished.a == pair.a && unfinished.b == pair.b;
  });
  return found == all.end() ? nullptr : &*found;
}

/// Bodies of every type, with pairs by every row of kSupport.
class World {
 public:
  explicit World(const Settings& settings) : m_collisions(settings) {
    Random random(17);
    m_bodies = bodiesOfEveryType(random, kMotion);
    for (StepBody& body : bodiesWithField(Vector3d::Constant(-kMotion)))
      m_bodies.push_back(std::move(body));
    for (const StepBody& body : m_bodies) m_ids.push_back(body.add(m_collisions));
    std::size_t number = 0;
    for (const SupportedPairs& row : kSupport) {
      std::size_t left = row.kind == PairKind::Proxy ? 1 : 2;
      for (std::size_t i = 0; i < m_bodies.size(); ++i)
        for (std::size_t j = 0; j < m_bodies.size() && left > 0; ++j)
          if ((7 * i + 3 * j + number) % 3 == 0 && answers(row, m_bodies[i], m_bodies[j]) &&
              (row.kind != PairKind::Proxy || m_bodies[j].name.starts_with("placed")) &&
              add(i, j, row, number))
            --left, ++number;
    }
  }

  /// Steps there, back, and at rest.
  void step(std::size_t number) {
    if (number > 0) m_collisions.advance();
    for (std::size_t i = 0; i < m_bodies.size(); ++i) {
      const StepBody& body = m_bodies[i];
      if (number % 3 == 0)
        body.move(m_collisions, m_ids[i]);
      else if (number % 3 == 1 && !body.now.empty() && !body.name.starts_with("placed"))
        m_collisions.setPositions(m_ids[i], body.now, body.before);
    }
  }

  OctreeBasedCD& collisions() { return m_collisions; }
  const std::vector<StepBody>& bodies() const { return m_bodies; }
  const std::vector<GeometryId>& ids() const { return m_ids; }

 private:
  static constexpr double kMotion = 0.05;

  /// Whether the two had no pair before.
  bool add(std::size_t i, std::size_t j, const SupportedPairs& row, std::size_t number) {
    PairSettings pair = caseOf(row, number);
    pair.trackContacts = !pair.continuous.earliestTimeOnly;
    pair.reportCrossings = row.method == Method::Continuous && row.kind == PairKind::Meshes &&
                           !pair.continuous.earliestTimeOnly;
    if (number % 4 == 1 && row.kind != PairKind::Proxy && row.kind != PairKind::Field &&
        m_bodies[i].type != GeometryType::Field && m_bodies[j].type != GeometryType::Field)
      pair.freeMotionReach = 0.1;
    try {
      m_collisions.addCollisionPair(m_ids[i], m_ids[j], pair);
      return true;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::DuplicatePair) << error.what();
      return false;
    }
  }

  OctreeBasedCD m_collisions;
  std::vector<StepBody> m_bodies;
  std::vector<GeometryId> m_ids;
};

/// Expects of each pair the complete answer, or the one before and the marks of an answer that was
/// kept. Returns how many were not finished.
std::size_t expectAnswers(OctreeBasedCD& found, const std::vector<Answer>& before,
                          const std::vector<Answer>& complete, bool newStep) {
  const auto pairs = found.pairs();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    SCOPED_TRACE("pair " + std::to_string(i));
    const Answer now = answerOf(found.collisionData(pairs[i].a, pairs[i].b));
    const UnfinishedPair* const unfinished = findUnfinished(found, pairs[i]);
    if (!unfinished) {
      EXPECT_EQ(now, complete[i]);
      continue;
    }
    EXPECT_EQ(now.hash, before[i].hash);
    EXPECT_FALSE(now.validity.trusted);
    EXPECT_TRUE(now.validity.sideMayBeWrong);
    EXPECT_EQ(now.validity.reason, MethodReason::OutOfTime);
    EXPECT_EQ(now.validity.age, before[i].validity.age + 1);
    EXPECT_EQ(unfinished->age, now.validity.age);
    EXPECT_EQ(now.validity.atEnd, before[i].validity.atEnd);
    EXPECT_TRUE(now.crossings.empty());
    std::vector<TrackedContact> tracked = before[i].tracked;
    if (newStep)
      for (TrackedContact& contact : tracked) contact.predecessor.reset();
    EXPECT_EQ(now.tracked, tracked);
    EXPECT_EQ(now.ended, newStep ? std::vector<TrackedContact>() : before[i].ended);
  }
  return found.statistics().unfinishedPairs.size();
}

void expectFreeMotions(const World& world, OctreeBasedCD& found, OctreeBasedCD& complete) {
  const FrameStatistics& statistics = found.statistics();
  const bool isComplete = statistics.unfinishedPairs.empty() && !statistics.freeMotionUnfinished;
  for (const GeometryId id : world.ids()) {
    const auto now = found.freeMotion(id), exact = complete.freeMotion(id);
    ASSERT_EQ(now.size(), exact.size());
    for (std::size_t v = 0; v < now.size(); ++v) {
      EXPECT_LE(now[v], exact[v] * (1 + 1e-12));
      if (isComplete) {
        EXPECT_EQ(now[v], exact[v]);
      }
    }
  }
}

class DeadlineWith : public ::testing::TestWithParam<Settings> {};

/// A detection may end at each look at the clock. Afterwards a complete one continues as if that
/// had not been.
TEST_P(DeadlineWith, EveryPlaceOfStopping) {
  Settings settings = GetParam();
  World world(settings), reference(settings);
  settings.audit.features = 0;
  OctreeBasedCD &found = world.collisions(), &truth = reference.collisions();
  LooksClock clock(found);
  const auto step = [&](std::size_t number) { world.step(number), reference.step(number); };
  const auto expectEqual = [&] {
    EXPECT_EQ(answersOf(found), answersOf(truth));
    EXPECT_TRUE(found.auditFailures().empty());
    EXPECT_TRUE(found.statistics().unfinishedPairs.empty());
  };
  step(0);
  found.detectCollision();
  truth.detectCollision();
  expectEqual();
  EXPECT_GT(contactsOf(truth), 100u);
  bool isComplete = false;
  std::size_t stops = 0, seenPartly = 0;
  std::size_t number = 1;
  const std::size_t share = shareOfCases(3);
  for (std::int64_t budget = 0; !isComplete; budget += static_cast<std::int64_t>(share)) {
    SCOPED_TRACE("budget " + std::to_string(budget));
    step(number++);
    const std::vector<Answer> before = answersOf(found);
    truth.detectCollision();
    isComplete = found.detectCollision(microseconds(budget));
    const std::size_t unfinished = expectAnswers(found, before, answersOf(truth), true);
    EXPECT_EQ(isComplete, unfinished == 0 && !found.statistics().freeMotionUnfinished);
    EXPECT_TRUE(found.auditFailures().empty());
    expectFreeMotions(world, found, truth);
    seenPartly += unfinished > 0 && unfinished < found.pairs().size();
    ++stops;
    // Of the same step, twice out of time.
    if (budget % 5 == 0) {
      const std::vector<Answer> kept = answersOf(found);
      found.detectCollision(microseconds(budget / 2));
      expectAnswers(found, kept, answersOf(truth), false);
    }
    found.detectCollision();
    expectEqual();
    expectFreeMotions(world, found, truth);
    if (HasFailure()) return;
  }
  EXPECT_GT(stops * share, 40u);
  EXPECT_GT(seenPartly, 20u / share);
}

Settings withAudit(const Settings& settings) {
  Settings audited = settings;
  audited.audit.features = 5;
  return audited;
}

INSTANTIATE_TEST_SUITE_P(Engines, DeadlineWith,
                         ::testing::Values(withAudit(settingsOf(Engine::Octree, 1)),
                                           settingsOf(Engine::Octree, 3),
                                           settingsOf(Engine::BruteForce, 1)),
                         [](const auto& settings) {
                           return toString(settings.param.engine) +
                                  std::to_string(settings.param.threads);
                         });

/// Pairs that wait come first, so that none waits for ever. Contacts over time are those of the
/// detections that finished a pair.
TEST(Deadline, NoPairWaitsForEver) {
  World world(settingsOf(Engine::Octree));
  OctreeBasedCD& collisions = world.collisions();
  LooksClock clock(collisions);
  world.step(0);
  collisions.detectCollision(microseconds(1'000'000));
  const std::int64_t all = clock.looks();
  std::vector<std::uint32_t> ages(collisions.pairs().size()), oldest = ages;
  for (std::size_t number = 1; number < 40; ++number) {
    world.step(number);
    collisions.detectCollision(microseconds(all / 4));
    for (std::size_t i = 0; i < ages.size(); ++i) {
      const auto& [a, b, settings] = collisions.pairs()[i];
      const std::uint32_t age = collisions.collisionData(a, b).validity().age;
      EXPECT_TRUE(age == 0 || age == ages[i] + 1);
      oldest[i] = std::max(oldest[i], ages[i] = age);
    }
  }
  EXPECT_GT(*std::max_element(oldest.begin(), oldest.end()), 1u);
  EXPECT_LT(*std::max_element(oldest.begin(), oldest.end()), 16u);
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

/// A pair that takes more than the budget does not keep the others from being finished.
TEST(Deadline, APairThatIsTooLargeYields) {
  Row row(3, kTouching, {.threads = 1});
  const Mesh large = sphere(60, 90, {0, 0, 0}, 5.0);
  const GeometryId a = addMesh(row.collisions, large), b = addMesh(row.collisions, large);
  PairSettings first = kTouching;
  first.priority = 1;
  row.collisions.addCollisionPair(a, b, first);
  row.collisions.detectCollision();
  LooksClock clock(row.collisions);
  std::size_t finished = 0, tooLarge = 0;
  for (int i = 0; i < 6; ++i) {
    row.moveAll({0, 1e-3, 0});
    auto positions = large.positions;
    for (Vector3d& x : positions) x[2] += 1e-4 * (i + 1);
    row.collisions.setPositions(a, positions);
    row.collisions.detectCollision(microseconds(40));
    finished += !findUnfinished(row.collisions, row.collisions.pairs()[0]);
    tooLarge += findUnfinished(row.collisions, row.collisions.pairs()[2]) != nullptr;
  }
  EXPECT_EQ(tooLarge, 6u);
  EXPECT_EQ(finished, 3u);
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

/// A pair for which a whole budget is not enough says so, also behind one of the highest priority.
/// It does not keep the others from being finished, and with a budget that is large enough it is.
TEST(Deadline, APairThatExceedsTheBudgetSaysSo) {
  for (const bool isBehind : {false, true}) {
    Row row(4, kTouching, {.threads = 1});
    const Mesh large = sphere(60, 90, {0, 0, 0}, 5.0);
    const GeometryId a = addMesh(row.collisions, large), b = addMesh(row.collisions, large);
    row.collisions.addCollisionPair(a, b, kTouching);
    if (isBehind) {
      PairSettings pair = kTouching;
      pair.priority = 1;
      row.collisions.setPairSettings(row.ids[0], row.ids[1], pair);
    }
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

template <class F>
void forEachContact(const CollisionData& data, F&& f) {
  const auto each = [&](const auto& list) { std::for_each(list.begin(), list.end(), f); };
  each(data.vertexTriangle());
  each(data.triangleVertex());
  each(data.edgeEdge());
  each(data.shape());
  each(data.shapeShape());
}

/// The bound of every pair at once: nothing nearer is found at five times of the step.
TEST(Deadline, DistanceBoundsHold) {
  Random random(3);
  std::vector<StepBody> bodies = bodiesOfEveryType(random, 0.3);
  std::size_t positive = 0, pairs = 0, nearest = 0;
  for (std::size_t i = 0; i < bodies.size(); ++i)
    for (std::size_t j = i; j < bodies.size(); ++j) {
      const StepBody &a = bodies[i], &b = bodies[j];
      const bool moves = i != j && !b.name.starts_with("placed");
      for (const double away : {0.0, 0.9, 2.0}) {
        if (away > 0.0 && !moves) continue;
        for (const Method method : {Method::Proximity, Method::Continuous, Method::Auto}) {
          const SupportedPairs* const row = supportOf(method, a.type, b.type, i == j);
          if (!row || !answers(*row, a, b)) continue;
          SCOPED_TRACE(a.name + " with " + b.name + " by " + toString(method));
          OctreeBasedCD collisions({.threads = 1});
          const GeometryId first = a.add(collisions), second = i == j ? first : b.add(collisions);
          collisions.addCollisionPair(first, second, {.method = method, .thickness = 0.01});
          a.move(collisions, first);
          if (i != j) b.move(collisions, second);
          Positions before = b.before, now = b.now;
          const Vector3d shift = away * Vector3d(0.6, 0.5, 0.7);
          if (moves && before.empty()) {
            Pose end = collisions.transform(second);
            end.translation += shift;
            collisions.setTransform(second, {Eigen::Matrix3d::Identity(), shift}, end);
          } else if (moves) {
            for (Vector3d& x : before) x += shift;
            for (Vector3d& x : now) x += shift;
            collisions.setPositions(second, before, now);
          }
          EXPECT_FALSE(collisions.detectCollision(microseconds(0)));
          ASSERT_EQ(collisions.statistics().unfinishedPairs.size(), 1u);
          const double bound = collisions.statistics().unfinishedPairs[0].distanceBound;
          EXPECT_GE(bound, 0.0);
          ++pairs;
          positive += bound > 0.0;
          if (i == j) {
            EXPECT_EQ(bound, 0.0);
            continue;
          }
          // Proximity at the end, others at any time. A contact's distance is less radii.
          OctreeBasedCD probe({.threads = 1});
          const std::array ids{a.add(probe), b.add(probe)};
          probe.addCollisionPair(ids[0], ids[1],
                                 {.method = Method::Proximity,
                                  .thickness = 1.2 * bound + 0.05,
                                  .contacts = Contacts::All});
          for (const double time : {1.0, 0.0, 0.25, 0.5, 0.75}) {
            if (method == Method::Proximity && time < 1.0) break;
            const auto place = [&](const StepBody& body, GeometryId id, GeometryId moved,
                                   const Positions& from, const Positions& to) {
              if (body.before.empty()) {
                Pose pose = collisions.transform(moved);
                const Vector3d start = moved == second && moves ? shift : Vector3d::Zero();
                pose.translation = start + time * (pose.translation - start);
                return probe.setTransform(id, pose);
              }
              Positions between(from.size());
              for (std::size_t v = 0; v < from.size(); ++v)
                between[v] = (1.0 - time) * from[v] + time * to[v];
              probe.setPositions(id, between);
            };
            place(a, ids[0], first, a.before, a.now);
            place(b, ids[1], second, before, now);
            probe.detectCollision();
            const CollisionData& data = probe.collisionData(ids[0], ids[1]);
            nearest +=
                !data.shape().empty() || !data.shapeShape().empty() || Rows(data).contacts() > 0;
            forEachContact(data, [&](const auto& contact) {
              EXPECT_GE(std::max(0.0, contact.distance), bound);
            });
          }
        }
      }
    }
  EXPECT_GT(positive, pairs / 4);
  EXPECT_GT(nearest, pairs / 4);
}

/// A plane's half-space is bounded, too, unless it turns.
TEST(Deadline, DistanceBoundsOfPlanes) {
  Mesh cube = testing::cube(-0.5, 0.5);
  for (Vector3d& x : cube.positions) x[2] += 3.0;
  for (const bool twoSided : {false, true})
    for (const double lift : {0.0, 1.0, 5.0}) {
      OctreeBasedCD collisions({.threads = 1});
      const GeometryId mesh = addMesh(collisions, cube),
                       plane =
                           collisions.addAnalyticalGeometry(Plane{{0, 0, 0}, {0, 0, 1}, twoSided});
      collisions.addCollisionPair(mesh, plane, {.method = Method::Continuous, .thickness = 0.1});
      collisions.setTransform(plane, {}, {Eigen::Matrix3d::Identity(), {0, 0, lift}});
      collisions.detectCollision(microseconds(0));
      const double bound = collisions.statistics().unfinishedPairs.at(0).distanceBound;
      EXPECT_NEAR(bound, std::max(0.0, 2.5 - lift), 1e-12);
      EXPECT_LE(bound, std::max(0.0, 2.5 - lift));
    }
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
  LooksClock clock(row.collisions);
  EXPECT_FALSE(row.collisions.detectCollision(microseconds(-1)));
  EXPECT_EQ(Rows(dataOf(row)).contacts(), 0u);
  EXPECT_EQ(dataOf(row).validity().age, 1u);
  EXPECT_EQ(dataOf(row).validity().method, Method::Proximity);
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
  EXPECT_EQ(answerOf(dataOf(row)), answerOf(dataOf(reference)));
  EXPECT_GT(dataOf(row).trackedVertexTriangle().size() + dataOf(row).trackedEdgeEdge().size(), 0u);
  EXPECT_EQ(dataOf(row).validity().age, 0u);
}

/// The same for lists that are kept from one detection to the next.
TEST(Deadline, KeptCandidates) {
  const Mesh large = sphere(40, 60, {0, 0, 0}, 1.0);
  const PairSettings pair{.method = Method::Proximity, .thickness = 0.02};
  OctreeBasedCD found({.threads = 1}), truth({.threads = 1});
  std::vector<GeometryId> ids;
  for (OctreeBasedCD* each : {&found, &truth}) {
    ids = {addMesh(*each, large), addMesh(*each, large)};
    each->addCollisionPair(ids[0], ids[1], pair);
  }
  LooksClock clock(found);
  std::size_t stopped = 0, stoppedWhileKept = 0;
  std::int64_t most = 0;
  for (int i = 0; i < 200; ++i) {
    auto positions = large.positions;
    for (Vector3d& x : positions) x[0] += 2.005 + 2e-4 * std::sin(0.1 * i);
    const bool withBudget = i % 4 == 3;
    for (OctreeBasedCD* each : {&found, &truth}) each->setPositions(ids[1], positions);
    truth.detectCollision();
    if (withBudget) {
      const std::int64_t before = clock.looks();
      const bool isStopped = !found.detectCollision(microseconds(i / 8));
      stopped += isStopped;
      stoppedWhileKept +=
          isStopped && implementationOf(found).pairs.records()[0]->memory.kept.answers();
      most = std::max(most, clock.looks() - before);
    }
    found.detectCollision();
    ASSERT_EQ(found.collisionData(ids[0], ids[1]).hash(),
              truth.collisionData(ids[0], ids[1]).hash());
    ASSERT_EQ(found.statistics().candidatePairs > 0, truth.statistics().candidatePairs > 0);
    for (OctreeBasedCD* each : {&found, &truth}) each->advance();
  }
  EXPECT_GT(stopped, 10u);
  EXPECT_GT(stoppedWhileKept, 5u);
  EXPECT_GT(most, 10);
}

/// The same for bodies that are deep in each other, at a share of the looks.
TEST(Deadline, OverlappingBodies) {
  const Mesh large = sphere(16, 24, {0, 0, 0}, 1.0), small = sphere(10, 14, {0, 0, 0}, 0.4);
  OctreeBasedCD found({.threads = 1}), truth({.threads = 1});
  std::array<GeometryId, 2> ids{};
  for (OctreeBasedCD* each : {&found, &truth}) {
    ids = {addMesh(*each, large), addMesh(*each, small)};
    each->addCollisionPair(ids[0], ids[1], {.method = Method::Auto, .thickness = 0.02});
    each->detectCollision();
  }
  LooksClock clock(found);
  std::int64_t all = 0;
  std::size_t stops = 0, deep = 0;
  for (const double depth : {0.5, 0.95}) {  // within, and piercing
    bool isComplete = false;
    for (std::int64_t budget = 0, number = 0; !isComplete; ++number) {
      auto positions = small.positions;
      for (Vector3d& x : positions) x += Vector3d(depth, 0.1, 0.01 * std::sin(0.1 * number));
      for (OctreeBasedCD* each : {&found, &truth}) {
        each->advance();
        each->setPositions(ids[1], positions);
      }
      truth.detectCollision();
      const std::vector<Answer> before = answersOf(found), complete = answersOf(truth);
      isComplete = found.detectCollision(microseconds(budget));
      expectAnswers(found, before, complete, true);
      const std::int64_t last = clock.looks();
      found.detectCollision(microseconds::max());
      all = clock.looks() - last;
      EXPECT_EQ(answersOf(found), complete);
      deep += implementationOf(found).pairs.records()[0]->found.byBodies;
      ++stops;
      budget += 1 + all / 200 * kShareOfCases;
      if (HasFailure()) return;
    }
  }
  EXPECT_GT(stops, 100u / kShareOfCases);
  EXPECT_GT(deep, stops / 2);
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

/// Queries, snapshots, guards and captures see the positions now, whatever pairs were not finished.
TEST(Deadline, WhatElseReadsTheFrame) {
  Row row(3, {.method = Method::Continuous, .thickness = 0.02}, {.threads = 1}),
      reference(3, {.method = Method::Continuous, .thickness = 0.02}, {.threads = 1});
  LooksClock clock(row.collisions);
  for (Row* each : {&row, &reference}) {
    each->collisions.detectCollision();
    each->collisions.advance();
    each->move(1, {0.3, 0.1, 0.0});
  }
  EXPECT_FALSE(row.collisions.detectCollision(microseconds(2)));
  reference.collisions.detectCollision();
  EXPECT_GE(row.collisions.statistics().unfinishedPairs.size(), 1u);
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
  PairSettings pair{.method = Method::Continuous, .thickness = 0.02};
  pair.priority = -7;
  row.collisions.setPairSettings(row.ids[0], row.ids[1], pair);
  writeCapture(row.collisions.problem(), file);
  const CollisionProblem problem = readCapture(file);
  EXPECT_EQ(problem.pairs[0].settings.priority, -7);
  OctreeBasedCD replay = setUp(problem);
  replay.detectCollision();
  EXPECT_EQ(replay.collisionData(replay.pairs()[0].a, replay.pairs()[0].b).hash(),
            reference.collisions.collisionData(row.ids[0], row.ids[1]).hash());

  std::vector<std::vector<HeldVertex>> held;
  for (Row* each : {&row, &reference}) {
    StepGuard guard(each->collisions);
    EXPECT_GT(guard.hold(), 0u);
    held.emplace_back(guard.held().begin(), guard.held().end());
    each->collisions.detectCollision();
  }
  ASSERT_EQ(held[0].size(), held[1].size());
  for (std::size_t i = 0; i < held[0].size(); ++i) {
    EXPECT_EQ(held[0][i].vertex, held[1][i].vertex);
    EXPECT_EQ(held[0][i].fraction, held[1][i].fraction);
  }
  EXPECT_EQ(answersOf(row.collisions), answersOf(reference.collisions));
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
      EXPECT_EQ(answersOf(other), answersOf(truth));
      EXPECT_GT(contactsOf(other), 10u);
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
