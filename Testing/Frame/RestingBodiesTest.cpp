#include "Common/DegenerateCases.h"
#include "Common/PairRun.h"
#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"

#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

// Bodies whose surfaces touch exactly, and overlap nowhere: they rest on each other, also over
// edges. Coordinates are multiples of 1/4.
namespace palpate::testing {
namespace {

using Eigen::Vector3d;

/// One of the 48 turns and mirrorings of a cube, which keep multiples of 1/4.
struct Orientation {
  std::array<int, 3> axes{0, 1, 2};
  Vector3d signs{1, 1, 1};

  explicit Orientation(Random& random) {
    for (int i = 2; i > 0; --i) std::swap(axes[i], axes[random() % (i + 1)]);
    for (int i = 0; i < 3; ++i) signs[i] = random() % 2 ? 1 : -1;
  }
  Vector3d operator()(const Vector3d& p) const {
    return {signs[0] * p[axes[0]], signs[1] * p[axes[1]], signs[2] * p[axes[2]]};
  }
  bool isMirror() const {
    const int order = (axes[1] - axes[0] + 3) % 3 == 1 ? 1 : -1;
    return order * signs.prod() < 0;
  }
  Mesh of(Mesh mesh) const {
    for (Vector3d& p : mesh.positions) p = (*this)(p);
    if (isMirror())
      for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
    return mesh;
  }
};

double quarters(Random& random, double low, double high) {
  const auto count = static_cast<std::uint64_t>(4 * (high - low)) + 1;
  return low + 0.25 * static_cast<double>(random() % count);
}

/// A table, and what lies on it and hangs over its edges.
struct RestScene {
  Mesh table, body;
  std::vector<Vector3d> before;  ///< of the body
};

/// depth: how far the body is in the table.
RestScene restScene(Random& random, bool isCloth, bool slides, double depth) {
  RestScene scene;
  scene.table = dividedBox({-2, -2, -2}, {2, 2, 0}, 1 + static_cast<int>(random() % 2));
  const auto pointOf = [&](double low, double high, double z) {
    const double x = quarters(random, low, high);
    return Vector3d(x, quarters(random, low, high), z);
  };
  const Vector3d size = pointOf(0.5, 2.5, 1);
  if (isCloth) {
    scene.body = flat(4, 0);
    for (Vector3d& p : scene.body.positions) p = p.cwiseProduct(size);
  } else {
    scene.body = dividedBox({0, 0, 0}, size, 1 + static_cast<int>(random() % 2));
  }
  const Vector3d at = pointOf(-3, 1.5, -depth);
  for (Vector3d& p : scene.body.positions) p += at;
  const Orientation orientation(random);
  scene.table = orientation.of(scene.table);
  scene.body = orientation.of(scene.body);
  scene.before = scene.body.positions;
  if (slides) {
    const Vector3d way = orientation(pointOf(-0.5, 0.5, 0));
    for (Vector3d& p : scene.before) p -= way;
  }
  return scene;
}

struct RestAnswer {
  double least = 0;  ///< the least distance of a contact, or 0
  bool trusted = false, intersecting = false;
  std::size_t inside = 0;
};
RestAnswer answerOf(const RestScene& scene, bool isCloth, Method method, double thickness) {
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  const GeometryId table = addMesh(collisions, scene.table), body = addMesh(collisions, scene.body);
  PairSettings settings{.method = method};
  settings.thickness = thickness;
  collisions.addCollisionPair(body, table, settings);
  collisions.setPositions(body, scene.before, scene.body.positions);
  collisions.detectCollision();
  const CollisionData& data = collisions.collisionData(body, table);
  RestAnswer answer;
  const auto add = [&](const auto& contacts) {
    for (const auto& c : contacts) answer.least = std::min(answer.least, c.distance);
  };
  add(data.vertexTriangle());
  add(data.triangleVertex());
  add(data.edgeEdge());
  answer.trusted = data.validity().trusted;
  if (!isCloth)  // has no inside
    answer.intersecting = collisions.queries().penetration(body, table).intersecting;
  std::vector<InsideVertex> inside;
  collisions.queries().findInsideVertices(body, table, inside);
  answer.inside = inside.size();
  return answer;
}

TEST(RestingBodies, HaveNoContactWithADepthWhereTheyTouch) {
  Random random(7);
  for (int run = 0; run < casesOf(300); ++run)
    for (const bool isCloth : {false, true})
      for (const bool slides : {false, true}) {
        const RestScene scene = restScene(random, isCloth, slides, 0);
        for (const Method method : {Method::Intersection, Method::Auto}) {
          if (slides && method == Method::Intersection) continue;
          const RestAnswer answer =
              answerOf(scene, isCloth, method, method == Method::Auto && run % 2 ? 0.125 : 0);
          EXPECT_GE(answer.least, 0.0) << run << ' ' << isCloth << slides << int(method);
          EXPECT_FALSE(answer.intersecting);
          EXPECT_EQ(answer.inside, 0u);
        }
      }
}

/// The same bodies, a quarter lower: what overlaps has a depth, of a quarter at most.
TEST(RestingBodies, HaveADepthWhereTheyAreLower) {
  Random random(8);
  int overlapping = 0;
  for (int run = 0; run < casesOf(100); ++run) {
    const RestScene scene = restScene(random, false, false, 0.25);
    for (const Method method : {Method::Intersection, Method::Auto}) {
      const RestAnswer answer = answerOf(scene, false, method, 0);
      overlapping += answer.intersecting;
      EXPECT_EQ(answer.least < 0, answer.intersecting) << run << ' ' << int(method);
    }
  }
  EXPECT_GT(overlapping, static_cast<int>(leastOf(100)));
}

}  // namespace
}  // namespace palpate::testing
