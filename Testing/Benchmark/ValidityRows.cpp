// The cost of validity(). It has three parts: measuring the motion while positions are copied, the
// additional work of the narrow phase, and the triangle pairs of the initial intersection check.
// The first two are differences of times with and without, on the same candidates and in turns. The
// third is the number of pairs times the cost of one. The whole frame is given beside it.
#include "Rows.h"

#include "Bodies/InputChecks.h"
#include "Mesh/Motion.h"
#include "Math/MotionBound.h"
#include "NarrowPhase/IntersectionFilter.h"
#include "NarrowPhase/NarrowPhase.h"

#include <palpate/OctreeBasedCD.h>

#include <Scenes.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <utility>

namespace palpate::benchmark {
namespace {

using Step = std::vector<std::vector<Eigen::Vector3d>>;

constexpr int kFrames = 24;

/// A sheet that lies on another within the thickness and creeps along it: every step is trusted,
/// and every contact is checked.
scenes::Scene restingSheets() {
  scenes::Scene scene{"resting sheets", {scenes::sheet(30), scenes::sheet(30)}, {}, {{0, 1}}};
  scene.frames = 24;
  const double edge = 2.0 / 30;
  scene.thickness = edge / 20;
  scene.motions.push_back([](const Eigen::Vector3d& rest, double) { return rest; });
  scene.motions.push_back([edge](const Eigen::Vector3d& rest, double time) -> Eigen::Vector3d {
    const double angle = 2 * std::acos(-1.0) * time;
    return rest +
           edge * Eigen::Vector3d(0.3 + 0.05 * std::cos(angle), 0.05 * std::sin(angle), 0.03);
  });
  return scene;
}

/// A scene in one frame, with a pair's candidates from the library.
class ValidityCost {
 public:
  ValidityCost(const scenes::Scene& scene, const PairSettings& settings)
      : m_scene(scene), m_settings(settings), m_detection({.threads = 1}) {
    m_before = m_now = at(0);
    for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
      m_ids.push_back(m_detection.addTriangleMesh(m_now[m], scene.meshes[m].triangles));
      m_meshes.push_back({MeshTopology(m_now[m].size(), scene.meshes[m].triangles), {}, {}});
    }
    for (const auto& [a, b] : scene.pairs)
      m_detection.addCollisionPair(m_ids[a], m_ids[b], settings);
    m_detection.detectCollision();
    m_detection.advance();
  }

  /// Milliseconds of the next frame.
  struct Frame {
    double whole = std::numeric_limits<double>::infinity();  ///< the whole frame as shipped;
                                                             ///< candidates are kept
    double validity = 0;                                     ///< the part of validity()
  };
  Frame next(int frame) {
    m_before = std::exchange(m_now, at(frame));
    Frame cost;
    const double start = now();
    for (std::size_t m = 0; m < m_ids.size(); ++m) m_detection.setPositions(m_ids[m], m_now[m]);
    m_detection.detectCollision();
    m_detection.advance();
    cost.whole = now() - start;
    for (std::size_t m = 0; m < m_meshes.size(); ++m) {
      m_meshes[m].before = m_before[m];
      m_meshes[m].now = m_now[m];
    }
    cost.validity = findMotion();
    for (const auto& pair : m_scene.pairs) cost.validity += narrowPhase(pair);
    cost.validity += looks();
    return cost;
  }

