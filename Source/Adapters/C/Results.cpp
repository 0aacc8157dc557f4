// Part of <palpate/palpate_c.h>: contacts, constraint rows and statistics.
#include "C/Handles.h"
#include "C/Structs.h"
#include "Fields/Contacts.h"
#include "Fields/Statistics.h"

using namespace palpate;
using namespace palpate::c;

namespace {

const CollisionData& dataOf(const palpate_cd* cd, palpate_id a, palpate_id b) {
  return of(cd).collisionData(GeometryId{a}, GeometryId{b});
}

SolverVertices verticesOf(const palpate_side* side, const char* name) {
  const palpate_side& s = sized(side, name);
  return {s.first, positions(s.before, s.count, "before"), positions(s.now, s.count, "now")};
}

ContactSide sideOf(const palpate_side* side, const char* name) {
  return {verticesOf(side, name), array(side->radii, side->radius_count, "radii"),
          motionOf(&side->motion, name)};
}

std::span<const TrackedContact> trackedOf(const CollisionData& data, ContactKind kind) {
  switch (kind) {
    case ContactKind::VertexTriangle:
      return data.trackedVertexTriangle();
    case ContactKind::TriangleVertex:
      return data.trackedTriangleVertex();
    case ContactKind::EdgeEdge:
      return data.trackedEdgeEdge();
    case ContactKind::Shape:
      return data.trackedShape();
    case ContactKind::ShapeShape:
      break;
  }
  return data.trackedShapeShape();
}

std::span<const Eigen::Vector3d> smoothOf(const CollisionData& data, ContactKind kind) {
  switch (kind) {
    case ContactKind::VertexTriangle:
      return data.smoothVertexTriangle();
    case ContactKind::TriangleVertex:
      return data.smoothTriangleVertex();
    case ContactKind::EdgeEdge:
      return data.smoothEdgeEdge();
    default:
      return data.smoothShape();
  }
}

/// Not a twin: TrackedContact has a std::optional.
palpate_tracked_contact fromTracked(const TrackedContact& contact) {
  return {.key = fromTwin<palpate_contact_key>(contact.key),
          .predecessor = fromTwin<palpate_contact_key>(contact.predecessor.value_or(ContactKey{})),
          .age = contact.age,
          .has_predecessor = contact.predecessor.has_value(),
          .end = static_cast<std::uint8_t>(contact.end),
          .user_data = contact.userData};
}

void fill(std::span<palpate_tracked_contact> items, std::size_t& count,
          std::span<const TrackedContact> all) {
  const std::size_t written = std::min(items.size(), all.size());
  std::transform(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(written), items.begin(),
                 fromTracked);
  count = all.size();
}

}  // namespace

palpate_status palpate_get_contacts(const palpate_cd* cd, palpate_id a, palpate_id b,
                                    palpate_contacts* contacts) {
  return guarded(__func__, [&] {
    sized(contacts, "contacts");
    const CollisionData::Parts parts = dataOf(cd, a, b).parts();
    *contacts = {
        .size = sizeof *contacts,
        .vertex_triangle = fromTwins<palpate_vertex_triangle>(parts.vertexTriangle.data()),
        .vertex_triangle_count = parts.vertexTriangle.size(),
        .triangle_vertex = fromTwins<palpate_vertex_triangle>(parts.triangleVertex.data()),
        .triangle_vertex_count = parts.triangleVertex.size(),
        .edge_edge = fromTwins<palpate_edge_edge>(parts.edgeEdge.data()),
        .edge_edge_count = parts.edgeEdge.size(),
        .intersecting_triangles = fromTwins<palpate_pair>(parts.intersectingTriangles.data()),
        .intersecting_triangle_count = parts.intersectingTriangles.size(),
        .shape = fromTwins<palpate_shape_contact>(parts.shape.data()),
        .shape_count = parts.shape.size(),
        .shape_shape = fromTwins<palpate_shape_shape>(parts.shapeShape.data()),
        .shape_shape_count = parts.shapeShape.size(),
        .error_bound = parts.errorBound};
  });
}
palpate_status palpate_get_validity(const palpate_cd* cd, palpate_id a, palpate_id b,
                                    palpate_validity* validity) {
  return guarded(__func__, [&] {
    sized(validity, "validity");
    *validity = structOf<palpate_validity>(dataOf(cd, a, b).validity());
  });
}
palpate_status palpate_get_earliest_time(const palpate_cd* cd, palpate_id a, palpate_id b,
                                         double* time_of_impact) {
  return guarded(__func__, [&] {
    given(time_of_impact, "time_of_impact") = dataOf(cd, a, b).earliestTimeOfImpact();
  });
}
palpate_status palpate_get_hash(const palpate_cd* cd, palpate_id a, palpate_id b, uint64_t* hash) {
  return guarded(__func__, [&] { given(hash, "hash") = dataOf(cd, a, b).hash(); });
}
palpate_status palpate_get_free_motion(const palpate_cd* cd, palpate_id id, const double** motions,
                                       size_t* count) {
  return guarded(__func__, [&] {
    given(motions, "motions"), given(count, "count");
    const auto all = of(cd).freeMotion(GeometryId{id});
    *motions = all.data();
    *count = all.size();
  });
}

