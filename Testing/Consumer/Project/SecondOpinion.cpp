// A separate project that switches from one engine to the other.
#include <palpate/FclEngine.h>

#include <vector>

template <class Engine>
std::size_t intersectingPairs() {
  const std::vector<Eigen::Vector3d> flat{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}},
      upright{{0.2, 0.2, -1}, {0.2, 0.2, 1}, {0.8, 0.8, 1}};
  const std::vector<palpate::Triangle> triangles{{0, 1, 2}};
  Engine engine;
  const auto a = engine.addTriangleMesh(flat, triangles),
             b = engine.addTriangleMesh(upright, triangles);
  engine.addCollisionPair(a, b, {palpate::Method::Intersection});
  engine.detectCollision();
  return engine.collisionData(a, b).intersectingTriangles().size();
}

int main() {
  return intersectingPairs<palpate::OctreeBasedCD>() == 1 &&
                 intersectingPairs<palpate::FclEngine>() == 1
             ? 0
             : 1;
}
