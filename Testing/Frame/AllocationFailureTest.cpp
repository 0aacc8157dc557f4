#include <palpate/OctreeBasedCD.h>
#include <palpate/PenetrationTracker.h>
#include <palpate/Capture.h>
#include <palpate/ConstraintRows.h>
#include <palpate/StepGuard.h>
#include <palpate/ThreadTopology.h>

#include "Common/Answers.h"
#include "Common/FailingAllocation.h"
#include "Common/QueryCalls.h"
#include "Common/PairRun.h"
#include "Common/Renamed.h"
#include "Common/Sanitized.h"
#include "Common/TemporaryFolder.h"
#include "Common/WholeScene.h"

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

// Makes every allocation of every public call fail once. A call that changes the object leaves it
// unchanged. After a frame that failed, the next frame is correct.

namespace palpate::testing {
namespace {

using Words = Row;

/// Makes a call again and again, each time with another allocation that fails, until none fails.
/// check(state, whether the call threw) follows each. Returns how often it threw.
template <class Prepare, class F, class Check>
std::size_t forEachFailure(Prepare&& prepare, F&& call, Check&& check, std::size_t step = 1) {
  using enum FailingAllocation::Failures;
  std::size_t failures = 0;
  for (std::size_t n = 1; !::testing::Test::HasFailure(); n += step) {
    SCOPED_TRACE("allocation " + std::to_string(n));
    const auto state = prepare();
    const bool threw = FailingAllocation::throwsAt(
        n, [&] { call(*state); }, n % 2 ? One : All);
    if (!FailingAllocation::failed()) break;
    failures += threw;
    check(*state, threw);
  }
  return failures;
}

/// The whole scene but Method::Proxy, which has a test of its own.
struct TrackedScene : WholeScene {
  explicit TrackedScene(const Settings& settings) : WholeScene(input(), settings, false) {
    detection.setTags(floor, Ids(input().floor.triangles.size(), 7));
    detection.setTags(block, Ids(input().block.tetrahedra.size(), 8));
    detection.setDisabledElements(floor, Ids{3});
    detection.setPairSettings(organ, floor, {.thickness = 0.02, .trackContacts = true});
    topology.add(threadPath(), loopPath());
    topology.addParts(threadPath(), {needle, {0, 1}});
  }
  VertexPath threadPath() const { return {suture, {0, 1, 2, 3}}; }
  VertexPath loopPath() const {
    const Triangle& t = input().organ.triangles[0];
    return {organ, {t.begin(), t.end()}};
  }
  /// Everything that answers depend on. What is known of earlier detections may change.
  std::vector<std::byte> state() const {
    const CollisionProblem problem = detection.problem();
    std::vector<std::byte> all = setUp(problem).save(), ofThreads = topology.save();
    all.insert(all.end(), ofThreads.begin(), ofThreads.end());
    for (const CollisionProblem::Pair& pair : problem.pairs)
      all.push_back(static_cast<std::byte>(pair.predicate));
    return all;
  }
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
      if (pair.b != tool && pair.b != hull && pair.b != field)
        words.push_back(detection.candidatePairs(pair.a, pair.b).size());
    }
    EXPECT_EQ(detection.octree().validate(), std::vector<std::string>{});
    topology.update();
    for (const std::byte byte : topology.save()) words.push_back(static_cast<std::uint64_t>(byte));
    return words;
  }

  PenetrationTracker tracker{drops, organ};
  GeometryId needle = detection.addLineMesh(Positions{{0.1, 0.4, 0.2}, {0.9, 0.6, 0.6}},
                                            std::vector<Segment>{{0, 1}});
  ThreadTopology topology{detection};

 private:
  static const WholeSceneInput& input() {
    static const WholeSceneInput input(4);
    return input;
  }
};

struct Call {
  std::string name;
  std::function<void(TrackedScene&)> call;
  bool afterAFrame = true;
};

