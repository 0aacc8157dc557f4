// PairSettings::freeMotionReach and OctreeBasedCD::freeMotion().
#include <palpate/FeaturePairs.h>
#include <palpate/Error.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/DegenerateCases.h"
#include "Common/ExpectRefused.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Common/TestGeometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace palpate::testing {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Contacts, or pairs of intersecting triangles, by their features.
using FeatureSet = std::set<std::tuple<std::size_t, int, std::array<std::uint32_t, 4>>>;

void addFeatures(const OctreeBasedCD& collisions, FeatureSet& features) {
  for (std::size_t i = 0; i < collisions.pairs().size(); ++i) {
    const CollisionPair& pair = collisions.pairs()[i];
    const CollisionData& data = collisions.collisionData(pair.a, pair.b);
    for (const auto& [a, b] : data.intersectingTriangles()) features.insert({i, 5, {a, b, 0, 0}});
    // Which features describe the depth of bodies in each other changes with it.
    if (pair.settings.method == Method::Intersection) continue;
    for (const auto& c : data.vertexTriangle())
      features.insert({i, 0, {c.vertex, c.triangle, 0, 0}});
    for (const auto& c : data.triangleVertex())
      features.insert({i, 1, {c.vertex, c.triangle, 0, 0}});
    for (const auto& c : data.edgeEdge())
      features.insert({i, 2, {c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]}});
    for (const auto& c : data.shape())
      features.insert(
          {i,
           3,
           {static_cast<std::uint32_t>(c.element), c.vertices[0], c.vertices[1], c.vertices[2]}});
    if (!data.shapeShape().empty()) features.insert({i, 4, {}});
  }
}

/// Geometries and pairs of them, among them geometries with themselves.
struct Scene {
  std::vector<TestGeometry> meshes;
  std::vector<AnalyticalGeometry> shapes;  ///< after the meshes
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  double thickness = 0.0, reach = 0.0;

  bool isShape(std::size_t i) const { return i >= meshes.size(); }
  bool hasOneRadius(std::size_t i) const { return isShape(i) || meshes[i].radii.size() == 1; }
  bool hasFaces(std::size_t i) const {
    return !isShape(i) && meshes[i].type == GeometryType::Triangles;
  }
};

PairSettings sceneSettings(const Scene& scene, Method method) {
  return {.method = method,
          .thickness = scene.thickness,
          .contacts = Contacts::All,
          .freeMotionReach = scene.reach};
}

/// A Scene in an OctreeBasedCD. Pairs that the method does not answer are left out.
class SceneRun {
 public:
  SceneRun(const Scene& scene, Method method, const Settings& settings = {.threads = 1})
      : m_scene(scene), m_collisions(settings) {
    for (const TestGeometry& mesh : scene.meshes) m_ids.push_back(mesh.addTo(m_collisions));
    for (const AnalyticalGeometry& shape : scene.shapes)
      m_ids.push_back(m_collisions.addAnalyticalGeometry(shape));
    for (const auto& [a, b] : scene.pairs) {
      if (method == Method::Intersection && !(scene.hasFaces(a) && scene.hasFaces(b))) continue;
      if (method == Method::Continuous && !(scene.hasOneRadius(a) && scene.hasOneRadius(b)))
        continue;
      const bool touches = scene.thickness > 0.0 || scene.isShape(a) || scene.isShape(b);
      if (method == Method::Proximity && !touches) continue;
      m_collisions.addCollisionPair(m_ids[a], m_ids[b], sceneSettings(scene, method));
    }
  }

  void move(const std::vector<Positions>& positions, const std::vector<Vector3d>& translations) {
    for (std::size_t i = 0; i < m_ids.size(); ++i)
      if (m_scene.isShape(i))
        m_collisions.setTransform(
            m_ids[i], {Eigen::Matrix3d::Identity(), translations[i - m_scene.meshes.size()]});
      else
        m_collisions.setPositions(m_ids[i], positions[i]);
  }
  FeatureSet detect() {
    m_collisions.detectCollision();
    FeatureSet features;
    addFeatures(m_collisions, features);
    return features;
  }
  std::vector<std::vector<double>> freeMotions() const {
    std::vector<std::vector<double>> all;
    for (const GeometryId id : m_ids) {
      const auto motions = m_collisions.freeMotion(id);
      all.emplace_back(motions.begin(), motions.end());
    }
    return all;
  }
  OctreeBasedCD& collisions() { return m_collisions; }

 private:
  const Scene& m_scene;
  OctreeBasedCD m_collisions;
  std::vector<GeometryId> m_ids;
};

