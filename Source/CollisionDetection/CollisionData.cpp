#include <palpate/CollisionData.h>

#include "NarrowPhase/NarrowPhase.h"

#include <algorithm>
#include <bit>
#include <type_traits>

namespace palpate {

namespace {

/// FNV-1a over 64-bit words.
class Hash {
 public:
  void add(const auto&... values) { (addOne(values), ...); }
  std::uint64_t value() const { return m_value; }

 private:
  template <class T>
  void addOne(const T& value) {
    if constexpr (std::is_floating_point_v<T>) {
      addOne(std::bit_cast<std::uint64_t>(value));
    } else if constexpr (std::is_integral_v<T>) {
      for (int i = 0; i < 64; i += 8)
        m_value = (m_value ^ (std::uint64_t{value} >> i & 0xff)) * 0x100000001b3u;
    } else {
      for (const auto& part : value) addOne(part);
    }
  }

  std::uint64_t m_value = 0xcbf29ce484222325u;
};

}  // namespace

double CollisionData::earliestTimeOfImpact() const {
  double earliest = m_contents.earliestTimeOfImpact;
  forEachTimed(m_contents, [&](const auto& list) {
    for (const auto& contact : list) earliest = std::min(earliest, contact.timeOfImpact);
  });
  return earliest;
}

std::uint64_t CollisionData::hash() const {
  Hash hash;
  for (const auto* list : {&m_contents.vertexTriangle, &m_contents.triangleVertex}) {
    hash.add(list->size());
    for (const VertexTriangleContact& c : *list)
      hash.add(c.vertex, c.triangle, c.weights, c.normal, c.distance, c.timeOfImpact,
               static_cast<std::uint64_t>(c.feature));
  }
  hash.add(m_contents.edgeEdge.size());
  for (const EdgeEdgeContact& c : m_contents.edgeEdge)
    hash.add(c.edgeA, c.edgeB, c.weightA, c.weightB, c.distance, c.timeOfImpact, c.normal,
             static_cast<std::uint64_t>(c.featureA) << 8 | static_cast<std::uint64_t>(c.featureB));
  hash.add(m_contents.intersectingTriangles.size());
  for (const ElementPair& p : m_contents.intersectingTriangles)
    hash.add(std::uint64_t{p.a} << 32 | p.b);
  for (const ShapeContact& c : m_contents.shape)
    hash.add(static_cast<std::uint64_t>(c.element) << 32 | c.id, c.vertices, c.weights, c.point,
             c.pointOnShape, c.normal, c.distance, c.timeOfImpact);
  for (const ShapeShapeContact& c : m_contents.shapeShape)
    hash.add(c.pointA, c.pointB, c.normal, c.distance, c.timeOfImpact);
  if (const double earliest = m_contents.earliestTimeOfImpact; earliest <= 1.0) hash.add(earliest);
  return hash.value();
}

}  // namespace palpate
