#include <palpate/StepGuard.h>

#include <palpate/OctreeBasedCD.h>

#include "CollisionDetection/GeometryTable.h"
#include "Core/FloatingPoint.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace palpate {

namespace {

using Eigen::Vector3d;

constexpr std::uint32_t kNoGroup = std::numeric_limits<std::uint32_t>::max();

/// A geometry, and during a hold() its step.
struct Guarded {
  GeometryId id{};
  GeometryType type = GeometryType::Triangles;
  std::vector<Vector3d> settled{};     ///< positions after the last hold()
  std::vector<std::uint32_t> group{};  ///< by vertex, or kNoGroup
  std::vector<std::uint8_t> fixed{};   ///< by vertex
  GuardedStep step{};
  bool isGiven = false;   ///< this hold() has a step for it
  bool hasMoved = false;  ///< vertices were moved back in this round
  bool isStale = false;   ///< after a failed call, the detection has other positions than `settled`
};

struct Group {
  std::vector<GuardedVertex> vertices{};
  bool isFixed = false, isHeld = false;
};

struct MovedBack {
  GuardedVertex vertex;
  Vector3d* now;
  Vector3d previous;
};

/// Two features that touch.
struct Touch {
  std::array<GuardedVertex, 4> vertices;
  std::string first, second;
};

std::string elementOf(const Guarded& geometry, std::uint32_t index) {
  const char* name = geometry.type == GeometryType::Lines    ? ", segment "
                     : geometry.type == GeometryType::Points ? ", point "
                                                             : ", triangle ";
  return nameOf(geometry.id) + name + std::to_string(index);
}

std::string edgeOf(const Guarded& geometry, const std::array<std::uint32_t, 2>& edge) {
  return nameOf(geometry.id) + ", edge (" + std::to_string(edge[0]) + ", " +
         std::to_string(edge[1]) + ")";
}

[[noreturn]] void throwNoVertex(GeometryId id, std::uint32_t vertex, std::size_t count) {
  throw Error(ErrorCode::IndexOutOfRange,
              nameOf(id) + ": vertex " + std::to_string(vertex) +
                  " is out of range; the geometry has " + std::to_string(count) + " vertices",
              id, vertex);
}

}  // namespace

struct StepGuard::Implementation {
  explicit Implementation(const Settings& settings) : detection(settings) {}

  OctreeBasedCD detection;
  std::vector<Guarded> geometries;  ///< by ascending id
  std::vector<Group> groups;        ///< those without vertices are not in use
  std::vector<MovedBack> movedBack;
  std::vector<GuardedVertex> held, nextHeld;
  std::size_t rounds = 0;

  std::size_t indexOf(GeometryId id) const {
    const auto at =
        std::lower_bound(geometries.begin(), geometries.end(), id,
                         [](const Guarded& geometry, GeometryId key) { return geometry.id < key; });
    if (at == geometries.end() || at->id != id)
      throw Error(ErrorCode::UnknownGeometry, nameOf(id) + " was never added, or was removed", id);
    return static_cast<std::size_t>(at - geometries.begin());
  }
  Guarded& at(GeometryId id) { return geometries[indexOf(id)]; }

  /// add() adds the geometry to the detection and returns its id.
  template <class Add>
  GeometryId add(std::span<const Vector3d> positions, GeometryType type, Add&& add) {
    Guarded geometry;
    geometry.type = type;
    geometry.settled.assign(positions.begin(), positions.end());
    geometry.group.assign(positions.size(), kNoGroup);
    geometry.fixed.assign(positions.size(), 0);
    if (geometries.size() == geometries.capacity())
      geometries.reserve(std::max<std::size_t>(8, 2 * geometries.size()));
    geometry.id = add();
    geometries.push_back(std::move(geometry));  // nothing throws from here
    return geometries.back().id;
  }

  /// set() changes the topology in the detection.
  template <class Set>
  void setTopology(GeometryId id, std::span<const Vector3d> positions, Set&& set) {
    Guarded& geometry = at(id);
    std::vector<Vector3d> settled(positions.begin(), positions.end());
    std::vector<std::uint32_t> group = geometry.group;
    std::vector<std::uint8_t> fixed = geometry.fixed;
    group.resize(positions.size(), kNoGroup);
    fixed.resize(positions.size(), 0);
    set();
    geometry.settled = std::move(settled);  // nothing throws from here
    geometry.group = std::move(group);
    geometry.fixed = std::move(fixed);
    geometry.isStale = false;
    leaveGroups(id, static_cast<std::uint32_t>(positions.size()));
  }

