// A haptic thread feels a deforming organ at 1 kHz through snapshots of a simulation at 60 Hz.
#include "CommandLine.h"
#include "Distribution.h"
#include "Scenes.h"
#include "VirtualTool.h"
#include "World.h"
#include "WriteFile.h"

#include <sched.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <thread>

namespace palpate::scenes {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Clock = std::chrono::steady_clock;

constexpr double kFrame = 1.0 / 60, kTick = 1e-3;  // s
/// s: how far the surface that is felt is behind the simulation's clock. A frame computes the state
/// at its end, so that its snapshot comes in time if it takes less than two frames.
constexpr double kDelay = kFrame;
constexpr double kOrganLength = 150;      // mm
constexpr double kLift = 30, kPress = 4;  // mm, of the device above and below the surface
/// Of jumps in one tick beyond what the tool's own motion explains. The surface moves at about 10
/// mm/s and is played at twice its speed at most, 0.02 mm in a tick. This changes the spring by 10
/// mN, and turns the blade about half its width of 4 mm by 5 mrad.
constexpr double kAllowedForce = 10, kAllowedTorque = 1;  // mN, N mm

/// A liver that breathes and that a probe presses from a side.
class Organ {
 public:
  Organ() : m_world(1) {
    m_mesh = liver(24);
    Eigen::AlignedBox3d box;
    for (const Vector3d& p : m_mesh.positions) box.extend(p);
    m_size = kOrganLength;
    const double scale = m_size / box.sizes().maxCoeff();
    const Vector3d foot(box.center().x(), box.center().y(), box.min().z());
    for (Vector3d& p : m_mesh.positions) p = scale * (p - foot);
    m_height = scale * box.sizes().z();
    m_organ = m_world.addMesh("Liver", m_mesh, static_cast<double>(m_mesh.positions.size()) / 1.5);
    m_world.pin(m_organ, [&](const Vector3d& p) { return p.z() < 0.25 * m_height; });
    m_world.addStiffness(m_organ, 0.02, 0.06);
    m_world.addVolume(m_organ, 0);
    const Capsule shape{{0, 0, 0}, {0, 0, 0.6 * m_size}, 0.05 * m_size};
    m_probe = m_world.addShape("Probe", shape, {});
    m_world.addPair(m_organ, m_probe,
                    {.method = Method::Proximity, .thickness = 0.5, .contacts = Contacts::All},
                    0.5);
  }

  /// Computes a frame and publishes it. Returns the milliseconds of publish().
  double computeFrame() {
    const double time = kFrame * ++m_frame;
    const double breath = std::sin(2 * std::numbers::pi * 0.35 * time);
    m_world.predict(kFrame, Vector3d::Zero(), 0.05);
    for (std::size_t v = 0; v < m_mesh.positions.size(); ++v)
      if (m_mesh.positions[v].z() < 0.25 * m_height)
        m_world.positions(m_organ)[v] = m_mesh.positions[v] + breath * Vector3d(2, 0, 4);
    const double lift = 0.15 * m_height * std::cos(2 * std::numbers::pi * 0.2 * time);
    m_world.place(m_probe, Matrix3d::Identity(), {-0.3 * m_size, 0, 1.1 * m_height + lift});
    m_world.detect();
    m_world.solve(8);
    m_world.detectOnly();
    const auto start = Clock::now();
    m_world.detection().publish(time);
    const std::chrono::duration<double, std::milli> taken = Clock::now() - start;
    m_world.commit();
    return taken.count();
  }

  OctreeBasedCD& collisions() { return m_world.detection(); }
  GeometryId id() const { return m_world.bodies()[m_organ].id; }
  std::size_t triangleCount() const { return m_mesh.triangles.size(); }
  double size() const { return m_size; }
  double heightAt(double x, double y) {
    const auto hit = collisions().queries().firstHit(id(), {{x, y, 10 * m_size}, {0, 0, -1}});
    return hit ? 10 * m_size - hit->t : 0;
  }

