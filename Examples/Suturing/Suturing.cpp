// A thread of 1,000 segments goes through two sheets and around itself, and is pulled tight. Beside
// it a guide sews a stitch and ties it by an overhand knot. ThreadTopology grades the stitch, and
// says when the thread's end goes through the loop of the knot. It does not say whether a knot is
// tied.
#include "CommandLine.h"
#include "SceneProgram.h"
#include "SelfImpacts.h"
#include "Stitch.h"

#include <palpate/ThreadTopology.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <optional>

namespace palpate::scenes {
namespace {

using Eigen::Vector3d, std::numbers::pi;

// Lengths in mm, times in s.
constexpr int kSubsteps = 4, kRounds = 2, kIterations = 10;
constexpr double kStep = 1.0 / 60 / kSubsteps;
constexpr std::uint32_t kNeedle = 60, kSegments = 1000;  // segments
constexpr double kSegment = 0.07, kRadius = 0.05, kGap = 0.01, kArc = 4, kDepth = 2.4;
constexpr double kNeedleSpeed = 0.1, kMostStretch = 1.08;
// The story, in substeps: through both sheets, up, around the standing part, away.
constexpr double kStitchSteps = 120;  // substeps of the stitch
constexpr int kUntilFault = 1;        // substeps
constexpr double kThrough = 300, kUp = 160, kAround = 400, kAway = 740;

Vector3d onArc(double angle) {
  return {kArc * std::cos(angle), 0.21, kDepth + kArc * std::sin(angle)};
}

double part(double time, double from, double length) {
  return std::clamp((time - from) / length, 0.0, 1.0);
}

/// The needle from its tip to the thread's first vertex.
std::vector<Vector3d> needleAt(double time) {
  const double tip = pi * (170 + 350 * part(time, 0, kThrough)) / 180;
  const double up = part(time, kThrough, kUp), around = part(time, kThrough + kUp, kAround),
               away = part(time, kThrough + kUp + kAround, kAway);
  const double orbit = 2.5 * pi * around;
  const Vector3d end = onArc(tip - pi), axis(-kArc * 0.8, 0.21, 0);
  // The thread's end of the needle rises, goes around the axis, and off to the side.
  const double radius = 7 - 2 * around;
  Vector3d place = end + up * (axis + Vector3d(7, 0, 9.5) - end);
  if (up == 1)
    place = axis + Vector3d(radius * std::cos(orbit), radius * std::sin(orbit), 9.5 - 2 * around);
  place += away * Vector3d(48, 48, -4);
  const Eigen::AngleAxisd turn(orbit - pi * up, Vector3d::UnitZ());
  std::vector<Vector3d> needle;
  for (std::uint32_t i = 0; i <= kNeedle; ++i)
    needle.push_back(place + turn * (onArc(tip - pi * i / kNeedle) - end));
  return needle;
}

/// Where the thread's other end is held.
Vector3d tailAt(double time, const Vector3d& start) {
  return start + part(time, 0.6 * kThrough, 0.4 * kThrough + kUp) *
                     (Vector3d(-kArc * 0.8, 0.21, 14) - start);
}

/// The needle, then the thread, which leads to a coil.
std::vector<Vector3d> atRest() {
  std::vector<Vector3d> line = needleAt(0);
  constexpr std::uint32_t kStraight = 200;
  constexpr double kCoil = 2, kRise = 0.5;  // radius, and way along the axis a turn
  const Vector3d along = Vector3d(0.35, 0, 1).normalized(), needleEnd = line.back();
  for (std::uint32_t i = 1; i <= kStraight; ++i) line.push_back(needleEnd + kSegment * i * along);
  const Vector3d start = line.back(), axis = start + kCoil * along.cross(Vector3d::UnitY());
  const double turn = kSegment / std::hypot(kCoil, kRise / (2 * pi));
  for (std::uint32_t i = 1; i <= kSegments - kStraight; ++i)
    line.push_back(axis - Eigen::AngleAxisd(-turn * i, Vector3d::UnitY()) * (axis - start) -
                   Vector3d(0, kRise * turn * i / (2 * pi), 0));
  return line;
}

class Suturing : public LiveScene {
 public:
  Suturing(int threads, const std::string& fault) : m_world(threads), m_fault(fault) {
    m_thread = m_world.addThread("thread", atRest(), kRadius, 1.0);
    std::vector<double>& mobility = m_world.solver().inverseMasses;
    std::fill_n(mobility.begin(), kNeedle + 1, 0.0);
    mobility.back() = 0;
    m_world.addStiffness(m_thread, 0, 2e-5);
    m_world.addRigid(m_thread, kNeedle + 1);
    const PairSettings touching{
        .method = Method::Continuous, .thickness = kGap, .contacts = Contacts::All};
    m_world.addPair(m_thread, m_thread,
                    {.method = Method::Continuous,
                     .thickness = kGap,
                     .contacts = Contacts::All,
                     .restDistance = 4 * kSegment},
                    kGap);
    m_world.addGuard(m_thread, m_thread);
    for (const double side : {-1.0, 1.0}) addSheet(side, touching);
    m_world.addPair(m_sheets[0], m_sheets[1], touching, kGap);
    m_stitch = m_world.addThread("stitch", stitch(), kRadius, 0.0);
    m_world.addPair(m_stitch, m_stitch,
                    {.method = Method::Continuous,
                     .thickness = kTied,
                     .contacts = Contacts::All,
                     .restDistance = 4 * kRadius},
                    0);
    SceneMesh bed = sheet(24);  // shown only
    for (Vector3d& p : bed.positions) p = {2.5 * p.x(), 2.7 + 4.8 * p.y(), -2};
    m_bed = m_world.addRigidMesh("wound", bed);
    m_world.addGuard(m_sheets[0], m_sheets[1]);
    for (const std::size_t side : {0u, 1u}) {
      const auto rim = rimAt(m_sheets[side], kStitchHoles[side]);
      m_edges[side] = watch(m_stitch, m_sheets[side], rim);
      // The guide does not feel the tissue, so it must not be moved away from the stitch.
      for (const std::uint32_t v : rim) mobility[m_world.bodies()[m_sheets[side]].first + v] = 0;
    }
  }

