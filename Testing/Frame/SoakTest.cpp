// A day's session: geometries of every type and every method, with geometries that come and go.
#include "Common/PairRun.h"
#include "Common/WholeScene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iostream>
#include <numbers>
#include <string>
#include <unistd.h>
#include <utility>
#include <vector>

namespace palpate::testing {
namespace {

/// Frames after which the scene repeats, and frames of one block that is measured.
constexpr int kPeriod = 100, kBlock = kSanitized ? 200 : 1000;

int framesToRun() {
  const char* const frames = std::getenv("PALPATE_SOAK_FRAMES");
  return frames ? std::max(3 * kBlock, std::atoi(frames)) : 3 * kBlock;
}

double cpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double residentBytes() {
  std::ifstream file("/proc/self/statm");
  double size = 0, resident = 0;
  file >> size >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE));
}

double medianOf(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// The scene, with a needle that comes and goes, cuts of the sheet, and snapshots held for a while.
class Session {
 public:
  explicit Session(const Settings& settings) : m_scene(m_input, settings), m_cut(m_input.floor) {
    m_cut.triangles.resize(m_cut.triangles.size() / 2);
  }

  void frame(int number) {
    OctreeBasedCD& detection = m_scene.detection;
    const int phase = number % kPeriod;
    if (phase == 10) {
      m_needle = m_input.suture.addTo(detection);
      detection.addCollisionPair(m_needle, m_scene.organ, {Method::Auto, 0.02});
    }
    if (phase == 60) detection.removeGeometry(m_needle);
    if (phase == 30 || phase == 80) {
      const Mesh& sheet = phase == 30 ? m_cut : m_input.floor;
      detection.setTriangles(m_scene.floor, sheet.positions, sheet.triangles);
    }
    if (phase == 40 || phase == 90)
      detection.setDisabledElements(m_scene.organ, std::vector<std::uint32_t>(phase == 40, 3));
    m_scene.move(2 * std::numbers::pi * phase / kPeriod);
    detection.detectCollision();
    detection.publish(number);
    if (phase % 7 == 0) m_held = detection.latestSnapshot();
    m_scene.query(phase % 2 ? detection.queries() : m_held->queries());
    m_hash = m_hash * 31 + m_scene.hash();
    detection.advance();
  }
  /// Of the frames since the last call.
  std::uint64_t takeHash() { return std::exchange(m_hash, 0); }
  const OctreeBasedCD& detection() const { return m_scene.detection; }

 private:
  const WholeSceneInput m_input{10};
  WholeScene m_scene;
  Mesh m_cut;
  GeometryId m_needle{};
  std::shared_ptr<const Snapshot> m_held;
  std::uint64_t m_hash = 0;
};

/// After the first thousand frames memory does not grow, times do not drift, and equal frames have
/// equal results.
TEST(Soak, MemoryAndTimesStay) {
  Session session(settingsOf(Engine::Octree, 2));
  struct Block {
    std::size_t counted;
    double resident, seconds;
    std::uint64_t hash;
  };
  std::vector<Block> blocks;
  const int frames = framesToRun();
  double start = cpuSeconds();
  for (int number = 0; number < frames; ++number) {
    session.frame(number);
    if ((number + 1) % kBlock != 0) continue;
    blocks.push_back({session.detection().memoryUse().total, residentBytes(), cpuSeconds() - start,
                      session.takeHash()});
    start = cpuSeconds();
  }
  std::vector<double> first, last;
  for (std::size_t i = 1; i < blocks.size(); ++i)
    (i <= blocks.size() / 2 ? first : last).push_back(blocks[i].seconds);
  for (const std::size_t i : {std::size_t{1}, blocks.size() / 2, blocks.size() - 1})
    std::cout << "frame " << (i + 1) * kBlock << ": " << blocks[i].counted << " bytes counted, "
              << blocks[i].resident << " resident, " << blocks[i].seconds << " s of " << kBlock
              << '\n';
  for (std::size_t i = 2; i < blocks.size(); ++i) {
    SCOPED_TRACE("block " + std::to_string(i));
    EXPECT_EQ(blocks[i].hash, blocks[1].hash);
    // Which thread takes which scratch of a query is chance.
    EXPECT_LE(blocks[i].counted, blocks[0].counted + 100'000);
    // AddressSanitizer keeps freed memory.
    if (kShareOfCases == 1) {
      EXPECT_LE(blocks[i].resident, blocks[0].resident + 4e6);
    }
  }
  if (kShareOfCases > 1 || frames < 10 * kBlock) return;  // a short run shows no drift
  EXPECT_LE(medianOf(last), 1.25 * medianOf(first));
}

}  // namespace
}  // namespace palpate::testing
