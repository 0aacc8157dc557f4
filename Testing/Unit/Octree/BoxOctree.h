#pragma once

#include "Common/RandomMeshes.h"
#include "Octree/Forest.h"
#include "Octree/Octree.h"

#include <algorithm>
#include <cstring>
#include <vector>

namespace palpate::testing {

using Boxes = std::vector<FloatBox>;

inline FloatBox boxAbout(const std::array<double, 3>& centre, double size) {
  FloatBox box;
  for (std::size_t k = 0; k < 3; ++k) {
    box.lower[k] = static_cast<float>(centre[k] - 0.5 * size);
    box.upper[k] = static_cast<float>(centre[k] + 0.5 * size);
  }
  return box;
}

inline Boxes randomBoxes(Random& random, std::size_t count, double size) {
  Boxes boxes;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d centre = randomPoint(random, -1, 1);
    boxes.push_back(boxAbout({centre.x(), centre.y(), centre.z()}, size));
  }
  return boxes;
}

/// Boxes around one point, each half the size of the one before. Nearly every level of the octree
/// holds some of them and passes the smaller ones on.
inline Boxes nestedBoxes(Random& random, std::size_t perLevel, int levels, std::size_t smallest) {
  Boxes boxes;
  const auto add = [&](std::size_t count, double size) {
    for (std::size_t i = 0; i < count; ++i) {
      const Eigen::Vector3d centre = randomPoint(random, 0.0, 0.4 * size);
      boxes.push_back(boxAbout({centre.x(), centre.y(), centre.z()}, size));
    }
  };
  double size = 0x1p20;
  for (int level = 0; level < levels; ++level, size *= 0.5) add(perLevel, 0.9 * size);
  add(smallest, size);
  std::shuffle(boxes.begin(), boxes.end(), random);
  return boxes;
}

/// An octree of boxes, with the calls that its owner makes.
class BoxOctree {
 public:
  Octree octree;

  /// It allocates nothing itself after prepare().
  void prepare(const Boxes& boxes) { m_keys.resize(boxes.size()); }
  void build(const Boxes& boxes, const OctreeSettings& settings, const Threads& threads) {
    prepare(boxes);
    octree.reset(boxes.size());
    FloatBox bounds;
    for (std::size_t i = 0; i < boxes.size(); ++i) {
      write(i, boxes[i]);
      bounds.add(boxes[i]);
    }
    octree.build(bounds, bounds.upper[0] - bounds.lower[0], settings, m_keys, threads);
    fit(boxes, threads);
    octree.measureLooseness();
  }
  void fit(const Boxes& boxes, const Threads& threads) {
    writeGroups(boxes, 0, octree.groups().size() - 1);
    octree.fit(threads);
  }
  void refit(const Boxes& boxes, std::size_t first, std::size_t last) {
    writeGroups(boxes, first, last);
    octree.refit(first, last);
  }

 private:
  void writeGroups(const Boxes& boxes, std::size_t first, std::size_t last) {
    const auto groups = octree.groups();
    for (std::size_t g = first; g < last; ++g) {
      FloatBox all;
      for (std::uint32_t i = groups[g]; i < groups[g + 1]; ++i) {
        write(i, boxes[octree.order()[i]]);
        all.add(boxes[octree.order()[i]]);
      }
      octree.groupBoxes()[g] = all;
    }
  }
  void write(std::size_t i, const FloatBox& box) {
    for (std::size_t k = 0; k < 3; ++k) {
      octree.boxes().lower[k][i] = box.lower[k];
      octree.boxes().upper[k][i] = box.upper[k];
    }
  }

  Buffer<std::uint64_t> m_keys;
};

/// Expects the same nodes, boxes and order, bit by bit.
inline bool same(const Octree& a, const Octree& b) {
  const std::size_t blocks = a.pool().used();
  if (!std::ranges::equal(a.order(), b.order()) || !std::ranges::equal(a.groups(), b.groups()) ||
      blocks != b.pool().used() ||
      std::memcmp(a.blocks(), b.blocks(), blocks * sizeof(OctreeBlock)) != 0)
    return false;
  for (std::size_t block = 0; block < blocks; ++block)
    if (a.parent(block) != b.parent(block)) return false;
  return a.looseness() == b.looseness() && a.rootCube().edge == b.rootCube().edge &&
         a.rootCube().lower == b.rootCube().lower;
}

}  // namespace palpate::testing
