// Spatial queries on a mesh that deforms in each frame: Palpate beside the libraries of Debian.
#include "Rows.h"

#include "SpatialEngine.h"
#include "SpatialTruth.h"

#include "Common/RandomMeshes.h"

#include <Meshes.h>

#include <Eigen/Geometry>

#include <cmath>
#include <cstdio>
#include <limits>

namespace palpate::benchmark {
namespace {

using Eigen::Vector3d;
using Points = std::vector<Vector3d>;

enum class Place { Near, Tenth, Anywhere, Inside, Rays, Surface };

/// A row of the table. Times of the reference machine in microseconds a query, at 10,000, 100,000
/// and 1,000,000 triangles: the target, and the fastest library there.
struct QueryRow {
  const char* name;
  SpatialQuery query;
  Place place;
  std::array<std::size_t, 3> cases;
  std::array<double, 3> target, fastest;
};
constexpr QueryRow kRows[] = {
    {"closest, near", SpatialQuery::Closest, Place::Near, {4000, 4000, 4000}, {0.5, 0.8, 1.5},
     {0.61, 1.06, 1.9}},
    {"closest, 10 %", SpatialQuery::Closest, Place::Tenth, {4000, 4000, 2000}, {0.8, 2.1, 8},
     {0.99, 2.8, 10.8}},
    {"closest, anywhere", SpatialQuery::Closest, Place::Anywhere, {4000, 2000, 1000},
     {1.7, 4.5, 14}, {2.2, 5.8, 18}},
    {"signed distance, near", SpatialQuery::SignedDistance, Place::Near, {4000, 4000, 4000},
     {0.6, 1.0, 1.8}, {0.73, 1.6, 2.6}},
    {"contains", SpatialQuery::Contains, Place::Inside, {4000, 4000, 4000}, {0.22, 0.33, 0.6},
     {0.25, 0.38, 0.67}},
    {"first hit", SpatialQuery::FirstHit, Place::Rays, {4000, 4000, 4000}, {0.22, 0.40, 0.75},
     {0.20, 0.31, 0.56}},
    {"8 nearest", SpatialQuery::EightNearest, Place::Near, {2000, 2000, 2000}, {1.5, 2.2, 3.3},
     {2.1, 3.0, 4.3}},
    {"ball", SpatialQuery::Ball, Place::Near, {2000, 2000, 2000}, {1.9, 2.7, 4.3}, {2.5, 3.5, 5.6}},
    {"capsule", SpatialQuery::Capsule, Place::Surface, {500, 200, 40}, {4, 30, 220},
     {22, 181, 1358}},
    {"oriented box", SpatialQuery::Box, Place::Surface, {500, 200, 40}, {5, 45, 400},
     {20, 213, 1922}}};

/// A closed body that deforms, and what the rows need to know of it.
struct Body {
  std::string name;
  std::size_t size;  ///< which of the three
  std::vector<Triangle> triangles;
  std::vector<Points> frames;
  double diagonal, edge;  ///< L
  ShapeSizes sizes;
};

constexpr int kFrames = 4;

Body makeBody(const std::string& name, std::size_t size, int frequency) {
  const scenes::SceneMesh sphere = scenes::sphere(frequency);
  Body body{name, size, sphere.triangles, {}, 0, scenes::meanEdge({sphere}), {}};
  for (int frame = 0; frame < kFrames; ++frame) {
    Points positions = sphere.positions;
    for (Vector3d& p : positions)
      p *= 1 + 0.1 * std::sin(9 * p[0] + 0.1 * frame) * std::cos(11 * p[1] + 5 * p[2]);
    body.frames.push_back(positions);
  }
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : body.frames[0]) box.extend(p);
  body.diagonal = box.diagonal().norm();
  body.sizes = {2 * body.edge, 0.01 * body.diagonal, 0.2 * body.diagonal,
                body.diagonal * Vector3d(0.08, 0.03, 0.02)};
  return body;
}

Vector3d direction(testing::Random& random) {
  for (;;) {
    const Vector3d d = testing::randomPoint(random, -1, 1);
    if (d.squaredNorm() > 0.01 && d.squaredNorm() < 1) return d.normalized();
  }
}

std::vector<SpatialCase> makeCases(const Body& body, const Points& positions, Place place,
                                   std::size_t count, testing::Random& random) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : positions) box.extend(p);
  const auto inBox = [&](double scale) -> Vector3d {
    return box.center() +
           testing::randomPoint(random, -scale / 2, scale / 2).cwiseProduct(box.sizes());
  };
  std::vector<SpatialCase> cases(count);
  for (SpatialCase& c : cases) {
    const auto& [i, j, k] = body.triangles[random() % body.triangles.size()];
    const Vector3d &p = positions[i], &q = positions[j], &r = positions[k];
    double u = testing::uniform(random, 0, 1), v = testing::uniform(random, 0, 1);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Vector3d surface = p + u * (q - p) + v * (r - p);
    const auto offSurface = [&](double distance) -> Vector3d {
      return surface + testing::uniform(random, -distance, distance) *
                           (q - p).cross(r - p).normalized();
    };
    switch (place) {
      case Place::Near: c.point = offSurface(body.edge); break;
      case Place::Tenth: c.point = offSurface(0.1 * body.diagonal); break;
      case Place::Anywhere: c.point = inBox(2); break;
      case Place::Inside: c.point = inBox(1); break;
      case Place::Rays:
        c.point = inBox(2);
        c.direction = (inBox(1) - c.point).normalized();
        break;
      case Place::Surface:
        c.point = surface;
        c.rotation =
            Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitX(), direction(random)).matrix() *
            Eigen::AngleAxisd(testing::uniform(random, 0, 6), Vector3d::UnitX()).matrix();
        break;
    }
  }
  return cases;
}

