#include "CollisionDetection/PairTable.h"

#include "Core/Text.h"
#include "Mesh/RestDistance.h"
#include "Math/Range.h"
#include "Math/Tolerances.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace palpate {

std::string nameOf(const GeometryLabel& a, const GeometryLabel& b) {
  return "pair (" + a.number() + ", " + b.number() + ")";
}

bool PairRecord::mayUseProxy() const {
  const PairSettings& settings = pair.settings;
  const double reach = settings.thickness + a->mesh.largestRadius;
  return settings.method == Method::Auto && a->mesh.topology.type == GeometryType::Points &&
         b->proxy && b->proxySettings.errorBound <= settings.allowedError && !predicate &&
         reach > 0.0 && reach <= b->proxySettings.reach;
}

FieldContacts PairRecord::fieldContacts(const PlacedField& placed) {
  if (!fieldScratch) fieldScratch = std::make_unique<FieldScratch>();
  const MeshPair both = meshes();
  return {both.mesh(), placed, both.settings.contacts, both.thicknessAtEnd(), *fieldScratch};
}

void PairRecord::useField(Engine engine) {
  if (predicate || plan.byProxy || !collides()) return;
  const std::optional<PairPlan> byField =
      planByField(pair.settings, a->inStep(), b->inStep(), plan);
  if (!byField) return;
  const PairPlan exact = std::exchange(plan, *byField);
  if (plan.motion == 0.0) return;
  const auto isProven = [&] {
    if (hasData && dataVersion.isCurrent(state()))  // decided before
      return data.validity().reason == MethodReason::AllowedError;
    const PlacedField placed = placedField();
    FieldContacts contacts = fieldContacts(placed);
    return engine == Engine::BruteForce ? contacts.isFurtherByBruteForce(plan.motion)
                                        : contacts.isFurther(mesh(), plan.motion);
  };
  if (!isProven()) plan = exact;
}

bool PairRecord::updateProxy(std::span<const std::unique_ptr<PairRecord>> others,
                             const Threads& threads) {
  const DerivedFrom<3>::Sources sources{b->revisions.topology, b->revisions.enabled,
                                        b->mesh.now.bodyRevision()};
  const ProxySettings wanted{pair.settings.thickness + a->mesh.largestRadius,
                             pair.settings.allowedError, pair.settings.widestNormalCone};
  const auto isCurrent = [&](const PairRecord& record) {
    return record.proxy && record.b == b && record.proxySettings == wanted &&
           record.proxyVersion.isCurrent(sources);
  };
  if (isCurrent(*this)) return false;
  if (proxyVersion.isValid() && proxyVersion.sources()[0] == sources[0] &&
      proxyVersion.sources()[2] != sources[2])
    throw Error(ErrorCode::UnsupportedMethod,
                nameOf(*a, *b) + ": Method::Proxy is for a rigid body, and the positions of " +
                    nameOf(*b) +
                    " were changed; move it by setTransform(), or set its elements again",
                b->id);
  const auto shared = std::find_if(others.begin(), others.end(),
                                   [&](const auto& record) { return isCurrent(*record); });
  const bool builds = shared == others.end();
  proxy =
      builds ? std::make_shared<const SurfaceProxy>(b->mesh, wanted, threads) : (*shared)->proxy;
  proxySettings = wanted;
  proxyVersion.commit(sources);
  return builds;
}

void PairRecord::commit() noexcept {
  std::swap(data, next);
  hasData = true;
  dataVersion.commit(state());
}

void PairRecord::releaseMemory() {
  next = {};
  fieldScratch.reset();
  if (!candidatesVersion.isValid()) candidates.clear();
  releaseSpare(candidates);
  CollisionData::Contents& kept = data.contents();
  forEachTimed(kept, [](auto& list) { releaseSpare(list); });
  releaseSpare(kept.intersectingTriangles);
}

void PairRecord::commitEmpty(bool keepsCandidates) noexcept {
  next = {};
  commit();
  trust.forget();
  candidates.clear();
  if (keepsCandidates) candidatesVersion.commit(state());
}