Vector3d unit(const Vector3d& v) {
  const double norm = v.norm();
  return norm > 0.0 ? Vector3d(v / norm) : Vector3d::UnitX();
}

/// The vertex of another geometry, or of another part of this one, that is nearest to a vertex.
Vector3d towardsNearest(const std::vector<Positions>& all, std::size_t mesh, std::size_t vertex) {
  const Vector3d p = all[mesh][vertex];
  double least = kInfinity;
  Vector3d best = p;
  for (std::size_t m = 0; m < all.size(); ++m)
    for (std::size_t v = 0; v < all[m].size(); ++v) {
      const double square = (all[m][v] - p).squaredNorm();
      if ((m == mesh && (v == vertex || all.size() > 1)) || !(square < least) || square == 0.0)
        continue;
      least = square;
      best = all[m][v];
    }
  return unit(best - p);
}

/// Moves everything by its free motion, in random directions or towards what is near, and expects
/// no new contact, impact or intersection. Returns the sum of the motions.
double expectNothingNew(Random& random, const Scene& scene, int steps) {
  SceneRun search(scene, Method::Auto);
  std::vector<SceneRun> checks;
  for (const Method method : {Method::Proximity, Method::Intersection, Method::Continuous})
    checks.emplace_back(scene, method);
  std::vector<Positions> now;
  for (const TestGeometry& mesh : scene.meshes) now.push_back(mesh.positions);
  std::vector<Vector3d> translations(scene.shapes.size(), Vector3d::Zero());
  double sum = 0.0;
  for (int step = 0; step < steps; ++step) {
    search.move(now, translations);
    search.detect();
    const auto free = search.freeMotions();
    std::vector<FeatureSet> before;
    for (SceneRun& check : checks) {
      check.move(now, translations);
      check.collisions().advance();  // at rest
      check.move(now, translations);
      before.push_back(check.detect());
      check.collisions().advance();
    }
    const bool towards = step % 2 == 1;
    const std::vector<Positions> start = now;
    for (std::size_t m = 0; m < now.size(); ++m)
      for (std::size_t v = 0; v < now[m].size(); ++v) {
        const double length = free[m][v] < kInfinity ? free[m][v] : scene.reach;
        EXPECT_GE(length, 0.0);
        now[m][v] +=
            length * (towards ? towardsNearest(start, m, v) : unit(randomPoint(random, -1, 1)));
        sum += length;
      }
    for (std::size_t s = 0; s < translations.size(); ++s) {
      const double length = free[scene.meshes.size() + s][0];
      if (length < kInfinity) translations[s] += length * unit(randomPoint(random, -1, 1));
    }
    for (std::size_t i = 0; i < checks.size(); ++i) {
      checks[i].move(now, translations);
      const FeatureSet after = checks[i].detect();
      for (const auto& [pair, kind, ids] : after)
        EXPECT_TRUE(before[i].contains({pair, kind, ids}))
            << "method " << i << ", step " << step << ", pair " << pair << ", kind " << kind << ": "
            << ids[0] << ' ' << ids[1] << ' ' << ids[2] << ' ' << ids[3];
      if (i == 1) {
        EXPECT_EQ(after.size(), before[i].size()) << "triangles, step " << step;
      }
    }
    if (::testing::Test::HasFailure()) return sum;
  }
  return sum;
}

void translate(TestGeometry& geometry, const Vector3d& by) {
  for (Vector3d& p : geometry.positions) p += by;
}

