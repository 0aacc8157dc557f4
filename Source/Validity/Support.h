#pragma once

#include <palpate/Settings.h>
#include <palpate/Types.h>

#include <cstdint>

namespace palpate {

/// How a pair is answered. Search/PairWork.h names the work of each kind.
enum class PairKind : std::uint8_t {
  Meshes,         ///< candidates of two octrees
  MeshAndShape,   ///< the elements near an analytical shape
  Shapes,         ///< two analytical shapes
  Field,          ///< the elements near a distance field
  Proxy,          ///< particles by a surface proxy
  AttachedProxy,  ///< Auto: the same, and another method for particles that may touch
};

/// A set of geometry types. A tetrahedral mesh has Triangles, those of its surface.
class GeometryTypes {
 public:
  template <class... Types>
  constexpr GeometryTypes(Types... types) : m_bits((0u | ... | bitOf(types))) {}
  constexpr bool has(GeometryType type) const { return m_bits & bitOf(type); }

 private:
  static constexpr unsigned bitOf(GeometryType type) { return 1u << static_cast<unsigned>(type); }
  unsigned m_bits;
};

/// Conditions of a row of the table of support.
enum SupportConditions : unsigned {
  kNoCondition = 0,
  kInOrder = 1,     ///< the pair's geometries are in the order of the row
  kNotItself = 2,   ///< not for a geometry with itself
  kNeedsStep = 4,   ///< the answer depends on both ends of the step
  kOneRadius = 8,   ///< no geometry may have one radius per vertex
  kNeedsReach = 16  ///< thickness and radii must not all be 0
};

/// A row of the table of support: a method answers pairs of these types, in either order.
struct SupportedPairs {
  Method method;
  GeometryTypes first, second;
  PairKind kind;
  unsigned conditions = kNoCondition;  ///< SupportConditions
  constexpr bool has(SupportConditions condition) const { return conditions & condition; }
};

inline constexpr GeometryTypes kTriangles(GeometryType::Triangles), kPoints(GeometryType::Points),
    kElements(GeometryType::Triangles, GeometryType::Lines, GeometryType::Points),
    kShapes(GeometryType::Shape), kFields(GeometryType::Field),
    kMayHaveField(GeometryType::Triangles, GeometryType::Field);

/// What the library supports, besides two conditions on shapes: not two planes, and sizes whose
/// ratio is at most kMaxSizeRatio. Docs/SupportMatrix.md is for users.
inline constexpr SupportedPairs kSupport[] = {
    {Method::Intersection, kTriangles, kTriangles, PairKind::Meshes},
    {Method::Proximity, kElements, kElements, PairKind::Meshes, kNeedsReach},
    {Method::Proximity, kShapes, kElements, PairKind::MeshAndShape},
    {Method::Proximity, kShapes, kShapes, PairKind::Shapes, kNotItself},
    {Method::Continuous, kElements, kElements, PairKind::Meshes, kNeedsStep | kOneRadius},
    {Method::Continuous, kShapes, kElements, PairKind::MeshAndShape, kNeedsStep | kOneRadius},
    {Method::Continuous, kShapes, kShapes, PairKind::Shapes, kNeedsStep | kNotItself},
    {Method::DistanceField, kMayHaveField, kElements, PairKind::Field, kNotItself},
    {Method::Proxy, kPoints, kTriangles, PairKind::Proxy, kInOrder | kNeedsReach},
    // Auto answers by the methods above.
    {Method::Auto, kElements, kElements, PairKind::Meshes},
    {Method::Auto, kShapes, kElements, PairKind::MeshAndShape},
    {Method::Auto, kShapes, kShapes, PairKind::Shapes, kNotItself},
    {Method::Auto, kFields, kElements, PairKind::Field},
};

/// The row for a method and two types, or null. itself: the two are one geometry.
constexpr const SupportedPairs* supportOf(Method method, GeometryType a, GeometryType b,
                                          bool itself) {
  for (const SupportedPairs& row : kSupport)
    if (row.method == method && !(itself && row.has(kNotItself)) &&
        ((row.first.has(a) && row.second.has(b)) ||
         (!row.has(kInOrder) && row.first.has(b) && row.second.has(a))))
      return &row;
  return nullptr;
}

}  // namespace palpate
