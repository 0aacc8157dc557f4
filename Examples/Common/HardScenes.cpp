#include "Scenes.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::scenes {

using Eigen::Vector3d;
using std::numbers::pi;

namespace {

constexpr int kFrames = 24;

Scene hardScene(std::string name, std::vector<SceneMesh> meshes, std::vector<Motion> motions) {
  Scene scene{std::move(name), std::move(meshes), std::move(motions), {{0, 1}}};
  scene.thickness = meanEdge(scene.meshes) / 20;
  scene.frames = kFrames;
  return scene;
}

double ripple(const Vector3d& p, double phase) {
  return std::sin(9 * p.x() + phase) * std::sin(7 * p.y() - phase);
}

/// Two soft bodies whose flattened sides meet and separate by a tenth of the thickness per frame.
Scene slowPressing(std::string name, const Vector3d& at) {
  const auto press = [at](double side) -> Motion {
    return [at, side](const Vector3d& rest, double time) -> Vector3d {
      const double gap = 0.004 * std::cos(2 * pi * time);
      Vector3d p = rest;
      p.z() = std::min(p.z(), 0.85 + 0.003 * ripple(rest, 2 * pi * time + side)) - 0.85;
      p.z() = side * (p.z() - gap / 2);
      if (side < 0) p = Vector3d(p.y() + 0.03, p.x() + 0.02, p.z());
      return at + p;
    };
  };
  return hardScene(std::move(name), {sphere(7), sphere(7)}, {press(1), press(-1)});
}

/// A needle driven through a membrane of two layers, fastest where it passes: at most half its
/// length moves through in a frame.
Scene fastNeedle() {
  SceneMesh needle = tube(8, 8), membrane = sheet(22), layer = sheet(22);
  for (Vector3d& p : needle.positions) {
    const double radius = p.z() < -0.9 ? 0.0015 : 0.03;
    p = Vector3d(radius * p.x(), radius * p.y(), 0.15 * p.z());
  }
  for (Vector3d& p : layer.positions) p.z() = 0.03;
  append(membrane, layer);
  const Motion drive = [](const Vector3d& rest, double time) -> Vector3d {
    const Eigen::AngleAxisd tilt(0.3 * std::sin(2 * pi * time), Vector3d(0.6, 0.8, 0));
    return tilt * rest + Vector3d(0.05, 0.03, 1.6 * std::cos(2 * pi * time + 0.1));
  };
  const Motion breathe = [](const Vector3d& rest, double time) -> Vector3d {
    return rest + Vector3d(0, 0, 0.02 * ripple(rest, 2 * pi * time));
  };
  return hardScene("fast needle", {std::move(needle), std::move(membrane)}, {drive, breathe});
}

/// A thread lies and slides on tissue while its far end whips: slow and fast motion in one pair.
Scene slidingSuture() {
  SceneMesh thread = tube(6, 50);
  for (Vector3d& p : thread.positions) p = Vector3d(p.z(), 0.02 * p.x(), 0.02 * p.y());
  const auto height = [](double x, double y) { return 0.06 * std::sin(4 * x) * std::cos(3 * y); };
  const Motion slide = [height](const Vector3d& rest, double time) -> Vector3d {
    const double x = rest.x() + 0.05 * std::sin(2 * pi * time),
                 end = std::pow(std::max(rest.x(), 0.0), 3.0),
                 y = rest.y() + 0.2 * std::sin(3 * x) + 0.4 * end * std::sin(2 * pi * 3 * time),
                 lift = 0.5 * end * std::sin(2 * pi * 5 * time);
    const double gap = 0.0195 + 0.002 * std::sin(5 * x + 2 * pi * time);
    return {x, y, height(x, y) + gap + rest.z() + lift};
  };
  const Motion tissue = [height](const Vector3d& rest, double) -> Vector3d {
    return {rest.x(), rest.y(), height(rest.x(), rest.y())};
  };
  return hardScene("sliding suture", {std::move(thread), sheet(18)}, {slide, tissue});
}

/// Two soft closed bodies that glide through each other.
Scene deepPenetration() {
  Scene scene = glidingMeshes({sphere(6), sphere(7)});
  scene.name = "deep penetration";
  scene.frames = kFrames;
  return scene;
}

/// Four stacked sheets that clap together and separate.
Scene stackedSheets() {
  Scene scene;
  const auto wave = [](int layer) -> Motion {
    return [layer](const Vector3d& rest, double time) -> Vector3d {
      const double shift = 0.011 * layer;
      return {rest.x() + shift, rest.y() + 0.7 * shift,
              0.02 * layer + 0.012 * std::sin(2 * pi * 3 * time + 2.1 * layer + 2 * rest.x()) +
                  0.002 * ripple(rest, layer)};
    };
  };
  scene = hardScene("stacked sheets", {sheet(11), sheet(11), sheet(11), sheet(11)},
                    {wave(0), wave(1), wave(2), wave(3)});
  scene.pairs = {{0, 1}, {1, 2}, {2, 3}};
  return scene;
}

/// Two rows of crossing ridges that touch with their sharp edges only.
Scene sharpEdges() {
  const auto ridges = [](double side) -> Motion {
    return [side](const Vector3d& rest, double time) -> Vector3d {
      // Every other row of the sheet's vertices is raised.
      const double height = 0.1 * (static_cast<int>(std::lround((rest.x() + 1) * 6)) % 2);
      const Eigen::AngleAxisd turn(side > 0 ? 0.0 : 1.3 + 0.4 * std::sin(2 * pi * time),
                                   Vector3d::UnitZ());
      Vector3d p(rest.x(), rest.y(), side * (height - 0.1));
      if (side < 0)
        p += Vector3d(0.05 * std::sin(2 * pi * time), 0, 0.03 * std::cos(4 * pi * time));
      return turn * p;
    };
  };
  return hardScene("sharp edges", {sheet(12), sheet(12)}, {ridges(1), ridges(-1)});
}

}  // namespace

std::vector<Scene> hardScenes() {
  Scene uneven = gradedBodies(20);
  uneven.name = "uneven triangles";
  uneven.frames = kFrames;
  return {slowPressing("slow pressing", Vector3d::Zero()),
          fastNeedle(),
          slidingSuture(),
          deepPenetration(),
          stackedSheets(),
          sharpEdges(),
          std::move(uneven),
          slowPressing("far away", Vector3d(2e6, -1e6, 1.5e6))};
}

}  // namespace palpate::scenes
