#pragma once

#include "CollisionDetection/ProxyJobs.h"

#include <cstddef>

namespace palpate {

/// Work of Auto on particles by an attached surface proxy. The plan's method finds the contacts of
/// particles that may have an impact in the step.
class AttachedProxyWork {
 public:
  explicit AttachedProxyWork(PairRecord& record) : m_record(&record) {}

  std::size_t start(const FrameStart&);
  bool hasRound(int round, Jobs) const { return round == 0; }
  void run(int round, std::size_t job, JobScratch&) const;
  void runByBruteForce(JobScratch&);
  void join(Jobs, const FrameJoin&) const;

 private:
  std::size_t place(bool divides);
  void writeHits(JobScratch&) const;
  void findOthers(JobScratch&) const;

  PairRecord* m_record;
  ProxyJobs m_proxyJobs;
};

}  // namespace palpate
