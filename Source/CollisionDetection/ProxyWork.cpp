#include "CollisionDetection/ProxyWork.h"

#include "CollisionDetection/PairResults.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopwatch.h"

#include <algorithm>

namespace palpate {

void describeProxy(const SurfaceProxy& proxy, const PlacedProxy& placed, Jobs jobs,
                   CollisionData::Contents& contents) {
  double error = 0;
  for (const auto& job : jobs) error = std::max(error, job->hits.error);
  contents.validity.proxyDepth = proxy.depth();
  contents.errorBound = jobs.empty() ? 0.0 : placed.totalError(error);
}

void ProxyWork::place() {
  PALPATE_ASSERT(m_record->proxy != nullptr);
  m_proxy.emplace(*m_record->proxy, m_record->b->body.mesh, m_record->pair.settings.thickness);
}

std::size_t ProxyWork::start(const FrameStart&) {
  place();
  return (m_record->a->body.mesh.now.size() + kParticlesPerJob - 1) / kParticlesPerJob;
}

void ProxyWork::run(int, std::size_t job, JobScratch& scratch) const {
  const std::size_t begin = job * kParticlesPerJob;
  find(begin, std::min(m_record->a->body.mesh.now.size(), begin + kParticlesPerJob), false,
       scratch);
}

void ProxyWork::runByBruteForce(JobScratch& scratch) {
  place();
  find(0, m_record->a->body.mesh.now.size(), true, scratch);
}

void ProxyWork::find(std::size_t begin, std::size_t end, bool byBruteForce,
                     JobScratch& scratch) const {
  PALPATE_ASSERT(m_proxy && begin <= end);
  const MemoryScope memory(MemoryStage::NarrowPhase);
  Stopwatch watch;
  m_proxy->find(m_record->a->body.mesh, begin, end, byBruteForce, nullptr, scratch.hits);
  scratch.contacts.featurePairs += scratch.hits.answered;
  scratch.narrowMilliseconds += watch.lap();
}

void ProxyWork::join(Jobs jobs, const FrameJoin& join) const {
  PairRecord& record = *m_record;
  CollisionData::Contents& contents = record.next.contents();
  contents.vertexTriangle.clear();
  contents.triangleVertex.clear();
  contents.edgeEdge.clear();
  contents.intersectingTriangles.clear();
  contents.shapeShape.clear();
  describeExact(contents);
  std::size_t size = 0;
  for (const auto& job : jobs) size += job->hits.count;
  contents.shape.resize(size);
  join.threads.forEach(jobs.size(), [&](std::size_t i) {
    std::size_t first = 0;
    for (std::size_t k = 0; k < i; ++k) first += jobs[k]->hits.count;
    m_proxy->write(record.a->body.mesh, jobs[i]->hits, contents.shape.data() + first);
  });
  describeProxy(*record.proxy, *m_proxy, jobs, contents);
  join.results.start(jobs);
  join.results.assess(record, false, join.statistics);
  countContacts(0, contents);
}

}  // namespace palpate
