#include <palpate/StepGuard.h>

#include <palpate/OctreeBasedCD.h>

#include "CollisionDetection/GuardedStep.h"
#include "Bodies/InputChecks.h"
#include "Core/Assert.h"

#include <memory>
#include <vector>

namespace palpate {

namespace {

void check(const Geometry& geometry, std::uint32_t vertex) {
  const std::size_t count = geometry.body.shape ? 0 : geometry.body.mesh.now.size();
  if (vertex != kNoElement) checkVertex(geometry, vertex, count);
}

/// The settings by which a pair is guarded.
PairSettings settingsOf(const PairRecord& guarded) {
  const double radii = guarded.a->body.mesh.largestRadius + guarded.b->body.mesh.largestRadius;
  const bool touches = !guarded.a->body.shape && !guarded.b->body.shape && radii == 0.0;
  return {.method = Method::Continuous,
          .contacts = Contacts::All,
          .restDistance = guarded.pair.settings.restDistance,
          .continuous = {.timeTolerance = touches ? kTouchTolerance : kGuardTolerance}};
}

/// Brings pairs up to date with those of the table.
void updatePairs(const PairTable& table, const GuardSettings& settings,
                 std::vector<std::unique_ptr<SeparateSearch>>& pairs) {
  std::size_t count = 0;
  for (const auto& record : table.records()) {
    if (settings.isLeftOut(record->pair.a, record->pair.b)) continue;
    for (const Geometry* geometry : {record->a, record->b})
      if (geometry->body.isField())
        throw Error(ErrorCode::UnsupportedMethod,
                    nameOf(record->pair.a, record->pair.b) + ": a StepGuard cannot guard " +
                        nameOf(*geometry) + ", which is a distance field; leave the pair out",
                    geometry->body.id);
    if (count == pairs.size()) pairs.emplace_back();
    std::unique_ptr<SeparateSearch>& own = pairs[count++];
    if (!own) own = std::make_unique<SeparateSearch>();
    own->set(*record, settingsOf(*record), true);
  }
  pairs.resize(count);
}

}  // namespace

struct StepGuard::Implementation {
  std::shared_ptr<StepSource> source;
  GuardSettings settings;
  std::vector<std::unique_ptr<SeparateSearch>> pairs;
  GuardedParts parts;
  GuardedFractions fractions;
  std::vector<HeldVertex> held;
  std::size_t rounds = 0;

  // Scratch of hold(), which remembers its peak.
  std::vector<GuardedTouch> touches;
  std::vector<Eigen::Vector3d> positions;
  std::vector<HeldVertex> nextHeld;
};

StepGuard::Implementation& StepGuard::all() const {
  if (!m_implementation)
    throw Error(ErrorCode::InvalidCall, "this StepGuard was moved from: it guards nothing");
  return *m_implementation;
}

StepGuard::StepGuard(OctreeBasedCD& detection)
    : m_implementation(std::make_unique<Implementation>()) {
  m_implementation->source = detection.stepSource();
}
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
    check(guard.source->geometries().at(v.geometry), v.vertex);
  if (!vertices.empty()) guard.settings.groups.emplace_back(vertices.begin(), vertices.end());
}

void StepGuard::setFixedVertices(GeometryId id, std::span<const std::uint32_t> vertices) {
  Implementation& guard = all();
  const Geometry& geometry = guard.source->geometries().at(id);
  for (const std::uint32_t v : vertices) check(geometry, v);
  guard.settings.fix(id, vertices);
}

std::size_t StepGuard::hold() {
  Implementation& guard = all();
  StepSource& source = *guard.source;
  source.change([&] {
    GuardedParts& parts = guard.parts;
    const auto fractions = [&] { return guard.fractions.all(); };
    updatePairs(source.pairs(), guard.settings, guard.pairs);
    parts.start(source.geometries(), guard.pairs, guard.settings);
    guard.fractions.start(parts.nodeCount());
    std::size_t rounds = 0;
    try {
      for (;;) {
        source.detect(guard.pairs);
        ++rounds;
        findTouches(guard.pairs, parts, fractions(), guard.touches);
        if (guard.touches.empty()) break;
        guard.fractions.shorten(parts, guard.touches);
        setShortened(parts, fractions(), source.geometries(), source.threads(), guard.positions);
      }
      listHeld(parts, fractions(), guard.nextHeld);
    } catch (...) {
      restoreGiven(parts, source.geometries());
      parts.clear();
      throw;
    }
    parts.clear();
    guard.held.swap(guard.nextHeld);
    guard.rounds = rounds;
  });
  return guard.held.size();
}

std::span<const HeldVertex> StepGuard::held() const { return all().held; }

std::size_t StepGuard::rounds() const { return all().rounds; }

}  // namespace palpate
