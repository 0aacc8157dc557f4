#pragma once

#include <palpate/CollisionData.h>

#include <Eigen/Core>

#include <array>
#include <cstdint>
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

/// What a method says of two features.
struct Claim {
  FeaturePair features;
  Eigen::Vector3d normal;  ///< unit, from the second mesh towards the first
  double distance;         ///< L; negative: depth
  double time;             ///< of the step, that this is said of
  bool example = false;    ///< of triangles that intersect and are named themselves
};

/// What a method says of a step, in any order.
struct Claims {
  std::vector<Claim> claims;
  std::vector<TrianglePair> triangles;  ///< said to touch, besides those that hold the features
  bool ofTriangles = false;             ///< all of its features are examples
  std::optional<bool> trusted;          ///< its own word on this answer, if it has one
};

/// Which triangles hold a vertex, or an edge.
class Incidence {
 public:
  explicit Incidence(const std::vector<Triangle>& triangles);
  std::vector<std::uint32_t> holding(std::uint32_t vertex) const { return m_byVertex[vertex]; }
  std::vector<std::uint32_t> holding(std::uint32_t p, std::uint32_t q) const;
  /// Every pair of triangles that touch where these features touch.
  static void addTriangles(const FeaturePair&, const Incidence& a, const Incidence& b,
                           std::vector<TrianglePair>& out);

 private:
  std::vector<std::vector<std::uint32_t>> m_byVertex;
};

void sortUnique(std::vector<TrianglePair>&);

/// Contacts as claims, and whether they are trusted, besides those added before. from, to: the part
/// of the step that was detected.
void addClaims(const CollisionData&, double from, double to, Claims& out);

}  // namespace palpate::accuracy
