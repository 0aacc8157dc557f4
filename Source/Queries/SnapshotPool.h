#pragma once

#include <palpate/Snapshot.h>

#include "Queries/QuerySource.h"
#include "Bodies/Body.h"
#include "Mesh/Revision.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace palpate {

/// A copy of one geometry for queries. Snapshots share it. It is updated when none of them uses it;
/// only what changed since its last update is then copied.
class GeometryCopy : public CountedObject {
 public:
  explicit GeometryCopy(GeometryId id) : geometry(id) {}

  bool isCurrent(const Body& original) const;
  void update(const Body& original);
  /// How much an update need not copy: 2 for the octree, 1 for the topology.
  int kept(const Body& original) const;

  Body geometry;
  std::size_t users = 0;  ///< snapshots; only SnapshotPool::take() reads and writes it

 private:
  DerivedFrom<ElementsState> m_elementsVersion;
  DerivedFrom<BodyState> m_version;
};

/// The memory of the snapshots of one OctreeBasedCD. The OctreeBasedCD and each snapshot hold it,
/// so that snapshots may outlive their owner.
///
/// A snapshot's memory is free when its last reader lets go, which sets one atomic flag. The next
/// take() reuses it. A steady publication therefore allocates nothing, and only the publishing
/// thread changes copies and their counts.
class SnapshotPool : public std::enable_shared_from_this<SnapshotPool> {
 public:
  /// budget: null for none.
  explicit SnapshotPool(std::shared_ptr<MemoryBudget> budget = nullptr);
  ~SnapshotPool();

  /// A snapshot of all geometries of a source, whose octrees must be up to date. Called by one
  /// thread at a time. If it throws, no snapshot has changed.
  std::shared_ptr<const Snapshot> take(SpatialQueries::Source&, double time);
  /// Gives back the memory of snapshots that nobody holds, and what queries keep.
  void releaseMemory();
  /// A pool without snapshots, which counts on from this one.
  std::shared_ptr<SnapshotPool> successor(std::shared_ptr<MemoryBudget>) const;
  std::size_t copyCount() const { return m_copies.size(); }
  std::size_t slotCount() const { return m_slots.size(); }

 private:
  class Slot;
  template <class T>
  class SlotAllocator;

  void reclaim();
  void forgetRemoved(const SpatialQueries::Source&);
  Slot& freeSlot();
  GeometryCopy& copyOf(const Body&);

  const std::shared_ptr<SpatialQueries::Source::Pool> m_scratch;
  std::vector<std::unique_ptr<GeometryCopy>> m_copies;  ///< by ascending ids
  std::vector<std::unique_ptr<Slot>> m_slots;
  std::uint64_t m_last = 0;  ///< number of the last snapshot
};

/// The latest snapshot of one OctreeBasedCD.
///
/// Threads  publish() on one thread at a time, latest() on any. A std::mutex is locked while one
///          shared_ptr is copied or swapped, and for nothing else. A mutex, because
///          std::atomic<std::shared_ptr> of this standard library is a spin lock.
class LatestSnapshot {
 public:
  /// budget: of all snapshots; null for none.
  explicit LatestSnapshot(std::shared_ptr<MemoryBudget> budget)
      : m_pool(std::make_shared<SnapshotPool>(std::move(budget))) {}

  void releaseMemory() { m_pool->releaseMemory(); }
  /// A pool for another state of the geometries, in which ids may stand for other ones.
  std::shared_ptr<SnapshotPool> newPool(std::shared_ptr<MemoryBudget> budget) const {
    return m_pool->successor(std::move(budget));
  }
  void setPool(std::shared_ptr<SnapshotPool> pool) noexcept { m_pool.swap(pool); }
  void publish(SpatialQueries::Source&, double time);
  std::shared_ptr<const Snapshot> get() const;

 private:
  std::shared_ptr<SnapshotPool> m_pool;
  mutable std::mutex m_mutex;
  std::shared_ptr<const Snapshot> m_latest;
};

}  // namespace palpate
