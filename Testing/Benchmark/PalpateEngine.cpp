#include "PalpateEngine.h"

#include "Measure.h"

#include <optional>
#include <vector>

namespace palpate::benchmark {
namespace {

Settings settingsFor(OctreeUpdate update, int threads) {
  Settings settings;
  settings.octree.update = update;
  settings.threads = threads;
  return settings;
}

class PalpateEngine : public BroadPhase {
 public:
  PalpateEngine(OctreeUpdate update, PairOrder order) : m_update(update), m_order(order) {}

  std::string name() const override {
    return std::string("Palpate") + (rebuilds() ? ", full rebuild" : "") +
           (m_order == PairOrder::Sorted ? ", sorted pairs" : "");
  }
  bool rebuilds() const override { return m_update == OctreeUpdate::Rebuild; }

  void prepare(const Task& task, const Positions& positions) override {
    m_task = task;
    m_scene.emplace(task, positions, m_update);
    m_lists.prepare(task.pairs.size(), 1);
    m_sorted.resize(task.pairs.size());
  }

  void update(const Positions& positions) override {
    m_scene->setPositions(positions);
    m_scene->detection.update();
  }

  void collide() override {
    if (m_order == PairOrder::Sorted) {
      for (std::size_t pair = 0; pair < m_task.pairs.size(); ++pair)
        m_sorted[pair] = m_scene->detection.candidatePairs(first(pair), second(pair));
      return;
    }
    m_lists.clear();
    m_scene->detection.forEachCandidate(
        [this](const CollisionPair& pair, std::span<const ElementPair> batch) {
          std::vector<ElementPair>& list = m_lists.of(indexOf(pair), 0);
          list.insert(list.end(), batch.begin(), batch.end());
        });
  }

  std::vector<ElementPair> candidates(std::size_t pair) const override {
    return m_order == PairOrder::Found ? m_lists.sorted(pair) : m_sorted[pair];
  }

 private:
  std::size_t indexOf(const CollisionPair& pair) const {
    std::size_t i = 0;
    while (first(i) != pair.a || second(i) != pair.b) ++i;
    return i;
  }
  GeometryId first(std::size_t pair) const { return m_scene->ids[m_task.pairs[pair][0]]; }
  GeometryId second(std::size_t pair) const { return m_scene->ids[m_task.pairs[pair][1]]; }

  OctreeUpdate m_update;
  PairOrder m_order;
  Task m_task;
  std::optional<PalpateScene> m_scene;
  PairLists m_lists;
  std::vector<std::vector<ElementPair>> m_sorted;
};

}  // namespace

PalpateScene::PalpateScene(const Task& task, const Positions& positions, OctreeUpdate update,
                           double thickness)
    : detection(settingsFor(update, task.threads)) {
  PairSettings pairSettings;
  pairSettings.method = Method::Proximity;
  pairSettings.thickness = thickness > 0 ? thickness : task.thickness;
  for (std::size_t mesh = 0; mesh < task.meshes.size(); ++mesh)
    ids.push_back(detection.addTriangleMesh(positions[mesh], task.meshes[mesh]));
  for (const auto& [a, b] : task.pairs) detection.addCollisionPair(ids[a], ids[b], pairSettings);
}

void PalpateScene::setPositions(const Positions& positions) {
  detection.advance();  // a new step
  for (std::size_t mesh = 0; mesh < ids.size(); ++mesh)
    detection.setPositions(ids[mesh], positions[mesh]);
}

std::unique_ptr<BroadPhase> makePalpate(OctreeUpdate update, PairOrder order) {
  return std::make_unique<PalpateEngine>(update, order);
}

FrameStatistics findCandidates(OctreeBasedCD& detection) {
  detection.update();
  FrameStatistics statistics = detection.statistics();
  const double start = now();
  detection.forEachCandidate([&](const CollisionPair&, std::span<const ElementPair> batch) {
    statistics.candidatePairs += batch.size();
  });
  statistics.milliseconds.pairs = now() - start;
  return statistics;
}

}  // namespace palpate::benchmark