void PairRecord::commitNoCandidates() noexcept {
  candidates.clear();
  candidatesVersion.commit(state());
}

namespace {

std::uint64_t keyOf(GeometryId a, GeometryId b) {
  const auto first = static_cast<std::uint64_t>(a), second = static_cast<std::uint64_t>(b);
  return std::min(first, second) << 32 | std::max(first, second);
}

constexpr const char* kRigidWithItself =
    "a geometry that setTransform() moves cannot be tested against itself";

constexpr const char* kNoPredicate = "Method::DistanceField does not use contact predicates";

[[noreturn]] void throwPredicate(const PairRecord& record) {
  throw Error(ErrorCode::UnsupportedMethod,
              nameOf(*record.a, *record.b) + ": contact predicates are not for Method::Proxy",
              record.a->id);
}

/// What a pair by Method::DistanceField lacks; empty if nothing. field: of its body, or null.
std::string faultOf(const DistanceField* field, const PairSettings& settings, double radius,
                    ErrorCode& code) {
  code = ErrorCode::UnsupportedMethod;
  if (!field)
    return "Method::DistanceField needs a field: addDistanceField() or attachDistanceField()";
  code = ErrorCode::InvalidSettings;
  if (isWithinBand(*field, settings.thickness, radius)) return "";
  return "the thickness and the largest radius are " + textOf(settings.thickness + radius) +
         "; Method::DistanceField needs less than the band less the error bound, which is " +
         textOf(field->band() - field->errorBound());
}

/// Checks the settings of a pair. Throws an Error that describes the fault.
class Check {
 public:
  Check(const Geometry& a, const Geometry& b, const PairSettings& settings)
      : m_id(a.id), m_name(nameOf(a, b)), m_method(settings.method) {
    range(a.mesh, b.mesh, settings);
    types(a, b);
    if (m_method == Method::DistanceField || a.isField() || b.isField()) {
      field(a, b, settings);
      return;
    }
    const bool proximity = hasProximity(a.inStep(), b.inStep(), settings.thickness);
    need((m_method != Method::Proximity && m_method != Method::Proxy) || proximity,
         std::string("Method::") + toString(m_method) + " needs a positive thickness; it is 0");
    need(m_method != Method::Auto || proximity || hasContinuous(a.inStep(), b.inStep()),
         "Method::Auto needs a positive thickness if radii differ between vertices; it is 0");
  }

 private:
  void need(bool good, const std::string& reason, ErrorCode code = ErrorCode::InvalidSettings) {
    if (!good) throw Error(code, m_name + ": " + reason, m_id);
  }
  void support(bool supported, const std::string& reason) {
    need(supported, reason, ErrorCode::UnsupportedMethod);
  }
  void finite(const char* which, double value, bool good, const char* rule) {
    need(good && value <= kLargestMeasure,
         std::string(which) + " is " + textOf(value) + "; it must be " + rule);
  }

