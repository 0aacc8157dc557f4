#include "RunReport.h"

#include "ContactPoints.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <set>
#include <string>

// What a page has to draw, read back from its text.

namespace palpate::scenes {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::json;

constexpr std::uint32_t kSteps = 92 * 92 - 1;

Json replayOf(const std::string& page) {
  const std::string start = "id=\"data\">";
  const std::size_t first = page.find(start) + start.size();
  return Json::parse(page.substr(first, page.find("</script>", first) - first)).at("replay");
}

std::vector<std::uint32_t> numbersOf(const Json& replay, const Json& block) {
  const std::string text = replay["blocks"][block.get<std::size_t>()];
  const auto digit = [&](std::size_t at) {
    const char c = text[at];
    return static_cast<std::uint32_t>(c - 32 - (c > '"') - (c > '<') - (c > '\\'));
  };
  std::vector<std::uint32_t> numbers((text.size() - 1) / digit(0));
  for (std::size_t at = 1; at < text.size(); ++at) {
    std::uint32_t& number = numbers[(at - 1) / digit(0)];
    number = 92 * number + digit(at);
  }
  return numbers;
}

Vector3d inBox(const Json& box, const std::vector<std::uint32_t>& steps, std::size_t at) {
  Vector3d p;
  for (std::size_t i = 0; i < 3; ++i)
    p[i] = box[i].get<double>() + steps[at + i] * box[3 + i].get<double>() / kSteps;
  return p;
}

/// A finger of a mesh that sinks into a sheet with a thread on it.
class RunReportOfAWorld : public ::testing::Test {
 protected:
  RunReportOfAWorld() : world(1) {
    tool = world.addMesh("tool", sphere(10), 0);
    cloth = world.addMesh("</script>", sheet(12), 1);
    thread =
        world.addThread("thread", std::vector<Vector3d>{{-2, 0, 0}, {0, 0, 2}, {3, 1, 0}}, 0.1, 1);
    world.addPair(tool, cloth, {.method = Method::Proximity, .thickness = 0.2}, 0.2);
  }
  void step(double height) {
    world.predict(1, Vector3d::Zero(), 0);
    const SceneMesh rest = sphere(10);
    for (std::size_t i = 0; i < rest.positions.size(); ++i)
      world.positions(tool)[i] = rest.positions[i] + height * Vector3d::UnitZ();
    world.detect();
    world.commit();
  }
  static std::string pageOf(const RunReport& report, std::size_t frames) {
    return report.html({"title", {}, "mm", 0, "first"},
                       std::vector<Series>{{"frame ms", std::vector<double>(frames, 1.0)}});
  }

