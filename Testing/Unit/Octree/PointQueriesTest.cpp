#include "Octree/PointQueries.h"

#include "CollisionDetection/GeometryTable.h"
#include "Common/EverySimdPath.h"
#include "Common/RandomMeshes.h"
#include "Octree/Traversal.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <string>
#include <vector>

namespace palpate {
namespace {

using testing::Mesh;
using testing::Random;
using testing::uniform;

/// A geometry's octree, and maps of its boxes: the identity, and one and two rotations.
struct QueryCase {
  GeometryTable table;
  const Octree* octree;
  std::vector<BoxMap> maps{BoxMap{}};

  QueryCase(Random& random, std::size_t size, double extent) {
    const Mesh mesh = testing::soup(random, size, extent);
    const GeometryId id = table.add(table.builder().triangles(mesh.positions, mesh.triangles));
    Body& body = table.at(id).body;
    const Revision topology = body.revisions.elements.topology;
    const double scale = frameScale(body.tree.sampleFrame(body.mesh, topology));
    body.tree.update(body.mesh, topology, scale, {}, Threads(1));
    octree = &body.tree.octree();
    for (int ends = 1; ends <= 2; ++ends) {
      BoxMap& map = maps.emplace_back();
      for (int i = 0; i < ends; ++i) {
        const double angle = uniform(random, 0.0, 3.0);
        const Eigen::Vector3d axis = testing::randomPoint(random, -1.0, 1.0).normalized();
        const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
        std::array<std::array<double, 3>, 3> matrix;
        for (int k = 0; k < 3; ++k)
          for (int j = 0; j < 3; ++j) matrix[k][j] = turn(k, j);
        setEnd(map.ends[map.count++], matrix, {0.1, -0.2, 0.3}, 0.0, 1e-6);
      }
    }
  }
  std::uint32_t size() const { return static_cast<std::uint32_t>(octree->size()); }
};

FloatBox randomBox(Random& random, double reach, double size) {
  FloatBox box;
  for (int k = 0; k < 3; ++k) {
    box.lower[k] = static_cast<float>(uniform(random, -reach, reach));
    box.upper[k] = box.lower[k] + static_cast<float>(uniform(random, 0.0, size));
  }
  return box;
}

/// Calls f(case, map, reach) on every SIMD path. reach: the largest coordinate of the case's boxes.
template <class F>
void forEachCase(F&& f) {
  Random random(7);
  for (const std::size_t size : {1u, 5u, 33u, 2000u})
    for (const double extent : {0.02, 0.5}) {
      const QueryCase c(random, size, extent);
      double reach = 0;
      const FloatBox root = c.octree->blocks()[0].box(0);
      for (int k = 0; k < 3; ++k)
        reach = std::max({reach, -double{root.lower[k]}, double{root.upper[k]}});
      for (const std::string& path : testing::EverySimdPath()) {
        for (const BoxMap& map : c.maps) {
          SCOPED_TRACE(path + ", " + std::to_string(size) + " of size " + std::to_string(extent) +
                       ", ends " + std::to_string(map.count));
          f(c, map, reach);
        }
      }
    }
}

TEST(PointQueries, FindEveryOverlappingElement) {
  std::size_t all = 0, none = 0;
  forEachCase([&](const QueryCase& c, const BoxMap& map, double reach) {
    Random random(8 + c.size());
    PointQueryStack stack;
    for (int query = 0; query < 40; ++query) {
      const FloatBox box = query == 0 ? FloatBox() : randomBox(random, 1.5 * reach, 0.5 * reach);
      std::vector<std::uint32_t> expected;
      for (std::uint32_t i = 0; i < c.size(); ++i)
        if (map(c.octree->boxes()[i]).overlaps(box)) expected.push_back(i);
      findOverlapping(*c.octree, map, box, stack);
      std::vector<std::uint32_t> found(stack.found.begin(), stack.found.end());
      std::sort(found.begin(), found.end());
      ASSERT_EQ(found, expected);
      // Without their own boxes, elements come with those of their node.
      found.clear();
      forEachOverlapping(
          *c.octree, [&](const FloatBox& stored) { return map(stored).overlaps(box); },
          [&](std::uint32_t begin, std::uint32_t end) {
            for (std::uint32_t i = begin; i < end; ++i) found.push_back(i);
          });
      std::sort(found.begin(), found.end());
      ASSERT_EQ(std::adjacent_find(found.begin(), found.end()), found.end());
      ASSERT_TRUE(std::includes(found.begin(), found.end(), expected.begin(), expected.end()));
      (expected.empty() ? none : all) += 1;
    }
  });
  EXPECT_GT(all, 100u);
  EXPECT_GT(none, 100u);
}

}  // namespace
}  // namespace palpate
