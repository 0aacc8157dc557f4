#pragma once

#include "Search/JobScratch.h"
#include "Octree/Traversal.h"
#include "Core/Assert.h"
#include "Core/Buffer.h"

#include <algorithm>
#include <cstddef>
#include <span>

namespace palpate {

/// The traversal of two octrees, divided into jobs.
class TraversalJobs {
 public:
  /// Divides the traversal. elements: of both octrees. Returns the number of jobs.
  std::size_t start(const TreePair& trees, std::size_t elements, const FrameStart& frame) {
    m_trees = trees;
    const bool shared = frame.divides() && elements >= kSharedSize;
    startPairs(m_trees, shared ? kNodePairsWanted : isTimed() ? kFewNodePairs : 1, frame.stack);
    m_nodePairs = &frame.nodePairs;
    m_first = frame.nodePairs.size(), m_count = frame.stack.pairs.size();
    frame.nodePairs.insert(frame.nodePairs.end(), frame.stack.pairs.begin(),
                           frame.stack.pairs.end());
    m_grain = std::max<std::size_t>(1, (m_count + kJobsPerPair - 1) / kJobsPerPair);
    return (m_count + m_grain - 1) / m_grain;
  }
  const TreePair& trees() const { return m_trees; }
  /// Calls use(pairs) for each batch of a job's pairs.
  template <class Use>
  void forEachBatch(std::size_t job, JobScratch& scratch, Use&& use) const {
    PALPATE_ASSERT(m_nodePairs && job * m_grain < m_count);
    scratch.sink.start(
        [](void* opaque, std::span<const ElementPair> pairs) {
          (*static_cast<std::remove_reference_t<Use>*>(opaque))(pairs);
        },
        &use);
    const std::size_t begin = job * m_grain, size = std::min(m_count - begin, m_grain);
    traverse(m_trees, std::span(*m_nodePairs).subspan(m_first + begin, size), scratch.stack,
             scratch.sink);
    scratch.sink.flush();
  }

  static constexpr std::size_t kJobsPerPair = 32;

 private:
  /// Below this many elements, splitting a pair among threads costs more than it saves. With a
  /// deadline it is split into a few node pairs, as the search from each asks no deadline.
  static constexpr std::size_t kSharedSize = 8192, kNodePairsWanted = 256, kFewNodePairs = 8;

  TreePair m_trees{};
  const Buffer<NodePair>* m_nodePairs = nullptr;
  std::size_t m_first = 0, m_count = 0, m_grain = 1;  ///< of m_nodePairs
};

}  // namespace palpate
