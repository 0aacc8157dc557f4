// A separate project that simplifies a mesh: it needs the libraries behind simplify() to link and
// to run.
#include <palpate/OctreeBasedCD.h>
#include <palpate/Simplify.h>

#include <vector>

int main() {
  const std::vector<Eigen::Vector3d> positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const std::vector<palpate::Triangle> triangles{{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  const palpate::SimplifiedMesh around =
      palpate::simplify({positions, triangles}, {.maxDistance = 0.1});
  palpate::OctreeBasedCD collisions;
  const auto body = collisions.addTriangleMesh(around.positions, around.triangles);
  const auto queries = collisions.queries();
  for (const Eigen::Vector3d& p : positions)
    if (!queries.contains(body, p) || queries.closestPoint(body, p)->distance > 0.2) return 1;
  return 0;
}
