// An arm of five rigid links beside a bone of a million triangles: frames with the bone, with its
// certified simplification, and with the bone only where the simplification leaves it open. Lengths
// are in mm.
#include "Rows.h"

#include "Common/RandomMeshes.h"
#include "InstrumentArm.h"

#include <palpate/OctreeBasedCD.h>
#include <palpate/Simplify.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

namespace palpate::benchmark {
namespace {

using Eigen::Vector3d;
using scenes::InstrumentArm;

constexpr int kFrames = 200;
constexpr double kThickness = 0.5;

/// Along z, thin in the middle.
testing::Mesh bone(std::uint32_t rings, std::uint32_t segments) {
  testing::Mesh body = testing::sphere(rings, segments, Vector3d::Zero(), 1.0);
  for (Vector3d& p : body.positions) {
    const double z = p[2],
                 width = 13 + 17 * std::exp(-std::pow((z - 0.8) / 0.3, 2)) +
                         20 * std::exp(-std::pow((z + 0.85) / 0.25, 2)),
                 waves = 1 + 0.03 * std::sin(9 * p[0] + 31 * z) * std::cos(7 * p[1] - 17 * z);
    const double round = std::pow(std::max(0.0, 1 - z * z), -0.35);
    p = {width * waves * p[0] * std::min(round, 20.0), width * waves * p[1] * std::min(round, 20.0),
         200 * z};
  }
  return body;
}

struct Reach {
  const char* name;
  double distance;       ///< of the arm's port from the bone's axis
  bool isAlong = false;  ///< the arm points along the bone, else towards it
};

InstrumentArm armAt(const Reach& reach, int frame) {
  const double phase = 2 * std::numbers::pi * frame / kFrames;
  Eigen::Isometry3d port = Eigen::Isometry3d::Identity();
  port.translation() = Vector3d(reach.distance, 5 * std::sin(phase), 20 * std::cos(phase));
  const Vector3d direction = reach.isAlong ? Vector3d(0, 0.01, -1) : Vector3d(-1, 0, 0.1);
  port.linear() = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), direction).matrix();
  InstrumentArm::Joints joints;
  joints << 0.1 * std::sin(phase), 0.1 * std::cos(phase), 4 * std::sin(3 * phase),
      0.3 * std::sin(2 * phase), 0.3 * std::cos(2 * phase), 0.2 + 0.1 * std::sin(phase);
  if (reach.isAlong) joints.head<5>() *= 0.02;
  return {port, joints};
}

/// One body and the links of the arm.
class Scene {
 public:
  Scene(std::span<const Vector3d> positions, std::span<const Triangle> triangles,
        const PairSettings& pair, int threads)
      : m_detection(settingsOf(threads)),
        m_body(m_detection.addTriangleMesh(positions, triangles)) {
    m_detection.setTransform(m_body, {Eigen::Matrix3d::Identity(), Vector3d::Zero()});
    for (const InstrumentArm::Link& link : InstrumentArm::makeLinks()) {
      m_links.push_back(m_detection.addTriangleMesh(link.drawn.positions, link.drawn.triangles));
      m_detection.addCollisionPair(m_body, m_links.back(), pair);
      m_first.push_back(link.drawn.positions[0]);
    }
  }
  /// Milliseconds from transforms to contacts.
  double detect(const InstrumentArm& before, const InstrumentArm& arm) {
    const double begin = now();
    for (int i = 0; i < InstrumentArm::kLinks; ++i) {
      const Eigen::Isometry3d &from = before.link(i), &to = arm.link(i);
      m_detection.setTransform(m_links[static_cast<std::size_t>(i)],
                               {from.linear(), from.translation()},
                               {to.linear(), to.translation()});
    }
    m_detection.detectCollision();
    m_detection.advance();
    return now() - begin;
  }
  std::size_t contacts() const { return m_detection.statistics().contacts; }
  /// Whether the body encloses a vertex of a link, which stands for all if nothing touches.
  bool encloses(const InstrumentArm& arm) {
    const SpatialQueries queries = m_detection.queries();
    bool inside = false;
    for (int i = 0; i < InstrumentArm::kLinks; ++i)
      inside |= queries.contains(m_body, arm.link(i) * m_first[static_cast<std::size_t>(i)]);
    return inside;
  }

 private:
  static Settings settingsOf(int threads) {
    Settings settings;
    settings.threads = threads;
    return settings;
  }

  OctreeBasedCD m_detection;
  GeometryId m_body;
  std::vector<GeometryId> m_links;
  std::vector<Vector3d> m_first;
};

/// The longest way of a vertex of the arm in a step.
double longestWay(const Reach& reach) {
  double longest = 0.0;
  const auto links = InstrumentArm::makeLinks();
  for (int frame = 0; frame < kFrames; ++frame) {
    const InstrumentArm before = armAt(reach, frame), arm = armAt(reach, frame + 1);
    for (int i = 0; i < InstrumentArm::kLinks; ++i)
      for (const Vector3d& p : links[static_cast<std::size_t>(i)].drawn.positions)
        longest = std::max(longest, (arm.link(i) * p - before.link(i) * p).norm());
  }
  return longest;
}

