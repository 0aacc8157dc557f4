// Sweeps of two triangles that meet. Each sweep makes one property more difficult, and the program
// counts the errors of each method. It fails if a result is not finite or violates the definition
// of its method. Docs/Figures/stability.py draws the chart from the CSV.
#include "CommandLine.h"
#include "HtmlReport.h"
#include "Tally.h"
#include "WriteFile.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <stdexcept>

namespace {

using namespace palpate;
using namespace palpate::stability;

struct Options {
  std::filesystem::path out;
  std::vector<std::string> sweeps;
  std::size_t cases = 200;
  int steps = 5;
  bool redraw = false;
};

report::Figures emptyFigures() {
  return {{"sweep", "quantity", "method", "setting"},
          {{"difficulty", "difficulty (value of the quantity)"},
           {"failed", "false negatives and false positives (% of cases)"},
           {"false_negatives", "false negatives (% of cases)"},
           {"false_positives", "false positives (% of cases)"},
           {"wrong_side", "normal on the wrong side (% of cases)"},
           {"turned_by_noise", "normal turned by noise of 1e-7 (% of cases)"},
           {"not_finite", "contacts not finite"},
           {"not_unit", "contacts whose normal does not have unit length"},
           {"against_definition", "feature pairs against the method's definition"},
           {"wrong_trusted", "answers wrong and trusted"},
           {"wrong", "impact missing or normal on the wrong side (% of answers)"},
           {"right_untrusted", "answers right and not trusted (%)"},
           {"us", "microseconds a case"}}};
}

/// At most `most` of the values, evenly spaced from the first to the last.
std::vector<double> chosen(const std::vector<double>& values, int most) {
  const std::size_t count = std::min(values.size(), static_cast<std::size_t>(most));
  std::vector<double> some;
  for (std::size_t i = 0; i < count; ++i)
    some.push_back(values[(values.size() - 1) * i / (count - 1)]);
  return some;
}

double percent(std::size_t part, const Tally& tally) {
  return 100.0 * static_cast<double>(part) / static_cast<double>(tally.cases);
}

double percentOfAnswers(std::size_t part, const Tally& tally) {
  return tally.answers == 0
             ? std::numeric_limits<double>::quiet_NaN()
             : 100.0 * static_cast<double>(part) / static_cast<double>(tally.answers);
}

report::Figures::Row rowOf(const Sweep& sweep, double value, const Subject& subject,
                           const Tally& tally) {
  const auto count = [](std::size_t n) { return static_cast<double>(n); };
  return {
      {sweep.name, sweep.quantity, subject.contestant.family, subject.contestant.setting},
      {value, percent(tally.falseNegatives + tally.falsePositives, tally),
       percent(tally.falseNegatives, tally), percent(tally.falsePositives, tally),
       percent(tally.wrongSide, tally), percent(tally.turnedByNoise, tally), count(tally.notFinite),
       count(tally.notUnit), count(tally.featuresMissing + tally.featuresExtra + tally.untimely),
       count(tally.wrongTrusted), percentOfAnswers(tally.wrong, tally),
       percentOfAnswers(tally.rightUntrusted, tally),
       1000 * tally.milliseconds / count(tally.cases)}};
}

/// Prints and counts faults, which must not occur.
int faultsOf(const Sweep& sweep, double value, const Subject& subject, const Tally& tally) {
  int faults = 0;
  const auto expectNone = [&](std::size_t count, const char* what) {
    if (count == 0) return;
    ++faults;
    std::printf("FAULT %s at %g, %s: %zu %s\n", sweep.name.c_str(), value,
                subject.contestant.family.c_str(), count, what);
  };
  if (subject.contestant.family == "FCL") return 0;
  expectNone(tally.wrongTrusted, "answers wrong and trusted");
  expectNone(tally.notFinite, "contacts not finite");
  expectNone(tally.notUnit, "normals without unit length");
  expectNone(tally.featuresMissing, "feature pairs missing by the method's definition");
  expectNone(tally.featuresExtra, "feature pairs beyond the method's definition");
  expectNone(tally.untimely, "times of impact late, or early by more than 1e-6");
  if (subject.definition != Definition::Continuous) return faults;
  expectNone(tally.wrongSide, "normals of Continuous on the wrong side");
  if (!sweep.startsInside)
    expectNone(tally.falseNegativesNew + tally.falsePositives, "false answers of Continuous");
  return faults;
}

int measure(const Options& options, report::Figures& figures) {
  int faults = 0;
  const std::vector<Subject> all = subjects();
  for (const Sweep& sweep : sweeps()) {
    if (!options.sweeps.empty() &&
        std::find(options.sweeps.begin(), options.sweeps.end(), sweep.name) == options.sweeps.end())
      continue;
    std::printf("%s\n%-10s", sweep.name.c_str(), "");
    for (const Subject& subject : all) std::printf(" %21s", subject.contestant.family.c_str());
    std::printf("\n");
    for (const double value : chosen(sweep.values, options.steps)) {
      const std::vector<Tally> tallies = runStep(sweep, value, options.cases, all);
      std::printf("%-10.3g", value);
      for (std::size_t s = 0; s < all.size(); ++s)
        std::printf(" %5.1f / %5.1f %7.1f us",
                    percent(tallies[s].falseNegatives + tallies[s].falsePositives, tallies[s]),
                    percent(tallies[s].wrongSide, tallies[s]),
                    1000 * tallies[s].milliseconds / static_cast<double>(tallies[s].cases));
      std::printf("\n");
      for (std::size_t s = 0; s < all.size(); ++s) {
        faults += faultsOf(sweep, value, all[s], tallies[s]);
        figures.add(rowOf(sweep, value, all[s], tallies[s]));
      }
      std::fflush(stdout);
    }
  }
  return faults;
}

report::View view() {
  report::View view;
  view.title = "Palpate: where each method starts to fail";
  view.paragraphs = {
      "Two triangles meet within a step, in many random cases. Each sweep makes one property of "
      "the cases more difficult from step to step. The reference is decided in rational "
      "arithmetic that shares no code with the library.",
      "Cases: a case is a false negative if the two triangles touch at any time of the step, "
      "also if they intersect throughout, and the method reports nothing. It is a false "
      "positive if the triangles do not touch and the method reports that they do. A normal is "
      "on the wrong side if it points to the side that its features did not come from.",
      "Answers: an impact is a pair of features, vertex and triangle or two edges, that touch "
      "within the step. An answer is wrong if an impact is missing or a normal is on the wrong "
      "side. Triangles that intersect throughout the step have no impact. A method that reports "
      "impacts only then has a false negative, and its answer is not wrong."};
  view.group = "sweep";
  view.series = "method";
  view.label = "setting";
  view.x = "difficulty";
  view.y = "failed";
  view.lines = true;
  return view;
}

void write(const Options& options, const report::Figures& figures) {
  std::filesystem::create_directories(options.out);
  scenes::writeWhole(options.out / "stability.csv", figures.csv());
  scenes::writeWhole(options.out / "report.html", toHtml(figures, view()));
  std::printf("figures and page: %s\n", options.out.c_str());
}

}  // namespace

int main(int count, char** arguments) {
  CLI::App app("The difficulty at which each method starts to fail.", "palpate_stability");
  Options options;
  std::vector<std::string> names;
  for (const Sweep& sweep : sweeps()) names.push_back(sweep.name);
  app.add_option("--out", options.out, "folder for stability.csv and report.html");
  app.add_option("--sweep", options.sweeps, "only these sweeps")
      ->delimiter(',')
      ->check(scenes::oneOf(names));
  app.add_option("--cases", options.cases, "random cases for each step")->capture_default_str();
  app.add_option("--steps", options.steps, "steps of each sweep")
      ->check(scenes::between(2, 28))
      ->capture_default_str();
  app.add_flag("--redraw", options.redraw, "writes the page again, from stability.csv in --out");
  return scenes::exitCodeOf(app, [&] {
    app.parse(count, arguments);
    report::Figures figures = emptyFigures();
    if (options.redraw) figures.addFrom(options.out / "stability.csv");
    const int faults = options.redraw ? 0 : measure(options, figures);
    if (!options.out.empty()) write(options, figures);
    if (faults > 0) std::printf("%d faults\n", faults);
    return faults == 0;
  });
}
