#include <palpate/OctreeBasedCD.h>
#include <palpate/PenetrationTracker.h>
#include <palpate/Capture.h>
#include <palpate/ConstraintRows.h>
#include <palpate/StepGuard.h>
#include <palpate/ThreadTopology.h>

#include "Common/QueryCalls.h"
#include "Common/FailingAllocation.h"
#include "Common/PairRun.h"
#include "Common/Sanitized.h"
#include "Common/Solids.h"
#include "Common/WholeScene.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>

#include <bit>
#include <functional>
#include <new>
#include <optional>
#include <string>

// Makes every allocation of every public call fail once. A call that changes the object leaves it
// unchanged. After a frame that failed, the next frame is correct.

namespace palpate::testing {
namespace {

using Words = std::vector<std::uint64_t>;

void append(Words& words, double value) { words.push_back(std::bit_cast<std::uint64_t>(value)); }
void append(Words& words, const Positions& positions) {
  words.push_back(positions.size());
  for (const Vector3d& p : positions)
    for (const double x : p) append(words, x);
}

/// Everything that a frame's contacts depend on.
Words stateOf(const OctreeBasedCD& detection) {
  Words words;
  const CollisionProblem problem = detection.problem();
  for (const CollisionProblem::Geometry& mesh : problem.geometries) {
    words.push_back(static_cast<std::uint64_t>(mesh.id));
    append(words, mesh.before);
    append(words, mesh.now);
    append(words, mesh.rest);
    for (const Triangle& t : mesh.triangles) words.insert(words.end(), t.begin(), t.end());
    for (const Tetrahedron& t : mesh.tetrahedra) words.insert(words.end(), t.begin(), t.end());
    for (const double radius : mesh.radii) append(words, radius);
    words.insert(words.end(), mesh.disabled.begin(), mesh.disabled.end());
    words.push_back(mesh.filter.mask);
    words.push_back(static_cast<std::uint64_t>(mesh.filter.sidedness));
    for (const Pose& pose : {mesh.motion.before, mesh.motion.now}) {
      for (const double x : pose.rotation.reshaped()) append(words, x);
      for (const double x : pose.translation) append(words, x);
    }
  }
  for (const CollisionProblem::Pair& pair : problem.pairs) {
    words.insert(words.end(), {pair.a, pair.b, pair.predicate});
    words.push_back(static_cast<std::uint64_t>(pair.settings.method));
    append(words, pair.settings.thickness);
    append(words, pair.settings.restDistance);
  }
  EXPECT_EQ(detection.pairs().size(), problem.pairs.size());
  return words;
}

/// The whole scene but Method::Proxy, which has a test of its own.
struct Scene : WholeScene {
  explicit Scene(const Settings& settings) : WholeScene(input(), settings, false) {}
  void move() { WholeScene::move(1); }
  /// A frame's contacts, candidates and queries.
  Words answer() {
    Words words;
    const auto add = [&](const auto& found, auto&& depth) {
      words.push_back(found.size());
      for (const auto& each : found) append(words, depth(each));
    };
    add(testing::insideVertices(detection, drops, organ), [](const auto& v) { return v.depth; });
    add(testing::insideVertices(detection, drops, floor, {.rule = InsideRule::WindingNumber}),
        [](const auto& v) { return v.depth; });
    add(testing::embeddedVertices(detection, drops, block),
        [](const auto& v) { return v.at.weights[0]; });
    words.push_back(detection.queries().findTetrahedron(block, {0.3, 0.3, 0.3}).has_value());
    detection.detectCollision();
    for (const CollisionPair& pair : detection.pairs()) {
      words.push_back(detection.collisionData(pair.a, pair.b).hash());
      append(words, detection.collisionData(pair.a, pair.b).validity().displacement);
    }
    EXPECT_EQ(detection.octree().validate(), std::vector<std::string>{});
    for (const CollisionPair& pair : detection.pairs())
      if (pair.b != tool && pair.b != hull && pair.b != field)
        words.push_back(detection.candidatePairs(pair.a, pair.b).size());
    return words;
  }

  PenetrationTracker tracker{drops, organ};

