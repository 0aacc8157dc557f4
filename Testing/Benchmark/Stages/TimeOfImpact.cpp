// Published continuous queries, one by one, through the public functions.
#include "Queries.h"

#include <benchmark/benchmark.h>

#include <string>

namespace {

using namespace palpate::benchmark;
using palpate::testing::PublishedQueries;

/// The mean is the time of the row over its queries. The counters are of single calls.
void timeOfImpacts(benchmark::State& state, const PublishedQueries& set) {
  for (auto _ : state)
    for (const auto& query : set.queries) benchmark::DoNotOptimize(timeOfImpact(set.edges, query));
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(set.queries.size()));
  const QueryTimes times = timeQueries(set);
  state.counters["mean_us"] = times.mean;
  state.counters["median_us"] = times.median;
  state.counters["worst_us"] = times.worst;
  state.counters["false_negatives"] = times.falseNegatives;
  state.counters["false_positives"] = times.falsePositives;
}

/// One row for each set.
const bool registered = [] {
  for (const PublishedQueries& set : publishedSets(PALPATE_SHARED_DATA))
    benchmark::RegisterBenchmark(("timeOfImpact/" + set.name).c_str(), timeOfImpacts, set);
  return true;
}();

}  // namespace
