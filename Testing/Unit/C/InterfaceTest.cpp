#include "Common/TemporaryFolder.h"
#include "Common/WholeScene.h"
#include "Unit/C/Numbers.h"

#include <palpate/Capture.h>
#include <palpate/Meshes.h>
#include <palpate/Snapshot.h>
#include <palpate/ThreadTopology.h>
#include <palpate/palpate_c.h>

#include <gtest/gtest.h>

#include <chrono>
#include <cstring>
#include <limits>
#include <span>
#include <vector>

// The C interface gives the bits of the C++ interface, for geometries of every type.
namespace palpate::testing {
namespace {

#define EXPECT_OK(call) EXPECT_EQ(call, PALPATE_OK) << palpate_last_error()
#define ASSERT_OK(call) ASSERT_EQ(call, PALPATE_OK) << palpate_last_error()

const double* flat(const std::vector<Vector3d>& positions) { return positions[0].data(); }
template <std::size_t N>
const std::uint32_t* flat(const std::vector<std::array<std::uint32_t, N>>& elements) {
  return elements[0].data();
}

palpate_pose cPose(const Pose& pose) {
  palpate_pose result;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) result.rotation[i][j] = pose.rotation(i, j);
    result.translation[i] = pose.translation[i];
  }
  return result;
}

template <class A, class B>
void expectSame(std::span<const A> ofC, std::span<const B> ofCpp) {
  ASSERT_EQ(ofC.size(), ofCpp.size());
  EXPECT_EQ(numbersOfList(ofC), numbersOfList(ofCpp));
}

/// Calls list(items, capacity, count) first for the count, then for all items, and checks that one
/// too few is cut.
template <class T, class Call>
std::vector<T> listFrom(const Call& call) {
  std::size_t count = 0;
  EXPECT_OK(call(nullptr, 0, &count));
  std::vector<T> items(count);
  EXPECT_OK(call(items.data(), count, &count));
  EXPECT_EQ(count, items.size());
  if (count > 1) {
    std::vector<T> fewer(count);
    std::memset(static_cast<void*>(fewer.data()), 0x5a, count * sizeof(T));
    const T untouched = fewer.back();
    EXPECT_OK(call(fewer.data(), count - 1, &count));
    EXPECT_EQ(count, items.size());
    EXPECT_EQ(numbersOf(fewer.front()), numbersOf(items.front()));
    EXPECT_EQ(std::memcmp(&fewer.back(), &untouched, sizeof(T)), 0);
  }
  return items;
}

/// WholeScene by calls of C.
class CScene : public ::testing::Test {
 protected:
  CScene() : m_input(12), m_whole(m_input, {.threads = 2}) {
    palpate_settings settings;
    EXPECT_OK(palpate_init_settings(&settings, sizeof settings));
    settings.threads = 2;
    EXPECT_OK(palpate_create(&settings, &m_cd));
    const auto addMesh = [&](const Mesh& mesh) {
      palpate_id id;
      EXPECT_OK(palpate_add_triangle_mesh(m_cd, flat(mesh.positions), mesh.positions.size(),
                                          flat(mesh.triangles), mesh.triangles.size(), &id));
      return id;
    };
    const auto addShape = [&](const palpate_shape& shape) {
      palpate_id id;
      EXPECT_OK(palpate_add_shape(m_cd, &shape, &id));
      return id;
    };
    organ = addMesh(m_input.organ);
    floor = addMesh(m_input.floor);
    bone = addMesh(m_input.bone);
    const TestGeometry &s = m_input.suture, &d = m_input.drops;
    EXPECT_OK(palpate_add_line_mesh(m_cd, flat(s.positions), s.positions.size(), flat(s.segments),
                                    s.segments.size(), s.radii.data(), s.radii.size(), &suture));
    EXPECT_OK(palpate_add_point_set(m_cd, flat(d.positions), d.positions.size(), d.radii.data(),
                                    d.radii.size(), &drops));
    EXPECT_OK(palpate_add_tetrahedral_mesh(
        m_cd, flat(m_input.block.positions), m_input.block.positions.size(),
        flat(m_input.block.tetrahedra), m_input.block.tetrahedra.size(), &block));
    tool = addShape(palpate_shape{.size = sizeof(palpate_shape),
                                  .kind = PALPATE_CAPSULE,
                                  .two_sided = 0,
                                  .p0 = {},
                                  .p1 = {0, 0, 1},
                                  .radius = 0.1,
                                  .points = nullptr,
                                  .point_count = 0});
    hull = addShape(palpate_shape{.size = sizeof(palpate_shape),
                                  .kind = PALPATE_HULL,
                                  .two_sided = 0,
                                  .p0 = {},
                                  .p1 = {},
                                  .radius = 0,
                                  .points = flat(m_input.block.positions),
                                  .point_count = m_input.block.positions.size()});
    palpate_field_settings field_settings;
    EXPECT_OK(palpate_init_field_settings(&field_settings, sizeof field_settings));
    field_settings.error_bound = 0.02;
    field_settings.band = 0.2;
    field_settings.threads = 1;
    EXPECT_OK(palpate_build_field(flat(m_input.bone.positions), m_input.bone.positions.size(),
                                  flat(m_input.bone.triangles), m_input.bone.triangles.size(),
                                  &field_settings, &m_field));
    EXPECT_OK(palpate_add_field(m_cd, m_field, &field));
    for (const CollisionPair& pair : m_whole.detection.pairs()) {
      palpate_pair_settings p;
      EXPECT_OK(palpate_init_pair_settings(&p, sizeof p));
      p.method = static_cast<int>(pair.settings.method);
      p.thickness = pair.settings.thickness;
      p.allowed_error = pair.settings.allowedError;
      p.rest_distance = pair.settings.restDistance;
      EXPECT_OK(palpate_add_pair(m_cd, static_cast<palpate_id>(pair.a),
                                 static_cast<palpate_id>(pair.b), &p));
    }
  }
  ~CScene() override {
    palpate_release_field(m_field);
    palpate_destroy(m_cd);
  }

  /// Both scenes take a step.
  void step(double time, double height) {
    m_whole.move(time, height);
    for (const palpate_id id : {organ, suture, drops, block}) {
      const auto now = m_whole.detection.positions(GeometryId{id});
      EXPECT_OK(palpate_set_positions(m_cd, id, now[0].data(), now.size()));
    }
    for (const palpate_id id : {tool, field, bone}) {
      const palpate_pose now = cPose(m_whole.detection.transform(GeometryId{id}));
      EXPECT_OK(palpate_set_transform(m_cd, id, &now));
    }
    m_whole.detection.detectCollision();
    EXPECT_OK(palpate_detect(m_cd));
  }
  void advance() {
    m_whole.detection.advance();
    EXPECT_OK(palpate_advance(m_cd));
  }
  const OctreeBasedCD& cpp() const { return m_whole.detection; }
  static palpate_id idOf(GeometryId id) { return static_cast<palpate_id>(id); }

  WholeSceneInput m_input;
  WholeScene m_whole;
  palpate_cd* m_cd = nullptr;
  palpate_field* m_field = nullptr;
  palpate_id organ, floor, bone, suture, drops, block, tool, hull, field;
};

