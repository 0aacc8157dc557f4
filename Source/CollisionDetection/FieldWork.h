#pragma once

#include "CollisionDetection/JobScratch.h"
#include "CollisionDetection/PairTable.h"

#include <cstddef>

namespace palpate {

/// Work on the elements near a distance field, in three rounds: values at vertices, then contacts
/// of vertices and edges, then those of triangles. A job has a share of the elements and of the
/// vertices.
class FieldWork {
 public:
  explicit FieldWork(PairRecord& record) : m_record(&record) {}

  std::size_t start(const FrameStart&);
  bool hasRound(int round, Jobs) const { return round < 3; }
  void run(int round, std::size_t job, JobScratch&) const;
  void runByBruteForce(JobScratch&) const;
  void join(Jobs, const FrameJoin&) const;

 private:
  PairRecord* m_record;
  std::size_t m_jobs = 0;
};

}  // namespace palpate
