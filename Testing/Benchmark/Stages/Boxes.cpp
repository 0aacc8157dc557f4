// Positions to float boxes.
#include "Stages/TimeStage.h"

using namespace palpate;
using namespace palpate::benchmark;

static void boxes(::benchmark::State& state) {
  timeStage(state, Through::Pairs, OctreeUpdate::Auto,
            [](const FrameStatistics::Stages& ms) { return ms.boxes; });
}
BENCHMARK(boxes)->Apply(everyScene);