 private:
  World m_world;
  SceneMesh m_mesh;
  double m_size = 0, m_height = 0;  // mm
  World::BodyId m_organ = 0, m_probe = 0;
  int m_frame = 0;
};

/// A hand that comes down, strokes the organ while it turns the tool, and lifts it again.
class Hand {
 public:
  Hand(Organ& organ, double seconds) : m_seconds(seconds) {
    for (int i = 0; i <= kPlaces; ++i) {
      const double share = static_cast<double>(i) / kPlaces;
      const double x = (0.25 - 0.3 * share) * organ.size(), y = 0.05 * organ.size() * share;
      m_path[i] = {x, y, organ.heightAt(x, y)};
    }
  }

  /// share: of the stroke, in [0, 1].
  ToolPose at(double share) const {
    const double place = std::clamp(share, 0.0, 1.0) * kPlaces;
    const int i = std::min(static_cast<int>(place), kPlaces - 1);
    ToolPose pose;
    pose.position = m_path[i] + (place - i) * (m_path[i + 1] - m_path[i]);
    const double up = std::pow(std::cos(std::numbers::pi * share), 4);  // 1 at both ends
    pose.position.z() += up * kLift - (1 - up) * kPress;
    pose.rotation = (Eigen::AngleAxisd(0.9 * share, Vector3d::UnitZ()) *
                     Eigen::AngleAxisd(0.3 * std::sin(9 * share), Vector3d::UnitX()) *
                     Eigen::AngleAxisd(0.2 * std::sin(7 * share), Vector3d::UnitY()))
                        .toRotationMatrix();
    return pose;
  }
  double seconds() const { return m_seconds; }

 private:
  static constexpr int kPlaces = 12;
  double m_seconds;
  std::array<Vector3d, kPlaces + 1> m_path;
};

/// What the ticks of all strokes measured.
struct Record {
  Distribution work{"haptic step", {}}, done{"haptic step, from its due time", {}};
  Distribution emptyDone{"empty step, from its due time", {}};
  Distribution jump{"force jump", {}}, excess{"force jump beyond the tool's motion", {}};
  Distribution turnJump{"torque jump", {}}, turnExcess{"torque jump beyond the tool's motion", {}};
  Distribution publish{"publish()", {}};
  double strongest = 0;        // N
  double nearest = kInfinity;  // mm, of the blade's proxy from the surface
  std::size_t touching = 0, contacts = 0;
  std::uint64_t snapshots = 0, hash = 14695981039346656037u;

  void reserve(std::size_t ticks) {
    for (Distribution* each : all()) each->samples.reserve(ticks);
  }
  std::array<Distribution*, 8> all() {
    return {&work, &done, &emptyDone, &jump, &excess, &turnJump, &turnExcess, &publish};
  }
};

/// The strokes of the tool, tick by tick.
class HapticLoop {
 public:
  HapticLoop(Organ& organ, const Hand& hand, Record& record)
      : m_organ(organ), m_hand(hand), m_record(record), m_tool(organ.id()) {}

  void startStroke() {
    m_ticks = 0;
    m_tool.start(m_hand.at(0));
    m_force = m_torque = Vector3d::Zero();
  }
  /// time: s, of the simulation's clock.
  void tick(double time) {
    if (!m_player.advance(m_organ.collisions().latestSnapshot(), time, kTick)) return;
    const ToolPose device = m_hand.at(++m_ticks * kTick / m_hand.seconds());
    const VirtualTool::Answer answer =
        m_tool.step(m_player.snapshot(), m_player.share(), m_player.played(), device);
    record(answer);
    m_force = answer.force;
    m_torque = answer.torque;
  }

