#include "Shrink.h"

#include <palpate/Capture.h>

#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <string>
#include <utility>

namespace palpate {
namespace {

namespace fs = std::filesystem;
using scenes::dataOf;

fs::path folder() { return fs::path(PALPATE_SOURCE_DIR) / "Data" / "Regression"; }

CollisionProblem problemOf(const std::string& name) {
  return readCapture(folder() / (name + ".capture"));
}

OctreeBasedCD solve(CollisionProblem problem, Engine engine, int threads = 1) {
  problem.settings.threads = threads;
  return scenes::solve(std::move(problem), engine);
}

std::array<std::size_t, 4> countsOf(const CollisionData& data) {
  return {data.vertexTriangle().size(), data.triangleVertex().size(), data.edgeEdge().size(),
          data.intersectingTriangles().size()};
}

void expectAsBruteForce(const CollisionProblem& problem) {
  const OctreeBasedCD oracle = solve(problem, Engine::BruteForce);
  for (const int threads : {1, 2}) {
    const OctreeBasedCD octree = solve(problem, Engine::Octree, threads);
    EXPECT_EQ(octree.octree().validate(), std::vector<std::string>{});
    for (const CollisionProblem::Pair& pair : problem.pairs) {
      EXPECT_EQ(countsOf(dataOf(octree, pair)), countsOf(dataOf(oracle, pair)));
      EXPECT_EQ(dataOf(octree, pair).hash(), dataOf(oracle, pair).hash());
      EXPECT_EQ(dataOf(octree, pair).earliestTimeOfImpact(),
                dataOf(oracle, pair).earliestTimeOfImpact());
    }
  }
}

TEST(Regression, EveryFileMatchesBruteForce) {
  std::size_t files = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder())) {
    if (entry.path().extension() != ".capture") continue;
    SCOPED_TRACE(entry.path().filename());
    expectAsBruteForce(readCapture(entry.path()));
    ++files;
  }
  EXPECT_GE(files, 11u);
}

/// Counts of vertex-triangle, triangle-vertex, edge-edge and intersecting triangles.
TEST(Regression, FailuresOfTheOldOctreeAreSolved) {
  const std::pair<const char*, std::array<std::size_t, 4>> rows[] = {
      {"VertexOfSecondPiercesFace", {0, 1, 0, 3}}, {"ThreeEdgesCross", {1, 1, 1, 1}},
      {"CoplanarTriangles", {0, 1, 2, 1}},         {"VertexExactlyOnFace", {0, 1, 0, 1}},
      {"EdgesShorterThan2e-5", {0, 1, 0, 3}},      {"OutsideTheRoot", {0, 1, 0, 3}}};
  for (const auto& [name, counts] : rows) {
    const CollisionProblem problem = problemOf(name);
    EXPECT_EQ(countsOf(dataOf(solve(problem, Engine::Octree), problem.pairs[0])), counts) << name;
  }
}

/// The old octree reported pairs twice after bodies had left its root and come back.
TEST(Regression, BodiesMayLeaveAndComeBack) {
  CollisionProblem problem = problemOf("VertexOfSecondPiercesFace");
  OctreeBasedCD detection = setUp(problem);
  const std::vector<Eigen::Vector3d> home = problem.geometries[1].now;
  detection.detectCollision();
  const std::uint64_t atHome = dataOf(detection, problem.pairs[0]).hash();
  for (const double far : {1e1, 1e3, 1e6, 1e12, 1e300}) {
    for (const bool away : {true, false}) {
      std::vector<Eigen::Vector3d> now = home;
      for (Eigen::Vector3d& p : now) p.x() += away ? far : 0.0;
      detection.advance();
      detection.setPositions(GeometryId{1}, now);
      detection.detectCollision();
      const CollisionData& data = dataOf(detection, problem.pairs[0]);
      if (away)
        EXPECT_EQ(countsOf(data), (std::array<std::size_t, 4>{})) << far;
      else
        EXPECT_EQ(data.hash(), atHome) << far;
      EXPECT_TRUE(detection.octree().validate().empty());
    }
  }
}

