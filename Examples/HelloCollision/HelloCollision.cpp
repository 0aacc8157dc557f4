// From two meshes to their contacts: a needle's tip comes down on a piece of tissue.
#include <palpate/Palpate.h>

#include <cstdio>
#include <vector>

int main() {
  using Eigen::Vector3d;
  const std::vector<Vector3d> tissue{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  const std::vector<palpate::Triangle> tissueTriangles{{0, 1, 2}, {0, 2, 3}};
  const std::vector<Vector3d> tipAtRest{{0.2, 0, 1}, {0.4, 0, 1}, {0.3, 0.2, 1}, {0.3, 0.1, 0.41}};
  const std::vector<palpate::Triangle> tipTriangles{{0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {0, 2, 1}};

  palpate::OctreeBasedCD detection;
  const palpate::GeometryId tip = detection.addTriangleMesh(tipAtRest, tipTriangles);
  const palpate::GeometryId organ = detection.addTriangleMesh(tissue, tissueTriangles);
  detection.addCollisionPair(tip, organ, {.method = palpate::Method::Proximity, .thickness = 0.02});

  std::vector<Vector3d> positions = tipAtRest;
  for (int frame = 0; frame < 5; ++frame) {
    detection.setPositions(tip, positions);
    detection.detectCollision();
    const palpate::CollisionData& contacts = detection.collisionData(tip, organ);
    if (contacts.vertexTriangle().empty()) std::printf("frame %d: no contact\n", frame);
    for (const palpate::VertexTriangleContact& contact : contacts.vertexTriangle()) {
      std::printf(
          "frame %d: vertex %u of the tip touches triangle %u of the tissue, %.3f away, normal "
          "(%g, %g, %g)\n",
          frame, contact.vertex, contact.triangle, contact.distance, contact.normal.x(),
          contact.normal.y(), contact.normal.z());
    }
    detection.advance();
    for (Vector3d& p : positions) p.z() -= 0.1;
  }
}
