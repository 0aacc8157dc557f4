#include "Rows.h"

#include "AllocationCount.h"
#include "PalpateEngine.h"

#include "Core/SimdPath.h"

#include <palpate/Executor.h>

#include <Meshes.h>

#include <cmath>
#include <cstdio>

namespace palpate::benchmark {
namespace {

constexpr const char* kUpdateNames[] = {"as shipped", "full rebuild"};

std::string whole(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.0f", value);
  return text;
}

std::string tenths(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", value);
  return text;
}

/// Milliseconds by stage of every frame of some passes, without the first frame of each pass.
struct StageSamples {
  std::vector<double> boxes, octree, pairs, narrowPhase, order, total;

  void add(const FrameStatistics::Stages& stages) {
    boxes.push_back(stages.boxes);
    octree.push_back(stages.octree);
    pairs.push_back(stages.pairs);
    narrowPhase.push_back(stages.narrowPhase);
    order.push_back(stages.order);
    total.push_back(stages.total());
  }
};

void stageRow(Report& report, const Workload& workload, OctreeUpdate update, int repetitions) {
  PalpateScene scene(workload.task, workload.frames[0], update);
  StageSamples samples;
  std::vector<double> pairs;
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    for (std::size_t frame = 0; frame < workload.frames.size(); ++frame) {
      scene.setPositions(workload.frames[frame]);
      const FrameStatistics statistics = findCandidates(scene.detection);
      if (frame == 0) continue;
      samples.add(statistics.milliseconds);
      pairs.push_back(static_cast<double>(statistics.candidatePairs));
    }
  }
  const double perTriangle = 1e6 / static_cast<double>(workload.triangles());
  const double perPair = 1e6 / std::max(1.0, median(pairs));
  const double boxes = median(samples.boxes), octree = median(samples.octree);
  const double found = median(samples.pairs), order = median(samples.order);
  const char* name = kUpdateNames[update == OctreeUpdate::Rebuild];
  report.line({workload.name + ", " + name, milliseconds(boxes), milliseconds(octree),
               milliseconds(found), milliseconds(order), tenths(boxes * perTriangle),
               tenths(octree * perTriangle), tenths(found * perTriangle), tenths(found * perPair),
               tenths(order * perPair)});
  const auto row = [&](const char* metric, double value) {
    report.row("stages", workload.name, workload.task.threads, name, metric, value);
  };
  row("boxes ms", boxes);
  row("octree ms", octree);
  row("pairs ms", found);
  row("order ms", order);
  row("boxes ns per triangle", boxes * perTriangle);
  row("octree ns per triangle", octree * perTriangle);
  row("pairs ns per pair", found * perPair);
  row("order ns per pair", order * perPair);
}

std::unique_ptr<BroadPhase> shipped() { return makePalpate(OctreeUpdate::Auto, PairOrder::Found); }

/// Times one engine on two workloads in turns, and the second over the first.
void pairedRow(Report& report, const char* table, const Workload& first, const Workload& second,
               std::unique_ptr<BroadPhase> (*make)(), const MeasureOptions& options) {
  const auto engineA = make(), engineB = make();
  engineA->prepare(first.task, first.frames[0]);
  engineB->prepare(second.task, second.frames[0]);
  const Contestant contestants[] = {{engineA.get(), &first.frames},
                                    {engineB.get(), &second.frames}};
  const auto timings = takeTurns(contestants, options);
  const double factor = ratio(timings[1], timings[0]);
  report.line({first.name + ", " + engineA->name(), milliseconds(timings[0].update),
               milliseconds(timings[0].total), milliseconds(timings[1].update),
               milliseconds(timings[1].total), times(factor)});
  const auto row = [&](const char* metric, double value) {
    report.row(table, first.name, first.task.threads, engineA->name(), metric, value);
  };
  row("without ms", timings[0].total);
  row("with ms", timings[1].total);
  row("ratio", factor);
}

std::unique_ptr<BroadPhase> rebuilding() {
  return makePalpate(OctreeUpdate::Rebuild, PairOrder::Found);
}

}  // namespace

bool isWanted(const std::string& name, const std::vector<std::string>& parts) {
  return parts.empty() || std::any_of(parts.begin(), parts.end(), [&](const std::string& part) {
           return name.find(part) != std::string::npos;
         });
}

