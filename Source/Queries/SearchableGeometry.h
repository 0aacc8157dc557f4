#pragma once

#include <palpate/DistanceField.h>
#include <palpate/Types.h>

#include "Core/MemoryBudget.h"
#include "Mesh/Revision.h"
#include "Mesh/TetrahedralTopology.h"
#include "Mesh/TriangleMesh.h"
#include "Octree/BoxMap.h"
#include "Octree/Traversal.h"
#include "Queries/GeometryOctree.h"
#include "Queries/TetrahedronTree.h"
#include "Queries/WindingNumber.h"
#include "Shapes/PlacedShape.h"

#include <Eigen/Core>

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace palpate {

/// Revisions of the parts of a geometry that users can change, besides its positions.
struct GeometryRevisions {
  RevisionCounter counter;
  Revision topology;  ///< elements, and the shape at rest
  Revision enabled;   ///< which elements are enabled
  Revision filter;
  Revision field;
};

/// The tetrahedra of a geometry that is the surface of a tetrahedral mesh, and an octree over them.
/// The octree is built when a query first needs it.
struct Solid : CountedObject {
  TetrahedralTopology topology;
  TetrahedronTree tree;
  /// The topology and positions for which `tree` was updated, and the geometry's float frame then.
  DerivedFrom<2> treeVersion;
  FloatFrame treeFrame;
};

/// SpatialQueries::Source::state() and GeometryOctree::updates() at the end of a preparation.
class PreparedState {
 public:
  bool isCurrent(std::uint64_t state, std::uint64_t updates) const {
    return m_state.load(std::memory_order_acquire) == state &&
           m_updates.load(std::memory_order_relaxed) == updates;
  }
  void commit(std::uint64_t state, std::uint64_t updates) {
    m_updates.store(updates, std::memory_order_relaxed);
    m_state.store(state, std::memory_order_release);
  }

 private:
  std::atomic<std::uint64_t> m_state = 0, m_updates = 0;
};

/// A geometry with the octree over its elements, and all other data that queries need.
struct SearchableGeometry : CountedObject {
  explicit SearchableGeometry(GeometryId newId) : id(newId) {}

  GeometryId id;
  std::string name;  ///< OctreeBasedCD::setName()
  GeometryRevisions revisions;
  TriangleMesh mesh;                 ///< of a shape: no elements, and its corners as positions
  std::optional<PlacedShape> shape;  ///< of an analytical geometry
  /// Of a geometry that is a distance field, or a mesh to which one is attached.
  std::shared_ptr<const DistanceField> field;
  GeometryOctree tree;
  std::unique_ptr<Solid> solid;  ///< of a tetrahedral mesh
  WindingNumbers windingNumbers;
  /// Locked while a query updates what queries prepare: MeshTopology::closed, the tree of `solid`
  /// and windingNumbers.
  std::mutex preparation;
  /// The state for which checkInside() accepted the geometry and all of this was updated, for each
  /// InsideRule. Read without the lock.
  std::array<PreparedState, 2> preparedFor;

  /// Whether setTransform() has placed the geometry. Its octree is then in the body's frame.
  bool isPlaced() const { return mesh.now.isPlaced(); }
  bool isField() const { return mesh.topology.type == GeometryType::Field; }
};

/// Makes a geometry at rest of triangles, with its octree, for queries of points.
void makeBody(std::span<const Eigen::Vector3d> positions, std::span<const Triangle> triangles,
              const Threads&, SearchableGeometry& out);

/// The geometry, for queries. Throws UnsupportedMethod for a distance field that is a geometry.
SearchableGeometry& searchable(SearchableGeometry&);

/// The origin of a geometry's float frame in the world.
Eigen::Vector3d worldOrigin(const SearchableGeometry&);

/// The map from boxes of a geometry's octree to boxes in the world, as floats relative to `origin`.
/// It grows them by `thickness`, in units of these floats. The boxes enclose the positions now, or
/// the whole step. For a geometry that is not placed, the map changes nothing.
BoxMap worldMap(const SearchableGeometry&, const Eigen::Vector3d& origin, double thickness,
                bool wholeStep);

/// The frame in which a traversal compares boxes of two geometries.
enum class BoxFrame {
  World,  ///< candidates are defined there
  /// If both are placed: that of a body which does not turn while boxes enclose the step, b's if
  /// possible; else the world. Elements within the thickness are found in any frame. Here fewer
  /// others are, and faster, because only one geometry's boxes are mapped.
  Body
};

/// The octrees of two geometries, whose frames have one scale, for a traversal. thickness: L.
TreePair treesOf(const SearchableGeometry& a, const SearchableGeometry& b, double thickness,
                 bool wholeStep, BoxFrame frame = BoxFrame::World);

/// A geometry in a message. An id alone is that of a geometry that is not there yet, or unknown.
struct GeometryLabel {
  GeometryLabel(GeometryId newId) : id(newId) {}
  GeometryLabel(const SearchableGeometry& geometry) : id(geometry.id), name(geometry.name) {}
  std::string number() const;  ///< "3", or "3 \"liver\"" where it has a name

  GeometryId id;
  std::string_view name;
};
std::string nameOf(const GeometryLabel&);  ///< "geometry 3"
std::string nameOf(GeometryType);          ///< "a line mesh"
/// Throws UnsupportedMethod unless the geometry is a triangle mesh or, with `tetrahedra`, a
/// tetrahedral mesh. call: the end of the message.
void checkMeshType(const SearchableGeometry&, bool tetrahedra, const char* call);

}  // namespace palpate
