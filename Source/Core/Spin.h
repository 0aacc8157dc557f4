#pragma once

namespace palpate {

/// Busy waiting, because waking a thread takes longer than the loops of a small frame.
class Spin {
 public:
  bool isOver() const { return m_count >= kMaxCount; }  ///< other threads should get the core now
  void wait() {
    ++m_count;
#ifdef __x86_64__
    __builtin_ia32_pause();
#endif
  }

 private:
  static constexpr int kMaxCount = 2000;  ///< 20 to 80 microseconds
  int m_count = 0;
};

}  // namespace palpate
