// Part of <palpate/palpate_c.h>: snapshots, distance fields and meshes without an OctreeBasedCD.
#include "C/Handles.h"

#include <palpate/Meshes.h>

#include <algorithm>

using namespace palpate;
using namespace palpate::c;

namespace {

const DistanceField& fieldOf(const palpate_field* field) { return *given(field, "field").field; }

TriangleMeshView meshOf(const double* data, std::size_t vertices, const std::uint32_t* triangles,
                        std::size_t count) {
  return {positions(data, vertices), elements<3>(triangles, count, "triangles")};
}

}  // namespace

palpate_status palpate_publish(palpate_cd* cd, double time) {
  return guarded(__func__, [&] { of(cd).publish(time); });
}
palpate_status palpate_latest_snapshot(const palpate_cd* cd, palpate_snapshot** snapshot) {
  return guarded(__func__, [&] {
    given(snapshot, "snapshot");
    auto latest = of(cd).latestSnapshot();
    *snapshot = latest ? new palpate_snapshot{std::move(latest)} : nullptr;
  });
}
void palpate_release_snapshot(palpate_snapshot* snapshot) { delete snapshot; }
palpate_status palpate_snapshot_queries(const palpate_snapshot* snapshot,
                                        palpate_queries** queries) {
  return guarded(__func__, [&] {
    given(queries, "queries");
    *queries = new palpate_queries{of(snapshot).queries()};
  });
}
palpate_status palpate_snapshot_time(const palpate_snapshot* snapshot, uint64_t* number,
                                     double* time) {
  return guarded(__func__, [&] {
    given(number, "number"), given(time, "time");
    *number = of(snapshot).number();
    *time = of(snapshot).time();
  });
}
palpate_status palpate_snapshot_has(const palpate_snapshot* snapshot, palpate_id id, uint8_t* has) {
  return guarded(__func__, [&] { given(has, "has") = of(snapshot).has(GeometryId{id}); });
}
palpate_status palpate_snapshot_positions(const palpate_snapshot* snapshot, palpate_id id,
                                          const double** before, const double** now,
                                          size_t* count) {
  return guarded(__func__, [&] {
    given(before, "before"), given(now, "now"), given(count, "count");
    const auto end = of(snapshot).positions(GeometryId{id});
    *before = reinterpret_cast<const double*>(of(snapshot).positionsBefore(GeometryId{id}).data());
    *now = reinterpret_cast<const double*>(end.data());
    *count = end.size();
  });
}
palpate_status palpate_snapshot_tags(const palpate_snapshot* snapshot, palpate_id id,
                                     const uint32_t** tags, size_t* count) {
  return guarded(__func__, [&] {
    given(tags, "tags"), given(count, "count");
    const auto all = of(snapshot).tags(GeometryId{id});
    *tags = all.data();
    *count = all.size();
  });
}
palpate_status palpate_snapshot_motion(const palpate_snapshot* snapshot, palpate_id id,
                                       palpate_motion* motion) {
  return guarded(
      __func__, [&] { given(motion, "motion") = fromMotion(of(snapshot).motion(GeometryId{id})); });
}
palpate_status palpate_snapshot_position(const palpate_snapshot* snapshot, palpate_id id,
                                         uint32_t vertex, double time, double* position) {
  return guarded(__func__, [&] {
    fromVector(of(snapshot).position(GeometryId{id}, vertex, time), &given(position, "position"));
  });
}

