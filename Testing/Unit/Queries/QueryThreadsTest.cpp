#include "Common/FailingAllocation.h"
#include "Common/Sanitized.h"
#include "Common/ShapeTruth.h"
#include "Unit/Queries/EveryQuery.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <thread>
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
  /// Calls f for each query and each geometry that has what it needs.
  template <class F>
  void forEachCall(F&& f) const {
    for (const QueryCall& call : queryCalls())
      for (const GeometryId id : {closed, solid, open, line, points, shape}) {
        const Needs has = id == shape  ? Needs::Nothing
                          : id < open  ? Needs::Inside
                          : id == open ? Needs::Triangles
                                       : Needs::Elements;
        if (has >= call.needs) f(call, id);
      }
  }

  OctreeBasedCD collisions;
  GeometryId closed, solid, open, line, points, shape;
  Positions rest, probes;
  std::vector<Ray> rays;
};

std::vector<QueryAnswers> ask(const SharedScene& scene, const SpatialQueries& queries) {
  std::vector<QueryAnswers> all;
  QueryAnswers answers;
  for (std::size_t i = 0; i < scene.probes.size(); ++i) {
    const Ray& ray = scene.rays[i];
    scene.forEachCall([&](const QueryCall& call, GeometryId id) {
      call.ask(queries, id, scene.probes[i], ray, all.emplace_back());
    });
    all.back().firstOfAll = queries.firstHit(ray);
    all.back().pick = queries.pick(ray);
    all.back().pickOfFrontFaces = queries.pick(ray, true);
  }
  answers.closestOfBatch.resize(scene.probes.size());
  answers.signedOfBatch.resize(scene.probes.size());
  answers.firstOfBatch.resize(scene.rays.size());
  queries.closestPoints(scene.closed, scene.probes, answers.closestOfBatch);
  queries.signedDistances(scene.solid, scene.probes, answers.signedOfBatch);
  queries.firstHits(scene.closed, scene.rays, answers.firstOfBatch);
  queries.findInsideVertices(scene.points, scene.closed, answers.inside);
  queries.findInsideVertices(scene.points, scene.open, answers.insideByNumber,
                             {.rule = InsideRule::WindingNumber});
  queries.findEmbeddedVertices(scene.points, scene.solid, answers.embedded);
  all.push_back(answers);
  return all;
}

TEST(QueryThreads, ManyThreadsGetTheAnswersOfOne) {
  const SharedScene alone(1);
  const std::vector<QueryAnswers> expected = ask(alone, alone.collisions.queries());
  const QueryAnswers& last = expected.back();
  EXPECT_GT(std::min(last.inside.size(), last.embedded.size()), 10u);
  for (const int threads : {1, 3}) {
    SharedScene scene(threads);
    for (int repeat = 0; repeat < 3; ++repeat) {
      std::vector<std::vector<QueryAnswers>> answers(4);
      {
        std::vector<std::jthread> askers;
        for (auto& each : answers)
          askers.emplace_back([&] { each = ask(scene, scene.collisions.queries()); });
      }
      for (const auto& each : answers) EXPECT_TRUE(isSame(each, expected));
      scene.collisions.setPositions(scene.closed, scene.rest);  // the next ones update the octree
      scene.collisions.advance();
    }
  }
}

/// Scratch and the caller's vectors keep their capacity.
TEST(QueryAllocations, RepeatedSingleCallsAllocateNothing) {
  Random random(802);
  const SharedScene scene(1);
  const SpatialQueries queries = scene.collisions.queries();
  std::vector<AnalyticalGeometry> shapes = shapesOfEveryKind(random);
  shapes.resize(7);  // another box or hull allocates again
  shapes.insert(shapes.end(), {Sphere{{0, 0, 0}, 0.1}, Capsule{{-0.2, 0, 0}, {0.1, 0, 0}, 0.05},
                               Cylinder{{-0.1, 0, 0}, {0.1, 0, 0}, 0.0}});
  QueryAnswers answers;
  const auto expectNone = [&](const std::string& name, const auto& run) {
    run();
    FailingAllocation::arm(0);
    run();
    FailingAllocation::disarm();
    EXPECT_EQ(FailingAllocation::count(), 0u) << name;
  };
  scene.forEachCall([&](const QueryCall& call, GeometryId id) {
    if (call.isBatch) return;
    expectNone(call.name, [&] {
      for (std::size_t i = 0; i < scene.probes.size(); ++i)
        call.ask(queries, id, scene.probes[i], scene.rays[i], answers);
    });
  });
  expectNone("all geometries", [&] {
    for (const Ray& ray : scene.rays) {
      answers.firstOfAll = queries.firstHit(ray);
      answers.pick = queries.pick(ray);
      answers.pickOfFrontFaces = queries.pick(ray, true);
    }
  });
  expectNone("shapes in turn", [&] {
    for (const Vector3d& p : scene.probes)
      for (const GeometryId id : {scene.closed, scene.solid, scene.open, scene.line, scene.points})
        for (const AnalyticalGeometry& shape : shapes) {
          queries.contacts(id, shape, {Matrix3d::Identity(), p}, 0.05, answers.contacts);
          queries.overlapping(id, shape, {Matrix3d::Identity(), p}, answers.overlapping);
        }
  });
}

}  // namespace
}  // namespace palpate::testing
