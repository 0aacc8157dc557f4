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
#include <utility>
#include <vector>

namespace palpate {

// Adapters for simulators that keep vectors as contiguous triples of doubles, and that want
// contacts as pairs of cells. Docs/HowTo/FromIMSTK.md shows both in a loop.

static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));

/// The positions in an array of contiguous triples of doubles, in place: valid as the array is.
/// Needs    size() and operator[], whose items are contiguous doubles or contiguous triples.
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

/// A copy of positions in floats or doubles; position i begins at numbers[i * stride].
/// Errors   WrongPositionCount if a position is not whole; InvalidSettings for a stride below 3.
template <class Real>
std::vector<Eigen::Vector3d> copyPositions(std::span<const Real> numbers, std::size_t stride = 3) {
  static_assert(std::is_floating_point_v<Real>);
  if (stride < 3)
    throw Error(ErrorCode::InvalidSettings,
                "The stride is " + std::to_string(stride) + "; it must be at least 3.");
  const std::size_t rest = numbers.size() % stride;
  if (rest == 1 || rest == 2)
    throw Error(ErrorCode::WrongPositionCount,
                std::to_string(numbers.size()) + " numbers with a stride of " +
                    std::to_string(stride) + " are no whole number of positions.");
  std::vector<Eigen::Vector3d> positions;
  positions.reserve(numbers.size() / stride + 1);
  for (std::size_t i = 0; i + 3 <= numbers.size(); i += stride)
    positions.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
  return positions;
}

/// A copy of the elements of an array, with N vertices each, such as 3 for a Triangle.
/// Needs    size() and operator[], whose items are integers of any width or have an operator[].
/// Errors   IndexOutOfRange names the first element with an index that is negative or beyond 32
///          bits, and WrongPositionCount a number of integers that is no multiple of N.
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
      const auto index = [&] {
        if constexpr (kIsFlat)
          return array[N * i + corner];
        else
          return array[static_cast<int>(i)][static_cast<int>(corner)];
      }();
      if (!std::in_range<std::uint32_t>(index))
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

/// The triangles (a, b, c) and (a, c, d) of each quad (a, b, c, d), in order, as elementsOf<4>().
template <class Array>
std::vector<std::array<std::uint32_t, 3>> trianglesOfQuads(const Array& array) {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (const auto& [a, b, c, d] : elementsOf<4>(array)) {
    triangles.push_back({a, b, c});
    triangles.push_back({a, c, d});
  }
  return triangles;
}

template <class CellType>
struct CellTypes {
  CellType vertex, edge, triangle;
};

/// Appends a pair of cells for each contact: one to `a` for the first geometry, one to `b` for the
/// second. A vertex, point or triangle is given by its index (idCount 1), an edge or segment by its
/// two vertices (idCount 2). Contacts with shapes are not included. If the pair's settings name
/// Method::Intersection, all pairs of triangles that intersect follow: a contact may stand for
/// several of them.
/// Order    vertexTriangle(), triangleVertex(), edgeEdge(), intersectingTriangles().
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
    const auto [p, q, r] = contact.vertices;  // {p, p, p} of a point, {p, q, q} of a segment
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
  const Validity validity = contacts.validity();
  if (validity.method != Method::Intersection || validity.reason != MethodReason::Requested) return;
  for (const ElementPair& pair : contacts.intersectingTriangles()) {
    a.push_back(cell(types.triangle, pair.a));
    b.push_back(cell(types.triangle, pair.b));
  }
}

}  // namespace palpate
