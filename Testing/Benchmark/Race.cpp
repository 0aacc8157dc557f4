// Times Palpate and the baselines on the same frames, in turns, in one process. Then it runs the
// other tables, most of Palpate alone. It prints tables and writes every figure as CSV.
#include "PalpateEngine.h"
#include "Rows.h"

#include <palpate/Executor.h>

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdio>
#include <utility>

using namespace palpate;
using namespace palpate::benchmark;

namespace {

using Engines = std::vector<std::unique_ptr<BroadPhase>>;

Engines makeEngines(const std::vector<std::string>& wanted) {
  Engines all;
  for (const PairOrder order : {PairOrder::Found, PairOrder::Sorted})
    for (const OctreeUpdate update : {OctreeUpdate::Auto, OctreeUpdate::Rebuild})
      all.push_back(makePalpate(update, order));
#ifdef PALPATE_BENCHMARK_BASELINES
  for (const auto make : {makeEmbreeRefit, makeEmbreeMorton, makeBullet, makeFcl, makeCgal})
    all.push_back(make());
#endif
  std::erase_if(all, [&](const auto& engine) { return !isWanted(engine->name(), wanted); });
  return all;
}

std::string setText(const SetCheck& check) {
  if (check.falseNegatives) return std::to_string(check.falseNegatives) + " FALSE NEG";
  return check.falsePositives ? std::to_string(check.falsePositives) + " false pos" : "exact";
}

bool isPalpate(const Entry& entry) { return entry.engine.starts_with("Palpate"); }

const Entry* find(const Outcome& outcome, const std::string& engine) {
  for (const Entry& entry : outcome.entries)
    if (entry.engine == engine) return &entry;
  return nullptr;
}

/// The time of the fastest baseline without false negatives over Palpate's. With `rebuilding`, only
/// baselines that rebuild count. 0 if there is none.
double againstBaselines(const Outcome& outcome, const Timing& palpate, bool rebuilding) {
  double least = 0;
  for (const Entry& entry : outcome.entries) {
    if (isPalpate(entry) || entry.check.falseNegatives > 0 || (rebuilding && !entry.rebuilds))
      continue;
    const double factor = ratio(entry.timing, palpate);
    if (least == 0 || factor < least) least = factor;
  }
  return least;
}

/// One line of the comparison: the time of the baseline over Palpate's, and the target.
void comparison(Report& report, const Workload& workload, const std::string& what, double factor,
                double target) {
  report.line({"  " + what, times(factor), "target " + times(target),
               factor >= target ? "met" : "NOT MET"});
  report.row("comparison", workload.name, workload.task.threads, what, "ratio", factor);
  report.row("comparison", workload.name, workload.task.threads, what, "target", target);
}

void comparisons(Report& report, const Workload& workload, const Outcome& outcome) {
  const Entry *shipped = find(outcome, "Palpate"),
              *rebuilt = find(outcome, "Palpate, full rebuild");
  const Entry* embree = find(outcome, "Embree 3.13, Morton rebuild + rtcCollide");
  if (!shipped || !rebuilt || againstBaselines(outcome, shipped->timing, false) == 0) return;
  const auto [a, b] = workload.task.pairs[0];
  comparison(report, workload, "as shipped, against the fastest baseline",
             againstBaselines(outcome, shipped->timing, false), a == b ? 2.5 : 1.3);
  if (embree)
    comparison(report, workload, "full rebuild: update against Embree's rebuild",
               embree->timing.update / rebuilt->timing.update, 4);
  if (const double factor = againstBaselines(outcome, rebuilt->timing, true); factor > 0)
    comparison(report, workload, "full rebuild, against rebuilding baselines", factor, 2);
  if (!workload.name.starts_with("sheets"))
    comparison(report, workload, "full rebuild, against the fastest baseline",
               againstBaselines(outcome, rebuilt->timing, false), 1);
}

void race(Report& report, const RowOptions& options, Workload& workload, int threads) {
  workload.task.threads = threads;
  const Engines engines = makeEngines(options.engines);
  const Outcome outcome = measure(workload, engines, options.measure);
  char heading[200];
  std::snprintf(heading, sizeof heading,
                "%s: %zu triangles, %.0f pairs (most %.0f), %zu frames, %d thread%s, hash %016lx",
                workload.name.c_str(), workload.triangles(), outcome.medianPairs, outcome.mostPairs,
                workload.frames.size(), threads, threads == 1 ? "" : "s", outcome.hash);
  report.heading(heading);
  report.line({"ms a frame", "median", "update", "pairs", "fastest", "worst", "ratio", "pair set"});
  for (const Entry& entry : outcome.entries) {
    const Timing& timing = entry.timing;
    const double against = ratio(timing, outcome.entries[0].timing);
    report.line({entry.engine, milliseconds(timing.total), milliseconds(timing.update),
                 milliseconds(timing.total - timing.update), milliseconds(timing.fastest),
                 milliseconds(timing.worst), times(against), setText(entry.check)});
    const auto row = [&](const char* metric, double value) {
      report.row("race", workload.name, threads, entry.engine, metric, value, outcome.hash);
    };
    row("median ms", timing.total);
    row("update ms", timing.update);
    row("fastest ms", timing.fastest);
    row("worst ms", timing.worst);
    row("ratio", against);
    row("false negatives", static_cast<double>(entry.check.falseNegatives));
    row("false positives", static_cast<double>(entry.check.falsePositives));
    row("widest false positive", entry.check.widestFalsePositive);
  }
  const auto triangles = static_cast<double>(workload.triangles());
  report.row("race", workload.name, threads, "scene", "triangles", triangles);
  report.row("race", workload.name, threads, "scene", "pairs", outcome.medianPairs);
  report.row("race", workload.name, threads, "scene", "most pairs", outcome.mostPairs);
  comparisons(report, workload, outcome);
}

void raceRows(Report& report, const RowOptions& options) {
  const std::vector<std::string> all = workloadNames(options.sharedData);
  for (const std::string& scene : options.scenes.empty() ? all : options.scenes) {
    Workload workload = makeWorkload(scene, options.frames, options.sharedData);
    for (const int threads : options.threads) race(report, options, workload, threads);
  }
}

/// In the order in which they run.
const std::vector<std::pair<std::string, void (*)(Report&, const RowOptions&)>> kTables = {
    {"race", raceRows},         {"stages", stageRows},          {"frame", wholeFrameRows},
    {"far", farTriangleRows},   {"rest", atRestRows},           {"tool", smallToolRows},
    {"scale", scaleRows},       {"steady", steadyRows},         {"features", featureRows},
    {"lines", lineRows},        {"shapes", shapeRows},          {"inside", insideRows},
    {"rigid", rigidRows},       {"fieldframe", fieldFrameRows}, {"proxy", proxyRows},
    {"coarse", coarseRows},     {"bounds", boundsRows},         {"continuous", continuousRows},
    {"validity", validityRows}, {"resting", restingRows},       {"freemotion", freeMotionRows},
    {"kept", keptRows},         {"options", optionRows},        {"cuts", cutRows},
    {"queries", spatialRows},   {"fields", fieldRows},          {"simd", simdRows}};

}  // namespace

