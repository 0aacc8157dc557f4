// A spherical burr in the hollow that it has drilled into a skull, under flowing water: debris and
// blood sink over the bone. The picture is a section through the hollow. The bone does not move, so
// only the particles' octree changes. The particles meet the bone by planes in an octree's leaves,
// built before the first frame.
#include "CommandLine.h"
#include "SceneProgram.h"
#include "Scenes.h"

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <tuple>

namespace palpate::scenes {
namespace {

using Eigen::Vector3d, std::numbers::pi;
// Lengths in mm, times in s. Nothing moves further than kReach in a substep, which is what
// contacts are found within: so each knows its side, and Proximity is enough.
constexpr double kFrame = 1.0 / 60, kReach = 0.4, kSpeed = 48, kParticle = 0.1, kBurr = 4,
                 kGap = 0.02, kBrick = 5;
constexpr double kBone = 120, kFloor = -180;
constexpr double kHollow = 7, kFloorWidth = 2, kRim = 11;  // its depth and two radii
const Vector3d kMiddle(0, 0, 0), kGravity(0, 0, -600);     // less what water carries
const Vector3d kDrilled = Vector3d(0, -0.3, 1).normalized();
/// From the whole bone's surface: of the outer table, spongy bone, inner table and brain.
constexpr std::array kDepths{0.0, 2.5, 9.0, 11.5, 26.0};
const Vector3d kBehind = kDrilled.cross(Vector3d::UnitX());  // the section, from its normal

struct Size {
  int particles = 100'000, triangles = 500'000;
};
/// Of the bone, which is seen whole from its middle, along a unit vector.
double wholeRadius(const Vector3d& d) {
  return kBone * (1 + 0.06 * std::sin(5 * d.x() + 1) * std::cos(4 * d.y()) - 0.1 * d.y() * d.y() +
                  0.003 * std::sin(23 * d.x()) * std::sin(19 * d.y() + 7 * d.z()));
}
double boneRadius(const Vector3d& d) {
  const double away = kBone * (d - kDrilled).norm(),
               up = std::clamp((away - kFloorWidth) / (kRim - kFloorWidth), 0.0, 1.0);
  return wholeRadius(d) - kHollow * (1 + std::cos(pi * up)) / 2;
}

/// Directions nearer to the hollow, where the bone's triangles are smaller.
Vector3d closer(const Vector3d& d) {
  const Vector3d across = d - d.dot(kDrilled) * kDrilled;
  const double angle = std::atan2(across.norm(), d.dot(kDrilled)),
               to = angle * (1 - 0.7 * std::exp(-2 * angle * angle));
  return std::cos(to) * kDrilled + std::sin(to) * across.stableNormalized();
}

/// A layer of the section, between two depths below the whole bone's surface.
SceneMesh layer(double from, double to) {
  constexpr std::uint32_t kSteps = 120;
  constexpr double kSide = 0.4;  // radians
  SceneMesh face;
  for (std::uint32_t i = 0; i <= kSteps; ++i) {
    const double x = kSide * (2.0 * i / kSteps - 1);
    const Vector3d d = std::cos(x) * kDrilled + std::sin(x) * Vector3d::UnitX();
    for (const double depth : {to, from})
      face.positions.push_back(std::min(boneRadius(d), wholeRadius(d) - depth) * d);
    const std::uint32_t v = 2 * i;
    if (i < kSteps)
      face.triangles.insert(face.triangles.end(), {{v, v + 2, v + 1}, {v + 1, v + 2, v + 3}});
  }
  return face;
}

class BoneDrilling : public LiveScene {
 public:
  BoneDrilling(const Size& size, int threads) : m_sag(16'000.0 / size.triangles), m_world(threads) {
    SceneMesh bone = cubeSphere(static_cast<int>(std::ceil(std::sqrt(size.triangles / 12.0))));
    for (Vector3d& p : bone.positions) {
      const Vector3d d = closer(p);
      p = boneRadius(d) * d;
    }
    m_bone = m_world.addRigidMesh("bone", bone);
    m_burrAt = burrTarget(0) + 5 * Vector3d::UnitZ();
    m_burr = m_world.addShape("burr", Sphere{kMiddle, kBurr}, capsule(kMiddle, kMiddle, kBurr, 8));
    m_shaft = m_world.addRigidMesh("shaft", capsule(kMiddle, {10, 6, 40}, 1.5, 8));  // shown only
    for (std::size_t i = 0; i < m_layers.size(); ++i)
      m_layers[i] = m_world.addRigidMesh("layer", layer(kDepths[i], kDepths[i + 1]));  // shown only
    placeBurr();
    std::vector<Vector3d> positions(size.particles);
    for (std::size_t i = 0; i < positions.size(); ++i) {  // sinking already; an eighth at the burr
      Vector3d& p = positions[i];
      do
        p = i % 8 == 0 ? m_burrAt + within({-14, -14, -9}, {14, 14, 14})
                       : within({-130, -150, kFloor}, {130, 120, kBone + 180});
      while (p.norm() < (i % 8 == 0 ? boneRadius(p.normalized()) + 1 : 1.2 * kBone));
    }
    // Neighbours have near indices, as solvers of particles arrange them: they share cache lines.
    std::sort(positions.begin(), positions.end(), [](const Vector3d& a, const Vector3d& b) {
      const Vector3d s = (a / kBrick).array().floor(), t = (b / kBrick).array().floor();
      return std::tuple(s.x(), s.y(), a.z()) < std::tuple(t.x(), t.y(), b.z());
    });
    m_particles = m_world.addPoints("particles", positions, kParticle, 1.0);
    // Of the bone a particle needs no more than a plane, which may be off by half its radius.
    m_world.addPair(m_particles, m_bone,
                    {.method = Method::Proxy, .thickness = kReach, .allowedError = kParticle / 2},
                    kGap);
    m_world.addPair(m_bone, m_burr,
                    {.method = Method::Proximity, .thickness = kReach, .contacts = Contacts::All},
                    0);
    m_world.detectOnly();  // builds the leaves
  }

