// A grasper closes on the lower edge of a liver and lifts it from the gallbladder.
#include "Anatomy.h"
#include "SceneProgram.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace palpate::scenes {
namespace {

using Eigen::AlignedBox3d, Eigen::Vector3d, std::numbers::pi;

// Lengths in mm, times in s, masses in kg, forces in mN.
constexpr double kStep = 1.0 / 60, kGap = 0.8, kMass = 1.5, kOpen = 0.5, kClosed = 0.16;
constexpr int kRounds = 2, kIterations = 10, kClose = 30, kPeriod = 120;
constexpr double kLift = 20, kGrown = 14;  // behind kGrown the liver is fixed

/// One jaw of a fenestrated grasper, 5 mm wide, along z from its joint at the origin; it closes on
/// y = 0.
SceneMesh jaw(double side, double edge) {
  const auto body = [side](const Vector3d& p) {
    const double y = side * p.y(), middle = 1.9 + 0.0015 * p.z() * p.z();
    const Vector3d q(p.x() / 2.7, 0, (p.z() - 11) / 13);
    const double outline =
                     2.7 *
                     (std::pow(std::pow(std::abs(q.x()), 3) + std::pow(std::abs(q.z()), 6), 0.2) -
                      1),
                 plate = std::abs(y - middle) - 1.1,
                 window = toCone({p.x(), 0, p.z()}, {0, 0, 9}, {0, 0, 18}, 1.2, 1.2);
    return smoothMax(smoothMax(outline, plate, 0.8), -window, 0.6);
  };
  SceneMesh mesh = meshOf(body, AlignedBox3d(Vector3d(-5, -7, -6), Vector3d(5, 7, 28)), edge);
  return mesh;
}

class LiverLift : public LiveScene {
 public:
  explicit LiverLift(int threads) : m_world(threads) {
    const SceneMesh liver = anatomicalLiver(3.2);
    m_liver = m_world.addMesh("liver", liver, static_cast<double>(liver.positions.size()) / kMass);
    m_gallbladder = m_world.addMesh("gallbladder", anatomicalGallbladder(2.05), 0.0);
    m_vein = m_world.addRigidMesh("portal vein", portalVein(2.5));
    m_artery = m_world.addRigidMesh("hepatic artery", hepaticArtery(1.2));
    m_duct = m_world.addRigidMesh("bile duct", bileDuct(1.4));
    const auto isGrown = [](const Vector3d& p) { return p.y() > kGrown; };
    m_world.pin(m_liver, isGrown);
    m_world.addStiffness(m_liver, 1e-3, 1e-3);
    m_world.addInside(m_liver, kMass, isInLiver, isGrown);
    m_world.addVolume(m_liver, 0);
    const std::array<SceneMesh, 2> jaws{jaw(-1, 0.8), jaw(1, 0.8)};
    m_start = startOf(liver);
    m_frame = frameAt(0);
    for (int i = 0; i < 2; ++i) {
      m_rest[i] = jaws[i].positions;
      SceneMesh placed = jaws[i];
      for (Vector3d& p : placed.positions) p = jawAt(i, 0) * p;
      m_jaws[i] = m_world.addMesh(i == 0 ? "lower jaw" : "upper jaw", placed, 0.0);
      m_world.addRigid(m_jaws[i], m_world.bodies()[m_jaws[i]].count);
      m_world.addPair(m_liver, m_jaws[i], {.method = Method::Auto, .thickness = kGap}, kGap);
      m_world.addGuard(m_liver, m_jaws[i]);
    }
    m_world.addPair(m_liver, m_gallbladder, {.method = Method::Auto, .thickness = kGap}, kGap / 2);
    m_world.addGuard(m_liver, m_gallbladder);
    const std::array shaft{Vector3d(0, 0, -330), Vector3d(0, 0, -14), Vector3d(0, 0, -8),
                           Vector3d(0, 0, -1)};
    SceneMesh drawn = tubeAround(shaft, 2.5, 32);
    m_shaft = m_world.addRigidMesh("shaft", drawn);
    place();
  }

  World& world() override { return m_world; }

  std::vector<BodyLook> looks() override {
    constexpr double kWet = 0.28;
    return {{m_liver, "Liver", kLiverColour, 1, true, 0, kWet},
            {m_gallbladder, "Gallbladder", {0.45, 0.56, 0.30}, 1, true, 0, kWet},
            {m_vein, "", {0.28, 0.36, 0.58}, 1, true, 0, kWet},
            {m_artery, "", {0.78, 0.14, 0.12}, 1, true, 0, kWet},
            {m_duct, "", {0.52, 0.60, 0.28}, 1, true, 0, kWet},
            {m_jaws[0], "", kSteelColour, 0.45, true, 0, 0.3, 1},
            {m_jaws[1], "", kSteelColour, 0.45, true, 0, 0.3, 1},
            {m_shaft, "Grasper", kSteelColour, 1, true, 0, 0.3, 1}};
  }

  PictureView view() override {
    return {.from = {0.15, -1, -0.3},
            .centre = {-16, -20, -4},
            .height = 190,
            .inset = m_start + Vector3d(0, -4, 12),
            .insetHeight = 46,
            .insetLeft = true,
            .insetTop = false};
  }

  void computeFrame(int frame) override {
    m_world.predict(kStep, Vector3d::Zero(), 0.1);
    for (int i = 0; i < 2; ++i) {
      const Eigen::Isometry3d pose = jawAt(i, frame + 1);
      m_motions[i] = pose * jawAt(i, frame).inverse();
      for (std::size_t v = 0; v < m_rest[i].size(); ++v)
        m_world.positions(m_jaws[i])[v] = pose * m_rest[i][v];
    }
    for (int round = 0; round < kRounds; ++round) {
      m_world.detect();
      m_world.solve(kIterations);
      if (frame >= kClose / 2) grip();
    }
    m_world.hold();
    m_world.commit();
    m_frame = frameAt(frame + 1);
    m_lift = kLift * lifted(frame + 1);
    place();
  }

