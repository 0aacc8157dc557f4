#pragma once

#include "Common/Solids.h"
#include "Common/TestGeometry.h"
#include "Unit/Math/RationalOracle.h"

#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

/// What the tests of queries share: one geometry in both engines, and what queries answer in
/// rational arithmetic.
namespace palpate::testing {

using Eigen::Matrix3d;
using oracle::Rational;

inline GeometryId addTo(OctreeBasedCD& collisions, const TestGeometry& geometry) {
  return geometry.addTo(collisions);
}
inline GeometryId addTo(OctreeBasedCD& collisions, const Mesh& mesh) {
  return collisions.addTriangleMesh(mesh.positions, mesh.triangles);
}
inline GeometryId addTo(OctreeBasedCD& collisions, const Solid& solid) {
  return collisions.addTetrahedralMesh(solid.positions, solid.tetrahedra);
}
inline GeometryId addTo(OctreeBasedCD& collisions, const Positions& points) {
  return collisions.addPointSet(points);
}
inline GeometryId addTo(OctreeBasedCD& collisions, const AnalyticalGeometry& shape) {
  return collisions.addAnalyticalGeometry(shape);
}
inline GeometryId addTo(OctreeBasedCD& collisions,
                        const std::function<GeometryId(OctreeBasedCD&)>& add) {
  return add(collisions);
}

/// The same geometries searched by octrees, and by brute force.
struct Both {
  using Add = std::function<GeometryId(OctreeBasedCD&)>;

  Both() = default;
  template <class First>
  explicit Both(const First& first) : id(add(first)) {}
  template <class Geometry>
  GeometryId add(const Geometry& geometry) {
    addTo(bruteForce, geometry);
    return addTo(octree, geometry);
  }
  template <class F>
  void change(F&& f) {
    for (OctreeBasedCD* each : {&octree, &bruteForce}) f(*each);
  }

  OctreeBasedCD octree{settingsOf(Engine::Octree)}, bruteForce{settingsOf(Engine::BruteForce)};
  GeometryId id{};  ///< of the first geometry
};

inline bool isSame(const SurfacePoint& a, const SurfacePoint& b) {
  return a.geometry == b.geometry && a.element == b.element && a.vertices == b.vertices &&
         a.weights == b.weights && a.position == b.position && a.distance == b.distance;
}
inline bool isSame(const GeometryDistance& a, const GeometryDistance& b) {
  return isSame(a.a, b.a) && isSame(a.b, b.b) && a.distance == b.distance;
}
inline bool isSame(const SignedDistance& a, const SignedDistance& b) {
  return isSame(a.nearest, b.nearest) && a.distance == b.distance;
}
inline bool isSame(const RayHit& a, const RayHit& b) {
  return a.geometry == b.geometry && a.element == b.element && a.vertices == b.vertices &&
         a.weights == b.weights && a.t == b.t && a.frontFace == b.frontFace &&
         a.crosses == b.crosses;
}
inline bool isSame(const Pick& a, const Pick& b) {
  return isSame(a.hit, b.hit) && a.vertex == b.vertex && a.edge == b.edge;
}
template <class T>
bool isSame(const std::optional<T>& a, const std::optional<T>& b) {
  return a.has_value() == b.has_value() && (!a || isSame(*a, *b));
}
template <class T>
bool isSame(const std::vector<T>& a, const std::vector<T>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const T& one, const T& two) { return isSame(one, two); });
}

/// Expects that all queries of one ray agree with each other and with brute force. Returns all
/// hits.
inline std::vector<RayHit> consistentHits(const Both& both, const Ray& ray) {
  const SpatialQueries fast = both.octree.queries(), truth = both.bruteForce.queries();
  std::vector<RayHit> hits, expected;
  fast.allHits(both.id, ray, hits);
  truth.allHits(both.id, ray, expected);
  EXPECT_TRUE(isSame(hits, expected));
  std::optional<RayHit> first;
  if (!hits.empty()) first = hits[0];
  EXPECT_TRUE(isSame(fast.firstHit(both.id, ray), first));
  EXPECT_TRUE(isSame(truth.firstHit(both.id, ray), first));
  EXPECT_TRUE(isSame(fast.firstHit(ray), first));  // of all geometries
  EXPECT_EQ(fast.anyHit(both.id, ray), !hits.empty());
  EXPECT_EQ(truth.anyHit(both.id, ray), !hits.empty());
  for (std::size_t i = 1; i < hits.size(); ++i) EXPECT_LE(hits[i - 1].t, hits[i].t);
  return hits;
}

