#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Queries/QueryTruth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

// What a ray selects among several geometries of all types: the first of all their hits.
namespace palpate::testing {
namespace {

struct PickScene {
  explicit PickScene(Engine engine) : collisions(settingsOf(engine)) {
    Random random(601);
    geometries = {testGeometry(sphere(10, 14, {0.3, 0.3, 0.5}, 0.25)),
                  thread(random, 60, 0.1, 0.02, false), particles(random, 60, 0.03),
                  testGeometry(sheet(6, 0.4, 0.0)), thread(random, 40, 0.1, 0.0, false)};
    for (const TestGeometry& each : geometries) ids.push_back(each.addTo(collisions));
    for (const AnalyticalGeometry& shape :
         {AnalyticalGeometry(Sphere{{0.8, 0.8, 0.8}, 0.15}),
          AnalyticalGeometry(Box{{0.8, 0.2, 0.3}, {0.1, 0.1, 0.1}}),
          AnalyticalGeometry(Cylinder{{0.1, 0.9, 0}, {0.1, 0.9, 1}, 0.1})})
      ids.push_back(collisions.addAnalyticalGeometry(shape));
    collisions.removeGeometry(collisions.addAnalyticalGeometry(Sphere{{0.5, 0.5, 0.5}, 3.0}));
  }
  bool isShape(GeometryId id) const { return id >= ids[geometries.size()]; }
  const TestGeometry& at(GeometryId id) const {
    return geometries[static_cast<std::size_t>(std::find(ids.begin(), ids.end(), id) -
                                               ids.begin())];
  }

