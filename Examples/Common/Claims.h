#pragma once

#include <palpate/CollisionData.h>

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <functional>
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

/// A contact that a method reports for two features.
struct Claim {
  FeaturePair features;
  Eigen::Vector3d normal;  ///< unit, from the second mesh towards the first
  double distance;         ///< L; negative: depth
  double time;             ///< the time of the step for which it is reported
  bool example = false;    ///< of triangles that intersect and are reported themselves
  /// The feature with each of the closest points, in the first mesh and in the second.
  std::array<Held, 2> held{};
};

/// All contacts that a method reports in a step, in any order.
struct Claims {
  std::vector<Claim> claims;
  std::vector<ElementPair> triangles;  ///< reported triangle pairs, besides those of the features
  bool ofTriangles = false;            ///< the features of a pair are examples only
  bool distinct = false;               ///< impacts of the same closest features are reported once
  std::optional<bool> trusted;         ///< the method's own statement on this answer, if it has one
};

/// The triangles of each vertex and of each edge.
class Incidence {
 public:
  explicit Incidence(const std::vector<Triangle>& triangles);
  std::vector<std::uint32_t> holding(std::uint32_t vertex) const { return m_byVertex[vertex]; }
  std::vector<std::uint32_t> holding(std::uint32_t p, std::uint32_t q) const;
  const Triangle& corners(std::uint32_t triangle) const { return m_triangles[triangle]; }
  /// Calls f with every pair of triangles that touch where these features touch.
  static void addTriangles(const FeaturePair&, const Incidence& a, const Incidence& b,
                           std::vector<ElementPair>& out);

 private:
  std::vector<std::vector<std::uint32_t>> m_byVertex;
  std::vector<Triangle> m_triangles;
};

/// Finds the claim that represents an unreported impact, if impacts of the same closest features
/// are reported once.
class Substitutes {
 public:
  /// Uses the `distinct` claims within the step. They must outlive this object.
  explicit Substitutes(const Claims&);
  /// The first claim in time whose closest features belong to these elements, or null. It
  /// represents an impact that is not earlier.
  const Claim* find(const FeaturePair&, const Incidence& a, const Incidence& b) const;
  /// The first claim in time about a vertex, an edge or a triangle of these features, or a part of
  /// it, on one side, for which `stands` holds; or null. By the second rule of Contacts::Distinct
  /// it may represent an impact that is not earlier.
  const Claim* findBeside(const FeaturePair&, const Incidence& a, const Incidence& b,
                          const std::function<bool(const Claim&)>& stands) const;

 private:
  std::map<std::array<Held, 2>, const Claim*> m_byHeld;
  std::vector<const Claim*> m_impacts;
};

void sortUnique(std::vector<ElementPair>&);

/// Adds contacts as claims, and whether they are trusted. from, to: the part of the step that was
/// detected.
void addClaims(const CollisionData&, double from, double to, Claims& out);

}  // namespace palpate::accuracy