  void remove(GeometryId id) {
    const std::size_t index = indexOf(id);
    detection.removeGeometry(id);
    geometries.erase(geometries.begin() + static_cast<std::ptrdiff_t>(index));
    leaveGroups(id, 0);
  }

  /// Removes the geometry's vertices from number `from` on from all groups.
  void leaveGroups(GeometryId id, std::uint32_t from) {
    for (Group& group : groups)
      std::erase_if(group.vertices,
                    [&](const GuardedVertex& v) { return v.geometry == id && v.vertex >= from; });
    findFixedGroups();
  }

  void findFixedGroups() {
    for (Group& group : groups)
      group.isFixed =
          std::any_of(group.vertices.begin(), group.vertices.end(),
                      [&](const GuardedVertex& v) { return at(v.geometry).fixed[v.vertex] != 0; });
  }

  void addGroup(std::span<const GuardedVertex> vertices) {
    if (vertices.empty()) return;
    std::vector<std::uint32_t> joined;  // groups that become part of the new one
    for (const GuardedVertex& v : vertices) {
      const Guarded& geometry = at(v.geometry);
      if (v.vertex >= geometry.group.size())
        throwNoVertex(v.geometry, v.vertex, geometry.group.size());
      if (const std::uint32_t group = geometry.group[v.vertex]; group != kNoGroup)
        joined.push_back(group);
    }
    std::sort(joined.begin(), joined.end());
    joined.erase(std::unique(joined.begin(), joined.end()), joined.end());
    Group all{{vertices.begin(), vertices.end()}};
    for (const std::uint32_t group : joined)
      all.vertices.insert(all.vertices.end(), groups[group].vertices.begin(),
                          groups[group].vertices.end());
    std::sort(all.vertices.begin(), all.vertices.end());
    all.vertices.erase(std::unique(all.vertices.begin(), all.vertices.end()), all.vertices.end());
    groups.push_back(std::move(all));  // nothing throws from here
    for (const std::uint32_t group : joined) groups[group].vertices.clear();
    for (const GuardedVertex& v : groups.back().vertices)
      at(v.geometry).group[v.vertex] = static_cast<std::uint32_t>(groups.size() - 1);
    findFixedGroups();
  }

  void setFixed(GeometryId id, std::span<const std::uint32_t> vertices) {
    Guarded& geometry = at(id);
    for (const std::uint32_t v : vertices)
      if (v >= geometry.fixed.size()) throwNoVertex(id, v, geometry.fixed.size());
    std::fill(geometry.fixed.begin(), geometry.fixed.end(), std::uint8_t{0});
    for (const std::uint32_t v : vertices) geometry.fixed[v] = 1;
    findFixedGroups();
  }

  std::size_t hold(std::span<const GuardedStep> steps) {
    const StandardFloatingPoint standard;  // so that denormal differences do not become zero
    movedBack.clear();
    try {
      begin(steps);
      const std::size_t count = holdRounds();
      publish();
      rounds = count;
    } catch (...) {
      undo();
      throw;
    }
    end();
    return held.size();
  }

 private:
  void begin(std::span<const GuardedStep> steps) {
    for (Guarded& geometry : geometries) geometry.isGiven = geometry.hasMoved = false;
    for (Group& group : groups) group.isHeld = false;
    for (const GuardedStep& step : steps) {
      Guarded& geometry = at(step.geometry);
      if (geometry.isGiven)
        throw Error(ErrorCode::InvalidSettings, nameOf(step.geometry) + " has more than one step",
                    step.geometry);
      geometry.isGiven = true;
      geometry.isStale = true;  // until this hold() has succeeded
      geometry.step = step;
    }
    for (const GuardedStep& step : steps)
      detection.setPositions(step.geometry, step.before, step.now);
    for (Guarded& geometry : geometries) {
      if (geometry.isGiven || !geometry.isStale) continue;
      detection.setPositions(geometry.id, geometry.settled, geometry.settled);
      geometry.isStale = false;
    }
  }

