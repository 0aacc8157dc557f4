// Two instrument arms of five rigid links each at a gallbladder, among organs that breathe:
// transforms only, and contacts become corrections of the arms' joints.
#include "Anatomy.h"
#include "InstrumentArm.h"
#include "SceneProgram.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace palpate::scenes {
namespace {

using Eigen::Vector3d, std::numbers::pi;
using Joints = InstrumentArm::Joints;
using BothJoints = Eigen::Matrix<double, 12, 1>;

// Lengths in mm. kStep: what an arm's points move in a frame of 1/60 s, of its own accord.
constexpr double kGap = 1, kSight = 2 * kGap, kStep = 1;
constexpr int kRounds = 6, kIterations = 12, kPeriod = 240, kLinks = InstrumentArm::kLinks,
              kJoints = 3;
const Vector3d kWork(-22, -58, -44);  // where the arms meet, at the gallbladder
constexpr World::BodyId kCavity = 0, kLiver = 1, kFirstArm = 4, kSecondArm = kFirstArm + kLinks;

struct Row {
  double gap;        // mm
  BothJoints slope;  // mm for each joint's unit
};

/// Where the hand leads an arm; side: -1, 1.
Joints targetOf(double side, double phase) {
  const double s = std::sin(phase), c = std::cos(phase), twice = std::sin(2 * phase + side);
  return (Joints() << 0.35 * s, 0.35 * side * c, 56 + 20 * twice, 0.8 * c - 0.3, 0.7 * s * side,
          0.25 - 0.35 * twice)
      .finished();
}

class RobotArms : public LiveScene {
 public:
  explicit RobotArms(int threads) : m_world(threads), m_check(Settings{.threads = threads}) {
    SceneMesh cavity = sphere(16);
    for (Vector3d& p : cavity.positions) p = Vector3d(0, -30, -10) + 140 * p;
    addMesh("cavity", cavity);
    addMesh("liver", anatomicalLiver(5));
    addMesh("gallbladder", anatomicalGallbladder(2.15));
    addMesh("stomach", anatomicalStomach(5));
    for (const double side : {-1.0, 1.0}) {
      Eigen::Isometry3d port = Eigen::Isometry3d::Identity();
      port.translation() = kWork + Vector3d(80 * side, -43, -30);
      port.linear() =
          Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), kWork - port.translation())
              .matrix();
      m_arms.emplace_back(port, targetOf(side, 0));
      for (const auto& [name, shape, drawn] : InstrumentArm::makeLinks()) {
        addToCheck(drawn);
        m_world.addShape((side < 0 ? "left " : "right ") + name, shape, drawn);
      }
    }
    addPairs();
    m_duct = m_world.addRigidMesh("bile duct", bileDuct(1.4));  // this and what follows: shown only
    const std::array outside{Vector3d(0, 0, -300), Vector3d(0, 0, -70)};
    for (World::BodyId& shaft : m_shafts)
      shaft = m_world.addRigidMesh("shaft", tubeAround(outside, 3, 32));
    for (int joint = 0; joint < 2 * kJoints; ++joint) {
      SceneMesh ball = sphere(8);
      for (Vector3d& p : ball.positions) p *= 3.5 - 0.2 * (joint % kJoints);
      m_joints.push_back(m_world.addRigidMesh("joint", ball));
    }
    move();
  }

  World& world() override { return m_world; }

  std::vector<BodyLook> looks() override {
    std::vector<BodyLook> looks{
        {.body = kCavity, .label = "", .colour = kTissueColour, .frontFaces = false},
        {kLiver, "Liver", kLiverColour, 1, true, 0, 0.28},
        {kLiver + 1, "", {0.45, 0.56, 0.30}, 1, true, 0, 0.28},
        {m_duct, "", {0.52, 0.60, 0.28}, 1, true, 0, 0.28},
        {kLiver + 2, "Stomach", kStomachColour, 1, true, 0, 0.28}};
    for (World::BodyId link = kFirstArm; link < kFirstArm + 2 * kLinks; ++link) {
      const char* label = link == kFirstArm ? "Left arm" : link == kSecondArm ? "Right arm" : "";
      looks.push_back({link, label, kSteelColour, 1, true, 0, 0.3, 1});
    }
    for (const World::BodyId shaft : m_shafts)
      looks.push_back({shaft, "", kSteelColour, 1, true, 0, 0.3, 1});
    for (const World::BodyId joint : m_joints)
      looks.push_back({joint, "", {0.15, 0.16, 0.18}, 1, true, 0, 0.4, 0.5});
    return looks;
  }
  PictureView view() override {
    return {.from = {0.1, -1, -0.35}, .centre = kWork + Vector3d(6, 0, 9), .height = 100};
  }
  std::vector<PictureNote> notes() override {
    return {{"Gallbladder", m_world.bodies()[kLiver + 1].translation + Vector3d(-30, -66, -62)}};
  }
  void computeFrame(int frame) override {
    const std::vector<InstrumentArm> arms = m_arms;
    const double breath = m_breath;
    m_breath += 2 * pi / kPeriod;
    for (int i = 0; i < 2; ++i) {
      const Joints target = targetOf(2 * i - 1, 2 * pi * (frame + 1) / kPeriod),
                   now = arms[i].joints();
      const double length = (target - now).cwiseAbs().dot(InstrumentArm::reach());
      m_arms[i].bend(now + std::min(1.0, kStep / length) * (target - now));
    }
    for (int round = 0; round < kRounds && move() < kGap / 2; ++round) correct();
    if (m_held = move() <= 0; m_held == 0) return;
    m_arms = arms, m_breath = breath;  // all waits, as it was
    move();
  }

  std::vector<std::pair<std::string, double>> values() override {
    return {{"least distance mm", m_nearest},
            {"held", m_held},
            {"arms touch", m_armsTouch},
            {"organs touch", m_organsTouch}};
  }

  /// By other means than those that hold links apart: their tessellations do not intersect, by
  /// exact arithmetic, and a vertex of each, which stands for all then, is not inside another.
  std::string fault() override {
    const auto& bodies = m_world.bodies();
    for (std::size_t i = 0; i < m_meshes.size(); ++i)
      for (const GeometryId id : {m_meshes[i], m_firsts[i]})
        m_check.setTransform(id, {bodies[i].rotation, bodies[i].translation});
    m_check.detectCollision();
    m_check.advance();
    for (const auto& [a, b, gap] : m_world.pairs()) {
      const CollisionData& data = m_check.collisionData(m_meshes[a], m_meshes[b]);
      m_check.queries().findInsideVertices(m_firsts[b], m_meshes[a], m_inA);
      m_check.queries().findInsideVertices(m_firsts[a], m_meshes[b], m_inB);
      const bool inA = !m_inA.empty(), inB = !m_inB.empty();
      if (!data.intersectingTriangles().empty() || inA || inB != (b == kCavity))
        return bodies[a].name + " and " + bodies[b].name + " overlap.";
    }
    return "";
  }

 private:
  void addToCheck(const SceneMesh& mesh) {
    m_meshes.push_back(m_check.addTriangleMesh(mesh.positions, mesh.triangles));
    m_firsts.push_back(m_check.addPointSet({mesh.positions.data(), 1}));
  }
  void addMesh(const std::string& name, const SceneMesh& mesh) {
    addToCheck(mesh);
    m_world.addRigidMesh(name, mesh);
  }

  /// Each link with all that it is not joined to; the shaft came in through the cavity's wall.
  void addPairs() {
    for (World::BodyId a = kFirstArm; a < m_world.bodies().size(); ++a) {
      const int link = (a - kFirstArm) % kLinks;
      for (World::BodyId b = link == 0 ? kLiver : kCavity; b < a; ++b) {
        const bool sameArm = b >= kFirstArm && (b < kSecondArm) == (a < kSecondArm);
        if (sameArm && InstrumentArm::areJoined(link, (b - kFirstArm) % kLinks)) continue;
        m_world.addPair(a, b, {.method = Method::Proximity, .thickness = kSight}, kGap);
        m_check.addCollisionPair(m_meshes[a], m_meshes[b], {.method = Method::Intersection});
      }
    }
  }

  /// Places everything and finds what is near. Returns the least distance, at most kSight.
  double move() {
    for (const World::BodyId organ : {kLiver, kLiver + 1, kLiver + 2, m_duct})
      m_world.place(organ, Eigen::AngleAxisd(0.03 * std::sin(m_breath), Vector3d::UnitX()).matrix(),
                    {0, 0, 5 * std::sin(m_breath)});
    for (int i = 0; i < 2 * kLinks; ++i) {
      const Eigen::Isometry3d& at = m_arms[i / kLinks].link(i % kLinks);
      m_world.place(kFirstArm + i, at.linear(), at.translation());
      if (i % kLinks == 0) m_world.place(m_shafts[i / kLinks], at.linear(), at.translation());
      const int joint = i % kLinks - 1;
      if (joint >= 0 && joint < kJoints)
        m_world.place(m_joints[kJoints * (i / kLinks) + joint], at.linear(), at.translation());
    }
    m_world.detect();
    m_rows.clear();
    m_nearest = kSight, m_armsTouch = m_organsTouch = 0;
    for (const auto& [a, b, gap] : m_world.pairs()) {
      for (const ShapeContact& c : m_world.contacts(a, b).shape())
        addRow(a, b, c.distance, -c.normal, c.pointOnShape, c.point);
      for (const ShapeShapeContact& c : m_world.contacts(a, b).shapeShape())
        addRow(a, b, c.distance, c.normal, c.pointA, c.pointB);
    }
    return m_nearest;
  }

  /// normal: towards a, which is a link.
  void addRow(World::BodyId a, World::BodyId b, double distance, const Vector3d& normal,
              const Vector3d& onA, const Vector3d& onB) {
    Row row{distance, BothJoints::Zero()};
    const auto add = [&](World::BodyId body, const Vector3d& point, const Vector3d& direction) {
      const int link = body - kFirstArm, arm = link / kLinks;
      row.slope.segment<6>(6 * arm) += m_arms[arm].slope(link % kLinks, point, direction);
    };
    add(a, onA, normal);
    if (b >= kFirstArm) add(b, onB, -normal);
    m_nearest = std::min(m_nearest, distance);
    m_organsTouch += distance < kGap && b >= kLiver && b < kFirstArm;
    m_armsTouch += distance < kGap && b >= kFirstArm && b < kSecondArm && a >= kSecondArm;
    m_rows.push_back(row);
  }

  /// Joints give way, those first that move least for it, until gaps are wide enough as far as
  /// slopes tell.
  void correct() {
    BothJoints change = BothJoints::Zero(), ease;
    ease << InstrumentArm::reach(), InstrumentArm::reach();
    ease = ease.cwiseAbs2().cwiseInverse().eval();
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      for (const Row& row : m_rows) {
        const BothJoints push = ease.cwiseProduct(row.slope);
        const double missing = kGap - row.gap - row.slope.dot(change), give = push.dot(row.slope);
        if (missing > 0 && give > 0) change += missing / give * push;
      }
    }
    for (int i = 0; i < 2; ++i) m_arms[i].bend(m_arms[i].joints() + change.segment<6>(6 * i));
  }

  World m_world;
  OctreeBasedCD m_check;
  std::vector<InsideVertex> m_inA, m_inB;
  std::vector<GeometryId> m_meshes, m_firsts;  // of m_check, by body: tessellation, its vertex 0
  std::vector<InstrumentArm> m_arms;
  std::vector<Row> m_rows;
  World::BodyId m_duct = 0;
  std::array<World::BodyId, 2> m_shafts{};
  std::vector<World::BodyId> m_joints;
  double m_breath = 0, m_nearest = kSight;
  int m_armsTouch = 0, m_organsTouch = 0, m_held = 0;
};

}  // namespace
}  // namespace palpate::scenes

int main(int count, char** arguments) {
  using namespace palpate::scenes;
  return runScene(
      {.name = "RobotArms",
       .description = "Two arms of rigid links at a gallbladder, among organs that breathe.",
       .frames = 480,
       .frameMilliseconds = 1000.0 / 60,
       .keys = "n",
       .make = [](int threads) { return std::make_unique<RobotArms>(threads); }},
      count, arguments);
}
