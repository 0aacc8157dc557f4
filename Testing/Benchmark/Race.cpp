// The race: Palpate and its peers over the same frames, in turns, in one process; then what is
// measured of Palpate alone. Prints tables and writes every figure as CSV.
#include "PalpateEngine.h"
#include "Rows.h"

#include <palpate/Platform.h>

#include <CLI/CLI.hpp>

#include <cstdio>
#include <map>

using namespace palpate;
using namespace palpate::benchmark;

namespace {

struct Options {
  std::vector<std::string> scenes, engines, tables;
  std::string csv, commit = "unknown";
  RowOptions rows;
};

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
  if (wanted.empty()) return all;
  Engines chosen;
  for (auto& engine : all) {
    const std::string name = engine->name();
    if (std::any_of(wanted.begin(), wanted.end(),
                    [&](const auto& part) { return name.find(part) != std::string::npos; }))
      chosen.push_back(std::move(engine));
  }
  return chosen;
}

std::string setText(const SetCheck& check) {
  if (check.missed) return "MISSES " + std::to_string(check.missed);
  return check.extra ? "all +" + std::to_string(check.extra) : "exact";
}

bool isPalpate(const Entry& entry) { return entry.engine.starts_with("Palpate"); }

const Entry* find(const Outcome& outcome, const std::string& engine) {
  for (const Entry& entry : outcome.entries)
    if (entry.engine == engine) return &entry;
  return nullptr;
}

/// Against the complete peer that comes nearest; of those that rebuild, if asked for. 0: there is
/// none.
double againstBaselines(const Outcome& outcome, const Timing& palpate, bool rebuilding) {
  double least = 0;
  for (const Entry& entry : outcome.entries) {
    if (isPalpate(entry) || entry.check.missed > 0 || (rebuilding && !entry.rebuilds)) continue;
    const double factor = ratio(entry.timing, palpate);
    if (least == 0 || factor < least) least = factor;
  }
  return least;
}

/// One line of the verdict: how many times as long the peer takes, and how many are asked for.
void verdict(Report& report, const Workload& workload, const std::string& what, double factor,
             double limit) {
  report.line(
      {"  " + what, times(factor), "of " + times(limit), factor >= limit ? "holds" : "SHORT"});
  report.row("verdict", workload.name, workload.task.threads, what, "ratio", factor);
  report.row("verdict", workload.name, workload.task.threads, what, "limit", limit);
}

void verdicts(Report& report, const Workload& workload, const Outcome& outcome) {
  const Entry *shipped = find(outcome, "Palpate"),
              *rebuilt = find(outcome, "Palpate, full rebuild");
  const Entry* embree = find(outcome, "Embree 3.13, Morton rebuild + rtcCollide");
  if (!shipped || !rebuilt || againstBaselines(outcome, shipped->timing, false) == 0) return;
  const auto [a, b] = workload.task.pairs[0];
  verdict(report, workload, "as shipped, against the fastest peer",
          againstBaselines(outcome, shipped->timing, false), a == b ? 2.5 : 1.3);
  if (embree)
    verdict(report, workload, "full rebuild: update against Embree's rebuild",
            embree->timing.update / rebuilt->timing.update, 4);
  if (const double factor = againstBaselines(outcome, rebuilt->timing, true); factor > 0)
    verdict(report, workload, "full rebuild, against rebuilding peers", factor, 2);
  if (!workload.name.starts_with("sheets"))
    verdict(report, workload, "full rebuild, against the fastest peer",
            againstBaselines(outcome, rebuilt->timing, false), 1);
}

void race(Report& report, const Options& options, Workload& workload, int threads) {
  workload.task.threads = threads;
  const Engines engines = makeEngines(options.engines);
  const Outcome outcome = measure(workload, engines, options.rows.measure);
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
    row("missed", static_cast<double>(entry.check.missed));
    row("extra", static_cast<double>(entry.check.extra));
    row("widest extra", entry.check.widestExtra);
  }
  const auto triangles = static_cast<double>(workload.triangles());
  report.row("race", workload.name, threads, "scene", "triangles", triangles);
  report.row("race", workload.name, threads, "scene", "pairs", outcome.medianPairs);
  report.row("race", workload.name, threads, "scene", "most pairs", outcome.mostPairs);
  verdicts(report, workload, outcome);
}

void raceRows(Report& report, const Options& options) {
  for (const std::string& scene : options.scenes) {
    Workload workload = makeWorkload(scene, options.rows.frames, options.rows.sharedData);
    for (const int threads : options.rows.threads) race(report, options, workload, threads);
  }
}

}  // namespace

int main(int count, char** arguments) {
  Options options;
  options.rows.sharedData = PALPATE_SHARED_DATA;
  options.tables = {"race",  "stages",     "frame",    "far",   "still",  "pay",
                    "scale", "steady",     "features", "lines", "shapes", "inside",
                    "rigid", "continuous", "validity", "simd"};
  MeasureOptions& measure = options.rows.measure;
  CLI::App app{"Palpate and its peers, side by side in one run"};
  app.add_option("--tables", options.tables,
                 "some of race, stages, frame, far, still, pay, scale, "
                 "steady, features, lines, shapes, inside, rigid, continuous, validity, simd")
      ->delimiter(',')
      ->check(CLI::IsMember(options.tables));
  app.add_option("--scenes", options.scenes, "of the race; default: all")->delimiter(',');
  app.add_option("--engines", options.engines, "parts of engines' names; default: all")
      ->delimiter(',');
  app.add_option("--threads", options.rows.threads, "thread counts")->delimiter(',');
  app.add_option("--frames", options.rows.frames, "of each scene; 0: by its size");
  app.add_option("--repetitions", measure.repetitions, "of every engine, in turns");
  app.add_option("--seconds", measure.secondsPerEngine, "after so long, no more repetitions");
  app.add_flag("--quick", options.rows.quick, "no four million triangles, fewer steady frames");
  app.add_flag_callback("--cpu-clock", useCpuClock,
                        "time on processors; for 1 thread on a busy machine");
  app.add_option("--csv", options.csv, "file to write");
  app.add_option("--commit", options.commit, "to be named in the report");
  app.add_option("--shared-data", options.rows.sharedData, "folder of the published frames");
  CLI11_PARSE(app, count, arguments);
  if (options.scenes.empty()) options.scenes = workloadNames(options.rows.sharedData);

  Report report(options.csv, options.commit, simdPath());
  const std::map<std::string, void (*)(Report&, const RowOptions&)> tables = {
      {"stages", stageRows},          {"frame", wholeFrameRows},  {"far", farFlungRows},
      {"still", stillRows},           {"pay", payRows},           {"scale", scaleRows},
      {"steady", steadyRows},         {"features", featureRows},  {"lines", lineRows},
      {"shapes", shapeRows},          {"inside", insideRows},     {"rigid", rigidRows},
      {"continuous", continuousRows}, {"validity", validityRows}, {"simd", simdRows}};
  for (const std::string& table : options.tables) {
    if (table == "race")
      raceRows(report, options);
    else
      tables.at(table)(report, options.rows);
  }
}
