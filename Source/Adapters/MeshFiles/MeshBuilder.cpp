#include "MeshFiles/MeshBuilder.h"

#include <palpate/AnalyticalGeometry.h>

#include <algorithm>
#include <cmath>

namespace palpate::files {

namespace {

/// A file may have many parts: reserving each alone would take quadratic time, and a list that
/// doubles, too much memory.
template <class T>
void reserveMore(std::vector<T>& list, std::size_t more) {
  if (const std::size_t size = list.size() + more; size > list.capacity())
    list.reserve(std::max(size, list.capacity() + list.capacity() / 2));
}

void checkCorners(std::size_t corners, Cell cell, const FileText& at) {
  constexpr const char* kNames[]{"a cell of points", "a line", "a polygon", "a triangle strip",
                                 "a tetrahedron"};
  constexpr std::size_t kLeast[]{1, 2, 3, 3, 4};
  const auto kind = static_cast<std::size_t>(cell);
  const bool isExact = cell == Cell::Tetrahedron;
  if (corners < kLeast[kind] || (isExact && corners > kLeast[kind]))
    at.refuse("expected " + std::string(kNames[kind]) + " of " + (isExact ? "" : "at least ") +
              std::to_string(kLeast[kind]) + " corners, not " + std::to_string(corners));
}

}  // namespace

void MeshBuilder::reservePositions(std::size_t more) { reserveMore(m_mesh.positions, more); }

void MeshBuilder::addPosition(const Eigen::Vector3d& position, const FileText& at) {
  if (positionCount() == kNoElement) at.refuse("expected fewer than 2^32 - 1 vertices");
  for (const double x : position)
    if (!(std::abs(x) <= kLargestMeasure))  // refuses NaN
      at.refuse("vertex " + std::to_string(positionCount()) +
                " (from 0): expected a finite coordinate of at most 1e300, not " + shortest(x));
  m_mesh.positions.push_back(position);
}

void MeshBuilder::readPositions(FileText& text, const NumberType& type, std::size_t count) {
  text.checkCount(count, "vertices", 3 * (text.isText() ? 2 : type.size));
  reservePositions(count);
  for (std::size_t i = 0; i < count; ++i) {
    Eigen::Vector3d position;
    for (double& x : position) x = text.number(type);
    addPosition(position, text);
  }
}

void MeshBuilder::useVertices(std::size_t first, std::size_t count) {
  m_first = first;
  m_vertices = count;
}

void MeshBuilder::addCorner(double index, const FileText& at, int base) {
  const double inside = index - base;
  const bool isWhole = inside >= 0 && inside < kNoElement && inside == std::floor(inside);
  if (m_vertices != kUnknown && !(isWhole && inside < static_cast<double>(m_vertices)))
    at.refuse("expected the index of one of the " + std::to_string(m_vertices) +
              " vertices, counted from " + std::to_string(base) + ", not " + shortest(index));
  const std::size_t corner =
      isWhole ? m_first + static_cast<std::size_t>(inside) : std::size_t{kNoElement};
  m_end = std::max(m_end, corner + 1);
  m_corners.push_back(static_cast<std::uint32_t>(corner));
}

void MeshBuilder::addTriangles(bool isStrip) {
  const std::vector<std::uint32_t>& corners = m_corners;
  reserveMore(m_mesh.triangles, corners.size() - 2);
  for (std::size_t i = 2; i < corners.size(); ++i) {
    const std::size_t odd = i % 2;  // every second triangle of a strip is wound the other way
    m_mesh.triangles.push_back(
        isStrip ? Triangle{corners[i - 2 + odd], corners[i - 1 - odd], corners[i]}
                : Triangle{corners[0], corners[i - 1], corners[i]});
  }
}

void MeshBuilder::endCell(Cell cell, const FileText& at) {
  checkCorners(m_corners.size(), cell, at);
  const std::vector<std::uint32_t>& c = m_corners;
  if (cell == Cell::Points) {
    reserveMore(m_mesh.points, c.size());
    m_mesh.points.insert(m_mesh.points.end(), c.begin(), c.end());
  } else if (cell == Cell::Polyline) {
    reserveMore(m_mesh.segments, c.size() - 1);
    for (std::size_t i = 1; i < c.size(); ++i) m_mesh.segments.push_back({c[i - 1], c[i]});
  } else if (cell == Cell::Tetrahedron) {
    reserveMore(m_mesh.tetrahedra, 1);
    m_mesh.tetrahedra.push_back({c[0], c[1], c[2], c[3]});
  } else {
    addTriangles(cell == Cell::Strip);
  }
  m_corners.clear();
}

bool MeshBuilder::isEmpty() const {
  return m_mesh.triangles.empty() && m_mesh.tetrahedra.empty() && m_mesh.segments.empty() &&
         m_mesh.points.empty();
}

MeshArrays MeshBuilder::mesh() && { return std::move(m_mesh); }

}  // namespace palpate::files
