#include "RigidBodies.h"

#include "CommandLine.h"
#include "RigidContestant.h"
#include "Scenes.h"

#include <palpate/Error.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>
#include <random>
#include <vector>

namespace palpate::accuracy {

namespace {

using Eigen::Vector3d;
using report::Figures;
using scenes::SceneMesh;

// Lengths in mm.
constexpr double kSkull = 90, kThickness = 0.4, kDepth = 0.3, kBurr = 4;

/// The skull's outer surface, along a unit vector: an egg with two orbits and a rough surface.
double outerRadius(const Vector3d& d) {
  double radius = kSkull * (1 + 0.12 * d.y() * d.y() - 0.08 * d.z());
  for (const double side : {-1.0, 1.0}) {
    const Vector3d orbit = Vector3d(0.35 * side, -1, -0.1).normalized();
    radius -= 14 * std::exp(-60 * (d - orbit).squaredNorm());
  }
  return radius + 0.5 * std::sin(31 * d.x()) * std::sin(29 * d.y() + 11 * d.z());
}

/// A closed shell of bone, 6 mm thick.
SceneMesh skull(int triangles) {
  const int frequency = std::max(4, static_cast<int>(std::sqrt(triangles / 40.0)));
  SceneMesh outer = scenes::sphere(frequency), inner = outer;
  for (Vector3d& p : outer.positions) p = (outerRadius(p) * p).eval();
  for (Vector3d& p : inner.positions) p = ((outerRadius(p) - 6) * p).eval();
  for (Triangle& t : inner.triangles) std::swap(t[1], t[2]);
  scenes::append(outer, inner);
  return outer;
}

/// A direction that wanders over the skull's crown, and the point of the surface there.
Vector3d wander(double phase) {
  return Vector3d(0.3 * std::sin(2 * std::numbers::pi * phase),
                  0.3 * std::cos(2 * std::numbers::pi * phase), 1)
      .normalized();
}

struct Moving {
  std::string name;
  SceneMesh tool;
  std::function<void(double phase, std::vector<Vector3d>& now)> move;
};

/// A burr that presses on the bone.
Moving burr() {
  SceneMesh tool = scenes::sphere(12);
  const std::vector<Vector3d> rest = tool.positions;
  return {"bone and burr", std::move(tool), [rest](double phase, std::vector<Vector3d>& now) {
            const Vector3d d = wander(phase);
            const Eigen::AngleAxisd turn(20 * phase, Vector3d(1, 2, 2) / 3);
            for (std::size_t i = 0; i < rest.size(); ++i)
              now[i] = (outerRadius(d) + kBurr - kDepth) * d + kBurr * (turn * rest[i]);
          }};
}

/// Soft tissue of 11,000 triangles that clings to the bone, at distances from -kDepth to 4 mm.
Moving organ() {
  SceneMesh tool = scenes::sphere(23);
  const std::vector<Vector3d> rest = tool.positions;
  return {"bone and organ", std::move(tool), [rest](double phase, std::vector<Vector3d>& now) {
            const Vector3d d = wander(phase);
            const Eigen::Quaterniond turn =
                Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), d);
            for (std::size_t i = 0; i < rest.size(); ++i) {
              // A cap of the sphere about the bone, thick in its middle.
              const Vector3d &p = rest[i], around = turn * Vector3d(0.3 * p.x(), 0.3 * p.y(), 1);
              const Vector3d direction = around.normalized();
              const double lift =
                  p.z() > 0 ? 15 * p.z() + 2
                            : 2 + 2.3 * std::sin(9 * p.x() + 6 * phase) * std::sin(8 * p.y());
              now[i] = (outerRadius(direction) + lift) * direction;
            }
          }};
}

Moving particles(int count) {
  SceneMesh tool;
  std::minstd_rand random(7);
  const auto between = [&](double low, double high) {
    return low + (high - low) * (random() - random.min()) /
                     static_cast<double>(random.max() - random.min());
  };
  std::vector<Vector3d> directions;
  std::vector<double> heights;
  while (directions.size() < static_cast<std::size_t>(count)) {
    Vector3d d;
    for (const int axis : {2, 1, 0}) d[axis] = between(-1, 1);
    if (d.norm() > 1 || d.norm() < 0.1) continue;
    directions.push_back(d.normalized());
    heights.push_back(between(-0.5 * kDepth, 3 * kThickness));
  }
  tool.positions.resize(directions.size());
  return {"bone and particles", std::move(tool),
          [directions, heights](double phase, std::vector<Vector3d>& now) {
            const Eigen::AngleAxisd turn(0.05 * std::sin(2 * std::numbers::pi * phase),
                                         Vector3d::UnitZ());
            for (std::size_t i = 0; i < directions.size(); ++i) {
              const Vector3d d = turn * directions[i];
              now[i] = (outerRadius(d) + heights[i]) * d;
            }
          }};
}

