#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <filesystem>
#include <vector>

namespace palpate::vtk {

/// The content of a mesh file, in the file's length unit.
struct MeshFile {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Triangle> triangles;

  operator TriangleMeshView() const { return {positions, triangles}; }
};

/// Reads a triangle mesh from an OBJ, STL, PLY, VTK (legacy) or VTP file. The extension of the
/// file's name selects the format; upper and lower case are the same.
///
/// Shapes   all vertices of the file in its order, also those in no triangle. Normals, texture
///          coordinates and other attributes are ignored. STL files do not share vertices: vertices
///          at equal positions become one. Polygons become fans about their first corner, strips
///          become their triangles.
/// Errors   File, with the file's name and the reason: missing, empty, truncated, not a mesh, an
///          index out of range, a coordinate that is not finite. Nothing is printed. OBJ has
///          neither a count nor an end mark; a file that ends between two lines cannot be
///          recognised as truncated.
/// Threads  safe from any number of threads.
PALPATE_EXPORT MeshFile readTriangleMesh(const std::filesystem::path& path);

}  // namespace palpate::vtk