/// Every public call that changes or computes something.
std::vector<Call> calls() {
  const std::vector<Triangle> one{{0, 1, 2}};
  const Positions tip{{0.4, 0.4, 0.15}}, three{{0, 0, 0.5}, {1, 0, 0.5}, {0, 1, 0.5}};
  const Positions four{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const std::vector<Tetrahedron> first{{0, 1, 2, 3}};
  const Eigen::Matrix3d unit = Eigen::Matrix3d::Identity();
  const Positions body = sphere(4, 8, {0.5, 0.5, 0.4}, 0.35).positions;
  std::vector<Call> all{
      {"detectCollision, first", [](TrackedScene& s) { s.detection.detectCollision(); }, false},
      {"forEachCandidate, first",
       [](TrackedScene& s) { s.detection.forEachCandidate([](auto&&...) {}); }, false},
      {"update, first", [](TrackedScene& s) { s.detection.update(); }, false},
      {"detectCollision", [](TrackedScene& s) { s.detection.detectCollision(); }},
      {"forEachCandidate", [](TrackedScene& s) { s.detection.forEachCandidate([](auto&&...) {}); }},
      {"update", [](TrackedScene& s) { s.detection.update(); }},
      {"advance", [](TrackedScene& s) { s.detection.advance(); }},
      {"publish", [](TrackedScene& s) { s.detection.publish(); }},
      {"findInsideVertices",
       [](TrackedScene& s) { testing::insideVertices(s.detection, s.drops, s.organ); }},
      {"ThreadTopology::add",
       [](TrackedScene& s) { s.topology.add(s.threadPath(), s.loopPath()); }},
      {"ThreadTopology::addParts",
       [](TrackedScene& s) {
         s.topology.addParts(s.threadPath(), {s.needle, {0, 1}});
       }},
      {"ThreadTopology::update", [](TrackedScene& s) { s.topology.update(); }},
      {"PenetrationTracker", [](TrackedScene& s) { s.tracker.update(s.detection.queries()); }},
      {"findInsideVertices by winding number",
       [](TrackedScene& s) {
         testing::insideVertices(s.detection, s.drops, s.floor,
                                 {.rule = InsideRule::WindingNumber});
       }},
      {"findEmbeddedVertices",
       [](TrackedScene& s) { testing::embeddedVertices(s.detection, s.drops, s.block); }},
      {"findTetrahedron",
       [](TrackedScene& s) {
         s.detection.queries().findTetrahedron(s.block, {0.3, 0.3, 0.3});
       }},
      {"setPositions", [=](TrackedScene& s) { s.detection.setPositions(s.organ, body); }},
      {"setPositions, both",
       [=](TrackedScene& s) { s.detection.setPositions(s.organ, body, body); }},
      {"setTransform of a mesh",
       [=](TrackedScene& s) {
         s.detection.setTransform(s.drops, {unit, {0.1, 0, 0}});
       }},
      {"setTransform of a shape",
       [=](TrackedScene& s) {
         s.detection.setTransform(s.hull, {unit, {0.1, 0, 0}});
       }},
      {"setTransform, both",
       [=](TrackedScene& s) {
         s.detection.setTransform(s.hull, {unit, {0, 0, 0}}, {unit, {0.1, 0, 0}});
       }},
      {"setTriangles", [=](TrackedScene& s) { s.detection.setTriangles(s.floor, three, one); }},
      {"setTetrahedra", [=](TrackedScene& s) { s.detection.setTetrahedra(s.block, four, first); }},
      {"replaceTriangles",
       [=](TrackedScene& s) {
         const auto m = static_cast<std::uint32_t>(s.detection.vertexCount(s.floor));
         s.detection.replaceTriangles(s.floor, Ids{2, 8},
                                      std::vector<Triangle>{{0, 1, m}, {1, 2, m}}, tip);
       }},
      {"replaceTetrahedra",
       [=](TrackedScene& s) {
         const auto m = static_cast<std::uint32_t>(s.detection.vertexCount(s.block));
         s.detection.replaceTetrahedra(s.block, Ids{1, 4}, std::vector<Tetrahedron>{{0, 1, 2, m}},
                                       tip);
       }},
      {"setCollisionFilter",
       [](TrackedScene& s) {
         s.detection.setCollisionFilter(s.floor, {.sidedness = Sidedness::Outer});
       }},
      {"setDisabledElements",
       [](TrackedScene& s) {
         s.detection.setDisabledElements(s.organ, Ids{3, 5});
       }},
      {"addCollisionPair",
       [](TrackedScene& s) {
         s.detection.addCollisionPair(s.suture, s.block, {Method::Proximity, 0.1});
       }},
      {"setPairSettings",
       [](TrackedScene& s) {
         PairSettings settings{Method::Proximity, 0.02};
         settings.restDistance = 0.2;
         s.detection.setPairSettings(s.suture, s.suture, settings);
       }},
      {"setContactPredicate",
       [](TrackedScene& s) {
         s.detection.setContactPredicate(s.organ, s.floor,
                                         [](const ContactFeatures& f) { return f.a[0] % 2 == 0; });
       }},
      {"removeCollisionPair",
       [](TrackedScene& s) { s.detection.removeCollisionPair(s.organ, s.organ); }},
      {"removeGeometry", [](TrackedScene& s) { s.detection.removeGeometry(s.hull); }}};
  const auto add = [&](std::string name, auto&& addOne) {
    all.push_back({std::move(name), [=](TrackedScene& s) { addOne(s.detection); }});
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
      auto scene = std::make_unique<TrackedScene>(settings());
      if (call.afterAFrame) {
        scene->answer();
        scene->detection.advance();
      }
      scene->move();
      return scene;
    };
    const auto without = prepared(), with = prepared();
    const auto state = without->state();
    const Words answerWithout = without->answer();
    call.call(*with);
    const Words answerWith = with->answer();
    failures += forEachFailure(
        prepared, call.call,
        [&](TrackedScene& scene, bool threw) {
          if (threw) {
            EXPECT_TRUE(scene.state() == state);
            EXPECT_EQ(scene.answer(), answerWithout);
            call.call(scene);
          }
          EXPECT_EQ(scene.answer(), answerWith);
        },
        kShareOfCases);
  }
  EXPECT_GT(failures, 500u / kShareOfCases);
}