void stageRows(Report& report, const RowOptions& options) {
  for (const int threads : options.threads) {
    report.heading("Stages, median ms, ns per triangle and ns per pair, " +
                   std::to_string(threads) + (threads == 1 ? " thread" : " threads"));
    report.line({"", "boxes", "octree", "pairs", "order", "boxes/tri", "octree/tri", "pairs/tri",
                 "pairs/pair", "order/pair"});
    for (const std::string& name : workloadNames(options.sharedData)) {
      Workload workload = makeWorkload(name, options.frames, options.sharedData);
      workload.task.threads = threads;
      for (const OctreeUpdate update : {OctreeUpdate::Auto, OctreeUpdate::Rebuild})
        stageRow(report, workload, update, options.quick ? 1 : 3);
    }
  }
}

void wholeFrameRows(Report& report, const RowOptions& options) {
  report.heading("Whole frame: organs, all proximity contacts, Distinct, sorted; ms");
  report.line({"", "median", "p99", "worst", "narrow", "contacts", "Embree*"});
  for (const int threads : options.threads) {
    Workload workload = makeWorkload("organs", 0, options.sharedData);
    workload.task.threads = threads;
    workload.task.thickness /= 2;  // a twentieth of the mean edge
    PalpateScene scene(workload.task, workload.frames[0]);
    std::vector<double> total, narrow, contacts;
    for (int repetition = 0; repetition < options.measure.repetitions + 1; ++repetition) {
      for (const Positions& frame : workload.frames) {
        const double start = now();
        scene.setPositions(frame);
        scene.detection.detectCollision();
        const double end = now();
        if (repetition == 0) continue;  // until every buffer has its peak size
        total.push_back(end - start);
        narrow.push_back(scene.detection.statistics().milliseconds.narrowPhase);
        contacts.push_back(static_cast<double>(scene.detection.statistics().contacts));
      }
    }
    std::string embree = "-";
#ifdef PALPATE_BENCHMARK_BASELINES
    const auto embreeRebuild = makeEmbreeMorton();
    embreeRebuild->prepare(workload.task, workload.frames[0]);
    const Contestant contestant{embreeRebuild.get(), &workload.frames};
    embree = milliseconds(takeTurns({&contestant, 1}, options.measure)[0].total);
    report.row("whole frame", "organs", threads, "Embree rebuild + collide", "median ms",
               std::stod(embree));
#endif
    report.line({std::to_string(threads) + " threads", milliseconds(median(total)),
                 milliseconds(quantile(total, 0.99)), milliseconds(quantile(total, 1)),
                 milliseconds(median(narrow)), whole(median(contacts)), embree});
    report.row("whole frame", "organs", threads, "Palpate", "median ms", median(total));
    report.row("whole frame", "organs", threads, "Palpate", "p99 ms", quantile(total, 0.99));
    report.row("whole frame", "organs", threads, "Palpate", "worst ms", quantile(total, 1));
    report.row("whole frame", "organs", threads, "Palpate", "narrow phase ms", median(narrow));
    report.row("whole frame", "organs", threads, "Palpate", "contacts", median(contacts));
  }
  report.line({"* rebuild + rtcCollide, candidate pairs only"});
}

void farTriangleRows(Report& report, const RowOptions& options) {
  report.heading("One triangle a million scene sizes away: update and frame, ms; 1 thread");
  report.line({"", "update", "frame", "with: update", "frame", "ratio"});
  for (const char* name : {"organs", "sheets-64K"}) {
    const Workload plain = makeWorkload(name, options.frames, options.sharedData);
    Workload withFar = plain;
    addFarTriangle(withFar);
    pairedRow(report, "far triangle", plain, withFar, shipped, options.measure);
    pairedRow(report, "far triangle", plain, withFar, rebuilding, options.measure);
#ifdef PALPATE_BENCHMARK_BASELINES
    pairedRow(report, "far triangle", plain, withFar, makeEmbreeRefit, options.measure);
    pairedRow(report, "far triangle", plain, withFar, makeEmbreeMorton, options.measure);
#endif
  }
}

