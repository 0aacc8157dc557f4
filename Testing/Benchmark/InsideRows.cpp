// Vertices inside a closed body, beside CGAL; and a million particles around it, beside brute
// force.
#include "Common/QueryCalls.h"
#include "Rows.h"

#include "Common/RandomMeshes.h"
#include "Common/Solids.h"

#ifdef PALPATE_BENCHMARK_BASELINES
#include "BroadPhase.h"
#endif

#include <palpate/OctreeBasedCD.h>
#include <palpate/PenetrationTracker.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace palpate::benchmark {
namespace {

using Points = std::vector<Eigen::Vector3d>;

/// A closed body of 100,352 triangles, with bumps.
testing::Mesh bone() {
  testing::Mesh body = testing::sphere(225, 224, Eigen::Vector3d::Zero(), 1);
  for (Eigen::Vector3d& p : body.positions)
    p *= 0.9 + 0.05 * std::sin(9 * p[0]) * std::cos(11 * p[1] + 5 * p[2]);
  return body;
}

Points pointsIn(testing::Random& random, std::size_t count, double half) {
  Points points(count);
  for (Eigen::Vector3d& p : points) p = testing::randomPoint(random, -half, half);
  return points;
}

void insideRow(Report& report, const std::string& name, const testing::Mesh& body,
               const Points& points, int threads) {
  Settings settings;
  settings.threads = threads;
  OctreeBasedCD detection(settings);
  const GeometryId pointSet = detection.addPointSet(points),
                   id = detection.addTriangleMesh(body.positions, body.triangles);
  std::vector<double> samples;
  std::size_t inside = 0;
  double depth = 0;
  std::vector<InsideVertex> found;
  for (int i = 0; i < 7; ++i) {
    const double start = now();
    detection.queries().findInsideVertices(pointSet, id, found);
    samples.push_back(now() - start);
    inside = found.size();
    depth = 0;
    for (const InsideVertex& v : found) depth += v.depth;
  }
  samples.erase(samples.begin());  // which builds octrees
  const double each = 1000 * median(samples) / static_cast<double>(inside);
  report.line({name + ", " + std::to_string(threads) + " threads", milliseconds(each)});
  report.row("inside", name, threads, "Palpate", "us per inside vertex", each);
#ifdef PALPATE_BENCHMARK_BASELINES
  if (threads != 1) return;
  const InsideAnswer answer = insideByCgal(body.positions, body.triangles, points);
  if (answer.inside != inside || std::abs(answer.depth - depth) > 1e-9 * depth)
    report.line({"CGAL has other results", std::to_string(answer.inside), std::to_string(inside)});
  const double theirs = 1000 * answer.milliseconds / static_cast<double>(answer.inside);
  report.line({name + ", CGAL 5.5", milliseconds(theirs)});
  report.row("inside", name, 1, "CGAL 5.5 Side_of_triangle_mesh, AABB_tree", "us per inside vertex",
             theirs);
#endif
}

/// Microseconds per vertex with the update, by winding number: of the same body, where the rule for
/// closed bodies finds the same, and of the body without a tenth of its triangles.
void windingRow(Report& report, const testing::Mesh& body, const Points& points, int threads) {
  testing::Mesh open = body;
  std::erase_if(open.triangles, [&](const auto& triangle) { return triangle[0] % 10 == 0; });
  const std::pair<const char*, const testing::Mesh&> bodies[] = {{"closed", body}, {"open", open}};
  for (const auto& [name, mesh] : bodies) {
    Settings settings;
    settings.threads = threads;
    OctreeBasedCD detection(settings);
    const GeometryId pointSet = detection.addPointSet(points),
                     id = detection.addTriangleMesh(mesh.positions, mesh.triangles);
    std::vector<double> samples;
    std::vector<InsideVertex> inside;
    Points moved = mesh.positions;
    for (Eigen::Vector3d& p : moved) p += Eigen::Vector3d(1e-3, 0, 0);
    for (int i = 0; i < 4; ++i) {  // the last positions are those of the mesh
      detection.setPositions(id, i % 2 ? mesh.positions : moved);
      const double start = now();
      detection.queries().findInsideVertices(pointSet, id, inside,
                                             {.rule = InsideRule::WindingNumber});
      samples.push_back(now() - start);
    }
    samples.erase(samples.begin());
    if (&mesh == &body &&
        !std::ranges::equal(testing::insideVertices(detection, pointSet, id), inside))
      report.line({"the rules give different results"});
    const double each = 1000 * median(samples) / static_cast<double>(points.size());
    report.line({std::string("winding number, ") + name + ", " + std::to_string(threads) +
                     " threads, us per vertex with update",
                 milliseconds(each)});
    report.row("inside", std::string("winding, ") + name, threads, "Palpate",
               "us per vertex with update", each);
  }
}

/// Microseconds per probe with the update, in a solid of 162,000 tetrahedra that deforms in each
/// frame: tetrahedron and weights, or tracked penetration directions.
void embeddedRow(Report& report, const Points& probes, Engine engine, int threads) {
  testing::Random random(2);
  const testing::Solid solid = testing::cells(30, random);
  Settings settings;
  settings.threads = threads;
  settings.engine = engine;
  const bool bruteForce = engine == Engine::BruteForce;
  OctreeBasedCD detection(settings);
  const GeometryId pointSet = detection.addPointSet(probes),
                   id = detection.addTetrahedralMesh(solid.positions, solid.tetrahedra);
  PenetrationTracker tracker(pointSet, id);
  std::vector<EmbeddedVertex> found;
  std::vector<double> embedded, tracked;
  Points deformed = solid.positions;
  for (int frame = 0; frame < (bruteForce ? 2 : 9); ++frame) {
    for (std::size_t v = 0; v < deformed.size(); ++v)
      deformed[v].x() = solid.positions[v].x() + 0.4 * std::sin(deformed[v].y() + 0.2 * frame);
    const double start = now();
    detection.setPositions(id, deformed);
    detection.queries().findEmbeddedVertices(pointSet, id, found);
    embedded.push_back(now() - start);
    if (!bruteForce) tracker.update(detection.queries());
    tracked.push_back(now() - start - embedded.back());
  }
  for (auto* samples : {&embedded, &tracked}) {
    samples->erase(samples->begin());
    if (bruteForce && samples == &tracked) continue;
    const std::string name = samples == &embedded ? "embedded" : "tracked";
    const double each = 1000 * median(*samples) / static_cast<double>(probes.size());
    report.line(
        {name + (bruteForce ? ", brute force" : ", " + std::to_string(threads) + " threads"),
         milliseconds(each)});
    report.row("inside", name, threads, bruteForce ? "Palpate, brute force" : "Palpate",
               "us per probe", each);
  }
}

/// Half a box of particles that sinks into the body, all moving.
double particleFrame(const Settings& settings, const testing::Mesh& body, const Points& start,
                     int frames, std::uint64_t& hash) {
  constexpr double kRadius = 0.002;
  OctreeBasedCD detection(settings);
  const GeometryId id = detection.addTriangleMesh(body.positions, body.triangles),
                   smoke = detection.addPointSet(start, kRadius);
  detection.addCollisionPair(smoke, id, {Method::Proximity, kRadius});
  std::vector<double> samples;
  Points points = start;
  for (int frame = 0; frame < frames; ++frame) {
    for (Eigen::Vector3d& p : points) p *= 0.999;
    const double begin = now();
    detection.setPositions(smoke, points);
    detection.detectCollision();
    detection.advance();
    samples.push_back(now() - begin);
  }
  hash = detection.collisionData(smoke, id).hash();
  return median(samples);
}

}  // namespace