TEST_F(CScene, ContactsValidityAndStatisticsAreThoseOfCpp) {
  std::size_t kinds[6] = {};
  for (const double height : {0.0, -0.1, -0.2}) {
    step(height * 9, height);
    for (const CollisionPair& pair : cpp().pairs()) {
      const palpate_id a = idOf(pair.a), b = idOf(pair.b);
      SCOPED_TRACE(std::to_string(a) + ", " + std::to_string(b));
      const CollisionData& expected = cpp().collisionData(pair.a, pair.b);
      palpate_contacts c{};
      c.size = sizeof c;
      ASSERT_EQ(palpate_get_contacts(m_cd, a, b, &c), PALPATE_OK) << palpate_last_error();
      expectSame(std::span(c.vertex_triangle, c.vertex_triangle_count), expected.vertexTriangle());
      expectSame(std::span(c.triangle_vertex, c.triangle_vertex_count), expected.triangleVertex());
      expectSame(std::span(c.edge_edge, c.edge_edge_count), expected.edgeEdge());
      expectSame(std::span(c.intersecting_triangles, c.intersecting_triangle_count),
                 expected.intersectingTriangles());
      expectSame(std::span(c.shape, c.shape_count), expected.shape());
      expectSame(std::span(c.shape_shape, c.shape_shape_count), expected.shapeShape());
      EXPECT_EQ(c.error_bound, expected.errorBound());
      kinds[0] += c.vertex_triangle_count, kinds[1] += c.triangle_vertex_count;
      kinds[2] += c.edge_edge_count, kinds[3] += c.intersecting_triangle_count;
      kinds[4] += c.shape_count, kinds[5] += c.shape_shape_count;

      const Validity& v = expected.validity();
      palpate_validity w{};
      w.size = sizeof w;
      EXPECT_OK(palpate_get_validity(m_cd, a, b, &w));
      const auto same = [](const palpate_indices& list, const std::vector<std::uint32_t>& of) {
        return std::vector<std::uint32_t>(list.data, list.data + list.count) == of;
      };
      EXPECT_EQ(
          listOf(w.trusted, w.started_apart, w.side_may_be_wrong, w.unwelded, w.method, w.reason,
                 w.at_end, w.at_impact, w.displacement, w.displacement_limit, w.arc_deviation,
                 w.effective_thickness, w.proxy_depth, w.age, w.advance_may_be_missing),
          listOf(v.trusted, v.startedApart, v.sideMayBeWrong, v.unwelded, v.method, v.reason,
                 v.atEnd, v.atImpact, v.displacement, v.displacementLimit, v.arcDeviation,
                 v.effectiveThickness, v.proxyDepth, v.age, v.advanceMayBeMissing));
      EXPECT_TRUE(same(w.untrusted_vertices_a, v.untrustedVerticesA) &&
                  same(w.untrusted_vertices_b, v.untrustedVerticesB) &&
                  same(w.degenerate_triangles_a, v.degenerateTrianglesA) &&
                  same(w.degenerate_triangles_b, v.degenerateTrianglesB) &&
                  same(w.outside_band, v.outsideBand) && same(w.near_threshold, v.nearThreshold) &&
                  same(w.unreliable_sign, v.unreliableSign));

      double earliest = 0;
      std::uint64_t hash = 0;
      EXPECT_OK(palpate_get_earliest_time(m_cd, a, b, &earliest));
      EXPECT_OK(palpate_get_hash(m_cd, a, b, &hash));
      EXPECT_EQ(earliest, expected.earliestTimeOfImpact());
      EXPECT_EQ(hash, expected.hash());

      palpate_pair_statistics p{};
      p.size = sizeof p;
      EXPECT_OK(palpate_get_pair_statistics(m_cd, a, b, &p));
      const PairStatistics q = cpp().pairStatistics(pair.a, pair.b);
      EXPECT_EQ(listOf(p.candidate_pairs, p.feature_pairs, p.exact_decisions, p.contacts),
                listOf(q.candidatePairs, q.featurePairs, q.exactDecisions, q.contacts));
    }
    palpate_statistics s{};
    s.size = sizeof s;
    EXPECT_OK(palpate_get_statistics(m_cd, &s));
    const FrameStatistics& t = cpp().statistics();
    EXPECT_EQ(listOf(s.geometries, s.triangles, s.segments, s.points, s.untested_vertices,
                     s.rebuilt_octrees, s.refitted_octrees, s.unchanged_octrees, s.candidate_pairs,
                     s.feature_pairs, s.contacts, s.intersecting_triangles, s.exact_decisions,
                     s.validity_pairs, s.memory.geometries, s.memory.results),
              listOf(t.geometries, t.triangles, t.segments, t.points, t.untestedVertices,
                     t.rebuiltOctrees, t.refittedOctrees, t.unchangedOctrees, t.candidatePairs,
                     t.featurePairs, t.contacts, t.intersectingTriangles, t.exactDecisions,
                     t.validityPairs, t.memory.geometries, t.memory.results));
    EXPECT_GT(s.memory.total, s.memory.octrees);
    EXPECT_GE(s.peak_memory.total, s.memory.total);
    EXPECT_GT(s.boxes_ms + s.octree_ms + s.pairs_ms + s.narrow_phase_ms + s.order_ms, 0);
    advance();
  }
  for (const std::size_t count : kinds) EXPECT_GT(count, 0u);
}

TEST_F(CScene, SavedStates) {
  step(0, 0);
  step(1, 0);
  std::size_t size = 0, again = 0;
  EXPECT_OK(palpate_save(m_cd, nullptr, 0, &size));
  std::vector<std::uint8_t> state(size), last(size);
  EXPECT_OK(palpate_save(m_cd, state.data(), size, &again));
  EXPECT_EQ(again, size);
  step(2, 0);
  EXPECT_OK(palpate_restore(m_cd, state.data(), size));
  EXPECT_OK(palpate_save(m_cd, last.data(), size, &again));
  EXPECT_EQ(last, state);
  EXPECT_EQ(palpate_restore(m_cd, state.data(), size - 1), PALPATE_FILE);
  EXPECT_NE(std::string(palpate_last_error()).find("saved state, byte"), std::string::npos);
}

TEST_F(CScene, DetectionsWithABudget) {
  std::uint8_t complete = 7;
  step(0, 0);
  EXPECT_OK(palpate_cancel_detection(m_cd));  // nothing runs
  EXPECT_OK(palpate_detect_within(m_cd, std::numeric_limits<std::int64_t>::max(), &complete));
  EXPECT_EQ(complete, 1);
  const palpate_unfinished_pair* pairs = nullptr;
  std::size_t count = 1;
  EXPECT_OK(palpate_get_unfinished_pairs(m_cd, &pairs, &count));
  EXPECT_EQ(count, 0u);
  advance();
  step(1, -0.1);
  advance();  // other steps of all pairs, which step() has detected
  EXPECT_OK(palpate_detect_within(m_cd, 0, &complete));
  EXPECT_FALSE(m_whole.detection.detectCollision(std::chrono::microseconds(0)));
  EXPECT_EQ(complete, 0);
  EXPECT_OK(palpate_get_unfinished_pairs(m_cd, &pairs, &count));
  expectSame<palpate_unfinished_pair, UnfinishedPair>({pairs, count},
                                                      cpp().statistics().unfinishedPairs);
  ASSERT_GT(count, 0u);
  palpate_validity validity{};
  validity.size = sizeof validity;
  EXPECT_OK(palpate_get_validity(m_cd, pairs[0].a, pairs[0].b, &validity));
  EXPECT_EQ(validity.reason, PALPATE_REASON_OUT_OF_TIME);
  EXPECT_EQ(validity.age, 1u);
  palpate_pair_settings settings{};
  settings.size = sizeof settings;
  EXPECT_OK(palpate_get_pair_settings(m_cd, pairs[0].a, pairs[0].b, &settings));
  settings.priority = -3;
  EXPECT_OK(palpate_set_pair_settings(m_cd, pairs[0].a, pairs[0].b, &settings));
  EXPECT_OK(palpate_get_pair_settings(m_cd, pairs[0].a, pairs[0].b, &settings));
  EXPECT_EQ(settings.priority, -3);
}

