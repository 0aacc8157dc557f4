// Part of <palpate/palpate_c.h>: geometries, pairs and frames.
#include "C/Handles.h"
#include "C/Structs.h"
#include "Fields/Settings.h"

#include <palpate/Capture.h>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

using namespace palpate;
using namespace palpate::c;

namespace {

std::span<const Eigen::Vector3d> positionsOrNone(const double* data, std::size_t count) {
  return c::positions(data, data ? count : 0);
}

/// Sets the id of what add() adds. Nothing is added if there is no place for it.
template <class Add>
void giveId(palpate_id* id, const Add& add) {
  given(id, "id");
  *id = static_cast<palpate_id>(add());
}

/// add() with one radius for all vertices, or with one per vertex.
template <class Add>
GeometryId withRadii(const double* radii, std::size_t count, const Add& add) {
  const auto all = array(radii, count, "radii");
  return count > 1 ? add(all) : add(count == 1 ? all[0] : 0.0);
}

}  // namespace

palpate_status palpate_init_settings(palpate_settings* settings, size_t size) {
  return initialiseAs<Settings>(__func__, settings, size);
}
palpate_status palpate_init_pair_settings(palpate_pair_settings* settings, size_t size) {
  return initialiseAs<PairSettings>(__func__, settings, size);
}
palpate_status palpate_init_filter(palpate_filter* filter, size_t size) {
  return initialiseAs<CollisionFilter>(__func__, filter, size);
}
palpate_status palpate_init_proxy_settings(palpate_proxy_settings* settings, size_t size) {
  return initialiseAs<SurfaceProxySettings>(__func__, settings, size);
}

palpate_status palpate_create(const palpate_settings* settings, palpate_cd** cd) {
  return guarded(__func__, [&] {
    given(cd, "cd");
    *cd = new palpate_cd{OctreeBasedCD(structFrom<Settings>(settings))};
  });
}
void palpate_destroy(palpate_cd* cd) { delete cd; }

palpate_status palpate_add_triangle_mesh(palpate_cd* cd, const double* positions,
                                         size_t vertex_count, const uint32_t* triangles,
                                         size_t triangle_count, palpate_id* id) {
  return guarded(__func__, [&] {
    giveId(id, [&] {
      return of(cd).addTriangleMesh(c::positions(positions, vertex_count),
                                    elements<3>(triangles, triangle_count, "triangles"));
    });
  });
}
palpate_status palpate_add_tetrahedral_mesh(palpate_cd* cd, const double* positions,
                                            size_t vertex_count, const uint32_t* tetrahedra,
                                            size_t tetrahedron_count, palpate_id* id) {
  return guarded(__func__, [&] {
    giveId(id, [&] {
      return of(cd).addTetrahedralMesh(c::positions(positions, vertex_count),
                                       elements<4>(tetrahedra, tetrahedron_count, "tetrahedra"));
    });
  });
}
palpate_status palpate_add_line_mesh(palpate_cd* cd, const double* positions, size_t vertex_count,
                                     const uint32_t* segments, size_t segment_count,
                                     const double* radii, size_t radius_count, palpate_id* id) {
  return guarded(__func__, [&] {
    giveId(id, [&] {
      return withRadii(radii, radius_count, [&](const auto& all) {
        return of(cd).addLineMesh(c::positions(positions, vertex_count),
                                  elements<2>(segments, segment_count, "segments"), all);
      });
    });
  });
}
palpate_status palpate_add_point_set(palpate_cd* cd, const double* positions, size_t vertex_count,
                                     const double* radii, size_t radius_count, palpate_id* id) {
  return guarded(__func__, [&] {
    giveId(id, [&] {
      return withRadii(radii, radius_count, [&](const auto& all) {
        return of(cd).addPointSet(c::positions(positions, vertex_count), all);
      });
    });
  });
}
palpate_status palpate_add_shape(palpate_cd* cd, const palpate_shape* shape, palpate_id* id) {
  return guarded(__func__,
                 [&] { giveId(id, [&] { return of(cd).addAnalyticalGeometry(shapeOf(shape)); }); });
}
palpate_status palpate_add_field(palpate_cd* cd, const palpate_field* field, palpate_id* id) {
  return guarded(__func__, [&] {
    giveId(id, [&] { return of(cd).addDistanceField(given(field, "field").field); });
  });
}
palpate_status palpate_attach_field(palpate_cd* cd, palpate_id mesh, const palpate_field* field) {
  return guarded(__func__, [&] {
    of(cd).attachDistanceField(GeometryId{mesh}, field ? field->field : nullptr);
  });
}
palpate_status palpate_attach_proxy(palpate_cd* cd, palpate_id mesh,
                                    const palpate_proxy_settings* settings) {
  return guarded(__func__, [&] {
    std::optional<SurfaceProxySettings> proxy;
    if (settings) proxy = structFrom<SurfaceProxySettings>(settings);
    of(cd).attachSurfaceProxy(GeometryId{mesh}, proxy);
  });
}
palpate_status palpate_remove(palpate_cd* cd, palpate_id id) {
  return guarded(__func__, [&] { of(cd).removeGeometry(GeometryId{id}); });
}
palpate_status palpate_has(const palpate_cd* cd, palpate_id id, uint8_t* has) {
  return guarded(__func__, [&] { given(has, "has") = of(cd).has(GeometryId{id}); });
}

