// Sweeps of a rigid body and particles. Each sweep makes one property more difficult for distance
// fields and proxies. The program fails if an error exceeds the stated one and validity() does not
// name it.
#include "Common/RandomMeshes.h"
#include "CommandLine.h"
#include "Figures.h"
#include "RigidContestant.h"
#include "WriteFile.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <numbers>

namespace {

using namespace palpate;
using namespace palpate::accuracy;
using Eigen::Vector3d;
using scenes::SceneMesh;
using testing::Random;
using testing::uniform;

/// L: for bodies of size 1.
constexpr double kThickness = 0.02, kBand = 0.06;

struct Options {
  std::filesystem::path out;
  std::vector<std::string> sweeps;
  std::size_t particles = 200;
  int steps = 5;
};

/// A body, and where its particles are.
struct BodyCase {
  SceneMesh body;
  std::vector<Vector3d> particles;
};

struct BodySweep {
  std::string name, quantity;
  double from, to;  ///< powers of ten, easiest first
  std::function<BodyCase(double value, std::size_t count, Random&)> make;
};

/// A closed prism over the polygon, which is convex and counterclockwise, from z = -1/2 to 1/2.
SceneMesh prism(const std::vector<Vector3d>& polygon) {
  SceneMesh mesh;
  const auto n = static_cast<std::uint32_t>(polygon.size());
  for (const double z : {-0.5, 0.5})
    for (const Vector3d& p : polygon) mesh.positions.emplace_back(p.x(), p.y(), z);
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t j = (i + 1) % n;
    mesh.triangles.push_back({i, j, n + j});
    mesh.triangles.push_back({i, n + j, n + i});
    if (i < 2) continue;
    mesh.triangles.push_back({0, i, i - 1});
    mesh.triangles.push_back({n, n + i - 1, n + i});
  }
  return mesh;
}

/// A plate of this height, and particles within the thickness of its faces, and inside.
BodyCase plate(double height, std::size_t count, Random& random) {
  const double h = 0.5 * height;
  BodyCase made{prism({{-0.5, -h, 0}, {0.5, -h, 0}, {0.5, h, 0}, {-0.5, h, 0}}), {}};
  for (std::size_t i = 0; i < count; ++i) {
    const double z = uniform(random, -0.45, 0.45),
                 y = uniform(random, -h - kThickness, h + kThickness),
                 x = uniform(random, -0.45, 0.45);
    made.particles.emplace_back(x, y, z);
  }
  return made;
}

/// A wedge of this angle at the z axis, and particles about its edge.
BodyCase wedge(double degrees, std::size_t count, Random& random) {
  const double half = 0.5 * degrees * std::numbers::pi / 180;
  const Vector3d up(std::cos(half), std::sin(half), 0), down(std::cos(half), -std::sin(half), 0);
  BodyCase made{prism({Vector3d::Zero(), down, up}), {}};
  for (std::size_t i = 0; i < count; ++i) {
    const double z = uniform(random, -0.4, 0.4), y = uniform(random, -2, 2) * kThickness,
                 x = uniform(random, -kThickness, 3 * kThickness);
    made.particles.emplace_back(x, y, z);
  }
  return made;
}

/// A ball, and particles at a depth of this many bands.
BodyCase ball(double bands, std::size_t count, Random& random) {
  BodyCase made{scenes::sphere(8), {}};
  for (Vector3d& p : made.body.positions) p *= 0.7;
  for (std::size_t i = 0; i < count; ++i)
    made.particles.push_back((0.7 - bands * kBand) *
                             testing::randomPoint(random, -1, 1).normalized());
  return made;
}

/// A ball without a cap of this share of its height, and particles near what is left and in the
/// hole.
BodyCase openBall(double share, std::size_t count, Random& random) {
  BodyCase made = ball(0, count, random);
  std::erase_if(made.body.triangles, [&](const Triangle& t) {
    return std::min({made.body.positions[t[0]].z(), made.body.positions[t[1]].z(),
                     made.body.positions[t[2]].z()}) > 0.7 * (1 - 2 * share);
  });
  for (Vector3d& p : made.particles) p *= 1 + uniform(random, -1, 1) * kThickness;
  return made;
}

std::vector<BodySweep> sweeps() {
  return {{"thin", "height of a plate / thickness", 1, -3,
           [](double x, std::size_t count, Random& random) {
             return plate(x * kThickness, count, random);
           }},
          {"depth", "depth / band of the field", -1, 1,
           [](double x, std::size_t count, Random& random) { return ball(x, count, random); }},
          {"open", "height of a hole / diameter of a ball", -2.5, -0.3, openBall},
          {"sharp", "angle at an edge (degrees)", 2, -2, wedge}};
}

