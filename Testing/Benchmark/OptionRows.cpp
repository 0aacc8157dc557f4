// What options of a pair, cuts, budgets and saved states cost in the frames of a scene.
#include "Rows.h"

#include <palpate/OctreeBasedCD.h>

#include <Scenes.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace palpate::benchmark {
namespace {

using Points = std::vector<Eigen::Vector3d>;

/// The frames of a scene, in which each body has one mesh and each pair has the same settings.
class Frames {
 public:
  Frames(const scenes::Scene& scene, const PairSettings& settings) : m_detection({.threads = 1}) {
    Points start;
    for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
      scene.positions(0, m, start);
      m_ids.push_back(m_detection.addTriangleMesh(start, scene.meshes[m].triangles));
    }
    for (const auto& [a, b] : scene.pairs)
      m_detection.addCollisionPair(m_ids[a], m_ids[b], settings);
  }

  /// Begins a step: untimed, except for advance(), which finds the sides of the last one.
  double advance() {
    const double start = now();
    m_detection.advance();
    return now() - start;
  }
  double detect(const std::vector<Points>& positions) {
    const double start = now();
    for (std::size_t m = 0; m < m_ids.size(); ++m) m_detection.setPositions(m_ids[m], positions[m]);
    m_detection.detectCollision();
    return now() - start;
  }
  OctreeBasedCD& detection() { return m_detection; }
  GeometryId id(std::size_t mesh) const { return m_ids[mesh]; }

 private:
  OctreeBasedCD m_detection;
  std::vector<GeometryId> m_ids;
};

std::vector<Points> positionsOf(const scenes::Scene& scene, int frame) {
  std::vector<Points> all(scene.meshes.size());
  for (std::size_t m = 0; m < all.size(); ++m) scene.positions(frame, m, all[m]);
  return all;
}

/// Median milliseconds of a frame, which is what `step` returns, for each kind of settings, in
/// turns.
using Step = std::function<double(Frames&, const std::vector<Points>&)>;
std::vector<double> medians(const scenes::Scene& scene, int frames,
                            const std::vector<std::pair<PairSettings, Step>>& kinds) {
  std::deque<Frames> all;
  for (const auto& [settings, step] : kinds) all.emplace_back(scene, settings);
  std::vector<std::vector<double>> spent(kinds.size());
  for (int frame = 0; frame < frames; ++frame) {
    const std::vector<Points> positions = positionsOf(scene, frame % scene.frames);
    for (std::size_t turn = 0; turn < kinds.size(); ++turn) {
      const std::size_t k = (turn + static_cast<std::size_t>(frame)) % kinds.size();
      const double ms = kinds[k].second(all[k], positions);
      if (frame > 2) spent[k].push_back(ms);
    }
  }
  std::vector<double> result;
  for (std::vector<double>& times : spent) result.push_back(median(std::move(times)));
  return result;
}

std::vector<std::uint32_t> allOf(std::size_t count) {
  std::vector<std::uint32_t> ids(count);
  std::iota(ids.begin(), ids.end(), 0u);
  return ids;
}

double plainStep(Frames& frames, const std::vector<Points>& positions) {
  const double advanced = frames.advance();
  return advanced + frames.detect(positions);
}

void optionRowsOf(Report& report, const scenes::Scene& scene, int count) {
  const auto compare = [&](const char* name, const PairSettings& plain, const PairSettings& with,
                           const Step& step = plainStep) {
    const std::vector<double> ms = medians(scene, count, {{plain, plainStep}, {with, step}});
    report.line(
        {scene.name + ", " + name, milliseconds(ms[0]), milliseconds(ms[1]), times(ms[1] / ms[0])});
    report.row("options", scene.name, 1, name, "plain ms", ms[0]);
    report.row("options", scene.name, 1, name, "with ms", ms[1]);
    report.row("options", scene.name, 1, name, "ratio", ms[1] / ms[0]);
  };
  const PairSettings automatic{.thickness = scene.thickness};
  const PairSettings continuous{.method = Method::Continuous, .thickness = scene.thickness};
  PairSettings with = automatic;
  with.trackContacts = true;
  compare("trackContacts", automatic, with);
  with = automatic;
  with.smoothNormals = true;
  compare("smoothNormals", automatic, with);
  with = continuous;
  with.reportCrossings = true;
  compare("reportCrossings", continuous, with);
  with = continuous;
  with.rememberSides = true;
  compare("rememberSides", continuous, with);
  compare("a budget that is not exceeded", automatic, automatic,
          [](Frames& frames, const std::vector<Points>& positions) {
            const double start = now();
            OctreeBasedCD& detection = frames.detection();
            detection.advance();
            for (std::size_t m = 0; m < positions.size(); ++m)
              detection.setPositions(frames.id(m), positions[m]);
            if (!detection.detectCollision(std::chrono::seconds(10)))
              throw std::runtime_error("ten seconds are too short for a frame");
            return now() - start;
          });
  compare("save() and restore() in each frame", automatic, automatic,
          [](Frames& frames, const std::vector<Points>& positions) {
            const double ms = plainStep(frames, positions);
            const double start = now();
            frames.detection().restore(frames.detection().save());
            return ms + now() - start;
          });
  compare("a cut in each frame: 10 triangles, replaced by as many", automatic, automatic,
          [&scene, ids = allOf(scene.meshes[0].triangles.size()), next = std::size_t{0}](
              Frames& frames, const std::vector<Points>& positions) mutable {
            const std::vector<std::uint32_t> removed(&ids[next], &ids[next + 10]);
            const std::vector<Triangle> added(&scene.meshes[0].triangles[next],
                                              &scene.meshes[0].triangles[next + 10]);
            const double advanced = frames.advance();
            const double start = now();
            const auto names =
                frames.detection().replaceTriangles(frames.id(0), removed, added, {});
            const double cut = now() - start;
            std::copy(names.begin(), names.end(), &ids[next]);
            next = (next + 10) % (ids.size() - 10);
            return advanced + cut + frames.detect(positions);
          });
}

}  // namespace

void optionRows(Report& report, const RowOptions& options) {
  report.heading("Frames, advance() included, without and with an option, ms; 1 thread");
  report.line({"", "without", "with", "ratio"});
  for (const scenes::Scene& scene : {scenes::organs(), scenes::clothOnBall()})
    if (isWanted(scene.name, options.scenes))
      optionRowsOf(report, scene, options.quick ? 30 : scene.frames);
}

}  // namespace palpate::benchmark
