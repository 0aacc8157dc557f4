#pragma once

#include <palpate/Export.h>

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

// Palpate in C99. Functions do what C++ functions of like names do, with the same bits.
// The C++ headers state laws, accuracy, order and cost; Docs/HowTo/C.md has a program.
// Status   unless it is PALPATE_OK, palpate_last_error() says why, nothing has changed, and arrays
//          and structs that the call fills have no meaning. Null is refused unless this header
//          allows it. No exception leaves a call.
// Units    L is the length unit of the positions.
// Arrays   contiguous. Positions are x, y, z in double. An element is its vertex indices: 3 of a
//          triangle, 2 of a segment, 4 of a tetrahedron. Counts are of positions and elements. The
//          library keeps no pointer. An array of count 0 may be null.
// Structs  where `size` is the first member, palpate_init_*() sets it and the defaults, or you set
//          it to sizeof. Another size is refused. Null settings are the defaults.
// Views    a pointer to const that a call returns is valid until the next call that takes the
//          palpate_cd without const. Of a snapshot, until its release.
// Lists    the call writes at most `capacity` items and sets `count` to the length of the whole
//          list. With capacity 0 the array may be null.
// Flags    uint8_t, 0 or 1; each other value of a flag that you pass counts as 1.
// Threads  calls with const handles may run at once while no other call has the same palpate_cd.

/// Up to PALPATE_CANCELLED the codes are those of ErrorCode, whose causes are in Docs/Errors.md.
typedef enum palpate_status {
  PALPATE_OK,
  PALPATE_NON_FINITE_POSITION,
  PALPATE_WRONG_POSITION_COUNT,
  PALPATE_INDEX_OUT_OF_RANGE,
  PALPATE_UNKNOWN_GEOMETRY,
  PALPATE_UNKNOWN_PAIR,
  PALPATE_DUPLICATE_PAIR,
  PALPATE_INVALID_SETTINGS,
  PALPATE_NOT_CLOSED,
  PALPATE_UNSUPPORTED_METHOD,
  PALPATE_TOO_LARGE,
  PALPATE_NOT_AVAILABLE,
  PALPATE_FILE,
  PALPATE_INVALID_RADIUS,
  PALPATE_INVALID_SHAPE,
  PALPATE_INVALID_TRANSFORM,
  PALPATE_SHARED_FACE,
  PALPATE_INVALID_CALL,
  PALPATE_IMPACT_REMAINS,
  PALPATE_MEMORY_LIMIT,
  PALPATE_CANCELLED,
  PALPATE_INVALID_ARGUMENT = 100,  ///< null, a size that is not that of the struct, no such value
  PALPATE_OUT_OF_MEMORY,           ///< the system gives no more memory
  PALPATE_UNEXPECTED               ///< another exception; the message is its text
} palpate_status;

PALPATE_EXPORT const char* palpate_version(void);  ///< such as "0.1.0"
PALPATE_EXPORT const char* palpate_status_name(palpate_status);

/// Of the last call on this thread that failed: the function, and what is wrong with geometry,
/// element and value. Empty before; valid until the next failure on this thread.
PALPATE_EXPORT const char* palpate_last_error(void);
/// The geometry at fault, or PALPATE_NO_ELEMENT.
PALPATE_EXPORT uint32_t palpate_last_error_geometry(void);
/// The index of the vertex, element or hull point at fault, or SIZE_MAX.
PALPATE_EXPORT size_t palpate_last_error_element(void);

#define PALPATE_NO_ELEMENT 0xffffffffu  ///< no element, vertex or geometry

typedef uint32_t palpate_id;  ///< a geometry of one palpate_cd; never given out twice

typedef struct palpate_cd palpate_cd;              ///< OctreeBasedCD
typedef struct palpate_queries palpate_queries;    ///< SpatialQueries
typedef struct palpate_snapshot palpate_snapshot;  ///< a reference to a Snapshot
typedef struct palpate_field palpate_field;        ///< a reference to a DistanceField
typedef struct palpate_topology palpate_topology;  ///< ThreadTopology

// Settings

enum { PALPATE_UPDATE_AUTO, PALPATE_UPDATE_REBUILD };                     ///< OctreeUpdate
enum { PALPATE_BOUNDS_BOX, PALPATE_BOUNDS_DOP14, PALPATE_BOUNDS_DOP18 };  ///< OctreeBounds
enum { PALPATE_ENGINE_OCTREE, PALPATE_ENGINE_BRUTE_FORCE };               ///< Engine
enum {
  PALPATE_METHOD_AUTO,
  PALPATE_METHOD_INTERSECTION,
  PALPATE_METHOD_PROXIMITY,
  PALPATE_METHOD_CONTINUOUS,
  PALPATE_METHOD_DISTANCE_FIELD,
  PALPATE_METHOD_PROXY
};                                                              ///< Method
enum { PALPATE_CONTACTS_DISTINCT, PALPATE_CONTACTS_ALL };       ///< Contacts
enum { PALPATE_SIDES_BOTH, PALPATE_SIDES_OUTER };               ///< Sidedness
enum { PALPATE_INSIDE_CLOSED, PALPATE_INSIDE_WINDING_NUMBER };  ///< InsideRule

/// <palpate/Settings.h>, without audits, traces and executors.
typedef struct palpate_settings {
  size_t size;
  size_t memory_limit;  ///< bytes; 0: no limit
  int max_depth;
  int max_elements_per_leaf;
  int octree_update;
  int octree_bounds;
  int engine;
  int threads;  ///< 0: one per core
  uint8_t keeps_pairs;
} palpate_settings;
PALPATE_EXPORT palpate_status palpate_init_settings(palpate_settings* settings, size_t size);

