#pragma once

#include "Common/RandomMeshes.h"

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace palpate::testing {

/// Vertices and triangles of a plain OBJ file. Normals and texture coordinates are ignored. It
/// serves tests that are built without VTK.
inline Mesh readObj(const std::filesystem::path& path) {
  Mesh mesh;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string kind;
    words >> kind;
    if (kind == "v") {
      Eigen::Vector3d& p = mesh.positions.emplace_back();
      words >> p[0] >> p[1] >> p[2];
    } else if (kind == "f") {
      Triangle& triangle = mesh.triangles.emplace_back();
      for (std::uint32_t& corner : triangle) {
        std::string word;
        words >> word;
        corner = static_cast<std::uint32_t>(std::stoul(word) - 1);
      }
    }
  }
  return mesh;
}

}  // namespace palpate::testing
