#include "Common/FailingAllocation.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Queries/QueryTruth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

// Many threads ask at once and get the answers of one. Repeated single calls allocate nothing.
namespace palpate::testing {
namespace {

struct SharedScene {
  explicit SharedScene(int threads) : collisions(settingsOf(Engine::Octree, threads)) {
    Random random(801);
    const Mesh ball = sphere(16, 24, {0.5, 0.5, 0.5}, 0.4), cloth = sheet(10, 0.5, 0);
    rest = ball.positions;
    closed = collisions.addTriangleMesh(rest, ball.triangles);
    Solid cube = cells(3, random);
    for (Vector3d& p : cube.positions) p *= 0.3;
    solid = collisions.addTetrahedralMesh(cube.positions, cube.tetrahedra);
    open = collisions.addTriangleMesh(cloth.positions, cloth.triangles);
    line = thread(random, 100, 0.1, 0.02, false).addTo(collisions);
    points = tapered(random, particles(random, 100, 0.0), 0.05).addTo(collisions);
    shape = collisions.addAnalyticalGeometry(Box{{0.5, 0.5, 0.5}, {0.2, 0.1, 0.3}});
    collisions.setTransform(line, {randomTurn(random), {0.1, 0, 0}});
    for (int i = 0; i < casesOf(60); ++i) probes.push_back(randomPoint(random, 0, 1));
    for (const Vector3d& p : probes) rays.push_back({p, randomPoint(random, -1, 1)});
  }
  std::vector<GeometryId> withElements() const { return {closed, solid, open, line, points}; }

  OctreeBasedCD collisions;
  GeometryId closed, solid, open, line, points, shape;
  Positions rest, probes;
  std::vector<Ray> rays;
};

constexpr InsideSettings kByNumber{.rule = InsideRule::WindingNumber};

/// What all queries answer.
struct Answers {
  std::vector<SurfacePoint> points, batchOfPoints;
  std::vector<SignedDistance> distances, batchOfDistances;
  std::vector<RayHit> hits, batchOfHits;
  std::vector<Pick> picks;
  std::vector<std::uint32_t> elements;
  std::vector<ShapeContact> contacts;
  std::vector<bool> flags;
  std::vector<InsideVertex> inside, byNumber;
  std::vector<EmbeddedVertex> embedded;