TEST_F(CScene, RowsAndMotionsAreThoseOfCpp) {
  step(0, 0);
  advance();
  step(1, -0.1);
  std::size_t rowCount = 0, motionCount = 0;
  const CollisionProblem problem = cpp().problem();
  const auto side = [&](palpate_id id, palpate_side& c, std::vector<Vector3d>& before) {
    EXPECT_OK(palpate_init_side(&c, sizeof c));
    ContactSide s;
    const auto now = cpp().positions(GeometryId{id});
    before.assign(now.begin(), now.end());
    for (const CollisionProblem::Geometry& geometry : problem.geometries)
      if (geometry.id == GeometryId{id} && !geometry.before.empty()) before = geometry.before;
    if (id == tool || id == hull || id == field || id == bone) {
      s.motion = {{}, cpp().transform(GeometryId{id})};
    } else {
      s.vertices = {id * 1000, before, now};
    }
    c.first = s.vertices.first;
    c.before = s.vertices.before.empty() ? nullptr : s.vertices.before[0].data();
    c.now = s.vertices.now.empty() ? nullptr : s.vertices.now[0].data();
    c.count = s.vertices.now.size();
    c.motion = {cPose(s.motion.before), cPose(s.motion.now)};
    return s;
  };
  for (const CollisionPair& pair : cpp().pairs()) {
    if (pair.a == pair.b) continue;
    const palpate_id a = idOf(pair.a), b = idOf(pair.b);
    std::vector<Vector3d> beforeA, beforeB;
    palpate_side cA, cB;
    const ContactSide sideA = side(a, cA, beforeA), sideB = side(b, cB, beforeB);
    const RigidMotion body = sideB.motion;
    std::vector<ConstraintRow> rows;
    appendRows(cpp().collisionData(pair.a, pair.b), sideA.vertices, sideB.vertices, rows, body);
    const auto cRows = listFrom<palpate_row>(
        [&](auto... list) { return palpate_get_rows(m_cd, a, b, &cA, &cB, &cB.motion, list...); });
    expectSame<palpate_row, ConstraintRow>(cRows, rows);
    rows.clear();
    cpp().collisionData(pair.a, pair.b).appendRows(rows, a * 1000, b * 1000);
    const auto stepRows = listFrom<palpate_row>([&](auto... list) {
      return palpate_get_step_rows(m_cd, a, b, a * 1000, b * 1000, list...);
    });
    expectSame<palpate_row, ConstraintRow>(stepRows, rows);
    EXPECT_EQ(stepRows.size(), cRows.size());
    std::vector<ContactMotion> motions;
    appendMotions(cpp().collisionData(pair.a, pair.b), sideA, sideB, motions);
    const auto cMotions = listFrom<palpate_contact_motion>(
        [&](auto... list) { return palpate_get_motions(m_cd, a, b, &cA, &cB, list...); });
    expectSame<palpate_contact_motion, ContactMotion>(cMotions, motions);
    rowCount += rows.size(), motionCount += motions.size();
  }
  EXPECT_GT(rowCount, 10u);
  EXPECT_GT(motionCount, 10u);

  const double normal[] = {0, 0.6, 0.8};
  double first[2][3], second[2][3];
  EXPECT_OK(palpate_get_tangents(normal, nullptr, first));
  const Tangents t = tangentsOf({0, 0.6, 0.8});
  EXPECT_EQ(numbersOf(first), numbersOf(t));
  const double turned[] = {0.6, 0, 0.8};
  EXPECT_OK(palpate_get_tangents(turned, first, second));
  EXPECT_EQ(numbersOf(second), numbersOf(tangentsOf({0.6, 0, 0.8}, t)));
}

TEST_F(CScene, ContactsOverTimeAreThoseOfCpp) {
  OctreeBasedCD& whole = m_whole.detection;
  std::vector<CollisionPair> tracked(whole.pairs().begin(), whole.pairs().end());
  for (CollisionPair& pair : tracked) {
    const palpate_id a = idOf(pair.a), b = idOf(pair.b);
    pair.settings.trackContacts = true;
    if (pair.b == GeometryId{floor} && pair.a == GeometryId{organ}) {
      pair.settings.method = Method::Continuous;
      pair.settings.reportCrossings = pair.settings.rememberSides = true;
      pair.settings.smoothNormals = true;
    }
    whole.setPairSettings(pair.a, pair.b, pair.settings);
    palpate_pair_settings p{};
    p.size = sizeof p;
    EXPECT_OK(palpate_get_pair_settings(m_cd, a, b, &p));
    EXPECT_FALSE(p.track_contacts || p.report_crossings || p.smooth_normals || p.remember_sides);
    p.track_contacts = 1;
    p.report_crossings = p.smooth_normals = p.remember_sides = pair.settings.reportCrossings;
    p.method = static_cast<int>(pair.settings.method);
    EXPECT_OK(palpate_set_pair_settings(m_cd, a, b, &p));
    EXPECT_OK(palpate_get_pair_settings(m_cd, a, b, &p));
    EXPECT_TRUE(p.track_contacts && p.report_crossings == pair.settings.reportCrossings);
    EXPECT_TRUE(p.smooth_normals == p.report_crossings && p.remember_sides == p.report_crossings);
  }
  std::size_t lasting[5] = {}, slides = 0, ends = 0, crossings = 0, kept = 0, normals = 0,
              sides = 0;
  for (int frame = 0; frame < 5; ++frame) {
    step(0.4 * frame, -0.05 * frame);
    for (const CollisionPair& pair : tracked) {
      const palpate_id a = idOf(pair.a), b = idOf(pair.b);
      SCOPED_TRACE(std::to_string(a) + ", " + std::to_string(b));
      const CollisionData& expected = whole.collisionData(pair.a, pair.b);
      const std::span<const TrackedContact> lists[] = {
          expected.trackedVertexTriangle(), expected.trackedTriangleVertex(),
          expected.trackedEdgeEdge(), expected.trackedShape(), expected.trackedShapeShape()};
      for (int kind = 0; kind < 5; ++kind) {
        const auto all = listFrom<palpate_tracked_contact>(
            [&](auto... list) { return palpate_get_tracked(m_cd, a, b, kind, list...); });
        expectSame<palpate_tracked_contact, TrackedContact>(all, lists[kind]);
        for (const palpate_tracked_contact& contact : all) {
          EXPECT_EQ(contact.key.kind, kind);
          lasting[kind] += contact.age > 0;
          slides += contact.has_predecessor;
          kept += contact.age > 0 && contact.user_data > 0;
        }
        for (std::size_t i = 0; i < all.size(); i += 3) {
          const std::uint64_t value = (std::uint64_t{1} << 63) + i;
          EXPECT_OK(palpate_set_user_data(m_cd, a, b, &all[i].key, value));
          whole.setUserData(pair.a, pair.b, lists[kind][i].key, value);
        }
      }
      const auto ended = listFrom<palpate_tracked_contact>(
          [&](auto... list) { return palpate_get_ended(m_cd, a, b, list...); });
      expectSame<palpate_tracked_contact, TrackedContact>(ended, expected.ended());
      const palpate_crossing* passed = nullptr;
      std::size_t passedCount = 0;
      EXPECT_OK(palpate_get_crossings(m_cd, a, b, &passed, &passedCount));
      expectSame(std::span(passed, passedCount), expected.crossings());
      ends += ended.size(), crossings += passedCount;
      const std::span<const Eigen::Vector3d> smooth[] = {
          expected.smoothVertexTriangle(), expected.smoothTriangleVertex(),
          expected.smoothEdgeEdge(), expected.smoothShape()};
      for (int kind = 0; kind < 4; ++kind) {
        const double* all = nullptr;
        std::size_t count = 0;
        EXPECT_OK(palpate_get_smooth_normals(m_cd, a, b, kind, &all, &count));
        ASSERT_EQ(count, smooth[kind].size());
        for (std::size_t i = 0; i < count; ++i)
          EXPECT_EQ(Eigen::Vector3d(all + 3 * i), smooth[kind][i]);
        normals += count;
      }
      EXPECT_OK(palpate_get_remembered_sides(m_cd, a, b, &passed, &passedCount));
      expectSame(std::span(passed, passedCount), expected.rememberedSides());
      sides += passedCount;
      if (!pair.settings.rememberSides) continue;
      // Half of the sides are forgotten.
      const auto half = expected.rememberedSides().first(passedCount / 2);
      const std::vector<Crossing> left(half.begin(), half.end());
      EXPECT_OK(palpate_set_remembered_sides(m_cd, a, b, passed, left.size()));
      whole.setRememberedSides(pair.a, pair.b, left);
    }
    advance();
  }
  for (const std::size_t count : lasting) EXPECT_GT(count, 0u);
  EXPECT_GT(slides, 0u);
  EXPECT_GT(ends, 0u);
  EXPECT_GT(crossings, 0u);
  EXPECT_GT(kept, 0u);
  EXPECT_GT(normals, 0u);
  EXPECT_GT(sides, 0u);
}

