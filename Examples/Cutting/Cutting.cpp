// A scalpel cuts through a slab of tissue under tension. The flaps gape, and meet when the sides
// are pressed together. Beside the wound a needle cuts a hole, through which its thread follows.
#include "CommandLine.h"
#include "SceneProgram.h"
#include "Scenes.h"

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

namespace palpate::scenes {
namespace {

using Eigen::Vector3d, std::numbers::pi;
using Ids = std::vector<std::uint32_t>;

// Lengths in mm, times in s, masses in kg.
constexpr int kIterations = 12;
constexpr double kStep = 1.0 / 60;
constexpr std::array kCells{30, 20, 4};
constexpr double kCell = 2, kDepth = kCells[2] * kCell, kMass = 0.02, kCompliance = 0.05;
constexpr double kTension = 0.85;  // length across the wound without tension
constexpr double kThickness = 0.6, kGap = 0.15, kOpening = 0.5, kAhead = 2;
constexpr double kThreadRadius = 0.25, kSegment = 0.8, kThreadMass = 1e-6;
constexpr std::uint32_t kNeedle = 12, kSegments = 60;  // segments
constexpr std::uint32_t kRim = 1;                      // the tag around the hole
const Vector3d kGravity(0, 0, -300), kHole(-8.6, -9.9, 0);
// The story, in frames: the blade goes down, along the wound, up; then the sides close.
constexpr double kDown = 12, kAlong = 70, kUp = 12, kClosing = 40, kFrames = 150;
constexpr double kStart = -12, kEnd = 14;  // of the blade's leading edge
constexpr double kBladeTail = 7.5, kBladeHalf = 0.15;

double part(double frame, double from, double length) {
  return std::clamp((frame - from) / length, 0.0, 1.0);
}
/// The wound's line, along x.
double lineAt(double x) { return 1.5 * std::sin(0.08 * x); }

/// A blade of even thickness, with its lowest point at z = 0 and its leading edge at x = 0.
SceneMesh blade() {
  std::vector<Vector3d> outline{{-4.4, 0, 0}};
  constexpr int kSteps = 10;
  for (int i = 1; i <= kSteps; ++i) {
    const double angle = pi / 2 * i / kSteps;
    outline.emplace_back(-4.4 + 4.4 * std::sin(angle), 0, 6 - 6 * std::cos(angle));
  }
  outline.insert(outline.end(), {{-0.4, 0, 16}, {-2, 0, 22}, {-5, 0, 22}, {-kBladeTail, 0, 14}});
  SceneMesh mesh;
  const auto count = static_cast<std::uint32_t>(outline.size());
  for (const double side : {-kBladeHalf, kBladeHalf})
    for (const Vector3d& p : outline) mesh.positions.emplace_back(p.x(), side, p.z());
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t next = (i + 1) % count;
    if (i > 0 && next > 0) {
      mesh.triangles.push_back({0, i, next});
      mesh.triangles.push_back({count, count + next, count + i});
    }
    mesh.triangles.insert(mesh.triangles.end(),
                          {{i, i + count, next}, {next, i + count, next + count}});
  }
  return mesh;
}

/// Cells of six tetrahedra around a diagonal. The wound's line is a row of vertices.
struct Slab {
  std::vector<Vector3d> positions;
  std::vector<Tetrahedron> tetrahedra;
  static std::uint32_t vertex(int i, int j, int k) {
    return static_cast<std::uint32_t>((i * (kCells[1] + 1) + j) * (kCells[2] + 1) + k);
  }
};
Slab slab() {
  Slab slab;
  for (int i = 0; i <= kCells[0]; ++i)
    for (int j = 0; j <= kCells[1]; ++j)
      for (int k = 0; k <= kCells[2]; ++k) {
        const double x = kCell * (i - kCells[0] / 2), y = kCell * (j - kCells[1] / 2);
        const double side = 1 - 2.0 * std::abs(j - kCells[1] / 2) / kCells[1];
        slab.positions.emplace_back(x, y + side * lineAt(x), kCell * (k - kCells[2]));
      }
  for (int i = 0; i < kCells[0]; ++i)
    for (int j = 0; j < kCells[1]; ++j)
      for (int k = 0; k < kCells[2]; ++k) {
        std::array<int, 3> axes{0, 1, 2};
        do {
          std::array<int, 3> at{i, j, k};
          Tetrahedron t{Slab::vertex(i, j, k)};
          for (int corner = 0; corner < 3; ++corner) {
            ++at[axes[corner]];
            t[corner + 1] = Slab::vertex(at[0], at[1], at[2]);
          }
          slab.tetrahedra.push_back(t);
        } while (std::next_permutation(axes.begin(), axes.end()));
      }
  return slab;
}

/// Contacts whose triangle i has the id ofA[i] or ofB[i]; none: the id i.
struct Lists {
  std::vector<VertexTriangleContact> vertexTriangle, triangleVertex;
  std::vector<EdgeEdgeContact> edgeEdge;
  explicit Lists(const CollisionData& data, const Ids& ofA = {}, const Ids& ofB = {})
      : vertexTriangle(data.vertexTriangle().begin(), data.vertexTriangle().end()),
        triangleVertex(data.triangleVertex().begin(), data.triangleVertex().end()),
        edgeEdge(data.edgeEdge().begin(), data.edgeEdge().end()) {
    for (VertexTriangleContact& c : vertexTriangle)
      if (!ofB.empty()) c.triangle = ofB[c.triangle];
    for (VertexTriangleContact& c : triangleVertex)
      if (!ofA.empty()) c.triangle = ofA[c.triangle];
  }
  std::size_t size() const {
    return vertexTriangle.size() + triangleVertex.size() + edgeEdge.size();
  }
  friend bool operator==(const Lists&, const Lists&) = default;
};

class Cutting : public LiveScene {
 public:
  Cutting(bool checks, int threads) : m_world(threads), m_threads(threads), m_checks(checks) {
    const SceneMesh handle = tubeAround(
        std::array<Vector3d, 4>{{{-4, 0, 20}, {-5, 0, 26}, {-12, 0, 45}, {-40, 0, 120}}}, 2.4, 24);
    m_blade = m_world.addRigidMesh("scalpel", blade());
    m_handle = m_world.addRigidMesh("handle", handle);  // shown only
    SceneMesh bed = sheet(24);                          // shown only
    for (Vector3d& p : bed.positions) p = {26 * p.x(), 16 * p.y(), -kDepth - 3};
    m_bed = m_world.addRigidMesh("bed", bed);
    std::vector<Vector3d> line;
    for (std::uint32_t i = 0; i <= kSegments; ++i)
      line.push_back(needleAt(0) - Vector3d(0, 0, kSegment * i));
    m_thread = m_world.addThread("thread", line, kThreadRadius, kSegments / kThreadMass);
    m_world.addStiffness(m_thread, 0, 1e-3);
    std::fill_n(m_world.solver().inverseMasses.begin() + m_world.bodies()[m_thread].first,
                kNeedle + 1, 0.0);
    const Slab tissue = slab();
    m_rest = tissue.positions;
    m_tetrahedra = tissue.tetrahedra;
    m_isRemoved.resize(m_tetrahedra.size());
    m_tags.resize(m_tetrahedra.size());
    m_around.resize(m_rest.size());
    m_tissue = m_world.addSolid("tissue", m_rest, m_tetrahedra, inverseMass());
    m_world.pin(m_tissue, [](const Vector3d& p) {
      return std::abs(p.x()) > kCell * (kCells[0] - 1) / 2.0 ||
             std::abs(p.y()) > kCell * (kCells[1] - 1) / 2.0;
    });
    for (std::uint32_t t = 0; t < m_tetrahedra.size(); ++t) addTetrahedron(t);
    m_settings = {{m_tissue,
                   m_tissue,
                   {.method = Method::Auto, .thickness = kThickness, .restDistance = 1.6 * kCell}},
                  {m_tissue, m_blade, {.method = Method::Auto, .thickness = kThickness}},
                  {m_thread,
                   m_tissue,
                   {.method = Method::Auto, .thickness = kGap, .contacts = Contacts::All}}};
    for (const auto& [a, b, settings] : m_settings) m_world.addPair(a, b, settings, kGap);
    m_world.addGuard(m_tissue, m_tissue);
    m_world.detection().setContactPredicate(id(m_thread), id(m_tissue), predicate());
    placeBlade(0);
  }

