// What each method costs a frame and what it gets wrong, on scenes each of which some method gets
// wrong: as CSV, as a page to explore, and as a picture.
#ifdef PALPATE_HAS_CHARTS
#include "Chart.h"
#endif
#include "CommandLine.h"
#include "HtmlReport.h"
#include "Contestant.h"
#include "WriteFile.h"
#include "Score.h"
#include "Truth.h"

#include <palpate/Error.h>

#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <numeric>

namespace {

using namespace palpate;
using namespace palpate::accuracy;
using report::Figures;

struct Options {
  std::filesystem::path out = "out";
  std::vector<std::string> scenes, methods;
  std::string pictured = "fast needle";
  int frames = 24;
  int repetitions = 5;
  bool again = false;
};

/// At how many times of each step the truth is looked at a second time.
constexpr int kFineSubsteps = 16;

Figures emptyFigures() {
  return {{"scene", "method", "setting"},
          {{"ms", "milliseconds a frame"},
           {"missed", "contacts missed (%)"},
           {"new_missed", "new contacts missed (%)"},
           {"invented", "contacts invented (%)"},
           {"distance_worst", "distance: worst error (% of the mean edge)"},
           {"distance_rms", "distance: RMS error (% of the mean edge)"},
           {"normal_worst", "normal: worst error (degrees)"},
           {"normal_rms", "normal: RMS error (degrees)"},
           {"time_worst", "time of impact: worst error (% of the step)"},
           {"time_rms", "time of impact: RMS error (% of the step)"},
           {"silent", "answers wrong and trusted"},
           {"alarms", "answers right and not trusted (%)"},
           {"claims", "contacts reported a frame"},
           {"touching", "triangle pairs that touch a frame"}}};
}

Positions positionsAt(const scenes::Scene& scene, int frame) {
  Positions all(scene.meshes.size());
  for (std::size_t m = 0; m < all.size(); ++m) scene.positions(frame, m, all[m]);
  return all;
}

/// What happens in a scene's frames, and with whom each triangle of a mesh has its corners in
/// common.
class SceneTruth {
 public:
  SceneTruth(const scenes::Scene& scene, int frames) : m_scene(scene) {
    for (const scenes::SceneMesh& mesh : scene.meshes) m_incidence.emplace_back(mesh.triangles);
    Positions before = positionsAt(scene, 0);
    for (int frame = 1; frame <= frames; ++frame) {
      std::fprintf(stderr, "%s: what really happens, frame %d of %d\n", scene.name.c_str(), frame,
                   frames);
      const Positions now = positionsAt(scene, frame);
      std::vector<Truth>& pairs = m_frames.emplace_back();
      for (const auto& [a, b] : scene.pairs) {
        pairs.push_back(
            truthOf({scene.meshes[a], scene.meshes[b], before[a], now[a], before[b], now[b]},
                    kFineSubsteps));
        if (pairs.back().contradictions > 0)
          throw Error(ErrorCode::NotAvailable, "Triangles intersect that brute force says do not.");
      }
      before = now;
    }
  }

  void judge(const Run& run, std::size_t frame, Score& score) const {
    for (std::size_t p = 0; p < m_scene.pairs.size(); ++p)
      score.add(m_frames[frame][p], run.claims(p), m_incidence[m_scene.pairs[p].first],
                m_incidence[m_scene.pairs[p].second]);
  }
  double touchingPerFrame() const {
    double count = 0;
    for (const auto& pairs : m_frames)
      for (const Truth& truth : pairs) count += static_cast<double>(truth.touching.size());
    return count / static_cast<double>(m_frames.size());
  }

