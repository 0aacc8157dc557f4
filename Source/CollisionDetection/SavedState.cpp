// Part of CollisionDetection/OctreeBasedCDImplementation.h: saved states.
#include "CollisionDetection/OctreeBasedCDImplementation.h"

#include "CollisionDetection/Planning.h"
#include "CollisionDetection/ProblemDescription.h"
#include "CollisionDetection/RestoredGeometry.h"
#include "Validity/TrustDescription.h"
#include "Tracking/TrackingDescription.h"
#include "Contact/ContactLists.h"
#include "Bodies/SavedRevisions.h"
#include "Fields/Contacts.h"
#include "Fields/Description.h"
#include "Fields/Settings.h"
#include "Fields/Statistics.h"
#include "Core/Archive.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <utility>

namespace palpate {

template <class File>
void Urgency::describe(File& file, PairRecord&, const auto&) {
  description::fieldOf(file, yields);
}

template <class File>
void TrustMemory::describe(File& file, PairRecord&, const auto& revisions) {
  m_committed.describe(file, revisions);
  trust = m_committed;
}

template <class File>
void TrackerMemory::describe(File& file, PairRecord& record, const auto& revisions) {
  description::optionalOf(file, tracker, [&](ContactTracker& each) {
    each.describe(file, revisions, CollisionData::Contents::of(record.last.data),
                  record.last.version.isValid());
  });
}

template <class File>
void SidesMemory::describe(File& file, PairRecord& record, const auto&) {
  description::optionalOf(file, sides,
                          [&](SideMemory& each) { each.describe(file, record.a == record.b); });
}

template <class File>
void ProxyMemory::describe(File& file, PairRecord&, const auto& revisions) {
  for (double* value : {&m_settings.reach, &m_settings.allowedError, &m_settings.normalCone})
    file.real(*value);
  description::derivedOf(file, m_version, [&](State& state) {
    revisions[1].elementsOf(file, state.elements);
    revisions[1].bodyOf(file, state.positions);
  });
}

namespace {

using namespace description;

constexpr std::string_view kStateTitle = "palpate-state";
constexpr std::uint32_t kStateVersion = 6;

using Contents = CollisionData::Contents;
using PairStates = std::array<SavedRevisions, 2>;

// Least bytes of items.
constexpr std::size_t kGeometryBytes = 64, kSavedPairBytes = 64;

template <class File>
void poseOf(File& file, Pose& pose) {
  for (double& value : pose.rotation.reshaped()) file.real(value);
  fieldOf(file, pose.translation);
}

template <class File>
void describeSets(File& file, StepSets& sets) {
  for (double* value : {&sets.first, &sets.whole}) file.real(*value);
  file.integer(sets.count);
  for (bool* flag : {&sets.isSet, &sets.isDetected, &sets.addUp}) fieldOf(file, *flag);
}

template <class File>
void describeGeometry(File& file, SavedGeometry& geometry) {
  CollisionProblem::Geometry& problem = geometry.problem;
  meshLines(file, problem, kVersion);
  itemsOf(file, problem.name, 1, [&](char& letter) { file.integer(letter); });
  optionalOf(file, geometry.field, [&](auto& bounds) { fieldOf(file, bounds); });
  valueOf(file, geometry.proxy);
  for (auto& pose : geometry.poses) optionalOf(file, pose, [&](Pose& p) { poseOf(file, p); });
  for (bool* flag : {&geometry.isDetectedOther, &geometry.isDetectedBefore, &geometry.isNew,
                     &geometry.bodyGiven, &geometry.transformGiven})
    fieldOf(file, *flag);
  describeSets(file, geometry.sets);
  valueOf(file, geometry.detected);
  valueOf(file, geometry.freeMotion);
}

/// Throws unless all ids are below the numbers of vertices and of elements of the two geometries.
void checkIds(const ArchiveReader& file, const Contents& c, const PairStates& states) {
  const auto& [a, b] = states;
  const std::size_t vertices = std::max(a.vertexCount, b.vertexCount),
                    elements = std::max(a.elementCount, b.elementCount);
  const auto need = [&](std::uint32_t id, std::size_t count) {
    file.need(id < count, "a contact names a vertex or element that does not exist");
  };
  const auto needVertices = [&](ContactKind kind, const std::array<std::uint32_t, 4>& ids) {
    for (std::size_t i = 0; i < 4; ++i) need(ids[i], states[sidesOf(kind)[i]].vertexCount);
  };
  std::size_t first = 0;
  auto row = c.step.endRows.begin();
  forEachMeshList(c, [&](auto kind, const auto& list) {
    for (const auto& contact : list) {
      needVertices(kind, verticesOf(contact));
      if constexpr (kind != ContactKind::EdgeEdge)
        need(contact.triangle, states[sidesOf(kind)[1]].elementCount);
    }
    first += list.size();
    for (; row != c.step.endRows.end() && row->contact < first; ++row)
      needVertices(kind, row->stencil.vertices);
  });
  for (const auto& x : c.intersectingTriangles)
    need(x.a, a.elementCount), need(x.b, b.elementCount);
  for (const auto& x : c.shape) {
    need(x.id, x.element == ShapeElement::Face ? elements : vertices);
    for (const std::uint32_t v : x.vertices) need(v, vertices);
  }
  const Validity& v = c.validity;
  for (const std::uint32_t id : v.untrustedVerticesA) need(id, a.vertexCount);
  for (const std::uint32_t id : v.untrustedVerticesB) need(id, b.vertexCount);
  for (const std::uint32_t id : v.degenerateTrianglesA) need(id, a.elementCount);
  for (const std::uint32_t id : v.degenerateTrianglesB) need(id, b.elementCount);
}

/// Lists beside those of contacts are empty or as long, and what has an order has it.
void checkLists(const ArchiveReader& file, const Contents& c) {
  const auto beside = [&](const auto& list, const auto& contacts) {
    file.need(list.empty() || list.size() == contacts.size(),
              "a list has not one item for each contact");
  };
  std::size_t between = 0;
  forEachContactList(c, [&](auto kind, const auto& list) {
    const auto& [tracked, tags, smooth] = c.columnsOf(kind);
    beside(tracked, list), beside(tags, list), beside(smooth, list);
    file.need(std::all_of(tracked.begin(), tracked.end(),
                          [&](const TrackedContact& t) { return t.key.kind == kind; }) &&
                  std::is_sorted(tracked.begin(), tracked.end(),
                                 [](const auto& l, const auto& r) { return l.key < r.key; }),
              "tracked contacts are not in order");
    if (kind <= ContactKind::EdgeEdge) between += list.size();
  });
  std::size_t next = 0;
  for (const auto* passages : {&c.crossings, &c.rememberedSides})
    for (const Crossing& passage : *passages)
      file.need(passage.kind <= ContactKind::EdgeEdge, "there is no such enumerator");
  for (const auto& row : c.step.endRows) {
    file.need(row.contact >= next && row.contact < between, "a row belongs to no contact");
    next = row.contact + std::size_t{1};
  }
  for (const auto* list :
       {&c.validity.outsideBand, &c.validity.nearThreshold, &c.validity.unreliableSign})
    for (const std::uint32_t index : *list)
      file.need(index < c.shape.size(), "a list names a contact that does not exist");
  const std::size_t size = contactCount(c);
  file.need(c.validity.atEnd <= size && c.validity.atImpact <= size - c.validity.atEnd,
            "a number of contacts is wrong");
}

template <class File>
void describeContents(File& file, Contents& c) {
  const auto values = [&](auto&... each) { (valueOf(file, each), ...); };
  forEachContactList(c, [&](ContactKind, auto& list) { values(list); });
  values(c.intersectingTriangles, c.earliestTimeOfImpact, c.errorBound, c.validity);
  for (auto& each : c.columns) values(each.tracked);
  values(c.ended, c.crossings, c.rememberedSides, c.trackedOfSecond, c.step.elementsOfSecond);
  itemsOf(file, c.step.endRows, 84, [&](Contents::Step::EndRow& row) {
    values(row.contact, row.stencil, row.normal, row.gap);
  });
  for (auto& each : c.columns) values(each.tags);
  forEachContactList(c, [&](ContactKind kind, auto&) {
    if (kind != ContactKind::ShapeShape) values(c.columnsOf(kind).smooth);
  });
  if constexpr (File::kReads) checkLists(file, c);
}

template <class File>
void describeState(File& file, PairState& state, const PairRecord& record,
                   const PairStates& states) {
  states[0].stateOf(file, state.a);
  states[1].stateOf(file, state.b);
  SavedRevisions::choose(file, state.settings, std::array{record.settingsRevision}, {});
  file.integer(state.sides);
}

/// All but the geometries, settings and predicate.
template <class File>
void describePair(File& file, PairRecord& record, const PairStates& states) {
  LastAnswer& last = record.last;
  for (bool* flag :
       {&last.isThere, &record.found.sidesAreKnown, &record.found.byBodies, &record.found.bySides})
    fieldOf(file, *flag);
  derivedOf(file, last.version,
            [&](PairState& state) { describeState(file, state, record, states); });
  for (std::size_t i = 0; i < 2; ++i) states[i].topologyOf(file, last.topologies[i]);
  bool hasContents = Contents::isIn(last.data);
  fieldOf(file, hasContents);
  if (hasContents) {
    Contents& contents = Contents::of(last.data);
    describeContents(file, contents);
    if constexpr (File::kReads) record.linkData();
    if constexpr (File::kReads)
      if (last.topologies == record.topologies()) checkIds(file, contents, states);
  }
  record.memory.forEach([&](auto& part) { part.describe(file, record, states); });
}

/// The pairs for whose states free motions hold. recordOf(pair): null if there is none any more;
/// free motions then hold for no state.
template <class File, class RecordOf, class StatesOf>
void describeKnown(File& file, std::vector<FreeMotionSearch::Known>& known, RecordOf&& recordOf,
                   StatesOf&& statesOf) {
  using Known = FreeMotionSearch::Known;
  constexpr GeometryId kNone{kNoElement};
  if (std::any_of(known.begin(), known.end(), [&](const Known& k) { return !recordOf(k.pair); }))
    known.assign(1, {{kNone, kNone, {}}, {}});
  itemsOf(file, known, 8, [&](Known& each) {
    for (GeometryId* id : {&each.pair.a, &each.pair.b}) file.integer(*id);
    if (const PairRecord* const record = recordOf(each.pair))
      describeState(file, each.state, *record, statesOf(*record));
  });
}

template <class File>
void describeUnfinished(File& file, FrameStatistics& statistics) {
  fieldOf(file, statistics.freeMotionUnfinished);
  valueOf(file, statistics.unfinishedPairs);
}

SavedRevisions revisionsOf(const Geometry& geometry) {
  const MeshTopology& topology = geometry.body.mesh.topology;
  return {geometry.body.state(),
          geometry.step.detected().state(),
          {},
          topology.vertexCount,
          topology.elements.size()};
}

/// Of a geometry that restore() will change so.
SavedRevisions revisionsOf(const RestoredGeometry& restored) {
  Geometry& geometry = *restored.geometry;
  SavedRevisions saved = revisionsOf(geometry);
  const BodyRevisions& revisions = restored.revisions;
  saved.now = {revisions.elements, revisions.filter, revisions.field, restored.step.before.state(),
               restored.step.now.state()};
  saved.detected = restored.step.detected.state();
  const Revision other = geometry.body.revisions.counter.next(),
                 otherEnd = geometry.step.nextRevision();
  saved.other = {{other, other}, other, other, {otherEnd, otherEnd}, {otherEnd, otherEnd}};
  return saved;
}

template <class T>
void copyTo(std::vector<T>& out, std::span<const T> from) {
  out.assign(from.begin(), from.end());
}

SavedGeometry savedOf(const Geometry& geometry) {
  const Body& body = geometry.body;
  SavedGeometry saved{.problem = problemOf(geometry)};
  CollisionProblem::Geometry& problem = saved.problem;
  const GeometryStep::State step = geometry.step.state(body.mesh);
  if (problem.field) saved.field = {problem.field->errorBound(), problem.field->band()};
  saved.proxy = problem.proxy;
  if (!body.shape && !body.isField()) {
    copyTo(problem.now, step.now.body());
    copyTo(problem.before, step.before.body());
    const bool isAtRest =
        std::equal(problem.now.begin(), problem.now.end(), body.mesh.rest.begin(),
                   body.mesh.rest.end(), [](const Eigen::Vector3d& l, const Eigen::Vector3d& r) {
                     return std::memcmp(l.data(), r.data(), sizeof l) == 0;
                   });
    if (!isAtRest) copyTo<Eigen::Vector3d>(problem.rest, body.mesh.rest);
    saved.isDetectedBefore = step.detected.hasSameBody(step.before);
    saved.isDetectedOther = !saved.isDetectedBefore && !step.detected.hasSameBody(step.now);
    if (saved.isDetectedOther) copyTo(saved.detected, step.detected.body());
  }
  for (std::size_t i = 0; const Positions* end : {&step.now, &step.before, &step.detected}) {
    if (end->isPlaced()) saved.poses[i] = end->transform();
    ++i;
  }
  saved.isNew = step.isNew;
  saved.bodyGiven = step.bodyGiven;
  saved.transformGiven = step.transformGiven;
  saved.sets = step.sets;
  saved.freeMotion.assign(geometry.freeMotion.begin(), geometry.freeMotion.end());
  return saved;
}

}  // namespace

std::vector<std::byte> OctreeBasedCD::Implementation::save() const {
  ArchiveWriter file(kStateTitle, kStateVersion, savedSize);
  file.integer(geometries.lastId());
  file.integer(geometries.stepNumber());
  file.integer(audit.frame);
  file.count(geometries.all().size());
  for (const auto& geometry : geometries.all()) {
    SavedGeometry saved = savedOf(*geometry);
    describeGeometry(file, saved);
  }
  file.count(pairs.records().size());
  for (const auto& record : pairs.records()) {
    CollisionProblem::Pair pair{static_cast<std::uint32_t>(record->pair.a),
                                static_cast<std::uint32_t>(record->pair.b), record->pair.settings,
                                record->pair.settings.method,
                                static_cast<bool>(record->filters.predicate)};
    pairLine(file, pair, kVersion);
    describePair(file, *record, {revisionsOf(*record->a), revisionsOf(*record->b)});
  }
  std::vector<FreeMotionSearch::Known> known = detection.freeMotions().known();
  describeKnown(
      file, known, [&](const CollisionPair& pair) { return pairs.find(pair.a, pair.b); },
      [](const PairRecord& record) -> PairStates {
        return {revisionsOf(*record.a), revisionsOf(*record.b)};
      });
  FrameStatistics unfinished;
  unfinished.unfinishedPairs = statistics.unfinishedPairs;
  unfinished.freeMotionUnfinished = statistics.freeMotionUnfinished;
  describeUnfinished(file, unfinished);
  savedSize = file.size() + file.size() / 16;
  return file.bytes();
}

namespace {

/// Reads a saved state, and changes nothing before it was found to be whole.
class StateReader {
 public:
  StateReader(std::span<const std::byte> state, GeometryTable& table, PairTable& formerPairs,
              const Threads& threads)
      : pairs(formerPairs.successor()),
        m_file(state, m_name, kStateTitle, kStateVersion),
        m_table(table),
        m_formerPairs(formerPairs),
        m_threads(threads) {
    m_file.integer(lastId);
    m_file.integer(stepNumber);
    m_file.integer(auditFrame);
    readGeometries();
    readPairs();
    describeKnown(
        m_file, known, [&](const CollisionPair& pair) { return pairs.find(pair.a, pair.b); },
        [&](const PairRecord& record) { return m_states[record.index]; });
    describeUnfinished(m_file, statistics);
    m_file.expectEnd();
  }

