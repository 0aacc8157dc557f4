// Every file of Data/Fuzz through the function that is fuzzed with it: in any build, without a
// fuzzer.
#include "Targets.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <ostream>
#include <string>
#include <vector>

namespace palpate::fuzz {

namespace {

namespace fs = std::filesystem;

class Replay : public ::testing::TestWithParam<Target> {};

TEST_P(Replay, KeptFilesHaveNoFault) {
  std::vector<fs::path> files;
  for (const auto& entry :
       fs::directory_iterator(fs::path(PALPATE_SOURCE_DIR) / "Data/Fuzz" / GetParam().name))
    files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  EXPECT_FALSE(files.empty());
  for (const fs::path& path : files) {
    SCOPED_TRACE(path.filename());
    std::ifstream file(path, std::ios::binary);
    const std::vector<char> content(std::istreambuf_iterator<char>(file), {});
    GetParam().run({reinterpret_cast<const std::uint8_t*>(content.data()), content.size()});
  }
}

INSTANTIATE_TEST_SUITE_P(Targets, Replay, ::testing::ValuesIn(kTargets),
                         [](const auto& target) { return std::string(target.param.name); });

}  // namespace

void PrintTo(const Target& target, std::ostream* out) { *out << target.name; }

}  // namespace palpate::fuzz
