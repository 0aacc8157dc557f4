#pragma once

#include <palpate/ConstraintRows.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/palpate_c.h>

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

/// Structs of C and of C++ as lists of numbers, by the names of their members.
namespace palpate::testing {

using Numbers = std::vector<std::uint64_t>;

struct Tag {};  // for the look-up of bitsOf() where it is called

template <class T>
Numbers bitsOf(Tag, const T& value) requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) {
  return {std::bit_cast<std::uint64_t>(static_cast<double>(value))};
}
template <class T>
Numbers numbersOf(const T& value) {
  return bitsOf(Tag{}, value);
}
template <class... T>
Numbers listOf(const T&... members);

template <class List>
Numbers numbersOfList(const List& list) {
  Numbers numbers;
  for (const auto& item : list) {
    const Numbers more = numbersOf(item);
    numbers.insert(numbers.end(), more.begin(), more.end());
  }
  return numbers;
}
template <class T, std::size_t N>
Numbers bitsOf(Tag, const T (&list)[N]) {
  return numbersOfList(list);
}
template <class T, std::size_t N>
Numbers bitsOf(Tag, const std::array<T, N>& list) {
  return numbersOfList(list);
}
inline Numbers bitsOf(Tag, const Eigen::Vector3d& v) { return listOf(v[0], v[1], v[2]); }

inline Numbers bitsOf(Tag, const palpate_pair& p) { return listOf(p.a, p.b); }
inline Numbers bitsOf(Tag, const ElementPair& p) { return listOf(p.a, p.b); }

inline Numbers bitsOf(Tag, const palpate_unfinished_pair& p) {
  return listOf(p.a, p.b, p.distance_bound, p.age, p.exceeds_budget);
}
inline Numbers bitsOf(Tag, const UnfinishedPair& p) {
  return listOf(p.a, p.b, p.distanceBound, p.age, p.exceedsBudget);
}

inline Numbers bitsOf(Tag, const palpate_vertex_triangle& c) {
  return listOf(c.vertex, c.triangle, c.vertices, c.weights, c.normal, c.distance, c.time_of_impact,
                c.feature);
}
inline Numbers bitsOf(Tag, const VertexTriangleContact& c) {
  return listOf(c.vertex, c.triangle, c.vertices, c.weights, c.normal, c.distance, c.timeOfImpact,
                c.feature);
}
inline Numbers bitsOf(Tag, const palpate_edge_edge& c) {
  return listOf(c.edge_a, c.edge_b, c.weight_a, c.weight_b, c.normal, c.distance, c.time_of_impact,
                c.feature_a, c.feature_b);
}
inline Numbers bitsOf(Tag, const EdgeEdgeContact& c) {
  return listOf(c.edgeA, c.edgeB, c.weightA, c.weightB, c.normal, c.distance, c.timeOfImpact,
                c.featureA, c.featureB);
}
inline Numbers bitsOf(Tag, const palpate_shape_contact& c) {
  return listOf(c.element, c.id, c.vertices, c.weights, c.point, c.point_on_shape, c.normal,
                c.distance, c.time_of_impact);
}
inline Numbers bitsOf(Tag, const ShapeContact& c) {
  return listOf(c.element, c.id, c.vertices, c.weights, c.point, c.pointOnShape, c.normal,
                c.distance, c.timeOfImpact);
}
inline Numbers bitsOf(Tag, const palpate_shape_shape& c) {
  return listOf(c.point_a, c.point_b, c.normal, c.distance, c.time_of_impact);
}
inline Numbers bitsOf(Tag, const ShapeShapeContact& c) {
  return listOf(c.pointA, c.pointB, c.normal, c.distance, c.timeOfImpact);
}
inline Numbers bitsOf(Tag, const palpate_contact_key& k) { return listOf(k.kind, k.ids); }
inline Numbers bitsOf(Tag, const ContactKey& k) { return listOf(k.kind, k.ids); }
inline Numbers bitsOf(Tag, const palpate_tracked_contact& c) {
  return listOf(c.key, c.predecessor, c.age, c.has_predecessor, c.end, c.user_data);
}
inline Numbers bitsOf(Tag, const TrackedContact& c) {
  return listOf(c.key, c.predecessor.value_or(ContactKey{}), c.age, c.predecessor.has_value(),
                c.end, c.userData);
}
inline Numbers bitsOf(Tag, const palpate_crossing& c) {
  return listOf(c.kind, c.ids, c.time, c.forward);
}
inline Numbers bitsOf(Tag, const Crossing& c) { return listOf(c.kind, c.ids, c.time, c.forward); }
inline Numbers bitsOf(Tag, const palpate_row& r) {
  return listOf(r.vertices, r.weights, r.normal, r.offset);
}
inline Numbers bitsOf(Tag, const ConstraintRow& r) {
  return listOf(r.vertices, r.weights, r.normal, r.offset);
}
inline Numbers bitsOf(Tag, const palpate_contact_motion& m) {
  return listOf(m.point, m.opposite, m.relative_displacement);
}
inline Numbers bitsOf(Tag, const ContactMotion& m) {
  return listOf(m.point, m.opposite, m.relativeDisplacement);
}