  World& world() override { return m_world; }

  std::vector<BodyLook> looks() override {
    return {{m_thread, "Needle", kSteelColour, 1, true, 0, 0.3, 1},
            {.body = m_thread, .label = "Thread", .colour = kThreadColour, .firstElement = kNeedle},
            {m_stitch, "", kThreadColour},
            {m_sheets[0], "", kTissueColour, 1, true, 0, 0.5},
            {m_sheets[1], "", kTissueColour, 1, true, 0, 0.5},
            {m_bed, "Wound", {0.45, 0.05, 0.05}, 1, true, 0, 0.25}};
  }

  PictureView view() override {
    return {.from = {0.35, -1, 0.75},
            .centre = {-1.1, 1, 0.9},
            .height = 8,
            .inset = kStitch + Vector3d(0, 0, 0.2),
            .insetHeight = 1.6,
            .insetLeft = true,
            .insetTop = false};
  }

  std::vector<PictureNote> notes() override { return {{"Knot", kStitch + Vector3d(0, 0, 0.8)}}; }

  void computeFrame(int) override {
    m_steps.clear();
    for (int substep = 0; substep < kSubsteps; ++substep) {
      m_steps.push_back(line());
      m_world.predict(kStep, Vector3d::Zero(), 0.03);
      drive();
      sew();
      for (int round = 0; round < kRounds; ++round) {
        m_world.detect();
        pierce();
        m_world.solve(kIterations);
      }
      m_world.hold();
      m_time += m_world.fraction(m_thread, 0) * (m_next - m_time);  // the hand waits
      m_topology.update();
      m_world.commit();
    }
    m_steps.push_back(line());
  }

  std::vector<std::pair<std::string, double>> values() override {
    return {{"substeps", m_time},
            {"stretch", stretch()},
            {"holes", m_holes[0] + m_holes[1]},
            {"stitched edges", passed(m_edges[0]) + passed(m_edges[1])},
            {"end through loop", m_knot ? m_topology.count(*m_knot) : 0},
            {"knot gap mm", knotGap()},
            {"touches itself", m_world.contacts(m_thread, m_thread).edgeEdge().size()},
            {"wound mm", m_world.positions(m_sheets[1])[kMiddle].x() -
                             m_world.positions(m_sheets[0])[kMiddle + kCells].x()}};
  }

