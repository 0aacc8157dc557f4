// Published queries with exact truth, built to break continuous detection. (Erleben, Methodology
// for assessing mesh-based contact point methods, 2018; Wang et al., A large-scale benchmark and an
// inclusion-based algorithm for continuous collision detection, 2021.)
#include "ImpactCases.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace palpate {

namespace {

struct Labelled {
  ImpactCase query;
  bool impact;
};

/// Eight rows a query; a row has three fractions, as numerator and denominator, and the truth. The
/// fractions are doubles exactly, and so are their parts.
std::vector<Labelled> read(const std::filesystem::path& file, bool edges) {
  std::vector<Labelled> result;
  std::ifstream stream(file);
  std::string line;
  for (int row = 0; std::getline(stream, line); ++row) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream fields(line);
    oracle::Positions positions;
    positions.fill(Eigen::Vector3d::Zero());
    if (row % 8 == 0) result.push_back({{edges, positions}, false});
    for (int k = 0; k < 3; ++k) {
      double numerator = 0, denominator = 0;
      fields >> numerator >> denominator;
      result.back().query.positions[row % 8][k] = numerator / denominator;
    }
    fields >> result.back().impact;
  }
  return result;
}

TEST(TimeOfImpactPublished, EveryLabelHoldsInEveryOrderAndDirection) {
  const std::filesystem::path folder = std::string(PALPATE_SHARED_DATA) + "/ccd-queries";
  if (!std::filesystem::is_directory(folder))
    GTEST_SKIP() << "no ccd-queries in PALPATE_SHARED_DATA";
  int queries = 0, impacts = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".csv") continue;
    const bool edges = entry.path().parent_path().filename() == "edge-edge";
    const std::vector<Labelled> labelled = read(entry.path(), edges);
    for (std::size_t i = 0; i < labelled.size(); ++i) {
      const auto& [query, impact] = labelled[i];
      const std::array<int, 4> order = edges ? std::array{3, 2, 0, 1} : std::array{0, 3, 1, 2};
      EXPECT_EQ(query.time().has_value(), impact) << entry.path() << ", query " << i;
      EXPECT_EQ(query.reversed().time().has_value(), impact) << entry.path() << ", query " << i;
      EXPECT_EQ(query.permuted(order).time().has_value(), impact)
          << entry.path() << ", query " << i;
      impacts += impact;
    }
    queries += static_cast<int>(labelled.size());
  }
  EXPECT_GT(queries, 2000);
  EXPECT_GT(impacts, 200);
}

/// Every tenth, as the oracle is slow: the truth, and a time that is not late and not early.
TEST(TimeOfImpactPublished, TimesAreThoseOfTheOracle) {
  const std::filesystem::path folder = std::string(PALPATE_SHARED_DATA) + "/ccd-queries";
  if (!std::filesystem::is_directory(folder))
    GTEST_SKIP() << "no ccd-queries in PALPATE_SHARED_DATA";
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".csv") continue;
    const bool edges = entry.path().parent_path().filename() == "edge-edge";
    const std::vector<Labelled> labelled = read(entry.path(), edges);
    for (std::size_t i = 0; i < labelled.size(); ++i) {
      const auto& [query, impact] = labelled[i];
      if (!impact && i % 10 != 0) continue;
      std::optional<oracle::Real> truth = oracle::Query(edges, query.positions).firstTouch();
      ASSERT_EQ(truth.has_value(), impact) << entry.path() << ", query " << i;
      const std::optional<double> time = query.time();
      ASSERT_EQ(time.has_value(), impact) << entry.path() << ", query " << i;
      if (!impact) continue;
      EXPECT_GE(truth->compare(*time), 0) << entry.path() << ", query " << i;
      EXPECT_LE(truth->compare(oracle::Rational(*time) + oracle::Rational(1e-6)), 0)
          << entry.path() << ", query " << i;
    }
  }
}

}  // namespace

}  // namespace palpate