  World& world() override { return m_world; }
  std::string settings() override {
    return std::to_string(kCells[0] * kCells[1] * kCells[2] * 6) + " tetrahedra";
  }

  std::vector<BodyLook> looks() override {
    return {
        {m_tissue, "Tissue", kTissueColour, 0.75, true, 0, 0.4},
        {m_blade, "Scalpel", kSteelColour, 1, true, 0, 0.3, 1},
        {m_handle, "", kSteelColour, 1, true, 0, 0.3, 1},
        {m_thread, "Needle", kSteelColour, 1, true, 0, 0.3, 1},
        {.body = m_thread, .label = "Thread", .colour = kThreadColour, .firstElement = kNeedle}};
  }
  PictureView view() override {
    return {.from = {0.2, -1, 1.2}, .centre = {0, -1, 1}, .height = 34};
  }

  void computeFrame(int frame) override {
    m_split = m_removed = 0;
    cutWithBlade(frame + 1);
    cutWithNeedle(frame + 1);
    findThreadInHole();
    m_world.predict(kStep, kGravity, 0.1);
    placeBlade(frame + 1);
    drive(frame + 1);
    m_world.detect();
    if (m_checks) compareWithNew(frame);
    for (int half = 0; half < 2; ++half) {
      m_world.solve(kIterations / 2);
      holdThread();
    }
    m_world.hold();
    m_world.commit();
  }