 private:
  const scenes::Scene& m_scene;
  std::vector<Incidence> m_incidence;
  std::vector<std::vector<Truth>> m_frames;
};

/// Goes through the frames several times: of each frame the fastest time counts, of these the
/// mean.
Figures::Row measure(const scenes::Scene& scene, const SceneTruth& truth, const Contestant& method,
                     const Options& options) {
  const std::unique_ptr<Run> run = method.run(scene, positionsAt(scene, 0));
  Score score;
  score.meanEdge = 20 * scene.thickness;
  std::vector<double> fastest(static_cast<std::size_t>(options.frames),
                              std::numeric_limits<double>::infinity());
  const int repetitions = method.slow || options.frames != scene.frames ? 1 : options.repetitions;
  for (int repetition = 0; repetition < repetitions; ++repetition)
    for (int frame = 1; frame <= options.frames; ++frame) {
      double& least = fastest[static_cast<std::size_t>(frame - 1)];
      least = std::min(least, run->step(positionsAt(scene, frame)));
      if (repetition == 0) truth.judge(*run, static_cast<std::size_t>(frame - 1), score);
    }
  return {
      {scene.name, method.family, method.setting},
      {std::accumulate(fastest.begin(), fastest.end(), 0.0) / options.frames, score.missedPercent(),
       score.newMissedPercent(), score.inventedPercent(), score.distance.worst(),
       score.distance.rms(), score.normal.worst(), score.normal.rms(), score.time.worst(),
       score.time.rms(), static_cast<double>(score.silentFailures), score.falseAlarmsPercent(),
       static_cast<double>(score.claims) / options.frames, truth.touchingPerFrame()}};
}

bool isChosen(const std::vector<std::string>& choices, const std::string& name) {
  return choices.empty() || std::any_of(choices.begin(), choices.end(), [&](const auto& choice) {
           return name.find(choice) != std::string::npos;
         });
}

/// Each scene with each method; what the CSV has already is not measured again.
void measureAll(const Options& options, const std::filesystem::path& csv, Figures& figures) {
  const std::vector<Contestant> all = contestants();
  for (const scenes::Scene& scene : scenes::hardScenes()) {
    if (!isChosen(options.scenes, scene.name)) continue;
    std::vector<const Contestant*> missing;
    for (const Contestant& method : all)
      if (isChosen(options.methods, method.family) &&
          !figures.find(std::vector{scene.name, method.family, method.setting}))
        missing.push_back(&method);
    std::printf("%-18s %zu triangles, %zu methods, %zu of them measured before\n",
                scene.name.c_str(), scene.triangleCount(), all.size(), all.size() - missing.size());
    std::fflush(stdout);
    if (missing.empty()) continue;
    const SceneTruth truth(scene, options.frames);
    for (const Contestant* method : missing) {
      figures.add(measure(scene, truth, *method, options));
      const std::vector<double>& values = figures.rows().back().values;
      std::printf("  %-22s %-24s %9.3f ms  %5.1f %% missed  %5.1f %% invented\n",
                  method->family.c_str(), method->setting.c_str(), values[0], values[1], values[3]);
      std::fflush(stdout);
      scenes::writeWhole(csv, figures.csv());
    }
  }
}

report::View view(const Options& options) {
  report::View view;
  view.title = "Palpate: speed against accuracy";
  view.paragraphs = {
      "Each point is a method with its setting on one scene. Across: what a frame costs, one "
      "thread, positions in to "
      "contacts out; the mean over the frames of the fastest of several repetitions. Up: what is "
      "wrong with the answer. "
      "Down and to the left is better; the dashed front joins what nothing else beats in both. "
      "Point at a mark for its figures.",
      "Truth: every vertex moves on a straight line within a frame. Two triangles touch if they "
      "have a point in common at any "
      "time of the frame, start and end included; brute force over all features decides that "
      "exactly. Missed: of the pairs "
      "that touch, those not reported. New: of the pairs that were apart at the frame's start; "
      "Continuous speaks of these, and not again of what "
      "intersects already. Invented: of the pairs reported, those that do not touch; "
      "for Proximity, which is asked "
      "for what is near, that is the price of its thickness and no fault.",
      "Errors are judged where features that a method reports do touch within the frame, coming "
      "from a side that can be told. "
      "Normal: against the plane of contact at the first touch, on the side they came from, so "
      "that 180 degrees pushes the "
      "wrong way. Distance: against the gap along that normal between the points that touch, at "
      "the time the method speaks "
      "of, negative once they have passed through. Time: against the first touch; methods without "
      "one speak of the time at "
      "which they looked. FCL speaks of triangles, not features: the kindest of a pair's truths "
      "counts."};
  view.group = "scene";
  view.series = "method";
  view.label = "setting";
  view.first = options.pictured;
  view.x = "ms";
  view.y = "missed";
  view.front = true;
  return view;
}

#ifdef PALPATE_HAS_CHARTS
report::Charts charts(const std::string& scene) {
  const auto diagram = [&](const std::string& title, const std::string& y) {
    return report::Diagram{.title = title,
                           .group = "scene",
                           .value = scene,
                           .series = "method",
                           .x = "ms",
                           .y = y,
                           .front = true};
  };
  return {
      {diagram(scene + ": contacts missed", "missed"), diagram(scene + ": normals", "normal_rms")},
      2};
}
#endif

/// No answer may be wrong and trusted.
void checkTrust(const Figures& figures) {
  for (const Figures::Row& row : figures.rows())
    if (row.values[figures.indexOf("silent")] > 0)
      throw Error(ErrorCode::NotAvailable, row.texts[0] + ", " + row.texts[1] + ", " +
                                               row.texts[2] + ": answers wrong and trusted.");
}

void run(const Options& options) {
  std::filesystem::create_directories(options.out);
  const std::filesystem::path csv = options.out / "speed-accuracy.csv",
                              page = options.out / "report.html";
  Figures figures = emptyFigures();
  if (!options.again) figures.addFrom(csv);
  measureAll(options, csv, figures);
  scenes::writeWhole(page, toHtml(figures, view(options)));
  checkTrust(figures);
  std::printf("figures   %s\npage      %s\n", csv.c_str(), page.c_str());
#ifdef PALPATE_HAS_CHARTS
  const auto files = draw(figures, charts(options.pictured), options.out / "speed-accuracy");
  for (const auto& file : files) std::printf("picture   %s\n", file.c_str());
  if (files.empty()) std::printf("no picture: no display; run under xvfb-run -a\n");
#else
  std::printf("no picture: built without VTK\n");
#endif
}

Options parse(CLI::App& app, int count, char** arguments) {
  Options options;
  app.add_option("--out", options.out, "folder for speed-accuracy.csv, .png, .svg and report.html")
      ->capture_default_str();
  app.add_option("--scenes", options.scenes, "only scenes with one of these words in their name")
      ->delimiter(',');
  app.add_option("--methods", options.methods, "only methods with one of these words in their name")
      ->delimiter(',');
  app.add_option("--picture", options.pictured, "the scene of the picture")->capture_default_str();
  app.add_option("--frames", options.frames, "the scenes' motion repeats after 24")
      ->check(CLI::Range(1, 24))
      ->capture_default_str();
  app.add_option("--repetitions", options.repetitions, "passes through the frames")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_flag("--again", options.again, "measure also what the CSV has already");
  app.parse(count, arguments);
  return options;
}

}  // namespace

int main(int count, char** arguments) {
  CLI::App app("What methods cost and what they get wrong.", "SpeedAccuracy");
  return scenes::exitCodeOf(app, [&] { run(parse(app, count, arguments)); });
}
