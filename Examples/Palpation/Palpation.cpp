// A rigid probe, or the user's own tool, presses and strokes a soft organ; no vertex of the organ
// is inside the probe at the end of any frame.
#include "Anatomy.h"
#include "SceneProgram.h"

#include <palpate/Error.h>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>

#include <cmath>
#include <map>
#include <numbers>

namespace palpate::scenes {
namespace {

using Eigen::Vector3d;

constexpr double kFrame = 1.0 / 60;                 // s
constexpr double kEdge = 4.5;                       // mm, of the liver's triangles
constexpr double kMass = 1.5, kCompliance = 0.002;  // kg; mm/mN of edges
constexpr int kRounds = 2, kIterations = 8;

struct Files {
  std::filesystem::path organ, tool;
};

Eigen::AlignedBox3d boxOf(std::span<const Vector3d> positions) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : positions) box.extend(p);
  return box;
}

SceneMesh closedMesh(const std::filesystem::path& path) {
  SceneMesh mesh = readMesh(path);
  const MeshDefects defects = findMeshDefects(mesh.triangles);
  if (mesh.triangles.empty() || !defects.closed())
    throw Error(ErrorCode::NotClosed,
                "The mesh \"" + path.string() +
                    "\" has no inside: " + std::to_string(defects.open.size()) +
                    " edges are open, " + std::to_string(defects.flipped.size()) + " flipped, " +
                    std::to_string(defects.shared.size()) + " shared.");
  return mesh;
}

/// Standing on z = 0, its highest point above the origin, which was at `foot`.
SceneMesh organMesh(const std::filesystem::path& path, Vector3d& foot) {
  SceneMesh mesh = path.empty() ? anatomicalLiver(kEdge) : closedMesh(path);
  const auto [low, high] =
      std::minmax_element(mesh.positions.begin(), mesh.positions.end(),
                          [](const Vector3d& a, const Vector3d& b) { return a.z() < b.z(); });
  foot = {high->x(), high->y(), low->z()};
  for (Vector3d& p : mesh.positions) p -= foot;
  return mesh;
}

class Palpation : public LiveScene {
 public:
  Palpation(const Files& files, int threads) : m_world(threads) {
    Vector3d origin;
    SceneMesh organ = organMesh(files.organ, origin);
    m_box = boxOf(organ.positions);
    m_size = m_box.sizes().maxCoeff(), m_gap = 0.003 * m_size;
    m_organ = m_world.addMesh(files.organ.empty() ? "Liver" : "Organ", organ,
                              static_cast<double>(organ.positions.size()) / kMass);
    const double foot = 0.25 * m_box.max().z();  // it grows on what is below
    const auto isGrown = [foot](const Vector3d& p) { return p.z() < foot; };
    m_world.pin(m_organ, isGrown);
    m_world.addStiffness(m_organ, kCompliance, 3 * kCompliance);
    if (files.organ.empty())
      m_world.addInside(
          m_organ, kMass, [&](const Vector3d& p) { return isInLiver(p + origin); }, isGrown);
    m_world.addVolume(m_organ, 0);
    addTool(files.tool);
  }

  World& world() override { return m_world; }

  std::vector<BodyLook> looks() override {
    return {{m_organ, m_world.bodies()[m_organ].name, kLiverColour},
            {m_tool, m_world.bodies()[m_tool].name, kSteelColour, 0.35, true, 0, 0.3, 1}};
  }

  PictureView view() override { return {.from = {0.3, -1, 0.8}}; }

  /// What the organ does to the tool.
  std::vector<PictureNote> notes() override {
    return forceNotes(m_tip, m_world.force(m_tool) / 1000, m_size / 2);
  }

  void computeFrame(int frame) override {
    m_world.predict(kFrame, Vector3d::Zero(), 0.05);
    drive(frame);
    for (int round = 0; round < kRounds; ++round) {
      m_world.detect();
      m_world.solve(kIterations);
    }
    leaveTool();
    m_world.commit();
  }

  std::vector<std::pair<std::string, double>> values() override {
    return {
        {"force mN", m_world.force(m_tool).norm()},
        {"force z mN", m_world.force(m_tool).z()},
        {"volume share", volumeOf(m_world.positions(m_organ), m_world.bodies()[m_organ].triangles) /
                             m_world.solver().volumes[0].rest}};
  }

  std::string fault() override {
    std::size_t inside = 0;
    if (m_toolRest.positions.empty()) {  // by the definition, not by the library
      for (const Vector3d& p : m_world.positions(m_organ)) {
        const double along = std::clamp((p - m_tip).dot(m_axis), 0.0, m_length);
        inside += (p - m_tip - along * m_axis).norm() < m_radius;
      }
    } else {
      for (const World::BodyId body : {m_organ, m_tool})
        m_world.detection().setPositions(id(body), m_world.positions(body));
      std::vector<InsideVertex> found;
      m_world.detection().queries().findInsideVertices(id(m_organ), id(m_tool), found);
      inside = found.size();
    }
    return inside == 0 ? ""
                       : std::to_string(inside) + " vertices of the organ are inside the tool.";
  }

