#include "Budgets.h"

#include "Scenes.h"

#include <palpate/OctreeBasedCD.h>

#include <algorithm>
#include <array>
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
  /// hasPriority: the first pair does.
  explicit Organs(bool hasPriority) : m_scene(scenes::organs()) {
    for (const scenes::SceneMesh& mesh : m_scene.meshes)
      m_ids.push_back(m_detection.addTriangleMesh(mesh.positions, mesh.triangles));
    for (const auto& [a, b] : m_scene.pairs)
      m_detection.addCollisionPair(
          m_ids[a], m_ids[b],
          {.method = Method::Continuous,
           .thickness = m_scene.thickness,
           .trackContacts = true,
           .priority = hasPriority && m_detection.pairs().empty() ? 1 : 0});
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
           {"missed_first", "contacts of the first pair missed (%)"},
           {"missed", "contacts of all pairs missed (%)"},
           {"outdated", "contacts that are no more (% of the reported)"},
           {"unfinished", "pairs not finished (%)"}}};
}

void measureBudgets(int frames, report::Figures& figures) {
  for (const bool hasPriority : {false, true})
    for (const int share : {5, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 120}) {
      Organs exact(hasPriority), limited(hasPriority);
      std::array<std::size_t, 2> touching{}, missed{};  // of the first pair, and of all
      std::size_t reported = 0, outdated = 0, unfinished = 0;
      exact.move(0), limited.move(0);
      for (int i = 1; i <= frames; ++i) {
        const int frame = (exact.frames() - 1) * i / frames;
        exact.move(frame), limited.move(frame);
        const Clock::time_point start = Clock::now();
        exact.detection().detectCollision();
        const auto whole = std::chrono::duration_cast<Microseconds>(Clock::now() - start);
        limited.detection().detectCollision(whole * share / 100);
        const Contacts truth = exact.contacts(), found = limited.contacts();
        for (const auto& contact : truth)
          for (std::size_t all = std::get<0>(contact) == 0 ? 0 : 1; all < 2; ++all) {
            ++touching[all];
            missed[all] += !found.contains(contact);
          }
        reported += found.size();
        outdated += static_cast<std::size_t>(std::count_if(
            found.begin(), found.end(), [&](const auto& c) { return !truth.contains(c); }));
        unfinished += limited.detection().statistics().unfinishedPairs.size();
      }
      const std::size_t pairs =
          limited.detection().pairs().size() * static_cast<std::size_t>(frames);
      const std::string order = hasPriority ? "the first pair has priority" : "without priorities";
      const double ofFirst = percent(missed[0], touching[0]),
                   ofAll = percent(missed[1], touching[1]);
      figures.add({{order},
                   {static_cast<double>(share), ofFirst, ofAll, percent(outdated, reported),
                    percent(unfinished, pairs)}});
      std::printf("%-28s budget %3d %%  missed %5.1f %% of the first pair, %5.1f %% of all\n",
                  order.c_str(), share, ofFirst, ofAll);
      std::fflush(stdout);
    }
}

}  // namespace palpate::accuracy
