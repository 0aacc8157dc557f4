#include "Common/History.h"
#include "Common/Sanitized.h"

#include <gtest/gtest-spi.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <iostream>
#include <optional>
#include <set>
#include <sstream>
#include <string>

// Random histories against a model that keeps only the last values: see Common/History.h.

namespace palpate::testing {
namespace {

struct HistoryFailure {
  int frame = 0, line = 0;
  std::size_t decisions = 0;  ///< until it was noticed
  std::string error{};        ///< the type of an exception
  std::string message{};
};

/// What stands before and after the calls of a history in a program that shows its answers by both
/// engines.
constexpr const char *kBeforeCalls = R"(#include <palpate/DistanceField.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/StepGuard.h>
#include <cstdio>
using namespace palpate;
using Positions = std::vector<Eigen::Vector3d>;
using Triangles = std::vector<Triangle>;
using Tetrahedra = std::vector<Tetrahedron>;
using Segments = std::vector<Segment>;
using Radii = std::vector<double>;
using Ids = std::vector<std::uint32_t>;
using Sides = std::vector<Crossing>;
Pose poseOf(std::array<double, 9> r, Eigen::Vector3d t) {
  Pose pose{{}, t};
  for (int i = 0; i < 9; ++i) pose.rotation(i / 3, i % 3) = r[i];
  return pose;
}
void attempt(auto&& f) {
  try {
    f();
  } catch (const Error& error) {
    std::printf("refused: %s\n", error.what());
  }
}
ContactPredicate predicateOf(int number) {
  if (number == 0) return {};
  return [=](const ContactFeatures& f) {
    const std::uint32_t hash = f.a[0] * 2654435761u ^ f.b[0] * 40503u ^ f.a[1] ^ f.b[1] * 7u ^
                               static_cast<std::uint32_t>(f.kind) ^ f.tagA * 5u ^ f.tagB * 3u;
    return hash % 5 != static_cast<std::uint32_t>(number);
  };
}
void hold(OctreeBasedCD& c, GeometryId fixed, const Ids& vertices,
          const std::vector<GuardedVertex>& group) {
  StepGuard guard(c);
  guard.setFixedVertices(fixed, vertices);
  if (!group.empty()) guard.addRigidGroup(group);
  guard.hold();
}
void show(OctreeBasedCD& c) {
  for (const CollisionPair& p : c.pairs()) {
    const CollisionData& d = c.collisionData(p.a, p.b);
    std::printf("(%u, %u): hash %016llx, %zu + %zu + %zu + %zu contacts, %zu crossings, %zu sides\n",
                static_cast<unsigned>(p.a), static_cast<unsigned>(p.b),
                static_cast<unsigned long long>(d.hash()), d.vertexTriangle().size(),
                d.triangleVertex().size(), d.edgeEdge().size(), d.shape().size(),
                d.crossings().size(), d.rememberedSides().size());
  }
}
void history(OctreeBasedCD& c) {
)",
                     *kAfterCalls = R"(}
int main() {
  for (const Engine engine : {Engine::Octree, Engine::BruteForce}) {
    std::printf("%s\n", toString(engine));
    OctreeBasedCD c(Settings{.engine = engine, .threads = 1});
    history(c);
  }
}
)";

/// A history from its beginning, of which decisions are left out.
struct HistoryRun {
  std::uint64_t seed;
  BodySize size;
  int frames;
  std::set<std::size_t> leftOut{};

  /// The first failure. calls: where the calls are written; or null.
  std::optional<HistoryFailure> fail(std::ostream* calls = nullptr,
                                     FeaturePairsTable* table = nullptr,
                                     std::size_t* contacts = nullptr) const {
    ::testing::TestPartResultArray results;
    ::testing::ScopedFakeTestPartResultReporter reporter(
        ::testing::ScopedFakeTestPartResultReporter::INTERCEPT_ONLY_CURRENT_THREAD, &results);
    RandomHistory history(seed, size);
    history.leaveOut(leftOut);
    history.writeTo(calls);
    for (int frame = 0; frame < frames; ++frame) {
      try {
        history.frame();
      } catch (const std::exception& error) {
        return HistoryFailure{frame, 0, history.decisions(), error.what(),
                              history.description() + "\nexception: " + error.what()};
      }
      if (results.size() > 0) {
        const ::testing::TestPartResult& first = results.GetTestPartResult(0);
        return HistoryFailure{frame,
                              first.line_number(),
                              history.decisions(),
                              {},
                              history.description() + '\n' + first.message()};
      }
      if (table) table->add(history.features());
    }
    if (contacts) *contacts += history.contacts();
    return {};
  }

