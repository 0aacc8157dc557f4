#pragma once

#include <palpate/LooseOctree.h>
#include <palpate/Settings.h>

#include "Bodies/ElementCuts.h"
#include "Bodies/OctreeFloats.h"
#include "Bodies/OctreeSlices.h"
#include "Bodies/OrderedElements.h"
#include "Octree/Octree.h"
#include "Mesh/PieceMotion.h"
#include "Mesh/Revision.h"
#include "Mesh/UnfoldedStars.h"

#include <cstdint>
#include <span>
#include <utility>

namespace palpate {

/// The octree over one geometry's elements, with the float positions that its boxes come from. It
/// owns how an octree follows its geometry: update() first brings the elements up to date, then
/// the boxes.
///
/// Elements. After cuts, of which cut() tells, few elements leave the nodes or join them. After
/// many, or where a node would become too full, the tree is built anew.
///
/// Boxes. One of three strategies brings boxes to the positions, in slices of consecutive groups:
/// Whole, Changed or Lagging. With Lagging, boxes are behind the positions: all positions are
/// within lag() of their boxes.
///
/// If an update throws, there is no valid tree, and the next update builds it anew.
class GeometryOctree {
 public:
  /// Call before update(). swept: a pair's method needs boxes that enclose the whole step.
  void setSwept(bool swept) { m_swept = swept; }
  bool isSwept() const { return m_swept; }
  /// Call before update(). Chooses the float frame's origin for the positions now, if the tree is
  /// outdated. Returns the spread of the positions.
  double sampleFrame(const TriangleMesh&, Revision topology);
  bool isCurrent(const TriangleMesh&, Revision topology, double scale) const;
  /// How far boxes may lag behind the positions.
  struct Lag {
    const PieceMotion* motion;  ///< from the last update; null: they must not lag
    double most;                ///< L
  };
  /// Which boxes update() fits.
  enum class Strategy : std::uint8_t {
    Whole,    ///< all; nodes that have become loose are built anew
    Changed,  ///< those of slices with vertices that changed since the last update: few
    /// Those of so many slices, in turn, that lag() is small enough. While the motion does not
    /// change, these are in turn all slices, about as many in each call. The octree isCurrent()
    /// only after the next update without lag.
    Lagging,
  };
  /// scale: the scale of the float frames, common to all geometries.
  /// Cost     of Changed: linear in the changed vertices and in the elements of their slices, and
  ///          in the number of slices. Else linear in all vertices. After cuts: see
  ///          Octree::replace(). At most that of a new tree, and of a refit before it.
  void update(const TriangleMesh&, Revision topology, double scale, const OctreeSettings&,
              const Threads&, const Lag& = {});
  /// Call when the elements are others, but for cuts. The next update() builds the tree anew.
  void forgetElements() { m_isBuilt = false; }
  /// Call before cut(), which then does not throw.
  void reserveCut(std::size_t removed);
  /// These elements were removed, and others perhaps appended. Positions to which vertices were
  /// appended have other revisions now: from their first to their second.
  void cut(std::span<const std::uint32_t> removed,
           std::span<const std::pair<Revision, Revision>> positions) noexcept;
  /// Whether the last update was Lagging to the positions now, of these elements.
  bool laggedTo(const TriangleMesh& mesh, Revision topology, double scale) const {
    return m_isLagging && isValid() && m_frame.scale == scale &&
           m_treeVersion.state().topology == topology && m_lastPositions == mesh.now.bodyRevision();
  }
  /// L: no coordinate of a position is further outside of the boxes of its elements.
  double lag() const { return m_slices.lag(); }
  /// Whether the octree lacks the further bounds of these settings. Only a placed body has them,
  /// and only if it does not deform in the step.
  bool needsDops(const TriangleMesh&, OctreeBounds) const;
  /// Call after update(). Makes the further bounds if needsDops().
  void updateDops(const TriangleMesh&, OctreeBounds, const Threads&);
  /// For self-collision: finds neighbouring triangles that certainly meet nowhere but in common
  /// vertices and edges. Returns UnfoldedStars::triangles().
  const Triangle* findUnfoldedStars(const TriangleMesh&, const Threads&);

  /// Becomes a copy of an octree that isValid(), for queries only. All copies in one object must be
  /// of one octree; only what changed since the last copy is copied.
  void copy(const GeometryOctree& other);

  void releaseMemory();  ///< gives back what only the next updates need

  /// Whether the boxes enclose the positions now, in the body's frame. They may enclose more.
  bool encloses(const TriangleMesh&, Revision topology) const;
  std::uint64_t updates() const { return m_updates; }       ///< counts update()
  bool isValid() const { return m_treeVersion.isValid(); }  ///< no update has failed since
  bool isLagging() const { return m_isLagging; }            ///< the last update was Lagging
  const Octree& octree() const { return m_octree; }
  const FloatFrame& frame() const { return m_frame; }      ///< of the boxes
  const OctreeFloats& floats() const { return m_floats; }  ///< in a frame of their own if it lags
  double spread() const { return m_spread; }               ///< L: extent of most positions
  /// L: the largest coordinate of the octree's boxes about frame().origin.
  double reach() const { return m_octree.box(0).reach() / m_frame.scale; }
  /// Whether rounding errors of the furthest vertices are much smaller than most boxes. It implies
  /// that no position is clamped to the range of floats.
  bool isCompact() const { return m_octree.isBuilt() && reach() <= 0x1p20 * m_spread; }
  /// The cut that the last update followed, if it kept the nodes.
  const ElementCuts::Cut& lastCut() const { return m_cuts.last(); }
  /// Elements in the octree's order, readable BoxArrays::kPadding past their end.
  std::span<const Triangle> ordered() const { return m_ordered.triangles(); }
  std::size_t bytesBesidesOctree() const;

  // Of the last update:
  LooseOctree::Update lastUpdate = LooseOctree::Update::Unchanged;
  double boxMilliseconds = 0, octreeMilliseconds = 0;

 private:
  struct State {
    Revision topology, now, before;  ///< positions in the body's frame
    friend bool operator==(const State&, const State&) = default;
  };
  State stateOf(const TriangleMesh&, Revision topology) const;
  Strategy strategyFor(const TriangleMesh&, double scale, const OctreeSettings&, const Lag&) const;
  void fitWhole(const TriangleMesh&, double scale, const OctreeSettings&, const Threads&,
                bool keepsOrder);
  void fitChanged(const TriangleMesh&, const Threads&);
  void fitLagging(const TriangleMesh&, const Lag&, const Threads&);

  OctreeSlices::Tree sliced(const TriangleMesh& mesh) {
    return {mesh, m_ordered.triangles(), m_frame, m_octree};
  }

  FloatFrame m_frame;
  OctreeFloats m_floats;
  SampledExtent m_sample;  ///< of the positions of the next update
  double m_spread = 0;
  bool m_swept = false;
  OrderedElements m_ordered;
  UnfoldedStars m_stars;
  Octree m_octree;
  ElementCuts m_cuts;     ///< unless !m_isBuilt
  OctreeSlices m_slices;  ///< of Changed and Lagging
  DerivedFrom<State> m_treeVersion;
  Revision m_lastPositions;  ///< of the last update of any kind
  std::uint64_t m_updates = 0;
  bool m_isLagging = false;
  bool m_isBuilt = false;  ///< for the topology of m_treeVersion; the tree can be refitted
};

}  // namespace palpate
