// nanoflann 1.4: a k-d tree of doubles over the positions of a point set, rebuilt for each frame.
#include "SpatialEngine.h"

#include <nanoflann.hpp>

#include <cmath>
#include <optional>

namespace palpate::benchmark {
namespace {

struct Cloud {
  const std::vector<Eigen::Vector3d>* positions = nullptr;
  std::size_t kdtree_get_point_count() const { return positions->size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return (*positions)[i][static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

class NanoflannQueries : public SpatialEngine {
  using Tree = nanoflann::KDTreeSingleIndexAdaptor<
      nanoflann::L2_Simple_Adaptor<double, Cloud, double, std::uint32_t>, Cloud, 3, std::uint32_t>;

 public:
  std::string name() const override { return "nanoflann 1.4"; }

  void prepare(const std::vector<Triangle>&, const std::vector<Eigen::Vector3d>& p) override {
    update(p);
  }
  void update(const std::vector<Eigen::Vector3d>& positions) override {
    m_positions = positions;
    m_cloud.positions = &m_positions;
    m_tree.emplace(3, m_cloud);
  }

  bool answers(SpatialQuery query) const override {
    return query == SpatialQuery::Closest || query == SpatialQuery::EightNearest ||
           query == SpatialQuery::Ball;
  }

  void ask(SpatialQuery query, std::span<const SpatialCase> cases, const ShapeSizes& sizes,
           SpatialAnswers& out) override {
    const std::size_t count = query == SpatialQuery::Closest ? 1 : 8;
    std::uint32_t elements[8];
    double squared[8];
    for (const SpatialCase& c : cases) {
      if (query == SpatialQuery::Ball) {
        m_tree->radiusSearch(c.point.data(), sizes.ball * sizes.ball, m_found, m_unsorted);
        for (const auto& [element, distanceSquared] : m_found) out.elements.push_back(element);
        out.endCase();
        continue;
      }
      const std::size_t found = m_tree->knnSearch(c.point.data(), count, elements, squared);
      for (std::size_t i = 0; i < found; ++i) out.add(std::sqrt(squared[i]), elements[i]);
    }
  }

 private:
  std::vector<Eigen::Vector3d> m_positions;
  Cloud m_cloud;
  std::optional<Tree> m_tree;
  std::vector<std::pair<std::uint32_t, double>> m_found;
  nanoflann::SearchParams m_unsorted{32, 0, false};
};

}  // namespace

std::unique_ptr<SpatialEngine> makeNanoflannQueries() {
  return std::make_unique<NanoflannQueries>();
}

}  // namespace palpate::benchmark
