// Whole frames: positions to candidate pairs, and to contacts.
#include "Stages/TimeStage.h"

using namespace palpate;
using namespace palpate::benchmark;

static void frameOfPairs(::benchmark::State& state) {
  timeStage(state, Through::Pairs, OctreeUpdate::Auto,
            [](const FrameStatistics::Stages& ms) { return ms.total(); });
}
BENCHMARK(frameOfPairs)->Apply(everyScene);

static void frameOfContacts(::benchmark::State& state) {
  timeStage(state, Through::Contacts, OctreeUpdate::Auto,
            [](const FrameStatistics::Stages& ms) { return ms.total(); });
}
BENCHMARK(frameOfContacts)->Apply(everyScene);
