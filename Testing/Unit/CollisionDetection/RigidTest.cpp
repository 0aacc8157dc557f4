#include <palpate/Capture.h>

#include "Common/ExpectRefused.h"
#include "Common/QueryCalls.h"
#include "Common/Sanitized.h"
#include "Common/TestGeometry.h"
#include "Core/SimdPath.h"

#include <Eigen/Geometry>

#include <array>
#include <functional>
#include <optional>

// Geometries that setTransform() moves. The reference is the same scene with positions fl(R x + t),
// and brute force.

namespace palpate::testing {
namespace {

using Eigen::Matrix3d;

Place somewhere(Random& random) {
  const Vector3d axis = randomPoint(random, -1, 1);
  const double angle = uniform(random, 0, 3);
  return Place().then(axis, angle, {0.5, 0.5, 0.5}, randomPoint(random, -0.1, 0.1));
}

/// The transforms of the frames.
enum class Way { Still, Slide, Exact, Small, Large, Far };

std::vector<Place> placesOf(Random& random, Way way) {
  const Vector3d middle(0.5, 0.5, 0.5), up = Vector3d::UnitZ();
  std::vector<Place> places;
  Place place;
  if (way == Way::Far) place.translation = {4e6, -3e7, 2e6};
  if (way == Way::Slide || way == Way::Small || way == Way::Large) place = somewhere(random);
  for (int frame = 0; frame < 4; ++frame) {
    places.push_back(place);
    if (way == Way::Slide) place = place.then(up, 0, middle, randomPoint(random, -0.1, 0.1));
    if (way == Way::Exact)
      place = {(Matrix3d() << 0, -1, 0, 1, 0, 0, 0, 0, 1).finished(), {1, 0, 0}};
    const Vector3d axis = randomPoint(random, -1, 1);
    if (way == Way::Small || way == Way::Far)
      place = place.then(axis, 0.02, middle + (way == Way::Far ? place.translation : 0 * up),
                         randomPoint(random, -0.01, 0.01));
    if (way == Way::Large) place = place.then(axis, 0.8, middle, randomPoint(random, -0.3, 0.3));
  }
  return places;
}

/// A pair over some frames. The body is moved by transforms, or by the same positions.
class RigidRun {
 public:
  RigidRun(Settings settings, const TestGeometry& body, const TestGeometry& other,
           const PairSettings& pair, bool bodyFirst, bool byTransform)
      : m_collisions(settings),
        m_positions(body.positions),
        m_byTransform(byTransform),
        m_body(body.addTo(m_collisions)),
        m_other(other.addTo(m_collisions)),
        m_a(bodyFirst ? m_body : m_other),
        m_b(bodyFirst ? m_other : m_body) {
    m_collisions.addCollisionPair(m_a, m_b, pair);
  }
  void frame(const Place& place, const Place* ofOther, const Positions& other) {
    if (std::exchange(m_hasFrame, true)) m_collisions.advance();
    move(m_body, place, m_positions);
    if (ofOther)
      move(m_other, *ofOther, other);
    else
      m_collisions.setPositions(m_other, other);
    m_collisions.detectCollision();
    EXPECT_EQ(m_collisions.octree().validate(), std::vector<std::string>{});
  }
  OctreeBasedCD& collisions() { return m_collisions; }
  const CollisionData& data() const { return m_collisions.collisionData(m_a, m_b); }
  std::vector<ElementPair> candidates() { return m_collisions.candidatePairs(m_a, m_b); }
  GeometryId body() const { return m_body; }

