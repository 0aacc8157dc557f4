#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Error.h>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace palpate {

// For simulators that keep vectors as contiguous triples (VecDataArray and its like) and want
// contacts as cells: Docs/FromIMSTK.md shows both in a loop.

static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));

/// Contiguous double triples where they are: nothing is copied.
/// Needs    an array with getPointer(), to double triples in a row, and size(), their number.
template <class Array>
std::span<const Eigen::Vector3d> positionsOf(const Array& array) {
  static_assert(sizeof(*array.getPointer()) == sizeof(Eigen::Vector3d));
  return {reinterpret_cast<const Eigen::Vector3d*>(array.getPointer()),
          static_cast<std::size_t>(array.size())};
}

/// Elements of N vertices (Triangle: 3, Segment: 2), copied: topology is handed over once.
/// Needs    an array with size() and operator[], whose elements have operator[] in turn.
/// Errors   IndexOutOfRange names the element with an index below 0.
template <std::size_t N, class Array>
std::vector<std::array<std::uint32_t, N>> elementsOf(const Array& array) {
  std::vector<std::array<std::uint32_t, N>> elements;
  for (std::size_t i = 0; i < static_cast<std::size_t>(array.size()); ++i) {
    std::array<std::uint32_t, N> element;
    for (std::size_t corner = 0; corner < N; ++corner) {
      const auto index =
          static_cast<long long>(array[static_cast<int>(i)][static_cast<int>(corner)]);
      if (index < 0)
        throw Error(
            ErrorCode::IndexOutOfRange,
            "Element " + std::to_string(i) + " has the index " + std::to_string(index) + ".", {},
            i);
      element[corner] = static_cast<std::uint32_t>(index);
    }
    elements.push_back(element);
  }
  return elements;
}

/// A simulator's own names of cells.
template <class CellType>
struct CellTypes {
  CellType vertex, edge, triangle;
};

/// Contacts as pairs of cells: element i of `a` against element i of `b`, in the order
/// vertexTriangle(), triangleVertex(), edgeEdge(). Vertices and triangles are given by their
/// number (idCount 1), edges by their two vertices (idCount 2).
/// Needs    Element with ids[4], idCount and cellType.
template <class Element, class CellType>
void appendCells(const CollisionData& contacts, const CellTypes<CellType>& types,
                 std::vector<Element>& a, std::vector<Element>& b) {
  const auto cell = [](CellType type, std::uint32_t id) {
    Element element{};
    element.ids[0] = static_cast<int>(id);
    for (int i = 1; i < 4; ++i) element.ids[i] = -1;
    element.idCount = 1;
    element.cellType = type;
    return element;
  };
  const auto edge = [&](const std::array<std::uint32_t, 2>& ends) {
    Element element = cell(types.edge, ends[0]);
    element.ids[1] = static_cast<int>(ends[1]);
    element.idCount = 2;
    return element;
  };
  for (const VertexTriangleContact& contact : contacts.vertexTriangle()) {
    a.push_back(cell(types.vertex, contact.vertex));
    b.push_back(cell(types.triangle, contact.triangle));
  }
  for (const VertexTriangleContact& contact : contacts.triangleVertex()) {
    a.push_back(cell(types.triangle, contact.triangle));
    b.push_back(cell(types.vertex, contact.vertex));
  }
  for (const EdgeEdgeContact& contact : contacts.edgeEdge()) {
    a.push_back(edge(contact.edgeA));
    b.push_back(edge(contact.edgeB));
  }
}

}  // namespace palpate