typedef struct palpate_pair_settings {
  size_t size;
  double thickness;           ///< L
  double rest_distance;       ///< L
  double allowed_error;       ///< L
  double free_motion_reach;   ///< L
  double time_tolerance;      ///< of ContinuousSettings
  double motion_tolerance;    ///< L, of AutoSettings; negative: half the thickness
  double widest_normal_cone;  ///< rad, of LeafSettings
  int method;
  int contacts;
  int priority;
  uint8_t track_contacts, report_crossings;
  uint8_t smooth_normals, remember_sides;
  uint8_t earliest_time_only;
} palpate_pair_settings;
PALPATE_EXPORT palpate_status palpate_init_pair_settings(palpate_pair_settings* settings,
                                                         size_t size);

/// Two geometries collide only if the mask of each contains a group of the other.
typedef struct palpate_filter {
  size_t size;
  uint32_t groups;
  uint32_t mask;
  int sidedness;
} palpate_filter;
PALPATE_EXPORT palpate_status palpate_init_filter(palpate_filter* filter, size_t size);

/// SurfaceProxySettings. reach and error_bound have no default.
typedef struct palpate_proxy_settings {
  size_t size;
  double reach;               ///< L
  double error_bound;         ///< L
  double widest_normal_cone;  ///< rad
} palpate_proxy_settings;
PALPATE_EXPORT palpate_status palpate_init_proxy_settings(palpate_proxy_settings* settings,
                                                          size_t size);

/// DistanceFieldSettings. error_bound and band have no default.
typedef struct palpate_field_settings {
  size_t size;
  double error_bound;   ///< L
  double band;          ///< L
  size_t memory_limit;  ///< bytes; 0: no limit
  int threads;          ///< 0: one per core
  /// Null, or it returns 0 to end the build with PALPATE_CANCELLED.
  int (*progress)(void* context, double fraction);
  void* context;
} palpate_field_settings;
PALPATE_EXPORT palpate_status palpate_init_field_settings(palpate_field_settings* settings,
                                                          size_t size);

typedef struct palpate_inside_settings {
  size_t size;
  double margin;
  int rule;
} palpate_inside_settings;
PALPATE_EXPORT palpate_status palpate_init_inside_settings(palpate_inside_settings* settings,
                                                           size_t size);

// Placements and shapes

/// A point x of the body's frame is at rotation x + translation in the world.
typedef struct palpate_pose {
  double rotation[3][3];  ///< rows
  double translation[3];  ///< L
} palpate_pose;

typedef struct palpate_motion {
  palpate_pose before, now;
} palpate_motion;

enum {
  PALPATE_SPHERE,    ///< p0: centre; radius
  PALPATE_CAPSULE,   ///< p0, p1: ends; radius
  PALPATE_PLANE,     ///< p0: a point; p1: the normal, out of the half-space; two_sided
  PALPATE_BOX,       ///< p0: centre; p1: half extents
  PALPATE_CYLINDER,  ///< p0, p1: centres of the ends; radius
  PALPATE_HULL       ///< points, point_count
};
/// Members that the kind does not name do not count.
typedef struct palpate_shape {
  size_t size;
  int kind;
  uint8_t two_sided;
  double p0[3], p1[3];  ///< L
  double radius;        ///< L
  const double* points;
  size_t point_count;
} palpate_shape;

// Geometries

/// settings may be null.
PALPATE_EXPORT palpate_status palpate_create(const palpate_settings* settings, palpate_cd** cd);
PALPATE_EXPORT void palpate_destroy(palpate_cd* cd);  ///< null: does nothing

PALPATE_EXPORT palpate_status palpate_add_triangle_mesh(palpate_cd* cd, const double* positions,
                                                        size_t vertex_count,
                                                        const uint32_t* triangles,
                                                        size_t triangle_count, palpate_id* id);
PALPATE_EXPORT palpate_status palpate_add_tetrahedral_mesh(palpate_cd* cd, const double* positions,
                                                           size_t vertex_count,
                                                           const uint32_t* tetrahedra,
                                                           size_t tetrahedron_count,
                                                           palpate_id* id);
/// radii: L, `radius_count` of them: none for 0, 1 for all vertices, or one per vertex.
PALPATE_EXPORT palpate_status palpate_add_line_mesh(palpate_cd* cd, const double* positions,
                                                    size_t vertex_count, const uint32_t* segments,
                                                    size_t segment_count, const double* radii,
                                                    size_t radius_count, palpate_id* id);
/// radii: as for palpate_add_line_mesh().
PALPATE_EXPORT palpate_status palpate_add_point_set(palpate_cd* cd, const double* positions,
                                                    size_t vertex_count, const double* radii,
                                                    size_t radius_count, palpate_id* id);
PALPATE_EXPORT palpate_status palpate_add_shape(palpate_cd* cd, const palpate_shape* shape,
                                                palpate_id* id);
PALPATE_EXPORT palpate_status palpate_add_field(palpate_cd* cd, const palpate_field* field,
                                                palpate_id* id);
/// field: null detaches.
PALPATE_EXPORT palpate_status palpate_attach_field(palpate_cd* cd, palpate_id mesh,
                                                   const palpate_field* field);
/// settings: null detaches.
PALPATE_EXPORT palpate_status palpate_attach_proxy(palpate_cd* cd, palpate_id mesh,
                                                   const palpate_proxy_settings* settings);
PALPATE_EXPORT palpate_status palpate_remove(palpate_cd* cd, palpate_id id);
PALPATE_EXPORT palpate_status palpate_has(const palpate_cd* cd, palpate_id id, uint8_t* has);

PALPATE_EXPORT palpate_status palpate_set_positions(palpate_cd* cd, palpate_id id,
                                                    const double* now, size_t count);
/// Both ends of the step.
PALPATE_EXPORT palpate_status palpate_set_step(palpate_cd* cd, palpate_id id, const double* before,
                                               const double* now, size_t count);
