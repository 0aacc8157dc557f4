/* Prints the size of each struct of the C interface, as Testing/C/abi.txt lists it. */
#include <palpate/palpate_c.h>

#include <stdio.h>

#define SIZE(type) printf("%s %u\n", #type, (unsigned)sizeof(type))

int main(void) {
  SIZE(palpate_contact_key);
  SIZE(palpate_contact_motion);
  SIZE(palpate_contacts);
  SIZE(palpate_crossing);
  SIZE(palpate_distance);
  SIZE(palpate_edge_edge);
  SIZE(palpate_embedded_vertex);
  SIZE(palpate_features);
  SIZE(palpate_field_info);
  SIZE(palpate_field_settings);
  SIZE(palpate_filter);
  SIZE(palpate_hit);
  SIZE(palpate_indices);
  SIZE(palpate_inside_settings);
  SIZE(palpate_inside_vertex);
  SIZE(palpate_memory);
  SIZE(palpate_mesh_defects);
  SIZE(palpate_motion);
  SIZE(palpate_pair);
  SIZE(palpate_pair_settings);
  SIZE(palpate_pair_statistics);
  SIZE(palpate_path_clearance);
  SIZE(palpate_path_interval);
  SIZE(palpate_penetration);
  SIZE(palpate_pick);
  SIZE(palpate_pose);
  SIZE(palpate_proxy_settings);
  SIZE(palpate_ray);
  SIZE(palpate_row);
  SIZE(palpate_settings);
  SIZE(palpate_shape);
  SIZE(palpate_shape_contact);
  SIZE(palpate_shape_shape);
  SIZE(palpate_side);
  SIZE(palpate_signed_distance);
  SIZE(palpate_statistics);
  SIZE(palpate_surface_point);
  SIZE(palpate_tetrahedron_point);
  SIZE(palpate_thread_event);
  SIZE(palpate_tracked_contact);
  SIZE(palpate_unfinished_pair);
  SIZE(palpate_validity);
  SIZE(palpate_vertex_triangle);
  return 0;
}