Scene randomScene(Random& random) {
  Scene scene;
  const double offset = random() % 4 == 0 ? 1000.0 : 0.0;
  const auto add = [&](TestGeometry geometry) {
    translate(geometry, Vector3d::Constant(offset));
    scene.meshes.push_back(std::move(geometry));
  };
  switch (random() % 6) {
    case 0:
      add(testGeometry(soup(random, 12, 0.2)));
      add(testGeometry(soup(random, 12, 0.2)));
      break;
    case 1: {
      add(testGeometry(sheet(4, 0.1, uniform(random, 0, 6))));
      const double radius = uniform(random, 0, 0.02);
      const bool isClosed = random() % 2;
      add(thread(random, 12, 0.2, radius, isClosed));
      break;
    }
    case 2:
      add(tapered(random, thread(random, 10, 0.2, 0.0, false), 0.03));
      add(particles(random, 12, uniform(random, 0, 0.03)));
      break;
    case 3:
      add(testGeometry(sheet(3, 0.2, 0)));
      add(tapered(random, particles(random, 12, 0.0), 0.03));
      break;
    case 4:  // a stack of thin layers
      for (int layer = 0; layer < 3; ++layer) {
        Mesh flat = sheet(3, 0.0, 0);
        for (Vector3d& p : flat.positions) p[2] = 0.001 * layer;
        add(testGeometry(flat));
      }
      break;
    default:
      add(testGeometry(sphere(4, 6, {0.5, 0.5, 0.3}, 0.3)));
      add(testGeometry(soup(random, 8, 0.3)));
  }
  const Vector3d centre = Vector3d::Constant(offset + 0.5);
  switch (random() % 5) {
    case 0:
      scene.shapes.push_back(Sphere{centre, 0.2});
      break;
    case 1:
      scene.shapes.push_back(Box{centre, {0.2, 0.1, 0.3}});
      break;
    case 2:
      scene.shapes.push_back(Capsule{centre, centre + Vector3d(0.3, 0.1, 0), 0.1});
      break;
    case 3:
      scene.shapes.push_back(Cylinder{centre, centre + Vector3d(0, 0.3, 0.1), 0.1});
      break;
    default:
      break;
  }
  if (!scene.shapes.empty() && random() % 2)
    scene.shapes.push_back(Plane{centre - Vector3d(0, 0, 0.4), {0, 0, 1}});
  const std::size_t count = scene.meshes.size() + scene.shapes.size();
  for (std::size_t a = 0; a < count; ++a)
    for (std::size_t b = a; b < count; ++b)
      if (a != b || (!scene.isShape(a) && random() % 2)) scene.pairs.push_back({a, b});
  scene.thickness = random() % 3 == 0 ? 0.0 : uniform(random, 0.0005, 0.05);
  scene.reach = uniform(random, 0.02, 0.5);
  return scene;
}

/// PALPATE_FREE_MOTION_STEPS: number of steps; 1,000,000 take some hours.
int stepsOf(int few) {
  const char* const steps = std::getenv("PALPATE_FREE_MOTION_STEPS");
  return steps ? std::atoi(steps) : few / kShareOfCases;
}

TEST(FreeMotion, NothingNewComesNearInRandomScenes) {
  Random random(1);
  double sum = 0.0;
  constexpr int kStepsEach = 6;
  for (int scene = 0; kStepsEach * scene < stepsOf(900); ++scene) {
    SCOPED_TRACE("scene " + std::to_string(scene));
    const Scene made = randomScene(random);
    // Auto needs one radius where nothing has a thickness.
    if (made.thickness == 0.0 && !(made.hasOneRadius(0) && made.hasOneRadius(1))) continue;
    sum += expectNothingNew(random, made, kStepsEach);
    if (HasFailure()) return;
  }
  EXPECT_GT(sum, 10.0);
}

TEST(FreeMotion, NothingNewComesNearInDegenerateCases) {
  Random random(2);
  std::size_t number = 0;
  for (const DegenerateCase& degenerate : degenerateCases()) {
    if (degenerate.large || degenerate.name == "more than 2^16 vertices") continue;
    if (isLeftOut(number++)) continue;
    SCOPED_TRACE(degenerate.name);
    Scene scene;
    scene.meshes = {testGeometry(degenerate.a), testGeometry(degenerate.b)};
    scene.pairs = {{0, 1}, {0, 0}, {1, 1}};
    scene.thickness = degenerate.thickness;
    scene.reach = 4 * degenerate.thickness;
    expectNothingNew(random, scene, 2);
    if (HasFailure()) return;
  }
}

/// Calls f(weights, distance, radii) for each pair of features that a pair of geometries tests:
/// weights of all vertices at the closest points, by geometry and vertex.
template <class F>
void forEachFeaturePair(const TestGeometry& a, const TestGeometry& b, F&& f) {
  const bool self = &a == &b;
  using Weights = std::vector<std::tuple<bool, std::uint32_t, double>>;
  const auto vertices = [&](const TestGeometry& p, const TestGeometry& q, bool swapped) {
    for (std::uint32_t v = 0; v < p.positions.size(); ++v)
      for (const auto& [i, j, k] : q.triangles) {
        if (self && (v == i || v == j || v == k)) continue;
        const auto& x = q.positions;
        const auto answer = vertexTriangleDistance(p.positions[v], x[i], x[j], x[k]);
        f(Weights{{swapped, v, 1.0},
                  {!swapped && !self, i, answer.weights[0]},
                  {!swapped && !self, j, answer.weights[1]},
                  {!swapped && !self, k, answer.weights[2]}},
          answer.distance, p.radius(v));
      }
  };
  vertices(a, b, false);
  if (!self) vertices(b, a, true);
  for (const Segment& p : a.edges())
    for (const Segment& q : b.edges()) {
      if (self && (p[0] == q[0] || p[0] == q[1] || p[1] == q[0] || p[1] == q[1])) continue;
      const auto &x = a.positions, &y = b.positions;
      const auto answer = edgeEdgeDistance(x[p[0]], x[p[1]], y[q[0]], y[q[1]]);
      f(Weights{{false, p[0], 1.0 - answer.weightA},
                {false, p[1], answer.weightA},
                {!self, q[0], 1.0 - answer.weightB},
                {!self, q[1], answer.weightB}},
        answer.distance,
        (1.0 - answer.weightA) * a.radius(p[0]) + answer.weightA * a.radius(p[1]) +
            (1.0 - answer.weightB) * b.radius(q[0]) + answer.weightB * b.radius(q[1]));
    }
}

