#pragma once

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace palpate::testing {

/// A continuous query with its exact result: (v, a, b, c) or (p0, p1, q0, q1), before and then now.
struct PublishedQuery {
  std::array<Eigen::Vector3d, 8> positions;
  bool impact = false;
};
struct PublishedQueries {
  std::string name;  ///< folders and file, below ccd-queries
  bool edges;
  std::vector<PublishedQuery> queries;
};

/// Eight rows per query. A row has three fractions, as numerator and denominator, and the label.
/// The fractions and their parts are exact in double.
inline std::vector<PublishedQuery> readQueries(const std::filesystem::path& file) {
  std::vector<PublishedQuery> queries;
  std::ifstream stream(file);
  std::string line;
  for (int row = 0; std::getline(stream, line); ++row) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream fields(line);
    if (row % 8 == 0) queries.emplace_back();
    for (int k = 0; k < 3; ++k) {
      double numerator = 0, denominator = 0;
      fields >> numerator >> denominator;
      queries.back().positions[row % 8][k] = numerator / denominator;
    }
    fields >> queries.back().impact;
  }
  return queries;
}

/// All files of sharedData/ccd-queries, by name. Empty if the folder is absent.
inline std::vector<PublishedQueries> publishedQueries(const std::filesystem::path& sharedData) {
  const std::filesystem::path folder = sharedData / "ccd-queries";
  std::vector<PublishedQueries> sets;
  if (!std::filesystem::is_directory(folder)) return sets;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".csv") continue;
    const bool edges = entry.path().parent_path().filename() == "edge-edge";
    sets.push_back({std::filesystem::relative(entry.path(), folder).string(), edges,
                    readQueries(entry.path())});
  }
  std::sort(sets.begin(), sets.end(), [](const auto& l, const auto& r) { return l.name < r.name; });
  return sets;
}

}  // namespace palpate::testing
