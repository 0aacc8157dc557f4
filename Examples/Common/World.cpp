#include "World.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <chrono>
#include <map>
#include <utility>

namespace palpate::scenes {

using Eigen::Vector3d;

namespace {

using Clock = std::chrono::steady_clock;

/// Adds its lifetime to `milliseconds`.
class Timed {
 public:
  explicit Timed(double& milliseconds) : m_milliseconds(milliseconds) {}
  ~Timed() {
    m_milliseconds += std::chrono::duration<double, std::milli>(Clock::now() - m_start).count();
  }
  Timed(const Timed&) = delete;
  Timed& operator=(const Timed&) = delete;

 private:
  double& m_milliseconds;
  Clock::time_point m_start = Clock::now();
};

}  // namespace

World::BodyId World::add(Body body, std::span<const Vector3d> positions, double inverseMass) {
  body.first = m_solver.add(positions, inverseMass);
  body.count = static_cast<std::uint32_t>(positions.size());
  m_bodies.push_back(std::move(body));
  return m_bodies.size() - 1;
}

World::BodyId World::addMesh(std::string name, const SceneMesh& mesh, double inverseMass) {
  const GeometryId id = m_detection.addTriangleMesh(mesh.positions, mesh.triangles);
  return add({std::move(name), id, GeometryType::Triangles, 0, 0, mesh.triangles, {}, 0, {}},
             mesh.positions, inverseMass);
}

World::BodyId World::addRigidMesh(std::string name, const SceneMesh& mesh) {
  const BodyId id = addMesh(std::move(name), mesh, 0.0);
  m_bodies[id].rest = mesh.positions;
  return id;
}

World::BodyId World::addThread(std::string name, std::span<const Vector3d> positions, double radius,
                               double inverseMass) {
  std::vector<Segment> segments;
  for (std::uint32_t i = 0; i + 1 < positions.size(); ++i) segments.push_back({i, i + 1});
  const GeometryId id = m_detection.addLineMesh(positions, segments, radius);
  return add({std::move(name), id, GeometryType::Lines, 0, 0, {}, std::move(segments), radius, {}},
             positions, inverseMass);
}

World::BodyId World::addPoints(std::string name, std::span<const Vector3d> positions, double radius,
                               double inverseMass) {
  const GeometryId id = m_detection.addPointSet(positions, radius);
  return add({std::move(name), id, GeometryType::Points, 0, 0, {}, {}, radius, {}}, positions,
             inverseMass);
}

World::BodyId World::addShape(std::string name, const AnalyticalGeometry& shape, SceneMesh drawn) {
  const GeometryId id = m_detection.addAnalyticalGeometry(shape);
  return add({std::move(name), id, GeometryType::Shape, 0, 0, {}, {}, 0, std::move(drawn)}, {}, 0);
}

World::BodyId World::addSolid(std::string name, std::span<const Vector3d> positions,
                              std::span<const Tetrahedron> tetrahedra, double inverseMass) {
  const GeometryId id = m_detection.addTetrahedralMesh(positions, tetrahedra);
  const std::span<const Triangle> surface = m_detection.surface(id).triangles;
  return add({std::move(name),
              id,
              GeometryType::Triangles,
              0,
              0,
              {surface.begin(), surface.end()},
              {},
              0,
              {}},
             positions, inverseMass);
}

void World::addStiffness(BodyId body, double edgeCompliance, double bendingCompliance) {
  std::map<Segment, std::vector<std::uint32_t>> opposite;  // corners across each edge
  for (const Triangle& t : m_bodies[body].triangles) {
    for (int i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(t[i], t[(i + 1) % 3]);
      opposite[{low, high}].push_back(t[(i + 2) % 3]);
    }
  }
  const std::uint32_t first = m_bodies[body].first;
  const auto keep = [&](std::uint32_t a, std::uint32_t b, double compliance) {
    const double rest = (m_solver.now[first + a] - m_solver.now[first + b]).norm();
    m_solver.distances.push_back({first + a, first + b, rest, compliance});
  };
  for (std::uint32_t i = 0; i < m_bodies[body].segments.size(); ++i) {
    keep(i, i + 1, edgeCompliance);
    if (i + 2 < m_bodies[body].count)
      m_solver.bends.push_back({first + i, first + i + 1, first + i + 2, bendingCompliance});
  }
  for (const auto& [edge, corners] : opposite) {
    keep(edge[0], edge[1], edgeCompliance);
    if (corners.size() == 2) keep(corners[0], corners[1], bendingCompliance);
  }
}

void World::addVolume(BodyId id, double compliance) {
  const Body& body = m_bodies[id];
  m_solver.volumes.push_back({body.first, body.count, body.triangles,
                              volumeOf(positions(id), body.triangles), compliance});
}

void World::addInside(BodyId body, double kilograms,
                      const std::function<bool(const Vector3d&)>& isIn,
                      const std::function<bool(const Vector3d&)>& isPinned) {
  constexpr double kSpacing = 12, kReach = 1.8 * kSpacing, kCompliance = 4e-4;  // mm; mm/mN
  constexpr std::size_t kNearest = 5;
  const std::vector<Vector3d> surface(positions(body).begin(), positions(body).end());
  std::vector<Vector3d> inside;
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : surface) box.extend(p);
  for (double z = box.min().z(); z < box.max().z(); z += kSpacing)
    for (double y = box.min().y(); y < box.max().y(); y += kSpacing)
      for (double x = box.min().x(); x < box.max().x(); x += kSpacing)
        if (isIn({x, y, z})) inside.emplace_back(x, y, z);
  const std::uint32_t first = m_solver.add(inside, static_cast<double>(inside.size()) / kilograms);
  for (std::uint32_t i = 0; i < inside.size(); ++i)
    if (isPinned(inside[i])) m_solver.inverseMasses[first + i] = 0;
  const auto keep = [&](std::uint32_t a, std::uint32_t b) {
    m_solver.distances.push_back({a, b, (m_solver.now[a] - m_solver.now[b]).norm(), kCompliance});
  };
  for (std::uint32_t j = 0; j < inside.size(); ++j)
    for (std::uint32_t i = 0; i < j; ++i)
      if ((inside[i] - inside[j]).norm() < kReach) keep(first + i, first + j);
  std::vector<std::pair<double, std::uint32_t>> near;
  for (std::uint32_t v = 0; v < surface.size(); ++v) {
    near.clear();
    for (std::uint32_t i = 0; i < inside.size(); ++i)
      near.emplace_back((inside[i] - surface[v]).norm(), i);
    std::partial_sort(near.begin(), near.begin() + kNearest, near.end());
    for (std::size_t i = 0; i < kNearest; ++i)
      keep(m_bodies[body].first + v, first + near[i].second);
  }
}

