#include "Common/DegenerateCases.h"
#include "Common/TestGeometry.h"

#include <numeric>

// Validity::trusted is never true for a wrong answer. The reference is exact: impacts of
// Method::Continuous at thickness 0, and Method::Intersection of the positions at the step's start.

namespace palpate {
namespace {

using namespace testing;

constexpr double kSheetThickness = 0.02;

/// The exact events of a step.
struct Truth {
  bool startedApart, touched;
};

Truth truthOf(const Mesh& a, const Mesh& b, const Positions& aBefore, const Positions& aNow,
              const Positions& bBefore, const Positions& bNow) {
  PairRun start(settingsOf(Engine::Octree), a, b, {Method::Intersection}, false);
  start.step(aBefore, aBefore, bBefore, bBefore);
  PairRun step(settingsOf(Engine::Octree), a, b, {Method::Continuous}, false);
  step.step(aBefore, aNow, bBefore, bNow);
  return {start.data().intersectingTriangles().empty(), step.data().earliestTimeOfImpact() <= 1.0};
}

/// A ball over a sheet, whose vertices began above it. A contact in the interior of a face shows
/// the side that the method assumes.
struct BallAndSheet {
  Mesh ball = sphere(5, 7, {0.5, 0.5, 0.35}, 0.2), sheet = testing::sheet(5, 0, 1.0);