  friend bool operator==(const Answers& a, const Answers& b) {
    return isSame(a.points, b.points) && isSame(a.batchOfPoints, b.batchOfPoints) &&
           isSame(a.distances, b.distances) && isSame(a.batchOfDistances, b.batchOfDistances) &&
           isSame(a.hits, b.hits) && isSame(a.batchOfHits, b.batchOfHits) &&
           isSame(a.picks, b.picks) && a.elements == b.elements && a.contacts == b.contacts &&
           a.flags == b.flags && a.inside == b.inside && a.byNumber == b.byNumber &&
           a.embedded == b.embedded;
  }
};

template <class T>
void append(std::vector<T>& all, const std::vector<T>& more) {
  all.insert(all.end(), more.begin(), more.end());
}

Answers ask(const SharedScene& scene, const SpatialQueries& queries) {
  Answers all;
  std::vector<SurfacePoint> points;
  std::vector<RayHit> hits;
  std::vector<std::uint32_t> elements;
  std::vector<ShapeContact> contacts;
  for (std::size_t i = 0; i < scene.probes.size(); ++i) {
    const Vector3d& p = scene.probes[i];
    const Ray& ray = scene.rays[i];
    for (const GeometryId id : scene.withElements()) {
      queries.nearestElements(id, p, 4, points);
      append(all.points, points);
      queries.elementsWithin(id, p, 0.1, elements);
      append(all.elements, elements);
      queries.overlapping(id, Capsule{p, {0.5, 0.5, 0.5}, 0.05}, {Matrix3d::Identity(), {0, 0, 0}},
                          elements);
      append(all.elements, elements);
      queries.contacts(id, Box{p, {0.1, 0.2, 0.1}}, {Matrix3d::Identity(), {0, 0, 0}}, 0.01,
                       contacts);
      append(all.contacts, contacts);
    }
    for (GeometryId id : scene.withElements()) {
      for (const GeometryId each : {id, scene.shape}) {
        if (const auto point = queries.closestPoint(each, p, 0.5)) all.points.push_back(*point);
        queries.allHits(each, ray, hits);
        append(all.hits, hits);
        if (const auto hit = queries.firstHit(each, ray)) all.hits.push_back(*hit);
        all.flags.push_back(queries.anyHit(each, ray));
      }
    }
    for (const GeometryId id : {scene.closed, scene.solid, scene.open}) {
      all.flags.push_back(queries.contains(id, p, kByNumber));
      all.distances.push_back(queries.signedDistance(id, p, kByNumber));
      if (id == scene.open) continue;
      all.flags.push_back(queries.contains(id, p));
      all.distances.push_back(queries.signedDistance(id, p));
    }
    if (const auto hit = queries.firstHit(ray)) all.hits.push_back(*hit);
    for (const bool frontFacesOnly : {false, true})
      if (const auto pick = queries.pick(ray, frontFacesOnly)) all.picks.push_back(*pick);
  }
  all.batchOfPoints.resize(scene.probes.size());
  all.batchOfDistances.resize(scene.probes.size());
  all.batchOfHits.resize(scene.rays.size());
  queries.closestPoints(scene.closed, scene.probes, all.batchOfPoints);
  queries.signedDistances(scene.solid, scene.probes, all.batchOfDistances);
  queries.firstHits(scene.closed, scene.rays, all.batchOfHits);
  queries.findInsideVertices(scene.points, scene.closed, all.inside);
  queries.findInsideVertices(scene.points, scene.open, all.byNumber, kByNumber);
  queries.findEmbeddedVertices(scene.points, scene.solid, all.embedded);
  return all;
}

TEST(QueryThreads, ManyThreadsGetTheAnswersOfOne) {
  const SharedScene alone(1);
  const Answers expected = ask(alone, alone.collisions.queries());
  EXPECT_GT(expected.hits.size(), alone.probes.size());
  EXPECT_GT(expected.elements.size(), alone.probes.size());
  EXPECT_GT(expected.contacts.size(), alone.probes.size());
  EXPECT_GT(std::min(expected.inside.size(), expected.embedded.size()), 10u);
  for (const int threads : {1, 3}) {
    SharedScene scene(threads);
    for (int repeat = 0; repeat < 3; ++repeat) {
      std::vector<Answers> answers(4);
      {
        std::vector<std::jthread> askers;
        for (Answers& each : answers)
          askers.emplace_back([&] { each = ask(scene, scene.collisions.queries()); });
      }
      for (const Answers& each : answers) EXPECT_TRUE(each == expected);
      scene.collisions.setPositions(scene.closed, scene.rest);  // the next ones update the octree
      scene.collisions.advance();
    }
  }
}

/// Scratch and the caller's vectors keep their capacity.
TEST(QueryAllocations, RepeatedSingleCallsAllocateNothing) {
  const SharedScene scene(1);
  const SpatialQueries queries = scene.collisions.queries();
  std::vector<SurfacePoint> points;
  std::vector<RayHit> hits;
  std::vector<std::uint32_t> elements;
  std::vector<ShapeContact> contacts;
  const std::vector<AnalyticalGeometry> shapes{
      Sphere{{0, 0, 0}, 0.2},
      Sphere{{0, 0, 0}, 0.1},
      Capsule{{-0.1, 0, 0}, {0.1, 0, 0}, 0.1},
      Capsule{{-0.2, 0, 0}, {0.1, 0, 0}, 0.05},
      Plane{{0, 0, 0}, {0, 0, 1}, false},
      Box{{0, 0, 0}, {0.1, 0.2, 0.1}},
      Cylinder{{-0.1, 0, 0}, {0.1, 0, 0}, 0.1},
      Cylinder{{-0.1, 0, 0}, {0.1, 0, 0}, 0.0},
      ConvexHull{{{0, 0, 0}, {0.2, 0, 0}, {0, 0.2, 0}, {0, 0, 0.2}}}};
  const std::vector<GeometryId> ids = scene.withElements();
  using Call = std::function<void(GeometryId, const Vector3d&, const Ray&)>;
  const std::vector<std::pair<std::string, Call>> calls{
      {"closestPoint", [&](auto id, auto& p, auto&) { queries.closestPoint(id, p); }},
      {"nearestElements",
       [&](auto id, auto& p, auto&) { queries.nearestElements(id, p, 50, points); }},
      {"elementsWithin",
       [&](auto id, auto& p, auto&) { queries.elementsWithin(id, p, 0.3, elements); }},
      {"firstHit", [&](auto id, auto&, auto& ray) { queries.firstHit(id, ray); }},
      {"firstHit of all", [&](auto, auto&, auto& ray) { queries.firstHit(ray); }},
      {"anyHit", [&](auto id, auto&, auto& ray) { (void)queries.anyHit(id, ray); }},
      {"allHits", [&](auto id, auto&, auto& ray) { queries.allHits(id, ray, hits); }},
      {"pick", [&](auto, auto&, auto& ray) { queries.pick(ray); }},
      {"pick front faces", [&](auto, auto&, auto& ray) { queries.pick(ray, true); }},
      {"contacts and overlapping of shapes in turn",
       [&](auto id, auto& p, auto&) {
         for (const AnalyticalGeometry& shape : shapes) {
           queries.contacts(id, shape, {Eigen::Matrix3d::Identity(), p}, 0.05, contacts);
           queries.overlapping(id, shape, {Eigen::Matrix3d::Identity(), p}, elements);
         }
       }},
      {"contains",
       [&](auto id, auto& p, auto&) {
         if (id == scene.closed || id == scene.solid) (void)queries.contains(id, p);
       }},
      {"signedDistance", [&](auto id, auto& p, auto&) {
         if (id == scene.closed || id == scene.solid) queries.signedDistance(id, p);
         if (id == scene.open) queries.signedDistance(id, p, kByNumber);
       }}};
  for (const auto& [name, call] : calls) {
    const auto run = [&, &call = call] {
      for (std::size_t i = 0; i < scene.probes.size(); ++i)
        for (const GeometryId id : ids) call(id, scene.probes[i], scene.rays[i]);
    };
    run();
    FailingAllocation::arm(0);
    run();
    FailingAllocation::disarm();
    EXPECT_EQ(FailingAllocation::count(), 0u) << name;
  }
}

}  // namespace
}  // namespace palpate::testing
