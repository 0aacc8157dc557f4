// Golden FILE compares hashes of answers with those of FILE. Golden --write FILE stores them. The
// same input must give the same bits for any processor, compiler, optimization, SIMD path and
// number of threads.

#include "Core/SimdPath.h"

#include <palpate/ConstraintRows.h>
#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/RandomMeshes.h"
#include "Common/Solids.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <map>
#include <string>
#include <type_traits>

namespace palpate {
namespace {

using namespace testing;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Positions = std::vector<Vector3d>;

/// FNV-1a over values, so that padding does not count.
class Hash {
 public:
  template <class T>
  requires std::is_arithmetic_v<T> Hash& add(T value) {
    unsigned char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    for (const unsigned char byte : bytes) m_value = (m_value ^ byte) * 0x100000001b3u;
    return *this;
  }
  Hash& add(const Vector3d& v) { return add(v.x()).add(v.y()).add(v.z()); }
  Hash& add(const SurfacePoint& p) {
    for (const std::uint32_t v : p.vertices) add(v);
    return add(p.element).add(p.weights).add(p.position).add(p.distance);
  }
  Hash& add(const RayHit& h) {
    return add(h.element).add(h.weights).add(h.t).add(h.frontFace).add(h.crosses);
  }
  Hash& add(const CollisionData& data) { return add(data.hash()).add(data.errorBound()); }
  std::uint64_t value() const { return m_value; }

