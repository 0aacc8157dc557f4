#include "Queries.h"

#include <palpate/FeaturePairs.h>

#include <algorithm>
#include <chrono>
#include <map>

namespace palpate::benchmark {

std::vector<testing::PublishedQueries> publishedSets(const std::string& sharedData) {
  std::map<std::string, testing::PublishedQueries> byFolder;
  for (auto& file : testing::publishedQueries(sharedData)) {
    const std::string name = file.name.substr(0, file.name.rfind('/'));
    auto& set =
        byFolder.try_emplace(name, testing::PublishedQueries{name, file.edges, {}}).first->second;
    set.queries.insert(set.queries.end(), file.queries.begin(), file.queries.end());
  }
  std::vector<testing::PublishedQueries> sets;
  for (auto& [name, set] : byFolder) sets.push_back(std::move(set));
  return sets;
}

std::optional<double> timeOfImpact(bool edges, const testing::PublishedQuery& query) {
  const auto& p = query.positions;
  return (edges ? edgeEdgeTimeOfImpact : vertexTriangleTimeOfImpact)(p[0], p[1], p[2], p[3], p[4],
                                                                     p[5], p[6], p[7], {});
}

QueryTimes timeQueries(const testing::PublishedQueries& set) {
  QueryTimes times;
  std::vector<double> microseconds;
  for (const testing::PublishedQuery& query : set.queries) {
    double best = 1e9;
    bool impact = false;
    for (int i = 0; i < 7; ++i) {
      const auto start = std::chrono::steady_clock::now();
      impact = timeOfImpact(set.edges, query).has_value();
      const std::chrono::duration<double, std::micro> took =
          std::chrono::steady_clock::now() - start;
      best = std::min(best, took.count());
    }
    microseconds.push_back(best);
    times.falseNegatives += query.impact && !impact;
    times.falsePositives += !query.impact && impact;
    times.mean += best / static_cast<double>(set.queries.size());
  }
  std::sort(microseconds.begin(), microseconds.end());
  times.median = microseconds[microseconds.size() / 2];
  times.worst = microseconds.back();
  return times;
}

}  // namespace palpate::benchmark
