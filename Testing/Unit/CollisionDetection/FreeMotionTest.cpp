// PairSettings::freeMotionReach and OctreeBasedCD::freeMotion().
#include <palpate/FeaturePairs.h>

#include "Common/DegenerateCases.h"
#include "Common/ExpectRefused.h"
#include "Common/TestGeometry.h"

#include <numeric>
#include <tuple>

namespace palpate::testing {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Geometries and pairs of them, among them geometries with themselves.
struct FreeScene {
  std::vector<TestGeometry> meshes{};
  std::vector<AnalyticalGeometry> shapes{};  ///< after the meshes
  std::vector<std::pair<std::size_t, std::size_t>> pairs{};
  double thickness = 0.0, reach = 0.0;
};

/// A FreeScene in an object. Pairs that the method does not answer are left out.
class FreeRun {
 public:
  FreeRun(const FreeScene& scene, Method method) {
    for (const TestGeometry& mesh : scene.meshes) m_ids.push_back(mesh.addTo(m_collisions));
    for (const AnalyticalGeometry& shape : scene.shapes)
      m_ids.push_back(m_collisions.addAnalyticalGeometry(shape));
    const PairSettings settings{.method = method,
                                .thickness = scene.thickness,
                                .contacts = Contacts::All,
                                .freeMotionReach = scene.reach,
                                .trackContacts = true};
    for (const auto& [a, b] : scene.pairs) {
      try {
        m_collisions.addCollisionPair(m_ids[a], m_ids[b], settings);
      } catch (const Error& error) {
        EXPECT_NE(error.code(), ErrorCode::DuplicatePair);
      }
    }
  }
  void detectAt(const std::vector<Positions>& positions,
                const std::vector<Vector3d>& translations) {
    for (std::size_t i = 0; i < m_ids.size(); ++i)
      if (const std::size_t meshes = positions.size(); i < meshes)
        m_collisions.setPositions(m_ids[i], positions[i]);
      else
        m_collisions.setTransform(m_ids[i], {.translation = translations[i - meshes]});
    m_collisions.detectCollision();
  }
  void advance() { m_collisions.advance(); }
  std::vector<std::vector<double>> freeMotions() const {
    std::vector<std::vector<double>> all;
    for (const GeometryId id : m_ids) {
      const auto motions = m_collisions.freeMotion(id);
      all.emplace_back(motions.begin(), motions.end());
    }
    return all;
  }
  std::vector<ElementPair> intersections() const {
    std::vector<ElementPair> all;
    for (const CollisionPair& pair : m_collisions.pairs())
      for (const ElementPair& both :
           m_collisions.collisionData(pair.a, pair.b).intersectingTriangles())
        all.push_back(both);
    return all;
  }
  /// Each contact was there in the step before.
  void expectNoneBegan() const {
    for (const CollisionPair& pair : m_collisions.pairs()) {
      // Which features describe the depth of bodies in each other changes with it.
      if (pair.settings.method == Method::Intersection) continue;
      for (const TrackedContact& contact : allTracked(m_collisions.collisionData(pair.a, pair.b)))
        EXPECT_TRUE(contact.age > 0 && !contact.predecessor)
            << toString(pair.settings.method) << ", " << toString(contact.key.kind) << ' '
            << contact.key.ids[0] << ' ' << contact.key.ids[1];
    }
  }

