// A suture of 1,000 segments with itself and with the organs as one mesh. The baseline is brute
// force on the same frame.
#include "Rows.h"

#include "Scenes.h"

#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>

#include <cmath>
#include <numbers>

namespace palpate::benchmark {
namespace {

constexpr int kSegments = 1000;
constexpr double kMilliseconds = 0.5;  ///< the target for both pairs

/// Wound through the organs and over itself; `phase` in [0, 1] moves it along.
void windSuture(const Eigen::AlignedBox3d& box, double phase, std::vector<Eigen::Vector3d>& out) {
  out.clear();
  for (int i = 0; i <= kSegments; ++i) {
    const double s = (2 * std::numbers::pi * i) / kSegments;
    const Eigen::Vector3d turn(std::sin(3 * s + phase), std::sin(5 * s), std::cos(4 * s - phase));
    out.push_back(box.center() + 0.45 * box.sizes().cwiseProduct(turn));
  }
}

class SutureScene {
 public:
  SutureScene(const Settings& settings, const scenes::Scene& scene)
      : m_scene(scene), m_detection(settings) {
    std::vector<Triangle> triangles;
    for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
      const auto first = static_cast<std::uint32_t>(m_organs.size());
      m_organs.insert(m_organs.end(), scene.meshes[m].positions.begin(),
                      scene.meshes[m].positions.end());
      for (const auto& [a, b, c] : scene.meshes[m].triangles)
        triangles.push_back({a + first, b + first, c + first});
    }
    for (const Eigen::Vector3d& p : m_organs) m_box.extend(p);
    windSuture(m_box, 0, m_thread);
    std::vector<Segment> segments;
    for (std::uint32_t i = 0; i < kSegments; ++i) segments.push_back({i, i + 1});
    const double radius = (m_thread[1] - m_thread[0]).norm() / 4;
    m_suture = m_detection.addLineMesh(m_thread, segments, radius);
    m_mesh = m_detection.addTriangleMesh(m_organs, triangles);
    PairSettings self{Method::Proximity, radius};
    self.restDistance = 4 * radius;
    m_detection.addCollisionPair(m_suture, m_suture, self);
    m_detection.addCollisionPair(m_suture, m_mesh, {Method::Proximity, radius});
  }

  void setFrame(int frame) {
    m_organs.clear();
    for (std::size_t m = 0; m < m_scene.meshes.size(); ++m) {
      m_scene.positions(frame, m, m_part);
      m_organs.insert(m_organs.end(), m_part.begin(), m_part.end());
    }
    windSuture(m_box, 0.02 * frame, m_thread);
  }
  /// Milliseconds from positions to the contacts of both pairs.
  double detect() {
    const double start = now();
    m_detection.setPositions(m_suture, m_thread);
    m_detection.setPositions(m_mesh, m_organs);
    m_detection.detectCollision();
    m_detection.advance();
    return now() - start;
  }
  const CollisionData& withItself() const { return m_detection.collisionData(m_suture, m_suture); }
  const CollisionData& withOrgans() const { return m_detection.collisionData(m_suture, m_mesh); }

 private:
  const scenes::Scene& m_scene;
  OctreeBasedCD m_detection;
  Eigen::AlignedBox3d m_box;
  std::vector<Eigen::Vector3d> m_organs, m_thread, m_part;
  GeometryId m_suture, m_mesh;
};

}  // namespace

void lineRows(Report& report, const RowOptions& options) {
  report.heading("A suture of 1,000 segments with itself and with 10,840 triangles: ms per frame");
  report.line({"", "frame", "worst", "own", "organs'"});
  const scenes::Scene scene = scenes::organs();
  constexpr int kFrames = 60;
  for (const int threads : options.threads) {
    Settings settings;
    settings.threads = threads;
    SutureScene suture(settings, scene);
    std::vector<double> samples, own, others;
    for (int frame = 0; frame < kFrames; ++frame) {
      suture.setFrame(frame);
      const double sample = suture.detect();
      if (frame > 0) samples.push_back(sample);
      own.push_back(static_cast<double>(suture.withItself().edgeEdge().size()));
      others.push_back(static_cast<double>(suture.withOrgans().edgeEdge().size() +
                                           suture.withOrgans().vertexTriangle().size()));
    }
    const double middle = median(samples);
    report.line({std::to_string(threads) + " threads", milliseconds(middle),
                 milliseconds(quantile(samples, 1)), milliseconds(median(own)),
                 milliseconds(median(others))});
    report.row("lines", "suture-organs", threads, "Palpate", "frame ms", middle,
               suture.withOrgans().hash());
    report.row("lines", "suture-organs", threads, "Palpate", "share of the target of 0.5 ms",
               middle / kMilliseconds);
  }
  Settings bruteForce;
  bruteForce.engine = Engine::BruteForce;
  SutureScene suture(bruteForce, scene);
  suture.setFrame(kFrames - 1);
  const double taken = suture.detect();
  report.line({"brute force", milliseconds(taken)});
  report.row("lines", "suture-organs", 1, "Palpate, brute force", "frame ms", taken,
             suture.withOrgans().hash());
}

}  // namespace palpate::benchmark