/// The old octree hung after a triangle had grown to the root's size and shrunk again.
TEST(Regression, TriangleMayGrowAndShrink) {
  CollisionProblem problem = problemOf("VertexOfSecondPiercesFace");
  for (const OctreeUpdate update : {OctreeUpdate::Auto, OctreeUpdate::Rebuild}) {
    problem.settings.octree.update = update;
    OctreeBasedCD detection = setUp(problem);
    CollisionProblem now = problem;
    std::vector<Eigen::Vector3d>& floor = now.geometries[0].now;
    for (const double size : {1.0, 8.0, 1e3, 1e9, 1e3, 8.0, 1.0, 0.5, 0x1p-20, 1.0}) {
      for (std::size_t v = 0; v < floor.size(); ++v) floor[v] = problem.geometries[0].now[v] * size;
      detection.setPositions(GeometryId{0}, floor);
      detection.detectCollision();
      EXPECT_TRUE(detection.octree().validate().empty());
      EXPECT_EQ(dataOf(detection, now.pairs[0]).hash(),
                dataOf(solve(now, Engine::BruteForce), now.pairs[0]).hash())
          << size;
    }
  }
}

/// A strip of triangles; each mesh has `count` of them.
CollisionProblem strips(std::uint32_t count) {
  CollisionProblem problem;
  for (std::uint32_t g = 0; g < 3; ++g) {
    CollisionProblem::Geometry mesh{GeometryId{g}, {}, {}, {}};
    for (std::uint32_t v = 0; v < count + 2; ++v)
      mesh.now.push_back({double(v), double(v % 2), double(g)});
    mesh.before = mesh.now;
    for (std::uint32_t t = 0; t < count; ++t) mesh.triangles.push_back({t, t + 1, t + 2});
    problem.geometries.push_back(mesh);
  }
  for (const auto& [a, b] : {std::pair{0u, 1u}, {0u, 2u}, {1u, 2u}, {2u, 2u}})
    problem.pairs.push_back({a, b, {}, Method::Intersection});
  return problem;
}

/// Whether a mesh has a triangle whose first corner is at x.
bool hasTriangleAt(const CollisionProblem& problem, GeometryId id, double x) {
  for (const CollisionProblem::Geometry& mesh : problem.geometries)
    for (const Triangle& triangle : mesh.triangles)
      if (mesh.id == id && mesh.now[triangle[0]].x() == x) return true;
  return false;
}

TEST(Shrink, KeepsOnlyWhatFails) {
  std::size_t calls = 0;
  // Fails if one triangle each of meshes 0 and 2 and the pair (0, 2) exist.
  const auto fails = [&](const CollisionProblem& problem) {
    ++calls;
    bool hasPair = false;
    for (const CollisionProblem::Pair& pair : problem.pairs)
      hasPair |= problem.geometries[pair.a].id == GeometryId{0} &&
                 problem.geometries[pair.b].id == GeometryId{2};
    return hasPair && hasTriangleAt(problem, GeometryId{0}, 317) &&
           hasTriangleAt(problem, GeometryId{2}, 40);
  };
  const CollisionProblem small = scenes::shrink(strips(500), fails);
  EXPECT_TRUE(fails(small));
  EXPECT_LT(calls, 150u);
  ASSERT_EQ(small.geometries.size(), 2u);
  ASSERT_EQ(small.pairs.size(), 1u);
  EXPECT_EQ(small.pairs[0].a, 0u);
  EXPECT_EQ(small.pairs[0].b, 1u);
  for (const CollisionProblem::Geometry& mesh : small.geometries) {
    ASSERT_EQ(mesh.triangles.size(), 1u);
    EXPECT_EQ(mesh.triangles[0], (Triangle{0, 1, 2}));
    EXPECT_EQ(mesh.now.size(), 3u);
    EXPECT_EQ(mesh.before.size(), 3u);
  }
  EXPECT_EQ(small.geometries[0].now[0].x(), 317);
  EXPECT_EQ(small.geometries[1].now[0].x(), 40);
}

TEST(Shrink, KeepsWhatAPredicateNeeds) {
  const CollisionProblem whole = strips(20);
  const auto needsVertices = [](const CollisionProblem& problem) {
    return problem.geometries.size() == 3 && problem.geometries[0].now.size() == 22;
  };
  const CollisionProblem small = scenes::shrink(whole, needsVertices);
  EXPECT_TRUE(needsVertices(small));
  EXPECT_TRUE(small.pairs.empty());
  for (const CollisionProblem::Geometry& mesh : small.geometries)
    EXPECT_TRUE(mesh.triangles.empty());
}

}  // namespace
}  // namespace palpate
