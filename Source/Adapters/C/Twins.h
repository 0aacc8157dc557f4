#pragma once

#include "C/Border.h"

#include <palpate/CollisionData.h>
#include <palpate/ConstraintRows.h>
#include <palpate/FrameStatistics.h>
#include <palpate/Meshes.h>
#include <palpate/Settings.h>
#include <palpate/SpatialQueries.h>
#include <palpate/ThreadTopology.h>

#include <algorithm>

namespace palpate::c {

/// The C++ struct with the layout of a struct of C: one is read as the other, without a copy. If a
/// layout changes, an assertion below fails; the ABI of C changes with it.
template <class C>
struct Twin;
template <>
struct Twin<std::uint32_t> {
  using Type = std::uint32_t;
};
template <class C>
using TwinOf = typename Twin<C>::Type;

#define PALPATE_TWIN(c, cpp)                                               \
  template <>                                                              \
  struct Twin<c> {                                                         \
    using Type = cpp;                                                      \
    static_assert(sizeof(c) == sizeof(cpp) && alignof(c) == alignof(cpp)); \
  }
#define PALPATE_SAME(c, member, cpp, twin)                    \
  static_assert(offsetof(c, member) == offsetof(cpp, twin) && \
                sizeof(c::member) == sizeof(cpp::twin))

PALPATE_TWIN(palpate_pair, ElementPair);
PALPATE_SAME(palpate_pair, a, ElementPair, a);
PALPATE_SAME(palpate_pair, b, ElementPair, b);

PALPATE_TWIN(palpate_features, ContactFeatures);
PALPATE_SAME(palpate_features, kind, ContactFeatures, kind);
PALPATE_SAME(palpate_features, a, ContactFeatures, a);
PALPATE_SAME(palpate_features, b, ContactFeatures, b);
PALPATE_SAME(palpate_features, tag_a, ContactFeatures, tagA);
PALPATE_SAME(palpate_features, tag_b, ContactFeatures, tagB);

PALPATE_TWIN(palpate_vertex_triangle, VertexTriangleContact);
PALPATE_SAME(palpate_vertex_triangle, vertex, VertexTriangleContact, vertex);
PALPATE_SAME(palpate_vertex_triangle, triangle, VertexTriangleContact, triangle);
PALPATE_SAME(palpate_vertex_triangle, vertices, VertexTriangleContact, vertices);
PALPATE_SAME(palpate_vertex_triangle, weights, VertexTriangleContact, weights);
PALPATE_SAME(palpate_vertex_triangle, normal, VertexTriangleContact, normal);
PALPATE_SAME(palpate_vertex_triangle, distance, VertexTriangleContact, distance);
PALPATE_SAME(palpate_vertex_triangle, time_of_impact, VertexTriangleContact, timeOfImpact);
PALPATE_SAME(palpate_vertex_triangle, feature, VertexTriangleContact, feature);

PALPATE_TWIN(palpate_edge_edge, EdgeEdgeContact);
PALPATE_SAME(palpate_edge_edge, edge_a, EdgeEdgeContact, edgeA);
PALPATE_SAME(palpate_edge_edge, edge_b, EdgeEdgeContact, edgeB);
PALPATE_SAME(palpate_edge_edge, weight_a, EdgeEdgeContact, weightA);
PALPATE_SAME(palpate_edge_edge, weight_b, EdgeEdgeContact, weightB);
PALPATE_SAME(palpate_edge_edge, normal, EdgeEdgeContact, normal);
PALPATE_SAME(palpate_edge_edge, distance, EdgeEdgeContact, distance);
PALPATE_SAME(palpate_edge_edge, time_of_impact, EdgeEdgeContact, timeOfImpact);
PALPATE_SAME(palpate_edge_edge, feature_a, EdgeEdgeContact, featureA);
PALPATE_SAME(palpate_edge_edge, feature_b, EdgeEdgeContact, featureB);

PALPATE_TWIN(palpate_shape_contact, ShapeContact);
PALPATE_SAME(palpate_shape_contact, element, ShapeContact, element);
PALPATE_SAME(palpate_shape_contact, id, ShapeContact, id);
PALPATE_SAME(palpate_shape_contact, vertices, ShapeContact, vertices);
PALPATE_SAME(palpate_shape_contact, weights, ShapeContact, weights);
PALPATE_SAME(palpate_shape_contact, point, ShapeContact, point);
PALPATE_SAME(palpate_shape_contact, point_on_shape, ShapeContact, pointOnShape);
PALPATE_SAME(palpate_shape_contact, normal, ShapeContact, normal);
PALPATE_SAME(palpate_shape_contact, distance, ShapeContact, distance);
PALPATE_SAME(palpate_shape_contact, time_of_impact, ShapeContact, timeOfImpact);

PALPATE_TWIN(palpate_shape_shape, ShapeShapeContact);
PALPATE_SAME(palpate_shape_shape, point_a, ShapeShapeContact, pointA);
PALPATE_SAME(palpate_shape_shape, point_b, ShapeShapeContact, pointB);
PALPATE_SAME(palpate_shape_shape, normal, ShapeShapeContact, normal);
PALPATE_SAME(palpate_shape_shape, distance, ShapeShapeContact, distance);
PALPATE_SAME(palpate_shape_shape, time_of_impact, ShapeShapeContact, timeOfImpact);

PALPATE_TWIN(palpate_contact_key, ContactKey);
PALPATE_SAME(palpate_contact_key, kind, ContactKey, kind);
PALPATE_SAME(palpate_contact_key, ids, ContactKey, ids);

PALPATE_TWIN(palpate_crossing, Crossing);
PALPATE_SAME(palpate_crossing, kind, Crossing, kind);
PALPATE_SAME(palpate_crossing, ids, Crossing, ids);
PALPATE_SAME(palpate_crossing, time, Crossing, time);
PALPATE_SAME(palpate_crossing, forward, Crossing, forward);

PALPATE_TWIN(palpate_thread_event, ThreadEvent);
PALPATE_SAME(palpate_thread_event, index, ThreadEvent, index);
PALPATE_SAME(palpate_thread_event, step, ThreadEvent, step);
PALPATE_SAME(palpate_thread_event, cause, ThreadEvent, cause);
PALPATE_SAME(palpate_thread_event, change, ThreadEvent, change);
PALPATE_SAME(palpate_thread_event, thread, ThreadEvent, thread);
PALPATE_SAME(palpate_thread_event, loop, ThreadEvent, loop);
PALPATE_SAME(palpate_thread_event, time, ThreadEvent, time);

PALPATE_TWIN(palpate_unfinished_pair, UnfinishedPair);
PALPATE_SAME(palpate_unfinished_pair, a, UnfinishedPair, a);
PALPATE_SAME(palpate_unfinished_pair, b, UnfinishedPair, b);
PALPATE_SAME(palpate_unfinished_pair, distance_bound, UnfinishedPair, distanceBound);
PALPATE_SAME(palpate_unfinished_pair, age, UnfinishedPair, age);
PALPATE_SAME(palpate_unfinished_pair, exceeds_budget, UnfinishedPair, exceedsBudget);

PALPATE_TWIN(palpate_memory, MemoryUse);
PALPATE_SAME(palpate_memory, geometries, MemoryUse, geometries);
PALPATE_SAME(palpate_memory, octrees, MemoryUse, octrees);
PALPATE_SAME(palpate_memory, pairs, MemoryUse, pairs);
PALPATE_SAME(palpate_memory, narrow_phase, MemoryUse, narrowPhase);
PALPATE_SAME(palpate_memory, results, MemoryUse, results);
PALPATE_SAME(palpate_memory, queries, MemoryUse, queries);
PALPATE_SAME(palpate_memory, snapshots, MemoryUse, snapshots);
PALPATE_SAME(palpate_memory, total, MemoryUse, total);

PALPATE_TWIN(palpate_row, ConstraintRow);
PALPATE_SAME(palpate_row, vertices, ConstraintRow, vertices);
PALPATE_SAME(palpate_row, weights, ConstraintRow, weights);
PALPATE_SAME(palpate_row, normal, ConstraintRow, normal);
PALPATE_SAME(palpate_row, offset, ConstraintRow, offset);

PALPATE_TWIN(palpate_contact_motion, ContactMotion);
PALPATE_SAME(palpate_contact_motion, point, ContactMotion, point);
PALPATE_SAME(palpate_contact_motion, opposite, ContactMotion, opposite);
PALPATE_SAME(palpate_contact_motion, relative_displacement, ContactMotion, relativeDisplacement);

PALPATE_TWIN(palpate_surface_point, SurfacePoint);
PALPATE_SAME(palpate_surface_point, geometry, SurfacePoint, geometry);
PALPATE_SAME(palpate_surface_point, element, SurfacePoint, element);
PALPATE_SAME(palpate_surface_point, vertices, SurfacePoint, vertices);
PALPATE_SAME(palpate_surface_point, weights, SurfacePoint, weights);
PALPATE_SAME(palpate_surface_point, position, SurfacePoint, position);
PALPATE_SAME(palpate_surface_point, distance, SurfacePoint, distance);
PALPATE_SAME(palpate_surface_point, normal, SurfacePoint, normal);

PALPATE_TWIN(palpate_signed_distance, SignedDistance);
PALPATE_SAME(palpate_signed_distance, nearest, SignedDistance, nearest);
PALPATE_SAME(palpate_signed_distance, distance, SignedDistance, distance);

PALPATE_TWIN(palpate_ray, Ray);
PALPATE_SAME(palpate_ray, origin, Ray, origin);
PALPATE_SAME(palpate_ray, direction, Ray, direction);
PALPATE_SAME(palpate_ray, t_min, Ray, tMin);
PALPATE_SAME(palpate_ray, t_max, Ray, tMax);

PALPATE_TWIN(palpate_hit, RayHit);
PALPATE_SAME(palpate_hit, geometry, RayHit, geometry);
PALPATE_SAME(palpate_hit, element, RayHit, element);
PALPATE_SAME(palpate_hit, vertices, RayHit, vertices);
PALPATE_SAME(palpate_hit, weights, RayHit, weights);
PALPATE_SAME(palpate_hit, t, RayHit, t);
PALPATE_SAME(palpate_hit, front_face, RayHit, frontFace);
PALPATE_SAME(palpate_hit, crosses, RayHit, crosses);

PALPATE_TWIN(palpate_pick, Pick);
PALPATE_SAME(palpate_pick, hit, Pick, hit);
PALPATE_SAME(palpate_pick, vertex, Pick, vertex);
PALPATE_SAME(palpate_pick, edge, Pick, edge);

PALPATE_TWIN(palpate_distance, GeometryDistance);
PALPATE_SAME(palpate_distance, a, GeometryDistance, a);
PALPATE_SAME(palpate_distance, b, GeometryDistance, b);
PALPATE_SAME(palpate_distance, distance, GeometryDistance, distance);

PALPATE_TWIN(palpate_penetration, Penetration);
PALPATE_SAME(palpate_penetration, intersecting, Penetration, intersecting);
PALPATE_SAME(palpate_penetration, direction, Penetration, direction);
PALPATE_SAME(palpate_penetration, depth, Penetration, depth);
PALPATE_SAME(palpate_penetration, a, Penetration, a);
PALPATE_SAME(palpate_penetration, b, Penetration, b);
PALPATE_SAME(palpate_penetration, minimal, Penetration, minimal);

PALPATE_TWIN(palpate_path_interval, PathInterval);
PALPATE_SAME(palpate_path_interval, body, PathInterval, body);
PALPATE_SAME(palpate_path_interval, enter, PathInterval, enter);
PALPATE_SAME(palpate_path_interval, leave, PathInterval, leave);
PALPATE_SAME(palpate_path_interval, entry_element, PathInterval, entryElement);
PALPATE_SAME(palpate_path_interval, exit_element, PathInterval, exitElement);

PALPATE_TWIN(palpate_path_clearance, PathClearance);
PALPATE_SAME(palpate_path_clearance, body, PathClearance, body);
PALPATE_SAME(palpate_path_clearance, distance, PathClearance, distance);
PALPATE_SAME(palpate_path_clearance, at, PathClearance, at);
PALPATE_SAME(palpate_path_clearance, nearest, PathClearance, nearest);

PALPATE_TWIN(palpate_inside_vertex, InsideVertex);
PALPATE_SAME(palpate_inside_vertex, vertex, InsideVertex, vertex);
PALPATE_SAME(palpate_inside_vertex, triangle, InsideVertex, triangle);
PALPATE_SAME(palpate_inside_vertex, vertices, InsideVertex, vertices);
PALPATE_SAME(palpate_inside_vertex, weights, InsideVertex, weights);
PALPATE_SAME(palpate_inside_vertex, direction, InsideVertex, direction);
PALPATE_SAME(palpate_inside_vertex, depth, InsideVertex, depth);
PALPATE_SAME(palpate_inside_vertex, decided, InsideVertex, decided);

PALPATE_TWIN(palpate_tetrahedron_point, TetrahedronPoint);
PALPATE_SAME(palpate_tetrahedron_point, tetrahedron, TetrahedronPoint, tetrahedron);
PALPATE_SAME(palpate_tetrahedron_point, vertices, TetrahedronPoint, vertices);
PALPATE_SAME(palpate_tetrahedron_point, weights, TetrahedronPoint, weights);

PALPATE_TWIN(palpate_embedded_vertex, EmbeddedVertex);
PALPATE_SAME(palpate_embedded_vertex, vertex, EmbeddedVertex, vertex);
PALPATE_SAME(palpate_embedded_vertex, at, EmbeddedVertex, at);

#undef PALPATE_TWIN
#undef PALPATE_SAME

template <class C>
const C* fromTwins(const TwinOf<C>* data) {
  return reinterpret_cast<const C*>(data);
}
template <class C>
C fromTwin(const TwinOf<C>& value) {
  return *fromTwins<C>(&value);
}

/// `count` structs of the caller.
template <class C>
auto twins(C* data, std::size_t count, const char* name) {
  using Type = std::conditional_t<std::is_const_v<C>, const TwinOf<std::remove_const_t<C>>,
                                  TwinOf<std::remove_const_t<C>>>;
  return arrayOf<Type>(data, count, name);
}

/// A list of the caller with its capacity, checked before it is computed.
template <class C>
class List {
 public:
  List(C* items, std::size_t capacity, std::size_t* count, const char* name)
      : m_items(twins(items, capacity, name)), m_count(given(count, "count")) {}

  void fill(std::span<const TwinOf<C>> all) const {
    std::copy_n(all.begin(), std::min(all.size(), m_items.size()), m_items.begin());
    m_count = all.size();
  }

 private:
  std::span<TwinOf<C>> m_items;
  std::size_t& m_count;
};

}  // namespace palpate::c