std::vector<RigidContestant> contestants() {
  return {{"Proximity", "triangles", Method::Proximity},
          {"DistanceField", "1/2 thickness", Method::DistanceField, 0.5 * kThickness},
          {"DistanceField", "1/10 thickness", Method::DistanceField, 0.1 * kThickness},
          {"Proxy", "1/2 thickness", Method::Proxy, 0.5 * kThickness},
          {"Proxy", "1/10 thickness", Method::Proxy, 0.1 * kThickness}};
}

report::Figures emptyFigures() {
  return {
      {"sweep", "quantity", "method", "setting"},
      {{"difficulty", "difficulty (value of the quantity)"},
       {"missing",
        "particles missing beyond the stated error (% of those inside or within the thickness)"},
       {"extra", "particles beyond the thickness and the stated error (% of the reported)"},
       {"beyond_stated", "errors beyond the stated one (% of the reported)"},
       {"wrong_side", "normals into the body (% of the reported)"},
       {"doubtful", "contacts that validity() doubts (% of the reported)"},
       {"silent", "errors beyond the stated one, not named by validity()"},
       {"distance_worst", "distance: worst error / thickness"},
       {"stated", "stated error / thickness"}}};
}

double percent(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

/// Returns whether errors are silent.
bool measure(const BodySweep& sweep, double value, const Options& options,
             report::Figures& figures) {
  Random random(static_cast<std::uint64_t>(1e6 * value));
  const BodyCase made = sweep.make(value, options.particles, random);
  const std::vector<SignedDistance> truth = RigidTruth(made.body).of(made.particles);
  const SceneMesh particles{made.particles, {}};
  const RigidScene scene{made.body, particles, kThickness, kBand};
  bool isSilent = false;
  for (const RigidContestant& contestant : contestants()) {
    RigidScore score;
    RigidRun run(scene, contestant);
    run.step(made.particles);
    score.add(scene, run, made.particles, truth);
    figures.add({{sweep.name, sweep.quantity, contestant.family, contestant.setting},
                 {value, percent(score.missing, score.within), percent(score.extra, score.claims),
                  percent(score.beyondStated, score.claims), percent(score.wrongSide, score.claims),
                  percent(score.doubtful, score.claims), static_cast<double>(score.silent),
                  score.distanceWorst / kThickness, score.statedWorst / kThickness}});
    std::printf("%-6s %9.3g  %-14s %-15s %5.1f %% missing  %5.1f %% beyond the stated error\n",
                sweep.name.c_str(), value, contestant.family.c_str(), contestant.setting.c_str(),
                percent(score.missing, score.within), percent(score.beyondStated, score.claims));
    if (score.silent == 0) continue;
    isSilent = true;
    std::printf("FAULT: %zu errors beyond the stated one are not named by validity()\n",
                score.silent);
  }
  return isSilent;
}

}  // namespace

int main(int count, char** arguments) {
  CLI::App app("The difficulty at which fields and proxies start to fail.", "palpate_bodies");
  Options options;
  std::vector<std::string> names;
  for (const BodySweep& sweep : sweeps()) names.push_back(sweep.name);
  app.add_option("--out", options.out, "folder for stability-bodies.csv");
  app.add_option("--sweep", options.sweeps, "only these sweeps")
      ->delimiter(',')
      ->check(scenes::oneOf(names));
  app.add_option("--particles", options.particles, "of each step")->capture_default_str();
  app.add_option("--steps", options.steps, "steps of each sweep")
      ->check(scenes::between(2, 100))
      ->capture_default_str();
  return scenes::exitCodeOf(app, [&] {
    app.parse(count, arguments);
    report::Figures figures = emptyFigures();
    int faults = 0;
    for (const BodySweep& sweep : sweeps()) {
      if (!options.sweeps.empty() && std::find(options.sweeps.begin(), options.sweeps.end(),
                                               sweep.name) == options.sweeps.end())
        continue;
      for (int step = 0; step < options.steps; ++step) {
        const double power = sweep.from + (sweep.to - sweep.from) * step / (options.steps - 1);
        faults += measure(sweep, std::pow(10, power), options, figures);
      }
    }
    if (!options.out.empty()) {
      std::filesystem::create_directories(options.out);
      scenes::writeWhole(options.out / "stability-bodies.csv", figures.csv());
    }
    return faults == 0;
  });
}
