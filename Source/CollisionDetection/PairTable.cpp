#include "CollisionDetection/PairTable.h"

#include "Geometry/RestDistance.h"
#include "Math/Tolerances.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

namespace palpate {

void PairRecord::updateNear() {
  const double distance = pair.settings.restDistance;
  if (distance == 0.0 || nearRevision == a->restRevision) return;
  near = verticesWithin(a->mesh.topology, a->mesh.rest, distance);
  nearRevision = a->restRevision;
}

void PairRecord::clear() {
  data = {};
  candidates.clear();
  trust.forget();
}

namespace {

std::uint64_t keyOf(GeometryId a, GeometryId b) {
  const auto first = static_cast<std::uint64_t>(a), second = static_cast<std::uint64_t>(b);
  return std::min(first, second) << 32 | std::max(first, second);
}

std::string nameOf(GeometryId a, GeometryId b) {
  return "pair (" + std::to_string(static_cast<std::uint32_t>(a)) + ", " +
         std::to_string(static_cast<std::uint32_t>(b)) + ")";
}

std::string shortest(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

constexpr const char* kRigidWithItself =
    "a geometry that setTransform() moves cannot be tested against itself";

/// Throws what is wrong with the settings for the pair's kinds.
void checkKinds(const TriangleMesh& a, const TriangleMesh& b, const PairSettings& settings,
                GeometryId id, const std::string& name) {
  const auto refuse = [&](const std::string& reason, ErrorCode code) {
    throw Error(code, name + ": " + reason, id);
  };
  if (!(settings.restDistance >= 0.0) || std::isinf(settings.restDistance))
    refuse("restDistance is " + shortest(settings.restDistance) +
               "; it must be finite and not negative",
           ErrorCode::InvalidSettings);
  if (settings.restDistance > 0.0 && (&a != &b || a.topology.kind == GeometryKind::Points))
    refuse("restDistance is for a triangle or line mesh with itself", ErrorCode::InvalidSettings);
  if (&a == &b && a.now.isPlaced()) refuse(kRigidWithItself, ErrorCode::UnsupportedMethod);
  if (a.topology.hasFaces() && b.topology.hasFaces()) return;
  if (a.shape || b.shape) {
    if (&a == &b) refuse("a shape does not meet itself", ErrorCode::UnsupportedMethod);
    if (a.shape && b.shape && a.shape->isPlane() && b.shape->isPlane())
      refuse("two planes have no distance", ErrorCode::UnsupportedMethod);
    if (settings.method != Method::Proximity)
      refuse("a shape is tested by Method::Proximity only", ErrorCode::UnsupportedMethod);
    return;
  }
  const std::string kinds = nameOf(a.topology.kind) + " and " + nameOf(b.topology.kind);
  if (settings.method == Method::Auto || settings.method == Method::Intersection)
    refuse("this method is for two triangle meshes, not for " + kinds +
               "; Proximity and Continuous are",
           ErrorCode::UnsupportedMethod);
  if (settings.method == Method::Continuous && !(a.radii.empty() && b.radii.empty()))
    refuse("Method::Continuous needs one radius for all vertices", ErrorCode::UnsupportedMethod);
}

/// Throws what is wrong with the settings.
void check(const Geometry& first, const Geometry& second, const PairSettings& settings) {
  const GeometryId a = first.id, b = second.id;
  const std::string name = nameOf(a, b);
  checkKinds(first.mesh, second.mesh, settings, a, name);
  if (!(settings.thickness >= 0.0) || std::isinf(settings.thickness))
    throw Error(ErrorCode::InvalidSettings,
                name + ": thickness is " + shortest(settings.thickness) +
                    "; it must be finite and not negative",
                a);
  if (!(settings.tolerance <= std::numeric_limits<double>::max()))
    throw Error(ErrorCode::InvalidSettings,
                name + ": tolerance is " + shortest(settings.tolerance) +
                    "; it must be finite, or negative for half the thickness",
                a);
  if (!(settings.timeTolerance >= kSmallestTimeTolerance && settings.timeTolerance <= 1.0))
    throw Error(ErrorCode::InvalidSettings,
                name + ": timeTolerance is " + shortest(settings.timeTolerance) +
                    "; it must be from 2^-50 to 1",
                a);
  if (settings.contacts != Contacts::Distinct && settings.contacts != Contacts::All &&
      settings.contacts != Contacts::Earliest)
    throw Error(ErrorCode::InvalidSettings, name + ": contacts must be Distinct, All or Earliest",
                a);
  if (settings.contacts == Contacts::Earliest && settings.method != Method::Continuous)
    throw Error(ErrorCode::InvalidSettings,
                name + ": Contacts::Earliest is for Method::Continuous only", a);
  switch (settings.method) {
    case Method::Auto:
    case Method::Intersection:
    case Method::Continuous:
      return;
    case Method::Proximity:
      if (!first.mesh.shape && !second.mesh.shape &&
          settings.thickness + (first.mesh.largestRadius + second.mesh.largestRadius) == 0.0)
        throw Error(ErrorCode::InvalidSettings,
                    name + ": Method::Proximity needs a positive thickness; it is 0", a);
      return;
    case Method::Proxy:
      throw Error(ErrorCode::UnsupportedMethod, name + ": Method::Proxy does not exist yet", a);
    case Method::DistanceField:
      throw Error(ErrorCode::UnsupportedMethod, name + ": Method::DistanceField does not exist yet",
                  a);
  }
  throw Error(ErrorCode::InvalidSettings,
              name + ": no such method: " + std::to_string(static_cast<int>(settings.method)), a);
}

}  // namespace

void PairTable::add(GeometryTable& geometries, GeometryId a, GeometryId b,
                    const PairSettings& settings) {
  Geometry& first = geometries.at(a);
  Geometry& second = geometries.at(b);
  check(first, second, settings);
  if (m_byIds.contains(keyOf(a, b)))
    throw Error(ErrorCode::DuplicatePair,
                nameOf(a, b) + " was added before; setPairSettings() changes its settings", a);
  auto record = std::make_unique<PairRecord>();
  record->pair = {a, b, settings};
  record->a = &first;
  record->b = &second;
  record->plan = planOf(settings, first, second);
  record->updateNear();
  m_records.push_back(std::move(record));
  index();
}

PairRecord& PairTable::at(const GeometryTable& geometries, GeometryId a, GeometryId b) const {
  const auto found = m_byIds.find(keyOf(a, b));
  if (found != m_byIds.end()) return *found->second;
  const_cast<GeometryTable&>(geometries).at(a);
  const_cast<GeometryTable&>(geometries).at(b);
  throw Error(ErrorCode::UnknownPair, nameOf(a, b) + " was never added, or was removed", a);
}

PairRecord& PairTable::inOrder(const GeometryTable& geometries, GeometryId a, GeometryId b) const {
  PairRecord& record = at(geometries, a, b);
  if (record.pair.a != a)
    throw Error(ErrorCode::UnknownPair,
                nameOf(a, b) + " was added as " + nameOf(b, a) + "; its results are in that order",
                a);
  return record;
}

void PairTable::set(GeometryTable& geometries, GeometryId a, GeometryId b,
                    const PairSettings& settings) {
  PairRecord& record = at(geometries, a, b);
  check(*record.a, *record.b, settings);
  const double restDistance =
      std::exchange(record.pair.settings.restDistance, settings.restDistance);
  try {
    if (restDistance != settings.restDistance) record.nearRevision = 0;
    record.updateNear();
  } catch (const Error&) {
    record.pair.settings.restDistance = restDistance;
    throw;
  }
  record.pair.settings = settings;
  record.plan = planOf(settings, *record.a, *record.b);
  record.dataFor = record.candidatesFor = {};
  index();
}

void PairTable::checkRigid(GeometryId geometry) const {
  if (m_byIds.contains(keyOf(geometry, geometry)))
    throw Error(ErrorCode::UnsupportedMethod, nameOf(geometry, geometry) + ": " + kRigidWithItself,
                geometry);
}

void PairTable::setPredicate(const GeometryTable& geometries, GeometryId a, GeometryId b,
                             ContactPredicate predicate) {
  PairRecord& record = inOrder(geometries, a, b);
  if (predicate && record.meshes().hasShape())
    throw Error(ErrorCode::UnsupportedMethod,
                nameOf(a, b) + ": a shape has no features to ask about", a);
  record.predicate = std::move(predicate);
  record.dataFor = {};
}

void PairTable::remove(GeometryTable& geometries, GeometryId a, GeometryId b) {
  const PairRecord* record = &at(geometries, a, b);
  std::erase_if(m_records, [=](const auto& r) { return r.get() == record; });
  index();
}

void PairTable::removeAllOf(GeometryId geometry) {
  std::erase_if(m_records,
                [=](const auto& r) { return r->pair.a == geometry || r->pair.b == geometry; });
  index();
}

void PairTable::index() {
  m_pairs.clear();
  m_byIds.clear();
  for (const auto& record : m_records) {
    m_pairs.push_back(record->pair);
    m_byIds.emplace(keyOf(record->pair.a, record->pair.b), record.get());
  }
}

}  // namespace palpate
