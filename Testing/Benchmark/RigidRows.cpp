// A bone of half a million triangles that turns and presses into 10,952 deforming ones. It is moved
// by its transform, or by the same positions. The baseline is FCL with its transform.
#include "Bone.h"
#include "Rows.h"

#include "Common/RandomMeshes.h"

#ifdef PALPATE_BENCHMARK_BASELINES
#include "Baselines/FclBody.h"
#endif

#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>

#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

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
      detection.setTransform(id, {at.rotation, at.translation});
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

namespace {

/// A bone of a million triangles in deforming ones, in turns by its triangles and by its field.
class FieldRace {
 public:
  FieldRace(const testing::Mesh& body, std::shared_ptr<const DistanceField> ofBone, int threads)
      : m_byTriangles(Settings{.threads = threads}), m_byField(Settings{.threads = threads}) {
    const testing::Mesh start = tissue(0);
    for (OctreeBasedCD* detection : {&m_byTriangles, &m_byField}) {
      m_organ = detection->addTriangleMesh(start.positions, start.triangles);
      m_bone = detection->addTriangleMesh(body.positions, body.triangles);
    }
    m_byField.attachDistanceField(m_bone, std::move(ofBone));
    m_byTriangles.addCollisionPair(m_organ, m_bone, {Method::Proximity, kThickness});
    m_byField.addCollisionPair(m_organ, m_bone, {Method::DistanceField, kThickness});
  }

  void run() {
    for (int frame = 0; frame < kFrames; ++frame) {
      const std::vector<Eigen::Vector3d> positions = tissue(frame).positions;
      step(m_byTriangles, positions, frame, byTriangles);
      step(m_byField, positions, frame, byField);
    }
  }

  Moved byTriangles, byField;

 private:
  /// Milliseconds from a transform and positions to contacts.
  void step(OctreeBasedCD& detection, std::span<const Eigen::Vector3d> positions, int frame,
            Moved& result) {
    const Placement at = placement(frame);
    const double begin = now();
    detection.setPositions(m_organ, positions);
    detection.setTransform(m_bone, {at.rotation, at.translation});
    detection.detectCollision();
    detection.advance();
    if (frame > 1) result.samples.push_back(now() - begin);
    result.contacts += detection.statistics().contacts;
    result.hash ^= detection.collisionData(m_organ, m_bone).hash() * (2 * frame + 1u);
  }

  OctreeBasedCD m_byTriangles, m_byField;
  GeometryId m_organ, m_bone;
};

}  // namespace

void fieldFrameRows(Report& report, const RowOptions& options) {
  const testing::Mesh body = options.quick ? bone() : bone(708, 708);
  const double begin = now();
  const auto field = std::make_shared<const DistanceField>(DistanceField::build(
      {body.positions, body.triangles}, {.errorBound = kThickness / 4, .band = 20 * kThickness}));
  report.heading("A bone of " + std::to_string(body.triangles.size()) +
                 " triangles in 10,952 deforming ones, in turns: ms per frame");
  report.line({"", "frame", "worst", "contacts of all frames", "ratio"});
  report.row("fieldframe", "bone-tissue", 0, "build", "ms", now() - begin);
  for (const int threads : options.threads) {
    FieldRace race(body, field, threads);
    race.run();
    const double proximity = median(race.byTriangles.samples);
    for (const auto& [name, moved] :
         {std::pair<std::string, const Moved&>{"Proximity", race.byTriangles},
          std::pair<std::string, const Moved&>{"DistanceField", race.byField}}) {
      const double frame = median(moved.samples);
      report.line({name + ", " + std::to_string(threads) + " threads", milliseconds(frame),
                   milliseconds(quantile(moved.samples, 1)), std::to_string(moved.contacts),
                   times(frame / proximity)});
      report.row("fieldframe", "bone-tissue", threads, name, "frame ms", frame, moved.hash);
    }
  }
}

}  // namespace palpate::benchmark
