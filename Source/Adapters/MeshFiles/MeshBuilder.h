#pragma once

#include "MeshFiles/FileText.h"

#include <palpate/MeshFiles.h>

#include <limits>

namespace palpate::files {

enum class Cell { Points, Polyline, Polygon, Strip, Tetrahedron };

/// The mesh of a file that is being read. A file's content may be hostile: each list grows only by
/// what the file really has. Faults are thrown at the place of a text.
class MeshBuilder {
 public:
  /// Without the number of vertices, corners out of range are noticed at the end only: see fits().
  explicit MeshBuilder(std::size_t vertices = kUnknown) : m_vertices(vertices) {}

  void reservePositions(std::size_t more);
  void addPosition(const Eigen::Vector3d&, const FileText& at);
  /// Reads the coordinates of so many vertices.
  void readPositions(FileText&, const NumberType&, std::size_t count);
  std::size_t positionCount() const { return m_mesh.positions.size(); }

  /// The next corners are indices into the vertices from `first` on, of which there are `count`.
  void useVertices(std::size_t first, std::size_t count);
  void reserveCorners(std::size_t count) { m_corners.reserve(count); }
  /// Adds a corner to the cell that endCell() will end. base: the first vertex's index in the file.
  void addCorner(double index, const FileText& at, int base = 0);
  std::size_t openCorners() const { return m_corners.size(); }
  void endCell(Cell, const FileText& at);

  /// Whether no corner was out of range.
  bool fits() const { return m_end <= positionCount(); }
  bool isEmpty() const;
  MeshArrays mesh() &&;

 private:
  static constexpr std::size_t kUnknown = std::numeric_limits<std::size_t>::max();
  void addTriangles(bool isStrip);

  std::size_t m_vertices, m_first = 0, m_end = 0;  ///< m_end: above all corners
  std::vector<std::uint32_t> m_corners;
  MeshArrays m_mesh;
};

}  // namespace palpate::files
