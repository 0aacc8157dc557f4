#pragma once

#include <palpate/LooseOctree.h>
#include <palpate/Settings.h>

#include "Octree/Octree.h"
#include "Mesh/FloatPositions.h"
#include "Mesh/PieceMotion.h"
#include "Mesh/Revision.h"
#include "Mesh/TriangleMesh.h"
#include "Mesh/UnfoldedStars.h"
#include "Core/ReusableMemory.h"
#include "Core/Buffer.h"
#include "Core/Threads.h"

#include <cstdint>
#include <span>

namespace palpate {

/// The octree over one geometry's elements, with the float positions that its boxes come from.
///
/// Its boxes may lag behind the positions: updateSome() fits those of some elements only. All
/// positions are then within lag() of their boxes.
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
  /// scale: the scale of the float frames, common to all geometries.
  void update(const TriangleMesh&, Revision topology, double scale, const OctreeSettings&,
              const Threads&);
  /// Call when the elements are others. Otherwise elements were removed or appended if the topology
  /// has changed, and the next update() keeps the nodes if these are few.
  void forgetElements() { m_isBuilt = false; }
  /// Instead of update(), if few vertices changed since the last one, and it swept no step: brings
  /// the floats and boxes of these up to date. Returns false if that is not so.
  /// Cost     linear in these vertices and in the elements of their slices, and in the number of
  ///          slices.
  bool updateChanged(const TriangleMesh&, Revision topology, double scale, const OctreeSettings&,
                     const Threads&);
  /// Whether updateSome() is possible: the tree was updated to the positions from which the motion
  /// was measured, without sweeping the step, is tight, and is in the body's frame, the world.
  bool canLag(const TriangleMesh&, Revision topology, double scale, const OctreeSettings&,
              const PieceMotion&) const;
  /// Instead of update(): brings the floats up to date, and the boxes of so many elements that
  /// lag() is at most `lag`. While the motion does not change, these are in turn all elements,
  /// about as many in each call. The octree isCurrent() only after the next update().
  void updateSome(const TriangleMesh&, const PieceMotion&, double lag, const Threads&);
  /// Whether the last update was updateSome() to the positions now, of these elements.
  bool laggedTo(const TriangleMesh& mesh, Revision topology, double scale) const {
    return m_isLagging && isValid() && m_frame.scale == scale &&
           m_treeVersion.state().topology == topology && m_lastPositions == mesh.now.bodyRevision();
  }
  /// L: no coordinate of a position is further outside of the boxes of its elements.
  double lag() const { return m_lag; }
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
  bool isLagging() const { return m_isLagging; }            ///< the last update was updateSome()
  const Octree& octree() const { return m_octree; }
  const FloatFrame& frame() const { return m_frame; }              ///< of the boxes
  const FloatFrame& floatsFrame() const { return m_floatsFrame; }  ///< of floats()
  double spread() const { return m_spread; }                       ///< L: extent of most positions
  double reach() const;  ///< L: the largest coordinate of the octree's boxes about frame().origin
  /// Whether rounding errors of the furthest vertices are much smaller than most boxes. It implies
  /// that no position is clamped to the range of floats.
  bool isCompact() const;
  const FloatPoint* floats() const { return m_floats.data(); }
  /// The floats at the step's start if the boxes enclose the step, else those of the positions now.
  const FloatPoint* floatsAtStart() const {
    return (m_treeSwept ? m_floatsBefore : m_floats).data();
  }
  /// A cut that kept the nodes: Octree::layout() before and after it, and the groups, ascending,
  /// that hold elements with a vertex of those that it removed or added.
  struct Cut {
    std::uint64_t before = 0, after = 0;
    CountedVector<std::uint32_t> groups;
  };
  const Cut& lastCut() const { return m_cut; }
  /// Finds the pieces of PieceMotion of those ranges again that hold one of these groups, and calls
  /// found(i) for each. pieces: of each range. rangeOf(i): its places in the order, which ascend.
  /// groups: ascending.
  template <class RangeOf, class F>
  void findPiecesAgain(IndexLists& pieces, const CountedVector<std::uint32_t>& groups,
                       std::size_t vertexCount, RangeOf&& rangeOf, F&& found) const {
    auto group = groups.begin();
    for (std::size_t i = 0; i < pieces.size() && group != groups.end(); ++i) {
      const std::pair<std::uint32_t, std::uint32_t> range = rangeOf(i);
      const auto isInside = [&] {
        return group != groups.end() && m_octree.groups()[*group] < range.second;
      };
      if (!isInside()) continue;
      while (isInside()) ++group;
      const IndexLists now = piecesOf(m_ordered, std::span(&range, 1), vertexCount);
      pieces.reserveMore(0, now[0].size());
      pieces.replace(i, now[0]);
      found(i);
    }
  }
  /// Elements in the octree's order, readable BoxArrays::kPadding past their end.
  std::span<const Triangle> ordered() const { return m_ordered; }
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
  void computeBoxes(const TriangleMesh&, std::span<const std::uint32_t> groups,
                    FloatBox* groupBoxes, std::size_t grain, const Threads&, bool reordered);
  FloatBox bounds(const TriangleMesh&, const Threads&);
  void startOrdered(std::size_t size);
  bool replaceElements(const MeshTopology&, const OctreeSettings&);
  bool canRefitSome(const TriangleMesh&, Revision topology, double scale,
                    const OctreeSettings&) const;
  void makeSlices(const TriangleMesh&);
  void measureLooseness();
  void refit(const TriangleMesh&, std::size_t slice);
  void rebuild(const TriangleMesh&, const OctreeSettings&, const Threads&);
  void fitBoxes(const TriangleMesh&, const OctreeSettings&, const Threads&, bool rebuilt);

