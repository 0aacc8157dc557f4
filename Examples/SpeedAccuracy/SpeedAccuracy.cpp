// Measures the cost and the errors of each method on eight scenes, and of the methods for rigid
// bodies on three. Writes CSV files and interactive pages. Docs/Figures/speedAccuracy.py draws the
// printed chart from the CSV.
#include "Budgets.h"
#include "CommandLine.h"
#include "Contestant.h"
#include "HtmlReport.h"
#include "Reference.h"
#include "RigidBodies.h"
#include "Score.h"
#include "WriteFile.h"

#include <palpate/Error.h>

#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <numeric>

namespace {

using namespace palpate;
using namespace palpate::accuracy;
using report::Figures;

struct Options {
  std::filesystem::path out = "out";
  std::vector<std::string> scenes, methods;
  int frames = 24;
  int repetitions = 9;
  bool again = false;
  int budgetFrames = 0;
  RigidOptions rigid;
};

/// Times of each step at which the reference is checked.
constexpr int kFineSubsteps = 16;
/// Milliseconds a frame above which a method is timed once only.
constexpr double kSlow = 50;

Figures emptyFigures() {
  return {{"scene", "method", "setting"},
          {{"ms", "time (ms a frame, one thread)"},
           {"ms_low", "time, lower quartile (ms a frame)"},
           {"ms_high", "time, upper quartile (ms a frame)"},
           {"repetitions", "timed repetitions"},
           {"false_negatives", "false negatives (% of touching pairs)"},
           {"new_false_negatives", "false negatives among new contacts (%)"},
           {"false_positives", "false positives (% of reported pairs)"},
           {"distance_worst", "distance: worst error (% of the mean edge)"},
           {"distance_rms", "distance: RMS error (% of the mean edge)"},
           {"normal_worst", "normal: worst error (degrees)"},
           {"normal_rms", "normal: RMS error (degrees)"},
           {"time_worst", "time of impact: worst error (% of the step)"},
           {"time_rms", "time of impact: RMS error (% of the step)"},
           {"wrong_trusted", "answers wrong and trusted"},
           {"right_untrusted", "answers right and not trusted (%)"},
           {"contacts", "contacts reported a frame"},
           {"touching", "triangle pairs that touch a frame"}}};
}

Positions positionsAt(const scenes::Scene& scene, int frame) {
  Positions all(scene.meshes.size());
  for (std::size_t m = 0; m < all.size(); ++m) scene.positions(frame, m, all[m]);
  return all;
}

/// The reference of each frame of a scene, and the incidence of each of its meshes.
class SceneReference {
 public:
  SceneReference(const scenes::Scene& scene, int frames) : m_scene(scene) {
    for (const scenes::SceneMesh& mesh : scene.meshes) m_incidence.emplace_back(mesh.triangles);
    Positions before = positionsAt(scene, 0);
    for (int frame = 1; frame <= frames; ++frame) {
      std::fprintf(stderr, "%s: reference, frame %d of %d\n", scene.name.c_str(), frame, frames);
      const Positions now = positionsAt(scene, frame);
      std::vector<Reference>& pairs = m_frames.emplace_back();
      for (const auto& [a, b] : scene.pairs) {
        pairs.push_back(
            referenceOf({scene.meshes[a], scene.meshes[b], before[a], now[a], before[b], now[b]},
                        kFineSubsteps));
        if (pairs.back().contradictions > 0)
          throw scenes::BrokenPromise("Triangles intersect that do not touch by brute force.");
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
      for (const Reference& reference : pairs)
        count += static_cast<double>(reference.touching.size());
    return count / static_cast<double>(m_frames.size());
  }

 private:
  const scenes::Scene& m_scene;
  std::vector<Incidence> m_incidence;
  std::vector<std::vector<Reference>> m_frames;
};

/// Runs all frames once. Returns the mean milliseconds a frame. Judges the answers if `score` is
/// not null.
double runFrames(const scenes::Scene& scene, int frames, const SceneReference& reference, Run& run,
                 Score* score) {
  double milliseconds = 0;
  for (int frame = 1; frame <= frames; ++frame) {
    milliseconds += run.step(positionsAt(scene, frame));
    if (score) reference.judge(run, static_cast<std::size_t>(frame - 1), *score);
  }
  return milliseconds / frames;
}

double quantile(const std::vector<double>& sorted, double share) {
  return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1) + 0.5)];
}

