#include "Common/DegenerateCases.h"
#include "Common/PairRun.h"
#include "Common/Sanitized.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <iostream>

// Validity::trusted is never true for a wrong answer. The reference is exact: impacts of
// Method::Continuous at thickness 0, and Method::Intersection of the positions at the step's start.

namespace palpate {
namespace {

using namespace testing;
using Eigen::Vector3d;
using Positions = std::vector<Vector3d>;

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

/// Frames with a wrong answer, and frames with a correct answer that was not trusted.
struct Tally {
  std::size_t frames = 0, wrong = 0, silent = 0, refused = 0, refusedRight = 0;
  friend std::ostream& operator<<(std::ostream& out, const Tally& t) {
    return out << t.frames << " frames, wrong " << t.wrong << ", silent " << t.silent
               << ", not trusted " << t.refused << ", though right " << t.refusedRight;
  }
  void add(bool isWrong, bool trusted) {
    ++frames;
    wrong += isWrong;
    silent += isWrong && trusted;
    refused += !trusted;
    refusedRight += !isWrong && !trusted;
  }
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
      tally.add(wrong, validity.trusted);
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
      std::cout << (response ? "response, " : "") << "speed " << speed << ": " << tally << "\n";
      all.wrong += tally.wrong;
    }
    if (GetParam().settings.method == Method::Proximity) {
      EXPECT_GE(all.wrong, leastOf(101));
    }
  }
}

/// A ball and a sheet as one mesh.
Mesh asOne(const BallAndSheet& scene) {
  Mesh mesh = scene.ball;
  append(mesh, scene.sheet);
  return mesh;
}

/// Frames of histories of bodies that go through each other and back, by startedApart.
struct Known {
  std::size_t frames = 0, apart = 0, foundApart = 0, looks = 0;
};

/// Without correction. place(frame, positions at rest, is second mesh) gives the positions.
template <class Place>
Known livesThrough(const PairSettings& settings, const Mesh& a, const Mesh* b, int threads,
                   Place&& place) {
  Known known;
  OctreeBasedCD detection(settingsOf(Engine::Octree, threads));
  OctreeBasedCD truth(settingsOf(Engine::BruteForce));
  OctreeBasedCD all(settingsOf(Engine::Octree, threads));  // impacts that Distinct excludes
  const auto add = [&](OctreeBasedCD& to, const PairSettings& pair) {
    const GeometryId first = addMesh(to, a);
    to.addCollisionPair(first, b ? to.addTriangleMesh(b->positions, b->triangles) : first, pair);
  };
  add(detection, settings);
  add(truth, {Method::Intersection});
  add(all, {Method::Continuous, settings.thickness, Contacts::All});
  const auto dataOf = [](const OctreeBasedCD& each) -> const CollisionData& {
    return each.collisionData(each.pairs().front().a, each.pairs().front().b);
  };
  for (int frame = 0; frame < 48; ++frame) {
    const Positions nowA = place(frame, a.positions, false),
                    nowB = b ? place(frame, b->positions, true) : Positions{};
    for (OctreeBasedCD* each : {&detection, &truth, &all}) {
      const CollisionPair pair = each->pairs().front();
      each->setPositions(pair.a, nowA);
      if (b) each->setPositions(pair.b, nowB);
    }
    // This step starts where the previous one ended.
    const bool apart = frame > 0 && dataOf(truth).intersectingTriangles().empty();
    for (OctreeBasedCD* each : {&detection, &truth, &all}) {
      each->detectCollision();
      each->advance();
    }
    if (frame == 0) continue;
    const bool found = dataOf(detection).validity().startedApart;
    EXPECT_TRUE(apart || !found) << "frame " << frame;
    ++known.frames;
    known.apart += apart;
    known.foundApart += found;
    const FrameStatistics& statistics = detection.statistics();
    std::size_t contacts = statistics.contacts;
    if (settings.method == Method::Continuous) contacts = all.statistics().contacts;
    if (settings.method == Method::Auto) contacts += all.statistics().contacts;
    known.looks += statistics.validityPairs > contacts + 32;
    EXPECT_LE(statistics.validityPairs, statistics.candidatePairs + contacts + 32);
  }
  // If contacts do not tell, the initial intersection check runs once, and later now and then.
  if (settings.method != Method::Auto) {
    EXPECT_LE(known.looks, 4 + known.frames / 16);
  }
  return known;
}