 private:
  static const WholeSceneInput& input() {
    static const WholeSceneInput input(4);
    return input;
  }
};

struct Call {
  std::string name;
  std::function<void(Scene&)> call;
  bool afterAFrame = true;
};

/// Every public call that changes or computes something.
std::vector<Call> calls() {
  const std::vector<Triangle> one{{0, 1, 2}};
  const Positions three{{0, 0, 0.5}, {1, 0, 0.5}, {0, 1, 0.5}};
  const Positions four{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const std::vector<Tetrahedron> first{{0, 1, 2, 3}};
  const Eigen::Matrix3d unit = Eigen::Matrix3d::Identity();
  const Positions body = sphere(4, 8, {0.5, 0.5, 0.4}, 0.35).positions;
  std::vector<Call> all{
      {"detectCollision, first", [](Scene& s) { s.detection.detectCollision(); }, false},
      {"forEachCandidate, first", [](Scene& s) { s.detection.forEachCandidate([](auto&&...) {}); },
       false},
      {"update, first", [](Scene& s) { s.detection.update(); }, false},
      {"detectCollision", [](Scene& s) { s.detection.detectCollision(); }},
      {"forEachCandidate", [](Scene& s) { s.detection.forEachCandidate([](auto&&...) {}); }},
      {"update", [](Scene& s) { s.detection.update(); }},
      {"advance", [](Scene& s) { s.detection.advance(); }},
      {"publish", [](Scene& s) { s.detection.publish(); }},
      {"findInsideVertices",
       [](Scene& s) { testing::insideVertices(s.detection, s.drops, s.organ); }},
      {"PenetrationTracker", [](Scene& s) { s.tracker.update(s.detection.queries()); }},
      {"findInsideVertices by winding number",
       [](Scene& s) {
         testing::insideVertices(s.detection, s.drops, s.floor,
                                 {.rule = InsideRule::WindingNumber});
       }},
      {"findEmbeddedVertices",
       [](Scene& s) { testing::embeddedVertices(s.detection, s.drops, s.block); }},
      {"findTetrahedron",
       [](Scene& s) {
         s.detection.queries().findTetrahedron(s.block, {0.3, 0.3, 0.3});
       }},
      {"setPositions", [=](Scene& s) { s.detection.setPositions(s.organ, body); }},
      {"setPositions, both", [=](Scene& s) { s.detection.setPositions(s.organ, body, body); }},
      {"setTransform of a mesh",
       [=](Scene& s) {
         s.detection.setTransform(s.drops, {unit, {0.1, 0, 0}});
       }},
      {"setTransform of a shape",
       [=](Scene& s) {
         s.detection.setTransform(s.hull, {unit, {0.1, 0, 0}});
       }},
      {"setTransform, both",
       [=](Scene& s) {
         s.detection.setTransform(s.hull, {unit, {0, 0, 0}}, {unit, {0.1, 0, 0}});
       }},
      {"setTriangles", [=](Scene& s) { s.detection.setTriangles(s.floor, three, one); }},
      {"setTetrahedra", [=](Scene& s) { s.detection.setTetrahedra(s.block, four, first); }},
      {"setCollisionFilter",
       [](Scene& s) { s.detection.setCollisionFilter(s.floor, {.sidedness = Sidedness::Outer}); }},
      {"setDisabledElements",
       [](Scene& s) {
         s.detection.setDisabledElements(s.organ, std::vector<std::uint32_t>{3, 5});
       }},
      {"addCollisionPair",
       [](Scene& s) {
         s.detection.addCollisionPair(s.suture, s.block, {Method::Proximity, 0.1});
       }},
      {"setPairSettings",
       [](Scene& s) {
         PairSettings settings{Method::Proximity, 0.02};
         settings.restDistance = 0.2;
         s.detection.setPairSettings(s.suture, s.suture, settings);
       }},
      {"setContactPredicate",
       [](Scene& s) {
         s.detection.setContactPredicate(s.organ, s.floor,
                                         [](const ContactFeatures& f) { return f.a[0] % 2 == 0; });
       }},
      {"removeCollisionPair", [](Scene& s) { s.detection.removeCollisionPair(s.organ, s.organ); }},
      {"removeGeometry", [](Scene& s) { s.detection.removeGeometry(s.hull); }}};
  const auto add = [&](std::string name, auto&& addOne) {
    all.push_back({std::move(name), [=](Scene& s) { addOne(s.detection); }});
  };
  add("addTriangleMesh", [=](OctreeBasedCD& d) { return d.addTriangleMesh(three, one); });
  add("addTetrahedralMesh", [=](OctreeBasedCD& d) { return d.addTetrahedralMesh(four, first); });
  add("addLineMesh", [=](OctreeBasedCD& d) {
    return d.addLineMesh(three, std::vector<Segment>{{0, 1}}, std::vector<double>{0.1, 0.2, 0.1});
  });
  add("addPointSet", [=](OctreeBasedCD& d) { return d.addPointSet(three, 0.1); });
  for (const AnalyticalGeometry& shape : std::vector<AnalyticalGeometry>{
           ConvexHull{four}, ConvexHull{three}, Box{{0, 0, 0}, {1, 1, 1}}, Sphere{{0, 0, 0}, 1},
           Plane{}, Cylinder{{0, 0, 0}, {0, 0, 1}, 1}})
    add("addAnalyticalGeometry " + std::to_string(shape.index()),
        [=](OctreeBasedCD& d) { return d.addAnalyticalGeometry(shape); });
  return all;
}

class AllocationFailure : public ::testing::TestWithParam<int> {
 protected:
  Settings settings() const { return settingsOf(Engine::Octree, GetParam()); }
};

TEST_P(AllocationFailure, LeavesTheObjectUnchanged) {
  std::size_t failures = 0;
  for (const Call& call : calls()) {
    SCOPED_TRACE(call.name);
    const auto prepared = [&] {
      auto scene = std::make_unique<Scene>(settings());
      if (call.afterAFrame) {
        scene->answer();
        scene->detection.advance();
      }
      scene->move();
      return scene;
    };
    const auto without = prepared(), with = prepared();
    const Words state = stateOf(without->detection), answerWithout = without->answer();
    call.call(*with);
    const Words answerWith = with->answer();
    for (std::size_t n = 1;; n += kShareOfCases) {
      const auto scene = prepared();
      bool threw = false;
      FailingAllocation::arm(
          n, n % 2 ? FailingAllocation::Failures::One : FailingAllocation::Failures::All);
      try {
        call.call(*scene);
      } catch (const std::bad_alloc&) {
        threw = true;
      }
      FailingAllocation::disarm();
      if (!FailingAllocation::failed()) break;
      SCOPED_TRACE("allocation " + std::to_string(n));
      if (threw) {
        ++failures;
        ASSERT_EQ(stateOf(scene->detection), state);
        ASSERT_EQ(scene->answer(), answerWithout);
        call.call(*scene);  // again, with memory
      }
      ASSERT_EQ(scene->answer(), answerWith);
    }
  }
  EXPECT_GT(failures, 500u / kShareOfCases);
}

/// The first and the second frame of two sheets of 800 triangles.
TEST_P(AllocationFailure, NextFrameIsCorrect) {
  const std::size_t step = kShareOfCases == 1 ? shareOfCases(5) : 19;
  std::size_t begin = 0;  // each method and frame begins with another allocation
  for (const Method method :
       {Method::Proximity, Method::Continuous, Method::Intersection, Method::Auto})
    for (const bool first : {true, false}) {
      SCOPED_TRACE("method " + std::to_string(static_cast<int>(method)) + (first ? ", first" : ""));
      const Mesh a = sheet(20, 0, 0), b = sheet(20, 0.01, 1);
      const PairSettings pair{method, method == Method::Intersection ? 0.0 : 0.02};
      const auto prepared = [&] {
        auto run = std::make_unique<PairRun>(settings(), a, b, pair, false);
        if (first) return run;
        run->detect();
        run->detection().advance();
        Random random(2);
        run->detection().setPositions(run->a(), moved(random, a.positions, 0.01));
        return run;
      };
      const auto fresh = prepared();
      const std::uint64_t hash = first ? 0 : fresh->data().hash();
      fresh->detect();
      ASSERT_GT(fresh->detection().statistics().contacts, 50u);
      std::size_t failures = 0;
      for (std::size_t n = 1 + begin++ % step;; n += step) {
        const auto run = prepared();
        FailingAllocation::arm(n);
        bool threw = false;
        try {
          run->detection().detectCollision();
        } catch (const std::bad_alloc&) {
          threw = true;
        }
        FailingAllocation::disarm();
        if (!FailingAllocation::failed()) break;
        failures += threw;
        SCOPED_TRACE("allocation " + std::to_string(n));
        if (threw) {
          if (first) {
            EXPECT_THROW(run->data(), Error);
          } else {
            ASSERT_EQ(run->data().hash(), hash);  // the contacts of the previous frame
          }
          EXPECT_TRUE(run->detection().octree().validate().empty());
          run->detect();
        }
        ASSERT_EQ(run->data().hash(), fresh->data().hash());
        ASSERT_EQ(run->data().validity().trusted, fresh->data().validity().trusted);
        Random random(3);
        run->detection().advance();
        run->detection().setPositions(run->b(), moved(random, b.positions, 0.01));
        run->detect();
      }
      EXPECT_GT(failures, first ? 40u / step : 0u);
    }
}

/// A cut that fails leaves every bit of the state, also of what it had already prepared.
TEST_P(AllocationFailure, LeavesTheMeshUncut) {
  using Ids = std::vector<std::uint32_t>;
  Random random(4);
  const Solid block = cells(2, random);
  const Mesh ground = sheet(5, 0.1, 0), ball = sphere(6, 8, {0.5, 0.5, 0.1}, 0.3);
  for (const bool solid : {false, true}) {
    const auto prepared = [&] {
      auto detection = std::make_unique<OctreeBasedCD>(settings());
      const GeometryId a = solid ? detection->addTetrahedralMesh(block.positions, block.tetrahedra)
                                 : detection->addTriangleMesh(ground.positions, ground.triangles),
                       b = detection->addTriangleMesh(ball.positions, ball.triangles);
      detection->addCollisionPair(a, a, {.thickness = 0.02, .restDistance = 0.3});
      detection->addCollisionPair(a, b, {.thickness = 0.05, .trackContacts = true});
      detection->setTags(a, Ids((solid ? block.tetrahedra.size() : ground.triangles.size()), 7));
      detection->setDisabledElements(a, Ids{3});
      detection->detectCollision();
      detection->advance();
      return detection;
    };
    const auto cut = [&](OctreeBasedCD& detection) {
      const GeometryId a{0};
      const auto m = static_cast<std::uint32_t>(detection.vertexCount(a));
      const Positions tip{{0.4, 0.4, 0.15}};
      if (!solid) {
        const Triangle t = ground.triangles[8];
        return detection.replaceTriangles(
            a, Ids{2, 8}, std::vector<Triangle>{{t[0], t[1], m}, {t[1], t[2], m}}, tip);
      }
      Tetrahedron t = block.tetrahedra[5];
      t[0] = m;
      return detection.replaceTetrahedra(a, Ids{5, 9}, std::vector<Tetrahedron>{t}, tip);
    };
    const auto answers = [&](OctreeBasedCD& detection) {
      detection.detectCollision();
      return std::array{detection.collisionData(GeometryId{0}, GeometryId{0}).hash(),
                        detection.collisionData(GeometryId{0}, GeometryId{1}).hash()};
    };
    const auto fresh = prepared();
    const auto before = fresh->save();
    cut(*fresh);
    const auto after = fresh->save();
    ASSERT_NE(after, before);
    const auto expected = answers(*fresh);
    std::size_t failures = 0;
    for (std::size_t n = 1;; ++n) {
      const auto detection = prepared();
      const bool threw = FailingAllocation::throwsAt(n, [&] { cut(*detection); });
      const bool failed = FailingAllocation::failed();
      SCOPED_TRACE("allocation " + std::to_string(n));
      if (threw) {
        ASSERT_EQ(detection->save(), before);
        cut(*detection);
        ++failures;
      }
      ASSERT_EQ(detection->save(), after);
      ASSERT_EQ(answers(*detection), expected);
      if (!failed) break;
    }
    EXPECT_GT(failures, 20u);
  }
}

/// A publication that fails leaves the last snapshot, and copies of the next one are whole.
TEST_P(AllocationFailure, LastSnapshotStays) {
  Scene scene(settings());
  const auto answerOf = [&](const SpatialQueries& queries) {
    Words words;
    for (const GeometryId id : {scene.organ, scene.floor, scene.block, scene.tool})
      append(words, queries.closestPoint(id, {0.1, 0.2, 2})->distance);
    append(words, queries.signedDistance(scene.organ, {0.4, 0.5, 0.6}).distance);
    words.push_back(queries.findTetrahedron(scene.block, {0.3, 0.3, 0.3}).has_value());
    return words;
  };
  scene.detection.publish();
  const Words first = answerOf(scene.detection.latestSnapshot()->queries());
  scene.move();
  const Words next = answerOf(scene.detection.queries());
  ASSERT_NE(next, first);
  std::size_t n = 1;
  for (;; ++n) {
    FailingAllocation::arm(n);
    bool failed = false;
    try {
      scene.detection.publish();
    } catch (const std::bad_alloc&) {
      failed = true;
    }
    FailingAllocation::disarm();
    if (!failed) break;
    EXPECT_EQ(scene.detection.latestSnapshot()->number(), 1u) << n;
    EXPECT_EQ(answerOf(scene.detection.latestSnapshot()->queries()), first) << n;
  }
  EXPECT_GT(n, 10u);
  EXPECT_EQ(scene.detection.latestSnapshot()->number(), 2u);
  EXPECT_EQ(answerOf(scene.detection.latestSnapshot()->queries()), next);
}

TEST_P(AllocationFailure, LeavesTheStepGuardUnchanged) {
  const Mesh body = sphere(5, 6, {0.51, 0.47, 0.53}, 0.4), floor = sheet(4, 0.5, 0.3);
  Random random(6);
  const Positions bodyNow = moved(random, body.positions, 0.3),
                  floorNow = moved(random, floor.positions, 0.3);
  std::size_t failures = 0;
  bool threw = true;
  for (std::size_t n = 1; threw; ++n) {
    SCOPED_TRACE("allocation " + std::to_string(n));
    OctreeBasedCD collisions(settingsOf(Engine::Octree, GetParam())), unfailed;
    StepGuard guard(collisions), other(unfailed);
    for (OctreeBasedCD* each : {&collisions, &unfailed}) {
      each->addTriangleMesh(body.positions, body.triangles);
      each->addTriangleMesh(floor.positions, floor.triangles);
      each->addCollisionPair(GeometryId{0}, GeometryId{1});
      each->setPositions(GeometryId{0}, body.positions, bodyNow);
      each->setPositions(GeometryId{1}, floor.positions, floorNow);
    }
    const auto ends = [](const OctreeBasedCD& each) {
      std::vector<Positions> positions;
      for (const GeometryId id : {GeometryId{0}, GeometryId{1}})
        positions.emplace_back(each.positions(id).begin(), each.positions(id).end());
      return positions;
    };
    threw = false;
    FailingAllocation::arm(n);
    try {
      guard.hold();
    } catch (const std::bad_alloc&) {
      threw = true;
    }
    FailingAllocation::disarm();
    if (!threw) break;
    ++failures;
    ASSERT_TRUE(guard.held().empty());
    ASSERT_EQ(ends(collisions), (std::vector<Positions>{bodyNow, floorNow}));
    ASSERT_EQ(guard.hold(), other.hold());
    ASSERT_EQ(ends(collisions), ends(unfailed));
  }
  EXPECT_GT(failures, 20u);
}

INSTANTIATE_TEST_SUITE_P(Threads, AllocationFailure, ::testing::Values(1, 2));

/// A failing add(), addParts() or update() leaves counts and events, and the next call finds all.
TEST(AllocationFailureOfThreadTopology, LeavesItUnchanged) {
  const Positions hole{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  const auto threadAt = [](double x) { return Positions{{x, 0.1, -1}, {x, 0.1, 1}}; };
  const std::vector<std::uint32_t> rim{0, 1, 2, 3}, ends{0, 1};
  using Numbers = std::vector<std::int64_t>;
  std::size_t failures = 0;
  const auto run = [&](std::size_t n) {
    OctreeBasedCD collisions;
    const std::vector<Segment> square{{0, 1}, {1, 2}, {2, 3}, {3, 0}};
    const GeometryId loop = collisions.addLineMesh(hole, square, 0.0),
                     thread = collisions.addLineMesh(threadAt(0), std::vector<Segment>{{0, 1}});
    ThreadTopology topology(collisions);
    std::size_t watches = 0;
    const auto state = [&] {
      Numbers numbers;
      for (std::size_t i = 0; i < watches; ++i)
        numbers.insert(numbers.end(), {topology.count(i), topology.isLost(i)});
      for (const ThreadEvent& e : topology.events())
        numbers.insert(numbers.end(),
                       {static_cast<int>(e.cause), e.change, e.thread[0], e.loop[0]});
      return numbers;
    };
    const auto attempt = [&](auto&& call) {
      const Numbers before = state();
      if (FailingAllocation::throwsAt(n, call)) {
        ++failures;
        EXPECT_EQ(state(), before) << n;
        call();
      }
    };
    const VertexPath threadPath{thread, ends}, loopPath{loop, rim};
    attempt([&] { EXPECT_EQ(topology.add(threadPath, loopPath), watches); });
    ++watches;
    attempt([&] { EXPECT_EQ(topology.addParts(threadPath, loopPath), watches); });
    ++watches;
    Numbers all;
    for (const double x : {3.0, 0.5, -3.0}) {
      collisions.advance();
      collisions.setPositions(thread, threadAt(x));
      attempt([&] { topology.update(); });
      const Numbers numbers = state();
      all.insert(all.end(), numbers.begin(), numbers.end());
    }
    return all;
  };
  const Numbers truth = run(1'000'000);
  EXPECT_EQ(failures, 0u);
  EXPECT_GT(truth.size(), 30u);
  for (std::size_t n = 1, before = 1; failures != before; ++n) {
    before = failures;
    EXPECT_EQ(run(n), truth) << n;
  }
  EXPECT_GT(failures, 10u);
}

/// All that a pair's answer says.
struct WholeAnswer {
  explicit WholeAnswer(const CollisionData& data)
      : hash(data.hash()),
        validity(data.validity()),
        crossings(data.crossings().begin(), data.crossings().end()),
        sides(data.rememberedSides().begin(), data.rememberedSides().end()),
        tracked(data.trackedVertexTriangle().begin(), data.trackedVertexTriangle().end()),
        ended(data.ended().begin(), data.ended().end()) {}
  friend bool operator==(const WholeAnswer&, const WholeAnswer&) = default;

  std::uint64_t hash;
  Validity validity;
  std::vector<Crossing> crossings, sides;
  std::vector<TrackedContact> tracked, ended;
};

/// A detection that throws leaves the last answers: age, crossings, trust and contacts over time,
/// with any budget, in the same step and in the next. The next one is as if it had not been.
TEST(AllocationFailureOfDetections, LeavesEveryAnswer) {
  const Mesh ground = sheet(2, 0.0, 0.0);
  std::size_t failures = 0;
  // n: the allocation that fails. Returns the answers at the end.
  const auto run = [&](std::size_t n, std::optional<std::chrono::microseconds> budget,
                       bool inNextStep) {
    OctreeBasedCD collisions(settingsOf(Engine::Octree, 1));
    Positions drops{{0.3, 0.4, 0.1}, {0.6, 0.2, 0.1}};
    const GeometryId organ = addMesh(collisions, ground), points = collisions.addPointSet(drops);
    collisions.addCollisionPair(points, organ,
                                {.method = Method::Continuous,
                                 .thickness = 0.3,
                                 .trackContacts = true,
                                 .reportCrossings = true,
                                 .rememberSides = true});
    collisions.advance();
    const auto move = [&](double z) {
      for (Vector3d& p : drops) p[2] += z;
      collisions.setPositions(points, drops);
    };
    const CollisionPair pair = collisions.pairs()[0];
    const auto answer = [&] { return WholeAnswer(collisions.collisionData(pair.a, pair.b)); };
    move(-0.2);
    collisions.detectCollision();
    EXPECT_EQ(answer().crossings.size(), 2u);
    const auto isComplete = [&] { return collisions.statistics().unfinishedPairs.empty(); };
    for (int i = 0; i < 3; ++i) {
      if (inNextStep) collisions.advance();
      move(-0.05);
      const WholeAnswer before = answer();
      const bool wasComplete = isComplete();
      const auto detect = [&] {
        if (budget)
          collisions.detectCollision(*budget);
        else
          collisions.detectCollision();
      };
      if (FailingAllocation::throwsAt(n, detect)) {
        ++failures;
        EXPECT_EQ(answer(), before) << n;
        EXPECT_EQ(isComplete(), wasComplete) << n;
        detect();
      }
    }
    collisions.detectCollision();
    return answer();
  };
  using std::chrono::microseconds;
  for (const auto budget : {std::optional<microseconds>(), std::optional(microseconds(0)),
                            std::optional(microseconds::max())})
    for (const bool inNextStep : {false, true}) {
      failures = 0;
      const WholeAnswer truth = run(1'000'000, budget, inNextStep);
      EXPECT_EQ(failures, 0u);
      for (std::size_t n = 1, before = 1; failures != before; ++n) {
        before = failures;
        EXPECT_EQ(run(n, budget, inNextStep), truth) << n;
      }
      EXPECT_GE(failures, 2u);
    }
}

/// A body at rest starts its step where it ends it. What a detection that throws found out about
/// the end is not known at the start.
TEST(AllocationFailureOfDetections, LeavesWhatIsKnownOfTheStart) {
  Random random(1);
  const TestGeometry body = testGeometry(soup(random, 12, 0.3));
  const auto run = [&](std::size_t n) {
    OctreeBasedCD collisions(settingsOf(Engine::Octree, 1));
    const GeometryId id = body.addTo(collisions);
    collisions.detectCollision();
    collisions.addCollisionPair(id, id, {.freeMotionReach = 0.1});
    const auto detect = [&] { collisions.detectCollision(); };
    const bool threw = FailingAllocation::throwsAt(n, detect);
    if (threw) detect();
    return std::pair(threw, collisions.collisionData(id, id).validity());
  };
  const Validity truth = run(1'000'000).second;
  std::size_t failures = 0;
  for (std::size_t n = 1;; ++n) {
    const auto [threw, validity] = run(n);
    if (!threw) break;
    ++failures;
    EXPECT_EQ(validity, truth) << n;
  }
  EXPECT_GT(failures, 10u);
}

/// Vectors that appendRows() and appendMotions() extend keep their content.
TEST(AllocationFailureWhileAppendingOrCapturing, AppendedRowsAndMotionsStayUnchanged) {
  const Mesh low = sheet(3, 0.0, 0.0), high = sheet(3, 0.0, 0.2);
  const CollisionData contacts = detectCollision(
      {low.positions, low.triangles}, {high.positions, high.triangles}, {Method::Proximity, 0.5});
  const SolverVertices a{0, low.positions, low.positions}, b{100, high.positions, high.positions};
  std::vector<ConstraintRow> rows;
  std::vector<ContactMotion> motions;
  appendRows(contacts, a, b, rows);
  ASSERT_GT(rows.size(), 20u);
  const auto expectKept = [](auto& list, auto&& append) {
    for (std::size_t n = 1;; ++n) {
      list.resize(3);
      list.shrink_to_fit();
      FailingAllocation::arm(n);
      bool thrown = false;
      try {
        append();
      } catch (const std::bad_alloc&) {
        thrown = true;
      }
      FailingAllocation::disarm();
      if (!FailingAllocation::failed()) {
        EXPECT_GT(n, 2u);
        return;
      }
      EXPECT_TRUE(thrown);
      EXPECT_EQ(list.size(), 3u) << n;
    }
  };
  expectKept(rows, [&] { appendRows(contacts, a, b, rows); });
  expectKept(motions, [&] { appendMotions(contacts, {a}, {b}, motions); });
}

TEST(AllocationFailureWhileAppendingOrCapturing, CaptureLeavesNoPartialFile) {
  const Mesh mesh = sheet(2, 0.0, 0.0);
  OctreeBasedCD collisions;
  addMesh(collisions, mesh);
  const auto folder = std::filesystem::temp_directory_path() / "palpate-capture-failures";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directory(folder);
  for (std::size_t n = 1;; ++n) {
    FailingAllocation::arm(n);
    try {
      capture(collisions, folder / "a.capture");
    } catch (const std::bad_alloc&) {
    } catch (const Error&) {
    }
    FailingAllocation::disarm();
    if (!FailingAllocation::failed()) break;
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      EXPECT_NE(entry.path().extension(), ".part") << n;
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "a.capture"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace palpate::testing