  World& world() override { return m_world; }

  std::vector<BodyLook> looks() override {
    return {{m_bone, "", kBoneColour, 1, true, 0, 0.7},
            {m_layers[0], "", {1, 0.95, 0.82}, 1, true, 0, 0.7, 0, false},
            {m_layers[1], "", {0.85, 0.52, 0.40}, 1, true, 0, 0.9, 0, false},
            {m_layers[2], "", {1, 0.95, 0.82}, 1, true, 0, 0.7, 0, false},
            {m_layers[3], "", {1, 0.80, 0.78}, 1, true, 0, 0.5, 0, false},
            {m_burr, "Burr", kSteelColour, 1, true, 0, 0.3, 1, false},
            {m_shaft, "", kSteelColour, 1, true, 0, 0.3, 1, false},
            {m_particles, "", kBloodColour}};
  }
  PictureView view() override {
    return {.from = {0.15, -1, 0.12},
            .centre = kBone * kDrilled + Vector3d(1, 0, -1),
            .height = 36,
            .section = Plane{.normal = -kBehind}};
  }
  std::vector<PictureNote> notes() override {
    std::vector<PictureNote> notes;
    for (const auto& [text, depth] : {std::pair("outer table", kDepths[1] / 2),
                                      {"spongy bone", (kDepths[1] + kDepths[2]) / 2},
                                      {"inner table", (kDepths[2] + kDepths[3]) / 2},
                                      {"brain", kDepths[3] + 3}}) {
      constexpr double kAngle = 0.17;
      const Vector3d d = std::cos(kAngle) * kDrilled + std::sin(kAngle) * Vector3d::UnitX();
      notes.push_back({text, (wholeRadius(d) - depth) * d});
    }
    return notes;
  }
  void computeFrame(int frame) override {
    double fastest = 0;
    for (const Vector3d& v : m_world.solver().velocities) fastest = std::max(fastest, v.norm());
    const double speed = std::min(kSpeed, fastest - kFrame * kGravity.z());
    const int substeps = static_cast<int>(std::ceil(speed * kFrame / kReach));
    m_fallen = m_rebuilt = 0;
    for (int substep = 1; substep <= substeps; ++substep) {
      m_world.detect();  // where all is: planes that hold for as far as anything moves
      m_rebuilt += m_world.detection().statistics().rebuiltOctrees;
      moveBurr(burrTarget(frame + static_cast<double>(substep) / substeps));
      m_world.predict(kFrame / substeps, kGravity, 0.02);
      m_world.solve(2);
      keepOut();
      m_world.commit();
      raiseFallen();
    }
  }

  std::vector<std::pair<std::string, double>> values() override {
    return {{"burr distance mm", m_burrDistance},
            {"touching", m_touching},
            {"fallen", m_fallen},
            {"rebuilt", m_rebuilt}};
  }

  /// By the surface that the bone's mesh was made of.
  std::string fault() override {
    const std::span<const Vector3d> particles = m_world.positions(m_particles);
    for (std::size_t i = 0; i < particles.size(); ++i)
      if (particles[i].norm() < boneRadius(particles[i].normalized()) - m_sag)
        return "particle " + std::to_string(i) + " is inside the bone.";
    for (const Vector3d& p : m_world.bodies()[m_bone].rest)
      if ((p - m_burrAt).norm() < (1 - 1e-9) * kBurr) return "the burr is in the bone.";
    return "";
  }

 private:
  double between(double low, double high) {
    return low + (high - low) * m_random() / m_random.max();
  }
  Vector3d within(const Vector3d& low, const Vector3d& high) {
    Vector3d p;
    for (const int axis : {2, 1, 0}) p[axis] = between(low[axis], high[axis]);
    return p;
  }

