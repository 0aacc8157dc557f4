// A fan retractor lifts the left lobe of a liver from the stomach and lowers it, again and again.
// Nothing ever intersects, and nothing drifts.
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
constexpr int kPeriod = 150, kRounds = 2, kIterations = 8;
constexpr double kStep = 1.0 / 60, kGap = 0.8, kMass = 1.5, kLift = 20;
constexpr double kGrown = 14;     // behind it the organs are fixed
constexpr double kMostDrift = 1;  // of a body's centre from one period to the next
const Vector3d kUp = Vector3d(0, -0.35, 0.94).normalized();

/// The fingers of a fan retractor, 5 mm thick, spread in the plane y = 0 about z.
SceneMesh fan() {
  constexpr double kRadius = 2.5, kLength = 52;
  const auto body = [=](const Vector3d& p) {
    double nearest = 1e9;
    for (const double angle : {-0.42, -0.14, 0.14, 0.42}) {
      const Vector3d along(std::sin(angle), 0, std::cos(angle));
      nearest = std::min(nearest, toCone(p, Vector3d::Zero(), kLength * along, kRadius, kRadius));
    }
    return nearest;
  };
  return meshOf(body, AlignedBox3d(Vector3d(-30, -5, -5), Vector3d(30, 5, 60)), 1.4);
}

Vector3d meanOf(std::span<const Vector3d> positions) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& p : positions) sum += p;
  return sum / static_cast<double>(positions.size());
}

class Retraction : public LiveScene {
 public:
  explicit Retraction(int threads) : m_world(threads) {
    const auto isGrown = [](const Vector3d& p) { return p.y() > kGrown; };
    const auto addOrgan = [&](const char* name, const SceneMesh& mesh) {
      const World::BodyId id =
          m_world.addMesh(name, mesh, static_cast<double>(mesh.positions.size()) / kMass);
      m_world.pin(id, isGrown);
      m_world.addStiffness(id, 1e-3, 1e-3);
      return id;
    };
    m_liver = addOrgan("liver", anatomicalLiver(5));
    m_world.addInside(m_liver, kMass, isInLiver, isGrown);
    m_stomach = addOrgan("stomach", anatomicalStomach(5));
    for (const World::BodyId organ : {m_liver, m_stomach}) m_world.addVolume(organ, 0);
    m_fan = fan();
    SceneMesh placed = m_fan;
    for (Vector3d& p : placed.positions) p = poseAt(0) * p;
    m_retractor = m_world.addMesh("retractor", placed, 0.0);
    m_world.addRigid(m_retractor, m_world.bodies()[m_retractor].count);
    for (const auto& [a, b] : std::array<std::array<World::BodyId, 2>, 3>{
             {{m_liver, m_retractor}, {m_liver, m_stomach}, {m_stomach, m_retractor}}}) {
      m_world.addPair(a, b, {.method = Method::Auto, .thickness = kGap}, kGap);
      m_world.addGuard(a, b);
    }
    const std::array shaft{Vector3d(0, 0, -300), Vector3d(0, 0, -100), Vector3d(0, 0, 3)};
    m_shaft = m_world.addRigidMesh("shaft", tubeAround(shaft, 4, 32));  // shown only
    placeShaft(0);
  }

  World& world() override { return m_world; }

  std::vector<BodyLook> looks() override {
    constexpr double kWet = 0.28;
    return {{m_liver, "Liver", kLiverColour, 1, true, 0, kWet},
            {m_stomach, "Stomach", kStomachColour, 1, true, 0, kWet},
            {m_retractor, "", kSteelColour, 0.6, true, 0, 0.3, 1},
            {m_shaft, "", kSteelColour, 1, true, 0, 0.3, 1}};
  }

  PictureView view() override {
    return {.from = {0.3, -1, -1.5}, .centre = {12, -10, 8}, .height = 160};
  }

  /// What the retractor does to the liver.
  std::vector<PictureNote> notes() override {
    std::vector<PictureNote> notes = forceNotes(touched(), force(), 10);
    notes.push_back({"Retractor", m_world.bodies()[m_shaft].translation + Vector3d(20, -20, -8)});
    return notes;
  }

