// FCL 0.7: BVHModel<AABB<double>>, vertices replaced and the tree refitted bottom-up, then FCL's
// own recursion with a traversal node that keeps every pair of leaves whose boxes, inflated,
// overlap. FCL fits its boxes to the vertices, so the test carries the thickness. (endUpdateModel()
// would fit boxes over the last two frames.)
#include "BroadPhase.h"

#include <fcl/math/bv/utility.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/narrowphase/detail/traversal/collision/bvh_collision_traversal_node.h>
#include <fcl/narrowphase/detail/traversal/traversal_recurse.h>

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace palpate::benchmark {
namespace {

using Box = fcl::AABB<double>;
using Model = fcl::BVHModel<Box>;

class Collector : public fcl::detail::BVHCollisionTraversalNode<Box> {
 public:
  Collector(const Model& a, const Model& b, double distance, std::vector<ElementPair>& list,
            const std::vector<Triangle>* within)
      : m_distance(distance), m_list(list), m_within(within) {
    model1 = &a;
    model2 = &b;
  }

  bool BVTesting(int b1, int b2) const override {  // true: apart
    const Box &a = model1->getBV(b1).bv, &b = model2->getBV(b2).bv;
    return a.min_[0] - m_distance > b.max_[0] || a.min_[1] - m_distance > b.max_[1] ||
           a.min_[2] - m_distance > b.max_[2] || b.min_[0] - m_distance > a.max_[0] ||
           b.min_[1] - m_distance > a.max_[1] || b.min_[2] - m_distance > a.max_[2];
  }

  void leafTesting(int b1, int b2) const override {
    const auto a = static_cast<std::uint32_t>(model1->getBV(b1).primitiveId());
    const auto b = static_cast<std::uint32_t>(model2->getBV(b2).primitiveId());
    if (!m_within)
      m_list.push_back({a, b});
    else if (!shareVertex((*m_within)[a], (*m_within)[b]))
      m_list.push_back({std::min(a, b), std::max(a, b)});
  }

  bool canStop() const override { return false; }

 private:
  double m_distance;
  std::vector<ElementPair>& m_list;
  const std::vector<Triangle>* m_within;
};

class Fcl : public BroadPhase {
 public:
  std::string name() const override { return "FCL 0.7 BVHModel<AABB>, refit"; }
  bool rebuilds() const override { return false; }

  void prepare(const Task& task, const Positions& positions) override {
    m_task = task;
    m_arena.terminate();
    m_arena.initialize(task.threads);
    m_lists.prepare(task.pairs.size(), 1);
    m_models.clear();
    for (std::size_t i = 0; i < task.meshes.size(); ++i) {
      std::vector<fcl::Triangle> triangles;
      for (const Triangle& t : task.meshes[i]) triangles.emplace_back(t[0], t[1], t[2]);
      auto& model = m_models.emplace_back(std::make_unique<Model>());
      model->beginModel(static_cast<int>(triangles.size()), static_cast<int>(positions[i].size()));
      model->addSubModel(positions[i], triangles);
      model->endModel();
    }
  }

  void update(const Positions& positions) override {
    m_arena.execute([&] {
      tbb::parallel_for(std::size_t(0), m_models.size(), [&](std::size_t i) {
        m_models[i]->beginReplaceModel();
        m_models[i]->replaceSubModel(positions[i]);
        m_models[i]->endReplaceModel(true, true);
      });
    });
  }

  void collide() override {
    m_lists.clear();
    m_arena.execute([&] {
      tbb::parallel_for(std::size_t(0), m_task.pairs.size(),
                        [&](std::size_t pair) { collide(pair); });
    });
  }

  std::vector<ElementPair> candidates(std::size_t pair) const override {
    return m_lists.sorted(pair);
  }

 private:
  void collide(std::size_t pair) {
    const auto [a, b] = m_task.pairs[pair];
    Collector collector(*m_models[a], *m_models[b], m_task.thickness, m_lists.of(pair, 0),
                        a == b ? &m_task.meshes[a] : nullptr);
    if (a == b)
      fcl::detail::selfCollisionRecurse<double>(&collector, 0, nullptr);
    else
      fcl::detail::collisionRecurse<double>(&collector, 0, 0, nullptr);
  }

  Task m_task;
  std::vector<std::unique_ptr<Model>> m_models;
  PairLists m_lists;
  tbb::task_arena m_arena;
};

}  // namespace

std::unique_ptr<BroadPhase> makeFcl() { return std::make_unique<Fcl>(); }

}  // namespace palpate::benchmark
