#include "Contestant.h"

#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/narrowphase/collision.h>

#include <chrono>

namespace palpate::accuracy {

namespace {

class FclRun : public Run {
 public:
  using Model = fcl::BVHModel<fcl::OBBRSSd>;

  FclRun(const scenes::Scene& scene, const Positions& start)
      : m_pairs(scene.pairs), m_results(scene.pairs.size()) {
    for (std::size_t m = 0; m < start.size(); ++m) {
      std::vector<fcl::Triangle> triangles;
      for (const auto& [a, b, c] : scene.meshes[m].triangles) triangles.emplace_back(a, b, c);
      Model& model = *m_models.emplace_back(std::make_unique<Model>());
      model.beginModel(static_cast<int>(triangles.size()), static_cast<int>(start[m].size()));
      model.addSubModel(start[m], triangles);
      model.endModel();
    }
  }

  double step(const Positions& now) override {
    const auto start = std::chrono::steady_clock::now();
    for (std::size_t m = 0; m < m_models.size(); ++m) {
      m_models[m]->beginReplaceModel();
      m_models[m]->replaceSubModel(now[m]);
      m_models[m]->endReplaceModel(true, true);
    }
    const fcl::CollisionRequestd request(1u << 24, true);  // contacts at most, and all about them
    const fcl::Transform3d still = fcl::Transform3d::Identity();
    for (std::size_t p = 0; p < m_pairs.size(); ++p) {
      m_results[p].clear();
      fcl::collide(m_models[m_pairs[p].first].get(), still, m_models[m_pairs[p].second].get(),
                   still, request, m_results[p]);
    }
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
        .count();
  }

  /// Its normals point from the first to the second mesh. Its contacts are at the frame's end.
  Claims claims(std::size_t pair) const override {
    const fcl::CollisionResultd& result = m_results[pair];

    Claims all;
    all.ofTriangles = true;
    for (std::size_t i = 0; i < result.numContacts(); ++i) {
      const fcl::Contactd& contact = result.getContact(i);
      const auto a = static_cast<std::uint32_t>(contact.b1),
                 b = static_cast<std::uint32_t>(contact.b2);
      all.triangles.push_back({a, b});
      all.claims.push_back({{FeaturePair::Kind::Triangles, {a, b}},
                            -contact.normal,
                            -contact.penetration_depth,
                            1.0});
    }
    return all;
  }

 private:
  std::vector<std::unique_ptr<Model>> m_models;
  std::vector<std::pair<std::size_t, std::size_t>> m_pairs;
  std::vector<fcl::CollisionResultd> m_results;
};

}  // namespace

Contestant fclCollide() {
  return {"FCL", "collide()", false,
          [](const scenes::Scene& scene, const Positions& start) -> std::unique_ptr<Run> {
            return std::make_unique<FclRun>(scene, start);
          }};
}

}  // namespace palpate::accuracy
