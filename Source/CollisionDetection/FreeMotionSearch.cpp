#include "CollisionDetection/FreeMotionSearch.h"

#include "CollisionDetection/PairOrder.h"
#include "Queries/ElementsNearShape.h"
#include "Shapes/ShapeFreeMotion.h"
#include "Bodies/OctreeFrame.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace palpate {

namespace {

/// Jobs of a pair, and node pairs for them, where there is more than one thread and enough
/// elements.
constexpr std::size_t kSearchJobs = 32, kSearchNodePairs = 256, kSharedSearchSize = 8192;

bool takesPart(const PairRecord& record) {
  return record.pair.settings.freeMotionReach > 0.0 && record.collides();
}

/// L: bounds the magnitudes of all coordinates in the world.
double largestOf(const Body& body) {
  if (body.shape) return body.shape->now.magnitude();
  return OctreeFrame(body).magnitude() + std::sqrt(3.0) * body.tree.reach();
}

bool isEmpty(const Body& body) { return !body.shape && body.tree.octree().size() == 0; }

bool hasShape(const PairRecord& record) { return record.a->body.shape || record.b->body.shape; }

FreeMotionRange rangeOf(const PairRecord& record) {
  return {record.pair.settings,
          record.a->body.mesh.largestRadius + record.b->body.mesh.largestRadius};
}

/// The pair's meshes, with the settings that the user gave: Auto's choice may change in the next
/// frame.
MeshPair meshesOf(const PairRecord& record) {
  MeshPair meshes = record.meshes();
  meshes.settings = record.pair.settings;
  return meshes;
}

FreeMotions motionsOf(const PairRecord& record) {
  return {record.a->nextFreeMotion, record.b->nextFreeMotion, record.a->elementBoxes,
          record.b->elementBoxes};
}

}  // namespace

bool FreeMotionSearch::isKnown(const PairTable& pairs) const {
  auto known = m_known.begin();
  for (const auto& record : pairs.records()) {
    if (!takesPart(*record)) continue;
    if (known == m_known.end() || known->pair.a != record->pair.a ||
        known->pair.b != record->pair.b || !(known->state == record->state()))
      return false;
    ++known;
  }
  return known == m_known.end();
}

bool FreeMotionSearch::find(const GeometryTable& geometries, const PairTable& pairs, Engine engine,
                            const Threads& threads) {
  if (isKnown(pairs)) return true;
  m_known.clear();
  start(geometries, pairs);
  const bool isComplete = endsInTime([&] { search(engine, threads); });
  bool allFinished = true;
  for (const auto& record : pairs.records()) {
    if (!takesPart(*record) || (isComplete && !record->isUnfinished)) continue;
    allFinished = false;
    // The features of an unfinished pair may be in contacts that its answer does not have.
    const double gap = distanceBoundOf(*record) - record->pair.settings.thickness,
                 share = gap > 0.0 ? 0.5 * (1.0 - 0x1p-50) * gap : 0.0;
    for (Geometry* geometry : {record->a, record->b})
      for (double& motion : geometry->nextFreeMotion) motion = std::min(motion, share);
  }
  if (allFinished)
    for (const auto& record : pairs.records())
      if (takesPart(*record)) m_known.push_back({record->pair, record->state()});
  m_isNew = true;
  return isComplete;
}

void FreeMotionSearch::search(Engine engine, const Threads& threads) {
  threads.forEach(m_boxed.size(), [&](std::size_t i) {
    boxElements(m_boxed[i]->body.mesh, m_boxed[i]->elementBoxes);
  });
  m_places.clear();
  m_nodePairs.clear();
  for (std::size_t i = 0; i < m_works.size(); ++i) {
    std::size_t jobs = 1;
    if (engine == Engine::Octree && !hasShape(*m_works[i].record)) {
      startSearch(m_works[i], threads.count() > 1 || isTimed());
      jobs = (m_works[i].count + m_works[i].grain - 1) / m_works[i].grain;
    }
    for (std::size_t job = 0; job < jobs; ++job) m_places.push_back({i, job});
  }
  while (m_scratch.size() < m_places.size()) m_scratch.push_back(std::make_unique<Scratch>());
  threads.forEach(m_places.size(), [&](std::size_t i) {
    const Work& work = m_works[m_places[i].work];
    if (hasShape(*work.record))
      withShape(work, engine, *m_scratch[i]);
    else if (engine == Engine::BruteForce)
      runByBruteForce(work, *m_scratch[i]);
    else
      run(work, m_places[i].job, *m_scratch[i]);
  });
}

void FreeMotionSearch::commit(const GeometryTable& geometries) noexcept {
  if (!std::exchange(m_isNew, false)) return;
  for (const auto& geometry : geometries.all()) geometry->freeMotion.swap(geometry->nextFreeMotion);
}

