#include <palpate/MeshFiles.h>

#include "Core/WholeFile.h"
#include "MeshFiles/Formats.h"

#include <palpate/AnalyticalGeometry.h>
#include <palpate/Error.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <new>
#include <string>

namespace palpate {

namespace files {

MeshArrays meshOf(void (*reader)(FileText, MeshBuilder&), std::string_view content) {
  MeshBuilder mesh;
  reader(FileText(content), mesh);
  if (!mesh.fits()) {  // read once more, to name the place of the corner that is out of range
    mesh = MeshBuilder(mesh.positionCount());
    reader(FileText(content), mesh);
  }
  if (mesh.isEmpty()) throw FileFault{"it has no elements"};
  return std::move(mesh).mesh();
}

namespace {

struct Format {
  std::string_view extension;
  void (*read)(FileText, MeshBuilder&);
  std::string (*write)(const MeshArrays&, const MeshWriteSettings&);
  bool hasPoints, hasSegments, hasTetrahedra;
};
constexpr Format kFormats[]{{".obj", readObj, writeObj, true, true, false},
                            {".ply", readPly, writePly, false, true, false},
                            {".stl", readStl, writeStl, false, false, false},
                            {".vtk", readLegacyVtk, writeLegacyVtk, true, true, true},
                            {".vtp", readVtp, writeVtp, true, true, false},
                            {".vtu", readVtu, writeVtu, true, true, true},
                            {".msh", readGmsh, writeGmsh, true, true, true},
                            {".mesh", readMedit, writeMedit, false, true, true}};

const Format& formatOf(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const auto found = std::ranges::find(kFormats, extension, &Format::extension);
  if (found == std::end(kFormats))
    throw FileFault{"its name does not end in .obj, .ply, .stl, .vtk, .vtp, .vtu, .msh or .mesh"};
  return *found;
}

Error refusal(const std::filesystem::path& path, const std::string& reason) {
  return Error(ErrorCode::File,
               "The mesh file \"" + path.string() + "\" cannot be used: " + reason + ".");
}

void join(MeshArrays& mesh, double distance) {
  Welded welded = weld(mesh.positions, mesh.triangles, distance);
  mesh.joinedVertices = mesh.positions.size() - welded.positions.size();
  mesh.positions = std::move(welded.positions);
  mesh.triangles = std::move(welded.triangles);
  const auto renumber = [&](auto& elements) {
    for (auto& element : elements)
      for (std::uint32_t& vertex : element) vertex = welded.vertexOf[vertex];
  };
  renumber(mesh.tetrahedra);
  renumber(mesh.segments);
  for (std::uint32_t& point : mesh.points) point = welded.vertexOf[point];
}

void checkHolds(const Format& format, const MeshArrays& mesh) {
  const auto check = [&](bool isHeld, bool isThere, const char* elements) {
    if (isThere && !isHeld)
      throw FileFault{"the format " + std::string(format.extension) + " has no " + elements};
  };
  check(format.hasPoints, !mesh.points.empty(), "points");
  check(format.hasSegments, !mesh.segments.empty(), "lines");
  check(format.hasTetrahedra, !mesh.tetrahedra.empty(), "tetrahedra");
}

void checkPositions(const MeshArrays& mesh, double largest) {
  if (mesh.positions.size() > std::numeric_limits<std::int32_t>::max())
    throw Error(ErrorCode::TooLarge, "A mesh file has at most 2^31 - 1 vertices.");
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    for (const double x : mesh.positions[v])
      if (!(std::abs(x) <= largest))  // refuses NaN
        throw Error(ErrorCode::NonFinitePosition,
                    "Vertex " + std::to_string(v) + " has the coordinate " + shortest(x) +
                        ", which the file cannot hold.",
                    {}, v);
}

void checkIndices(const MeshArrays& mesh) {
  const auto check = [&](const auto& elements, const char* kind) {
    for (std::size_t i = 0; i < elements.size(); ++i)
      for (const std::uint32_t vertex : elements[i])
        if (vertex >= mesh.positions.size())
          throw Error(ErrorCode::IndexOutOfRange,
                      std::string(kind) + " " + std::to_string(i) + " has vertex " +
                          std::to_string(vertex) + ", but the mesh has " +
                          std::to_string(mesh.positions.size()) + " vertices.",
                      {}, i);
  };
  check(mesh.triangles, "Triangle");
  check(mesh.tetrahedra, "Tetrahedron");
  check(mesh.segments, "Segment");
  check(pointElements(mesh), "Point");
}

}  // namespace
}  // namespace files

MeshArrays readMeshFile(const std::filesystem::path& path, const MeshReadSettings& settings) {
  MeshArrays mesh;
  try {
    const files::Format& format = files::formatOf(path);
    const std::string content = readWholeFile(path, "The mesh file");
    if (content.empty()) throw files::FileFault{"it is empty"};
    mesh = files::meshOf(format.read, content);
  } catch (const files::FileFault& fault) {
    throw files::refusal(path, fault.reason);
  } catch (const std::bad_alloc&) {
    throw files::refusal(path, "it needs more memory than is available");
  }
  if (settings.weldDistance) files::join(mesh, *settings.weldDistance);
  return mesh;
}

void writeMeshFile(const std::filesystem::path& path, const MeshArrays& mesh,
                   const MeshWriteSettings& settings) {
  try {
    const files::Format& format = files::formatOf(path);
    files::checkHolds(format, mesh);
    const bool hasFloats = format.write == files::writeStl && settings.binary;
    files::checkPositions(mesh,
                          hasFloats ? double{std::numeric_limits<float>::max()} : kLargestMeasure);
    files::checkIndices(mesh);
    writeWholeFile(path, format.write(mesh, settings), "The mesh file");
  } catch (const files::FileFault& fault) {
    throw files::refusal(path, fault.reason);
  }
}

}  // namespace palpate