void World::pin(BodyId body, const std::function<bool(const Vector3d&)>& holds) {
  for (std::uint32_t i = 0; i < m_bodies[body].count; ++i)
    if (holds(positions(body)[i])) m_solver.inverseMasses[m_bodies[body].first + i] = 0;
}

void World::addPair(BodyId a, BodyId b, const PairSettings& settings, double gap) {
  m_detection.addCollisionPair(m_bodies[a].id, m_bodies[b].id, settings);
  m_guard.setGuarded(m_bodies[a].id, m_bodies[b].id, false);
  m_pairs.push_back({a, b, gap});
}

void World::addGuard(BodyId a, BodyId b) {
  m_guard.setGuarded(m_bodies[a].id, m_bodies[b].id, true);
}

void World::addRigid(BodyId body, std::uint32_t count) {
  std::vector<GuardedVertex> vertices(count);
  for (std::uint32_t i = 0; i < count; ++i) vertices[i] = {m_bodies[body].id, i};
  m_guard.addRigidGroup(vertices);
}

void World::disable(BodyId body, std::span<const std::uint32_t> triangles) {
  m_detection.setDisabledElements(m_bodies[body].id, triangles);
}

std::vector<std::uint32_t> World::cut(BodyId id, std::span<const std::uint32_t> removed,
                                      std::span<const Tetrahedron> added,
                                      std::span<const Vector3d> newPositions,
                                      std::span<const Vector3d> rest, double inverseMass) {
  const Timed timed(m_times.cut);
  Body& body = m_bodies[id];
  const auto ids = m_detection.replaceTetrahedra(body.id, removed, added, newPositions, rest);
  m_solver.add(newPositions, inverseMass);
  body.count += static_cast<std::uint32_t>(newPositions.size());
  const std::span<const Triangle> surface = m_detection.surface(body.id).triangles;
  body.triangles.assign(surface.begin(), surface.end());
  return ids;
}

void World::place(BodyId id, const Eigen::Matrix3d& rotation, const Vector3d& translation) {
  Body& body = m_bodies[id];
  m_detection.setTransform(body.id, {rotation, translation});
  body.rotation = rotation;
  body.translation = translation;
  for (std::size_t i = 0; i < body.rest.size(); ++i)
    m_solver.now[body.first + i] = rotation * body.rest[i] + translation;
}

