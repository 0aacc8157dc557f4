#include "Mesh/TetrahedraCut.h"

#include "Common/RandomMeshes.h"
#include "Common/Solids.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <vector>

// A topology that is cut, beside one that is computed anew and keeps the ids of its surface.

namespace palpate {
namespace {

using testing::Random;
using Ids = std::vector<std::uint32_t>;

void expectSame(const TetrahedralTopology& found, const TetrahedralTopology& truth) {
  EXPECT_EQ(found.tetrahedra, truth.tetrahedra);
  EXPECT_EQ(found.surface, truth.surface);
  EXPECT_EQ(found.surfaceOwner, truth.surfaceOwner);
  EXPECT_EQ(found.removed, truth.removed);
  ASSERT_EQ(found.isPositive.size(), truth.isPositive.size());
  truth.forEach([&](std::uint32_t t) { EXPECT_EQ(found.isPositive[t], truth.isPositive[t]) << t; });
}

TEST(TetrahedraCut, EqualsATopologyThatIsComputedAnew) {
  std::size_t cuts = 0, faults = 0, passed = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    Random random(seed);
    testing::Solid solid = testing::cells(2, random);
    for (Eigen::Vector3d& p : solid.positions) p += testing::randomPoint(random, -0.05, 0.05);
    std::optional<OverusedFace> fault;
    TetrahedralTopology topology = topologyOf(solid.positions, solid.tetrahedra, fault);
    ASSERT_FALSE(fault);
    for (int cut = 0; cut < 12; ++cut) {
      Ids gone;
      std::vector<Tetrahedron> added;
      std::vector<Eigen::Vector3d> rest = solid.positions;
      const auto addVertex = [&](const Eigen::Vector3d& p) {
        rest.push_back(p);
        return static_cast<std::uint32_t>(rest.size() - 1);
      };
      topology.forEach([&](std::uint32_t id) {
        Tetrahedron t = topology.tetrahedra[id];
        if (random() % 10) return;
        const Eigen::Vector3d middle = (rest[t[0]] + rest[t[1]] + rest[t[2]] + rest[t[3]]) / 4;
        switch (random() % 5) {
          case 0:  // on a face, inside (which is refused where another one is beyond) or outside
            t[random() % 4] = addVertex(middle + testing::randomPoint(random, -0.1, 0.1));
            if (random() % 8 == 0) added.push_back(t);
            return;
          case 1:  // the same one again, also wound in another way
            gone.push_back(id);
            if (random() % 2) std::swap(t[0], t[1]);
            added.push_back(t);
            return;
          case 2:  // four in its place
            gone.push_back(id);
            for (int corner = 0; corner < 4; ++corner) {
              added.push_back(t);
              added.back()[static_cast<std::size_t>(corner)] =
                  corner == 0 ? addVertex(middle) : static_cast<std::uint32_t>(rest.size() - 1);
            }
            return;
          default:
            gone.push_back(id);
        }
      });
      ASSERT_TRUE(TetrahedraCut::isPossible(topology, rest, added));
      TetrahedralTopology next = topology;
      TetrahedraCut found(next, rest, gone, added);

      std::vector<Tetrahedron> all(topology.tetrahedra.begin(), topology.tetrahedra.end());
      all.insert(all.end(), added.begin(), added.end());
      Ids removed(topology.removed.begin(), topology.removed.end());
      removed.insert(removed.end(), gone.begin(), gone.end());
      std::sort(removed.begin(), removed.end());
      fault.reset();
      TetrahedralTopology truth = topologyOf(rest, all, fault, removed);
      ASSERT_EQ(found.fault().has_value(), fault.has_value()) << "seed " << seed;
      if (fault) {
        EXPECT_EQ(found.fault()->face, fault->face);
        EXPECT_EQ(found.fault()->tetrahedra, fault->tetrahedra);
        ++faults;
        continue;
      }
      ASSERT_FALSE(truth.hasFlat);
      const auto without = keepSurfaceIds(topology.surface, truth);
      Ids goneFaces;  // of this cut
      for (const std::uint32_t face : without)
        if (topology.surfaceOwner[face] != kNoElement) goneFaces.push_back(face);
      EXPECT_TRUE(std::ranges::equal(found.goneFaces(), goneFaces));
      EXPECT_EQ(topology.surface.size() + found.newFaces().size(), truth.surface.size());
      Ids passedFaces;
      for (std::uint32_t face = 0; face < topology.surface.size(); ++face)
        if (truth.surfaceOwner[face] != topology.surfaceOwner[face] &&
            truth.surfaceOwner[face] != kNoElement)
          passedFaces.push_back(face);
      Ids foundPassed(found.passedFaces().begin(), found.passedFaces().end());
      std::sort(foundPassed.begin(), foundPassed.end());
      EXPECT_EQ(foundPassed, passedFaces);
      passed += passedFaces.size();
      found.apply();
      expectSame(next, truth);
      topology = next;
      solid.positions = rest;
      ++cuts;
      if (::testing::Test::HasFailure()) FAIL() << "seed " << seed << ", cut " << cut;
    }
  }
  EXPECT_GT(cuts, 300u);
  EXPECT_GT(faults, 20u);
  EXPECT_GT(passed, 100u);
}

}  // namespace
}  // namespace palpate
