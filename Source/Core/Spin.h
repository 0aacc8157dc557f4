#pragma once

namespace palpate {

/// Waiting on the core, as waking a thread takes longer than a small frame's loops.
class Spin {
 public:
  bool isOver() const { return m_count >= kMost; }  ///< better to leave the core to others
  void wait() {
    ++m_count;
#ifdef __x86_64__
    __builtin_ia32_pause();
#endif
  }

 private:
  static constexpr int kMost = 2000;  ///< 20 to 80 microseconds
  int m_count = 0;
};

}  // namespace palpate
