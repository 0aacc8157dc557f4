// Spatial queries on a geometry that deforms in each frame: Palpate beside the libraries of Debian.
#include "Rows.h"

#include "SpatialBody.h"
#include "SpatialTruth.h"

#ifdef PALPATE_BENCHMARK_BASELINES
#include "Baselines/FclDistance.h"
#endif

#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>

#include <chrono>
#include <cstdio>
#include <thread>

namespace palpate::benchmark {
namespace {

using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

/// Two meshes whose boxes are a tenth of the diagonal apart; of two sizes.
constexpr double kDistanceTargets[] = {300, 1000}, kDistanceFastest[] = {600, 1000};

using Engines = std::vector<std::unique_ptr<SpatialEngine>>;

/// Palpate is the first.
Engines makeEngines(bool isPointSet, const std::vector<std::string>& wanted) {
  Engines engines;
  engines.push_back(makePalpateQueries(isPointSet));
#ifdef PALPATE_BENCHMARK_BASELINES
  if (isPointSet) {
    engines.push_back(makeNanoflannQueries());
  } else {
    engines.push_back(makeEmbreeQueries(true));
    engines.push_back(makeEmbreeQueries(false));
    engines.push_back(makeCgalQueries(false));
    engines.push_back(makeCgalQueries(true));
    engines.push_back(makeBulletQueries());
    engines.push_back(makeFclQueries());
#ifdef PALPATE_BENCHMARK_VTK
    engines.push_back(makeVtkQueries(true));
    engines.push_back(makeVtkQueries(false));
#endif
  }
#endif
  std::erase_if(engines, [&](const auto& engine) {
    return engine != engines[0] && !isWanted(engine->name(), wanted);
  });
  return engines;
}

/// Times of one engine in each turn: of updates in milliseconds, of each row in microseconds a
/// query, and of the row's first query.
struct EngineTimes {
  std::vector<double> updates;
  std::vector<std::vector<double>> rows, first;
};

/// The median over the turns of both.
double medianRatio(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) ratios.push_back(a[i] / b[i]);
  return median(ratios);
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

template <class F>
double millisecondsOf(F&& f) {
  const double start = now();
  f();
  return now() - start;
}

void askRow(SpatialEngine& engine, const SpatialRow& row, std::span<const SpatialCase> cases,
            const ShapeSizes& sizes, SpatialAnswers& out) {
  if (row.isBatch)
    engine.askTogether(row.query, cases, sizes, out);
  else
    engine.ask(row.query, cases, sizes, out);
}

/// In each repetition all engines update to the next frame and answer the same cases. A different
/// engine begins each time. An engine rests once its time is spent.
std::vector<EngineTimes> takeTurns(const SpatialBody& body, const Engines& engines,
                                   const RowOptions& options) {
  const std::vector<std::vector<double>> empty(body.rows().size());
  const EngineTimes none{{}, empty, empty};
  std::vector<EngineTimes> times(engines.size(), none);
  std::vector<double> spent(engines.size());  // ms
  SpatialAnswers answers;
  testing::Random random(1);
  for (std::size_t turn = 0; turn < static_cast<std::size_t>(options.measure.repetitions); ++turn) {
    const Points& positions = body.frames[(turn + 1) % kFrames];
    std::vector<char> rests(engines.size());
    for (std::size_t i = 0; i < engines.size(); ++i) {
      rests[i] = spent[i] > 1000 * options.measure.secondsPerEngine;
      if (rests[i]) continue;
      times[i].updates.push_back(millisecondsOf([&] { engines[i]->update(positions); }));
      spent[i] += times[i].updates.back();
    }
    for (std::size_t r = 0; r < body.rows().size(); ++r) {
      const SpatialRow& row = body.rows()[r];
      if (!isWanted(body.name + ": " + row.name, options.scenes)) continue;
      const auto cases = makeCases(body, positions, row.place, row.cases[body.size], random);
      for (std::size_t i = 0; i < engines.size(); ++i) {
        const std::size_t e = (i + turn) % engines.size();
        if (rests[e] || !engines[e]->answers(row.query)) continue;
        const auto ask = [&](std::span<const SpatialCase> some) {
          answers.clear();
          askRow(*engines[e], row, some, body.sizes, answers);
        };
        // The first query after an update makes what an engine keeps for its frame.
        times[e].first[r].push_back(1000 * millisecondsOf([&] { ask(std::span(cases).first(1)); }));
        ask(std::span(cases).first(cases.size() / 8));  // warms the caches
        const double taken = millisecondsOf([&] { ask(cases); });
        spent[e] += taken;
        times[e].rows[r].push_back(1000 * taken / static_cast<double>(cases.size()));
      }
    }
  }
  return times;
}

/// The time of a first hit in Embree here over that on the machine of the targets. 0: not measured.
double speedOf(const SpatialBody& body, const Engines& engines,
               const std::vector<EngineTimes>& times) {
  double least = 0;
  for (std::size_t r = 0; r < body.rows().size(); ++r)
    for (std::size_t e = 0; e < engines.size(); ++e) {
      const SpatialRow& row = body.rows()[r];
      if (row.query != SpatialQuery::FirstHit || row.isBatch || row.fastest[body.size] == 0 ||
          times[e].rows[r].empty() || !engines[e]->name().starts_with("Embree"))
        continue;
      const double speed = median(times[e].rows[r]) / row.fastest[body.size];
      if (least == 0 || speed < least) least = speed;
    }
  return least;
}

/// A table of one body: each engine's times, Palpate's ratio to the fastest of the others beside
/// the ratio that the targets allow, and the target in microseconds of this machine.
void timeRows(Report& report, const SpatialBody& body, const Engines& engines,
              const RowOptions& options) {
  const auto times = takeTurns(body, engines, options);
  report.heading("Spatial queries, " + body.name + ", us a query; update in ms");
  std::vector<std::string> header = {""}, updates = {"update"};
  for (std::size_t e = 0; e < engines.size(); ++e) {
    header.push_back(engines[e]->name().substr(0, 11));
    updates.push_back(milliseconds(median(times[e].updates)));
    report.row("spatial", body.name + ": update", 1, engines[e]->name(), "ms",
               median(times[e].updates));
  }
  header.insert(header.end(), {"ratio", "allowed", "", "target", ""});
  report.line(header);
  report.line(updates);
  const double scale = speedOf(body, engines, times);
  for (std::size_t r = 0; r < body.rows().size(); ++r) {
    const SpatialRow& row = body.rows()[r];
    const std::vector<double>& palpate = times[0].rows[r];
    if (palpate.empty()) continue;
    const std::string scene = body.name + ": " + row.name;
    const auto figure = [&](const std::string& engine, const char* metric, double value) {
      report.row("spatial", scene, 1, engine, metric, value);
    };
    std::vector<std::string> cells = {row.name};
    double ratio = 0;
    for (std::size_t e = 0; e < engines.size(); ++e) {
      const std::vector<double>& samples = times[e].rows[r];
      cells.push_back(samples.empty() ? "-" : number(median(samples)));
      if (samples.empty()) continue;
      figure(engines[e]->name(), "us", median(samples));
      figure(engines[e]->name(), "first query us", median(times[e].first[r]));
      if (e > 0) ratio = std::max(ratio, medianRatio(palpate, samples));
    }
    if (ratio == 0) {  // Palpate alone
      report.line(cells);
      continue;
    }
    cells.push_back(number(ratio));
    figure("Palpate", "ratio to the fastest library", ratio);
    const double target = row.target[body.size];
    if (target > 0) {
      const double allowed = target / row.fastest[body.size];
      cells.insert(cells.end(), {number(allowed), ratio <= allowed ? "met" : "NOT MET"});
      figure("Palpate", "allowed ratio", allowed);
    }
    if (target > 0 && scale > 0) {
      cells.insert(cells.end(),
                   {number(scale * target), median(palpate) <= scale * target ? "met" : "NOT MET"});
      figure("Palpate", "scaled target us", scale * target);
    }
    report.line(cells);
  }
}

/// Errors on a sample, for the body at the origin and 1,000 diagonals from it.
void errorRows(Report& report, const SpatialBody& body, const Engines& engines,
               const RowOptions& options) {
  for (const bool isFar : {false, true}) {
    Points positions = body.frames[1];
    if (isFar)
      for (Vector3d& p : positions) p += 1000 * body.diagonal * Vector3d(0.6, -0.64, 0.48);
    const std::string where = isFar ? ", 1,000 diagonals away" : ", at the origin";
    report.heading("Spatial queries, " + body.name + where +
                   ": wrong elements, largest error / diagonal");
    std::vector<std::string> header = {""};
    for (const auto& engine : engines) {
      engine->update(positions);
      header.push_back(engine->name().substr(0, 11));
      header.push_back("");
    }
    report.line(header);
    testing::Random random(2);
    for (const SpatialRow& row : body.rows()) {
      const std::string scene = body.name + ": " + row.name + where;
      if (!isWanted(scene, options.scenes)) continue;
      const bool isShape = row.query == SpatialQuery::Capsule || row.query == SpatialQuery::Box;
      const auto cases = makeCases(body, positions, row.place,
                                   (isShape ? 10u : 100u) / (body.size == 2 ? 5u : 1u), random);
      std::vector<SpatialAnswers> answers(engines.size());
      for (std::size_t e = 0; e < engines.size(); ++e)
        if (engines[e]->answers(row.query)) askRow(*engines[e], row, cases, body.sizes, answers[e]);
      const auto errors = errorsOf(row.query, cases, body.sizes, answers, body.triangles, positions,
                                   1e-15 * body.diagonal);
      std::vector<std::string> cells = {row.name};
      for (std::size_t e = 0; e < engines.size(); ++e) {
        const double widest = errors[e].widest / body.diagonal;
        const bool answered = engines[e]->answers(row.query);
        cells.push_back(answered ? std::to_string(errors[e].wrong) : "-");
        cells.push_back(answered && widest > 0 ? number(widest) : "");
        if (!answered) continue;
        const auto figure = [&](const char* metric, double value) {
          report.row("spatial errors", scene, 1, engines[e]->name(), metric, value);
        };
        figure("wrong", static_cast<double>(errors[e].wrong));
        figure("of", static_cast<double>(errors[e].of));
        figure("largest error / diagonal", widest);
      }
      report.line(cells);
    }
  }
}

/// A loop that only computes.
void compute() {
  double x = 0.5;
  for (int i = 0; i < 20'000'000; ++i) x = 3.9 * x * (1 - x);
  volatile double sink = x;
  static_cast<void>(sink);
}

/// Milliseconds on the wall, as the CPU clock adds up those of both threads.
template <class F>
double wallMillisecondsOf(F&& f) {
  const auto start = std::chrono::steady_clock::now();
  f();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

/// Batches on one and two threads, beside compute() once on a thread and once on each of two.
void batchRows(Report& report, const SpatialBody& body, const RowOptions& options) {
  constexpr std::size_t kCases = 100'000;
  std::array<std::unique_ptr<OctreeBasedCD>, 2> collisions;
  GeometryId mesh{};
  for (int threads : {1, 2}) {
    Settings settings;
    settings.threads = threads;
    auto& made = collisions[static_cast<std::size_t>(threads - 1)];
    made = std::make_unique<OctreeBasedCD>(settings);
    mesh = made->addTriangleMesh(body.frames[0], body.triangles);
    made->update();
  }
  testing::Random random(3);
  Points near;
  std::vector<Ray> rays;
  for (const SpatialCase& c : makeCases(body, body.frames[0], Place::Near, kCases, random))
    near.push_back(c.point);
  for (const SpatialCase& c : makeCases(body, body.frames[0], Place::Rays, kCases, random))
    rays.push_back({c.point, c.direction});
  std::vector<SurfacePoint> points(kCases);
  std::vector<SignedDistance> distances(kCases);
  std::vector<RayHit> hits(kCases);
  constexpr const char* kNames[] = {"closestPoints near", "signedDistances near", "firstHits"};
  std::array<std::array<std::vector<double>, 2>, 4> taken;
  for (int turn = 0; turn <= options.measure.repetitions; ++turn)
    for (std::size_t thread = 0; thread < 2; ++thread) {
      const SpatialQueries queries = collisions[thread]->queries();
      const double each[] = {
          wallMillisecondsOf([&] { queries.closestPoints(mesh, near, points); }),
          wallMillisecondsOf([&] { queries.signedDistances(mesh, near, distances); }),
          wallMillisecondsOf([&] { queries.firstHits(mesh, rays, hits); }), wallMillisecondsOf([&] {
            std::jthread other(thread == 1 ? compute : [] {});
            compute();
          })};
      if (turn > 0)  // the first prepares what queries keep
        for (std::size_t i = 0; i < 4; ++i) taken[i][thread].push_back(each[i]);
    }
  report.heading("Batches of " + std::to_string(kCases) + " queries, " + body.name +
                 ": us a query on 1 and 2 threads, speed-up, of that of a loop");
  const double loop = 2 * medianRatio(taken[3][0], taken[3][1]);
  report.row("spatial batches", "loop", 2, "compute-bound loop", "speed-up", loop);
  for (std::size_t i = 0; i < 3; ++i) {
    const double speedUp = medianRatio(taken[i][0], taken[i][1]);
    report.line({kNames[i], number(1000 * median(taken[i][0]) / kCases),
                 number(1000 * median(taken[i][1]) / kCases), times(speedUp), times(loop),
                 number(speedUp / loop), speedUp >= 0.9 * loop ? "met" : "NOT MET"});
    for (std::size_t thread = 0; thread < 2; ++thread)
      report.row("spatial batches", kNames[i], static_cast<int>(thread) + 1, "Palpate", "us",
                 1000 * median(taken[i][thread]) / kCases);
    report.row("spatial batches", kNames[i], 2, "Palpate", "speed-up", speedUp);
    report.row("spatial batches", kNames[i], 2, "Palpate", "share of the loop's", speedUp / loop);
  }
}

/// The clearance of straight paths that pass a body, beside distance() of a line at their places.
void pathRow(Report& report, const SpatialBody& body, const RowOptions& options) {
  constexpr std::size_t kCases = 200;
  const std::string scene = body.name + ": clearance of a path";
  if (!isWanted(scene, options.scenes)) return;
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : body.frames[0]) box.extend(p);
  testing::Random random(4);
  std::vector<std::array<Vector3d, 2>> paths(kCases);
  for (auto& path : paths)
    for (Vector3d& p : path) {
      p = box.center() + body.diagonal * testing::randomPoint(random, -1, 1);
      p[0] = box.max()[0] + body.diagonal * testing::uniform(random, 0.02, 0.3);
    }
  OctreeBasedCD collisions;
  const GeometryId mesh = collisions.addTriangleMesh(body.frames[0], body.triangles),
                   line = collisions.addLineMesh(paths[0], std::vector<Segment>{{0, 1}}, 0.0);
  collisions.update();
  const GeometryId bodies[] = {mesh};
  std::vector<PathInterval> inside;
  std::vector<PathClearance> outside;
  std::array<std::vector<double>, 2> taken;
  std::array<double, 2> sums{};
  for (int turn = 0; turn < options.measure.repetitions; ++turn) {
    const SpatialQueries queries = collisions.queries();
    taken[0].push_back(1000 / double(kCases) * millisecondsOf([&] {
                         for (const auto& path : paths) {
                           queries.path(path, 0.0, bodies, inside, outside);
                           sums[0] += outside[0].distance;
                         }
                       }));
    taken[1].push_back(1000 / double(kCases) * millisecondsOf([&] {
                         for (const auto& path : paths) {
                           collisions.setPositions(line, path);
                           sums[1] += collisions.queries().distance(line, mesh).distance;
                         }
                       }));
  }
  report.heading("Spatial queries, " + scene +
                 ": us of path(), of setPositions() and distance(), difference / diagonal");
  report.line({"", number(median(taken[0])), number(median(taken[1])),
               number((sums[0] - sums[1]) / body.diagonal)});
  report.row("spatial", scene, 1, "Palpate", "us", median(taken[0]));
  report.row("spatial", scene, 1, "Palpate, distance()", "us", median(taken[1]));
}

#ifdef PALPATE_BENCHMARK_BASELINES
/// The least distance of two bodies of which both deform. placed: both are also turned by
/// setTransform().
void distanceRow(Report& report, const SpatialBody& body, bool placed, const RowOptions& options) {
  const std::string scene = body.name + ": minimum distance" + (placed ? ", placed" : "");
  if (!isWanted(scene, options.scenes)) return;
  using Eigen::Isometry3d;
  Isometry3d poseA = Isometry3d::Identity(), poseB = poseA;
  if (placed) {
    poseA.rotate(Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()));
    poseB.rotate(Eigen::AngleAxisd(1.9, Vector3d(-2, 1, 2).normalized()));
  }
  Eigen::AlignedBox3d boxA, boxB;
  for (const Points& frame : body.frames)
    for (const Vector3d& p : frame) {
      boxA.extend(poseA * p);
      boxB.extend(poseB * p);
    }
  const double aside = boxA.max()[0] - boxB.min()[0] + 0.1 * body.diagonal;
  std::vector<Points> others = body.frames;
  if (placed)
    poseB.pretranslate(aside * Vector3d::UnitX());
  else
    for (Points& frame : others)
      for (Vector3d& p : frame) p[0] += aside;

