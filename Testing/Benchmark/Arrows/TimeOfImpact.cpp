// Published continuous queries, one by one, through the public functions.
#include <palpate/TimeOfImpact.h>

#include "Common/PublishedQueries.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <optional>
#include <string>

namespace {

using palpate::testing::PublishedQuery;

std::optional<double> answer(bool edges, const PublishedQuery& query) {
  const auto& p = query.positions;
  return (edges ? palpate::edgeEdgeTimeOfImpact : palpate::vertexTriangleTimeOfImpact)(
      p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], {});
}

/// The mean is the row's time over its queries; median and worst, in microseconds, are of each
/// query's best of seven.
void timeOfImpact(benchmark::State& state, bool edges, const std::vector<PublishedQuery>& queries) {
  for (auto _ : state)
    for (const PublishedQuery& query : queries) benchmark::DoNotOptimize(answer(edges, query));
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(queries.size()));

  std::vector<double> microseconds;
  int missed = 0, invented = 0;
  for (const PublishedQuery& query : queries) {
    double best = 1e9;
    for (int i = 0; i < 7; ++i) {
      const auto start = std::chrono::steady_clock::now();
      const std::optional<double> time = answer(edges, query);
      const std::chrono::duration<double, std::micro> took =
          std::chrono::steady_clock::now() - start;
      best = std::min(best, took.count());
      benchmark::DoNotOptimize(time);
    }
    microseconds.push_back(best);
    const bool impact = answer(edges, query).has_value();
    missed += query.impact && !impact;
    invented += !query.impact && impact;
  }
  std::sort(microseconds.begin(), microseconds.end());
  double sum = 0;
  for (const double time : microseconds) sum += time;
  state.counters["mean_us"] = sum / static_cast<double>(queries.size());
  state.counters["median_us"] = microseconds[queries.size() / 2];
  state.counters["worst_us"] = microseconds.back();
  state.counters["missed"] = missed;
  state.counters["invented"] = invented;
}

/// One row a set: all files of one folder.
const bool registered = [] {
  std::map<std::string, palpate::testing::PublishedQueries> sets;
  for (auto& file : palpate::testing::publishedQueries(PALPATE_SHARED_DATA)) {
    const std::string name = file.name.substr(0, file.name.rfind('/'));
    auto& set = sets.try_emplace(name, palpate::testing::PublishedQueries{name, file.edges, {}})
                    .first->second;
    set.queries.insert(set.queries.end(), file.queries.begin(), file.queries.end());
  }
  for (const auto& [name, set] : sets)
    benchmark::RegisterBenchmark(("timeOfImpact/" + name).c_str(), timeOfImpact, set.edges,
                                 set.queries);
  return true;
}();

}  // namespace
