#include "CollisionDetection/PairTable.h"

#include "Search/PairResults.h"
#include "Contact/SmoothNormals.h"
#include "CollisionDetection/Planning.h"
#include "CollisionDetection/SettingsCheck.h"
#include "Contact/ContactLists.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

namespace palpate {

std::string nameOf(const GeometryLabel& a, const GeometryLabel& b) {
  return "pair (" + a.number() + ", " + b.number() + ")";
}

void PairRecord::ask(const PairPlan& plan) {
  const SurfaceProxy* const proxy =
      plan.kind == PairKind::AttachedProxy ? b->proxy.get() : memory.proxy.proxy.get();
  question.emplace(
      Question{pair, a->body, b->body, a->inStep(), b->inStep(), filters, plan, proxy});
}

void PairRecord::finish(const Threads& threads) {
  memory.sides.follow(*question, found);
  if (pair.settings.smoothNormals)
    findSmoothNormals(meshes(), question->plan.kind == PairKind::MeshAndShape, threads,
                      found.contents());
  else
    found.contents().drop(&CollisionData::Contents::Columns::smooth);
}

/// Of a shape or of a field that is a geometry. Bodies that a field or proxy stands for have none.
static std::uint32_t tagOfWhole(const Body& body) {
  return (body.shape || body.isField()) && !body.mesh.tags.empty() ? body.mesh.tags.front() : 0;
}

void PairRecord::addTags() {
  if (isCurrent()) return;
  const TriangleMesh &ofA = a->body.mesh, &ofB = b->body.mesh;
  CollisionData::Contents& contents = found.contents();
  for (CollisionData::Contents::Columns& each : contents.columns) each.tags.clear();
  if (ofA.tags.empty() && ofB.tags.empty()) return;
  const auto tagsOf = [&](auto kind, const auto& c) -> ContactTags {
    if constexpr (kind == ContactKind::VertexTriangle)
      return {ofA.tagOfVertex(c.vertex), ofB.tag(c.triangle)};
    else if constexpr (kind == ContactKind::TriangleVertex)
      return {ofA.tag(c.triangle), ofB.tagOfVertex(c.vertex)};
    else if constexpr (kind == ContactKind::EdgeEdge)
      return {ofA.tagOfEdge(c.edgeA), ofB.tagOfEdge(c.edgeB)};
    else if constexpr (kind == ContactKind::Shape)
      return tagsOfShape(c);
    else
      return {tagOfWhole(a->body), tagOfWhole(b->body)};
  };
  forEachContactList(contents, [&](auto kind, const auto& list) {
    auto& tags = contents.columnsOf(kind).tags;
    tags.reserve(list.size());
    for (const auto& contact : list) tags.push_back(tagsOf(kind, contact));
  });
}

ContactTags PairRecord::tagsOfShape(const ShapeContact& c) const {
  const TriangleMesh& elements = question->mesh().mesh;
  const bool ofSecond = &elements == &b->body.mesh;
  const std::uint32_t tag = c.element == ShapeElement::Vertex ? elements.tagOfVertex(c.id)
                            : c.element == ShapeElement::Edge
                                ? elements.tagOfEdge({c.vertices[0], c.vertices[1]})
                                : elements.tag(c.id);
  const std::uint32_t tagOfBody = tagOfWhole((ofSecond ? *a : *b).body);
  return ofSecond ? ContactTags{tagOfBody, tag} : ContactTags{tag, tagOfBody};
}

void PairRecord::setSides(std::uint64_t step, std::span<const Crossing> given) {
  const std::string pairName = nameOf(*a, *b);
  if (!pair.settings.rememberSides)
    throw Error(ErrorCode::NotAvailable, pairName + ": PairSettings::rememberSides is not set",
                pair.a);
  std::vector<SideMemory::Side> all;
  for (const Crossing& crossing : given) {
    const auto& ids = crossing.ids;
    const std::size_t number = all.size();
    const auto need = [&](bool good, const Geometry& geometry, const std::string& feature) {
      if (!good)
        throw Error(ErrorCode::IndexOutOfRange,
                    pairName + ": remembered side " + std::to_string(number) + " names " + feature +
                        ", which " + nameOf(geometry) + " does not have",
                    geometry.body.id);
    };
    const auto vertex = [&](const Geometry& geometry, std::uint32_t id) {
      need(id < geometry.body.mesh.topology.vertexCount, geometry, "vertex " + std::to_string(id));
    };
    const auto triangle = [&](const Geometry& geometry, std::uint32_t id) {
      const MeshTopology& topology = geometry.body.mesh.topology;
      need(topology.hasFaces() && id < topology.elements.size() && !topology.isRemoved(id),
           geometry, "triangle " + std::to_string(id));
      return topology.elements[id];
    };
    Crossing passage = crossing;
    passage.time = 0.0;
    // Puts the lower vertex first.
    const auto edge = [&](const Geometry& geometry, std::uint32_t& p, std::uint32_t& q) {
      const Segment sorted{std::min(p, q), std::max(p, q)};
      need(geometry.body.mesh.topology.edgeOf(sorted) != kNoEdge, geometry,
           "edge " + std::to_string(p) + " " + std::to_string(q));
      if (p > q) passage.forward = !passage.forward;
      std::tie(p, q) = std::tie(sorted[0], sorted[1]);
    };
    Triangle corners{};
    if (crossing.kind == ContactKind::VertexTriangle) {
      vertex(*a, ids[0]);
      corners = triangle(*b, ids[1]);
    } else if (crossing.kind == ContactKind::TriangleVertex && a != b) {
      corners = triangle(*a, ids[0]);
      vertex(*b, ids[1]);
    } else if (crossing.kind == ContactKind::EdgeEdge) {
      auto& [p, q, r, s] = passage.ids;
      edge(*a, p, q);
      edge(*b, r, s);
      // Of a mesh with itself, the lower edge is first. The passage has the same sense from both.
      if (a == b && std::tie(r, s) < std::tie(p, q)) std::swap(p, r), std::swap(q, s);
    } else {
      throw Error(ErrorCode::IndexOutOfRange,
                  pairName + ": remembered side " + std::to_string(number) + " is of the kind " +
                      toString(crossing.kind) + ", which the pair does not have",
                  pair.a);
    }
    all.push_back({passage, corners});
  }
  memory.sides.startStep(momentIn(step));
  memory.sides.sides->set(step, all);
}

void PairRecord::commit(std::uint64_t step) noexcept {
  PALPATE_ASSERT(found.data.validity().atImpact + found.data.validity().atEnd ==
                 contactCount(found.contents()));
  std::swap(last.data, found.data);
  CollisionData::Contents& contents = CollisionData::Contents::of(last.data);
  contents.step.elementsOfSecond = !contents.shape.empty() && &question->mesh() == &b->body;
  linkData();
  last.isThere = true;
  last.topologies = topologies();
  const PairMoment moment = momentIn(step);
  memory.forEach([&](auto& part) { part.commit(moment); });
  if (!collides()) memory.forEach([](auto& part) { part.forget(); });
  last.version.commit(state());
}

void PairRecord::linkData() noexcept {
  if (!CollisionData::Contents::isIn(last.data)) return;
  CollisionData::Contents& contents = CollisionData::Contents::of(last.data);
  contents.step.record = this;
  contents.step.radii = a->body.mesh.largestRadius + b->body.mesh.largestRadius;
  contents.step.timeTolerance = pair.settings.continuous.timeTolerance;
}

void PairRecord::keepLastAnswer(std::uint64_t step) {
  CollisionData::Contents& answer = CollisionData::Contents::of(last.data);
  PairMoment moment = momentIn(step);
  moment.isOutdated = last.isThere && last.topologies != topologies();
  memory.forEach([&](auto& part) { part.skip(moment); });
  if (moment.isOutdated || !last.isThere) {
    const std::uint32_t age = answer.validity.age;
    answer = {};
    answer.validity.method = question->plan.method;
    answer.validity.age = age;
  }
  answer.crossings.clear();
  Validity& validity = answer.validity;
  validity.trusted = validity.startedApart = false;
  validity.sideMayBeWrong = true;
  validity.reason = MethodReason::OutOfTime;
  ++validity.age;
  last.isThere = true;
  last.topologies = topologies();
  last.version.invalidate();
}

void PairRecord::releaseMemory(bool all) {
  found.data = {};
  found.fieldScratch.reset();
  CollisionData::Contents& contents = CollisionData::Contents::of(last.data);
  contents.releaseSpare();
  memory.forEach([&](auto& part) { part.release(all); });
}

void PairRecord::takeOver(PairRecord& former) noexcept {
  PALPATE_ASSERT(a == former.a && b == former.b);
  if (pair.settings.restDistance == former.pair.settings.restDistance)
    filters.nearAtRest = std::move(former.filters.nearAtRest);
  found.fieldScratch = std::move(former.found.fieldScratch);
  memory.kept.takeOver(former.memory.kept);
  memory.proxy.takeOver(former.memory.proxy);
}

namespace {

std::uint64_t keyOf(GeometryId a, GeometryId b) {
  const auto first = static_cast<std::uint64_t>(a), second = static_cast<std::uint64_t>(b);
  return std::min(first, second) << 32 | std::max(first, second);
}

/// Throws unless a pair that is answered so can have a contact predicate.
void checkPredicate(const PairRecord& record, const SupportedPairs& support) {
  const PairKind kind = support.kind;
  if (kind == PairKind::Meshes) return;
  throw Error(ErrorCode::UnsupportedMethod,
              nameOf(*record.a, *record.b) +
                  (kind == PairKind::Proxy   ? ": contact predicates are not for Method::Proxy"
                   : kind == PairKind::Field ? ": Method::DistanceField does not use contact "
                                               "predicates"
                                             : ": contact predicates are for pairs of meshes, and "
                                               "one of the two is a shape"),
              record.a->body.id);
}

}  // namespace

bool PairTable::needsNearAtRest(GeometryId id) const {
  const auto found = m_byIds.find(keyOf(id, id));
  return found != m_byIds.end() && found->second->pair.settings.restDistance > 0.0;
}

IndexLists PairTable::nearAtRest(GeometryId id, const MeshTopology& topology,
                                 std::span<const Eigen::Vector3d> rest,
                                 const Threads& threads) const {
  return verticesWithin(topology, rest, m_byIds.at(keyOf(id, id))->pair.settings.restDistance,
                        threads);
}

void PairTable::setNearAtRest(GeometryId id, IndexLists& lists) noexcept {
  m_byIds.find(keyOf(id, id))->second->filters.nearAtRest = std::move(lists);
}

ChangedLists PairTable::nearAtRest(GeometryId id, const EdgeChange& change,
                                   std::span<const Eigen::Vector3d> rest, const Threads& threads) {
  PairRecord& record = *m_byIds.at(keyOf(id, id));
  IndexLists& now = record.filters.nearAtRest;
  ChangedLists changed = verticesWithinAfterCut(record.a->body.mesh.topology, change, rest,
                                                record.pair.settings.restDistance, now, threads);
  if (!changed.areAll) now.reserveMore(rest.size() - now.size(), changed.lists.itemCount());
  return changed;
}

void PairTable::setNearAtRest(GeometryId id, ChangedLists& changed) noexcept {
  replaceLists(m_byIds.find(keyOf(id, id))->second->filters.nearAtRest, changed);
}

void PairTable::add(GeometryTable& geometries, GeometryId a, GeometryId b,
                    const PairSettings& settings, const Threads& threads) {
  Geometry& first = geometries.at(a);
  add(first, geometries.at(b), settings, first.body.isPlaced(), nullptr, threads);
}

PairRecord& PairTable::add(Geometry& first, Geometry& second, const PairSettings& settings,
                           bool isPlaced, const PairRecord* former, const Threads& threads) {
  const GeometryId a = first.body.id, b = second.body.id;
  const SupportedPairs& support = checkPair(first, second, settings, isPlaced);
  if (m_byIds.contains(keyOf(a, b)))
    throw Error(ErrorCode::DuplicatePair,
                nameOf(first, second) + " was added before; setPairSettings() changes its settings",
                a);
  auto record = std::make_unique<PairRecord>();
  record->pair = {a, b, settings};
  record->a = &first;
  record->b = &second;
  record->support = &support;
  record->ask(planWithoutMotion(*record));
  record->settingsRevision = m_revisions.next();
  const bool takesOver = former && former->pair.settings.restDistance == settings.restDistance;
  if (settings.restDistance > 0.0 && !takesOver)
    record->filters.nearAtRest = verticesWithin(first.body.mesh.topology, first.body.mesh.rest,
                                                settings.restDistance, threads);
  record->index = m_records.size();
  const auto reserve = [](auto& vector) {
    if (vector.size() == vector.capacity()) vector.reserve(2 * vector.size() + 1);
  };
  reserve(m_records);
  reserve(m_pairs);
  m_byIds.emplace(keyOf(a, b), record.get());
  // Nothing below throws.
  m_pairs.push_back(record->pair);
  m_records.push_back(std::move(record));
  return *m_records.back();
}

PairRecord* PairTable::find(GeometryId a, GeometryId b) const {
  const auto found = m_byIds.find(keyOf(a, b));
  return found != m_byIds.end() && found->second->pair.a == a ? found->second : nullptr;
}

PairTable PairTable::successor() const {
  PairTable next;
  next.m_revisions = m_revisions;
  return next;
}

PairRecord& PairTable::at(const GeometryTable& geometries, GeometryId a, GeometryId b) const {
  const auto found = m_byIds.find(keyOf(a, b));
  if (found != m_byIds.end()) return *found->second;
  throw Error(ErrorCode::UnknownPair,
              nameOf(geometries.at(a), geometries.at(b)) + " was never added, or was removed", a);
}

PairRecord& PairTable::inOrder(const GeometryTable& geometries, GeometryId a, GeometryId b) const {
  PairRecord& record = at(geometries, a, b);
  if (record.pair.a != a)
    throw Error(ErrorCode::UnknownPair,
                nameOf(*record.b, *record.a) + " was added as " + nameOf(*record.a, *record.b) +
                    "; its results are in that order",
                a);
  return record;
}

void PairTable::set(GeometryTable& geometries, GeometryId a, GeometryId b,
                    const PairSettings& settings, const Threads& threads) {
  PairRecord& record = at(geometries, a, b);
  const SupportedPairs& support = checkPair(*record.a, *record.b, settings);
  if (record.filters.predicate) checkPredicate(record, support);
  if (record.pair.settings.restDistance != settings.restDistance && settings.restDistance > 0.0)
    record.filters.nearAtRest = verticesWithin(
        record.a->body.mesh.topology, record.a->body.mesh.rest, settings.restDistance, threads);
  // Nothing below throws.
  if (settings.method != Method::Proxy) record.memory.proxy.forgetBody();
  PALPATE_ASSERT(m_records[record.index].get() == &record);
  record.pair.settings = m_pairs[record.index].settings = settings;
  record.support = &support;
  record.ask(planWithoutMotion(record));
  record.settingsRevision = m_revisions.next();
}

void PairTable::checkRigid(const Geometry& geometry) const {
  if (m_byIds.contains(keyOf(geometry.body.id, geometry.body.id)))
    throw Error(ErrorCode::UnsupportedMethod, nameOf(geometry, geometry) + ": " + kRigidWithItself,
                geometry.body.id);
}

void PairTable::checkFieldChange(GeometryId geometry, const DistanceField* field) const {
  for (const auto& record : m_records) {
    const auto& [a, b, settings] = record->pair;
    if (settings.method != Method::DistanceField || (a != geometry && b != geometry)) continue;
    if (record->a->body.isField() || record->b->body.isField()) continue;
    const DistanceField* const ofA = a == geometry ? field : record->a->body.field.get();
    const DistanceField* const ofB = b == geometry ? field : record->b->body.field.get();
    checkField(*record->a, *record->b, ofB ? ofB : ofA, settings,
               (ofB ? record->a : record->b)->body.mesh.largestRadius, geometry);
  }
}

void PairTable::setPredicate(const GeometryTable& geometries, GeometryId a, GeometryId b,
                             ContactPredicate predicate) {
  PairRecord& record = inOrder(geometries, a, b);
  if (predicate) checkPredicate(record, *record.support);
  record.filters.predicate = std::move(predicate);
  record.settingsRevision = m_revisions.next();
}

template <class Predicate>
void PairTable::removeIf(Predicate&& isRemoved) noexcept {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < m_records.size(); ++i) {
    if (isRemoved(*m_records[i])) {
      m_byIds.erase(keyOf(m_pairs[i].a, m_pairs[i].b));
      continue;
    }
    m_pairs[kept] = m_pairs[i];
    if (kept != i) m_records[kept] = std::move(m_records[i]);
    m_records[kept]->index = kept;
    ++kept;
  }
  m_pairs.resize(kept);
  m_records.resize(kept);
  PALPATE_ASSERT(m_byIds.size() == kept);
}

void PairTable::remove(GeometryTable& geometries, GeometryId a, GeometryId b) {
  const PairRecord* record = &at(geometries, a, b);
  removeIf([=](const PairRecord& other) { return &other == record; });
}

void PairTable::removeAllOf(GeometryId geometry) noexcept {
  removeIf([=](const PairRecord& other) {
    return other.pair.a == geometry || other.pair.b == geometry;
  });
}

}  // namespace palpate