palpate_status palpate_set_positions(palpate_cd* cd, palpate_id id, const double* now,
                                     size_t count) {
  return guarded(__func__,
                 [&] { of(cd).setPositions(GeometryId{id}, positions(now, count, "now")); });
}
palpate_status palpate_set_step(palpate_cd* cd, palpate_id id, const double* before,
                                const double* now, size_t count) {
  return guarded(__func__, [&] {
    of(cd).setPositions(GeometryId{id}, positions(before, count, "before"),
                        positions(now, count, "now"));
  });
}
palpate_status palpate_set_some_positions(palpate_cd* cd, palpate_id id, size_t first,
                                          const double* now, size_t count) {
  return guarded(__func__,
                 [&] { of(cd).setPositions(GeometryId{id}, first, positions(now, count, "now")); });
}
palpate_status palpate_set_triangles(palpate_cd* cd, palpate_id id, const double* positions,
                                     size_t vertex_count, const uint32_t* triangles,
                                     size_t triangle_count) {
  return guarded(__func__, [&] {
    of(cd).setTriangles(GeometryId{id}, c::positions(positions, vertex_count),
                        elements<3>(triangles, triangle_count, "triangles"));
  });
}
palpate_status palpate_set_tetrahedra(palpate_cd* cd, palpate_id id, const double* positions,
                                      size_t vertex_count, const uint32_t* tetrahedra,
                                      size_t tetrahedron_count) {
  return guarded(__func__, [&] {
    of(cd).setTetrahedra(GeometryId{id}, c::positions(positions, vertex_count),
                         elements<4>(tetrahedra, tetrahedron_count, "tetrahedra"));
  });
}
palpate_status palpate_replace_triangles(palpate_cd* cd, palpate_id id, const uint32_t* removed,
                                         size_t removed_count, const uint32_t* added,
                                         size_t added_count, const double* new_positions,
                                         const double* rest, size_t new_count, uint32_t* ids) {
  return guarded(__func__, [&] {
    const auto found = of(cd).replaceTriangles(
        GeometryId{id}, array(removed, removed_count, "removed"),
        elements<3>(added, added_count, "added"),
        c::positions(new_positions, new_count, "new_positions"), positionsOrNone(rest, new_count));
    if (ids) std::copy(found.begin(), found.end(), ids);
  });
}
palpate_status palpate_replace_tetrahedra(palpate_cd* cd, palpate_id id, const uint32_t* removed,
                                          size_t removed_count, const uint32_t* added,
                                          size_t added_count, const double* new_positions,
                                          const double* rest, size_t new_count, uint32_t* ids) {
  return guarded(__func__, [&] {
    const auto found = of(cd).replaceTetrahedra(
        GeometryId{id}, array(removed, removed_count, "removed"),
        elements<4>(added, added_count, "added"),
        c::positions(new_positions, new_count, "new_positions"), positionsOrNone(rest, new_count));
    if (ids) std::copy(found.begin(), found.end(), ids);
  });
}
palpate_status palpate_set_transform(palpate_cd* cd, palpate_id id, const palpate_pose* now) {
  return guarded(__func__, [&] { of(cd).setTransform(GeometryId{id}, poseOf(now, "now")); });
}
palpate_status palpate_set_motion(palpate_cd* cd, palpate_id id, const palpate_motion* motion) {
  return guarded(__func__, [&] {
    const RigidMotion step = motionOf(motion, "motion");
    of(cd).setTransform(GeometryId{id}, step.before, step.now);
  });
}
palpate_status palpate_set_name(palpate_cd* cd, palpate_id id, const char* name) {
  return guarded(__func__, [&] { of(cd).setName(GeometryId{id}, &given(name, "name")); });
}
palpate_status palpate_set_filter(palpate_cd* cd, palpate_id id, const palpate_filter* filter) {
  return guarded(__func__, [&] {
    of(cd).setCollisionFilter(
        GeometryId{id}, structFrom<CollisionFilter>(&given(filter, "the filter"), "the filter"));
  });
}
palpate_status palpate_set_disabled_elements(palpate_cd* cd, palpate_id id,
                                             const uint32_t* elements, size_t count) {
  return guarded(__func__, [&] {
    of(cd).setDisabledElements(GeometryId{id}, array(elements, count, "elements"));
  });
}
palpate_status palpate_set_tags(palpate_cd* cd, palpate_id id, const uint32_t* tags, size_t count) {
  return guarded(__func__, [&] { of(cd).setTags(GeometryId{id}, array(tags, count, "tags")); });
}

