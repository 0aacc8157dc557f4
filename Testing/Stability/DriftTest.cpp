// Contact held for many frames in a loop with response: what does not stay bounded in such a loop
// is of no use to a simulator, however right it is in each frame.
#include <palpate/OctreeBasedCD.h>

#include "Common/RandomMeshes.h"
#include "Meshes.h"

#include <Eigen/Geometry>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <numbers>
#include <set>
#include <tuple>
#include <vector>

namespace palpate {

namespace {

using Eigen::Vector3d;

/// The long run takes a thousand frames.
int frameCount() { return std::getenv("PALPATE_LONG") != nullptr ? 1000 : 150; }

/// A mesh of unit masses at its vertices, kept in shape by its edges.
struct Body {
  scenes::SceneMesh mesh;
  std::vector<Vector3d> positions, before, velocities;
  std::vector<bool> held;  ///< vertices that the solver does not move
  std::vector<std::tuple<std::uint32_t, std::uint32_t, double>> edges;  ///< with their rest lengths

  explicit Body(scenes::SceneMesh made)
      : mesh(std::move(made)),
        positions(mesh.positions),
        before(positions),
        velocities(positions.size(), Vector3d::Zero()),
        held(positions.size(), false) {
    std::set<std::pair<std::uint32_t, std::uint32_t>> known;
    for (const Triangle& t : mesh.triangles)
      for (int i = 0; i < 3; ++i) {
        const auto [p, q] = std::minmax(t[i], t[(i + 1) % 3]);
        if (known.emplace(p, q).second)
          edges.emplace_back(p, q, (positions[p] - positions[q]).norm());
      }
  }
};

/// A contact's features, and its normal from the second body towards the first.
using Normals = std::map<std::vector<std::uint32_t>, Vector3d>;

/// Position-based dynamics: predict, correct edges and contacts in turn, take velocities from what
/// has moved.
class Loop {
 public:
  static constexpr double kThickness = 0.02, kStep = 0.01, kGravity = 1.0;

  Loop(std::vector<Body> bodies, double noise) : m_bodies(std::move(bodies)), m_noise(noise) {
    for (const Body& body : m_bodies)
      m_ids.push_back(m_detection.addTriangleMesh(body.positions, body.mesh.triangles));
    for (std::size_t b = 1; b < m_bodies.size(); ++b)
      m_detection.addCollisionPair(m_ids[b - 1], m_ids[b],
                                   {.method = Method::Proximity, .thickness = kThickness});
  }

  std::vector<Body>& bodies() { return m_bodies; }
  std::size_t contacts() const { return m_contacts; }
  const Normals& normals() const { return m_normals; }

  void step() {
    for (Body& body : m_bodies) {
      body.before = body.positions;
      for (std::size_t v = 0; v < body.positions.size(); ++v) {
        if (body.held[v]) continue;
        body.velocities[v].z() -= kGravity * kStep;
        body.positions[v] += kStep * body.velocities[v];
      }
    }
    detect();
    for (int i = 0; i < 8; ++i) {
      for (Body& body : m_bodies) keepEdges(body);
      for (std::size_t b = 1; b < m_bodies.size(); ++b) keepApart(b - 1, b);
    }
    for (Body& body : m_bodies)
      for (std::size_t v = 0; v < body.positions.size(); ++v)
        body.velocities[v] = 0.95 * (body.positions[v] - body.before[v]) / kStep;
  }

  double kineticEnergy() const {
    double energy = 0;
    for (const Body& body : m_bodies)
      for (const Vector3d& velocity : body.velocities) energy += velocity.squaredNorm() / 2;
    return energy;
  }

 private:
  /// What is handed in is as good as float.
  std::vector<Vector3d> noisy(const std::vector<Vector3d>& positions) {
    std::vector<Vector3d> all = positions;
    for (Vector3d& p : all) p += m_noise * testing::randomPoint(m_random, -1, 1);
    return all;
  }

