#include "Stitch.h"

#include "Meshes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::scenes {
namespace {

using Eigen::Vector3d, std::numbers::pi;

constexpr double kSpacing = 0.05;               // of the thread's vertices
constexpr double kLoose = 0.16, kTight = 0.06;  // radius of the two parts' twist
constexpr double kDrawn = 0.85;                 // time; then the knot is pulled tight

/// Half of the thread's way: from below the wound up through an edge, one and a quarter times
/// around the other half, which is this one turned by 180 degrees about z.
std::vector<Vector3d> halfWay(double twist) {
  constexpr double kKnot = 0.45;  // half its length
  constexpr int kPoints = 12;
  const double height = 0.07 + twist;
  std::vector<Vector3d> line{{0, 0, -0.9},    {0.9, 0, -0.8},    {1.45, 0, -0.35},
                             {1.55, 0, 0.05}, {1.3, -0.06, 0.2}, {0.85, -0.1, 0.15}};
  for (int i = 0; i <= kPoints; ++i) {
    const double along = 2.0 * i / kPoints - 1, angle = pi * (1 + 1.25 * along);
    line.emplace_back(-kKnot * along, -twist * std::cos(angle), height + twist * std::sin(angle));
  }
  line.emplace_back(-kKnot - 0.3, -twist - 0.08, height + twist + 0.12);
  line.emplace_back(-kKnot - 0.8, -twist - 0.25, height + 0.7);
  return curve(line);
}

/// The way of the thread, straight beyond its ends.
class Way {
 public:
  explicit Way(double twist) {
    const std::vector<Vector3d> half = halfWay(twist);
    for (std::size_t i = half.size() - 1; i > 0; --i)
      m_points.emplace_back(-half[i].x(), -half[i].y(), half[i].z());
    m_points.insert(m_points.end(), half.begin(), half.end());
    m_lengths.push_back(0);
    for (std::size_t i = 0; i + 1 < m_points.size(); ++i)
      m_lengths.push_back(m_lengths.back() + (m_points[i + 1] - m_points[i]).norm());
  }
  double halfLength() const { return m_lengths.back() / 2; }
  /// length: from the middle, negative before it.
  Vector3d at(double length) const {
    const double along = length + halfLength();
    const auto next = std::upper_bound(m_lengths.begin() + 1, m_lengths.end() - 1, along);
    const auto i = static_cast<std::size_t>(next - m_lengths.begin());
    const double part = (along - m_lengths[i - 1]) / (m_lengths[i] - m_lengths[i - 1]);
    return m_points[i - 1] + part * (m_points[i] - m_points[i - 1]);
  }

 private:
  std::vector<Vector3d> m_points;
  std::vector<double> m_lengths;
};

}  // namespace

std::vector<Vector3d> stitchAt(double time) {
  static const double kHalf = Way(kLoose).halfLength();
  const double tightening = std::clamp((time - kDrawn) / (1 - kDrawn), 0.0, 1.0);
  const Way way(kLoose + tightening * (kTight - kLoose));
  const double tip = kHalf * (2 * std::clamp(time / kDrawn, 0.0, 1.0) - 1);
  std::vector<Vector3d> thread;
  for (std::uint32_t i = 0; i < kStitchVertices; ++i) thread.push_back(way.at(tip - kSpacing * i));
  return thread;
}

}  // namespace palpate::scenes
