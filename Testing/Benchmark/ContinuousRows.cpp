// Continuous detection of the two published steps, from positions to times of impact, beside
// Embree on the same frame. The earliest time is compared with the faster engine of the IPC
// toolkit, all times with Tight-Inclusion on every candidate. These baselines were measured
// elsewhere on this class of machine. Their times are scaled by Embree's time here over its time
// there.
#include "Queries.h"
#include "Rows.h"

#include <palpate/OctreeBasedCD.h>

#include <algorithm>
#include <cstdio>
#include <memory>

namespace palpate::benchmark {
namespace {

/// Milliseconds by one thread and by two; 0: no figure.
struct Reference {
  const char* scene;
  double embree[2];     ///< rebuild + collide, as it is
  double earliest[2];   ///< IPC toolkit, whole step, Additive CCD, the faster of its two
  double everyTime[2];  ///< each candidate by Tight-Inclusion
};
constexpr Reference kReferences[] = {{"cloth-funnel", {15.8, 6.7}, {27, 20}, {0, 0}},
                                     {"rod-twist", {121, 60}, {679, 365}, {0, 11400}}};
constexpr double kTimesEarliest = 5, kTimesEveryTime = 20;

/// One published step, again and again.
class Step {
 public:
  Step(const Workload& workload, bool earliestTimeOnly, double thickness)
      : m_workload(workload), m_earliest(earliestTimeOnly), m_detection([&] {
          Settings settings;
          settings.threads = workload.task.threads;
          settings.octree.update = OctreeUpdate::Rebuild;
          return settings;
        }()) {
    PairSettings settings;
    settings.method = Method::Continuous;
    settings.contacts = Contacts::All;
    settings.continuous.earliestTimeOnly = earliestTimeOnly;
    settings.thickness = thickness;
    m_id = m_detection.addTriangleMesh(workload.frames[0][0], workload.task.meshes[0]);
    m_detection.addCollisionPair(m_id, m_id, settings);
  }

  /// Milliseconds from positions to contacts. It sets other positions first, so that these are new.
  double frame() {
    const auto &first = m_workload.frames[0][0], &second = m_workload.frames[1][0];
    m_detection.setPositions(m_id, second, first);
    m_detection.update();
    const double start = now();
    m_detection.setPositions(m_id, first, second);
    m_detection.detectCollision();
    return now() - start;
  }

  double found() const {
    const CollisionData& data = m_detection.collisionData(m_id, m_id);
    return m_earliest ? data.earliestTimeOfImpact()
                      : static_cast<double>(data.vertexTriangle().size() + data.edgeEdge().size());
  }
  const FrameStatistics& statistics() const { return m_detection.statistics(); }

