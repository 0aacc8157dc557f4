#pragma once

#include <palpate/FrameStatistics.h>
#include <palpate/Settings.h>

#include <benchmark/benchmark.h>

namespace palpate::benchmark {

enum class Through {
  Pairs,    ///< update() and forEachCandidate()
  Contacts  ///< detectCollision()
};

using Stage = double (*)(const FrameStatistics::Stages&);  ///< milliseconds

/// Runs frames of a scene (arguments: its number, threads). The time is that of one stage from the
/// frame's statistics, so that each stage is timed within its frame.
void timeStage(::benchmark::State&, Through, OctreeUpdate, Stage);

/// Arguments for timeStage(): every scene of up to 140,000 triangles, 1 and 2 threads; manual time.
void everyScene(::benchmark::internal::Benchmark*);

}  // namespace palpate::benchmark
