#include "Queries/SnapshotPool.h"

#include <palpate/Error.h>

#include "Bodies/InputChecks.h"
#include "Core/Assert.h"
#include "Core/FloatingPoint.h"
#include "Core/Text.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

namespace palpate {

bool GeometryCopy::isCurrent(const Body& original) const {
  return m_version.isCurrent(original.state()) && geometry.name == original.name &&
         geometry.tree.updates() == original.tree.updates();
}

int GeometryCopy::kept(const Body& original) const {
  return (geometry.tree.updates() == original.tree.updates() ? 2 : 0) +
         (m_elementsVersion.isCurrent(original.revisions.elements) ? 1 : 0);
}

void GeometryCopy::update(const Body& original) {
  PALPATE_ASSERT(original.tree.isValid());
  PALPATE_ASSERT(original.id == geometry.id);
  m_version.invalidate();
  TriangleMesh& mesh = geometry.mesh;
  const bool hasTags = m_elementsVersion.isCurrent(original.revisions.elements) &&
                       geometry.revisions.filter == original.revisions.filter;
  if (const ElementsState& elements = original.revisions.elements;
      !m_elementsVersion.isCurrent(elements)) {
    const bool isSameMesh =
        m_elementsVersion.isValid() && geometry.revisions.elements.topology == elements.topology;
    m_elementsVersion.invalidate();
    mesh.topology = original.mesh.topology;
    mesh.radii = original.mesh.radii;
    mesh.largestRadius = original.mesh.largestRadius;
    if (original.solid && !isSameMesh) {
      geometry.solid = std::make_unique<Solid>();
      geometry.solid->topology = original.solid->topology;
    }
    geometry.revisions = original.revisions;
    m_elementsVersion.commit(elements);
  }
  if (!hasTags) {
    geometry.revisions.filter = {};
    mesh.tags = original.mesh.tags;
    if (original.solid) geometry.solid->tags = original.solid->tags;
    geometry.revisions.filter = original.revisions.filter;
  }
  mesh.now = original.mesh.now;
  mesh.before = original.mesh.before;
  mesh.outerSideOnly = original.mesh.outerSideOnly;
  geometry.shape = original.shape;
  geometry.name = original.name;
  geometry.tree.copy(original.tree);
  m_version.commit(original.state());
}

/// What a snapshot shows: the source of its queries.
class Snapshot::Contents : public SpatialQueries::Source {
 public:
  explicit Contents(std::shared_ptr<Pool> scratch) : Source(std::move(scratch)) {}

  std::uint64_t state() const override { return m_state.load(std::memory_order_relaxed); }
  const Body& at(GeometryId id) const override { return searchable(body(id)); }
  const Body& body(GeometryId id) const {
    if (GeometryCopy* const copy = find(id)) return copy->geometry;
    throw Error(ErrorCode::UnknownGeometry, nameOf(id) + " is not in this snapshot", id);
  }
  std::size_t geometryCount() const override { return m_geometries.size(); }
  const Body& geometry(std::size_t index) const override { return m_geometries[index]->geometry; }
  std::uint64_t step() const override { return m_step; }
  Engine engine() const override { return m_engine; }
  const OctreeSettings& octreeSettings() const override { return m_octreeSettings; }
  const Threads& threads() const override { return m_thread; }

  GeometryCopy* find(GeometryId id) const {  ///< null if there is none
    const auto found =
        std::lower_bound(m_geometries.begin(), m_geometries.end(), id,
                         [](const GeometryCopy* c, GeometryId i) { return c->geometry.id < i; });
    return found == m_geometries.end() || (*found)->geometry.id != id ? nullptr : *found;
  }
  const SpatialQueries& queries() const { return *m_queries; }
  double time() const { return m_time; }
  const Snapshot& snapshot() const { return m_snapshot; }

 protected:
  std::vector<GeometryCopy*> m_geometries;  ///< by ascending ids
  std::optional<SpatialQueries> m_queries;  ///< holds the pool; empty while the slot is free
  std::atomic<std::uint64_t> m_state = 0;   ///< the snapshot's number; 0: the slot is free
  std::uint64_t m_step = 0;
  Engine m_engine = Engine::Octree;
  OctreeSettings m_octreeSettings;
  double m_time = 0;

