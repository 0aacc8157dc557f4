#include "Measure.h"

#include <ctime>

namespace palpate::benchmark {
namespace {

using Pairs = std::vector<ElementPair>;

clockid_t g_clock = CLOCK_MONOTONIC;

/// The widest of the gaps along the three axes; at most 0 where the boxes overlap.
double gap(const DoubleBox& a, const DoubleBox& b) {
  return (a.min - b.max).cwiseMax(b.min - a.max).maxCoeff();
}

/// Compares the pair sets of all engines, for one mesh pair in one frame.
class SetChecker {
 public:
  SetChecker(const Task& task, const Positions& positions) : m_task(task), m_positions(positions) {
    for (const auto& mesh : positions)
      for (const Eigen::Vector3d& p : mesh)
        m_largest = std::max(m_largest, p.cwiseAbs().maxCoeff());
  }

  void check(std::size_t pair, std::span<const Pairs> sets, std::vector<Entry>& entries) const {
    Pairs all;
    for (const Pairs& set : sets) all.insert(all.end(), set.begin(), set.end());
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    for (std::size_t i = 0; i < sets.size(); ++i) {
      if (sets[i] != all) compare(pair, sets[i], all, entries[i].check);
    }
    // A pair in every set can still be a false positive, because every engine rounds outward.
    for (std::size_t i = 0; i < sets.size(); ++i)
      countFalsePositives(pair, sets[i], entries[i].check);
  }

 private:
  double gapOf(std::size_t pair, ElementPair p) const {
    const auto [a, b] = m_task.pairs[pair];
    const double margin = m_task.thickness / 2;
    return gap(boxOf(m_task.meshes[a][p.a], m_positions[a].data(), margin),
               boxOf(m_task.meshes[b][p.b], m_positions[b].data(), margin));
  }

  void compare(std::size_t pair, const Pairs& set, const Pairs& all, SetCheck& check) const {
    Pairs missing;
    std::set_difference(all.begin(), all.end(), set.begin(), set.end(),
                        std::back_inserter(missing));
    for (const ElementPair& p : missing) check.falseNegatives += gapOf(pair, p) <= 0;
  }

  void countFalsePositives(std::size_t pair, const Pairs& set, SetCheck& check) const {
    for (std::size_t i = 0; i < set.size(); ++i) {
      const double apart = gapOf(pair, set[i]);
      const bool twice = i > 0 && set[i] == set[i - 1];
      check.falsePositives += apart > 0 || twice;
      check.widestFalsePositive = std::max(check.widestFalsePositive, apart / m_largest);
    }
  }

  const Task& m_task;
  const Positions& m_positions;
  double m_largest = 0;
};

void addToHash(std::uint64_t& hash, const Pairs& pairs) {
  for (const ElementPair& p : pairs)
    for (const std::uint32_t id : {p.a, p.b}) hash = (hash ^ id) * 0x100000001b3u;
}

void checkSets(const Workload& workload, std::span<const std::unique_ptr<BroadPhase>> engines,
               Outcome& outcome) {
  const std::size_t count = workload.frames.size();
  std::vector<std::size_t> frames = {0, count / 3, 2 * count / 3, count - 1};
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  outcome.hash = 0xcbf29ce484222325u;
  for (const std::size_t frame : frames) {
    const SetChecker checker(workload.task, workload.frames[frame]);
    for (const auto& engine : engines) {
      engine->update(workload.frames[frame]);
      engine->collide();
    }
    for (std::size_t pair = 0; pair < workload.task.pairs.size(); ++pair) {
      std::vector<Pairs> sets(engines.size());
      for (std::size_t i = 0; i < engines.size(); ++i) sets[i] = engines[i]->candidates(pair);
      addToHash(outcome.hash, sets[0]);
      checker.check(pair, sets, outcome.entries);
    }
  }
}

void countPairs(const Workload& workload, BroadPhase& engine, Outcome& outcome) {
  std::vector<double> counts;
  for (const Positions& frame : workload.frames) {
    engine.update(frame);
    engine.collide();
    std::size_t pairs = 0;
    for (std::size_t pair = 0; pair < workload.task.pairs.size(); ++pair)
      pairs += engine.candidates(pair).size();
    counts.push_back(static_cast<double>(pairs));
  }
  outcome.medianPairs = median(counts);
  outcome.mostPairs = quantile(counts, 1);
}

struct Samples {
  std::vector<double> total, update;
};

void repeat(BroadPhase& engine, const std::vector<Positions>& frames, Timing& timing,
            Samples& samples) {
  std::vector<double> totals;
  for (std::size_t frame = 0; frame < frames.size(); ++frame) {
    const double start = now();
    engine.update(frames[frame]);
    const double updated = now();
    engine.collide();
    const double end = now();
    if (frame == 0 && frames.size() > 1) continue;
    totals.push_back(end - start);
    samples.update.push_back(updated - start);
  }
  timing.repetitions.push_back(median(totals));
  samples.total.insert(samples.total.end(), totals.begin(), totals.end());
}

}  // namespace

void useCpuClock() { g_clock = CLOCK_PROCESS_CPUTIME_ID; }

double now() {
  timespec time;
  clock_gettime(g_clock, &time);
  return static_cast<double>(time.tv_sec) * 1e3 + static_cast<double>(time.tv_nsec) * 1e-6;
}

double quantile(std::vector<double> values, double fraction) {
  if (values.empty()) return 0;
  const auto rank =
      static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

double median(std::vector<double> values) { return quantile(std::move(values), 0.5); }

Outcome measure(const Workload& workload, std::span<const std::unique_ptr<BroadPhase>> engines,
                const MeasureOptions& options) {
  Outcome outcome;
  for (const auto& engine : engines) {
    Entry& entry = outcome.entries.emplace_back();
    entry.engine = engine->name();
    entry.rebuilds = engine->rebuilds();
    engine->prepare(workload.task, workload.frames[0]);
  }
  checkSets(workload, engines, outcome);
  countPairs(workload, *engines[0], outcome);
  std::vector<Contestant> contestants;
  for (const auto& engine : engines) contestants.push_back({engine.get(), &workload.frames});
  const std::vector<Timing> timings = takeTurns(contestants, options);
  for (std::size_t i = 0; i < engines.size(); ++i) outcome.entries[i].timing = timings[i];
  return outcome;
}

std::vector<Timing> takeTurns(std::span<const Contestant> contestants,
                              const MeasureOptions& options) {
  std::vector<Timing> timings(contestants.size());
  std::vector<Samples> samples(contestants.size());
  std::vector<double> spent(contestants.size());
  for (int repetition = 0; repetition < options.repetitions; ++repetition) {
    for (std::size_t i = 0; i < contestants.size(); ++i) {
      if (spent[i] > 1000 * options.secondsPerEngine) continue;
      const double start = now();
      repeat(*contestants[i].engine, *contestants[i].frames, timings[i], samples[i]);
      spent[i] += now() - start;
    }
  }
  for (std::size_t i = 0; i < contestants.size(); ++i) {
    timings[i].total = median(samples[i].total);
    timings[i].update = median(samples[i].update);
    timings[i].fastest = quantile(samples[i].total, 0);
    timings[i].worst = quantile(samples[i].total, 1);
  }
  return timings;
}

double ratio(const Timing& timing, const Timing& other) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < std::min(timing.repetitions.size(), other.repetitions.size()); ++i)
    ratios.push_back(timing.repetitions[i] / other.repetitions[i]);
  return median(ratios);
}

}  // namespace palpate::benchmark
