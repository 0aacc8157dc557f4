#pragma once

#include "Mesh/TriangleMesh.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <string>
#include <vector>

namespace palpate::testing {

/// Binary PLY with double positions and triangles as "uint8 3, int32 x 3".
inline std::vector<Triangle> readFrame(const std::filesystem::path& path,
                                       std::vector<Eigen::Vector3d>& positions) {
  std::ifstream file(path, std::ios::binary);
  std::string line;
  std::size_t faces = 0;
  while (std::getline(file, line) && line != "end_header") {
    if (line.starts_with("element vertex ")) positions.resize(std::stoul(line.substr(15)));
    if (line.starts_with("element face ")) faces = std::stoul(line.substr(13));
  }
  file.read(reinterpret_cast<char*>(positions.data()),
            static_cast<std::streamsize>(positions.size() * sizeof(Eigen::Vector3d)));
  std::vector<Triangle> triangles(faces);
  for (Triangle& triangle : triangles) {
    file.get();
    file.read(reinterpret_cast<char*>(triangle.data()), sizeof triangle);
  }
  return triangles;
}

inline TriangleMesh readStep(const std::filesystem::path& before,
                             const std::filesystem::path& now) {
  TriangleMesh mesh;
  std::vector<Eigen::Vector3d> start, end;
  const std::vector<Triangle> triangles = readFrame(before, start);
  readFrame(now, end);
  mesh.before = start;
  mesh.now = end;
  mesh.topology = MeshTopology(mesh.now.size(), triangles);
  return mesh;
}

/// The numbers in a list of lists of two, as JSON has it.
inline std::vector<std::array<std::uint32_t, 2>> readPairs(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<std::array<std::uint32_t, 2>> pairs;
  std::array<std::uint32_t, 2> pair{};
  for (char c = 0; file.get(c);) {
    if (!std::isdigit(static_cast<unsigned char>(c))) continue;
    file.unget();
    file >> pair[0];
    while (file.get(c) && !std::isdigit(static_cast<unsigned char>(c))) {
    }
    file.unget();
    file >> pair[1];
    pairs.push_back(pair);
  }
  return pairs;
}

/// The truth values in a list, as JSON has it.
inline std::vector<bool> readTruth(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<bool> truth;
  for (char c = 0; file.get(c);)
    if (c == 't' || c == 'f') truth.push_back(c == 't'), file.ignore(3);
  return truth;
}

/// Every pair of triangles of a mesh, a < b, whose boxes over the step overlap.
inline std::vector<ElementPair> sweptCandidates(const TriangleMesh& mesh) {
  std::vector<Eigen::AlignedBox3d> boxes(mesh.topology.elements.size());
  for (std::size_t t = 0; t < boxes.size(); ++t)
    for (const std::uint32_t vertex : mesh.topology.elements[t])
      boxes[t].extend(mesh.before[vertex]).extend(mesh.now[vertex]);
  std::vector<std::uint32_t> order(boxes.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t l, std::uint32_t r) {
    return boxes[l].min().x() < boxes[r].min().x();
  });
  std::vector<ElementPair> pairs;
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t j = i + 1;
         j < order.size() && boxes[order[j]].min().x() <= boxes[order[i]].max().x(); ++j)
      if (boxes[order[i]].intersects(boxes[order[j]]))
        pairs.push_back({std::min(order[i], order[j]), std::max(order[i], order[j])});
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace palpate::testing