/// Queries of the scene and of its snapshot by C, against those of C++.
void expectSameQueries(const palpate_queries* c, const SpatialQueries& q, palpate_id organ,
                       palpate_id floor, palpate_id drops, palpate_id block, palpate_id hull,
                       palpate_id tool) {
  const GeometryId organId{organ}, blockId{block}, dropsId{drops};
  const std::vector<Vector3d> points{{0.5, 0.5, 0.3}, {0.5, 0.5, 2}, {0.1, 0.9, 0.2}};
  const double inf = std::numeric_limits<double>::infinity();

  std::vector<palpate_surface_point> near(points.size());
  std::vector<SurfacePoint> nearCpp(points.size());
  EXPECT_OK(palpate_closest_points(c, organ, flat(points), 3, 0.5, near.data()));
  q.closestPoints(organId, points, nearCpp, 0.5);
  expectSame<palpate_surface_point, SurfacePoint>(near, nearCpp);
  EXPECT_EQ(near[1].element, PALPATE_NO_ELEMENT);
  q.nearestElements(organId, points[0], 5, nearCpp);
  expectSame<palpate_surface_point, SurfacePoint>(
      listFrom<palpate_surface_point>([&](auto... list) {
        return palpate_nearest_elements(c, organ, points[0].data(), 5, inf, list...);
      }),
      nearCpp);

  std::uint8_t inside[3];
  EXPECT_OK(palpate_contains(c, organ, flat(points), 3, nullptr, inside));
  for (int i = 0; i < 3; ++i) EXPECT_EQ(inside[i], q.contains(organId, points[i]));
  EXPECT_EQ(inside[0], 1);
  palpate_inside_settings winding;
  EXPECT_OK(palpate_init_inside_settings(&winding, sizeof winding));
  winding.rule = PALPATE_INSIDE_WINDING_NUMBER;
  const InsideSettings windingCpp{.rule = InsideRule::WindingNumber};
  std::vector<palpate_signed_distance> distances(3);
  std::vector<SignedDistance> distancesCpp(3);
  EXPECT_OK(palpate_signed_distances(c, organ, flat(points), 3, &winding, distances.data()));
  q.signedDistances(organId, points, distancesCpp, windingCpp);
  expectSame<palpate_signed_distance, SignedDistance>(distances, distancesCpp);

  std::vector<std::uint32_t> within;
  q.elementsWithin(organId, points[0], 0.4, within);
  EXPECT_GT(within.size(), 1u);
  EXPECT_EQ(listFrom<std::uint32_t>([&](auto... list) {
              return palpate_elements_within(c, organ, points[0].data(), 0.4, list...);
            }),
            within);

  const std::vector<Ray> rays{{{0.5, 0.5, 5}, {0, 0, -1}}, {{5, 5, 5}, {1, 0, 0}, 0, 9}};
  std::vector<palpate_ray> cRays;
  for (const Ray& r : rays)
    cRays.push_back({{r.origin[0], r.origin[1], r.origin[2]},
                     {r.direction[0], r.direction[1], r.direction[2]},
                     r.tMin,
                     r.tMax});
  std::vector<palpate_hit> hits(2);
  std::vector<RayHit> hitsCpp(2);
  EXPECT_OK(palpate_first_hits(c, organ, cRays.data(), 2, hits.data()));
  q.firstHits(organId, rays, hitsCpp);
  expectSame<palpate_hit, RayHit>(hits, hitsCpp);
  q.allHits(organId, rays[0], hitsCpp);
  EXPECT_GT(hitsCpp.size(), 1u);
  expectSame<palpate_hit, RayHit>(listFrom<palpate_hit>([&](auto... list) {
                                    return palpate_all_hits(c, organ, &cRays[0], list...);
                                  }),
                                  hitsCpp);
  palpate_pick pick;
  EXPECT_OK(palpate_first_hit(c, &cRays[0], &hits[0]));
  EXPECT_EQ(numbersOf(hits[0]), numbersOf(*q.firstHit(rays[0])));
  EXPECT_OK(palpate_pick_first(c, &cRays[0], 1, &pick));
  EXPECT_EQ(numbersOf(pick), numbersOf(*q.pick(rays[0], true)));
  EXPECT_OK(palpate_first_hit(c, &cRays[1], &hits[1]));
  EXPECT_EQ(hits[1].t, inf);
  EXPECT_OK(palpate_pick_first(c, &cRays[1], 0, &pick));
  EXPECT_EQ(pick.hit.t, inf);
  std::uint8_t any[2];
  for (int i = 0; i < 2; ++i) EXPECT_OK(palpate_any_hit(c, organ, &cRays[i], &any[i]));
  EXPECT_EQ(any[0], 1);
  EXPECT_EQ(any[1], 0);

  const palpate_shape box{sizeof box, PALPATE_BOX, 0, {0.5, 0.5, 0.3}, {0.1, 0.1, 0.6}, 0, {}, 0};
  const AnalyticalGeometry boxCpp = Box{{0.5, 0.5, 0.3}, {0.1, 0.1, 0.6}};
  const palpate_pose rest = cPose({});
  q.overlapping(organId, boxCpp, {}, within);
  EXPECT_EQ(listFrom<std::uint32_t>(
                [&](auto... list) { return palpate_overlapping(c, organ, &box, &rest, list...); }),
            within);
  std::vector<ShapeContact> contacts;
  q.contacts(organId, boxCpp, {}, 0.01, contacts);
  EXPECT_GT(contacts.size(), 1u);
  expectSame<palpate_shape_contact, ShapeContact>(
      listFrom<palpate_shape_contact>([&](auto... list) {
        return palpate_contacts_with_shape(c, organ, &box, &rest, 0.01, list...);
      }),
      contacts);

  palpate_distance distance;
  EXPECT_OK(palpate_get_distance(c, organ, floor, &distance));
  EXPECT_EQ(numbersOf(distance), numbersOf(q.distance(organId, GeometryId{floor})));
  palpate_penetration penetration;
  EXPECT_OK(palpate_get_penetration(c, hull, tool, &penetration));
  EXPECT_EQ(numbersOf(penetration), numbersOf(q.penetration(GeometryId{hull}, GeometryId{tool})));

  const std::vector<Vector3d> line{{0.5, 0.5, 2}, {0.5, 0.5, -2}};
  std::vector<PathInterval> through;
  std::vector<PathClearance> beside;
  q.path(line, 0.01, std::vector{organId, GeometryId{tool}}, through, beside);
  EXPECT_GT(through.size(), 0u);
  const palpate_id bodies[] = {organ, tool};
  std::vector<palpate_path_interval> cThrough(through.size());
  std::vector<palpate_path_clearance> cBeside(beside.size());
  std::size_t throughCount, besideCount;
  EXPECT_OK(palpate_follow_path(c, flat(line), 2, 0.01, bodies, 2, cThrough.data(), cThrough.size(),
                                &throughCount, cBeside.data(), cBeside.size(), &besideCount));
  EXPECT_EQ(throughCount, through.size());
  EXPECT_EQ(besideCount, beside.size());
  expectSame<palpate_path_interval, PathInterval>(cThrough, through);
  expectSame<palpate_path_clearance, PathClearance>(cBeside, beside);

  std::vector<InsideVertex> vertices;
  q.findInsideVertices(dropsId, organId, vertices);
  expectSame<palpate_inside_vertex, InsideVertex>(
      listFrom<palpate_inside_vertex>(
          [&](auto... list) { return palpate_inside_vertices(c, drops, organ, nullptr, list...); }),
      vertices);
  EXPECT_GT(vertices.size(), 1u);
  std::vector<EmbeddedVertex> embedded;
  q.findEmbeddedVertices(dropsId, blockId, embedded);
  expectSame<palpate_embedded_vertex, EmbeddedVertex>(
      listFrom<palpate_embedded_vertex>(
          [&](auto... list) { return palpate_embedded_vertices(c, drops, block, list...); }),
      embedded);
  EXPECT_GT(embedded.size(), 0u);
  palpate_tetrahedron_point at;
  const Vector3d centre(0.45, 0.44, 0.2);
  EXPECT_OK(palpate_find_tetrahedron(c, block, centre.data(), &at));
  if (const auto found = q.findTetrahedron(blockId, centre)) {
    EXPECT_EQ(numbersOf(at), numbersOf(*found));
  } else {
    EXPECT_EQ(at.tetrahedron, PALPATE_NO_ELEMENT);
  }
  EXPECT_OK(palpate_find_tetrahedron(c, block, points[1].data(), &at));
  EXPECT_EQ(at.tetrahedron, PALPATE_NO_ELEMENT);
}

