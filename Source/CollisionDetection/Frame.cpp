#include "CollisionDetection/Frame.h"

#include "CollisionDetection/DiagnosticsInterface.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopwatch.h"
#include "Core/Spin.h"
#include "DistanceField/FieldCells.h"
#include "DistanceField/FieldContacts.h"
#include "DistanceField/PlacedProxy.h"
#include "Math/Tolerances.h"
#include "NarrowPhase/Continuous.h"
#include "NarrowPhase/ElementBoxes.h"
#include "NarrowPhase/FeaturePairs.h"
#include "NarrowPhase/Intersection.h"
#include "NarrowPhase/Meeting.h"
#include "NarrowPhase/Piercing.h"
#include "NarrowPhase/StepCheck.h"
#include "Queries/ElementsNearShape.h"
#include "Shapes/ShapeContacts.h"
#include "Shapes/ShapeNearings.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <mutex>

namespace palpate {

/// A user's function, called by one thread at a time.
struct GuardedFunction {
  std::mutex mutex;
  Frame::BatchFunction function;
  void* context;
};

namespace {

/// Node pairs and jobs for each collision pair, where there is more than one thread.
constexpr std::size_t kNodePairsWanted = 256;
constexpr std::size_t kJobsPerPair = 32;
/// Below this many triangles, splitting a pair among threads costs more than it saves.
constexpr std::size_t kSharedSize = 8192;
/// The same for elements near a distance field.
constexpr std::size_t kSharedFieldSize = 512;
/// Particles of a job with Method::Proxy.
constexpr std::size_t kParticlesPerJob = 16384;

/// Whether the traversal may skip neighbours that UnfoldedStars proves not to touch. It may if the
/// method reports nothing but touching features: Continuous, without a thickness.
bool reportsOnlyTouching(const PairRecord& record) {
  return record.a == record.b && record.plan.method == Method::Continuous &&
         record.a->mesh.topology.hasFaces() && record.meshes().maxFeatureDistance() == 0.0;
}

bool arePlaced(const PairRecord& record) { return record.a->isPlaced() && record.b->isPlaced(); }

double boxThickness(const PairRecord& record) {
  return record.plan.method == Method::Intersection ? 0.0 : record.meshes().maxFeatureDistance();
}

/// L: by how much more than the thickness Continuous may report features (TimeOfImpactSettings).
/// Their boxes in the world overlap at the thickness, but those in another frame may not.
double approachSlack(const PairRecord& record) {
  if (!record.plan.swept()) return 0.0;
  const double motion = record.plan.motion,
               largestDifference = record.a->inStep().extent + record.b->inStep().extent + motion;
  return record.pair.settings.timeTolerance * motion +
         kApproachError * (largestDifference + 2.0 * boxThickness(record));
}

/// thickness: L, of the boxes. unfolded: UnfoldedStars::triangles(), or null.
TreePair treesOf(const PairRecord& record, bool adjacentPairs, const Triangle* unfolded,
                 double thickness, BoxFrame frame) {
  if (frame == BoxFrame::Body) thickness += approachSlack(record);
  TreePair trees = treesOf(*record.a, *record.b, thickness, record.plan.swept(), frame);
  if (trees.self() && !adjacentPairs) trees.adjacency = record.a->tree.ordered().data();
  if (unfolded) trees.adjacency = unfolded;
  return trees;
}

std::size_t trianglesOf(const PairRecord& record) {
  return record.a->tree.octree().size() + record.b->tree.octree().size();
}

FloatPair floatsOf(const PairRecord& record, const TreePair& trees) {
  FloatPair floats{record.a->tree.floats(), record.b->tree.floats(), nullptr, nullptr,
                   trees.shiftLower,        trees.shiftUpper};
  if (record.plan.swept()) {
    floats.beforeA = record.a->tree.floatsAtStart();
    floats.beforeB = record.b->tree.floatsAtStart();
  }
  return floats;
}

/// Sorts ids, which are below `count`, and keeps each once.
void sortUnique(Buffer<std::uint32_t>& ids, std::size_t count, Buffer<std::uint8_t>& flags) {
  if (ids.size() < count) {
    std::sort(ids.begin(), ids.end());
    ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    return;
  }
  flags.assign(count, 0);
  for (const std::uint32_t id : ids) flags[id] = 1;
  ids.clear();
  for (std::uint32_t id = 0; id < count; ++id)
    if (flags[id]) ids.push_back(id);
}

std::size_t sizeOf(const CollisionData::Contents& contents) {
  std::size_t size = 0;
  forEachTimed(contents, [&](const auto& list) { size += list.size(); });
  return size;
}

/// intersectionCount: the number of contacts that Method::Intersection found at the step's end.
void countContacts(const PairPlan& plan, std::size_t intersectionCount,
                   CollisionData::Contents& contents) {
  std::size_t atImpact = 0;
  if (plan.byProxy) {
    if (plan.method == Method::Continuous) atImpact = contents.vertexTriangle.size();
  } else if (plan.step.reportsImpacts) {
    forEachTimed(contents, [&](const auto& contacts) {
      for (const auto& contact : contacts) atImpact += contact.timeOfImpact < 1.0;
    });
  } else if (plan.method == Method::Continuous) {
    atImpact = sizeOf(contents) - intersectionCount;
  }
  contents.validity.atImpact = atImpact;
  contents.validity.atEnd = sizeOf(contents) - contents.validity.atImpact;
}

/// PairSettings::earliestTimeOnly: replaces a pair's contacts by the earliest of their times.
void takeEarliest(PairRecord& record, ContactBuffers& contacts) {
  forEachTimed(contacts, [&](auto& list) {
    for (const auto& contact : list)
      record.earliest = std::min(record.earliest.load(), contact.timeOfImpact);
    list.clear();
  });
}

/// Validity's lists for Method::DistanceField, and the error bound. That of Proxy is there already.
void describeField(const PairRecord& record, CollisionData::Contents& contents) {
  Validity& validity = contents.validity;
  validity.outsideBand.clear();
  validity.nearThreshold.clear();
  validity.unreliableSign.clear();
  if (record.usesProxy() || record.plan.byProxy) return;
  validity.proxyDepth = contents.errorBound = 0.0;
  if (!record.usesField()) return;
  const DistanceField& field = *record.body().field;
  contents.errorBound = field.errorBound();
  const PlacedField placed = record.placedField();
  const double thickness = record.meshes().thicknessAtEnd();
  for (std::uint32_t i = 0; i < contents.shape.size(); ++i) {
    const ShapeContact& contact = contents.shape[i];
    if (!placed.lookup().signIsReliable(placed.inField(contact.point)))
      validity.unreliableSign.push_back(i);
    const double value =
        contact.distance + record.mesh().mesh.radius(contact.vertices, contact.weights);
    if (value <= -reachOf(field)) validity.outsideBand.push_back(i);
    if (thickness - contact.distance < field.errorBound()) validity.nearThreshold.push_back(i);
  }
}

/// Auto by an attached proxy: makes the contacts of the exact method such of a body, too. Both
/// lists are in the order of particles.
void describeAsShape(const TriangleMesh& points, CollisionData::Contents& contents) {
  auto& exact = contents.vertexTriangle;
  auto& all = contents.shape;
  std::size_t byProxy = all.size(), left = exact.size();
  all.resize(byProxy + left);
  for (std::size_t place = all.size(); left > 0;) {
    if (byProxy > 0 && all[byProxy - 1].id > exact[left - 1].vertex) {
      all[--place] = all[--byProxy];
      continue;
    }
    const VertexTriangleContact& contact = exact[--left];
    const std::uint32_t v = contact.vertex;
    const double time = contact.timeOfImpact;
    const Eigen::Vector3d point = (1.0 - time) * points.before[v] + time * points.now[v];
    all[--place] = {ShapeElement::Vertex,
                    v,
                    {v, v, v},
                    Eigen::Vector3d::UnitX(),
                    point,
                    point - (contact.distance + points.radius(v)) * contact.normal,
                    contact.normal,
                    contact.distance,
                    time};
  }
  exact.clear();
}

bool sharesVertex(const Triangle& s, const Triangle& t) {
  return std::any_of(s.begin(), s.end(),
                     [&](std::uint32_t v) { return v == t[0] || v == t[1] || v == t[2]; });
}

}  // namespace

/// A part of one pair's traversal, and its results.
struct Frame::Job : CountedObject {
  using Use = void (*)(Job&, std::span<const ElementPair>);

