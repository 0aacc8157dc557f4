// Sweeps of two triangles that meet, from comfortable to hopeless: what each method gets wrong, and
// where it starts to. Fails where a method is not finite, or is not what it is defined to be.
#ifdef PALPATE_HAS_CHARTS
#include "Chart.h"
#endif
#include "HtmlReport.h"
#include "WriteFile.h"
#include "Tally.h"

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
  return {{"sweep", "method", "setting"},
          {{"difficulty", "difficulty"},
           {"failed", "missed or invented (%)"},
           {"missed", "touching and not reported (%)"},
           {"invented", "reported and not touching (%)"},
           {"turned", "normal on the wrong side (%)"},
           {"flipped", "normal turned by noise of 1e-7 (%)"},
           {"not_finite", "contacts not finite"},
           {"not_unit", "contacts whose normal is not unit"},
           {"undefined", "features against the method's own definition"},
           {"silent", "answers wrong and trusted"},
           {"wrong", "answers wrong (%)"},
           {"alarms", "answers right and not trusted (%)"},
           {"us", "microseconds a case"}}};
}

/// `most` of the values, evenly from first to last, or all.
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
  return {{sweep.name, subject.contestant.family, subject.contestant.setting},
          {value, percent(tally.missed + tally.invented, tally), percent(tally.missed, tally),
           percent(tally.invented, tally), percent(tally.turned, tally),
           percent(tally.flipped, tally), count(tally.notFinite), count(tally.notUnit),
           count(tally.undefinedMissed + tally.undefinedInvented + tally.untimely),
           count(tally.silent), percentOfAnswers(tally.wrong, tally),
           percentOfAnswers(tally.alarms, tally), 1000 * tally.milliseconds / count(tally.cases)}};
}

/// Prints and counts what must never be.
int faultsOf(const Sweep& sweep, double value, const Subject& subject, const Tally& tally) {
  int faults = 0;
  const auto expectNone = [&](std::size_t count, const char* what) {
    if (count == 0) return;
    ++faults;
    std::printf("FAULT %s at %g, %s: %zu %s\n", sweep.name.c_str(), value,
                subject.contestant.family.c_str(), count, what);
  };
  if (subject.contestant.family == "FCL") return 0;
  expectNone(tally.silent, "answers wrong and trusted");
  expectNone(tally.notFinite, "contacts not finite");
  expectNone(tally.notUnit, "normals not unit");
  expectNone(tally.undefinedMissed, "features missed");
  expectNone(tally.undefinedInvented, "features invented");
  expectNone(tally.untimely, "times of impact late, or early by more than 1e-6");
  if (subject.definition != Definition::Continuous) return faults;
  expectNone(tally.turned, "normals of Continuous on the wrong side");
  if (!sweep.startsInside)
    expectNone(tally.missedApart + tally.invented, "cases failed by Continuous");
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
                    percent(tallies[s].missed + tallies[s].invented, tallies[s]),
                    percent(tallies[s].turned, tallies[s]),
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
  view.title = "Palpate: past the failing point";
  view.paragraphs = {
      "Two triangles meet in a step, over and over, and one geometry about them gets harder from "
      "step "
      "to step of a sweep. Failed: "
      "they touch and nothing is reported, or something is reported to touch and does not, or a "
      "normal points to the side "
      "that its features did not come from. What is true is decided in rational arithmetic that "
      "shares no code with the "
      "library."};
  view.group = "sweep";
  view.series = "method";
  view.label = "setting";
  view.x = "difficulty";
  view.y = "failed";
  view.lines = true;
  return view;
}

void checkNames(const std::vector<std::string>& names) {
  const std::vector<Sweep> all = sweeps();
  for (const std::string& name : names)
    if (std::none_of(all.begin(), all.end(), [&](const Sweep& s) { return s.name == name; }))
      throw std::invalid_argument("no sweep is called \"" + name + "\"");
}

void write(const Options& options, const report::Figures& figures) {
  std::filesystem::create_directories(options.out);
  scenes::writeWhole(options.out / "stability.csv", figures.csv());
  scenes::writeWhole(options.out / "report.html", toHtml(figures, view()));
#ifdef PALPATE_HAS_CHARTS
  // Pictures are drawn in floats, which 1e150 is not.
  auto quantities = figures.quantities();
  quantities.push_back({"exponent", "difficulty, powers of ten"});
  report::Figures drawable(figures.textKeys(), quantities);
  for (report::Figures::Row row : figures.rows()) {
    row.values.push_back(std::log10(row.values.front()));
    drawable.add(std::move(row));
  }
  report::Charts charts{.diagrams = {}, .columns = 3, .width = 440, .height = 330};
  for (const Sweep& sweep : sweeps())
    charts.diagrams.push_back({.title = sweep.name,
                               .group = "sweep",
                               .value = sweep.name,
                               .series = "method",
                               .x = "exponent",
                               .y = "failed",
                               .logX = false,
                               .lines = true});
  draw(drawable, charts, options.out / "stability");
#endif
  std::printf("figures and page: %s\n", options.out.c_str());
}

}  // namespace

int main(int count, char** arguments) {
  CLI::App app("Where methods start to fail.", "palpate_stability");
  Options options;
  app.add_option("--out", options.out, "folder for stability.csv, .png, .svg and report.html");
  app.add_option("--sweep", options.sweeps, "only these")->delimiter(',');
  app.add_option("--cases", options.cases, "random cases a step")->capture_default_str();
  app.add_option("--steps", options.steps, "of each sweep")
      ->check(CLI::Range(2, 28))
      ->capture_default_str();
  app.add_flag("--redraw", options.redraw, "page and pictures again, from --out's stability.csv");
  CLI11_PARSE(app, count, arguments);
  try {
    checkNames(options.sweeps);
    report::Figures figures = emptyFigures();
    if (options.redraw) figures.addFrom(options.out / "stability.csv");
    const int faults = options.redraw ? 0 : measure(options, figures);
    if (!options.out.empty()) write(options, figures);
    if (faults > 0) std::printf("%d faults\n", faults);
    return faults > 0 ? 1 : 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
