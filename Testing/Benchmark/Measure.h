#pragma once

#include "Workload.h"

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace palpate::benchmark {

double median(std::vector<double> values);
double quantile(std::vector<double> values, double fraction);  ///< fraction in [0, 1]

/// Milliseconds from an arbitrary start, of wall time. After useCpuClock() it is the process's CPU
/// time. A busy machine disturbs CPU time less, but it measures one thread only.
double now();
void useCpuClock();

/// An engine's pairs compared with the reference: all pairs that any engine of the run found and
/// whose exact boxes overlap.
struct SetCheck {
  std::size_t falseNegatives = 0;
  std::size_t falsePositives =
      0;  ///< boxes apart, reported because of outward rounding; pairs twice
  double widestFalsePositive = 0;  ///< the widest gap of their boxes over the largest coordinate
  bool equal() const { return falseNegatives == 0 && falsePositives == 0; }
};

/// Milliseconds of whole frames; `update` is the part of `total` before the pairs.
struct Timing {
  double total = 0, update = 0;     ///< medians over every frame of every repetition
  double fastest = 0, worst = 0;    ///< of those frames
  std::vector<double> repetitions;  ///< median over the frames of each
};

/// The time over the other's time: the median over the repetitions that both have.
double ratio(const Timing&, const Timing& other);

struct Contestant {
  BroadPhase* engine;
  const std::vector<Positions>* frames;
};

struct MeasureOptions {
  int repetitions = 5;
  double secondsPerEngine = 2;  ///< no further repetition of an engine that took longer
};

/// The contestants take turns, so that disturbances of the machine affect all alike. The first
/// frame of each repetition is not timed, because the motion jumps back there.
std::vector<Timing> takeTurns(std::span<const Contestant>, const MeasureOptions&);

struct Entry {
  std::string engine;
  bool rebuilds = false;
  Timing timing;
  SetCheck check;
};

struct Outcome {
  std::vector<Entry> entries;
  double medianPairs = 0, mostPairs = 0;  ///< over all frames, by the first engine
  std::uint64_t hash = 0;                 ///< of the first engine's sorted pairs in four frames
};

/// Prepares all engines, compares their pairs, and times them.
Outcome measure(const Workload&, std::span<const std::unique_ptr<BroadPhase>> engines,
                const MeasureOptions&);

}  // namespace palpate::benchmark
