#include "CollisionDetection/Planning.h"

#include "Core/Assert.h"

#include <optional>
#include <utility>

namespace palpate {

namespace {

/// The plan that is expected from the motion in the step. moves: whether it is measured.
PairPlan expectedPlan(const SupportedPairs& support, const PairSettings& settings, Geometry& a,
                      Geometry& b, bool detecting) {
  const bool moves = (detecting || settings.method == Method::Auto) &&
                     support.kind != PairKind::Proxy && support.kind != PairKind::Field;
  if (moves)
    for (Geometry* geometry : {&a, &b}) geometry->motion.update(*geometry);
  const PairPlan plan = planOf(support, settings, a.inStep(), b.inStep(), moves);
  if (plan.swept())
    for (Geometry* geometry : {&a, &b}) geometry->body.tree.setSwept(true);
  return plan;
}

/// Calls f with both geometries of a pair, each once.
template <class F>
void forBoth(const PairRecord& record, F&& f) {
  f(*record.a);
  if (record.b != record.a) f(*record.b);
}

void updateAll(const PairRecord& record) {
  forBoth(record, [](Geometry& geometry) { geometry.mayLag = false; });
}

}  // namespace

PairPlan planWithoutMotion(const PairRecord& record) {
  return planOf(*record.support, record.pair.settings, record.a->inStep(), record.b->inStep());
}

bool mayUseProxy(const PairRecord& record) {
  const PairSettings& settings = record.pair.settings;
  const Geometry &a = *record.a, &b = *record.b;
  const double reach = settings.thickness + a.body.mesh.largestRadius;
  return settings.method == Method::Auto && kPoints.has(a.body.mesh.topology.type) && b.proxy &&
         b.proxySettings.errorBound <= settings.allowedError && !record.filters.predicate &&
         !record.meshes().findsPassages() && reach > 0.0 && reach <= b.proxySettings.reach;
}

void expectPlan(PairRecord& record, bool detecting) {
  const PairSettings& settings = record.pair.settings;
  const PairPlan plan = expectedPlan(*record.support, settings, *record.a, *record.b, detecting);
  record.ask(detecting && mayUseProxy(record) ? planByProxy(settings, plan) : plan);
}

void expectPlan(SeparateSearch& own) {
  const PairPlan plan = expectedPlan(*own.support, own.pair.settings, *own.a, *own.b, true);
  own.question.emplace(Question{own.pair, own.a->body, own.b->body, own.a->inStep(),
                                own.b->inStep(), own.of->filters, plan, nullptr, own.keepsApart});
}

void planKeptCandidates(const GeometryTable& geometries,
                        std::span<const std::unique_ptr<PairRecord>> records,
                        const Settings& settings) {
  for (const auto& geometry : geometries.all()) geometry->mayLag = false;
  for (const auto& record : records) {
    record->memory.kept.plan(*record, record->question->plan, settings);
    if (record->memory.kept.areInUse())
      forBoth(*record, [](Geometry& geometry) { geometry.mayLag = true; });
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
    record->memory.kept.addMotion(record->a->pieces, record->b->pieces);
  for (const auto& record : records)
    if (!record->memory.kept.needsNoOctree(*record) ||
        (record->a != record->b && record->a->isCut() && record->b->isCut()))
      updateAll(*record);
}

void reviewCuts(std::span<const std::unique_ptr<PairRecord>> records) {
  for (const auto& record : records) {
    record->memory.kept.reviewCut(*record);
    if (!record->memory.kept.needsNoOctree(*record)) updateAll(*record);
  }
}

void planByFieldIfProven(PairRecord& record, Engine engine) {
  Question& question = *record.question;
  if (record.filters.predicate || question.plan.kind != PairKind::Meshes || !record.collides())
    return;
  const std::optional<PairPlan> byField =
      planByField(question.settings(), question.aInStep, question.bInStep, question.plan);
  if (!byField) return;
  const PairPlan exact = std::exchange(question.plan, *byField);
  if (exact.motion == 0.0) return;
  const auto isProven = [&] {
    if (record.last.isThere && record.isCurrent())  // decided before
      return record.last.data.validity().reason == MethodReason::AllowedError;
    const PlacedField placed = question.placedField();
    FieldContacts contacts = record.found.fieldContacts(question, placed);
    return engine == Engine::BruteForce ? contacts.isFurtherByBruteForce(exact.motion)
                                        : contacts.isFurther(question.mesh(), exact.motion);
  };
  if (!isProven()) question.plan = exact;
}

void completePlan(PairRecord& record, Engine engine) {
  planByFieldIfProven(record, engine);
  Question& question = *record.question;
  record.memory.trust.trust.start(question.settings(), question.aInStep, question.bInStep,
                                  question.plan);
  record.memory.kept.reviewPlan(record);
}

}  // namespace palpate
