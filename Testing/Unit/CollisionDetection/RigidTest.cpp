#include <palpate/Capture.h>

#include "Common/ExpectRefused.h"
#include "Common/TestGeometry.h"
#include "Core/SimdPath.h"

#include <tuple>

// Geometries that setTransform() moves. The reference is brute force for positions fl(R x + t).
// Random histories (Common/History.h) place geometries as well, with filters, shapes and queries.

namespace palpate::testing {
namespace {

using Eigen::Matrix3d;

Place somewhere(Random& random) {
  const Vector3d axis = randomPoint(random, -1, 1);
  const double angle = uniform(random, 0, 3);
  return Place().then(axis, angle, {0.5, 0.5, 0.5}, randomPoint(random, -0.1, 0.1));
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

/// One step of two bodies. Placed by transforms, with every engine and kind of bounds, they have
/// the contacts of brute force for the same positions. Returns how many there are.
std::size_t expectAsPositions(const TestGeometry& a, const TestGeometry& b,
                              const PairSettings& pair, const std::array<Place, 2>& before,
                              const std::array<Place, 2>& now, int threads = 1) {
  const auto dataOf = [&](const Settings& settings, bool byTransform) {
    OctreeBasedCD collisions(settings);
    const GeometryId ids[] = {a.addTo(collisions), b.addTo(collisions)};
    collisions.addCollisionPair(ids[0], ids[1], pair);
    for (const std::size_t i : {0, 1}) {
      const Positions& positions = (i == 0 ? a : b).positions;
      if (byTransform)
        collisions.setTransform(ids[i], before[i].pose(), now[i].pose());
      else
        collisions.setPositions(ids[i], before[i](positions), now[i](positions));
    }
    collisions.detectCollision();
    EXPECT_EQ(collisions.octree().validate(), std::vector<std::string>{});
    return collisions.collisionData(ids[0], ids[1]);
  };
  const CollisionData truth = dataOf(settingsOf(Engine::BruteForce), false);
  for (const Settings& settings : boundsSettings(threads)) {
    const CollisionData found = dataOf(settings, true);
    expectSameRows(Rows(found), Rows(truth));
    // Motion is bounded with a reserve for rounding.
    EXPECT_GE(found.validity().displacement, truth.validity().displacement);
    EXPECT_NEAR(found.validity().displacement, truth.validity().displacement,
                1e-12 * (10 + now[0].translation.norm() + a.positions[0].norm()));
    EXPECT_EQ(found.validity().method, truth.validity().method);
  }
  return Rows(truth).contacts();
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
        const bool isFirst = repeat % 3 == 0;
        const TestGeometry &a = isFirst ? floor : other, &b = isFirst ? other : floor;
        const std::array places{isFirst ? place : above, isFirst ? above : place};
        TestGeometry there[] = {a, b};
        for (int i : {0, 1}) there[i].positions = places[i](there[i].positions);
        const double first =
            leastDistance(answer(there[0], there[1], {method, 1.0, Contacts::All}), 1.0);
        for (const double thickness :
             {std::nextafter(first, 0.0), first, std::nextafter(first, 9.0)})
          begun += expectAsPositions(a, b, {method, thickness, Contacts::All}, places, places) > 0;
        if (HasFailure()) return;
      }
  }
  EXPECT_GE(begun, leastOf(700));
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
      for (int repeat = 0; repeat < casesOf(4); ++repeat) {
        TestGeometry body = flat;
        for (Vector3d& p : body.positions)
          p = (1000 * p[0] - 500) * right + (1000 * p[1] - 500) * up;
        Place place = somewhere(random);
        place.translation.setZero();
        EXPECT_GT(expectAsPositions(body, body, {method, 0.0}, {place, place}, {place, place}), 0u);
      }
}

/// Bodies of every type in generic places, near each other or touching, that move and turn in the
/// step.
TEST(Rigid, BodiesMatchTheirPositions) {
  Random random(10);
  const TestGeometry ball = testGeometry(sphere(7, 9, {0.5, 0.5, 0.5}, 0.4)),
                     leaf = testGeometry(sheet(8, 0.5, 1.0)),
                     mess = testGeometry(soup(random, 60, 0.1)),
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
      // Features that pass at more than the thickness are reported in every frame of boxes, or
      // none.
      if (one.continuous)
        methods.push_back({.method = Method::Continuous,
                           .thickness = 0.01,
                           .contacts = Contacts::All,
                           .continuous = {.timeTolerance = 0.5}});
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
            contacts += expectAsPositions(*one.a, *one.b, pair, before, now, 1 + repeat % 2);
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
  for (Settings settings : boundsSettings(2)) {
    if (settings.engine == Engine::BruteForce) continue;
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
    expectSameRows(rows.back(), rows[0]);
    candidates.push_back(collisions.statistics().candidatePairs);
    bytes.push_back(collisions.octree().statistics().bytes);
  }
  EXPECT_GT(rows[0].contacts(), 10u);
  for (const std::size_t dop : {1, 2}) {
    EXPECT_LT(candidates[dop], 0.7 * static_cast<double>(candidates[0]));
    EXPECT_LT(bytes[dop - 1], bytes[dop]);
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
        OctreeBasedCD collisions;
        const GeometryId a = body.addTo(collisions), b = far.addTo(collisions);
        collisions.addCollisionPair(a, b, {Method::Continuous, thickness});
        const auto validityOf = [&](const Pose& from, const Pose& to) {
          collisions.setTransform(a, from, to);
          collisions.detectCollision();
          return collisions.collisionData(a, b).validity();
        };
        const Validity turned = validityOf(before.pose(), now.pose());
        EXPECT_NEAR(turned.arcDeviation, truth, 1e-9 * truth + 1e-13);
        EXPECT_EQ(turned.trusted, thickness > truth);
        // Without a turn there is no arc.
        const Validity slid =
            validityOf(now.pose(), {now.rotation, now.translation + Vector3d(1, 2, 3)});
        EXPECT_EQ(slid.arcDeviation, 0.0);
        EXPECT_TRUE(slid.trusted);
      }
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
    Matrix3d exact;
    // Contacts of a placed body, of a query's mesh, and elements that overlap a query's box.
    const auto answersOf = [&](const Matrix3d& r) {
      OctreeBasedCD collisions;
      const GeometryId a = body.addTo(collisions), b = other.addTo(collisions);
      collisions.addCollisionPair(a, b, {Method::Proximity, 0.05});
      collisions.setTransform(a, {r, at});
      collisions.detectCollision();
      exact = collisions.transform(a).rotation;
      EXPECT_EQ(collisions.transform(a).translation, at);
      contacts += collisions.statistics().contacts;
      RigidMesh mesh(body.positions, body.triangles);
      CollisionData data;
      collisions.queries().contacts(b, mesh, {r, at}, 0.05, data);
      std::vector<std::uint32_t> elements;
      collisions.queries().overlapping(b, Box{{0, 0, 0}, {0.4, 0.1, 0.2}}, {r, at}, elements);
      return std::tuple(collisions.collisionData(a, b).hash(), data.hash(), elements);
    };
    const auto answers = answersOf(rotation);
    const Matrix3d made = exact;
    const Eigen::JacobiSVD<Matrix3d> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
    EXPECT_LE((made - svd.matrixU() * svd.matrixV().transpose()).cwiseAbs().maxCoeff(),
              1e-14 + 2e-9 * (made == rotation));
    // An exact rotation keeps its bits.
    EXPECT_TRUE(answersOf(made) == answers);
    EXPECT_EQ(exact, made);
  }
  EXPECT_GE(rough, leastOf(290));
  EXPECT_GE(contacts, leastOf(2000));
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
