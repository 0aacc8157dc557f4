// Free motion beside Continuous: its cost in a frame, and how much of the motion that is really
// free it proves.
#include "Rows.h"

#include <palpate/FeaturePairs.h>
#include <palpate/OctreeBasedCD.h>

#include <Scenes.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

namespace palpate::benchmark {
namespace {

using Points = std::vector<Eigen::Vector3d>;

/// Frames of a scene. Lines have no triangles.
struct MovingScene {
  scenes::Scene scene;
  double radius = 0.0;  ///< L: of a line mesh, whose vertices follow each other
  bool isLine(std::size_t mesh) const { return scene.meshes[mesh].triangles.empty(); }
};

/// A thread of 1,000 segments that winds around itself through a sheet.
MovingScene suture() {
  MovingScene suture;
  suture.scene.name = "suture";
  scenes::SceneMesh thread;
  constexpr int kSegments = 1000;
  for (int i = 0; i <= kSegments; ++i) {
    const double s = 0.01 * i;
    thread.positions.push_back(
        {0.8 * std::sin(3 * s) * std::cos(s), 0.8 * std::sin(5 * s), 0.1 * s * std::sin(7 * s)});
  }
  suture.scene.meshes = {thread, scenes::sheet(40)};
  const scenes::Motion sway = [](const Eigen::Vector3d& rest, double time) -> Eigen::Vector3d {
    return rest + 0.05 * std::sin(6.283185307179586 * time + 3 * rest.x()) *
                      Eigen::Vector3d(0.3, 0.2, 1.0);
  };
  const scenes::Motion still = [](const Eigen::Vector3d& rest, double) { return rest; };
  suture.scene.motions = {sway, still};
  suture.scene.pairs = {{0, 0}, {0, 1}};
  suture.radius = 0.004;
  suture.scene.thickness = 0.0025;
  return suture;
}

class Frames {
 public:
  Frames(const MovingScene& moving, double reach) : m_moving(moving) {
    const scenes::Scene& scene = moving.scene;
    for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
      const auto& mesh = scene.meshes[m];
      if (moving.isLine(m)) {
        std::vector<Segment> segments;
        for (std::uint32_t i = 0; i + 1 < mesh.positions.size(); ++i)
          segments.push_back({i, i + 1});
        m_ids.push_back(m_detection.addLineMesh(mesh.positions, segments, moving.radius));
      } else {
        m_ids.push_back(m_detection.addTriangleMesh(mesh.positions, mesh.triangles));
      }
    }
    for (const auto& [a, b] : scene.pairs)
      m_detection.addCollisionPair(
          m_ids[a], m_ids[b],
          {.method = Method::Continuous, .thickness = scene.thickness, .freeMotionReach = reach});
  }

  double next() {
    const scenes::Scene& scene = m_moving.scene;
    m_now.resize(m_ids.size());
    for (std::size_t m = 0; m < m_ids.size(); ++m) scene.positions(m_frame, m, m_now[m]);
    m_frame = (m_frame + 1) % scene.frames;
    const double start = now();
    for (std::size_t m = 0; m < m_ids.size(); ++m) m_detection.setPositions(m_ids[m], m_now[m]);
    m_detection.detectCollision();
    m_detection.advance();
    return now() - start;
  }
  std::span<const double> free(std::size_t mesh) const {
    return m_detection.freeMotion(m_ids[mesh]);
  }
  const Points& positions(std::size_t mesh) const { return m_now[mesh]; }

 private:
  const MovingScene& m_moving;
  OctreeBasedCD m_detection{{.threads = 1}};
  std::vector<GeometryId> m_ids;
  std::vector<Points> m_now;
  int m_frame = 0;
};

/// Bounds from above how far one vertex may really move while all others move within their free
/// motion, by the exact distances of all features.
class ReallyFree {
 public:
  ReallyFree(const MovingScene& moving, const Frames& frames) : m_moving(moving), m_frames(frames) {
    for (const auto& mesh : moving.scene.meshes) {
      std::vector<Segment> edges;
      for (const Triangle& t : mesh.triangles)
        for (int i = 0; i < 3; ++i)
          edges.push_back({std::min(t[i], t[(i + 1) % 3]), std::max(t[i], t[(i + 1) % 3])});
      for (std::uint32_t i = 0; mesh.triangles.empty() && i + 1 < mesh.positions.size(); ++i)
        edges.push_back({i, i + 1});
      std::sort(edges.begin(), edges.end());
      edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
      m_edges.push_back(std::move(edges));
    }
  }

  double of(std::size_t mesh, std::uint32_t vertex) {
    m_least = std::numeric_limits<double>::infinity();
    for (const auto& [a, b] : m_moving.scene.pairs) {
      if (a == mesh) against(mesh, b, vertex);
      if (b == mesh && a != b) against(mesh, a, vertex);
    }
    return m_least;
  }

 private:
  using Corner = std::pair<std::uint32_t, double>;