  Settings settings;
  settings.threads = 1;
  OctreeBasedCD collisions(settings);
  const GeometryId a = collisions.addTriangleMesh(body.frames[0], body.triangles),
                   b = collisions.addTriangleMesh(others[0], body.triangles);
  if (placed) {
    collisions.setTransform(a, {poseA.linear(), poseA.translation()});
    collisions.setTransform(b, {poseB.linear(), poseB.translation()});
  }
  FclDistance fcl(body.triangles, body.frames[0], others[0]);
  std::array<std::vector<double>, 2> updates, queries;
  std::array<double, 2> least;
  for (std::size_t turn = 0; turn < static_cast<std::size_t>(options.measure.repetitions); ++turn) {
    const std::size_t frame = (turn + 1) % kFrames;
    updates[0].push_back(millisecondsOf([&] {
      collisions.advance();
      collisions.setPositions(a, body.frames[frame]);
      collisions.setPositions(b, others[frame]);
      collisions.update();
    }));
    updates[1].push_back(millisecondsOf([&] { fcl.update(body.frames[frame], others[frame]); }));
    for (std::size_t i = 0; i < 2; ++i) {
      const std::size_t engine = (i + turn) % 2;
      const auto ask = [&] {
        least[engine] =
            engine == 0 ? collisions.queries().distance(a, b).distance : fcl.distance(poseA, poseB);
      };
      ask();  // warms the caches
      queries[engine].push_back(1000 * millisecondsOf(ask));
    }
  }
  constexpr const char* kNames[] = {"Palpate", "FCL 0.7 BVHModel<OBBRSS>, refit"};
  const double ratio = medianRatio(queries[0], queries[1]),
               allowed = kDistanceTargets[body.size] / kDistanceFastest[body.size];
  report.heading("Spatial queries, " + scene + ", " + number(least[0] / body.diagonal) +
                 " diagonals, Palpate and FCL; update in ms, query in us, ratio, allowed ratio, "
                 "difference / diagonal");
  report.line({"update", milliseconds(median(updates[0])), milliseconds(median(updates[1]))});
  report.line({"minimum distance", number(median(queries[0])), number(median(queries[1])),
               number(ratio), number(allowed), ratio <= allowed ? "met" : "NOT MET",
               number((least[0] - least[1]) / body.diagonal)});
  for (std::size_t engine = 0; engine < 2; ++engine) {
    report.row("spatial", scene, 1, kNames[engine], "us", median(queries[engine]));
    report.row("spatial", scene, 1, kNames[engine], "update ms", median(updates[engine]));
  }
  report.row("spatial", scene, 1, "Palpate", "ratio to the fastest library", ratio);
  report.row("spatial", scene, 1, "Palpate", "allowed ratio", allowed);
}
#endif

}  // namespace

void spatialRows(Report& report, const RowOptions& options) {
  const std::size_t sizes = options.quick ? 2 : 3;
  for (const bool isPointSet : {false, true})
    for (std::size_t size = 0; size < sizes; ++size) {
      const SpatialBody body = makeBody(size, isPointSet);
      if (std::ranges::none_of(body.rows(), [&](const SpatialRow& row) {
            return isWanted(body.name + ": " + row.name, options.scenes);
          }))
        continue;
      const Engines engines = makeEngines(isPointSet, options.engines);
      for (const auto& engine : engines) engine->prepare(body.triangles, body.frames[0]);
      timeRows(report, body, engines, options);
      errorRows(report, body, engines, options);
    }
  for (std::size_t size = 0; size < sizes; ++size) pathRow(report, makeBody(size, false), options);
#ifdef PALPATE_BENCHMARK_BASELINES
  for (std::size_t size = 0; size < std::size(kDistanceTargets); ++size)
    for (const bool placed : {false, true})
      distanceRow(report, makeBody(size, false), placed, options);
#endif
  if (isWanted("batches", options.scenes)) batchRows(report, makeBody(1, false), options);
}

}  // namespace palpate::benchmark
