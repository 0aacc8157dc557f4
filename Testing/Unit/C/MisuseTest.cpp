#include "Common/FailingAllocation.h"

#include <palpate/palpate_c.h>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

// Each misuse of the C interface gives a status and a message that names the function and the
// place.
namespace palpate::testing {
namespace {

constexpr double kPositions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
constexpr std::uint32_t kTriangles[] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
constexpr palpate_pose kRest{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 0, 0}};

class CMisuse : public ::testing::Test {
 protected:
  CMisuse() {
    palpate_create(nullptr, &m_cd);
    palpate_add_triangle_mesh(m_cd, kPositions, 4, kTriangles, 4, &m_a);
    palpate_add_triangle_mesh(m_cd, kPositions, 4, kTriangles, 4, &m_b);
    palpate_add_pair(m_cd, m_a, m_b, nullptr);
    palpate_create_queries(m_cd, &m_queries);
    palpate_publish(m_cd, 0);
    palpate_latest_snapshot(m_cd, &m_snapshot);
    palpate_field_settings settings;
    palpate_init_field_settings(&settings, sizeof settings);
    settings.error_bound = settings.band = 0.5;
    palpate_build_field(kPositions, 4, kTriangles, 4, &settings, &m_field);
  }
  ~CMisuse() override {
    palpate_release_field(m_field);
    palpate_release_snapshot(m_snapshot);
    palpate_destroy_queries(m_queries);
    palpate_destroy(m_cd);
  }

