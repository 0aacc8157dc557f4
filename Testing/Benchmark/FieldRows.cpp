// Distance fields of closed bodies, beside OpenVDB with voxels as large as the error bound.
#include "FieldBaseline.h"
#include "Rows.h"

#include "Common/RandomMeshes.h"
#include "Meshes.h"
#include "Scenes.h"

#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>

namespace palpate::benchmark {
namespace {

using Eigen::Vector3d;
using scenes::SceneMesh;

struct Body {
  std::string name;
  std::function<SceneMesh()> make;
  bool isLarge = false;  ///< timed only if the option `scenes` names it
};

/// A sphere of about 2 across² triangles with bumps.
SceneMesh bumpySphere(std::size_t across, const Vector3d& size) {
  const testing::Mesh body = testing::sphere(across + 1, across, Vector3d::Zero(), 1);
  SceneMesh mesh{body.positions, body.triangles};
  for (Vector3d& p : mesh.positions)
    p = (0.9 + 0.05 * std::sin(9 * p[0]) * std::cos(11 * p[1] + 5 * p[2])) * p.cwiseProduct(size);
  return mesh;
}

SceneMesh torus(std::uint32_t around, std::uint32_t across) {
  SceneMesh mesh;
  const auto at = [&](std::uint32_t i, std::uint32_t j) {
    return i % around * across + j % across;
  };
  for (std::uint32_t i = 0; i < around; ++i)
    for (std::uint32_t j = 0; j < across; ++j) {
      const double u = 2 * std::numbers::pi * i / around, v = 2 * std::numbers::pi * j / across,
                   r = 1 + 0.3 * std::cos(v);
      mesh.positions.emplace_back(r * std::cos(u), r * std::sin(u), 0.3 * std::sin(v));
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

SceneMesh box() {
  SceneMesh mesh;
  for (int v = 0; v < 8; ++v)
    mesh.positions.emplace_back(v & 1 ? 1.0 : -1.0, v & 2 ? 0.7 : -0.7, v & 4 ? 0.4 : -0.4);
  mesh.triangles = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}};
  return mesh;
}

const std::vector<Body>& bodies() {
  static const std::vector<Body> all{{"sphere with bumps",
                                      [] {
                                        return bumpySphere(71, {1, 1, 1});
                                      }},
                                     {"torus", [] { return torus(125, 40); }},
                                     {"box", box},
                                     {"liver", [] { return scenes::liver(22); }},
                                     {"bone of a million triangles",
                                      [] {
                                        return bumpySphere(708, {1, 1, 4});
                                      },
                                      true}};
  return all;
}

/// Shares of the diagonal.
struct Accuracy {
  double bound, band;
  std::string name() const {
    char text[64];
    std::snprintf(text, sizeof text, "%g %%, band %g %%", 100 * bound, 100 * band);
    return text;
  }
};

/// Points at random within about a band of the surface, and their exact distances.
struct Samples {
  std::vector<Vector3d> points;
  std::vector<SignedDistance> exact;

