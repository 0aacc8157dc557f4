#pragma once

#include "Unit/Queries/QueryTruth.h"

#include <cmath>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

/// Every query of one geometry, and a scene of geometries of all types.
namespace palpate::testing {

/// The last answer of each query. Vectors keep their memory from call to call.
struct QueryAnswers {
  std::optional<SurfacePoint> closest;
  std::optional<SignedDistance> signedDistance, signedByNumber;
  std::optional<RayHit> first, firstOfAll;
  std::optional<Pick> pick, pickOfFrontFaces;
  bool contained = false, containedByNumber = false, any = false;
  std::vector<SurfacePoint> nearest = std::vector<SurfacePoint>(2),
                            closestOfBatch = std::vector<SurfacePoint>(1);
  std::vector<SignedDistance> signedOfBatch = std::vector<SignedDistance>(1);
  std::vector<RayHit> hits = std::vector<RayHit>(2), firstOfBatch = std::vector<RayHit>(1);
  std::vector<std::uint32_t> within{7, 8}, overlapping{7, 8};
  std::vector<ShapeContact> contacts = std::vector<ShapeContact>(2);
  std::vector<InsideVertex> inside, insideByNumber;
  std::vector<EmbeddedVertex> embedded;
};

inline bool isSame(const QueryAnswers& a, const QueryAnswers& b) {
  return isSame(a.closest, b.closest) && isSame(a.signedDistance, b.signedDistance) &&
         isSame(a.signedByNumber, b.signedByNumber) && isSame(a.first, b.first) &&
         isSame(a.firstOfAll, b.firstOfAll) && isSame(a.pick, b.pick) &&
         isSame(a.pickOfFrontFaces, b.pickOfFrontFaces) && a.contained == b.contained &&
         a.containedByNumber == b.containedByNumber && a.any == b.any &&
         isSame(a.nearest, b.nearest) && isSame(a.closestOfBatch, b.closestOfBatch) &&
         isSame(a.signedOfBatch, b.signedOfBatch) && isSame(a.hits, b.hits) &&
         isSame(a.firstOfBatch, b.firstOfBatch) && a.within == b.within &&
         a.overlapping == b.overlapping && a.contacts == b.contacts && a.inside == b.inside &&
         a.insideByNumber == b.insideByNumber && a.embedded == b.embedded;
}

/// What a geometry must have. Each of these has what those before have.
enum class Needs { Nothing, Elements, Triangles, Inside };

struct QueryCall {
  std::string name;
  Needs needs;
  std::function<void(const SpatialQueries&, GeometryId, const Vector3d&, const Ray&, QueryAnswers&)>
      ask;
  bool isBatch = false;
};

inline std::vector<QueryCall> queryCalls() {
  using Q = const SpatialQueries&;
  using Id = GeometryId;
  using P = const Vector3d&;
  using R = const Ray&;
  using A = QueryAnswers&;
  static constexpr InsideSettings kByNumber{.rule = InsideRule::WindingNumber};
  using enum Needs;
  return {
      {"closestPoint", Nothing, [](Q q, Id id, P p, R, A a) { a.closest = q.closestPoint(id, p); }},
      {"closestPoints", Nothing,
       [](Q q, Id id, P p, R, A a) { q.closestPoints(id, std::span(&p, 1), a.closestOfBatch); },
       true},
      {"nearestElements", Elements,
       [](Q q, Id id, P p, R, A a) { q.nearestElements(id, p, 20, a.nearest); }},
      {"elementsWithin", Elements,
       [](Q q, Id id, P p, R, A a) { q.elementsWithin(id, p, 0.3, a.within); }},
      {"contains", Inside, [](Q q, Id id, P p, R, A a) { a.contained = q.contains(id, p); }},
      {"contains by number", Triangles,
       [](Q q, Id id, P p, R, A a) { a.containedByNumber = q.contains(id, p, kByNumber); }},
      {"signedDistance", Inside,
       [](Q q, Id id, P p, R, A a) { a.signedDistance = q.signedDistance(id, p); }},
      {"signedDistance by number", Triangles,
       [](Q q, Id id, P p, R, A a) { a.signedByNumber = q.signedDistance(id, p, kByNumber); }},
      {"signedDistances", Inside,
       [](Q q, Id id, P p, R, A a) { q.signedDistances(id, std::span(&p, 1), a.signedOfBatch); },
       true},
      {"firstHit", Nothing, [](Q q, Id id, P, R ray, A a) { a.first = q.firstHit(id, ray); }},
      {"anyHit", Nothing, [](Q q, Id id, P, R ray, A a) { a.any = q.anyHit(id, ray); }},
      {"firstHits", Nothing,
       [](Q q, Id id, P, R ray, A a) { q.firstHits(id, std::span(&ray, 1), a.firstOfBatch); },
       true},
      {"allHits", Nothing, [](Q q, Id id, P, R ray, A a) { q.allHits(id, ray, a.hits); }},
      {"overlapping", Elements,
       [](Q q, Id id, P p, R, A a) {
         q.overlapping(id, Capsule{p, {0.5, 0.5, 0.5}, 0.05}, Pose{}, a.overlapping);
       }},
      {"contacts", Elements, [](Q q, Id id, P p, R, A a) {
         q.contacts(id, Cylinder{p, {0.5, 0.5, 0.5}, 0.1}, Pose{}, 0.01, a.contacts);
       }}};
}

/// A ball, tetrahedra, a placed ball, an open sheet, lines, points and a shape.
struct QueryScene {
  explicit QueryScene(const Settings& settings = settingsOf(Engine::Octree), int probeCount = 10)
      : collisions(settings) {
    Random random(801);
    const Mesh ballMesh = sphere(12, 16, {0.5, 0.5, 0.5}, 0.4);
    rest = ballMesh.positions;
    triangles = ballMesh.triangles;
    Solid cube = cells(2, random);
    for (Vector3d& p : cube.positions) p *= 0.4;
    solidRest = cube.positions;
    for (int i = 0; i < probeCount; ++i) probes.push_back(randomPoint(random, 0, 1));
    for (const Vector3d& p : probes) rays.push_back({p, randomPoint(random, -1, 1)});
    ball = addTo(collisions, ballMesh);
    solid = addTo(collisions, cube);
    body = addTo(collisions, ballMesh);
    open = addTo(collisions, sheet(8, 0.5, 0));
    line = thread(random, 100, 0.1, 0.02, false).addTo(collisions);
    points = tapered(random, particles(random, 200, 0.0), 0.05).addTo(collisions);
    shape = collisions.addAnalyticalGeometry(Capsule{{0, 0, 0}, {0, 0, 0.3}, 0.1});
    removed = collisions.addPointSet(probes);
    collisions.removeGeometry(removed);
    collisions.addCollisionPair(ball, open, {Method::Continuous, 0.01});
    collisions.advance();
  }
  /// Deforms the ball and, in every third step, the tetrahedra; moves the placed ball and the
  /// shape; detects.
  void step(int i) {
    Positions moved = rest, solidNow = solidRest;
    for (Vector3d& p : moved) p += 0.05 * std::sin(0.3 * i + 4 * p.x()) * (p - rest[0]);
    collisions.setPositions(ball, moved);
    for (Vector3d& p : solidNow) p *= 1 + 0.01 * (i % 7);
    if (i % 3 == 0) collisions.setPositions(solid, solidNow);
    const Matrix3d turn = Eigen::AngleAxisd(0.1 * i, Vector3d(1, 2, 2) / 3).toRotationMatrix();
    collisions.setTransform(body, {turn, {0.1, 0.01 * i, 0}});
    collisions.setTransform(shape, {turn, {0.2, 0.3, 0.01 * i}});
    collisions.detectCollision();
  }
  /// Calls f for each query and each geometry that has what it needs.
  template <class F>
  void forEachCall(F&& f) const {
    for (const QueryCall& call : queryCalls())
      for (const GeometryId id : {ball, solid, body, open, line, points, shape}) {
        const Needs has = id == shape  ? Needs::Nothing
                          : id < open  ? Needs::Inside
                          : id == open ? Needs::Triangles
                                       : Needs::Elements;
        if (has >= call.needs) f(call, id);
      }
  }

