#pragma once

#include "Common/PairRun.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <compare>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

// Meshes at another place, scale and numbering, and their contacts in the original ids.

namespace palpate::testing {

/// Two meshes in a step.
struct StepScene {
  std::string name;
  Mesh a, b;                                      ///< now
  std::vector<Eigen::Vector3d> aBefore, bBefore;  ///< displaced by less than their size
  double thickness;
};

struct Transformation {
  std::string name;
  double scale = 1.0;
  Eigen::Vector3d mirror{1, 1, 1};                            ///< signs
  Eigen::Vector3d translation{0, 0, 0};                       ///< after scaling
  bool corners = false, triangles = false, vertices = false;  ///< permuted at random
  bool swapped = false;                                       ///< b is the first geometry
  /// Triangles keep their order and, mirrored or not, their front. The contacts of Intersection
  /// depend on the front, and name the lowest triangle that holds the nearest feature.
  bool keepsTriangles = false;

  bool isMirrored() const { return mirror.prod() < 0; }

  /// Whether triangles keep their outer sides.
  bool keepsWinding() const { return !corners && mirror.prod() > 0; }
  Eigen::Vector3d place(const Eigen::Vector3d& p) const {
    return (p * scale).cwiseProduct(mirror) + translation;
  }
};

/// A contact in the scene's own ids, lengths and axes.
struct PlainContact {
  enum Kind : std::uint32_t { VertexTriangle, TriangleVertex, VertexVertex, EdgeEdge };
  std::array<std::uint32_t, 5> ids{};  ///< kind first
  std::array<double, 3> weights{};     ///< of the corners or edges, in ascending order of vertices
  Eigen::Vector3d normal;              ///< for the pair in its original order
  double distance, time;
  friend bool operator<(const PlainContact& p, const PlainContact& q) { return p.ids < q.ids; }
};

/// The scene at its new place, with its original numbering.
inline StepScene placed(StepScene scene, const Transformation& how) {
  for (auto* positions : {&scene.a.positions, &scene.b.positions, &scene.aBefore, &scene.bBefore})
    for (Eigen::Vector3d& p : *positions) p = how.place(p);
  scene.thickness *= how.scale;
  if (how.keepsTriangles && how.isMirrored())
    for (Mesh* mesh : {&scene.a, &scene.b})
      for (Triangle& t : mesh->triangles) std::swap(t[1], t[2]);
  return scene;
}

/// Triangles with area between few places of a coarse lattice, so that all ways of touching occur.
inline Mesh onLattice(Random& random) {
  Mesh mesh;
  const auto coordinate = [&] { return static_cast<double>(random() % 4) * 0.25; };
  while (mesh.positions.size() < 14)
    mesh.positions.push_back({coordinate(), coordinate(), coordinate()});
  while (mesh.triangles.size() < 14) {
    const Triangle t{static_cast<std::uint32_t>(random() % 14),
                     static_cast<std::uint32_t>(random() % 14),
                     static_cast<std::uint32_t>(random() % 14)};
    const Eigen::Vector3d u = mesh.positions[t[1]] - mesh.positions[t[0]],
                          v = mesh.positions[t[2]] - mesh.positions[t[0]];
    if (u.cross(v) != Eigen::Vector3d::Zero()) mesh.triangles.push_back(t);
  }
  return mesh;
}

/// Two meshes that move towards each other; each vertex has its own motion.
inline StepScene stepScene(const std::string& name, const Mesh& a, const Mesh& b,
                           double thickness) {
  StepScene scene{name, a, b, a.positions, b.positions, thickness};
  Random random(3);
  for (Eigen::Vector3d& p : scene.aBefore)
    p += Eigen::Vector3d(0.02, 0.01, 0.15) + randomPoint(random, 0, 0.01);
  for (Eigen::Vector3d& p : scene.bBefore) p -= randomPoint(random, 0, 0.02);
  return scene;
}

/// Two meshes on one lattice, the first from half a unit above.
inline StepScene latticeScene(Random& random) {
  const Mesh lattice = onLattice(random), other = onLattice(random);
  StepScene touching{"lattice", lattice, other, lattice.positions, other.positions, 0.25};
  for (Eigen::Vector3d& p : touching.aBefore) p.z() += 0.5;
  return touching;
}

class Placement {
 public:
  Placement(const StepScene& scene, const Transformation& how) : m_how(how) {
    m_meshes[0] = placed(scene.a, scene.aBefore, m_before[0], m_names[0]);
    m_meshes[1] = placed(scene.b, scene.bBefore, m_before[1], m_names[1]);
    m_thickness = scene.thickness * how.scale;
  }

  const Mesh& mesh(int which) const { return m_meshes[which]; }
  const std::vector<Eigen::Vector3d>& before(int which) const { return m_before[which]; }
  double thickness() const { return m_thickness; }
  bool swapped() const { return m_how.swapped; }

  /// One frame of the step.
  PairRun run(PairSettings settings, const Settings& octree = settingsOf(Engine::Octree)) const {
    settings.thickness *= m_thickness;
    const int first = swapped(), second = 1 - first;
    PairRun run(octree, m_meshes[first], m_meshes[second], settings);
    run.step(m_before[first], m_meshes[first].positions, m_before[second],
             m_meshes[second].positions);
    return run;
  }

