#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>

namespace palpate {

/// Decides when memory is given back that only a burst needed, such as one bad step. It depends on
/// counts of detections, never on the clock.
class BurstMemory {
 public:
  /// What a detection worked on, to which its memory is about proportional.
  struct Work {
    std::size_t pairs = 0;     ///< candidates and feature pairs
    std::size_t contacts = 0;  ///< and triangles that intersect
  };

  /// A detection was completed. bytes: held for detections. Returns whether memory is to be given
  /// back: all detections of late needed much less than one since the last time.
  /// Laws     (1) a burst is over at most 2 kDetections after it.
  ///          (2) work that stays within a factor of kShare is never a burst.
  bool isOver(const Work& work, std::size_t bytes) {
    raise(m_recent, work);
    if (++m_count < kDetections) return false;
    m_count = 0;
    const Work need = std::exchange(m_recent, {});
    const bool isLess =
        m_most.pairs > kShare * need.pairs || m_most.contacts > kShare * need.contacts;
    if (isLess && bytes > kFewBytes) {
      m_most = need;
      return true;
    }
    raise(m_most, need);
    return false;
  }

  static constexpr int kDetections = 128;  ///< a second or two of frames, a tenth in a haptic loop
  static constexpr std::size_t kShare = 4;
  /// A loop needs these again so soon that giving them back would cost more.
  static constexpr std::size_t kFewBytes = std::size_t{8} << 20;

 private:
  static void raise(Work& most, const Work& work) {
    most.pairs = std::max(most.pairs, work.pairs);
    most.contacts = std::max(most.contacts, work.contacts);
  }

  Work m_most, m_recent;  ///< since memory was given back; in the detections that are counted
  int m_count = 0;
};

}  // namespace palpate
