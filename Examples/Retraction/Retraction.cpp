// A liver is pressed onto a stomach and drawn aside, again and again, with a membrane between them
// that a grasper gathers into folds. Nothing ever intersects, and nothing drifts.
#include "SceneProgram.h"
#include "Scenes.h"

#include <Eigen/Geometry>

#include <array>
#include <cmath>
#include <numbers>

namespace palpate::scenes {
namespace {

using Eigen::Vector3d, std::numbers::pi;

// Lengths in mm, times in s, masses in kg.
constexpr int kPeriod = 150, kSubsteps = 2, kRounds = 1, kIterations = 8;
constexpr double kStep = 1.0 / 60 / kSubsteps, kScale = 50, kGap = 0.8, kHalfMembrane = 70;
constexpr double kMostDrift = 1;  // of a body's centre from one period to the next
const Vector3d kGravity(0, 0, -2000);

Vector3d meanOf(std::span<const Vector3d> positions) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& p : positions) sum += p;
  return sum / static_cast<double>(positions.size());
}

/// A body of organs() whose lowest (highest) point is at this height.
SceneMesh organAt(std::size_t index, double height, bool standing) {
  SceneMesh organ = organs().meshes[index];
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : organ.positions) box.extend(p);
  const double edge = standing ? box.min().z() : box.max().z();
  for (Vector3d& p : organ.positions)
    p = kScale * (p - Vector3d(box.center().x(), box.center().y(), edge)) +
        height * Vector3d::UnitZ();
  return organ;
}

class Retraction : public LiveScene {
 public:
  explicit Retraction(int threads) : m_world(threads), m_check(Settings{.threads = threads}) {
    SceneMesh membrane = sheet(36);  // with a flap of 40 mm beside the organs
    for (Vector3d& p : membrane.positions) p = {90 * p.x() - 20, kHalfMembrane * p.y(), 0};
    m_bodies = {m_world.addMesh("liver", organAt(0, 3, true), 1000),
                m_world.addMesh("stomach", organAt(1, -3, false), 1000),
                m_world.addMesh("membrane", membrane, 10000)};
    const auto [liver, stomach, sheetBody] = m_bodies;
    m_world.pin(liver, [](const Vector3d& p) { return p.z() > 0.8 * 1.5 * kScale; });
    m_world.pin(stomach, [](const Vector3d& p) { return p.z() < -0.8 * 1.6 * kScale; });
    m_world.pin(sheetBody, [](const Vector3d& p) {
      return p.x() < -109.9 || std::abs(std::abs(p.x()) - kHalfMembrane) < 0.1;
    });
    for (const World::BodyId organ : {liver, stomach}) {
      m_world.addStiffness(organ, 1e-3, 3e-3);
      m_world.addVolume(organ, 0);
    }
    m_world.addStiffness(sheetBody, 1e-4, 30);
    for (const auto& [a, b] :
         std::array<std::array<World::BodyId, 2>, 4>{{{liver, stomach},
                                                      {liver, sheetBody},
                                                      {stomach, sheetBody},
                                                      {sheetBody, sheetBody}}}) {
      m_world.addPair(a, b, {.method = Method::Auto, .thickness = kGap}, kGap);
      m_world.addGuard(a, b);
    }
    for (const World::Body& body : m_world.bodies())
      m_ids.push_back(m_check.addTriangleMesh(m_world.positions(m_ids.size()), body.triangles));
    for (const World::Pair& pair : m_world.pairs())
      m_check.addCollisionPair(m_ids[pair.a], m_ids[pair.b], {.method = Method::Intersection});
    m_rest = m_world.solver().now;
  }

  World& world() override { return m_world; }

  std::vector<BodyLook> looks() override {
    const auto [liver, stomach, membrane] = m_bodies;
    return {{liver, "Liver", kLiverColour},
            {stomach, "Stomach", kStomachColour},
            {membrane, "Membrane", kGallbladderColour, 0.6}};
  }

  PictureView view() override { return {.from = {0.5, -1, 0.55}}; }

  /// What the membrane and the stomach do to the liver.
  std::vector<PictureNote> notes() override {
    return forceNotes(touched(), m_world.force(m_bodies[0]) / 1000, 50);
  }

  void computeFrame(int frame) override {
    for (int substep = 1; substep <= kSubsteps; ++substep) {
      m_world.predict(kStep, kGravity, 0.02);
      drive((frame + static_cast<double>(substep) / kSubsteps) / kPeriod);
      for (int round = 0; round < kRounds; ++round) {
        m_world.detect();
        m_world.solve(kIterations);
      }
      m_world.hold();
      m_world.commit();
    }
    std::array<Vector3d, 3> centres;
    for (int i = 0; i < 3; ++i) centres[i] = meanOf(m_world.positions(m_bodies[i]));
    m_centres.push_back(centres);
  }

