#include "Scenes.h"

#include <Eigen/Geometry>

#include <cmath>
#include <numbers>

namespace palpate::scenes {

using Eigen::Vector3d;
using std::numbers::pi;

namespace {

/// 0 at the ends of the period, 1 in its middle.
double swell(double time) { return 0.5 - 0.5 * std::cos(2 * pi * time); }

Vector3d still(const Vector3d& rest, double) { return rest; }

/// Sets the thickness from the edges in a frame.
Scene withThickness(Scene scene, int frame) {
  std::vector<SceneMesh> meshes = scene.meshes;
  for (std::size_t m = 0; m < meshes.size(); ++m) scene.positions(frame, m, meshes[m].positions);
  scene.thickness = meanEdge(meshes) / 20;
  return scene;
}

}  // namespace

void Scene::positions(int frame, std::size_t mesh, std::vector<Vector3d>& out) const {
  const double time = static_cast<double>(frame % frames) / frames;
  const std::vector<Vector3d>& rest = meshes[mesh].positions;
  out.resize(rest.size());
  for (std::size_t i = 0; i < rest.size(); ++i) out[i] = motions[mesh](rest[i], time);
}

std::size_t Scene::triangleCount() const {
  std::size_t count = 0;
  for (const SceneMesh& mesh : meshes) count += mesh.triangles.size();
  return count;
}

Scene clothOnBall() {
  constexpr double kRadius = 0.5;
  SceneMesh ball = sphere(35);
  for (Vector3d& p : ball.positions) p *= kRadius;
  // Along each ray from the sheet's middle: on the ball up to `wrapped`, then straight along the
  // tangent, where folds take up the spare circumference.
  const Motion drape = [](const Vector3d& rest, double time) -> Vector3d {
    const double along = rest.head<2>().norm(), angle = std::atan2(rest.y(), rest.x());
    const double radius =
        kRadius * (1.002 + 0.004 * std::sin(9 * rest.x() + 2 * pi * time) * std::sin(7 * rest.y()));
    const double wrapped = 0.3 + 1.2 * swell(time);  // radians
    const double onBall = std::min(along / kRadius, wrapped), beyond = along - kRadius * onBall;
    const double fold = 0.3 * beyond * std::sin(12 * angle) * std::sin(wrapped);
    const double across = radius * std::sin(onBall) + beyond * std::cos(wrapped) + fold;
    const double height = radius * std::cos(onBall) - beyond * std::sin(wrapped);
    return {across * std::cos(angle), across * std::sin(angle), height};
  };
  return withThickness({"cloth", {sheet(237), std::move(ball)}, {drape, still}, {{0, 1}}}, 0);
}

Scene gradedBodies(int around) {
  const SceneMesh body = gradedSphere(around, 1e-4);
  const auto bumpy = [](const Vector3d& rest, double phase) -> Vector3d {
    return rest * (1 + 0.05 * std::sin(5 * rest.x()) * std::sin(4 * rest.y()) * std::cos(phase));
  };
  const Motion below = [bumpy](const Vector3d& rest, double time) {
    return bumpy(rest, 2 * pi * time);
  };
  const Motion above = [bumpy](const Vector3d& rest, double time) -> Vector3d {
    const Vector3d flipped(rest.x(), -rest.y(), -rest.z());
    const double side = 2 * pi * time;
    return bumpy(flipped, 1 - side) + Vector3d(0.01 * std::cos(side), 0.01 * std::sin(side), 1.992);
  };
  return withThickness({"uneven", {body, body}, {below, above}, {{0, 1}}}, 0);
}

Scene unevenBodies() { return gradedBodies(119); }

Scene interleavedSheets(std::size_t triangles) {
  const int cells =
      std::max(1, static_cast<int>(std::lround(std::sqrt(static_cast<double>(triangles) / 4))));
  const double edge = 2.0 / cells;
  const auto wave = [](const Vector3d& rest, double phase) {
    return 0.15 * std::sin(6 * rest.x() + phase) * std::sin(5 * rest.y() + 0.5 - phase);
  };
  const Motion lower = [wave](const Vector3d& rest, double time) -> Vector3d {
    return {rest.x(), rest.y(), wave(rest, 2 * pi * time)};
  };
  const Motion upper = [wave, edge](const Vector3d& rest, double time) -> Vector3d {
    const double phase = 2 * pi * time;
    const double gap = 4 * edge * std::sin(11 * rest.x() - phase) * std::sin(9 * rest.y() + phase);
    return {rest.x() + 0.37 * edge, rest.y() + 0.23 * edge, wave(rest, phase) + gap};
  };
  return withThickness({"sheets", {sheet(cells), sheet(cells)}, {lower, upper}, {{0, 1}}}, 0);
}

Scene foldedCloth() {
  const Motion fold = [](const Vector3d& rest, double time) -> Vector3d {
    const double pushed = swell(time), angle = 2 * pi * 5 * rest.x();
    // An overhanging wave: its crests lean over its troughs as the sheet is pushed together.
    return {(1 - 0.8 * pushed) * rest.x() - 0.03 * pushed * std::sin(2 * angle) +
                0.05 * std::sin(2 * rest.y()),
            rest.y() + 0.03 * std::sin(angle + 3 * rest.y()), 0.1 * pushed * std::sin(angle)};
  };
  return withThickness({"folded cloth", {sheet(95)}, {fold}, {{0, 0}}}, 60);
}

Scene twistedRods() {
  constexpr double kRadius = 0.1;
  SceneMesh rods;
  for (int i = 0; i < 7; ++i) {
    SceneMesh rod = tube(96, 60);
    const double angle = pi / 3 * i;
    const Vector3d centre =
        i == 6 ? Vector3d(0, 0, 0) : Vector3d(2 * std::cos(angle), 2 * std::sin(angle), 0);
    for (Vector3d& p : rod.positions) {
      p += centre;
      p.head<2>() *= kRadius;
    }
    append(rods, rod);
  }
  const Motion twist = [](const Vector3d& rest, double time) -> Vector3d {
    const double wound = swell(time), squeezed = 1 - 0.15 * wound;
    const Eigen::AngleAxisd turn(1.5 * pi * wound * rest.z(), Vector3d::UnitZ());
    return turn * Vector3d(squeezed * rest.x(), squeezed * rest.y(), rest.z());
  };
  return withThickness({"twisted rods", {std::move(rods)}, {twist}, {{0, 0}}}, 60);
}

}  // namespace palpate::scenes
