#include "Common/PairRun.h"
#include "Common/Zoo.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace palpate
