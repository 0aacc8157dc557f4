// palpate_sizes: time and memory of scenes of extreme sizes, as the table of Docs/Memory.md.
//
// palpate_sizes [--limit BYTES] [NUMBER...]   numbers of scenes, from 0; without them: all
#include <palpate/OctreeBasedCD.h>

#include <Eigen/Core>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace palpate;
using Eigen::Vector3d;

struct Mesh {
  std::vector<Vector3d> positions;
  std::vector<Triangle> triangles;

  GeometryId addTo(OctreeBasedCD& detection) const {
    return detection.addTriangleMesh(positions, triangles);
  }
};

/// n triangles in planes at right angles to axis 0 or 1. All triangles of two axes cross.
Mesh fan(std::uint32_t n, int axis) {
  Mesh mesh;
  for (std::uint32_t i = 0; i < n; ++i) {
    for (const auto& [along, up] : {std::pair(-1.0, -1.0), {1.0, -1.0}, {0.0, 1.0}}) {
      Vector3d p(along, along, up);
      p[axis] = 0.5 * i / n - 0.25;
      mesh.positions.push_back(p);
    }
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

/// A waved sheet of 2 n n triangles over a square of this side.
Mesh sheet(std::uint32_t n, double side, double height, const Vector3d& at) {
  Mesh mesh;
  for (std::uint32_t j = 0; j <= n; ++j)
    for (std::uint32_t i = 0; i <= n; ++i)
      mesh.positions.push_back(at + Vector3d(side * i / n, side * j / n,
                                             height * std::sin(0.3 * i) * std::cos(0.2 * j)));
  for (std::uint32_t j = 0; j < n; ++j)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t v = j * (n + 1) + i;
      mesh.triangles.push_back({v, v + 1, v + n + 2});
      mesh.triangles.push_back({v, v + n + 2, v + n + 1});
    }
  return mesh;
}

/// n triangles around one vertex, in a cone of this height.
Mesh star(std::uint32_t n, double height) {
  Mesh mesh;
  mesh.positions.push_back({0, 0, height});
  for (std::uint32_t i = 0; i < n; ++i) {
    mesh.positions.push_back({std::cos(6.283185307 * i / n), std::sin(6.283185307 * i / n), 0});
    mesh.triangles.push_back({0, 1 + i, 1 + (i + 1) % n});
  }
  return mesh;
}

/// n triangles without common vertices. Triangle i has edges of about `width` 2^e and is this far
/// from the origin: `distance` 2^e. The exponents e are evenly spaced from `first` to `last`.
struct Spacing {
  double first, last, width, distance;
};
Mesh spaced(std::uint32_t n, const Spacing& spacing) {
  Mesh mesh;
  for (std::uint32_t i = 0; i < n; ++i) {
    const double unit = std::exp2(spacing.first + (spacing.last - spacing.first) * i / n);
    const double turn = 2.4 * i;
    const Vector3d out(std::cos(turn), std::sin(turn), 0.3), u(-std::sin(turn), std::cos(turn), 0),
        v = out.cross(u);
    for (const auto& [x, y] : {std::pair(1.0, 0.0), {-0.5, 0.8}, {-0.5, -0.8}})
      mesh.positions.push_back(unit * (spacing.distance * out + spacing.width * (x * u + y * v)));
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

/// n triangles whose corners are all at one point, without common vertices.
Mesh atOnePoint(std::uint32_t n) {
  Mesh mesh = spaced(n, {0, 0, 0, 0});
  for (Vector3d& p : mesh.positions) p = Vector3d(0.25, 0.5, 0.75);
  return mesh;
}

void addSelfPair(OctreeBasedCD& detection, const Mesh& mesh, const PairSettings& settings) {
  const GeometryId id = mesh.addTo(detection);
  if (settings.method == Method::Auto || settings.method == Method::Continuous) {
    std::vector<Vector3d> before = mesh.positions;
    for (Vector3d& p : before) p *= 1.001;
    detection.setPositions(id, before, mesh.positions);
  }
  detection.addCollisionPair(id, id, settings);
}

void addPair(OctreeBasedCD& detection, const Mesh& a, const Mesh& b, const PairSettings& settings) {
  const GeometryId first = a.addTo(detection);
  detection.addCollisionPair(first, b.addTo(detection), settings);
}

struct Scene {
  std::string name;
  std::function<void(OctreeBasedCD&)> add;
  std::size_t limit = 0;  ///< Settings::memoryLimit
};

std::vector<Scene> scenes() {
  const auto crossing = [](Method method) {
    return [=](OctreeBasedCD& d) { addPair(d, fan(4000, 0), fan(4000, 1), {method}); };
  };
  const auto identical = [](OctreeBasedCD& d) {
    Mesh mesh;
    for (std::uint32_t i = 0; i < 2000; ++i) {
      mesh.positions.insert(mesh.positions.end(), {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
      mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    const GeometryId id = mesh.addTo(d);
    d.addCollisionPair(id, id, {Method::Intersection});
  };
  const auto many = [](OctreeBasedCD& d) {
    const int n = 71;  // 71 by 71 patches, each with its neighbours to the right and above
    std::vector<GeometryId> ids;
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i)
        ids.push_back(sheet(4, 1.1, 0.02, {double(i), double(j), 0.01 * ((i + j) % 3)}).addTo(d));
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const auto at = static_cast<std::size_t>(j * n + i);
        if (i + 1 < n) d.addCollisionPair(ids[at], ids[at + 1], {Method::Proximity, 0.02});
        if (j + 1 < n) d.addCollisionPair(ids[at], ids[at + n], {Method::Proximity, 0.02});
      }
  };
  const auto stars = [](Method method, double thickness) {
    return [=](OctreeBasedCD& d) {
      const GeometryId id = star(10000, 0.5).addTo(d);
      d.addCollisionPair(id, id, {method, thickness});
    };
  };
  const auto self = [](const Mesh& mesh, Method method, double thickness) {
    return [=](OctreeBasedCD& d) { addSelfPair(d, mesh, {method, thickness}); };
  };
  const auto point = [=](Method method, double thickness) {
    return self(atOnePoint(1000), method, thickness);
  };
  // The whole range of lengths, and a part that is within the range of the octree's floats at one
  // end only.
  const Spacing sizes{-1074, 996, 1, 0}, distances{-1074, 996, 0.02, 1}, part{-400, 0, 0.02, 1};
  const auto resting = [](OctreeBasedCD& d) {
    const Mesh mesh = sheet(130, 1, 0, {0, 0, 0});
    const GeometryId id = d.addTriangleMesh({}, {});
    PairSettings settings{Method::Proximity, 0.001};
    settings.restDistance = 0.3;
    d.addCollisionPair(id, id, settings);
    d.setTriangles(id, mesh.positions, mesh.triangles);
  };
  return {
      {"20,000,000 triangles with 20,000, Proximity",
       [](OctreeBasedCD& d) {
         addPair(d, sheet(3163, 100, 0.1, {0, 0, 0}), sheet(100, 10, 0.1, {40, 40, 0.05}),
                 {Method::Proximity, 0.01});
       }},
      {"4,000 triangles crossing 4,000, Intersection", crossing(Method::Intersection)},
      {"2,000 identical triangles, Intersection", identical},
      {"5,041 geometries with 9,940 pairs, Proximity", many},
      {"10,000 triangles at one vertex, Intersection", stars(Method::Intersection, 0)},
      {"10,000 triangles at one vertex, Proximity", stars(Method::Proximity, 1e-4)},
      {"1,000 triangles at one point, Intersection", point(Method::Intersection, 0)},
      {"1,000 triangles at one point, Proximity", point(Method::Proximity, 1e-3)},
      {"1,000 triangles at one point, Auto", point(Method::Auto, 1e-3)},
      {"1,000 triangles at one point with 1,000, Proximity",
       [](OctreeBasedCD& d) {
         addPair(d, atOnePoint(1000), atOnePoint(1000), {Method::Proximity, 1e-3});
       }},
      {"10,000 triangles at one point, Intersection, limit 2 GB",
       self(atOnePoint(10000), Method::Intersection, 0), 2'000'000'000},
      {"1,000 nested triangles of sizes 2^-1074 to 2^996, Intersection",
       self(spaced(1000, sizes), Method::Intersection, 0)},
      {"10,000 triangles at distances 2^-1074 to 2^996, Intersection",
       self(spaced(10000, distances), Method::Intersection, 0)},
      {"10,000 triangles at distances 2^-1074 to 2^996, Proximity",
       self(spaced(10000, distances), Method::Proximity, 0x1p-1060)},
      {"10,000 triangles at distances 2^-1074 to 2^996, Continuous",
       self(spaced(10000, distances), Method::Continuous, 0)},
      {"10,000 triangles at distances 2^-400 to 1, Proximity",
       self(spaced(10000, part), Method::Proximity, 0x1p-450)},
      {"10,000 triangles at distances 2^-400 to 1, Continuous",
       self(spaced(10000, part), Method::Continuous, 0)},
      {"17,161 vertices, restDistance a third of the sheet, Proximity", resting},
  };
}

double seconds() {
  using Clock = std::chrono::steady_clock;
  return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}

void measure(const Scene& scene, std::size_t limit) {
  Settings settings;
  settings.memoryLimit = limit > 0 ? limit : scene.limit;
  OctreeBasedCD detection(settings);
  const double start = seconds();
  const std::clock_t clock = std::clock();
  std::string outcome, pairs = "-";
  double added = start, first = start;
  try {
    scene.add(detection);
    added = seconds();
    detection.detectCollision();
    first = seconds();
    outcome = std::to_string(detection.statistics().contacts) + " contacts";
    pairs = std::to_string(detection.statistics().candidatePairs);
  } catch (const Error& error) {
    first = seconds();
    outcome = error.what();
  }
  const std::clock_t end = std::clock();
  const double mega = 1e-6;
  const double held = static_cast<double>(detection.memoryUse().total);
  const double peak = static_cast<double>(detection.statistics().peakMemory.total);
  detection.releaseMemory();
  std::printf("| %s | %.2f | %.2f | %.2f | %.0f | %.0f | %.0f | %s | %s |\n", scene.name.c_str(),
              added - start, first - added, static_cast<double>(end - clock) / CLOCKS_PER_SEC,
              mega * peak, mega * held, mega * static_cast<double>(detection.memoryUse().total),
              pairs.c_str(), outcome.c_str());
  std::fflush(stdout);
}

}  // namespace

int main(int count, char** arguments) {
  std::size_t limit = 0;
  std::vector<std::size_t> chosen;
  for (int i = 1; i < count; ++i) {
    if (std::string(arguments[i]) == "--limit" && i + 1 < count)
      limit = std::strtoull(arguments[++i], nullptr, 10);
    else
      chosen.push_back(std::strtoull(arguments[i], nullptr, 10));
  }
  std::printf(
      "| scene | add, s | first frame, s | processor, s | peak, MB | held, MB | released, MB | "
      "element pairs | result |\n");
  std::printf("|---|---|---|---|---|---|---|---|---|\n");
  const std::vector<Scene> all = scenes();
  for (std::size_t i = 0; i < all.size(); ++i)
    if (chosen.empty() || std::find(chosen.begin(), chosen.end(), i) != chosen.end())
      measure(all[i], limit);
}
