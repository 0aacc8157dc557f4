// Part of Python/Classes.h: mesh files.

#include "Python/Classes.h"
#include "Python/Collisions.h"

#ifdef PALPATE_HAS_MESH_FILES
#include <palpate/MeshFiles.h>
#endif

namespace palpate::python {
namespace {

using Object = const py::object&;

#ifdef PALPATE_HAS_MESH_FILES
template <class T>
std::vector<T> listOf(std::span<const T> values) {
  return {values.begin(), values.end()};
}
#else
[[noreturn]] void refuse() {
  throw Error(ErrorCode::NotAvailable, "This build of palpate has no mesh files.");
}
#endif

py::object read([[maybe_unused]] const std::filesystem::path& path,
                [[maybe_unused]] std::optional<double> weldDistance) {
#ifdef PALPATE_HAS_MESH_FILES
  MeshArrays mesh;
  {
    const py::gil_scoped_release release;
    mesh = readMeshFile(path, {weldDistance});
  }
  return lookedUp<MeshArrays>("palpate", "MeshArrays")(
      copyOf(mesh.positions), copyOf<3>(mesh.triangles), copyOf<4>(mesh.tetrahedra),
      copyOf<2>(mesh.segments), copyOf(mesh.points), mesh.joinedVertices);
#else
  refuse();
#endif
}

void write([[maybe_unused]] const std::filesystem::path& path, [[maybe_unused]] Object mesh,
           [[maybe_unused]] bool binary, [[maybe_unused]] bool gmsh22) {
#ifdef PALPATE_HAS_MESH_FILES
  const Positions positions(mesh.attr("positions"), "positions");
  const Elements<3> triangles(mesh.attr("triangles"), "triangles");
  const Elements<4> tetrahedra(mesh.attr("tetrahedra"), "tetrahedra");
  const Elements<2> segments(mesh.attr("segments"), "segments");
  const Indices points(mesh.attr("points"), 1, "points");
  const py::gil_scoped_release release;
  writeMeshFile(path,
                {listOf(positions.span()), listOf(triangles.span()), listOf(tetrahedra.span()),
                 listOf(segments.span()), listOf(points.all())},
                {binary, gmsh22});
#else
  refuse();
#endif
}

}  // namespace

void addMeshFiles(py::module_& module) {
  module.def("read_mesh_file", &read, py::arg("path"), py::kw_only(),
             py::arg("weld_distance") = py::none(),
             R"(read_mesh_file(path, *, weld_distance=None) -> MeshArrays

Reads a mesh file: .obj, .ply, .stl, .vtk, .vtp, .vtu, .msh or .mesh.

weld_distance  L: joins vertices at equal positions (0), or at most this far apart, as those of an
               STL file. None joins none.)");
  module.def("write_mesh_file", &write, py::arg("path"), py::arg("mesh"), py::kw_only(),
             py::arg("binary") = true, py::arg("gmsh22") = false,
             R"(write_mesh_file(path, mesh, *, binary=True, gmsh22=False) -> None

Writes MeshArrays to a file of one of these formats, completely or not at all.

binary  in formats that have both
gmsh22  .msh: version 2.2 instead of 4.1)");
}

}  // namespace palpate::python