  OctreeBasedCD collisions;
  std::vector<TestGeometry> geometries;
  std::vector<GeometryId> ids;
};

/// Of the element's vertices and edges the one that is nearest to the hit.
void expectNearestFeatures(const Pick& pick, const TestGeometry& geometry, const Ray& ray) {
  const Positions& p = geometry.positions;
  const Vector3d at = ray.origin + pick.hit.t * ray.direction;
  const Triangle& t = pick.hit.vertices;
  EXPECT_NE(std::find(t.begin(), t.end(), pick.vertex), t.end());
  for (const std::uint32_t v : t)
    EXPECT_LE((p[pick.vertex] - at).norm(), (p[v] - at).norm() + 1e-12);
  const auto toEdge = [&](std::uint32_t a, std::uint32_t b) {
    const Vector3d edge = p[b] - p[a];
    const double square = edge.squaredNorm(),
                 s = square > 0 ? std::clamp((at - p[a]).dot(edge) / square, 0.0, 1.0) : 0.0;
    return (at - p[a] - s * edge).norm();
  };
  const auto [a, b] = pick.edge;
  if (geometry.type == GeometryType::Points) {
    EXPECT_TRUE(a == pick.vertex && b == pick.vertex);
    return;
  }
  EXPECT_LT(a, b);
  EXPECT_NE(std::find(t.begin(), t.end(), a), t.end());
  EXPECT_NE(std::find(t.begin(), t.end(), b), t.end());
  for (std::size_t i = 0; i < 3; ++i) {
    if (t[i] == t[(i + 1) % 3]) continue;
    EXPECT_LE(toEdge(a, b), toEdge(t[i], t[(i + 1) % 3]) + 1e-12);
  }
}

TEST(Pick, IsTheFirstHitOfAllGeometries) {
  const PickScene scene(Engine::Octree), bruteForce(Engine::BruteForce);
  const SpatialQueries queries = scene.collisions.queries(),
                       truth = bruteForce.collisions.queries();
  Random random(602);
  std::vector<std::size_t> picked(scene.ids.size());
  std::vector<RayHit> hits;
  for (int i = 0; i < casesOf(3000); ++i) {
    Ray ray{randomPoint(random, -0.5, 1.5), randomPoint(random, -1, 1)};
    if (i % 4 == 1) ray.tMin = 0.3, ray.tMax = 0.8;
    for (const bool frontFacesOnly : {false, true}) {
      const auto found = queries.pick(ray, frontFacesOnly);
      ASSERT_TRUE(isSame(found, truth.pick(ray, frontFacesOnly)));
      std::optional<RayHit> first;
      for (const GeometryId id : scene.ids) {
        queries.allHits(id, ray, hits);
        for (const RayHit& hit : hits)
          if ((hit.frontFace || !frontFacesOnly) && (!first || hit.t < first->t)) first = hit;
      }
      ASSERT_EQ(found.has_value(), first.has_value());
      if (!frontFacesOnly) {
        ASSERT_TRUE(isSame(queries.firstHit(ray), first));
        ASSERT_TRUE(isSame(truth.firstHit(ray), first));
      }
      if (!found) continue;
      ASSERT_TRUE(isSame(found->hit, *first));
      ++picked[static_cast<std::size_t>(found->hit.geometry)];
      if (scene.isShape(found->hit.geometry)) {
        EXPECT_EQ(found->vertex, kNoElement);
        EXPECT_EQ(found->edge, (std::array{kNoElement, kNoElement}));
      } else {
        expectNearestFeatures(*found, scene.at(found->hit.geometry), ray);
      }
    }
  }
  for (std::size_t i = 0; i < picked.size(); ++i)
    if (i != 4) {  // a line without radius is met by no random ray
      EXPECT_GE(picked[i], leastOf(10)) << i;
    }
}

/// Of equally early hits that on the lowest geometry counts.
TEST(Pick, TiesGoToTheLowestGeometry) {
  OctreeBasedCD collisions;
  const Mesh mesh = sheet(2, 0.0, 0.0);
  Positions flat = mesh.positions;
  for (Vector3d& p : flat) p.z() = 0.0;
  const GeometryId first = collisions.addAnalyticalGeometry(Plane{{0, 0, -1}, {0, 0, 1}, false}),
                   second = collisions.addTriangleMesh(flat, mesh.triangles);
  collisions.addTriangleMesh(flat, mesh.triangles);
  const SpatialQueries queries = collisions.queries();
  EXPECT_EQ(queries.pick({{0.3, 0.2, 1}, {0, 0, -1}})->hit.geometry, second);
  EXPECT_EQ(queries.pick({{0.3, 0.2, -0.5}, {0, 0, -1}})->hit.geometry, first);
  EXPECT_EQ(queries.pick({{0.3, 0.2, -0.5}, {0, 0, 1}})->hit.geometry, second);
  EXPECT_FALSE(queries.pick({{0.3, 0.2, -0.5}, {0, 0, 1}}, true));  // from behind
  EXPECT_FALSE(OctreeBasedCD().queries().pick({{0, 0, 0}, {0, 0, 1}}));
}

/// A hit on one geometry does not change those on others, whatever their scale and order.
TEST(Pick, IsTheFirstOfTheSeparateFirstHits) {
  Random random(603);
  for (const int exponent : {-80, -50, -40, 0, 45, 60, 110, -110}) {
    for (int i = 0; i < casesOf(20); ++i) {
      Positions wall;
      for (int k = 0; k < 3; ++k)
        wall.push_back(std::ldexp(1.0, exponent) * randomPoint(random, -10, 10));
      const std::vector<Triangle> triangle{{0, 1, 2}};
      OctreeBasedCD collisions;
      const GeometryId first = collisions.addTriangleMesh(wall, triangle),
                       second = collisions.addTriangleMesh(wall, triangle);
      const SpatialQueries queries = collisions.queries();
      for (int k = 0; k < 50; ++k) {
        const Vector3d target = 0.3 * wall[0] + 0.3 * wall[1] + 0.4 * wall[2],
                       origin = std::ldexp(1.0, exponent) * randomPoint(random, -10, 10);
        const Ray ray{origin, uniform(random, 0.1, 10) * (target - origin)};
        const auto expected = queries.firstHit(first, ray);
        ASSERT_TRUE(expected);
        EXPECT_EQ(expected->t, queries.firstHit(second, ray)->t);
        EXPECT_TRUE(isSame(queries.firstHit(ray), expected));
        EXPECT_TRUE(isSame(queries.pick(ray)->hit, *expected));
      }
    }
  }
}

/// A hit in the middle of another geometry's part does not change whether the ray crosses there.
TEST(Pick, PartsAreNotCutByHitsOfOtherGeometries) {
  Mesh step = cube(-1.0, 1.0);
  const Mesh high = cube(-2.0, 2.0);
  for (const Triangle& t : high.triangles) step.triangles.push_back({t[0] + 8, t[1] + 8, t[2] + 8});
  for (const Vector3d& p : high.positions) step.positions.push_back(p + Vector3d(3, 0, 0));
  for (const bool isBallFirst : {false, true}) {
    OctreeBasedCD collisions;
    GeometryId body{};
    const auto addBody = [&] { body = collisions.addTriangleMesh(step.positions, step.triangles); };
    if (!isBallFirst) addBody();
    collisions.addPointSet(Positions{{0.5, 0.3, 1}}, 0.5);
    if (isBallFirst) addBody();
    const SpatialQueries queries = collisions.queries();
    const Ray ray{{-5, 0.3, 1}, {1, 0, 0}};  // along the low box's top, into the high box
    const auto expected = queries.firstHit(body, ray);
    ASSERT_TRUE(expected && expected->crosses);
    EXPECT_TRUE(isSame(queries.firstHit(ray), expected));
    EXPECT_TRUE(isSame(queries.pick(ray)->hit, *expected));
    std::vector<RayHit> hits;
    queries.allHits(body, ray, hits);
    EXPECT_TRUE(isSame(hits[0], *expected));
  }
}

TEST(Pick, NearestVertexAtAnyScale) {
  for (const int exponent : {-1000, -600, 0, 600, 990}) {
    const double s = std::ldexp(1.0, exponent);
    OctreeBasedCD collisions;
    collisions.addTriangleMesh(Positions{{-8 * s, -8 * s, 0}, {8 * s, -8 * s, 0}, {0, 8 * s, 0}},
                               std::vector<Triangle>{{0, 1, 2}});
    const auto found = collisions.queries().pick({{0, 7 * s, 4 * s}, {0, 0, -s}});
    ASSERT_TRUE(found);
    EXPECT_EQ(found->vertex, 2u);
    EXPECT_EQ(found->hit.t, 4.0);
  }
}

}  // namespace
}  // namespace palpate::testing
