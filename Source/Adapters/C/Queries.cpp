// Part of <palpate/palpate_c.h>: queries.
#include "C/Handles.h"
#include "C/Structs.h"
#include "Fields/Queries.h"

using namespace palpate;
using namespace palpate::c;

namespace {

palpate_hit noHit() {
  palpate_hit hit{};
  hit.element = PALPATE_NO_ELEMENT;
  hit.t = kInfinity;
  return hit;
}

const Ray& rayOf(const palpate_ray* ray) { return twins(ray, 1, "ray")[0]; }

}  // namespace

palpate_status palpate_init_inside_settings(palpate_inside_settings* settings, size_t size) {
  return initialiseAs<InsideSettings>(__func__, settings, size);
}

palpate_status palpate_create_queries(const palpate_cd* cd, palpate_queries** queries) {
  return guarded(__func__, [&] {
    given(queries, "queries");
    *queries = new palpate_queries{of(cd).queries()};
  });
}
void palpate_destroy_queries(palpate_queries* queries) { delete queries; }

palpate_status palpate_closest_points(const palpate_queries* queries, palpate_id id,
                                      const double* points, size_t count, double max_distance,
                                      palpate_surface_point* out) {
  return guarded(__func__, [&] {
    of(queries).closestPoints(GeometryId{id}, positions(points, count, "points"),
                              twins(out, count, "out"), max_distance);
  });
}
palpate_status palpate_nearest_elements(const palpate_queries* queries, palpate_id id,
                                        const double* point, int k, double max_distance,
                                        palpate_surface_point* out, size_t capacity,
                                        size_t* count) {
  return guarded(__func__, [&] {
    const List<palpate_surface_point> list(out, capacity, count, "out");
    std::vector<SurfacePoint> all;
    of(queries).nearestElements(GeometryId{id}, vector(point, "point"), k, all, max_distance);
    list.fill(all);
  });
}
palpate_status palpate_contains(const palpate_queries* queries, palpate_id body,
                                const double* points, size_t count,
                                const palpate_inside_settings* settings, uint8_t* inside) {
  return guarded(__func__, [&] {
    const auto all = positions(points, count, "points");
    const auto flags = array(inside, count, "inside");
    const InsideSettings rule = structFrom<InsideSettings>(settings);
    for (std::size_t i = 0; i < count; ++i)
      flags[i] = of(queries).contains(GeometryId{body}, all[i], rule);
  });
}
palpate_status palpate_signed_distances(const palpate_queries* queries, palpate_id body,
                                        const double* points, size_t count,
                                        const palpate_inside_settings* settings,
                                        palpate_signed_distance* out) {
  return guarded(__func__, [&] {
    of(queries).signedDistances(GeometryId{body}, positions(points, count, "points"),
                                twins(out, count, "out"), structFrom<InsideSettings>(settings));
  });
}
palpate_status palpate_elements_within(const palpate_queries* queries, palpate_id id,
                                       const double* point, double radius, uint32_t* elements,
                                       size_t capacity, size_t* count) {
  return guarded(__func__, [&] {
    const List<uint32_t> list(elements, capacity, count, "elements");
    std::vector<uint32_t> all;
    of(queries).elementsWithin(GeometryId{id}, vector(point, "point"), radius, all);
    list.fill(all);
  });
}
palpate_status palpate_first_hits(const palpate_queries* queries, palpate_id id,
                                  const palpate_ray* rays, size_t count, palpate_hit* out) {
  return guarded(__func__, [&] {
    of(queries).firstHits(GeometryId{id}, twins(rays, count, "rays"), twins(out, count, "out"));
  });
}
palpate_status palpate_first_hit(const palpate_queries* queries, const palpate_ray* ray,
                                 palpate_hit* hit) {
  return guarded(__func__, [&] {
    given(hit, "hit") = noHit();
    if (const auto found = of(queries).firstHit(rayOf(ray))) *hit = fromTwin<palpate_hit>(*found);
  });
}
palpate_status palpate_any_hit(const palpate_queries* queries, palpate_id id,
                               const palpate_ray* ray, uint8_t* any) {
  return guarded(__func__,
                 [&] { given(any, "any") = of(queries).anyHit(GeometryId{id}, rayOf(ray)); });
}
palpate_status palpate_all_hits(const palpate_queries* queries, palpate_id id,
                                const palpate_ray* ray, palpate_hit* hits, size_t capacity,
                                size_t* count) {
  return guarded(__func__, [&] {
    const List<palpate_hit> list(hits, capacity, count, "hits");
    std::vector<RayHit> all;
    of(queries).allHits(GeometryId{id}, rayOf(ray), all);
    list.fill(all);
  });
}
palpate_status palpate_pick_first(const palpate_queries* queries, const palpate_ray* ray,
                                  int front_faces_only, palpate_pick* pick) {
  return guarded(__func__, [&] {
    given(pick, "pick") = {noHit(), PALPATE_NO_ELEMENT, {PALPATE_NO_ELEMENT, PALPATE_NO_ELEMENT}};
    if (const auto found = of(queries).pick(rayOf(ray), front_faces_only != 0))
      *pick = fromTwin<palpate_pick>(*found);
  });
}
palpate_status palpate_overlapping(const palpate_queries* queries, palpate_id id,
                                   const palpate_shape* shape, const palpate_pose* pose,
                                   uint32_t* elements, size_t capacity, size_t* count) {
  return guarded(__func__, [&] {
    const List<uint32_t> list(elements, capacity, count, "elements");
    std::vector<uint32_t> all;
    of(queries).overlapping(GeometryId{id}, shapeOf(shape), poseOf(pose, "pose"), all);
    list.fill(all);
  });
}
palpate_status palpate_contacts_with_shape(const palpate_queries* queries, palpate_id id,
                                           const palpate_shape* shape, const palpate_pose* pose,
                                           double thickness, palpate_shape_contact* contacts,
                                           size_t capacity, size_t* count) {
  return guarded(__func__, [&] {
    const List<palpate_shape_contact> list(contacts, capacity, count, "contacts");
    std::vector<ShapeContact> all;
    of(queries).contacts(GeometryId{id}, shapeOf(shape), poseOf(pose, "pose"), thickness, all);
    list.fill(all);
  });
}
palpate_status palpate_get_distance(const palpate_queries* queries, palpate_id a, palpate_id b,
                                    palpate_distance* distance) {
  return guarded(__func__, [&] {
    given(distance, "distance") =
        fromTwin<palpate_distance>(of(queries).distance(GeometryId{a}, GeometryId{b}));
  });
}
palpate_status palpate_get_penetration(const palpate_queries* queries, palpate_id a, palpate_id b,
                                       palpate_penetration* penetration) {
  return guarded(__func__, [&] {
    given(penetration, "penetration") =
        fromTwin<palpate_penetration>(of(queries).penetration(GeometryId{a}, GeometryId{b}));
  });
}
palpate_status palpate_follow_path(const palpate_queries* queries, const double* points,
                                   size_t point_count, double radius, const palpate_id* bodies,
                                   size_t body_count, palpate_path_interval* inside,
                                   size_t inside_capacity, size_t* inside_count,
                                   palpate_path_clearance* outside, size_t outside_capacity,
                                   size_t* outside_count) {
  return guarded(__func__, [&] {
    const List<palpate_path_interval> inList(inside, inside_capacity, inside_count, "inside");
    const List<palpate_path_clearance> outList(outside, outside_capacity, outside_count, "outside");
    std::vector<GeometryId> ids;
    for (const palpate_id body : array(bodies, body_count, "bodies"))
      ids.push_back(GeometryId{body});
    std::vector<PathInterval> allInside;
    std::vector<PathClearance> allOutside;
    of(queries).path(positions(points, point_count, "points"), radius, ids, allInside, allOutside);
    inList.fill(allInside);
    outList.fill(allOutside);
  });
}
palpate_status palpate_inside_vertices(const palpate_queries* queries, palpate_id vertices,
                                       palpate_id body, const palpate_inside_settings* settings,
                                       palpate_inside_vertex* out, size_t capacity, size_t* count) {
  return guarded(__func__, [&] {
    const List<palpate_inside_vertex> list(out, capacity, count, "out");
    std::vector<InsideVertex> all;
    of(queries).findInsideVertices(GeometryId{vertices}, GeometryId{body}, all,
                                   structFrom<InsideSettings>(settings));
    list.fill(all);
  });
}
palpate_status palpate_embedded_vertices(const palpate_queries* queries, palpate_id vertices,
                                         palpate_id body, palpate_embedded_vertex* out,
                                         size_t capacity, size_t* count) {
  return guarded(__func__, [&] {
    const List<palpate_embedded_vertex> list(out, capacity, count, "out");
    std::vector<EmbeddedVertex> all;
    of(queries).findEmbeddedVertices(GeometryId{vertices}, GeometryId{body}, all);
    list.fill(all);
  });
}
palpate_status palpate_find_tetrahedron(const palpate_queries* queries, palpate_id body,
                                        const double* point, palpate_tetrahedron_point* at) {
  return guarded(__func__, [&] {
    given(at, "at") = {PALPATE_NO_ELEMENT, {}, {}};
    if (const auto found = of(queries).findTetrahedron(GeometryId{body}, vector(point, "point")))
      *at = fromTwin<palpate_tetrahedron_point>(*found);
  });
}