  std::size_t holdRounds() {
    for (std::size_t round = 1;; ++round) {
      detection.detectCollision();
      const std::size_t heldBefore = movedBack.size();
      bool touches = false;
      for (const CollisionPair& pair : detection.pairs())
        forEachTouch(pair, [&](const auto&, const std::array<GuardedVertex, 4>& vertices) {
          touches = true;
          for (const GuardedVertex& vertex : vertices) moveBackWithGroup(vertex);
        });
      if (!touches) return round;
      if (movedBack.size() == heldBefore) throwFirstTouch();
      for (Guarded& geometry : geometries)
        if (std::exchange(geometry.hasMoved, false))
          detection.setPositions(geometry.id, geometry.step.now);
    }
  }

  /// Calls f(contact, vertices) for each contact of the pair.
  template <class F>
  void forEachTouch(const CollisionPair& pair, F&& f) const {
    const auto& [a, b, settings] = pair;
    const CollisionData& contacts = detection.collisionData(a, b);
    const auto pass = [&](const auto& contact, const std::array<GeometryId, 4>& ids) {
      const Stencil of = stencil(contact);
      std::array<GuardedVertex, 4> vertices;
      for (std::size_t i = 0; i < 4; ++i) vertices[i] = {ids[i], of.vertices[i]};
      f(contact, vertices);
    };
    for (const auto& contact : contacts.vertexTriangle()) pass(contact, {a, b, b, b});
    for (const auto& contact : contacts.triangleVertex()) pass(contact, {b, a, a, a});
    for (const auto& contact : contacts.edgeEdge()) pass(contact, {a, a, b, b});
  }

  void moveBackWithGroup(const GuardedVertex& vertex) {
    Guarded& geometry = at(vertex.geometry);
    const std::uint32_t index = geometry.group[vertex.vertex];
    if (index == kNoGroup) {
      if (!geometry.fixed[vertex.vertex]) moveBack(geometry, vertex);
      return;
    }
    Group& group = groups[index];
    if (group.isFixed || group.isHeld) return;
    for (const GuardedVertex& v : group.vertices) moveBack(at(v.geometry), v);
    group.isHeld = true;
  }

  void moveBack(Guarded& geometry, const GuardedVertex& vertex) {
    if (!geometry.isGiven) return;
    const Vector3d& before = geometry.step.before[vertex.vertex];
    Vector3d& now = geometry.step.now[vertex.vertex];
    if (now == before) return;
    movedBack.push_back({vertex, &now, now});
    now = before;
    geometry.hasMoved = true;
  }

  bool moves(const GuardedVertex& vertex) const {
    const Guarded& geometry = geometries[indexOf(vertex.geometry)];
    return geometry.isGiven &&
           geometry.step.now[vertex.vertex] != geometry.step.before[vertex.vertex];
  }

  Touch touchOf(const VertexTriangleContact& contact,
                const std::array<GuardedVertex, 4>& vertices) const {
    const GuardedVertex& vertex = vertices[0];
    return {vertices, nameOf(vertex.geometry) + ", vertex " + std::to_string(vertex.vertex),
            elementOf(geometries[indexOf(vertices[1].geometry)], contact.triangle)};
  }
  Touch touchOf(const EdgeEdgeContact& contact,
                const std::array<GuardedVertex, 4>& vertices) const {
    return {vertices, edgeOf(geometries[indexOf(vertices[0].geometry)], contact.edgeA),
            edgeOf(geometries[indexOf(vertices[2].geometry)], contact.edgeB)};
  }

  /// Throws an Error about the first of the touching features, when none of them can move back.
  [[noreturn]] void throwFirstTouch() const {
    std::optional<Touch> touch;
    for (const CollisionPair& pair : detection.pairs())
      forEachTouch(pair, [&](const auto& contact, const std::array<GuardedVertex, 4>& vertices) {
        if (!touch) touch = touchOf(contact, vertices);
      });
    const bool anyMoves = std::any_of(touch->vertices.begin(), touch->vertices.end(),
                                      [&](const GuardedVertex& vertex) { return moves(vertex); });
    throw Error(ErrorCode::ImpactRemains,
                touch->first + ", and " + touch->second +
                    (anyMoves ? " touch within the step, and all their vertices that move are fixed"
                              : " touched before the step"),
                touch->vertices[0].geometry, touch->vertices[0].vertex);
  }

  void publish() {
    nextHeld.clear();
    for (const MovedBack& moved : movedBack) nextHeld.push_back(moved.vertex);
    std::sort(nextHeld.begin(), nextHeld.end());
  }