TEST_F(CScene, QueriesAndSnapshotsAreThoseOfCpp) {
  palpate_snapshot* snapshot = nullptr;
  EXPECT_OK(palpate_latest_snapshot(m_cd, &snapshot));
  EXPECT_EQ(snapshot, nullptr);
  step(0, 0);
  advance();
  step(1, -0.1);
  palpate_queries* queries = nullptr;
  EXPECT_OK(palpate_create_queries(m_cd, &queries));
  expectSameQueries(queries, cpp().queries(), organ, floor, drops, block, hull, tool);
  EXPECT_OK(palpate_publish(m_cd, 0.25));
  m_whole.detection.publish(0.25);
  EXPECT_OK(palpate_latest_snapshot(m_cd, &snapshot));
  const auto expected = cpp().latestSnapshot();

  advance();
  step(2, -0.3);
  std::uint8_t inside;
  const double origin[3] = {};
  EXPECT_EQ(palpate_contains(queries, organ, origin, 1, nullptr, &inside), PALPATE_INVALID_CALL);
  palpate_destroy_queries(queries);

  EXPECT_OK(palpate_snapshot_queries(snapshot, &queries));
  expectSameQueries(queries, expected->queries(), organ, floor, drops, block, hull, tool);
  palpate_destroy_queries(queries);
  std::uint64_t number;
  double time;
  EXPECT_OK(palpate_snapshot_time(snapshot, &number, &time));
  EXPECT_EQ(number, expected->number());
  EXPECT_EQ(time, 0.25);
  std::uint8_t has;
  EXPECT_OK(palpate_snapshot_has(snapshot, 99, &has));
  EXPECT_EQ(has, 0);
  EXPECT_OK(palpate_snapshot_has(snapshot, organ, &has));
  EXPECT_EQ(has, 1);
  const double *before, *now;
  std::size_t count;
  EXPECT_OK(palpate_snapshot_positions(snapshot, organ, &before, &now, &count));
  ASSERT_EQ(count, m_input.organ.positions.size());
  for (std::size_t i = 0; i < count; ++i) {
    EXPECT_EQ(Vector3d(&before[3 * i]), expected->positionsBefore(GeometryId{organ})[i]);
    EXPECT_EQ(Vector3d(&now[3 * i]), expected->positions(GeometryId{organ})[i]);
  }
  palpate_motion motion;
  EXPECT_OK(palpate_snapshot_motion(snapshot, tool, &motion));
  const RigidMotion motionCpp = expected->motion(GeometryId{tool});
  const palpate_pose poses[] = {cPose(motionCpp.before), cPose(motionCpp.now)};
  EXPECT_EQ(std::memcmp(&motion.before, &poses[0], sizeof poses[0]), 0);
  EXPECT_EQ(std::memcmp(&motion.now, &poses[1], sizeof poses[1]), 0);
  double at[3];
  EXPECT_OK(palpate_snapshot_position(snapshot, organ, 5, 0.5, at));
  EXPECT_EQ(Vector3d(at), expected->position(GeometryId{organ}, 5, 0.5));
  palpate_release_snapshot(snapshot);
}