 private:
  Step at(int frame) const {
    Step positions(m_scene.meshes.size());
    for (std::size_t m = 0; m < positions.size(); ++m) m_scene.positions(frame, m, positions[m]);
    return positions;
  }
  template <class F>
  static double fastest(F&& f) {
    double least = std::numeric_limits<double>::infinity();
    for (int turn = 0; turn < 12; ++turn) {
      const double start = now();
      f();
      least = std::min(least, now() - start);
    }
    return least;
  }
  /// Measuring the motion: copying positions with it, less copying them without.
  double findMotion() {
    const Threads one(1);
    double spent = 0;
    m_motion.assign(m_meshes.size(), {});
    for (const bool asked : {true, false}) {
      const double all = fastest([&] {
        for (std::size_t m = 0; m < m_meshes.size(); ++m) {
          MotionRange moved;
          m_copy.resize(m_now[m].size());
          checkPositions(m_ids[m], m_now[m], m_copy.data(), "", one,
                         asked ? m_before[m].data() : nullptr, &moved);
          if (asked) m_motion[m] = moved;
        }
      });
      spent += asked ? all : -all;
    }
    return spent;
  }
  std::vector<ElementPair> candidatesOf(const std::pair<std::size_t, std::size_t>& pair) {
    return m_detection.candidatePairs(m_ids[pair.first], m_ids[pair.second]);
  }
  /// The initial intersection check: its number of pairs, times the cost per candidate.
  double looks() {
    const std::size_t looked = m_detection.statistics().validityPairs;
    if (looked == 0) return 0;
    std::size_t candidates = 0;
    for (const auto& pair : m_scene.pairs) candidates += candidatesOf(pair).size();
    const double all = fastest([&] {
      for (const auto& pair : m_scene.pairs) {
        const TriangleMesh &a = m_meshes[pair.first], &b = m_meshes[pair.second];
        keepPossiblyIntersecting({a.topology.elements, a.before}, {b.topology.elements, b.before},
                                 &a == &b, candidatesOf(pair), m_possible);
      }
    });
    // A step may have no candidates although its start had some to look at.
    if (candidates > 0) m_millisecondsOfOne = all / static_cast<double>(candidates);
    return m_millisecondsOfOne * static_cast<double>(looked);
  }
  /// The additional work of the narrow phase: its time with validity, less its time without.
  double narrowPhase(const std::pair<std::size_t, std::size_t>& pair) {
    if (m_settings.continuous.earliestTimeOnly) return 0;
    const auto candidates = candidatesOf(pair);
    MeshPair plain{m_meshes[pair.first], m_meshes[pair.second], m_settings};
    MeshPair asked = plain;
    const double motion = largestMotion(m_motion[pair.first], m_motion[pair.second]);
    // As in the library: if the step is not known to start apart, there is no such work.
    const Validity& validity =
        m_detection.collisionData(m_ids[pair.first], m_ids[pair.second]).validity();
    if (m_settings.method == Method::Continuous ||
        (validity.startedApart && motion <= m_settings.thickness))
      asked.step.motion = motion;
    asked.step.motionWithRounding = motion * (1 + 1e-9);
    double least[2] = {std::numeric_limits<double>::infinity(),
                       std::numeric_limits<double>::infinity()};
    for (int turn = 0; turn < 10; ++turn) {
      const double start = now();
      m_buffers.clear();
      findContacts(turn % 2 ? asked : plain, candidates, m_buffers);
      least[turn % 2] = std::min(least[turn % 2], now() - start);
    }
    return least[1] - least[0];
  }

  const scenes::Scene& m_scene;
  PairSettings m_settings;
  OctreeBasedCD m_detection;
  std::vector<GeometryId> m_ids;
  Step m_before, m_now;
  std::deque<TriangleMesh> m_meshes;
  std::vector<MotionRange> m_motion;
  std::vector<Eigen::Vector3d> m_copy;
  ContactBuffers m_buffers;
  Buffer<PossibleIntersection> m_possible;
  double m_millisecondsOfOne = 0;  ///< of one candidate that is looked at, in the last such step
};

}  // namespace

void validityRows(Report& report, const RowOptions& options) {
  report.heading("Cost of validity() in a frame, ms; 1 thread");
  report.line({"", "frame", "validity", "percent"});
  std::vector<scenes::Scene> all = scenes::hardScenes();
  all.push_back(scenes::organs());
  all.push_back(restingSheets());
  for (const scenes::Scene& scene : all) {
    const double thickness = scene.thickness;
    const std::pair<const char*, PairSettings> settings[] = {
        {"Proximity", {.method = Method::Proximity, .thickness = thickness}},
        {"Continuous", {.method = Method::Continuous}},
        {"earliest", {.method = Method::Continuous, .continuous = {.earliestTimeOnly = true}}}};
    for (const auto& [name, ofPair] : settings) {
      ValidityCost cost(scene, ofPair);
      double whole = 0, validity = 0;
      for (int repetition = 0; repetition <= options.measure.repetitions; ++repetition)
        for (int frame = 0; frame <= kFrames; ++frame) {
          const auto spent = cost.next(scene.frames / 3 + frame);
          if (repetition == 0 || frame == 0) continue;  // a jump back in the motion
          whole += spent.whole / (kFrames * options.measure.repetitions);
          validity += spent.validity / (kFrames * options.measure.repetitions);
        }
      const double percent = 100 * validity / whole;
      report.line({scene.name + ", " + name, milliseconds(whole), milliseconds(validity),
                   milliseconds(percent)});
      report.row("validity", scene.name, 1, name, "frame ms", whole);
      report.row("validity", scene.name, 1, name, "validity ms", validity);
      report.row("validity", scene.name, 1, name, "percent", percent);
    }
  }
}

}  // namespace palpate::benchmark
