// PalpateWriteRegression FOLDER: writes the generated files of Data/Regression.
#include "Problems.h"

#include <palpate/Capture.h>

#include <cstdio>

int main(int argc, char** argv) {
  if (argc != 2) return 1;
  try {
    for (const auto& [name, problem, counts] : palpate::testing::regressionProblems())
      palpate::writeCapture(problem, std::filesystem::path(argv[1]) / (name + ".capture"));
  } catch (const palpate::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
