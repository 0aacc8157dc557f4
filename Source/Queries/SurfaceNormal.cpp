#include "Queries/SurfaceNormal.h"

#include "Mesh/Corners.h"
#include "Math/ClosestPoint.h"
#include "Math/Foot.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"

#include <Eigen/Geometry>

#include <cmath>
#include <numbers>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// The angle in [0, pi] with this sine and cosine, both times `length`, within 2^-40 of itself.
/// std::atan2() has other bits on other processors.
double angleOf(double sine, double cosine, double length) {
  if (cosine < 0.0) return std::numbers::pi - angleOf(sine, -cosine, length);
  double tangent = sine / (length + cosine);  // of the half
  for (int i = 0; i < 2; ++i) tangent /= 1.0 + std::sqrt(1.0 + tangent * tangent);
  const double square = tangent * tangent;
  constexpr double kInverse[] = {1.0 / 15, 1.0 / 13, 1.0 / 11, 1.0 / 9, 1.0 / 7, 1.0 / 5, 1.0 / 3};
  double series = 0.0;
  for (const double inverse : kInverse) series = inverse - square * series;
  return 8.0 * tangent * (1.0 - square * series);
}

/// A triangle as seen from one of its corners.
class FaceAtCorner {
 public:
  FaceAtCorner(const Corners& p, std::size_t corner)
      : m_corners(p),
        m_u(p[(corner + 1) % 3] - p[corner]),
        m_v(p[(corner + 2) % 3] - p[corner]),
        m_across(m_u.cross(m_v)),
        m_ofU(m_u.squaredNorm()),
        m_ofV(m_v.squaredNorm()),
        m_square(m_across.squaredNorm()) {}

  /// Its unit normal, within 2^-44; zero without area.
  Vector3d normal() const {
    if (isPlain()) return m_across / std::sqrt(m_square);
    return unitCross(m_corners[0], m_corners[1], m_corners[0], m_corners[2]);
  }
  /// Its unit normal times the angle at the corner, in rad.
  Vector3d weightedNormal() const {
    if (isPlain()) {
      const double length = std::sqrt(m_square);
      return angleOf(length, m_u.dot(m_v), std::sqrt(m_ofU * m_ofV)) / length * m_across;
    }
    const Vector3d u = stableUnit(m_u), v = stableUnit(m_v);
    return angleOf(stableLength(u.cross(v)), u.dot(v), 1.0) * normal();
  }
  /// Whether its size and angle are moderate, so that the cross product of the rounded edges is
  /// within 2^-44 of its length.
  bool isPlain() const {
    const auto isModerate = [](double square) { return square > 0x1p-400 && square < 0x1p400; };
    return isModerate(m_ofU) && isModerate(m_ofV) && m_square > 0x1p-10 * m_ofU * m_ofV;
  }

 private:
  const Corners& m_corners;
  const Vector3d m_u, m_v, m_across;
  const double m_ofU, m_ofV, m_square;  ///< squared lengths
};

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
