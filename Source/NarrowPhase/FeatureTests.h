#pragma once

#include "Mesh/TriangleMesh.h"

#include <array>
#include <cstdint>

namespace palpate {

/// Places of a triangle's features in a row. Corner i is feature i. Edge 2 has two places, so that
/// each group of four tests takes its features from one half of the row.
inline constexpr int kFeatures = 8;
enum Feature : std::uint8_t {
  kCorner0,
  kCorner1,
  kCorner2,
  kEdge2,
  kEdge0,
  kEdge1,
  kTriangle,
  kEdge2Again
};

constexpr bool isCorner(std::uint8_t feature) { return feature <= kCorner2; }
constexpr bool isEdge(std::uint8_t feature) { return !isCorner(feature) && feature != kTriangle; }
/// The number of an edge in its triangle.
constexpr int edgeNumber(std::uint8_t feature) {
  return feature == kEdge0 ? 0 : feature == kEdge1 ? 1 : 2;
}

/// The fifteen feature tests of triangles a and b. All sets of tests use one order: bit t of a set
/// is test t. The last of the sixteen places holds no test.
inline constexpr int kTests = 15, kTestPlaces = 16;
using TestFeatures = std::array<std::uint8_t, kTestPlaces>;
/// For each test, its feature of triangle a and its feature of triangle b.
// clang-format off
inline constexpr TestFeatures
    kFeatureOfA = {kCorner0,  kCorner1,  kCorner2,  kEdge2,
            kTriangle, kTriangle, kTriangle, kEdge0,
            kEdge0,    kEdge0,    kEdge1,    kEdge1,
            kEdge1,    kEdge2Again, kEdge2Again, kEdge2Again},
    kFeatureOfB = {kTriangle, kTriangle, kTriangle, kEdge2Again,
            kCorner0,  kCorner1,  kCorner2,  kEdge2,
            kEdge0,    kEdge1,    kEdge0,    kEdge1,
            kEdge2Again, kEdge0,  kEdge1,    kEdge2Again};
// clang-format on

/// Numbers of the tests: corner i of a with b, corner j of b with a, edge i of a with edge j of b.
constexpr int cornerTestOfA(int i) { return i; }
constexpr int cornerTestOfB(int j) { return 4 + j; }
inline constexpr auto kTestOfEdges = [] {
  std::array<std::array<std::uint8_t, 3>, 3> tests{};
  for (std::uint8_t test = 0; test < kTests; ++test)
    if (isEdge(kFeatureOfA[test]) && isEdge(kFeatureOfB[test]))
      tests[edgeNumber(kFeatureOfA[test])][edgeNumber(kFeatureOfB[test])] = test;
  return tests;
}();
constexpr int edgeTest(int i, int j) { return kTestOfEdges[i][j]; }

/// Sets of all tests of one kind.
inline constexpr unsigned kCornerTestsOfA = 0x0007, kCornerTestsOfB = 0x0070, kEdgeTests = 0x7f88;

/// The tests that apply to the geometry types of two meshes.
inline unsigned allowedTests(const MeshTopology& a, const MeshTopology& b) {
  return kEdgeTests | (areTested(a, b, true) ? kCornerTestsOfA : 0) |
         (areTested(b, a, false) ? kCornerTestsOfB : 0);
}

/// For each value of MeshTopology::owned, the tests whose feature the triangle owns. Each triangle
/// owns itself.
constexpr auto ownedTests(const TestFeatures& features) {
  const auto owns = [](unsigned owned, std::uint8_t feature) {
    return feature == kTriangle ||
           owned & (isCorner(feature) ? MeshTopology::cornerBit(feature)
                                      : MeshTopology::edgeBit(edgeNumber(feature)));
  };
  std::array<std::uint16_t, 64> tests{};
  for (unsigned owned = 0; owned < 64; ++owned)
    for (int test = 0; test < kTests; ++test)
      if (owns(owned, features[test])) tests[owned] |= static_cast<std::uint16_t>(1u << test);
  return tests;
}
inline constexpr auto kOwnedByA = ownedTests(kFeatureOfA), kOwnedByB = ownedTests(kFeatureOfB);

/// Each corner of a with each corner of b, in the order of the bits of sameCorners().
inline constexpr int kCornerPairs = 9;
inline constexpr TestFeatures kCornerOfA = {0, 0, 0, 1, 1, 1, 2, 2, 2},
                              kCornerOfB = {0, 1, 2, 0, 1, 2, 0, 1, 2};
/// Which corners of two triangles are the same vertex.
inline unsigned sameCorners(const Triangle& a, const Triangle& b) {
  unsigned same = 0;
  for (int pair = 0; pair < kCornerPairs; ++pair)
    same |= static_cast<unsigned>(a[kCornerOfA[pair]] == b[kCornerOfB[pair]]) << pair;
  return same;
}

constexpr bool containsCorner(std::uint8_t feature, std::uint8_t corner) {
  if (isCorner(feature)) return feature == corner;
  return feature == kTriangle || edgeNumber(feature) == corner ||
         (edgeNumber(feature) + 1) % 3 == corner;
}
/// For each value of sameCorners(), the tests whose features have a vertex in common.
inline constexpr auto kSharingTests = [] {
  std::array<std::uint16_t, 1 << kCornerPairs> tests{};
  for (int test = 0; test < kTests; ++test) {
    unsigned sharing = 0;
    for (int pair = 0; pair < kCornerPairs; ++pair)
      if (containsCorner(kFeatureOfA[test], kCornerOfA[pair]) &&
          containsCorner(kFeatureOfB[test], kCornerOfB[pair]))
        sharing |= 1u << pair;
    for (unsigned same = 0; same < tests.size(); ++same)
      if (same & sharing) tests[same] |= static_cast<std::uint16_t>(1u << test);
  }
  return tests;
}();

}  // namespace palpate
