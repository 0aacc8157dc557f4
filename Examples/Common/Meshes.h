#pragma once

#include <palpate/Types.h>

#include <Eigen/Core>

#include <span>
#include <string>
#include <vector>

namespace palpate::scenes {

struct SceneMesh {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Triangle> triangles;
};

/// Unit sphere: each face of an icosahedron cut into frequency² triangles, 20 frequency² in all.
/// Outward winding.
SceneMesh sphere(int frequency);

/// Unit sphere: six square sheets around a cube, projected to the sphere, 12 cells² triangles of
/// about one size. Each sheet has its own vertices at its border. Outward winding.
SceneMesh cubeSphere(int cells);

/// The square [-1, 1]² at z = 0, 2 cells² triangles, normals up.
SceneMesh sheet(int cells);

/// Open cylinder of radius 1 about the z axis, z in [-1, 1], 2 around along triangles. Outward
/// winding.
SceneMesh tube(int around, int along);

/// Sphere of radius 1 whose triangles, all of about the same shape, shrink towards its pole at +z
/// to `smallest` of the largest. 2 around (rings + 1) triangles with rings = around ln(2 /
/// smallest) / 2π.
SceneMesh gradedSphere(int around, double smallest);

/// Sphere of this radius around p0, with the half towards p1 moved there. Outward winding.
SceneMesh capsule(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1, double radius,
                  int frequency);

/// Open tube around a polyline of at least two positions, for pictures.
SceneMesh tubeAround(std::span<const Eigen::Vector3d> line, double radius, int around);

/// Points of a smooth curve through these: eight for each of them.
std::vector<Eigen::Vector3d> curve(const std::vector<Eigen::Vector3d>& through);

void append(SceneMesh& mesh, const SceneMesh& other);

/// L: mean over every side of every triangle of all meshes.
double meanEdge(const std::vector<SceneMesh>& meshes);

/// Wavefront OBJ with six decimals, which keeps coordinates that are multiples of 1e-6.
std::string toObj(const SceneMesh& mesh, const std::string& comment);

}  // namespace palpate::scenes
