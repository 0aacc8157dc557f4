// Candidate pairs to proximity contacts.
#include "Stages/TimeStage.h"

using namespace palpate;
using namespace palpate::benchmark;

static void narrowPhase(::benchmark::State& state) {
  timeStage(state, Through::Contacts, OctreeUpdate::Auto,
            [](const FrameStatistics::Stages& ms) { return ms.narrowPhase; });
}
BENCHMARK(narrowPhase)->Apply(everyScene);
