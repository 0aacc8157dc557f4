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

// Adapters for simulators that keep vectors as contiguous triples of doubles, and that want
// contacts as pairs of cells. Docs/HowTo/FromIMSTK.md shows both in a loop.

static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));

/// The positions in an array of contiguous triples of doubles. Nothing is copied: the span is valid
/// as long as the array.
/// Needs    an array with getPointer(), which returns the first of its triples, and size(), their
///          number.
template <class Array>
std::span<const Eigen::Vector3d> positionsOf(const Array& array) {
  static_assert(sizeof(*array.getPointer()) == sizeof(Eigen::Vector3d));
  return {reinterpret_cast<const Eigen::Vector3d*>(array.getPointer()),
          static_cast<std::size_t>(array.size())};
}

/// A copy of the elements of an array, with N vertices each (Triangle: 3, Segment: 2).
/// Needs    an array with size() and operator[]; its elements have operator[], too.
/// Errors   IndexOutOfRange names the first element with a negative index.
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

/// The cell types of a simulator, for appendCells().
template <class CellType>
struct CellTypes {
  CellType vertex, edge, triangle;
};

/// Appends a pair of cells for each contact: one to `a` for the first geometry, one to `b` for the
/// second. A vertex or triangle is given by its index (idCount 1), an edge by its two vertices
/// (idCount 2). Contacts with analytical shapes are not included.
///
/// Order    vertexTriangle(), triangleVertex(), edgeEdge().
/// Needs    an Element with ids[4], idCount and cellType.
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
