#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

namespace palpate::benchmark {

/// Prints tables and writes every figure as a row of CSV: table, scene, threads, engine, metric,
/// value, hash, machine, compiler, SIMD path and commit.
class Report {
 public:
  Report(const std::string& csvPath, std::string commit, std::string simdPath);

  void heading(const std::string& text);
  void line(const std::vector<std::string>& cells);  ///< the first cell wide, the others narrow
  void row(const std::string& table, const std::string& scene, int threads,
           const std::string& engine, const std::string& metric, double value,
           std::uint64_t hash = 0);

 private:
  std::ofstream m_csv;
  std::string m_provenance;
};

std::string milliseconds(double);  ///< three significant digits
std::string times(double);         ///< "1.34x"

}  // namespace palpate::benchmark