  void detect() {
    for (std::size_t b = 0; b < m_bodies.size(); ++b)
      m_detection.setPositions(m_ids[b], noisy(m_bodies[b].positions));
    m_detection.detectCollision();
    m_detection.advance();
    m_contacts = 0;
    m_normals.clear();
    for (std::uint32_t b = 1; b < m_bodies.size(); ++b) {
      const CollisionData& data = m_detection.collisionData(m_ids[b - 1], m_ids[b]);
      m_contacts +=
          data.vertexTriangle().size() + data.triangleVertex().size() + data.edgeEdge().size();
      for (const auto& c : data.vertexTriangle())
        m_normals[{b, 0, c.vertex, c.triangle}] = c.normal;
      for (const auto& c : data.triangleVertex())
        m_normals[{b, 1, c.triangle, c.vertex}] = -c.normal;
      for (const auto& c : data.edgeEdge())
        m_normals[{b, 2, c.edgeA[0], c.edgeA[1], c.edgeB[0], c.edgeB[1]}] = c.normal;
    }
  }

  void keepEdges(Body& body) {
    for (const auto& [p, q, rest] : body.edges) {
      const double wp = !body.held[p], wq = !body.held[q];
      const Vector3d along = body.positions[q] - body.positions[p];
      const double length = along.norm();
      if (wp + wq == 0 || length == 0) continue;
      const Vector3d correction = 0.5 * (length - rest) / (length * (wp + wq)) * along;
      body.positions[p] += wp * correction;
      body.positions[q] -= wq * correction;
    }
  }

  void keepApart(std::size_t a, std::size_t b) {
    const CollisionData& data = m_detection.collisionData(m_ids[a], m_ids[b]);
    for (const auto& c : data.vertexTriangle()) push(stencil(c), c.normal, {a, b, b, b});
    for (const auto& c : data.triangleVertex()) push(stencil(c), c.normal, {b, a, a, a});
    for (const auto& c : data.edgeEdge()) push(stencil(c), c.normal, {a, a, b, b});
  }

  /// Moves the four vertices so that their features are the thickness apart along the normal.
  void push(const Stencil& features, const Vector3d& normal,
            const std::array<std::size_t, 4>& bodies) {
    Vector3d difference = Vector3d::Zero();
    double weight = 0;
    for (int i = 0; i < 4; ++i) {
      const Body& body = m_bodies[bodies[i]];
      difference += features.weights[i] * body.positions[features.vertices[i]];
      if (!body.held[features.vertices[i]]) weight += features.weights[i] * features.weights[i];
    }
    const double missing = kThickness - difference.dot(normal);
    if (missing <= 0 || weight == 0) return;
    for (int i = 0; i < 4; ++i) {
      Body& body = m_bodies[bodies[i]];
      if (!body.held[features.vertices[i]])
        body.positions[features.vertices[i]] +=
            0.3 * missing * features.weights[i] / weight * normal;
    }
  }