  /// Consecutive groups, whose boxes updateSome() fits together.
  struct Slice {
    std::uint32_t firstGroup, endGroup;
    double moved;  ///< L: of a coordinate, at most, since the boxes were fitted
  };

  FloatFrame m_frame, m_floatsFrame;
  SampledExtent m_sample;  ///< of the positions of the next update
  double m_spread = 0;
  bool m_swept = false, m_treeSwept = false;
  Buffer<FloatPoint> m_floats, m_floatsBefore;
  std::span<Triangle> m_ordered;   ///< empty during a build
  ReusableMemory m_orderedMemory;  ///< of m_ordered, or of the keys during a build
  UnfoldedStars m_stars;
  Octree m_octree;
  Buffer<std::uint32_t> m_boundsGroups;  ///< scratch of a rebuild
  Buffer<FloatBox> m_boundsBoxes;
  DerivedFrom<State> m_treeVersion;
  // Of updateSome() and updateChanged():
  CountedVector<Slice> m_slices;
  IndexLists m_slicePieces;          ///< of PieceMotion, for each slice
  std::uint64_t m_slicesLayout = 0;  ///< Octree::layout() of the slices
  std::size_t m_nextSlice = 0;
  double m_lag = 0;
  // Of replaceElements(), made by the first one:
  CountedVector<std::uint32_t> m_groupOf;  ///< per element: its group of the octree, or none
  std::uint64_t m_groupsLayout = 0;        ///< Octree::layout() of m_groupOf
  Cut m_cut;
  bool m_isLagging = false, m_isLoose = false;
  Revision m_lastPositions;    ///< of the last update of any kind
  std::size_t m_refitted = 0;  ///< slices that updateChanged() fitted since looseness was measured
  Buffer<Eigen::Vector3d> m_corners;
  Buffer<FloatPoint> m_cornerFloats;
  Buffer<Triangle> m_cornerTriangles;

  std::uint64_t m_updates = 0;
  bool m_isBuilt = false;  ///< for the topology of m_treeVersion; the tree can be refitted
};

}  // namespace palpate
