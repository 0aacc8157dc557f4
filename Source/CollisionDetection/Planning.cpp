#include "CollisionDetection/Planning.h"

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
         b.proxySettings.errorBound <= settings.allowedError && !record.predicate && reach > 0.0 &&
         reach <= b.proxySettings.reach;
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
