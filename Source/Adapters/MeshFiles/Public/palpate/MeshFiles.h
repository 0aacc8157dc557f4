#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

namespace palpate {

/// Positions and elements of a mesh, as the functions of OctreeBasedCD take them.
struct MeshArrays {
  std::vector<Eigen::Vector3d> positions;  ///< L: the file's length unit
  std::vector<Triangle> triangles;
  std::vector<Tetrahedron> tetrahedra{};
  std::vector<Segment> segments{};      ///< a polyline of n vertices gives n - 1
  std::vector<std::uint32_t> points{};  ///< the vertex of each element that is a point
  std::size_t joinedVertices = 0;       ///< vertices that readMeshFile() joined to others

  operator TriangleMeshView() const { return {positions, triangles}; }
};

struct MeshReadSettings {
  /// L: joins vertices as weld() does, at equal positions (0) or near ones. Without a value: none.
  std::optional<double> weldDistance;
};

/// Reads a mesh file in the format of its extension, of either case: .obj, .ply, .stl, .vtk, .vtp,
/// .vtu, .msh or .mesh. Docs/HowTo/Organs.md says what each may have.
/// Shapes   all vertices in the file's order. Polygons become fans about their first corner, strips
///          triangles. A grid has the triangles of its file. Other data are ignored.
/// Errors   File, with the name, the line or byte, and what was expected there; also without
///          elements, for other cells (by name), and for a coordinate not finite or beyond
///          kLargestMeasure. OBJ and legacy VTK files truncated between lines or sections are not
///          recognised. Those of weld().
/// Cost     linear; memory of 20 times the file's size at most; ZLib stores 1032 bytes in one.
/// Threads  safe from any number of threads. The locale has no effect.
PALPATE_EXPORT MeshArrays readMeshFile(const std::filesystem::path& path,
                                       const MeshReadSettings& settings = {});

struct MeshWriteSettings {
  bool binary = true;   ///< in formats that have both; OBJ and MEDIT files are text
  bool gmsh22 = false;  ///< .msh: version 2.2 instead of 4.1
};

/// Writes a file completely or not at all. readMeshFile() then gives the same, in order; binary
/// .stl rounds positions to floats, and has no vertex without a triangle.
/// Errors   File for a path that is no regular file or cannot be written, or elements that it
///          lacks; NonFinitePosition, IndexOutOfRange, TooLarge (2^31 vertices). An old file stays.
/// Cost     linear; the file is made in memory first.
PALPATE_EXPORT void writeMeshFile(const std::filesystem::path& path, const MeshArrays& mesh,
                                  const MeshWriteSettings& settings = {});

}  // namespace palpate
