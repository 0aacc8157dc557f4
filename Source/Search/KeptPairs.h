#pragma once

#include "Search/JobScratch.h"
#include "Search/KeptDetection.h"
#include "Search/OctreeParts.h"
#include "NarrowPhase/FeaturePairs.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Bodies/Body.h"
#include "Octree/Traversal.h"
#include "Mesh/PieceMotion.h"
#include "Core/Buffer.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

namespace palpate {

/// The candidates of one pair of meshes, kept from one detection to the next.
///
/// Nodes of about the same size divide each octree into parts. The pairs of parts that are near
/// each other divide the search into units. A unit lists the element pairs whose boxes are at most
/// a margin further apart than the distance that is asked for, and those of them with features that
/// may be. The lists stay complete while the elements move relative to each other by no more than
/// the margin. Each detection makes some of the lists again, so that all are made again in turn
/// before that happens.
///
/// The first lists are made along with searches, some in each detection, so that no detection costs
/// much more than a search. Their lengths tell early whether keeping them would pay.
///
/// Pairs with near features are in classes by a bound on the distance of their features. From the
/// motion since they were sorted it follows which classes may hold contacts now; only these are
/// tested. They are sorted again more often than the lists are made.
///
/// A cut that keeps the nodes of the octree keeps the lists of all parts without elements at the
/// cut.
///
/// Docs/Algorithms/LooseOctree.md has the argument.
class KeptPairs {
 public:
  bool isActive() const { return m_isActive; }
  /// The lists are not kept up to date any more. Their memory is kept.
  void deactivate() { m_isActive = false; }
  /// Call after each PieceMotion::advanceTo() of either body while the lists are active, which end
  /// with other elements unless those are of a cut. The two are one object in self-collision.
  void addMotion(const PieceMotion& a, const PieceMotion& b);

  /// Begins a detection by lists alone, and activates them. Lists that are missing are made.
  /// Returns the number of jobs, at most `mostJobs`.
  std::size_t start(const Body& a, const Body& b, const KeptReach&, std::size_t mostJobs);
  /// The same along with a search, for gather(): lists are made in this detection so that none is
  /// missing after about `detections` like it, and few in the first one.
  std::size_t startGathering(const Body& a, const Body& b, const KeptReach&, std::size_t detections,
                             std::size_t mostJobs);
  /// Whether the parts are of the present octrees, or of those before the last cut.
  bool fits(const Body& a, const Body& b) const;
  /// Whether the lists are active and none is missing.
  bool isWhole() const;
  /// ns: about what it will cost to make the lists again in turn, in each detection, at a relative
  /// motion of `speed`, L. 0 before any list was made.
  double cost(double speed) const;
  /// The boxes of the elements now, with the distance between them.
  const FloatPair& floats() const { return m_detection.floats(); }
  /// Appends the element pairs of a job that may have features in contact to `near`.
  void run(std::size_t job, const MeshPair&, JobScratch&, Buffer<ElementPair>& near);
  /// After startGathering(): makes the lists of a job.
  void gather(std::size_t job, const MeshPair&, JobScratch&);
  /// Element pairs of a job, which has run: its candidates, and some whose boxes do not overlap.
  /// first: only lists with elements from these ids on.
  template <class Use>
  void forEachList(std::size_t job, const std::array<std::uint32_t, 2>& first, Use&& use) const {
    PALPATE_ASSERT(m_isActive && job + 1 < m_jobs.size());
    for (std::size_t i = m_jobs[job]; i < m_jobs[job + 1]; ++i)
      if (m_units[i].last[0] >= first[0] || m_units[i].last[1] >= first[1])
        use(std::span<const ElementPair>(m_units[i].boxes));
  }
  /// The number of candidates of all jobs, while the floats are those of this detection. In
  /// self-collision it may be off by pairs whose boxes are at the distance within rounding. cuts:
  /// since the detection.
  std::size_t countCandidates(const MeshTopology& a, const CutsSince& cutsOfA,
                              const MeshTopology& b, const CutsSince& cutsOfB) const;
  void releaseMemory() { *this = KeptPairs(); }

 private:
  using Unit = KeptUnit;
  /// Whose turn it is.
  struct Turn {
    double due = 0;        ///< weight of the units that are due
    std::size_t next = 0;  ///< the unit that is due next
  };

  void startUnits(const Body& a, const Body& b, const KeptReach&);
  void makeParts(const Body& a, const Body& b);
  void makeUnits(const CountedVector<PartPair>&);
  void cutUnits(const Body& a, const Body& b);
  void chooseUnits();
  template <class IsDone, class Weight>
  void takeTurns(Turn&, IsDone&&, Weight&&);
  template <class Weight>
  std::size_t divide(std::size_t mostJobs, Weight&&);
  void make(Unit&, const MeshPair&, JobScratch&);
  const OctreeParts& partsB() const { return m_detection.self() ? m_partsA : m_partsB; }

  bool m_isActive = false;
  CountedVector<Unit> m_units;        ///< ascending parts
  CountedVector<Unit> m_formerUnits;  ///< their buffers are used again
  OctreeParts m_partsA, m_partsB;     ///< of one mesh with itself, m_partsA only
  double m_reached = 0;  ///< L: further apart, less m_moved, are all pairs of parts without a unit
  double m_moved = 0;    ///< L: the relative motion of all since the units were made
  Turn m_lists, m_classes;

  KeptDetection m_detection;   ///< the last one
  Buffer<std::size_t> m_jobs;  ///< job i has units [m_jobs[i], m_jobs[i + 1])
};

}  // namespace palpate
