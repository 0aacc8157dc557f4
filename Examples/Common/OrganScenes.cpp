#include "Anatomy.h"
#include "Scenes.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::scenes {

using Eigen::Vector3d;
using std::numbers::pi;

namespace {

/// A bumpy sphere (star-shaped while the bumps stay below 1), stretched, tapered and bent along x.
struct RoundShape {
  int frequency;
  Vector3d radii;
  double bumps;  ///< of the radius
  Vector3d bumpWaves;
  double taper;  ///< at x = 1 the section is 1 + taper as large
  double bend;   ///< at x = 1 the section is bend higher
};

const std::array<RoundShape, 5> kRoundShapes{{
    {11, {1.25, 0.85, 0.75}, 0.10, {3.1, 4.3, 2.2}, -0.35, -0.15},
    {11, {1.15, 0.80, 0.80}, 0.08, {4.0, 2.5, 3.7}, 0.25, 0.30},
    {10, {1.05, 0.80, 0.75}, 0.05, {2.0, 5.0, 3.0}, 0.05, 0.35},
    {10, {1.10, 0.85, 0.70}, 0.07, {5.2, 3.3, 4.1}, 0.15, -0.25},
    {10, {1.15, 0.75, 0.75}, 0.06, {2.7, 2.9, 5.1}, 0.40, 0.10},
}};

SceneMesh shaped(const RoundShape& shape) {
  SceneMesh mesh = sphere(shape.frequency);
  for (Vector3d& p : mesh.positions) {
    const Vector3d waves = (shape.bumpWaves.cwiseProduct(p)).array().sin();
    p = (shape.radii.cwiseProduct(p) * (1.0 + shape.bumps * waves.sum())).eval();
    p.tail<2>() *= 1.0 + shape.taper * p.x();
    p.z() += shape.bend * p.x() * p.x();
    p = (p * 1e6).array().round() / 1e6;
  }
  return mesh;
}

/// The direction of body `index` of `count`: evenly around the z axis, alternately above and below.
Vector3d direction(std::size_t index, std::size_t count) {
  const double angle = 2 * pi * static_cast<double>(index) / static_cast<double>(count);
  return Vector3d(std::cos(angle), std::sin(angle), count > 2 ? (index % 2 == 0 ? 0.4 : -0.4) : 0.0)
      .normalized();
}

/// Glides from one side through the centre to the other and back. On the way it breathes, ripples
/// and turns.
Motion glide(std::size_t index, std::size_t count, double reach, double size) {
  const Vector3d towards = direction(index, count);
  const double phase = 1.3 * static_cast<double>(index);
  const Vector3d axis = Vector3d(towards.z(), towards.x(), 1.0).normalized();
  const double waves = size > 0 ? 3.0 / size : 0.0;
  return [=](const Vector3d& rest, double time) -> Vector3d {
    const double beat = 2 * pi * 6 * time + phase;
    const Vector3d wave = rest * waves;
    const Vector3d ripple(std::sin(wave.y() + beat), std::sin(wave.z() + beat),
                          std::sin(wave.x() + beat));
    const Vector3d deformed = rest * (1.0 + 0.04 * std::sin(beat)) + 0.03 * size * ripple;
    const Eigen::AngleAxisd turn(0.5 * std::sin(2 * pi * time), axis);
    return turn * deformed + reach * std::cos(2 * pi * time) * towards;
  };
}

/// sizes: half the extent of each mesh, which scales its ripples.
Scene glidingScene(std::string name, std::vector<SceneMesh> meshes, double reach,
                   const std::vector<double>& sizes) {
  Scene scene{std::move(name), std::move(meshes), {}, {}};
  for (std::size_t b = 0; b < scene.meshes.size(); ++b) {
    scene.motions.push_back(glide(b, scene.meshes.size(), reach, sizes[b]));
    for (std::size_t a = 0; a < b; ++a) scene.pairs.emplace_back(a, b);
  }
  scene.thickness = meanEdge(scene.meshes) / 20;
  return scene;
}

}  // namespace

std::vector<Organ> organMeshes() {
  std::vector<Organ> organs{{"Liver", anatomicalLiver(7)},
                            {"Stomach", anatomicalStomach(5.7)},
                            {"Kidney", anatomicalKidney(5)},
                            {"Spleen", anatomicalSpleen(5.3)},
                            {"Gallbladder", anatomicalGallbladder(2.15)}};
  for (Organ& organ : organs)
    for (Vector3d& p : organ.mesh.positions) p = (p * 1e3).array().round() / 1e3;
  return organs;
}

Scene breathingOrgans() {
  // mm: how far an organ goes down when the diaphragm does, and how its surface ripples.
  constexpr std::array kFalls{14.0, 11.0, 11.0, 11.0, 12.0}, kRipples{0.6, 1.5, 0.3, 0.6, 0.6};
  Scene scene{"breathing organs", {}, {}, {}};
  for (Organ& organ : organMeshes()) {
    const std::size_t b = scene.meshes.size();
    scene.meshes.push_back(std::move(organ.mesh));
    scene.motions.push_back([=](const Vector3d& rest, double time) -> Vector3d {
      constexpr double kWave = 15;  // mm
      const double beat = 2 * pi * 3 * time + static_cast<double>(b);
      const Vector3d ripple(std::sin(rest.y() / kWave + beat), std::sin(rest.z() / kWave + beat),
                            std::sin(rest.x() / kWave + beat));
      return rest + kRipples[b] * ripple -
             kFalls[b] * (1 - std::cos(2 * pi * time)) / 2 * Vector3d::UnitZ();
    });
    for (std::size_t a = 0; a < b; ++a) scene.pairs.emplace_back(a, b);
  }
  scene.thickness = 1;
  return scene;
}

SceneMesh liver(int frequency) {
  RoundShape shape = kRoundShapes[0];
  shape.frequency = frequency;
  return shaped(shape);
}

std::string organObj(const Organ& organ) {
  return toObj(organ.mesh, organ.name + ": made by Examples/Common, see Data/README.md");
}

Scene organs() {
  std::vector<SceneMesh> meshes;
  for (const RoundShape& shape : kRoundShapes) meshes.push_back(shaped(shape));
  return glidingScene("organs", std::move(meshes), 1.45,
                      std::vector<double>(kRoundShapes.size(), 1.0));
}

Scene glidingMeshes(std::vector<SceneMesh> meshes) {
  if (meshes.size() == 1) meshes.push_back(meshes.front());
  std::vector<double> sizes;
  for (SceneMesh& mesh : meshes) {
    Eigen::AlignedBox3d box(mesh.positions.front());
    for (const Vector3d& p : mesh.positions) box.extend(p);
    for (Vector3d& p : mesh.positions) p -= box.center();
    sizes.push_back(box.sizes().norm() / 2);
  }
  const double reach = 0.8 * *std::max_element(sizes.begin(), sizes.end());
  return glidingScene("meshes", std::move(meshes), reach, sizes);
}

}  // namespace palpate::scenes