  std::vector<std::pair<std::string, double>> values() override {
    const auto contacts = [&](World::BodyId a, World::BodyId b) {
      const CollisionData& data = m_world.contacts(a, b);
      return static_cast<double>(data.vertexTriangle().size() + data.triangleVertex().size() +
                                 data.edgeEdge().size());
    };
    return {{"cut ms", m_world.times().cut},
            {"split vertices", m_split},
            {"removed tetrahedra", m_removed},
            {"flaps touch", contacts(m_tissue, m_tissue)},
            {"blade touches", contacts(m_tissue, m_blade)},
            {"thread touches", contacts(m_thread, m_tissue)},
            {"filtered contacts", m_filtered}};
  }
  std::string fault() override { return m_fault; }

 private:
  GeometryId id(World::BodyId body) const { return m_world.bodies()[body].id; }
  static double inverseMass() {
    return (kCells[0] + 1) * (kCells[1] + 1) * (kCells[2] + 1) / kMass;
  }

  void addTetrahedron(std::uint32_t id) {
    const Tetrahedron& t = m_tetrahedra[id];
    for (int i = 0; i < 4; ++i) m_around[t[i]].push_back(id);
    const std::uint32_t first = m_world.bodies()[m_tissue].first;
    std::vector<DistanceConstraint>& all = m_world.solver().distances;
    forEachEdge(t, [&](const Segment& edge) {
      const auto [entry, isNew] = m_edges.try_emplace(edge, Edge{all.size(), 0});
      ++entry->second.uses;
      if (!isNew) return;
      const Vector3d rest =
          (m_rest[edge[0]] - m_rest[edge[1]]).cwiseProduct(Vector3d(1, kTension, 1));
      all.push_back({first + edge[0], first + edge[1], rest.norm(), kCompliance});
    });
  }
  /// The last constraint takes the place of one that is gone.
  void removeTetrahedron(std::uint32_t id) {
    const Tetrahedron& t = m_tetrahedra[id];
    for (int i = 0; i < 4; ++i) std::erase(m_around[t[i]], id);
    const std::uint32_t first = m_world.bodies()[m_tissue].first;
    std::vector<DistanceConstraint>& all = m_world.solver().distances;
    forEachEdge(t, [&](const Segment& edge) {
      const auto entry = m_edges.find(edge);
      if (--entry->second.uses > 0) return;
      const std::size_t place = entry->second.constraint;
      m_edges.erase(entry);
      all[place] = all.back();
      all.pop_back();
      if (place < all.size())
        m_edges.at({all[place].a - first, all[place].b - first}).constraint = place;
    });
    m_isRemoved[id] = true;
  }
  template <class F>
  static void forEachEdge(const Tetrahedron& t, F&& f) {
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < i; ++j) f(Segment{std::min(t[i], t[j]), std::max(t[i], t[j])});
  }

