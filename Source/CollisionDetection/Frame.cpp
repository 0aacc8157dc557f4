#include "CollisionDetection/Frame.h"

#include "CollisionDetection/DiagnosticsInterface.h"
#include "Tracking/SmoothNormals.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Spin.h"
#include "Core/Stopping.h"
#include "Core/Stopwatch.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <mutex>
#include <tuple>
#include <variant>

namespace palpate {

namespace {

/// For those who ask for candidates: other kinds of pairs have none.
constexpr auto kStartCandidates = [](PairWork& work, const FrameStart& frame) -> std::size_t {
  MeshWork* const meshes = std::get_if<MeshWork>(&work);
  return meshes ? meshes->startCandidates(frame) : 0;
};

constexpr auto kStartWork = [](PairWork& work, const FrameStart& frame) {
  return std::visit([&](auto& each) { return each.start(frame); }, work);
};

}  // namespace

/// startOf(work, frame): starts a pair's work and returns its number of jobs. Starts all pairs, or
/// with a deadline as many as keep the threads busy.
template <class Start>
void Frame::start(std::span<PairRecord* const> records, const Threads& threads, Start&& startOf) {
  constexpr std::size_t kJobsPerThread = 4;
  const MemoryScope memory(MemoryStage::Pairs);
  m_pairs.clear();
  m_places.clear();
  m_nodePairs.clear();
  std::size_t enough =
      threads.count() > 1 ? kJobsPerThread * static_cast<std::size_t>(threads.count()) : 1;
  // Where the deadline ends a group, none of its pairs is joined. Groups therefore become smaller
  // the longer the first pair waits, until it is alone.
  if (isTimed() && !records.empty())
    enough =
        std::max<std::size_t>(1, enough >> std::min(records.front()->data.validity().age, 16u));
  const FrameStart frame{threads, m_nodePairs, m_stack};
  for (PairRecord* record : records) {
    if (isTimed() && m_places.size() >= enough) break;
    checkTime();
    record->earliest = std::numeric_limits<double>::infinity();
    m_pairs.push_back({record, workOf(*record), m_places.size()});
    Pair& pair = m_pairs.back();
    pair.jobCount = startOf(pair.work, frame);
    for (std::size_t i = 0; i < pair.jobCount; ++i) {
      if (m_places.size() == m_jobs.size()) m_jobs.push_back(std::make_unique<JobScratch>());
      m_jobs[m_places.size()]->clear();
      m_places.push_back({m_pairs.size() - 1, i});
    }
  }
}

void Frame::forEach(std::span<PairRecord* const> records, const Threads& threads,
                    BatchFunction function, void* context) {
  start(records, threads, kStartCandidates);
  std::mutex mutex;
  threads.forEach(m_places.size(), [&](std::size_t i) {
    const Pair& pair = m_pairs[m_places[i].pair];
    JobScratch& scratch = *m_jobs[i];
    std::get<MeshWork>(pair.work).forEachBatch(
        m_places[i].job, scratch, [&](std::span<const ElementPair> pairs) {
          std::unique_lock lock(mutex, std::try_to_lock);
          for (Spin spin; !lock && !spin.isOver() && !lock.try_lock();) spin.wait();
          if (!lock) lock.lock();
          function(context, pair.record->pair, pairs);
        });
    scratch.candidateCount = scratch.sink.total();
  });
  for (const Pair& pair : m_pairs) {
    pair.record->candidateCount = 0;
    for (const auto& job : jobsOf(pair)) pair.record->candidateCount += job->candidateCount;
  }
}

void Frame::runRounds(const Threads& threads, Trace* trace) {
  const bool inOrder = isTimed();
  for (int round = 0;; ++round) {
    bool any = false;
    for (Pair& pair : m_pairs) {
      pair.runs = std::visit([&](const auto& work) { return work.hasRound(round, jobsOf(pair)); },
                             pair.work);
      any |= pair.runs;
    }
    if (!any) return;
    PALPATE_ASSERT(round < 3);
    const TraceSpan roundSpan(trace, "round");
    const std::size_t firstEvent = trace ? trace->reserve(m_places.size()) : 0;
    std::atomic<std::size_t> next{0};
    threads.forEach(m_places.size(), [&](std::size_t index) {
      // Threads take indices from both ends; with a deadline, jobs are run in the order of pairs.
      const std::size_t i = inOrder ? next.fetch_add(1, std::memory_order_relaxed) : index;
      const Pair& pair = m_pairs[m_places[i].pair];
      if (!pair.runs) return;
      const AddedTime time(m_jobs[i]->milliseconds);
      const CollisionPair& ids = pair.record->pair;
      const TraceSpan span(trace, firstEvent + i,
                           {.name = "job",
                            .a = ids.a,
                            .b = ids.b,
                            .job = static_cast<std::uint32_t>(m_places[i].job)});
      std::visit([&](const auto& work) { work.run(round, m_places[i].job, *m_jobs[i]); },
                 pair.work);
    });
  }
}

/// Writes a pair's results and adds what its jobs counted.
void Frame::join(Pair& pair, const FrameJoin& join) {
  PALPATE_ASSERT(pair.firstJob + pair.jobCount <= m_jobs.size());
  const MemoryScope memory(MemoryStage::Results);
  PairRecord& record = *pair.record;
  const std::size_t exactBefore = join.statistics.exactDecisions;
  CountedVector<Crossing>& crossings = CollisionData::Contents::of(record.next).crossings;
  crossings.clear();
  for (const auto& job : jobsOf(pair)) {
    const ContactBuffers& found = job->contacts;
    const std::size_t features = found.featurePairs + found.shapes.featurePairs,
                      exact = found.exactDecisions + found.shapes.exactDecisions +
                              job->intersections.exactDecisions;
    crossings.insert(crossings.end(), found.passages.begin(), found.passages.end());
    join.statistics.candidatePairs += job->candidateCount;
    join.statistics.featurePairs += features;
    join.statistics.exactDecisions += exact;
    join.statistics.validityPairs += job->intersections.validityPairs;
    record.statistics.candidatePairs += job->candidateCount;
    record.statistics.featurePairs += features;
  }
  sortInTime(crossings.begin(), crossings.end(), [](const Crossing& l, const Crossing& r) {
    return std::tie(l.kind, l.ids, l.time) < std::tie(r.kind, r.ids, r.time);
  });
  std::visit([&](const auto& work) { work.join(jobsOf(pair), join); }, pair.work);
  record.followSides();
  CollisionData::Contents& contents = CollisionData::Contents::of(record.next);
  if (record.pair.settings.smoothNormals)
    findSmoothNormals(record.meshes(), record.plan.kind == PairKind::MeshAndShape, join.threads,
                      contents);
  else
    contents.smooth = {};
  record.statistics.exactDecisions += join.statistics.exactDecisions - exactBefore;
}

void Frame::detect(std::span<PairRecord* const> records, const Threads& threads,
                   FrameStatistics& statistics, Trace* trace) {
  Stopwatch watch;
  {
    const TraceSpan span(trace, "start");
    start(records, threads, kStartWork);
  }
  runRounds(threads, trace);
  addTimes(watch.lap(), statistics);
  for (Pair& pair : m_pairs) {
    PairRecord& record = *pair.record;
    const TraceSpan span(trace, "join", record.pair.a, record.pair.b);
    join(pair, {threads, Engine::Octree, statistics, m_results});
    const double spent = watch.lap();
    record.statistics.milliseconds += spent;
    statistics.milliseconds.order += spent;
  }
}

/// Threads work on both stages at once. The wall-clock time is therefore divided in proportion to
/// the work of each stage.
void Frame::addTimes(double wall, FrameStatistics& statistics) const {
  double all = 0, narrow = 0;
  for (const Pair& pair : m_pairs)
    for (const auto& job : jobsOf(pair)) {
      pair.record->statistics.milliseconds += job->milliseconds;
      all += job->milliseconds;
      narrow += job->narrowMilliseconds;
    }
  const double ofNarrowPhase = all > 0 ? wall * narrow / all : 0;
  statistics.milliseconds.narrowPhase += ofNarrowPhase;
  statistics.milliseconds.pairs += wall - ofNarrowPhase;
}

void Frame::detectInTime(std::uint64_t step, std::span<PairRecord* const> records,
                         const Threads& threads, FrameStatistics& statistics, Trace* trace) {
  Stopwatch watch;
  const auto finish = [&](Pair& pair) {
    PairRecord& record = *pair.record;
    const TraceSpan span(trace, "join", record.pair.a, record.pair.b);
    record.isUnfinished = !endsInTime([&] {
      checkTime();
      join(pair, {threads, Engine::Octree, statistics, m_results});
    });
    if (!record.isUnfinished) track(record, step);
    const double spent = watch.lap();
    record.statistics.milliseconds += spent;
    statistics.milliseconds.order += spent;
    return !record.isUnfinished;
  };
  for (PairRecord* record : records) record->isUnfinished = true;
  // Pairs that run together are joined together: those of the highest priority do not wait for
  // others. A pair that yields comes after them.
  const auto isFirst = [first = records.empty() ? 0 : records.front()->pair.settings.priority](
                           const PairRecord* record) {
    return !record->yields && record->pair.settings.priority == first;
  };
  auto urgent = static_cast<std::size_t>(std::find_if_not(records.begin(), records.end(), isFirst) -
                                         records.begin());
  while (!records.empty()) {
    const bool haveRun = endsInTime([&] {
      start(urgent > 0 ? records.first(urgent) : records, threads, kStartWork);
      runRounds(threads, trace);
    });
    addTimes(watch.lap(), statistics);
    if (!haveRun) return;
    if (!std::all_of(m_pairs.begin(), m_pairs.end(), finish)) return;
    urgent -= std::min(urgent, m_pairs.size());
    records = records.subspan(m_pairs.size());
  }
}

void Frame::detectByBruteForce(std::span<PairRecord* const> records, FrameStatistics& statistics,
                               Trace* trace) {
  const Threads oneThread(1);
  for (PairRecord* record : records) {
    Stopwatch watch;
    const TraceSpan span(trace, "brute force", record->pair.a, record->pair.b);
    const double before = statistics.milliseconds.total();
    start({&record, 1}, oneThread, [](PairWork&, const FrameStart&) { return std::size_t{1}; });
    Pair& pair = m_pairs.front();
    std::visit([&](auto& work) { work.runByBruteForce(*m_jobs.front()); }, pair.work);
    statistics.milliseconds.narrowPhase += watch.lap();
    join(pair, {oneThread, Engine::BruteForce, statistics, m_results});
    statistics.milliseconds.order += watch.lap();
    record->statistics.milliseconds = statistics.milliseconds.total() - before;
  }
}

}  // namespace palpate
