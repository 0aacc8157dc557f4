// Settings::traceFrames and OctreeBasedCD::writeTrace(). Testing/Python reads a trace as JSON.
#include <palpate/Error.h>
#include <palpate/OctreeBasedCD.h>

#include "Common/ExpectRefused.h"
#include "Common/FailingAllocation.h"
#include "Common/RandomMeshes.h"
#include "Common/TemporaryFolder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace palpate::testing {
namespace {

namespace fs = std::filesystem;

struct Event {
  std::string name;
  unsigned thread = 0, frame = 0;
  long long begin = 0, end = 0;  ///< ns
};

/// The events of a trace, which has one in each line between the first and the last.
std::vector<Event> eventsOf(const fs::path& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  EXPECT_GE(lines.size(), 2u);
  EXPECT_EQ(lines.front(), R"({"displayTimeUnit":"ms","traceEvents":[)");
  EXPECT_EQ(lines.back(), "]}");
  std::vector<Event> events;
  for (std::size_t i = 1; i + 1 < lines.size(); ++i) {
    Event event;
    char name[40];
    long long micro = 0, nano = 0, lasts = 0, rest = 0;
    const int read = std::sscanf(
        lines[i].c_str(),
        R"({"ph":"X","pid":0,"tid":%u,"ts":%lld.%3lld,"dur":%lld.%3lld,"name":"%39[^"]","args":{"frame":%u)",
        &event.thread, &micro, &nano, &lasts, &rest, name, &event.frame);
    EXPECT_EQ(read, 7) << lines[i];
    EXPECT_EQ(lines[i].substr(lines[i].find_last_not_of(',') - 1, 2), "}}") << lines[i];
    event.name = name;
    event.begin = 1000 * micro + nano;
    event.end = event.begin + 1000 * lasts + rest;
    events.push_back(event);
  }
  return events;
}

struct Balls {
  std::uint32_t rings = 40;  ///< enough for jobs of several threads
  Mesh first = sphere(rings, 60, {0, 0, 0}, 1.0), second = sphere(rings, 60, {1.99, 0, 0}, 1.0);
  std::vector<std::vector<Eigen::Vector3d>> frames{3, second.positions};
  OctreeBasedCD collisions;
  GeometryId a, b;

  explicit Balls(const Settings& settings)
      : rings(settings.engine == Engine::Octree ? 40 : 4), collisions(settings) {
    a = collisions.addTriangleMesh(first.positions, first.triangles);
    b = collisions.addTriangleMesh(second.positions, second.triangles);
    collisions.addCollisionPair(a, b, {.thickness = 0.05});
    for (std::size_t i = 0; i < frames.size(); ++i)
      for (Eigen::Vector3d& p : frames[i]) p.x() -= 0.001 * static_cast<double>(i);
  }
  /// Returns the hash of the answer.
  std::uint64_t step(std::size_t number) {
    collisions.setPositions(b, frames[number % frames.size()]);
    collisions.detectCollision();
    const std::uint64_t hash = collisions.collisionData(a, b).hash();
    collisions.advance();
    return hash;
  }
};

class TraceFile : public ::testing::Test {
 protected:
  const TemporaryFolder m_folder;
  const fs::path m_file = m_folder.path / "frames.json";
};

TEST_F(TraceFile, HasTheLastFramesWithNestedEvents) {
  for (const Engine engine : {Engine::Octree, Engine::BruteForce})
    for (const int threads : {1, 3}) {
      Balls balls({.engine = engine, .threads = threads, .traceFrames = 4});
      for (std::size_t i = 0; i < 6; ++i) balls.step(i);
      balls.collisions.writeTrace(m_file);
      const std::vector<Event> events = eventsOf(m_file);
      std::map<unsigned, std::set<std::string>> names;
      std::map<unsigned, std::vector<Event>> byThread;
      for (const Event& event : events) {
        names[event.frame].insert(event.name);
        byThread[event.thread].push_back(event);
        EXPECT_GE(event.end, event.begin);
        EXPECT_GE(event.begin, 0);
      }
      ASSERT_EQ(names.size(), 4u);
      EXPECT_EQ(names.begin()->first, 3u);
      EXPECT_EQ(names.rbegin()->first, 6u);
      const std::set<std::string> expected{"detectCollision", "update", "octree", "audit",
                                           "start",           "round",  "job",    "join"};
      for (const auto& [frame, found] : names) EXPECT_EQ(found, expected) << frame;
      EXPECT_LE(byThread.size(), static_cast<std::size_t>(threads));
      for (auto& [thread, own] : byThread) {
        std::sort(own.begin(), own.end(), [](const Event& l, const Event& r) {
          return l.begin != r.begin ? l.begin < r.begin : l.end > r.end;
        });
        std::vector<long long> open;
        for (const Event& event : own) {
          while (!open.empty() && open.back() <= event.begin) open.pop_back();
          if (!open.empty()) {
            EXPECT_LE(event.end, open.back()) << event.name;
          }
          open.push_back(event.end);
        }
      }
      // The thread that calls has the frames themselves.
      const auto outer = std::count_if(events.begin(), events.end(), [](const Event& event) {
        return event.name == "detectCollision";
      });
      EXPECT_EQ(outer, 4);
    }
}

TEST_F(TraceFile, ChangesNoResultAndKeepsSteadyFramesFreeOfAllocations) {
  Balls traced({.threads = 2, .traceFrames = 3}), untraced({.threads = 2});
  for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(traced.step(i), untraced.step(i));
#ifndef PALPATE_VALIDATE  // validation itself allocates
  FailingAllocation::arm(0);
  for (std::size_t i = 0; i < 3; ++i) traced.step(i);
  FailingAllocation::disarm();
  EXPECT_EQ(FailingAllocation::count(), 0u);
#endif
}

TEST_F(TraceFile, RefusesWhatItCannotDo) {
  Balls untraced({});
  untraced.step(0);
  expectRefused(ErrorCode::NotAvailable, "Settings::traceFrames is 0",
                [&] { untraced.collisions.writeTrace(m_file); });
  EXPECT_FALSE(fs::exists(m_file));
  Balls traced({.traceFrames = 1});
  const fs::path missing = m_folder.path / "missing" / "frames.json";
  expectRefused(ErrorCode::File, missing.string().c_str(),
                [&] { traced.collisions.writeTrace(missing); });
  traced.collisions.writeTrace(m_file);  // before any frame
  EXPECT_TRUE(eventsOf(m_file).empty());
  for (const int frames : {-1, 10001})
    expectRefused(ErrorCode::InvalidSettings, "traceFrames is",
                  [&] { OctreeBasedCD(Settings{.traceFrames = frames}); });
}

}  // namespace
}  // namespace palpate::testing
