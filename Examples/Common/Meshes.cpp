#include "Meshes.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>

namespace palpate::scenes {

using Eigen::Vector3d;
using std::numbers::pi;

namespace {

/// Rows of equally many positions. With `closed`, each row is a ring. Normals are along the row ×
/// to the next row.
void stitchRows(std::vector<Triangle>& triangles, std::uint32_t rows, std::uint32_t perRow,
                bool closed) {
  for (std::uint32_t row = 0; row + 1 < rows; ++row) {
    for (std::uint32_t i = 0; i < (closed ? perRow : perRow - 1); ++i) {
      const std::uint32_t next = (i + 1) % perRow;
      const std::uint32_t a = row * perRow + i, b = row * perRow + next, c = a + perRow,
                          d = b + perRow;
      triangles.push_back({a, b, d});
      triangles.push_back({a, d, c});
    }
  }
}

}  // namespace

SceneMesh sphere(int frequency) {
  const double g = std::numbers::phi;
  const std::array<Vector3d, 12> corners{{{-1, g, 0},
                                          {1, g, 0},
                                          {-1, -g, 0},
                                          {1, -g, 0},
                                          {0, -1, g},
                                          {0, 1, g},
                                          {0, -1, -g},
                                          {0, 1, -g},
                                          {g, 0, -1},
                                          {g, 0, 1},
                                          {-g, 0, -1},
                                          {-g, 0, 1}}};
  const std::array<std::array<int, 3>, 20> faces{
      {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
       {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
       {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}}};
  SceneMesh mesh;
  std::map<std::map<int, int>, std::uint32_t>
      known;  // weights of the corners that a lattice point lies between
  for (const auto& face : faces) {
    const auto vertex = [&](int i, int j) {
      std::map<int, int> weights;
      Vector3d position = Vector3d::Zero();
      const std::array<int, 3> shares{frequency - i - j, i, j};
      for (int k = 0; k < 3; ++k) {
        if (shares[k] > 0) weights[face[k]] = shares[k];
      }
      for (const auto& [corner, weight] : weights) position += weight * corners[corner];
      const auto [entry, isNew] = known.try_emplace(weights, mesh.positions.size());
      if (isNew) mesh.positions.push_back(position.normalized());
      return entry->second;
    };
    for (int i = 0; i < frequency; ++i) {
      for (int j = 0; i + j < frequency; ++j) {
        mesh.triangles.push_back({vertex(i, j), vertex(i + 1, j), vertex(i, j + 1)});
        if (i + j + 1 < frequency) {
          mesh.triangles.push_back({vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)});
        }
      }
    }
  }
  return mesh;
}

SceneMesh sheet(int cells) {
  SceneMesh mesh;
  for (int row = 0; row <= cells; ++row) {
    for (int i = 0; i <= cells; ++i) {
      mesh.positions.emplace_back(2.0 * i / cells - 1.0, 2.0 * row / cells - 1.0, 0.0);
    }
  }
  stitchRows(mesh.triangles, cells + 1, cells + 1, false);
  return mesh;
}

SceneMesh cubeSphere(int cells) {
  SceneMesh mesh;
  for (int face = 0; face < 6; ++face) {
    const Eigen::AngleAxisd turn(
        face < 4 ? face * pi / 2 : (face - 4.5) * pi,
        face < 4 ? Vector3d(Vector3d::UnitX()) : Vector3d(Vector3d::UnitY()));
    SceneMesh side = sheet(cells);
    for (Vector3d& p : side.positions) p = turn * (p + Vector3d::UnitZ()).normalized();
    append(mesh, side);
  }
  return mesh;
}

SceneMesh tube(int around, int along) {
  SceneMesh mesh;
  for (int row = 0; row <= along; ++row) {
    for (int i = 0; i < around; ++i) {
      const double angle = 2 * pi * i / around;
      mesh.positions.emplace_back(std::cos(angle), std::sin(angle), 2.0 * row / along - 1.0);
    }
  }
  stitchRows(mesh.triangles, along + 1, around, true);
  return mesh;
}

SceneMesh gradedSphere(int around, double smallest) {
  // Mercator's projection keeps shapes: equal steps of its height v, of which a triangle's size is
  // 1 / cosh v.
  const double top = std::log(2 / smallest), bottom = -1.5;
  const int rings = static_cast<int>(std::lround(around * (top - bottom) / (2 * pi)));
  SceneMesh mesh;
  for (int ring = 0; ring <= rings; ++ring) {
    const double v = bottom + (top - bottom) * ring / rings;
    for (int i = 0; i < around; ++i) {
      const double angle = 2 * pi * i / around;
      mesh.positions.emplace_back(std::cos(angle) / std::cosh(v), std::sin(angle) / std::cosh(v),
                                  std::tanh(v));
    }
  }
  stitchRows(mesh.triangles, rings + 1, around, true);
  const auto count = static_cast<std::uint32_t>(around), last = rings * count, south = last + count,
             north = south + 1;
  mesh.positions.emplace_back(0, 0, -1);
  mesh.positions.emplace_back(0, 0, 1);
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t next = (i + 1) % count;
    mesh.triangles.push_back({south, next, i});
    mesh.triangles.push_back({north, last + i, last + next});
  }
  return mesh;
}

