#include "Common/PairRun.h"
#include "Common/DegenerateCases.h"
#include "Common/FloatingPointMode.h"
#include "Common/TemporaryFolder.h"
#include "Unit/Math/TrianglePairs.h"

#include <palpate/ConstraintRows.h>
#include <palpate/FeaturePairs.h>
#include <palpate/Palpate.h>

#include <gtest/gtest.h>

#include <bit>
#include <cfenv>
#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <type_traits>
#include <utility>

// Results do not depend on the floating-point environment of the calling thread: rounding mode,
// flushing denormals to zero as audio and graphics code often does, trapping exceptions. The
// environment and its exception flags stay unchanged.

namespace palpate {
namespace {

using namespace testing;

constexpr std::uint64_t kBoth = kFlushResults | kFlushOperands;

struct Mode {
  const char* name;
  int rounding = FE_TONEAREST;
  std::uint64_t flags = 0;
  bool traps = false;
};

const Mode kStandard{"standard"};
const std::vector<Mode> kModes{{"trapping", FE_TONEAREST, 0, true},
                               {"flushing", FE_TONEAREST, kBoth},
                               {"upward", FE_UPWARD},
                               {"downward", FE_DOWNWARD},
                               {"toward zero", FE_TOWARDZERO},
                               {"flushing, downward", FE_DOWNWARD, kBoth},
                               {"trapping, upward", FE_UPWARD, 0, true},
                               {"all", FE_TOWARDZERO, kBoth, true}};

/// Sets the mode of this thread while the object exists.
class InMode {
 public:
  explicit InMode(const Mode& mode) {
    std::fegetenv(&m_before);
    std::feclearexcept(FE_ALL_EXCEPT);
    std::fesetround(mode.rounding);
    addFloatingPointMode(mode.flags);
    if (mode.traps) feenableexcept(FE_ALL_EXCEPT);
  }
  ~InMode() { std::fesetenv(&m_before); }
  InMode(const InMode&) = delete;
  InMode& operator=(const InMode&) = delete;