/// Without vertices and weights, which have no meaning where there is no element.
template <class Point>
Numbers pointNumbers(const Point& p) {
  if (p.element == kNoElement) return listOf(p.element, p.distance);
  return listOf(p.geometry, p.element, p.vertices, p.weights, p.position, p.distance, p.normal);
}
inline Numbers bitsOf(Tag, const palpate_surface_point& p) { return pointNumbers(p); }
inline Numbers bitsOf(Tag, const SurfacePoint& p) { return pointNumbers(p); }
inline Numbers bitsOf(Tag, const palpate_signed_distance& d) {
  return listOf(d.nearest, d.distance);
}
inline Numbers bitsOf(Tag, const SignedDistance& d) { return listOf(d.nearest, d.distance); }
inline Numbers bitsOf(Tag, const palpate_hit& h) {
  if (h.element == kNoElement) return listOf(h.element, h.t);
  return listOf(h.geometry, h.element, h.vertices, h.weights, h.t, h.front_face, h.crosses);
}
inline Numbers bitsOf(Tag, const RayHit& h) {
  if (h.element == kNoElement) return listOf(h.element, h.t);
  return listOf(h.geometry, h.element, h.vertices, h.weights, h.t, h.frontFace, h.crosses);
}
inline Numbers bitsOf(Tag, const palpate_pick& p) { return listOf(p.hit, p.vertex, p.edge); }
inline Numbers bitsOf(Tag, const Pick& p) { return listOf(p.hit, p.vertex, p.edge); }
inline Numbers bitsOf(Tag, const palpate_distance& d) { return listOf(d.a, d.b, d.distance); }
inline Numbers bitsOf(Tag, const GeometryDistance& d) { return listOf(d.a, d.b, d.distance); }
inline Numbers bitsOf(Tag, const palpate_penetration& p) {
  return listOf(p.intersecting, p.direction, p.depth, p.a, p.b, p.minimal);
}
inline Numbers bitsOf(Tag, const Penetration& p) {
  return listOf(p.intersecting, p.direction, p.depth, p.a, p.b, p.minimal);
}
inline Numbers bitsOf(Tag, const palpate_path_interval& p) {
  return listOf(p.body, p.enter, p.leave, p.entry_element, p.exit_element);
}
inline Numbers bitsOf(Tag, const PathInterval& p) {
  return listOf(p.body, p.enter, p.leave, p.entryElement, p.exitElement);
}
inline Numbers bitsOf(Tag, const palpate_path_clearance& p) {
  return listOf(p.body, p.distance, p.at, p.nearest);
}
inline Numbers bitsOf(Tag, const PathClearance& p) {
  return listOf(p.body, p.distance, p.at, p.nearest);
}
inline Numbers bitsOf(Tag, const palpate_inside_vertex& v) {
  return listOf(v.vertex, v.triangle, v.vertices, v.weights, v.direction, v.depth, v.decided);
}
inline Numbers bitsOf(Tag, const InsideVertex& v) {
  return listOf(v.vertex, v.triangle, v.vertices, v.weights, v.direction, v.depth, v.decided);
}
inline Numbers bitsOf(Tag, const palpate_tetrahedron_point& p) {
  return listOf(p.tetrahedron, p.vertices, p.weights);
}
inline Numbers bitsOf(Tag, const TetrahedronPoint& p) {
  return listOf(p.tetrahedron, p.vertices, p.weights);
}
inline Numbers bitsOf(Tag, const palpate_embedded_vertex& v) { return listOf(v.vertex, v.at); }
inline Numbers bitsOf(Tag, const EmbeddedVertex& v) { return listOf(v.vertex, v.at); }

template <class... T>
Numbers listOf(const T&... members) {
  Numbers numbers;
  for (const Numbers& more : {numbersOf(members)...})
    numbers.insert(numbers.end(), more.begin(), more.end());
  return numbers;
}

}  // namespace palpate::testing