palpate_status palpate_get_tracked(const palpate_cd* cd, palpate_id a, palpate_id b, int kind,
                                   palpate_tracked_contact* tracked, size_t capacity,
                                   size_t* count) {
  return guarded(__func__, [&] {
    const auto items = array(tracked, capacity, "tracked");
    const auto list = enumerator(kind, ContactKind::ShapeShape, "kind");
    given(count, "count");
    fill(items, *count, trackedOf(dataOf(cd, a, b), list));
  });
}
palpate_status palpate_get_ended(const palpate_cd* cd, palpate_id a, palpate_id b,
                                 palpate_tracked_contact* ended, size_t capacity, size_t* count) {
  return guarded(__func__, [&] {
    const auto items = array(ended, capacity, "ended");
    given(count, "count");
    fill(items, *count, dataOf(cd, a, b).ended());
  });
}
palpate_status palpate_set_user_data(palpate_cd* cd, palpate_id a, palpate_id b,
                                     const palpate_contact_key* key, uint64_t user_data) {
  return guarded(__func__, [&] {
    ContactKey contact;
    contact.kind = enumerator(given(key, "key").kind, ContactKind::ShapeShape, "kind");
    std::copy_n(key->ids, contact.ids.size(), contact.ids.begin());
    of(cd).setUserData(GeometryId{a}, GeometryId{b}, contact, user_data);
  });
}
palpate_status palpate_get_contact_tags(const palpate_cd* cd, palpate_id a, palpate_id b, int kind,
                                        const uint32_t** tags, size_t* count) {
  return guarded(__func__, [&] {
    given(tags, "tags"), given(count, "count");
    const auto all = dataOf(cd, a, b).tags(enumerator(kind, ContactKind::ShapeShape, "kind"));
    *tags = reinterpret_cast<const uint32_t*>(all.data());
    *count = all.size();
  });
}
palpate_status palpate_get_crossings(const palpate_cd* cd, palpate_id a, palpate_id b,
                                     const palpate_crossing** crossings, size_t* count) {
  return guarded(__func__, [&] {
    given(crossings, "crossings"), given(count, "count");
    const auto all = dataOf(cd, a, b).crossings();
    *crossings = fromTwins<palpate_crossing>(all.data());
    *count = all.size();
  });
}

palpate_status palpate_get_smooth_normals(const palpate_cd* cd, palpate_id a, palpate_id b,
                                          int kind, const double** normals, size_t* count) {
  return guarded(__func__, [&] {
    given(normals, "normals"), given(count, "count");
    const auto list = enumerator(kind, ContactKind::Shape, "kind");
    const auto all = smoothOf(dataOf(cd, a, b), list);
    static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));
    *normals = all.empty() ? nullptr : all.data()->data();
    *count = all.size();
  });
}
palpate_status palpate_get_remembered_sides(const palpate_cd* cd, palpate_id a, palpate_id b,
                                            const palpate_crossing** sides, size_t* count) {
  return guarded(__func__, [&] {
    given(sides, "sides"), given(count, "count");
    const auto all = dataOf(cd, a, b).rememberedSides();
    *sides = fromTwins<palpate_crossing>(all.data());
    *count = all.size();
  });
}
palpate_status palpate_set_remembered_sides(palpate_cd* cd, palpate_id a, palpate_id b,
                                            const palpate_crossing* sides, size_t count) {
  return guarded(__func__, [&] {
    of(cd).setRememberedSides(GeometryId{a}, GeometryId{b}, twins(sides, count, "sides"));
  });
}

