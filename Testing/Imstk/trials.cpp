// palpate_imstk_trials: runs the scenes of Trials.h.
//   --judge [SCENE]   each with Palpate; fails if anything passes or does not come to rest
//   --times [SCENE]   a table of each with Palpate and with iMSTK's own classes, for
//   Docs/HowTo/FromIMSTK.md
//   --forces          a table of the forces of tools on a spring, for that page
//   --thickness       a table of how often the guard holds such a tool, for that page
//   --curve           CSV of the force of a tool on a spring in tissue, for
//   Docs/Figures/forceCurve.py
#include "Trials.h"

#include <imstkScene.h>

#include <cstdio>
#include <ctime>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace {

using trials::Trial;

struct Result {
  std::size_t judged = 0, stepsThatCross = 0, untrusted = 0, errors = 0;
  std::pair<int, std::size_t> first;  ///< step with crossings, and how many
  double fastest = 0;                 ///< at the end
  double milliseconds = 0;            ///< of a step
};

Result run(Trial& trial, bool isJudged) {
  Result result;
  trial.test.scene->initialize();
  std::clock_t time = 0;
  for (int step = 0; step < trial.steps; ++step) {
    trial.move(step);
    const std::clock_t start = std::clock();
    trial.test.step();
    time += std::clock() - start;
    if (trial.isPalpate) {
      result.untrusted += trial.test.palpateScene.trusted() ? 0 : 1;
      result.errors += trial.test.palpateScene.error().empty() ? 0 : 1;
    }
    if (!isJudged || (step % trial.judgedEvery != 0 && step + 1 != trial.steps)) continue;
    ++result.judged;
    const std::size_t count = trial.judge();
    if (count != 0 && result.stepsThatCross++ == 0) result.first = {step, count};
  }
  result.fastest = trial.fastest();
  result.milliseconds = 1e3 * static_cast<double>(time) / CLOCKS_PER_SEC / trial.steps;
  return result;
}

/// What gravity gives in two steps is rest.
bool judge(const trials::Named& scene) {
  const auto trial = scene.make(true);
  const Result result = run(*trial, true);
  const double rest = 2 * trial->test.config().m_gravity.norm() * trial->test.config().m_dt;
  const bool isGood = result.stepsThatCross == 0 && result.errors == 0 &&
                      (trial->moving.empty() || result.fastest < rest);
  std::printf(
      "%-12s %s: %d steps, %zu with crossings, %zu untrusted, %zu with errors; fastest at the end "
      "%.3g; "
      "%.2f ms a step\n",
      scene.name, isGood ? "good" : "WRONG", trial->steps, result.stepsThatCross, result.untrusted,
      result.errors, result.fastest, result.milliseconds);
  if (result.stepsThatCross > 0)
    std::printf("  step %d has %zu crossings\n", result.first.first, result.first.second);
  for (const std::string& message : logged()) std::printf("  %s\n", message.c_str());
  std::fflush(stdout);
  return isGood;
}

void printTimes(const std::string& name) {
  std::printf(
      "| scene | Palpate: ms a step | iMSTK: ms a step | iMSTK: steps in which bodies overlap "
      "|\n|---|---|---|---|\n");
  for (const trials::Named& scene : trials::all()) {
    if (!name.empty() && name != scene.name) continue;
    const Result ours = run(*scene.make(true), false);
    const auto own = scene.make(false);
    const Result theirs = run(*own, true);
    std::printf("| %s | %.2f | %.2f | %zu of %zu |\n", scene.title, ours.milliseconds,
                theirs.milliseconds, theirs.stepsThatCross, theirs.judged);
    std::fflush(stdout);
  }
}

/// The force of the spring in each step.
std::vector<double> forcesOf(bool isPalpate, const trials::Press& press) {
  const auto trial = trials::toolAndTissue(isPalpate, press);
  trial->test.scene->initialize();
  std::vector<double> forces;
  for (int step = 0; step < trial->steps; ++step) {
    trial->move(step);
    trial->test.step();
    forces.push_back(trial->force());
  }
  return forces;
}

void printCurve(const std::string&) {
  std::printf("step,series,force\n");
  const struct {
    const char* name;
    bool isPalpate;
    unsigned iterations;
  } series[] = {{"Palpate", true, 10}, {"iMSTK", false, 10}, {"Palpate converged", true, 50}};
  for (const auto& one : series) {
    const std::vector<double> forces = forcesOf(one.isPalpate, {"capsule", true, one.iterations});
    for (std::size_t step = 0; step < forces.size(); ++step)
      std::printf("%zu,%s,%.6g\n", step, one.name, forces[step]);
  }
}

/// Means over the last 60 of the steps in which the device rests.
void printForces(const std::string&) {
  std::printf(
      "| tool | Palpate, 10 iterations | Palpate, 20 | Palpate, 50 | iMSTK, 10 | iMSTK, 50 |\n"
      "|---|---|---|---|---|---|\n");
  for (const char* tool : {"mesh", "box", "capsule", "sphere"}) {
    std::printf("| %s |", tool);
    for (const auto& [isPalpate, iterations] :
         {std::pair(true, 10u), std::pair(true, 20u), std::pair(true, 50u), std::pair(false, 10u),
          std::pair(false, 50u)}) {
      const std::vector<double> forces = forcesOf(isPalpate, {tool, true, iterations});
      double mean = 0;
      for (int step = 220; step < 280; ++step) mean += forces[static_cast<std::size_t>(step)] / 60;
      if (mean > 0)
        std::printf(" %.1f |", mean);
      else
        std::printf(" unstable |");
      std::fflush(stdout);
    }
    std::printf("\n");
  }
}

/// In which share of the steps that press the guard holds something.
void printThickness(const std::string&) {
  std::printf(
      "| thickness, in motions of a step | 5 iterations | 10 | 20 | 50 |\n|---|---|---|---|---|\n");
  for (const double ratio : {0.5, 1.0, 2.0, 4.0, 8.0}) {
    std::printf("| %g |", ratio);
    for (const unsigned iterations : {5u, 10u, 20u, 50u}) {
      const auto trial =
          trials::toolAndTissue(true, {"capsule", true, iterations, ratio * trials::kPressPerStep});
      trial->test.scene->initialize();
      int held = 0;
      for (int step = 0; step < 120; ++step) {
        trial->move(step);
        trial->test.step();
        held += trial->test.palpateScene.held() > 0;
      }
      std::printf(" %.0f %% |", 100.0 * held / 120);
      std::fflush(stdout);
    }
    std::printf("\n");
  }
}

}  // namespace

int main(int count, char** words) {
  const std::string task = count > 1 ? words[1] : "--judge", name = count > 2 ? words[2] : "";
  logged();  // before iMSTK logs
  const std::map<std::string, void (*)(const std::string&)> prints{{"--times", printTimes},
                                                                   {"--forces", printForces},
                                                                   {"--thickness", printThickness},
                                                                   {"--curve", printCurve}};
  if (const auto print = prints.find(task); print != prints.end()) {
    print->second(name);
    return 0;
  }
  bool isGood = true, isFound = false;
  for (const trials::Named& scene : trials::all())
    if (name.empty() || name == scene.name) {
      isFound = true;
      isGood &= judge(scene);
    }
  return isGood && isFound ? 0 : 1;
}
