#pragma once

#include <palpate/CollisionData.h>
#include <palpate/Error.h>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

namespace palpate {

// Adapters for simulators that keep vectors as contiguous triples of doubles, and that want
// contacts as pairs of cells. Docs/HowTo/FromIMSTK.md shows both in a loop.

static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));

/// The positions in an array of contiguous triples of doubles. Nothing is copied: the span is valid
/// as long as the array.
/// Needs    an array with size() and operator[]. Its items are contiguous doubles, three for each
///          position, as in a std::vector<double>; or contiguous triples of doubles.
/// Errors   WrongPositionCount for a number of doubles that is no multiple of 3.
template <class Array>
std::span<const Eigen::Vector3d> positionsOf(const Array& array) {
  using Item = std::remove_cvref_t<decltype(array[0])>;
  auto size = static_cast<std::size_t>(array.size());
  if constexpr (std::is_arithmetic_v<Item>) {
    static_assert(std::is_same_v<Item, double>);
    if (size % 3 != 0)
      throw Error(ErrorCode::WrongPositionCount,
                  std::to_string(size) + " coordinates are no whole number of positions.");
    size /= 3;
  } else {
    static_assert(sizeof(Item) == sizeof(Eigen::Vector3d));
  }
  if (size == 0) return {};
  return {reinterpret_cast<const Eigen::Vector3d*>(&array[0]), size};
}

/// A copy of the elements of an array, with N vertices each: 2 for a Segment, 3 for a Triangle, 4
/// for a Tetrahedron.
/// Needs    an array with size() and operator[]. Its items are integers, N for each element, or
///          have an operator[] themselves.
/// Errors   IndexOutOfRange names the first element with a negative index, and WrongPositionCount a
///          number of integers that is no multiple of N.
template <std::size_t N, class Array>
std::vector<std::array<std::uint32_t, N>> elementsOf(const Array& array) {
  constexpr bool kIsFlat = std::is_integral_v<std::remove_cvref_t<decltype(array[0])>>;
  auto size = static_cast<std::size_t>(array.size());
  if constexpr (kIsFlat) {
    if (size % N != 0)
      throw Error(ErrorCode::WrongPositionCount,
                  std::to_string(size) + " indices are no whole number of elements of " +
                      std::to_string(N) + " vertices.");
    size /= N;
  }
  std::vector<std::array<std::uint32_t, N>> elements;
  for (std::size_t i = 0; i < size; ++i) {
    std::array<std::uint32_t, N> element;
    for (std::size_t corner = 0; corner < N; ++corner) {
      long long index;
      if constexpr (kIsFlat)
        index = static_cast<long long>(array[N * i + corner]);
      else
        index = static_cast<long long>(array[static_cast<int>(i)][static_cast<int>(corner)]);
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
/// second. A vertex or triangle is given by its index (idCount 1), an edge or a segment by its two
/// vertices (idCount 2). A point of a point set is a vertex. The index of a triangle of a
/// tetrahedral mesh is that in OctreeBasedCD::surface(). Contacts with analytical shapes are not
/// included.
///
/// Order    vertexTriangle(), triangleVertex(), edgeEdge(); one cell per contact.
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
  const auto element = [&](const VertexTriangleContact& contact) {
    const auto [p, q, r] = contact.corners;  // {p, p, p} of a point, {p, q, q} of a segment
    if (p == q && q == r) return cell(types.vertex, p);
    return q == r ? edge({p, q}) : cell(types.triangle, contact.triangle);
  };
  for (const VertexTriangleContact& contact : contacts.vertexTriangle()) {
    a.push_back(cell(types.vertex, contact.vertex));
    b.push_back(element(contact));
  }
  for (const VertexTriangleContact& contact : contacts.triangleVertex()) {
    a.push_back(element(contact));
    b.push_back(cell(types.vertex, contact.vertex));
  }
  for (const EdgeEdgeContact& contact : contacts.edgeEdge()) {
    a.push_back(edge(contact.edgeA));
    b.push_back(edge(contact.edgeB));
  }
}

}  // namespace palpate
