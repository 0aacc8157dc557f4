#include "Stages/TimeStage.h"

#include "PalpateEngine.h"
#include "Workload.h"

#include <optional>

namespace palpate::benchmark {
namespace {

constexpr const char* kScenes[] = {"organs", "cloth", "uneven", "sheets-64K", "folded-cloth"};

/// Made once: positions take longer to compute than to collide.
const Workload& workloadOf(std::size_t scene) {
  static std::optional<Workload> made[std::size(kScenes)];
  if (!made[scene]) made[scene] = makeWorkload(kScenes[scene], 0, PALPATE_SHARED_DATA);
  return *made[scene];
}

}  // namespace

void timeStage(::benchmark::State& state, Through through, OctreeUpdate update, Stage stage) {
  const Workload& workload = workloadOf(static_cast<std::size_t>(state.range(0)));
  Task task = workload.task;
  task.threads = static_cast<int>(state.range(1));
  PalpateScene scene(task, workload.frames[0], update);
  std::size_t frame = 0;
  double pairs = 0;
  for (auto _ : state) {
    scene.setPositions(workload.frames[frame++ % workload.frames.size()]);
    if (through == Through::Contacts) scene.detection.detectCollision();
    const FrameStatistics statistics = through == Through::Contacts
                                           ? scene.detection.statistics()
                                           : findCandidates(scene.detection);
    state.SetIterationTime(stage(statistics.milliseconds) / 1000);
    pairs += static_cast<double>(statistics.candidatePairs);
  }
  const auto frames = static_cast<double>(state.iterations());
  state.SetLabel(workload.name);
  state.counters["triangles"] = static_cast<double>(workload.triangles());
  state.counters["pairs"] = pairs / frames;
  state.counters["per_triangle"] =
      ::benchmark::Counter(static_cast<double>(workload.triangles()) * frames,
                           ::benchmark::Counter::kIsRate | ::benchmark::Counter::kInvert);
}

void everyScene(::benchmark::internal::Benchmark* benchmark) {
  benchmark->ArgNames({"scene", "threads"})->UseManualTime()->Unit(::benchmark::kMillisecond);
  for (std::size_t scene = 0; scene < std::size(kScenes); ++scene)
    for (const int threads : {1, 2}) benchmark->Args({static_cast<std::int64_t>(scene), threads});
}

}  // namespace palpate::benchmark