 private:
  const Workload& m_workload;
  bool m_earliest;
  OctreeBasedCD m_detection;
  GeometryId m_id;
};

struct Kind {
  const char* name;
  bool earliestTimeOnly;
  double thickness;  ///< over the mean edge
};
constexpr Kind kKinds[] = {{"earliest time", true, 0},
                           {"all times", false, 0},
                           {"earliest time, thickness", true, 0.05},
                           {"all times, thickness", false, 0.05}};

/// Median milliseconds of each kind, and of Embree; in turns.
struct Medians {
  double kinds[std::size(kKinds)] = {}, narrow[std::size(kKinds)] = {},
         found[std::size(kKinds)] = {}, embree = 0;
};

Medians takeTurns(const Workload& workload, const MeasureOptions& options) {
  std::vector<std::unique_ptr<Step>> steps;
  // A workload's thickness is a tenth of the mean edge.
  for (const Kind& kind : kKinds)
    steps.push_back(std::make_unique<Step>(workload, kind.earliestTimeOnly,
                                           kind.thickness * 10 * workload.task.thickness));
  std::vector<double> times[std::size(kKinds)], narrow[std::size(kKinds)], embree;
#ifdef PALPATE_BENCHMARK_BASELINES
  const auto embreeRebuild = makeEmbreeMorton();
  embreeRebuild->prepare(workload.task, workload.frames[0]);
#endif
  for (int repetition = 0; repetition < 1 + options.repetitions; ++repetition) {
    for (std::size_t i = 0; i < steps.size(); ++i) {
      const double took = steps[i]->frame();
      if (repetition == 0) continue;
      times[i].push_back(took);
      narrow[i].push_back(steps[i]->statistics().milliseconds.narrowPhase);
    }
#ifdef PALPATE_BENCHMARK_BASELINES
    for (const Positions& frame : workload.frames) {
      const double start = now();
      embreeRebuild->update(frame);
      embreeRebuild->collide();
      if (repetition > 0) embree.push_back(now() - start);
    }
#endif
  }
  Medians medians;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    medians.kinds[i] = median(times[i]);
    medians.narrow[i] = median(narrow[i]);
    medians.found[i] = steps[i]->found();
  }
  medians.embree = median(embree);
  return medians;
}

void rowsOf(Report& report, const Reference& reference, const Workload& workload,
            const MeasureOptions& options) {
  const int threads = workload.task.threads;
  const Medians medians = takeTurns(workload, options);
  const std::string name = std::string(reference.scene) + ", " + std::to_string(threads) +
                           (threads == 1 ? " thread" : " threads");
  report.line({name + ", Embree", milliseconds(medians.embree)});
  report.row("continuous", reference.scene, threads, "Embree rebuild + collide", "ms",
             medians.embree);
  for (std::size_t i = 0; i < std::size(kKinds); ++i) {
    const Kind& kind = kKinds[i];
    const auto row = [&](const char* metric, double value) {
      report.row("continuous", reference.scene, threads, kind.name, metric, value);
    };
    row("ms", medians.kinds[i]);
    row("narrow phase ms", medians.narrow[i]);
    // The whole narrow phase, so that listing the candidates counts too.
    const double nanoseconds =
        1e6 * medians.narrow[i] / static_cast<double>(featureCandidates(workload));
    if (!kind.earliestTimeOnly && kind.thickness == 0) row("ns per feature candidate", nanoseconds);
    const bool earliest = kind.earliestTimeOnly;
    char found[32];
    std::snprintf(found, sizeof found, earliest ? "%.6f" : "%.0f", medians.found[i]);
    std::vector<std::string> cells = {name + ", " + kind.name, milliseconds(medians.kinds[i]),
                                      milliseconds(medians.narrow[i]), found,
                                      milliseconds(nanoseconds)};
    const int column = threads - 1;
    const double target = kind.thickness > 0 || column > 1 ? 0
                          : earliest ? reference.earliest[column] / kTimesEarliest
                                     : reference.everyTime[column] / kTimesEveryTime;
    if (target > 0 && medians.embree > 0) {
      const double scaled = target * medians.embree / reference.embree[column];
      row("target ms", scaled);
      row("speed-up over the target", scaled / medians.kinds[i]);
      cells.insert(cells.end(), {milliseconds(scaled), times(scaled / medians.kinds[i]),
                                 scaled >= medians.kinds[i] ? "met" : "NOT MET"});
    }
    report.line(cells);
  }
}

/// Published queries one by one, microseconds.
void queryRows(Report& report, const std::string& sharedData) {
  report.heading("Published continuous queries, microseconds per query; 1 thread");
  report.line({"", "queries", "mean", "median", "worst", "false neg.", "false pos."});
  for (const testing::PublishedQueries& set : publishedSets(sharedData)) {
    const QueryTimes times = timeQueries(set);
    report.line({set.name, std::to_string(set.queries.size()), milliseconds(times.mean),
                 milliseconds(times.median), milliseconds(times.worst),
                 std::to_string(times.falseNegatives), std::to_string(times.falsePositives)});
    const auto row = [&](const char* metric, double value) {
      report.row("queries", set.name, 1, "Palpate", metric, value);
    };
    row("queries", static_cast<double>(set.queries.size()));
    row("mean us", times.mean);
    row("median us", times.median);
    row("worst us", times.worst);
    row("false negatives", times.falseNegatives);
    row("false positives", times.falsePositives);
  }
}

}  // namespace

void continuousRows(Report& report, const RowOptions& options) {
  report.heading("Continuous, whole step of the published frames, octree rebuilt; ms");
  report.line({"", "median", "narrow", "found", "ns/candidate", "target", "speed-up"});
  const std::vector<std::string> names = workloadNames(options.sharedData);
  for (const Reference& reference : kReferences) {
    if (std::find(names.begin(), names.end(), reference.scene) == names.end()) continue;
    Workload workload = makeWorkload(reference.scene, 2, options.sharedData);
    for (const int threads : options.threads) {
      workload.task.threads = threads;
      rowsOf(report, reference, workload, options.measure);
    }
  }
  queryRows(report, options.sharedData);
}

}  // namespace palpate::benchmark
