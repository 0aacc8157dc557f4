#pragma once

#include "Search/ProxyJobs.h"

#include <cstddef>

namespace palpate {

/// Work of Auto on particles by an attached surface proxy. The plan's method finds the contacts of
/// particles that may have an impact in the step.
class AttachedProxyWork {
 public:
  explicit AttachedProxyWork(const Search& search) : m_search(search) {}

  std::size_t start(const FrameStart&);
  bool hasRound(int round, Jobs) const { return round == 0; }
  void run(int round, std::size_t job, JobScratch&) const;
  void join(Jobs, const FrameJoin&) const;

 private:
  void writeHits(JobScratch&) const;
  void findOthers(JobScratch&) const;

  Search m_search;
  ProxyJobs m_proxyJobs;
};

}  // namespace palpate
