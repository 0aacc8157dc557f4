#include "Vtk/MeshFile.h"

#include <palpate/Error.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fstream>
#include <limits>
#include <new>

namespace palpate::vtk {

void Polygons::addPositions(const std::vector<double>& coordinates) {
  for (std::size_t i = 0; i + 2 < coordinates.size(); i += 3)
    positions.emplace_back(coordinates[i], coordinates[i + 1], coordinates[i + 2]);
}

void Polygons::addStrip(std::span<const double> strip) {
  if (strip.size() < 3) throw FileFault{"a triangle strip has fewer than three corners"};
  for (std::size_t i = 0; i + 2 < strip.size(); ++i) {
    const std::size_t odd = i % 2;  // every second triangle of a strip is wound the other way
    corners.push_back({strip[i + odd], strip[i + 1 - odd], strip[i + 2]});
  }
}

void Polygons::addCells(std::span<const double> offsets, std::span<const double> all, bool strips) {
  for (std::size_t i = 0; i + 1 < offsets.size(); ++i) {
    const std::size_t end = toCount(offsets[i + 1], all.size()), begin = toCount(offsets[i], end);
    const auto cell = all.subspan(begin, end - begin);
    strips ? addStrip(cell) : corners.push_back({cell.begin(), cell.end()});
  }
}

namespace {

std::string contentOf(const std::filesystem::path& path) {
  std::error_code fault;
  if (!std::filesystem::exists(path, fault)) throw FileFault{"there is no such file"};
  if (std::filesystem::is_directory(path, fault)) throw FileFault{"it is a folder"};
  std::ifstream file(path, std::ios::binary);
  std::string content{std::istreambuf_iterator<char>(file), {}};
  if (file.fail() || file.bad()) throw FileFault{"it cannot be read"};
  if (content.empty()) throw FileFault{"it is empty"};
  return content;
}

Polygons polygonsOf(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  const std::string content = contentOf(path);
  if (extension == ".obj") return readObj(content);
  if (extension == ".ply") return readPly(content);
  if (extension == ".vtk") return readLegacyVtk(content);
  if (extension == ".stl") return readStl(content);
  if (extension == ".vtp") return readVtp(content);
  throw FileFault{"its name does not end in .obj, .stl, .ply, .vtk or .vtp"};
}

void checkPositions(const std::vector<Eigen::Vector3d>& positions) {
  if (positions.size() > std::numeric_limits<std::uint32_t>::max())
    throw FileFault{"it has too many vertices"};
  for (std::size_t v = 0; v < positions.size(); ++v)
    if (!positions[v].allFinite())
      throw FileFault{"vertex " + std::to_string(v) +
                      " (from 0) has a coordinate that is not finite"};
}

std::vector<Triangle> fans(const Polygons& polygons) {
  const std::size_t count = polygons.positions.size();
  std::vector<Triangle> triangles;
  for (std::size_t p = 0; p < polygons.corners.size(); ++p) {
    const auto fault = [&](const std::string& reason) {
      return FileFault{"polygon " + std::to_string(p) + " (from 0) " + reason};
    };
    std::vector<std::uint32_t> corners;
    for (const double corner : polygons.corners[p]) {
      if (!(corner >= 0 && corner < static_cast<double>(count) && corner == std::floor(corner)))
        throw fault("has a vertex index out of range; the file has " + std::to_string(count) +
                    " vertices");
      corners.push_back(static_cast<std::uint32_t>(corner));
    }
    if (corners.size() < 3) throw fault("has fewer than three corners");
    for (std::size_t i = 2; i < corners.size(); ++i)
      triangles.push_back({corners[0], corners[i - 1], corners[i]});
  }
  if (triangles.empty()) throw FileFault{"it has no triangles"};
  return triangles;
}

}  // namespace

MeshFile readTriangleMesh(const std::filesystem::path& path) {
  const auto refuse = [&](const std::string& reason) {
    return Error(ErrorCode::File,
                 "The mesh file \"" + path.string() + "\" cannot be used: " + reason + ".");
  };
  try {
    Polygons polygons = polygonsOf(path);
    checkPositions(polygons.positions);
    std::vector<Triangle> triangles = fans(polygons);
    return {std::move(polygons.positions), std::move(triangles)};
  } catch (const FileFault& fault) {
    throw refuse(fault.reason);
  } catch (const std::bad_alloc&) {
    throw refuse("it needs more memory than is available");
  }
}

}  // namespace palpate::vtk