  /// Contacts of the pair, sorted; self: of mesh a with itself.
  std::vector<PlainContact> contacts(const PairRun& run, bool self, Contacts how) const {
    const GeometryId a = swapped() ? run.b() : run.a();
    const CollisionData& data = self ? run.detection().collisionData(a, a) : run.data();
    std::vector<PlainContact> all;
    const int first = self ? 0 : swapped(), second = self ? 0 : 1 - first;
    for (const auto& c : data.vertexTriangle()) all.push_back(plain(c, first, second, self, how));
    for (const auto& c : data.triangleVertex()) all.push_back(plain(c, second, first, self, how));
    for (const auto& c : data.edgeEdge()) all.push_back(plain(c, first, second, self));
    std::sort(all.begin(), all.end());
    return all;
  }

  std::vector<ElementPair> intersectingTriangles(const PairRun& run) const {
    std::vector<ElementPair> all;
    for (auto [s, t] : run.data().intersectingTriangles()) {
      if (swapped()) std::swap(s, t);
      all.push_back({m_names[0].triangles[s], m_names[1].triangles[t]});
    }
    std::sort(all.begin(), all.end());
    return all;
  }

 private:
  /// The old id of each new one.
  struct Names {
    std::vector<std::uint32_t> vertices, triangles;
  };

  std::vector<std::uint32_t> order(std::size_t size, bool permuted) {
    std::vector<std::uint32_t> ids(size);
    std::iota(ids.begin(), ids.end(), 0u);
    for (std::size_t i = size; permuted && i > 1; --i) std::swap(ids[i - 1], ids[m_random() % i]);
    return ids;
  }

  Mesh placed(const Mesh& mesh, const std::vector<Eigen::Vector3d>& before,
              std::vector<Eigen::Vector3d>& newBefore, Names& names) {
    names.vertices = order(mesh.positions.size(), m_how.vertices);
    names.triangles = order(mesh.triangles.size(), m_how.triangles && !m_how.keepsTriangles);
    std::vector<std::uint32_t> newId(names.vertices.size());
    Mesh out;
    for (std::uint32_t v = 0; v < names.vertices.size(); ++v) {
      newId[names.vertices[v]] = v;
      out.positions.push_back(m_how.place(mesh.positions[names.vertices[v]]));
      newBefore.push_back(m_how.place(before[names.vertices[v]]));
    }
    for (const std::uint32_t t : names.triangles) {
      std::vector<std::uint32_t> corner = order(3, m_how.corners);
      const bool isOdd = corner[1] != (corner[0] + 1) % 3;
      if (m_how.keepsTriangles && isOdd != m_how.isMirrored()) std::swap(corner[1], corner[2]);
      const Triangle& old = mesh.triangles[t];
      out.triangles.push_back(
          {newId[old[corner[0]]], newId[old[corner[1]]], newId[old[corner[2]]]});
    }
    return out;
  }

  void setNumbers(PlainContact& plain, const auto& c) const {
    plain.normal = c.normal.cwiseProduct(m_how.mirror);
    plain.distance = c.distance / m_how.scale;
    plain.time = c.timeOfImpact;
  }

  PlainContact plain(const VertexTriangleContact& c, int vertices, int triangles, bool self,
                     Contacts how) const {
    PlainContact out;
    setNumbers(out, c);
    std::array<std::pair<std::uint32_t, double>, 3> corners;
    for (int i = 0; i < 3; ++i)
      corners[i] = {m_names[triangles].vertices[c.vertices[i]], c.weights[i]};
    std::sort(corners.begin(), corners.end());
    for (int i = 0; i < 3; ++i) out.weights[i] = corners[i].second;
    const std::uint32_t vertex = m_names[vertices].vertices[c.vertex];
    const auto kind = vertices == 0 ? PlainContact::VertexTriangle : PlainContact::TriangleVertex;
    out.ids = {kind, vertex, m_names[triangles].triangles[c.triangle]};
    if (how != Contacts::Distinct) return out;
    // One contact for each feature, with the lowest triangle of its numbering: identified by
    // corners.
    constexpr std::uint32_t kNone = ~0u;
    std::array<std::uint32_t, 3> holding{kNone, kNone, kNone};
    int count = 0;
    out.weights = {};
    for (const auto& [corner, weight] : corners)
      if (weight != 0) {
        out.weights[count] = weight;
        holding[count++] = corner;
      }
    out.ids = {kind, vertex, holding[0], holding[1], holding[2]};
    if (count > 1) return out;
    const bool turned = self ? holding[0] < vertex : vertices == 1;
    out.ids = {PlainContact::VertexVertex, turned ? holding[0] : vertex,
               turned ? vertex : holding[0]};
    if (turned) out.normal = -out.normal;
    return out;
  }

  PlainContact plain(const EdgeEdgeContact& c, int first, int second, bool self) const {
    PlainContact out;
    setNumbers(out, c);
    const auto named = [&](const Segment& edge, int mesh, double weight) {
      const std::uint32_t p = m_names[mesh].vertices[edge[0]], q = m_names[mesh].vertices[edge[1]];
      return std::tuple(std::min(p, q), std::max(p, q), p < q ? weight : 1.0 - weight);
    };
    auto a = named(c.edgeA, first, c.weightA), b = named(c.edgeB, second, c.weightB);
    if (self ? b < a : first == 1) {
      std::swap(a, b);
      out.normal = -out.normal;
    }
    out.ids = {PlainContact::EdgeEdge, std::get<0>(a), std::get<1>(a), std::get<0>(b),
               std::get<1>(b)};
    out.weights = {std::get<2>(a), std::get<2>(b)};
    return out;
  }

  Transformation m_how;
  Random m_random{17};
  Mesh m_meshes[2];
  std::vector<Eigen::Vector3d> m_before[2];
  Names m_names[2];
  double m_thickness;
};

}  // namespace palpate::testing