/// `count` vertices from `first` on.
PALPATE_EXPORT palpate_status palpate_set_some_positions(palpate_cd* cd, palpate_id id,
                                                         size_t first, const double* now,
                                                         size_t count);
PALPATE_EXPORT palpate_status palpate_set_triangles(palpate_cd* cd, palpate_id id,
                                                    const double* positions, size_t vertex_count,
                                                    const uint32_t* triangles,
                                                    size_t triangle_count);
PALPATE_EXPORT palpate_status palpate_set_tetrahedra(palpate_cd* cd, palpate_id id,
                                                     const double* positions, size_t vertex_count,
                                                     const uint32_t* tetrahedra,
                                                     size_t tetrahedron_count);
/// A cut. rest: of the new vertices, or null. ids: null, or receives one for each added triangle.
PALPATE_EXPORT palpate_status palpate_replace_triangles(
    palpate_cd* cd, palpate_id id, const uint32_t* removed, size_t removed_count,
    const uint32_t* added, size_t added_count, const double* new_positions, const double* rest,
    size_t new_count, uint32_t* ids);
PALPATE_EXPORT palpate_status palpate_replace_tetrahedra(
    palpate_cd* cd, palpate_id id, const uint32_t* removed, size_t removed_count,
    const uint32_t* added, size_t added_count, const double* new_positions, const double* rest,
    size_t new_count, uint32_t* ids);
PALPATE_EXPORT palpate_status palpate_set_transform(palpate_cd* cd, palpate_id id,
                                                    const palpate_pose* now);
/// Both ends of the step.
PALPATE_EXPORT palpate_status palpate_set_motion(palpate_cd* cd, palpate_id id,
                                                 const palpate_motion* motion);
PALPATE_EXPORT palpate_status palpate_set_name(palpate_cd* cd, palpate_id id, const char* name);
PALPATE_EXPORT palpate_status palpate_set_filter(palpate_cd* cd, palpate_id id,
                                                 const palpate_filter* filter);
PALPATE_EXPORT palpate_status palpate_set_disabled_elements(palpate_cd* cd, palpate_id id,
                                                            const uint32_t* elements, size_t count);
PALPATE_EXPORT palpate_status palpate_set_tags(palpate_cd* cd, palpate_id id, const uint32_t* tags,
                                               size_t count);

PALPATE_EXPORT palpate_status palpate_get_positions(const palpate_cd* cd, palpate_id id,
                                                    const double** positions, size_t* count);
PALPATE_EXPORT palpate_status palpate_get_bounds(const palpate_cd* cd, palpate_id id,
                                                 double lower[3], double upper[3]);
PALPATE_EXPORT palpate_status palpate_get_transform(const palpate_cd* cd, palpate_id id,
                                                    palpate_pose* now);
PALPATE_EXPORT palpate_status palpate_get_name(const palpate_cd* cd, palpate_id id,
                                               const char** name);
/// The triangles that collide, and the tetrahedron of each.
PALPATE_EXPORT palpate_status palpate_get_surface(const palpate_cd* cd, palpate_id id,
                                                  const uint32_t** triangles,
                                                  const uint32_t** tetrahedra, size_t* count);
/// A view.
PALPATE_EXPORT palpate_status palpate_get_removed_elements(const palpate_cd* cd, palpate_id id,
                                                           const uint32_t** elements,
                                                           size_t* count);
/// A view.
PALPATE_EXPORT palpate_status palpate_get_tags(const palpate_cd* cd, palpate_id id,
                                               const uint32_t** tags, size_t* count);

// Pairs

/// a, b: the index of a vertex or triangle, twice; or the two vertices of an edge.
typedef struct palpate_features {
  int kind;  ///< up to PALPATE_EDGE_EDGE
  uint32_t a[2], b[2];
  uint32_t tag_a, tag_b;  ///< of palpate_set_tags()
} palpate_features;
enum {
  PALPATE_VERTEX_TRIANGLE,
  PALPATE_TRIANGLE_VERTEX,
  PALPATE_EDGE_EDGE,
  PALPATE_SHAPE_ELEMENT,
  PALPATE_SHAPE_SHAPE
};  ///< ContactKind

/// 0: these features are no contact. Several threads call it at once.
typedef int (*palpate_predicate)(void* context, const palpate_features* features);

/// Two geometries, elements or triangles.
typedef struct palpate_pair {
  uint32_t a, b;
} palpate_pair;

/// settings may be null.
PALPATE_EXPORT palpate_status palpate_add_pair(palpate_cd* cd, palpate_id a, palpate_id b,
                                               const palpate_pair_settings* settings);
/// settings may be null.
PALPATE_EXPORT palpate_status palpate_set_pair_settings(palpate_cd* cd, palpate_id a, palpate_id b,
                                                        const palpate_pair_settings* settings);
/// predicate: null refuses nothing.
PALPATE_EXPORT palpate_status palpate_set_predicate(palpate_cd* cd, palpate_id a, palpate_id b,
                                                    palpate_predicate predicate, void* context);
PALPATE_EXPORT palpate_status palpate_remove_pair(palpate_cd* cd, palpate_id a, palpate_id b);
/// settings: set its size first.
PALPATE_EXPORT palpate_status palpate_get_pair_settings(const palpate_cd* cd, palpate_id a,
                                                        palpate_id b,
                                                        palpate_pair_settings* settings);
/// A list.
PALPATE_EXPORT palpate_status palpate_get_pairs(const palpate_cd* cd, palpate_pair* pairs,
                                                size_t capacity, size_t* count);
/// A list.
PALPATE_EXPORT palpate_status palpate_get_candidates(palpate_cd* cd, palpate_id a, palpate_id b,
                                                     palpate_pair* elements, size_t capacity,
                                                     size_t* count);

// Frames

PALPATE_EXPORT palpate_status palpate_update(palpate_cd* cd);
PALPATE_EXPORT palpate_status palpate_detect(palpate_cd* cd);
/// complete: whether everything was finished.
PALPATE_EXPORT palpate_status palpate_detect_within(palpate_cd* cd, int64_t microseconds,
                                                    uint8_t* complete);