  void range(const TriangleMesh& a, const TriangleMesh& b, const PairSettings& settings) {
    const auto [method, thickness, contacts, motionTolerance, rest, timeTolerance, earliestTimeOnly,
                allowedError, normalCone] = settings;
    finite("restDistance", rest, rest >= 0.0, kLengthRule);
    need(rest == 0.0 || (&a == &b && a.topology.type != GeometryType::Points),
         "restDistance is for a triangle or line mesh with itself");
    finite("thickness", thickness, thickness >= 0.0, kLengthRule);
    finite("motionTolerance", motionTolerance, true,
           "at most 1e+300, or negative for half the thickness");
    finite("timeTolerance", timeTolerance,
           timeTolerance >= kSmallestTimeTolerance && timeTolerance <= 1.0, "from 2^-50 to 1");
    need(contacts >= Contacts::Distinct && contacts <= Contacts::All,
         "contacts must be Distinct or All");
    need(!earliestTimeOnly || method == Method::Continuous,
         "earliestTimeOnly is for Method::Continuous only");
    need(method >= Method::Auto && method <= Method::Proxy,
         "method is " + std::to_string(static_cast<int>(method)) +
             "; it must be Auto, Intersection, Proximity, Continuous, DistanceField or Proxy");
    finite("allowedError", allowedError, allowedError >= 0.0, kLengthRule);
    need(method != Method::Proxy || allowedError > 0.0,
         "Method::Proxy needs a positive allowedError; it is 0");
    need(method == Method::Auto || method == Method::Proxy || allowedError == 0.0,
         "allowedError is " + textOf(allowedError) +
             "; only Auto and Proxy use it, so it must be 0 for Method::" + toString(method));
    need(normalCone > 0.0 && normalCone <= kWidestNormalCone,
         "widestNormalCone is " + textOf(normalCone) + "; it must be above 0 and at most 1.5");
    need(method == Method::Auto || motionTolerance < 0.0,
         "motionTolerance is " + textOf(motionTolerance) +
             "; only Method::Auto uses it, so it must be negative for Method::" + toString(method));
  }

  void field(const Geometry& a, const Geometry& b, const PairSettings& settings) {
    support(m_method == Method::DistanceField || m_method == Method::Auto,
            std::string("a distance field accepts only Auto and Method::DistanceField, not ") +
                toString(m_method));
    support(&a != &b, "Method::DistanceField is not for a geometry with itself");
    support(!a.isField() || !b.isField(), "a pair of two distance fields is not supported");
    support(!a.shape && !b.shape, "a distance field with a shape is not supported");
    const Geometry& body = bodyWithField(a, b);
    ErrorCode code;
    const std::string fault =
        faultOf(body.field.get(), settings, (&body == &a ? b : a).mesh.largestRadius, code);
    need(fault.empty(), fault, code);
  }

  void types(const Geometry& a, const Geometry& b) {
    const auto isPlane = [](const Geometry& each) {
      return each.shape && each.shape->now.isPlane();
    };
    const MeshTopology &ofA = a.mesh.topology, &ofB = b.mesh.topology;
    const bool continuous = m_method == Method::Continuous, self = &a == &b,
               meshes = ofA.hasFaces() && ofB.hasFaces();
    support(!self || a.shape || !a.isPlaced(), kRigidWithItself);
    support(!self || !a.shape, "a shape cannot be tested against itself");
    support(!isPlane(a) || !isPlane(b), "a pair of two planes is not supported");
    if (a.shape && b.shape && a.shape->now.needsMinkowskiDifference(b.shape->now)) {
      const double p = a.shape->now.size(), q = b.shape->now.size();
      support(std::max(p, q) <= kMaxSizeRatio * std::min(p, q),
              "the sizes of the shapes are " + textOf(p) + " and " + textOf(q) +
                  "; their ratio must be at most 2^40");
    }
    support(meshes || m_method != Method::Intersection,
            "Method::Intersection is for two triangle meshes, not for " + nameOf(ofA.type) +
                " and " + nameOf(ofB.type) + "; use Auto, Proximity or Continuous");
    support(m_method != Method::Proxy ||
                (ofA.type == GeometryType::Points && ofB.type == GeometryType::Triangles),
            "Method::Proxy is for a point set and a triangle mesh in this order, not for " +
                nameOf(ofA.type) + " and " + nameOf(ofB.type));
    support(!continuous || hasContinuous(a.inStep(), b.inStep()),
            "Method::Continuous needs one radius for all vertices; Proximity and Auto do not");
  }

  GeometryId m_id;
  std::string m_name;
  Method m_method;
};

}  // namespace

IndexLists PairTable::nearAtRest(GeometryId id, const MeshTopology& topology,
                                 std::span<const Eigen::Vector3d> rest,
                                 const Threads& threads) const {
  const auto found = m_byIds.find(keyOf(id, id));
  const double distance = found == m_byIds.end() ? 0.0 : found->second->pair.settings.restDistance;
  return distance > 0.0 ? verticesWithin(topology, rest, distance, threads) : IndexLists();
}

