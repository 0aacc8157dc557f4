#include "Core/SimdPath.h"

#include "Common/PairRun.h"
#include "Common/DegenerateCases.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <map>

// The same input gives the same bits: for any number of threads, any SIMD path, any build.

namespace palpate {
namespace {

using namespace testing;
using Eigen::Vector3d;

/// Positions from exact arithmetic only, so that no compiler or mathematics library changes them.
struct HashedScene {
  Mesh a, b;
  std::vector<Vector3d> aBefore, bBefore;
};

HashedScene scene() {
  Random random(99);
  HashedScene scene;
  scene.a = flat(24, 0);
  for (Vector3d& p : scene.a.positions)
    p.z() = 0.3 * p.x() * (1 - p.x()) + uniform(random, -0.01, 0.01);
  append(scene.a, soup(random, 60, 0.08));
  scene.b = soup(random, 400, 0.05);
  append(scene.b, flat(9, 0.06));
  scene.aBefore = scene.a.positions;
  scene.bBefore = scene.b.positions;
  for (Vector3d& p : scene.aBefore) p.z() += 0.03;
  for (Vector3d& p : scene.bBefore) p += randomPoint(random, -0.02, 0.02);
  return scene;
}

/// Refits the octrees to the step, then detects.
std::vector<std::uint64_t> hashes(const Settings& settings, const PairSettings& pair) {
  const HashedScene s = scene();
  PairRun run(settings, s.a, s.b, pair);
  run.step(s.aBefore, s.aBefore, s.bBefore, s.bBefore);
  run.step(s.aBefore, s.a.positions, s.bBefore, s.b.positions);
  const auto of = [&](GeometryId a, GeometryId b) {
    return run.detection().collisionData(a, b).hash();
  };
  return {of(run.a(), run.b()), of(run.a(), run.a()), of(run.b(), run.b())};
}

class Determinism : public ::testing::TestWithParam<MethodCase> {
 protected:
  static PairSettings settings() {
    PairSettings settings = GetParam().settings;
    settings.thickness *= 0.01;
    return settings;
  }
};

/// Frame/OracleTest.cpp and Unit/Validity/SupportedPairsTest.cpp compare threads and updates.
TEST_P(Determinism, SimdPathsDoNotChangeABit) {
  const std::vector<std::uint64_t> first = hashes(settingsOf(Engine::Octree), settings());
  for (const std::string& path : simdPaths()) {
    SCOPED_TRACE(path);
    useSimdPath(path);
    EXPECT_EQ(hashes(settingsOf(Engine::Octree), settings()), first);
  }
  useSimdPath("");
}

/// Hashes of (a, b), a and b by themselves. They change only with the definition of contacts, or
/// with the rounding of times. A build with other hashes breaks the guarantee of reproducibility.
const std::map<std::string, std::vector<std::uint64_t>> kExpected{
    {"ProximityDistinct", {0x06c8247d4b6f4146u, 0xd660ee6c3b7737fbu, 0x28518f6f825ead01u}},
    {"ProximityAll", {0x196380ccbb16a948u, 0x291a6629bf849511u, 0xa227e0c80aea4f7fu}},
    {"Intersection", {0x6bab33c99d13aeadu, 0x554013af07dd42c8u, 0x65448dabfe64962eu}},
    {"Continuous", {0x45c89b21dd5519edu, 0x0c8210784d8af5a5u, 0x64e2e1819e872c01u}},
    {"ContinuousWithThickness", {0x1b35f8e052d2d1dbu, 0x6e67e63b6b8b0344u, 0xb8e7905aaa07d5c5u}},
    {"ContinuousEarliest", {0xb05355e5d6a61913u, 0x0c8210784d8af5a5u, 0xfc3177c3d8cabcd6u}},
};

TEST_P(Determinism, HashesMatchTheStoredOnes) {
  const std::vector<std::uint64_t> found = hashes(settingsOf(Engine::Octree, 2), settings());
  std::printf("%s: hashes", GetParam().name.c_str());
  for (const std::uint64_t hash : found)
    std::printf(" 0x%016llxu", static_cast<unsigned long long>(hash));
  std::printf("\n");
  EXPECT_EQ(found, kExpected.at(GetParam().name));
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, Determinism, ::testing::ValuesIn(methodCases(1.0)),
                         [](const auto& method) { return method.param.name; });

}  // namespace
}  // namespace palpate