void atRestRows(Report& report, const RowOptions& options) {
  report.heading(
      "At rest: update() in ms while moving, with the same positions set, with none set");
  for (const char* name : {"organs", "sheets-64K", "sheets-1M"}) {
    const Workload workload = makeWorkload(name, options.frames, options.sharedData);
    PalpateScene scene(workload.task, workload.frames[0]);
    const auto time = [&](auto&& frame) {
      std::vector<double> samples;
      for (std::size_t i = 0; i < workload.frames.size(); ++i) {
        const double start = now();
        frame(workload.frames[i]);
        samples.push_back(now() - start);
      }
      return median(samples);
    };
    const double moving = time([&](const Positions& positions) {
      scene.setPositions(positions);
      scene.detection.update();
    });
    const double same = time([&](const Positions&) {
      scene.setPositions(workload.frames.back());
      scene.detection.update();
    });
    const double none = time([&](const Positions&) { scene.detection.update(); });
    report.line({workload.name, milliseconds(moving), milliseconds(same), milliseconds(none)});
    report.row("at rest", name, 1, "Palpate", "moving ms", moving);
    report.row("at rest", name, 1, "Palpate", "same positions ms", same);
    report.row("at rest", name, 1, "Palpate", "no positions ms", none);
  }
}

void smallToolRows(Report& report, const RowOptions& options) {
  report.heading("A tool of 1,280 triangles over a sheet at rest, and far from it; 1 thread, ms");
  report.line({"", "frame", "pairs", "far: frame"});
  for (const int cells : {90, 180, 360, 720}) {
    const scenes::SceneMesh sheet = scenes::sheet(cells), sphere = scenes::sphere(8);
    const double edge = 2.0 / cells;
    Task task;
    task.meshes = {sheet.triangles, sphere.triangles};
    task.pairs = {{0, 1}};
    task.thickness = edge / 10;
    PalpateScene scene(task, {sheet.positions, sphere.positions});
    // Ten cells of the sheet wide, so that the number of candidates does not depend on the sheet.
    std::vector<Eigen::Vector3d> tool(sphere.positions.size());
    const auto timeAt = [&](double height, double& pairs) {
      std::vector<double> samples;
      for (int frame = 0; frame < 10 * (1 + options.measure.repetitions); ++frame) {
        const Eigen::Vector3d centre(0.5 * edge * std::sin(0.1 * frame), 0, height);
        for (std::size_t i = 0; i < tool.size(); ++i)
          tool[i] = 5 * edge * sphere.positions[i] + centre;
        const double start = now();
        scene.detection.setPositions(scene.ids[1], tool);
        pairs = static_cast<double>(findCandidates(scene.detection).candidatePairs);
        scene.detection.advance();
        samples.push_back(now() - start);
      }
      return median(samples);
    };
    double pairs = 0, none = 0;
    const double near = timeAt(0, pairs), far = timeAt(10, none);
    const std::string name = "sheet of " + std::to_string(sheet.triangles.size());
    report.line({name, milliseconds(near), whole(pairs), milliseconds(far)});
    report.row("small tool", name, 1, "Palpate", "frame ms", near);
    report.row("small tool", name, 1, "Palpate", "pairs", pairs);
    report.row("small tool", name, 1, "Palpate", "far ms", far);
  }
}

void scaleRows(Report& report, const RowOptions& options) {
  report.heading(
      "Scale: ns per triangle, update and pairs in the order found; bytes per triangle; speed-up");
  report.line({"", "shipped", "rebuild", "bytes/tri", "2 threads", "2, rebuild", "pairs/tri"});
  std::vector<std::string> names = {"sheets-16K", "sheets-64K", "sheets-256K", "sheets-1M"};
  if (!options.quick) names.push_back("sheets-4M");
  for (const std::string& name : names) {
    Workload workload = makeWorkload(name, options.frames, options.sharedData);
    std::unique_ptr<BroadPhase> engines[4];
    std::vector<Contestant> contestants;
    for (int i = 0; i < 4; ++i) {
      workload.task.threads = 1 + i / 2;
      engines[i] =
          makePalpate(i % 2 ? OctreeUpdate::Rebuild : OctreeUpdate::Auto, PairOrder::Found);
      engines[i]->prepare(workload.task, workload.frames[0]);
      contestants.push_back({engines[i].get(), &workload.frames});
    }
    const auto timings = takeTurns(contestants, options.measure);
    const auto triangles = static_cast<double>(workload.triangles());
    double bytes[2] = {0, 0}, pairs = 0;
    for (const OctreeUpdate update : {OctreeUpdate::Auto, OctreeUpdate::Rebuild}) {
      PalpateScene scene(workload.task, workload.frames[0], update);
      for (const Positions& frame : workload.frames) {
        scene.setPositions(frame);
        pairs = static_cast<double>(findCandidates(scene.detection).candidatePairs) / triangles;
      }
      bytes[update == OctreeUpdate::Rebuild] =
          static_cast<double>(scene.detection.octree().statistics().bytes) / triangles;
    }
    const double speedUp[] = {ratio(timings[0], timings[2]), ratio(timings[1], timings[3])};
    report.line({name, tenths(timings[0].total * 1e6 / triangles),
                 tenths(timings[1].total * 1e6 / triangles),
                 tenths(bytes[0]) + "/" + tenths(bytes[1]), times(speedUp[0]), times(speedUp[1]),
                 tenths(pairs)});
    for (int i = 0; i < 2; ++i) {
      report.row("scale", name, 1, kUpdateNames[i], "ns per triangle",
                 timings[static_cast<std::size_t>(i)].total * 1e6 / triangles);
      report.row("scale", name, 2, kUpdateNames[i], "speed-up over 1 thread", speedUp[i]);
      report.row("scale", name, 1, kUpdateNames[i], "bytes per triangle", bytes[i]);
    }
  }
}