struct Times {
  std::vector<double> bone, coarse, first;
  std::size_t contacts = 0, decided = 0, lost = 0;
};

Times measure(const testing::Mesh& body, const SimplifiedMesh& around, const PairSettings& pair,
              const Reach& reach, int threads) {
  // A link that ends its step outside, and further away than it moved, was outside all the time.
  PairSettings coarsePair = pair;
  if (pair.method == Method::Continuous)
    coarsePair = {Method::Proximity, 1.001 * longestWay(reach)};
  Scene fine(body.positions, body.triangles, pair, threads),
      coarse(around.positions, around.triangles, coarsePair, threads);
  Times times;
  for (int frame = 0; frame < kFrames; ++frame) {
    const InstrumentArm before = armAt(reach, frame), arm = armAt(reach, frame + 1);
    double ofFine = 0, ofCoarse = 0;
    for (const bool isFine : {frame % 2 == 0, frame % 2 != 0})
      (isFine ? ofFine : ofCoarse) = (isFine ? fine : coarse).detect(before, arm);
    const double begin = now();
    const bool isOpen = coarse.contacts() > 0 || coarse.encloses(arm);
    const double first = ofCoarse + (now() - begin) + (isOpen ? ofFine : 0.0);
    times.contacts += fine.contacts();
    times.decided += !isOpen;
    if (!isOpen) times.lost += fine.contacts();
    if (frame < 2) continue;
    times.bone.push_back(ofFine);
    times.coarse.push_back(ofCoarse);
    times.first.push_back(first);
  }
  return times;
}

}  // namespace

void coarseRows(Report& report, const RowOptions& options) {
  testing::Mesh body;
  SimplifiedMesh around;
  report.heading("Certified simplification of a bone");
  report.line({"triangles, maxDistance / diagonal", "seconds", "triangles", "rounds"});
  for (const std::uint32_t rings : {225u, 701u}) {
    if (options.quick && rings > 300) continue;
    body = bone(rings, rings + 15);
    Eigen::AlignedBox3d box;
    for (const Vector3d& p : body.positions) box.extend(p);
    for (const double share : {0.01, 0.003, 0.001}) {  // the scenes below use the last one
      const int threads = options.threads.front();
      const double begin = now();
      around = simplify({body.positions, body.triangles},
                        {.maxDistance = share * box.diagonal().norm(), .threads = threads});
      const double seconds = (now() - begin) / 1000;
      const std::string scene = std::to_string(body.triangles.size()) + " triangles, " +
                                std::to_string(100 * share).substr(0, 3) + " % of the diagonal";
      report.line({scene, benchmark::milliseconds(seconds), std::to_string(around.triangles.size()),
                   std::to_string(around.rounds)});
      report.row("simplify", scene, threads, "Palpate", "seconds", seconds);
      report.row("simplify", scene, threads, "Palpate", "triangles",
                 static_cast<double>(around.triangles.size()));
      report.row("simplify", scene, threads, "Palpate", "rounds", around.rounds);
    }
  }
  report.heading("An arm beside a bone of " + std::to_string(body.triangles.size()) +
                 " triangles, and its simplification to " +
                 std::to_string(around.triangles.size()) + ": ms per frame");
  report.line({"", "bone", "coarse", "coarse first", "decided", "contacts", "lost"});
  struct MethodCase {
    const char* name;
    PairSettings settings;
  };
  const MethodCase all[] = {{"Intersection", {Method::Intersection, 0.0}},
                            {"Proximity", {Method::Proximity, kThickness}},
                            {"Continuous", {Method::Continuous, 0.0}}};
  for (const Reach& reach :
       {Reach{"away", 300}, Reach{"beside", 80}, Reach{"near", 68.5}, Reach{"touching", 62},
        Reach{"along, near", 18.5, true}, Reach{"along, touching", 17, true}})
    for (const MethodCase& method : all)
      for (const int threads : options.threads) {
        const Times times = measure(body, around, method.settings, reach, threads);
        const std::string scene = std::string(reach.name) + ", " + method.name;
        report.line({scene + ", " + std::to_string(threads) + " threads",
                     benchmark::milliseconds(median(times.bone)),
                     benchmark::milliseconds(median(times.coarse)),
                     benchmark::milliseconds(median(times.first)),
                     std::to_string(times.decided) + "/" + std::to_string(kFrames),
                     std::to_string(times.contacts), std::to_string(times.lost)});
        report.row("coarse", scene, threads, "the mesh alone", "frame ms", median(times.bone));
        report.row("coarse", scene, threads, "the simplification alone", "frame ms",
                   median(times.coarse));
        report.row("coarse", scene, threads, "the simplification first", "frame ms",
                   median(times.first));
        report.row("coarse", scene, threads, "the simplification first", "frames decided",
                   static_cast<double>(times.decided));
        report.row("coarse", scene, threads, "the simplification first", "contacts",
                   static_cast<double>(times.contacts));
        report.row("coarse", scene, threads, "the simplification first", "contacts lost",
                   static_cast<double>(times.lost));
      }
}

}  // namespace palpate::benchmark
