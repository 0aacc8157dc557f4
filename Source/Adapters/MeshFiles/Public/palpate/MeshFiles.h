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
  std::vector<Tetrahedron> tetrahedra;
  std::vector<Segment> segments;      ///< a polyline of n vertices gives n - 1
  std::vector<std::uint32_t> points;  ///< the vertex of each element that is a point
  std::size_t joinedVertices = 0;     ///< vertices that readMeshFile() joined to others

  operator TriangleMeshView() const { return {positions, triangles}; }
};

struct MeshReadSettings {
  /// L. Joins vertices at equal positions (0) or near ones, as weld() does. Vertices of an STL file
  /// are not shared by its triangles until they are joined. Without a value, none are joined.
  std::optional<double> weldDistance;
};

/// Reads a mesh file. The extension of its name selects the format; upper and lower case are the
/// same.
///
///   .obj          v, p, l and f; normals, texture coordinates, groups and materials are ignored
///   .ply          vertices, faces, triangle strips and edges; text and binary of both byte orders
///   .stl          text and binary
///   .vtk          legacy VTK files, versions 1 to 5.1, text and binary: polygonal data and
///                 unstructured grids
///   .vtp, .vtu    XML files of VTK, of the same two kinds: text, Base64, raw, also compressed by
///                 ZLib or LZ4
///   .msh          Gmsh 2.2 and 4.1, text and binary of both byte orders
///   .mesh         MEDIT, text
///
/// Shapes   all vertices of the file in its order, also those in no element. Polygons become fans
///          about their first corner, strips become their triangles. A grid has the triangles that
///          its file has; SpatialQueries and OctreeBasedCD find a tetrahedral mesh's surface.
///          Other attributes and fields are ignored.
/// Errors   File, with the name of the file, the line or, in binary parts, the byte, and what was
///          expected there: also for a file without elements, for cells of other kinds (by name,
///          such as hexahedra and cells of second order), and for a coordinate that is not finite
///          or beyond kLargestMeasure. An OBJ file that ends between two lines, and a
///          legacy VTK file that ends between two sections, cannot be recognised as truncated.
///          Errors of weld().
/// Cost     linear, and memory of at most 20 times the file's size; ZLib stores up to 1032 bytes
///          in one.
/// Threads  safe from any number of threads. The locale has no effect.
PALPATE_EXPORT MeshArrays readMeshFile(const std::filesystem::path& path,
                                       const MeshReadSettings& settings = {});

struct MeshWriteSettings {
  bool binary = true;   ///< in formats that have both; OBJ and MEDIT files are text
  bool gmsh22 = false;  ///< .msh: version 2.2 instead of 4.1
};

/// Writes a mesh file completely or not at all. The extension selects the format as in
/// readMeshFile(), which gives the same positions, bit for bit, and the same elements in the same
/// order.
///
///   .vtk          polygonal data, or an unstructured grid if there are tetrahedra; version 3.0
///   .vtp, .vtu    binary: raw, appended, not compressed
///   .stl          a binary file rounds positions to floats, and has no vertex without a triangle
///
/// Errors   File: the path names no regular file (a device, pipe or folder stays as it is), cannot
///          be written, or its format has no such elements. NonFinitePosition, IndexOutOfRange and
///          TooLarge (2^31 vertices) for the arrays. The old file then stays as it was.
/// Cost     linear; the file is made in memory first.
PALPATE_EXPORT void writeMeshFile(const std::filesystem::path& path, const MeshArrays& mesh,
                                  const MeshWriteSettings& settings = {});

}  // namespace palpate
