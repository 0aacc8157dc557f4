#pragma once

#include <palpate/DistanceField.h>
#include <palpate/Types.h>

#include "Bodies/GeometryOctree.h"
#include "Bodies/PreparedData.h"
#include "Shapes/PlacedShape.h"
#include "Mesh/Revision.h"
#include "Mesh/TetrahedralTopology.h"
#include "Mesh/TriangleMesh.h"
#include "Core/MemoryBudget.h"

#include <Eigen/Core>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace palpate {

/// The state of a body: a value derived from it holds while this is the same.
struct BodyState {
  ElementsState elements;
  Revision filter, field;
  PositionsState before, now;
  friend bool operator==(const BodyState&, const BodyState&) = default;
};

/// Revisions of the parts of a body that users can change, besides its positions.
struct BodyRevisions {
  Revision::Counter counter;
  ElementsState elements;
  Revision filter;
  Revision field;  ///< of all that is attached to the body

  void changeElements() {
    for (Revision* revision : {&elements.topology, &elements.enabled, &filter})
      *revision = counter.next();
  }
};

/// A body: elements, with an analytical shape or a distance field in their place where it has no
/// elements, and the octree over them.
struct Body : CountedObject {
  explicit Body(GeometryId newId) : id(newId) {}

  GeometryId id;
  std::string name;  ///< OctreeBasedCD::setName()
  BodyRevisions revisions;
  TriangleMesh mesh;                 ///< of a shape: no elements, and its corners as positions
  std::optional<PlacedShape> shape;  ///< of an analytical geometry
  /// Of a geometry that is a distance field, or a mesh to which one is attached.
  std::shared_ptr<const DistanceField> field;
  GeometryOctree tree;
  std::unique_ptr<Solid> solid;  ///< of a tetrahedral mesh
  /// What queries derive once. It stands beside the body: they change it and not the body.
  const std::unique_ptr<PreparedData> prepared = std::make_unique<PreparedData>();

  BodyState state() const {
    return {revisions.elements, revisions.filter, revisions.field, mesh.before.state(),
            mesh.now.state()};
  }
  /// Whether hasClosedSurface() was asked for these elements, and is true.
  bool isKnownClosed() const {
    return prepared->isClosed && prepared->closedVersion.isCurrent(revisions.elements.topology);
  }
  /// Whether setTransform() has placed the body. Its octree is then in the body's frame.
  bool isPlaced() const { return mesh.now.isPlaced(); }
  bool isField() const { return mesh.topology.type == GeometryType::Field; }
};

/// Makes a geometry at rest of triangles, with its octree, for queries of points.
void makeBody(std::span<const Eigen::Vector3d> positions, std::span<const Triangle> triangles,
              const Threads&, Body& out);

/// The geometry, for queries. Throws UnsupportedMethod for a distance field that is a geometry.
const Body& searchable(const Body&);

/// A geometry in a message. An id alone is that of a geometry that is not there yet, or unknown.
struct GeometryLabel {
  GeometryLabel(GeometryId newId) : id(newId) {}
  GeometryLabel(const Body& geometry) : id(geometry.id), name(geometry.name) {}
  std::string number() const;  ///< "3", or "3 \"liver\"" where it has a name

  GeometryId id;
  std::string_view name;
};
std::string nameOf(const GeometryLabel&);  ///< "geometry 3"
std::string nameOf(GeometryType);          ///< "a line mesh"
/// Throws UnsupportedMethod unless the geometry is a triangle mesh or, with `tetrahedra`, a
/// tetrahedral mesh. call: the end of the message.
void checkMeshType(const Body&, bool tetrahedra, const char* call);

}  // namespace palpate