TEST_F(CScene, GeometriesAreSetAndReadAsByCpp) {
  OctreeBasedCD& other = m_whole.detection;
  const GeometryId organId{organ}, toolId{tool}, blockId{block};
  std::vector<Vector3d> moved = m_input.organ.positions, now = moved;
  for (Vector3d& p : now) p[0] += 0.25;
  EXPECT_OK(palpate_set_step(m_cd, organ, flat(moved), flat(now), moved.size()));
  EXPECT_OK(palpate_set_some_positions(m_cd, organ, 3, flat(moved), 2));
  other.setPositions(organId, moved, now);
  other.setPositions(organId, 3, std::span(moved).first(2));
  const RigidMotion motion{{Eigen::Matrix3d::Identity(), {1, 2, 3}},
                           {Eigen::AngleAxisd(0.3, Vector3d(1, 0, 0)).matrix(), {2, 2, 3}}};
  const palpate_motion cMotion{cPose(motion.before), cPose(motion.now)};
  EXPECT_OK(palpate_set_motion(m_cd, tool, &cMotion));
  other.setTransform(toolId, motion.before, motion.now);
  EXPECT_OK(palpate_set_tetrahedra(m_cd, block, flat(m_input.block.positions),
                                   m_input.block.positions.size(), flat(m_input.block.tetrahedra),
                                   m_input.block.tetrahedra.size() / 2));
  other.setTetrahedra(
      blockId, m_input.block.positions,
      std::span(m_input.block.tetrahedra).first(m_input.block.tetrahedra.size() / 2));
  EXPECT_OK(palpate_set_triangles(m_cd, floor, flat(m_input.floor.positions),
                                  m_input.floor.positions.size(), flat(m_input.floor.triangles),
                                  9));
  other.setTriangles(GeometryId{floor}, m_input.floor.positions,
                     std::span(m_input.floor.triangles).first(9));
  const std::uint32_t gone[] = {2, 5};
  const std::vector<Triangle> added{{0, 1, 3}};
  const auto newVertex = static_cast<std::uint32_t>(m_input.block.positions.size());
  const Tetrahedron& cut = m_input.block.tetrahedra[2];
  const std::vector<Tetrahedron> addedTetrahedra{{cut[0], cut[1], cut[2], newVertex}};
  const std::vector<Vector3d> newPositions{{9, 9, 9}}, rest{{8, 9, 9}};
  std::uint32_t ids[1];
  EXPECT_OK(
      palpate_replace_triangles(m_cd, floor, gone, 2, flat(added), 1, nullptr, nullptr, 0, ids));
  EXPECT_EQ(ids[0], other.replaceTriangles(GeometryId{floor}, gone, added, {})[0]);
  EXPECT_OK(palpate_replace_tetrahedra(m_cd, block, gone, 2, flat(addedTetrahedra), 1,
                                       flat(newPositions), flat(rest), 1, nullptr));
  other.replaceTetrahedra(blockId, gone, addedTetrahedra, newPositions, rest);
  std::vector<std::uint32_t> tags;
  for (std::uint32_t i = 0; i < 10; ++i) tags.push_back(i % 3);
  EXPECT_OK(palpate_set_tags(m_cd, floor, tags.data(), tags.size()));
  other.setTags(GeometryId{floor}, tags);
  for (const palpate_id whole : {tool, bone, organ}) {
    const std::vector<std::uint32_t> same(
        whole == tool ? 1 : (whole == bone ? m_input.bone : m_input.organ).triangles.size(), whole);
    EXPECT_OK(palpate_set_tags(m_cd, whole, same.data(), same.size()));
    other.setTags(GeometryId{whole}, same);
  }
  const std::uint32_t disabled[] = {0, 7, 8};
  EXPECT_OK(palpate_set_disabled_elements(m_cd, organ, disabled, 3));
  other.setDisabledElements(organId, disabled);
  palpate_filter filter;
  EXPECT_OK(palpate_init_filter(&filter, sizeof filter));
  filter.groups = 2;
  EXPECT_OK(palpate_set_filter(m_cd, drops, &filter));
  other.setCollisionFilter(GeometryId{drops}, {.groups = 2});
  filter.groups = 1;
  filter.mask = 1;
  filter.sidedness = PALPATE_SIDES_OUTER;
  EXPECT_OK(palpate_set_filter(m_cd, organ, &filter));
  other.setCollisionFilter(organId, {.mask = 1, .sidedness = Sidedness::Outer});
  EXPECT_OK(palpate_set_name(m_cd, organ, "liver"));
  const char* name = nullptr;
  EXPECT_OK(palpate_get_name(m_cd, organ, &name));
  EXPECT_STREQ(name, "liver");

  const double* positions;
  std::size_t count;
  EXPECT_OK(palpate_get_positions(m_cd, organ, &positions, &count));
  ASSERT_EQ(count, now.size());
  for (std::size_t i = 0; i < count; ++i)
    EXPECT_EQ(Vector3d(&positions[3 * i]), other.positions(organId)[i]);
  double lower[3], upper[3];
  EXPECT_OK(palpate_get_bounds(m_cd, organ, lower, upper));
  EXPECT_EQ(Vector3d(lower), other.bounds(organId).min());
  EXPECT_EQ(Vector3d(upper), other.bounds(organId).max());
  palpate_pose pose;
  EXPECT_OK(palpate_get_transform(m_cd, tool, &pose));
  const palpate_pose expected = cPose(other.transform(toolId));
  EXPECT_EQ(std::memcmp(&pose, &expected, sizeof pose), 0);
  const std::uint32_t *triangles, *tetrahedra;
  EXPECT_OK(palpate_get_surface(m_cd, block, &triangles, &tetrahedra, &count));
  const TetrahedralSurface surface = other.surface(blockId);
  ASSERT_EQ(count, surface.triangles.size());
  for (std::size_t i = 0; i < count; ++i) {
    EXPECT_EQ((Triangle{triangles[3 * i], triangles[3 * i + 1], triangles[3 * i + 2]}),
              surface.triangles[i]);
    EXPECT_EQ(tetrahedra[i], surface.tetrahedra[i]);
  }
  const auto expectIndices = [&](auto call, palpate_id id, std::span<const std::uint32_t> truth) {
    const std::uint32_t* found;
    EXPECT_OK(call(m_cd, id, &found, &count));
    EXPECT_FALSE(truth.empty());
    EXPECT_TRUE(std::ranges::equal(std::span(found, count), truth));
  };
  expectIndices(palpate_get_removed_elements, block, other.removedElements(blockId));
  expectIndices(palpate_get_tags, floor, tags);
  EXPECT_OK(palpate_publish(m_cd, 0));
  palpate_snapshot* snapshot = nullptr;
  EXPECT_OK(palpate_latest_snapshot(m_cd, &snapshot));
  const std::uint32_t* ofSnapshot;
  EXPECT_OK(palpate_snapshot_tags(snapshot, floor, &ofSnapshot, &count));
  EXPECT_TRUE(std::ranges::equal(std::span(ofSnapshot, count), tags));
  palpate_release_snapshot(snapshot);
  EXPECT_OK(palpate_detect(m_cd));
  other.detectCollision();
  std::size_t tagged = 0;
  for (const CollisionPair& pair : other.pairs())
    for (int kind = 0; kind < 5; ++kind) {
      const std::uint32_t* found;
      EXPECT_OK(palpate_get_contact_tags(m_cd, idOf(pair.a), idOf(pair.b), kind, &found, &count));
      const auto truth = other.collisionData(pair.a, pair.b).tags(static_cast<ContactKind>(kind));
      ASSERT_EQ(count, truth.size());
      for (std::size_t i = 0; i < count; ++i)
        EXPECT_EQ((ContactTags{found[2 * i], found[2 * i + 1]}), truth[i]);
      tagged += count;
    }
  EXPECT_GT(tagged, 0u);
  std::uint64_t hash = 0, one;
  for (const CollisionPair& pair : other.pairs()) {
    EXPECT_OK(palpate_get_hash(m_cd, idOf(pair.a), idOf(pair.b), &one));
    hash = hash * 31 + one;
  }
  EXPECT_EQ(hash, m_whole.hash());

  std::uint8_t has;
  EXPECT_OK(palpate_remove(m_cd, hull));
  EXPECT_OK(palpate_has(m_cd, hull, &has));
  EXPECT_EQ(has, 0);
  EXPECT_OK(palpate_update(m_cd));
  EXPECT_OK(palpate_release_memory(m_cd));
}

