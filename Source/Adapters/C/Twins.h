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

/// The C++ struct with the layout of a struct of C: one is read as the other, without a copy. Both
/// have the members that Fields lists, with the same sizes, so that these are at the same places.
template <class C>
struct Twin;
template <>
struct Twin<std::uint32_t> {
  using Type = std::uint32_t;
};
template <class C>
using TwinOf = typename Twin<C>::Type;

/// The type in C of a member. Structs without one have their members in the place of the member.
template <class Member>
struct InC {
  using Type = Member;
};
template <class Member>
using InCOf = typename InC<Member>::Type;
template <>
struct InC<bool> {
  using Type = std::uint8_t;
};
template <class Member>
requires std::is_enum_v<Member>
struct InC<Member> {
  using Type = std::underlying_type_t<Member>;
};
template <>
struct InC<std::vector<std::uint32_t>> {
  using Type = palpate_indices;
};

#define PALPATE_TWIN(c, cpp)                                               \
  template <>                                                              \
  struct Twin<c> {                                                         \
    using Type = cpp;                                                      \
    static_assert(sizeof(c) == sizeof(cpp) && alignof(c) == alignof(cpp)); \
  };                                                                       \
  template <>                                                              \
  struct InC<cpp> {                                                        \
    using Type = c;                                                        \
  }

PALPATE_TWIN(palpate_pair, ElementPair);
PALPATE_TWIN(palpate_features, ContactFeatures);
PALPATE_TWIN(palpate_vertex_triangle, VertexTriangleContact);
PALPATE_TWIN(palpate_edge_edge, EdgeEdgeContact);
PALPATE_TWIN(palpate_shape_contact, ShapeContact);
PALPATE_TWIN(palpate_shape_shape, ShapeShapeContact);
PALPATE_TWIN(palpate_contact_key, ContactKey);
PALPATE_TWIN(palpate_crossing, Crossing);
PALPATE_TWIN(palpate_thread_event, ThreadEvent);
PALPATE_TWIN(palpate_unfinished_pair, UnfinishedPair);
PALPATE_TWIN(palpate_memory, MemoryUse);
PALPATE_TWIN(palpate_row, ConstraintRow);
PALPATE_TWIN(palpate_contact_motion, ContactMotion);
PALPATE_TWIN(palpate_surface_point, SurfacePoint);
PALPATE_TWIN(palpate_signed_distance, SignedDistance);
PALPATE_TWIN(palpate_ray, Ray);
PALPATE_TWIN(palpate_hit, RayHit);
PALPATE_TWIN(palpate_pick, Pick);
PALPATE_TWIN(palpate_distance, GeometryDistance);
PALPATE_TWIN(palpate_penetration, Penetration);
PALPATE_TWIN(palpate_path_interval, PathInterval);
PALPATE_TWIN(palpate_path_clearance, PathClearance);
PALPATE_TWIN(palpate_inside_vertex, InsideVertex);
PALPATE_TWIN(palpate_tetrahedron_point, TetrahedronPoint);
PALPATE_TWIN(palpate_embedded_vertex, EmbeddedVertex);
#undef PALPATE_TWIN

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