void PairTable::setNearAtRest(GeometryId id, IndexLists lists) noexcept {
  if (const auto found = m_byIds.find(keyOf(id, id)); found != m_byIds.end())
    found->second->nearAtRest = std::move(lists);
}

void PairTable::add(GeometryTable& geometries, GeometryId a, GeometryId b,
                    const PairSettings& settings, const Threads& threads) {
  Geometry& first = geometries.at(a);
  Geometry& second = geometries.at(b);
  Check(first, second, settings);
  if (m_byIds.contains(keyOf(a, b)))
    throw Error(ErrorCode::DuplicatePair,
                nameOf(first, second) + " was added before; setPairSettings() changes its settings",
                a);
  auto record = std::make_unique<PairRecord>();
  record->pair = {a, b, settings};
  record->a = &first;
  record->b = &second;
  record->plan = planOf(settings, first.inStep(), second.inStep());
  record->settingsRevision = m_revisions.next();
  if (settings.restDistance > 0.0)
    record->nearAtRest =
        verticesWithin(first.mesh.topology, first.mesh.rest, settings.restDistance, threads);
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
  Check(*record.a, *record.b, settings);
  if (record.predicate && settings.method == Method::DistanceField)
    throw Error(ErrorCode::UnsupportedMethod, nameOf(*record.a, *record.b) + ": " + kNoPredicate,
                a);
  if (settings.method == Method::Proxy && record.predicate) throwPredicate(record);
  if (record.pair.settings.restDistance != settings.restDistance && settings.restDistance > 0.0)
    record.nearAtRest = verticesWithin(record.a->mesh.topology, record.a->mesh.rest,
                                       settings.restDistance, threads);
  // Nothing below throws.
  if (settings.method != Method::Proxy) {
    record.proxy.reset();
    record.proxyVersion.invalidate();
  }
  record.pair.settings = m_pairs[record.index].settings = settings;
  record.plan = planOf(settings, record.a->inStep(), record.b->inStep());
  record.settingsRevision = m_revisions.next();
  record.candidatesVersion.invalidate();
}

void PairTable::checkRigid(const Geometry& geometry) const {
  if (m_byIds.contains(keyOf(geometry.id, geometry.id)))
    throw Error(ErrorCode::UnsupportedMethod, nameOf(geometry, geometry) + ": " + kRigidWithItself,
                geometry.id);
}

void PairTable::checkFieldChange(GeometryId geometry, const DistanceField* field) const {
  for (const auto& record : m_records) {
    const auto& [a, b, settings] = record->pair;
    if (settings.method != Method::DistanceField || (a != geometry && b != geometry)) continue;
    if (record->a->isField() || record->b->isField()) continue;
    const DistanceField* const ofA = a == geometry ? field : record->a->field.get();
    const DistanceField* const ofB = b == geometry ? field : record->b->field.get();
    ErrorCode code;
    const std::string fault =
        faultOf(ofB ? ofB : ofA, settings, (ofB ? record->a : record->b)->mesh.largestRadius, code);
    if (!fault.empty()) throw Error(code, nameOf(*record->a, *record->b) + ": " + fault, geometry);
  }
}

void PairTable::setPredicate(const GeometryTable& geometries, GeometryId a, GeometryId b,
                             ContactPredicate predicate) {
  PairRecord& record = inOrder(geometries, a, b);
  if (predicate && record.usesProxy()) throwPredicate(record);
  if (predicate && record.hasShape())
    throw Error(ErrorCode::UnsupportedMethod,
                nameOf(*record.a, *record.b) +
                    ": contact predicates are for pairs of meshes, and one of the two is a shape",
                a);
  if (predicate && record.needsField())
    throw Error(ErrorCode::UnsupportedMethod, nameOf(*record.a, *record.b) + ": " + kNoPredicate,
                a);
  record.predicate = std::move(predicate);
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
