#include "CollisionDetection/SettingsCheck.h"

#include <palpate/Error.h>

#include <filesystem>
#include <limits>
#include <string>
#include <system_error>

namespace palpate {

const Settings& checked(const Settings& settings) {
  const auto check = [](const char* name, auto setting, int low, int high, const char* range) {
    const int value = static_cast<int>(setting);
    if (value < low || value > high)
      throw Error(ErrorCode::InvalidSettings, std::string("settings: ") + name + " is " +
                                                  std::to_string(value) + "; it must be " + range);
  };
  constexpr int kAny = std::numeric_limits<int>::max();
  const OctreeSettings& octree = settings.octree;
  check("octree.maxDepth", octree.maxDepth, 1, 60, "in [1, 60]");
  check("octree.maxElementsPerLeaf", octree.maxElementsPerLeaf, 1, 1024, "in [1, 1024]");
  check("octree.update", octree.update, 0, 1, "Auto or Rebuild");
  check("octree.bounds", octree.bounds, 0, 2, "Box, Dop14 or Dop18");
  check("engine", settings.engine, 0, 1, "Octree or BruteForce");
  check("threads", settings.threads, 0, 1024, "in [0, 1024]");
  check("audit.features", settings.audit.features, 0, kAny, "at least 0");
  check("audit.maxFiles", settings.audit.maxFiles, 0, kAny, "at least 0");
  std::error_code fault;
  if (const auto& folder = settings.audit.folder;
      !folder.empty() && !std::filesystem::is_directory(folder, fault))
    throw Error(ErrorCode::InvalidSettings,
                "settings: audit.folder \"" + folder.string() + "\" is not a folder");
  return settings;
}

}  // namespace palpate
