#include "CollisionDetection/Frame.h"

#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Spin.h"
#include "Core/Stopping.h"
#include "Core/Stopwatch.h"

#include <algorithm>
#include <limits>
#include <mutex>
#include <variant>

namespace palpate {

/// Starts all pairs, or with a deadline as many as keep the threads busy. Returns their number.
std::size_t Frame::start(std::span<PairRecord* const> records, const Context& context) {
  constexpr std::size_t kJobsPerThread = 4;
  const MemoryScope memory(MemoryStage::Pairs);
  const auto threads = static_cast<std::size_t>(context.threads.count());
  std::size_t enough = threads > 1 ? kJobsPerThread * threads : 1;
  // Where the deadline ends a group, none of its pairs is joined. Groups therefore become smaller
  // the longer the first pair waits, until it is alone.
  if (isTimed() && !records.empty())
    enough = std::max<std::size_t>(
        1, enough >> std::min(records.front()->last.data.validity().age, 16u));
  m_jobs.begin();
  for (PairRecord* record : records) {
    if (isTimed() && m_jobs.jobCount() >= enough) break;
    checkTime();
    const Search search = record->search();
    record->found.earliest = std::numeric_limits<double>::infinity();
    m_jobs.add(record->pair, workOf(search), context.threads, context.engine);
  }
  return m_jobs.size();
}

void Frame::forEach(std::span<PairRecord* const> records, const Threads& threads,
                    BatchFunction function, void* context) {
  {
    const MemoryScope memory(MemoryStage::Pairs);
    m_jobs.begin();
    for (PairRecord* record : records)
      m_jobs.add(record->pair, MeshWork({&*record->question, &record->found}), threads,
                 Engine::Octree, [&](PairWork& work, const FrameStart& frame) {
                   return record->hasCandidates() ? std::get<MeshWork>(work).startCandidates(frame)
                                                  : std::size_t{0};
                 });
  }
  std::mutex mutex;
  m_jobs.forEachJob(threads, [&](std::size_t i, std::size_t job, JobScratch& scratch) {
    std::get<MeshWork>(m_jobs.work(i))
        .forEachBatch(job, scratch, [&](std::span<const ElementPair> pairs) {
          std::unique_lock lock(mutex, std::try_to_lock);
          for (Spin spin; !lock && !spin.isOver() && !lock.try_lock();) spin.wait();
          if (!lock) lock.lock();
          function(context, records[i]->pair, pairs);
        });
    scratch.candidateCount = scratch.sink.total();
  });
  for (std::size_t i = 0; i < records.size(); ++i) {
    std::size_t& count = records[i]->found.candidateCount;
    count = 0;
    for (const auto& job : m_jobs.jobsOf(i)) count += job->candidateCount;
  }
}

/// Writes the answer of the i-th pair that was started.
void Frame::join(std::size_t i, PairRecord& record, const Context& context) {
  const MemoryScope memory(MemoryStage::Results);
  const TraceSpan span(context.trace, "join", record.pair.a, record.pair.b);
  m_jobs.join(i, record.found, {context.threads, context.engine, context.statistics, m_results});
  record.finish(context.threads);
}

void Frame::detect(std::span<PairRecord* const> records, const Context& context) {
  Stopwatch watch;
  {
    const TraceSpan span(context.trace, "start");
    start(records, context);
  }
  m_jobs.run(context.threads, context.trace);
  for (std::size_t i = 0; i < records.size(); ++i)
    records[i]->found.statistics.milliseconds += m_jobs.millisecondsOf(i);
  m_jobs.addTimes(watch.lap(), context.statistics);
  for (std::size_t i = 0; i < records.size(); ++i) {
    join(i, *records[i], context);
    const double spent = watch.lap();
    records[i]->found.statistics.milliseconds += spent;
    context.statistics.milliseconds.order += spent;
  }
}

void Frame::detect(std::span<const Search> searches, const Context& context) {
  {
    const MemoryScope memory(MemoryStage::Pairs);
    m_jobs.begin();
    for (const Search& search : searches) {
      search.answer->earliest = std::numeric_limits<double>::infinity();
      m_jobs.add(search.question->pair, workOf(search), context.threads, context.engine);
    }
  }
  m_jobs.run(context.threads, context.trace);
  const MemoryScope memory(MemoryStage::Results);
  for (std::size_t i = 0; i < searches.size(); ++i)
    m_jobs.join(i, *searches[i].answer,
                {context.threads, context.engine, context.statistics, m_results});
}

void Frame::detectInTime(std::uint64_t step, std::span<PairRecord* const> records,
                         const Context& context) {
  Stopwatch watch;
  const auto finish = [&](std::size_t i, PairRecord& record) {
    bool& isUnfinished = record.memory.urgency.isUnfinished;
    isUnfinished = !endsInTime([&] {
      checkTime();
      join(i, record, context);
    });
    if (!isUnfinished) track(record, step);
    const double spent = watch.lap();
    record.found.statistics.milliseconds += spent;
    context.statistics.milliseconds.order += spent;
    return !isUnfinished;
  };
  for (PairRecord* record : records) record->memory.urgency.isUnfinished = true;
  // Pairs that run together are joined together: those of the highest priority do not wait for
  // others. A pair that yields comes after them.
  const auto isFirst = [first = records.empty() ? 0 : records.front()->pair.settings.priority](
                           const PairRecord* record) {
    return !record->memory.urgency.yields && record->pair.settings.priority == first;
  };
  auto urgent = static_cast<std::size_t>(std::find_if_not(records.begin(), records.end(), isFirst) -
                                         records.begin());
  while (!records.empty()) {
    std::size_t started = 0;
    const bool haveRun = endsInTime([&] {
      started = start(urgent > 0 ? records.first(urgent) : records, context);
      m_jobs.run(context.threads, context.trace);
    });
    for (std::size_t i = 0; i < m_jobs.size(); ++i)
      records[i]->found.statistics.milliseconds += m_jobs.millisecondsOf(i);
    m_jobs.addTimes(watch.lap(), context.statistics);
    if (!haveRun) return;
    for (std::size_t i = 0; i < started; ++i)
      if (!finish(i, *records[i])) return;
    urgent -= std::min(urgent, started);
    records = records.subspan(started);
  }
}

}  // namespace palpate
