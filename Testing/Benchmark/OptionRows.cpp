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

/// A cut by its share of a mesh.
struct CutSize {
  const char* name;
  std::uint32_t every;  ///< of the triangles from `first` on, one in so many goes; 0: none
  double first, last;   ///< shares of the triangles
  bool again;           ///< those that went are added again
};
constexpr CutSize kCutSizes[] = {
    {"none removed, one added", 0, 0.0, 0.0, true},
    {"1 % in one place removed", 1, 0.5, 0.51, false},
    {"1 % in one place replaced", 1, 0.5, 0.51, true},
    {"1 % everywhere removed", 100, 0.0, 1.0, false},
    {"1 % everywhere replaced", 100, 0.0, 1.0, true},
    {"2 % everywhere removed", 50, 0.0, 1.0, false},
    {"10 % everywhere removed", 10, 0.0, 1.0, false},
    {"50 % everywhere removed", 2, 0.0, 1.0, false},
    {"50 % in one place removed", 1, 0.0, 0.5, false},
    {"all removed", 1, 0.0, 1.0, false},
    {"all replaced", 1, 0.0, 1.0, true},
};

/// The first mesh of a scene is cut in a frame, beside an object to which what is left is handed
/// anew in that frame.
void cutRowsOf(Report& report, const scenes::Scene& scene, const PairSettings& settings,
               const char* kind, int repetitions) {
  constexpr int kFramesBefore = 4, kFramesAfter = 8;
  for (const CutSize& size : kCutSizes) {
    const std::vector<Triangle>& triangles = scene.meshes[0].triangles;
    const auto place = [&](double share) {
      return static_cast<std::size_t>(share * static_cast<double>(triangles.size()));
    };
    std::vector<std::uint32_t> removed;
    std::vector<Triangle> added;
    std::vector<bool> isGone(triangles.size());
    for (std::size_t t = place(size.first); size.every > 0 && t < place(size.last);
         t += size.every) {
      removed.push_back(static_cast<std::uint32_t>(t));
      isGone[t] = true;
      if (size.again) added.push_back(triangles[t]);
    }
    if (size.every == 0) added.push_back(triangles[0]);
    scenes::Scene rest = scene;
    rest.meshes[0].triangles.clear();
    for (std::size_t t = 0; t < triangles.size(); ++t)
      if (!isGone[t]) rest.meshes[0].triangles.push_back(triangles[t]);
    rest.meshes[0].triangles.insert(rest.meshes[0].triangles.end(), added.begin(), added.end());

    std::vector<double> cutMs, anewMs, afterCut, afterAnew;
    for (int repetition = 0; repetition < repetitions; ++repetition) {
      Frames cut(scene, settings);
      int frame = 0;
      for (; frame < kFramesBefore; ++frame) {
        cut.advance();
        cut.detect(positionsOf(scene, frame));
      }
      cut.advance();
      double start = now();
      cut.detection().replaceTriangles(cut.id(0), removed, added, {});
      cutMs.push_back(now() - start + cut.detect(positionsOf(scene, frame)));
      start = now();
      Frames anew(rest, settings);
      anewMs.push_back(now() - start + anew.detect(positionsOf(scene, frame)));
      std::vector<double> later[2];
      for (int i = 0; i < kFramesAfter; ++i) {
        const std::vector<Points> positions = positionsOf(scene, ++frame);
        cut.advance(), anew.advance();
        later[0].push_back(cut.detect(positions));
        later[1].push_back(anew.detect(positions));
      }
      afterCut.push_back(median(later[0]));
      afterAnew.push_back(median(later[1]));
    }
    const double cut = median(cutMs), anew = median(anewMs);
    const double later = median(afterCut) / median(afterAnew);
    const std::string name = std::string(kind) + ": " + size.name;
    report.line({scene.name + ", " + name, milliseconds(cut), milliseconds(anew), times(cut / anew),
                 times(later)});
    report.row("cuts", scene.name, 1, name, "cut ms", cut);
    report.row("cuts", scene.name, 1, name, "new object ms", anew);
    report.row("cuts", scene.name, 1, name, "ratio", cut / anew);
    report.row("cuts", scene.name, 1, name, "later frames", later);
  }
}

}  // namespace

void cutRows(Report& report, const RowOptions& options) {
  report.heading(
      "A cut and the next frame, and a new object of what is left with its first frame, ms; the "
      "frames after both; 1 thread");
  report.line({"", "cut", "new object", "ratio", "later frames"});
  const scenes::Scene scene = scenes::clothOnBall();
  if (!isWanted(scene.name, options.scenes)) return;
  const int repetitions = options.quick ? 3 : 9;
  cutRowsOf(report, scene, {.method = Method::Proximity, .thickness = scene.thickness}, "Proximity",
            repetitions);
  cutRowsOf(report, scene, {.thickness = scene.thickness}, "Auto", repetitions);
}

void optionRows(Report& report, const RowOptions& options) {
  report.heading("Frames, advance() included, without and with an option, ms; 1 thread");
  report.line({"", "without", "with", "ratio"});
  for (const scenes::Scene& scene : {scenes::organs(), scenes::clothOnBall()})
    if (isWanted(scene.name, options.scenes))
      optionRowsOf(report, scene, options.quick ? 30 : scene.frames);
}

}  // namespace palpate::benchmark
