#include "Report.h"

#include <cstdio>
#include <thread>

namespace palpate::benchmark {
namespace {

std::string processor() {
  std::ifstream info("/proc/cpuinfo");
  std::string line;
  while (std::getline(info, line))
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "unknown processor";
}

/// A field of CSV, in quotes if it needs them.
std::string field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + '"';
}

}  // namespace

Report::Report(const std::string& csvPath, std::string commit, std::string simdPath) {
  const std::string cores = std::to_string(std::thread::hardware_concurrency());
  m_provenance = field(processor() + " (" + cores + " cores)") + ',' +
                 field("g++ " + std::string(__VERSION__)) + ',' + field(simdPath) + ',' +
                 field(commit);
  std::printf("machine %s, compiler g++ %s, SIMD %s, commit %s\n", processor().c_str(), __VERSION__,
              simdPath.c_str(), commit.c_str());
  if (csvPath.empty()) return;
  m_csv.open(csvPath);
  m_csv << "table,scene,threads,engine,metric,value,hash,machine,compiler,simd,commit\n";
}

void Report::heading(const std::string& text) { std::printf("\n%s\n", text.c_str()); }

void Report::line(const std::vector<std::string>& cells) {
  for (std::size_t i = 0; i < cells.size(); ++i)
    std::printf(i == 0 ? "  %-40s" : "%12s", cells[i].c_str());
  std::printf("\n");
  std::fflush(stdout);
}

void Report::row(const std::string& table, const std::string& scene, int threads,
                 const std::string& engine, const std::string& metric, double value,
                 std::uint64_t hash) {
  if (!m_csv.is_open()) return;
  m_csv << field(table) << ',' << field(scene) << ',' << threads << ',' << field(engine) << ','
        << field(metric) << ',' << value << ',' << std::hex << hash << std::dec << ','
        << m_provenance << '\n';
  m_csv.flush();
}

std::string milliseconds(double value) {
  char text[32];
  std::snprintf(text, sizeof text,
                value < 1     ? "%.3f"
                : value < 10  ? "%.2f"
                : value < 100 ? "%.1f"
                              : "%.0f",
                value);
  return text;
}

std::string times(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2fx", value);
  return text;
}

}  // namespace palpate::benchmark
