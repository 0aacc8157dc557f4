#include "CollisionDetection/ProxyWork.h"

#include "CollisionDetection/PairResults.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopping.h"
#include "Core/Stopwatch.h"

namespace palpate {

std::size_t ProxyWork::place(bool divides) {
  return m_proxyJobs.start(*m_record, m_record->proxy.get(), m_record->pair.settings.thickness,
                           divides);
}

std::size_t ProxyWork::start(const FrameStart&) { return place(isTimed()); }

void ProxyWork::run(int, std::size_t job, JobScratch& scratch) const {
  const MemoryScope memory(MemoryStage::NarrowPhase);
  const AddedTime time(scratch.narrowMilliseconds);
  m_proxyJobs.find(job, scratch);
}

void ProxyWork::runByBruteForce(JobScratch& scratch) {
  place(false);
  const MemoryScope memory(MemoryStage::NarrowPhase);
  const AddedTime time(scratch.narrowMilliseconds);
  m_proxyJobs.findByBruteForce(scratch);
}

void ProxyWork::join(Jobs jobs, const FrameJoin& join) const {
  PairRecord& record = *m_record;
  PALPATE_ASSERT(record.plan.kind == PairKind::Proxy);
  CollisionData::Contents& contents = CollisionData::Contents::of(record.next);
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
    m_proxyJobs.write(*jobs[i], contents.shape.data() + first);
  });
  m_proxyJobs.describe(jobs, contents);
  join.results.start(jobs);
  join.results.assess(record, false, join.statistics);
  countContacts(0, contents);
}

}  // namespace palpate