  void computeFrame(int frame) override {
    m_world.predict(kStep, Vector3d::Zero(), 0.1);
    const Eigen::Isometry3d pose = poseAt(frame + 1);
    for (std::size_t v = 0; v < m_fan.positions.size(); ++v)
      m_world.positions(m_retractor)[v] = pose * m_fan.positions[v];
    for (int round = 0; round < kRounds; ++round) {
      m_world.detect();
      m_world.solve(kIterations);
    }
    m_world.hold();
    m_world.commit();
    placeShaft(frame + 1);
    m_centres.push_back({meanOf(m_world.positions(m_liver)), meanOf(m_world.positions(m_stomach))});
  }

  std::vector<std::pair<std::string, double>> values() override {
    std::vector<std::pair<std::string, double>> values{
        {"lift mm", kLift * lifted(static_cast<double>(m_centres.size()))},
        {"force N", force().norm()},
        {"drift mm", drift()}};
    for (const World::BodyId organ : {m_liver, m_stomach})  // numbered as their volumes
      values.emplace_back(m_world.bodies()[organ].name + " volume share",
                          volumeOf(m_world.positions(organ), m_world.bodies()[organ].triangles) /
                              m_world.solver().volumes[organ].rest);
    return values;
  }

  std::string fault() override {
    for (const World::Pair& pair : m_world.pairs())
      if (m_world.intersect(pair.a, pair.b))
        return m_world.bodies()[pair.a].name + " and " + m_world.bodies()[pair.b].name +
               " intersect.";
    return drift() <= kMostDrift ? ""
                                 : "a body's centre drifted by " + std::to_string(drift()) + " mm.";
  }

 private:
  static double lifted(double frame) { return (1 - std::cos(2 * pi * frame / kPeriod)) / 2; }

  /// Beneath the left lobe, y away from it: z comes from the body's left and from the front.
  static Eigen::Isometry3d poseAt(double frame) {
    const Vector3d y = Vector3d(0.55, 0.82, -1).normalized(), side(-0.6, 0.5, 0.08),
                   z = (side - side.dot(y) * y).normalized();
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() << y.cross(z), y, z;
    pose.translation() = Vector3d(38, -30, 16) - 26 * z + 4 * y + kLift * lifted(frame) * kUp;
    return pose;
  }
  void placeShaft(double frame) {
    const Eigen::Isometry3d pose = poseAt(frame);
    m_world.place(m_shaft, pose.linear(), pose.translation());
  }

  Vector3d force() const { return -m_world.force(m_retractor) / 1000; }  // N, on the liver

  /// The middle of the retractor's contacts with the liver.
  Vector3d touched() {
    std::vector<Vector3d> at;
    for (const VertexTriangleContact& c : m_world.contacts(m_liver, m_retractor).vertexTriangle())
      at.push_back(m_world.positions(m_liver)[c.vertex]);
    return at.empty() ? Vector3d::Zero() : meanOf(at);
  }

  /// mm: how far a body's centre is from where it was a period ago, once two have passed.
  double drift() const {
    if (m_centres.size() <= 2 * kPeriod) return 0;
    double most = 0;
    for (int i = 0; i < 2; ++i)
      most = std::max(most,
                      (m_centres.back()[i] - m_centres[m_centres.size() - 1 - kPeriod][i]).norm());
    return most;
  }

  World m_world;
  World::BodyId m_liver = 0, m_stomach = 0, m_retractor = 0, m_shaft = 0;
  SceneMesh m_fan;                                 // in its own frame
  std::vector<std::array<Vector3d, 2>> m_centres;  // by frame
};

}  // namespace
}  // namespace palpate::scenes

int main(int count, char** arguments) {
  using namespace palpate::scenes;
  return runScene(
      {.name = "Retraction",
       .description = "A fan retractor lifts the left lobe of a liver from the stomach.",
       .frames = 1000,
       .frameMilliseconds = 1000.0 / 60,
       .keys = "n",
       .make = [](int threads) { return std::make_unique<Retraction>(threads); }},
      count, arguments);
}