  std::vector<std::string> findings() override {
    std::vector<std::string> lines;
    const auto add = [&](const std::string& subject, std::optional<std::size_t> watch,
                         const std::string& done) {
      lines.push_back(subject + ": " + (watch ? grade(*watch, done) : "not yet"));
    };
    for (const std::size_t side : {0u, 1u}) {
      const std::string edge = side == 0 ? "left edge" : "right edge";
      add("needle, " + edge, m_pierced[side], "through");
      add("stitch, " + edge, m_edges[side], "through");
    }
    add("end, loop of the knot", m_knot, "through");
    return lines;
  }

  std::string settings() override { return m_fault.empty() ? "" : "fault " + m_fault; }

  std::string fault() override {
    std::size_t impacts = 0;
    for (std::size_t i = 0; i + 1 < m_steps.size(); ++i)
      impacts += countSelfImpacts(m_steps[i], m_steps[i + 1]);
    if (m_fault.empty() && knotGap() <= 0) return "the knot's thread is in itself.";
    return impacts == 0
               ? ""
               : "the thread passes through itself in " + std::to_string(impacts) + " places.";
  }

 private:
  static constexpr double kTied = 0.03;  // mm: nearer parts of the knot touch
  inline static const Vector3d kStitch{0, 2.1, 0};

  /// Between surfaces of the stitch.
  double knotGap() {
    double least = kTied;
    for (const EdgeEdgeContact& c : m_world.contacts(m_stitch, m_stitch).edgeEdge())
      least = std::min(least, c.distance);
    return least;
  }

  std::vector<Vector3d> stitch() {
    std::vector<Vector3d> thread = stitchAt(m_sewn);
    for (Vector3d& p : thread) p += kStitch;
    return thread;
  }

  /// The guide's next step on the stitch, or the fault's.
  void sew() {
    const std::string fault = m_afterKnot > kUntilFault ? m_fault : "";
    m_sewn = std::clamp(m_sewn + (fault == "end" ? -3 : 1) / kStitchSteps, 0.0, 1.0);
    if (m_sewn == 1) ++m_afterKnot;
    std::vector<Vector3d> thread = stitch();
    if (fault == "wall")
      for (const std::uint32_t v : knotEnd()) thread[v] -= Vector3d(0, 1.5, 0);
    if (fault == "disabled")
      m_world.detection().setDisabledElements(m_world.bodies()[m_stitch].id,
                                              std::array{knotLoop().front()});
    std::copy(thread.begin(), thread.end(), m_world.positions(m_stitch).begin());
    if (!m_knot && m_sewn >= kKnotBegins) {
      const GeometryId id = m_world.bodies()[m_stitch].id;
      m_knot = m_topology.add({id, knotEnd()}, {id, knotLoop()});
    }
  }

  /// The vertices of the triangle of a sheet below a hole of the stitch.
  std::array<std::uint32_t, 3> rimAt(World::BodyId sheet, const Vector3d& hole) {
    const Ray ray{kStitch + hole + Vector3d::UnitZ(), -Vector3d::UnitZ()};
    return m_world.detection().queries().firstHit(m_world.bodies()[sheet].id, ray)->vertices;
  }

  /// Counts how often the whole thread goes through a hole.
  std::size_t watch(World::BodyId thread, World::BodyId sheet,
                    const std::array<std::uint32_t, 3>& rim) {
    const World::Body& line = m_world.bodies()[thread];
    return m_topology.add({line.id, stitchPart(0, line.count - 1)},
                          {m_world.bodies()[sheet].id, {rim[0], rim[1], rim[2]}});
  }

  int passed(std::size_t watch) { return std::abs(m_topology.count(watch)); }

  /// Whether a passage was made and still holds, with the event that says so.
  std::string grade(std::size_t watch, const std::string& done) {
    const ThreadEvent* last = nullptr;
    for (const ThreadEvent& event : m_topology.events())
      if (event.index == watch) last = &event;
    if (!last) return "not yet";
    const auto edge = [](const char* what, const std::array<std::uint32_t, 2>& vertices) {
      if (vertices[0] == kNoElement) return std::string();
      return std::string(", ") + what + ' ' + std::to_string(vertices[0]) + '-' +
             std::to_string(vertices[1]);
    };
    return (m_topology.count(watch) != 0 ? done : "lost") + " in step " +
           std::to_string(last->step) + " (" + toString(last->cause) +
           edge("thread", last->thread) + edge("loop", last->loop) + ')';
  }

