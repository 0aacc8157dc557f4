#include "Implicit.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate::scenes {

using Eigen::Vector3d, Eigen::Vector3i;

namespace {

constexpr std::uint32_t kNone = 0xffffffff;

/// Cells of a box, and the values of a function at their corners.
class Grid {
 public:
  Grid(const Implicit& body, const Eigen::AlignedBox3d& box, double edge)
      : m_low(box.min()), m_edge(edge) {
    m_size = (box.sizes() / edge).array().ceil().cast<int>() + 1;
    m_values.reserve(static_cast<std::size_t>(m_size.x()) * m_size.y() * m_size.z());
    for (int z = 0; z < m_size.z(); ++z)
      for (int y = 0; y < m_size.y(); ++y)
        for (int x = 0; x < m_size.x(); ++x) m_values.push_back(body(position({x, y, z})));
  }
  const Vector3i& size() const { return m_size; }  ///< corners along each axis
  std::size_t index(const Vector3i& at) const {
    return (static_cast<std::size_t>(at.z()) * m_size.y() + at.y()) * m_size.x() + at.x();
  }
  double value(const Vector3i& at) const { return m_values[index(at)]; }
  Vector3d position(const Vector3i& at) const { return m_low + m_edge * at.cast<double>(); }

  /// The mean of the places where the surface crosses the sides of a cell.
  bool crossing(const Vector3i& cell, Vector3d& mean) const {
    int count = 0;
    mean.setZero();
    for (int axis = 0; axis < 3; ++axis) {
      for (int side = 0; side < 4; ++side) {
        Vector3i p = cell;
        p[(axis + 1) % 3] += side & 1;
        p[(axis + 2) % 3] += side >> 1;
        const Vector3i q = p + Vector3i::Unit(axis);
        const double a = value(p), b = value(q);
        if ((a < 0) == (b < 0)) continue;
        mean += position(p) + a / (a - b) * (position(q) - position(p));
        ++count;
      }
    }
    mean /= std::max(1, count);
    return count > 0;
  }

 private:
  Vector3d m_low;
  double m_edge;
  Vector3i m_size;
  std::vector<double> m_values;
};

/// Corners go to the middle of their neighbours and back to the surface, a few times.
void smooth(SceneMesh& mesh, const Implicit& body, double edge) {
  constexpr int kRounds = 6;
  const double step = 1e-3 * edge;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<Vector3d> sums(mesh.positions.size(), Vector3d::Zero());
    std::vector<int> counts(mesh.positions.size(), 0);
    for (const Triangle& t : mesh.triangles) {
      for (int i = 0; i < 3; ++i) {
        sums[t[i]] += mesh.positions[t[(i + 1) % 3]] + mesh.positions[t[(i + 2) % 3]];
        counts[t[i]] += 2;
      }
    }
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      if (counts[i] == 0) continue;  // at the border of the box
      Vector3d& p = mesh.positions[i];
      p += 0.5 * (sums[i] / counts[i] - p);
      const double value = body(p);
      Vector3d slope;
      for (int axis = 0; axis < 3; ++axis)
        slope[axis] = (body(p + step * Vector3d::Unit(axis)) - value) / step;
      const double most = 0.5 * edge, way = value / std::max(0.3, slope.norm());
      p -= std::clamp(way, -most, most) * slope.normalized();
    }
  }
}

}  // namespace

double smoothMin(double a, double b, double radius) {
  const double near = std::max(0.0, 1 - std::abs(a - b) / radius);
  return std::min(a, b) - near * near * radius / 4;
}

double toEllipsoid(const Vector3d& p, const Vector3d& centre, const Vector3d& radii) {
  const Vector3d q = (p - centre).cwiseQuotient(radii);
  const double length = q.norm();
  return length == 0 ? -radii.minCoeff() : length * (length - 1) / q.cwiseQuotient(radii).norm();
}

double toCone(const Vector3d& p, const Vector3d& p0, const Vector3d& p1, double radius0,
              double radius1) {
  const Vector3d along = p1 - p0;
  const double share = std::clamp((p - p0).dot(along) / along.squaredNorm(), 0.0, 1.0);
  return (p - p0 - share * along).norm() - (radius0 + share * (radius1 - radius0));
}

SceneMesh meshOf(const Implicit& body, const Eigen::AlignedBox3d& box, double edge) {
  const Grid grid(body, box, edge);
  const Vector3i cells = grid.size() - Vector3i::Ones();
  SceneMesh mesh;
  std::vector<std::uint32_t> vertexOf(
      static_cast<std::size_t>(grid.size().x()) * grid.size().y() * grid.size().z(), kNone);
  for (int z = 0; z < cells.z(); ++z) {
    for (int y = 0; y < cells.y(); ++y) {
      for (int x = 0; x < cells.x(); ++x) {
        Vector3d mean;
        if (!grid.crossing({x, y, z}, mean)) continue;
        vertexOf[grid.index({x, y, z})] = static_cast<std::uint32_t>(mesh.positions.size());
        mesh.positions.push_back(mean);
      }
    }
  }
  // The four cells around each side of the grid that the surface crosses.
  for (int z = 1; z < cells.z(); ++z) {
    for (int y = 1; y < cells.y(); ++y) {
      for (int x = 1; x < cells.x(); ++x) {
        for (int axis = 0; axis < 3; ++axis) {
          const Vector3i at(x, y, z), u = Vector3i::Unit((axis + 1) % 3),
                                      v = Vector3i::Unit((axis + 2) % 3);
          const bool inside = grid.value(at) < 0;
          if (inside == (grid.value(at + Vector3i::Unit(axis)) < 0)) continue;
          std::array<std::uint32_t, 4> q{};
          const std::array<Vector3i, 4> around{at - u - v, at - v, at, at - u};
          for (int i = 0; i < 4; ++i) q[i] = vertexOf[grid.index(around[i])];
          if (!inside) std::swap(q[1], q[3]);
          const auto length = [&](int i, int j) {
            return (mesh.positions[q[i]] - mesh.positions[q[j]]).squaredNorm();
          };
          if (length(0, 2) > length(1, 3)) std::rotate(q.begin(), q.begin() + 1, q.end());
          mesh.triangles.push_back({q[0], q[1], q[2]});
          mesh.triangles.push_back({q[0], q[2], q[3]});
        }
      }
    }
  }
  smooth(mesh, body, edge);
  return mesh;
}

}  // namespace palpate::scenes
