#pragma once

#include <palpate/Error.h>
#include <palpate/LooseOctree.h>
#include <palpate/Settings.h>

#include "CollisionDetection/RigidBody.h"
#include "CollisionDetection/TetrahedronTree.h"
#include "Core/Arena.h"
#include "Core/Threads.h"
#include "Geometry/FloatPositions.h"
#include "Geometry/Motion.h"
#include "Geometry/TetrahedralTopology.h"
#include "Geometry/TriangleMesh.h"
#include "Geometry/UnfoldedStars.h"
#include "Octree/Octree.h"
#include "Octree/PointQueries.h"

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace palpate {

/// One mesh, its floats and its octree.
struct Geometry {
  GeometryId id;
  TriangleMesh mesh;
  std::optional<TetrahedralTopology> solid;  ///< of a tetrahedral mesh, whose surface `mesh` is
  TetrahedronTree tetrahedronTree;           ///< made when first asked for
  std::uint64_t tetrahedraFor = 0;           ///< bodyRevision that it is of
  FloatFrame tetrahedraFrame;
  /// Positions are checked while copied into one of these that no end of a step has.
  std::array<std::shared_ptr<std::vector<Eigen::Vector3d>>, 5> bodies;
  std::uint64_t revision = 1;      ///< counts changes of positions now and of topology
  std::uint64_t stepRevision = 1;  ///< and of the positions before
  std::uint64_t revisionFor(bool wholeStep) const { return wholeStep ? stepRevision : revision; }
  /// The same of positions in the body's frame.
  std::uint64_t bodyRevision = 1, bodyStepRevision = 1;
  /// By setTransform(): the octree is of the body's frame.
  bool isPlaced() const { return mesh.now.isPlaced(); }
  bool setThisFrame = true;   ///< positions or topology, since the last frame ended
  bool hasLastFrame = false;  ///< one ended with this topology
  bool beforeGiven =
      false;  ///< by the last call, in this frame; then `lastFrame` holds what it would else be
  Positions lastFrame;

  MotionRange motion;                       ///< of the step
  MotionRange correction;                   ///< from the last frame's positions to `before`
  double arcDeviation = 0;                  ///< L: of the step
  double largestOfBody = 0;                 ///< L: of its coordinates' magnitudes, where placed
  std::uint64_t largestRevision = 0;        ///< bodyRevision that it is of
  std::array<std::uint32_t, 7> furthest{};  ///< vertices of the last step, to be tried first
  PointQueryStack queries;                  ///< scratch
  std::uint64_t motionRevision = 0;         ///< stepRevision that both are of
  std::uint64_t movedRevision = 0;          ///< or motion alone, seen as positions were set
  std::uint64_t topologyRevision = 1;       ///< counts changes of topology
  std::uint64_t restRevision = 1;           ///< and of the shape at rest
  CollisionFilter filter;
  bool meets(const Geometry& other) const {
    return (filter.groups & other.filter.mask) && (other.filter.groups & filter.mask);
  }
  double smallestHeight = 0;  ///< L: of a triangle with area, when the topology was set

  FloatFrame frame;
  double spread = 0;  ///< of a sample of the positions
  Buffer<FloatPoint> floats;
  Buffer<FloatPoint> floatsBefore;  ///< of a swept geometry
  bool swept = false;               ///< boxes hold the whole step, because a pair's method needs it
  bool treeSwept = false;
  bool treeSweeps() const { return swept && !mesh.now.hasSameBody(mesh.before); }
  std::uint64_t revisionForTree() const { return treeSweeps() ? bodyStepRevision : bodyRevision; }
  bool treeIsNow() const { return treeSwept == treeSweeps() && treeRevision == revisionForTree(); }
  bool treeHasBody() const {
    return treeKnown && treeRevision == (treeSwept ? bodyStepRevision : bodyRevision);
  }
  const FloatPoint* floatsAtStart() const { return (treeSwept ? floatsBefore : floats).data(); }
  std::span<Triangle> orderedTriangles;  ///< in the octree's order; none during a build
  Arena triangleMemory;                  ///< of these, or of the keys of a build
  UnfoldedStars stars;                   ///< of self-collision
  Octree octree;
  Buffer<std::uint32_t> boundsGroups;  ///< scratch of a rebuild
  Buffer<FloatBox> boundsBoxes;
  std::uint64_t treeRevision = 0;  ///< revision that the octree is of
  bool treeKnown = false;          ///< built for this topology
  LooseOctree::Update lastUpdate = LooseOctree::Update::Unchanged;
  double boxMilliseconds = 0, octreeMilliseconds = 0;  ///< of the last update
};

/// Geometries by id, with the checks of what users hand in.
class GeometryTable {
 public:
  /// radii: none, one for all, or as many as positions.
  GeometryId add(std::span<const Eigen::Vector3d> positions, std::span<const Triangle>,
                 GeometryKind = GeometryKind::Triangles, std::span<const double> radii = {});
  GeometryId addLines(std::span<const Eigen::Vector3d> positions, std::span<const Segment>,
                      std::span<const double> radii);
  GeometryId addPoints(std::span<const Eigen::Vector3d> positions, std::span<const double> radii);
  GeometryId add(std::span<const Eigen::Vector3d> positions, std::span<const Tetrahedron>);
  GeometryId add(const AnalyticalGeometry&);
  void remove(GeometryId);
  void setPositions(GeometryId, std::optional<std::span<const Eigen::Vector3d>> before,
                    std::span<const Eigen::Vector3d> now, const Threads&);
  void setTriangles(GeometryId, std::span<const Eigen::Vector3d> positions,
                    std::span<const Triangle>);
  void setTetrahedra(GeometryId, std::span<const Eigen::Vector3d> positions,
                     std::span<const Tetrahedron>);
  void setFilter(GeometryId, const CollisionFilter&);
  void setDisabled(GeometryId, std::span<const std::uint32_t> elements);

  void setTransform(GeometryId, const RigidTransform&);

  Geometry& at(GeometryId);  ///< throws UnknownGeometry
  std::span<const std::unique_ptr<Geometry>> all() const { return m_geometries; }

  /// How a geometry moves in the step.
  static void updateMotion(Geometry&);
  /// Octrees for the positions now, or the whole step.
  void updateOctrees(const OctreeSettings&, const Threads&);
  bool updatedAlone() const { return m_updatedAlone; }  ///< by one thread, which has the data
  void endFrame();
  std::uint64_t framesEnded() const { return m_framesEnded; }

 private:
  GeometryId nextId() const;  ///< of what is added; throws if there are no more
  Geometry& add(std::vector<Eigen::Vector3d> rest, MeshTopology);
  static void setTopology(Geometry&, std::vector<Eigen::Vector3d> rest, MeshTopology);

  std::vector<std::unique_ptr<Geometry>> m_geometries;  ///< ascending ids
  std::uint32_t m_nextId = 0;
  std::vector<Geometry*> m_changed;
  bool m_updatedAlone = false;
  std::uint64_t m_framesEnded = 0;
};

std::string nameOf(GeometryId);    ///< "geometry 3"
std::string nameOf(GeometryKind);  ///< "a line mesh"

}  // namespace palpate
