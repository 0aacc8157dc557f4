#pragma once

#include "Search/ProxyJobs.h"

#include <cstddef>

namespace palpate {

/// Work on particles by Method::Proxy. Contacts are written in join(), by all threads, to their
/// places in the results.
class ProxyWork {
 public:
  explicit ProxyWork(const Search& search) : m_search(search) {}

  std::size_t start(const FrameStart&);
  bool hasRound(int round, Jobs) const { return round == 0; }
  void run(int round, std::size_t job, JobScratch&) const;
  void join(Jobs, const FrameJoin&) const;

 private:
  Search m_search;
  ProxyJobs m_proxyJobs;
};

}  // namespace palpate
