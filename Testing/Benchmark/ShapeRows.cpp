// A capsule pressed into a sheet of 100,352 triangles, all moving, and into the sheet's vertices as
// particles. The time is that of the pair without the update. Baselines are brute force on the same
// frames and FCL.
#include "Rows.h"

#ifdef PALPATE_BENCHMARK_BASELINES
#include "Baselines/FclCapsule.h"
#endif

#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>

#include <cmath>

namespace palpate::benchmark {
namespace {

constexpr std::uint32_t kSide = 224;  ///< quads
constexpr int kFrames = 60;
constexpr double kThickness = 0.001;
constexpr double kMilliseconds = 0.1;  ///< the target for the triangles
/// The ratio to the sheet of an instrument of 5 mm to 200 mm.
const Capsule kTool{{0, 0, 0}, {0.25, 0, 0}, 0.0125};

std::vector<Eigen::Vector3d> waves(int frame) {
  std::vector<Eigen::Vector3d> positions;
  for (std::uint32_t j = 0; j <= kSide; ++j)
    for (std::uint32_t i = 0; i <= kSide; ++i) {
      const double x = double(i) / kSide, y = double(j) / kSide;
      positions.push_back({x, y, 0.05 * std::sin(9 * x + 0.1 * frame) * std::cos(7 * y)});
    }
  return positions;
}

std::vector<Triangle> quads() {
  std::vector<Triangle> triangles;
  for (std::uint32_t j = 0; j < kSide; ++j)
    for (std::uint32_t i = 0; i < kSide; ++i) {
      const std::uint32_t v = j * (kSide + 1) + i;
      triangles.push_back({v, v + 1, v + kSide + 2});
      triangles.push_back({v, v + kSide + 2, v + kSide + 1});
    }
  return triangles;
}

struct Placement {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
};
Placement placement(int frame) {
  return {Eigen::AngleAxisd(0.05 * frame, Eigen::Vector3d::UnitZ()).matrix(), {0.4, 0.5, 0.02}};
}

/// Milliseconds of the pair in one frame, without the update.
double pairTime(OctreeBasedCD& detection, GeometryId mesh, GeometryId tool, int frame) {
  detection.setPositions(mesh, waves(frame));
  const Placement at = placement(frame);
  detection.setTransform(tool, {at.rotation, at.translation});
  detection.update();
  const double start = now();
  detection.detectCollision();
  const double milliseconds = now() - start;
  detection.advance();
  return milliseconds;
}

#ifdef PALPATE_BENCHMARK_BASELINES
void fclRow(Report& report) {
  FclCapsule fcl(waves(0), quads());
  std::vector<double> samples;
  std::size_t contacts = 0;
  for (int frame = 0; frame < kFrames; ++frame) {
    const Placement at = placement(frame);
    const FclCapsule::Answer answer =
        fcl.collide(waves(frame), at.rotation * kTool.p0 + at.translation,
                    at.rotation * kTool.p1 + at.translation, kTool.radius + kThickness);
    contacts = answer.contacts;
    if (frame > 0) samples.push_back(answer.milliseconds);
  }
  report.line({"FCL 0.7", milliseconds(median(samples)), milliseconds(quantile(samples, 1)),
               std::to_string(contacts)});
  report.row("shapes", "capsule-sheet", 1, "FCL 0.7 BVHModel<OBBRSS>", "pair ms", median(samples));
}
#endif

}  // namespace

void shapeRows(Report& report, const RowOptions& options) {
  report.heading(
      "A capsule in 100,352 deforming triangles or 50,625 points: ms without the update");
  report.line({"", "pair", "worst", "contacts"});
  for (const bool triangles : {true, false}) {
    const std::string scene = triangles ? "capsule-sheet" : "capsule-points";
    for (const Engine engine : {Engine::Octree, Engine::BruteForce}) {
      Settings settings;
      settings.engine = engine;
      settings.threads = options.threads.empty() ? 1 : options.threads.front();
      OctreeBasedCD detection(settings);
      const GeometryId mesh = triangles ? detection.addTriangleMesh(waves(0), quads())
                                        : detection.addPointSet(waves(0));
      const GeometryId tool = detection.addAnalyticalGeometry(kTool);
      detection.addCollisionPair(mesh, tool, {Method::Proximity, kThickness});
      std::vector<double> samples;
      for (int frame = 0; frame < kFrames; ++frame) {
        const double sample = pairTime(detection, mesh, tool, frame);
        if (frame > 0) samples.push_back(sample);
      }
      const CollisionData& data = detection.collisionData(mesh, tool);
      const std::string name = engine == Engine::Octree ? "Palpate" : "Palpate, brute force";
      report.line({name, milliseconds(median(samples)), milliseconds(quantile(samples, 1)),
                   std::to_string(data.shape().size())});
      report.row("shapes", scene, settings.threads, name, "pair ms", median(samples), data.hash());
      if (triangles && engine == Engine::Octree)
        report.row("shapes", scene, settings.threads, name, "share of the target of 0.1 ms",
                   median(samples) / kMilliseconds);
    }
#ifdef PALPATE_BENCHMARK_BASELINES
    if (triangles) fclRow(report);
#endif
  }
}

}  // namespace palpate::benchmark