  PairRecord* record;
  TreePair trees;
  std::size_t begin, end;  ///< of m_nodePairs
  FloatPair floats;
  double thickness;  ///< L: of the boxes that the pair's method compares
  TraversalStack stack;
  PointQueryStack queries;
  Buffer<std::uint32_t> elements;
  PairSink sink;
  Use use;
  GuardedFunction* guarded;       ///< of forEach()
  std::atomic<double>* earliest;  ///< shared by all jobs of the pair, for earliestTimeOnly
  ElementPair* place;             ///< of collect(): where the job's candidates are copied
  bool keepCandidates;
  bool nearby;  ///< some boxes overlap at the thickness of the traversal
  ContactBuffers contacts;
  ContactBuffers intersections;  ///< Auto: Intersection's, where the step starts intersecting
  bool intersectionsMissed;      ///< detectIntersections() did not run for every batch
  Buffer<ElementPair> candidates;
  Buffer<ElementPair> kept;  ///< pairs of the present batch that passed the filters so far
  /// With Method::Proxy, and Auto by a proxy; begin and end are of particles.
  std::optional<PlacedProxy> proxy;
  ProxyHits hits;
  ShapeContact* firstContact;  ///< where those of `hits` are written
  double milliseconds = 0, narrowMilliseconds = 0;

  /// Batches are passed to `use`. If it is null, they stay in the sink.
  void start(Use newUse) {
    use = newUse;
    sink.start(use ? &receive : nullptr, this);
  }

