#pragma once

#include <palpate/OctreeBasedCD.h>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::scenes {

/// What a run's frames cost and found.
class Report {
 public:
  /// After each frame; milliseconds: wall clock from setPositions() to contacts.
  void add(const OctreeBasedCD& detection, double milliseconds);

  /// A line per stage (median, p99, worst), octree, pairs, contacts, hash of all results.
  std::string summary() const;
  /// A line per frame.
  std::string csv() const;
  /// A frame with about the median number of contacts of the frames that have any; 0 if none has.
  int typicalFrame() const;

 private:
  struct Frame {
    FrameStatistics statistics;
    double milliseconds;
    OctreeStatistics octree;
    std::uint64_t hash;
  };
  std::vector<Frame> m_frames;
};

/// Written beside its place, then moved there. Throws Error (ErrorCode::File).
void writeWhole(const std::filesystem::path& path, const std::string& content);

/// Throws Error (ErrorCode::File) where it cannot be made or written to.
void makeFolder(const std::filesystem::path& folder);

}  // namespace palpate::scenes
