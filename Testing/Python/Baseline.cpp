// The loops of benchmark.py in C++, as a library that the script loads: both run in one process, in
// turns.
#include "Scenes.h"

#include <palpate/Palpate.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <vector>

using palpate::GeometryId;
using Positions = std::vector<Eigen::Vector3d>;

namespace {

struct Loop {
  palpate::scenes::Scene scene = palpate::scenes::organs();
  std::vector<std::vector<Positions>> frames;  ///< by frame, then by mesh
  palpate::OctreeBasedCD collisions;
  std::vector<GeometryId> ids;
  std::vector<palpate::SurfacePoint> closest;

  explicit Loop(int threads) : collisions(palpate::Settings{.threads = threads}) {
    frames.resize(static_cast<std::size_t>(scene.frames));
    for (std::size_t frame = 0; frame < frames.size(); ++frame) {
      frames[frame].resize(scene.meshes.size());
      for (std::size_t mesh = 0; mesh < scene.meshes.size(); ++mesh)
        scene.positions(static_cast<int>(frame), mesh, frames[frame][mesh]);
    }
    for (std::size_t mesh = 0; mesh < scene.meshes.size(); ++mesh)
      ids.push_back(collisions.addTriangleMesh(frames[0][mesh], scene.meshes[mesh].triangles));
    for (const auto& [a, b] : scene.pairs)
      collisions.addCollisionPair(
          ids[a], ids[b], {.method = palpate::Method::Proximity, .thickness = 2 * scene.thickness});
  }
};

std::unique_ptr<Loop> loop;

double secondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

#define PALPATE_BASELINE extern "C" __attribute__((visibility("default")))

PALPATE_BASELINE void makeLoop(int threads) { loop = std::make_unique<Loop>(threads); }
PALPATE_BASELINE int frameCount() { return static_cast<int>(loop->frames.size()); }
PALPATE_BASELINE int meshCount() { return static_cast<int>(loop->scene.meshes.size()); }
PALPATE_BASELINE int pairCount() { return static_cast<int>(loop->scene.pairs.size()); }
PALPATE_BASELINE double thickness() { return 2 * loop->scene.thickness; }
PALPATE_BASELINE int vertexCount(int mesh) {
  return static_cast<int>(loop->frames[0][static_cast<std::size_t>(mesh)].size());
}
PALPATE_BASELINE int triangleCount(int mesh) {
  return static_cast<int>(loop->scene.meshes[static_cast<std::size_t>(mesh)].triangles.size());
}
PALPATE_BASELINE void copyFrame(int frame, int mesh, double* out) {
  const Positions& positions =
      loop->frames[static_cast<std::size_t>(frame)][static_cast<std::size_t>(mesh)];
  for (const Eigen::Vector3d& p : positions) out = std::copy_n(p.data(), 3, out);
}
PALPATE_BASELINE void copyTriangles(int mesh, std::uint32_t* out) {
  for (const palpate::Triangle& t : loop->scene.meshes[static_cast<std::size_t>(mesh)].triangles)
    out = std::copy_n(t.data(), 3, out);
}
PALPATE_BASELINE void copyPair(int pair, std::uint32_t* out) {
  const auto& [a, b] = loop->scene.pairs[static_cast<std::size_t>(pair)];
  out[0] = static_cast<std::uint32_t>(a);
  out[1] = static_cast<std::uint32_t>(b);
}

/// A frame from the arrays of positions to the lists of contacts. Returns seconds; contacts: how
/// many.
PALPATE_BASELINE double runFrame(int frame, std::size_t* contacts) {
  const std::vector<Positions>& now = loop->frames[static_cast<std::size_t>(frame)];
  const auto start = std::chrono::steady_clock::now();
  for (std::size_t mesh = 0; mesh < now.size(); ++mesh)
    loop->collisions.setPositions(loop->ids[mesh], now[mesh]);
  loop->collisions.detectCollision();
  *contacts = 0;
  for (const auto& [a, b] : loop->scene.pairs) {
    const palpate::CollisionData& data = loop->collisions.collisionData(loop->ids[a], loop->ids[b]);
    *contacts +=
        data.vertexTriangle().size() + data.triangleVertex().size() + data.edgeEdge().size();
  }
  const double seconds = secondsSince(start);
  loop->collisions.advance();
  return seconds;
}

/// Closest points of the first mesh. Returns seconds; sum: of all distances.
PALPATE_BASELINE double runClosestPoints(const double* points, std::size_t count, double* sum) {
  const palpate::SpatialQueries queries = loop->collisions.queries();
  const auto start = std::chrono::steady_clock::now();
  loop->closest.clear();
  loop->closest.shrink_to_fit();
  loop->closest.resize(count);  // as Python does, the caller makes an array for each batch
  queries.closestPoints(loop->ids[0], {reinterpret_cast<const Eigen::Vector3d*>(points), count},
                        loop->closest);
  const double seconds = secondsSince(start);
  *sum = 0;
  for (const palpate::SurfacePoint& point : loop->closest) *sum += point.distance;
  return seconds;
}
