// Bullet 3: one btDbvt for each mesh, built once from the top, its volumes refitted bottom-up in
// the way of Bullet's own soft bodies (btSoftBody::updateFaceTree), then collideTT. Bullet has no
// parallel traversal of one pair of trees; with threads, meshes and pairs are spread over them.
#include "BroadPhase.h"

#include <BulletCollision/BroadphaseCollision/btDbvt.h>

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace palpate::benchmark {
namespace {

btDbvtVolume volumeOf(const Triangle& t, const Eigen::Vector3d* positions, double margin) {
  const DoubleBox box = boxOf(t, positions, margin);
  return btDbvtVolume::FromMM(
      {roundDown(box.min.x()), roundDown(box.min.y()), roundDown(box.min.z())},
      {roundUp(box.max.x()), roundUp(box.max.y()), roundUp(box.max.z())});
}

struct Between : btDbvt::ICollide {
  std::vector<ElementPair>* list;
  void Process(const btDbvtNode* a, const btDbvtNode* b) {
    list->push_back(
        {static_cast<std::uint32_t>(a->dataAsInt), static_cast<std::uint32_t>(b->dataAsInt)});
  }
};

struct Within : btDbvt::ICollide {
  std::vector<ElementPair>* list;
  const std::vector<Triangle>* triangles;
  void Process(const btDbvtNode* first, const btDbvtNode* second) {
    auto a = static_cast<std::uint32_t>(first->dataAsInt),
         b = static_cast<std::uint32_t>(second->dataAsInt);
    if (shareVertex((*triangles)[a], (*triangles)[b])) return;
    list->push_back({std::min(a, b), std::max(a, b)});
  }
};

class Bullet : public BroadPhase {
 public:
  std::string name() const override { return "Bullet 3.24 btDbvt, refit"; }
  bool rebuilds() const override { return false; }

  void prepare(const Task& task, const Positions& positions) override {
    m_task = task;
    m_arena.terminate();
    m_arena.initialize(task.threads);
    m_lists.prepare(task.pairs.size(), 1);
    m_trees = std::vector<btDbvt>(task.meshes.size());
    m_stacks = std::vector<btDbvt>(task.pairs.size());
    for (std::size_t i = 0; i < m_trees.size(); ++i) {
      for (std::size_t t = 0; t < task.meshes[i].size(); ++t)
        m_trees[i]
            .insert(volumeOf(task.meshes[i][t], positions[i].data(), task.thickness / 2), nullptr)
            ->dataAsInt = static_cast<int>(t);
      m_trees[i].optimizeTopDown();
    }
  }

  void update(const Positions& positions) override {
    m_arena.execute([&] {
      tbb::parallel_for(std::size_t(0), m_trees.size(), [&](std::size_t i) {
        if (m_trees[i].m_root)
          refit(m_trees[i].m_root, m_task.meshes[i].data(), positions[i].data());
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
  void refit(btDbvtNode* node, const Triangle* triangles, const Eigen::Vector3d* positions) {
    if (node->isleaf()) {
      node->volume = volumeOf(triangles[node->dataAsInt], positions, m_task.thickness / 2);
      return;
    }
    refit(node->childs[0], triangles, positions);
    refit(node->childs[1], triangles, positions);
    Merge(node->childs[0]->volume, node->childs[1]->volume, node->volume);
  }

  // The stack that persists is a member of the tree it is called on, so each pair has an empty tree
  // of its own.
  void collide(std::size_t pair) {
    const auto [a, b] = m_task.pairs[pair];
    if (a == b) {
      Within within;
      within.list = &m_lists.of(pair, 0);
      within.triangles = &m_task.meshes[a];
      m_stacks[pair].collideTTpersistentStack(m_trees[a].m_root, m_trees[a].m_root, within);
    } else {
      Between between;
      between.list = &m_lists.of(pair, 0);
      m_stacks[pair].collideTTpersistentStack(m_trees[a].m_root, m_trees[b].m_root, between);
    }
  }

  Task m_task;
  std::vector<btDbvt> m_trees, m_stacks;
  PairLists m_lists;
  tbb::task_arena m_arena;
};

}  // namespace

std::unique_ptr<BroadPhase> makeBullet() { return std::make_unique<Bullet>(); }

}  // namespace palpate::benchmark
