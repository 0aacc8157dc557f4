#pragma once

#include "Search/JobScratch.h"
#include "Search/OctreeParts.h"
#include "NarrowPhase/FeatureBounds.h"
#include "NarrowPhase/FeaturePairs.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Bodies/Body.h"
#include "Octree/Traversal.h"
#include "Core/Buffer.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

namespace palpate {

/// How far the lists and classes reach.
struct KeptReach {
  double distance = 0;  ///< L: of features, and of boxes, that may be in contact
  double lists = 0;     ///< L: the margin of the lists
  double classes = 0;   ///< L: the same of the classes
  double error = 0;     ///< L: rounding of boxes and distances; set by KeptDetection

  /// The margins at which making lists, sorting and testing cost least together. distance: L.
  /// speed: the relative motion in a step, L. edge: length of a short edge, L.
  static KeptReach of(double distance, double speed, double edge);
  /// Above this share of an edge, the motion of a step makes keeping cost more than it saves.
  static constexpr double kMostSpeed = 0.04;
};

/// The lists of the element pairs of two parts of octrees.
struct KeptUnit {
  static constexpr int kClasses = 8;  ///< within KeptReach::classes

  std::uint32_t partA = 0, partB = 0;
  /// L: how far elements of both parts have moved, relative to each other, since the lists were
  /// made, and since they were sorted.
  double movedSinceLists = std::numeric_limits<double>::infinity(), movedSinceClasses = 0;
  KeptReach atLists{}, atClasses{};
  Buffer<ElementPair> boxes, near;
  std::array<std::uint32_t, kClasses> ends{};  ///< of the classes in `near`; the rest is further
  std::array<std::uint32_t, 2> last{};         ///< the highest ids in `boxes`
  bool isMade = false, isSorted = false;       ///< false: in this detection
  PartPair parts() const { return {partA, partB}; }
  bool isListed() const { return movedSinceLists < std::numeric_limits<double>::infinity(); }
  double weight() const { return static_cast<double>(boxes.size()) + 16.0; }
  double weightOfClasses() const { return static_cast<double>(near.size()) + 4.0; }
};

/// The boxes and features of two meshes in one detection, as the lists of KeptPairs see them: what
/// a unit lists, how its pairs are sorted, and which of them may be in contact now.
class KeptDetection {
 public:
  void start(const Body& a, const Body& b, const KeptReach&);
  const KeptReach& reach() const { return m_reach; }
  bool self() const { return m_trees.self(); }
  /// The boxes of the elements now, with the distance between them.
  const FloatPair& floats() const { return m_floats; }
  /// Both octrees, of which nodes overlap where elements may be within the distance, L.
  TreePair treesWithin(const Body& a, const Body& b, double distance) const;
  /// Makes the lists of a unit, whose parts are two nodes.
  void make(KeptUnit&, const NodePair&, const MeshPair&, JobScratch&) const;
  /// Sorts those of the pairs with near features into classes. Pairs beyond the margin of the lists
  /// are left out.
  void sort(KeptUnit&, const MeshPair&, std::span<const ElementPair>, JobScratch&) const;
  std::span<const ElementPair> nearOf(const KeptUnit&) const;  ///< those that may be in contact
  bool overlap(const Triangle& a, const Triangle& b) const;    ///< the boxes of elements

 private:
  KeptReach m_reach{};
  double m_scale = 1;               ///< of the floats
  std::array<float, 3> m_offset{};  ///< brings a's floats into the frame of b's
  float m_floatError = 0;           ///< of the difference of two coordinates
  TreePair m_trees{};
  FloatPair m_floats{};
};

}  // namespace palpate
