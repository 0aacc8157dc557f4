#pragma once

#include <palpate/FrameStatistics.h>
#include <palpate/Settings.h>

#include <benchmark/benchmark.h>

namespace palpate::benchmark {

enum class Through {
  Pairs,    ///< update() and collectCandidates()
  Contacts  ///< detectCollision()
};

using Stage = double (*)(const FrameStatistics::Stages&);  ///< milliseconds

/// Frames of a scene (arguments: its number, threads); the time is that of one stage, as the
/// frame's own statistics have it, so that each arrow is timed within the frame that it belongs to.
void timeStage(::benchmark::State&, Through, OctreeUpdate, Stage);

/// Arguments for timeStage(): every scene of up to 140,000 triangles, 1 and 2 threads; manual time.
void everyScene(::benchmark::internal::Benchmark*);

}  // namespace palpate::benchmark
