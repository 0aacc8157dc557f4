#pragma once

#include <string>
#include <vector>

namespace palpate {

/// The path that runs now.
std::string currentSimdPath();

/// The paths that this machine can run, best first.
std::vector<std::string> simdPaths();

/// For tests and benchmarks, between frames: runs the whole process on a path of simdPaths() from
/// now on; empty: on the best.
void useSimdPath(const std::string& path);

}  // namespace palpate
