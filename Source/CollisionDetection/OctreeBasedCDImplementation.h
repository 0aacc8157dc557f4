#pragma once

#include <palpate/OctreeBasedCD.h>

#include "CollisionDetection/BurstMemory.h"
#include "CollisionDetection/Detection.h"
#include "CollisionDetection/DiagnosticsInterface.h"
#include "CollisionDetection/StepSource.h"
#include "Queries/QuerySource.h"
#include "Queries/SnapshotPool.h"
#include "Core/FloatingPoint.h"
#include "Core/MemoryBudget.h"

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <type_traits>
#include <utility>

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
  Threads threads;
  GeometryTable geometries;
  PairTable pairs;
  SceneOctrees octrees{settings, threads, geometries, pairs};
  Detection detection{settings, threads, geometries, pairs, octrees};
  UnfollowedSides unfollowed;
  FrameStatistics statistics;  ///< of the last frame or explicit update
  BurstMemory burst;
  AuditRecord audit;
  std::optional<Trace> trace;  ///< with Settings::traceFrames
  std::shared_ptr<QuerySource> querySource;
  std::shared_ptr<GuardSource> guardSource;  ///< null before there is a StepGuard
  LatestSnapshot latestSnapshot;
  std::mutex filling;                ///< locked while a const call fills what it returns
  bool holdsSpare = false;           ///< there was a call since the last releaseMemory()
  std::atomic<bool> isBusy = false;  ///< a call that changes the object has not returned
  struct {
    std::atomic<bool> isCancelled = false;
    Deadline::Clock clock;  ///< of tests; empty: the system's
  } timed;                  ///< the detection with a budget that runs

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

  /// Adds the geometry that call(builder) returns.
  template <class F>
  GeometryId add(F&& call) {
    return withinLimit([&] { return geometries.add(call(geometries.builder())); });
  }

  /// Returns call(prepare), which sets the topology of a geometry, or cuts it. Change: what is
  /// prepared, MeshTopology or EdgeChange.
  template <class Change, class F>
  auto changeTopology(GeometryId geometry, F&& call) {
    return withinLimit([&] {
      const Geometry* const changed = geometries.find(geometry);
      if (std::is_same_v<Change, MeshTopology> ||
          (changed && !changed->step.continuesCuts(changed->body.revisions.elements)))
        countCandidates();
      decltype(pairs.nearAtRest(geometry, std::declval<const Change&>(), {}, threads)) near;
      std::function<void(const Change&, std::span<const Eigen::Vector3d>)> prepare;
      if (pairs.needsNearAtRest(geometry))
        prepare = [&](const Change& change, std::span<const Eigen::Vector3d> rest) {
          near = pairs.nearAtRest(geometry, change, rest, threads);
        };
      auto result = call(prepare);
      if (prepare) pairs.setNearAtRest(geometry, near);
      return result;
    });
  }

  /// Updates the octrees. An explicit call of the user publishes the statistics at once.
  void update(SceneOctrees::UpdateFor);
  /// Results and statistics of the table's pairs stay as they are.
  void detect(SeparateSearches);
  /// Returns whether everything was finished. The token ends the search for contacts and for free
  /// motions, and nothing else.
  bool detect(StopScope::Token);
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
  /// Updates the octrees unless they hold for the positions now. onlyLagging: unless no boxes lag
  /// behind the positions.
  void updateOctrees(bool onlyLagging = false) {
    const auto lock = lockOctrees();
    const MemoryScope memory(budget(), MemoryStage::Octrees);
    const SceneOctrees& held = m_all->octrees;
    if (onlyLagging ? held.anyLags() : !held.areCurrent())
      m_all->update(SceneOctrees::UpdateFor::Queries);
  }
  std::unique_lock<std::mutex> lockOctrees() { return std::unique_lock(m_octreesMutex); }

  std::uint64_t state() const override {
    if (!m_all) return 0;
    if (m_all->isBusy.load(std::memory_order_relaxed)) throwBusy();
    return m_all->octrees.areCurrent() ? m_all->geometries.state() : 0;
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
