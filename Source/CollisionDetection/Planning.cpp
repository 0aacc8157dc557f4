#include "CollisionDetection/Planning.h"

#include "Core/Assert.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace palpate {

void planWithoutMotion(PairRecord& record) {
  record.plan =
      planOf(*record.support, record.pair.settings, record.a->inStep(), record.b->inStep());
}

bool mayUseProxy(const PairRecord& record) {
  const PairSettings& settings = record.pair.settings;
  const Geometry &a = *record.a, &b = *record.b;
  const double reach = settings.thickness + a.body.mesh.largestRadius;
  return settings.method == Method::Auto && kPoints.has(a.body.mesh.topology.type) && b.proxy &&
         b.proxySettings.errorBound <= settings.allowedError && !record.predicate &&
         !record.meshes().findsPassages() && reach > 0.0 && reach <= b.proxySettings.reach;
}

void planStep(PairRecord& record, bool detecting) {
  const PairSettings& settings = record.pair.settings;
  const PairKind kind = record.support->kind;
  const bool moves = (detecting || settings.method == Method::Auto) && kind != PairKind::Proxy &&
                     kind != PairKind::Field;
  if (moves)
    for (Geometry* geometry : {record.a, record.b}) geometry->motion.update(*geometry);
  record.plan = planOf(*record.support, settings, record.a->inStep(), record.b->inStep(), moves);
  if (detecting && mayUseProxy(record)) record.plan = planByProxy(settings, record.plan);
}

/// Where floats of the extent have an error that is not small beside an edge, lists would hold
/// pairs that are far apart.
constexpr double kMostErrorOfKept = 0x1p-12;

/// L: the length on which the motion of a step is measured.
static double edgeOf(const PairRecord& record) {
  double edge = 0.0;
  for (const Geometry* geometry : {record.a, record.b})
    if (geometry->shortEdge > 0.0 && (edge == 0.0 || geometry->shortEdge < edge))
      edge = geometry->shortEdge;
  return edge;
}

/// Whether a search of the two octrees for pairs at one distance, at the step's end, answers the
/// pair.
static bool canKeep(const PairRecord& record) {
  constexpr std::size_t kFewElements = 256;
  const Body &a = record.a->body, &b = record.b->body;
  const double extent = a.mesh.now.bounds().merged(b.mesh.now.bounds()).sizes().maxCoeff();
  const auto fits = [](const Geometry& geometry) {
    return !geometry.body.isPlaced() && !geometry.body.tree.isSwept() && !geometry.body.field &&
           !geometry.proxy;
  };
  return record.plan.kind == PairKind::Meshes && record.plan.method == Method::Proximity &&
         record.collides() && kMostErrorOfKept * extent <= edgeOf(record) && fits(*record.a) &&
         fits(*record.b) &&
         a.mesh.topology.elements.size() + b.mesh.topology.elements.size() >= kFewElements;
}

/// Whether what follows the search needs no octree.
static bool canLag(const PairRecord& record) {
  return !record.collides() ||
         (record.keeps && record.pair.settings.freeMotionReach == 0.0 &&
          !(record.pair.settings.method == Method::Auto &&
            record.a->body.mesh.topology.hasFaces() && record.b->body.mesh.topology.hasFaces()));
}

void planKeptPairs(const GeometryTable& geometries,
                   std::span<const std::unique_ptr<PairRecord>> records, const Settings& settings) {
  constexpr int kSlowFrames = 3;        // before lists are made
  constexpr double kSpeedDecay = 0.95;  // in each detection
  for (const auto& geometry : geometries.all()) geometry->mayLag = false;
  const auto forBoth = [](PairRecord& record, auto&& f) {
    f(*record.a);
    if (record.b != record.a) f(*record.b);
  };
  for (const auto& record : records) {
    const double edge = edgeOf(*record), motion = record->plan.motion;
    const double most = KeptPairs::kMostSpeed * edge;
    record->recentSpeed = motion > most ? 0.0 : std::max(motion, kSpeedDecay * record->recentSpeed);
    record->pauseFrames = std::max(record->pauseFrames - 1, 0);
    const bool isSlow = settings.octree.keepsPairs && settings.engine == Engine::Octree &&
                        settings.octree.update == OctreeUpdate::Auto && edge > 0.0 &&
                        motion <= most && record->pauseFrames == 0 && canKeep(*record);
    record->slowFrames = isSlow ? std::min(record->slowFrames + 1, kSlowFrames) : 0;
    const bool mayKeep = record->slowFrames == kSlowFrames;
    const std::array elements{record->a->body.revisions.elements,
                              record->b->body.revisions.elements};
    // Other enabled elements own other features.
    const auto isCut = [&](const Geometry& geometry, const ElementsState& last) {
      const CutsSince& cuts = geometry.step.cutsSinceDetection();
      return cuts.before == last && cuts.after == geometry.body.revisions.elements;
    };
    record->followsCut = record->keptElements != elements;
    for (std::size_t i = 0; i < 2; ++i)
      if (!mayKeep || (record->keptElements[i] != elements[i] &&
                       !isCut(i == 0 ? *record->a : *record->b, record->keptElements[i])))
        record->kept.deactivate();
    record->keptElements = elements;
    record->keeps = mayKeep && record->kept.isWhole();
    record->gathers = mayKeep && !record->keeps;
    if (mayKeep) forBoth(*record, [](Geometry& geometry) { geometry.mayLag = true; });
  }
  for (const auto& geometry : geometries.all())
    if (geometry->mayLag) geometry->pieces.reserve(geometry->body.mesh.now.size());
  // Nothing below throws: all pairs see the same motion.
  for (const auto& geometry : geometries.all())
    if (geometry->mayLag)
      geometry->pieces.advanceTo(geometry->body.mesh.now);
    else
      geometry->pieces.forget();
  for (const auto& record : records)
    if (record->kept.isActive()) record->kept.addMotion(record->a->pieces, record->b->pieces);
  for (const auto& record : records)
    if (!canLag(*record)) forBoth(*record, [](Geometry& geometry) { geometry.mayLag = false; });
}