/// Ends the palpate_detect_within() of another thread.
PALPATE_EXPORT palpate_status palpate_cancel_detection(const palpate_cd* cd);
PALPATE_EXPORT palpate_status palpate_advance(palpate_cd* cd);
PALPATE_EXPORT palpate_status palpate_release_memory(palpate_cd* cd);
/// Writes the problem of the next detection to a file, which readCapture() of C++ reads.
PALPATE_EXPORT palpate_status palpate_capture(const palpate_cd* cd, const char* path);
/// The state, a list of bytes. Each call makes it anew: give a capacity that suffices.
PALPATE_EXPORT palpate_status palpate_save(const palpate_cd* cd, uint8_t* bytes, size_t capacity,
                                           size_t* count);
/// Goes back to a state of this or another palpate_cd.
PALPATE_EXPORT palpate_status palpate_restore(palpate_cd* cd, const uint8_t* bytes, size_t count);

// Contacts. <palpate/CollisionData.h> has the law that all satisfy, and signs and sides.

enum {
  PALPATE_CORNER_A,
  PALPATE_CORNER_B,
  PALPATE_CORNER_C,
  PALPATE_EDGE_AB,
  PALPATE_EDGE_BC,
  PALPATE_EDGE_CA,
  PALPATE_FACE
};                                                                            ///< TriangleFeature
enum { PALPATE_EDGE_START, PALPATE_EDGE_END, PALPATE_EDGE_INTERIOR };         ///< EdgeFeature
enum { PALPATE_ELEMENT_VERTEX, PALPATE_ELEMENT_EDGE, PALPATE_ELEMENT_FACE };  ///< ShapeElement

typedef struct palpate_vertex_triangle {
  uint32_t vertex, triangle;  ///< indices; `triangle` may be a segment or a point
  uint32_t vertices[3];       ///< {p, q, q} of a segment, {p, p, p} of a point
  double weights[3];
  double normal[3];  ///< unit, to the vertex
  double distance;   ///< L
  double time_of_impact;
  uint8_t feature;  ///< PALPATE_CORNER_A and following
} palpate_vertex_triangle;

typedef struct palpate_edge_edge {
  uint32_t edge_a[2], edge_b[2];  ///< vertex indices
  double weight_a, weight_b;      ///< closest point = p0 + weight (p1 - p0)
  double normal[3];               ///< unit, from edge b to edge a
  double distance;                ///< L
  double time_of_impact;
  uint8_t feature_a, feature_b;  ///< PALPATE_EDGE_START and following
} palpate_edge_edge;

typedef struct palpate_shape_contact {
  uint32_t element;      ///< PALPATE_ELEMENT_VERTEX and following
  uint32_t id;           ///< of the vertex or triangle; of an edge its lower vertex
  uint32_t vertices[3];  ///< {v, v, v} of a vertex, {p, q, q} of an edge
  double weights[3];
  double point[3];           ///< L, on the element
  double point_on_shape[3];  ///< L
  double normal[3];          ///< unit, out of the shape
  double distance;           ///< L
  double time_of_impact;
} palpate_shape_contact;

typedef struct palpate_shape_shape {
  double point_a[3], point_b[3];  ///< L
  double normal[3];               ///< unit, from b to a
  double distance;                ///< L
  double time_of_impact;
} palpate_shape_shape;

/// The contacts of a pair: views, in the order of CollisionData.
typedef struct palpate_contacts {
  size_t size;
  const palpate_vertex_triangle* vertex_triangle;  ///< vertices of a, triangles of b
  size_t vertex_triangle_count;
  const palpate_vertex_triangle* triangle_vertex;  ///< vertices of b, triangles of a
  size_t triangle_vertex_count;
  const palpate_edge_edge* edge_edge;
  size_t edge_edge_count;
  const palpate_pair* intersecting_triangles;
  size_t intersecting_triangle_count;
  const palpate_shape_contact* shape;
  size_t shape_count;
  const palpate_shape_shape* shape_shape;
  size_t shape_shape_count;
  double error_bound;  ///< L
} palpate_contacts;

/// Indices: a view.
typedef struct palpate_indices {
  const uint32_t* data;
  size_t count;
} palpate_indices;

enum {
  PALPATE_REASON_REQUESTED,
  PALPATE_REASON_STILL,
  PALPATE_REASON_SLOW,
  PALPATE_REASON_FAST,
  PALPATE_REASON_MIXED,
  PALPATE_REASON_CHEAPEST,
  PALPATE_REASON_NO_ALTERNATIVE,
  PALPATE_REASON_ALLOWED_ERROR,
  PALPATE_REASON_OUT_OF_TIME
};  ///< MethodReason

/// <palpate/Validity.h>
typedef struct palpate_validity {
  size_t size;
  size_t at_end, at_impact;
  double displacement, displacement_limit, arc_deviation, effective_thickness, proxy_depth;  ///< L
  palpate_indices untrusted_vertices_a, untrusted_vertices_b;
  palpate_indices degenerate_triangles_a, degenerate_triangles_b;
  palpate_indices outside_band, near_threshold, unreliable_sign;
  int method, reason;
  uint32_t age;  ///< in detections
  uint8_t trusted, started_apart, side_may_be_wrong, unwelded;
  uint8_t advance_may_be_missing;
} palpate_validity;

/// Set the size of `contacts` first. (a, b) is in the order of palpate_add_pair().
PALPATE_EXPORT palpate_status palpate_get_contacts(const palpate_cd* cd, palpate_id a, palpate_id b,
                                                   palpate_contacts* contacts);
/// Set the size of `validity` first.
PALPATE_EXPORT palpate_status palpate_get_validity(const palpate_cd* cd, palpate_id a, palpate_id b,
                                                   palpate_validity* validity);
