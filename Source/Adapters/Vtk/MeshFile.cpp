#include "Vtk/MeshFile.h"

#include <palpate/Error.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fstream>
#include <limits>
#include <new>

namespace palpate::vtk {

void Polygons::reservePositions(std::size_t more) {
  // A file may have many parts: reserving each alone would take quadratic time.
  if (const std::size_t size = m_positions.size() + more; size > m_positions.capacity())
    m_positions.reserve(std::max(size, m_positions.capacity() + m_positions.capacity() / 2));
}

void Polygons::addPositions(const std::vector<double>& coordinates) {
  reservePositions(coordinates.size() / 3);
  for (std::size_t i = 0; i + 2 < coordinates.size(); i += 3)
    m_positions.emplace_back(coordinates[i], coordinates[i + 1], coordinates[i + 2]);
}

std::size_t Polygons::openCorners() const {
  return m_corners.size() - (m_cells.empty() ? 0 : m_cells.back().end);
}

void Polygons::addCorner(double index, std::size_t first, std::size_t count) {
  const double at = index + static_cast<double>(first);
  const bool isIndex = index >= 0 && index < static_cast<double>(count) && at < kNoCorner &&
                       index == std::floor(index);  // false for NaN
  m_corners.push_back(isIndex ? static_cast<std::uint32_t>(at) : kNoCorner);
}

void Polygons::endCell(bool isStrip) {
  if (openCorners() < 3)
    throw FileFault{(isStrip ? "triangle strip " : "polygon ") + std::to_string(m_cells.size()) +
                    " (from 0) has fewer than three corners"};
  m_cells.push_back({isStrip, m_corners.size()});
}

void Polygons::addCells(std::span<const double> offsets, std::span<const double> all, bool strips,
                        std::size_t first, std::size_t count) {
  for (std::size_t i = 0; i + 1 < offsets.size(); ++i) {
    const std::size_t end = toCount(offsets[i + 1], all.size()), begin = toCount(offsets[i], end);
    for (const double corner : all.subspan(begin, end - begin)) addCorner(corner, first, count);
    endCell(strips);
  }
}

void Polygons::checkPositions() const {
  if (m_positions.size() > std::numeric_limits<std::uint32_t>::max())
    throw FileFault{"it has too many vertices"};
  for (std::size_t v = 0; v < m_positions.size(); ++v)
    if (!m_positions[v].allFinite())
      throw FileFault{"vertex " + std::to_string(v) +
                      " (from 0) has a coordinate that is not finite"};
}

MeshFile Polygons::mesh() && {
  checkPositions();
  m_corners.shrink_to_fit();
  std::vector<Triangle> triangles;
  triangles.reserve(m_corners.size() - 2 * m_cells.size());
  std::size_t begin = 0;
  for (std::size_t cell = 0; cell < m_cells.size(); ++cell) {
    const std::span corners(m_corners.data() + begin, m_cells[cell].end - begin);
    for (const std::uint32_t corner : corners)
      if (corner >= m_positions.size())
        throw FileFault{"polygon " + std::to_string(cell) +
                        " (from 0) has a vertex index out of range; the file has " +
                        std::to_string(m_positions.size()) + " vertices"};
    for (std::size_t i = 2; i < corners.size(); ++i) {
      const std::size_t odd = i % 2;  // every second triangle of a strip is wound the other way
      triangles.push_back(m_cells[cell].isStrip
                              ? Triangle{corners[i - 2 + odd], corners[i - 1 - odd], corners[i]}
                              : Triangle{corners[0], corners[i - 1], corners[i]});
    }
    begin = m_cells[cell].end;
  }
  if (triangles.empty()) throw FileFault{"it has no triangles"};
  return {std::move(m_positions), std::move(triangles)};
}

namespace {

std::string contentOf(const std::filesystem::path& path) {
  std::error_code fault;
  if (!std::filesystem::exists(path, fault)) throw FileFault{"there is no such file"};
  if (std::filesystem::is_directory(path, fault)) throw FileFault{"it is a folder"};
  std::ifstream file(path, std::ios::binary);
  std::string content;
  if (const auto size = std::filesystem::file_size(path, fault); !fault) content.reserve(size);
  char block[1 << 16];
  while (file.read(block, sizeof block) || file.gcount() > 0)
    content.append(block, static_cast<std::size_t>(file.gcount()));
  if (!file.eof() || file.bad()) throw FileFault{"it cannot be read"};
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

}  // namespace

MeshFile readTriangleMesh(const std::filesystem::path& path) {
  const auto refuse = [&](const std::string& reason) {
    return Error(ErrorCode::File,
                 "The mesh file \"" + path.string() + "\" cannot be used: " + reason + ".");
  };
  try {
    return polygonsOf(path).mesh();
  } catch (const FileFault& fault) {
    throw refuse(fault.reason);
  } catch (const std::bad_alloc&) {
    throw refuse("it needs more memory than is available");
  }
}

}  // namespace palpate::vtk