bool reviewKeptPairs(PairRecord& record) {
  const PairPlan& plan = record.plan;
  const auto stops = [&] {
    record.keeps = false;
    record.a->mayLag = record.b->mayLag = false;
    return record.a->body.tree.isLagging() || record.b->body.tree.isLagging();
  };
  if ((record.keeps || record.gathers) &&
      !(canKeep(record) && !plan.runsIntersection && !plan.startsIntersecting)) {
    record.gathers = false;
    return stops();
  }
  // A cut after which an octree was built anew.
  if (!record.keeps || !record.followsCut || record.kept.fits(record.a->body, record.b->body))
    return false;
  record.kept.deactivate();
  record.gathers = true;
  return stops();
}

/// ns: about what an update and a search cost in a detection.
static double costOfSearch(const PairRecord& record) {
  constexpr double kElement = 7.0, kCandidate = 14.0;
  double elements = 0.0;
  for (const Geometry* geometry : {record.a, record.b})
    elements += static_cast<double>(geometry->body.mesh.topology.elements.size());
  return kElement * elements + kCandidate * static_cast<double>(record.searchedCandidates);
}

void reviewLists(PairRecord& record) {
  constexpr int kFirstPause = 64, kLongestPause = 4096;  // detections; any numbers will do
  record.countIsPending = record.keeps;
  if (!record.keeps) record.searchedCandidates = record.statistics.candidatePairs;
  if (!(record.keeps || record.gathers) ||
      record.kept.cost(record.recentSpeed) <= costOfSearch(record))
    return;
  record.nextPause = std::clamp(2 * record.nextPause, kFirstPause, kLongestPause);
  record.pauseFrames = record.nextPause;
}

KeptPairs::Reach reachOfKept(const PairRecord& record) {
  PALPATE_ASSERT(record.keeps || record.gathers);
  return KeptPairs::reachFor(record.meshes().maxFeatureDistance(), record.recentSpeed,
                             edgeOf(record));
}

std::size_t detectionsToGather(const PairRecord& record, const KeptPairs::Reach& reach) {
  // The first lists should last until the last ones are made.
  constexpr double kShareOfMargin = 0.25, kMost = 16.0;
  const double motion = kShareOfMargin * reach.lists, speed = record.recentSpeed;
  if (motion >= kMost * speed) return static_cast<std::size_t>(kMost);
  return std::max<std::size_t>(1, static_cast<std::size_t>(motion / speed));
}

void planByFieldIfProven(PairRecord& record, Engine engine) {
  if (record.predicate || record.plan.kind != PairKind::Meshes || !record.collides()) return;
  const std::optional<PairPlan> byField =
      planByField(record.pair.settings, record.a->inStep(), record.b->inStep(), record.plan);
  if (!byField) return;
  const PairPlan exact = std::exchange(record.plan, *byField);
  if (exact.motion == 0.0) return;
  const auto isProven = [&] {
    if (record.hasData && record.dataVersion.isCurrent(record.state()))  // decided before
      return record.data.validity().reason == MethodReason::AllowedError;
    const PlacedField placed = record.placedField();
    FieldContacts contacts = record.fieldContacts(placed);
    return engine == Engine::BruteForce ? contacts.isFurtherByBruteForce(exact.motion)
                                        : contacts.isFurther(record.mesh().body, exact.motion);
  };
  if (!isProven()) record.plan = exact;
}

}  // namespace palpate