  /// Leaves out decisions as long as the failure at this line remains.
  void minimise(HistoryFailure failure) {
    using Clock = std::chrono::steady_clock;
    const Clock::time_point end = Clock::now() + std::chrono::seconds(20);
    for (std::size_t part = failure.decisions / 2; part > 0; part /= 2)
      for (std::size_t begin = 0; begin < failure.decisions && Clock::now() < end; begin += part) {
        HistoryRun less = *this;
        const std::size_t before = less.leftOut.size();
        for (std::size_t i = begin; i < std::min(begin + part, failure.decisions); ++i)
          less.leftOut.insert(i);
        if (less.leftOut.size() == before) continue;
        const auto found = less.fail();
        if (!found || found->line != failure.line || found->error != failure.error) continue;
        frames = found->frame + 1;
        failure.decisions = found->decisions;
        leftOut = less.leftOut;
      }
  }
};

/// Contacts of the whole history. A failure is reported with the calls of the shortest history that
/// still has it.
std::size_t runHistory(HistoryRun run, FeaturePairsTable* table = nullptr) {
  std::size_t contacts = 0;
  const std::optional<HistoryFailure> failure = run.fail(nullptr, table, &contacts);
  if (!failure) return contacts;
  run.minimise(*failure);
  std::ostringstream calls;
  const std::optional<HistoryFailure> last = run.fail(&calls);
  ADD_FAILURE() << failure->message << "\nseed " << run.seed << ", frame " << failure->frame
                << ". These calls of " << run.frames << " frames fail in line " << failure->line
                << (last ? " with\n" + last->message : std::string(", but not again"))
                << "\nas a program:\n"
                << kBeforeCalls << calls.str() << kAfterCalls;
  return 0;
}

constexpr int kHistories = casesOf(20), kFrames = 60, kLargeHistories = casesOf(3),
              kLargeFrames = 40;

class History : public ::testing::TestWithParam<int> {};

TEST_P(History, ContactsDependOnTheLastValuesOnly) {
  EXPECT_GT(runHistory({static_cast<std::uint64_t>(GetParam()), BodySize::Small, kFrames}), 0u);
}

INSTANTIATE_TEST_SUITE_P(Seeds, History, ::testing::Range(0, kHistories));

class LargeHistory : public ::testing::TestWithParam<int> {};

TEST_P(LargeHistory, ContactsDependOnTheLastValuesOnly) {
  runHistory({static_cast<std::uint64_t>(GetParam()), BodySize::Large, kLargeFrames});
}

INSTANTIATE_TEST_SUITE_P(Seeds, LargeHistory, ::testing::Range(0, kLargeHistories));

int numberFrom(const char* variable, int otherwise) {
  const char* const text = std::getenv(variable);
  return text ? std::stoi(text) : otherwise;
}

/// PALPATE_HISTORIES more histories of 1,000 frames each; two of eight have large bodies and a
/// quarter of the frames. None unless it is set. Prints which features were never at work together.
TEST(LongHistory, ContactsDependOnTheLastValuesOnly) {
  const int histories = numberFrom("PALPATE_HISTORIES", 0),
            first = numberFrom("PALPATE_FIRST_HISTORY", 1000),
            frames = numberFrom("PALPATE_HISTORY_FRAMES", 1000);
  if (histories == 0) GTEST_SKIP() << "skipped: PALPATE_HISTORIES is not set";
  FeaturePairsTable table;
  std::size_t contacts = 0;
  for (int seed = first; seed < first + histories; ++seed) {
    const bool isLarge = seed % 8 == 0 || seed % 8 == 3;
    contacts +=
        runHistory({static_cast<std::uint64_t>(seed), isLarge ? BodySize::Large : BodySize::Small,
                    isLarge ? frames / 4 : frames},
                   &table);
  }
  EXPECT_GT(contacts, 0u);
  table.print(std::cout);
}

}  // namespace
}  // namespace palpate::testing