  palpate_cd* m_cd = nullptr;
  palpate_queries* m_queries = nullptr;
  palpate_snapshot* m_snapshot = nullptr;
  palpate_field* m_field = nullptr;
  palpate_id m_a = 0, m_b = 0;
};

#define EXPECT_REFUSED(call, status, sentence)                                    \
  do {                                                                            \
    EXPECT_EQ(call, status);                                                      \
    const std::string message = palpate_last_error();                             \
    EXPECT_NE(message.find(sentence), std::string::npos) << message;              \
    const std::string function = std::string(#call).substr(0, message.find('(')); \
    EXPECT_EQ(message.substr(0, function.size()), function) << message;           \
  } while (false)

TEST_F(CMisuse, WrongArgumentsAreNamed) {
  const double nan[] = {0, 0, 0, 1, 0, 0, 0, std::nan(""), 0, 0, 0, 1};
  const std::uint32_t beyond[] = {0, 1, 9};
  palpate_id id;
  EXPECT_REFUSED(palpate_add_triangle_mesh(m_cd, nan, 4, kTriangles, 4, &id),
                 PALPATE_NON_FINITE_POSITION, "vertex 2");
  EXPECT_EQ(palpate_last_error_element(), 2u);
  EXPECT_EQ(palpate_last_error_geometry(), m_b + 1);
  EXPECT_REFUSED(palpate_set_triangles(m_cd, m_a, kPositions, 4, beyond, 1),
                 PALPATE_INDEX_OUT_OF_RANGE, "geometry 0");
  EXPECT_REFUSED(palpate_set_positions(m_cd, m_a, kPositions, 3), PALPATE_WRONG_POSITION_COUNT,
                 "geometry 0");
  EXPECT_REFUSED(palpate_set_some_positions(m_cd, m_a, 2, kPositions, 3),
                 PALPATE_WRONG_POSITION_COUNT, "geometry 0");
  EXPECT_REFUSED(palpate_set_some_positions(m_cd, m_a, SIZE_MAX, kPositions, 3),
                 PALPATE_WRONG_POSITION_COUNT, "geometry 0");
  EXPECT_REFUSED(palpate_remove(m_cd, 77), PALPATE_UNKNOWN_GEOMETRY, "77");
  EXPECT_EQ(palpate_last_error_geometry(), 77u);
  EXPECT_EQ(palpate_last_error_element(), SIZE_MAX);
  EXPECT_REFUSED(palpate_add_pair(m_cd, m_b, m_a, nullptr), PALPATE_DUPLICATE_PAIR, "0");
  EXPECT_REFUSED(palpate_set_triangles(m_cd, m_a, kPositions, 4, nullptr, 1),
                 PALPATE_INVALID_ARGUMENT, "triangles is null");
  EXPECT_REFUSED(palpate_set_positions(m_cd, m_a, nullptr, 4), PALPATE_INVALID_ARGUMENT,
                 "now is null");
  const double radius = -1, radii[] = {1, 1};
  EXPECT_REFUSED(palpate_add_point_set(m_cd, kPositions, 4, &radius, 1, &id),
                 PALPATE_INVALID_RADIUS, "-1");
  EXPECT_REFUSED(palpate_add_point_set(m_cd, kPositions, 4, radii, 2, &id), PALPATE_INVALID_RADIUS,
                 "2");
  palpate_pose pose = kRest;
  pose.rotation[1][1] = 2;
  EXPECT_REFUSED(palpate_set_transform(m_cd, m_a, &pose), PALPATE_INVALID_TRANSFORM, "geometry 0");
  palpate_surface_point point;
  EXPECT_REFUSED(palpate_closest_points(m_queries, m_a, nan, 3, 1, &point + 0),
                 PALPATE_NON_FINITE_POSITION, "point 2");
  EXPECT_REFUSED(palpate_set_name(m_cd, 9, "tool"), PALPATE_UNKNOWN_GEOMETRY, "9");
  palpate_field* field = nullptr;
  EXPECT_REFUSED(palpate_load_field("no such file", &field), PALPATE_FILE, "no such file");
  double position[3];
  EXPECT_REFUSED(palpate_snapshot_position(m_snapshot, m_a, 4, 1, position),
                 PALPATE_INDEX_OUT_OF_RANGE, "4");
  palpate_contacts contacts{};
  contacts.size = sizeof contacts;
  EXPECT_REFUSED(palpate_get_contacts(m_cd, m_a, m_b, &contacts), PALPATE_NOT_AVAILABLE, "");
}

TEST_F(CMisuse, SizesOfStructsAndValuesAreChecked) {
  palpate_pair_settings pair;
  EXPECT_REFUSED(palpate_init_pair_settings(&pair, sizeof pair - 1), PALPATE_INVALID_ARGUMENT,
                 std::to_string(sizeof pair));
  ASSERT_EQ(palpate_init_pair_settings(&pair, sizeof pair), PALPATE_OK);
  pair.size += 8;
  EXPECT_REFUSED(palpate_set_pair_settings(m_cd, m_a, m_b, &pair), PALPATE_INVALID_ARGUMENT,
                 "The size of the settings");
  pair.size = sizeof pair;
  for (const int wrong : {-1, 6}) {
    pair.method = wrong;
    EXPECT_REFUSED(palpate_set_pair_settings(m_cd, m_a, m_b, &pair), PALPATE_INVALID_ARGUMENT,
                   "method is " + std::to_string(wrong));
  }
  pair.method = PALPATE_METHOD_AUTO;
  pair.contacts = 2;
  EXPECT_REFUSED(palpate_set_pair_settings(m_cd, m_a, m_b, &pair), PALPATE_INVALID_ARGUMENT,
                 "contacts is 2");
  palpate_settings settings;
  ASSERT_EQ(palpate_init_settings(&settings, sizeof settings), PALPATE_OK);
  palpate_cd* cd = nullptr;
  for (int* member : {&settings.engine, &settings.octree_update, &settings.octree_bounds}) {
    *member = 9;
    EXPECT_REFUSED(palpate_create(&settings, &cd), PALPATE_INVALID_ARGUMENT, "9");
    *member = 0;
  }
  settings.max_depth = 99;
  EXPECT_REFUSED(palpate_create(&settings, &cd), PALPATE_INVALID_SETTINGS, "99");
  EXPECT_EQ(cd, nullptr);
  palpate_filter filter{};
  EXPECT_REFUSED(palpate_set_filter(m_cd, m_a, &filter), PALPATE_INVALID_ARGUMENT, "size");
  palpate_shape shape{};
  palpate_id id;
  EXPECT_REFUSED(palpate_add_shape(m_cd, &shape, &id), PALPATE_INVALID_ARGUMENT, "size");
  shape.size = sizeof shape;
  shape.kind = 6;
  EXPECT_REFUSED(palpate_add_shape(m_cd, &shape, &id), PALPATE_INVALID_ARGUMENT, "kind is 6");
  shape.kind = PALPATE_SPHERE;
  shape.radius = -2;
  EXPECT_REFUSED(palpate_add_shape(m_cd, &shape, &id), PALPATE_INVALID_SHAPE, "-2");
  shape.kind = PALPATE_HULL;
  shape.point_count = 3;
  EXPECT_REFUSED(palpate_add_shape(m_cd, &shape, &id), PALPATE_INVALID_ARGUMENT, "points is null");
  palpate_inside_settings inside{sizeof inside, 0.0, 2};
  std::uint8_t flag;
  EXPECT_REFUSED(palpate_contains(m_queries, m_a, kPositions, 1, &inside, &flag),
                 PALPATE_INVALID_ARGUMENT, "rule is 2");
}

TEST_F(CMisuse, ContactsOverTime) {
  std::size_t count = 0;
  palpate_contact_key key{5, {}};
  EXPECT_REFUSED(palpate_get_ended(m_cd, m_a, m_b, nullptr, 0, &count), PALPATE_NOT_AVAILABLE, "");
  EXPECT_REFUSED(palpate_set_user_data(m_cd, m_a, m_b, &key, 1), PALPATE_INVALID_ARGUMENT,
                 "kind is 5");
  key.kind = PALPATE_EDGE_EDGE;
  EXPECT_REFUSED(palpate_set_user_data(m_cd, m_a, m_b, &key, 1), PALPATE_NOT_AVAILABLE,
                 "trackContacts is not set");
  ASSERT_EQ(palpate_detect(m_cd), PALPATE_OK);
  for (const int kind : {-1, 5, 256})
    EXPECT_REFUSED(palpate_get_tracked(m_cd, m_a, m_b, kind, nullptr, 0, &count),
                   PALPATE_INVALID_ARGUMENT, "kind is " + std::to_string(kind));
  palpate_pair_settings pair;
  ASSERT_EQ(palpate_init_pair_settings(&pair, sizeof pair), PALPATE_OK);
  pair.method = PALPATE_METHOD_INTERSECTION;
  pair.report_crossings = 7;  // counts as 1
  EXPECT_REFUSED(palpate_set_pair_settings(m_cd, m_a, m_b, &pair), PALPATE_UNSUPPORTED_METHOD,
                 "reportCrossings");
  const double* normals = nullptr;
  for (const int kind : {-1, 4})
    EXPECT_REFUSED(palpate_get_smooth_normals(m_cd, m_a, m_b, kind, &normals, &count),
                   PALPATE_INVALID_ARGUMENT, "kind is " + std::to_string(kind));
  EXPECT_REFUSED(palpate_set_remembered_sides(m_cd, m_a, m_b, nullptr, 0), PALPATE_NOT_AVAILABLE,
                 "rememberSides is not set");
  EXPECT_REFUSED(palpate_get_tracked(m_cd, m_b, 99, 0, nullptr, 0, &count),
                 PALPATE_UNKNOWN_GEOMETRY, "99");
}

/// Arrays of more bytes than a program can have: their ends would lie before their starts.
TEST_F(CMisuse, CountsThatOverflowAreRefused) {
  constexpr int kBits = std::numeric_limits<std::size_t>::digits;
  palpate_id id;
  palpate_shape hull{};
  hull.size = sizeof hull;
  hull.kind = PALPATE_HULL;
  hull.points = kPositions;
  // The first, times the size of a position, is that of four positions.
  for (const std::size_t count : {(std::size_t{1} << (kBits - 3)) + 4, SIZE_MAX}) {
    const std::string items = std::to_string(count) + " items";
    hull.point_count = count;
    EXPECT_REFUSED(palpate_add_shape(m_cd, &hull, &id), PALPATE_TOO_LARGE, "points has " + items);
    EXPECT_REFUSED(palpate_add_point_set(m_cd, kPositions, count, nullptr, 0, &id),
                   PALPATE_TOO_LARGE, "positions has " + items);
    EXPECT_REFUSED(palpate_set_triangles(m_cd, m_a, kPositions, 4, kTriangles, count),
                   PALPATE_TOO_LARGE, "triangles has " + items);
    std::uint8_t flag = 0;
    EXPECT_REFUSED(palpate_contains(m_queries, m_a, kPositions, count, nullptr, &flag),
                   PALPATE_TOO_LARGE, "points has " + items);
  }
}

/// Each function with each of its pointers null in turn; those that may be null are not listed.
TEST_F(CMisuse, NullIsRefused) {
  palpate_cd* cd = m_cd;
  palpate_queries* q = m_queries;
  palpate_snapshot* s = m_snapshot;
  palpate_field* f = m_field;
  const palpate_id a = m_a, b = m_b;
  const double* d = kPositions;
  const std::uint32_t* e = kTriangles;
  palpate_id id = 0, *ids = &id;
  std::size_t n = 0, *count = &n;
  std::uint8_t u = 0, *flag = &u;
  double x[12], *out = x;
  std::uint32_t w[12], *words = w;
  const double** view;
  const double* viewed;
  view = &viewed;
  const std::uint32_t** wordView;
  const std::uint32_t* viewedWords;
  wordView = &viewedWords;
  const palpate_ray ray{{0, 0, 5}, {0, 0, -1}, 0, 9}, *r = &ray;
  palpate_shape sphere{};
  sphere.size = sizeof sphere;
  const palpate_shape* shape = &sphere;
  const palpate_pose *pose = &kRest, *noPose = nullptr;
  palpate_side sideValue;
  ASSERT_EQ(palpate_init_side(&sideValue, sizeof sideValue), PALPATE_OK);
  const palpate_side* side = &sideValue;
  const palpate_contact_key key{};
  const palpate_crossing* crossings = nullptr;
  palpate_topology* t = nullptr;
  const palpate_thread_event* events = nullptr;
  int number = 0;
  ASSERT_EQ(palpate_create_topology(cd, &t), PALPATE_OK);
  ASSERT_EQ(palpate_watch_loop(t, a, e, 3, b, e, 3, count), PALPATE_OK);
  const std::vector<std::function<palpate_status()>> calls{
      [&] { return palpate_create(nullptr, nullptr); },
      [&] { return palpate_init_settings(nullptr, sizeof(palpate_settings)); },
      [&] { return palpate_init_pair_settings(nullptr, sizeof(palpate_pair_settings)); },
      [&] { return palpate_init_filter(nullptr, sizeof(palpate_filter)); },
      [&] { return palpate_init_proxy_settings(nullptr, sizeof(palpate_proxy_settings)); },
      [&] { return palpate_init_field_settings(nullptr, sizeof(palpate_field_settings)); },
      [&] { return palpate_init_inside_settings(nullptr, sizeof(palpate_inside_settings)); },
      [&] { return palpate_init_side(nullptr, sizeof(palpate_side)); },
      [&] { return palpate_add_triangle_mesh(nullptr, d, 4, e, 4, ids); },
      [&] { return palpate_add_triangle_mesh(cd, nullptr, 4, e, 4, ids); },
      [&] { return palpate_add_triangle_mesh(cd, d, 4, nullptr, 4, ids); },
      [&] { return palpate_add_triangle_mesh(cd, d, 4, e, 4, nullptr); },
      [&] { return palpate_add_tetrahedral_mesh(nullptr, d, 4, e, 1, ids); },
      [&] { return palpate_add_tetrahedral_mesh(cd, nullptr, 4, e, 1, ids); },
      [&] { return palpate_add_tetrahedral_mesh(cd, d, 4, nullptr, 1, ids); },
      [&] { return palpate_add_tetrahedral_mesh(cd, d, 4, e, 1, nullptr); },
      [&] { return palpate_add_line_mesh(nullptr, d, 4, e, 1, d, 1, ids); },
      [&] { return palpate_add_line_mesh(cd, nullptr, 4, e, 1, d, 1, ids); },
      [&] { return palpate_add_line_mesh(cd, d, 4, nullptr, 1, d, 1, ids); },
      [&] { return palpate_add_line_mesh(cd, d, 4, e, 1, nullptr, 1, ids); },
      [&] { return palpate_add_line_mesh(cd, d, 4, e, 1, d, 1, nullptr); },
      [&] { return palpate_add_point_set(nullptr, d, 4, d, 1, ids); },
      [&] { return palpate_add_point_set(cd, nullptr, 4, d, 1, ids); },
      [&] { return palpate_add_point_set(cd, d, 4, nullptr, 1, ids); },
      [&] { return palpate_add_point_set(cd, d, 4, d, 1, nullptr); },
      [&] { return palpate_add_shape(nullptr, shape, ids); },
      [&] { return palpate_add_shape(cd, nullptr, ids); },
      [&] { return palpate_add_shape(cd, shape, nullptr); },
      [&] { return palpate_add_field(nullptr, f, ids); },
      [&] { return palpate_add_field(cd, nullptr, ids); },
      [&] { return palpate_add_field(cd, f, nullptr); },
      [&] { return palpate_attach_field(nullptr, a, f); },
      [&] { return palpate_attach_proxy(nullptr, a, nullptr); },
      [&] { return palpate_remove(nullptr, a); },
      [&] { return palpate_has(nullptr, a, flag); },
      [&] { return palpate_has(cd, a, nullptr); },
      [&] { return palpate_set_positions(nullptr, a, d, 4); },
      [&] { return palpate_set_positions(cd, a, nullptr, 4); },
      [&] { return palpate_set_step(nullptr, a, d, d, 4); },
      [&] { return palpate_set_step(cd, a, nullptr, d, 4); },
      [&] { return palpate_set_step(cd, a, d, nullptr, 4); },
      [&] { return palpate_set_some_positions(nullptr, a, 0, d, 4); },
      [&] { return palpate_set_some_positions(cd, a, 0, nullptr, 4); },
      [&] { return palpate_set_triangles(nullptr, a, d, 4, e, 4); },
      [&] { return palpate_set_triangles(cd, a, nullptr, 4, e, 4); },
      [&] { return palpate_set_tetrahedra(nullptr, a, d, 4, e, 1); },
      [&] { return palpate_set_tetrahedra(cd, a, nullptr, 4, e, 1); },
      [&] { return palpate_set_tetrahedra(cd, a, d, 4, nullptr, 1); },
      [&] { return palpate_set_transform(nullptr, a, pose); },
      [&] { return palpate_set_transform(cd, a, noPose); },
      [&] { return palpate_set_motion(nullptr, a, nullptr); },
      [&] { return palpate_set_motion(cd, a, nullptr); },
      [&] { return palpate_set_name(nullptr, a, ""); },
      [&] { return palpate_set_name(cd, a, nullptr); },
      [&] { return palpate_set_filter(nullptr, a, nullptr); },
      [&] { return palpate_set_filter(cd, a, nullptr); },
      [&] { return palpate_set_disabled_elements(nullptr, a, e, 1); },
      [&] { return palpate_set_disabled_elements(cd, a, nullptr, 1); },
      [&] { return palpate_get_positions(nullptr, a, view, count); },
      [&] { return palpate_get_positions(cd, a, nullptr, count); },
      [&] { return palpate_get_positions(cd, a, view, nullptr); },
      [&] { return palpate_get_bounds(nullptr, a, out, out); },
      [&] { return palpate_get_bounds(cd, a, nullptr, out); },
      [&] { return palpate_get_bounds(cd, a, out, nullptr); },
      [&] { return palpate_get_transform(nullptr, a, nullptr); },
      [&] { return palpate_get_transform(cd, a, nullptr); },
      [&] { return palpate_get_name(cd, a, nullptr); },
      [&] { return palpate_get_surface(cd, a, nullptr, wordView, count); },
      [&] { return palpate_get_surface(cd, a, wordView, nullptr, count); },
      [&] { return palpate_get_surface(cd, a, wordView, wordView, nullptr); },
      [&] { return palpate_get_surface(nullptr, a, wordView, wordView, count); },
      [&] { return palpate_add_pair(nullptr, a, a, nullptr); },
      [&] { return palpate_set_pair_settings(nullptr, a, b, nullptr); },
      [&] { return palpate_set_predicate(nullptr, a, b, nullptr, nullptr); },
      [&] { return palpate_remove_pair(nullptr, a, b); },
      [&] { return palpate_get_pair_settings(cd, a, b, nullptr); },
      [&] { return palpate_get_pairs(nullptr, nullptr, 0, count); },
      [&] { return palpate_get_pairs(cd, nullptr, 1, count); },
      [&] { return palpate_get_pairs(cd, nullptr, 0, nullptr); },
      [&] { return palpate_get_candidates(cd, a, b, nullptr, 1, count); },
      [&] { return palpate_get_candidates(cd, a, b, nullptr, 0, nullptr); },
      [&] { return palpate_update(nullptr); },
      [&] { return palpate_detect(nullptr); },
      [&] { return palpate_advance(nullptr); },
      [&] { return palpate_release_memory(nullptr); },
      [&] { return palpate_capture(nullptr, ""); },
      [&] { return palpate_capture(cd, nullptr); },
      [&] { return palpate_save(nullptr, nullptr, 0, count); },
      [&] { return palpate_save(cd, nullptr, 1, count); },
      [&] { return palpate_save(cd, nullptr, 0, nullptr); },
      [&] { return palpate_restore(nullptr, nullptr, 0); },
      [&] { return palpate_restore(cd, nullptr, 1); },
      [&] { return palpate_get_contacts(cd, a, b, nullptr); },
      [&] { return palpate_get_validity(cd, a, b, nullptr); },
      [&] { return palpate_get_earliest_time(nullptr, a, b, out); },
      [&] { return palpate_get_hash(nullptr, a, b, nullptr); },
      [&] { return palpate_get_free_motion(cd, a, nullptr, count); },
      [&] { return palpate_get_free_motion(cd, a, view, nullptr); },
      [&] { return palpate_get_tracked(nullptr, a, b, 0, nullptr, 0, count); },
      [&] { return palpate_get_tracked(cd, a, b, 0, nullptr, 1, count); },
      [&] { return palpate_get_tracked(cd, a, b, 0, nullptr, 0, nullptr); },
      [&] { return palpate_get_ended(nullptr, a, b, nullptr, 0, count); },
      [&] { return palpate_get_ended(cd, a, b, nullptr, 1, count); },
      [&] { return palpate_get_ended(cd, a, b, nullptr, 0, nullptr); },
      [&] { return palpate_set_user_data(nullptr, a, b, &key, 0); },
      [&] { return palpate_set_user_data(cd, a, b, nullptr, 0); },
      [&] { return palpate_get_crossings(nullptr, a, b, &crossings, count); },
      [&] { return palpate_get_crossings(cd, a, b, nullptr, count); },
      [&] { return palpate_get_crossings(cd, a, b, &crossings, nullptr); },
      [&] { return palpate_create_topology(nullptr, &t); },
      [&] { return palpate_create_topology(cd, nullptr); },
      [&] { return palpate_watch_loop(nullptr, a, e, 3, b, e, 3, count); },
      [&] { return palpate_watch_loop(t, a, nullptr, 3, b, e, 3, count); },
      [&] { return palpate_watch_loop(t, a, e, 3, b, nullptr, 3, count); },
      [&] { return palpate_watch_loop(t, a, e, 3, b, e, 3, nullptr); },
      [&] { return palpate_watch_parts(nullptr, a, e, 3, b, e, 3, count); },
      [&] { return palpate_watch_parts(t, a, nullptr, 3, b, e, 3, count); },
      [&] { return palpate_watch_parts(t, a, e, 3, b, nullptr, 3, count); },
      [&] { return palpate_watch_parts(t, a, e, 3, b, e, 3, nullptr); },
      [&] { return palpate_update_topology(nullptr); },
      [&] { return palpate_get_thread_count(nullptr, 0, &number, flag); },
      [&] { return palpate_get_thread_count(t, 0, nullptr, flag); },
      [&] { return palpate_get_thread_events(nullptr, &events, count); },
      [&] { return palpate_get_thread_events(t, nullptr, count); },
      [&] { return palpate_get_thread_events(t, &events, nullptr); },
      [&] { return palpate_clear_thread_events(nullptr); },
      [&] { return palpate_save_topology(nullptr, nullptr, 0, count); },
      [&] { return palpate_restore_topology(nullptr, nullptr, 0); },
      [&] { return palpate_get_smooth_normals(nullptr, a, b, 0, view, count); },
      [&] { return palpate_get_smooth_normals(cd, a, b, 0, nullptr, count); },
      [&] { return palpate_get_smooth_normals(cd, a, b, 0, view, nullptr); },
      [&] { return palpate_get_remembered_sides(nullptr, a, b, &crossings, count); },
      [&] { return palpate_get_remembered_sides(cd, a, b, nullptr, count); },
      [&] { return palpate_get_remembered_sides(cd, a, b, &crossings, nullptr); },
      [&] { return palpate_set_remembered_sides(nullptr, a, b, nullptr, 0); },
      [&] { return palpate_set_remembered_sides(cd, a, b, nullptr, 1); },
      [&] { return palpate_get_statistics(cd, nullptr); },
      [&] { return palpate_get_pair_statistics(cd, a, b, nullptr); },
      [&] { return palpate_get_rows(nullptr, a, b, side, side, nullptr, nullptr, 0, count); },
      [&] { return palpate_get_rows(cd, a, b, side, side, nullptr, nullptr, 1, count); },
      [&] { return palpate_get_step_rows(nullptr, a, b, 0, 0, nullptr, 0, count); },
      [&] { return palpate_get_step_rows(cd, a, b, 0, 0, nullptr, 1, count); },
      [&] { return palpate_get_step_rows(cd, a, b, 0, 0, nullptr, 0, nullptr); },
      [&] { return palpate_get_motions(cd, a, b, side, side, nullptr, 1, count); },
      [&] { return palpate_get_tangents(nullptr, nullptr, reinterpret_cast<double(*)[3]>(out)); },
      [&] { return palpate_get_tangents(d, nullptr, nullptr); },
      [&] { return palpate_create_queries(nullptr, &q); },
      [&] { return palpate_create_queries(cd, nullptr); },
      [&] { return palpate_closest_points(nullptr, a, d, 0, 1, nullptr); },
      [&] { return palpate_closest_points(q, a, nullptr, 1, 1, nullptr); },
      [&] { return palpate_closest_points(q, a, d, 1, 1, nullptr); },
      [&] { return palpate_nearest_elements(q, a, nullptr, 1, 1, nullptr, 0, count); },
      [&] { return palpate_nearest_elements(q, a, d, 1, 1, nullptr, 1, count); },
      [&] { return palpate_contains(q, a, nullptr, 1, nullptr, flag); },
      [&] { return palpate_contains(q, a, d, 1, nullptr, nullptr); },
      [&] { return palpate_signed_distances(q, a, d, 1, nullptr, nullptr); },
      [&] { return palpate_elements_within(q, a, nullptr, 1, words, 1, count); },
      [&] { return palpate_elements_within(q, a, d, 1, nullptr, 1, count); },
      [&] { return palpate_first_hits(q, a, nullptr, 1, nullptr); },
      [&] { return palpate_first_hits(q, a, r, 1, nullptr); },
      [&] { return palpate_first_hit(q, r, nullptr); },
      [&] { return palpate_any_hit(q, a, nullptr, flag); },
      [&] { return palpate_any_hit(q, a, r, nullptr); },
      [&] { return palpate_all_hits(q, a, nullptr, nullptr, 0, count); },
      [&] { return palpate_pick_first(q, r, 0, nullptr); },
      [&] { return palpate_overlapping(q, a, nullptr, pose, words, 1, count); },
      [&] { return palpate_overlapping(q, a, shape, nullptr, words, 1, count); },
      [&] { return palpate_contacts_with_shape(q, a, shape, nullptr, 1, nullptr, 0, count); },
      [&] { return palpate_get_distance(q, a, b, nullptr); },
      [&] { return palpate_get_penetration(q, a, b, nullptr); },
      [&] {
        return palpate_follow_path(q, nullptr, 2, 0, &a, 1, nullptr, 0, count, nullptr, 0, count);
      },
      [&] {
        return palpate_follow_path(q, d, 2, 0, nullptr, 1, nullptr, 0, count, nullptr, 0, count);
      },
      [&] {
        return palpate_follow_path(q, d, 2, 0, &a, 1, nullptr, 0, nullptr, nullptr, 0, count);
      },
      [&] { return palpate_inside_vertices(q, a, b, nullptr, nullptr, 1, count); },
      [&] { return palpate_embedded_vertices(q, a, b, nullptr, 1, count); },
      [&] { return palpate_find_tetrahedron(q, a, d, nullptr); },
      [&] { return palpate_publish(nullptr, 0); },
      [&] { return palpate_latest_snapshot(nullptr, &s); },
      [&] { return palpate_latest_snapshot(cd, nullptr); },
      [&] { return palpate_snapshot_queries(nullptr, &q); },
      [&] { return palpate_snapshot_queries(s, nullptr); },
      [&] { return palpate_snapshot_time(s, nullptr, out); },
      [&] { return palpate_snapshot_has(s, a, nullptr); },
      [&] { return palpate_snapshot_positions(s, a, nullptr, view, count); },
      [&] { return palpate_snapshot_motion(s, a, nullptr); },
      [&] { return palpate_snapshot_position(s, a, 0, 1, nullptr); },
      [&] { return palpate_build_field(d, 4, e, 4, nullptr, &f); },
      [&] { return palpate_load_field(nullptr, &f); },
      [&] { return palpate_save_field(nullptr, ""); },
      [&] { return palpate_save_field(f, nullptr); },
      [&] { return palpate_get_field_info(f, nullptr); },
      [&] { return palpate_field_values(f, d, 1, nullptr); },
      [&] { return palpate_field_gradient(f, nullptr, out); },
      [&] { return palpate_field_gradient(f, d, nullptr); },
      [&] { return palpate_field_sign_is_reliable(f, d, nullptr); },
      [&] { return palpate_weld(d, 4, e, 4, 0, nullptr, words, words, count); },
      [&] { return palpate_weld(d, 4, e, 4, 0, out, words, words, nullptr); },
      [&] { return palpate_find_mesh_defects(d, 4, e, 4, nullptr); },
  };
  for (std::size_t i = 0; i < calls.size(); ++i) {
    EXPECT_EQ(calls[i](), PALPATE_INVALID_ARGUMENT) << "call " << i;
    const std::string message = palpate_last_error();
    EXPECT_TRUE(message.starts_with("palpate_") && message.ends_with(" is null."))
        << "call " << i << ": " << message;
  }
  palpate_destroy(nullptr);
  palpate_destroy_topology(t);
  palpate_destroy_topology(nullptr);
  palpate_destroy_queries(nullptr);
  palpate_release_snapshot(nullptr);
  palpate_release_field(nullptr);
}

TEST_F(CMisuse, NothingIsNeededForEmptyArrays) {
  palpate_id id;
  EXPECT_EQ(palpate_add_triangle_mesh(m_cd, nullptr, 0, nullptr, 0, &id), PALPATE_OK);
  EXPECT_EQ(palpate_set_positions(m_cd, id, nullptr, 0), PALPATE_OK);
  EXPECT_EQ(palpate_set_disabled_elements(m_cd, id, nullptr, 0), PALPATE_OK);
  EXPECT_EQ(palpate_closest_points(m_queries, m_a, nullptr, 0, 1, nullptr), PALPATE_INVALID_CALL);
  EXPECT_EQ(palpate_add_point_set(m_cd, kPositions, 4, nullptr, 0, &id), PALPATE_OK);
  palpate_field_values(m_field, nullptr, 0, nullptr);
}

TEST_F(CMisuse, NoExceptionLeavesACall) {
  palpate_set_predicate(
      m_cd, m_a, m_b, [](void*, const palpate_features*) -> int { throw 7; }, nullptr);
  EXPECT_REFUSED(palpate_detect(m_cd), PALPATE_UNEXPECTED, "unknown type");
  palpate_set_predicate(
      m_cd, m_a, m_b,
      [](void*, const palpate_features*) -> int { throw std::runtime_error("my own"); }, nullptr);
  EXPECT_REFUSED(palpate_detect(m_cd), PALPATE_UNEXPECTED, "my own");
  palpate_set_predicate(m_cd, m_a, m_b, nullptr, nullptr);
  // Every allocation of these calls fails once.
  for (std::size_t n = 1;; ++n) {
    palpate_cd* cd = nullptr;
    palpate_id id;
    FailingAllocation::arm(n);
    const palpate_status created = palpate_create(nullptr, &cd);
    const palpate_status added =
        cd ? palpate_add_triangle_mesh(cd, kPositions, 4, kTriangles, 4, &id) : PALPATE_OK;
    const palpate_status refused = palpate_set_positions(m_cd, m_a, nullptr, 1);
    FailingAllocation::disarm();
    EXPECT_TRUE(created == PALPATE_OK || created == PALPATE_OUT_OF_MEMORY);
    EXPECT_EQ(created == PALPATE_OK, cd != nullptr);
    EXPECT_TRUE(added == PALPATE_OK || added == PALPATE_OUT_OF_MEMORY);
    EXPECT_TRUE(refused == PALPATE_INVALID_ARGUMENT || refused == PALPATE_OUT_OF_MEMORY);
    palpate_destroy(cd);
    if (!FailingAllocation::failed()) {
      EXPECT_GT(n, 10u);
      break;
    }
  }
}

TEST_F(CMisuse, ErrorsBelongToTheirThread) {
  palpate_detect(nullptr);
  const std::string message = palpate_last_error();
  std::string before, after;
  std::thread([&] {
    before = palpate_last_error();
    palpate_remove(m_cd, 55);
    after = palpate_last_error();
  }).join();
  EXPECT_EQ(before, "");
  EXPECT_NE(after, message);
  EXPECT_EQ(message, palpate_last_error());
  const std::string longName(3000, 'x');
  ASSERT_EQ(palpate_set_name(m_cd, m_a, longName.c_str()), PALPATE_OK);
  EXPECT_EQ(palpate_set_positions(m_cd, m_a, kPositions, 1), PALPATE_WRONG_POSITION_COUNT);
  EXPECT_EQ(std::string(palpate_last_error()).size(), 1023u);
}

TEST(CStatus, NamesAndVersion) {
  EXPECT_STREQ(palpate_status_name(PALPATE_OK), "Ok");
  EXPECT_STREQ(palpate_status_name(PALPATE_NON_FINITE_POSITION), "NonFinitePosition");
  EXPECT_STREQ(palpate_status_name(PALPATE_CANCELLED), "Cancelled");
  EXPECT_STREQ(palpate_status_name(PALPATE_INVALID_ARGUMENT), "InvalidArgument");
  EXPECT_STREQ(palpate_status_name(PALPATE_OUT_OF_MEMORY), "OutOfMemory");
  EXPECT_STREQ(palpate_status_name(PALPATE_UNEXPECTED), "Unexpected");
  EXPECT_STREQ(palpate_status_name(static_cast<palpate_status>(50)), "unknown");
  EXPECT_STREQ(palpate_version(), PALPATE_VERSION);
}

}  // namespace
}  // namespace palpate::testing