 private:
  std::fenv_t m_before;
};

/// Returns the results of a call, which must leave the environment and the exception flags
/// unchanged.
template <class F>
auto unchanged(F&& call) {
  const std::uint64_t before = floatingPointState();
  const auto result = call();
  EXPECT_EQ(floatingPointState(), before);
  return result;
}

/// Contacts of one frame, in a mode that is set before everything.
std::vector<Rows> answers(const DegenerateCase& input, const PairSettings& settings, int threads,
                          const Mode& mode) {
  const std::vector<Eigen::Vector3d> aBefore = input.aBefore(), bBefore = input.bBefore();
  const InMode inMode(mode);
  const std::uint64_t set = floatingPointState();
  PairRun run(settingsOf(Engine::Octree, threads), input.a, input.b, settings);
  run.detection().setPositions(run.a(), aBefore, input.a.positions);
  run.detection().setPositions(run.b(), bBefore, input.b.positions);
  run.detection().detectCollision();
  EXPECT_EQ(floatingPointState() & ~kRaisedExceptions, set & ~kRaisedExceptions);
  return run.answers();
}

using Bits = std::vector<std::uint64_t>;

template <class Value>
void appendBits(Bits& bits, const Value& value) {
  if constexpr (std::is_same_v<Value, double>)
    bits.push_back(std::bit_cast<std::uint64_t>(value));
  else if constexpr (std::is_same_v<Value, Eigen::Vector3d>)
    for (const double x : value) appendBits(bits, x);
  else
    bits.push_back(static_cast<std::uint64_t>(value));
}

/// Bits of the results of the functions of single features, in a mode.
Bits featureAnswers(const test::CornersPair& pair, const Mode& mode) {
  const Corners &a = pair.first, &b = pair.second;
  const auto both = [&](const TimeOfImpactSettings& settings) {
    const auto vertex = unchanged([&] {
      return vertexTriangleTimeOfImpact(a[0], b[0], b[1], b[2], a[1], b[1], b[2], b[0], settings);
    });
    const auto edges = unchanged([&] {
      return edgeEdgeTimeOfImpact(a[0], a[1], b[0], b[1], a[1], a[2], b[2], b[1], settings);
    });
    return std::pair{vertex, edges};
  };
  const InMode inMode(mode);
  const auto vertex = unchanged([&] { return vertexTriangleDistance(a[0], b[0], b[1], b[2]); });
  const auto edges = unchanged([&] { return edgeEdgeDistance(a[0], a[1], b[0], b[1]); });
  const bool intersect =
      unchanged([&] { return trianglesIntersect(a[0], a[1], a[2], b[0], b[1], b[2]); });
  const auto [vertexTime, edgeTime] = both({});
  const auto [vertexNear, edgeNear] = both({.minimumDistance = 0.125, .timeTolerance = 0x1p-10});
  const Stencil stencils[] = {
      stencil(VertexTriangleContact{0, 1, {2, 3, 4}, vertex.weights, vertex.normal, 0, 0}),
      unchanged([&] {
        return stencil(
            EdgeEdgeContact{{0, 1}, {2, 3}, edges.weightA, edges.weightB, edges.normal, 0, 0});
      })};
  Bits bits{intersect,
            static_cast<std::uint64_t>(vertex.feature),
            static_cast<std::uint64_t>(edges.featureA),
            static_cast<std::uint64_t>(edges.featureB),
            vertex.exact,
            edges.exact,
            edges.parallel};
  for (const Eigen::Vector3d& v :
       {vertex.weights, vertex.difference, vertex.normal, edges.difference, edges.normal})
    appendBits(bits, v);
  for (const double x : {vertex.distance, edges.distance, edges.weightA, edges.weightB})
    appendBits(bits, x);
  for (const auto& time : {vertexTime, edgeTime, vertexNear, edgeNear})
    appendBits(bits, time.value_or(2.0));
  for (const Stencil& each : stencils)
    for (const double weight : each.weights) appendBits(bits, weight);
  return bits;
}

TEST(FloatingPointInSingleFunctions, ModeOfTheCallerChangesNoBit) {
  test::Random random(1);
  for (int repeat = 0; repeat < 3200; ++repeat) {
    const auto kind = static_cast<test::Kind>(repeat % static_cast<int>(test::Kind::Count));
    const test::CornersPair pair = test::makePair(kind, random);
    const Bits truth = featureAnswers(pair, kStandard);
    for (const Mode& mode : kModes)
      ASSERT_EQ(featureAnswers(pair, mode), truth) << repeat << ' ' << mode.name;
  }
}

struct TripletOfBits {
  TripletOfBits(int r, int c, double v) : row(r), column(c), value(v) {}
  int row, column;
  double value;
};

/// The results of detectCollision() on two meshes and of the functions that make a solver's rows
/// from them.
Bits meshAnswers(const DegenerateCase& input, const PairSettings& settings, const Mode& mode) {
  const Mesh &a = input.a, &b = input.b;
  const std::vector<Eigen::Vector3d> aBefore = input.aBefore(), bBefore = input.bBefore();
  const auto first = static_cast<std::uint32_t>(a.positions.size());
  std::vector<Eigen::Vector3d> all = a.positions;
  all.insert(all.end(), b.positions.begin(), b.positions.end());
  const InMode inMode(mode);
  const CollisionData data = unchanged([&] {
    return detectCollision({a.positions, a.triangles}, {b.positions, b.triangles}, settings);
  });
  std::vector<ConstraintRow> rows;
  std::vector<TripletOfBits> triplets;
  const std::uint64_t before = floatingPointState();
  appendRows(data, {0, aBefore, a.positions}, {first, bBefore, b.positions}, rows);
  appendTriplets(std::span<const ConstraintRow>(rows), triplets);
  EXPECT_EQ(floatingPointState(), before);
  Bits bits{data.hash()};
  for (const ConstraintRow& row : rows) {
    appendBits(bits, row.normal);
    appendBits(bits, row.offset);
    appendBits(bits, unchanged([&] { return row.gap(all); }));
  }
  for (const TripletOfBits& triplet : triplets) {
    appendBits(bits, triplet.row);
    appendBits(bits, triplet.column);
    appendBits(bits, triplet.value);
  }
  return bits;
}

class FloatingPoint : public ::testing::TestWithParam<MethodCase> {};

/// Of objects with two threads, and of one call and its rows.
TEST_P(FloatingPoint, ModeOfTheCallerChangesNoBit) {
  const std::set<std::string> names{"denormal coordinates",   "among the smallest normals",
                                    "beyond float's range",   "slivers of 1e-12",
                                    "vertex exactly on face", "one vertex far away"};
  std::size_t seen = 0;
  for (const DegenerateCase& input : degenerateCases()) {
    if (!names.contains(input.name)) continue;
    SCOPED_TRACE(input.name);
    ++seen;
    PairSettings settings = GetParam().settings;
    settings.thickness *= input.thickness;
    const std::vector<Rows> truth = answers(input, settings, 1, kStandard);
    const bool hasOneCall = settings.method != Method::Continuous;
    const Bits truthOfCall = hasOneCall ? meshAnswers(input, settings, kStandard) : Bits{};
    // In a mode without denormals, a denormal thickness would be refused as zero.
    const bool denormal = settings.thickness < 0x1p-1022;
    for (Mode mode : kModes) {
      SCOPED_TRACE(mode.name);
      if (denormal) mode.flags &= kFlushResults;
      expectSame(answers(input, settings, 2, mode), truth);
      if (hasOneCall) {
        EXPECT_EQ(meshAnswers(input, settings, mode), truthOfCall);
      }
    }
  }
  EXPECT_EQ(seen, names.size());
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, FloatingPoint, ::testing::ValuesIn(methodCases(1.0)),
                         [](const auto& method) { return method.param.name; });

TEST(FloatingPointInCaptures, ModeOfTheCallerChangesNoByte) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path / "frame.capture";
  std::size_t number = 0;
  for (const DegenerateCase& input : degenerateCases()) {
    PairSettings settings;
    settings.method = Method::Continuous;
    if (input.large || isLeftOut(number++)) continue;
    SCOPED_TRACE(input.name);
    PairRun run({.threads = 1}, input.a, input.b, settings);
    run.step(input.aBefore(), input.a.positions, input.bBefore(), input.b.positions);
    capture(run.detection(), path);
    const std::string truth = contentOf(path);
    const std::uint64_t hash = run.data().hash();
    for (const Mode& mode : {kModes.front(), kModes.back()}) {
      SCOPED_TRACE(mode.name);
      std::filesystem::remove(path);
      const std::uint64_t found = [&] {
        const InMode inMode(mode);
        capture(run.detection(), path);
        OctreeBasedCD again = setUp(readCapture(path));
        writeCapture(again.problem(), path);
        again.detectCollision();
        return again.collisionData(again.pairs()[0].a, again.pairs()[0].b).hash();
      }();
      EXPECT_EQ(found, hash);
      EXPECT_EQ(contentOf(path), truth);
    }
  }
}

}  // namespace
}  // namespace palpate