std::span<Vector3d> World::positions(BodyId body) {
  return {m_solver.now.data() + m_bodies[body].first, m_bodies[body].count};
}

std::span<const Vector3d> World::before(BodyId body) const {
  return {m_solver.before.data() + m_bodies[body].first, m_bodies[body].count};
}

SolverVertices World::vertices(BodyId body) const {
  const auto& [first, count] = std::pair(m_bodies[body].first, m_bodies[body].count);
  return {first, {m_solver.before.data() + first, count}, {m_solver.now.data() + first, count}};
}

void World::predict(double seconds, const Vector3d& acceleration, double damping) {
  const Timed timed(m_times.solver);
  // A geometry is at rest in the step in which it is added. The first step begins after that.
  if (!m_hasStarted) m_detection.advance();
  m_hasStarted = true;
  m_seconds = seconds;
  m_forces.assign(m_bodies.size(), Vector3d::Zero());
  m_solver.predict(seconds, acceleration, damping);
}

void World::passPositions() {
  for (BodyId id = 0; id < m_bodies.size(); ++id)
    if (const Body& body = m_bodies[id]; body.count > 0 && body.rest.empty())
      m_detection.setPositions(body.id, positions(id));
}

void World::detectOnly() {
  const Timed timed(m_times.collision);
  passPositions();
  m_detection.detectCollision();
  const FrameStatistics& statistics = m_detection.statistics();
  m_times.boxes += statistics.milliseconds.boxes;
  m_times.octree += statistics.milliseconds.octree;
  m_times.pairs += statistics.milliseconds.pairs;
  m_times.narrowPhase += statistics.milliseconds.narrowPhase;
  m_times.order += statistics.milliseconds.order;
  m_times.contacts = statistics.contacts;
}

void World::detect() {
  detectOnly();
  const Timed timed(m_times.collision);
  m_rows.clear();
  m_rowPairs.clear();
  for (std::size_t p = 0; p < m_pairs.size(); ++p) {
    const auto& [a, b, gap] = m_pairs[p];
    const CollisionData& data = contacts(a, b);
    // A field or proxy of b, which is rigid, has no vertices.
    const Method method = data.validity().method;
    const bool withoutVertices = method == Method::DistanceField || method == Method::Proxy;
    appendRows(data, vertices(a), withoutVertices ? SolverVertices{} : vertices(b), m_rows);
    for (std::size_t row = m_rowPairs.size(); row < m_rows.size(); ++row) m_rows[row].offset += gap;
    m_rowPairs.resize(m_rows.size(), p);
  }
}

void World::solve(int iterations) {
  const Timed timed(m_times.solver);
  const std::span<const double> multipliers = m_solver.solve(m_seconds, m_rows, iterations);
  for (std::size_t r = 0; r < m_rows.size(); ++r) {
    const Vector3d force = multipliers[r] / (m_seconds * m_seconds) * m_rows[r].normal;
    const auto& [a, b, gap] = m_pairs[m_rowPairs[r]];
    const Body& first =
        m_bodies[a];  // weights above 0 belong to the side to which the normal points
    const std::uint32_t pushed = m_rows[r].vertices[0];
    const bool towardsA = pushed >= first.first && pushed < first.first + first.count;
    m_forces[a] += towardsA ? force : Vector3d(-force);
    m_forces[b] -= towardsA ? force : Vector3d(-force);
  }
}

void World::hold() {
  const Timed timed(m_times.hold);
  passPositions();
  m_times.held += m_guard.hold();
  for (BodyId id = 0; id < m_bodies.size(); ++id)
    if (const Body& body = m_bodies[id]; body.count > 0 && body.rest.empty()) {
      const std::span<const Vector3d> held = m_detection.positions(body.id);
      std::copy(held.begin(), held.end(), positions(id).begin());
    }
}

double World::fraction(BodyId body, std::uint32_t vertex) const {
  for (const HeldVertex& held : m_guard.held())
    if (held.geometry == m_bodies[body].id && held.vertex == vertex) return held.fraction;
  return 1.0;
}

void World::commit() {
  const Timed timed(m_times.solver);
  m_solver.commit(m_seconds);
  passPositions();  // as corrected since the detection
  m_detection.advance();
}

Vector3d World::force(BodyId body) const { return m_forces[body]; }

bool World::intersect(BodyId a, BodyId b) {
  const auto view = [&](BodyId id) {
    return TriangleMeshView{positions(id), m_bodies[id].triangles};
  };
  return !palpate::detectCollision(view(a), view(b), {.method = Method::Intersection})
              .intersectingTriangles()
              .empty();
}

}  // namespace palpate::scenes
