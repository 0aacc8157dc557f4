// The race: Palpate and its peers over the same frames, in turns, in one process.
#include "Measure.h"
#include "Report.h"

#include <CLI/CLI.hpp>

#include <thread>

using namespace palpate::benchmark;

namespace {

struct Options {
  std::vector<std::string> scenes;
  std::vector<int> threads = {1, 2};
  std::size_t frames = 0;
  MeasureOptions measure;
  std::string csv, commit = "unknown", sharedData = PALPATE_SHARED_DATA;
  std::vector<std::string> engines;
};

std::vector<std::unique_ptr<Peer>> makeEngines(const std::vector<std::string>& wanted) {
  std::vector<std::unique_ptr<Peer>> all;
#ifdef PALPATE_BENCHMARK_PEERS
  all.push_back(makeEmbreeRefit());
  all.push_back(makeEmbreeMorton());
  all.push_back(makeBullet());
  all.push_back(makeFcl());
  all.push_back(makeCgal());
#endif
  if (wanted.empty()) return all;
  std::vector<std::unique_ptr<Peer>> chosen;
  for (auto& engine : all)
    for (const std::string& name : wanted)
      if (engine && engine->name().find(name) != std::string::npos)
        chosen.push_back(std::move(engine));
  return chosen;
}

std::string setText(const SetCheck& check) {
  if (check.equal()) return "exact";
  std::string text = check.missed ? "MISSES " + std::to_string(check.missed) : "complete";
  if (check.extra) text += " +" + std::to_string(check.extra);
  return text;
}

void race(Report& report, const Options& options, Workload& workload, int threads) {
  workload.task.threads = threads;
  const auto engines = makeEngines(options.engines);
  const Outcome outcome = measure(workload, engines, options.measure);
  char heading[200];
  std::snprintf(heading, sizeof heading,
                "%s: %zu triangles, %.0f pairs (most %.0f), %zu frames, %d thread%s, hash %016lx",
                workload.name.c_str(), workload.triangles(), outcome.medianPairs, outcome.mostPairs,
                workload.frames.size(), threads, threads == 1 ? "" : "s", outcome.hash);
  report.heading(heading);
  report.line({"ms a frame", "median", "update", "pairs", "worst", "ratio", "pair set"});
  for (const Entry& entry : outcome.entries) {
    const double against = ratio(entry, outcome.entries[0]);
    report.line({entry.engine, milliseconds(entry.total), milliseconds(entry.update),
                 milliseconds(entry.total - entry.update), milliseconds(entry.worst),
                 times(against), setText(entry.check)});
    const auto row = [&](const char* metric, double value) {
      report.row("race", workload.name, threads, entry.engine, metric, value, outcome.hash);
    };
    row("median ms", entry.total);
    row("update ms", entry.update);
    row("fastest ms", entry.fastest);
    row("worst ms", entry.worst);
    row("ratio", against);
    row("missed", static_cast<double>(entry.check.missed));
    row("extra", static_cast<double>(entry.check.extra));
    row("widest extra", entry.check.widestExtra);
  }
  report.row("race", workload.name, threads, "scene", "triangles",
             static_cast<double>(workload.triangles()));
  report.row("race", workload.name, threads, "scene", "pairs", outcome.medianPairs);
}

}  // namespace

int main(int count, char** arguments) {
  Options options;
  CLI::App app{"Palpate and its peers, side by side in one run"};
  app.add_option("--scenes", options.scenes, "which scenes; default: all")->delimiter(',');
  app.add_option("--threads", options.threads, "thread counts")->delimiter(',');
  app.add_option("--frames", options.frames, "frames of each scene; 0: by its size");
  app.add_option("--repetitions", options.measure.repetitions, "of every engine, in turns");
  app.add_option("--seconds", options.measure.secondsPerEngine,
                 "no more repetitions of an engine after so long");
  app.add_option("--engines", options.engines, "parts of names of engines; default: all")
      ->delimiter(',');
  app.add_option("--csv", options.csv, "file to write");
  app.add_option("--commit", options.commit, "to be named in the report");
  app.add_option("--shared-data", options.sharedData, "published frames");
  CLI11_PARSE(app, count, arguments);
  if (options.scenes.empty()) options.scenes = workloadNames(options.sharedData);
  Report report(options.csv, options.commit, "unknown");
  for (const std::string& scene : options.scenes) {
    Workload workload = makeWorkload(scene, options.frames, options.sharedData);
    for (const int threads : options.threads) race(report, options, workload, threads);
  }
}