palpate_status palpate_get_positions(const palpate_cd* cd, palpate_id id, const double** positions,
                                     size_t* count) {
  return guarded(__func__, [&] {
    given(positions, "positions"), given(count, "count");
    const auto now = of(cd).positions(GeometryId{id});
    *positions = reinterpret_cast<const double*>(now.data());
    *count = now.size();
  });
}
palpate_status palpate_get_bounds(const palpate_cd* cd, palpate_id id, double* lower,
                                  double* upper) {
  return guarded(__func__, [&] {
    given(lower, "lower"), given(upper, "upper");
    const Eigen::AlignedBox3d box = of(cd).bounds(GeometryId{id});
    fromVector(box.min(), lower);
    fromVector(box.max(), upper);
  });
}
palpate_status palpate_get_transform(const palpate_cd* cd, palpate_id id, palpate_pose* now) {
  return guarded(__func__, [&] { given(now, "now") = fromPose(of(cd).transform(GeometryId{id})); });
}
palpate_status palpate_get_name(const palpate_cd* cd, palpate_id id, const char** name) {
  return guarded(__func__, [&] { given(name, "name") = of(cd).name(GeometryId{id}).c_str(); });
}
palpate_status palpate_get_surface(const palpate_cd* cd, palpate_id id, const uint32_t** triangles,
                                   const uint32_t** tetrahedra, size_t* count) {
  return guarded(__func__, [&] {
    given(triangles, "triangles"), given(tetrahedra, "tetrahedra"), given(count, "count");
    const TetrahedralSurface surface = of(cd).surface(GeometryId{id});
    *triangles = reinterpret_cast<const uint32_t*>(surface.triangles.data());
    *tetrahedra = surface.tetrahedra.data();
    *count = surface.triangles.size();
  });
}
palpate_status palpate_get_removed_elements(const palpate_cd* cd, palpate_id id,
                                            const uint32_t** elements, size_t* count) {
  return guarded(__func__, [&] {
    given(elements, "elements"), given(count, "count");
    const auto all = of(cd).removedElements(GeometryId{id});
    *elements = all.data();
    *count = all.size();
  });
}
palpate_status palpate_get_tags(const palpate_cd* cd, palpate_id id, const uint32_t** tags,
                                size_t* count) {
  return guarded(__func__, [&] {
    given(tags, "tags"), given(count, "count");
    const auto all = of(cd).tags(GeometryId{id});
    *tags = all.data();
    *count = all.size();
  });
}