/// The vertices of one geometry that are inside another one.
template <class Vertices, class Body>
std::vector<InsideVertex> insideOf(const Vertices& vertices, const Body& body,
                                   const InsideSettings& inside = {},
                                   const Settings& settings = settingsOf(Engine::Octree)) {
  OctreeBasedCD collisions(settings);
  const GeometryId id = addTo(collisions, vertices), around = addTo(collisions, body);
  std::vector<InsideVertex> found;
  collisions.queries().findInsideVertices(id, around, found, inside);
  return found;
}

/// The points of [-1, n + 1]³ whose coordinates are multiples of the step, as a geometry of a type.
inline TestGeometry lattice(GeometryType type, int n, double step) {
  TestGeometry all;
  all.type = type;
  const int count = static_cast<int>((n + 2) / step) + 1;
  for (int x = 0; x < count; ++x)
    for (int y = 0; y < count; ++y)
      for (int z = 0; z < count; ++z)
        all.positions.push_back(step * Vector3d(x, y, z) - Vector3d(1, 1, 1));
  for (std::uint32_t v = 0; v + 2 < all.positions.size(); ++v) {
    if (type == GeometryType::Triangles) all.triangles.push_back({v, v + 1, v + 2});
    if (type == GeometryType::Lines) all.segments.push_back({v, v + 1});
  }
  return all;
}

/// Positions of a placed body in the world, rounded as the library documents it.
inline Positions placed(const Positions& body, const Matrix3d& r, const Vector3d& t) {
  Positions world;
  for (const Vector3d& p : body)
    world.push_back((r.col(0) * p[0] + r.col(1) * p[1]) + r.col(2) * p[2] + t);
  return world;
}

inline Vector3d onLattice(Random& random, unsigned size) {
  const auto coordinate = [&] { return static_cast<double>(random() % size); };
  const double x = coordinate(), y = coordinate(), z = coordinate();
  return {x, y, z};
}

/// Triangles with small integer coordinates: many are equally far, coplanar, or without area.
inline TestGeometry latticeSoup(Random& random, std::uint32_t triangles, unsigned size) {
  TestGeometry soup;
  for (std::uint32_t i = 0; i < 3 * triangles; ++i)
    soup.positions.push_back(onLattice(random, size));
  for (std::uint32_t t = 0; t < triangles; ++t)
    soup.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  return soup;
}

/// Triangles in general position, on a lattice, without area, far away and twice; lines and points.
inline std::vector<TestGeometry> hardGeometries(Random& random) {
  std::vector<TestGeometry> all{testGeometry(sphere(8, 10, {0.5, 0.5, 0.5}, 0.4)),
                                testGeometry(soup(random, 100, 0.2)),
                                latticeSoup(random, 60, 4),
                                testGeometry(sheet(8, 0.5, 0.0)),
                                thread(random, 80, 0.1, 0.0, true),
                                particles(random, 60, 0.0)};
  all.push_back(all[0]);
  for (Vector3d& p : all.back().positions) p += Vector3d(1e3, -2e3, 5e2);
  all.push_back(all[1]);
  for (std::size_t i = 0; i < 300; i += 9) {
    Positions& p = all.back().positions;
    p[i + 2] = i % 2 ? p[i] : Vector3d(2 * p[i + 1] - p[i]);
  }
  all.push_back(all[0]);
  all.back().triangles.insert(all.back().triangles.end(), all[0].triangles.begin(),
                              all[0].triangles.end());
  return all;
}

/// Rays through vertices, middles of edges, along edges, in planes of triangles, parallel to axes,
/// from far away, and others.
inline Ray hardRay(Random& random, const Positions& positions, std::span<const Triangle> elements) {
  const auto corner = [&] { return positions[elements[random() % elements.size()][random() % 3]]; };
  const Triangle& t = elements[random() % elements.size()];
  const Vector3d p = positions[t[0]], q = positions[t[1]], r = positions[t[2]];
  Ray ray{p + randomPoint(random, -2, 2), randomPoint(random, -1, 1)};
  switch (random() % 8) {
    case 0:
      ray.direction = corner() - ray.origin;
      break;
    case 1:
      ray.direction = 0.5 * (p + q) - ray.origin;
      break;
    case 2:  // along an edge
      ray = {p - 2 * (q - p), q - p};
      break;
    case 3:  // in the plane of a triangle
      ray = {p + (p - q) + 0.5 * (p - r), (q - p) + 0.5 * (r - q)};
      break;
    case 4:  // from one vertex to another
      ray.origin = corner();
      ray.direction = corner() - ray.origin;
      break;
    case 5:
      ray.direction = Vector3d::Unit(static_cast<Eigen::Index>(random() % 3));
      ray.origin = 0.5 * corner();
      ray.origin += 0.5 * corner();
      break;
    case 6:
      ray.origin += 500 * randomPoint(random, -1, 1);
      ray.direction = corner() - ray.origin;
      break;
    default:
      break;
  }
  if (ray.direction == Vector3d::Zero()) ray.direction = {1, 0, 0};
  return ray;
}