TEST_P(ValidityOfMethod, KnowsStartedApartFromImpactsOfThePreviousStep) {
  const PairSettings& settings = GetParam().settings;
  if (settings.method == Method::Intersection) return;  // the check does not run
  const BallAndSheet scene;
  const Mesh one = asOne(scene);
  Known all;
  const auto count = [&](const Known& known) {
    all.frames += known.frames;
    all.apart += known.apart;
    all.foundApart += known.foundApart;
  };
  for (const bool itself : {false, true})
    for (const double speed : {0.05, 0.1, 0.3})
      for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(casesOf(12, 3)); ++seed) {
        SCOPED_TRACE((itself ? "itself, speed " : "speed ") + std::to_string(speed) + ", seed " +
                     std::to_string(seed));
        Random random(seed);
        // At the top of each swing apart, and at its lowest in the sheet or through it.
        count(livesThrough(settings, itself ? one : scene.ball, itself ? nullptr : &scene.sheet,
                           1 + seed % 2, [&](int frame, Positions now, bool isSheet) {
                             const double height = speed * (std::cos(0.7 * frame) - 1.0);
                             for (std::size_t v = 0; v < now.size(); ++v) {
                               const bool ofBall = !isSheet && v < scene.ball.positions.size();
                               now[v] += Vector3d(0, 0, ofBall ? height : 0.0) +
                                         randomPoint(random, -0.01, 0.01);
                             }
                             return now;
                           }));
      }
  // Where a single feature decides.
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(casesOf(300, 100)); ++seed) {
    SCOPED_TRACE("few triangles, seed " + std::to_string(seed));
    Random random(1000 + seed);
    Mesh few[2];
    for (Mesh& mesh : few) {
      for (int v = 0; v < 4; ++v) mesh.positions.push_back(randomPoint(random, 0.0, 1.0));
      mesh.triangles = {{0, 1, 2}, {2, 1, 3}};
    }
    if (seed % 3 == 0) few[0].triangles = {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}};
    const bool itself = seed % 4 == 3;
    if (itself) {
      few[0].positions.push_back(few[1].positions[0]);
      few[0].triangles = {{0, 1, 2}, {2, 1, 3}, {2, 3, 4}};
    }
    Positions walk[2];
    count(livesThrough(settings, few[0], itself ? nullptr : &few[1], 1,
                       [&](int frame, const Positions& rest, bool second) {
                         Positions& now = walk[second];
                         if (frame == 0) now = rest;
                         for (std::size_t v = 0; v < now.size(); ++v)
                           now[v] += 0.1 * (rest[v] - now[v]) + randomPoint(random, -0.15, 0.15);
                         return now;
                       }));
  }
  std::cout << all.frames << " frames, " << all.apart << " started apart, known of "
            << all.foundApart << "\n";
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

