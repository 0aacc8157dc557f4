#pragma once

#include <palpate/Export.h>
#include <palpate/Types.h>

#include <Eigen/Core>

#include <filesystem>
#include <vector>

namespace palpate::vtk {

struct MeshFile {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Triangle> triangles;

  operator TriangleMeshView() const { return {positions, triangles}; }
};

/// Triangle mesh from an OBJ, STL, PLY, VTK (legacy) or VTP file; the kind follows from the file's
/// name.
///
/// Shapes   the file's own vertices in its order, also those in no triangle; normals, texture
///          coordinates and other attributes ignored. STL has no sharing of its own: its vertices
///          at equal positions become one. Polygons become fans about their first corner, strips
///          become their triangles.
/// Errors   ErrorCode::File, with the file's name and the reason: missing, empty, truncated, not a
///          mesh, an index out of range, a coordinate that is not finite. Nothing is printed.
///          Formats without a count or an end mark (OBJ) that end between two lines cannot be known
///          to be truncated.
/// Threads  safe from many threads.
PALPATE_EXPORT MeshFile readTriangleMesh(const std::filesystem::path& path);

}  // namespace palpate::vtk