SceneMesh capsule(const Vector3d& p0, const Vector3d& p1, double radius, int frequency) {
  SceneMesh mesh = sphere(frequency);
  for (Vector3d& p : mesh.positions) p = (p.dot(p1 - p0) > 0 ? p1 : p0) + radius * p;
  return mesh;
}

SceneMesh tubeAround(std::span<const Vector3d> line, double radius, int around) {
  SceneMesh mesh;
  Vector3d side = (line[1] - line[0]).unitOrthogonal();
  for (std::size_t i = 0; i < line.size(); ++i) {
    const std::size_t last = line.size() - 1;
    const Vector3d along = (line[std::min(i + 1, last)] - line[i == 0 ? 0 : i - 1]).normalized();
    const Vector3d across = side - along.dot(side) * along;
    side = across.norm() > 1e-6 ? Vector3d(across.normalized()) : along.unitOrthogonal();
    for (int j = 0; j < around; ++j) {
      const double angle = 2 * pi * j / around;
      mesh.positions.push_back(
          line[i] + radius * (std::cos(angle) * side + std::sin(angle) * along.cross(side)));
    }
  }
  stitchRows(mesh.triangles, static_cast<std::uint32_t>(line.size()), around, true);
  return mesh;
}

std::vector<Vector3d> curve(const std::vector<Vector3d>& through) {
  constexpr int kSteps = 8;
  const auto at = [&](std::ptrdiff_t i) {
    return through[std::clamp<std::ptrdiff_t>(i, 0, std::ssize(through) - 1)];
  };
  std::vector<Vector3d> points;
  for (std::ptrdiff_t i = 0; i + 1 < std::ssize(through); ++i) {
    for (int step = 0; step < kSteps; ++step) {
      const double t = static_cast<double>(step) / kSteps, u = 1 - t;
      const Vector3d slope0 = (at(i + 1) - at(i - 1)) / 2, slope1 = (at(i + 2) - at(i)) / 2;
      points.push_back(u * u * (1 + 2 * t) * at(i) + t * t * (1 + 2 * u) * at(i + 1) +
                       t * u * (u * slope0 - t * slope1));
    }
  }
  points.push_back(through.back());
  return points;
}

void append(SceneMesh& mesh, const SceneMesh& other) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
  for (const auto& [a, b, c] : other.triangles)
    mesh.triangles.push_back({first + a, first + b, first + c});
}

double meanEdge(const std::vector<SceneMesh>& meshes) {
  double sum = 0;
  std::size_t count = 0;
  for (const SceneMesh& mesh : meshes) {
    for (const Triangle& triangle : mesh.triangles) {
      for (int i = 0; i < 3; ++i) {
        sum += (mesh.positions[triangle[(i + 1) % 3]] - mesh.positions[triangle[i]]).norm();
      }
    }
    count += 3 * mesh.triangles.size();
  }
  return count == 0 ? 0.0 : sum / static_cast<double>(count);
}

std::string toObj(const SceneMesh& mesh, const std::string& comment) {
  std::string text = "# " + comment + "\n";
  std::array<char, 128> line;
  for (const Vector3d& p : mesh.positions) {
    text.append(line.data(),
                std::snprintf(line.data(), line.size(), "v %.6f %.6f %.6f\n", p.x(), p.y(), p.z()));
  }
  for (const auto& [a, b, c] : mesh.triangles) {
    text.append(line.data(),
                std::snprintf(line.data(), line.size(), "f %u %u %u\n", a + 1, b + 1, c + 1));
  }
  return text;
}

}  // namespace palpate::scenes
