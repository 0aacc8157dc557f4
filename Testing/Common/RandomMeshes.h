#pragma once

#include <palpate/Types.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <span>
#include <vector>

namespace palpate::testing {

struct Mesh {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Triangle> triangles;
};

inline void append(Mesh& mesh, const Mesh& other) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
  for (const auto& [a, b, c] : other.triangles)
    mesh.triangles.push_back({first + a, first + b, first + c});
}

/// With the opposite winding.
inline Mesh insideOut(Mesh mesh) {
  for (Triangle& t : mesh.triangles) std::swap(t[0], t[1]);
  return mesh;
}

/// Two meshes as one.
inline Mesh joined(Mesh a, const Mesh& b) {
  append(a, b);
  return a;
}

/// Random numbers, the same on every machine. Or decisions that a fuzzer makes, one byte for each
/// number, in which that byte is repeated; random numbers after the last one.
class Random {
 public:
  using result_type = std::uint64_t;
  static constexpr result_type min() { return 0; }
  static constexpr result_type max() { return ~result_type{0}; }

  explicit Random(std::uint64_t seed) : m_engine(seed) {}
  explicit Random(std::span<const std::uint8_t> decisions)
      : m_isDecided(true), m_decisions(decisions) {}

  result_type operator()() {
    if (m_decisions.empty()) return m_engine();
    const std::uint8_t decision = m_decisions.front();
    m_decisions = m_decisions.subspan(1);
    return decision * 0x0101010101010101u;
  }
  bool isDecided() const { return m_isDecided; }
  bool isOver() const { return m_isDecided && m_decisions.empty(); }

 private:
  std::mt19937_64 m_engine;
  bool m_isDecided = false;
  std::span<const std::uint8_t> m_decisions;
};

/// Uniform in [low, high), the same on every machine.
inline double uniform(Random& random, double low, double high) {
  return low + (high - low) * (static_cast<double>(random() >> 11) * 0x1p-53);
}

inline Eigen::Vector3d randomPoint(Random& random, double low, double high) {
  const double x = uniform(random, low, high), y = uniform(random, low, high),
               z = uniform(random, low, high);
  return {x, y, z};
}

/// Triangles of about `size`, in a unit cube, no two sharing a vertex.
inline Mesh soup(Random& random, std::size_t triangles, double size) {
  Mesh mesh;
  for (std::uint32_t t = 0; t < triangles; ++t) {
    const Eigen::Vector3d centre = randomPoint(random, 0, 1);
    for (int corner = 0; corner < 3; ++corner)
      mesh.positions.push_back(centre + randomPoint(random, -size, size));
    mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  }
  return mesh;
}

/// An n by n sheet of quads over the unit square, with waves of about `height` in z.
inline Mesh sheet(std::uint32_t n, double height, double phase) {
  Mesh mesh;
  for (std::uint32_t j = 0; j <= n; ++j)
    for (std::uint32_t i = 0; i <= n; ++i) {
      const double x = double(i) / n, y = double(j) / n;
      mesh.positions.push_back({x, y, height + 0.05 * std::sin(9 * x + phase) * std::cos(7 * y)});
    }
  for (std::uint32_t j = 0; j < n; ++j)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t v = j * (n + 1) + i;
      mesh.triangles.push_back({v, v + 1, v + n + 2});
      mesh.triangles.push_back({v, v + n + 2, v + n + 1});
    }
  return mesh;
}

/// A box with two triangles for each side, wound outwards.
inline Mesh boxMesh(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  Mesh mesh;
  for (int v = 0; v < 8; ++v)
    mesh.positions.emplace_back(v & 1 ? high[0] : low[0], v & 2 ? high[1] : low[1],
                                v & 4 ? high[2] : low[2]);
  mesh.triangles = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}};
  return mesh;
}

/// The cube [low, high]³.
inline Mesh cube(double low, double high) {
  return boxMesh(Eigen::Vector3d::Constant(low), Eigen::Vector3d::Constant(high));
}

/// A box whose faces are divided into n x n squares, wound outward.
inline Mesh dividedBox(const Eigen::Vector3d& lower, const Eigen::Vector3d& upper, int n = 1) {
  Mesh mesh;
  std::vector<std::array<int, 3>> places;
  const auto vertexAt = [&](const std::array<int, 3>& place) {
    const auto known = std::find(places.begin(), places.end(), place);
    if (known != places.end()) return static_cast<std::uint32_t>(known - places.begin());
    const Eigen::Vector3d share = Eigen::Vector3d(place[0], place[1], place[2]) / n;
    mesh.positions.push_back(lower + share.cwiseProduct(upper - lower));
    places.push_back(place);
    return static_cast<std::uint32_t>(places.size() - 1);
  };
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const int side : {0, 1})
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const auto corner = [&](int u, int v) {
            std::array<int, 3> place{};
            place[axis] = side * n;
            place[(axis + 1) % 3] = u;
            place[(axis + 2) % 3] = v;
            return vertexAt(place);
          };
          const std::uint32_t a = corner(i, j), b = corner(i + 1, j), c = corner(i + 1, j + 1),
                              d = corner(i, j + 1);
          mesh.triangles.push_back(side ? Triangle{a, b, c} : Triangle{a, c, b});
          mesh.triangles.push_back(side ? Triangle{a, c, d} : Triangle{a, d, c});
        }
  return mesh;
}

/// A closed sphere: latitudes by longitudes.
inline Mesh sphere(std::uint32_t rings, std::uint32_t segments, const Eigen::Vector3d& centre,
                   double radius) {
  Mesh mesh;
  constexpr double kPi = 3.14159265358979323846;
  mesh.positions.push_back(centre + Eigen::Vector3d(0, 0, radius));
  for (std::uint32_t r = 1; r < rings; ++r)
    for (std::uint32_t s = 0; s < segments; ++s) {
      const double theta = kPi * r / rings, phi = 2 * kPi * s / segments;
      mesh.positions.push_back(centre + radius * Eigen::Vector3d(std::sin(theta) * std::cos(phi),
                                                                 std::sin(theta) * std::sin(phi),
                                                                 std::cos(theta)));
    }
  mesh.positions.push_back(centre - Eigen::Vector3d(0, 0, radius));
  const auto bottom = static_cast<std::uint32_t>(mesh.positions.size() - 1);
  const auto at = [&](std::uint32_t r, std::uint32_t s) {
    return 1 + (r - 1) * segments + s % segments;
  };
  for (std::uint32_t s = 0; s < segments; ++s) {
    mesh.triangles.push_back({0, at(1, s), at(1, s + 1)});
    for (std::uint32_t r = 1; r + 1 < rings; ++r) {
      mesh.triangles.push_back({at(r, s), at(r + 1, s), at(r + 1, s + 1)});
      mesh.triangles.push_back({at(r, s), at(r + 1, s + 1), at(r, s + 1)});
    }
    mesh.triangles.push_back({at(rings - 1, s), bottom, at(rings - 1, s + 1)});
  }
  return mesh;
}

}  // namespace palpate::testing