  static bool anyFromBelow(const CollisionData& data, const Positions& before,
                           const Positions& now) {
    for (const VertexTriangleContact& c : data.vertexTriangle()) {
      if (!(c.weights.minCoeff() > 0.0)) continue;
      const double t = c.timeOfImpact;
      const auto at = [&](std::uint32_t v) { return Vector3d((1 - t) * before[v] + t * now[v]); };
      const Vector3d a = at(c.vertices[0]), b = at(c.vertices[1]), d = at(c.vertices[2]);
      if ((b - a).cross(d - a).dot(c.normal) < 0.0) return true;
    }
    return false;
  }
};

/// Frames with a wrong answer, and those of them that were trusted.
struct Tally {
  std::size_t wrong = 0, silent = 0;
};

/// Histories of a ball that bobs over a sheet by `speed` thicknesses per frame, up to crossing it.
Tally historiesOf(const PairSettings& settings, double speed, std::uint64_t seed,
                  std::size_t histories, bool response) {
  Random random(seed);
  Tally tally;
  for (std::size_t history = 0; history < histories; ++history) {
    const BallAndSheet scene;
    PairRun run(settingsOf(Engine::Octree), scene.ball, scene.sheet, settings, false);
    Positions ball = scene.ball.positions, sheet = scene.sheet.positions;
    const double drop = uniform(random, 0.0, 0.1);
    for (Vector3d& p : ball) p.z() -= drop;
    run.step(ball, ball, sheet, sheet);
    const Positions start = ball;
    bool crossed = false;  // until now; afterwards no side is defined
    double height = 0;
    for (int frame = 0; frame < 12 && !crossed; ++frame) {
      height += uniform(random, -1.2, 1.0) * speed * kSheetThickness;
      Positions ballNow = start, sheetNow = scene.sheet.positions, ballBefore = ball;
      for (Vector3d& p : ballNow)
        p += Vector3d(0, 0, height) + randomPoint(random, -0.1, 0.1) * speed * kSheetThickness;
      for (Vector3d& p : sheetNow) p += randomPoint(random, -0.1, 0.1) * speed * kSheetThickness;
      if (response && frame % 3 == 2)  // corrected since by a solver
        for (Vector3d& p : ballBefore) p.z() += 0.2 * kSheetThickness;
      const Truth truth = truthOf(scene.ball, scene.sheet, ballBefore, ballNow, sheet, sheetNow);
      if (response) {
        run.step(ballBefore, ballNow, sheet, sheetNow);
      } else {
        run.detection().setPositions(run.a(), ballNow);
        run.detection().setPositions(run.b(), sheetNow);
        run.detect();
        run.detection().advance();
      }
      const Validity& validity = run.data().validity();
      const bool fromBelow = BallAndSheet::anyFromBelow(run.data(), sheet, sheetNow);
      bool wrong = false;
      switch (settings.method) {
        case Method::Intersection:
          wrong = truth.touched && run.data().intersectingTriangles().empty();
          break;
        case Method::Proximity:  // the method cannot find impacts
          wrong = truth.touched || fromBelow;
          break;
        default:
          wrong = !truth.startedApart || fromBelow;
      }
      if (validity.startedApart) {
        EXPECT_TRUE(truth.startedApart);
        if (settings.method == Method::Auto) {  // then there are no contacts of Intersection
          EXPECT_TRUE(run.data().intersectingTriangles().empty());
        }
      }
      EXPECT_EQ(validity.sideMayBeWrong,
                settings.method != Method::Intersection && !validity.trusted);
      tally.wrong += wrong;
      tally.silent += wrong && validity.trusted;
      crossed = truth.touched;
      ball = ballNow;
      sheet = sheetNow;
    }
  }
  return tally;
}

struct ValidityOfMethod : ::testing::TestWithParam<MethodCase> {};

TEST_P(ValidityOfMethod, NeverFailsSilently) {
  std::size_t number = 0;
  for (const bool response : {false, true}) {
    Tally all;
    for (const double speed : {0.01, 0.1, 0.3, 0.7, 1.0, 1.5, 3.0, 10.0, 50.0}) {
      if (isLeftOut(number++)) continue;
      const Tally tally = historiesOf(GetParam().settings, speed, 5, 40, response);
      EXPECT_EQ(tally.silent, 0u) << "speed " << speed;
      all.wrong += tally.wrong;
    }
    if (GetParam().settings.method == Method::Proximity) {
      EXPECT_GE(all.wrong, leastOf(101));
    }
  }
}

/// Frames of histories of bodies that go through each other and back, by startedApart.
struct Known {
  std::size_t frames = 0, apart = 0, foundApart = 0;
};

/// A ball, at the top of each swing apart from a sheet, and at its lowest in it or through it.
/// Without correction.
void swingThrough(const PairSettings& settings, double speed, std::uint64_t seed, Known& known) {
  const BallAndSheet scene;
  Random random(seed);
  PairRun run(settingsOf(Engine::Octree, 1 + seed % 2), scene.ball, scene.sheet, settings, false),
      truth(settingsOf(Engine::BruteForce), scene.ball, scene.sheet, {Method::Intersection}, false),
      // Impacts that Distinct excludes.
      all(settingsOf(Engine::Octree), scene.ball, scene.sheet,
          {Method::Continuous, settings.thickness, Contacts::All}, false);
  std::size_t looks = 0;
  for (int frame = 0; frame < 48; ++frame) {
    Positions ball = moved(random, scene.ball.positions, 0.01);
    for (Vector3d& p : ball) p.z() += speed * (std::cos(0.7 * frame) - 1.0);
    const Positions sheet = moved(random, scene.sheet.positions, 0.01);
    // This step starts where the previous one ended.
    const bool apart = frame > 0 && truth.data().intersectingTriangles().empty();
    for (PairRun* each : {&run, &truth, &all}) {
      each->detection().setPositions(each->a(), ball);
      each->detection().setPositions(each->b(), sheet);
      each->detect();
      each->detection().advance();
    }
    if (frame == 0) continue;
    const bool found = run.data().validity().startedApart;
    EXPECT_TRUE(apart || !found) << "frame " << frame;
    ++known.frames, known.apart += apart, known.foundApart += found;
    const FrameStatistics& statistics = run.detection().statistics();
    std::size_t contacts = statistics.contacts;
    if (settings.method == Method::Continuous) contacts = all.detection().statistics().contacts;
    if (settings.method == Method::Auto) contacts += all.detection().statistics().contacts;
    looks += statistics.validityPairs > contacts + 32;
    EXPECT_LE(statistics.validityPairs, statistics.candidatePairs + contacts + 32);
  }
  // If contacts do not tell, the initial intersection check runs once, and later now and then.
  if (settings.method != Method::Auto) {
    EXPECT_LE(looks, 4u + 47 / 16);
  }
}

TEST_P(ValidityOfMethod, KnowsStartedApartFromImpactsOfThePreviousStep) {
  const PairSettings& settings = GetParam().settings;
  if (settings.method == Method::Intersection) return;  // the check does not run
  Known all;
  for (const double speed : {0.05, 0.1, 0.3})
    for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(casesOf(24, 6)); ++seed) {
      SCOPED_TRACE("speed " + std::to_string(speed) + ", seed " + std::to_string(seed));
      swingThrough(settings, speed, seed, all);
    }
  EXPECT_GT(all.apart, 500u / shareOfCases(5));
  EXPECT_LT(all.apart, all.frames - 500 / shareOfCases(5));
  if (settings.method == Method::Auto) {
    EXPECT_EQ(all.foundApart, all.apart);
  } else if (settings.method == Method::Continuous) {
    EXPECT_GT(all.foundApart, all.apart * 4 / 5);
  }
}

/// As an STL file has it: each triangle has three vertices of its own.
TEST(Validity, OfAnUnweldedMeshWithItselfIsNotTrusted) {
  const Mesh cut = unwelded(cube(0, 1));
  const Welded welded = weld(cut.positions, cut.triangles);
  for (const Method method : {Method::Auto, Method::Proximity, Method::Intersection}) {
    OctreeBasedCD detection;
    const GeometryId soup = addMesh(detection, cut), closed = addMesh(detection, welded);
    for (const GeometryId id : {soup, closed})
      detection.addCollisionPair(
          id, id, {.method = method, .thickness = method == Method::Intersection ? 0.0 : 0.01});
    for (int frame = 0; frame < 2; ++frame) {
      detection.detectCollision();
      const Validity &ofSoup = detection.collisionData(soup, soup).validity(),
                     &ofClosed = detection.collisionData(closed, closed).validity();
      EXPECT_TRUE(ofSoup.unwelded);
      EXPECT_FALSE(ofSoup.trusted);
      EXPECT_FALSE(ofClosed.unwelded);
      EXPECT_TRUE(ofClosed.trusted);
      detection.advance();
    }
  }
  // Triangles that are apart are no mesh that was cut into pieces. Two vertices are in none.
  OctreeBasedCD detection;
  const GeometryId apart = detection.addTriangleMesh(
      std::vector<Eigen::Vector3d>{
          {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {5, 5, 5}, {5, 5, 5}},
      std::vector<Triangle>{{0, 1, 2}, {3, 4, 5}});
  detection.addCollisionPair(apart, apart, {.method = Method::Proximity, .thickness = 0.01});
  detection.detectCollision();
  EXPECT_FALSE(detection.collisionData(apart, apart).validity().unwelded);
  EXPECT_TRUE(detection.collisionData(apart, apart).validity().trusted);
}

/// Vertices that meet or part later do not count, whether the mesh was detected before or not.
TEST(Validity, AMeshIsUnweldedByItsPositionsAtRest) {
  const std::vector<Eigen::Vector3d> apart{{0, 0, 0}, {1, 0, 0}, {0, 1, 0},
                                           {2, 0, 0}, {3, 1, 0}, {2, 1, 0}},
      joined{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  const std::vector<Triangle> triangles{{0, 1, 2}, {3, 4, 5}};
  for (const bool isJoinedAtRest : {false, true})
    for (const bool wasDetected : {false, true}) {
      OctreeBasedCD detection;
      const GeometryId mesh = detection.addTriangleMesh(isJoinedAtRest ? joined : apart, triangles);
      detection.addCollisionPair(mesh, mesh, {.method = Method::Proximity, .thickness = 0.01});
      if (wasDetected) detection.detectCollision();
      detection.setPositions(mesh, isJoinedAtRest ? apart : joined);
      detection.detectCollision();
      EXPECT_EQ(detection.collisionData(mesh, mesh).validity().unwelded, isJoinedAtRest)
          << (wasDetected ? "detected before" : "not detected before");
    }
}

INSTANTIATE_TEST_SUITE_P(
    Validity, ValidityOfMethod,
    ::testing::Values(MethodCase{"Intersection", {Method::Intersection}},
                      MethodCase{"ProximityDistinct", {Method::Proximity, kSheetThickness}},
                      MethodCase{"ProximityAll",
                                 {Method::Proximity, kSheetThickness, Contacts::All}},
                      MethodCase{"Continuous", {Method::Continuous, 0}},
                      MethodCase{"ContinuousWithThickness", {Method::Continuous, kSheetThickness}},
                      MethodCase{"AutoDistinct", {Method::Auto, kSheetThickness}},
                      MethodCase{"AutoAll", {Method::Auto, kSheetThickness, Contacts::All}},
                      MethodCase{"AutoWithoutThickness", {Method::Auto, 0}}),
    [](const auto& test) { return test.param.name; });

/// Of those that move further than the limit, the first. A motion of both meshes does not count.
TEST(Validity, NamesFastVertices) {
  const Mesh low = flat(12, 0), high = flat(12, 1);
  for (const Vector3d& common : {Vector3d(0, 0, 0), Vector3d(0, 0.5, 1)})
    for (const std::uint32_t every : {1u, 2u, 60u}) {
      PairRun run(settingsOf(Engine::Octree), high, low, {Method::Proximity, 0.01}, false);
      Positions now = moved(high, common).positions;
      std::vector<std::uint32_t> fast;
      for (std::uint32_t v = 0; v < now.size(); v += every) {
        now[v].x() += 0.5;
        if (fast.size() < Validity::kMaxFastVertices) fast.push_back(v);
      }
      run.step(high.positions, now, low.positions, moved(low, common).positions);
      EXPECT_EQ(run.data().validity().untrustedVerticesA, fast);
    }
}

/// Two sheets, the second one within the thickness above the first one.
struct NearSheets {
  explicit NearSheets(Method method) {
    for (Vector3d& p : high) p.z() += 0.02;
    collisions.setPositions(b, high, high);
    collisions.addCollisionPair(a, b, {.method = method, .thickness = 0.05});
  }
  const Validity& validity() const { return collisions.collisionData(a, b).validity(); }

  const Mesh low = sheet(4, 0.0, 0.0);
  Positions high = low.positions;
  OctreeBasedCD collisions;
  GeometryId a = addMesh(collisions, low), b = addMesh(collisions, low);
};

/// After a step without motion a solver moves positions by less than the thickness, so that the
/// meshes intersect.
TEST(StartedApart, IsFalseAfterACorrectionBeyondTheRemainingDistance) {
  NearSheets sheets(Method::Continuous);
  sheets.collisions.detectCollision();
  EXPECT_TRUE(sheets.validity().startedApart);
  sheets.collisions.advance();
  for (Vector3d& p : sheets.high) p.z() -= p.x() > 0.5 ? 0.04 : 0.0;
  sheets.collisions.setPositions(sheets.b, sheets.high, sheets.high);
  sheets.collisions.detectCollision();
  EXPECT_FALSE(sheets.validity().startedApart);
}

/// Moves a mesh over two large triangles, which may be part of it, by these steps, the first from
/// where it is. No step is said to start apart if brute force finds that the previous one ended in
/// a touch. Returns whether the last one is.
bool startsApart(const PairSettings& settings, bool self, const Mesh& mesh,
                 std::initializer_list<Vector3d> steps) {
  const Mesh floor = flat(1, 0);
  PairRun run(settingsOf(Engine::Octree), self ? joined(mesh, floor) : mesh,
              self ? moved(floor, {9, 9, 9}) : floor, settings, self),
      truth(settingsOf(Engine::BruteForce), mesh, floor, {Method::Intersection}, false);
  const auto data = [&]() -> const CollisionData& {
    return run.detection().collisionData(run.a(), self ? run.a() : run.b());
  };
  Positions positions = mesh.positions;
  bool isApart = true;
  for (const Vector3d& step : steps) {
    for (Vector3d& p : positions) p += step;
    truth.detection().setPositions(truth.a(), positions);
    run.detection().setPositions(run.a(),
                                 self ? joined({positions, {}}, floor).positions : positions);
    for (PairRun* each : {&run, &truth}) each->detect(), each->detection().advance();
    EXPECT_TRUE(isApart || !data().validity().startedApart);
    EXPECT_TRUE(settings.method == Method::Auto || data().intersectingTriangles().empty());
    const FrameStatistics& counts = run.detection().statistics();
    EXPECT_LE(counts.exactDecisions, 64 * (counts.candidatePairs + counts.validityPairs));
    isApart = truth.data().intersectingTriangles().empty();
  }
  return data().validity().startedApart;
}

/// The spike pierces the triangle further than the thickness from its edges, or comes to stand on
/// it. The flat mesh comes to lie on it.
TEST(StartedApart, IsFalseAfterAStepThatEndsInATouchOrAPiercing) {
  const Mesh tip = spike({0.7, 0.3, 0.125}, 0.5);
  const Vector3d rest = Vector3d::Zero(), down(0, 0, -0.125), side(0.03125, 0, 0), up(0, 0, 0.25);
  for (const bool self : {false, true})
    for (const Method method : {Method::Proximity, Method::Continuous, Method::Auto})
      for (const double thickness : {0.0625, 0.25, 0.5}) {
        SCOPED_TRACE(::testing::Message() << toString(method) << " " << thickness << " " << self);
        PairSettings settings{method, thickness};
        settings.continuous.timeTolerance = 0x1p-50;
        const auto after = [&](const Mesh& mesh, std::initializer_list<Vector3d> steps) {
          return startsApart(settings, self, mesh, steps);
        };
        EXPECT_TRUE(after(tip, {rest, side, rest, 0.5 * down, rest}));
        EXPECT_FALSE(after(tip, {rest, down, rest, rest}));
        EXPECT_FALSE(after(tip, {rest, 2 * down, rest, rest, side, side, rest}));
        EXPECT_FALSE(after(tip, {rest, 2 * down, side, rest, side, rest}));
        EXPECT_FALSE(after(flat(2, 1), {rest, 7 * down, down, rest}));
        EXPECT_FALSE(after(flat(2, 1), {rest, 8 * down, rest, rest}));
        after(tip, {rest, 2 * down, up, rest, down, side, up, rest});
      }
}

/// Sheets that come near each other in every second step, and never as near as they move. One of
/// them has a small triangle that flies through the other one, so that the step itself does not
/// tell.
TEST(StartedApart, IsKnownOfMotionsShorterThanTheDistance) {
  const Mesh low = flat(8, 0), high = flat(8, 0.15),
             fly = moved(flat(1, 0), {0.52, 0.53, 0.5}, 0.0625);
  PairRun run(settingsOf(Engine::Octree), joined(high, fly), low, {Method::Continuous, 0.1}, false);
  for (int frame = 0; frame < 40; ++frame) {
    const bool isDown = frame % 2;
    run.detection().setPositions(run.a(), joined(moved(high, {0, 0, isDown ? -0.07 : 0.0}),
                                                 moved(fly, {0, 0, isDown ? -1.0 : 0.0}))
                                              .positions);
    run.detect();
    EXPECT_TRUE(run.data().validity().startedApart) << frame;
    EXPECT_TRUE(frame == 0 || run.data().validity().atImpact > 32) << frame;
    run.detection().advance();
  }
}

TEST(StartedApart, IsFalseOfPointsAtOnePlace) {
  for (const double distance : {0.0, 0.0625})
    for (const Method method : {Method::Proximity, Method::Continuous}) {
      OctreeBasedCD collisions;
      const GeometryId a = collisions.addPointSet(Positions{{1, 2, 3}}),
                       b = collisions.addPointSet(Positions{{1, 2, 3 + distance}});
      collisions.addCollisionPair(a, b, {.method = method, .thickness = 0.125});
      collisions.detectCollision();
      EXPECT_EQ(collisions.collisionData(a, b).validity().startedApart, distance > 0.0);
    }
}

/// A cut adds two triangles, one that is apart and one that is not, to one of two meshes.
TEST(StartedApart, IsFalseAfterACutAddsATriangleThatPierces) {
  const Mesh floor = flat(4, 0);
  Mesh other = flat(4, 0.25);
  const auto first = static_cast<std::uint32_t>(other.positions.size());
  for (const double down : {0.0, 0.3})
    for (const Vector3d& p : {Vector3d(0.55, 0.3, 0.3), {0.6, 0.32, 0.5}, {0.5, 0.32, 0.5}})
      other.positions.push_back(p - Vector3d(0, 0, down));
  for (const bool isSwapped : {false, true})
    for (const Method method : {Method::Proximity, Method::Continuous, Method::Auto}) {
      PairRun run(settingsOf(Engine::Octree), isSwapped ? floor : other, isSwapped ? other : floor,
                  {method, 0.01}, false);
      run.detect();
      EXPECT_TRUE(run.data().validity().startedApart);
      run.detection().advance();
      run.detection().replaceTriangles(
          isSwapped ? run.b() : run.a(), {},
          std::vector<Triangle>{{first, first + 1, first + 2}, {first + 3, first + 4, first + 5}},
          {});
      run.detect();
      EXPECT_FALSE(run.data().validity().startedApart);
    }
}

/// Of a body, all triangles are cut out in another one.
TEST(StartedApart, IsTrueOfABodyWithoutTriangles) {
  for (const bool isSwapped : {false, true}) {
    const Mesh body = cube(0, 1), inner = cube(0.25, 0.75);
    PairRun run(settingsOf(Engine::Octree), isSwapped ? inner : body, isSwapped ? body : inner,
                {Method::Auto, 0.1}, false);
    std::vector<std::uint32_t> all(inner.triangles.size());
    std::iota(all.begin(), all.end(), 0u);
    run.detection().replaceTriangles(isSwapped ? run.a() : run.b(), all, {}, {});
    for (int frame = 0; frame < 3; ++frame) {
      run.detect();
      EXPECT_TRUE(run.data().validity().startedApart);
      EXPECT_EQ(run.detection().statistics().contacts, 0u);
      run.detection().advance();
    }
  }
}

/// A check that no detection finished was not made.
TEST(StartedApart, IsCheckedAfterDetectionsThatThrew) {
  NearSheets sheets(Method::Proximity);
  sheets.collisions.setContactPredicate(sheets.a, sheets.b,
                                        [](const ContactFeatures&) -> bool { throw 1; });
  for (int i = 0; i < 6; ++i) EXPECT_THROW(sheets.collisions.detectCollision(), int);
  sheets.collisions.setContactPredicate(sheets.a, sheets.b, {});
  sheets.collisions.detectCollision();
  EXPECT_TRUE(sheets.validity().startedApart);
  EXPECT_TRUE(sheets.validity().trusted);
}

}  // namespace
}  // namespace palpate
