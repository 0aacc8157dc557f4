#pragma once

#include "World.h"

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::scenes {

/// A VTK XML file of polygonal data (.vtp), as text.
class VtpText {
 public:
  std::vector<Eigen::Vector3d> points;
  std::vector<Triangle> triangles;
  std::vector<Segment> lines;
  std::vector<std::uint32_t> vertices;
  /// A value, or the three of a vector, for each point or for each cell: vertices, lines,
  /// triangles.
  void addPointField(const std::string& name, const std::vector<double>& values,
                     int components = 1);
  void addCellField(const std::string& name, const std::vector<double>& values);
  std::string text() const;

 private:
  std::string m_pointFields, m_cellFields;
};

/// All bodies; field "body".
VtpText bodiesVtp(World&);
/// A point in the middle of each contact, with the fields "distance", "time of impact", "normal",
/// "pair" and "kind" (0: vertex-triangle, 1: triangle-vertex, 2: edge-edge, 3: shape, 4: two
/// shapes).
VtpText contactsVtp(World&);
/// Edges of the cells that hold elements, with the fields "depth", "elements" and "geometry".
VtpText octreeVtp(const LooseOctree&);

/// Frames of a run as FOLDER/{bodies,contacts,octree}_N.vtp, and FOLDER/NAME.pvd over them. If the
/// run fails, nothing is written.
class ParaViewSeries {
 public:
  /// Throws Error (ErrorCode::File) if the folder cannot be made or written to.
  explicit ParaViewSeries(std::filesystem::path folder);
  ~ParaViewSeries();
  ParaViewSeries(const ParaViewSeries&) = delete;
  ParaViewSeries& operator=(const ParaViewSeries&) = delete;
  void add(World&);
  void finish(const std::string& name);  ///< replaces what was there

 private:
  std::filesystem::path m_folder, m_partial;
  std::string m_entries;
  int m_frames = 0;
};

}  // namespace palpate::scenes