palpate_status palpate_init_field_settings(palpate_field_settings* settings, size_t size) {
  const DistanceFieldSettings s;
  return initialise(
      __func__, settings, size,
      {sizeof *settings, s.errorBound, s.band, s.memoryLimit, s.threads, nullptr, nullptr});
}
palpate_status palpate_build_field(const double* positions, size_t vertex_count,
                                   const uint32_t* triangles, size_t triangle_count,
                                   const palpate_field_settings* settings, palpate_field** field) {
  return guarded(__func__, [&] {
    given(field, "field");
    const palpate_field_settings& s = sized(settings, "the settings");
    DistanceFieldSettings all{.errorBound = s.error_bound,
                              .band = s.band,
                              .memoryLimit = s.memory_limit,
                              .threads = s.threads};
    if (s.progress)
      all.progress = [&s](double fraction) { return s.progress(s.context, fraction) != 0; };
    *field = new palpate_field{std::make_shared<const DistanceField>(
        DistanceField::build(meshOf(positions, vertex_count, triangles, triangle_count), all))};
  });
}
palpate_status palpate_load_field(const char* path, palpate_field** field) {
  return guarded(__func__, [&] {
    given(field, "field");
    *field = new palpate_field{
        std::make_shared<const DistanceField>(DistanceField::load(&given(path, "path")))};
  });
}
palpate_status palpate_save_field(const palpate_field* field, const char* path) {
  return guarded(__func__, [&] { fieldOf(field).save(&given(path, "path")); });
}
void palpate_release_field(palpate_field* field) { delete field; }
palpate_status palpate_get_field_info(const palpate_field* field, palpate_field_info* info) {
  return guarded(__func__, [&] {
    sized(info, "info");
    const DistanceField& f = fieldOf(field);
    *info = {sizeof *info, f.errorBound(), f.band(), f.bytes(), f.cells(), f.isClosed()};
  });
}
palpate_status palpate_field_values(const palpate_field* field, const double* points, size_t count,
                                    double* values) {
  return guarded(__func__, [&] {
    fieldOf(field).values(positions(points, count, "points"), array(values, count, "values"));
  });
}
palpate_status palpate_field_gradient(const palpate_field* field, const double* point,
                                      double* gradient) {
  return guarded(__func__, [&] {
    given(gradient, "gradient");
    fromVector(fieldOf(field).gradient(vector(point, "point")), gradient);
  });
}
palpate_status palpate_field_sign_is_reliable(const palpate_field* field, const double* point,
                                              uint8_t* reliable) {
  return guarded(__func__, [&] {
    given(reliable, "reliable") = fieldOf(field).signIsReliable(vector(point, "point"));
  });
}

palpate_status palpate_weld(const double* positions, size_t vertex_count, const uint32_t* triangles,
                            size_t triangle_count, double distance, double* welded_positions,
                            uint32_t* welded_triangles, uint32_t* vertex_of, size_t* count) {
  return guarded(__func__, [&] {
    given(count, "count");
    const auto outPositions = array(welded_positions, 3 * vertex_count, "welded_positions");
    const auto outTriangles = array(welded_triangles, 3 * triangle_count, "welded_triangles");
    const auto outVertices = array(vertex_of, vertex_count, "vertex_of");
    const TriangleMeshView mesh = meshOf(positions, vertex_count, triangles, triangle_count);
    const Welded welded = weld(mesh.positions, mesh.triangles, distance);
    for (std::size_t i = 0; i < welded.positions.size(); ++i)
      fromVector(welded.positions[i], &outPositions[3 * i]);
    for (std::size_t i = 0; i < welded.triangles.size(); ++i)
      std::ranges::copy(welded.triangles[i], &outTriangles[3 * i]);
    std::ranges::copy(welded.vertexOf, outVertices.begin());
    *count = welded.positions.size();
  });
}
palpate_status palpate_find_mesh_defects(const double* positions, size_t vertex_count,
                                         const uint32_t* triangles, size_t triangle_count,
                                         palpate_mesh_defects* defects) {
  return guarded(__func__, [&] {
    sized(defects, "defects");
    const MeshDefects d =
        findMeshDefects(meshOf(positions, vertex_count, triangles, triangle_count));
    *defects = {sizeof *defects,      d.open.size(), d.flipped.size(), d.shared.size(),
                d.overlapping.size(), d.unwelded,    d.insideOut};
  });
}