/// Infinity without a contact.
PALPATE_EXPORT palpate_status palpate_get_earliest_time(const palpate_cd* cd, palpate_id a,
                                                        palpate_id b, double* time_of_impact);
PALPATE_EXPORT palpate_status palpate_get_hash(const palpate_cd* cd, palpate_id a, palpate_id b,
                                               uint64_t* hash);
/// One number per vertex, or one for a shape: a view.
PALPATE_EXPORT palpate_status palpate_get_free_motion(const palpate_cd* cd, palpate_id id,
                                                      const double** motions, size_t* count);

// Contacts over time. <palpate/Tracking.h>

typedef struct palpate_contact_key {
  uint8_t kind;     ///< PALPATE_VERTEX_TRIANGLE and following
  uint32_t ids[4];  ///< those of ContactKey
} palpate_contact_key;

enum {
  PALPATE_END_NONE,
  PALPATE_END_CUT,
  PALPATE_END_DISABLED,
  PALPATE_END_FILTERED,
  PALPATE_END_APART
};  ///< ContactEnd

typedef struct palpate_tracked_contact {
  palpate_contact_key key;
  palpate_contact_key predecessor;  ///< without one its ids are PALPATE_NO_ELEMENT
  uint32_t age;
  uint8_t has_predecessor;
  uint8_t end;  ///< PALPATE_END_NONE and following
  uint64_t user_data;
} palpate_tracked_contact;

typedef struct palpate_crossing {
  uint8_t kind;     ///< up to PALPATE_EDGE_EDGE
  uint32_t ids[4];  ///< those of palpate_contact_key
  double time;      ///< [0, 1] of the step
  uint8_t forward;
} palpate_crossing;

/// A list, parallel to the contacts of this kind. Empty without `track_contacts`.
PALPATE_EXPORT palpate_status palpate_get_tracked(const palpate_cd* cd, palpate_id a, palpate_id b,
                                                  int kind, palpate_tracked_contact* tracked,
                                                  size_t capacity, size_t* count);
/// A list of the contacts that ended.
PALPATE_EXPORT palpate_status palpate_get_ended(const palpate_cd* cd, palpate_id a, palpate_id b,
                                                palpate_tracked_contact* ended, size_t capacity,
                                                size_t* count);
PALPATE_EXPORT palpate_status palpate_set_user_data(palpate_cd* cd, palpate_id a, palpate_id b,
                                                    const palpate_contact_key* key,
                                                    uint64_t user_data);
/// Two tags for each contact of this kind, of both features: a view. Empty without tags.
PALPATE_EXPORT palpate_status palpate_get_contact_tags(const palpate_cd* cd, palpate_id a,
                                                       palpate_id b, int kind,
                                                       const uint32_t** tags, size_t* count);
/// A view. Empty without `report_crossings`.
PALPATE_EXPORT palpate_status palpate_get_crossings(const palpate_cd* cd, palpate_id a,
                                                    palpate_id b,
                                                    const palpate_crossing** crossings,
                                                    size_t* count);
/// A view of x, y, z of each contact of this kind. Empty without `smooth_normals`.
PALPATE_EXPORT palpate_status palpate_get_smooth_normals(const palpate_cd* cd, palpate_id a,
                                                         palpate_id b, int kind,
                                                         const double** normals, size_t* count);
/// A view. Empty without `remember_sides`.
PALPATE_EXPORT palpate_status palpate_get_remembered_sides(const palpate_cd* cd, palpate_id a,
                                                           palpate_id b,
                                                           const palpate_crossing** sides,
                                                           size_t* count);
PALPATE_EXPORT palpate_status palpate_set_remembered_sides(palpate_cd* cd, palpate_id a,
                                                           palpate_id b,
                                                           const palpate_crossing* sides,
                                                           size_t count);

// Stitches and knots. <palpate/ThreadTopology.h>

enum {
  PALPATE_PASSED,
  PALPATE_END_PASSED,
  PALPATE_SET,
  PALPATE_CUT,
  PALPATE_DISABLED
};  ///< ThreadEvent::Cause

typedef struct palpate_thread_event {
  size_t index;
  uint64_t step;
  int cause;           ///< PALPATE_PASSED and following
  int change;          ///< of the count
  uint32_t thread[2];  ///< an edge, twice an end, or PALPATE_NO_ELEMENT
  uint32_t loop[2];    ///< a side or the second edge, or PALPATE_NO_ELEMENT
  double time;         ///< [0, 1] of the step
} palpate_thread_event;

/// Destroy it with palpate_destroy_topology(), before or after the palpate_cd. Calls without const
/// change it, and read the palpate_cd.
PALPATE_EXPORT palpate_status palpate_create_topology(palpate_cd* cd, palpate_topology** topology);
PALPATE_EXPORT void palpate_destroy_topology(palpate_topology* topology);  ///< null: does nothing
/// ThreadTopology::add().
PALPATE_EXPORT palpate_status palpate_watch_loop(palpate_topology* topology, palpate_id thread,
                                                 const uint32_t* vertices, size_t count,
                                                 palpate_id loop, const uint32_t* loop_vertices,
                                                 size_t loop_count, size_t* index);
/// ThreadTopology::addParts().
PALPATE_EXPORT palpate_status palpate_watch_parts(palpate_topology* topology, palpate_id first,
                                                  const uint32_t* vertices, size_t count,
                                                  palpate_id second,
                                                  const uint32_t* second_vertices,
                                                  size_t second_count, size_t* index);
PALPATE_EXPORT palpate_status palpate_update_topology(palpate_topology* topology);
/// is_lost: may be null.
PALPATE_EXPORT palpate_status palpate_get_thread_count(const palpate_topology* topology,
                                                       size_t index, int* count, uint8_t* is_lost);