  std::vector<std::pair<std::string, double>> values() override {
    std::vector<std::pair<std::string, double>> values{{"drift mm", drift()},
                                                       {"folds touch", foldContacts()}};
    for (const VolumeConstraint& volume : m_world.solver().volumes) {
      const std::span<const Vector3d> positions(m_world.solver().now.data() + volume.first,
                                                volume.count);
      values.emplace_back(volume.first == 0 ? "liver volume share" : "stomach volume share",
                          volumeOf(positions, volume.triangles) / volume.rest);
    }
    return values;
  }

  std::string fault() override {
    for (std::size_t i = 0; i < m_ids.size(); ++i)
      m_check.setPositions(m_ids[i], m_world.positions(i));
    m_check.detectCollision();
    m_check.advance();
    for (const World::Pair& pair : m_world.pairs()) {
      if (!m_check.collisionData(m_ids[pair.a], m_ids[pair.b]).intersectingTriangles().empty())
        return m_world.bodies()[pair.a].name + " and " + m_world.bodies()[pair.b].name +
               " intersect.";
    }
    return drift() <= kMostDrift ? ""
                                 : "a body's centre drifted by " + std::to_string(drift()) + " mm.";
  }

 private:
  /// What is held by hand: the liver's top goes down, aside and up; the membrane's one side is
  /// gathered, its flap folded.
  void drive(double periods) {
    const double angle = 2 * pi * periods, in = (1 - std::cos(angle)) / 2;
    const Vector3d liver(12 * std::sin(angle) * in, 8 * std::sin(2 * angle) * in, -16 * in);
    const Vector3d gathered(-45 * in, 0, 6 * std::sin(angle)), folded(40.3 * in, 0, 1.5 * in);
    Xpbd& solver = m_world.solver();
    const std::size_t liverEnd = m_world.bodies()[m_bodies[0]].count,
                      membraneBegin = m_world.bodies()[m_bodies[2]].first;
    for (std::size_t i = 0; i < m_rest.size(); ++i) {
      if (solver.inverseMasses[i] > 0) continue;
      if (i < liverEnd) solver.now[i] = m_rest[i] + liver;
      if (i >= membraneBegin && m_rest[i].x() > 0) solver.now[i] = m_rest[i] + gathered;
      if (i >= membraneBegin && m_rest[i].x() < -100) solver.now[i] = m_rest[i] + folded;
    }
  }

  /// The middle of the contacts at the liver.
  Vector3d touched() {
    std::vector<Vector3d> at;
    for (const World::BodyId other : {m_bodies[1], m_bodies[2]})
      for (const VertexTriangleContact& c : m_world.contacts(m_bodies[0], other).vertexTriangle())
        at.push_back(m_world.positions(m_bodies[0])[c.vertex]);
    return at.empty() ? Vector3d::Zero() : meanOf(at);
  }

  double foldContacts() {
    const CollisionData& folds = m_world.contacts(m_bodies[2], m_bodies[2]);
    return static_cast<double>(folds.vertexTriangle().size() + folds.edgeEdge().size());
  }

  /// L: how far a body's centre is from where it was a period ago, once two have passed.
  double drift() const {
    if (m_centres.size() <= 2 * kPeriod) return 0;
    double most = 0;
    for (int i = 0; i < 3; ++i)
      most = std::max(most,
                      (m_centres.back()[i] - m_centres[m_centres.size() - 1 - kPeriod][i]).norm());
    return most;
  }

  World m_world;
  OctreeBasedCD m_check;  // sees positions only, by another method than those that hold them apart
  std::vector<GeometryId> m_ids;
  std::array<World::BodyId, 3> m_bodies{};
  std::vector<Vector3d> m_rest;
  std::vector<std::array<Vector3d, 3>> m_centres;  // by frame
};

}  // namespace
}  // namespace palpate::scenes

int main(int count, char** arguments) {
  using namespace palpate::scenes;
  return runScene(
      {.name = "Retraction",
       .description =
           "A liver pressed onto a stomach and drawn aside, a membrane gathered between them.",
       .frames = 1000,
       .frameMilliseconds = 1000.0 / 60,
       .keys = "n",
       .make = [](int threads) { return std::make_unique<Retraction>(threads); }},
      count, arguments);
}