void insideRows(Report& report, const RowOptions& options) {
  report.heading(
      "Vertices inside a body of 100,352 triangles: us each, with depth and penetration direction");
  testing::Random random(1);
  const testing::Mesh body = bone();
  const Points deep = pointsIn(random, 20000, 0.5), around = pointsIn(random, 60000, 1.0);
  Points below = body.positions;
  for (Eigen::Vector3d& p : below) p *= 0.998;
  for (const int threads : options.threads) {
    insideRow(report, "deep", body, deep, threads);
    insideRow(report, "around", body, around, threads);
    insideRow(report, "just below", body, below, threads);
    windingRow(report, body, around, threads);
  }
  report.heading("Probes in 162,000 tetrahedra that deform: us each");
  Points probes = pointsIn(random, 100000, 15);
  for (Eigen::Vector3d& p : probes) p += Eigen::Vector3d(15, 15, 15);
  for (const int threads : options.threads) embeddedRow(report, probes, Engine::Octree, threads);
  embeddedRow(report, Points(probes.begin(), probes.begin() + 50), Engine::BruteForce, 1);
  report.heading(
      "A million particles against the body: ms per frame, millions of particles per second");
  const Points smoke = pointsIn(random, 1000000, 1.2);
  std::uint64_t hash = 0;
  for (const int threads : options.threads) {
    Settings settings;
    settings.threads = threads;
    const double frame = particleFrame(settings, body, smoke, 8, hash);
    report.line(
        {std::to_string(threads) + " threads", milliseconds(frame), milliseconds(1000 / frame)});
    report.row("points", "particles-bone", threads, "Palpate", "frame ms", frame, hash);
    report.row("points", "particles-bone", threads, "Palpate",
               "share of the target time of 20 million per second", frame / 50);
  }
  Settings bruteForce;
  bruteForce.engine = Engine::BruteForce;
  const Points few(smoke.begin(), smoke.begin() + 50);
  const double taken = particleFrame(bruteForce, body, few, 1, hash) * 20000;
  report.line({"brute force, from 50 particles", milliseconds(taken)});
  report.row("points", "particles-bone", 1, "Palpate, brute force", "frame ms", taken);
}

}  // namespace palpate::benchmark
