// Results to sorted results: candidate pairs, and contacts.
#include "Arrows/Arrow.h"

using namespace palpate;
using namespace palpate::benchmark;

static void orderOfPairs(::benchmark::State& state) {
  timeStage(state, Through::Pairs, OctreeUpdate::Auto,
            [](const FrameStatistics::Stages& ms) { return ms.order; });
}
BENCHMARK(orderOfPairs)->Apply(everyScene);

static void orderOfContacts(::benchmark::State& state) {
  timeStage(state, Through::Contacts, OctreeUpdate::Auto,
            [](const FrameStatistics::Stages& ms) { return ms.order; });
}
BENCHMARK(orderOfContacts)->Apply(everyScene);
