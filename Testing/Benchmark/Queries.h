#pragma once

#include "Common/PublishedQueries.h"

#include <optional>
#include <vector>

namespace palpate::benchmark {

/// The published continuous queries, one set for each folder.
std::vector<testing::PublishedQueries> publishedSets(const std::string& sharedData);

std::optional<double> timeOfImpact(bool edges, const testing::PublishedQuery&);

/// Times of single calls of the public functions, in microseconds. Each query counts by its best of
/// seven.
struct QueryTimes {
  double mean = 0, median = 0, worst = 0;
  int falseNegatives = 0, falsePositives = 0;  ///< against the labels
};
QueryTimes timeQueries(const testing::PublishedQueries&);

}  // namespace palpate::benchmark