  std::uint32_t lastId = 0;
  std::uint64_t stepNumber = 0, auditFrame = 0;
  std::vector<RestoredGeometry> geometries;  ///< ascending ids
  PairTable pairs;
  std::vector<std::pair<PairRecord*, PairRecord*>> successors;  ///< a former pair, and its own
  std::vector<FreeMotionSearch::Known> known;
  FrameStatistics statistics;

 private:
  /// What the calls that add geometries and pairs refuse is refused here, too.
  template <class F>
  decltype(auto) checked(F&& call) {
    try {
      return call();
    } catch (const Error& error) {
      if (error.code() == ErrorCode::MemoryLimit || error.code() == ErrorCode::NotAvailable ||
          error.code() == ErrorCode::File)
        throw;
      m_file.fail(error.what());
    }
  }
  void readGeometries() {
    std::size_t count = 0;
    m_file.count(count, kGeometryBytes);
    for (std::size_t i = 0; i < count; ++i) {
      SavedGeometry saved;
      describeGeometry(m_file, saved);
      const GeometryId id = saved.problem.id;
      m_file.need(static_cast<std::uint32_t>(id) < lastId &&
                      (geometries.empty() || geometries.back().geometry->body.id < id),
                  "the id of a geometry is out of order");
      checked([&] { geometries.emplace_back(saved, m_table, m_threads); });
    }
  }
  const RestoredGeometry& find(std::uint32_t id) {
    const auto found = std::lower_bound(
        geometries.begin(), geometries.end(), GeometryId{id},
        [](const auto& restored, GeometryId i) { return restored.geometry->body.id < i; });
    m_file.need(found != geometries.end() && found->geometry->body.id == GeometryId{id},
                "a pair names a geometry that does not exist");
    return *found;
  }
  void readPairs() {
    std::size_t count = 0;
    m_file.count(count, kSavedPairBytes);
    for (std::size_t i = 0; i < count; ++i) readPair();
  }
  void readPair() {
    CollisionProblem::Pair pair{};
    pairLine(m_file, pair, kVersion);
    const auto &a = find(pair.a), &b = find(pair.b);
    PairRecord* const same = m_formerPairs.find(GeometryId{pair.a}, GeometryId{pair.b});
    PairRecord* const former = a.made || b.made ? nullptr : same;
    PairRecord& record = checked([&]() -> PairRecord& {
      return pairs.add(*a.geometry, *b.geometry, pair.settings, a.step.now.isPlaced(), former,
                       m_threads);
    });
    if (pair.predicate) {
      if (!same || !same->filters.predicate)
        throw Error(ErrorCode::NotAvailable,
                    m_name + " has no contact predicates: " + nameOf(*record.a, *record.b) +
                        " must have the one that it had",
                    record.pair.a);
      checked([&] {
        pairs.setPredicate(m_table, record.pair.a, record.pair.b, same->filters.predicate);
      });
    }
    m_states.push_back({revisionsOf(a), revisionsOf(b)});
    describePair(m_file, record, m_states.back());
    if (former) successors.emplace_back(former, &record);
  }