/// The closest points of two features cannot meet, and a vertex has at least half of the gap to
/// the nearest feature.
TEST(FreeMotion, IsHalfOfTheGapByExactDistances) {
  Random random(3);
  for (int trial = 0; trial < 60 / kShareOfCases; ++trial) {
    SCOPED_TRACE(trial);
    Scene scene;
    scene.meshes.push_back(
        testGeometry(trial % 2 ? soup(random, 10, 0.2) : sheet(4, 0.1, uniform(random, 0, 6))));
    if (trial % 3 == 0)
      scene.meshes.push_back(thread(random, 12, 0.2, uniform(random, 0, 0.02), false));
    else if (trial % 3 == 1)
      scene.meshes.push_back(testGeometry(soup(random, 10, 0.2)));
    scene.pairs = {{0, scene.meshes.size() - 1}};
    scene.thickness = trial % 4 ? 0.03 : 0.0;
    scene.reach = trial % 5 ? 0.3 : 0.03;
    SceneRun run(scene, Method::Auto);
    run.detect();
    const auto free = run.freeMotions();
    const TestGeometry &a = scene.meshes.front(), &b = scene.meshes.back();
    std::vector<std::vector<double>> least;
    for (const auto& each : free) least.emplace_back(each.size(), 0.5 * scene.reach);
    forEachFeaturePair(a, b, [&](const auto& weights, double distance, double radii) {
      const double gap =
          distance - radii <= scene.thickness ? distance : distance - radii - scene.thickness;
      double motion = 0.0;
      for (const auto& [ofB, v, weight] : weights) {
        motion += weight * free[ofB][v];
        least[ofB][v] = std::min(least[ofB][v], 0.5 * gap);
      }
      EXPECT_LT(motion, std::max(gap, 1e-300));
    });
    for (std::size_t m = 0; m < free.size(); ++m)
      for (std::size_t v = 0; v < free[m].size(); ++v) {
        EXPECT_GE(free[m][v], least[m][v] - 1e-6 * scene.reach);
        EXPECT_LE(free[m][v], 0.5 * scene.reach);
      }
  }
}

/// The closest points cannot meet either where radii differ along a thread.
TEST(FreeMotion, IsBelowTheGapOfTaperedThreads) {
  Random random(5);
  std::size_t near = 0;
  for (int trial = 0; trial < 600 / kShareOfCases; ++trial) {
    SCOPED_TRACE(trial);
    Scene scene;
    for (int i = 0; i < 2; ++i)
      scene.meshes.push_back(tapered(random, thread(random, 6, 0.4, 0.0, false), 0.15));
    scene.pairs = {{0, 1}};
    scene.thickness = 0.01;
    scene.reach = 0.4;
    SceneRun run(scene, Method::Auto);
    run.detect();
    const auto free = run.freeMotions();
    forEachFeaturePair(scene.meshes[0], scene.meshes[1],
                       [&](const auto& weights, double distance, double radii) {
                         if (distance - radii <= scene.thickness) return;
                         double motion = 0.0;
                         for (const auto& [ofB, v, weight] : weights)
                           motion += weight * free[ofB][v];
                         EXPECT_LT(motion, distance - radii - scene.thickness);
                         near += motion > 0.5 * (distance - radii - scene.thickness);
                       });
    if (HasFailure()) return;
  }
  EXPECT_GT(near, 100u);
}

/// Whatever the last detection left unfinished or released.
TEST(FreeMotion, IsUnlimitedWithoutAPair) {
  const Mesh low = flat(2, 0.0), high = flat(2, 0.5);
  for (const bool hasTime : {false, true}) {
    OctreeBasedCD collisions;
    const GeometryId a = addMesh(collisions, low), b = addMesh(collisions, high);
    collisions.addCollisionPair(a, b, {.thickness = 0.1, .freeMotionReach = 1.0});
    if (hasTime) {
      collisions.detectCollision();
      collisions.releaseMemory();
    } else {
      EXPECT_FALSE(collisions.detectCollision(std::chrono::microseconds(0)));
    }
    EXPECT_LT(collisions.freeMotion(a)[0], 0.5);
    collisions.removeCollisionPair(a, b);
    collisions.detectCollision();
    EXPECT_EQ(collisions.freeMotion(a)[0], kInfinity);
  }
}