  Samples(const SceneMesh& mesh, double band) : points(100000), exact(20000) {
    testing::Random random(1);
    for (Vector3d& p : points) {
      const auto& [a, b, c] = mesh.triangles[random() % mesh.triangles.size()];
      double s = testing::uniform(random, 0, 1), t = testing::uniform(random, 0, 1);
      if (s + t > 1) s = 1 - s, t = 1 - t;
      p = mesh.positions[a] + s * (mesh.positions[b] - mesh.positions[a]) +
          t * (mesh.positions[c] - mesh.positions[a]) +
          testing::randomPoint(random, -0.5, 0.5) * band;
    }
    OctreeBasedCD detection;
    const GeometryId id = detection.addTriangleMesh(mesh.positions, mesh.triangles);
    detection.queries().signedDistances(id, std::span(points).first(exact.size()), exact);
  }
  /// The largest error in the band.
  double errorOf(std::span<const double> values, double band) const {
    double error = 0;
    for (std::size_t i = 0; i < exact.size(); ++i)
      if (std::abs(exact[i].distance) <= band)
        error = std::max(error, std::abs(values[i] - exact[i].distance));
    return error;
  }
};

/// The median, in milliseconds. Slow calls are made once.
template <class F>
double timeOf(int repetitions, F&& f) {
  std::vector<double> times;
  for (int i = 0; i < repetitions; ++i) {
    const double begin = now();
    f();
    times.push_back(now() - begin);
    if (times.back() > 1500) break;
  }
  return median(times);
}

struct Row {
  std::string engine;
  std::vector<double> builds;  ///< ms, for each number of threads
  std::size_t bytes = 0;
  std::optional<double> value;  ///< ns of a call for one point
  double values = 0;            ///< ns a point of a call for many
  double error = 0;             ///< over the bound
};

void print(Report& report, const RowOptions& options, const std::string& scene, const Row& row) {
  std::vector<std::string> line{"  " + row.engine};
  const auto add = [&](int threads, const std::string& metric, double value) {
    line.push_back(milliseconds(value));
    report.row("fields", scene, threads, row.engine, metric, value);
  };
  for (std::size_t i = 0; i < row.builds.size(); ++i)
    add(options.threads[i], "build ms", row.builds[i]);
  add(1, "MB", 1e-6 * static_cast<double>(row.bytes));
  if (row.value)
    add(1, "value ns", *row.value);
  else
    line.push_back("-");
  add(1, "values ns", row.values);
  add(1, "error / bound", row.error);
  report.line(line);
}

/// Returns its error over the bound.
double palpateRow(Report& report, const RowOptions& options, const std::string& scene,
                  const SceneMesh& mesh, const Samples& samples, double bound, double band) {
  Row row;
  row.engine = "Palpate";
  std::optional<DistanceField> field;
  for (const int threads : options.threads)
    row.builds.push_back(timeOf(options.measure.repetitions, [&] {
      field = DistanceField::build({mesh.positions, mesh.triangles},
                                   {.errorBound = bound, .band = band, .threads = threads});
    }));
  row.bytes = field->bytes();
  std::vector<double> out(samples.points.size());
  const double perPoint = 1e6 / static_cast<double>(out.size());
  row.value = perPoint * timeOf(7, [&] {
                for (std::size_t i = 0; i < out.size(); ++i)
                  out[i] = field->value(samples.points[i]);
              });
  row.values = perPoint * timeOf(7, [&] { field->values(samples.points, out); });
  row.error = samples.errorOf(out, band) / bound;
  print(report, options, scene, row);
  report.row("fields", scene, 1, row.engine, "cells", static_cast<double>(field->cells()));
  return row.error;
}

#ifdef PALPATE_BENCHMARK_OPENVDB
void openVdbRow(Report& report, const RowOptions& options, const std::string& scene,
                const SceneMesh& mesh, const Samples& samples, double bound, double band,
                double voxel, const char* name) {
  Row row;
  row.engine = name;
  std::unique_ptr<FieldBaseline> field;
  for (const int threads : options.threads)
    row.builds.push_back(timeOf(options.measure.repetitions, [&] {
      field = buildOpenVdb(mesh.positions, mesh.triangles, voxel, band, threads);
    }));
  row.bytes = field->bytes();
  std::vector<double> out(samples.points.size());
  row.values = 1e6 / static_cast<double>(out.size()) *
               timeOf(7, [&] { field->values(samples.points, out); });
  row.error = samples.errorOf(out, band) / bound;
  print(report, options, scene, row);
}

/// The largest voxel, in steps of 5 %, whose measured error over the bound is at most this.
double voxelOfError(const SceneMesh& mesh, const Samples& samples, double bound, double band,
                    double error) {
  std::vector<double> out(samples.exact.size());
  double found = bound;
  for (double voxel = bound; voxel <= band; voxel *= 1.05) {
    buildOpenVdb(mesh.positions, mesh.triangles, voxel, band, 1)
        ->values(std::span(samples.points).first(out.size()), out);
    if (samples.errorOf(out, band) > error * bound) break;
    found = voxel;
  }
  return found;
}
#endif

/// OpenVDB stores every voxel of its band. Bands of more voxels than this are not timed.
constexpr double kWidestBand = 10;

void fieldRow(Report& report, const RowOptions& options, const std::string& name,
              const SceneMesh& mesh, const Accuracy& accuracy) {
  Eigen::AlignedBox3d extent;
  for (const Vector3d& p : mesh.positions) extent.extend(p);
  const double diagonal = extent.diagonal().norm(), bound = accuracy.bound * diagonal,
               band = accuracy.band * diagonal;
  const Samples samples(mesh, band);
  const std::string scene = name + ", " + accuracy.name();
  report.line({scene});
  [[maybe_unused]] const double error =
      palpateRow(report, options, scene, mesh, samples, bound, band);
#ifdef PALPATE_BENCHMARK_OPENVDB
  if (band > kWidestBand * bound) return;
  openVdbRow(report, options, scene, mesh, samples, bound, band, bound, "OpenVDB 10");
  openVdbRow(report, options, scene, mesh, samples, bound, band,
             voxelOfError(mesh, samples, bound, band, error), "OpenVDB 10, equal error");
#endif
}

}  // namespace

void fieldRows(Report& report, const RowOptions& options) {
  report.heading("Distance fields: milliseconds of a build, MB, nanoseconds of a lookup");
#ifndef PALPATE_BENCHMARK_OPENVDB
  report.line({"without OpenVDB, which was not found"});
#endif
  std::vector<std::string> header{"bound and band as shares of the diagonal"};
  for (const int threads : options.threads) header.push_back("build, " + std::to_string(threads));
  for (const char* column : {"MB", "value()", "values()", "error/bound"}) header.push_back(column);
  report.line(header);
  for (const auto& [name, make, isLarge] : bodies()) {
    if (isLarge && options.scenes.empty()) continue;
    std::optional<SceneMesh> mesh;
    for (const Accuracy& accuracy :
         {Accuracy{0.01, 0.03}, Accuracy{0.01, 0.05}, Accuracy{0.003, 0.009},
          Accuracy{0.001, 0.003}, Accuracy{0.001, 0.05}}) {
      if (!isWanted(name + (", " + accuracy.name()), options.scenes)) continue;
      if (isLarge && accuracy.band != 0.003) continue;
      if (!mesh) mesh = make();
      fieldRow(report, options, name, *mesh, accuracy);
    }
  }
}

}  // namespace palpate::benchmark
