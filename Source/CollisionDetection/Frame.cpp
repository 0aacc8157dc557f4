#include "CollisionDetection/Frame.h"

#include "CollisionDetection/BruteForce.h"
#include "CollisionDetection/Stopwatch.h"

#include <algorithm>
#include <mutex>

namespace palpate {

namespace {

/// Node pairs and jobs for each collision pair, where there is more than one thread.
constexpr std::size_t kNodePairsWanted = 256;
constexpr std::size_t kJobsPerPair = 16;

TreePair treesOf(const PairRecord& record, bool adjacentPairs) {
  TreePair trees{&record.a->octree, &record.b->octree};
  if (trees.self() && !adjacentPairs) trees.adjacency = record.a->orderedTriangles.data();
  const Eigen::Vector3d offset =
      (record.a->frame.origin - record.b->frame.origin) * record.a->frame.scale;
  const double thickness =
      record.method == Method::Intersection ? 0.0 : record.pair.settings.thickness;
  setShift(trees, {offset[0], offset[1], offset[2]}, thickness * record.a->frame.scale);
  return trees;
}

bool sharesVertex(const Triangle& s, const Triangle& t) {
  return std::any_of(s.begin(), s.end(),
                     [&](std::uint32_t v) { return v == t[0] || v == t[1] || v == t[2]; });
}

}  // namespace

/// Part of one pair's traversal, with what it found.
struct Frame::Job {
  PairRecord* record;
  TreePair trees;
  std::size_t begin, end;  ///< of m_nodePairs
  bool keepCandidates;
  TraversalStack stack;
  PairSink sink;
  ContactBuffers contacts;
  Buffer<TrianglePair> candidates;
  double milliseconds = 0, narrowMilliseconds = 0;