/// Points on vertices, edges and faces, near them, around the geometry and far away.
inline Positions hardPoints(Random& random, const Positions& positions,
                            std::span<const Triangle> elements, int count) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : positions) box.extend(p);
  const double size = box.sizes().maxCoeff();
  Positions points;
  for (int i = 0; i < count; ++i) {
    const Triangle& t = elements[random() % elements.size()];
    const Vector3d a = positions[t[0]], b = positions[t[1]], c = positions[t[2]],
                   aside = size * randomPoint(random, -1, 1);
    const Vector3d all[] = {a,
                            0.5 * (a + b),
                            0.25 * a + 0.25 * b + 0.5 * c,
                            0.3 * a + 0.5 * b + 0.2 * c + 1e-3 * aside,
                            a + 0.025 * aside,
                            box.center() + 0.6 * aside,
                            box.center() + aside,
                            box.center() + 1e6 * aside};
    points.push_back(all[i % 8]);
  }
  return points;
}

/// The squared distance of a point from an element.
inline Rational squaredDistance(const Vector3d& p, const Positions& positions, const Triangle& t) {
  return oracle::vertexTriangle(p, positions[t[0]], positions[t[1]], positions[t[2]]).square;
}

inline oracle::Vector pointOf(const Ray& ray, const Rational& t) {
  using namespace oracle;
  return toRational(ray.origin) + t * toRational(ray.direction);
}

/// The direction's product with the winding normal.
inline Rational facingOf(const Ray& ray, const Positions& positions, const Triangle& t) {
  using namespace oracle;
  const oracle::Vector a = toRational(positions[t[0]]);
  return dot(toRational(ray.direction),
             cross(toRational(positions[t[1]]) - a, toRational(positions[t[2]]) - a));
}

/// Whether the ray's line certainly misses an element, by a ball around it.
inline bool certainlyMisses(const Ray& ray, const Positions& positions, const Triangle& t) {
  const Vector3d centre = positions[t[0]], from = centre - ray.origin;
  const double radius =
      std::max((positions[t[1]] - centre).stableNorm(), (positions[t[2]] - centre).stableNorm());
  const double apart = from.cross(ray.direction.stableNormalized()).stableNorm();
  return apart > radius + 1e-3 * (radius + from.stableNorm());  // NaN: it may not
}

/// A connected part of what a ray and a surface share.
struct RationalHit {
  Rational first, last;
  std::uint32_t element;  ///< the lowest of those that begin first
};

/// The parts by ascending parameter.
inline std::vector<RationalHit> hitsOf(const Ray& ray, const Positions& positions,
                                       std::span<const Triangle> elements) {
  const oracle::Vector origin = oracle::toRational(ray.origin),
                       direction = oracle::toRational(ray.direction);
  std::vector<RationalHit> ranges;
  for (std::uint32_t e = 0; e < elements.size(); ++e) {
    if (certainlyMisses(ray, positions, elements[e])) continue;
    std::array<oracle::Vector, 3> corners;
    for (std::size_t i = 0; i < 3; ++i) corners[i] = oracle::toRational(positions[elements[e][i]]);
    auto range = oracle::lineOn(origin, direction, corners);
    if (!range) continue;
    if (range->first < ray.tMin) range->first = ray.tMin;
    if (ray.tMax < kInfinity && range->last > ray.tMax) range->last = ray.tMax;
    if (range->first <= range->last) ranges.push_back({range->first, range->last, e});
  }
  std::stable_sort(ranges.begin(), ranges.end(),
                   [](const RationalHit& a, const RationalHit& b) { return a.first < b.first; });
  std::vector<RationalHit> parts;
  for (const RationalHit& range : ranges)
    if (parts.empty() || range.first > parts.back().last)
      parts.push_back(range);
    else if (range.last > parts.back().last)
      parts.back().last = range.last;
  return parts;
}

}  // namespace palpate::testing