  void replace(const Ids& removed, const std::vector<Tetrahedron>& added,
               const std::vector<Vector3d>& positions, const std::vector<Vector3d>& rest) {
    const Ids ids = m_world.cut(m_tissue, removed, added, positions, rest, inverseMass());
    for (const std::uint32_t t : removed) removeTetrahedron(t);
    m_rest.insert(m_rest.end(), rest.begin(), rest.end());
    m_around.resize(m_rest.size());
    m_tetrahedra.insert(m_tetrahedra.end(), added.begin(), added.end());
    m_isRemoved.resize(m_tetrahedra.size());
    m_tags.resize(m_tetrahedra.size());
    for (const std::uint32_t t : ids) addTetrahedron(t);
  }

  /// Vertices of the wound's line within reach of the blade become two: tetrahedra on the far side
  /// get a vertex of their own.
  void cutWithBlade(double frame) {
    constexpr int kMiddle = kCells[1] / 2;
    const Vector3d tip = bladeAt(frame);
    std::map<std::uint32_t, std::uint32_t> copies;
    std::vector<Vector3d> positions, rest;
    std::set<std::uint32_t> removed;
    for (int i = 0; i <= kCells[0]; ++i)
      for (int k = 0; k <= kCells[2]; ++k) {
        const std::uint32_t v = Slab::vertex(i, kMiddle, k);
        if (m_isSplit.contains(v) || m_rest[v].x() > tip.x() + kAhead ||
            m_rest[v].x() < tip.x() - kBladeTail || m_rest[v].z() < tip.z() - kAhead)
          continue;
        m_isSplit.insert(v);
        copies[v] = static_cast<std::uint32_t>(m_rest.size() + positions.size());
        positions.push_back(m_world.positions(m_tissue)[v] + kOpening / 2 * Vector3d::UnitY());
        rest.push_back(m_rest[v]);
        for (const std::uint32_t t : m_around[v])
          if (isBehind(t)) removed.insert(t);
      }
    if (copies.empty()) return;
    m_split += static_cast<int>(copies.size());
    std::vector<Tetrahedron> added;
    for (const std::uint32_t t : removed) {
      added.push_back(m_tetrahedra[t]);
      for (std::uint32_t& v : added.back())
        if (const auto copy = copies.find(v); copy != copies.end()) v = copy->second;
    }
    replace({removed.begin(), removed.end()}, added, positions, rest);
    // The blade's wedge opens the cut at both ends of the step.
    const std::uint32_t first = m_world.bodies()[m_tissue].first;
    Xpbd& solver = m_world.solver();
    for (const auto& [v, copy] : copies) {
      solver.before[first + v].y() -= kOpening / 2;
      solver.now[first + v] = solver.before[first + v];
      solver.velocities[first + copy] = solver.velocities[first + v];
    }
    const std::span<const Vector3d> opened = m_world.before(m_tissue);
    m_world.detection().setPositions(id(m_tissue), opened, opened);
  }
  /// Whether a tetrahedron is on the far side of the wound's line.
  bool isBehind(std::uint32_t t) const {
    double side = 0;
    for (const std::uint32_t v : m_tetrahedra[t]) side += m_rest[v].y() - lineAt(m_rest[v].x());
    return side > 0;
  }

  /// Tetrahedra that the needle's tip is about to enter are removed. Those around have the tag of
  /// the hole's rim.
  void cutWithNeedle(double frame) {
    const Vector3d tip = needleAt(frame);
    std::set<std::uint32_t> removed;
    if (!m_isThrough)
      for (int i = 0; i < 4; ++i)
        if (const auto found = m_world.detection().queries().findTetrahedron(
                id(m_tissue), tip + Vector3d(0, 0, 0.5 * i)))
          removed.insert(found->tetrahedron);
    m_isThrough = tip.z() > 4;
    if (removed.empty()) return;
    m_removed += static_cast<int>(removed.size());
    for (const std::uint32_t t : removed)
      for (const std::uint32_t v : m_tetrahedra[t])
        for (const std::uint32_t neighbour : m_around[v]) m_tags[neighbour] = kRim;
    for (const std::uint32_t t : removed)
      m_rim.insert(m_tetrahedra[t].begin(), m_tetrahedra[t].end());
    replace({removed.begin(), removed.end()}, {}, {}, {});
    m_world.detection().setTags(id(m_tissue), m_tags);
  }