  static void findContactsOf(void* context, std::span<const TrianglePair> candidates) {
    Job& job = *static_cast<Job*>(context);
    Stopwatch watch;
    const FloatPair floats{
        job.record->a->floats.data(), job.record->b->floats.data(), nullptr, nullptr,
        job.trees.shiftLower,         job.trees.shiftUpper};
    const MeshPair meshes = job.record->meshes(&floats);
    findContacts(meshes, candidates, job.contacts);
    job.narrowMilliseconds += watch.lap();
    if (!job.keepCandidates) return;
    const std::vector<Triangle>& triangles = meshes.a.topology.triangles;
    for (const TrianglePair pair : candidates)
      if (!meshes.self() || !sharesVertex(triangles[pair.a], triangles[pair.b]))
        job.candidates.push_back(pair);
  }
};

Frame::Frame() = default;
Frame::~Frame() = default;

Frame::Job& Frame::newJob(PairRecord& record) {
  if (m_jobCount == m_jobs.size()) m_jobs.push_back(std::make_unique<Job>());
  Job& job = *m_jobs[m_jobCount++];
  job.record = &record;
  job.contacts.clear();
  job.candidates.clear();
  job.milliseconds = job.narrowMilliseconds = 0;
  return job;
}

void Frame::start(std::span<PairRecord* const> records, const Threads& threads,
                  bool adjacentPairs) {
  m_jobCount = 0;
  m_nodePairs.clear();
  for (PairRecord* record : records) {
    if (record->a->octree.size() == 0 || record->b->octree.size() == 0) continue;
    const TreePair trees = treesOf(*record, adjacentPairs);
    startPairs(trees, threads.count() == 1 ? 1 : kNodePairsWanted, m_stack);
    const std::size_t first = m_nodePairs.size(), count = m_stack.pairs.size();
    m_nodePairs.insert(m_nodePairs.end(), m_stack.pairs.begin(), m_stack.pairs.end());
    const std::size_t grain = std::max<std::size_t>(1, (count + kJobsPerPair - 1) / kJobsPerPair);
    for (std::size_t begin = 0; begin < count; begin += grain) {
      Job& job = newJob(*record);
      job.trees = trees;
      job.begin = first + begin;
      job.end = first + std::min(count, begin + grain);
    }
  }
}

void Frame::run(Job& job) const {
  traverse(job.trees, std::span(m_nodePairs).subspan(job.begin, job.end - job.begin), job.stack,
           job.sink);
  job.sink.flush();
}

void Frame::collect(std::span<PairRecord* const> records, const Threads& threads,
                    FrameStatistics& statistics) {
  Stopwatch watch;
  start(records, threads, false);
  threads.forEach(m_jobCount, [&](std::size_t i) {
    m_jobs[i]->sink.start(nullptr, nullptr);
    run(*m_jobs[i]);
  });
  std::size_t i = 0;
  for (PairRecord* record : records) {
    const std::size_t first = i;
    std::size_t size = 0;
    for (; i < m_jobCount && m_jobs[i]->record == record; ++i)
      size += m_jobs[i]->sink.kept().size();
    if (i == first + 1) {
      m_jobs[first]->sink.takeKept(record->candidates);
    } else {
      record->candidates.resize(size);
      auto place = record->candidates.begin();
      for (std::size_t k = first; k < i; ++k)
        place = std::copy(m_jobs[k]->sink.kept().begin(), m_jobs[k]->sink.kept().end(), place);
    }
    record->candidatesFor = record->revisions();
    record->candidatesSorted = false;
    statistics.candidatePairs += size;
  }
  statistics.milliseconds.pairs = watch.lap();
}

void Frame::forEach(PairRecord& record, const Threads& threads, PairSink::Function function,
                    void* context) {
  PairRecord* records[] = {&record};
  start(records, threads, false);
  struct Guarded {
    std::mutex mutex;
    PairSink::Function function;
    void* context;
  } guarded{{}, function, context};
  const PairSink::Function call = [](void* guard, std::span<const TrianglePair> pairs) {
    Guarded& g = *static_cast<Guarded*>(guard);
    const std::lock_guard lock(g.mutex);
    g.function(g.context, pairs);
  };
  threads.forEach(m_jobCount, [&](std::size_t i) {
    m_jobs[i]->sink.start(m_jobCount == 1 ? function : call, m_jobCount == 1 ? context : &guarded);
    run(*m_jobs[i]);
  });
}

void Frame::detect(std::span<PairRecord* const> records, const Settings& settings,
                   const Threads& threads, FrameStatistics& statistics) {
  Stopwatch watch;
  start(records, threads, true);
  threads.forEach(m_jobCount, [&](std::size_t i) {
    Stopwatch jobWatch;
    Job& job = *m_jobs[i];
    job.keepCandidates = settings.keepCandidates;
    job.sink.start(&Job::findContactsOf, &job);
    run(job);
    job.milliseconds = jobWatch.lap();
  });
  double all = 0, narrow = 0;
  for (std::size_t i = 0; i < m_jobCount; ++i) {
    const Job& job = *m_jobs[i];
    all += job.milliseconds;
    narrow += job.narrowMilliseconds;
    statistics.candidatePairs += job.sink.total();
    statistics.featurePairs += job.contacts.featurePairs;
    statistics.exactDecisions += job.contacts.exactDecisions;
  }
  // Threads work on both stages at once: the wall clock is shared out as their work was.
  const double wall = watch.lap();
  statistics.milliseconds.narrowPhase = all > 0 ? wall * narrow / all : 0;
  statistics.milliseconds.pairs = wall - statistics.milliseconds.narrowPhase;

  std::size_t i = 0;
  for (PairRecord* record : records) {
    m_buffers.clear();
    if (settings.keepCandidates) record->candidates.clear();
    for (; i < m_jobCount && m_jobs[i]->record == record; ++i) {
      m_buffers.push_back(&m_jobs[i]->contacts);
      if (settings.keepCandidates)
        record->candidates.insert(record->candidates.end(), m_jobs[i]->candidates.begin(),
                                  m_jobs[i]->candidates.end());
    }
    orderContacts(m_buffers, m_orderScratch, record->data.contents());
    record->dataFor = record->revisions();
    record->candidatesFor =
        settings.keepCandidates ? record->revisions() : PairRecord::AnsweredFor{};
    record->candidatesSorted = false;
  }
  statistics.milliseconds.order = watch.lap();
}

void Frame::detectByBruteForce(std::span<PairRecord* const> records, const Settings& settings,
                               FrameStatistics& statistics) {
  for (PairRecord* record : records) {
    Stopwatch watch;
    ContactBuffers contacts;
    findContactsByBruteForce(record->meshes(), contacts);
    if (settings.keepCandidates) findCandidatesByBruteForce(record->meshes(), record->candidates);
    statistics.featurePairs += contacts.featurePairs;
    statistics.exactDecisions += contacts.exactDecisions;
    statistics.milliseconds.narrowPhase += watch.lap();
    ContactBuffers* const buffers[] = {&contacts};
    orderContacts(buffers, m_orderScratch, record->data.contents());
    record->dataFor = record->revisions();
    record->candidatesFor =
        settings.keepCandidates ? record->revisions() : PairRecord::AnsweredFor{};
    record->candidatesSorted = true;
    statistics.milliseconds.order += watch.lap();
  }
}

}  // namespace palpate
