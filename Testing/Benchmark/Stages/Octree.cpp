// Boxes to octree: as shipped, and rebuilt from sorted keys every frame.
#include "Stages/TimeStage.h"

using namespace palpate;
using namespace palpate::benchmark;

static void octreeAsShipped(::benchmark::State& state) {
  timeStage(state, Through::Pairs, OctreeUpdate::Auto,
            [](const FrameStatistics::Stages& ms) { return ms.octree; });
}
BENCHMARK(octreeAsShipped)->Apply(everyScene);

static void octreeRebuilt(::benchmark::State& state) {
  timeStage(state, Through::Pairs, OctreeUpdate::Rebuild,
            [](const FrameStatistics::Stages& ms) { return ms.octree; });
}
BENCHMARK(octreeRebuilt)->Apply(everyScene);
