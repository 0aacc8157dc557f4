#pragma once

#include <string>
#include <vector>

namespace palpate {

/// The SIMD path that is in use.
std::string currentSimdPath();

/// The paths that this machine can run, best first.
std::vector<std::string> simdPaths();

/// For tests and benchmarks, between frames: switches the whole process to a path of simdPaths().
/// An empty path selects the best one.
void useSimdPath(const std::string& path);

/// For tests, before all else: this process behaves as on a processor without these paths. One path
/// always remains. Returns false if a name is that of no path of this build.
bool hideSimdPaths(const std::vector<std::string>& paths);

}  // namespace palpate
