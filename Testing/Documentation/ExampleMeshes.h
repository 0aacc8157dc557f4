#pragma once

// Meshes for the hidden code of the documentation's examples.

#include <palpate/Palpate.h>

#include <Eigen/Core>

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace example {

using Positions = std::vector<Eigen::Vector3d>;

struct Mesh {
  Positions positions;
  std::vector<palpate::Triangle> triangles;
};

/// A closed sphere of 12 x 10 quadrilaterals and two caps. Its winding normals point outward.
inline Mesh ball(const Eigen::Vector3d& centre, double radius) {
  constexpr std::uint32_t kRings = 9, kSectors = 12;
  constexpr double kPi = 3.14159265358979323846;
  Mesh mesh;
  mesh.positions.push_back(centre + Eigen::Vector3d(0, 0, radius));
  for (std::uint32_t ring = 1; ring <= kRings; ++ring)
    for (std::uint32_t sector = 0; sector < kSectors; ++sector) {
      const double polar = kPi * ring / (kRings + 1), around = 2 * kPi * sector / kSectors;
      mesh.positions.push_back(centre + radius * Eigen::Vector3d(std::sin(polar) * std::cos(around),
                                                                 std::sin(polar) * std::sin(around),
                                                                 std::cos(polar)));
    }
  mesh.positions.push_back(centre - Eigen::Vector3d(0, 0, radius));
  const std::uint32_t last = 1 + kRings * kSectors;
  const auto at = [](std::uint32_t ring, std::uint32_t sector) {
    return 1 + ring * kSectors + sector % kSectors;
  };
  for (std::uint32_t sector = 0; sector < kSectors; ++sector) {
    mesh.triangles.push_back({0, at(0, sector), at(0, sector + 1)});
    mesh.triangles.push_back({last, at(kRings - 1, sector + 1), at(kRings - 1, sector)});
    for (std::uint32_t ring = 0; ring + 1 < kRings; ++ring) {
      mesh.triangles.push_back({at(ring, sector), at(ring + 1, sector), at(ring + 1, sector + 1)});
      mesh.triangles.push_back({at(ring, sector), at(ring + 1, sector + 1), at(ring, sector + 1)});
    }
  }
  return mesh;
}

/// An open square of 8 x 8 quadrilaterals in a plane of constant z. Its normals point to +z.
inline Mesh sheet(const Eigen::Vector3d& corner, double size) {
  constexpr std::uint32_t kCells = 8, kRow = kCells + 1;
  Mesh mesh;
  for (std::uint32_t y = 0; y < kRow; ++y)
    for (std::uint32_t x = 0; x < kRow; ++x)
      mesh.positions.push_back(corner + size / kCells * Eigen::Vector3d(x, y, 0));
  for (std::uint32_t y = 0; y < kCells; ++y)
    for (std::uint32_t x = 0; x < kCells; ++x) {
      const std::uint32_t v = y * kRow + x;
      mesh.triangles.push_back({v, v + 1, v + kRow + 1});
      mesh.triangles.push_back({v, v + kRow + 1, v + kRow});
    }
  return mesh;
}

/// A grid of n x n squares with edges of 1 around the z axis, turned by an angle, and moved up and
/// down at random.
inline Mesh unevenGrid(int n, double height, double angle, double bumps) {
  std::mt19937 generator(2);
  Mesh mesh;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      const double x = i - 0.5 * n, y = j - 0.5 * n;
      const double z = height + bumps * (static_cast<double>(generator()) / 2147483648.0 - 1);
      mesh.positions.push_back({std::cos(angle) * x - std::sin(angle) * y,
                                std::sin(angle) * x + std::cos(angle) * y, z});
      if (i == n || j == n) continue;
      const auto a = static_cast<std::uint32_t>(i * (n + 1) + j),
                 b = a + static_cast<std::uint32_t>(n) + 1;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
    }
  return mesh;
}

/// Contacts for each vertex of a grid at rest on another one, with edges of 1.
inline double contactsPerVertex(palpate::Contacts kind, double thickness) {
  const Mesh lower = unevenGrid(30, 0, 0, 0),
             upper = unevenGrid(20, thickness / 2, 0.3, thickness / 4);
  palpate::OctreeBasedCD sheets;
  const auto a = sheets.addTriangleMesh(lower.positions, lower.triangles);
  const auto b = sheets.addTriangleMesh(upper.positions, upper.triangles);
  sheets.addCollisionPair(a, b, {.thickness = thickness, .contacts = kind});
  sheets.detectCollision();
  const palpate::CollisionData& data = sheets.collisionData(a, b);
  return static_cast<double>(data.vertexTriangle().size() + data.triangleVertex().size() +
                             data.edgeEdge().size()) /
         static_cast<double>(upper.positions.size());
}

struct Line {
  Positions positions;
  std::vector<palpate::Segment> segments;
};

inline Line thread(const Eigen::Vector3d& from, const Eigen::Vector3d& to, int segments) {
  Line line;
  for (int v = 0; v <= segments; ++v) line.positions.push_back(from + (to - from) * v / segments);
  for (std::uint32_t v = 0; v + 1 < line.positions.size(); ++v) line.segments.push_back({v, v + 1});
  return line;
}

struct Solid {
  Positions positions;
  std::vector<palpate::Tetrahedron> tetrahedra;
};

/// A cube of `cells` cubes per axis, each of them six tetrahedra around its diagonal.
inline Solid block(const Eigen::Vector3d& corner, double size, int cells) {
  const auto row = static_cast<std::uint32_t>(cells + 1);
  Solid solid;
  for (std::uint32_t z = 0; z < row; ++z)
    for (std::uint32_t y = 0; y < row; ++y)
      for (std::uint32_t x = 0; x < row; ++x)
        solid.positions.push_back(corner + size / cells * Eigen::Vector3d(x, y, z));
  const std::array<std::uint32_t, 3> step{1, row, row * row};
  for (std::uint32_t z = 0; z + 1 < row; ++z)
    for (std::uint32_t y = 0; y + 1 < row; ++y)
      for (std::uint32_t x = 0; x + 1 < row; ++x) {
        const std::uint32_t v = (z * row + y) * row + x;
        for (int first = 0; first < 3; ++first)
          for (int second = 0; second < 3; ++second) {
            if (first == second) continue;
            const std::uint32_t a = v + step[first], b = a + step[second];
            solid.tetrahedra.push_back({v, a, b, v + step[0] + step[1] + step[2]});
          }
      }
  return solid;
}

}  // namespace example