/// The first pass through the frames judges the answers. The passes after it are timed. The time is
/// the median of the passes' means, with its quartiles. Slow methods have the first pass only.
Figures::Row measure(const scenes::Scene& scene, const SceneReference& reference,
                     const Contestant& method, const Options& options) {
  const std::unique_ptr<Run> run = method.run(scene, positionsAt(scene, 0));
  Score score;
  score.meanEdge = 20 * scene.thickness;
  std::vector<double> means{runFrames(scene, options.frames, reference, *run, &score)};
  const bool repeats = options.frames == scene.frames;  // the motion's end is its start
  if (repeats && !method.slow && means.front() < kSlow) {
    means.clear();
    for (int repetition = 0; repetition < options.repetitions; ++repetition)
      means.push_back(runFrames(scene, options.frames, reference, *run, nullptr));
  }
  std::sort(means.begin(), means.end());
  return {{scene.name, method.family, method.setting},
          {quantile(means, 0.5), quantile(means, 0.25), quantile(means, 0.75),
           static_cast<double>(means.size()), score.falseNegativesPercent(),
           score.newFalseNegativesPercent(), score.falsePositivesPercent(), score.distance.worst(),
           score.distance.rms(), score.normal.worst(), score.normal.rms(), score.time.worst(),
           score.time.rms(), static_cast<double>(score.wrongTrusted), score.rightUntrustedPercent(),
           static_cast<double>(score.claims) / options.frames, reference.touchingPerFrame()}};
}

bool isChosen(const std::vector<std::string>& choices, const std::string& name) {
  return choices.empty() || std::any_of(choices.begin(), choices.end(), [&](const auto& choice) {
           return name.find(choice) != std::string::npos;
         });
}

/// Measures each method on each scene, except rows that the CSV already has.
void measureAll(const Options& options, const std::filesystem::path& csv, Figures& figures) {
  const std::vector<Contestant> all = contestants();
  for (const scenes::Scene& scene : scenes::hardScenes()) {
    if (!isChosen(options.scenes, scene.name)) continue;
    std::vector<const Contestant*> missing;
    for (const Contestant& method : all)
      if (isChosen(options.methods, method.family) &&
          !figures.find(std::vector{scene.name, method.family, method.setting}))
        missing.push_back(&method);
    std::printf("%-18s %zu triangles, %zu methods, %zu of them measured already\n",
                scene.name.c_str(), scene.triangleCount(), all.size(), all.size() - missing.size());
    std::fflush(stdout);
    if (missing.empty()) continue;
    const SceneReference reference(scene, options.frames);
    for (const Contestant* method : missing) {
      figures.add(measure(scene, reference, *method, options));
      const std::vector<double>& values = figures.rows().back().values;
      const auto value = [&](const char* key) { return values[figures.indexOf(key)]; };
      std::printf("  %-26s %-24s %9.3f ms  %5.1f %% false negatives  %5.1f %% false positives\n",
                  method->family.c_str(), method->setting.c_str(), value("ms"),
                  value("false_negatives"), value("false_positives"));
      std::fflush(stdout);
      scenes::writeWhole(csv, figures.csv());
    }
  }
}

report::View view() {
  report::View view;
  view.title = "Palpate: speed against accuracy";
  view.paragraphs = {
      "Each mark is a method with one setting, on one scene. The horizontal axis shows the cost "
      "of a frame with one thread, from positions to contacts. It is the median over several "
      "passes through the frames; the bar spans the quartiles. The vertical axis shows an "
      "error. Low and left is better. The dashed line is the Pareto front: no other method is "
      "better in both. Point at a mark to read its figures.",
      "Reference: every vertex moves on a straight line within a step. Two triangles touch if "
      "they have a common point at any time of the step. Brute force over all features decides "
      "this exactly.",
      "False negatives: touching pairs of triangles that the method does not report. New "
      "contacts are pairs that do not intersect at the start of the step. Continuous reports "
      "new contacts only, by definition. False positives: reported pairs that do not touch. "
      "Proximity reports features within its thickness by definition, so its false positives "
      "are the price of the thickness.",
      "Errors of normals, distances and times are measured where the reported features touch "
      "within the step and come from a known side. Normal: the angle to the normal of the "
      "contact plane at the first touch. At 180 degrees the normal points to the wrong side. "
      "Distance: the difference to the gap along that normal, at the time of the contact. Time: "
      "the difference to the first touch; contacts without a time of impact count at the end of "
      "their step or substep. FCL reports pairs of triangles; the impact of the pair with the "
      "smallest error counts."};
  view.group = "scene";
  view.series = "method";
  view.label = "setting";
  view.first = "fast needle";
  view.x = "ms";
  view.xLow = "ms_low";
  view.xHigh = "ms_high";
  view.y = "false_negatives";
  view.front = true;
  return view;
}

/// No answer may be wrong and trusted.
void checkTrust(const Figures& figures) {
  for (const Figures::Row& row : figures.rows())
    if (row.values[figures.indexOf("wrong_trusted")] > 0)
      throw scenes::BrokenPromise(row.texts[0] + ", " + row.texts[1] + ", " + row.texts[2] +
                                  ": answers wrong and trusted.");
}