  /// Where the thread is in the hole now: contacts of this part with the rim are filtered.
  void findThreadInHole() {
    const std::span<const Vector3d> thread = m_world.before(m_thread),
                                    tissue = m_world.before(m_tissue);
    double low = kInfinity, high = -kInfinity;
    for (const std::uint32_t v : m_rim) {
      low = std::min(low, tissue[v].z() - kMargin);
      high = std::max(high, tissue[v].z() + kMargin);
    }
    m_inHole = {kNoElement, 0};
    for (std::uint32_t i = 0; i < thread.size(); ++i)
      if (thread[i].z() >= low && thread[i].z() <= high) m_inHole = {std::min(m_inHole[0], i), i};
  }
  ContactPredicate predicate() const {
    return [this](const ContactFeatures& features) { return !isAtRim(features.a, features.tagB); };
  }
  bool isAtRim(const std::array<std::uint32_t, 2>& thread, std::uint32_t tag) const {
    return tag == kRim && thread[0] >= m_inHole[0] && thread[1] <= m_inHole[1];
  }
  /// Instead of the rim's contacts: the thread passes through the middle of the hole.
  void holdThread() {
    if (m_rim.empty()) return;
    const std::span<const Vector3d> tissue = m_world.positions(m_tissue);
    const std::span<Vector3d> thread = m_world.positions(m_thread);
    Vector3d middle = Vector3d::Zero();
    for (const std::uint32_t v : m_rim) middle += tissue[v] / static_cast<double>(m_rim.size());
    for (std::uint32_t i = std::max(kNeedle + 1, m_inHole[0]); i <= m_inHole[1]; ++i)
      thread[i].head<2>() = middle.head<2>();
  }

  /// The tip goes up through the slab; the needle then lays the thread aside.
  static Vector3d needleAt(double frame) {
    return kHole + Vector3d(0, 0, -kDepth - 3 + 30 * part(frame, 0, 45)) +
           part(frame, 45, 45) * Vector3d(-10, -6, -8);
  }

  void drive(double frame) {
    const std::span<Vector3d> thread = m_world.positions(m_thread);
    for (std::uint32_t i = 0; i <= kNeedle; ++i)
      thread[i] = needleAt(frame) - Vector3d(0, 0, kSegment * i);
    const double in = part(frame, kDown + kAlong + kUp, kClosing);
    Xpbd& solver = m_world.solver();
    const World::Body& body = m_world.bodies()[m_tissue];
    for (std::uint32_t v = 0; v < body.count; ++v)
      if (solver.inverseMasses[body.first + v] == 0)
        solver.now[body.first + v] =
            m_rest[v] - kClose * in * m_rest[v].y() / (kCell * kCells[1] / 2) * Vector3d::UnitY();
  }

  /// The lowest point of the leading edge.
  static Vector3d bladeAt(double frame) {
    const double x = kStart + (kEnd - kStart) * part(frame, kDown, kAlong);
    const double up = 1 - part(frame, 0, kDown) + part(frame, kDown + kAlong, kUp);
    return {x, lineAt(x), -kDepth - 1 + 12 * up};
  }
  static Pose poseAt(double frame) {
    const Vector3d at = bladeAt(frame);
    const double tail = at.x() - kBladeTail;
    const Vector3d along = (at - Vector3d(tail, lineAt(tail), at.z())).normalized();
    Pose pose{.translation = at};
    pose.rotation << along, Vector3d::UnitZ().cross(along), Vector3d::UnitZ();
    return pose;
  }
  void placeBlade(double frame) {
    const auto [rotation, translation] = poseAt(frame);
    for (const World::BodyId body : {m_blade, m_handle}) m_world.place(body, rotation, translation);
  }