TEST_F(CScene, PairsPredicatesCandidatesAndFreeMotionAreThoseOfCpp) {
  OctreeBasedCD& other = m_whole.detection;
  const auto pairs =
      listFrom<palpate_pair>([&](auto... list) { return palpate_get_pairs(m_cd, list...); });
  ASSERT_EQ(pairs.size(), other.pairs().size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    EXPECT_EQ(pairs[i].a, idOf(other.pairs()[i].a));
    EXPECT_EQ(pairs[i].b, idOf(other.pairs()[i].b));
  }
  palpate_pair_settings settings;
  settings.size = sizeof settings;
  EXPECT_OK(palpate_get_pair_settings(m_cd, drops, bone, &settings));
  EXPECT_EQ(settings.method, PALPATE_METHOD_PROXY);
  EXPECT_EQ(settings.allowed_error, 0.02);
  EXPECT_OK(palpate_get_pair_settings(m_cd, organ, floor, &settings));
  settings.contacts = PALPATE_CONTACTS_ALL;
  settings.free_motion_reach = 0.3;
  settings.time_tolerance = 1e-3;
  settings.motion_tolerance = 0.001;
  EXPECT_OK(palpate_set_pair_settings(m_cd, organ, floor, &settings));
  PairSettings same{.method = Method::Auto, .thickness = 0.02, .contacts = Contacts::All};
  same.freeMotionReach = 0.3;
  same.continuous.timeTolerance = 1e-3;
  same.automatic.motionTolerance = 0.001;
  other.setPairSettings(GeometryId{organ}, GeometryId{floor}, same);

  int calls = 0;
  EXPECT_OK(palpate_set_predicate(
      m_cd, organ, floor,
      [](void* context, const palpate_features* f) {
        static_cast<void>(__atomic_add_fetch(static_cast<int*>(context), 1, __ATOMIC_RELAXED));
        return f->kind == PALPATE_EDGE_EDGE || f->a[0] % 2 == 0 ? 1 : 0;
      },
      &calls));
  other.setContactPredicate(GeometryId{organ}, GeometryId{floor}, [](const ContactFeatures& f) {
    return f.kind == ContactFeatures::Kind::EdgeEdge || f.a[0] % 2 == 0;
  });
  step(0, 0);
  advance();
  step(1, -0.2);
  EXPECT_GT(calls, 0);
  palpate_contacts contacts{};
  contacts.size = sizeof contacts;
  EXPECT_OK(palpate_get_contacts(m_cd, organ, floor, &contacts));
  const CollisionData& expected = other.collisionData(GeometryId{organ}, GeometryId{floor});
  EXPECT_GT(contacts.vertex_triangle_count, 0u);
  expectSame(std::span(contacts.vertex_triangle, contacts.vertex_triangle_count),
             expected.vertexTriangle());
  expectSame(std::span(contacts.edge_edge, contacts.edge_edge_count), expected.edgeEdge());
  const double* motions;
  std::size_t count;
  EXPECT_OK(palpate_get_free_motion(m_cd, organ, &motions, &count));
  const auto free = other.freeMotion(GeometryId{organ});
  EXPECT_EQ(std::vector<double>(motions, motions + count),
            std::vector<double>(free.begin(), free.end()));
  const auto candidates = listFrom<palpate_pair>(
      [&](auto... list) { return palpate_get_candidates(m_cd, organ, floor, list...); });
  const auto candidatesCpp = other.candidatePairs(GeometryId{organ}, GeometryId{floor});
  EXPECT_GT(candidates.size(), 0u);
  expectSame<palpate_pair, ElementPair>(candidates, candidatesCpp);
  EXPECT_OK(palpate_set_predicate(m_cd, organ, floor, nullptr, nullptr));
  EXPECT_OK(palpate_remove_pair(m_cd, floor, organ));
  EXPECT_EQ(palpate_get_contacts(m_cd, organ, floor, &contacts), PALPATE_UNKNOWN_PAIR);
}

TEST_F(CScene, FieldsAreThoseOfCpp) {
  const DistanceField& expected = *m_input.field;
  palpate_field_info info{};
  info.size = sizeof info;
  EXPECT_OK(palpate_get_field_info(m_field, &info));
  EXPECT_EQ(listOf(info.error_bound, info.band, info.bytes, info.cells, info.is_closed),
            listOf(expected.errorBound(), expected.band(), expected.bytes(), expected.cells(),
                   expected.isClosed()));
  const std::vector<Vector3d> points{{0.5, 0.5, 0.0}, {0.5, 0.5, 0.35}, {2, 2, 2}};
  double values[3], gradient[3];
  EXPECT_OK(palpate_field_values(m_field, flat(points), 3, values));
  for (int i = 0; i < 3; ++i) EXPECT_EQ(values[i], expected.value(points[i]));
  EXPECT_OK(palpate_field_gradient(m_field, flat(points) + 3, gradient));
  EXPECT_EQ(Vector3d(gradient), expected.gradient(points[1]));
  std::uint8_t reliable = 0;
  EXPECT_OK(palpate_field_sign_is_reliable(m_field, flat(points), &reliable));
  EXPECT_EQ(reliable, 1);

  const TemporaryFolder folder;
  const std::string path = (folder.path / "Bone.field").string();
  EXPECT_OK(palpate_save_field(m_field, path.c_str()));
  palpate_field* loaded = nullptr;
  EXPECT_OK(palpate_load_field(path.c_str(), &loaded));
  double again[3];
  EXPECT_OK(palpate_field_values(loaded, flat(points), 3, again));
  EXPECT_EQ(numbersOf(values), numbersOf(again));
  palpate_id mesh;
  EXPECT_OK(palpate_add_triangle_mesh(m_cd, flat(m_input.bone.positions),
                                      m_input.bone.positions.size(), flat(m_input.bone.triangles),
                                      m_input.bone.triangles.size(), &mesh));
  EXPECT_OK(palpate_attach_field(m_cd, mesh, loaded));
  palpate_release_field(loaded);
  const auto setPositions = [&] {
    return palpate_set_positions(m_cd, mesh, flat(m_input.bone.positions),
                                 m_input.bone.positions.size());
  };
  std::vector<Vector3d> moved = m_input.bone.positions;
  moved[0][0] += 1;
  EXPECT_EQ(palpate_set_positions(m_cd, mesh, flat(moved), moved.size()),
            PALPATE_UNSUPPORTED_METHOD);
  EXPECT_OK(palpate_attach_field(m_cd, mesh, nullptr));
  EXPECT_OK(setPositions());
  palpate_proxy_settings proxy;
  EXPECT_OK(palpate_init_proxy_settings(&proxy, sizeof proxy));
  proxy.reach = 0.1;
  proxy.error_bound = 0.02;
  EXPECT_OK(palpate_attach_proxy(m_cd, mesh, &proxy));
  EXPECT_EQ(palpate_set_positions(m_cd, mesh, flat(moved), moved.size()),
            PALPATE_UNSUPPORTED_METHOD);
  EXPECT_OK(palpate_attach_proxy(m_cd, mesh, nullptr));
  EXPECT_OK(palpate_set_positions(m_cd, mesh, flat(moved), moved.size()));

  palpate_field_settings settings;
  EXPECT_OK(palpate_init_field_settings(&settings, sizeof settings));
  settings.error_bound = 0.02;
  settings.band = 0.2;
  settings.context = &settings;
  settings.progress = [](void*, double) { return 0; };
  palpate_field* none = nullptr;
  EXPECT_EQ(palpate_build_field(flat(moved), moved.size(), flat(m_input.bone.triangles),
                                m_input.bone.triangles.size(), &settings, &none),
            PALPATE_CANCELLED);
  EXPECT_EQ(none, nullptr);

  EXPECT_OK(palpate_remove(m_cd, field));
  EXPECT_OK(palpate_capture(m_cd, (folder.path / "Frame.txt").string().c_str()));
  EXPECT_EQ(folder.fileCount(), 2u);
}