using Engines = std::vector<std::unique_ptr<SpatialEngine>>;

Engines makeEngines() {
  Engines engines;
  engines.push_back(makePalpateQueries());
#ifdef PALPATE_BENCHMARK_BASELINES
  engines.push_back(makeEmbreeQueries(true));
  engines.push_back(makeEmbreeQueries(false));
  engines.push_back(makeCgalQueries(false));
  engines.push_back(makeCgalQueries(true));
  engines.push_back(makeBulletQueries());
#endif
  return engines;
}

/// Times of one engine: of updates in milliseconds, of each row in microseconds a query.
struct EngineTimes {
  std::vector<double> updates;
  std::array<std::vector<double>, std::size(kRows)> rows;
};

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

std::vector<EngineTimes> takeTurns(const Body& body, const Engines& engines,
                                   const RowOptions& options) {
  std::vector<EngineTimes> times(engines.size());
  std::vector<double> spent(engines.size());
  SpatialAnswers answers;
  testing::Random random(1);
  for (int repetition = 0; repetition < options.measure.repetitions; ++repetition) {
    const Points& positions = body.frames[static_cast<std::size_t>((repetition + 1) % kFrames)];
    const auto time = [&](std::size_t engine, auto&& f) {
      const double start = now();
      f();
      const double taken = now() - start;
      spent[engine] += taken;
      return taken;
    };
    for (std::size_t e = 0; e < engines.size(); ++e)
      times[e].updates.push_back(time(e, [&] { engines[e]->update(positions); }));
    for (std::size_t row = 0; row < std::size(kRows); ++row) {
      const QueryRow& r = kRows[row];
      const auto cases = makeCases(body, positions, r.place, r.cases[body.size], random);
      const auto few = std::span(cases).first(cases.size() / 8);
      for (std::size_t turn = 0; turn < engines.size(); ++turn) {
        const std::size_t e = (turn + static_cast<std::size_t>(repetition)) % engines.size();
        if (!engines[e]->answers(r.query)) continue;
        answers.clear();
        engines[e]->ask(r.query, few, body.sizes, answers);  // warms the caches
        answers.clear();
        const double taken =
            time(e, [&] { engines[e]->ask(r.query, cases, body.sizes, answers); });
        times[e].rows[row].push_back(1000 * taken / static_cast<double>(cases.size()));
      }
    }
  }
  return times;
}

}  // namespace

void spatialRows(Report& report, const RowOptions& options) {
  for (std::size_t size = 0; size < (options.quick ? 2 : 3); ++size) {
    constexpr int kFrequencies[] = {22, 71, 224};
    const char* kNames[] = {"10K", "100K", "1M"};
    const Body body = makeBody(kNames[size], size, kFrequencies[size]);
    const Engines engines = makeEngines();
    for (const auto& engine : engines) engine->prepare(body.triangles, body.frames[0]);
    const auto times = takeTurns(body, engines, options);
    report.heading("Spatial queries, " + std::to_string(body.triangles.size()) +
                   " triangles, us a query");
    std::vector<std::string> header = {""};
    for (const auto& engine : engines) header.push_back(engine->name().substr(0, 11));
    report.line(header);
    std::vector<std::string> updates = {"update, ms"};
    for (const EngineTimes& t : times) updates.push_back(milliseconds(median(t.updates)));
    report.line(updates);
    for (std::size_t row = 0; row < std::size(kRows); ++row) {
      const QueryRow& r = kRows[row];
      std::vector<std::string> cells = {r.name};
      double best = 0;
      for (std::size_t e = 0; e < engines.size(); ++e) {
        const auto& samples = times[e].rows[row];
        cells.push_back(samples.empty() ? "-" : number(median(samples)));
        if (e == 0 || samples.empty()) continue;
        const double ratio = medianRatio(times[0].rows[row], samples);
        best = std::max(best, ratio);
      }
      const double allowed = r.target[size] / r.fastest[size];
      cells.push_back("ratio " + number(best));
      cells.push_back("of " + number(allowed));
      cells.push_back(best <= allowed ? "met" : "NOT MET");
      report.line(cells);
    }
  }
}

}  // namespace palpate::benchmark