  /// Whether the traversal may find pairs that are no candidates.
  bool isFiltered() const { return record->anyDisabled() || trees.isMapped(); }
  /// Whether the boxes of the traversal may be larger than those of the pair's method.
  bool hasWiderBoxes() const {
    return record->hasWiderBoxes() || record->plan.searchDistance > 0.0;
  }

  /// Receives a batch of the traversal, and passes its candidates to `use`.
  static void receive(void* context, std::span<const ElementPair> pairs) {
    Job& job = *static_cast<Job*>(context);
    if (!job.hasWiderBoxes() && !job.isFiltered()) {
      job.nearby = true;
      return job.use(job, pairs);
    }
    job.kept.assign(pairs.begin(), pairs.end());
    job.keepNearby();
    job.nearby |= !job.kept.empty();
    job.keepEnabled();
    job.keepWithinThickness();
    if (!job.kept.empty()) job.use(job, job.kept);
  }

  /// Keeps pairs whose boxes overlap at the thickness of the traversal. The traversal of mapped
  /// trees finds other pairs as well. So does a search at the searchDistance if other pairs of the
  /// geometries need boxes over the step.
  void keepNearby() {
    const bool searches = record->plan.searchDistance > 0.0;
    if (trees.isMapped() || (searches && record->hasWiderBoxes()))
      keepInWorld(searches ? std::max(record->plan.step.motionWithRounding, thickness) : thickness);
  }
  void keepEnabled() {
    if (!record->anyDisabled()) return;
    const MeshTopology &a = record->a->mesh.topology, &b = record->b->mesh.topology;
    std::erase_if(kept,
                  [&](const ElementPair& p) { return !a.isEnabled(p.a) || !b.isEnabled(p.b); });
  }
  /// Keeps pairs whose boxes overlap at the pair's own thickness. The boxes are those of the pair's
  /// method: at the step's end, or over the whole step.
  void keepWithinThickness() {
    if (!trees.isMapped()) {
      if (hasWiderBoxes())
        keepOverlapping(record->a->mesh.topology, record->b->mesh.topology, floats, kept);
    } else if (record->plan.searchDistance > thickness) {
      keepInWorld(thickness);
    }
  }
  void keepInWorld(double distance) {
    keepOverlapping(record->meshes(), record->plan.swept(), distance, kept);
  }

  static void keep(Job& job, std::span<const ElementPair> pairs) {
    job.candidates.insert(job.candidates.end(), pairs.begin(), pairs.end());
  }

  static void callGuarded(Job& job, std::span<const ElementPair> pairs) {
    std::unique_lock lock(job.guarded->mutex, std::try_to_lock);
    for (Spin spin; !lock && !spin.isOver() && !lock.try_lock();) spin.wait();
    if (!lock) lock.lock();
    job.guarded->function(job.guarded->context, job.record->pair, pairs);
  }

  static void detect(Job& job, std::span<const ElementPair> pairs) {
    const MeshPair meshes = job.record->meshes(job.trees.isMapped() ? nullptr : &job.floats);
    job.findAll(meshes, pairs);
    if (!job.keepCandidates) return;
    const CountedVector<Triangle>& triangles = meshes.a.topology.triangles;
    for (const ElementPair pair : pairs)
      if (!meshes.self() || !sharesVertex(triangles[pair.a], triangles[pair.b]))
        job.candidates.push_back(pair);
  }

  void findAll(const MeshPair& meshes, std::span<const ElementPair> pairs) {
    const MemoryScope memory(MemoryStage::NarrowPhase);
    Stopwatch watch;
    StepFacts& facts = contacts.facts;
    if (meshes.step.checksStart && !facts.startsPiercing())
      facts.atStart =
          std::max(facts.atStart, meetingOf(meshes, true, pairs, intersections).meeting);
    if (record->plan.runsIntersection &&
        (facts.startsPiercing() || record->plan.startsIntersecting))
      detectIntersections(*this, pairs);
    else
      intersectionsMissed = true;
    if (meshes.settings.earliestTimeOnly)
      findEarliest(meshes, pairs);
    else
      findContacts(meshes, pairs, contacts);
    narrowMilliseconds += watch.lap();
  }

  /// Detects the contacts of a pair with a shape, without a traversal.
  void detectShape() {
    const MeshPair meshes = record->meshes();
    if (meshes.isShapePair()) {
      if (meshes.keepsApart)
        return findShapePairNearing(*meshes.shapeOfA, *meshes.shapeOfB,
                                    meshes.settings.timeTolerance, contacts);
      findShapePair(*meshes.shapeOfA, *meshes.shapeOfB, meshes.settings, contacts);
      if (meshes.settings.earliestTimeOnly) takeEarliest(*record, contacts);
      return;
    }
    const auto& [analytical, now, before] = meshes.shape();
    findElementsNear(record->mesh(), record->plan.swept() ? before : now, now,
                     meshes.maxFeatureDistance(), queries, elements);
    const MemoryScope memory(MemoryStage::NarrowPhase);
    Stopwatch watch;
    if (meshes.keepsApart)
      findShapeNearings(meshes.mesh(), meshes.shape(), meshes.settings.timeTolerance, elements,
                        contacts);
    else
      findShapeContacts(meshes.mesh(), meshes.shape(), meshes.settings, elements, contacts);
    if (meshes.settings.earliestTimeOnly) takeEarliest(*record, contacts);
    narrowMilliseconds += watch.lap();
  }

