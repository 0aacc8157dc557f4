#pragma once

#include <chrono>
#include <string>

namespace palpate::scenes {

/// Progress of a long command on stderr: a bar on a terminal, elsewhere a line each half minute.
class Progress {
 public:
  explicit Progress(std::string name);
  void operator()(int done, int total);

 private:
  using Clock = std::chrono::steady_clock;
  std::string m_name;
  bool m_isTerminal;
  Clock::time_point m_start = Clock::now(), m_last = m_start;
};

}  // namespace palpate::scenes
