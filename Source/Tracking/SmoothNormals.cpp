#include "Tracking/SmoothNormals.h"

#include "Mesh/FaceAtCorner.h"
#include "Math/StableLength.h"
#include "Core/Assert.h"

#include <cmath>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// Unit, or zero.
Vector3d normalOfVertex(const TriangleMesh& mesh, std::uint32_t vertex, double time) {
  struct AtTime {
    const TriangleMesh& mesh;
    double time;
    Vector3d operator[](std::uint32_t v) const {
      return time == 1.0 ? mesh.now[v] : (1.0 - time) * mesh.before[v] + time * mesh.now[v];
    }
  };
  Vector3d sum = Vector3d::Zero();
  for (const std::uint32_t t : mesh.topology.vertexTriangles[vertex]) {
    const Triangle& names = mesh.topology.elements[t];
    const std::size_t corner = names[0] == vertex ? 0 : names[1] == vertex ? 1 : 2;
    const Corners corners = cornersOf(names, AtTime{mesh, time});
    sum += FaceAtCorner(corners, corner).weightedNormal();
  }
  return stableUnit(sum);
}

/// The smooth normal on the side of the contact's. Where they are far apart, as at the border of an
/// open surface and at sharp edges, it is the contact's.
Vector3d onSideOf(const Vector3d& normal, const Vector3d& smooth) {
  constexpr double kLeastCosine = 0.5;
  const double cosine = normal.dot(stableUnit(smooth));
  if (!(std::abs(cosine) >= kLeastCosine)) return normal;
  return stableUnit(cosine > 0.0 ? smooth : Vector3d(-smooth));
}

template <class Contact>
Vector3d ofElement(const TriangleMesh& mesh, const Contact& contact) {
  return interpolatedNormal(mesh, contact.vertices, contact.weights.data(), contact.timeOfImpact);
}

Vector3d ofEdges(const MeshPair& pair, const EdgeEdgeContact& contact) {
  const double a[] = {1.0 - contact.weightA, contact.weightA},
               b[] = {1.0 - contact.weightB, contact.weightB};
  return interpolatedNormal(pair.b, contact.edgeB, b, contact.timeOfImpact) -
         interpolatedNormal(pair.a, contact.edgeA, a, contact.timeOfImpact);
}

}  // namespace

Vector3d interpolatedNormal(const TriangleMesh& mesh, std::span<const std::uint32_t> vertices,
                            const double* weights, double time) {
  Vector3d sum = Vector3d::Zero();
  if (!mesh.topology.hasFaces()) return sum;
  for (std::size_t i = 0; i < vertices.size(); ++i)
    if (weights[i] != 0.0) sum += weights[i] * normalOfVertex(mesh, vertices[i], time);
  return stableUnit(sum);
}

void findSmoothNormals(const MeshPair& pair, bool smoothsShape, const Threads& threads,
                       CollisionData::Contents& contents) {
  constexpr std::size_t kGrain = 64;  // contacts; any number will do
  const auto fill = [&](const auto& contacts, CountedVector<Vector3d>& normals, auto&& smooth) {
    normals.resize(contacts.size());
    threads.forChunks(contacts.size(), kGrain, [&](std::size_t, std::size_t i, std::size_t end) {
      for (; i < end; ++i) {
        normals[i] = onSideOf(contacts[i].normal, smooth(contacts[i]));
        PALPATE_ASSERT(std::abs(normals[i].norm() - 1.0) < 1e-9);
      }
    });
  };
  const TriangleMesh& mesh = pair.a.topology.hasFaces() ? pair.a : pair.b;
  fill(contents.vertexTriangle, contents.smooth.vertexTriangle,
       [&](const auto& contact) { return ofElement(pair.b, contact); });
  fill(contents.triangleVertex, contents.smooth.triangleVertex,
       [&](const auto& contact) { return ofElement(pair.a, contact); });
  fill(contents.edgeEdge, contents.smooth.edgeEdge,
       [&](const auto& contact) { return ofEdges(pair, contact); });
  fill(contents.shape, contents.smooth.shape, [&](const ShapeContact& contact) -> Vector3d {
    return smoothsShape ? ofElement(mesh, contact) : contact.normal;
  });
}

}  // namespace palpate