  /// Finds the contacts of the job's particles with a proxy.
  void detectProxy(bool byBruteForce) {
    const MemoryScope memory(MemoryStage::NarrowPhase);
    Stopwatch watch;
    proxy->find(record->a->mesh, begin, end, byBruteForce, nullptr, hits);
    contacts.featurePairs += hits.answered;
    narrowMilliseconds += watch.lap();
  }

  /// Auto by a proxy: finds the contacts of the job's particles. The exact method finds those of
  /// particles that may have an impact in the step.
  void detectParticles(bool byBruteForce) {
    const MemoryScope memory(MemoryStage::NarrowPhase);
    Stopwatch watch;
    const TriangleMesh& points = record->a->mesh;
    const PairPlan& plan = record->plan;
    const ParticleStep step{record->b->motion.range(), record->pair.settings.thickness,
                            plan.motionTolerance};
    proxy->find(points, begin, end, byBruteForce, plan.motion > 0.0 ? &step : nullptr, hits);
    contacts.featurePairs += hits.answered;
    contacts.shape.resize(hits.count);
    proxy->write(points, hits, contacts.shape.data());
    if (byBruteForce)
      detectVerticesByBruteForce(*record, hits.others, contacts);
    else
      detectOthers();
    narrowMilliseconds += watch.lap();
  }
  void detectOthers() {
    const TriangleMesh& points = record->a->mesh;
    const MeshPair meshes = record->meshes();
    const bool swept = record->plan.swept();
    const auto isDisabled = [&](const ElementPair& p) {
      return !record->b->mesh.topology.isEnabled(p.b);
    };
    for (const std::uint32_t point : hits.others) {
      Eigen::AlignedBox3d box(points.now[point]);
      if (swept) box.extend(points.before[point]);
      const Eigen::Vector3d margin = Eigen::Vector3d::Constant(meshes.maxFeatureDistance());
      findElementsNear(*record->b, {box.min() - margin, box.max() + margin}, swept, queries,
                       elements);
      kept.clear();
      for (const std::uint32_t element : elements) kept.push_back({point, element});
      std::erase_if(kept, isDisabled);
      if (!kept.empty()) findContacts(meshes, kept, contacts);
    }
  }

  // Method::DistanceField: the job's share of the elements near the field, in three phases.

  std::size_t vertexBegin, vertexEnd;  ///< of FieldScratch::vertices

  template <class F>
  void inField(F&& f) {
    const MemoryScope memory(MemoryStage::NarrowPhase);
    Stopwatch watch;
    const PlacedField placed = record->placedField();
    FieldContacts found = record->fieldContacts(placed);
    f(found);
    const double spent = watch.lap();
    milliseconds += spent;
    narrowMilliseconds += spent;
  }
  void findFieldValues() {
    inField([&](FieldContacts& found) { found.findValues(vertexBegin, vertexEnd); });
  }
  void findFieldEdges() {
    inField([&](FieldContacts& found) { found.findEdges(begin, end, contacts); });
  }
  void findFieldFaces() {
    inField([&](FieldContacts& found) { found.findFaces(begin, end, contacts); });
  }

  /// Auto: finds intersections at the step's end.
  static void detectIntersections(Job& job, std::span<const ElementPair> pairs) {
    const MemoryScope memory(MemoryStage::NarrowPhase);
    const MeshPair meshes = job.record->meshes();
    findIntersections(meshes, pairs, job.intersections);
    if (meshes.step.motion > 0.0) findCrossingsAtStart(meshes, pairs, job.intersections);
  }

