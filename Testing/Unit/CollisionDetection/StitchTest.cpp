// The stitch of the scene Suturing, tied and untied over many steps, while faults happen to it.

#include "Common/RandomMeshes.h"
#include "Common/Sanitized.h"
#include "Common/ThreadTruth.h"

#include <Stitch.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/ThreadTopology.h>

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

namespace palpate::testing {
namespace {

using Eigen::Vector3d;
using Cause = ThreadEvent::Cause;
using Positions = std::vector<Vector3d>;

/// PALPATE_STITCH_STEPS: number of steps; 100,000 take some minutes.
int stitchSteps() {
  const char* const steps = std::getenv("PALPATE_STITCH_STEPS");
  return steps ? std::atoi(steps) : 1000 / kShareOfCases;
}

/// The thread, whose ends further vertices join far from the stitch, and the rims of two holes.
struct Sewing {
  OctreeBasedCD collisions;
  Positions thread, rims;
  GeometryId threadId, rimsId;
  ThreadTopology topology{collisions};
  struct Watched {
    GeometryId loopGeometry;
    std::vector<std::uint32_t> path, loop;
    bool areParts;
    int count;
  };
  std::vector<Watched> watches;

  static Positions closed(Positions open) {
    for (const Vector3d& p : {Vector3d(12, 1, 12), Vector3d(0, 9, 14), Vector3d(-9, 1, 9)})
      open.push_back(p);
    return open;
  }
  explicit Sewing(const Positions& start) : thread(start) {
    for (const Vector3d& hole : scenes::kStitchHoles)
      for (const auto& [x, y] : {std::pair{-0.3, -0.3}, {0.3, -0.3}, {0.3, 0.3}, {-0.3, 0.3}})
        rims.push_back(hole + Vector3d(x, y, 0));
    const auto size = static_cast<std::uint32_t>(thread.size());
    std::vector<Segment> segments{{size - 1, 0}};
    for (std::uint32_t v = 0; v + 1 < size; ++v) segments.push_back({v, v + 1});
    threadId = collisions.addLineMesh(thread, segments, 0.05);
    rimsId = collisions.addLineMesh(
        rims, std::vector<Segment>{{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6}, {6, 7}, {7, 4}},
        0.01);
    watch();
    collisions.advance();
  }
  /// Watches all from the present step on.
  void watch() {
    topology = ThreadTopology(collisions);
    watches.clear();
    const auto whole = scenes::stitchPart(0, scenes::kStitchVertices - 1);
    auto round = scenes::stitchPart(0, static_cast<std::uint32_t>(thread.size() - 1));
    round.push_back(0);
    for (const std::uint32_t first : {0u, 4u})
      for (const auto& path : {whole, round})
        watches.push_back({rimsId, path, scenes::stitchPart(first, first + 3), false, 0});
    watches.push_back({threadId, scenes::knotEnd(), scenes::knotLoop(), false, 0});
    watches.push_back({threadId, scenes::knotEnd(), scenes::stitchPart(73, 213), true, 0});
    for (std::size_t i = 0; i < watches.size(); ++i) {
      Watched& w = watches[i];
      EXPECT_EQ(w.areParts ? topology.addParts({threadId, w.path}, {w.loopGeometry, w.loop})
                           : topology.add({threadId, w.path}, {w.loopGeometry, w.loop}),
                i);
      w.count = topology.count(i);
    }
  }
};

TEST(Stitch, EachPassageIsReportedInItsStepWithItsElements) {
  Random random(1);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  Sewing all(Sewing::closed(scenes::stitchAt(0)));
  const Positions rimsAtRest = all.rims;
  std::map<std::string, std::size_t> found;
  double time = 0, speed = 0.02;
  Vector3d torn = Vector3d::Zero();  // the knot's end is away from its place by this
  std::uint64_t advanced = 1;
  const int steps = stitchSteps();
  for (int step = 0; step < steps; ++step) {
    SCOPED_TRACE("step " + std::to_string(step));
    // The story goes on, or back after the knot was tied, and by a fault the end slips out at once.
    time += uniform(0.2, 1.8) * speed;
    const std::uint64_t fault = random() % 40;
    if (fault == 0) time -= uniform(0.1, 0.4);
    if (time > 1.1) speed = -0.03;
    if (time < -0.05) speed = 0.02;
    if (fault == 1) torn = randomPoint(random, -1.5, 1.5);
    if (torn != Vector3d::Zero() && random() % 8 == 0) torn.setZero();
    Positions thread = Sewing::closed(scenes::stitchAt(time)), rims = all.rims;
    for (const std::uint32_t v : scenes::knotEnd()) thread[v] += torn;
    for (Vector3d& p : thread) p += randomPoint(random, -0.005, 0.005);
    if (fault == 2)  // the thread cuts through tissue: a hole leaves it
      for (Vector3d& p : rims) p += Vector3d{uniform(-1, 1), uniform(-1, 1), 0};
    const bool isTorn = fault == 3;
    const std::uint32_t element = static_cast<std::uint32_t>(random() % thread.size());

    all.topology.clear();
    all.collisions.setPositions(all.threadId, thread);
    all.collisions.setPositions(all.rimsId, rims);
    if (isTorn) all.collisions.setDisabledElements(all.threadId, std::array{element});
    all.topology.update();
    const std::span<const ThreadEvent> events = all.topology.events();
    for (std::size_t i = 0; i < all.watches.size(); ++i) {
      Sewing::Watched& w = all.watches[i];
      // Element 0 joins the last vertex and the first one, element v > 0 joins v - 1 and v.
      const std::uint32_t size = static_cast<std::uint32_t>(thread.size());
      const std::array ends{element == 0 ? size - 1 : element - 1, element};
      const auto loses = [&](const std::vector<std::uint32_t>& path, bool isClosed) {
        for (std::size_t k = 0; k + (isClosed ? 0 : 1) < path.size(); ++k)
          if (const std::array edge{path[k], path[(k + 1) % path.size()]};
              std::is_permutation(ends.begin(), ends.end(), edge.begin()))
            return true;
        return false;
      };
      const bool isLost =
          isTorn &&
          (loses(w.path, false) || (w.loopGeometry == all.threadId && loses(w.loop, !w.areParts)));
      ASSERT_EQ(all.topology.isLost(i), isLost) << i;
      if (isLost) {
        std::size_t reports = 0;
        for (const ThreadEvent& e : events) {
          if (e.index != i) continue;
          ++reports;
          ASSERT_EQ(e.cause, Cause::Disabled);
        }
        ASSERT_EQ(reports, 1u) << i;
        ASSERT_EQ(all.topology.count(i), 0);
        ++found["disabled"];
        continue;
      }
      const PathStep path{w.path, all.thread, thread};
      const PathStep loop = w.areParts || w.loopGeometry == all.threadId
                                ? PathStep{w.loop, all.thread, thread}
                                : PathStep{w.loop, all.rims, rims};
      const auto truth = passageTruth(path, loop, w.areParts);
      ASSERT_EQ(passageRows(events, i), truth) << i;
      for (const PassageRow& row : truth) {
        w.count += std::get<3>(row);
        ++found[std::string(w.areParts ? "parts"
                            : i == 4   ? "knot"
                                       : "hole") +
                (std::get<0>(row) ? " by its end" : " by its side")];
      }
      ASSERT_EQ(all.topology.count(i), w.count) << i;
      if (w.path.front() != w.path.back()) continue;
      Positions rim;
      for (const std::uint32_t v : w.loop) rim.push_back(rims[v]);
      ASSERT_NEAR(w.count, linkingIntegral(thread, rim), 1e-6) << i;
    }
    for (const ThreadEvent& e : events) ASSERT_EQ(e.step, advanced);
    if (time >= 1 && torn == Vector3d::Zero() && !all.topology.isLost(4)) {
      ASSERT_EQ(all.topology.count(4), 1);
      ++found["tied"];
    }
    all.collisions.advance();
    ++advanced;
    all.thread = thread, all.rims = rims;
    if (isTorn) {
      all.collisions.setDisabledElements(all.threadId, {});
      all.watch();
    }
    if (fault == 2) {  // the tissue comes back
      all.rims = rimsAtRest;
      all.collisions.setPositions(all.rimsId, all.rims);
      all.collisions.advance();
      ++advanced;
      all.watch();
    }
  }
  for (const auto& [kind, count] : found) std::printf("%s: %zu\n", kind.c_str(), count);
  for (const char* kind : {"disabled", "tied", "hole by its end", "hole by its side",
                           "knot by its end", "knot by its side", "parts by its side"})
    EXPECT_GE(found[kind], leastOf(5)) << kind;
}

}  // namespace
}  // namespace palpate::testing
