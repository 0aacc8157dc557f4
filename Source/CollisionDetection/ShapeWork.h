#pragma once

#include "CollisionDetection/JobScratch.h"
#include "CollisionDetection/PairTable.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

/// Finds the contacts of two shapes, or of a shape with these elements of a mesh, by the pair's
/// plan.
void findWithShape(const PairRecord&, std::span<const std::uint32_t> elements,
                   ShapeContactBuffers&);

/// Work on an analytical shape and the elements near it, or on two shapes: one job.
class ShapeWork {
 public:
  explicit ShapeWork(PairRecord& record) : m_record(&record) {}

  std::size_t start(const FrameStart&) const;
  bool hasRound(int round, Jobs) const { return round == 0; }
  void run(int round, std::size_t job, JobScratch&) const;
  void runByBruteForce(JobScratch&) const;
  void join(Jobs, const FrameJoin&) const;

 private:
  PairRecord* m_record;
};

}  // namespace palpate
