#pragma once

#include <palpate/Settings.h>
#include <palpate/Types.h>

#include "CollisionDetection/GeometryOctree.h"
#include "CollisionDetection/GeometryStep.h"
#include "CollisionDetection/RigidBody.h"
#include "CollisionDetection/TetrahedronTree.h"
#include "Mesh/Motion.h"
#include "Mesh/Revision.h"
#include "Mesh/TetrahedralTopology.h"
#include "Mesh/TriangleMesh.h"
#include "Octree/PointQueries.h"
#include "Shapes/PlacedShape.h"

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

namespace palpate {

struct Geometry;

/// How a geometry moves in its step.
class GeometryMotion {
 public:
  /// Brings what follows up to date.
  void update(const Geometry&);
  /// Takes the motion of the step's positions, measured while they were copied.
  void take(const TriangleMesh&, const MotionRange&);
  /// Whether it pays to measure motion while positions are copied: the step before asked for it.
  bool isWanted() const { return m_wasUsed; }
  void advance() { m_wasUsed = std::exchange(m_isUsed, false); }

  const MotionRange& range() const { return m_range; }  ///< from before to now
  /// From the end that the last detection saw to the start of this step.
  const MotionRange& correction() const { return m_correction; }
  double arcDeviation() const { return m_arcDeviation; }  ///< L

 private:
  using Ends = DerivedFrom<4>;  ///< body and transform of two ends
  Ends m_rangeOf, m_arcOf, m_correctionOf;
  MotionRange m_range, m_correction;
  double m_arcDeviation = 0;
  bool m_isUsed = false, m_wasUsed = false;
  RigidSearch m_search;
};

/// What users change of a geometry besides its positions, by state.
struct GeometryRevisions {
  RevisionCounter counter;
  Revision topology;  ///< elements, and the shape at rest
  Revision enabled;   ///< which elements are enabled
  Revision filter;
};

/// The tetrahedra whose surface a geometry is, and an octree over them, built when it is first
/// asked for.
struct Solid {
  TetrahedralTopology topology;
  TetrahedronTree tree;
  /// Of the geometry's topology and positions now; and its float frame then.
  DerivedFrom<2> treeOf;
  FloatFrame treeFrame;
};

/// One geometry of an OctreeBasedCD. Each part has one owner, which keeps it consistent; the parts
/// below use those above.
struct Geometry {
  explicit Geometry(GeometryId newId) : id(newId), step(newId) {}

  GeometryId id;
  GeometryRevisions revisions;
  CollisionFilter filter;
  TriangleMesh mesh;                 ///< topology and positions; of a shape, its corners
  std::optional<PlacedShape> shape;  ///< of an analytical geometry
  GeometryStep step;                 ///< writes the positions of both ends
  double smallestHeight = 0;         ///< L: of a triangle with area, when the topology was set
  GeometryMotion motion;
  GeometryOctree tree;
  std::unique_ptr<Solid> solid;  ///< of a tetrahedral mesh

  /// Whether setTransform() has placed it: its octree is in the body's frame.
  bool isPlaced() const { return mesh.now.isPlaced(); }
  bool meets(const Geometry& other) const {
    return (filter.groups & other.filter.mask) && (other.filter.groups & filter.mask);
  }
  /// All that answers about it depend on.
  std::array<Revision, 7> state() const {
    return {revisions.topology,
            revisions.enabled,
            revisions.filter,
            mesh.before.bodyRevision(),
            mesh.before.transformRevision(),
            mesh.now.bodyRevision(),
            mesh.now.transformRevision()};
  }
};

}  // namespace palpate