 private:
  const Threads m_thread{1};
  const Snapshot m_snapshot{*this};
};

/// One snapshot, with the memory of its shared_ptr's control block.
class SnapshotPool::Slot : public Snapshot::Contents, public CountedObject {
 public:
  explicit Slot(std::shared_ptr<Pool> scratch) : Contents(std::move(scratch)) {}

  /// Acquires what readers did before release().
  bool isFree() const { return m_state.load(std::memory_order_acquire) == 0; }
  std::vector<GeometryCopy*>& geometries() { return m_geometries; }
  /// `self` holds the pool.
  void start(std::shared_ptr<Source> self, const Source& frame, std::uint64_t number, double time) {
    PALPATE_ASSERT(isFree() && number != 0);
    PALPATE_ASSERT(std::is_sorted(m_geometries.begin(), m_geometries.end(),
                                  [](const GeometryCopy* l, const GeometryCopy* r) {
                                    return l->geometry.id < r->geometry.id;
                                  }));
    m_step = frame.step();
    m_engine = frame.engine();
    m_octreeSettings = frame.octreeSettings();
    m_time = time;
    m_state.store(number, std::memory_order_relaxed);
    m_queries = Source::queries(std::move(self));
  }
  void release() {
    m_queries.reset();
    m_state.store(0, std::memory_order_release);
  }

  alignas(std::max_align_t) std::byte controlBlock[128];
};

/// Gives a shared_ptr the memory in a slot for its control block. The slot is free when this memory
/// is given back, after the last reader.
template <class T>
class SnapshotPool::SlotAllocator {
 public:
  using value_type = T;

  SlotAllocator(std::shared_ptr<SnapshotPool> pool, Slot& slot)
      : m_pool(std::move(pool)), m_slot(&slot) {}
  template <class U>
  SlotAllocator(const SlotAllocator<U>& other) : m_pool(other.m_pool), m_slot(other.m_slot) {}

  T* allocate(std::size_t) {
    static_assert(sizeof(T) <= sizeof(Slot::controlBlock));
    return reinterpret_cast<T*>(m_slot->controlBlock);
  }
  void deallocate(T*, std::size_t) { m_slot->release(); }
  template <class U>
  bool operator==(const SlotAllocator<U>& other) const {
    return m_slot == other.m_slot;
  }

 private:
  template <class U>
  friend class SlotAllocator;

