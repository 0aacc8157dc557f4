#include <palpate/ConstraintRows.h>

#include "Common/TestGeometry.h"

// The rows of a mesh that slides over another one, against the distance between the two meshes that
// brute force over all features finds: no row asks for more than this distance needs.

namespace palpate::testing {
namespace {

constexpr double kHeldGap = 0.2;

/// Of n by n squares with a size of 1, turned about the z axis.
Mesh floorOf(int n, double turn, const std::function<double(double, double)>& height) {
  Mesh mesh;
  const auto id = [n](int i, int j) { return static_cast<std::uint32_t>(j * (n + 1) + i); };
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) {
      const double x = i - 0.5 * n, y = j - 0.5 * n;
      const double u = std::cos(turn) * x - std::sin(turn) * y,
                   v = std::sin(turn) * x + std::cos(turn) * y;
      mesh.positions.push_back({u, v, height(u, v)});
    }
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      mesh.triangles.push_back({id(i, j), id(i + 1, j), id(i + 1, j + 1)});
      mesh.triangles.push_back({id(i, j), id(i + 1, j + 1), id(i, j + 1)});
    }
  return mesh;
}
double flatHeight(double, double) { return 0; }

/// A closed disk with a bottom at z = 0.
Mesh puckOf(std::uint32_t corners, double radius, double height) {
  Mesh mesh;
  for (const double z : {0.0, height})
    for (std::uint32_t i = 0; i < corners; ++i) {
      const double angle = 2 * 3.14159 * i / corners;
      mesh.positions.push_back({radius * std::cos(angle), radius * std::sin(angle), z});
    }
  const std::uint32_t bottom = 2 * corners, top = bottom + 1;
  mesh.positions.push_back({0, 0, 0});
  mesh.positions.push_back({0, 0, height});
  for (std::uint32_t i = 0; i < corners; ++i) {
    const std::uint32_t a = i, b = (i + 1) % corners, c = corners + a, d = corners + b;
    for (const Triangle& t : {Triangle{b, a, bottom}, {c, d, top}, {a, b, d}, {a, d, c}})
      mesh.triangles.push_back(t);
  }
  return mesh;
}

/// By brute force.
double distanceOf(const TestGeometry& floor, const TestGeometry& tool, const Positions& at) {
  OctreeBasedCD collisions(settingsOf(Engine::BruteForce));
  const GeometryId below = addMesh(collisions, floor),
                   above = collisions.addTriangleMesh(at, tool.triangles);
  return collisions.queries().distance(below, above).distance;
}

Positions placedAt(const TestGeometry& mesh, const Vector3d& place) {
  Positions positions = mesh.positions;
  for (Vector3d& p : positions) p += place;
  return positions;
}

/// A tool that slides in steps. At the end of each it is at least the gap away from the floor.
struct Slide {
  TestGeometry floor, tool;
  std::vector<Positions> positions;  ///< of the tool, after each step
  std::vector<double> distances;

  /// follows: the tool is lowered to the gap in each step.
  Slide(const Mesh& below, const Mesh& above, const Vector3d& start, const Vector3d& step,
        bool follows = false)
      : floor(testGeometry(below)), tool(testGeometry(above)) {
    for (int i = 0; i < 5; ++i) {
      Vector3d place = start + i * step;
      for (int k = 0; k < (follows ? 12 : 0); ++k)
        place.z() -= distanceOf(floor, tool, placedAt(tool, place)) - kHeldGap - 1e-12;
      positions.push_back(placedAt(tool, place));
      distances.push_back(distanceOf(floor, tool, positions.back()));
    }
  }
};

/// How much more than the distance needs a row asks for, at most.
double mostExcess(const Slide& slide, const PairSettings& settings, bool toolFirst,
                  std::size_t& rowCount) {
  OctreeBasedCD collisions(settingsOf(Engine::Octree));
  const GeometryId floor = addMesh(collisions, slide.floor), tool = addMesh(collisions, slide.tool);
  const auto [a, b] = toolFirst ? std::array{tool, floor} : std::array{floor, tool};
  collisions.addCollisionPair(a, b, settings);
  const auto size = static_cast<std::uint32_t>(slide.floor.positions.size());
  double most = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < slide.positions.size(); ++i) {
    const Positions& now = slide.positions[i];
    collisions.setPositions(tool, slide.positions[i - 1], now);
    collisions.detectCollision();
    std::vector<ConstraintRow> rows;
    collisions.collisionData(a, b).appendRows(rows, toolFirst ? size : 0, toolFirst ? 0 : size);
    Positions all = slide.floor.positions;
    all.insert(all.end(), now.begin(), now.end());
    const double need = std::max(0.0, kHeldGap - slide.distances[i]);
    for (const ConstraintRow& row : rows) most = std::max(most, kHeldGap - row.gap(all) - need);
    rowCount += rows.size();
    collisions.advance();
  }
  return most;
}

void expectNoExcess(const Slide& slide, const std::string& name) {
  std::size_t rows = 0;
  for (const Method method : {Method::Auto, Method::Continuous, Method::Proximity})
    for (const bool smooth : {false, true})
      for (const bool toolFirst : {false, true}) {
        PairSettings settings{method, 2 * kHeldGap};
        settings.smoothNormals = smooth;
        EXPECT_LE(mostExcess(slide, settings, toolFirst, rows), 1e-9)
            << name << ", " << toString(method) << ", smooth " << smooth << ", tool first "
            << toolFirst;
      }
  EXPECT_GT(rows, 40u) << name;
}

TEST(FlatFloors, DoNotPushWhatSlidesOverThemAtTheGap) {
  const Mesh floor = floorOf(7, 0, flatHeight), box = puckOf(4, 1.2, 2), puck = puckOf(9, 1.1, 0.1);
  for (const double length : {0.05, 0.3, 1.0}) {
    const std::string name = "step " + std::to_string(length);
    const Vector3d along(length, 0, 0), across(0.6 * length, 0.8 * length, 0);
    expectNoExcess({floor, floorOf(3, 0, flatHeight), {0, 0, kHeldGap}, along}, "lines " + name);
    expectNoExcess({floor, floorOf(3, 0, flatHeight), {0.5, 0.5, kHeldGap}, across},
                   "cells " + name);
    expectNoExcess({floor, floorOf(3, 0.4, flatHeight), {0.1, 0.3, kHeldGap}, across},
                   "turned " + name);
    expectNoExcess({floor, box, {-1, 0, kHeldGap}, along}, "box " + name);
    expectNoExcess({floor, puck, {-1, 0.05, kHeldGap}, across}, "puck " + name);
    expectNoExcess({floor, box, {4.3, 3.2, kHeldGap}, -across}, "onto a border " + name);
  }
}

TEST(FlatFloors, BentOnesPushNoMoreThanTheGapNeeds) {
  const Mesh puck = puckOf(7, 0.6, 0.3),
             wave =
                 floorOf(6, 0, [](double x, double y) { return 0.15 * std::sin(x) * std::cos(y); }),
             roof = floorOf(6, 0, [](double x, double) { return -0.3 * std::abs(x); }),
             valley = floorOf(6, 0, [](double x, double) { return 0.3 * std::abs(x); });
  std::size_t number = 0;
  for (const double length : {0.05, 0.3, 1.0})
    for (const auto& [floor, name] : {std::pair(wave, "wave"), {roof, "roof"}, {valley, "valley"}})
      if (!isLeftOut(number++))
        expectNoExcess({floor, puck, {-1.5, 0.2, 1}, {length, 0.1 * length, 0}, true},
                       name + std::string(" step ") + std::to_string(length));
}

}  // namespace
}  // namespace palpate::testing
