#include "Common/PairRun.h"
#include "Common/Zoo.h"
#include "Unit/Math/TrianglePairs.h"

#include <palpate/Distance.h>
#include <palpate/Intersection.h>
#include <palpate/TimeOfImpact.h>

#include <gtest/gtest.h>

#include <bit>
#include <cfenv>
#include <set>
#include <string>
#include <xmmintrin.h>

// A frame's answers do not depend on how the calling thread rounds, nor on whether it flushes
// denormals to zero, as audio and graphics code often asks for; and it is left as it was.

namespace palpate {
namespace {

using namespace testing;

constexpr unsigned kFlushToZero = 0x8000, kDenormalsAreZero = 0x0040;

struct Mode {
  const char* name;
  int rounding;
  unsigned flags;
};

/// Answers of one frame, in a mode that is set before everything.
std::vector<Rows> answers(const Specimen& specimen, const PairSettings& settings, int threads,
                          const Mode& mode) {
  const std::vector<Eigen::Vector3d> aBefore = specimen.aBefore(), bBefore = specimen.bBefore();
  const unsigned before = _mm_getcsr();
  std::fesetround(mode.rounding);
  _mm_setcsr(_mm_getcsr() | mode.flags);
  const unsigned set = _mm_getcsr() & ~0x3fu;  // without the flags of what happened
  std::vector<Rows> rows;
  {
    PairRun run(settingsOf(Engine::Octree, threads), specimen.a, specimen.b, settings);
    run.detection().setPositions(run.a(), aBefore, specimen.a.positions);
    run.detection().setPositions(run.b(), bBefore, specimen.b.positions);
    run.detection().detectCollision();
    EXPECT_EQ(_mm_getcsr() & ~0x3fu, set);
    rows = run.answers();
  }
  std::fesetround(FE_TONEAREST);
  _mm_setcsr(before);
  return rows;
}

class FloatingPoint : public ::testing::TestWithParam<MethodCase> {};

TEST_P(FloatingPoint, OfTheCallerChangesNoBit) {
  const std::set<std::string> names{"denormal coordinates",   "among the smallest normals",
                                    "beyond float's range",   "slivers of 1e-12",
                                    "vertex exactly on face", "one vertex far away"};
  std::size_t seen = 0;
  for (const Specimen& specimen : zoo()) {
    if (!names.contains(specimen.name)) continue;
    SCOPED_TRACE(specimen.name);
    ++seen;
    PairSettings settings = GetParam().settings;
    settings.thickness *= specimen.thickness;
    const std::vector<Rows> truth = answers(specimen, settings, 1, {"standard", FE_TONEAREST, 0});
    // A thickness that is denormal would be refused as zero where denormals are.
    const bool denormal = settings.thickness < 0x1p-1022;
    const unsigned both = kFlushToZero | (denormal ? 0 : kDenormalsAreZero);
    for (const Mode& mode : {Mode{"upward", FE_UPWARD, 0}, Mode{"flushing", FE_TONEAREST, both},
                             Mode{"flushing and downward", FE_DOWNWARD, both}}) {
      SCOPED_TRACE(mode.name);
      expectSame(answers(specimen, settings, 2, mode), truth);
    }
  }
  EXPECT_EQ(seen, names.size());
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, FloatingPoint, ::testing::ValuesIn(methodCases(1.0)),
                         [](const auto& method) { return method.param.name; });

/// Bits of what the functions of single features answer, in a mode.
std::vector<std::uint64_t> featureAnswers(const test::CornersPair& pair, const Mode& mode) {
  const auto& [a, b] = pair;
  const unsigned before = _mm_getcsr();
  std::fesetround(mode.rounding);
  _mm_setcsr(_mm_getcsr() | mode.flags);
  const unsigned set = _mm_getcsr() & ~0x3fu;
  const auto vertex = vertexTriangleDistance(a[0], b[0], b[1], b[2]);
  const auto edges = edgeEdgeDistance(a[0], a[1], b[0], b[1]);
  const bool intersect = trianglesIntersect(a[0], a[1], a[2], b[0], b[1], b[2]);
  const auto vertexTime =
      vertexTriangleTimeOfImpact(a[0], b[0], b[1], b[2], a[1], b[1], b[2], b[0]);
  const auto edgeTime = edgeEdgeTimeOfImpact(a[0], a[1], b[0], b[1], a[1], a[2], b[2], b[1]);
  EXPECT_EQ(_mm_getcsr() & ~0x3fu, set);
  std::fesetround(FE_TONEAREST);
  _mm_setcsr(before);
  std::vector<std::uint64_t> bits{intersect, static_cast<std::uint64_t>(vertex.feature),
                                  static_cast<std::uint64_t>(edges.featureA),
                                  static_cast<std::uint64_t>(edges.featureB)};
  for (const Eigen::Vector3d& v :
       {vertex.barycentric, vertex.difference, vertex.normal, edges.difference, edges.normal})
    for (const double x : v) bits.push_back(std::bit_cast<std::uint64_t>(x));
  for (const double x : {vertex.distance, edges.distance, edges.weightA, edges.weightB,
                         vertexTime.value_or(2.0), edgeTime.value_or(2.0)})
    bits.push_back(std::bit_cast<std::uint64_t>(x));
  return bits;
}

TEST(FloatingPointOfSingleFeatures, ChangesNoBit) {
  test::Random random(1);
  constexpr unsigned kBoth = kFlushToZero | kDenormalsAreZero;
  for (int repeat = 0; repeat < 3200; ++repeat) {
    const auto kind = static_cast<test::Kind>(repeat % static_cast<int>(test::Kind::Count));
    const test::CornersPair pair = test::makePair(kind, random);
    const auto truth = featureAnswers(pair, {"standard", FE_TONEAREST, 0});
    for (const Mode& mode : {Mode{"upward", FE_UPWARD, 0}, Mode{"flushing", FE_TONEAREST, kBoth},
                             Mode{"flushing and downward", FE_DOWNWARD, kBoth}})
      ASSERT_EQ(featureAnswers(pair, mode), truth) << repeat << ' ' << mode.name;
  }
}

}  // namespace
}  // namespace palpate