 private:
  void move(GeometryId id, const Place& place, const Positions& positions) {
    if (m_byTransform)
      m_collisions.setTransform(id, place.pose());
    else
      m_collisions.setPositions(id, place(positions));
  }
  OctreeBasedCD m_collisions;
  Positions m_positions;
  bool m_byTransform;
  GeometryId m_body, m_other, m_a, m_b;
  bool m_hasFrame = false;
};

struct RigidCase {
  Way way = Way::Small;
  bool bodyFirst = true, bothRigid = false;
  std::function<void(OctreeBasedCD&, GeometryId body)> setUp = [](auto&, GeometryId) {};
};

/// size: L, the size of coordinates, from which motion is bounded with a reserve for rounding.
void expectSameValidity(const Validity& found, const Validity& truth, double size) {
  EXPECT_NEAR(found.displacement, truth.displacement, 1e-13 * size);
  EXPECT_GE(found.displacement, truth.displacement);
  EXPECT_LE(found.trusted, truth.trusted);
  EXPECT_EQ(found.startedApart, truth.startedApart);
  EXPECT_EQ(found.method, truth.method);
  EXPECT_EQ(found.reason, truth.reason);
  EXPECT_EQ(found.atEnd, truth.atEnd);
  EXPECT_EQ(found.atImpact, truth.atImpact);
  EXPECT_EQ(found.untrustedVerticesA, truth.untrustedVerticesA);
  EXPECT_EQ(found.untrustedVerticesB, truth.untrustedVerticesB);
}

/// Brute force, then the octree with each kind of bounds. Leaves are small, so that there are
/// nodes.
std::vector<Settings> boundsSettings(int threads = 1) {
  std::vector<Settings> all{settingsOf(Engine::BruteForce)};
  for (const OctreeBounds bounds : {OctreeBounds::Box, OctreeBounds::Dop14, OctreeBounds::Dop18}) {
    all.push_back(settingsOf(Engine::Octree, threads));
    all.back().octree.bounds = bounds;
    all.back().octree.maxElementsPerLeaf = 3;
  }
  return all;
}

/// One step of two placed bodies: octrees with each kind of bounds have the contacts of brute
/// force. Returns how many there are.
std::size_t expectEveryBounds(const TestGeometry& a, const TestGeometry& b,
                              const PairSettings& pair, const std::array<Place, 2>& before,
                              const std::array<Place, 2>& now, int threads = 1) {
  std::optional<Rows> truth;
  for (const Settings& settings : boundsSettings(threads)) {
    OctreeBasedCD collisions(settings);
    const GeometryId ids[] = {a.addTo(collisions), b.addTo(collisions)};
    collisions.addCollisionPair(ids[0], ids[1], pair);
    for (const std::size_t i : {0, 1})
      collisions.setTransform(ids[i], before[i].pose(), now[i].pose());
    collisions.detectCollision();
    EXPECT_EQ(collisions.octree().validate(), std::vector<std::string>{});
    const Rows rows(collisions.collisionData(ids[0], ids[1]));
    if (!truth) truth = rows;
    expectSameRows(rows, *truth);
  }
  return truth->contacts();
}

/// Every engine with transforms has the contacts of the same positions. Returns the contacts of all
/// frames.
std::size_t expectAsPositions(Random& random, const TestGeometry& body, const TestGeometry& other,
                              const PairSettings& pair, const RigidCase& run) {
  const std::vector<Place> places = placesOf(random, run.way);
  const auto runOf = [&](const Settings& settings, bool byTransform) {
    return RigidRun(settings, body, other, pair, run.bodyFirst, byTransform);
  };
  std::vector<RigidRun> rigid;
  for (const int threads : {1, 2})
    rigid.push_back(runOf(settingsOf(Engine::Octree, threads), true));
  if (run.bothRigid)
    for (const int threads : {1, 2})
      for (const Settings& settings : boundsSettings(threads))
        rigid.push_back(runOf(settings, true));
  rigid.push_back(runOf(settingsOf(Engine::BruteForce), true));
  RigidRun truth = runOf(settingsOf(Engine::Octree), false);
  for (RigidRun& one : rigid) run.setUp(one.collisions(), one.body());
  run.setUp(truth.collisions(), truth.body());
  std::size_t contacts = 0;
  double largest = 0;
  for (const Vector3d& p : body.positions) largest = std::max(largest, p.norm());
  Place ofOther = places[0];
  for (const Place& place : places) {
    ofOther = ofOther.then({1, 2, 3}, 0.01, ofOther({0.5, 0.5, 0.5}), {0, 0, 0});
    Positions now =
        run.bothRigid ? other.positions : places[0](moved(random, other.positions, 0.02));
    for (RigidRun& one : rigid) one.frame(place, run.bothRigid ? &ofOther : nullptr, now);
    truth.frame(place, run.bothRigid ? &ofOther : nullptr, now);
    const Rows expected(truth.data());
    contacts += expected.contacts() + expected.intersectingTriangles.size() +
                (expected.earliestTimeOfImpact <= 1.0);
    const auto candidates = rigid.back().candidates();
    for (RigidRun& one : rigid) {
      expectSameRows(Rows(one.data()), expected);
      expectSameValidity(one.data().validity(), truth.data().validity(),
                         10 + place.translation.norm() + largest);
      EXPECT_EQ(candidates, one.candidates());
    }
    EXPECT_TRUE(std::ranges::includes(truth.candidates(), candidates));
    for (std::size_t i = 0; i < rigid.size(); i += 2) rigid[i].collisions().releaseMemory();
  }
  return contacts;
}

constexpr Way kWays[] = {Way::Still, Way::Slide, Way::Exact, Way::Small, Way::Large, Way::Far};

TEST(Rigid, TrianglesMatchSetPositions) {
  Random random(1);
  const TestGeometry body = testGeometry(sphere(4, 5, {0.5, 0.5, 0.5}, 0.4)),
                     tissue = testGeometry(sheet(4, 0.5, 1.0));
  std::vector<PairSettings> all = settingsFor(0.03);
  all.push_back({Method::Intersection, 0.0});
  all.push_back({Method::Auto, 0.0});
  all.push_back({Method::Auto, 0.03});
  all.push_back({.method = Method::Auto,
                 .thickness = 0.2,
                 .contacts = Contacts::Distinct,
                 .automatic = {.motionTolerance = 0.4}});
  std::size_t number = 0;
  for (const PairSettings& pair : all)
    for (const Way way : kWays) {
      if (isLeftOut(number++)) continue;
      SCOPED_TRACE(::testing::Message() << "method " << int(pair.method) << " way " << int(way)
                                        << " thickness " << pair.thickness);
      std::size_t contacts = 0;
      for (const bool first : {true, false})
        contacts += expectAsPositions(random, body, tissue, pair, {way, first});
      for (const bool first : {true, false})
        contacts += expectAsPositions(random, tissue, body, pair, {way, first, true});
      EXPECT_GT(contacts, 5u);
      if (HasFailure()) return;
    }
}

TEST(Rigid, SoupsMatchSetPositions) {
  Random random(2);
  const TestGeometry body = testGeometry(soup(random, 40, 0.2)),
                     other = testGeometry(soup(random, 40, 0.2));
  for (const Way way : kWays)
    EXPECT_GT(expectAsPositions(random, body, other, {Method::Auto, 0.05}, {way, way == Way::Far}),
              20u);
}

TEST(Rigid, LinesAndPointsMatchSetPositions) {
  Random random(3);
  const TestGeometry tissue = testGeometry(sheet(4, 0.5, 1.0)),
                     needle = thread(random, 20, 0.2, 0.02, false),
                     tapering = tapered(random, thread(random, 20, 0.2, 0, true), 0.05),
                     smoke = particles(random, 60, 0.02);
  std::size_t number = 0;
  for (const auto& [body, other] : Pairs{{&tissue, &needle},
                                         {&tissue, &smoke},
                                         {&needle, &tissue},
                                         {&smoke, &tissue},
                                         {&needle, &smoke},
                                         {&smoke, &needle},
                                         {&needle, &tapering},
                                         {&tapering, &tissue}})
    for (const PairSettings& pair :
         settingsFor(0.02, body->radii.size() == 1 && other->radii.size() == 1))
      for (const Way way : {Way::Small, Way::Large, Way::Far}) {
        if (isLeftOut(number++)) continue;
        SCOPED_TRACE(::testing::Message() << "kinds " << int(body->type) << int(other->type)
                                          << " method " << int(pair.method) << " way " << int(way));
        expectAsPositions(random, *body, *other, pair, {way, way != Way::Large, way == Way::Large});
        if (HasFailure()) return;
      }
}

/// Bodies above each other, placed and by their positions, with thicknesses at which a contact
/// begins: the distance of a contact, and the doubles beside it.
TEST(Rigid, ContactsBeginAtTheSameThickness) {
  Random random(31);
  TestGeometry floor = testGeometry(sheet(4, 0.0, 1.0));
  for (Vector3d& p : floor.positions) p.z() = 0.0;
  const std::array<Positions, 2> corners{Positions{{0.2, 0.3, 0}, {0.7, 0.3, 0}, {0.2, 0.8, 0}},
                                         Positions{{0.2, 0.3, 0}, {0.7, 0.3, 0}, {0.2, 0.8, 0.3}}};
  std::size_t begun = 0;
  for (int repeat = 0; repeat < casesOf(60); ++repeat) {
    const double size = std::exp2(uniform(random, -3, 12)), height = uniform(random, 0.02, 0.4);
    Place place;
    place.rotation = Eigen::AngleAxisd(uniform(random, 0, 6), Vector3d::UnitZ()).toRotationMatrix();
    place.translation = randomPoint(random, -size, size);
    const Vector3d up = Vector3d::UnitZ();
    const Place above = place.then(up, uniform(random, 0, 6), place({0.5, 0.5, 0}), height * up);
    const Positions& of = corners[repeat % 2];
    const TestGeometry others[] = {
        {GeometryType::Triangles, of, {{0, 1, 2}}, {}},
        {GeometryType::Lines, of, {}, {{0, 1}, {1, 2}}, {uniform(random, 0, 0.01)}},
        {GeometryType::Lines, of, {}, {{0, 1}, {1, 2}}, {0.001, 0.002, 0.007}},
        {GeometryType::Points, of, {}, {}, {uniform(random, 0, 0.01)}}};
    for (const TestGeometry& other : others)
      for (const Method method : {Method::Proximity, Method::Auto}) {
        const auto with = [&](const Settings& settings, double thickness, bool byTransform,
                              auto&& use) {
          RigidRun run(settings, floor, other, {method, thickness, Contacts::All}, repeat % 3 == 0,
                       byTransform);
          run.frame(place, byTransform ? &above : nullptr,
                    byTransform ? other.positions : above(other.positions));
          return use(run.data());
        };
        const auto rowsOf = [&](const Settings& settings, double thickness, bool byTransform) {
          return with(settings, thickness, byTransform,
                      [](const CollisionData& data) { return Rows(data); });
        };
        const double first =
            with(settingsOf(Engine::BruteForce), 1.0, true,
                 [](const CollisionData& data) { return leastDistance(data, 1.0); });
        for (const double thickness :
             {std::nextafter(first, 0.0), first, std::nextafter(first, 9.0)}) {
          const Rows truth = rowsOf(settingsOf(Engine::BruteForce), thickness, false);
          begun += truth.contacts() > 0;
          for (const Settings& settings : boundsSettings())
            for (const bool byTransform : {true, false})
              expectSameRows(rowsOf(settings, thickness, byTransform), truth);
        }
        if (HasFailure()) return;
      }
  }
  EXPECT_GE(begun, leastOf(700));
}

TEST(Rigid, FiltersApply) {
  Random random(4);
  const TestGeometry body = testGeometry(sphere(7, 9, {0.5, 0.5, 0.5}, 0.4)),
                     tissue = testGeometry(sheet(7, 0.5, 1.0));
  for (const Method method : {Method::Proximity, Method::Continuous, Method::Intersection}) {
    const auto filter = [](OctreeBasedCD& collisions, GeometryId id) {
      collisions.setCollisionFilter(id, {.sidedness = Sidedness::Outer});
      collisions.setDisabledElements(id, std::vector<std::uint32_t>{1, 5, 9, 20, 21, 22, 23});
    };
    EXPECT_GT(
        expectAsPositions(random, body, tissue, {method, method == Method::Proximity ? 0.05 : 0.0},
                          {Way::Large, true, false, filter}),
        0u);
  }
}

/// A vertex so far away that floats are clamped, and another that makes the octree flat.
TEST(Rigid, VerticesFarAwayMatchSetPositions) {
  Random random(5);
  for (const double far : {1e4, 1e30, 1e60}) {
    TestGeometry body = testGeometry(soup(random, 40, 0.2));
    body.positions[3] = {far, 0.5 * far, -far};
    const TestGeometry other = testGeometry(soup(random, 40, 0.2));
    expectAsPositions(random, body, other, {Method::Proximity, 0.05, Contacts::All}, {Way::Small});
    expectAsPositions(random, body, other, {Method::Continuous, 0.0}, {Way::Small});
  }
}

/// Two bodies in one frame, with all vertices in one of its planes. The product of their rotations
/// is the identity but for rounding, which moves vertices out of the plane by more than their boxes
/// are thick.
TEST(Rigid, FlatBodiesTouchInOneFrame) {
  Random random(8);
  const TestGeometry flat = testGeometry(sheet(4, 0.0, 0.0));
  // Planes across directions of boxes and of k-DOPs. Their positions are exact.
  const std::array<std::array<Vector3d, 2>, 3> planes{
      {{{{0, 0, 1}, {0, 1, 0}}}, {{{0, 0, 1}, {1, -1, 0}}}, {{{1, -1, 0}, {0, 1, -1}}}}};
  for (const auto& [right, up] : planes)
    for (const Method method : {Method::Intersection, Method::Continuous})
      for (int repeat = 0; repeat < casesOf(20, 4); ++repeat) {
        TestGeometry body = flat;
        for (Vector3d& p : body.positions)
          p = (1000 * p[0] - 500) * right + (1000 * p[1] - 500) * up;
        Place place = somewhere(random);
        place.translation.setZero();
        EXPECT_GT(expectEveryBounds(body, body, {method, 0.0}, {place, place}, {place, place}), 0u);
      }
}

/// With a large time tolerance, Continuous also reports features that pass at more than the
/// thickness. Whether it does must not depend on the frame in which boxes are compared.
TEST(Rigid, NearMissesMatchBruteForce) {
  Random random(9);
  PairSettings pair{Method::Continuous, 0.01, Contacts::All};
  pair.continuous.timeTolerance = 0.5;
  std::size_t contacts = 0;
  for (int repeat = 0; repeat < casesOf(150, 30); ++repeat) {
    const TestGeometry first = testGeometry(soup(random, 60, 0.3)),
                       second = testGeometry(soup(random, 60, 0.3));
    const Place still = somewhere(random), before = somewhere(random);
    const Vector3d axis = randomPoint(random, -1, 1);
    const double angle = uniform(random, 0, 1);
    const Place now =
        before.then(axis, angle, before({0.5, 0.5, 0.5}), randomPoint(random, -0.3, 0.3));
    contacts += expectEveryBounds(first, second, pair, {still, before}, {still, now}) +
                expectEveryBounds(first, second, pair, {before, still}, {now, still});
    if (HasFailure()) return;
  }
  EXPECT_GE(contacts, leastOf(10000, 1500));
}

/// Two bodies in generic places, near each other or touching, that move and turn in the step.
TEST(Rigid, BoundsDoNotChangeContacts) {
  Random random(10);
  const TestGeometry ball = testGeometry(sphere(9, 12, {0.5, 0.5, 0.5}, 0.4)),
                     leaf = testGeometry(sheet(8, 0.5, 1.0)),
                     mess = testGeometry(soup(random, 90, 0.1)),
                     needle = thread(random, 60, 0.1, 0.02, false),
                     tapering = tapered(random, thread(random, 60, 0.1, 0, true), 0.05),
                     smoke = tapered(random, particles(random, 120, 0.0), 0.05);
  struct BoundsCase {
    const TestGeometry *a, *b;
    bool continuous = true;
  };
  const BoundsCase cases[] = {
      {&ball, &leaf},         {&mess, &ball},           {&leaf, &needle},
      {&needle, &mess},       {&smoke, &leaf, false},   {&tapering, &ball, false},
      {&mess, &smoke, false}, {&needle, &smoke, false}, {&mess, &mess}};
  for (const std::string& path : simdPaths()) {
    SCOPED_TRACE(path);
    useSimdPath(path);
    Random places(11);  // the same cases on every path
    std::size_t number = 0, contacts = 0;
    for (const BoundsCase& one : cases) {
      std::vector<PairSettings> methods = settingsFor(0.01, one.continuous);
      if (one.continuous && one.a->type == GeometryType::Triangles &&
          one.b->type == GeometryType::Triangles)
        methods.insert(methods.end(), {{Method::Intersection, 0.0}, {Method::Auto, 0.0}});
      if (one.continuous) methods.push_back({Method::Auto, 0.02});
      for (const PairSettings& pair : methods)
        for (const double distance : {0.0, 1e5})
          for (int repeat = 0; repeat < 3; ++repeat) {
            // Neither turns in the step, one, or both.
            if (isLeftOut(number++, 5)) continue;
            std::array<Place, 2> before, now;
            for (int i : {0, 1}) {
              before[i] = somewhere(places);
              before[i].translation += Vector3d(distance, -2 * distance, distance);
              const Vector3d axis = randomPoint(places, -1, 1);
              now[i] = before[i].then(axis, i < repeat ? 0.05 : 0.0, before[i]({0.5, 0.5, 0.5}),
                                      randomPoint(places, -0.1, 0.1));
            }
            contacts += expectEveryBounds(*one.a, *one.b, pair, before, now, 1 + repeat % 2);
            if (HasFailure()) {
              useSimdPath("");
              return;
            }
          }
    }
    EXPECT_GE(contacts, leastOf(10000, 1500));
  }
  useSimdPath("");
}

/// Two rods of 9,600 triangles, so that threads share the pair. Further bounds find fewer pairs.
TEST(Rigid, BoundsReduceCandidates) {
  TestGeometry rod = testGeometry(sphere(61, 40, {0, 0, 0}, 1));
  const Matrix3d skew = Eigen::AngleAxisd(0.9, Vector3d(1, 2, 0.5).normalized()).toRotationMatrix();
  for (Vector3d& p : rod.positions) p = skew * Vector3d(p[0], p[1], 20 * p[2]);
  std::vector<Rows> rows;
  std::vector<std::size_t> candidates, bytes;
  for (const int threads : {1, 2})
    for (Settings settings : boundsSettings(threads)) {
      if (settings.engine == Engine::BruteForce || isLeftOut(threads - 1u)) continue;
      settings.octree.maxElementsPerLeaf = 32;
      OctreeBasedCD collisions(settings);
      const GeometryId a = rod.addTo(collisions), b = rod.addTo(collisions);
      collisions.addCollisionPair(a, b, {Method::Proximity, 0.05});
      // The octrees exist before the bodies are placed.
      collisions.detectCollision();
      collisions.setTransform(a, {});
      collisions.setTransform(b, {Matrix3d::Identity(), skew * Vector3d(2.01, 0, 0.3)});
      collisions.detectCollision();
      rows.emplace_back(collisions.collisionData(a, b));
      candidates.push_back(collisions.statistics().candidatePairs);
      bytes.push_back(collisions.octree().statistics().bytes);
      // A body that deforms has boxes.
      collisions.advance();
      Positions deformed = rod.positions;
      deformed[5] *= 1.01;
      collisions.setPositions(a, deformed);
      collisions.detectCollision();
      EXPECT_EQ(collisions.octree().validate(), std::vector<std::string>{});
      rows.emplace_back(collisions.collisionData(a, b));
      expectSameRows(rows[rows.size() - 2], rows[0]);
      expectSameRows(rows.back(), rows[1]);
    }
  EXPECT_GT(rows[0].contacts(), 10u);
  for (std::size_t first = 0; first < candidates.size(); first += 3) {
    EXPECT_LT(candidates[first + 1], 0.7 * static_cast<double>(candidates[first]));
    EXPECT_LT(candidates[first + 2], 0.7 * static_cast<double>(candidates[first]));
    EXPECT_LT(bytes[first], bytes[first + 1]);
    EXPECT_LT(bytes[first + 1], bytes[first + 2]);
  }
}

TEST(Rigid, BoundsDoNotChangeContactsOfQueries) {
  Random random(11);
  const TestGeometry leaf = testGeometry(sheet(20, 0.5, 1.0)),
                     ball = testGeometry(sphere(15, 18, {0.5, 0.5, 0.5}, 0.4));
  RigidMesh probe(ball.positions, ball.triangles);
  for (int repeat = 0; repeat < casesOf(20); ++repeat) {
    const Place place = somewhere(random), pose = somewhere(random);
    std::vector<Rows> rows;
    for (const Settings& settings : boundsSettings()) {
      OctreeBasedCD collisions(settings);
      const GeometryId id = leaf.addTo(collisions);
      collisions.setTransform(id, place.pose());
      CollisionData found;
      collisions.queries().contacts(id, probe, pose.pose(), 0.03, found);
      rows.emplace_back(found);
    }
    EXPECT_GT(rows[0].contacts(), 0u);
    for (const Rows& row : rows) expectSameRows(row, rows[0]);
  }
}

TEST(Rigid, OctreeIsNotUpdated) {
  Random random(6);
  const TestGeometry bone = testGeometry(sphere(40, 50, {0.5, 0.5, 0.5}, 0.4)),
                     organ = testGeometry(sheet(6, 0.5, 1));
  OctreeBasedCD collisions(settingsOf(Engine::Octree, 1, OctreeUpdate::Rebuild));
  const GeometryId body = bone.addTo(collisions), other = organ.addTo(collisions);
  collisions.addCollisionPair(body, other, {Method::Continuous, 0.0});
  collisions.setTransform(body, {});
  collisions.detectCollision();
  const auto boxes = [&] {
    std::vector<Vector3d> all;
    for (const LooseOctree::Node& node : collisions.octree().nodes(body))
      all.push_back(node.fittedBox.min());
    return all;
  };
  const std::vector<Vector3d> built = boxes();
  for (int frame = 0; frame < 5; ++frame) {
    const Place place = somewhere(random);
    collisions.advance();
    collisions.setTransform(body, place.pose());
    collisions.detectCollision();
    EXPECT_EQ(collisions.statistics().rebuiltOctrees + collisions.statistics().refittedOctrees, 0u);
    EXPECT_EQ(collisions.statistics().unchangedOctrees, 2u);
    EXPECT_EQ(boxes(), built);  // in the body's frame
    EXPECT_GT(collisions.statistics().contacts, 0u);
  }
  collisions.setPositions(body, moved(random, bone.positions, 0.01));
  collisions.detectCollision();
  EXPECT_EQ(collisions.statistics().rebuiltOctrees, 1u);
}

/// What ask(collisions, body) finds of a body in both engines, placed by a transform or by its
/// positions: the same.
template <class Ask>
auto placedBothWays(const TestGeometry& body, const Place& place, Ask&& ask) {
  std::vector<std::invoke_result_t<Ask&, OctreeBasedCD&, GeometryId, bool>> found;
  for (const bool byTransform : {true, false})
    for (const Engine engine : {Engine::Octree, Engine::BruteForce}) {
      OctreeBasedCD collisions(settingsOf(engine));
      const GeometryId id = body.addTo(collisions);
      if (byTransform)
        collisions.setTransform(id, place.pose());
      else
        collisions.setPositions(id, place(body.positions));
      found.push_back(ask(collisions, id, byTransform));
      EXPECT_TRUE(found.back() == found.front()) << byTransform << static_cast<int>(engine);
    }
  return found.front();
}

TEST(Rigid, InsideVerticesMatchSetPositions) {
  Random random(8);
  const TestGeometry body = testGeometry(sphere(12, 14, {0.5, 0.5, 0.5}, 0.4)),
                     smoke = particles(random, 400, 0.0);
  for (const double far : {0.0, 1e7}) {
    Place place = somewhere(random);
    place.translation += Vector3d(far, -far, far);
    const Place ofSmoke = place.then({1, 0, 0}, 0.3, place({0.5, 0.5, 0.5}), {0, 0, 0});
    const auto inside = [&](OctreeBasedCD& collisions, GeometryId id, bool byTransform) {
      const GeometryId points = smoke.addTo(collisions);
      if (byTransform)
        collisions.setTransform(points, ofSmoke.pose());
      else
        collisions.setPositions(points, ofSmoke(smoke.positions));
      return testing::insideVertices(collisions, points, id);
    };
    EXPECT_GT(placedBothWays(body, place, inside).size(), 50u);
  }
}

/// A zero's sign reaches positions, so that two transforms that differ in it are not the same.
TEST(Rigid, SignsOfZerosMatchSetPositions) {
  const Vector3d minus = Vector3d::Constant(-0.0), plus = Vector3d::Zero();
  OctreeBasedCD collisions;
  const GeometryId id = collisions.addPointSet(Positions{minus}, 0.0);
  const Matrix3d same = Matrix3d::Identity();
  collisions.setTransform(id, {same, minus}, {same, plus});
  EXPECT_FALSE(std::signbit(collisions.transform(id).translation[0]));
  collisions.setTransform(id, {same, plus}, {same, minus});
  EXPECT_TRUE(std::signbit(collisions.transform(id).translation[0]));
}

TEST(Rigid, ContactsWithShapesMatchSetPositions) {
  Random random(9);
  const TestGeometry body = testGeometry(sphere(8, 9, {0.5, 0.5, 0.5}, 0.4));
  std::size_t contacts = 0;
  for (const AnalyticalGeometry& shape : std::vector<AnalyticalGeometry>{
           Capsule{{0, 0, 0.5}, {1, 1, 0.5}, 0.1}, Box{{0.1, 0.5, 0.5}, {0.2, 0.3, 0.1}},
           Plane{{0.5, 0.5, 0.2}}})
    for (int i = 0; i < 6; ++i)
      placedBothWays(body, somewhere(random), [&](OctreeBasedCD& collisions, GeometryId id, bool) {
        const GeometryId tool = collisions.addAnalyticalGeometry(shape);
        collisions.addCollisionPair(id, tool, {Method::Proximity, 0.02});
        collisions.detectCollision();
        contacts += collisions.statistics().contacts;
        return collisions.collisionData(id, tool).hash();
      });
  EXPECT_GT(contacts, 100u);
}

/// The path of a body that turns evenly about an axis and slides along it, in a thousand parts.
double deviationInParts(const Positions& body, const Place& before, const Vector3d& axis,
                        double angle, const Vector3d& through, double slide) {
  constexpr int kParts = 1000;
  double most = 0;
  const auto at = [&](double s) {
    return before.then(axis, s * angle, through, s * slide * axis.normalized());
  };
  for (int part = 0; part <= kParts; ++part) {
    const double s = double(part) / kParts;
    for (const Vector3d& p : body)
      most = std::max(most, (at(s)(p) - ((1 - s) * at(0)(p) + s * at(1)(p))).norm());
  }
  return most;
}

TEST(Rigid, ArcDeviationIsMeasured) {
  Random random(11);
  const TestGeometry body = testGeometry(sphere(5, 6, {0.5, 0.5, 0.5}, 0.4)),
                     far = testGeometry(sheet(2, 50, 0));
  for (const double angle : {1e-3, 0.05, 0.7, 2.0, 3.1})
    for (const double slide : {0.0, 0.6}) {
      const Vector3d axis = randomPoint(random, -1, 1), through = randomPoint(random, -2, 2);
      const Place before = somewhere(random),
                  now = before.then(axis, angle, through, slide * axis.normalized());
      const double truth = deviationInParts(body.positions, before, axis, angle, through, slide);
      for (const double thickness : {truth * 1.001, truth * 0.999}) {
        RigidRun run(settingsOf(Engine::Octree), body, far, {Method::Continuous, thickness}, true,
                     true);
        run.frame(before, nullptr, far.positions);
        EXPECT_EQ(run.data().validity().arcDeviation, 0.0);
        EXPECT_TRUE(run.data().validity().trusted);
        run.frame(now, nullptr, far.positions);
        EXPECT_NEAR(run.data().validity().arcDeviation, truth, 1e-9 * truth + 1e-13);
        EXPECT_EQ(run.data().validity().trusted, thickness > truth);
      }
    }
  // Without a turn there is no arc.
  RigidRun run(settingsOf(Engine::Octree), body, far, {Method::Continuous, 0.0}, true, true);
  Place place = somewhere(random);
  for (int frame = 0; frame < 2; ++frame, place.translation += Vector3d(1, 2, 3)) {
    run.frame(place, nullptr, far.positions);
    EXPECT_EQ(run.data().validity().arcDeviation, 0.0);
    EXPECT_TRUE(run.data().validity().trusted);
  }
}

/// Rotations from floats: one, and products of six.
TEST(Rigid, RotationsFromFloatsAreMadeExact) {
  Random random(14);
  const TestGeometry body = testGeometry(soup(random, 40, 0.2)),
                     other = testGeometry(soup(random, 40, 0.2));
  const auto floatRotation = [&] {
    Eigen::Vector4f q;
    for (float& x : q) x = static_cast<float>(uniform(random, -1, 1));
    return Eigen::Quaternionf(q).normalized().toRotationMatrix();
  };
  std::size_t rough = 0, contacts = 0;
  for (int repeat = 0; repeat < casesOf(300); ++repeat) {
    Eigen::Matrix3f given = floatRotation();
    const Eigen::Matrix3f turn = floatRotation();
    if (repeat % 10 == 0)
      for (int i = 0; i < 5; ++i) given = given * turn;
    const Matrix3d rotation = given.cast<double>();
    const Vector3d at = randomPoint(random, -0.2, 0.2);
    rough += (rotation.transpose() * rotation - Matrix3d::Identity()).cwiseAbs().maxCoeff() > 1e-9;
    OctreeBasedCD collisions(settingsOf(Engine::Octree)), truth(settingsOf(Engine::Octree));
    const auto place = [&](OctreeBasedCD& each, const Matrix3d& r) {
      const GeometryId a = body.addTo(each), b = other.addTo(each);
      each.addCollisionPair(a, b, {Method::Proximity, 0.05});
      each.setTransform(a, {r, at});
      each.detectCollision();
      return each.collisionData(a, b).hash();
    };
    const std::uint64_t hash = place(collisions, rotation);
    const Pose pose = collisions.transform(GeometryId{0});
    const Eigen::JacobiSVD<Matrix3d> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
    EXPECT_LE((pose.rotation - svd.matrixU() * svd.matrixV().transpose()).cwiseAbs().maxCoeff(),
              1e-14 + 2e-9 * (pose.rotation == rotation));
    EXPECT_EQ(pose.translation, at);
    // An exact rotation keeps its bits.
    EXPECT_EQ(place(truth, pose.rotation), hash);
    EXPECT_EQ(truth.transform(GeometryId{0}).rotation, pose.rotation);
    contacts += collisions.statistics().contacts;

    const auto overlapping = [&](const Matrix3d& r) {
      std::vector<std::uint32_t> elements;
      collisions.queries().overlapping(GeometryId{1}, Box{{0, 0, 0}, {0.4, 0.1, 0.2}}, {r, at},
                                       elements);
      return elements;
    };
    EXPECT_EQ(overlapping(rotation), overlapping(pose.rotation));
    const auto contactsOf = [&](const Matrix3d& r) {
      RigidMesh mesh(body.positions, body.triangles);
      CollisionData data;
      collisions.queries().contacts(GeometryId{1}, mesh, {r, at}, 0.05, data);
      return data.hash();
    };
    EXPECT_EQ(contactsOf(rotation), contactsOf(pose.rotation));
  }
  EXPECT_GE(rough, leastOf(290));
  EXPECT_GE(contacts, leastOf(1000));
}

TEST(Rigid, BadTransformsAreRefused) {
  using Code = ErrorCode;
  Random random(12);
  const TestGeometry body = testGeometry(soup(random, 5, 0.2));
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  const GeometryId id = body.addTo(collisions), huge = body.addTo(collisions);
  const Matrix3d one = Matrix3d::Identity();
  Matrix3d skewed = one;
  skewed(0, 1) = 2e-5;
  const Positions given = collisions.problem().geometries[0].now;
  for (const Matrix3d& bad : {skewed, Matrix3d(-one), Matrix3d(NAN * one), Matrix3d(2 * one)})
    expectRefused(Code::InvalidTransform, "geometry 0: ", [&] {
      collisions.setTransform(id, {bad, {0, 0, 0}});
    });
  for (const double bad : {double(NAN), double(INFINITY), 1e308})
    expectRefused(Code::InvalidTransform, "geometry 0: ", [&] {
      collisions.setTransform(id, {one, {0, bad, 0}});
    });
  Positions wide = body.positions;
  wide[4] = {0, 1e308, 0};
  expectRefused(Code::UnknownGeometry, "geometry 9", [&] {
    collisions.setTransform(GeometryId{9}, {one, {0, 0, 0}});
  });
  EXPECT_EQ(collisions.problem().geometries[0].now, given);
  collisions.setTransform(id, {one, {0, 0, 0}});
  expectRefused(Code::NonFinitePosition,
                "geometry 0, vertex 4: ", [&] { collisions.setPositions(id, wide); });
  expectRefused(Code::UnsupportedMethod, "cannot be tested against itself", [&] {
    collisions.addCollisionPair(id, id, {Method::Intersection, 0.0});
  });
  collisions.addCollisionPair(huge, huge, {Method::Intersection, 0.0});
  collisions.setPositions(huge, body.positions);
  expectRefused(Code::UnsupportedMethod, "cannot be tested against itself", [&] {
    collisions.setTransform(huge, {one, {0, 0, 0}});
  });
  collisions.removeCollisionPair(huge, huge);
  collisions.setTransform(huge, {one, {1, 0, 0}});
  collisions.detectCollision();
}

}  // namespace
}  // namespace palpate::testing
