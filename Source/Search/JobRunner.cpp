#include "Search/JobRunner.h"

#include "Core/Assert.h"
#include "Core/Stopping.h"
#include "Core/Stopwatch.h"

#include <atomic>
#include <tuple>
#include <utility>
#include <variant>

namespace palpate {

void JobRunner::begin() {
  m_works.clear();
  m_places.clear();
  m_nodePairs.clear();
}

void JobRunner::add(const CollisionPair& pair, PairWork work, const Threads& threads,
                    Engine engine) {
  add(pair, std::move(work), threads, engine, [](PairWork& added, const FrameStart& frame) {
    return std::visit([&](auto& each) { return each.start(frame); }, added);
  });
}

void JobRunner::addPlaces(std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    if (m_places.size() == m_jobs.size()) m_jobs.push_back(std::make_unique<JobScratch>());
    m_jobs[m_places.size()]->clear();
    m_places.push_back({m_works.size() - 1, i});
  }
}

bool JobRunner::startRound(int round) {
  bool any = false;
  for (std::size_t i = 0; i < m_works.size(); ++i) {
    Work& work = m_works[i];
    work.runs =
        std::visit([&](const auto& each) { return each.hasRound(round, jobsOf(i)); }, work.work);
    any |= work.runs;
  }
  return any;
}

void JobRunner::run(const Threads& threads, Trace* trace) {
  const bool inOrder = isTimed();
  for (int round = 0; startRound(round); ++round) {
    PALPATE_ASSERT(round < 3);
    const TraceSpan roundSpan(trace, "round");
    const std::size_t firstEvent = trace ? trace->reserve(m_places.size()) : 0;
    std::atomic<std::size_t> next{0};
    threads.forEach(m_places.size(), [&](std::size_t index) {
      // Threads take indices from both ends; with a deadline, jobs are run in the order of works.
      const std::size_t i = inOrder ? next.fetch_add(1, std::memory_order_relaxed) : index;
      const Place& place = m_places[i];
      const Work& work = m_works[place.work];
      if (!work.runs) return;
      const AddedTime time(m_jobs[i]->milliseconds);
      const TraceSpan span(trace, firstEvent + i,
                           {.name = "job",
                            .a = work.pair->a,
                            .b = work.pair->b,
                            .job = static_cast<std::uint32_t>(place.job)});
      std::visit([&](const auto& each) { each.run(round, place.job, *m_jobs[i]); }, work.work);
    });
  }
}

void JobRunner::join(std::size_t i, Answer& answer, const FrameJoin& join) {
  PALPATE_ASSERT(m_works[i].firstJob + m_works[i].jobCount <= m_jobs.size());
  FrameStatistics& all = join.statistics;
  PairStatistics& own = answer.statistics;
  const std::size_t exactBefore = all.exactDecisions;
  CountedVector<Crossing>& crossings = answer.contents().crossings;
  crossings.clear();
  for (const auto& job : jobsOf(i)) {
    const ContactBuffers& found = job->contacts;
    const std::size_t features = found.featurePairs + found.shapes.featurePairs,
                      exact = found.exactDecisions + found.shapes.exactDecisions +
                              job->intersections.exactDecisions;
    crossings.insert(crossings.end(), found.passages.begin(), found.passages.end());
    all.candidatePairs += job->candidateCount;
    all.featurePairs += features;
    all.exactDecisions += exact;
    all.validityPairs += job->intersections.validityPairs;
    own.candidatePairs += job->candidateCount;
    own.featurePairs += features;
  }
  sortInTime(crossings.begin(), crossings.end(), [](const Crossing& l, const Crossing& r) {
    return std::tie(l.kind, l.ids, l.time) < std::tie(r.kind, r.ids, r.time);
  });
  std::visit([&](const auto& work) { work.join(jobsOf(i), join); }, m_works[i].work);
  own.exactDecisions += all.exactDecisions - exactBefore;
}

void JobRunner::addTimes(double wall, FrameStatistics& statistics) const {
  double all = 0, narrow = 0;
  for (std::size_t i = 0; i < m_places.size(); ++i) {
    all += m_jobs[i]->milliseconds;
    narrow += m_jobs[i]->narrowMilliseconds;
  }
  const double ofNarrowPhase = all > 0 ? wall * narrow / all : 0;
  statistics.milliseconds.narrowPhase += ofNarrowPhase;
  statistics.milliseconds.pairs += wall - ofNarrowPhase;
}

double JobRunner::millisecondsOf(std::size_t i) const {
  double sum = 0;
  for (const auto& job : jobsOf(i)) sum += job->milliseconds;
  return sum;
}

}  // namespace palpate
