#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <optional>
#include <vector>

namespace palpate {

/// The shortest translation t with normal . t >= height for some half-spaces: the point of their
/// intersection that is nearest to the origin. Of few half-spaces: all sets of up to three are
/// tried.
class ShortestTranslation {
 public:
  void clear() {
    m_normals.clear();
    m_heights.clear();
  }
  void add(const Eigen::Vector3d& normal, double height) {
    m_normals.push_back(normal);
    m_heights.push_back(height);
  }
  /// None if no translation satisfies all, within rounding.
  std::optional<Eigen::Vector3d> find() const {
    std::optional<Eigen::Vector3d> best;
    const std::size_t size = m_normals.size();
    for (std::size_t i = 0; i < size; ++i) {
      take(m_heights[i] * m_normals[i], best);
      for (std::size_t j = i + 1; j < size; ++j) {
        take(onTwo(i, j), best);
        for (std::size_t k = j + 1; k < size; ++k) take(onThree(i, j, k), best);
      }
    }
    return best;
  }

 private:
  void take(const Eigen::Vector3d& t, std::optional<Eigen::Vector3d>& best) const {
    constexpr double kRounding = 1 - 0x1p-30;
    const double square = t.squaredNorm();
    if (!(square > 0) || (best && !(square < best->squaredNorm()))) return;
    for (std::size_t i = 0; i < m_normals.size(); ++i)
      if (!(m_normals[i].dot(t) >= kRounding * m_heights[i])) return;
    best = t;
  }
  Eigen::Vector3d onTwo(std::size_t i, std::size_t j) const {
    const double cosine = m_normals[i].dot(m_normals[j]), square = 1.0 - cosine * cosine;
    return ((m_heights[i] - cosine * m_heights[j]) * m_normals[i] +
            (m_heights[j] - cosine * m_heights[i]) * m_normals[j]) /
           square;
  }
  Eigen::Vector3d onThree(std::size_t i, std::size_t j, std::size_t k) const {
    const Eigen::Vector3d &a = m_normals[i], &b = m_normals[j], &c = m_normals[k];
    const Eigen::Vector3d bc = b.cross(c), ca = c.cross(a), ab = a.cross(b);
    return (m_heights[i] * bc + m_heights[j] * ca + m_heights[k] * ab) / a.dot(bc);
  }

  std::vector<Eigen::Vector3d> m_normals;
  std::vector<double> m_heights;
};

}  // namespace palpate
