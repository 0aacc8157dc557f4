#pragma once

#include "Search/JobScratch.h"
#include "Search/Question.h"

#include <cstddef>

namespace palpate {

/// Work on the elements near a distance field, in three rounds: values at vertices, then contacts
/// of vertices and edges, then those of triangles. A job has a share of the elements and of the
/// vertices.
class FieldWork {
 public:
  explicit FieldWork(const Search& search) : m_search(search) {}

  std::size_t start(const FrameStart&);
  bool hasRound(int round, Jobs) const { return round < (m_byBruteForce ? 1 : 3); }
  void run(int round, std::size_t job, JobScratch&) const;
  void join(Jobs, const FrameJoin&) const;

 private:
  Search m_search;
  bool m_byBruteForce = false;
  std::size_t m_jobs = 0;
};

}  // namespace palpate
