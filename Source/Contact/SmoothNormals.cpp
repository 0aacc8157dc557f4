#include "Contact/SmoothNormals.h"

#include "Contact/ContactLists.h"
#include "Mesh/FaceAtCorner.h"
#include "Mesh/FaceBlock.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// The positions of vertices at a time of the step.
struct AtTime {
  const TriangleMesh& mesh;
  double time;
  Vector3d operator[](std::uint32_t v) const {
    return time == 1.0 ? mesh.now[v] : (1.0 - time) * mesh.before[v] + time * mesh.now[v];
  }
};

/// Unit, or zero.
Vector3d normalOfVertex(const TriangleMesh& mesh, std::uint32_t vertex, double time) {
  constexpr std::size_t kLanes = FaceBlock::kLanes, kNext[] = {1, 2, 0, 1};
  const AtTime at{mesh, time};
  const Vector3d own = at[vertex];
  // Without a branch: which corner it is cannot be predicted.
  const auto cornerOf = [=](const Triangle& names) -> std::size_t {
    const std::size_t isLater = names[0] != vertex;
    return isLater + (isLater & static_cast<std::size_t>(names[1] != vertex));
  };
  const auto star = mesh.topology.vertexTriangles[vertex];
  Vector3d sum = Vector3d::Zero();
  FaceBlock block;
  for (std::size_t begin = 0; begin < star.size(); begin += kLanes) {
    const auto faces = star.subspan(begin, std::min(kLanes, star.size() - begin));
    for (std::size_t lane = 0; lane < faces.size(); ++lane) {
      const Triangle& names = mesh.topology.elements[faces[lane]];
      const std::size_t corner = cornerOf(names);
      block.set(lane, at[names[kNext[corner]]] - own, at[names[kNext[corner + 1]]] - own);
    }
    for (std::size_t lane = faces.size(); lane < kLanes; ++lane)
      block.set(lane, Vector3d::UnitX(), Vector3d::UnitY());
    const FaceBlockNormals normals = weightedNormals(block);
    for (std::size_t lane = 0; lane < faces.size(); ++lane) {
      const Triangle& names = mesh.topology.elements[faces[lane]];
      if (normals.isPlain >> lane & 1)
        sum += Vector3d(normals.weighted[0][lane], normals.weighted[1][lane],
                        normals.weighted[2][lane]);
      else
        sum += FaceAtCorner(cornersOf(names, at), cornerOf(names)).weightedNormal();
    }
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

/// Whether the smooth normal alone says that an impact's features come nearer: along the contact's
/// own normal they slide or part. A row along it would ask for what no feature needs.
bool holdsBack(const MeshPair& pair, ContactKind kind, const auto& contact,
               const Vector3d& smooth) {
  if (!(contact.timeOfImpact < 1.0)) return false;
  const Stencil all = stencil(contact);
  const auto sides = sidesOf(kind);
  Vector3d displacement = Vector3d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    const TriangleMesh& mesh = pair.meshOf(sides[i]);
    displacement += all.weights[i] * (mesh.now[all.vertices[i]] - mesh.before[all.vertices[i]]);
  }
  const double rounding = kTouchAngle * stableLength(displacement);
  return smooth.dot(displacement) < -rounding && contact.normal.dot(displacement) >= -rounding;
}

/// The sum of vertices' normals by weights. Unit, or zero.
template <class NormalOf>
Vector3d interpolated(std::span<const std::uint32_t> vertices, const double* weights,
                      NormalOf&& normalOf) {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = 0; i < vertices.size(); ++i)
    if (weights[i] != 0.0) sum += weights[i] * normalOf(vertices[i]);
  return stableUnit(sum);
}

/// interpolatedNormal() of two meshes, for contacts with common vertices.
class ContactNormals {
 public:
  explicit ContactNormals(const MeshPair& pair) : m_meshes{&pair.a, &pair.b} {}

  template <class Contact>
  Vector3d ofElement(bool ofB, const Contact& contact) {
    return of(ofB, contact.vertices, contact.weights.data(), contact.timeOfImpact);
  }
  Vector3d ofEdges(const EdgeEdgeContact& contact) {
    const double a[] = {1.0 - contact.weightA, contact.weightA},
                 b[] = {1.0 - contact.weightB, contact.weightB};
    return of(true, contact.edgeB, b, contact.timeOfImpact) -
           of(false, contact.edgeA, a, contact.timeOfImpact);
  }

 private:
  struct Key {
    std::uint32_t vertex = 0xffffffffu;  ///< 2 v, or 2 v + 1 of b
    std::uint64_t time = 0;              ///< the bits of the number
    bool operator==(const Key&) const = default;
  };
  struct Known {
    Key key;
    Vector3d normal;
  };

  Vector3d of(bool ofB, std::span<const std::uint32_t> vertices, const double* weights,
              double time) {
    const TriangleMesh& mesh = *m_meshes[ofB];
    if (!mesh.topology.hasFaces()) return Vector3d::Zero();
    return interpolated(vertices, weights, [&](std::uint32_t vertex) -> const Vector3d& {
      const Key key{2 * vertex + ofB, std::bit_cast<std::uint64_t>(time)};
      Known& known = m_known[key.vertex % m_known.size()];
      if (known.key != key) known = {key, normalOfVertex(mesh, vertex, time)};
      return known.normal;
    });
  }

  const std::array<const TriangleMesh*, 2> m_meshes;
  std::array<Known, 256> m_known;
};

}  // namespace

Vector3d interpolatedNormal(const TriangleMesh& mesh, std::span<const std::uint32_t> vertices,
                            const double* weights, double time) {
  if (!mesh.topology.hasFaces()) return Vector3d::Zero();
  return interpolated(vertices, weights,
                      [&](std::uint32_t vertex) { return normalOfVertex(mesh, vertex, time); });
}

void findSmoothNormals(const MeshPair& pair, bool smoothsShape, const Threads& threads,
                       CollisionData::Contents& contents) {
  constexpr std::size_t kGrain = 256;  // contacts; any number will do
  std::size_t size = 0;
  forEachContactList(contents, [&](ContactKind kind, const auto& list) {
    if (kind == ContactKind::ShapeShape) return;
    contents.columnsOf(kind).smooth.resize(list.size());
    size += list.size();
  });
  const bool meshIsB = !pair.a.topology.hasFaces();
  threads.forChunks(size, kGrain, [&](std::size_t, std::size_t begin, std::size_t end) {
    ContactNormals known(pair);
    const auto smooth = [&](auto kind, const auto& contact) -> Vector3d {
      if constexpr (kind == ContactKind::EdgeEdge)
        return known.ofEdges(contact);
      else if constexpr (kind == ContactKind::Shape)
        return smoothsShape ? known.ofElement(meshIsB, contact) : contact.normal;
      else
        return known.ofElement(kind == ContactKind::VertexTriangle, contact);
    };
    std::size_t first = 0;  // of the list, among all contacts
    forEachContactList(contents, [&](auto kind, const auto& list) {
      if constexpr (kind != ContactKind::ShapeShape) {
        const std::size_t last = std::min(end, first + list.size());
        for (std::size_t i = std::max(begin, first); i < last; ++i) {
          const auto& contact = list[i - first];
          Vector3d& normal = contents.columnsOf(kind).smooth[i - first];
          normal = onSideOf(contact.normal, smooth(kind, contact));
          if constexpr (kind != ContactKind::Shape)
            if (holdsBack(pair, kind, contact, normal)) normal = contact.normal;
          PALPATE_ASSERT(std::abs(normal.norm() - 1.0) < 1e-9);
        }
        first += list.size();
      }
    });
  });
}

}  // namespace palpate