std::vector<RigidContestant> rigidContestants(bool ofParticles, double diagonal) {
  std::vector<RigidContestant> all{{"Proximity", "triangles", Method::Proximity}};
  const auto add = [&](const char* family, Method method, double share) {
    char setting[32];
    std::snprintf(setting, sizeof setting, "%g %% of the diagonal", 100 * share);
    all.push_back({family, setting, method, share * diagonal});
  };
  for (const double share : {0.01, 0.003, 0.001, 0.0003})
    add("DistanceField", Method::DistanceField, share);
  if (ofParticles)
    for (const double share : {0.001, 0.0003, 0.0001, 0.00003}) add("Proxy", Method::Proxy, share);
  return all;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

double percent(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

/// The first pass through the frames is judged, the others are timed.
Figures::Row measure(const std::string& name, const RigidScene& scene, const Moving& moving,
                     const RigidContestant& contestant, double diagonal,
                     const std::vector<std::vector<SignedDistance>>& truth,
                     const RigidOptions& options) {
  RigidRun run(scene, contestant);
  RigidScore score;
  std::vector<Vector3d> now(moving.tool.positions.size());
  std::vector<double> times;
  for (int pass = 0; pass <= options.repetitions; ++pass) {
    double milliseconds = 0;
    for (int frame = 0; frame < options.frames; ++frame) {
      moving.move(static_cast<double>(frame) / options.frames, now);
      milliseconds += run.step(now);
      if (pass == 0) score.add(scene, run, now, truth[static_cast<std::size_t>(frame)]);
    }
    if (pass > 0) times.push_back(milliseconds / options.frames);
  }
  const auto share = [&](double length) { return 100 * length / diagonal; };
  return {{name, contestant.family, contestant.setting},
          {median(times), run.buildMilliseconds(), percent(score.missing, score.within),
           percent(score.extra, score.claims), share(score.statedWorst), share(score.distanceWorst),
           share(score.distanceRms()), score.normalWorst, percent(score.wrongSide, score.claims),
           percent(score.doubtful, score.claims), static_cast<double>(score.silent),
           static_cast<double>(score.claims) / options.frames}};
}

}  // namespace

Figures emptyRigidFigures() {
  return {
      {"scene", "method", "setting"},
      {{"ms", "time (ms a frame, one thread)"},
       {"build_ms", "time before the first frame (ms)"},
       {"missing", "vertices missing beyond the stated error (% of those within the thickness)"},
       {"extra", "vertices beyond the thickness and the stated error (% of the reported)"},
       {"stated", "stated error (% of the diagonal)"},
       {"distance_worst", "distance: worst error (% of the diagonal)"},
       {"distance_rms", "distance: RMS error (% of the diagonal)"},
       {"normal_worst", "normal: worst error (degrees)"},
       {"wrong_side", "normals into the body (% of the reported)"},
       {"doubtful", "contacts that validity() doubts (% of the reported)"},
       {"silent", "errors beyond the stated one, not named by validity()"},
       {"contacts", "vertices reported a frame"}}};
}

std::vector<std::pair<std::string, std::string>> rigidRows() {
  std::vector<std::pair<std::string, std::string>> rows;
  for (const Moving& moving : {burr(), organ(), particles(1)})
    for (const RigidContestant& contestant : rigidContestants(moving.tool.triangles.empty(), 1))
      rows.emplace_back(moving.name, contestant.family);
  return rows;
}

void measureRigidBodies(const RigidOptions& options,
                        const std::function<bool(const std::string&, const std::string&)>& isChosen,
                        Figures& figures, const std::function<void()>& save) {
  std::optional<SceneMesh> body;
  std::optional<RigidTruth> truthOfBody;
  for (const Moving& moving : {burr(), organ(), particles(options.particles)}) {
    const double diagonal = 2 * std::numbers::sqrt3 * kSkull;  // about that of the bone's box
    std::vector<RigidContestant> missing;
    for (const RigidContestant& contestant :
         rigidContestants(moving.tool.triangles.empty(), diagonal))
      if (isChosen(moving.name, contestant.family) &&
          !figures.find(std::vector{moving.name, contestant.family, contestant.setting}))
        missing.push_back(contestant);
    if (missing.empty()) continue;
    if (!body) {
      body = skull(options.triangles);
      truthOfBody.emplace(*body);
    }
    std::printf("%-18s body of %zu triangles, %zu vertices\n", moving.name.c_str(),
                body->triangles.size(), moving.tool.positions.size());
    std::vector<std::vector<SignedDistance>> truth;
    std::vector<Vector3d> now(moving.tool.positions.size());
    for (int frame = 0; frame < options.frames; ++frame) {
      moving.move(static_cast<double>(frame) / options.frames, now);
      truth.push_back(truthOfBody->of(now));
    }
    SceneMesh tool = moving.tool;
    moving.move(0, tool.positions);
    const RigidScene scene{*body, tool, kThickness, 3 * kThickness};
    for (const RigidContestant& contestant : missing) {
      figures.add(measure(moving.name, scene, moving, contestant, diagonal, truth, options));
      const auto value = [&](const char* key) {
        return figures.rows().back().values[figures.indexOf(key)];
      };
      std::printf("  %-14s %-24s %9.3f ms, built in %.0f ms  error stated %.3g %%, seen %.3g %%\n",
                  contestant.family.c_str(), contestant.setting.c_str(), value("ms"),
                  value("build_ms"), value("stated"), value("distance_worst"));
      std::fflush(stdout);
      save();
      if (value("silent") > 0)
        throw scenes::BrokenPromise(
            moving.name + ", " + contestant.family + ", " + contestant.setting +
            ": errors beyond the stated one that validity() does not name.");
    }
  }
}

}  // namespace palpate::accuracy