/// Two parallel sheets share the gap; a filter or a disabled element lifts its limit.
TEST(FreeMotion, FollowsPairsFiltersAndElements) {
  const Mesh low = flat(4, 0.0), high = flat(4, 0.5);
  OctreeBasedCD collisions;
  const GeometryId a = addMesh(collisions, low), b = addMesh(collisions, high),
                   alone = collisions.addPointSet(low.positions, 0.1),
                   sphere = collisions.addAnalyticalGeometry(Sphere{{0.5, 0.5, 0.8}, 0.1});
  int calls = 0;
  const auto expectAll = [&](GeometryId id, double motion) {
    SCOPED_TRACE(++calls);
    for (const double free : collisions.freeMotion(id))
      EXPECT_TRUE(free == motion || std::abs(free - motion) < 1e-6) << free;
  };
  expectAll(a, kInfinity);
  EXPECT_EQ(collisions.freeMotion(sphere).size(), 1u);
  collisions.addCollisionPair(a, b, {.thickness = 0.1, .freeMotionReach = 1.0});
  expectRefused(ErrorCode::NotAvailable, "has no free motion yet",
                [&] { collisions.freeMotion(a); });
  collisions.detectCollision();
  ASSERT_EQ(collisions.freeMotion(a).size(), low.positions.size());
  expectAll(a, 0.2), expectAll(b, 0.2), expectAll(alone, kInfinity);

  // What was found for other elements is no answer, not even for as many vertices.
  const auto expectOutdated = [&] {
    expectRefused(ErrorCode::NotAvailable, "has no free motion yet",
                  [&] { collisions.freeMotion(a); });
    collisions.detectCollision();
  };
  collisions.setDisabledElements(a, std::vector<std::uint32_t>{0});
  expectOutdated();
  collisions.setDisabledElements(a, {});
  expectOutdated();
  collisions.setTriangles(a, low.positions, low.triangles);
  expectOutdated();
  expectAll(a, 0.2), expectAll(b, 0.2);

  collisions.setPairSettings(a, b, {.thickness = 0.1, .freeMotionReach = 0.1});
  collisions.detectCollision();
  expectAll(a, 0.05);

  collisions.setPairSettings(a, b, {.thickness = 0.1, .freeMotionReach = 1.0});
  collisions.setContactPredicate(a, b, [](const ContactFeatures&) { return false; });
  collisions.detectCollision();
  expectAll(a, 0.5);
  collisions.setContactPredicate(a, b, {});
  std::vector<std::uint32_t> all(low.triangles.size());
  for (std::uint32_t i = 0; i < all.size(); ++i) all[i] = i;
  collisions.setDisabledElements(a, all);
  collisions.detectCollision();
  expectAll(b, 0.5);
  collisions.setDisabledElements(a, {});
  collisions.setCollisionFilter(a, {.groups = 2});
  collisions.setCollisionFilter(b, {.mask = 1});
  collisions.detectCollision();
  expectAll(a, kInfinity);

  collisions.addCollisionPair(b, sphere, {.method = Method::Proximity, .freeMotionReach = 1.0});
  collisions.detectCollision();
  EXPECT_NEAR(collisions.freeMotion(sphere)[0], 0.1, 1e-6);
  collisions.removeCollisionPair(b, sphere);
  collisions.detectCollision();
  expectAll(sphere, kInfinity);
}

TEST(FreeMotion, IsZeroWhereFeaturesTouchAndPositiveInContact) {
  Mesh low = flat(4, 0.0), high = low;
  OctreeBasedCD collisions;
  const GeometryId a = addMesh(collisions, low), b = addMesh(collisions, high);
  collisions.addCollisionPair(a, b, {.thickness = 0.1, .freeMotionReach = 1.0});
  collisions.detectCollision();
  for (const double free : collisions.freeMotion(a)) EXPECT_EQ(free, 0.0);
  for (Vector3d& p : high.positions) p[2] = 0.05;
  collisions.setPositions(b, high.positions);
  collisions.detectCollision();
  // Each vertex is in contact with the other sheet around its opposite, and no contact beyond.
  for (const double free : collisions.freeMotion(a)) {
    EXPECT_GT(free, 0.01);
    EXPECT_LT(free, 0.026);
  }
}

}  // namespace
}  // namespace palpate::testing
