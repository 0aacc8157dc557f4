#include "Math/TranslationExit.h"

#include "Math/Tolerances.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <limits>

namespace palpate {

using Eigen::Vector3d;

namespace {

bool isWeight(double w) { return w >= -kExitWeight && w <= 1.0 + kExitWeight; }

Vector3d corner(int i) { return Vector3d::Unit(i); }

Vector3d onEdge(int i, double weight) {
  return (1.0 - weight) * Vector3d::Unit(i) + weight * Vector3d::Unit((i + 1) % 3);
}

class Search {
 public:
  Search(const Corners& a, const Corners& b, const Vector3d& direction)
      : m_a(a), m_b(b), m_direction(direction) {}

  TranslationExit run() {
    for (int i = 0; i < 3; ++i) {
      meet(m_a[static_cast<std::size_t>(i)], m_direction, m_b,
           [&](double t, const Vector3d& weights, const Vector3d& normal) {
             take(t, corner(i), weights, normal);
           });
      meet(m_b[static_cast<std::size_t>(i)], -m_direction, m_a,
           [&](double t, const Vector3d& weights, const Vector3d& normal) {
             take(t, weights, corner(i), normal);
           });
      for (int j = 0; j < 3; ++j) meetEdges(i, j);
    }
    return m_last;
  }

 private:
  void take(double t, const Vector3d& weightsA, const Vector3d& weightsB, const Vector3d& normal) {
    if (!(t > m_last.t)) return;
    m_last = {t, weightsA, weightsB, normal.dot(m_direction) < 0 ? Vector3d(-normal) : normal};
  }
  /// Calls f(t, weights, normal) if p + t direction is on the triangle.
  template <class F>
  void meet(const Vector3d& p, const Vector3d& direction, const Corners& triangle, F&& f) {
    const auto& [a, b, c] = triangle;
    const Vector3d u = b - a, v = c - a, normal = u.cross(v);
    const double slope = direction.dot(normal), square = normal.squaredNorm();
    if (!(square > 0) || slope == 0) return;
    const double t = (a - p).dot(normal) / slope;
    if (!(t > m_last.t)) return;
    const Vector3d on = (p - a) + t * direction;
    const double s = on.cross(v).dot(normal) / square, w = u.cross(on).dot(normal) / square;
    if (isWeight(s) && isWeight(w) && isWeight(1.0 - s - w))
      f(t, Vector3d(1.0 - s - w, s, w), normal.normalized());
  }
  void meetEdges(int i, int j) {
    const auto end = [](const Corners& corners, int k) -> const Vector3d& {
      return corners[static_cast<std::size_t>(k % 3)];
    };
    const Vector3d e = end(m_a, i + 1) - end(m_a, i), f = end(m_b, j + 1) - end(m_b, j),
                   normal = e.cross(f), from = end(m_b, j) - end(m_a, i);
    const double slope = m_direction.dot(normal), square = normal.squaredNorm();
    if (!(square > 0) || slope == 0) return;
    const double t = from.dot(normal) / slope;
    if (!(t > m_last.t)) return;
    const Vector3d between = from - t * m_direction;
    const double s = between.cross(f).dot(normal) / square,
                 w = between.cross(e).dot(normal) / square;
    if (isWeight(s) && isWeight(w)) take(t, onEdge(i, s), onEdge(j, w), normal.normalized());
  }

  const Corners &m_a, &m_b;
  const Vector3d m_direction;
  TranslationExit m_last{-std::numeric_limits<double>::infinity(), Vector3d::Zero(),
                         Vector3d::Zero(), Vector3d::Zero()};
};

}  // namespace

TranslationExit lastTouch(const Corners& a, const Corners& b, const Vector3d& direction) {
  PALPATE_ASSERT(!direction.isZero(0.0));
  return Search(a, b, direction).run();
}

}  // namespace palpate
