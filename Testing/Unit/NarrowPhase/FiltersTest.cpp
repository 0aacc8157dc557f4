#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/TestGeometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <tuple>
#include <vector>

// Filters: groups, disabled elements, rest distance, predicates. Each is compared with a definition
// that is written here. SidednessTest.cpp has sides. Histories compare filters with brute force.

namespace palpate::testing {
namespace {

using Eigen::Vector3d;

/// A pair of meshes, or a mesh with itself, and its filters.
struct Case {
  Mesh a, b;
  bool self = false;
  Positions nowA, nowB;
  PairSettings pair;
  std::vector<std::uint32_t> disabledA{}, disabledB{};
  ContactPredicate predicate{};
};

struct Answer {
  Rows rows;
  Validity validity;
  std::vector<ElementPair> candidates;
};

Answer answer(const Settings& settings, const Case& c) {
  OctreeBasedCD detection(settings);
  const GeometryId a = addMesh(detection, c.a), b = c.self ? a : addMesh(detection, c.b);
  detection.addCollisionPair(a, b, c.pair);
  detection.setPositions(a, c.a.positions, c.nowA);
  detection.setDisabledElements(a, c.disabledA);
  if (!c.self) {
    detection.setPositions(b, c.b.positions, c.nowB);
    detection.setDisabledElements(b, c.disabledB);
  }
  detection.setContactPredicate(a, b, c.predicate);
  detection.detectCollision();
  const CollisionData& data = detection.collisionData(a, b);
  return {Rows(data), data.validity(), detection.candidatePairs(a, b)};
}

std::vector<PairSettings> everyMethod(double thickness) {
  std::vector<PairSettings> all;
  for (const MethodCase& method : methodCases(thickness)) all.push_back(method.settings);
  for (const double tolerance : {0.0, 0.02, 1.0}) {
    PairSettings automatic{Method::Auto, thickness, Contacts::Distinct};
    automatic.automatic.motionTolerance = tolerance;
    all.push_back(automatic);
  }
  return all;
}

Case sheetsInContact(Random& random, bool self) {
  Case c;
  c.a = sheet(7, 0.5, 0.0);
  c.b = sheet(6, 0.53, 1.5);
  if (self) {
    for (const auto& [i, j, k] : c.b.triangles) {
      const auto first = static_cast<std::uint32_t>(c.a.positions.size());
      c.a.triangles.push_back({first + i, first + j, first + k});
    }
    c.a.positions.insert(c.a.positions.end(), c.b.positions.begin(), c.b.positions.end());
  }
  c.self = self;
  c.nowA = moved(random, c.a.positions, 0.03);
  c.nowB = moved(random, c.b.positions, 0.03);
  return c;
}

// ---- Disabled elements ----

std::vector<std::uint32_t> some(Random& random, std::size_t size) {
  std::vector<std::uint32_t> ids;
  for (std::uint32_t i = 0; i < size; ++i)
    if (random() % 4 == 0) ids.push_back(i);
  return ids;
}

/// Removes the triangles. Returns the old ids of the others.
std::vector<std::uint32_t> takeOut(Mesh& mesh, const std::vector<std::uint32_t>& disabled) {
  std::vector<std::uint32_t> kept;
  std::vector<Triangle> triangles;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    if (!std::binary_search(disabled.begin(), disabled.end(), t)) {
      kept.push_back(t);
      triangles.push_back(mesh.triangles[t]);
    }
  mesh.triangles = triangles;
  return kept;
}

TEST(Filters, DisabledElementsCountAsRemoved) {
  Random random(1);
  std::size_t contacts = 0;
  for (const bool self : {false, true})
    for (const PairSettings& pair : everyMethod(0.04)) {
      Case c = sheetsInContact(random, self);
      c.pair = pair;
      c.disabledA = some(random, c.a.triangles.size());
      c.disabledB = some(random, c.b.triangles.size());
      const Answer found = answer(settingsOf(Engine::Octree), c);
      Case without = c;
      without.disabledA = without.disabledB = {};
      const auto keptA = takeOut(without.a, c.disabledA);
      const auto keptB = self ? keptA : takeOut(without.b, c.disabledB);
      Answer expected = answer(settingsOf(Engine::Octree), without);
      for (Row& row : expected.rows.vertexTriangle) row[1] = keptB[row[1]];
      for (Row& row : expected.rows.triangleVertex) row[0] = keptA[row[0]];
      for (auto* pairs : {&expected.rows.intersectingTriangles, &expected.candidates})
        for (ElementPair& p : *pairs) p = {keptA[p.a], keptB[p.b]};
      expectSameRows(found.rows, expected.rows);
      EXPECT_EQ(found.candidates, expected.candidates);
      EXPECT_EQ(found.validity.trusted, expected.validity.trusted);
      contacts += found.rows.contacts();
    }
  EXPECT_GT(contacts, 500u);
}

/// Two triangles at an edge. Tests have a point over the middle of it.
const Mesh kRoof{{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {4, 4, 0}}, {{0, 1, 2}, {1, 3, 2}}};

TEST(Filters, DisablingATrianglePassesItsFeaturesToNeighbours) {
  OctreeBasedCD detection(settingsOf(Engine::Octree));
  const GeometryId mesh = addMesh(detection, kRoof),
                   probe = detection.addPointSet(Positions{{2, 2, 0.25}});
  detection.addCollisionPair(probe, mesh, {Method::Proximity, 0.5});
  const auto triangles = [&] {
    detection.detectCollision();
    std::vector<std::uint32_t> ids;
    for (const auto& c : detection.collisionData(probe, mesh).vertexTriangle())
      ids.push_back(c.triangle);
    return ids;
  };
  using Ids = std::vector<std::uint32_t>;
  EXPECT_EQ(triangles(), Ids{0});
  detection.setDisabledElements(mesh, Ids{0});
  EXPECT_EQ(triangles(), Ids{1});
  EXPECT_EQ(detection.statistics().untestedVertices, 1u);
  detection.setDisabledElements(mesh, Ids{0, 1});
  EXPECT_EQ(triangles(), Ids{});
  detection.setDisabledElements(mesh, {});
  EXPECT_EQ(triangles(), Ids{0});
  detection.setDisabledElements(probe, Ids{0});
  EXPECT_EQ(triangles(), Ids{});
}

// ---- Predicates ----

/// About two thirds.
bool hashed(const ContactFeatures& f) {
  return (f.a[0] * 7 + f.a[1] * 3 + f.b[0] * 5 + f.b[1] * 11 + static_cast<unsigned>(f.kind)) % 3;
}

TEST(Filters, PredicateExcludesWhatItRefuses) {
  Random random(2);
  std::size_t left = 0, out = 0;
  for (const bool self : {false, true})
    for (const PairSettings& pair : everyMethod(0.04)) {
      Case c = sheetsInContact(random, self);
      c.pair = pair;
      const Answer all = answer(settingsOf(Engine::Octree), c);
      c.predicate = hashed;
      const Answer found = answer(settingsOf(Engine::Octree), c);
      EXPECT_TRUE(all.validity.trusted || !found.validity.trusted);
      EXPECT_EQ(found.rows.intersectingTriangles, all.rows.intersectingTriangles);
      EXPECT_GE(found.rows.earliestTimeOfImpact, all.rows.earliestTimeOfImpact);
      using Kind = ContactFeatures::Kind;
      const auto id = [](const Row& row, int i) { return static_cast<std::uint32_t>(row[i]); };
      const auto kept = [&](Kind kind) {
        return [=](const Row& r) {
          return kind == Kind::EdgeEdge
                     ? hashed({kind, {id(r, 0), id(r, 1)}, {id(r, 2), id(r, 3)}})
                     : hashed({kind, {id(r, 0), id(r, 0)}, {id(r, 1), id(r, 1)}});
        };
      };
      for (const auto& [list, kind] : {std::tuple(&Rows::vertexTriangle, Kind::VertexTriangle),
                                       std::tuple(&Rows::triangleVertex, Kind::TriangleVertex),
                                       std::tuple(&Rows::edgeEdge, Kind::EdgeEdge)}) {
        const auto& rows = found.rows.*list;
        EXPECT_TRUE(std::all_of(rows.begin(), rows.end(), kept(kind)));
        if (pair.contacts != Contacts::All || pair.method == Method::Auto) continue;
        std::vector<Row> expected;  // no contact suppresses another
        std::copy_if((all.rows.*list).begin(), (all.rows.*list).end(), std::back_inserter(expected),
                     kept(kind));
        EXPECT_EQ(firstDifference(rows, expected), "");
        left += rows.size();
        out += (all.rows.*list).size() - rows.size();
      }
    }
  EXPECT_GT(left, 200u);
  EXPECT_GT(out, 100u);
}

TEST(Filters, RefusedContactsSuppressNoOthers) {
  OctreeBasedCD detection(settingsOf(Engine::Octree));
  const GeometryId mesh = addMesh(detection, kRoof),
                   probe = detection.addPointSet(Positions{{2, 2, 0.25}});
  detection.addCollisionPair(mesh, probe, {Method::Proximity, 0.5});
  std::atomic<int> asked = 0;
  detection.setContactPredicate(mesh, probe, [&](const ContactFeatures& f) {
    ++asked;
    EXPECT_EQ(f.kind, ContactFeatures::Kind::TriangleVertex);
    return f.a[0] != 0;
  });
  detection.detectCollision();
  ASSERT_EQ(detection.collisionData(mesh, probe).triangleVertex().size(), 1u);
  EXPECT_EQ(detection.collisionData(mesh, probe).triangleVertex()[0].triangle, 1u);
  EXPECT_GT(asked, 0);
  asked = 0;
  detection.setPositions(probe, Positions{{2, 2, 0.75}});
  detection.detectCollision();
  EXPECT_EQ(asked, 0);  // only pairs within the thickness
  detection.setPositions(probe, Positions{{2, 2, 0.25}});
  detection.setContactPredicate(mesh, probe, {});
  detection.detectCollision();
  EXPECT_EQ(detection.collisionData(mesh, probe).triangleVertex()[0].triangle, 0u);
}

// ---- Rest distance ----

/// Along the edges, between all vertices.
std::vector<std::vector<double>> restDistances(const Mesh& mesh) {
  const std::size_t n = mesh.positions.size();
  std::vector<std::vector<double>> d(n, std::vector<double>(n, 1e300));
  for (std::size_t v = 0; v < n; ++v) d[v][v] = 0;
  for (const auto& [i, j, k] : mesh.triangles)
    for (const auto& [p, q] : {Segment{i, j}, Segment{j, k}, Segment{k, i}})
      d[p][q] = d[q][p] = (mesh.positions[p] - mesh.positions[q]).norm();
  for (std::size_t m = 0; m < n; ++m)
    for (std::size_t p = 0; p < n; ++p)
      for (std::size_t q = 0; q < n; ++q) d[p][q] = std::min(d[p][q], d[p][m] + d[m][q]);
  return d;
}

TEST(Filters, RestDistanceExcludesNeighboursAlongTheSurface) {
  Random random(3);
  std::size_t left = 0, out = 0;
  std::vector<PairSettings> pairs = everyMethod(0.15);
  pairs.push_back({.method = Method::Intersection, .restDistance = 0.01});
  for (const PairSettings& pair : pairs) {
    Case c = sheetsInContact(random, true);
    for (Vector3d& p : c.nowA) p[0] = 0.5 * p[0] + 0.2 * p[1] * p[1];  // crumpled
    if (pair.method == Method::Intersection) c.nowA = moved(random, c.nowA, 0.3);
    c.pair = pair;
    c.pair.restDistance = 0.0;
    const Answer all = answer(settingsOf(Engine::Octree), c);
    const double restDistance = c.pair.restDistance = pair.restDistance > 0 ? 0.01 : 0.31;
    const Answer found = answer(settingsOf(Engine::Octree), c);
    EXPECT_TRUE(all.validity.trusted || !found.validity.trusted);
    const auto d = restDistances(c.a);
    const auto isFar = [&](const std::vector<std::uint64_t>& p,
                           const std::vector<std::uint64_t>& q) {
      for (const std::uint64_t v : p)
        for (const std::uint64_t w : q)
          if (d[v][w] < restDistance) return false;
      return true;
    };
    const auto vertexIsFar = [&](const Row& r) { return isFar({r[0]}, {r[2], r[3], r[4]}); };
    const auto edgesAreFar = [&](const Row& r) { return isFar({r[0], r[1]}, {r[2], r[3]}); };
    const auto compare = [&](const auto& rows, const auto& unfiltered, const auto& keep) {
      EXPECT_TRUE(std::all_of(rows.begin(), rows.end(), keep));
      if (pair.contacts != Contacts::All || pair.method == Method::Auto) return;
      // Each contact of Intersection depends on all triangles that intersect.
      if (pair.method == Method::Intersection) return;
      std::vector<Row> expected;
      std::copy_if(unfiltered.begin(), unfiltered.end(), std::back_inserter(expected), keep);
      EXPECT_EQ(firstDifference(rows, expected), "");
      left += rows.size();
      out += unfiltered.size() - rows.size();
    };
    compare(found.rows.vertexTriangle, all.rows.vertexTriangle, vertexIsFar);
    compare(found.rows.edgeEdge, all.rows.edgeEdge, edgesAreFar);
    std::vector<ElementPair> expected;
    for (const ElementPair& p : all.rows.intersectingTriangles) {
      const auto &s = c.a.triangles[p.a], &t = c.a.triangles[p.b];
      if (isFar({s[0], s[1], s[2]}, {t[0], t[1], t[2]})) expected.push_back(p);
    }
    EXPECT_EQ(found.rows.intersectingTriangles, expected);
    if (pair.method == Method::Intersection) {
      EXPECT_TRUE(!expected.empty() && expected.size() < all.rows.intersectingTriangles.size());
    }
  }
  EXPECT_GT(left, 200u);
  EXPECT_GT(out, 200u);
}

// ---- Groups ----

TEST(Filters, GroupsAndMasksSelectThePairs) {
  Random random(4);
  const Case c = sheetsInContact(random, false);
  for (const PairSettings& pair : everyMethod(0.04)) {
    PairRun run(settingsOf(Engine::Octree), c.a, c.b, pair, false);
    OctreeBasedCD& detection = run.detection();
    const auto detect = [&] {
      run.step(c.a.positions, c.nowA, c.b.positions, c.nowB);
      return Rows(run.data());
    };
    const Rows all = detect();
    EXPECT_TRUE(all.anything());
    // First b's mask selects a, but not the other way round; then neither does; then both do.
    detection.setCollisionFilter(run.a(), {2, 1});
    detection.setCollisionFilter(run.b(), {4, 6});
    // Only a detection gives contacts, or takes them away.
    EXPECT_TRUE(detection.candidatePairs(run.a(), run.b()).empty());
    expectSameRows(Rows(run.data()), all);
    EXPECT_EQ(detect(), Rows());
    EXPECT_FALSE(run.data().validity().trusted);
    detection.setCollisionFilter(run.b(), {4, 0});
    EXPECT_EQ(detect(), Rows());
    EXPECT_TRUE(detection.candidatePairs(run.a(), run.b()).empty());
    detection.forEachCandidate(run.a(), run.b(),
                               [](std::span<const ElementPair>) { ADD_FAILURE(); });
    detection.setCollisionFilter(run.a(), {2, 4});
    detection.setCollisionFilter(run.b(), {4, 2});
    expectSameRows(detect(), all);
  }
}

// ---- Refused calls ----

TEST(Filters, BadInputThrowsErrorsThatNameIt) {
  const Mesh one{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
  OctreeBasedCD detection(settingsOf(Engine::Octree));
  const GeometryId mesh = addMesh(detection, one),
                   line = detection.addLineMesh(one.positions, std::vector<Segment>{{0, 1}});
  const std::vector<std::uint32_t> beyond{0, 1};
  expectRefused(ErrorCode::IndexOutOfRange,
                "geometry 0: element 1 is out of range; the geometry has 1",
                [&] { detection.setDisabledElements(mesh, beyond); });
  expectRefused(ErrorCode::InvalidSettings, "geometry 1 is a line mesh, which has no sides", [&] {
    detection.setCollisionFilter(line, {1, 1, Sidedness::Outer});
  });
  expectRefused(ErrorCode::InvalidSettings, "it must be Both or Outer", [&] {
    detection.setCollisionFilter(mesh, {1, 1, static_cast<Sidedness>(7)});
  });
  expectRefused(ErrorCode::UnknownGeometry, "geometry 9 was never added",
                [&] { detection.setCollisionFilter(GeometryId{9}, {}); });
  expectRefused(ErrorCode::UnknownPair, "was never added",
                [&] { detection.setContactPredicate(mesh, line, {}); });
  detection.addCollisionPair(mesh, line, {Method::Proximity, 0.1});
  detection.detectCollision();
  const std::uint64_t before = detection.collisionData(mesh, line).hash();
  EXPECT_GT(detection.statistics().contacts, 0u);
  expectRefused(ErrorCode::UnknownPair, "results are in that order",
                [&] { detection.setContactPredicate(line, mesh, {}); });
  PairSettings rest{Method::Proximity, 0.1};
  rest.restDistance = 1.0;
  expectRefused(ErrorCode::InvalidSettings, "for a triangle or line mesh with itself",
                [&] { detection.setPairSettings(mesh, line, rest); });
  detection.detectCollision();
  EXPECT_EQ(detection.collisionData(mesh, line).hash(), before);  // nothing changed
}

}  // namespace
}  // namespace palpate::testing
