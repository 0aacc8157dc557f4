#pragma once

#include "Common/PublishedQueries.h"

#include <optional>
#include <vector>

namespace palpate::benchmark {

/// One set a folder of the published continuous queries: all its files.
std::vector<testing::PublishedQueries> publishedSets(const std::string& sharedData);

std::optional<double> timeOfImpact(bool edges, const testing::PublishedQuery&);

/// Of single calls through the public functions, in microseconds: each query's best of seven.
struct QueryTimes {
  double mean = 0, median = 0, worst = 0;
  int missed = 0, invented = 0;  ///< against the labels
};
QueryTimes timeQueries(const testing::PublishedQueries&);

}  // namespace palpate::benchmark
