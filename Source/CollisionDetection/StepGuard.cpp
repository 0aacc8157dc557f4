#include <palpate/StepGuard.h>

#include <palpate/OctreeBasedCD.h>

#include "CollisionDetection/GuardedStep.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace palpate {

namespace {

void checkVertex(const Geometry& geometry, std::uint32_t vertex) {
  const std::size_t count = geometry.body.shape ? 0 : geometry.body.mesh.now.size();
  if (vertex == kNoElement || vertex < count) return;
  throw Error(ErrorCode::IndexOutOfRange,
              nameOf(geometry) + ": vertex " + std::to_string(vertex) +
                  " is out of range; the geometry has " + std::to_string(count) + " vertices",
              geometry.body.id, vertex);
}

}  // namespace

struct StepGuard::Implementation {
  explicit Implementation(std::shared_ptr<StepSource> newSource) : source(std::move(newSource)) {}

  std::shared_ptr<StepSource> source;
  GuardSettings settings;
  GuardedPairs pairs;
  GuardedStep step;
  std::vector<HeldVertex> held, nextHeld;
  std::size_t rounds = 0;

  /// Brings `pairs` up to date with those of the OctreeBasedCD.
  void updatePairs() {
    std::size_t count = 0;
    for (const auto& record : source->pairs().records()) {
      if (settings.isLeftOut(record->pair.a, record->pair.b)) continue;
      for (const Geometry* geometry : {record->a, record->b})
        if (geometry->body.isField())
          throw Error(ErrorCode::UnsupportedMethod,
                      nameOf(record->pair.a, record->pair.b) + ": a StepGuard cannot guard " +
                          nameOf(*geometry) + ", which is a distance field; leave the pair out",
                      geometry->body.id);
      if (count == pairs.size()) pairs.emplace_back();
      std::unique_ptr<PairRecord>& own = pairs[count++];
      if (!own || own->guarded != record.get() || own->a != record->a || own->b != record->b) {
        own = std::make_unique<PairRecord>();
        own->guarded = record.get();
        own->a = record->a;
        own->b = record->b;
      }
      own->pair = {record->pair.a, record->pair.b, settingsOf(record->pair.settings)};
      if (!own->a->body.shape && !own->b->body.shape &&
          own->a->body.mesh.largestRadius + own->b->body.mesh.largestRadius == 0.0)
        own->pair.settings.timeTolerance = kTouchTolerance;
      own->settingsRevision = record->settingsRevision;
    }
    pairs.resize(count);
  }

  static PairSettings settingsOf(const PairSettings& given) {
    return {.method = Method::Continuous,
            .contacts = Contacts::All,
            .restDistance = given.restDistance,
            .timeTolerance = kGuardTolerance};
  }

  void hold() {
    updatePairs();
    step.begin(source->geometries(), pairs, settings);
    std::size_t count = 0;
    try {
      bool touches = true;
      while (touches) {
        source->detect(pairs);
        ++count;
        touches = step.shorten(pairs);
        if (touches) step.apply(source->geometries(), source->threads());
      }
      step.listHeld(nextHeld);
    } catch (...) {
      step.undo(source->geometries());
      throw;
    }
    step.end();
    held.swap(nextHeld);
    rounds = count;
  }
};

StepGuard::Implementation& StepGuard::all() const {
  if (!m_implementation)
    throw Error(ErrorCode::InvalidCall, "this StepGuard was moved from: it guards nothing");
  return *m_implementation;
}

StepGuard::StepGuard(OctreeBasedCD& detection)
    : m_implementation(std::make_unique<Implementation>(detection.stepSource())) {}
StepGuard::StepGuard(StepGuard&&) noexcept = default;
StepGuard& StepGuard::operator=(StepGuard&&) noexcept = default;
StepGuard::~StepGuard() = default;

void StepGuard::setGuarded(GeometryId a, GeometryId b, bool guarded) {
  Implementation& guard = all();
  guard.source->pairs().at(guard.source->geometries(), a, b);
  guard.settings.leaveOut(a, b, !guarded);
}

void StepGuard::addRigidGroup(std::span<const GuardedVertex> vertices) {
  Implementation& guard = all();
  for (const GuardedVertex& v : vertices)
    checkVertex(guard.source->geometries().at(v.geometry), v.vertex);
  if (!vertices.empty()) guard.settings.groups.emplace_back(vertices.begin(), vertices.end());
}

void StepGuard::setFixedVertices(GeometryId id, std::span<const std::uint32_t> vertices) {
  Implementation& guard = all();
  const Geometry& geometry = guard.source->geometries().at(id);
  for (const std::uint32_t v : vertices) checkVertex(geometry, v);
  guard.settings.fix(id, vertices);
}

std::size_t StepGuard::hold() {
  Implementation& guard = all();
  guard.source->change([&guard] { guard.hold(); });
  return guard.held.size();
}

std::span<const HeldVertex> StepGuard::held() const { return all().held; }

std::size_t StepGuard::rounds() const { return all().rounds; }

}  // namespace palpate
