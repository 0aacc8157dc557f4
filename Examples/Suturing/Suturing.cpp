// A thread of 1,000 segments goes through two sheets and around itself, and is pulled tight. Beside
// it is a stitch that is tied already.
#include "SceneProgram.h"
#include "SelfImpacts.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

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

/// Half of a stitch that an overhand knot closes: from below the wound up through the left edge,
/// one and a half times half around the other half, which is this one turned by 180 degrees.
std::vector<Vector3d> halfStitch() {
  constexpr double kKnot = 0.45, kTwist = 0.06, kHeight = 0.13;  // half its length; radius; height
  constexpr int kPoints = 12;
  std::vector<Vector3d> line{{-0.06, 0, -0.9}, {-0.9, 0, -0.8}, {-1.45, 0, -0.35},
                             {-1.55, 0, 0.05}, {-1.25, 0, 0.2}, {-0.85, -0.03, 0.15}};
  for (int i = 0; i <= kPoints; ++i) {
    const double along = 2.0 * i / kPoints - 1, angle = pi * (1 + 1.5 * along);
    line.emplace_back(kKnot * along, kTwist * std::cos(angle), kHeight + kTwist * std::sin(angle));
  }
  line.emplace_back(kKnot + 0.3, 0.05, kHeight + kTwist + 0.12);
  line.emplace_back(kKnot + 0.8, 0.2, kHeight + 0.7);
  return curve(line);
}

class Suturing : public LiveScene {
 public:
  explicit Suturing(int threads) : m_world(threads) {
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
    for (const double side : {-1.0, 1.0}) {
      std::vector<Vector3d> half = halfStitch();
      for (Vector3d& p : half) p = Vector3d(-side * p.x(), -side * p.y(), p.z()) + kStitch;
      m_stitch[side > 0] = m_world.addThread("stitch", half, kRadius, 0.0);
    }
    m_world.addPair(m_stitch[0], m_stitch[1],
                    {.method = Method::Proximity, .thickness = kTied, .contacts = Contacts::All},
                    0);
    SceneMesh bed = sheet(24);  // shown only
    for (Vector3d& p : bed.positions) p = {2.5 * p.x(), 2.7 + 4.8 * p.y(), -2};
    m_bed = m_world.addRigidMesh("wound", bed);
    m_world.addGuard(m_sheets[0], m_sheets[1]);
  }

  World& world() override { return m_world; }

  std::vector<BodyLook> looks() override {
    return {{m_thread, "Needle", kSteelColour, 1, true, 0, 0.3, 1},
            {.body = m_thread, .label = "Thread", .colour = kThreadColour, .firstElement = kNeedle},
            {m_stitch[0], "", kThreadColour},
            {m_stitch[1], "", kThreadColour},
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
      for (int round = 0; round < kRounds; ++round) {
        m_world.detect();
        pierce();
        m_world.solve(kIterations);
      }
      m_world.hold();
      m_time += m_world.fraction(m_thread, 0) * (m_next - m_time);  // the hand waits
      m_world.commit();
    }
    m_steps.push_back(line());
  }

  std::vector<std::pair<std::string, double>> values() override {
    return {{"substeps", m_time},
            {"stretch", stretch()},
            {"holes", m_holes[0] + m_holes[1]},
            {"knot gap mm", knotGap()},
            {"touches itself", m_world.contacts(m_thread, m_thread).edgeEdge().size()},
            {"wound mm", m_world.positions(m_sheets[1])[kMiddle].x() -
                             m_world.positions(m_sheets[0])[kMiddle + kCells].x()}};
  }

  std::string fault() override {
    std::size_t impacts = 0;
    for (std::size_t i = 0; i + 1 < m_steps.size(); ++i)
      impacts += countSelfImpacts(m_steps[i], m_steps[i + 1]);
    if (knotGap() <= 0) return "the knot's thread is in itself.";
    return impacts == 0
               ? ""
               : "the thread passes through itself in " + std::to_string(impacts) + " places.";
  }

 private:
  static constexpr double kTied = 0.03;  // mm: nearer parts of the knot touch
  inline static const Vector3d kStitch{0, 2, 0};

  /// Between the surfaces of the knot's two parts.
  double knotGap() {
    double least = kTied;
    for (const EdgeEdgeContact& c : m_world.contacts(m_stitch[0], m_stitch[1]).edgeEdge())
      least = std::min(least, c.distance);
    return least;
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
  World::BodyId m_thread = 0, m_bed = 0;
  std::array<World::BodyId, 2> m_sheets{}, m_stitch{};
  std::array<bool, 2> m_holes{};
  std::vector<std::vector<Vector3d>> m_steps;  // the frame's, committed
  double m_time = 0, m_next = 0;               // substeps of the story
  Vector3d m_tailStart = atRest().back();
};

}  // namespace
}  // namespace palpate::scenes

int main(int count, char** arguments) {
  using namespace palpate::scenes;
  return runScene(
      {.name = "Suturing",
       .description = "A thread of 1,000 segments through two sheets and around itself.",
       .frames = 400,
       .frameMilliseconds = 1000.0 / 60,
       .keys = "n",
       .make = [](int threads) { return std::make_unique<Suturing>(threads); }},
      count, arguments);
}