  /// The same step with a mesh that has only the triangles that are left. Without the predicate
  /// there are the same contacts, and those of the thread in the hole with the rim.
  void compareWithNew(int frame) {
    const TetrahedralSurface surface = m_world.detection().surface(id(m_tissue));
    Ids ids, tags;
    std::vector<Triangle> triangles;
    for (std::uint32_t i = 0; i < surface.triangles.size(); ++i) {
      if (surface.tetrahedra[i] == kNoElement) continue;
      ids.push_back(i);
      triangles.push_back(surface.triangles[i]);
      tags.push_back(m_tags[surface.tetrahedra[i]]);
    }
    OctreeBasedCD anew(Settings{.threads = m_threads});
    std::map<World::BodyId, GeometryId> newIds;
    newIds[m_blade] = anew.addTriangleMesh(blade().positions, blade().triangles);
    anew.setTransform(newIds[m_blade], poseAt(frame), poseAt(frame + 1));
    newIds[m_thread] = anew.addLineMesh(m_world.before(m_thread),
                                        m_world.bodies()[m_thread].segments, kThreadRadius);
    newIds[m_tissue] = anew.addTriangleMesh(m_rest, triangles);
    for (const World::BodyId body : {m_thread, m_tissue})
      anew.setPositions(newIds[body], m_world.before(body), m_world.positions(body));
    anew.setTags(newIds[m_tissue], tags);
    for (const auto& [a, b, settings] : m_settings)
      anew.addCollisionPair(newIds[a], newIds[b], settings);
    anew.setContactPredicate(newIds[m_thread], newIds[m_tissue], predicate());
    anew.detectCollision();
    for (const auto& [a, b, settings] : m_settings)
      if (Lists(m_world.contacts(a, b)) != Lists(anew.collisionData(newIds[a], newIds[b]),
                                                 a == m_tissue ? ids : Ids(),
                                                 b == m_tissue ? ids : Ids()))
        m_fault = "a mesh that is handed over anew has other contacts.";
    anew.setContactPredicate(newIds[m_thread], newIds[m_tissue], nullptr);
    anew.detectCollision();
    const CollisionData& all = anew.collisionData(newIds[m_thread], newIds[m_tissue]);
    Lists unfiltered(all, {}, ids);
    const std::size_t count = unfiltered.size();
    std::erase_if(unfiltered.vertexTriangle, [&](const VertexTriangleContact& c) {
      return isAtRim({c.vertex, c.vertex}, m_tags[surface.tetrahedra[c.triangle]]);
    });
    std::erase_if(unfiltered.edgeEdge,
                  [&](const EdgeEdgeContact& c) { return isAtRim(c.edgeA, all.tagsOf(c)[1]); });
    m_filtered = static_cast<int>(count - unfiltered.size());
    if (unfiltered != Lists(m_world.contacts(m_thread, m_tissue)))
      m_fault = "the predicate filters other contacts than those of the thread with the rim.";
  }

  static constexpr double kMargin = 1, kClose = 4;
  struct Edge {
    std::size_t constraint;
    int uses;
  };
  struct Checked {
    World::BodyId a, b;
    PairSettings settings;
  };
  World m_world;
  int m_threads;
  bool m_checks, m_isThrough = false;
  World::BodyId m_blade = 0, m_handle = 0, m_bed = 0, m_thread = 0, m_tissue = 0;
  std::vector<Checked> m_settings;
  std::vector<Vector3d> m_rest;           // of the tissue
  std::vector<Tetrahedron> m_tetrahedra;  // by id, with removed ones
  std::vector<bool> m_isRemoved;
  Ids m_tags;
  std::vector<Ids> m_around;  // tetrahedra of each vertex
  std::map<Segment, Edge> m_edges;
  std::set<std::uint32_t> m_isSplit, m_rim;  // vertices
  std::string m_fault;
  std::array<std::uint32_t, 2> m_inHole{kNoElement, 0};  // the first and last vertex of the thread
  int m_split = 0, m_removed = 0, m_filtered = 0;
};

}  // namespace
}  // namespace palpate::scenes

int main(int count, char** arguments) {
  using namespace palpate::scenes;
  bool checks = false;
  return runScene({.name = "Cutting",
                   .description = "A scalpel cuts a slab of tissue, and a needle leads a thread.",
                   .frames = 150,
                   .frameMilliseconds = 1000.0 / 60,
                   .keys = "n",
                   .addOptions =
                       [&](CLI::App& app) {
                         app.add_flag("--check", checks,
                                      "compare each frame with a mesh that is handed over anew");
                       },
                   .make = [&](int threads) { return std::make_unique<Cutting>(checks, threads); }},
                  count, arguments);
}