/// Read while positions are copied or later, it is the displacement of the same step.
TEST(Displacement, IsTheRelativeMotionOfTheStep) {
  for (const int threads : {1, 2}) {
    Random random(3);
    const Mesh mesh = soup(random, 7000, 0.01);
    Mesh away = soup(random, 1, 0.1);
    for (Vector3d& p : away.positions) p += Vector3d(100, 0, 0);
    PairRun run(settingsOf(Engine::Octree, threads), mesh, away,
                {Method::Proximity, kSheetThickness}, false);
    Positions last = mesh.positions;
    const auto moved = [&](const Positions& from) {
      Positions to = from;
      const double size = uniform(random, 0.0, 0.01);
      for (Vector3d& p : to) p += randomPoint(random, -size, size);
      return to;
    };
    for (int frame = 0; frame < 12; ++frame) {
      Positions before = last;
      if (frame % 3 == 1)
        run.detection().setPositions(run.a(), moved(last));  // the place of another one
      const Positions now = moved(last);
      if (frame % 4 == 3) before = moved(last);
      if (frame % 4 == 3)
        run.detection().setPositions(run.a(), before, now);
      else
        run.detection().setPositions(run.a(), now);
      run.detect();
      Vector3d most = Vector3d::Zero();
      for (std::size_t v = 0; v < now.size() && frame > 0; ++v)
        most = most.cwiseMax((now[v] - before[v]).cwiseAbs());
      EXPECT_NEAR(run.data().validity().displacement, most.norm(), 1e-12) << "frame " << frame;
      run.detection().advance();
      last = now;
    }
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

/// Of those that move further than the limit, the first.
TEST(Validity, NamesFastVertices) {
  const Mesh low = flat(12, 0), high = flat(12, 1);
  for (const std::uint32_t every : {1u, 2u}) {
    PairRun run(settingsOf(Engine::Octree), high, low, {Method::Proximity, 0.01}, false);
    Positions now = high.positions;
    std::vector<std::uint32_t> fast;
    for (std::uint32_t v = 0; v < now.size(); v += every) {
      now[v].x() += 0.5;
      if (fast.size() < Validity::kMaxFastVertices) fast.push_back(v);
    }
    run.step(high.positions, now, low.positions, low.positions);
    EXPECT_EQ(run.data().validity().untrustedVerticesA, fast);
  }
}

/// A step without motion, with features within the thickness. Then a solver moves positions by less
/// than the thickness, so that the meshes intersect.
TEST(StartedApart, IsFalseAfterACorrectionBeyondTheRemainingDistance) {
  const Mesh low = sheet(4, 0.0, 0.0);
  std::vector<Eigen::Vector3d> high = low.positions;
  for (Eigen::Vector3d& p : high) p.z() += 0.02;
  OctreeBasedCD collisions;
  const GeometryId a = addMesh(collisions, low),
                   b = collisions.addTriangleMesh(high, low.triangles);
  collisions.addCollisionPair(a, b, {.method = Method::Continuous, .thickness = 0.05});
  collisions.detectCollision();
  EXPECT_TRUE(collisions.collisionData(a, b).validity().startedApart);
  collisions.advance();
  for (Eigen::Vector3d& p : high) p.z() -= p.x() > 0.5 ? 0.04 : 0.0;
  collisions.setPositions(b, high, high);
  collisions.detectCollision();
  EXPECT_FALSE(collisions.collisionData(a, b).validity().startedApart);
}

/// A check that no detection finished was not made.
TEST(StartedApart, IsCheckedAfterDetectionsThatThrew) {
  const Mesh low = sheet(4, 0.0, 0.0);
  std::vector<Eigen::Vector3d> high = low.positions;
  for (Eigen::Vector3d& p : high) p.z() += 0.02;
  OctreeBasedCD collisions;
  const GeometryId a = addMesh(collisions, low),
                   b = collisions.addTriangleMesh(high, low.triangles);
  collisions.addCollisionPair(a, b, {.method = Method::Proximity, .thickness = 0.05});
  collisions.setContactPredicate(a, b, [](const ContactFeatures&) -> bool { throw 1; });
  for (int i = 0; i < 6; ++i) EXPECT_THROW(collisions.detectCollision(), int);
  collisions.setContactPredicate(a, b, [](const ContactFeatures&) { return true; });
  collisions.detectCollision();
  EXPECT_TRUE(collisions.collisionData(a, b).validity().startedApart);
  EXPECT_TRUE(collisions.collisionData(a, b).validity().trusted);
}

}  // namespace
}  // namespace palpate