  /// The hand presses 1 mm deep, along an eight.
  static Vector3d burrTarget(double frame) {
    const double phase = 2 * pi * frame / 60;
    const Vector3d way(0.02 * std::sin(phase), 0.012 * std::sin(2 * phase), 0);
    const Vector3d d = (kDrilled + way).normalized();
    return (boneRadius(d) + kBurr - 1) * d;
  }

  /// What lies within reach is behind the plane through its nearest point: so the burr, on its side
  /// of all planes, is in nothing.
  void moveBurr(const Vector3d& target) {
    const auto contacts = m_world.contacts(m_bone, m_burr).shape();
    Vector3d way = target - m_burrAt;
    way *= std::min(1.0, kReach / way.norm());
    m_burrDistance = kReach;
    for (const ShapeContact& c : contacts) m_burrDistance = std::min(m_burrDistance, c.distance);
    for (int iteration = 0; iteration < 20; ++iteration)
      for (const ShapeContact& c : contacts)
        way -= std::max(0.0, way.dot(c.normal) + kGap - c.distance) * c.normal;
    double share = std::min(1.0, kReach / way.norm());
    for (const ShapeContact& c : contacts)
      if (const double towards = way.dot(c.normal); towards > c.distance)
        share = std::min(share, std::max(0.0, c.distance / towards));
    m_burrAt += share * way;
    placeBurr();
  }

  void placeBurr() {
    for (const World::BodyId body : {m_burr, m_shaft})
      m_world.place(body, Eigen::Matrix3d::Identity(), m_burrAt);
  }

  /// None goes further than contacts were looked for, and at the bone, where water stands, a
  /// quarter of that: a plane says nothing about the next facet of the hollow. Rows are met one
  /// after another: who would end behind a plane goes only as far as the plane.
  void keepOut() {
    const std::span<const Vector3d> before = m_world.before(m_particles);
    const std::span<Vector3d> now = m_world.positions(m_particles);
    for (std::size_t i = 0; i < now.size(); ++i)
      now[i] =
          before[i] + std::min(1.0, kReach / (now[i] - before[i]).norm()) * (now[i] - before[i]);
    m_touching = 0;
    const auto keep = [&](std::uint32_t vertex, const ShapeContact& c) {
      Vector3d way = now[vertex] - before[vertex];
      way *= std::min(1.0, kReach / 4 / way.norm());
      now[vertex] = before[vertex] + way;
      const double room = std::max(0.0, c.distance), towards = -way.dot(c.normal);
      if (towards > room) now[vertex] = before[vertex] + room / towards * way;
      m_touching += c.distance < 2 * kGap;
    };
    for (const ShapeContact& c : m_world.contacts(m_particles, m_bone).shape()) keep(c.id, c);
  }

  /// What is below all else comes again: debris from the burr, blood from a vessel beside it.
  void raiseFallen() {
    Xpbd& solver = m_world.solver();  // which has the particles last
    for (std::size_t i = m_world.bodies()[m_particles].first; i < solver.now.size(); ++i) {
      if (solver.now[i].z() > kFloor) continue;
      const Vector3d vessel(-14, -25, boneRadius(Vector3d(-14, -25, 110).normalized()) + 4);
      const Vector3d away = within({-2, -2, -2}, {2, 2, 2});
      solver.now[i] = solver.before[i] = (i % 2 == 0 ? m_burrAt : vessel) + away;
      solver.velocities[i] = 40 * away;
      ++m_fallen;
    }
    // They do not sweep through what is between: at rest at the new place.
    const std::span<const Vector3d> particles = m_world.positions(m_particles);
    m_world.detection().setPositions(m_world.bodies()[m_particles].id, particles, particles);
  }

  double m_burrDistance = 0, m_sag;  // m_sag: of the bone's mesh: edge² x curvature / 8
  World m_world;
  std::minstd_rand m_random;
  World::BodyId m_bone = 0, m_burr = 0, m_shaft = 0, m_particles = 0;
  std::array<World::BodyId, 4> m_layers{};
  Vector3d m_burrAt;
  int m_touching = 0, m_fallen = 0, m_rebuilt = 0;
};

}  // namespace
}  // namespace palpate::scenes

int main(int count, char** arguments) {
  using namespace palpate::scenes;
  palpate::scenes::Size size;
  return runScene(
      {.name = "BoneDrilling",
       .description =
           "A burr in a hollow of a bone of half a million triangles, under debris and blood.",
       .frames = 300,
       .frameMilliseconds = 1000.0 / 60,
       .keys = "cn",
       .addOptions =
           [&](CLI::App& app) {
             app.add_option("--particles", size.particles, "of debris and blood")
                 ->check(between(1, 10'000'000));
             app.add_option("--triangles", size.triangles, "of the bone, at least")
                 ->check(between(1000, 10'000'000));
           },
       .make = [&](int threads) { return std::make_unique<BoneDrilling>(size, threads); }},
      count, arguments);
}