/// A publication that fails leaves the last snapshot, and copies of the next one are whole.
TEST_P(AllocationFailure, LastSnapshotStays) {
  TrackedScene scene(settings());
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
  for (; FailingAllocation::throwsAt(n, [&] { scene.detection.publish(); }); ++n) {
    EXPECT_EQ(scene.detection.latestSnapshot()->number(), 1u) << n;
    EXPECT_EQ(answerOf(scene.detection.latestSnapshot()->queries()), first) << n;
  }
  EXPECT_GT(n, 10u);
  EXPECT_EQ(scene.detection.latestSnapshot()->number(), 2u);
  EXPECT_EQ(answerOf(scene.detection.latestSnapshot()->queries()), next);
}

TEST_P(AllocationFailure, LeavesTheStepGuardUnchanged) {
  struct Guarded {
    explicit Guarded(const Settings& settings) : collisions(settings) {
      Random random(6);
      for (const Mesh& mesh : {sphere(5, 6, {0.51, 0.47, 0.53}, 0.4), sheet(4, 0.5, 0.3)})
        collisions.setPositions(addMesh(collisions, mesh), mesh.positions,
                                moved(random, mesh.positions, 0.3));
      collisions.addCollisionPair(GeometryId{0}, GeometryId{1});
    }
    OctreeBasedCD collisions;
    StepGuard guard{collisions};
  };
  Guarded unfailed(settings());
  const auto before = unfailed.collisions.save();
  const std::size_t held = unfailed.guard.hold();
  const std::size_t failures = forEachFailure(
      [&] { return std::make_unique<Guarded>(settings()); }, [](Guarded& g) { g.guard.hold(); },
      [&](Guarded& g, bool threw) {
        EXPECT_TRUE(threw);
        EXPECT_TRUE(g.guard.held().empty());
        EXPECT_TRUE(g.collisions.save() == before);
        EXPECT_EQ(g.guard.hold(), held);
        for (const GeometryId id : {GeometryId{0}, GeometryId{1}})
          EXPECT_TRUE(
              std::ranges::equal(g.collisions.positions(id), unfailed.collisions.positions(id)));
      });
  EXPECT_GT(failures, 20u);
}

INSTANTIATE_TEST_SUITE_P(Threads, AllocationFailure, ::testing::Values(1, 2));

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
    const auto answer = [&] { return collisions.collisionData(pair.a, pair.b); };
    move(-0.2);
    collisions.detectCollision();
    EXPECT_EQ(answer().crossings().size(), 2u);
    const auto isComplete = [&] { return collisions.statistics().unfinishedPairs.empty(); };
    for (int i = 0; i < 3; ++i) {
      if (inNextStep) collisions.advance();
      move(-0.05);
      const CollisionData before = answer();
      const bool wasComplete = isComplete();
      const auto detect = [&] {
        if (budget)
          collisions.detectCollision(*budget);
        else
          collisions.detectCollision();
      };
      if (FailingAllocation::throwsAt(n, detect)) {
        ++failures;
        testing::expectSame(answer(), before, Knowledge::Same);
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
      const CollisionData truth = run(1'000'000, budget, inNextStep);
      EXPECT_EQ(failures, 0u);
      for (std::size_t n = 1, before = 1; failures != before; ++n) {
        before = failures;
        testing::expectSame(run(n, budget, inNextStep), truth, Knowledge::Same);
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
    const auto shrunk = [&] {
      list.resize(3);
      list.shrink_to_fit();
      return &list;
    };
    const std::size_t failures = forEachFailure(
        shrunk, [&](auto&) { append(); },
        [](auto& kept, bool threw) {
          EXPECT_TRUE(threw);
          EXPECT_EQ(kept.size(), 3u);
        });
    EXPECT_GT(failures, 1u);
  };
  expectKept(rows, [&] { appendRows(contacts, a, b, rows); });
  expectKept(motions, [&] { appendMotions(contacts, {a}, {b}, motions); });
}

TEST(AllocationFailureWhileAppendingOrCapturing, CaptureLeavesNoPartialFile) {
  const Mesh mesh = sheet(2, 0.0, 0.0);
  OctreeBasedCD collisions;
  addMesh(collisions, mesh);
  const TemporaryFolder folder;
  for (std::size_t n = 1;; ++n) {
    try {
      FailingAllocation::throwsAt(n, [&] { capture(collisions, folder.path / "a.capture"); });
    } catch (const Error&) {
      FailingAllocation::disarm();
    }
    if (!FailingAllocation::failed()) break;
    for (const auto& entry : std::filesystem::directory_iterator(folder.path))
      EXPECT_NE(entry.path().extension(), ".part") << n;
  }
  EXPECT_TRUE(std::filesystem::exists(folder.path / "a.capture"));
}

}  // namespace
}  // namespace palpate::testing
