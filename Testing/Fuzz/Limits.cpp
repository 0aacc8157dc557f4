#include "Limits.h"

#include <gtest/gtest.h>

#include <ctime>
#include <fstream>
#include <iterator>
#include <string>
#include <unistd.h>

namespace palpate::fuzz {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kTimes = 20, kBytes = 1'000'000, kMostMessage = 300;
/// For any file, and for each byte. Sanitizers make a reader some ten times slower.
constexpr double kSeconds = 0.2, kSecondsOfByte = 2e-6;

class ScratchFile {
 public:
  ScratchFile() : m_path(fs::temp_directory_path() / ("palpate-" + std::to_string(::getpid()))) {}
  ~ScratchFile() {
    std::error_code fault;
    fs::remove(m_path, fault);
  }
  const fs::path& path() const { return m_path; }

 private:
  fs::path m_path;
};

}  // namespace

double cpuSeconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

void expectWithinLimits(std::size_t bytes, std::size_t peak, double seconds) {
  EXPECT_LE(peak, kTimes * bytes + kBytes);
  EXPECT_LE(seconds, kSeconds + kSecondsOfByte * static_cast<double>(bytes));
}

void expectShort(std::string_view message) {
  EXPECT_FALSE(message.empty());
  EXPECT_LT(message.size(), kMostMessage) << message;
}

fs::path fileWith(std::string_view content) {
  static const ScratchFile file;
  std::ofstream(file.path(), std::ios::binary) << content;
  return file.path();
}

std::string contentOf(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace palpate::fuzz
