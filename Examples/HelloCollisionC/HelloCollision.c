/* From two meshes to their contacts: a needle's tip comes down on a piece of tissue. */
#include <palpate/palpate_c.h>

#include <stdio.h>

/* Ends the program with the library's message if a call failed. */
#define CHECK(call)                        \
  do {                                     \
    if ((call) != PALPATE_OK) {            \
      puts(palpate_last_error());          \
      return 1;                            \
    }                                      \
  } while (0)

int main(void) {
  static const double tissue[] = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0};
  static const uint32_t tissueTriangles[] = {0, 1, 2, 0, 2, 3};
  double tip[] = {0.2, 0, 1, 0.4, 0, 1, 0.3, 0.2, 1, 0.3, 0.1, 0.41};
  static const uint32_t tipTriangles[] = {0, 1, 3, 1, 2, 3, 2, 0, 3, 0, 2, 1};

  palpate_cd* detection;
  palpate_id tool, organ;
  CHECK(palpate_create(NULL, &detection));
  CHECK(palpate_add_triangle_mesh(detection, tip, 4, tipTriangles, 4, &tool));
  CHECK(palpate_add_triangle_mesh(detection, tissue, 4, tissueTriangles, 2, &organ));
  palpate_pair_settings settings;
  CHECK(palpate_init_pair_settings(&settings, sizeof settings));
  settings.method = PALPATE_METHOD_PROXIMITY;
  settings.thickness = 0.02;
  CHECK(palpate_add_pair(detection, tool, organ, &settings));

  palpate_contacts contacts = {.size = sizeof contacts};
  for (int frame = 0; frame < 5; ++frame) {
    CHECK(palpate_set_positions(detection, tool, tip, 4));
    CHECK(palpate_detect(detection));
    CHECK(palpate_get_contacts(detection, tool, organ, &contacts));
    if (contacts.vertex_triangle_count == 0) printf("frame %d: no contact\n", frame);
    for (size_t i = 0; i < contacts.vertex_triangle_count; ++i) {
      const palpate_vertex_triangle* contact = &contacts.vertex_triangle[i];
      printf(
          "frame %d: vertex %u of the tip touches triangle %u of the tissue, %.3f away, normal "
          "(%g, %g, %g)\n",
          frame, (unsigned)contact->vertex, (unsigned)contact->triangle, contact->distance,
          contact->normal[0], contact->normal[1], contact->normal[2]);
    }
    CHECK(palpate_advance(detection));
    for (int vertex = 0; vertex < 4; ++vertex) tip[3 * vertex + 2] -= 0.1;
  }
  palpate_destroy(detection);
  return 0;
}
