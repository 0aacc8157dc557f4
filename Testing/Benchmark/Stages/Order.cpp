// Contacts to sorted contacts. (Candidate pairs are sorted on demand, outside of a frame.)
#include "Stages/TimeStage.h"

using namespace palpate;
using namespace palpate::benchmark;

static void orderOfContacts(::benchmark::State& state) {
  timeStage(state, Through::Contacts, OctreeUpdate::Auto,
            [](const FrameStatistics::Stages& ms) { return ms.order; });
}
BENCHMARK(orderOfContacts)->Apply(everyScene);