/// A view, until the topology is updated, cleared or destroyed.
PALPATE_EXPORT palpate_status palpate_get_thread_events(const palpate_topology* topology,
                                                        const palpate_thread_event** events,
                                                        size_t* count);
PALPATE_EXPORT palpate_status palpate_clear_thread_events(palpate_topology* topology);
/// The counts and events, beside palpate_save(). Restore both.
PALPATE_EXPORT palpate_status palpate_save_topology(const palpate_topology* topology,
                                                    uint8_t* bytes, size_t capacity, size_t* count);
PALPATE_EXPORT palpate_status palpate_restore_topology(palpate_topology* topology,
                                                       const uint8_t* bytes, size_t count);

/// Bytes.
typedef struct palpate_memory {
  size_t geometries, octrees, pairs, narrow_phase, results, queries, snapshots, total;
} palpate_memory;

/// <palpate/FrameStatistics.h>. Milliseconds are wall-clock time.
typedef struct palpate_statistics {
  size_t size;
  double boxes_ms, octree_ms, pairs_ms, narrow_phase_ms, order_ms;
  size_t geometries, triangles, segments, points, untested_vertices;
  size_t rebuilt_octrees, refitted_octrees, unchanged_octrees;
  size_t candidate_pairs, feature_pairs, contacts, intersecting_triangles, exact_decisions;
  size_t validity_pairs;
  palpate_memory memory, peak_memory;
  uint8_t free_motion_unfinished;
} palpate_statistics;

typedef struct palpate_unfinished_pair {
  palpate_id a, b;
  double distance_bound;  ///< L
  uint32_t age;           ///< in detections
  uint8_t exceeds_budget;
} palpate_unfinished_pair;

typedef struct palpate_pair_statistics {
  size_t size;
  double milliseconds;
  size_t candidate_pairs, feature_pairs, exact_decisions, contacts;
} palpate_pair_statistics;

/// Set the size of `statistics` first.
PALPATE_EXPORT palpate_status palpate_get_statistics(const palpate_cd* cd,
                                                     palpate_statistics* statistics);
/// A view of the pairs for which the last detection had no time.
PALPATE_EXPORT palpate_status palpate_get_unfinished_pairs(const palpate_cd* cd,
                                                           const palpate_unfinished_pair** pairs,
                                                           size_t* count);
/// Set the size of `statistics` first.
PALPATE_EXPORT palpate_status palpate_get_pair_statistics(const palpate_cd* cd, palpate_id a,
                                                          palpate_id b,
                                                          palpate_pair_statistics* statistics);

// Constraint rows. <palpate/ConstraintRows.h>

/// gap(x) = normal . sum of weights[i] x[vertices[i]] - offset
typedef struct palpate_row {
  uint32_t vertices[4];  ///< the solver's numbers
  double weights[4];     ///< 0: this vertex does not count
  double normal[3];      ///< unit
  double offset;         ///< L
} palpate_row;

/// One side of a pair. For a shape or a field's body, `count` is 0 and only `motion` is read.
typedef struct palpate_side {
  size_t size;
  const double *before, *now;  ///< L, in the world, `count` vertices each
  size_t count;
  const double* radii;    ///< only palpate_get_motions() reads them
  size_t radius_count;    ///< 0, 1 or `count`
  uint32_t first;         ///< the solver's number of vertex 0
  palpate_motion motion;  ///< of a shape or field's body in the step
} palpate_side;
/// No vertices and no motion.
PALPATE_EXPORT palpate_status palpate_init_side(palpate_side* side, size_t size);

typedef struct palpate_contact_motion {
  double point[3], opposite[3];     ///< L, on the surfaces of the first and of the other side
  double relative_displacement[3];  ///< L, of the first side less the other's
} palpate_contact_motion;

/// A list: a row for each vertex-triangle, triangle-vertex, edge-edge and shape contact.
/// body     the motion of the pair's shape or field's body; null: it rests.
PALPATE_EXPORT palpate_status palpate_get_rows(const palpate_cd* cd, palpate_id a, palpate_id b,
                                               const palpate_side* side_a,
                                               const palpate_side* side_b,
                                               const palpate_motion* body, palpate_row* rows,
                                               size_t capacity, size_t* count);
/// The same list with the positions of the step: CollisionData::appendRows().
PALPATE_EXPORT palpate_status palpate_get_step_rows(const palpate_cd* cd, palpate_id a,
                                                    palpate_id b, uint32_t first_of_a,
                                                    uint32_t first_of_b, palpate_row* rows,
                                                    size_t capacity, size_t* count);
/// A list in the order of the rows, or one item for two shapes in contact.
PALPATE_EXPORT palpate_status palpate_get_motions(const palpate_cd* cd, palpate_id a, palpate_id b,
                                                  const palpate_side* side_a,
                                                  const palpate_side* side_b,
                                                  palpate_contact_motion* motions, size_t capacity,
                                                  size_t* count);
/// Of the unit normal. previous: null, or the contact's last tangents.
PALPATE_EXPORT palpate_status palpate_get_tangents(const double normal[3],
                                                   const double previous[2][3],
                                                   double tangents[2][3]);

// Queries. <palpate/SpatialQueries.h>

typedef struct palpate_surface_point {
  palpate_id geometry;
  uint32_t element;      ///< PALPATE_NO_ELEMENT: of a shape, or there is no such point
  uint32_t vertices[3];  ///< {p, q, q} of a segment, {p, p, p} of a point
  double weights[3];
  double position[3];  ///< L
  double distance;     ///< L
  double normal[3];    ///< unit, outward
} palpate_surface_point;

typedef struct palpate_signed_distance {
  palpate_surface_point nearest;
  double distance;  ///< L, negative inside
} palpate_signed_distance;

/// The points origin + t direction with t in [t_min, t_max], which may be INFINITY.
typedef struct palpate_ray {
  double origin[3], direction[3];  ///< L; the direction has any length but 0
  double t_min, t_max;
} palpate_ray;

