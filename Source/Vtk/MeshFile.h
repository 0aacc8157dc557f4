#pragma once

#include <palpate/vtk/MeshFile.h>

#include <span>
#include <string>
#include <string_view>

namespace palpate::vtk {

/// Why a file is refused: the sentence's part after its name.
struct FileFault {
  std::string reason;
};

/// What the formats have in common. Corners as the file gives them: not yet checked.
struct Polygons {
  std::vector<Eigen::Vector3d> positions;
  std::vector<double> corners;
  std::vector<std::size_t> ends;  ///< polygon i's corners end before corners[ends[i]]

  void addPositions(const std::vector<double>& coordinates);
  void addPolygon(std::span<const double> polygon);
  void addStrip(std::span<const double> strip);
  /// Cell i: corners [offsets[i], offsets[i + 1]) of `all`.
  void addCells(const std::vector<double>& offsets, std::span<const double> all, bool strips);
};

// One function for each format, from the file's content; FileFault if it is not what it should be.
Polygons readObj(std::string_view content);
Polygons readPly(std::string_view content);
Polygons readLegacyVtk(std::string_view content);
Polygons readStl(std::string_view content, const std::string& path);
Polygons readVtp(std::string_view content);

}  // namespace palpate::vtk
