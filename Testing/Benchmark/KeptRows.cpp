// Frames of slow motion with candidates that are kept, beside a search in each frame.
#include "Rows.h"

#include <palpate/OctreeBasedCD.h>

#include <Scenes.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <vector>

namespace palpate::benchmark {
namespace {

using Points = std::vector<Eigen::Vector3d>;

/// A scene in which vertices move by a share of the mean edge in a step, on average at its start.
class SlowFrames {
 public:
  SlowFrames(const scenes::Scene& scene, double share) : m_scene(scene) {
    constexpr double kInstant = 1e-6;
    double moved = 0;
    std::size_t vertices = 0;
    for (std::size_t m = 0; m < scene.meshes.size(); ++m)
      for (const Eigen::Vector3d& rest : scene.meshes[m].positions) {
        moved +=
            (scene.motions[m](rest, kStart + kInstant) - scene.motions[m](rest, kStart)).norm();
        ++vertices;
      }
    const double edge = 20 * scene.thickness;
    m_step = share * edge * kInstant * static_cast<double>(vertices) / moved;
  }
  void positions(int frame, std::size_t mesh, Points& out) const {
    const Points& rest = m_scene.meshes[mesh].positions;
    out.resize(rest.size());
    for (std::size_t v = 0; v < rest.size(); ++v)
      out[v] = m_scene.motions[mesh](rest[v], kStart + frame * m_step);
  }

 private:
  static constexpr double kStart = 0.28;  ///< the meshes move and touch
  const scenes::Scene& m_scene;
  double m_step;
};

class Detection {
 public:
  Detection(const scenes::Scene& scene, Method method, int threads, bool keeps)
      : m_detection({.octree = {.keepsPairs = keeps}, .threads = threads}) {
    for (const auto& mesh : scene.meshes)
      m_ids.push_back(m_detection.addTriangleMesh(mesh.positions, mesh.triangles));
    for (const auto& [a, b] : scene.pairs)
      m_detection.addCollisionPair(m_ids[a], m_ids[b],
                                   {.method = method, .thickness = scene.thickness});
  }
  double frame(const std::vector<Points>& positions) {
    m_detection.advance();
    const double start = now();
    for (std::size_t m = 0; m < m_ids.size(); ++m) m_detection.setPositions(m_ids[m], positions[m]);
    m_detection.detectCollision();
    return now() - start;
  }
  std::uint64_t hash() const {
    std::uint64_t all = 0;
    for (const CollisionPair& pair : m_detection.pairs())
      all = 31 * all + m_detection.collisionData(pair.a, pair.b).hash();
    return all;
  }

 private:
  OctreeBasedCD m_detection;
  std::vector<GeometryId> m_ids;
};

void compare(Report& report, const scenes::Scene& scene, double share, Method method, int threads,
             int frames) {
  const SlowFrames slow(scene, share);
  std::array<Detection, 2> detections{Detection(scene, method, threads, false),
                                      Detection(scene, method, threads, true)};
  std::vector<double> spent[2];
  std::vector<Points> positions(scene.meshes.size());
  for (int frame = 0; frame < frames; ++frame) {
    for (std::size_t m = 0; m < positions.size(); ++m) slow.positions(frame, m, positions[m]);
    for (int turn = 0; turn < 2; ++turn) {
      const std::size_t i = static_cast<std::size_t>((frame + turn) % 2);
      const double time = detections[i].frame(positions);
      if (frame >= 10) spent[i].push_back(time);
    }
    if (detections[0].hash() != detections[1].hash())
      throw std::runtime_error(scene.name + ": kept candidates change contacts");
  }
  const double searched = median(spent[0]), kept = median(spent[1]),
               worst = quantile(spent[1], 0.99);
  const std::string name = std::string(toString(method)) + ", " + std::to_string(share);
  report.line({scene.name + ", " + toString(method), std::to_string(threads), times(100 * share),
               milliseconds(searched), milliseconds(kept), times(kept / searched),
               times(worst / kept)});
  report.row("kept pairs", scene.name, threads, name, "searched ms", searched);
  report.row("kept pairs", scene.name, threads, name, "kept ms", kept);
  report.row("kept pairs", scene.name, threads, name, "p99 of kept over median", worst / kept);
}

}  // namespace

void keptRows(Report& report, const RowOptions& options) {
  report.heading("Slow frames with kept candidates, ms; contacts are compared in every frame");
  report.line({"", "threads", "% of an edge", "searched", "kept", "ratio", "p99 / median"});
  const scenes::Scene all[] = {scenes::organs(), scenes::clothOnBall(),
                               scenes::interleavedSheets(64'000), scenes::foldedCloth(),
                               scenes::unevenBodies()};
  for (const scenes::Scene& scene : all) {
    if (!isWanted(scene.name, options.scenes)) continue;
    for (const int threads : options.threads)
      for (const Method method : {Method::Proximity, Method::Auto})
        for (const double share : {0.0005, 0.002, 0.005, 0.01, 0.05, 0.5})
          compare(report, scene, share, method, threads, options.quick ? 60 : 300);
  }
}

}  // namespace palpate::benchmark
