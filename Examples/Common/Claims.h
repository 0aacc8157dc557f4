#pragma once

#include <palpate/CollisionData.h>

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

namespace palpate::accuracy {

/// Two features: a vertex of the first mesh and a triangle of the second, a triangle and a vertex,
/// two edges by their ends (lower first), or two triangles.
struct FeaturePair {
  enum class Kind : std::uint8_t { VertexTriangle, TriangleVertex, EdgeEdge, Triangles } kind;
  std::array<std::uint32_t, 4> ids{};
  friend auto operator<=>(const FeaturePair&, const FeaturePair&) = default;
};

/// A vertex, an edge or a triangle by its vertices, ascending, the last one repeated.
using Held = std::array<std::uint32_t, 3>;

/// What a method says of two features.
struct Claim {
  FeaturePair features;
  Eigen::Vector3d normal;  ///< unit, from the second mesh towards the first
  double distance;         ///< L; negative: depth
  double time;             ///< of the step, that this is said of
  bool example = false;    ///< of triangles that intersect and are named themselves
  /// What holds the two closest points, in the first mesh and in the second.
  std::array<Held, 2> held{};
};

/// What a method says of a step, in any order.
struct Claims {
  std::vector<Claim> claims;
  std::vector<ElementPair> triangles;  ///< said to touch, besides those that hold the features
  bool ofTriangles = false;            ///< all of its features are examples
  bool distinct = false;               ///< impacts of the same closest features are said once
  std::optional<bool> trusted;         ///< its own word on this answer, if it has one
};

/// Which triangles hold a vertex, or an edge.
class Incidence {
 public:
  explicit Incidence(const std::vector<Triangle>& triangles);
  std::vector<std::uint32_t> holding(std::uint32_t vertex) const { return m_byVertex[vertex]; }
  std::vector<std::uint32_t> holding(std::uint32_t p, std::uint32_t q) const;
  const Triangle& corners(std::uint32_t triangle) const { return m_triangles[triangle]; }
  /// Every pair of triangles that touch where these features touch.
  static void addTriangles(const FeaturePair&, const Incidence& a, const Incidence& b,
                           std::vector<ElementPair>& out);

 private:
  std::vector<std::vector<std::uint32_t>> m_byVertex;
  std::vector<Triangle> m_triangles;
};

/// Which claim stands for an impact that is not claimed itself, where impacts of the same closest
/// features are said once.
class Substitutes {
 public:
  /// Those of `distinct` claims within the step; the claims must outlive this.
  explicit Substitutes(const Claims&);
  /// The first claim in time whose closest features belong to these elements; null if there is
  /// none. It stands for an impact that is not earlier.
  const Claim* find(const FeaturePair&, const Incidence& a, const Incidence& b) const;

 private:
  std::map<std::array<Held, 2>, const Claim*> m_byHeld;
};

void sortUnique(std::vector<ElementPair>&);

/// Contacts as claims, and whether they are trusted, besides those added before. from, to: the part
/// of the step that was detected.
void addClaims(const CollisionData&, double from, double to, Claims& out);

}  // namespace palpate::accuracy