  std::vector<std::pair<std::string, double>> values() override {
    return {
        {"lift mm", m_lift},
        {"force N", force().norm()},
        {"grip contacts", gripped().size()},
        {"volume share", volumeOf(m_world.positions(m_liver), m_world.bodies()[m_liver].triangles) /
                             m_world.solver().volumes[0].rest}};
  }

  std::vector<PictureNote> notes() override {
    return forceNotes(m_frame * Vector3d(0, 0, 12), force(), 10);
  }

  std::string fault() override {
    for (const World::BodyId other : {m_jaws[0], m_jaws[1], m_gallbladder})
      if (m_world.intersect(m_liver, other))
        return "the liver and the " + m_world.bodies()[other].name + " intersect.";
    return "";
  }

 private:
  /// Where the grasper takes the edge: the lowest vertex in front, beside the gallbladder.
  static Vector3d startOf(const SceneMesh& liver) {
    constexpr double kX = 2;
    Vector3d best(0, 0, 1e9);
    const Vector3d down(0, 0.6, 0.8);
    for (const Vector3d& p : liver.positions)
      if (std::abs(p.x() - kX) < 2 && p.dot(down) < best.dot(down)) best = p;
    return best;
  }

  static double part(double frame, double from, double length) {
    const double share = std::clamp((frame - from) / length, 0.0, 1.0);
    return (1 - std::cos(pi * share)) / 2;
  }
  /// From 0 to 1 and back, in each period after the jaws have closed.
  static double lifted(double frame) {
    return frame < kClose ? 0 : (1 - std::cos(2 * pi * (frame - kClose) / kPeriod)) / 2;
  }

  /// The grasper's frame: z along its shaft, y across its jaws.
  Eigen::Isometry3d frameAt(double frame) const {
    const double up = lifted(frame);
    const Vector3d z = Vector3d(-0.55, 0.5, 0.62 + 0.1 * up).normalized(),
                   y = Vector3d(Vector3d(0, -0.8, 0.5) - z.dot(Vector3d(0, -0.8, 0.5)) * z)
                           .normalized();
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() << y.cross(z), y, z;
    pose.translation() = m_start - (14 + 6 * (1 - part(frame, 0, kClose / 3))) * z +
                         kLift * up * Vector3d(0, -0.35, 0.94);
    return pose;
  }
  Eigen::Isometry3d jawAt(int jaw, double frame) const {
    const double angle = kOpen + (kClosed - kOpen) * part(frame, kClose / 3, kClose * 2 / 3);
    return frameAt(frame) * Eigen::AngleAxisd(jaw == 0 ? angle : -angle, Vector3d::UnitX());
  }
  void place() { m_world.place(m_shaft, m_frame.linear(), m_frame.translation()); }

  struct Gripped {
    std::uint32_t vertex;  ///< of the liver
    int jaw;
    Vector3d normal;
  };
  std::vector<Gripped> gripped() {
    std::vector<Gripped> found;
    for (int jaw = 0; jaw < 2; ++jaw) {
      const CollisionData& data = m_world.contacts(m_liver, m_jaws[jaw]);
      for (const VertexTriangleContact& c : data.vertexTriangle())
        found.push_back({c.vertex, jaw, c.normal});
      for (const VertexTriangleContact& c : data.triangleVertex())
        for (const std::uint32_t v : m_world.bodies()[m_liver].triangles[c.triangle])
          found.push_back({v, jaw, c.normal});
      for (const EdgeEdgeContact& c : data.edgeEdge())
        for (const std::uint32_t v : c.edgeA) found.push_back({v, jaw, c.normal});
    }
    return found;
  }

  /// The teeth of the jaws let nothing slide: what they touch moves with them along them.
  void grip() {
    const std::span<const Vector3d> before = m_world.before(m_liver);
    for (const auto& [vertex, jaw, normal] : gripped()) {
      Vector3d& now = m_world.positions(m_liver)[vertex];
      const Vector3d slip = now - m_motions[jaw] * before[vertex];
      now -= slip - slip.dot(normal) * normal;
    }
  }

  /// N, of the jaws on the liver.
  Vector3d force() const { return -(m_world.force(m_jaws[0]) + m_world.force(m_jaws[1])) / 1000; }

  World m_world;
  World::BodyId m_liver = 0, m_gallbladder = 0, m_vein = 0, m_artery = 0, m_duct = 0, m_shaft = 0;
  std::array<World::BodyId, 2> m_jaws{};
  std::array<std::vector<Vector3d>, 2> m_rest;  // of the jaws, in their own frames
  std::array<Eigen::Isometry3d, 2> m_motions;   // of the jaws, in the frame
  Eigen::Isometry3d m_frame = Eigen::Isometry3d::Identity();
  Vector3d m_start = Vector3d::Zero();
  double m_lift = 0;  // of the jaws, since they closed
};

}  // namespace
}  // namespace palpate::scenes

int main(int count, char** arguments) {
  using namespace palpate::scenes;
  return runScene(
      {.name = "LiverLift",
       .description = "A grasper closes on the edge of a liver and lifts it from the gallbladder.",
       .frames = 90,
       .frameMilliseconds = 1000.0 / 60,
       .keys = "n",
       .make = [](int threads) { return std::make_unique<LiverLift>(threads); }},
      count, arguments);
}
