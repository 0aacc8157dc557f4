#pragma once

#include "Targets.h"

#include "Common/FailingAllocation.h"

#include <filesystem>
#include <string>
#include <string_view>

namespace palpate::fuzz {

inline std::string_view textOf(Bytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

double cpuSeconds();
void expectWithinLimits(std::size_t bytes, std::size_t peak, double seconds);

/// Calls read(), and expects that it keeps to the limits of every reader: memory of 20 times
/// `bytes` and 1 MB, and a time that is linear in them. bytes: of the file, or of what it may
/// decode to.
template <class F>
void withinLimits(std::size_t bytes, F&& read) {
  const double start = cpuSeconds();
  testing::FailingAllocation::arm(0);
  read();
  testing::FailingAllocation::disarm();
  expectWithinLimits(bytes, testing::FailingAllocation::peakBytes(), cpuSeconds() - start);
}

/// Messages must be short, whatever the file has.
void expectShort(std::string_view message);

/// A file that exists as long as the process, with the given content.
std::filesystem::path fileWith(std::string_view content);
std::string contentOf(const std::filesystem::path& path);

}  // namespace palpate::fuzz