  std::shared_ptr<SnapshotPool> m_pool;  ///< outlives deallocate()
  Slot* m_slot;
};

SnapshotPool::SnapshotPool(std::shared_ptr<MemoryBudget> budget)
    : m_scratch(std::make_shared<SpatialQueries::Source::Pool>(std::move(budget))) {}
SnapshotPool::~SnapshotPool() = default;

std::shared_ptr<SnapshotPool> SnapshotPool::successor(std::shared_ptr<MemoryBudget> budget) const {
  auto next = std::make_shared<SnapshotPool>(std::move(budget));
  next->m_last = m_last;
  return next;
}

/// Takes back the copies of free slots.
void SnapshotPool::reclaim() {
  for (const auto& slot : m_slots) {
    if (!slot->isFree()) continue;
    for (GeometryCopy* copy : slot->geometries()) --copy->users;
    slot->geometries().clear();
  }
}

void SnapshotPool::releaseMemory() {
  reclaim();
  std::erase_if(m_slots,
                [](const auto& slot) { return slot->isFree() && slot->geometries().empty(); });
  std::erase_if(m_copies, [](const auto& copy) { return copy->users == 0; });
  m_scratch->release();
}

/// Forgets free copies of removed geometries.
void SnapshotPool::forgetRemoved(const SpatialQueries::Source& frame) {
  std::size_t i = 0;
  std::erase_if(m_copies, [&](const auto& copy) {
    const GeometryId id = copy->geometry.id;
    while (i < frame.geometryCount() && frame.geometry(i).id < id) ++i;
    return copy->users == 0 && (i == frame.geometryCount() || frame.geometry(i).id != id);
  });
}

SnapshotPool::Slot& SnapshotPool::freeSlot() {
  // A slot that became free after reclaim() still has its copies.
  for (const auto& slot : m_slots)
    if (slot->isFree() && slot->geometries().empty()) return *slot;
  m_slots.push_back(std::make_unique<Slot>(m_scratch));
  return *m_slots.back();
}

/// A copy that is current or, if there is none, a free one that has most of what it needs.
GeometryCopy& SnapshotPool::copyOf(const Body& original) {
  const auto begin =
      std::lower_bound(m_copies.begin(), m_copies.end(), original.id,
                       [](const auto& c, GeometryId id) { return c->geometry.id < id; });
  GeometryCopy* best = nullptr;
  auto end = begin;
  for (; end != m_copies.end() && (*end)->geometry.id == original.id; ++end) {
    GeometryCopy& copy = **end;
    if (copy.isCurrent(original)) return copy;
    if (copy.users == 0 && (!best || copy.kept(original) > best->kept(original))) best = &copy;
  }
  if (!best) best = m_copies.insert(end, std::make_unique<GeometryCopy>(original.id))->get();
  best->update(original);
  return *best;
}

std::shared_ptr<const Snapshot> SnapshotPool::take(SpatialQueries::Source& frame, double time) {
  reclaim();
  forgetRemoved(frame);
  Slot& slot = freeSlot();
  slot.geometries().reserve(frame.geometryCount());
  for (std::size_t i = 0; i < frame.geometryCount(); ++i) {
    GeometryCopy& copy = copyOf(frame.geometry(i));
    slot.geometries().push_back(&copy);
    ++copy.users;
  }
  // Nothing below throws.
  slot.start({shared_from_this(), &slot}, frame, ++m_last, time);
  return {&slot.snapshot(), [](const Snapshot*) {},
          SlotAllocator<Snapshot>(shared_from_this(), slot)};
}

void LatestSnapshot::publish(SpatialQueries::Source& frame, double time) {
  std::shared_ptr<const Snapshot> next = m_pool->take(frame, time);
  const std::lock_guard lock(m_mutex);
  m_latest.swap(next);
}

std::shared_ptr<const Snapshot> LatestSnapshot::get() const {
  const std::lock_guard lock(m_mutex);
  return m_latest;
}

const SpatialQueries& Snapshot::queries() const { return m_contents.queries(); }

std::uint64_t Snapshot::number() const { return m_contents.state(); }

double Snapshot::time() const { return m_contents.time(); }

bool Snapshot::has(GeometryId id) const { return m_contents.find(id) != nullptr; }

namespace {

std::span<const Eigen::Vector3d> positionsOf(const Body& geometry, const Positions& end) {
  if (geometry.shape) return {};
  return end.body();
}

}  // namespace

std::span<const Eigen::Vector3d> Snapshot::positions(GeometryId id) const {
  const Body& geometry = m_contents.body(id);
  return positionsOf(geometry, geometry.mesh.now);
}

std::span<const Eigen::Vector3d> Snapshot::positionsBefore(GeometryId id) const {
  const Body& geometry = m_contents.body(id);
  return positionsOf(geometry, geometry.mesh.before);
}

std::span<const std::uint32_t> Snapshot::tags(GeometryId id) const {
  const Body& geometry = m_contents.body(id);
  return geometry.solid ? geometry.solid->tags : geometry.mesh.tags;
}

RigidMotion Snapshot::motion(GeometryId id) const {
  const TriangleMesh& mesh = m_contents.body(id).mesh;
  return {mesh.before.transform(), mesh.now.transform()};
}

Eigen::Vector3d Snapshot::position(GeometryId id, std::uint32_t vertex, double time) const {
  const Body& geometry = m_contents.body(id);
  checkVertex(geometry, vertex, positionsOf(geometry, geometry.mesh.now).size());
  if (!std::isfinite(time))
    throw Error(ErrorCode::InvalidSettings,
                nameOf(geometry) + ": time is " + textOf(time) + "; it must be finite", id);
  const StandardFloatingPoint standard;
  const Eigen::Vector3d now = geometry.mesh.now[vertex], before = geometry.mesh.before[vertex];
  if (time == 0.0 || time == 1.0) return time == 0.0 ? before : now;
  return before + time * (now - before);
}

}  // namespace palpate
