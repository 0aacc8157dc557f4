#pragma once

#include "CollisionDetection/ProxyJobs.h"

#include <cstddef>

namespace palpate {

/// Work on particles by Method::Proxy. Contacts are written in join(), by all threads, to their
/// places in the results.
class ProxyWork {
 public:
  explicit ProxyWork(PairRecord& record) : m_record(&record) {}

  std::size_t start(const FrameStart&);
  bool hasRound(int round, Jobs) const { return round == 0; }
  void run(int round, std::size_t job, JobScratch&) const;
  void runByBruteForce(JobScratch&);
  void join(Jobs, const FrameJoin&) const;

 private:
  std::size_t place(bool divides);

  PairRecord* m_record;
  ProxyJobs m_proxyJobs;
};

}  // namespace palpate