  const std::string m_name = "the saved state";
  ArchiveReader m_file;
  GeometryTable& m_table;
  PairTable& m_formerPairs;
  const Threads& m_threads;
  std::vector<PairStates> m_states;
};

}  // namespace

void OctreeBasedCD::Implementation::restore(std::span<const std::byte> state) {
  StateReader read(state, geometries, pairs, threads);
  FrameStatistics& next = read.statistics;
  geometries.prepareToRestore(read.geometries.size());
  octrees.reserve(read.geometries.size());
  const bool anyMade = std::any_of(read.geometries.begin(), read.geometries.end(),
                                   [](const auto& each) { return bool{each.made}; });
  auto pool = anyMade ? latestSnapshot.newPool(budget) : nullptr;

  // Nothing below throws.
  for (const auto& [former, record] : read.successors) record->takeOver(*former);
  std::swap(pairs, read.pairs);
  geometries.restore(read.geometries, read.lastId, read.stepNumber);
  if (pool) latestSnapshot.setPool(std::move(pool));
  for (const auto& record : pairs.records()) record->ask(planWithoutMotion(*record));
  detection.countContacts(next);
  detection.freeMotions().restore(read.known);
  audit.failures.clear();
  audit.frame = read.auditFrame;
  octrees.restart();
  setStatistics(std::move(next));
}

}  // namespace palpate
