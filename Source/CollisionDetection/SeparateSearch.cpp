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

/// The settings that find the passages of a pair, and nothing else.
static PairSettings passagesOf(PairSettings settings) {
  settings.thickness = settings.freeMotionReach = 0.0;
  settings.reportCrossings = true;
  settings.rememberSides = settings.smoothNormals = false;
  settings.method = Method::Continuous;  // not Auto, which looks for more than passages
  return settings;
}

SeparateSearches UnfollowedSides::find(const PairTable& pairs, std::uint64_t step) {
  m_count = 0;
  for (const auto& record : pairs.records()) {
    SidesMemory& memory = record->memory.sides;
    const PairMoment moment = record->momentIn(step);
    memory.startStep(moment);
    if (!memory.sides) continue;
    if (!SidesMemory::isWanted(moment)) {
      memory.commit(moment);
      continue;
    }
    if (record->isCurrent()) continue;
    if (m_count == m_searches.size()) m_searches.push_back(std::make_unique<SeparateSearch>());
    SeparateSearch& own = *m_searches[m_count++];
    own.set(*record, passagesOf(record->pair.settings), false);
    own.version.invalidate();
  }
  return found();
}

void UnfollowedSides::follow(const PairTable& pairs) {
  for (const auto& own : found()) {
    PairRecord& record = *pairs.records()[own->of->index];
    record.memory.sides.sides->follow(record.meshes(), own->found.data.crossings());
  }
  for (const auto& own : found()) {
    PairRecord& record = *pairs.records()[own->of->index];
    record.memory.sides.sides->commit();
    record.last.version.invalidate();  // the sides are not those of the last detection
  }
}

}  // namespace palpate
