#include "Core/SimdPath.h"

#include <gtest/gtest.h>

#ifdef __GLIBC__
#include <sched.h>
#endif

#include <cstdio>
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

// main() of the test binaries. Two variables of the environment make this machine look like
// another one. Only tests read them.
//
//   PALPATE_TEST_HIDDEN_PATHS="AVX-512,AVX2"   SIMD paths that the processor shall not have
//   PALPATE_TEST_CORES=16                      the number of cores that it shall have

#ifdef __GLIBC__
/// std::thread::hardware_concurrency() calls this instead of the C library's function.
extern "C" int get_nprocs() noexcept {
  if (const char* claimed = std::getenv("PALPATE_TEST_CORES")) return std::atoi(claimed);
  cpu_set_t allowed;
  return sched_getaffinity(0, sizeof allowed, &allowed) == 0 ? CPU_COUNT(&allowed) : 1;
}
#endif

namespace palpate::testing {
namespace {

std::vector<std::string> hiddenPaths() {
  std::vector<std::string> paths;
  const char* hidden = std::getenv("PALPATE_TEST_HIDDEN_PATHS");
  std::istringstream names(hidden ? hidden : "");
  for (std::string name; std::getline(names, name, ',');) paths.push_back(name);
  return paths;
}

}  // namespace
}  // namespace palpate::testing

int main(int count, char** arguments) {
  if (!palpate::hideSimdPaths(palpate::testing::hiddenPaths())) {
    std::fputs("PALPATE_TEST_HIDDEN_PATHS names a path that this build does not have\n", stderr);
    return 2;
  }
  ::testing::InitGoogleTest(&count, arguments);
  return RUN_ALL_TESTS();
}
