#include "Queries/SweepFrame.h"

#include "Mesh/Corners.h"
#include "Core/Stopping.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// Sums of normals, with either sign, by cells of the surface of a cube. The directions of the axes
/// are in the middle of cells.
class NormalCells {
 public:
  NormalCells() { m_sums.fill(Vector3d::Zero()); }

  void add(Vector3d normal) {
    Eigen::Index axis = 0;
    const double most = normal.cwiseAbs().maxCoeff(&axis);
    if (!(most > 0)) return;
    if (normal[axis] < 0) normal = -normal;
    const auto place = [&](Eigen::Index k) {
      return std::min(static_cast<Eigen::Index>(0.5 * kSide * (normal[k % 3] / most + 1)),
                      kSide - 1);
    };
    const Eigen::Index cell = (axis * kSide + place(axis + 1)) * kSide + place(axis + 2);
    m_sums[static_cast<std::size_t>(cell)] += normal;
  }
  const Vector3d& largest() const {
    return *std::max_element(m_sums.begin(), m_sums.end(), [](const auto& l, const auto& r) {
      return l.squaredNorm() < r.squaredNorm();
    });
  }
  /// Leaves only what is nearly across a unit direction.
  void keepAcross(const Vector3d& direction) {
    constexpr double kAcross = 0.125;
    for (Vector3d& sum : m_sums)
      if (std::abs(sum.dot(direction)) > kAcross * sum.norm()) sum.setZero();
  }

 private:
  static constexpr Eigen::Index kSide = 15;
  std::array<Vector3d, 3 * kSide * kSide> m_sums;
};

}  // namespace

SweepFrame frameOf(const BodyPair& pair) {
  SweepFrame frame{unitOf(pair.magnitude()), Eigen::Matrix3d::Identity()};
  NormalCells cells;
  for (const bool ofA : {true, false}) {
    const MeshTopology& topology = pair.geometry(ofA).mesh.topology;
    TimeCheck check(256);
    topology.forEachElement([&](std::uint32_t element) {
      check();
      const auto [p, q, r] = cornersOf(topology.elements[element], pair.vertices(ofA).positions);
      cells.add((frame.unit * (q - p)).cross(frame.unit * (r - p)));
    });
  }
  const Vector3d first = cells.largest().stableNormalized();
  if (!(first.norm() > 0.5)) return frame;  // no area, up to rounding
  cells.keepAcross(first);
  Vector3d second = cells.largest() - first.dot(cells.largest()) * first;
  if (second.isZero(0.0)) second = first.unitOrthogonal();
  second.stableNormalize();
  frame.axes << first.transpose(), second.transpose(), first.cross(second).transpose();
  return frame;
}

}  // namespace palpate