  std::vector<Body> m_bodies;
  double m_noise;
  testing::Random m_random{3};
  OctreeBasedCD m_detection{{.threads = 1}};
  std::vector<GeometryId> m_ids;
  std::size_t m_contacts = 0;
  Normals m_normals;
};

/// A held sheet below, three others on it, each a little aside from the one below.
std::vector<Body> stackedSheets() {
  std::vector<Body> bodies;
  for (int layer = 0; layer < 4; ++layer) {
    scenes::SceneMesh mesh = scenes::sheet(6);
    for (Vector3d& p : mesh.positions) {
      const Eigen::AngleAxisd turn(0.1 * layer, Vector3d::UnitZ());
      p = (0.5 - 0.05 * layer) * (turn * p) + Vector3d(0.013 * layer, 0.007 * layer, 0.025 * layer);
    }
    bodies.emplace_back(std::move(mesh));
  }
  bodies.front().held.assign(bodies.front().positions.size(), true);
  return bodies;
}

/// An organ between two held plates, of which the upper one comes down on it. It keeps its
/// shape by its edges and by others between opposite vertices.
std::vector<Body> pressedOrgan() {
  std::vector<Body> bodies;
  for (const double side : {-1.0, 0.0, 1.0}) {
    scenes::SceneMesh mesh = side == 0 ? scenes::sphere(4) : scenes::sheet(8);
    for (Vector3d& p : mesh.positions) p = side == 0 ? Vector3d(0.4 * p) : Vector3d(0.7 * p);
    for (Vector3d& p : mesh.positions) p.z() += 0.42 * side;
    if (side > 0)
      for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
    bodies.emplace_back(std::move(mesh));
    if (side != 0) bodies.back().held.assign(bodies.back().positions.size(), true);
  }
  Body& organ = bodies[1];
  const std::vector<Vector3d>& p = organ.positions;
  for (std::uint32_t v = 0; v < p.size(); ++v) {
    const auto opposite = std::min_element(p.begin(), p.end(), [&](const auto& l, const auto& r) {
      return l.dot(p[v]) < r.dot(p[v]);
    });
    organ.edges.emplace_back(v, opposite - p.begin(), (*opposite - p[v]).norm());
  }
  return bodies;
}

struct Drift {
  std::size_t mostEarly = 0, mostLate = 0;  ///< contacts, in the third and the last quarter
  double energyEarly = 0, energyLate = 0;   ///< likewise, the most
  double jitter = 0;         ///< degrees: RMS turn of a contact's normal from frame to frame
  std::size_t turns = 0;     ///< normals that turned by more than a right angle
  std::size_t contacts = 0;  ///< of all frames
};

/// move: what happens to held bodies before a frame.
template <class Move>
Drift drift(std::vector<Body> bodies, double noise, Move&& move) {
  Loop loop(std::move(bodies), noise);
  Drift result;
  Normals last;
  double squares = 0;
  std::size_t followed = 0;
  const int frames = frameCount();
  for (int frame = 0; frame < frames; ++frame) {
    move(loop, frame, frames);
    loop.step();
    for (const auto& [features, normal] : loop.normals()) {
      EXPECT_NEAR(normal.norm(), 1.0, 1e-12);
      const auto before = last.find(features);
      if (before == last.end() || frame < frames / 2) continue;
      const double angle =
          2 * std::atan2((normal - before->second).norm(), (normal + before->second).norm());
      squares += angle * angle;
      ++followed;
      result.turns += angle > std::numbers::pi / 2;
    }
    last = loop.normals();
    const bool early = frame >= frames / 2 && frame < 3 * frames / 4,
               late = frame >= 3 * frames / 4;
    std::size_t& most = late ? result.mostLate : result.mostEarly;
    double& energy = late ? result.energyLate : result.energyEarly;
    if (early || late) {
      most = std::max(most, loop.contacts());
      energy = std::max(energy, loop.kineticEnergy());
    }
    result.contacts += loop.contacts();
  }
  for (const Body& body : loop.bodies())
    for (const Vector3d& p : body.positions) EXPECT_LT(p.norm(), 2.0);  // NaN is not
  result.jitter = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(followed, 1))) *
                  180 / std::numbers::pi;
  return result;
}

void expectBounded(const Drift& quiet, const Drift& inNoise) {
  for (const auto& [name, d] : {std::pair{"without noise", quiet}, {"noise 1e-7", inNoise}}) {
    std::printf(
        "%-14s contacts at most %zu then %zu, kinetic energy %.2e then %.2e, normals jitter by "
        "%.4f degrees, %zu turned\n",
        name, d.mostEarly, d.mostLate, d.energyEarly, d.energyLate, d.jitter, d.turns);
    EXPECT_GT(d.mostLate, 10u);
    EXPECT_LE(d.mostLate, d.mostEarly + d.mostEarly / 4 + 5);
    EXPECT_LE(d.energyLate, 1.5 * d.energyEarly + 1e-3);
    EXPECT_EQ(d.turns, 0u);
  }
  EXPECT_LE(inNoise.jitter, 1.5 * quiet.jitter + 0.1);
}

TEST(Drift, StackedSheetsComeToRest) {
  const auto still = [](Loop&, int, int) {};
  expectBounded(drift(stackedSheets(), 0, still), drift(stackedSheets(), 1e-7, still));
}

TEST(Drift, PressedOrganStaysPressed) {
  const auto press = [](Loop& loop, int frame, int frames) {
    if (frame > frames / 3) return;  // and held from then on
    for (Vector3d& p : loop.bodies().back().positions) p.z() -= 0.1 / frames;
  };
  expectBounded(drift(pressedOrgan(), 0, press), drift(pressedOrgan(), 1e-7, press));
}

}  // namespace

}  // namespace palpate
