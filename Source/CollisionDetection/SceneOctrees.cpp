#include "CollisionDetection/SceneOctrees.h"

#include "CollisionDetection/Planning.h"
#include "Search/KeptPairs.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopwatch.h"

#include <algorithm>
#include <utility>

namespace palpate {

namespace {

/// Below this many triangles one thread updates a geometry, beside threads that update others.
constexpr std::size_t kSmall = 16384;
/// If fewer triangles than this are updated in all, one thread updates all geometries: cores take
/// longer to hand over the data than to compute them.
constexpr std::size_t kSmallRefit = 24576;

std::size_t sizeOf(const Geometry& geometry) { return geometry.body.mesh.topology.elements.size(); }

/// L: how far the octree's boxes may lag behind the positions; 0: not at all.
double lagFor(const Geometry& geometry) {
  if (!geometry.mayLag || geometry.shortEdge == 0.0) return 0.0;
  MotionRange all;
  for (const MotionRange& range : geometry.pieces.ranges()) all.add(range);
  const double speed = all.lower.cwiseAbs().cwiseMax(all.upper.cwiseAbs()).maxCoeff();
  if (!(speed <= KeptReach::kMostSpeed * geometry.shortEdge)) return 0.0;
  return 0.5 * KeptReach::of(0.0, speed, geometry.shortEdge).lists;
}

}  // namespace

void SceneOctrees::update(UpdateFor purpose, Trace* traced, SeparateSearches separate) {
  const MemoryScope memory(MemoryStage::Octrees);
  markSkipped(purpose == UpdateFor::Frame && !areCurrent());
  m_state = 0;
  m_shown.trees.clear();  // they are invalid until the update is complete
  if (!m_hasCounts) m_counts = {};
  const bool isFirst = purpose == UpdateFor::User || !std::exchange(m_hasCounts, true);
  for (const auto& geometry : m_geometries.all()) {
    GeometryOctree& tree = geometry->body.tree;
    if (isFirst) tree.lastUpdate = LooseOctree::Update::Unchanged;
    tree.setSwept(false);
    tree.boxMilliseconds = tree.octreeMilliseconds = 0;
  }
  Stopwatch watch;
  const TraceSpan span(traced, "update");
  planAndLag(purpose, traced, separate);
  m_counts.milliseconds.boxes += watch.lap();
  updateTrees(traced);
  count(watch.lap());
  updateView();
  const bool skips = std::any_of(m_geometries.all().begin(), m_geometries.all().end(),
                                 [](const auto& geometry) { return geometry->skipsOctree; });
  if (!skips && !anyLags()) m_state = m_geometries.state();
#ifdef PALPATE_VALIDATE
  PALPATE_ASSERT(m_shown.view.validate().empty());
#endif
}

/// Updates those octrees on which the plans of others depend.
void SceneOctrees::planAndLag(UpdateFor purpose, Trace* traced, SeparateSearches separate) {
  const auto updateSome = [&](IsDue isDue) {
    const auto all = m_geometries.all();
    if (std::any_of(all.begin(), all.end(), [&](const auto& each) { return isDue(*each); }))
      updateTrees(traced, isDue);
  };
  // The motion of placed bodies is measured with their octrees.
  for (const auto& geometry : m_geometries.all())
    if (geometry->body.isPlaced()) geometry->mayLag = false;
  updateSome([](const Geometry& g) { return g.body.isPlaced() && g.body.tree.isLagging(); });
  for (const auto& own : separate) expectPlan(*own);
  if (purpose != UpdateFor::Separate)
    for (const auto& record : m_pairs.records()) expectPlan(*record, purpose == UpdateFor::Frame);
  if (purpose != UpdateFor::Frame) {
    for (const auto& geometry : m_geometries.all()) geometry->mayLag = false;
    return;
  }
  planKeptCandidates(m_geometries, m_pairs.records(), m_settings);
  // A cut that needs a new octree ends lists, so that others must not lag.
  updateSome([](const Geometry& geometry) { return geometry.mayLag && geometry.isCut(); });
  reviewCuts(m_pairs.records());
}

/// Geometries are updated in parallel, the largest first, and large ones use several threads each.
/// The serial parts of one update thus run beside the work on other geometries.
void SceneOctrees::updateTrees(Trace* trace, IsDue isDue) {
  double spread = 0;
  for (const auto& geometry : m_geometries.all())
    spread = std::max(spread, geometry->body.tree.sampleFrame(
                                  geometry->body.mesh, geometry->body.revisions.elements.topology));
  const double scale = frameScale(spread);
  const OctreeSettings& settings = m_settings.octree;
  findOutdated(scale, isDue);
  if (m_outdated.empty()) return;
  std::size_t total = 0;
  for (const Geometry* geometry : m_outdated) total += sizeOf(*geometry);
  const Threads one(1);
  m_wereUpdatedByOneThread = settings.update == OctreeUpdate::Auto && total < kSmallRefit;
  const std::size_t firstEvent = trace ? trace->reserve(m_outdated.size()) : 0;
  (m_wereUpdatedByOneThread ? one : m_threads).forEach(m_outdated.size(), [&](std::size_t i) {
    Geometry& geometry = *m_outdated[i];
    const TraceSpan span(trace, firstEvent + i, {.name = "octree", .a = geometry.body.id});
    const Threads& shared = sizeOf(geometry) < kSmall ? one : m_threads;
    Body& body = geometry.body;
    const Revision topology = body.revisions.elements.topology;
    const double lag = lagFor(geometry);
    if (!body.tree.isCurrent(body.mesh, topology, scale))
      body.tree.update(body.mesh, topology, scale, settings, shared,
                       {lag > 0.0 ? &geometry.pieces : nullptr, lag});
    body.tree.updateDops(body.mesh, settings.bounds, shared);
  });
}

void SceneOctrees::findOutdated(double scale, IsDue isDue) {
  m_outdated.clear();
  reserve(m_geometries.all().size());
  for (const auto& geometry : m_geometries.all()) {
    const Body& body = geometry->body;
    const Revision topology = body.revisions.elements.topology;
    if (!geometry->skipsOctree && (!isDue || isDue(*geometry)) &&
        !(geometry->mayLag && body.tree.laggedTo(body.mesh, topology, scale)) &&
        (!body.tree.isCurrent(body.mesh, topology, scale) ||
         body.tree.needsDops(body.mesh, m_settings.octree.bounds)))
      m_outdated.push_back(geometry.get());
  }
  std::sort(m_outdated.begin(), m_outdated.end(), [](const Geometry* l, const Geometry* r) {
    return sizeOf(*l) != sizeOf(*r) ? sizeOf(*l) > sizeOf(*r) : l->body.id < r->body.id;
  });
}

/// milliseconds: the wall-clock time of updateTrees(). Geometries are updated in parallel. The time
/// is therefore divided in proportion to the work on boxes and on octrees.
void SceneOctrees::count(double milliseconds) {
  using Update = LooseOctree::Update;
  double boxes = 0, octrees = 0;
  m_counts.rebuiltOctrees = m_counts.refittedOctrees = m_counts.unchangedOctrees = 0;
  for (const auto& geometry : m_geometries.all()) {
    const GeometryOctree& tree = geometry->body.tree;
    ++(tree.lastUpdate == Update::Rebuilt    ? m_counts.rebuiltOctrees
       : tree.lastUpdate == Update::Refitted ? m_counts.refittedOctrees
                                             : m_counts.unchangedOctrees);
    boxes += tree.boxMilliseconds;
    octrees += tree.octreeMilliseconds;
  }
  const double share = boxes + octrees > 0 ? boxes / (boxes + octrees) : 0;
  m_counts.milliseconds.boxes += milliseconds * share;
  m_counts.milliseconds.octree += milliseconds * (1 - share);
}

/// Whether a detection answers the pair without octrees.
bool SceneOctrees::needsNone(const PairRecord& record) const {
  return record.pair.settings.freeMotionReach == 0.0 &&
         (record.support->kind == PairKind::Proxy || mayUseProxy(record));
}

/// A detection does not need the octrees of point sets of which all pairs use proxies. Queries
/// update them later.
void SceneOctrees::markSkipped(bool maySkip) {
  for (const auto& geometry : m_geometries.all()) geometry->skipsOctree = false;
  if (!maySkip) return;
  for (const auto& record : m_pairs.records())
    if (needsNone(*record)) record->a->skipsOctree = true;
  for (const auto& record : m_pairs.records()) {
    if (!needsNone(*record)) record->a->skipsOctree = false;
    if (record->support->kind != PairKind::Proxy) record->b->skipsOctree = false;
  }
}

bool SceneOctrees::anyLags() const {
  return std::any_of(m_geometries.all().begin(), m_geometries.all().end(),
                     [](const auto& geometry) { return geometry->body.tree.isLagging(); });
}

void SceneOctrees::updateView() {
  m_shown.trees.clear();
  for (const auto& geometry : m_geometries.all()) {
    const GeometryOctree& tree = geometry->body.tree;
    if (geometry->skipsOctree || !tree.isValid() || tree.isLagging() || tree.octree().size() == 0)
      continue;
    m_shown.trees.push_back({geometry->body.id, &tree.octree(), tree.frame().origin,
                             tree.frame().scale, tree.lastUpdate, tree.bytesBesidesOctree()});
  }
}

void SceneOctrees::reserve(std::size_t geometries) {
  if (m_outdated.capacity() < geometries) m_outdated.reserve(2 * geometries);
  if (m_shown.trees.capacity() < geometries) m_shown.trees.reserve(2 * geometries);
}

void SceneOctrees::restart() {
  m_state = 0;
  m_hasCounts = false;
  updateView();
}

}  // namespace palpate
