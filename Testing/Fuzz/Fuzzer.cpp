// The entry of libFuzzer for the target PALPATE_FUZZ_TARGET. It links no other target.
#include "Targets.h"

#include <gtest/gtest.h>

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  testing::InitGoogleTest(argc, *argv);
  GTEST_FLAG_SET(throw_on_failure, true);
  return 0;
}

// Nothing catches an exception here, so that libFuzzer sees a crash with the stack of the failure.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  palpate::fuzz::PALPATE_FUZZ_TARGET({data, size});
  return 0;
}
