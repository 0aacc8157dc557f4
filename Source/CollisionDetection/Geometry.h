#pragma once

#include <palpate/Settings.h>
#include <palpate/Types.h>

#include "CollisionDetection/GeometryStep.h"
#include "CollisionDetection/RigidSearch.h"
#include "Validity/MethodChoice.h"
#include "DistanceField/SurfaceProxy.h"
#include "Bodies/Body.h"
#include "Octree/PointQueries.h"
#include "Mesh/Motion.h"
#include "Mesh/PieceMotion.h"
#include "Mesh/Revision.h"
#include "Math/FreeMotion.h"
#include "Core/Buffer.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>

namespace palpate {

struct Geometry;

/// How a geometry moves in its step (GeometryMotion.cpp).
class GeometryMotion {
 public:
  /// Updates range(), correction() and arcDeviation().
  void update(const Geometry&);
  /// Stores the motion in the step, which was measured while the positions were copied.
  void set(const Geometry&, const MotionRange&);
  /// Whether motion should be measured while positions are copied: the step before needed it.
  bool shouldMeasure() const { return m_wasUsed; }
  void advance() { m_wasUsed = std::exchange(m_isUsed, false); }

  const MotionRange& range() const { return m_range; }  ///< from before to now
  /// From the end of the last detection's step to the start of this step.
  const MotionRange& correction() const { return m_correction; }
  double arcDeviation() const { return m_arcDeviation; }  ///< L

 private:
  using Ends = std::array<PositionsState, 2>;
  struct Step {
    Ends ends;
    Revision topology;  ///< of a placed body, only vertices of elements count
    friend bool operator==(const Step&, const Step&) = default;
  };
  static Step stepOf(const Geometry&);
  DerivedFrom<Step> m_rangeVersion, m_arcVersion;
  DerivedFrom<Ends> m_correctionVersion;
  MotionRange m_range, m_correction;
  double m_arcDeviation = 0;
  bool m_isUsed = false, m_wasUsed = false;
  RigidSearch m_search;
};

/// The smallest of some heights, which changes as heights are added and removed.
struct SmallestHeight {
  double value = std::numeric_limits<double>::infinity();  ///< L
  std::size_t count = 0;                                   ///< of those that are as small
  void add(double height);
  void remove(double height);  ///< an added one; afterwards isKnown() may be false
  bool isKnown() const { return count > 0 || value == std::numeric_limits<double>::infinity(); }
};

/// L: infinity without area.
double heightOf(const Triangle&, std::span<const Eigen::Vector3d> rest);
/// Of all triangles with area. In the body's frame, so that it does not depend on the transform.
SmallestHeight smallestHeight(const MeshTopology&, std::span<const Eigen::Vector3d> rest) noexcept;

/// The elements of a geometry with its shape at rest, and what follows from them.
struct RestShape {
  RestShape(CountedVector<Eigen::Vector3d> rest, MeshTopology, std::unique_ptr<Solid> = {});
  /// Throws the errors of input.
  static RestShape ofTetrahedra(const GeometryLabel&, std::span<const Eigen::Vector3d> positions,
                                std::span<const Tetrahedron>);

  CountedVector<Eigen::Vector3d> rest;
  MeshTopology topology;
  std::unique_ptr<Solid> solid;  ///< of a tetrahedral mesh
  Positions::Body positions;     ///< at rest
  SmallestHeight smallestHeight;
  double shortEdge;  ///< L: one edge in 16 is shorter; 0 without edges
};

/// One geometry of an OctreeBasedCD. Each part has one owner, which keeps it consistent; the parts
/// below use those above.
struct Geometry : CountedObject {
  /// revisions: where the numbers of its revisions begin.
  explicit Geometry(GeometryId id, Revision::Counter revisions = {}) : body(id), step(revisions) {
    body.revisions.counter = revisions;
  }

  Body body;
  CollisionFilter filter;
  GeometryStep step;              ///< writes the positions of both ends
  SmallestHeight smallestHeight;  ///< of all triangles with area, in the shape at rest
  double shortEdge = 0;  ///< L: one edge in 16 is shorter at rest, before cuts; 0 without edges
  GeometryMotion motion;
  PieceMotion pieces;   ///< from one detection to the next, for KeptPairs
  bool mayLag = false;  ///< the update that runs, or ran last, may be GeometryOctree::Lagging
  std::shared_ptr<const SurfaceProxy> proxy;  ///< attached, or null
  SurfaceProxySettings proxySettings;         ///< if there is one
  /// L: OctreeBasedCD::freeMotion(), of the last detection and of the one that runs. Empty before
  /// one is needed, and after a change of the elements. unlimited: the answer without a pair.
  Buffer<double> freeMotion, nextFreeMotion, unlimited;
  Buffer<RoundBox> elementBoxes;  ///< of the search for free motion that runs, or ran last
  bool skipsOctree = false;       ///< the update that runs, or ran last, leaves the octree outdated

  /// New elements, at rest at both ends of the step.
  void setElements(RestShape& shape) noexcept {
    body.mesh.rest = std::move(shape.rest);
    body.mesh.topology = std::move(shape.topology);
    body.mesh.tags.clear();
    body.solid = std::move(shape.solid);
    body.tree.forgetElements();
    body.revisions.changeElements();
    step.start(body.mesh, std::move(shape.positions));
    smallestHeight = shape.smallestHeight;
    shortEdge = shape.shortEdge;
    freeMotion.clear();
  }
  operator GeometryLabel() const { return body; }
  /// The data for the choice of a method.
  GeometryInStep inStep() const;
  /// One for each vertex; one for what has no elements.
  std::size_t freeMotionCount() const {
    return body.shape || body.isField() ? 1 : body.mesh.topology.vertexCount;
  }
  /// Whether nothing but cuts changed the elements since the last detection.
  bool isCut() const {
    const CutsSince& cuts = step.cutsSinceDetection();
    return cuts.after == body.revisions.elements && cuts.before != cuts.after;
  }
  bool meets(const Geometry& other) const {
    return (filter.groups & other.filter.mask) && (other.filter.groups & filter.mask);
  }
  /// Whether data of the shape are attached, so that it must not change.
  bool isShapeFixed() const { return proxy || (body.field && !body.isField()); }
};

}  // namespace palpate
