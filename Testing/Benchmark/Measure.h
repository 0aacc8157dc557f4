#pragma once

#include "Workload.h"

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace palpate::benchmark {

double median(std::vector<double> values);
double quantile(std::vector<double> values, double fraction);  ///< fraction in [0, 1]

/// Milliseconds from an arbitrary start: on the wall's clock, or after useCpuClock() of this
/// process's time on processors, which a busy machine disturbs less and which is of use with one
/// thread only.
double now();
void useCpuClock();

/// An engine's pairs against the truth: all pairs that any engine of the race found and whose exact
/// boxes overlap.
struct SetCheck {
  std::size_t missed = 0;
  std::size_t extra = 0;   ///< boxes apart, reported by outward rounding
  double widestExtra = 0;  ///< the widest gap among those, in units of the largest coordinate
  bool equal() const { return missed == 0 && extra == 0; }
};

/// Milliseconds of whole frames; `update` is the part of `total` before the pairs.
struct Timing {
  double total = 0, update = 0;     ///< medians over every frame of every repetition
  double fastest = 0, worst = 0;    ///< of those frames
  std::vector<double> repetitions;  ///< median over the frames of each
};

/// How many times as long as the other: the median over the repetitions that both have.
double ratio(const Timing&, const Timing& other);

struct Contestant {
  BroadPhase* engine;
  const std::vector<Positions>* frames;
};

struct MeasureOptions {
  int repetitions = 5;
  double secondsPerEngine = 2;  ///< no further repetition of an engine that took longer
};

/// Repetitions of all contestants take turns, so that what disturbs the machine meets them alike.
/// In each, the first frame is not timed (a jump back in the motion).
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
