// Part of <palpate/palpate_c.h>: stitches and knots.
#include "C/Handles.h"
#include "C/Twins.h"

using namespace palpate;
using namespace palpate::c;

namespace {

VertexPath pathOf(palpate_id id, const uint32_t* vertices, size_t count, const char* name) {
  const auto all = array(vertices, count, name);
  return {GeometryId{id}, {all.begin(), all.end()}};
}

}  // namespace

palpate_status palpate_create_topology(palpate_cd* cd, palpate_topology** topology) {
  return guarded(__func__, [&] {
    given(topology, "topology");
    *topology = new palpate_topology{ThreadTopology(of(cd))};
  });
}
void palpate_destroy_topology(palpate_topology* topology) { delete topology; }

palpate_status palpate_watch_loop(palpate_topology* topology, palpate_id thread,
                                  const uint32_t* vertices, size_t count, palpate_id loop,
                                  const uint32_t* loop_vertices, size_t loop_count, size_t* index) {
  return guarded(__func__, [&] {
    given(index, "index");
    *index = of(topology).add(pathOf(thread, vertices, count, "vertices"),
                              pathOf(loop, loop_vertices, loop_count, "loop_vertices"));
  });
}
palpate_status palpate_watch_parts(palpate_topology* topology, palpate_id first,
                                   const uint32_t* vertices, size_t count, palpate_id second,
                                   const uint32_t* second_vertices, size_t second_count,
                                   size_t* index) {
  return guarded(__func__, [&] {
    given(index, "index");
    *index =
        of(topology).addParts(pathOf(first, vertices, count, "vertices"),
                              pathOf(second, second_vertices, second_count, "second_vertices"));
  });
}

palpate_status palpate_update_topology(palpate_topology* topology) {
  return guarded(__func__, [&] { of(topology).update(); });
}
palpate_status palpate_get_thread_count(const palpate_topology* topology, size_t index, int* count,
                                        uint8_t* is_lost) {
  return guarded(__func__, [&] {
    given(count, "count") = of(topology).count(index);
    if (is_lost) *is_lost = of(topology).isLost(index);
  });
}
palpate_status palpate_get_thread_events(const palpate_topology* topology,
                                         const palpate_thread_event** events, size_t* count) {
  return guarded(__func__, [&] {
    given(events, "events"), given(count, "count");
    const auto all = of(topology).events();
    *events = fromTwins<palpate_thread_event>(all.data());
    *count = all.size();
  });
}
palpate_status palpate_clear_thread_events(palpate_topology* topology) {
  return guarded(__func__, [&] { of(topology).clear(); });
}
palpate_status palpate_save_topology(const palpate_topology* topology, uint8_t* bytes,
                                     size_t capacity, size_t* count) {
  return guarded(__func__, [&] {
    array(bytes, capacity, "bytes"), given(count, "count");
    copyBytes(of(topology).save(), bytes, capacity, count);
  });
}
palpate_status palpate_restore_topology(palpate_topology* topology, const uint8_t* bytes,
                                        size_t count) {
  return guarded(__func__,
                 [&] { of(topology).restore(std::as_bytes(array(bytes, count, "bytes"))); });
}
