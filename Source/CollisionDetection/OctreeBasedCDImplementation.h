#pragma once

#include <palpate/OctreeBasedCD.h>

#include "CollisionDetection/BurstMemory.h"
#include "CollisionDetection/DiagnosticsInterface.h"
#include "CollisionDetection/Frame.h"
#include "CollisionDetection/FreeMotionSearch.h"
#include "CollisionDetection/GeometryTable.h"
#include "CollisionDetection/PairTable.h"
#include "CollisionDetection/Planning.h"
#include "CollisionDetection/StepSource.h"
#include "Queries/QuerySource.h"
#include "Queries/SnapshotPool.h"
#include "Octree/Forest.h"
#include "Core/Stopping.h"
#include "Core/FloatingPoint.h"
#include "Core/MemoryBudget.h"
#include "Core/Threads.h"
#include "Core/Trace.h"

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace palpate {

/// What an OctreeBasedCD holds, and its calls that run more than one part of it.
struct OctreeBasedCD::Implementation {
  class ChangeGuard;
  class QuerySource;
  class GuardSource;

  explicit Implementation(const Settings& newSettings);
  ~Implementation();

  Settings settings;
  const std::shared_ptr<MemoryBudget> budget;
  Threads threads, singleThread{1};
  GeometryTable geometries;
  PairTable pairs;
  Frame frame;
  FreeMotionSearch freeMotions;
  FrameStatistics statistics;  ///< of the last frame or explicit update
  FrameStatistics updates;     ///< of the updates since the last frame
  bool hasUpdates = false;
  LooseOctree::State shownOctrees;  ///< what octree() shows
  std::vector<PairRecord*> selectedPairs;
  std::vector<UnfinishedPair> unfinishedPairs;  ///< of the detection that runs
  BurstMemory burst;
  AuditRecord audit;
  std::optional<Trace> trace;  ///< with Settings::traceFrames
  std::shared_ptr<QuerySource> querySource;
  std::shared_ptr<GuardSource> guardSource;  ///< null before there is a StepGuard
  std::vector<Search> outdatedSearches;      ///< of the SeparateSearches that are detected
  std::vector<std::unique_ptr<SeparateSearch>> unfollowed;  ///< scratch of followSides()
  LatestSnapshot latestSnapshot;
  /// geometries.state() for which all octrees hold; 0: for none.
  std::atomic<std::uint64_t> octreesState = 0;
  std::mutex filling;                ///< locked while a const call fills what it returns
  bool holdsSpare = false;           ///< there was a call since the last releaseMemory()
  std::atomic<bool> isBusy = false;  ///< a call that changes the object has not returned
  mutable std::atomic<bool> isCancelled = false;  ///< the detection with a budget that runs
  Deadline::Clock clock;                          ///< of tests; empty: the system's

  /// Adds the counts of geometries to the statistics, and makes them visible.
  void setStatistics(FrameStatistics next);

  /// Counts the candidates that the last detection kept, which takes longer than to keep them. Call
  /// before the elements or floats of a geometry, or the pairs, change.
  void countCandidates();
  void releaseMemory();

  /// Calls a function that changes nothing if it throws. If it exceeds Settings::memoryLimit while
  /// memory is held that only earlier calls needed, that is given back, and it is called again.
  template <class F>
  auto withinLimit(F&& call) {
    for (;;) {
      const bool heldSpare = std::exchange(holdsSpare, true);
      try {
        return call();
      } catch (const Error& error) {
        if (error.code() != ErrorCode::MemoryLimit) throw;
        releaseMemory();
        if (!heldSpare) throw;
      }
    }
  }

  /// Returns call(prepare), which sets the topology of a geometry.
  template <class F>
  auto changeTopology(GeometryId geometry, F&& call) {
    return withinLimit([&] {
      countCandidates();
      IndexLists near;
      GeometryTable::Preparation prepare;
      if (pairs.needsNearAtRest(geometry))
        prepare = [&](const MeshTopology& topology, std::span<const Eigen::Vector3d> rest) {
          near = pairs.nearAtRest(geometry, topology, rest, threads);
        };
      auto result = call(prepare);
      if (prepare) pairs.setNearAtRest(geometry, std::move(near));
      return result;
    });
  }
  /// The same for a cut.
  template <class F>
  auto cutTopology(GeometryId geometry, F&& call) {
    return withinLimit([&] {
      if (const Geometry* changed = geometries.find(geometry);
          changed && !changed->step.continuesCuts(changed->body.revisions.elements))
        countCandidates();
      ChangedLists near;
      GeometryTable::CutPreparation prepare;
      if (pairs.needsNearAtRest(geometry))
        prepare = [&](const EdgeChange& change, std::span<const Eigen::Vector3d> rest) {
          near = pairs.changeNearAtRest(geometry, change, rest, threads);
        };
      auto result = call(prepare);
      if (prepare) pairs.setNearAtRest(geometry, near);
      return result;
    });
  }

  /// Why octrees are updated. The user's explicit call publishes the statistics at once, which then
  /// count as rebuilt or refitted only the trees that it changed. The statistics of a frame include
  /// updates for queries.
  enum class UpdateFor : std::uint8_t { Queries, User, Frame, Separate };
  /// Updates the octrees. expectPlans(): asks what boxes have to enclose. traced: of a detection,
  /// or null.
  void update(UpdateFor, const std::function<void()>& expectPlans, Trace* traced = nullptr);
  /// The same with the expected plans of the table's pairs. Only those of a frame include the
  /// motion of all; others include the motion on which candidates depend.
  void update(UpdateFor = UpdateFor::Queries, Trace* traced = nullptr);

  bool needsNoOctree(const PairRecord& record) const {
    return record.pair.settings.freeMotionReach == 0.0 &&
           (record.support->kind == PairKind::Proxy || mayUseProxy(record));
  }

  /// A detection does not need the octrees of point sets of which all pairs use proxies. Queries
  /// update them later.
  void markSkippedOctrees(bool maySkip);

  void expectPlansAndLag(UpdateFor, const std::function<void()>& expectPlans, Trace*);
  void updateOctreeView();
  bool anyOctreeLags() const;

  /// Pairs whose result is outdated. Pairs that do not collide are not among them: their result is
  /// empty.
  std::span<PairRecord* const> outdatedPairs();

  /// Returns `singleThread` if one thread has refitted the octrees and few candidates are expected:
  /// other threads would wait for the data longer than they could help.
  const Threads& threadsFor(std::span<PairRecord* const> records) const;

  bool updateProxies(std::span<PairRecord* const> records);

  /// Results and statistics of the table's pairs stay as they are.
  void detect(SeparateSearches);

  /// Returns whether everything was finished. The token ends the search for contacts and for free
  /// motions, and nothing else.
  bool detect(StopScope::Token);

  /// Completes the plans of pairs. Those for which no time is left become Urgency::isUnfinished.
  void completePlans(std::span<PairRecord* const> records, StopScope::Token);
  Frame::Context context(FrameStatistics&, Trace*) const;
  void findContacts(std::span<PairRecord* const> records, FrameStatistics&, Trace*);
  /// records: all that had to be found, in the order of urgency. The first call lists those that
  /// are unfinished, and may throw; the second keeps their last answers.
  void listUnfinished(std::span<PairRecord* const> records);
  void keepUnfinished(std::span<PairRecord* const> records, FrameStatistics&) noexcept;
  void commit(std::span<PairRecord* const> records) noexcept;
  /// Gives back what only earlier detections needed, after many that needed much less.
  void reviewMemory();

  std::vector<std::byte> save() const;
  mutable std::atomic<std::size_t> savedSize = 0;  ///< about that of the last state; any thread
  void restore(std::span<const std::byte>);

  /// Before a step ends: finds the crossings of pairs that changed since their last detection, for
  /// PairSettings::rememberSides. Results and statistics stay as they are.
  void followSides();
};

[[noreturn]] void throwMovedFrom();
[[noreturn]] void throwBusy();

/// Exists while a call that changes the object runs. Other calls are refused meanwhile, so that
/// callbacks cannot change data in use. It also sets the floating-point mode that the library
/// needs.
class OctreeBasedCD::Implementation::ChangeGuard {
 public:
  explicit ChangeGuard(const std::unique_ptr<Implementation>& all) : ChangeGuard(all.get()) {}
  explicit ChangeGuard(Implementation* all)
      : m_all(all), m_memory(m_all ? m_all->budget : nullptr, MemoryStage::Geometries) {
    if (!m_all) throwMovedFrom();
    if (m_all->isBusy.exchange(true, std::memory_order_relaxed)) throwBusy();
  }
  ~ChangeGuard() { m_all->isBusy.store(false, std::memory_order_relaxed); }
  ChangeGuard(const ChangeGuard&) = delete;
  ChangeGuard& operator=(const ChangeGuard&) = delete;
  Implementation* operator->() const { return m_all; }
  Implementation& operator*() const { return *m_all; }

 private:
  StandardFloatingPoint m_standard;
  Implementation* m_all;
  MemoryScope m_memory;
};

/// The geometries of an OctreeBasedCD, for queries that may outlive it.
class OctreeBasedCD::Implementation::QuerySource : public SpatialQueries::Source {
 public:
  explicit QuerySource(Implementation& all)
      : Source(std::make_shared<Pool>(all.budget)), m_all(&all) {}

  void close() { m_all = nullptr; }  ///< called when the OctreeBasedCD is destroyed
  /// Updates the octrees unless they are up to date with the positions now.
  void updateOctrees() {
    const auto lock = lockOctrees();
    const MemoryScope memory(budget(), MemoryStage::Octrees);
    if (m_all->octreesState != m_all->geometries.state()) m_all->update();
  }
  /// The same if the boxes of an octree lag behind the positions.
  void updateLagging() {
    const auto lock = lockOctrees();
    const MemoryScope memory(budget(), MemoryStage::Octrees);
    if (m_all->anyOctreeLags()) m_all->update();
  }
  std::unique_lock<std::mutex> lockOctrees() { return std::unique_lock(m_octreesMutex); }

  std::uint64_t state() const override {
    if (!m_all) return 0;
    if (m_all->isBusy.load(std::memory_order_relaxed)) throwBusy();
    const std::uint64_t now = m_all->geometries.state();
    return m_all->octreesState == now ? now : 0;
  }
  const Body& at(GeometryId id) const override { return searchable(m_all->geometries.at(id).body); }
  std::size_t geometryCount() const override { return m_all->geometries.all().size(); }
  const Body& geometry(std::size_t index) const override {
    return m_all->geometries.all()[index]->body;
  }
  std::uint64_t step() const override { return m_all->geometries.stepNumber(); }
  Engine engine() const override { return m_all->settings.engine; }
  const OctreeSettings& octreeSettings() const override { return m_all->settings.octree; }
  const Threads& threads() const override { return m_all->threads; }

 private:
  Implementation* m_all;
  std::mutex m_octreesMutex;  ///< locked while octrees are updated
};

/// The step of an OctreeBasedCD, for guards that may outlive it.
class OctreeBasedCD::Implementation::GuardSource : public StepSource {
 public:
  explicit GuardSource(Implementation& all) : m_all(&all) {}
  void close() { m_all = nullptr; }  ///< called when the OctreeBasedCD is destroyed

  void change(const std::function<void()>& call) override {
    read();
    const ChangeGuard all(m_all);
    all->withinLimit(call);
  }
  GeometryTable& geometries() const override { return read().geometries; }
  const PairTable& pairs() const override { return read().pairs; }
  const Threads& threads() const override { return read().threads; }
  void detect(SeparateSearches searches) override { read().detect(searches); }

 private:
  Implementation& read() const {
    if (!m_all)
      throw Error(ErrorCode::InvalidCall, "the OctreeBasedCD of this StepGuard was destroyed");
    return *m_all;
  }
  Implementation* m_all;
};

}  // namespace palpate