void steadyRows(Report& report, const RowOptions& options) {
  report.heading("Steady frames: organs, whole frames after one full pass");
  report.line({"", "frames", "mallocs", "by oneTBB", "p99/median"});
  for (const int threads : options.threads) {
    Workload workload = makeWorkload("organs", 0, options.sharedData);
    workload.task.threads = threads;
    const std::size_t period = workload.frames.size(), count = options.quick ? 2 * period : 1000;
    PalpateScene scene(workload.task, workload.frames[0]);
    for (const Positions& frame : workload.frames) {
      scene.setPositions(frame);
      scene.detection.detectCollision();
    }
    std::vector<std::vector<double>> byFrame(period);  // the same frame of each pass
    for (auto& samples : byFrame) samples.reserve(count / period + 1);
    const AllocationCount before = allocationCount();
    for (std::size_t i = 0; i < count; ++i) {
      const double start = now();
      scene.setPositions(workload.frames[i % period]);
      scene.detection.detectCollision();
      byFrame[i % period].push_back(now() - start);
    }
    const AllocationCount after = allocationCount();
    std::vector<double> relative;
    for (const auto& samples : byFrame)
      for (const double sample : samples) relative.push_back(sample / median(samples));
    const auto own = static_cast<double>(after.own - before.own);
    const auto oneTbb = static_cast<double>(after.oneTbb - before.oneTbb);
    report.line({std::to_string(threads) + " threads", std::to_string(count), whole(own),
                 whole(oneTbb), times(quantile(relative, 0.99))});
    report.row("steady frames", "organs", threads, "Palpate", "mallocs", own);
    report.row("steady frames", "organs", threads, "Palpate", "mallocs by oneTBB", oneTbb);
    report.row("steady frames", "organs", threads, "Palpate", "p99 over median",
               quantile(relative, 0.99));
  }
}

void simdRows(Report& report, const RowOptions& options) {
  report.heading("SIMD paths: update ms, pairs ms, as shipped and with full rebuild; 1 thread");
  report.line({"", "update", "pairs", "rebuild", "pairs"});
  for (const char* name : {"organs", "sheets-64K"}) {
    const Workload workload = makeWorkload(name, options.frames, options.sharedData);
    for (const std::string& path : simdPaths()) {
      useSimdPath(path);
      std::vector<std::unique_ptr<BroadPhase>> engines;
      engines.push_back(shipped());
      engines.push_back(rebuilding());
      const Outcome outcome = measure(workload, engines, options.measure);
      const Timing &auto_ = outcome.entries[0].timing, &rebuilt = outcome.entries[1].timing;
      char hash[32];
      std::snprintf(hash, sizeof hash, "%016lx", outcome.hash);
      report.line({workload.name + ", " + simdPath(), milliseconds(auto_.update),
                   milliseconds(auto_.total - auto_.update), milliseconds(rebuilt.update),
                   milliseconds(rebuilt.total - rebuilt.update), std::string("  ") + hash});
      report.row("simd", name, 1, simdPath(), "as shipped ms", auto_.total, outcome.hash);
      report.row("simd", name, 1, simdPath(), "full rebuild ms", rebuilt.total, outcome.hash);
    }
    useSimdPath("");
  }
}

}  // namespace palpate::benchmark