  static constexpr int kCells = 20, kMiddle = kCells / 2 * (kCells + 1);  // a row's first vertex

  void addSheet(double side, const PairSettings& settings) {
    SceneMesh mesh = sheet(kCells);
    constexpr double kHalf = 5;
    for (Vector3d& p : mesh.positions) {  // the wound narrows towards its ends
      const double width = 0.02 + 0.38 * (1 - p.y() * p.y());
      p = kHalf * p + Vector3d(side * (kHalf + width), 0, 0);
    }
    const World::BodyId body = m_world.addMesh(side < 0 ? "left" : "right", mesh, 0.05);
    // Clamped on three sides, as by the tissue around: only the wound's edges are free.
    m_world.pin(body, [](const Vector3d& p) {
      return std::abs(p.x()) > 2 * kHalf ||
             (std::abs(p.y()) > 0.99 * kHalf && std::abs(p.x()) > kHalf);
    });
    m_world.addStiffness(body, 1e-6, 1e-6);
    m_world.addPair(m_thread, body, settings, kGap);
    m_world.addGuard(m_thread, body);
    m_sheets[side > 0] = body;
  }

  std::vector<Vector3d> line() {
    return {m_world.positions(m_thread).begin(), m_world.positions(m_thread).end()};
  }

  void drive() {
    m_next = m_time + (stretch() > kMostStretch ? 0 : 1);  // as tight as it may be
    const std::vector<Vector3d> needle = needleAt(m_next);
    const std::span<Vector3d> positions = m_world.positions(m_thread);
    std::copy(needle.begin(), needle.end(), positions.begin());
    positions.back() = tailAt(m_next, m_tailStart);
  }

  /// The first triangle of each sheet that the needle's tip meets gives way.
  void pierce() {
    for (int side = 0; side < 2; ++side) {
      if (m_holes[side]) continue;
      for (const VertexTriangleContact& c :
           m_world.contacts(m_thread, m_sheets[side]).vertexTriangle()) {
        if (c.vertex != 0) continue;
        m_world.disable(m_sheets[side], std::array{c.triangle});
        m_pierced[side] =
            watch(m_thread, m_sheets[side], m_world.bodies()[m_sheets[side]].triangles[c.triangle]);
        m_holes[side] = true;
        m_world.detect();
        break;
      }
    }
  }

  /// Of the thread's length over its length at rest.
  double stretch() {
    double length = 0;
    const std::span<const Vector3d> p = m_world.before(m_thread);
    for (std::uint32_t i = kNeedle; i + 1 < p.size(); ++i) length += (p[i + 1] - p[i]).norm();
    return length / (kSegments * kSegment);
  }

  World m_world;
  ThreadTopology m_topology{m_world.detection()};
  std::array<std::optional<std::size_t>, 2> m_pierced{};  // by the needle's thread
  std::array<std::size_t, 2> m_edges{};                   // of the stitch
  std::optional<std::size_t> m_knot;
  double m_sewn = 0;  // of the stitch's story
  int m_afterKnot = 0;
  std::string m_fault;
  World::BodyId m_thread = 0, m_bed = 0, m_stitch = 0;
  std::array<World::BodyId, 2> m_sheets{};
  std::array<bool, 2> m_holes{};
  std::vector<std::vector<Vector3d>> m_steps;  // the frame's, committed
  double m_time = 0, m_next = 0;               // substeps of the story
  Vector3d m_tailStart = atRest().back();
};

}  // namespace
}  // namespace palpate::scenes

int main(int count, char** arguments) {
  using namespace palpate::scenes;
  std::string fault;
  return runScene(
      {.name = "Suturing",
       .description =
           "A thread of 1,000 segments through two sheets and around itself, and a stitch "
           "that a guide ties.",
       .frames = 400,
       .frameMilliseconds = 1000.0 / 60,
       .keys = "n",
       .addOptions =
           [&](CLI::App& app) {
             app.add_option("--fault", fault, "by which the thread's end leaves the loop")
                 ->type_name("FAULT")
                 ->check(oneOf({"wall", "end", "disabled"}));
           },
       .make = [&](int threads) { return std::make_unique<Suturing>(threads, fault); }},
      count, arguments);
}
