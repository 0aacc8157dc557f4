#include "Report.h"

#include <algorithm>
#include <array>
#include <cinttypes>
#include <cstdio>
#include <fstream>
#include <unistd.h>

namespace palpate::scenes {

namespace {

template <class... Values>
std::string formatted(const char* format, Values... values) {
  std::array<char, 512> line;
  const int length = std::snprintf(line.data(), line.size(), format, values...);
  return {line.data(), std::min<std::size_t>(length, line.size() - 1)};
}

/// The smallest value that at least this share of all is not above.
double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto rank = static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(rank),
                   values.end());
  return values[rank];
}

std::uint64_t resultHash(const OctreeBasedCD& detection) {
  std::uint64_t hash = 0xcbf29ce484222325u;  // FNV-1a over the pairs' own hashes
  for (const CollisionPair& pair : detection.pairs()) {
    hash = (hash ^ detection.collisionData(pair.a, pair.b).hash()) * 0x100000001b3u;
  }
  return hash;
}

}  // namespace

void Report::add(const OctreeBasedCD& detection, double milliseconds) {
  m_frames.push_back({detection.statistics(), milliseconds, detection.octree().statistics(),
                      resultHash(detection)});
}

std::string Report::summary() const {
  if (m_frames.empty()) return "";
  const auto row = [this](const char* name, const char* format, auto&& value) {
    std::vector<double> values;
    for (const Frame& frame : m_frames) values.push_back(static_cast<double>(value(frame)));
    return formatted(format, name, quantile(values, 0.5), quantile(values, 0.99),
                     quantile(values, 1));
  };
  constexpr const char* kTime = "%-22s %10.3f %10.3f %10.3f  ms\n";
  constexpr const char* kCount = "%-22s %10.0f %10.0f %10.0f\n";
  using Stages = FrameStatistics::Stages;
  const auto stage = [&](const char* name, double Stages::*time) {
    return row(name, kTime,
               [time](const Frame& frame) { return frame.statistics.milliseconds.*time; });
  };
  std::string text = formatted("%-22s %10s %10s %10s\n", "", "median", "p99", "worst");
  text += stage("boxes", &Stages::boxes) + stage("octree", &Stages::octree) +
          stage("pairs", &Stages::pairs);
  text += stage("narrow phase", &Stages::narrowPhase) + stage("order", &Stages::order);
  text += row("update (boxes, octree)", kTime,
              [](const Frame& f) { return f.statistics.milliseconds.update(); });
  text += row("whole frame", kTime, [](const Frame& f) { return f.milliseconds; });
  text +=
      row("candidate pairs", kCount, [](const Frame& f) { return f.statistics.candidatePairs; });
  text += row("contacts", kCount, [](const Frame& f) { return f.statistics.contacts; });
  text += row("intersecting triangles", kCount,
              [](const Frame& f) { return f.statistics.intersectingTriangles; });
  text += row("octree nodes", kCount, [](const Frame& f) { return f.octree.nodesInUse; });
  text += row("octree depth", kCount, [](const Frame& f) { return f.octree.deepestLevel; });

  const OctreeStatistics& octree = m_frames.back().octree;
  text += formatted(
      "octree at the end      %zu of %zu nodes in use, %zu blocks free, at most %zu triangles in a "
      "node\n",
      octree.nodesInUse, octree.nodesAllocated, octree.blocksFree, octree.mostPrimitivesInNode);
  text += "nodes by depth        ";
  for (const std::size_t nodes : octree.nodesByDepth) text += formatted(" %zu", nodes);
  std::size_t rebuilt = 0, refitted = 0;
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const Frame& frame : m_frames) {
    rebuilt += frame.statistics.rebuiltOctrees;
    refitted += frame.statistics.refittedOctrees;
    hash = (hash ^ frame.hash) * 0x100000001b3u;
  }
  text += formatted("\noctrees of all frames  %zu rebuilt, %zu refitted\n", rebuilt, refitted);
  return text + formatted("result hash            %016" PRIx64 "\n", hash);
}

std::string Report::csv() const {
  std::string text =
      "frame,boxes_ms,octree_ms,pairs_ms,narrow_phase_ms,order_ms,frame_ms,candidate_pairs,feature_"
      "pairs,contacts,"
      "intersecting_triangles,octree_nodes,octree_depth,result_hash\n";
  for (std::size_t i = 0; i < m_frames.size(); ++i) {
    const auto& [statistics, milliseconds, octree, hash] = m_frames[i];
    const auto& stages = statistics.milliseconds;
    text += formatted(
        "%zu,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%zu,%zu,%zu,%zu,%zu,%d,%016" PRIx64 "\n", i,
        stages.boxes, stages.octree, stages.pairs, stages.narrowPhase, stages.order, milliseconds,
        statistics.candidatePairs, statistics.featurePairs, statistics.contacts,
        statistics.intersectingTriangles, octree.nodesInUse, octree.deepestLevel, hash);
  }
  return text;
}

int Report::typicalFrame() const {
  std::vector<std::pair<std::size_t, int>> byContacts;
  for (std::size_t i = 0; i < m_frames.size(); ++i) {
    const FrameStatistics& statistics = m_frames[i].statistics;
    const std::size_t found = std::max(statistics.contacts, statistics.intersectingTriangles);
    if (found > 0) byContacts.emplace_back(found, static_cast<int>(i));
  }
  if (byContacts.empty()) return 0;
  std::sort(byContacts.begin(), byContacts.end());
  return byContacts[byContacts.size() / 2].second;
}

void writeWhole(const std::filesystem::path& path, const std::string& content) {
  std::filesystem::path partial = path;
  partial += ".part";
  std::ofstream file(partial, std::ios::binary);
  file << content;
  file.close();
  std::error_code fault;
  if (file.good()) std::filesystem::rename(partial, path, fault);
  if (file.good() && !fault) return;
  std::error_code ignored;
  std::filesystem::remove(partial, ignored);
  throw Error(ErrorCode::File, "The file \"" + path.string() + "\" cannot be written.");
}

void makeFolder(const std::filesystem::path& folder) {
  std::error_code fault;
  std::filesystem::create_directories(folder, fault);
  if (fault || access(folder.c_str(), W_OK | X_OK) != 0) {
    throw Error(ErrorCode::File,
                "The folder \"" + folder.string() + "\" cannot be made or written to.");
  }
}

}  // namespace palpate::scenes