  void findEarliest(const MeshPair& meshes, std::span<const ElementPair> pairs) {
    const double found = findEarliestImpact(meshes, pairs, earliest->load(), contacts);
    double known = earliest->load();
    while (found < known && !earliest->compare_exchange_weak(known, found)) {
    }
  }
};

Frame::Frame() = default;
Frame::~Frame() = default;
Frame& Frame::operator=(Frame&&) noexcept = default;

Frame::Job& Frame::newJob(PairRecord& record) {
  if (m_jobCount == m_jobs.size()) m_jobs.push_back(std::make_unique<Job>());
  Job& job = *m_jobs[m_jobCount++];
  job.record = &record;
  job.contacts.clear();
  job.intersections.clear();
  job.nearby = job.intersectionsMissed = false;
  job.place = nullptr;
  job.candidates.clear();
  job.milliseconds = job.narrowMilliseconds = 0;
  return job;
}

void Frame::start(std::span<PairRecord* const> records, const Threads& threads, bool adjacentPairs,
                  BoxFrame frame) {
  const MemoryScope memory(MemoryStage::Pairs);
  m_jobCount = 0;
  m_usesFields = false;
  m_nodePairs.clear();
  for (PairRecord* record : records) {
    record->earliest = std::numeric_limits<double>::infinity();
    if (record->usesField()) {
      if (adjacentPairs) startField(*record, threads);
      continue;
    }
    if (record->hasShape()) {
      if (adjacentPairs && (record->mesh().shape || record->mesh().tree.octree().size() > 0))
        newJob(*record);
      continue;
    }
    if (record->usesProxy() || (adjacentPairs && record->plan.byProxy)) {
      if (adjacentPairs) startProxy(*record, kParticlesPerJob);
      continue;
    }
    if (record->a->tree.octree().size() == 0 || record->b->tree.octree().size() == 0) continue;
    const Triangle* const unfolded =
        adjacentPairs && reportsOnlyTouching(*record)
            ? record->a->tree.findUnfoldedStars(record->a->mesh, threads)
            : nullptr;
    const double thickness = boxThickness(*record);
    const TreePair own = treesOf(*record, adjacentPairs, unfolded, thickness, BoxFrame::World);
    // A search at the searchDistance is for boxes in the world.
    const bool searches = adjacentPairs && record->plan.searchDistance > 0.0;
    const TreePair trees =
        treesOf(*record, adjacentPairs, unfolded,
                searches ? std::max(thickness, record->plan.searchDistance) : thickness,
                searches || !arePlaced(*record) ? BoxFrame::World : frame);
    const bool shared = threads.count() > 1 && trianglesOf(*record) >= kSharedSize;
    startPairs(trees, shared ? kNodePairsWanted : 1, m_stack);
    const std::size_t first = m_nodePairs.size(), count = m_stack.pairs.size();
    m_nodePairs.insert(m_nodePairs.end(), m_stack.pairs.begin(), m_stack.pairs.end());
    const std::size_t grain = std::max<std::size_t>(1, (count + kJobsPerPair - 1) / kJobsPerPair);
    for (std::size_t begin = 0; begin < count; begin += grain) {
      Job& job = newJob(*record);
      job.trees = trees;
      job.floats = floatsOf(*record, own);
      job.thickness = thickness;
      job.earliest = &record->earliest;
      job.begin = first + begin;
      job.end = first + std::min(count, begin + grain);
    }
  }
}

void Frame::startProxy(PairRecord& record, std::size_t grain) {
  const std::size_t size = record.a->mesh.now.size();
  const bool isAuto = record.plan.byProxy;
  for (std::size_t begin = 0; begin < size; begin += grain) {
    Job& job = newJob(record);
    job.proxy.emplace(isAuto ? *record.b->proxy : *record.proxy, record.b->mesh,
                      isAuto ? record.plan.proxyThickness : record.pair.settings.thickness);
    job.begin = begin;
    job.end = std::min(size, begin + grain);
  }
}

/// Auto by a proxy: the error and the depth of its answer.
void Frame::describeProxy(std::span<const std::unique_ptr<Job>> jobs, PairRecord& record) {
  CollisionData::Contents& contents = record.next.contents();
  double error = 0;
  for (const auto& job : jobs) error = std::max(error, job->hits.error);
  contents.validity.proxyDepth = record.b->proxy->depth();
  contents.errorBound = jobs.empty() ? 0.0 : jobs.front()->proxy->totalError(error);
}

void Frame::writeProxyContacts(std::span<const std::unique_ptr<Job>> jobs, const Threads& threads,
                               PairRecord& record) {
  const MemoryScope memory(MemoryStage::Results);
  CollisionData::Contents& contents = record.next.contents();
  contents.vertexTriangle.clear();
  contents.triangleVertex.clear();
  contents.edgeEdge.clear();
  contents.intersectingTriangles.clear();
  contents.shapeShape.clear();
  std::size_t size = 0;
  double error = 0;
  for (const auto& job : jobs) {
    size += job->hits.count;
    error = std::max(error, job->hits.error);
  }
  contents.shape.resize(size);
  ShapeContact* place = contents.shape.data();
  for (const auto& job : jobs) {
    job->firstContact = place;
    place += job->hits.count;
  }
  threads.forEach(jobs.size(), [&](std::size_t i) {
    jobs[i]->proxy->write(record.a->mesh, jobs[i]->hits, jobs[i]->firstContact);
  });
  contents.validity.proxyDepth = record.proxy->depth();
  contents.errorBound = jobs.empty() ? 0.0 : jobs.front()->proxy->totalError(error);
}

void Frame::startField(PairRecord& record, const Threads& threads) {
  const PlacedField placed = record.placedField();
  record.fieldContacts(placed).start(record.mesh());
  const FieldScratch& scratch = *record.fieldScratch;
  const std::size_t elements = scratch.elements.size(), vertices = scratch.vertices.size();
  const bool shared = threads.count() > 1 && elements >= kSharedFieldSize;
  const std::size_t jobs = elements == 0 ? 0 : shared ? kJobsPerPair : 1;
  for (std::size_t i = 0; i < jobs; ++i) {
    Job& job = newJob(record);
    job.begin = elements * i / jobs, job.end = elements * (i + 1) / jobs;
    job.vertexBegin = vertices * i / jobs, job.vertexEnd = vertices * (i + 1) / jobs;
  }
  m_usesFields |= jobs > 0;
}

/// The phases of Method::DistanceField that come before the last one.
void Frame::prepareFields(const Threads& threads) {
  if (!m_usesFields) return;
  for (const auto phase : {&Job::findFieldValues, &Job::findFieldEdges})
    threads.forEach(m_jobCount, [&](std::size_t i) {
      if (m_jobs[i]->record->usesField()) ((*m_jobs[i]).*phase)();
    });
}

void Frame::run(Job& job) const {
  traverse(job.trees, std::span(m_nodePairs).subspan(job.begin, job.end - job.begin), job.stack,
           job.sink);
  job.sink.flush();
}

void Frame::collect(std::span<PairRecord* const> records, const Threads& threads,
                    FrameStatistics& statistics) {
  Stopwatch watch;
  start(records, threads, false, BoxFrame::World);
  threads.forEach(m_jobCount, [&](std::size_t i) {
    const PairRecord& record = *m_jobs[i]->record;
    m_jobs[i]->start(record.hasWiderBoxes() || m_jobs[i]->isFiltered() ? &Job::keep : nullptr);
    run(*m_jobs[i]);
  });
  const auto found = [&](std::size_t i) {
    return m_jobs[i]->use ? std::span<const ElementPair>(m_jobs[i]->candidates)
                          : m_jobs[i]->sink.kept();
  };
  std::size_t i = 0;
  for (PairRecord* record : records) {
    const std::size_t first = i;
    std::size_t size = 0;
    for (; i < m_jobCount && m_jobs[i]->record == record; ++i) size += found(i).size();
    if (i == first + 1 && !m_jobs[first]->use) {
      m_jobs[first]->sink.takeKept(record->candidates);
    } else {
      record->candidates.resize(size);
      ElementPair* place = record->candidates.data();
      for (std::size_t k = first; k < i; ++k) {
        m_jobs[k]->place = place;
        place += found(k).size();
      }
    }
    record->candidatesSorted = false;
    record->candidateCount = size;
  }
  threads.forEach(m_jobCount, [&](std::size_t k) {
    if (m_jobs[k]->place) std::copy(found(k).begin(), found(k).end(), m_jobs[k]->place);
  });
  for (PairRecord* record : records) record->candidatesVersion.commit(record->state());
  statistics.milliseconds.pairs = watch.lap();
}

void Frame::forEach(std::span<PairRecord* const> records, const Threads& threads,
                    BatchFunction function, void* context) {
  start(records, threads, false, BoxFrame::World);
  GuardedFunction guarded{{}, function, context};
  threads.forEach(m_jobCount, [&](std::size_t i) {
    m_jobs[i]->guarded = &guarded;
    m_jobs[i]->start(&Job::callGuarded);
    run(*m_jobs[i]);
  });
  for (PairRecord* record : records) record->candidateCount = 0;
  for (std::size_t i = 0; i < m_jobCount; ++i)
    m_jobs[i]->record->candidateCount += m_jobs[i]->sink.total();
}

void Frame::detect(std::span<PairRecord* const> records, const Settings& settings,
                   const Threads& threads, FrameStatistics& statistics) {
  Stopwatch watch;
  start(records, threads, true, settings.keepCandidates ? BoxFrame::World : BoxFrame::Body);
  prepareFields(threads);
  threads.forEach(m_jobCount, [&](std::size_t i) {
    if (m_jobs[i]->record->usesField()) {
      m_jobs[i]->start(&Job::detect);
      return m_jobs[i]->findFieldFaces();
    }
    Stopwatch job;
    m_jobs[i]->keepCandidates = settings.keepCandidates;
    m_jobs[i]->start(&Job::detect);
    if (m_jobs[i]->record->usesProxy())
      m_jobs[i]->detectProxy(false);
    else if (m_jobs[i]->record->plan.byProxy)
      m_jobs[i]->detectParticles(false);
    else
      m_jobs[i]->record->hasShape() ? m_jobs[i]->detectShape() : run(*m_jobs[i]);
    m_jobs[i]->milliseconds = job.lap();
  });
  findMissedIntersections(threads);
  double all = 0, narrow = 0;
  for (std::size_t i = 0; i < m_jobCount; ++i) {
    const Job& job = *m_jobs[i];
    all += job.milliseconds;
    narrow += job.narrowMilliseconds;
    const std::size_t exact = job.contacts.exactDecisions + job.intersections.exactDecisions;
    statistics.candidatePairs += job.sink.total();
    statistics.featurePairs += job.contacts.featurePairs;
    statistics.exactDecisions += exact;
    statistics.validityPairs += job.intersections.validityPairs;
    PairStatistics& ofPair = job.record->statistics;
    ofPair.milliseconds += job.milliseconds;
    ofPair.candidatePairs += job.sink.total();
    ofPair.featurePairs += job.contacts.featurePairs;
    ofPair.exactDecisions += exact;
  }
  // Threads work on both stages at once. The wall-clock time is therefore divided in proportion to
  // the work of each stage.
  const double wall = watch.lap();
  statistics.milliseconds.narrowPhase = all > 0 ? wall * narrow / all : 0;
  statistics.milliseconds.pairs = wall - statistics.milliseconds.narrowPhase;

  std::size_t i = 0;
  for (PairRecord* record : records) {
    m_buffers.clear();
    m_intersections.clear();
    bool nearby = false;
    const std::size_t first = i;
    if (settings.keepCandidates) record->candidates.clear();
    for (; i < m_jobCount && m_jobs[i]->record == record; ++i) {
      Job& job = *m_jobs[i];
      m_buffers.push_back(&job.contacts);
      m_intersections.push_back(&job.intersections);
      nearby |= job.nearby;
      if (settings.keepCandidates)
        record->candidates.insert(record->candidates.end(), job.candidates.begin(),
                                  job.candidates.end());
    }
    const auto jobs = std::span(m_jobs).subspan(first, i - first);
    if (record->usesProxy()) writeProxyContacts(jobs, threads, *record);
    if (record->plan.byProxy) describeProxy(jobs, *record);
    const std::size_t exact = statistics.exactDecisions;
    finish(*record, nearby, false, settings, statistics);
    const double spent = watch.lap();
    record->statistics.milliseconds += spent;
    record->statistics.exactDecisions += statistics.exactDecisions - exact;
    statistics.milliseconds.order += spent;
  }
}

/// Repeats jobs in which some batches ran before the step was known to start intersecting. This is
/// rare: most such steps are known before, or from their first batch.
void Frame::findMissedIntersections(const Threads& threads) {
  const auto missed = [](const Job& job) {
    return job.intersectionsMissed && job.record->plan.runsIntersection &&
           job.record->plan.startsIntersecting;
  };
  bool any = false;
  for (std::size_t i = 0; i < m_jobCount; ++i)
    m_jobs[i]->record->plan.startsIntersecting |= m_jobs[i]->contacts.facts.startsPiercing();
  for (std::size_t i = 0; i < m_jobCount; ++i) any |= missed(*m_jobs[i]);
  if (!any) return;
  threads.forEach(m_jobCount, [&](std::size_t i) {
    Job& job = *m_jobs[i];
    if (!missed(job)) return;
    Stopwatch watch;
    job.start(&Job::detectIntersections);
    run(job);
    const double spent = watch.lap();
    job.milliseconds += spent;
    job.narrowMilliseconds += spent;
  });
}

/// Auto: of closed bodies that intersect when the step begins, takes only contacts on outer sides.
/// Returns the number of preferred buffers.
std::size_t Frame::preferBodies(PairRecord& record, Engine engine, std::size_t preferred) {
  record.byBodies = false;
  if (record.pair.settings.method != Method::Auto || record.hasShape() || record.needsField())
    return preferred;
  if (!m_bodies) m_bodies = std::make_unique<BodyContacts>();
  const BodyContacts::Buffers all(m_buffers);
  const bool byIntersection = record.plan.method == Method::Intersection;
  const BodyContacts::Buffers local = byIntersection ? all : BodyContacts::Buffers(m_intersections);
  const bool areDeep = m_bodies->find(record, engine, m_facts.startsPiercing(), local,
                                      all.subspan(byIntersection ? all.size() : preferred));
  record.byBodies = areDeep || m_bodies->hasTurned();
  m_pierced.exactDecisions += m_bodies->exactDecisions();
  if (!areDeep) return preferred;
  m_buffers.assign(1, &m_bodies->contacts());
  return 1;
}

void Frame::finish(PairRecord& record, bool nearby, bool candidatesSorted, const Settings& settings,
                   FrameStatistics& statistics) {
  const MemoryScope memory(MemoryStage::Results);
  m_facts.clear();
  m_impacts.clear();
  m_pierced.clear();
  const bool byIntersection = record.plan.method == Method::Intersection;
  m_piercingContacts.find(record.meshes(), byIntersection ? m_buffers : m_intersections, m_pierced);
  (byIntersection ? m_buffers : m_intersections).push_back(&m_pierced);
  for (const auto* buffers : {&m_buffers, &m_intersections})
    for (const ContactBuffers* found : *buffers) {
      m_facts.add(found->facts);
      if (record.hasShape()) m_facts.addShape(*found, record.plan.method == Method::Continuous);
    }
  const TriangleMesh &a = record.a->mesh, &b = record.b->mesh;
  sortUnique(m_facts.verticesA, a.now.size(), m_flags);
  sortUnique(m_facts.verticesB, b.now.size(), m_flags);
  sortUnique(m_facts.degenerateA, a.topology.triangles.size(), m_flags);
  sortUnique(m_facts.degenerateB, b.topology.triangles.size(), m_flags);
  if (record.plan.step.reportsImpacts && m_facts.clearance == 0.0) {
    for (ContactBuffers* found : m_buffers)
      replaceByImpacts(record.meshes(), m_facts, *found, m_impacts);
    m_buffers.push_back(&m_impacts);
  }
  if (record.plan.startsIntersecting) m_facts.atStart = Meeting::Piercing;
  record.plan.startsIntersecting = m_facts.startsPiercing();
  std::size_t preferredBuffers = 0;
  record.sidesAreKnown = m_facts.startsPiercing() && record.plan.runsIntersection;
  if (record.sidesAreKnown) {
    m_leaving.clear();
    m_piercingContacts.findAtStart(record.meshes(), m_intersections, m_leaving);
    m_knownSides.apply(record.meshes(), m_intersections, m_leaving, m_buffers);
    preferredBuffers = m_intersections.size();
    m_buffers.insert(m_buffers.begin(), m_intersections.begin(), m_intersections.end());
  }
  preferredBuffers = preferBodies(record, settings.engine, preferredBuffers);
  // A feature pair that Intersection reports is not reported by distance or impact as well: where
  // the step starts intersecting only Intersection knows the side.
  CollisionData::Contents& contents = record.next.contents();
  const std::size_t intersectionCount =
      record.usesProxy() ? 0 : orderContacts(m_buffers, preferredBuffers, m_orderScratch, contents);
  describeField(record, contents);
  contents.earliestTimeOfImpact = record.earliest.load();
  if (contents.earliestTimeOfImpact <= 1.0) m_facts.clearance = 0.0;
  if (!record.guarded)
    record.trust.finish(record.pair.settings, record.a->inStep(), record.b->inStep(), record.plan,
                        m_facts, nearby, record.meshes(), contents, m_impacts);
  statistics.exactDecisions += m_impacts.exactDecisions + m_pierced.exactDecisions;
  statistics.validityPairs += m_impacts.validityPairs;
  // After trust.finish(), which tests the triangles around every impact.
  if (record.pair.settings.contacts == Contacts::Distinct &&
      (record.plan.step.reportsImpacts || record.plan.method == Method::Continuous))
    m_firstImpacts.keep(
        record.meshes(),
        record.plan.step.reportsImpacts ? 1.0 : std::numeric_limits<double>::infinity(),
        m_orderScratch, contents);
  if (const MeshPair meshes = record.meshes(); meshes.hasShape() && !meshes.isShapePair())
    contents.shape.resize(m_distinctContacts.keep(
        meshes.mesh(), meshes.shape().now, meshes.poses().before.transform(),
        meshes.poses().now.transform(), meshes.settings, contents.shape));
  countContacts(record.plan, intersectionCount, contents);
  if (record.plan.byProxy) describeAsShape(record.a->mesh, contents);
  record.candidatesSorted = candidatesSorted;
  if (settings.keepCandidates) record.candidatesVersion.commit(record.state());
}

void Frame::detectByBruteForce(std::span<PairRecord* const> records, const Settings& settings,
                               FrameStatistics& statistics) {
  for (PairRecord* record : records) {
    Stopwatch watch;
    const FrameStatistics before = statistics;
    ContactBuffers contacts, intersections;
    m_buffers = {&contacts};
    m_jobCount = 0;
    if (record->usesProxy() || record->plan.byProxy)
      startProxy(*record, std::max<std::size_t>(1, record->a->mesh.now.size()));
    const auto jobs = std::span(m_jobs).first(m_jobCount);
    if (record->plan.byProxy) {
      for (const auto& job : jobs) {
        job->detectParticles(true);
        m_buffers.push_back(&job->contacts);
        statistics.featurePairs += job->contacts.featurePairs;
        statistics.exactDecisions += job->contacts.exactDecisions;
      }
      describeProxy(jobs, *record);
    } else if (record->usesProxy()) {
      for (const auto& job : jobs) job->detectProxy(true);
      writeProxyContacts(jobs, Threads(1), *record);
      for (const auto& job : jobs) contacts.featurePairs += job->contacts.featurePairs;
    } else {
      detectPairByBruteForce(*record, contacts, intersections);
    }
    record->earliest = std::numeric_limits<double>::infinity();
    if (record->pair.settings.earliestTimeOnly) takeEarliest(*record, contacts);
    if (settings.keepCandidates && record->hasCandidates())
      findCandidatesByBruteForce(record->meshes(), record->candidates);
    else
      record->candidates.clear();
    statistics.featurePairs += contacts.featurePairs;
    statistics.exactDecisions += contacts.exactDecisions + intersections.exactDecisions;
    statistics.validityPairs += intersections.validityPairs;
    statistics.milliseconds.narrowPhase += watch.lap();
    m_intersections = {&intersections};
    finish(*record, true, true, settings, statistics);
    statistics.milliseconds.order += watch.lap();
    record->statistics.milliseconds = statistics.milliseconds.total() - before.milliseconds.total();
    record->statistics.featurePairs = statistics.featurePairs - before.featurePairs;
    record->statistics.exactDecisions = statistics.exactDecisions - before.exactDecisions;
  }
}

}  // namespace palpate
