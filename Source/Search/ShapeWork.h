#pragma once

#include "Search/JobScratch.h"
#include "Search/Question.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

/// Finds the contacts of two shapes, or of a shape with these elements of a mesh, by the plan.
void findWithShape(const Question&, std::span<const std::uint32_t> elements, ShapeContactBuffers&);

/// Work on an analytical shape and the elements near it, or on two shapes: one job.
class ShapeWork {
 public:
  explicit ShapeWork(const Search& search) : m_search(search) {}

  std::size_t start(const FrameStart&);
  bool hasRound(int round, Jobs) const { return round == 0; }
  void run(int round, std::size_t job, JobScratch&) const;
  void join(Jobs, const FrameJoin&) const;

 private:
  Search m_search;
  bool m_byBruteForce = false;
};

}  // namespace palpate