  void against(std::size_t mesh, std::size_t other, std::uint32_t vertex) {
    const Points &x = m_frames.positions(mesh), &y = m_frames.positions(other);
    const auto& scene = m_moving.scene;
    const bool self = mesh == other;
    const auto shares = [&](const auto& p, const auto& q) {
      return self && std::any_of(p.begin(), p.end(), [&](std::uint32_t v) {
               return std::find(q.begin(), q.end(), v) != q.end();
             });
    };
    for (const Triangle& t : scene.meshes[other].triangles)
      if (!shares(std::array{vertex}, t)) {
        const auto d = vertexTriangleDistance(x[vertex], y[t[0]], y[t[1]], y[t[2]]);
        limit(mesh, other, vertex, d.distance, {{{vertex, 1.0}}},
              {{{t[0], d.weights[0]}, {t[1], d.weights[1]}, {t[2], d.weights[2]}}});
      }
    for (const Triangle& t : scene.meshes[mesh].triangles) {
      if (std::find(t.begin(), t.end(), vertex) == t.end()) continue;
      for (std::uint32_t v = 0; v < y.size(); ++v)
        if (!shares(t, std::array{v})) {
          const auto d = vertexTriangleDistance(y[v], x[t[0]], x[t[1]], x[t[2]]);
          limit(mesh, other, vertex, d.distance,
                {{{t[0], d.weights[0]}, {t[1], d.weights[1]}, {t[2], d.weights[2]}}}, {{{v, 1.0}}});
        }
    }
    for (const Segment& p : m_edges[mesh]) {
      if (p[0] != vertex && p[1] != vertex) continue;
      for (const Segment& q : m_edges[other])
        if (!shares(p, q)) {
          const auto d = edgeEdgeDistance(x[p[0]], x[p[1]], y[q[0]], y[q[1]]);
          limit(mesh, other, vertex, d.distance, {{{p[0], 1 - d.weightA}, {p[1], d.weightA}}},
                {{{q[0], 1 - d.weightB}, {q[1], d.weightB}}});
        }
    }
  }

  void limit(std::size_t mesh, std::size_t other, std::uint32_t vertex, double distance,
             const std::array<Corner, 3>& of, const std::array<Corner, 3>& others) {
    const double radii = m_moving.radius * (m_moving.isLine(mesh) + m_moving.isLine(other));
    const double contact = radii + m_moving.scene.thickness;
    double gap = distance <= contact ? distance : distance - contact, weight = 0;
    for (const auto& [v, share] : others) gap -= share * m_frames.free(other)[v];
    for (const auto& [v, share] : of) {
      if (v == vertex && share > 0)
        weight += share;
      else
        gap -= share * m_frames.free(mesh)[v];
    }
    if (weight > 0) m_least = std::min(m_least, gap / weight);
  }

  const MovingScene& m_moving;
  const Frames& m_frames;
  std::vector<std::vector<Segment>> m_edges;
  double m_least = 0;
};

/// The share of really free motion that 90 % of a sample of the vertices have at least. Vertices
/// whose free motion is half of the reach have all of it.
double shareOf90Percent(const MovingScene& moving, const Frames& frames, double reach) {
  ReallyFree really(moving, frames);
  std::vector<double> shares;
  for (std::size_t m = 0; m < moving.scene.meshes.size(); ++m) {
    const auto free = frames.free(m);
    const std::size_t stride = std::max<std::size_t>(1, free.size() / 40);
    for (std::uint32_t v = 0; v < free.size(); v += static_cast<std::uint32_t>(stride)) {
      const double limit = free[v] < 0.4999 * reach ? really.of(m, v) : free[v];
      shares.push_back(limit > 0 ? std::min(1.0, free[v] / limit) : 1.0);
    }
  }
  return quantile(std::move(shares), 0.1);
}

}  // namespace

void freeMotionRows(Report& report, const RowOptions& options) {
  report.heading("Free motion beside Continuous, ms a frame; 1 thread");
  report.line({"", "reach over edge", "Continuous", "with free motion", "ratio", "share of 90 %"});
  const MovingScene all[] = {{scenes::organs()}, {scenes::foldedCloth()}, suture()};
  for (const MovingScene& moving : all) {
    const std::string& name = moving.scene.name;
    if (!isWanted(name, options.scenes)) continue;
    for (const double edges : {0.05, 0.25, 1.0}) {
      const double reach = edges * 20 * moving.scene.thickness;
      Frames without(moving, 0.0), with(moving, reach);
      std::vector<double> times[2];
      for (int frame = 0; frame < 2 * (options.quick ? 10 : 30); ++frame) {
        const double spent[] = {without.next(), with.next()};
        if (frame > 2)
          for (int i = 0; i < 2; ++i) times[i].push_back(spent[i]);
      }
      const double continuous = median(times[0]), both = median(times[1]),
                   share = shareOf90Percent(moving, with, reach);
      report.line({name, benchmark::times(edges), milliseconds(continuous), milliseconds(both),
                   benchmark::times(both / continuous), benchmark::times(share)});
      report.row("free motion", name, 1, "reach over edge " + std::to_string(edges),
                 "Continuous ms", continuous);
      report.row("free motion", name, 1, "reach over edge " + std::to_string(edges),
                 "with free motion ms", both);
      report.row("free motion", name, 1, "reach over edge " + std::to_string(edges),
                 "share of 90 %", share);
    }
  }
}

}  // namespace palpate::benchmark