 private:
  GeometryId id(World::BodyId body) const { return m_world.bodies()[body].id; }
  void addTool(const std::filesystem::path& path) {
    m_radius = 0.05 * m_size;
    m_length = 0.6 * m_size;
    m_tip = tip(0);
    const PairSettings nearby{
        .method = Method::Proximity, .thickness = m_gap, .contacts = Contacts::All};
    if (path.empty()) {
      const Capsule shape{Vector3d::Zero(), m_length * m_axis, m_radius};
      m_tool = m_world.addShape("Probe", shape, capsule(shape.p0, shape.p1, shape.radius, 8));
      m_world.addPair(m_organ, m_tool, nearby, m_gap);
      return;
    }
    m_toolRest = closedMesh(path);  // its lowest point is the tip
    const auto lowest =
        std::min_element(m_toolRest.positions.begin(), m_toolRest.positions.end(),
                         [](const Vector3d& a, const Vector3d& b) { return a.z() < b.z(); });
    const Vector3d foot = *lowest + m_radius * Vector3d::UnitZ();
    for (Vector3d& p : m_toolRest.positions) p -= foot;
    SceneMesh placed = m_toolRest;
    for (Vector3d& p : placed.positions) p += m_tip;
    m_tool = m_world.addMesh("Tool", placed, 0.0);
    m_world.addPair(m_organ, m_tool, {.method = Method::Auto, .thickness = m_gap}, m_gap);
    m_world.addGuard(m_organ, m_tool);
    m_world.addRigid(m_tool, m_world.bodies()[m_tool].count);
  }

  /// Down into the organ, along it, and up again.
  Vector3d tip(int frame) const {
    const double phase = 2 * std::numbers::pi * frame / 240, height = m_box.max().z();
    return {0.1 * m_size * std::sin(phase), 0.05 * m_size * std::sin(2 * phase),
            height + m_radius + 2 * m_gap - 0.03 * height * (1 - std::cos(2 * phase))};
  }

  void drive(int frame) {
    if (m_toolRest.positions.empty()) {
      m_tip = tip(frame);
      m_world.place(m_tool, Eigen::Matrix3d::Identity(), m_tip);
      return;
    }
    // It may have been held: the hand follows, at most twice as fast.
    const Vector3d way = tip(frame) - m_tip;
    const double most = 2 * (tip(frame) - tip(frame + 1)).norm() + m_gap;
    m_tip += way * std::min(1.0, most / std::max(most, way.norm()));
    for (std::size_t i = 0; i < m_toolRest.positions.size(); ++i)
      m_world.positions(m_tool)[i] = m_tip + m_toolRest.positions[i];
  }

  /// Constraints are met one after another, and the solver may leave elements inside: from the
  /// probe they go out by the shortest way; what the tool would pass through, and the tool, stay.
  void leaveTool() {
    if (!m_toolRest.positions.empty()) {
      m_world.hold();
      m_tip = m_world.positions(m_tool)[0] - m_toolRest.positions[0];
      return;
    }
    constexpr int kMostRounds = 4;
    for (int round = 0; round < kMostRounds; ++round) {
      m_world.detectOnly();
      std::map<std::uint32_t, Vector3d> ways;  // the longest of each vertex
      for (const ShapeContact& c : m_world.contacts(m_organ, m_tool).shape()) {
        if (c.distance >= 0) continue;
        const Vector3d way = (m_gap / 4 - c.distance) * c.normal;
        for (const std::uint32_t v : c.vertices) {
          Vector3d& longest = ways.try_emplace(v, Vector3d::Zero()).first->second;
          if (way.norm() > longest.norm()) longest = way;
        }
      }
      for (const auto& [v, way] : ways) m_world.positions(m_organ)[v] += way;
      if (ways.empty()) break;
    }
  }

  World m_world;
  World::BodyId m_organ = 0, m_tool = 0;
  Eigen::AlignedBox3d m_box;
  double m_size = 0, m_gap = 0, m_radius = 0, m_length = 0;  // mm
  Vector3d m_tip = Vector3d::Zero(), m_axis = Vector3d(0.3, -0.2, 1).normalized();
  SceneMesh m_toolRest;  // tip's centre at the origin; empty: the probe is a capsule
};

}  // namespace
}  // namespace palpate::scenes

int main(int count, char** arguments) {
  using namespace palpate::scenes;
  palpate::scenes::Files files;
  return runScene(
      {.name = "Palpation",
       .description = "A probe presses and strokes a liver.",
       .frames = 300,
       .frameMilliseconds = 1000.0 / 60,
       .collisionMilliseconds = 1,
       .keys = "n",
       .addOptions =
           [&](CLI::App& app) {
             app.add_option("--mesh", files.organ,
                            "the organ, closed: OBJ, STL, PLY or VTK, in mm");
             app.add_option("--tool", files.tool,
                            "the tool, closed, lowest at its tip, in the organ's unit");
           },
       .make = [&](int threads) { return std::make_unique<Palpation>(files, threads); }},
      count, arguments);
}