 private:
  OctreeBasedCD m_collisions{{.threads = 1}};
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
double expectNothingNew(Random& random, const FreeScene& scene, int steps) {
  FreeRun search(scene, Method::Auto);
  std::vector<FreeRun> checks;
  for (const Method method : {Method::Proximity, Method::Intersection, Method::Continuous})
    checks.emplace_back(scene, method);
  std::vector<Positions> now;
  for (const TestGeometry& mesh : scene.meshes) now.push_back(mesh.positions);
  std::vector<Vector3d> translations(scene.shapes.size(), Vector3d::Zero());
  double sum = 0.0;
  for (int step = 0; step < steps; ++step) {
    SCOPED_TRACE("step " + std::to_string(step));
    search.detectAt(now, translations);
    const auto free = search.freeMotions();
    for (FreeRun& check : checks)
      for (int rest = 0; rest < 2; ++rest) {
        check.detectAt(now, translations);
        check.advance();
      }
    const std::vector<Positions> start = now;
    for (std::size_t m = 0; m < now.size(); ++m)
      for (std::size_t v = 0; v < now[m].size(); ++v) {
        const double length = free[m][v] < kInfinity ? free[m][v] : scene.reach;
        EXPECT_GE(length, 0.0);
        const Vector3d anyWay = unit(randomPoint(random, -1, 1));
        now[m][v] += length * (step % 2 == 1 ? towardsNearest(start, m, v) : anyWay);
        sum += length;
      }
    for (std::size_t s = 0; s < translations.size(); ++s) {
      const double length = free[scene.meshes.size() + s][0];
      const Vector3d anyWay = unit(randomPoint(random, -1, 1));
      if (length < kInfinity) translations[s] += length * anyWay;
    }
    for (FreeRun& check : checks) {
      const std::vector<ElementPair> before = check.intersections();
      check.detectAt(now, translations);
      check.expectNoneBegan();
      EXPECT_EQ(check.intersections(), before);
    }
    if (::testing::Test::HasFailure()) return sum;
  }
  return sum;
}

FreeScene randomScene(Random& random) {
  FreeScene scene;
  const double offset = random() % 4 == 0 ? 1000.0 : 0.0, radius = uniform(random, 0, 0.03),
               phase = uniform(random, 0, 6);
  const TestGeometry line = thread(random, 10, 0.2, radius, false),
                     points = particles(random, 12, radius);
  const std::vector<TestGeometry> all{testGeometry(soup(random, 12, 0.2)),
                                      testGeometry(soup(random, 8, 0.3)),
                                      testGeometry(sheet(4, 0.1, phase)),
                                      testGeometry(sphere(4, 6, {0.5, 0.5, 0.3}, 0.3)),
                                      line,
                                      points,
                                      tapered(random, line, 0.03),
                                      tapered(random, points, 0.03)};
  for (int i = 0; i < 2; ++i) scene.meshes.push_back(all[random() % all.size()]);
  const int layers = random() % 6 == 0 ? 3 : 0;
  for (int layer = 0; layer < layers; ++layer)  // a stack of thin layers
    scene.meshes.push_back(testGeometry(flat(3, 0.001 * layer)));
  for (TestGeometry& mesh : scene.meshes)
    for (Vector3d& p : mesh.positions) p += Vector3d::Constant(offset);
  const Vector3d centre = Vector3d::Constant(offset + 0.5);
  const std::vector<AnalyticalGeometry> shapes{
      Sphere{centre, 0.2}, Box{centre, {0.2, 0.1, 0.3}},
      Capsule{centre, centre + Vector3d(0.3, 0.1, 0), 0.1},
      Cylinder{centre, centre + Vector3d(0, 0.3, 0.1), 0.1}};
  if (const std::size_t i = random() % 5; i < shapes.size()) scene.shapes.push_back(shapes[i]);
  if (!scene.shapes.empty() && random() % 2)
    scene.shapes.push_back(Plane{centre - Vector3d(0, 0, 0.4), {0, 0, 1}});
  const std::size_t count = scene.meshes.size() + scene.shapes.size();
  for (std::size_t a = 0; a < count; ++a)
    for (std::size_t b = a; b < count; ++b)
      if (a != b || (a < scene.meshes.size() && random() % 2)) scene.pairs.push_back({a, b});
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
  for (int scene = 0; kStepsEach * scene < stepsOf(600); ++scene) {
    SCOPED_TRACE("scene " + std::to_string(scene));
    const FreeScene made = randomScene(random);
    // Auto needs one radius where nothing has a thickness.
    const auto hasOneRadius = [](const TestGeometry& mesh) { return mesh.radii.size() == 1; };
    if (made.thickness > 0.0 || std::ranges::all_of(made.meshes, hasOneRadius))
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
    FreeScene scene;
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

/// The closest points of two features cannot meet, also where radii differ along a thread. Without
/// that a vertex has at least half of the gap to the nearest feature.
TEST(FreeMotion, IsHalfOfTheGapByExactDistances) {
  Random random(3);
  std::size_t near = 0;
  for (int trial = 0; trial < 300 / kShareOfCases; ++trial) {
    SCOPED_TRACE(trial);
    const bool isTapered = trial % 5 > 0;
    FreeScene scene;
    const Mesh bent = sheet(4, 0.1, uniform(random, 0, 6));
    const TestGeometry line = thread(random, 12, 0.2, uniform(random, 0, 0.02), false),
                       triangles = testGeometry(soup(random, 10, 0.2));
    const std::array<TestGeometry, 2> tapering{
        tapered(random, thread(random, 6, 0.4, 0.0, false), 0.15),
        tapered(random, thread(random, 6, 0.4, 0.0, false), 0.15)};
    if (isTapered)
      scene.meshes.assign(tapering.begin(), tapering.end());
    else
      scene.meshes.push_back(trial % 2 ? triangles : testGeometry(bent));
    if (!isTapered && trial % 3 < 2) scene.meshes.push_back(trial % 3 == 0 ? line : triangles);
    scene.pairs = {{0, scene.meshes.size() - 1}};
    scene.thickness = isTapered ? 0.01 : trial % 4 ? 0.03 : 0.0;
    scene.reach = isTapered ? 0.4 : trial % 25 ? 0.3 : 0.03;
    FreeRun run(scene, Method::Auto);
    std::vector<Positions> now;
    for (const TestGeometry& mesh : scene.meshes) now.push_back(mesh.positions);
    run.detectAt(now, {});
    const auto free = run.freeMotions();
    std::vector<std::vector<double>> least;
    for (const auto& each : free) least.emplace_back(each.size(), 0.5 * scene.reach);
    forEachFeaturePair(scene.meshes.front(), scene.meshes.back(),
                       [&](const auto& weights, double distance, double radii) {
                         const double gap = distance - radii <= scene.thickness
                                                ? distance
                                                : distance - radii - scene.thickness;
                         double motion = 0.0;
                         for (const auto& [ofB, v, weight] : weights) {
                           motion += weight * free[ofB][v];
                           least[ofB][v] = std::min(least[ofB][v], 0.5 * gap);
                         }
                         EXPECT_LT(motion, std::max(gap, 1e-300));
                         near += isTapered && motion > 0.5 * gap;
                       });
    for (std::size_t m = 0; m < free.size(); ++m)
      for (std::size_t v = 0; v < free[m].size(); ++v) {
        EXPECT_TRUE(isTapered || free[m][v] >= least[m][v] - 1e-6 * scene.reach) << m << ' ' << v;
        EXPECT_LE(free[m][v], 0.5 * scene.reach);
      }
    if (HasFailure()) return;
  }
  EXPECT_GE(near, leastOf(30));
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
  const auto expectAfterDetection = [&](GeometryId id, double motion) {
    collisions.detectCollision();
    expectAll(id, motion);
  };
  // What was found for other elements is no answer, not even for as many vertices.
  const auto expectNone = [&] {
    expectRefused(ErrorCode::NotAvailable, "has no free motion yet",
                  [&] { collisions.freeMotion(a); });
  };
  expectAll(a, kInfinity);
  EXPECT_EQ(collisions.freeMotion(sphere).size(), 1u);
  collisions.addCollisionPair(a, b, {.thickness = 0.1, .freeMotionReach = 1.0});
  expectNone();
  expectAfterDetection(a, 0.2);
  EXPECT_EQ(collisions.freeMotion(a).size(), low.positions.size());
  expectAll(b, 0.2), expectAll(alone, kInfinity);

  std::vector<std::uint32_t> all(low.triangles.size());
  std::iota(all.begin(), all.end(), 0u);
  collisions.setDisabledElements(a, all);
  expectNone();
  expectAfterDetection(b, 0.5);
  collisions.setDisabledElements(a, {});
  expectNone();
  collisions.setTriangles(a, low.positions, low.triangles);
  expectNone();
  expectAfterDetection(a, 0.2);

  collisions.setPairSettings(a, b, {.thickness = 0.1, .freeMotionReach = 0.1});
  expectAfterDetection(a, 0.05);
  collisions.setPairSettings(a, b, {.thickness = 0.1, .freeMotionReach = 1.0});
  collisions.setContactPredicate(a, b, [](const ContactFeatures&) { return false; });
  expectAfterDetection(a, 0.5);
  collisions.setContactPredicate(a, b, {});
  collisions.setCollisionFilter(a, {.groups = 2});
  collisions.setCollisionFilter(b, {.mask = 1});
  expectAfterDetection(a, kInfinity);

  collisions.addCollisionPair(b, sphere, {.method = Method::Proximity, .freeMotionReach = 1.0});
  expectAfterDetection(sphere, 0.1);
  collisions.removeCollisionPair(b, sphere);
  expectAfterDetection(sphere, kInfinity);
}

}  // namespace
}  // namespace palpate::testing