TEST(CTopology, CountsAndEventsAreThoseOfCpp) {
  constexpr double kHole[] = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0};
  constexpr std::uint32_t kSides[] = {0, 1, 1, 2, 2, 3, 3, 0}, kVertices[] = {0, 1, 2, 3};
  const auto threadAt = [](double x) { return std::array{x, 0.1, -1.0, x, 0.1, 1.0}; };
  palpate_cd* cd = nullptr;
  palpate_id hole, thread;
  ASSERT_OK(palpate_create(nullptr, &cd));
  ASSERT_OK(palpate_add_line_mesh(cd, kHole, 4, kSides, 4, nullptr, 0, &hole));
  ASSERT_OK(palpate_add_line_mesh(cd, threadAt(3).data(), 2, kSides, 1, nullptr, 0, &thread));
  palpate_topology* topology = nullptr;
  std::size_t loop, parts;
  ASSERT_OK(palpate_create_topology(cd, &topology));
  ASSERT_OK(palpate_watch_loop(topology, thread, kVertices, 2, hole, kVertices, 4, &loop));
  ASSERT_OK(palpate_watch_parts(topology, thread, kVertices, 2, hole, kVertices, 4, &parts));

  OctreeBasedCD ofCpp;
  const auto positionsOf = [](const auto& numbers) {
    std::vector<Vector3d> positions;
    for (std::size_t i = 0; i < std::size(numbers); i += 3)
      positions.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
    return positions;
  };
  const GeometryId holeId = ofCpp.addLineMesh(positionsOf(kHole),
                                              std::vector<Segment>{{0, 1}, {1, 2}, {2, 3}, {3, 0}}),
                   threadId =
                       ofCpp.addLineMesh(positionsOf(threadAt(3)), std::vector<Segment>{{0, 1}});
  ThreadTopology same(ofCpp);
  EXPECT_EQ(same.add({threadId, {0, 1}}, {holeId, {0, 1, 2, 3}}), loop);
  EXPECT_EQ(same.addParts({threadId, {0, 1}}, {holeId, {0, 1, 2, 3}}), parts);

  for (const double x : {0.0, -3.0, 0.5}) {
    ASSERT_OK(palpate_advance(cd));
    ASSERT_OK(palpate_set_positions(cd, thread, threadAt(x).data(), 2));
    ASSERT_OK(palpate_update_topology(topology));
    ofCpp.advance();
    ofCpp.setPositions(threadId, positionsOf(threadAt(x)));
    same.update();
    for (const std::size_t index : {loop, parts}) {
      int count;
      std::uint8_t isLost;
      ASSERT_OK(palpate_get_thread_count(topology, index, &count, &isLost));
      EXPECT_EQ(count, same.count(index));
      EXPECT_EQ(isLost, 0);
    }
  }
  const palpate_thread_event* events;
  std::size_t count;
  ASSERT_OK(palpate_get_thread_events(topology, &events, &count));
  ASSERT_EQ(count, same.events().size());
  EXPECT_GT(count, 3u);
  EXPECT_EQ(std::memcmp(events, same.events().data(), count * sizeof *events), 0);
  int none;
  EXPECT_EQ(palpate_get_thread_count(topology, 9, &none, nullptr), PALPATE_INDEX_OUT_OF_RANGE);
  std::vector<std::uint8_t> state(same.save().size());
  std::size_t size;
  ASSERT_OK(palpate_save_topology(topology, state.data(), state.size(), &size));
  EXPECT_EQ(size, state.size());
  EXPECT_TRUE(std::ranges::equal(std::as_bytes(std::span(state)), same.save()));
  ASSERT_OK(palpate_clear_thread_events(topology));
  ASSERT_OK(palpate_restore_topology(topology, state.data(), size));
  EXPECT_EQ(palpate_restore_topology(topology, state.data(), size - 1), PALPATE_FILE);
  ASSERT_OK(palpate_get_thread_events(topology, &events, &count));
  EXPECT_EQ(count, same.events().size());
  ASSERT_OK(palpate_clear_thread_events(topology));
  ASSERT_OK(palpate_get_thread_events(topology, &events, &count));
  EXPECT_EQ(count, 0u);
  ASSERT_OK(palpate_set_disabled_elements(cd, thread, kVertices, 1));
  ASSERT_OK(palpate_update_topology(topology));
  int counted;
  std::uint8_t isLost;
  ASSERT_OK(palpate_get_thread_count(topology, loop, &counted, &isLost));
  EXPECT_EQ(isLost, 1);
  ASSERT_OK(palpate_get_thread_events(topology, &events, &count));
  ASSERT_EQ(count, 2u);
  EXPECT_EQ(events[0].cause, PALPATE_DISABLED);
  palpate_destroy(cd);
  EXPECT_EQ(palpate_update_topology(topology), PALPATE_INVALID_CALL);
  palpate_destroy_topology(topology);
}

TEST(CMeshes, WeldedMeshesAndDefectsAreThoseOfCpp) {
  const std::vector<Vector3d> soup{{0, 0, 0}, {1, 0, 0}, {0, 1, 0},
                                   {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  const std::vector<Triangle> triangles{{0, 1, 2}, {3, 4, 5}};
  double positions[18];
  std::uint32_t joined[6], vertexOf[6];
  std::size_t count;
  EXPECT_OK(
      palpate_weld(flat(soup), 6, flat(triangles), 2, 0.0, positions, joined, vertexOf, &count));
  const Welded expected = weld(soup, triangles);
  ASSERT_EQ(count, expected.positions.size());
  EXPECT_EQ(count, 4u);
  for (std::size_t i = 0; i < count; ++i)
    EXPECT_EQ(Vector3d(&positions[3 * i]), expected.positions[i]);
  EXPECT_EQ(numbersOf(joined), numbersOfList(expected.triangles));
  EXPECT_EQ(numbersOf(vertexOf), numbersOfList(expected.vertexOf));
  palpate_mesh_defects defects{};
  defects.size = sizeof defects;
  EXPECT_OK(palpate_find_mesh_defects(flat(soup), 6, flat(triangles), 2, &defects));
  EXPECT_EQ(defects.unwelded, 1);
  EXPECT_EQ(defects.open, 6u);
  EXPECT_EQ(listOf(defects.flipped, defects.shared, defects.overlapping, defects.inside_out),
            listOf(0, 0, 0, 0));
}

TEST(CSettings, DefaultsAreThoseOfCpp) {
  palpate_settings s;
  EXPECT_OK(palpate_init_settings(&s, sizeof s));
  const Settings t;
  EXPECT_EQ(listOf(s.size, s.memory_limit, s.threads, s.engine, s.octree_update, s.octree_bounds,
                   s.max_depth, s.max_elements_per_leaf, s.keeps_pairs),
            listOf(sizeof s, t.memoryLimit, t.threads, t.engine, t.octree.update, t.octree.bounds,
                   t.octree.maxDepth, t.octree.maxElementsPerLeaf, t.octree.keepsPairs));
  palpate_pair_settings p;
  EXPECT_OK(palpate_init_pair_settings(&p, sizeof p));
  const PairSettings q;
  EXPECT_EQ(listOf(p.size, p.thickness, p.rest_distance, p.allowed_error, p.free_motion_reach,
                   p.time_tolerance, p.motion_tolerance, p.widest_normal_cone, p.method, p.contacts,
                   p.earliest_time_only),
            listOf(sizeof p, q.thickness, q.restDistance, q.allowedError, q.freeMotionReach,
                   q.continuous.timeTolerance, q.automatic.motionTolerance,
                   q.proxy.widestNormalCone, q.method, q.contacts, q.continuous.earliestTimeOnly));
  palpate_filter f;
  EXPECT_OK(palpate_init_filter(&f, sizeof f));
  const CollisionFilter g;
  EXPECT_EQ(listOf(f.groups, f.mask, f.sidedness), listOf(g.groups, g.mask, g.sidedness));
  palpate_field_settings d;
  EXPECT_OK(palpate_init_field_settings(&d, sizeof d));
  EXPECT_EQ(d.memory_limit, std::size_t{1} << 31);
  EXPECT_EQ(d.progress, nullptr);
}

}  // namespace
}  // namespace palpate::testing
