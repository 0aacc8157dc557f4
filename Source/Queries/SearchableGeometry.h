#pragma once

#include <palpate/Types.h>

#include "Mesh/Revision.h"
#include "Mesh/TetrahedralTopology.h"
#include "Mesh/TriangleMesh.h"
#include "Octree/BoxMap.h"
#include "Queries/GeometryOctree.h"
#include "Queries/TetrahedronTree.h"
#include "Queries/WindingNumber.h"
#include "Shapes/PlacedShape.h"

#include <Eigen/Core>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

namespace palpate {

/// The states of what users change of a geometry besides its positions.
struct GeometryRevisions {
  RevisionCounter counter;
  Revision topology;  ///< elements, and the shape at rest
  Revision enabled;   ///< which elements are enabled
  Revision filter;
};

/// The tetrahedra whose surface a geometry is, and an octree over them, which is built when a query
/// first needs it.
struct Solid {
  TetrahedralTopology topology;
  TetrahedronTree tree;
  /// Of the geometry's topology and positions now; and its float frame then.
  DerivedFrom<2> treeOf;
  FloatFrame treeFrame;
};

/// A geometry with the octree over its elements: all that queries need of it.
struct SearchableGeometry {
  explicit SearchableGeometry(GeometryId newId) : id(newId) {}

  GeometryId id;
  GeometryRevisions revisions;
  TriangleMesh mesh;                 ///< topology and positions; of a shape, its corners
  std::optional<PlacedShape> shape;  ///< of an analytical geometry
  GeometryOctree tree;
  std::unique_ptr<Solid> solid;  ///< of a tetrahedral mesh
  WindingNumbers windingNumbers;

  /// Whether setTransform() has placed it: its octree is in the body's frame.
  bool isPlaced() const { return mesh.now.isPlaced(); }
};

/// The origin of a geometry's float frame in the world.
Eigen::Vector3d worldOrigin(const SearchableGeometry&);

/// Brings the boxes of a geometry's octree into the world, in floats about `origin`, grown by
/// `thickness` (in those floats): at the positions now, or over the whole step. Changes nothing
/// where the geometry is not placed.
BoxMap worldMap(const SearchableGeometry&, const Eigen::Vector3d& origin, double thickness,
                bool wholeStep);

std::string nameOf(GeometryId);    ///< "geometry 3"
std::string nameOf(GeometryKind);  ///< "a line mesh"
/// Throws unless the geometry is of triangles (of tetrahedra), which `call` changes.
void checkTopologyKind(const SearchableGeometry&, bool tetrahedra, const char* call);

}  // namespace palpate