palpate_status palpate_get_statistics(const palpate_cd* cd, palpate_statistics* statistics) {
  return guarded(__func__, [&] {
    sized(statistics, "statistics");
    *statistics = structOf<palpate_statistics>(of(cd).statistics());
  });
}
palpate_status palpate_get_unfinished_pairs(const palpate_cd* cd,
                                            const palpate_unfinished_pair** pairs, size_t* count) {
  return guarded(__func__, [&] {
    given(pairs, "pairs"), given(count, "count");
    const std::vector<UnfinishedPair>& all = of(cd).statistics().unfinishedPairs;
    *pairs = fromTwins<palpate_unfinished_pair>(all.data());
    *count = all.size();
  });
}
palpate_status palpate_get_pair_statistics(const palpate_cd* cd, palpate_id a, palpate_id b,
                                           palpate_pair_statistics* statistics) {
  return guarded(__func__, [&] {
    sized(statistics, "statistics");
    *statistics =
        structOf<palpate_pair_statistics>(of(cd).pairStatistics(GeometryId{a}, GeometryId{b}));
  });
}

palpate_status palpate_init_side(palpate_side* side, size_t size) {
  palpate_side rest{};
  rest.size = sizeof rest;
  rest.motion = fromMotion({});
  return initialise(__func__, side, size, rest);
}
palpate_status palpate_get_rows(const palpate_cd* cd, palpate_id a, palpate_id b,
                                const palpate_side* side_a, const palpate_side* side_b,
                                const palpate_motion* body, palpate_row* rows, size_t capacity,
                                size_t* count) {
  return guarded(__func__, [&] {
    const List<palpate_row> list(rows, capacity, count, "rows");
    std::vector<ConstraintRow> all;
    appendRows(dataOf(cd, a, b), verticesOf(side_a, "side_a"), verticesOf(side_b, "side_b"), all,
               body ? motionOf(body, "body") : RigidMotion{});
    list.fill(all);
  });
}
palpate_status palpate_get_step_rows(const palpate_cd* cd, palpate_id a, palpate_id b,
                                     uint32_t first_of_a, uint32_t first_of_b, palpate_row* rows,
                                     size_t capacity, size_t* count) {
  return guarded(__func__, [&] {
    const List<palpate_row> list(rows, capacity, count, "rows");
    std::vector<ConstraintRow> all;
    dataOf(cd, a, b).appendRows(all, first_of_a, first_of_b);
    list.fill(all);
  });
}
palpate_status palpate_get_motions(const palpate_cd* cd, palpate_id a, palpate_id b,
                                   const palpate_side* side_a, const palpate_side* side_b,
                                   palpate_contact_motion* motions, size_t capacity,
                                   size_t* count) {
  return guarded(__func__, [&] {
    const List<palpate_contact_motion> list(motions, capacity, count, "motions");
    std::vector<ContactMotion> all;
    appendMotions(dataOf(cd, a, b), sideOf(side_a, "side_a"), sideOf(side_b, "side_b"), all);
    list.fill(all);
  });
}
palpate_status palpate_get_tangents(const double* normal, const double (*previous)[3],
                                    double (*tangents)[3]) {
  return guarded(__func__, [&] {
    given(tangents, "tangents");
    const Eigen::Vector3d n = vector(normal, "normal");
    const Tangents both =
        previous ? tangentsOf(n, {vector(previous[0], "previous"), vector(previous[1], "previous")})
                 : tangentsOf(n);
    fromVector(both[0], tangents[0]);
    fromVector(both[1], tangents[1]);
  });
}
