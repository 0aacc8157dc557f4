#pragma once

#include <palpate/CollisionData.h>

#include "Contact/ContactLists.h"
#include "Mesh/TriangleMesh.h"
#include "Core/Assert.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace palpate {

/// The vertices of an element, or of the part of it that holds a closest point.
struct ImpactElement {
  std::array<std::uint32_t, 3> ids{};
  std::size_t size = 0;

  ImpactElement() = default;
  explicit ImpactElement(std::uint32_t vertex) : ids{vertex}, size(1) {}
  explicit ImpactElement(const Segment& edge) : ids{edge[0], edge[1]}, size(2) {}
  explicit ImpactElement(const Triangle& corners)
      : ids{corners[0], corners[1], corners[2]}, size(3) {}

  std::span<const std::uint32_t> vertices() const { return {ids.data(), size}; }
  bool isIn(const ImpactElement& other) const {
    const auto all = other.vertices();
    return std::all_of(
        ids.begin(), ids.begin() + static_cast<std::ptrdiff_t>(size),
        [&](std::uint32_t v) { return std::find(all.begin(), all.end(), v) != all.end(); });
  }
  /// As a vertex {v, v} or an edge.
  Segment feature() const {
    PALPATE_ASSERT(size == 1 || size == 2);
    return {ids[0], ids[size - 1]};
  }
};

/// An impact of a vertex and a triangle, or of two edges, as both sides of the pair see it.
struct SidedImpact {
  std::array<ImpactElement, 2> elements, closest;  ///< of MeshPair::a and MeshPair::b
  std::array<double, 3> weights;  ///< of a triangle's corners; or of the ends' second ones
  Eigen::Vector3d normal;         ///< unit, from b to a
  double time, distance;
  std::size_t vertexSide;  ///< the side of the vertex; 2: two edges
  bool isOfFace;           ///< the closest point is in a triangle's interior

  SidedImpact(ContactKind kind, const VertexTriangleContact& c)
      : weights{c.weights[0], c.weights[1], c.weights[2]},
        normal(kind == ContactKind::TriangleVertex ? Eigen::Vector3d(-c.normal) : c.normal),
        time(c.timeOfImpact),
        distance(c.distance),
        vertexSide(sidesOf(kind)[0]),
        isOfFace(c.feature == TriangleFeature::Face) {
    elements[vertexSide] = closest[vertexSide] = ImpactElement(c.vertex);
    elements[1 - vertexSide] = ImpactElement(c.vertices);
    closest[1 - vertexSide] = closestOf(c);
  }
  SidedImpact(ContactKind, const EdgeEdgeContact& c)
      : elements{ImpactElement(c.edgeA), ImpactElement(c.edgeB)},
        closest{closestOf(c.edgeA, c.featureA), closestOf(c.edgeB, c.featureB)},
        weights{c.weightA, c.weightB, 0.0},
        normal(c.normal),
        time(c.timeOfImpact),
        distance(c.distance),
        vertexSide(2),
        isOfFace(false) {}

  /// From the other side to this one.
  Eigen::Vector3d upTo(std::size_t side) const {
    return side == 0 ? normal : Eigen::Vector3d(-normal);
  }

 private:
  static ImpactElement closestOf(const VertexTriangleContact& c) {
    const int i = static_cast<int>(c.feature);
    if (i < 3) return ImpactElement(c.vertices[i]);
    if (i < 6) return ImpactElement(Segment{c.vertices[i - 3], c.vertices[(i - 2) % 3]});
    return ImpactElement(c.vertices);
  }
  static ImpactElement closestOf(const Segment& ends, EdgeFeature feature) {
    if (feature == EdgeFeature::Interior) return ImpactElement(ends);
    return ImpactElement(ends[feature == EdgeFeature::End]);
  }
};

/// The features that hold an impact's closest points, of MeshPair::a and MeshPair::b, as a key. An
/// edge is given by its two vertices, the lower first, and a vertex by its id twice. self: of one
/// mesh with itself, the two features are in ascending order.
/// Returns  nothing for the interior of a triangle and for the interiors of two edges: no other
///          contact has the same features.
using ImpactFeatures = std::array<std::uint64_t, 2>;
inline std::optional<ImpactFeatures> sharedFeatures(const SidedImpact& c, bool self) {
  if (c.isOfFace || (c.vertexSide == 2 && c.closest[0].size == 2 && c.closest[1].size == 2))
    return {};
  const auto keyOf = [](const ImpactElement& element) {
    const auto [p, q] = element.feature();
    return std::uint64_t{std::min(p, q)} << 32 | std::max(p, q);
  };
  const std::uint64_t a = keyOf(c.closest[0]), b = keyOf(c.closest[1]);
  return self && b < a ? ImpactFeatures{b, a} : ImpactFeatures{a, b};
}

}  // namespace palpate
