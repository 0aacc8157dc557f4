#include "CollisionDetection/SeparateSearch.h"

#include "Core/Assert.h"

namespace palpate {

void SeparateSearch::set(const PairRecord& record, const PairSettings& settings, bool apart) {
  PALPATE_ASSERT(settings.method == Method::Continuous);
  if (of != &record || a != record.a || b != record.b) version.invalidate();
  of = &record;
  a = record.a;
  b = record.b;
  pair = {record.pair.a, record.pair.b, settings};
  support =
      supportOf(settings.method, a->body.mesh.topology.type, b->body.mesh.topology.type, a == b);
  PALPATE_ASSERT(support);
  keepsApart = apart;
}

}  // namespace palpate
