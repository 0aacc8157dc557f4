#pragma once

#include <string>
#include <vector>

namespace palpate::benchmark {

std::string simdPath();                ///< the one that run-time dispatch takes now
std::vector<std::string> simdPaths();  ///< that were built and that this processor runs, best first
void chooseSimdPath(const std::string& name);  ///< one of simdPaths(); "": the best
}  // namespace palpate::benchmark