int main(int count, char** arguments) {
  RowOptions options;
  options.sharedData = PALPATE_SHARED_DATA;
  std::vector<std::string> all;
  for (const auto& [name, rows] : kTables) all.push_back(name);
  std::vector<std::string> tables = all;
  std::string csv, commit = "unknown";
  CLI::App app{"Times Palpate and the baselines (Embree, Bullet, FCL, CGAL) on the same frames"};
  app.add_option("--tables", tables, "default: all, in this order")
      ->delimiter(',')
      ->check(CLI::IsMember(all));
  app.add_option(
         "--scenes", options.scenes,
         "scenes of the table race, parts of scenes of the tables bounds, queries and fields; "
         "default: all, but of fields without the bone of a million triangles")
      ->delimiter(',');
  app.add_option("--engines", options.engines, "parts of engines' names; default: all")
      ->delimiter(',');
  app.add_option("--threads", options.threads, "thread counts")->delimiter(',');
  app.add_option("--frames", options.frames, "frames of each scene; 0: by its size");
  app.add_option("--repetitions", options.measure.repetitions,
                 "repetitions of every engine, in turns");
  app.add_option("--seconds", options.measure.secondsPerEngine,
                 "time of one engine after which it gets no more repetitions");
  app.add_flag("--quick", options.quick, "at most a million triangles, fewer steady frames");
  app.add_flag_callback("--cpu-clock", useCpuClock,
                        "CPU time instead of wall time; for 1 thread on a busy machine");
  app.add_option("--csv", csv, "file to write");
  app.add_option("--commit", commit, "commit named in the report");
  app.add_option("--shared-data", options.sharedData, "folder of the published meshes and frames");
  CLI11_PARSE(app, count, arguments);

  Report report(csv, commit, simdPath());
  for (const auto& [name, rows] : kTables)
    if (std::find(tables.begin(), tables.end(), name) != tables.end()) rows(report, options);
}
