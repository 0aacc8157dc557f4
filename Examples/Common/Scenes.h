#pragma once

#include "Meshes.h"

#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace palpate::scenes {

/// The position at `time` in [0, 1] of the scene's period, of a vertex at `rest`.
using Motion = std::function<Eigen::Vector3d(const Eigen::Vector3d& rest, double time)>;

/// Meshes that move, the same in every run. Tests, benchmarks and examples share them.
struct Scene {
  std::string name;
  std::vector<SceneMesh> meshes;                           ///< at rest
  std::vector<Motion> motions;                             ///< one per mesh
  std::vector<std::pair<std::size_t, std::size_t>> pairs;  ///< of meshes; (m, m): self-collision
  double thickness = 0;                                    ///< L: a twentieth of the mean edge
  int frames = 120;                                        ///< after which the motion repeats

  /// The positions of a mesh in any frame (0, 1, ...). Overwrites `out`.
  void positions(int frame, std::size_t mesh, std::vector<Eigen::Vector3d>& out) const;
  std::size_t triangleCount() const;
};

/// Five closed deforming bodies, round and bumpy, 10,840 triangles, that glide through their common
/// centre and back. Figures of benchmarks are measured on them.
Scene organs();
SceneMesh liver(int frequency);  ///< the first of them, with 20 frequency² triangles; there 11

/// Organs at rest in their places, as in Data/Organs: mm, closed, outward winding, coordinates
/// multiples of 0.001.
struct Organ {
  std::string name;
  SceneMesh mesh;
};
std::vector<Organ> organMeshes();
Scene breathingOrgans();                   ///< slide along and into each other; thickness 1 mm
std::string organObj(const Organ& organ);  ///< the text of its file in Data/Organs

/// Any meshes, centred, that glide through each other as the bodies of organs() do. At least one; a
/// single mesh meets its copy.
Scene glidingMeshes(std::vector<SceneMesh> meshes);

/// A sheet of 112,338 triangles that settles on a ball and hangs down around it in folds.
Scene clothOnBall();

/// Two bodies with `around` triangles around, whose sizes span four orders of magnitude.
Scene gradedBodies(int around);
Scene unevenBodies();  ///< with 119 around: 103,292 triangles in all

/// Two wavy sheets that cross each other everywhere, of about `triangles` triangles in all.
Scene interleavedSheets(std::size_t triangles);

/// Self-collision: a sheet of 18,050 triangles pushed together into overlapping pleats.
Scene foldedCloth();

/// Self-collision: one mesh of seven rods, 80,640 triangles, twisted about their common axis.
Scene twistedRods();

/// Eight small scenes. Some method fails on each of them: soft bodies pressed slowly; a needle
/// through a membrane; a suture that slides while its end whips; bodies deep in each other; stacked
/// sheets; crossing ridges; triangle sizes over four orders of magnitude; the first scene a million
/// times its size from the origin.
std::vector<Scene> hardScenes();

}  // namespace palpate::scenes