typedef struct palpate_hit {
  palpate_id geometry;
  uint32_t element;      ///< PALPATE_NO_ELEMENT: of a shape, or there is no hit
  uint32_t vertices[3];  ///< as in palpate_surface_point
  double weights[3];
  double t;            ///< infinity: no hit
  uint8_t front_face;  ///< the ray comes against the winding normal
  uint8_t crosses;     ///< the ray changes sides
} palpate_hit;

typedef struct palpate_pick {
  palpate_hit hit;
  uint32_t vertex;
  uint32_t edge[2];
} palpate_pick;

typedef struct palpate_distance {
  palpate_surface_point a, b;
  double distance;  ///< L
} palpate_distance;

typedef struct palpate_penetration {
  uint8_t intersecting;
  double direction[3];  ///< unit; 0 if not intersecting
  double depth;         ///< L: moving a by depth * direction separates the bodies
  palpate_surface_point a, b;
  uint8_t minimal;  ///< no shorter translation separates the bodies
} palpate_penetration;

typedef struct palpate_path_interval {
  palpate_id body;
  double enter, leave;  ///< arc lengths, L
  uint32_t entry_element, exit_element;
} palpate_path_interval;

typedef struct palpate_path_clearance {
  palpate_id body;
  double distance;  ///< L
  double at;        ///< arc length, L
  palpate_surface_point nearest;
} palpate_path_clearance;

typedef struct palpate_inside_vertex {
  uint32_t vertex, triangle;
  uint32_t vertices[3];
  double weights[3];
  double direction[3];  ///< unit, to the surface point
  double depth;         ///< L
  uint8_t decided;
} palpate_inside_vertex;

typedef struct palpate_tetrahedron_point {
  uint32_t tetrahedron;  ///< PALPATE_NO_ELEMENT: no tetrahedron holds the point
  uint32_t vertices[4];
  double weights[4];
} palpate_tetrahedron_point;

typedef struct palpate_embedded_vertex {
  uint32_t vertex;
  palpate_tetrahedron_point at;
} palpate_embedded_vertex;

/// At the positions now. Calls fail with PALPATE_INVALID_CALL after these change. Destroy it with
/// palpate_destroy_queries(), before or after the palpate_cd or snapshot.
PALPATE_EXPORT palpate_status palpate_create_queries(const palpate_cd* cd,
                                                     palpate_queries** queries);
PALPATE_EXPORT void palpate_destroy_queries(palpate_queries* queries);  ///< null: does nothing

/// points: `count` of them. out: `count` items. max_distance: L; INFINITY for no limit.
PALPATE_EXPORT palpate_status palpate_closest_points(const palpate_queries* queries, palpate_id id,
                                                     const double* points, size_t count,
                                                     double max_distance,
                                                     palpate_surface_point* out);
/// A list of the k nearest, or of fewer.
PALPATE_EXPORT palpate_status palpate_nearest_elements(const palpate_queries* queries,
                                                       palpate_id id, const double point[3], int k,
                                                       double max_distance,
                                                       palpate_surface_point* out, size_t capacity,
                                                       size_t* count);
/// inside: `count` flags. settings may be null.
PALPATE_EXPORT palpate_status palpate_contains(const palpate_queries* queries, palpate_id body,
                                               const double* points, size_t count,
                                               const palpate_inside_settings* settings,
                                               uint8_t* inside);
/// out: `count` items. settings may be null.
PALPATE_EXPORT palpate_status palpate_signed_distances(const palpate_queries* queries,
                                                       palpate_id body, const double* points,
                                                       size_t count,
                                                       const palpate_inside_settings* settings,
                                                       palpate_signed_distance* out);
/// A list of elements.
PALPATE_EXPORT palpate_status palpate_elements_within(const palpate_queries* queries, palpate_id id,
                                                      const double point[3], double radius,
                                                      uint32_t* elements, size_t capacity,
                                                      size_t* count);
/// out: `count` items.
PALPATE_EXPORT palpate_status palpate_first_hits(const palpate_queries* queries, palpate_id id,
                                                 const palpate_ray* rays, size_t count,
                                                 palpate_hit* out);
/// The first hit of all geometries; without one its t is infinite.
PALPATE_EXPORT palpate_status palpate_first_hit(const palpate_queries* queries,
                                                const palpate_ray* ray, palpate_hit* hit);
PALPATE_EXPORT palpate_status palpate_any_hit(const palpate_queries* queries, palpate_id id,
                                              const palpate_ray* ray, uint8_t* any);
/// A list by ascending t.
PALPATE_EXPORT palpate_status palpate_all_hits(const palpate_queries* queries, palpate_id id,
                                               const palpate_ray* ray, palpate_hit* hits,
                                               size_t capacity, size_t* count);
/// Of all geometries; without a hit its t is infinite.
PALPATE_EXPORT palpate_status palpate_pick_first(const palpate_queries* queries,
                                                 const palpate_ray* ray, int front_faces_only,
                                                 palpate_pick* pick);
/// A list of elements.
PALPATE_EXPORT palpate_status palpate_overlapping(const palpate_queries* queries, palpate_id id,
                                                  const palpate_shape* shape,
                                                  const palpate_pose* pose, uint32_t* elements,
                                                  size_t capacity, size_t* count);
/// A list.
PALPATE_EXPORT palpate_status palpate_contacts_with_shape(const palpate_queries* queries,
                                                          palpate_id id, const palpate_shape* shape,
                                                          const palpate_pose* pose,
                                                          double thickness,
                                                          palpate_shape_contact* contacts,
                                                          size_t capacity, size_t* count);
PALPATE_EXPORT palpate_status palpate_get_distance(const palpate_queries* queries, palpate_id a,
                                                   palpate_id b, palpate_distance* distance);
