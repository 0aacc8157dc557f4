#include "InstrumentArm.h"

#include <algorithm>

namespace palpate::scenes {

using Eigen::Vector3d;

namespace {

constexpr double kShaft = 75, kElbow = 22, kWrist = 12, kJaw = 14;
/// The number of joints that move each link. The jaws turn against each other.
constexpr std::array<int, InstrumentArm::kLinks> kJointsOf{3, 4, 5, 6, 6};

/// A box from low to high that narrows along z. Corner i has bit 0: x, 1: y, 2: z.
SceneMesh tapered(const Vector3d& low, const Vector3d& high, double taper) {
  SceneMesh mesh;
  for (int i = 0; i < 8; ++i) {
    const double share = i & 4 ? taper : 1;
    mesh.positions.emplace_back(share * (i & 1 ? high : low).x(), share * (i & 2 ? high : low).y(),
                                (i & 4 ? high : low).z());
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

}  // namespace

std::array<InstrumentArm::Link, InstrumentArm::kLinks> InstrumentArm::makeLinks() {
  const auto rod = [](const char* name, const Capsule& shape) {
    return Link{name, shape, capsule(shape.p0, shape.p1, shape.radius, 4)};
  };
  const auto jaw = [](const char* name, double from, double to) {
    SceneMesh mesh = tapered({-1.8, from, 0}, {1.8, to, kJaw}, 0.4);
    return Link{name, ConvexHull{mesh.positions}, mesh};
  };
  const Vector3d half(2.2, 2.2, kWrist / 2), middle(0, 0, kWrist / 2);
  return {rod("shaft", {{0, 0, -kShaft}, {0, 0, 0}, 3}),
          rod("elbow", {{0, 0, 0}, {0, 0, kElbow}, 2.8}),
          Link{"wrist", Box{middle, half}, tapered(middle - half, middle + half, 1)},
          jaw("lower jaw", -2.8, -0.6), jaw("upper jaw", 0.6, 2.8)};
}

bool InstrumentArm::areJoined(int a, int b) {
  const auto [low, high] = std::minmax(a, b);
  return high - low <= 1 ? high != 4 : low == 2;
}

void InstrumentArm::bend(const Joints& joints) {
  m_joints = joints;
  Eigen::Isometry3d at = m_port;
  const auto joint = [&](int j, const Vector3d& axis, bool slides) {
    m_axes[j] = {at.linear() * axis, at.translation(), slides};
    if (slides)
      at.translate(joints[j] * axis);
    else
      at.rotate(Eigen::AngleAxisd(joints[j], axis));
  };
  joint(0, Vector3d::UnitX(), false);
  joint(1, Vector3d::UnitY(), false);
  joint(2, Vector3d::UnitZ(), true);
  m_links[0] = at;
  joint(3, Vector3d::UnitX(), false);
  m_links[1] = at;
  at.translate(kElbow * Vector3d::UnitZ());
  joint(4, Vector3d::UnitY(), false);
  m_links[2] = at;
  at.translate(kWrist * Vector3d::UnitZ());
  m_links[4] = at * Eigen::AngleAxisd(-joints[5], Vector3d::UnitX());
  joint(5, Vector3d::UnitX(), false);
  m_links[3] = at;
}

InstrumentArm::Joints InstrumentArm::slope(int link, const Vector3d& point,
                                           const Vector3d& direction) const {
  Joints slope = Joints::Zero();
  for (int j = 0; j < kJointsOf[link]; ++j) {
    const auto& [axis, through, slides] = m_axes[j];
    slope[j] = direction.dot(slides ? axis : Vector3d(axis.cross(point - through)));
  }
  if (link == 4) slope[5] = -slope[5];
  return slope;
}

}  // namespace palpate::scenes