  World world;
  World::BodyId tool, cloth, thread;
};

TEST_F(RunReportOfAWorld, PositionsContactsAndCellsAreThoseOfTheFrames) {
  RunReport made(world, {}, {});
  std::vector<std::vector<ContactPoint>> contacts;
  std::vector<std::vector<Vector3d>> positions;
  for (int frame = 0; frame < 3; ++frame) {
    step(1.3 - 0.1 * frame);
    made.add(world, frame, {});
    contacts.push_back(contactPoints(world));
    const auto now = world.positions(tool);
    positions.emplace_back(now.begin(), now.end());
  }
  EXPECT_TRUE(contacts[0].empty());
  EXPECT_GT(contacts[2].size(), 5u);
  const Json replay = replayOf(pageOf(made, 3));
  ASSERT_EQ(replay["frames"].size(), 3u);
  EXPECT_EQ(replay["bodies"][cloth]["name"], "</script>");
  EXPECT_EQ(replay["bodies"][thread]["shape"], "lines");
  EXPECT_EQ(numbersOf(replay, replay["bodies"][thread]["elements"]),
            (std::vector<std::uint32_t>{0, 1, 1, 2}));
  for (std::size_t frame = 0; frame < 3; ++frame) {
    const Json &held = replay["frames"][frame], &body = held["bodies"][tool];
    const auto steps = numbersOf(replay, body["block"]);
    ASSERT_EQ(steps.size(), 3 * positions[frame].size());
    for (std::size_t i = 0; i < positions[frame].size(); ++i)
      EXPECT_LT((inBox(body["box"], steps, 3 * i) - positions[frame][i]).norm(), 2.0 / kSteps);
    const auto numbers = numbersOf(replay, held["contacts"]["numbers"]),
               ids = numbersOf(replay, held["contacts"]["ids"]);
    ASSERT_EQ(numbers.size(), 13 * contacts[frame].size());
    EXPECT_EQ(held["pairs"][0]["count"], contacts[frame].size());
    EXPECT_EQ(held["pairs"][0]["method"], "Proximity");
    for (std::size_t i = 0; i < contacts[frame].size(); ++i) {
      const ContactPoint& expected = contacts[frame][i];
      EXPECT_LT((inBox(held["contacts"]["box"], numbers, 13 * i) - expected.at).norm(), 1e-3);
      EXPECT_EQ(numbers[13 * i + 6], static_cast<std::uint32_t>(expected.kind));
      EXPECT_NEAR(numbers[13 * i + 9], kSteps * expected.weights[0], 1);
      const double share = (numbers[13 * i + 11] + numbers[13 * i + 12] / double(kSteps)) / kSteps,
                   least = held["contacts"]["least"], most = held["contacts"]["most"];
      EXPECT_NEAR(least + share * (most - least), expected.distance, 1e-6);
      EXPECT_TRUE(std::equal(expected.ids.begin(), expected.ids.end(), ids.begin() + 4 * i));
    }
    // Each cell of the octree is its place among the cells of its depth.
    for (const Json& part : held["cells"]) {
      const GeometryId id = world.bodies()[part["body"].get<std::size_t>()].id;
      const std::vector<LooseOctree::Node> nodes = world.detection().octree().nodes(id);
      if (frame == 2) {
        EXPECT_NEAR(part["size"].get<double>(), nodes[0].bounds.sizes().x(), 1e-6);
      }
      const auto cells = numbersOf(replay, part["block"]);
      EXPECT_GT(cells.size(), 0u);
      for (std::size_t i = 0; i < cells.size(); ++i) {
        EXPECT_LT(cells[i], i % 4 == 3 ? 20u : 1u << cells[i / 4 * 4 + 3]);
      }
    }
  }
  EXPECT_EQ(replay["frames"][0]["bodies"][thread]["block"],
            replay["frames"][2]["bodies"][thread]["block"]);  // at rest: stored once
}

TEST_F(RunReportOfAWorld, LongRunsHoldTheWorstFramesAndOthersAtEqualDistances) {
  World large(1);
  const World::BodyId body = large.addMesh("ball", sphere(50), 1);  // 25,002 vertices, 150 KB
  RunReport made(large, {}, {});
  constexpr int kFrames = 120, kWorst = 77;
  for (int frame = 0; frame < kFrames; ++frame) {
    for (Vector3d& p : large.positions(body)) p *= 1 + 1e-3 * std::sin(100 * p.x() + frame);
    large.detectOnly();
    made.add(large, frame, {std::min(frame, kWorst)});
  }
  const std::string page = pageOf(made, kFrames);
  EXPECT_LT(page.size(), 8'000'000u);
  EXPECT_GT(page.size(), 3'000'000u);
  std::set<int> held;
  const Json replay = replayOf(page);
  for (const Json& frame : replay["frames"]) held.insert(frame["at"].get<int>());
  EXPECT_TRUE(held.contains(kWorst));
  held.erase(kWorst);
  ASSERT_GT(held.size(), 10u);
  const int stride = *std::next(held.begin());
  EXPECT_EQ(held.size(), static_cast<std::size_t>((kFrames - 1) / stride + 1));
  for (const int frame : held) EXPECT_EQ(frame % stride, 0);
}

TEST_F(RunReportOfAWorld, LargeMeshesAndCloudsAreSimplified) {
  World large(1);
  large.addRigidMesh("bone", sphere(120));
  large.addPoints("cloud", std::vector<Vector3d>(25'000, Vector3d::Zero()), 0.1, 1);
  RunReport made(large, {}, {});
  made.add(large, 0, {});
  const Json replay = replayOf(pageOf(made, 1));
  const auto elements = numbersOf(replay, replay["bodies"][0]["elements"]);
  EXPECT_LE(elements.size(), 3 * 60'000u);
  EXPECT_GT(elements.size(), 3 * 20'000u);
  const auto steps = numbersOf(replay, replay["frames"][0]["bodies"][0]["block"]);
  for (const std::uint32_t vertex : elements) EXPECT_LT(3 * vertex, steps.size());
  EXPECT_EQ(numbersOf(replay, replay["frames"][0]["bodies"][1]["block"]).size(), 3 * 8334u);
  EXPECT_EQ(replay["notes"].size(), 2u);
  EXPECT_FALSE(replay["bodies"][0]["ids"].get<bool>());
}

}  // namespace
}  // namespace palpate::scenes