/// Lists the pairs that take part and the meshes whose elements need boxes, and starts each free
/// motion at the share of the least reach.
void FreeMotionSearch::start(const GeometryTable& geometries, const PairTable& pairs) {
  for (const auto& geometry : geometries.all())
    geometry->nextFreeMotion.assign(geometry->freeMotionCount(),
                                    std::numeric_limits<double>::infinity());
  m_works.clear();
  m_boxed.clear();
  for (const auto& record : pairs.records()) {
    if (!takesPart(*record)) continue;
    const double reach = record->pair.settings.freeMotionReach;
    for (Geometry* geometry : {record->a, record->b})
      for (double& motion : geometry->nextFreeMotion) motion = std::min(motion, 0.5 * reach);
    if (isEmpty(record->a->body) || isEmpty(record->b->body)) continue;
    if (!hasShape(*record)) {
      m_boxed.push_back(record->a);
      m_boxed.push_back(record->b);
    }
    m_works.push_back({record.get(), rangeOf(*record).searchDistance(largestOf(record->a->body) +
                                                                     largestOf(record->b->body))});
  }
  std::sort(m_boxed.begin(), m_boxed.end());
  m_boxed.erase(std::unique(m_boxed.begin(), m_boxed.end()), m_boxed.end());
  for (Geometry* geometry : m_boxed)
    geometry->elementBoxes.resize(geometry->body.mesh.topology.elements.size());
}

void FreeMotionSearch::startSearch(Work& work, bool divides) {
  const Body &a = work.record->a->body, &b = work.record->b->body;
  const std::size_t elements = a.tree.octree().size() + b.tree.octree().size();
  work.trees = treesOf(a, b, work.searchDistance, false);
  startPairs(work.trees, divides && elements >= kSharedSearchSize ? kSearchNodePairs : 1, m_stack);
  work.first = m_nodePairs.size(), work.count = m_stack.pairs.size();
  m_nodePairs.insert(m_nodePairs.end(), m_stack.pairs.begin(), m_stack.pairs.end());
  work.grain = std::max<std::size_t>(1, (work.count + kSearchJobs - 1) / kSearchJobs);
}

void FreeMotionSearch::run(const Work& work, std::size_t job, Scratch& scratch) const {
  const std::size_t begin = job * work.grain, size = std::min(work.count - begin, work.grain);
  struct Context {
    const MeshPair pair;
    const double searchDistance;
    const FreeMotions motions;
  } context{meshesOf(*work.record), work.searchDistance, motionsOf(*work.record)};
  scratch.sink.start(
      [](void* opaque, std::span<const ElementPair> pairs) {
        const Context& c = *static_cast<const Context*>(opaque);
        forEachPart(pairs, [&](const auto& part) {
          findFreeMotion(c.pair, c.searchDistance, part, c.motions);
        });
      },
      &context);
  traverse(work.trees, std::span(m_nodePairs).subspan(work.first + begin, size), scratch.stack,
           scratch.sink);
  scratch.sink.flush();
}

void FreeMotionSearch::runByBruteForce(const Work& work, Scratch& scratch) {
  const MeshPair pair = meshesOf(*work.record);
  const auto countA = static_cast<std::uint32_t>(pair.a.topology.elements.size()),
             countB = static_cast<std::uint32_t>(pair.b.topology.elements.size());
  for (std::uint32_t i = 0; i < countA; ++i) {
    scratch.candidates.clear();
    for (std::uint32_t j = pair.self() ? i + 1 : 0; j < countB; ++j)
      scratch.candidates.push_back({i, j});
    findFreeMotion(pair, work.searchDistance, scratch.candidates, motionsOf(*work.record));
  }
}

void FreeMotionSearch::withShape(const Work& work, Engine engine, Scratch& scratch) {
  const PairRecord& record = *work.record;
  const FreeMotionRange range = rangeOf(record);
  Geometry &a = *record.a, &b = *record.b;
  if (a.body.shape && b.body.shape)
    return findFreeMotion(a.body.shape->now, b.body.shape->now, range, scratch.shapes,
                          a.nextFreeMotion[0], b.nextFreeMotion[0]);
  Geometry &mesh = a.body.shape ? b : a, &other = a.body.shape ? a : b;
  const Shape& shape = other.body.shape->now;
  if (engine == Engine::BruteForce) {
    scratch.elements.resize(mesh.body.mesh.topology.elements.size());
    std::iota(scratch.elements.begin(), scratch.elements.end(), 0u);
  } else {
    findElementsNear(mesh.body, shape, shape, work.searchDistance, scratch.elements);
  }
  findFreeMotion(mesh.body.mesh, shape, range, scratch.elements, mesh.nextFreeMotion,
                 other.nextFreeMotion[0]);
}

}  // namespace palpate
