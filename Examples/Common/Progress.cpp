#include "Progress.h"

#include <cstdio>
#include <unistd.h>

namespace palpate::scenes {

Progress::Progress(std::string name)
    : m_name(std::move(name)), m_isTerminal(isatty(STDERR_FILENO) != 0) {}

void Progress::operator()(int done, int total) {
  constexpr std::chrono::milliseconds kBetweenBars{100}, kBetweenLines{30'000};
  const Clock::time_point now = Clock::now();
  const bool isDue = now - m_last >= (m_isTerminal ? kBetweenBars : kBetweenLines);
  if (!isDue && !(done == total && m_isTerminal)) return;
  m_last = now;
  constexpr int kWidth = 30;
  const int filled = total > 0 ? static_cast<int>(static_cast<long>(kWidth) * done / total) : 0;
  if (m_isTerminal)
    std::fprintf(stderr, "\r[%s%s] ", std::string(filled, '#').c_str(),
                 std::string(kWidth - filled, '.').c_str());
  std::fprintf(stderr, "%s: frame %d of %d, %.0f s%s", m_name.c_str(), done, total,
               std::chrono::duration<double>(now - m_start).count(),
               m_isTerminal ? (done == total ? "\x1b[K\n" : "\x1b[K") : "\n");
}

}  // namespace palpate::scenes
