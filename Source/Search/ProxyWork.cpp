#include "Search/ProxyWork.h"

#include "Search/PairResults.h"
#include "Contact/ContactLists.h"
#include "Core/Assert.h"
#include "Core/MemoryBudget.h"
#include "Core/Stopping.h"
#include "Core/Stopwatch.h"

namespace palpate {

std::size_t ProxyWork::start(const FrameStart& frame) {
  return m_proxyJobs.start(*m_search.question, m_search.question->settings().thickness, frame);
}

void ProxyWork::run(int, std::size_t job, JobScratch& scratch) const {
  const MemoryScope memory(MemoryStage::NarrowPhase);
  const AddedTime time(scratch.narrowMilliseconds);
  m_proxyJobs.find(job, scratch);
}

void ProxyWork::join(Jobs jobs, const FrameJoin& join) const {
  PALPATE_ASSERT(m_search.question->plan.kind == PairKind::Proxy);
  CollisionData::Contents& contents = m_search.answer->contents();
  forEachContactList(contents, [](ContactKind, auto& list) { list.clear(); });
  contents.intersectingTriangles.clear();
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
  join.results.assess(m_search, false, join.statistics);
  countContacts(0, contents);
}

}  // namespace palpate
