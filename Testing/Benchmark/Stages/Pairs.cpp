// Octrees to candidate pairs: of octrees as shipped, and of rebuilt ones.
#include "Stages/TimeStage.h"

using namespace palpate;
using namespace palpate::benchmark;

static void pairsAsShipped(::benchmark::State& state) {
  timeStage(state, Through::Pairs, OctreeUpdate::Auto,
            [](const FrameStatistics::Stages& ms) { return ms.pairs; });
}
BENCHMARK(pairsAsShipped)->Apply(everyScene);

static void pairsRebuilt(::benchmark::State& state) {
  timeStage(state, Through::Pairs, OctreeUpdate::Rebuild,
            [](const FrameStatistics::Stages& ms) { return ms.pairs; });
}
BENCHMARK(pairsRebuilt)->Apply(everyScene);