 private:
  std::uint64_t m_value = 0xcbf29ce484222325u;
};

using Hashes = std::map<std::string, std::uint64_t>;

// All positions come from additions, multiplications, divisions and square roots, which every
// processor rounds alike.

/// A cube of n by n quads a side, each vertex moved to a sphere with bumps.
Mesh ball(int n, const Vector3d& centre, double radius) {
  Mesh mesh;
  std::map<std::array<int, 3>, std::uint32_t> ids;
  const auto vertex = [&](const std::array<int, 3>& at) {
    const auto [entry, isNew] = ids.try_emplace(at, static_cast<std::uint32_t>(ids.size()));
    if (isNew) {
      const double x = 2.0 * at[0] / n - 1, y = 2.0 * at[1] / n - 1, z = 2.0 * at[2] / n - 1;
      const double bumps = 1 + 0.2 * x * y * z, length = std::sqrt((x * x + y * y) + z * z);
      const double scale = radius * bumps / length;
      mesh.positions.emplace_back(centre.x() + x * scale, centre.y() + y * scale,
                                  centre.z() + z * scale);
    }
    return entry->second;
  };
  for (int axis = 0; axis < 3; ++axis)
    for (const int side : {0, n})
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const auto corner = [&](int di, int dj) {
            std::array<int, 3> at{};
            at[axis] = side;
            at[(axis + 1) % 3] = i + di;
            at[(axis + 2) % 3] = j + dj;
            return vertex(at);
          };
          const std::uint32_t a = corner(0, 0), b = corner(1, 0), c = corner(1, 1),
                              d = corner(0, 1);
          if (side == 0) {
            mesh.triangles.insert(mesh.triangles.end(), {{a, c, b}, {a, d, c}});
          } else {
            mesh.triangles.insert(mesh.triangles.end(), {{a, b, c}, {a, c, d}});
          }
        }
  return mesh;
}

Positions moved(Random& random, Positions positions, double most) {
  for (Vector3d& p : positions) p += randomPoint(random, -most, most);
  return positions;
}

/// Turns by angles of Pythagorean triples.
Matrix3d rotation(bool other) {
  Matrix3d a, b;
  a << 0.6, -0.8, 0, 0.8, 0.6, 0, 0, 0, 1;
  b << 1, 0, 0, 0, 0.96, -0.28, 0, 0.28, 0.96;
  return other ? Matrix3d(a * b) : a;
}

PairSettings pairOf(Method method, double thickness, Contacts contacts = Contacts::Distinct) {
  PairSettings pair;
  pair.method = method;
  pair.thickness = method == Method::Intersection ? 0 : thickness;
  pair.contacts = contacts;
  return pair;
}

Settings withThreads(int threads, OctreeBounds bounds = OctreeBounds::Box) {
  Settings settings;
  settings.threads = threads;
  settings.octree.bounds = bounds;
  return settings;
}

void addRows(const CollisionData& data, std::size_t a, std::size_t b, const Positions& aBefore,
             const Positions& aNow, const Positions& bBefore, const Positions& bNow, Hash& hash) {
  std::vector<ConstraintRow> rows;
  appendRows(data, {0, aBefore, aNow}, {static_cast<std::uint32_t>(a), bBefore, bNow}, rows);
  for (const ConstraintRow& row : rows) {
    for (int i = 0; i < 4; ++i) hash.add(row.vertices[i]).add(row.weights[i]);
    hash.add(row.normal).add(row.offset);
  }
  hash.add(b);
}

/// Two meshes that move, against each other and themselves, by every method.
void meshes(int threads, Hashes& out) {
  Random random(1);
  Mesh a = ball(12, {0.5, 0.5, 0.5}, 0.35);
  const Mesh b = soup(random, 300, 0.06);
  const Positions aNow = moved(random, a.positions, 0.02), bNow = moved(random, b.positions, 0.03);
  for (const auto& [name, pair] : std::map<std::string, PairSettings>{
           {"auto", pairOf(Method::Auto, 0.01)},
           {"intersection", pairOf(Method::Intersection, 0)},
           {"proximity", pairOf(Method::Proximity, 0.02)},
           {"proximity-all", pairOf(Method::Proximity, 0.02, Contacts::All)},
           {"continuous", pairOf(Method::Continuous, 0)},
           {"continuous-thick", pairOf(Method::Continuous, 0.004)}})
    for (const OctreeBounds bounds : {OctreeBounds::Box, OctreeBounds::Dop14}) {
      OctreeBasedCD detection(withThreads(threads, bounds));
      const GeometryId first = detection.addTriangleMesh(a.positions, a.triangles),
                       second = detection.addTriangleMesh(b.positions, b.triangles);
      for (const GeometryId other : {first, second}) detection.addCollisionPair(first, other, pair);
      detection.setPositions(first, a.positions, aNow);
      detection.setPositions(second, b.positions, bNow);
      detection.detectCollision();
      Hash hash;
      for (const CollisionPair& each : detection.pairs())
        hash.add(detection.collisionData(each.a, each.b));
      addRows(detection.collisionData(first, second), aNow.size(), bNow.size(), a.positions, aNow,
              b.positions, bNow, hash);
      out["meshes " + name + (bounds == OctreeBounds::Box ? "" : " dop14")] = hash.value();
    }
}

/// Lines, points, tetrahedra and shapes against a placed body.
void types(int threads, Hashes& out) {
  Random random(2);
  const Mesh body = ball(14, {0, 0, 0}, 0.4);
  Positions line{{0.1, 0.1, 0.1}}, points;
  std::vector<Segment> segments;
  for (std::uint32_t i = 0; i < 60; ++i) {
    line.push_back((line.back() + randomPoint(random, -0.1, 0.1))
                       .cwiseMax(Vector3d::Zero())
                       .cwiseMin(Vector3d::Ones()));
    segments.push_back({i, i + 1});
  }
  for (int i = 0; i < 500; ++i) points.push_back(randomPoint(random, 0, 1));
  Random order(0);
  Solid solid = cells(3, order);
  // std::shuffle() gives another order with another standard library.
  for (Tetrahedron& each : solid.tetrahedra) std::sort(each.begin(), each.end());
  std::sort(solid.tetrahedra.begin(), solid.tetrahedra.end());
  for (Vector3d& p : solid.positions) p = 0.2 * p + Vector3d(0.6, 0.55, 0.5);
  const Vector3d half(0.2, 0.1, 0.15), tip(0.3, 0.2, 0.25);
  const std::vector<AnalyticalGeometry> shapes{Sphere{half, 0.3},
                                               Capsule{half, tip, 0.1},
                                               Plane{half, {0.6, 0, 0.8}},
                                               Box{tip, half},
                                               Cylinder{half, {0.4, 0.3, 0}, 0.2},
                                               ConvexHull{{points.begin(), points.begin() + 20}}};
  for (const Method method : {Method::Auto, Method::Proximity, Method::Continuous}) {
    OctreeBasedCD detection(withThreads(threads));
    std::vector<GeometryId> ids{detection.addTriangleMesh(body.positions, body.triangles),
                                detection.addLineMesh(line, segments, 0.02),
                                detection.addPointSet(points, 0.01),
                                detection.addTetrahedralMesh(solid.positions, solid.tetrahedra)};
    for (const AnalyticalGeometry& shape : shapes)
      ids.push_back(detection.addAnalyticalGeometry(shape));
    detection.setTransform(ids[0], {rotation(false), {0.45, 0.5, 0.5}},
                           {rotation(true), {0.5, 0.5, 0.55}});
    for (std::size_t i = 4; i < ids.size(); ++i)
      detection.setTransform(ids[i], {rotation(false), {0.2, 0.2, 0.2}},
                             {rotation(true), {0.25, 0.2, 0.2}});
    const PairSettings pair = pairOf(method, 0.01);
    for (std::size_t i = 0; i < ids.size(); ++i)
      for (std::size_t j = i + 1; j < ids.size(); ++j)
        detection.addCollisionPair(ids[i], ids[j], pair);
    detection.setPositions(ids[1], line, moved(random, line, 0.02));
    detection.setPositions(ids[2], points, moved(random, points, 0.02));
    detection.detectCollision();
    Hash hash;
    for (const CollisionPair& each : detection.pairs())
      hash.add(detection.collisionData(each.a, each.b));
    out["types " + std::to_string(static_cast<int>(method))] = hash.value();
  }
}

void queries(int threads, Hashes& out) {
  Random random(3);
  const Mesh body = ball(14, {0.5, 0.5, 0.5}, 0.4);
  OctreeBasedCD detection(withThreads(threads));
  const GeometryId id = detection.addTriangleMesh(body.positions, body.triangles);
  detection.update();
  const SpatialQueries queries = detection.queries();
  Hash points, rays;
  std::vector<SurfacePoint> nearest;
  std::vector<RayHit> hits;
  for (int i = 0; i < 200; ++i) {
    const Vector3d p = randomPoint(random, 0, 1), q = randomPoint(random, -1, 1);
    const SignedDistance distance = queries.signedDistance(id, p);
    points.add(*queries.closestPoint(id, p)).add(distance.nearest).add(distance.distance);
    points.add(queries.contains(id, p));
    queries.nearestElements(id, p, 5, nearest);
    for (const SurfacePoint& each : nearest) points.add(each);
    queries.allHits(id, {p, q}, hits);
    for (const RayHit& hit : hits) rays.add(hit);
  }
  out["queries points"] = points.value();
  out["queries rays"] = rays.value();
}

void fields(int threads, Hashes& out) {
  Random random(4);
  const Mesh body = ball(10, {0, 0, 0}, 0.4);
  DistanceFieldSettings settings;
  settings.errorBound = 0.005;
  settings.band = 0.1;
  settings.threads = threads;
  const auto field = std::make_shared<const DistanceField>(
      DistanceField::build({body.positions, body.triangles}, settings));
  Hash hash;
  Positions points;
  for (int i = 0; i < 2000; ++i) points.push_back(randomPoint(random, -0.5, 0.5));
  for (const Vector3d& p : points) hash.add(field->value(p)).add(field->gradient(p));
  out["field values"] = hash.add(field->cells()).value();

  const Mesh other = ball(12, {0.3, 0.3, 0.3}, 0.3);
  OctreeBasedCD detection(withThreads(threads));
  const GeometryId rigid = detection.addTriangleMesh(body.positions, body.triangles),
                   soft = detection.addTriangleMesh(other.positions, other.triangles),
                   particles = detection.addPointSet(points, 0.01);
  detection.attachDistanceField(rigid, field);
  detection.addCollisionPair(soft, rigid, pairOf(Method::DistanceField, 0.02));
  PairSettings proxy = pairOf(Method::Proxy, 0.02);
  proxy.allowedError = 0.004;
  detection.addCollisionPair(particles, rigid, proxy);
  detection.setTransform(rigid, {rotation(true), {0.05, 0, 0}});
  detection.detectCollision();
  out["field contacts"] = Hash().add(detection.collisionData(soft, rigid)).value();
  out["proxy contacts"] = Hash().add(detection.collisionData(particles, rigid)).value();
}

Hashes all(int threads) {
  Hashes out;
  meshes(threads, out);
  types(threads, out);
  queries(threads, out);
  fields(threads, out);
  return out;
}

Hashes read(const char* path) {
  Hashes out;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    const std::size_t space = line.rfind(' ');
    out[line.substr(0, space)] = std::stoull(line.substr(space + 1), nullptr, 16);
  }
  return out;
}

