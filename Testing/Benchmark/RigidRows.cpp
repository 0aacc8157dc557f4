// A bone of half a million triangles that turns and presses into 10,952 deforming ones. It is moved
// by its transform, or by the same positions. The baseline is FCL with its transform.
#include "Rows.h"

#include "Common/RandomMeshes.h"

#ifdef PALPATE_BENCHMARK_BASELINES
#include "Baselines/FclBody.h"
#endif

#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>

#include <cmath>

namespace palpate::benchmark {
namespace {

constexpr int kFrames = 40;
constexpr double kThickness = 0.002;

struct Placement {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
};

Placement placement(int frame) {
  const double angle = 0.01 * frame;
  return {Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix(),
          {0.5 + 0.1 * std::sin(angle), 0.5, 0.42 - 0.02 * std::sin(5 * angle)}};
}

/// Closed, with bumps.
testing::Mesh bone() {
  testing::Mesh body = testing::sphere(501, 502, Eigen::Vector3d::Zero(), 0.4);
  for (Eigen::Vector3d& p : body.positions)
    p *= 0.95 + 0.05 * std::sin(19 * p[0]) * std::cos(23 * p[1] + 11 * p[2]);
  return body;
}

testing::Mesh tissue(int frame) { return testing::sheet(74, 0.0, 0.05 * frame); }

struct Moved {
  std::vector<double> samples;
  std::size_t contacts = 0;
  std::uint64_t hash = 0;
};

/// Milliseconds from a transform, or positions, to contacts.
Moved move(const testing::Mesh& body, const PairSettings& pair, int threads, bool byTransform) {
  Settings settings;
  settings.threads = threads;
  OctreeBasedCD detection(settings);
  const testing::Mesh start = tissue(0);
  const GeometryId organ = detection.addTriangleMesh(start.positions, start.triangles),
                   id = detection.addTriangleMesh(body.positions, body.triangles);
  detection.addCollisionPair(organ, id, pair);
  Moved result;
  std::vector<Eigen::Vector3d> world = body.positions;
  for (int frame = 0; frame < kFrames; ++frame) {
    const Placement at = placement(frame);
    const std::vector<Eigen::Vector3d> positions = tissue(frame).positions;
    for (std::size_t v = 0; v < world.size() && !byTransform; ++v)
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d& p = body.positions[v];
        world[v][k] = at.rotation(k, 0) * p[0] + at.rotation(k, 1) * p[1] +
                      at.rotation(k, 2) * p[2] + at.translation[k];
      }
    const double begin = now();
    detection.setPositions(organ, positions);
    if (byTransform)
      detection.setTransform(id, at.rotation, at.translation);
    else
      detection.setPositions(id, world);
    detection.detectCollision();
    detection.advance();
    if (frame > 1) result.samples.push_back(now() - begin);
    result.contacts += detection.statistics().contacts;
    result.hash ^= detection.collisionData(organ, id).hash() * (2 * frame + 1u);
  }
  return result;
}

}  // namespace

void rigidRows(Report& report, const RowOptions& options) {
  report.heading("A bone of 502,000 triangles in 10,952 deforming ones: ms per frame");
  report.line({"", "frame", "worst", "contacts of all frames"});
  const testing::Mesh body = bone();
  struct MethodCase {
    const char* name;
    PairSettings settings;
  };
  const MethodCase all[] = {{"Intersection", {Method::Intersection, 0.0}},
                            {"Proximity", {Method::Proximity, kThickness}},
                            {"Continuous", {Method::Continuous, 0.0}},
                            {"Auto", {Method::Auto, kThickness}}};
  for (const MethodCase& method : all)
    for (const int threads : options.threads)
      for (const bool byTransform : {true, false}) {
        const Moved moved = move(body, method.settings, threads, byTransform);
        const std::string name =
            std::string(method.name) + (byTransform ? ", setTransform" : ", setPositions");
        report.line({name + ", " + std::to_string(threads) + " threads",
                     milliseconds(median(moved.samples)), milliseconds(quantile(moved.samples, 1)),
                     std::to_string(moved.contacts)});
        report.row("rigid", "bone-tissue", threads, name, "frame ms", median(moved.samples),
                   moved.hash);
      }
#ifdef PALPATE_BENCHMARK_BASELINES
  FclBody fcl(tissue(0).positions, tissue(0).triangles, body.positions, body.triangles);
  std::vector<double> samples;
  std::size_t contacts = 0;
  for (int frame = 0; frame < kFrames; ++frame) {
    const Placement at = placement(frame);
    const FclBody::Answer answer =
        fcl.collide(tissue(frame).positions, at.rotation, at.translation);
    if (frame > 1) samples.push_back(answer.milliseconds);
    contacts += answer.contacts;
  }
  report.line({"FCL 0.7, refit and collide(), 1 thread", milliseconds(median(samples)),
               milliseconds(quantile(samples, 1)), std::to_string(contacts)});
  report.row("rigid", "bone-tissue", 1, "FCL 0.7 BVHModel<OBBRSS>, transform", "frame ms",
             median(samples));
#endif
}

}  // namespace palpate::benchmark