  OctreeBasedCD collisions;
  GeometryId ball, solid, body, open, line, points, shape, removed;
  Positions rest, solidRest, probes;
  std::vector<Triangle> triangles;
  std::vector<Ray> rays;
};

/// The answers of every query about every geometry of a scene.
inline std::vector<QueryAnswers> ask(const QueryScene& scene, const SpatialQueries& queries) {
  std::vector<QueryAnswers> all;
  for (std::size_t i = 0; i < scene.probes.size(); ++i) {
    const Ray& ray = scene.rays[i];
    scene.forEachCall([&](const QueryCall& call, GeometryId id) {
      call.ask(queries, id, scene.probes[i], ray, all.emplace_back());
    });
    all.back().firstOfAll = queries.firstHit(ray);
    all.back().pick = queries.pick(ray);
    all.back().pickOfFrontFaces = queries.pick(ray, true);
  }
  QueryAnswers& last = all.emplace_back();
  last.closestOfBatch.resize(scene.probes.size());
  last.signedOfBatch.resize(scene.probes.size());
  last.firstOfBatch.resize(scene.rays.size());
  queries.closestPoints(scene.ball, scene.probes, last.closestOfBatch);
  queries.signedDistances(scene.solid, scene.probes, last.signedOfBatch);
  queries.firstHits(scene.ball, scene.rays, last.firstOfBatch);
  queries.findInsideVertices(scene.points, scene.ball, last.inside);
  queries.findInsideVertices(scene.points, scene.open, last.insideByNumber,
                             {.rule = InsideRule::WindingNumber});
  queries.findEmbeddedVertices(scene.points, scene.solid, last.embedded);
  EXPECT_GT(last.inside.size(), 10u);
  EXPECT_GT(last.embedded.size(), 10u);
  return all;
}

}  // namespace palpate::testing