int write(const char* path) {
  std::ofstream file(path);
  for (const auto& [name, hash] : all(1)) file << name << ' ' << std::hex << hash << '\n';
  return file.flush() ? 0 : 1;
}

int compare(const char* path) {
  const Hashes expected = read(path);
  if (expected.empty()) return std::fprintf(stderr, "Golden: %s has no hashes\n", path), 1;
  int failures = 0;
  for (const std::string& simd : simdPaths())
    for (const int threads : {1, 3}) {
      useSimdPath(simd);
      Hashes found = all(threads);
      for (const auto& [name, hash] : expected)
        if (!found.contains(name) || found[name] != hash) {
          ++failures;
          std::printf("Golden: %s differs (%s, %d threads)\n", name.c_str(), simd.c_str(), threads);
        }
      if (found.size() != expected.size()) ++failures, std::printf("Golden: names differ\n");
      std::printf("Golden: %zu hashes compared (%s, %d threads)\n", found.size(), simd.c_str(),
                  threads);
    }
  if (failures != 0) std::printf("Golden: %d hashes differ; see above\n", failures);
  return failures == 0 ? 0 : 1;
}

}  // namespace
}  // namespace palpate

int main(int count, char** arguments) {
  if (count == 3 && std::strcmp(arguments[1], "--write") == 0) return palpate::write(arguments[2]);
  if (count == 2) return palpate::compare(arguments[1]);
  std::fprintf(stderr, "usage: Golden [--write] FILE\n");
  return 1;
}