 private:
  /// The tool's own motion explains jumps up to the stiffness times the motion.
  void record(const VirtualTool::Answer& answer) {
    const auto add = [](double jump, double explained, Distribution& jumps, Distribution& excess) {
      jumps.samples.push_back(jump);
      excess.samples.push_back(std::max(0.0, jump - explained));
    };
    add(1000 * (answer.force - m_force).norm(), 1000 * VirtualTool::kStiffness * answer.motion,
        m_record.jump, m_record.excess);
    add((answer.torque - m_torque).norm(),
        VirtualTool::kTurnStiffness / VirtualTool::kLever * answer.motion, m_record.turnJump,
        m_record.turnExcess);
    m_record.touching += answer.force.norm() > 0.01;
    m_record.contacts = std::max(m_record.contacts, answer.contacts);
    m_record.nearest = std::min(m_record.nearest, answer.distance);
    m_record.strongest = std::max(m_record.strongest, answer.force.norm());
    m_record.snapshots = m_player.snapshot().number();
    for (const Vector3d& part : {answer.force, answer.torque})
      for (const double x : part)
        m_record.hash = (m_record.hash ^ std::bit_cast<std::uint64_t>(x)) * 1099511628211u;
  }

  Organ& m_organ;
  const Hand& m_hand;
  Record& m_record;
  VirtualTool m_tool;
  SurfacePlayer m_player{kDelay, kFrame};
  Vector3d m_force = Vector3d::Zero(), m_torque = Vector3d::Zero();
  int m_ticks = 0;
};

/// Both loops in one thread, on a clock of their own: the same forces in every run.
void runInLockstep(Organ& organ, HapticLoop& loop, int strokes, int ticks, Record& record) {
  std::int64_t tick = 0, frame = 0;
  for (int stroke = 0; stroke < strokes; ++stroke) {
    loop.startStroke();
    for (int i = 0; i < ticks; ++i) {
      const double time = kTick * static_cast<double>(++tick);
      for (; kFrame * static_cast<double>(frame) < time; ++frame)
        record.publish.samples.push_back(organ.computeFrame());
      loop.tick(time);
    }
  }
}

/// Gives the calling thread real-time priority. Returns whether the system permits it.
bool becomeRealTime() {
  const sched_param priority{.sched_priority = 50};
  return sched_setscheduler(0, SCHED_FIFO, &priority) == 0;
}

double millisecondsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

/// A thread for the haptic loop beside the simulation. Strokes alternate with as many empty ticks.
bool runThreads(Organ& organ, HapticLoop& loop, int strokes, int ticks, Record& record) {
  const auto start = Clock::now();
  const auto after = [&](double seconds) {
    return start +
           std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  };
  std::atomic<bool> ends = false;
  bool isRealTime = false;
  std::thread haptics([&] {
    isRealTime = becomeRealTime();
    std::int64_t tick = static_cast<std::int64_t>(4 * kFrame / kTick);  // the first snapshots
    for (int i = 0; i < 2 * strokes; ++i) {
      const bool isEmpty = i % 2 == 1;
      loop.startStroke();
      for (int t = 0; t < ticks; ++t) {
        const double time = kTick * static_cast<double>(++tick);
        const auto due = after(time);
        std::this_thread::sleep_until(due);
        const auto woken = Clock::now();
        if (!isEmpty) {
          loop.tick(time);
          record.work.samples.push_back(millisecondsSince(woken));
        }
        (isEmpty ? record.emptyDone : record.done).samples.push_back(millisecondsSince(due));
      }
    }
    ends = true;
  });
  for (std::int64_t frame = 0; !ends; ++frame) {
    std::this_thread::sleep_until(after(kFrame * static_cast<double>(frame)));
    record.publish.samples.push_back(organ.computeFrame());
  }
  haptics.join();
  return isRealTime;
}

void print(const Distribution& each, const char* unit) {
  std::printf("%-34s %8.4f %8.4f %8.4f %8.4f %s\n", each.name.c_str(), each.at(0.5), each.at(0.99),
              each.at(0.999), each.most(), unit);
}

/// Returns whether no force or torque jumps by more than is allowed.
bool run(int strokes, double seconds, bool lockstep, const std::filesystem::path& folder) {
  const int ticks = static_cast<int>(seconds / kTick);
  Organ organ;
  const Hand hand(organ, seconds);
  Record record;
  record.reserve(static_cast<std::size_t>(strokes) * static_cast<std::size_t>(ticks));
  HapticLoop loop(organ, hand, record);
  bool isRealTime = false;
  if (lockstep)
    runInLockstep(organ, loop, strokes, ticks, record);
  else
    isRealTime = runThreads(organ, loop, strokes, ticks, record);
  for (Distribution* each : record.all()) each->sort();

  std::printf("organ of %zu triangles at 60 Hz, threads = 1; %d strokes of %d ticks at 1 kHz\n",
              organ.triangleCount(), strokes, ticks);
  std::printf("%-34s %8s %8s %8s %8s\n", "", "p50", "p99", "p99.9", "most");
  print(record.publish, "ms");
  if (!lockstep) {
    print(record.work, "ms");
    print(record.done, "ms");
    print(record.emptyDone, "ms");
    std::printf(
        "p99.9 of the haptic step less that of the empty step: %.4f ms (goal: below 0.25)\n",
        record.done.at(0.999) - record.emptyDone.at(0.999));
    std::printf("priority of the haptic thread: %s\n", isRealTime ? "real time" : "normal");
  }
  print(record.jump, "mN");
  print(record.excess, "mN");
  print(record.turnJump, "N mm");
  print(record.turnExcess, "N mm");
  std::printf("%zu ticks in touch, at most %zu contacts and %.3f N; snapshot %llu was the last\n",
              record.touching, record.contacts, record.strongest,
              static_cast<unsigned long long>(record.snapshots));
  std::printf("least distance of the proxy from the surface: %.3f mm\n", record.nearest);
  const bool isSmooth =
      record.excess.most() <= kAllowedForce && record.turnExcess.most() <= kAllowedTorque;
  std::printf(
      "largest jumps beyond the tool's own motion: %.3f mN of %g, %.4f N mm of %g allowed\n",
      record.excess.most(), kAllowedForce, record.turnExcess.most(), kAllowedTorque);
  if (lockstep) std::printf("result hash %016llx\n", static_cast<unsigned long long>(record.hash));
  if (folder.empty()) return isSmooth;
  makeFolder(folder);
  std::vector<Distribution> rows;
  for (const Distribution* each : record.all()) rows.push_back(*each);
  writeWhole(folder / "haptics.csv", csvOf(rows));
  std::vector<Panel> panels;
  if (!lockstep)
    panels.push_back(
        {"Share of steps that took longer", "ms", {&record.work, &record.done, &record.emptyDone}});
  panels.push_back(
      {"Share of ticks with a larger force jump", "mN", {&record.jump, &record.excess}});
  panels.push_back(
      {"Share of ticks with a larger torque jump", "N mm", {&record.turnJump, &record.turnExcess}});
  writeWhole(folder / "haptics.svg", svgOf(panels));
  return isSmooth;
}

}  // namespace
}  // namespace palpate::scenes

int main(int count, char** arguments) {
  int strokes = 5;
  double seconds = 2;
  bool lockstep = false;
  std::filesystem::path folder;
  CLI::App app("A haptic loop at 1 kHz beside a simulation at 60 Hz.", "Haptics");
  app.add_option("--strokes", strokes, "strokes of the tool over the organ")
      ->check(palpate::scenes::between(1, 1000));
  app.add_option("--seconds", seconds, "duration of a stroke")
      ->check(palpate::scenes::between(1.0, 60.0));
  app.add_flag("--lockstep", lockstep,
               "one thread on a clock of its own: the same forces each time");
  app.add_option("--out", folder, "the folder for haptics.csv and haptics.svg");
  return palpate::scenes::exitCodeOf(app, [&] {
    app.parse(count, arguments);
    return palpate::scenes::run(strokes, seconds, lockstep, folder);
  });
}
