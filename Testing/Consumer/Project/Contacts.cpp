#include <palpate/Palpate.h>

#include <cstdio>
#include <vector>

// A step of a program, and pairs with lines and points.
int main() {
  const std::vector<Eigen::Vector3d> organPositions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<palpate::Triangle> organTriangles{{0, 1, 2}};
  const std::vector<Eigen::Vector3d> toolPositions{{0.2, 0.2, 0.05}, {0.2, 0.2, 2}, {0.3, 0.2, 2}};
  const std::vector<palpate::Triangle> toolTriangles{{0, 1, 2}};
  int contacts = 0;
  const auto respond = [&](const palpate::Stencil& stencil,
                           const palpate::VertexTriangleContact& contact) {
    std::printf("vertex %u is %g from triangle %u, normal (%g, %g, %g)\n", stencil.vertices[0],
                contact.distance, contact.triangle, contact.normal.x(), contact.normal.y(),
                contact.normal.z());
    ++contacts;
  };

  palpate::OctreeBasedCD collisions;
  const auto organ = collisions.addTriangleMesh(organPositions, organTriangles);
  const auto tool = collisions.addTriangleMesh(toolPositions, toolTriangles);
  collisions.addCollisionPair(organ, tool, {.thickness = 0.1});
  // in each step
  collisions.setPositions(tool, toolPositions);
  collisions.detectCollision();
  for (const auto& contact : collisions.collisionData(organ, tool).triangleVertex())
    respond(palpate::stencil(contact), contact);
  collisions.advance();

  const std::vector<palpate::Segment> segments{{0, 1}, {1, 2}};
  const auto thread = collisions.addLineMesh(toolPositions, segments, 0.01);
  const auto drops = collisions.addPointSet(toolPositions, 0.01);
  for (const auto other : {thread, drops})
    collisions.addCollisionPair(organ, other, {palpate::Method::Proximity, 0.1});
  collisions.detectCollision();
  for (const auto other : {thread, drops})
    contacts += static_cast<int>(collisions.collisionData(organ, other).triangleVertex().size());
  return contacts == 3 ? 0 : 1;
}
