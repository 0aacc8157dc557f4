#pragma once

#include "Unit/Queries/QueryTruth.h"

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

/// Every query of one geometry.
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

}  // namespace palpate::testing