report::View rigidView() {
  report::View view;
  view.title = "Palpate: speed against accuracy at a rigid body";
  view.paragraphs = {
      "A tool, a deforming organ and particles touch a generated bone at rest. Each mark is a "
      "method with one setting. The reference is the exact signed distance of every vertex. A "
      "vertex inside the bone or within the thickness is a contact.",
      "The stated error is what the method says that its distances may be off by, the worst error "
      "is the largest that was seen. Proximity reports distances without a sign."};
  view.group = "scene";
  view.series = "method";
  view.label = "setting";
  view.x = "ms";
  view.y = "distance_worst";
  return view;
}

/// The same for the methods that replace the triangles of rigid bodies.
void runRigid(const Options& options) {
  const std::filesystem::path csv = options.out / "rigid-bodies.csv",
                              page = options.out / "rigid-bodies.html";
  Figures figures = emptyRigidFigures();
  if (!options.again) figures.addFrom(csv);
  measureRigidBodies(
      options.rigid,
      [&](const std::string& scene, const std::string& method) {
        return isChosen(options.scenes, scene) && isChosen(options.methods, method);
      },
      figures, [&] { scenes::writeWhole(csv, figures.csv()); });
  if (figures.rows().empty()) return;
  scenes::writeWhole(page, toHtml(figures, rigidView()));
  std::printf("figures   %s\npage      %s\n", csv.c_str(), page.c_str());
}

/// Contacts that a detection misses within a budget.
void runBudgets(const Options& options) {
  const std::filesystem::path csv = options.out / "budgets.csv";
  Figures figures = emptyBudgetFigures();
  measureBudgets(options.budgetFrames, figures);
  scenes::writeWhole(csv, figures.csv());
  std::printf("figures   %s\n", csv.c_str());
}

/// Each choice is part of the name of a scene or a method.
void checkNames(const Options& options) {
  std::vector<std::string> names, families;
  for (const scenes::Scene& scene : scenes::hardScenes()) names.push_back(scene.name);
  for (const Contestant& method : contestants()) families.push_back(method.family);
  for (const auto& [scene, method] : rigidRows()) {
    names.push_back(scene);
    families.push_back(method);
  }
  scenes::checkChoices(options.scenes, names, "scene");
  scenes::checkChoices(options.methods, families, "method");
}

void run(const Options& options) {
  checkNames(options);
  std::filesystem::create_directories(options.out);
  const std::filesystem::path csv = options.out / "speed-accuracy.csv",
                              page = options.out / "report.html";
  Figures figures = emptyFigures();
  if (!options.again) figures.addFrom(csv);
  measureAll(options, csv, figures);
  scenes::writeWhole(page, toHtml(figures, view()));
  checkTrust(figures);
  std::printf("figures   %s\npage      %s\n", csv.c_str(), page.c_str());
  runRigid(options);
  if (options.budgetFrames > 0) runBudgets(options);
}

Options parse(CLI::App& app, int count, char** arguments) {
  Options options;
  app.add_option("--out", options.out, "folder for speed-accuracy.csv and report.html")
      ->capture_default_str();
  app.add_option("--scenes", options.scenes, "only scenes with one of these words in their name")
      ->delimiter(',');
  app.add_option("--methods", options.methods, "only methods with one of these words in their name")
      ->delimiter(',');
  app.add_option("--frames", options.frames, "frames of each scene; the motion repeats after 24")
      ->check(scenes::between(1, 24))
      ->capture_default_str();
  app.add_option("--repetitions", options.repetitions, "timed passes through the 24 frames")
      ->check(scenes::between(1, 1000))
      ->capture_default_str();
  app.add_option("--bone", options.rigid.triangles, "triangles of the bone, about")
      ->check(scenes::between(1000, 10'000'000))
      ->capture_default_str();
  app.add_option("--particles", options.rigid.particles, "particles at the bone")
      ->check(scenes::between(1, 10'000'000))
      ->capture_default_str();
  app.add_option("--budget-frames", options.budgetFrames,
                 "frames of the organs within budgets, for budgets.csv")
      ->check(scenes::between(0, 10'000))
      ->capture_default_str();
  app.add_flag("--again", options.again, "measure also rows that the CSV already has");
  app.parse(count, arguments);
  return options;
}

}  // namespace

int main(int count, char** arguments) {
  CLI::App app("Cost and errors of each method on eight scenes.", "SpeedAccuracy");
  return scenes::exitCodeOf(app, [&] {
    run(parse(app, count, arguments));
    return true;
  });
}
