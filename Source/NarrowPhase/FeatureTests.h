#pragma once

#include <palpate/Types.h>

#include <array>
#include <cstdint>

namespace palpate {

/// The features of a triangle side by side. Edge 2 stands twice, so that each four tests take
/// theirs from one half.
inline constexpr int kFeatures = 8;
enum Feature : std::uint8_t { kCorner, kEdge2 = 3, kEdge0, kEdge1, kTriangle, kEdge2Too };

/// The tests of two triangles side by side, and which feature of each they take: corners of a with
/// b, corners of b with a, edges with edges. The last is none.
inline constexpr int kTests = 16;
using TestFeatures = std::array<std::uint8_t, kTests>;
inline constexpr TestFeatures kOfA = {0, 1, 2, 3, 6, 6, 6, 4, 4, 4, 5, 5, 5, 7, 7, 7},
                              kOfB = {6, 6, 6, 7, 0, 1, 2, 3, 4, 5, 4, 5, 7, 4, 5, 7};
inline constexpr unsigned kCornersOfA = 0x0007, kCornersOfB = 0x0070, kEdges = 0x7f88;
/// Each corner of a with each of b.
inline constexpr TestFeatures kCornerOfA = {0, 0, 0, 1, 1, 1, 2, 2, 2},
                              kCornerOfB = {0, 1, 2, 0, 1, 2, 0, 1, 2};

/// As in MeshTopology::owned.
constexpr unsigned ownedBit(std::uint8_t feature) {
  if (feature < kEdge2) return 1u << feature;
  return feature == kEdge0 ? 8 : feature == kEdge1 ? 16 : 32;
}
constexpr unsigned cornersOf(std::uint8_t feature) {
  if (feature < kEdge2) return 1u << feature;
  return feature == kTriangle ? 7 : feature == kEdge0 ? 3 : feature == kEdge1 ? 6 : 5;
}

/// Tests whose feature of one triangle it owns, by its bits; a triangle owns itself.
constexpr auto ownedTests(const TestFeatures& features) {
  std::array<std::uint16_t, 64> tests{};
  for (unsigned owned = 0; owned < 64; ++owned)
    for (int test = 0; test < kTests - 1; ++test)
      if (features[test] == kTriangle || owned & ownedBit(features[test]))
        tests[owned] |= static_cast<std::uint16_t>(1u << test);
  return tests;
}
inline constexpr auto kOwnedByA = ownedTests(kOfA), kOwnedByB = ownedTests(kOfB);

/// Tests of features with a vertex in common, by the corners that are the same: bit 3 i + j for a's
/// i and b's j.
constexpr auto sharingTests(const TestFeatures& ofA, const TestFeatures& ofB) {
  std::array<std::uint16_t, 512> tests{};
  for (unsigned same = 0; same < 512; ++same)
    for (int test = 0; test < kTests - 1; ++test)
      for (int bit = 0; bit < 9; ++bit)
        if (same >> bit & 1 && cornersOf(ofA[test]) >> bit / 3 & 1 &&
            cornersOf(ofB[test]) >> bit % 3 & 1)
          tests[same] |= static_cast<std::uint16_t>(1u << test);
  return tests;
}
inline unsigned sameCorners(const Triangle& a, const Triangle& b) {
  unsigned same = 0;
  for (int bit = 0; bit < 9; ++bit) same |= static_cast<unsigned>(a[bit / 3] == b[bit % 3]) << bit;
  return same;
}
inline constexpr auto kSharingTests = sharingTests(kOfA, kOfB);

/// The same tests in plain order: corner i of a with b, corner j of b with a (from bit 3), edge i
/// with edge j (at bit 6 + 3 i + j).
inline constexpr TestFeatures kInA = {0,         1,      2,      kTriangle, kTriangle,
                                      kTriangle, kEdge0, kEdge0, kEdge0,    kEdge1,
                                      kEdge1,    kEdge1, kEdge2, kEdge2,    kEdge2},
                              kInB = {kTriangle, kTriangle, kTriangle, 0,      1,
                                      2,         kEdge0,    kEdge1,    kEdge2, kEdge0,
                                      kEdge1,    kEdge2,    kEdge0,    kEdge1, kEdge2};
inline constexpr auto kOwnedInA = ownedTests(kInA), kOwnedInB = ownedTests(kInB);
inline constexpr auto kSharing = sharingTests(kInA, kInB);

}  // namespace palpate