PALPATE_EXPORT palpate_status palpate_get_penetration(const palpate_queries* queries, palpate_id a,
                                                      palpate_id b,
                                                      palpate_penetration* penetration);
/// Two lists. `points` make the polyline.
PALPATE_EXPORT palpate_status palpate_follow_path(const palpate_queries* queries,
                                                  const double* points, size_t point_count,
                                                  double radius, const palpate_id* bodies,
                                                  size_t body_count, palpate_path_interval* inside,
                                                  size_t inside_capacity, size_t* inside_count,
                                                  palpate_path_clearance* outside,
                                                  size_t outside_capacity, size_t* outside_count);
/// A list. settings may be null.
PALPATE_EXPORT palpate_status palpate_inside_vertices(const palpate_queries* queries,
                                                      palpate_id vertices, palpate_id body,
                                                      const palpate_inside_settings* settings,
                                                      palpate_inside_vertex* out, size_t capacity,
                                                      size_t* count);
/// A list.
PALPATE_EXPORT palpate_status palpate_embedded_vertices(const palpate_queries* queries,
                                                        palpate_id vertices, palpate_id body,
                                                        palpate_embedded_vertex* out,
                                                        size_t capacity, size_t* count);
PALPATE_EXPORT palpate_status palpate_find_tetrahedron(const palpate_queries* queries,
                                                       palpate_id body, const double point[3],
                                                       palpate_tetrahedron_point* at);

// Snapshots. <palpate/Snapshot.h>

PALPATE_EXPORT palpate_status palpate_publish(palpate_cd* cd, double time);
/// Safe on any thread while the palpate_cd exists. Null before the first palpate_publish(). Release
/// it with palpate_release_snapshot(), before or after the palpate_cd.
PALPATE_EXPORT palpate_status palpate_latest_snapshot(const palpate_cd* cd,
                                                      palpate_snapshot** snapshot);
PALPATE_EXPORT void palpate_release_snapshot(palpate_snapshot* snapshot);  ///< null: does nothing

PALPATE_EXPORT palpate_status palpate_snapshot_queries(const palpate_snapshot* snapshot,
                                                       palpate_queries** queries);
PALPATE_EXPORT palpate_status palpate_snapshot_time(const palpate_snapshot* snapshot,
                                                    uint64_t* number, double* time);
PALPATE_EXPORT palpate_status palpate_snapshot_has(const palpate_snapshot* snapshot, palpate_id id,
                                                   uint8_t* has);
/// At both ends of the step.
PALPATE_EXPORT palpate_status palpate_snapshot_positions(const palpate_snapshot* snapshot,
                                                         palpate_id id, const double** before,
                                                         const double** now, size_t* count);
PALPATE_EXPORT palpate_status palpate_snapshot_motion(const palpate_snapshot* snapshot,
                                                      palpate_id id, palpate_motion* motion);
PALPATE_EXPORT palpate_status palpate_snapshot_tags(const palpate_snapshot* snapshot, palpate_id id,
                                                    const uint32_t** tags, size_t* count);
/// In the world; time 0 is the start of the step, 1 its end.
PALPATE_EXPORT palpate_status palpate_snapshot_position(const palpate_snapshot* snapshot,
                                                        palpate_id id, uint32_t vertex, double time,
                                                        double position[3]);

// Distance fields. <palpate/DistanceField.h>

/// Set error_bound and band of `settings` first. Release it with palpate_release_field(), also
/// while a palpate_cd uses it.
PALPATE_EXPORT palpate_status palpate_build_field(const double* positions, size_t vertex_count,
                                                  const uint32_t* triangles, size_t triangle_count,
                                                  const palpate_field_settings* settings,
                                                  palpate_field** field);
PALPATE_EXPORT palpate_status palpate_load_field(const char* path, palpate_field** field);
PALPATE_EXPORT palpate_status palpate_save_field(const palpate_field* field, const char* path);
PALPATE_EXPORT void palpate_release_field(palpate_field* field);  ///< null: does nothing

typedef struct palpate_field_info {
  size_t size;
  double error_bound, band;  ///< L
  size_t bytes, cells;
  uint8_t is_closed;
} palpate_field_info;
/// Set the size of `info` first.
PALPATE_EXPORT palpate_status palpate_get_field_info(const palpate_field* field,
                                                     palpate_field_info* info);
/// values: `count` distances, L.
PALPATE_EXPORT palpate_status palpate_field_values(const palpate_field* field, const double* points,
                                                   size_t count, double* values);
PALPATE_EXPORT palpate_status palpate_field_gradient(const palpate_field* field,
                                                     const double point[3], double gradient[3]);
PALPATE_EXPORT palpate_status palpate_field_sign_is_reliable(const palpate_field* field,
                                                             const double point[3],
                                                             uint8_t* reliable);

// Meshes. <palpate/Meshes.h>, <palpate/Types.h>

/// Joins vertices within `distance` (L). welded_positions and vertex_of have room for vertex_count,
/// welded_triangles for triangle_count. count: of positions after the call.
PALPATE_EXPORT palpate_status palpate_weld(const double* positions, size_t vertex_count,
                                           const uint32_t* triangles, size_t triangle_count,
                                           double distance, double* welded_positions,
                                           uint32_t* welded_triangles, uint32_t* vertex_of,
                                           size_t* count);

/// Numbers of edges and of pairs of triangles; MeshDefects lists them.
typedef struct palpate_mesh_defects {
  size_t size;
  size_t open, flipped, shared, overlapping;
  uint8_t unwelded, inside_out;
} palpate_mesh_defects;
/// Set the size of `defects` first.
PALPATE_EXPORT palpate_status palpate_find_mesh_defects(const double* positions,
                                                        size_t vertex_count,
                                                        const uint32_t* triangles,
                                                        size_t triangle_count,
                                                        palpate_mesh_defects* defects);

#ifdef __cplusplus
}
#endif
