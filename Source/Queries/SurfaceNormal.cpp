#include "Queries/SurfaceNormal.h"

#include "Mesh/Corners.h"
#include "Math/ClosestPoint.h"
#include "Math/Foot.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// The angle in [0, pi] with this sine and cosine, within 2^-40 of itself. std::atan2() has other
/// bits on other processors.
double angleOf(double sine, double cosine) {
  if (cosine < 0.0) return std::numbers::pi - angleOf(sine, -cosine);
  double tangent = sine / (1.0 + cosine);  // of the half
  for (int i = 0; i < 2; ++i) tangent /= 1.0 + std::sqrt(1.0 + tangent * tangent);
  const double square = tangent * tangent;
  double series = 0.0;
  for (int i = 15; i > 0; i -= 2) series = 1.0 / i - square * series;
  return 8.0 * tangent * series;
}

/// The angle of a triangle at one of its corners, in rad.
double angleAt(const std::array<Vector3d, 3>& p, std::size_t corner) {
  const Vector3d u = stableUnit(p[(corner + 1) % 3] - p[corner]),
                 v = stableUnit(p[(corner + 2) % 3] - p[corner]);
  return angleOf(stableLength(u.cross(v)), u.dot(v));
}

/// The sum of the unit normals of these triangles, each times weight(triangle, corners). A triangle
/// without area counts for nothing.
template <class Weight>
Vector3d sumOfNormals(const TriangleMesh& mesh, std::span<const std::uint32_t> triangles,
                      Weight&& weight) {
  Vector3d sum = Vector3d::Zero();
  for (const std::uint32_t t : triangles) {
    const Corners p = cornersOf(mesh.topology.triangles[t], mesh.now);
    sum += weight(t, p) * unitCross(p[0], p[1], p[0], p[2]);
  }
  return sum;
}

/// The sum of the normals around the edge or vertex with the weights that are not 0; 0 on a face.
Vector3d sumAround(const TriangleMesh& mesh, const Triangle& corners, const Vector3d& weights) {
  const MeshTopology& topology = mesh.topology;
  const auto onFace = (weights.array() != 0.0).count();
  Eigen::Index last = 0;
  if (onFace == 1) {
    weights.maxCoeff(&last);
    const std::uint32_t vertex = corners[static_cast<std::size_t>(last)];
    return sumOfNormals(mesh, topology.vertexTriangles[vertex],
                        [&](std::uint32_t t, const std::array<Vector3d, 3>& p) {
                          const Triangle& names = topology.triangles[t];
                          const auto at = std::find(names.begin(), names.end(), vertex);
                          return angleAt(p, static_cast<std::size_t>(at - names.begin()));
                        });
  }
  if (onFace != 2) return Vector3d::Zero();
  weights.minCoeff(&last);
  const auto opposite = static_cast<std::size_t>(last);
  const auto [p, q] = std::minmax(corners[(opposite + 1) % 3], corners[(opposite + 2) % 3]);
  const std::uint32_t edge = topology.edgeOf({p, q});
  if (edge == kNoEdge) return Vector3d::Zero();
  return sumOfNormals(mesh, topology.edgeTriangles[edge], [](auto&&...) { return 1.0; });
}

}  // namespace

Vector3d surfaceNormal(const Body& body, std::uint32_t element, const Vector3d& weights,
                       const Vector3d& toward) {
  const TriangleMesh& mesh = body.mesh;
  if (!mesh.topology.hasFaces()) {
    const Vector3d direction = stableUnit(toward);
    if (direction != Vector3d::Zero()) return direction;
  } else if (mesh.topology.isEnabled(element)) {
    const Vector3d sum = sumAround(mesh, mesh.topology.triangles[element], weights);
    if (stableLength(sum) > kOpposedNormals) return stableUnit(sum);
  }
  const auto [a, b, c] = cornersOf(mesh.topology.triangles[element], mesh.now);
  return windingNormal(a, b, c);
}

void setNormal(const Body& body, const Vector3d& toward, SurfacePoint& point) {
  if (body.shape)
    point.normal = body.shape->now.signedDistance(point.position).normal;
  else if (point.element != kNoElement)
    point.normal = surfaceNormal(body, point.element, point.weights, toward);
}

}  // namespace palpate