palpate_status palpate_add_pair(palpate_cd* cd, palpate_id a, palpate_id b,
                                const palpate_pair_settings* settings) {
  return guarded(__func__, [&] {
    of(cd).addCollisionPair(GeometryId{a}, GeometryId{b}, structFrom<PairSettings>(settings));
  });
}
palpate_status palpate_set_pair_settings(palpate_cd* cd, palpate_id a, palpate_id b,
                                         const palpate_pair_settings* settings) {
  return guarded(__func__, [&] {
    of(cd).setPairSettings(GeometryId{a}, GeometryId{b}, structFrom<PairSettings>(settings));
  });
}
palpate_status palpate_set_predicate(palpate_cd* cd, palpate_id a, palpate_id b,
                                     palpate_predicate predicate, void* context) {
  return guarded(__func__, [&] {
    ContactPredicate accepts;
    if (predicate)
      accepts = [=](const ContactFeatures& features) {
        return predicate(context, fromTwins<palpate_features>(&features)) != 0;
      };
    of(cd).setContactPredicate(GeometryId{a}, GeometryId{b}, std::move(accepts));
  });
}
palpate_status palpate_remove_pair(palpate_cd* cd, palpate_id a, palpate_id b) {
  return guarded(__func__, [&] { of(cd).removeCollisionPair(GeometryId{a}, GeometryId{b}); });
}
palpate_status palpate_get_pair_settings(const palpate_cd* cd, palpate_id a, palpate_id b,
                                         palpate_pair_settings* settings) {
  return guarded(__func__, [&] {
    sized(settings, "the settings") =
        structOf<palpate_pair_settings>(of(cd).pairSettings(GeometryId{a}, GeometryId{b}));
  });
}
palpate_status palpate_get_pairs(const palpate_cd* cd, palpate_pair* pairs, size_t capacity,
                                 size_t* count) {
  return guarded(__func__, [&] {
    const List<palpate_pair> list(pairs, capacity, count, "pairs");
    std::vector<ElementPair> all;
    for (const CollisionPair& pair : of(cd).pairs())
      all.push_back({static_cast<palpate_id>(pair.a), static_cast<palpate_id>(pair.b)});
    list.fill(all);
  });
}
palpate_status palpate_get_candidates(palpate_cd* cd, palpate_id a, palpate_id b,
                                      palpate_pair* elements, size_t capacity, size_t* count) {
  return guarded(__func__, [&] {
    const List<palpate_pair> list(elements, capacity, count, "elements");
    list.fill(of(cd).candidatePairs(GeometryId{a}, GeometryId{b}));
  });
}

palpate_status palpate_update(palpate_cd* cd) {
  return guarded(__func__, [&] { of(cd).update(); });
}
palpate_status palpate_detect(palpate_cd* cd) {
  return guarded(__func__, [&] { of(cd).detectCollision(); });
}
palpate_status palpate_detect_within(palpate_cd* cd, int64_t microseconds, uint8_t* complete) {
  return guarded(__func__, [&] {
    given(complete, "complete") = of(cd).detectCollision(std::chrono::microseconds(microseconds));
  });
}
palpate_status palpate_cancel_detection(const palpate_cd* cd) {
  return guarded(__func__, [&] { of(cd).cancelDetection(); });
}
palpate_status palpate_advance(palpate_cd* cd) {
  return guarded(__func__, [&] { of(cd).advance(); });
}
palpate_status palpate_release_memory(palpate_cd* cd) {
  return guarded(__func__, [&] { of(cd).releaseMemory(); });
}
palpate_status palpate_capture(const palpate_cd* cd, const char* path) {
  return guarded(__func__, [&] { capture(of(cd), &given(path, "path")); });
}
palpate_status palpate_save(const palpate_cd* cd, uint8_t* bytes, size_t capacity, size_t* count) {
  return guarded(__func__, [&] {
    array(bytes, capacity, "bytes"), given(count, "count");
    copyBytes(of(cd).save(), bytes, capacity, count);
  });
}
palpate_status palpate_restore(palpate_cd* cd, const uint8_t* bytes, size_t count) {
  return guarded(__func__, [&] {
    of(cd).restore(std::as_bytes(arrayOf<const uint8_t>(bytes, count, "bytes")));
  });
}