  void undo() noexcept {
    for (const MovedBack& moved : movedBack) *moved.now = moved.previous;
    for (Guarded& geometry : geometries) geometry.isGiven = geometry.hasMoved = false;
  }

  void end() {
    held.swap(nextHeld);
    for (Guarded& geometry : geometries) {
      if (!std::exchange(geometry.isGiven, false)) continue;
      std::copy(geometry.step.now.begin(), geometry.step.now.end(), geometry.settled.begin());
      geometry.isStale = false;
    }
    detection.advance();
  }
};

StepGuard::Implementation& StepGuard::all() const {
  if (!m_implementation)
    throw Error(ErrorCode::InvalidCall, "this StepGuard was moved from: it has no geometries");
  return *m_implementation;
}

StepGuard::StepGuard(const Settings& settings)
    : m_implementation(std::make_unique<Implementation>(settings)) {}
StepGuard::StepGuard(StepGuard&&) noexcept = default;
StepGuard& StepGuard::operator=(StepGuard&&) noexcept = default;
StepGuard::~StepGuard() = default;

GeometryId StepGuard::addTriangleMesh(std::span<const Vector3d> positions,
                                      std::span<const Triangle> triangles) {
  Implementation& guard = all();
  return guard.add(positions, GeometryType::Triangles,
                   [&] { return guard.detection.addTriangleMesh(positions, triangles); });
}

GeometryId StepGuard::addTetrahedralMesh(std::span<const Vector3d> positions,
                                         std::span<const Tetrahedron> tetrahedra) {
  Implementation& guard = all();
  return guard.add(positions, GeometryType::Triangles,
                   [&] { return guard.detection.addTetrahedralMesh(positions, tetrahedra); });
}

GeometryId StepGuard::addLineMesh(std::span<const Vector3d> positions,
                                  std::span<const Segment> segments) {
  Implementation& guard = all();
  return guard.add(positions, GeometryType::Lines,
                   [&] { return guard.detection.addLineMesh(positions, segments); });
}

GeometryId StepGuard::addPointSet(std::span<const Vector3d> positions) {
  Implementation& guard = all();
  return guard.add(positions, GeometryType::Points,
                   [&] { return guard.detection.addPointSet(positions); });
}

void StepGuard::setTriangles(GeometryId id, std::span<const Vector3d> positions,
                             std::span<const Triangle> triangles) {
  Implementation& guard = all();
  guard.setTopology(id, positions, [&] { guard.detection.setTriangles(id, positions, triangles); });
}

void StepGuard::setTetrahedra(GeometryId id, std::span<const Vector3d> positions,
                              std::span<const Tetrahedron> tetrahedra) {
  Implementation& guard = all();
  guard.setTopology(id, positions,
                    [&] { guard.detection.setTetrahedra(id, positions, tetrahedra); });
}

void StepGuard::removeGeometry(GeometryId id) { all().remove(id); }

void StepGuard::addCollisionPair(GeometryId a, GeometryId b) {
  // Whether features touch does not depend on timeTolerance. The largest value is the cheapest.
  all().detection.addCollisionPair(
      a, b, {.method = Method::Continuous, .contacts = Contacts::All, .timeTolerance = 1.0});
}

void StepGuard::removeCollisionPair(GeometryId a, GeometryId b) {
  all().detection.removeCollisionPair(a, b);
}

void StepGuard::setDisabledElements(GeometryId id, std::span<const std::uint32_t> elements) {
  all().detection.setDisabledElements(id, elements);
}

void StepGuard::addRigidGroup(std::span<const GuardedVertex> vertices) { all().addGroup(vertices); }

void StepGuard::addRigidGroup(GeometryId id) {
  std::vector<GuardedVertex> vertices(all().at(id).settled.size());
  for (std::uint32_t v = 0; v < vertices.size(); ++v) vertices[v] = {id, v};
  all().addGroup(vertices);
}

void StepGuard::setFixedVertices(GeometryId id, std::span<const std::uint32_t> vertices) {
  all().setFixed(id, vertices);
}

std::size_t StepGuard::hold(std::span<const GuardedStep> steps) { return all().hold(steps); }

std::span<const GuardedVertex> StepGuard::held() const { return all().held; }

std::size_t StepGuard::rounds() const { return all().rounds; }

}  // namespace palpate
