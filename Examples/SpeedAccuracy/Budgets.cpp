#include "Budgets.h"

#include "Scenes.h"

#include <palpate/OctreeBasedCD.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <set>
#include <string>
#include <tuple>
#include <vector>

namespace palpate::accuracy {

namespace {

using Clock = std::chrono::steady_clock;
using Microseconds = std::chrono::microseconds;

/// By pair and key.
using Contacts = std::set<std::tuple<std::size_t, ContactKey>>;

class Organs {
 public:
  /// inOrder: the pairs have priorities in the order in which they were added.
  explicit Organs(bool inOrder) : m_scene(scenes::organs()) {
    for (const scenes::SceneMesh& mesh : m_scene.meshes)
      m_ids.push_back(m_detection.addTriangleMesh(mesh.positions, mesh.triangles));
    int priority = 0;
    for (const auto& [a, b] : m_scene.pairs)
      m_detection.addCollisionPair(m_ids[a], m_ids[b],
                                   {.method = Method::Continuous,
                                    .thickness = m_scene.thickness,
                                    .trackContacts = true,
                                    .priority = inOrder ? --priority : 0});
  }

  void move(int frame) {
    m_detection.advance();
    for (std::size_t i = 0; i < m_ids.size(); ++i) {
      m_scene.positions(frame, i, m_positions);
      m_detection.setPositions(m_ids[i], m_positions);
    }
  }
  Contacts contacts() const {
    Contacts all;
    std::size_t pair = 0;
    for (const auto& [a, b, settings] : m_detection.pairs()) {
      const CollisionData& data = m_detection.collisionData(a, b);
      for (const auto list :
           {data.trackedVertexTriangle(), data.trackedTriangleVertex(), data.trackedEdgeEdge()})
        for (const TrackedContact& contact : list) all.insert({pair, contact.key});
      ++pair;
    }
    return all;
  }
  OctreeBasedCD& detection() { return m_detection; }
  int frames() const { return m_scene.frames; }

 private:
  scenes::Scene m_scene;
  OctreeBasedCD m_detection{{.threads = 1}};
  std::vector<GeometryId> m_ids;
  std::vector<Eigen::Vector3d> m_positions;
};

double percent(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace

report::Figures emptyBudgetFigures() {
  return {{"order"},
          {{"budget", "budget (% of the time of a complete detection)"},
           {"missed", "contacts missed (% of those of a complete detection)"},
           {"new_missed", "contacts missed that began in the frame (%)"},
           {"outdated", "contacts that are no more (% of the reported)"},
           {"unfinished", "pairs not finished (%)"}}};
}

void measureBudgets(int frames, report::Figures& figures) {
  for (const bool inOrder : {true, false})
    for (const int share : {5, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 120}) {
      Organs exact(inOrder), limited(inOrder);
      std::size_t all = 0, missed = 0, begun = 0, begunMissed = 0, reported = 0, outdated = 0,
                  unfinished = 0;
      Contacts last;
      for (int i = 0; i < frames; ++i) {
        const int frame = exact.frames() * i / frames;
        exact.move(frame), limited.move(frame);
        const Clock::time_point start = Clock::now();
        exact.detection().detectCollision();
        const auto whole = std::chrono::duration_cast<Microseconds>(Clock::now() - start);
        limited.detection().detectCollision(whole * share / 100);
        const Contacts truth = exact.contacts(), found = limited.contacts();
        for (const auto& contact : truth) {
          const bool isMissed = !found.contains(contact), isNew = !last.contains(contact);
          missed += isMissed;
          begun += isNew;
          begunMissed += isMissed && isNew;
        }
        all += truth.size();
        reported += found.size();
        outdated += static_cast<std::size_t>(std::count_if(
            found.begin(), found.end(), [&](const auto& c) { return !truth.contains(c); }));
        unfinished += limited.detection().statistics().unfinishedPairs.size();
        last = truth;
      }
      const std::size_t pairs =
          limited.detection().pairs().size() * static_cast<std::size_t>(frames);
      const std::string order = inOrder ? "in the order of addition" : "nearest and fastest first";
      figures.add({{order},
                   {static_cast<double>(share), percent(missed, all), percent(begunMissed, begun),
                    percent(outdated, reported), percent(unfinished, pairs)}});
      std::printf("%-26s budget %3d %%  missed %5.1f %%, of new ones %5.1f %%  pairs %5.1f %%\n",
                  order.c_str(), share, percent(missed, all), percent(begunMissed, begun),
                  percent(unfinished, pairs));
      std::fflush(stdout);
    }
}

}  // namespace palpate::accuracy
