#include "Queries/SurfaceNormal.h"

#include "Mesh/FaceAtCorner.h"
#include "Math/ClosestPoint.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"

namespace palpate {

using Eigen::Vector3d;

namespace {

/// The sum of the normals around the element's edge or vertex with the weights that are not 0; 0 on
/// a face.
Vector3d sumAround(const TriangleMesh& mesh, std::uint32_t element, const Vector3d& weights) {
  const MeshTopology& topology = mesh.topology;
  const auto onFace = (weights.array() != 0.0).count();
  Eigen::Index last = 0;
  Vector3d sum = Vector3d::Zero();
  if (onFace == 1) {
    weights.maxCoeff(&last);
    const std::uint32_t vertex = topology.elements[element][static_cast<std::size_t>(last)];
    for (const std::uint32_t t : topology.vertexTriangles[vertex]) {
      const Triangle& names = topology.elements[t];
      const std::size_t corner = names[0] == vertex ? 0 : names[1] == vertex ? 1 : 2;
      sum += FaceAtCorner(cornersOf(names, mesh.now), corner).weightedNormal();
    }
  } else if (onFace == 2) {
    weights.minCoeff(&last);
    const auto opposite = static_cast<std::size_t>(last);
    const std::uint32_t edge = topology.triangleEdges[element][(opposite + 1) % 3];
    if (edge == kNoEdge) return sum;
    for (const std::uint32_t t : topology.edgeTriangles[edge])
      sum += FaceAtCorner(cornersOf(topology.elements[t], mesh.now), 0).normal();
  }
  return sum;
}

}  // namespace

Vector3d surfaceNormal(const Body& body, std::uint32_t element, const Vector3d& weights,
                       const Vector3d& toward) {
  const TriangleMesh& mesh = body.mesh;
  if (!mesh.topology.hasFaces()) {
    const Vector3d direction = stableUnit(toward);
    if (direction != Vector3d::Zero()) return direction;
  } else if (mesh.topology.isEnabled(element)) {
    const Vector3d sum = sumAround(mesh, element, weights);
    if (stableLength(sum) > kOpposedNormals) return stableUnit(sum);
  }
  const Corners p = cornersOf(mesh.topology.elements[element], mesh.now);
  const FaceAtCorner face(p, 0);
  return face.isPlain() ? face.normal() : windingNormal(p[0], p[1], p[2]);
}

void setNormal(const Body& body, const Vector3d& toward, SurfacePoint& point) {
  if (body.shape)
    point.normal = body.shape->now.signedDistance(point.position).normal;
  else if (point.element != kNoElement)
    point.normal = surfaceNormal(body, point.element, point.weights, toward);
}

}  // namespace palpate
