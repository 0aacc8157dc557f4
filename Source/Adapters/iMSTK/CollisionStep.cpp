#include "iMSTK/CollisionStep.h"

#include <palpate/ConstraintRows.h>
#include <palpate/Error.h>
#include <palpate/OctreeBasedCD.h>
#include <palpate/StepGuard.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

namespace palpate {

namespace {

template <std::size_t N>
std::vector<std::array<std::uint32_t, N>> cellsOf(const MeshArrays& mesh) {
  std::vector<std::array<std::uint32_t, N>> cells(mesh.cellCount);
  // A negative index becomes one that no mesh has, and is refused as such.
  for (std::size_t i = 0; i < N * mesh.cellCount; ++i)
    cells[i / N][i % N] = static_cast<std::uint32_t>(mesh.cells[i]);
  return cells;
}

std::span<const Eigen::Vector3d> positionsOf(const MeshArrays& mesh) {
  return {mesh.positions, mesh.vertices};
}

Pose poseOf(const BodyPose& pose) { return {pose.rotation, pose.translation}; }

AnalyticalGeometry shapeOf(const ShapeMeasures& measures) {
  const Eigen::Vector3d end(0, 0.5 * measures.length, 0);
  switch (measures.kind) {
    case ShapeMeasures::Kind::Sphere:
      return Sphere{Eigen::Vector3d::Zero(), measures.radius};
    case ShapeMeasures::Kind::Capsule:
      return Capsule{-end, end, measures.radius};
    case ShapeMeasures::Kind::Cylinder:
      return Cylinder{-end, end, measures.radius};
    case ShapeMeasures::Kind::Box:
      return Box{Eigen::Vector3d::Zero(), measures.halfExtents};
    case ShapeMeasures::Kind::Plane:
      break;
  }
  return Plane{Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitY()};
}

Method methodOf(CollisionStep::Method method) {
  switch (method) {
    case CollisionStep::Method::Intersection:
      return Method::Intersection;
    case CollisionStep::Method::Proximity:
      return Method::Proximity;
    case CollisionStep::Method::Continuous:
      return Method::Continuous;
    case CollisionStep::Method::Auto:
      break;
  }
  return Method::Auto;
}

struct Body {
  BodyRole role;
  int verticesPerCell;  // 0: a shape
  double radius;
  std::string name;
  GeometryId id{};
  ShapeMeasures measures{};                               // of a shape
  bool isPlane = false;                                   // without bounds
  std::vector<Eigen::Vector3d> local{};                   // of a rigid mesh
  std::vector<std::array<std::uint32_t, 3>> triangles{};  // of a triangle mesh
  std::vector<Eigen::Vector3d> before{}, now{};
  BodyPose poseBefore{}, poseNow{};
  // Where the program put a fixed body in the last step and in this one. What holds it back does
  // not slide.
  std::vector<Eigen::Vector3d> programBefore{}, program{};
  BodyPose programPoseBefore{}, programPose{};

  bool isShape() const { return verticesPerCell == 0; }
  bool isPlaced() const { return isShape() || role == BodyRole::Rigid; }
  void place() {
    const Pose start = poseOf(poseBefore), end = poseOf(poseNow);
    for (std::size_t i = 0; i < local.size(); ++i) {
      before[i] = start(local[i]);
      now[i] = end(local[i]);
    }
  }
  Pose poseAt(double time) const {
    const Eigen::Quaterniond start(poseBefore.rotation), end(poseNow.rotation);
    return {start.slerp(time, end).toRotationMatrix(),
            (1 - time) * poseBefore.translation + time * poseNow.translation};
  }
};

struct PairOfBodies {
  int a, b;
  CollisionStep::Pair settings;
};

}  // namespace

struct CollisionStep::Implementation {
  explicit Implementation(const Settings& settings) : collisions(settings), guard(collisions) {}

  OctreeBasedCD collisions;
  StepGuard guard;
  std::vector<Body> bodies;
  std::vector<PairOfBodies> pairs;

  const Body& body(int i) const { return bodies[static_cast<std::size_t>(i)]; }
  Body& body(int i) { return bodies[static_cast<std::size_t>(i)]; }
  const PairOfBodies& pair(int i) const { return pairs[static_cast<std::size_t>(i)]; }
  const CollisionData& contactsOf(int i) const {
    return collisions.collisionData(body(pair(i).a).id, body(pair(i).b).id);
  }

  void add(Body& added, const MeshArrays& mesh) {
    switch (added.verticesPerCell) {
      case 1:
        added.id = collisions.addPointSet(positionsOf(mesh), added.radius);
        break;
      case 2:
        added.id = collisions.addLineMesh(positionsOf(mesh), cellsOf<2>(mesh), added.radius);
        break;
      case 3:
        added.triangles = cellsOf<3>(mesh);
        added.id = collisions.addTriangleMesh(positionsOf(mesh), added.triangles);
        break;
      default:
        added.id = collisions.addTetrahedralMesh(positionsOf(mesh), cellsOf<4>(mesh));
    }
    nameAndGroup(added);
  }

  void nameAndGroup(const Body& added) {
    collisions.setName(added.id, added.name);
    if (added.role == BodyRole::Fixed && !added.isShape())
      guard.addRigidGroup(std::array{GuardedVertex{added.id}});
  }

  void add(const PairOfBodies& added) {
    const GeometryId a = body(added.a).id, b = body(added.b).id;
    collisions.addCollisionPair(
        a, b,
        {.method = methodOf(added.settings.method),
         .thickness = added.settings.thickness,
         .contacts = added.settings.all ? Contacts::All : Contacts::Distinct,
         .restDistance = added.settings.restDistance});
    guard.setGuarded(a, b, added.settings.guarded);
  }

  // Adds what one side of a row counts with: its particles, one point of a rigid body, or nothing.
  void addSide(StepRow& row, const ConstraintRow& from, int bodyIndex, std::uint32_t first) const {
    const Body& side = body(bodyIndex);
    const auto size = static_cast<std::uint32_t>(side.now.size());
    StepRow::Term whole{bodyIndex, -1, 0.0, Eigen::Vector3d::Zero()};
    for (std::size_t i = 0; i < 4; ++i) {
      const double weight = from.weights[i];
      const std::uint32_t vertex = from.vertices[i] - first;
      if (weight == 0 || from.vertices[i] < first || vertex >= size) continue;
      if (side.role == BodyRole::Particles) {
        row.terms[static_cast<std::size_t>(row.termCount++)] = {bodyIndex, static_cast<int>(vertex),
                                                                weight, Eigen::Vector3d::Zero()};
      } else if (side.role == BodyRole::Rigid) {
        whole.weight += weight;
        whole.local += weight * side.local[vertex];
      } else {
        row.offset -= weight * row.normal.dot(side.now[vertex]);
        row.fixedDisplacement += weight * (side.program[vertex] - side.programBefore[vertex]);
      }
    }
    if (whole.weight == 0) return;
    whole.local /= whole.weight;
    row.terms[static_cast<std::size_t>(row.termCount++)] = whole;
  }

  // The point of a shape, touched at a time of the step. `weight` is 1 or -1.
  void addPoint(StepRow& row, int bodyIndex, const Eigen::Vector3d& point, double time,
                double weight) const {
    const Body& side = body(bodyIndex);
    const Pose then = side.poseAt(time);
    const Eigen::Vector3d local = then.rotation.transpose() * (point - then.translation);
    const Eigen::Vector3d end = poseOf(side.poseNow)(local);
    if (side.role == BodyRole::Rigid) {
      row.terms[static_cast<std::size_t>(row.termCount++)] = {bodyIndex, -1, weight, local};
      row.offset += weight * row.normal.dot(end);
    } else {
      row.fixedDisplacement +=
          weight * (poseOf(side.programPose)(local) - poseOf(side.programPoseBefore)(local));
    }
  }
};

CollisionStep::CollisionStep(int threads) {
  Settings settings;
  settings.threads = threads;
  m_implementation = std::make_unique<Implementation>(settings);
}
CollisionStep::~CollisionStep() = default;

int CollisionStep::addMesh(BodyRole role, const MeshArrays& mesh, double radius,
                           const BodyPose& pose, const std::string& name) {
  Implementation& all = *m_implementation;
  Body body{role, mesh.verticesPerCell, radius, name};
  body.now.assign(mesh.positions, mesh.positions + mesh.vertices);
  body.before = body.program = body.programBefore = body.now;
  all.add(body, mesh);
  if (role == BodyRole::Rigid) {
    body.local = body.now;
    body.poseBefore = body.poseNow = pose;
    all.collisions.setTransform(body.id, poseOf(pose), poseOf(pose));
    body.place();
  }
  all.bodies.push_back(std::move(body));
  return static_cast<int>(all.bodies.size()) - 1;
}

int CollisionStep::addShape(BodyRole role, const ShapeMeasures& measures, const BodyPose& pose,
                            const std::string& name) {
  Implementation& all = *m_implementation;
  Body body{role, 0, 0.0, name};
  body.measures = measures;
  body.isPlane = measures.kind == ShapeMeasures::Kind::Plane;
  body.id = all.collisions.addAnalyticalGeometry(shapeOf(measures));
  body.poseBefore = body.poseNow = body.programPose = body.programPoseBefore = pose;
  all.collisions.setTransform(body.id, poseOf(pose), poseOf(pose));
  all.nameAndGroup(body);
  all.bodies.push_back(std::move(body));
  return static_cast<int>(all.bodies.size()) - 1;
}

void CollisionStep::replaceMesh(int index, const MeshArrays& mesh) {
  Implementation& all = *m_implementation;
  Body& body = all.body(index);
  if (body.verticesPerCell == 3) {
    all.collisions.setTriangles(body.id, positionsOf(mesh), cellsOf<3>(mesh));
    body.triangles = cellsOf<3>(mesh);
  } else if (body.verticesPerCell == 4) {
    all.collisions.setTetrahedra(body.id, positionsOf(mesh), cellsOf<4>(mesh));
  } else {
    const GeometryId old = body.id;
    all.add(body, mesh);
    all.collisions.removeGeometry(old);
    for (const PairOfBodies& pair : all.pairs)
      if (pair.a == index || pair.b == index) all.add(pair);
  }
  std::vector<Eigen::Vector3d>& positions = body.role == BodyRole::Rigid ? body.local : body.now;
  positions.assign(mesh.positions, mesh.positions + mesh.vertices);
  body.before.resize(positions.size());
  body.now.resize(positions.size());
  if (body.role == BodyRole::Rigid)
    body.place();
  else
    body.before = body.program = body.programBefore = body.now;
}

int CollisionStep::addPair(int a, int b, const Pair& settings) {
  const PairOfBodies pair{a, b, settings};
  m_implementation->add(pair);
  m_implementation->pairs.push_back(pair);
  return static_cast<int>(m_implementation->pairs.size()) - 1;
}

void CollisionStep::setGuarded(int index, bool guarded) {
  PairOfBodies& pair = m_implementation->pairs[static_cast<std::size_t>(index)];
  pair.settings.guarded = guarded;
  m_implementation->guard.setGuarded(m_implementation->body(pair.a).id,
                                     m_implementation->body(pair.b).id, guarded);
}

void CollisionStep::setPositions(int index, const Eigen::Vector3d* before,
                                 const Eigen::Vector3d* now, std::size_t vertices) {
  Body& body = m_implementation->body(index);
  const std::vector<Eigen::Vector3d> start(before, before + vertices), end(now, now + vertices);
  m_implementation->collisions.setPositions(body.id, start, end);
  body.programBefore = start == end ? end : body.program;
  body.program = end;
  body.before = start;
  body.now = end;
}

void CollisionStep::setPose(int index, const BodyPose& before, const BodyPose& now) {
  Body& body = m_implementation->body(index);
  m_implementation->collisions.setTransform(body.id, poseOf(before), poseOf(now));
  body.programPoseBefore = before == now ? now : body.programPose;
  body.programPose = now;
  body.poseBefore = before;
  body.poseNow = now;
  body.place();
}

const std::vector<Eigen::Vector3d>& CollisionStep::before(int body) const {
  return m_implementation->body(body).before;
}
const std::vector<Eigen::Vector3d>& CollisionStep::now(int body) const {
  return m_implementation->body(body).now;
}
const BodyPose& CollisionStep::poseBefore(int body) const {
  return m_implementation->body(body).poseBefore;
}
const BodyPose& CollisionStep::poseNow(int body) const {
  return m_implementation->body(body).poseNow;
}

void CollisionStep::detect() { m_implementation->collisions.detectCollision(); }

bool CollisionStep::trusted() const {
  for (int i = 0; i < static_cast<int>(m_implementation->pairs.size()); ++i)
    if (!m_implementation->contactsOf(i).validity().trusted) return false;
  return true;
}

bool CollisionStep::mayCross(int pair) const {
  return !m_implementation->contactsOf(pair).validity().startedApart;
}

bool CollisionStep::isCrossed(int index, bool was) {
  Implementation& all = *m_implementation;
  const PairOfBodies& pair = all.pair(index);
  const Body &a = all.body(pair.a), &b = all.body(pair.b);
  const SpatialQueries queries = all.collisions.queries();
  if (!a.isShape() && !b.isShape()) {
    if (a.verticesPerCell == 1 || b.verticesPerCell == 1) return false;
    std::vector<ElementPair> candidates;
    all.collisions.forEachCandidate(a.id, b.id, [&](std::span<const ElementPair> batch) {
      candidates.insert(candidates.end(), batch.begin(), batch.end());
    });
    return std::ranges::any_of(candidates, [&](const ElementPair& elements) {
      return queries.pierce(a.id, elements.a, b.id, elements.b);
    });
  }
  const auto sizeOf = [&](const Body& body) {
    const Eigen::AlignedBox3d box = all.collisions.bounds(body.id);
    return body.isPlane || box.isEmpty()
               ? 0.0
               : box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff();
  };
  // The guard's slack is 2^-33.
  const double slack = std::ldexp(std::max(sizeOf(a), sizeOf(b)), -30);
  if (a.isShape() && b.isShape()) {
    if (a.isPlane && b.isPlane) return false;
    const Penetration found = queries.penetration(a.id, b.id);
    return was ? found.intersecting || queries.distance(a.id, b.id).distance < slack
               : found.depth > slack;
  }
  const Body &shape = a.isShape() ? a : b, &mesh = a.isShape() ? b : a;
  std::vector<ShapeContact> contacts;
  queries.contacts(mesh.id, shapeOf(shape.measures), poseOf(shape.poseNow), slack, contacts);
  return was ? !contacts.empty() : std::ranges::any_of(contacts, [&](const ShapeContact& c) {
    return c.distance < -slack;
  });
}

void CollisionStep::appendRows(int index, std::vector<StepRow>& rows) const {
  const Implementation& all = *m_implementation;
  const CollisionData& contacts = all.contactsOf(index);
  const PairOfBodies& pair = all.pair(index);
  const Body &a = all.body(pair.a), &b = all.body(pair.b);
  const auto emptyRow = [](const Eigen::Vector3d& normal, double offset) {
    StepRow row{};
    row.normal = normal;
    row.offset = offset;
    row.fixedDisplacement = Eigen::Vector3d::Zero();
    return row;
  };

  const std::uint32_t firstOfB = pair.a == pair.b ? 0 : static_cast<std::uint32_t>(a.now.size());
  const auto side = [](const Body& body, std::uint32_t first) {
    return body.isShape() ? SolverVertices{} : SolverVertices{first, body.before, body.now};
  };
  const Body& shape = a.isShape() ? a : b;
  std::vector<ConstraintRow> solverRows;
  if (!(a.isShape() && b.isShape()))
    palpate::appendRows(contacts, side(a, 0), side(b, firstOfB), solverRows,
                        {poseOf(shape.poseBefore), poseOf(shape.poseNow)});
  const std::size_t firstShapeRow = solverRows.size() - contacts.shape().size();
  for (std::size_t i = 0; i < solverRows.size(); ++i) {
    StepRow row = emptyRow(solverRows[i].normal, solverRows[i].offset);
    all.addSide(row, solverRows[i], pair.a, 0);
    if (pair.a != pair.b) all.addSide(row, solverRows[i], pair.b, firstOfB);
    if (i >= firstShapeRow) {
      const ShapeContact& contact = contacts.shape()[i - firstShapeRow];
      // The row's offset holds the normal's part of the shape's point, which addPoint() moves out.
      const int shapeIndex = a.isShape() ? pair.a : pair.b;
      all.addPoint(row, shapeIndex, contact.pointOnShape, contact.timeOfImpact, -1.0);
    }
    rows.push_back(row);
  }
  for (const ShapeShapeContact& contact : contacts.shapeShape()) {
    // With both points at the step's end, the gap is what separates them along the normal.
    StepRow row = emptyRow(contact.normal, 0.0);
    const auto end = [&](const Body& body, const Eigen::Vector3d& point) -> Eigen::Vector3d {
      const Pose then = body.poseAt(contact.timeOfImpact);
      return poseOf(body.poseNow)(then.rotation.transpose() * (point - then.translation));
    };
    row.offset = -contact.normal.dot(end(a, contact.pointA) - end(b, contact.pointB));
    all.addPoint(row, pair.a, contact.pointA, contact.timeOfImpact, 1.0);
    all.addPoint(row, pair.b, contact.pointB, contact.timeOfImpact, -1.0);
    rows.push_back(row);
  }
}

void CollisionStep::appendElements(int index, std::vector<StepElement>& a,
                                   std::vector<StepElement>& b) const {
  const Implementation& all = *m_implementation;
  const CollisionData& contacts = all.contactsOf(index);
  // {p, p, p} is a vertex, {p, q, q} an edge.
  const auto element = [](const std::array<std::uint32_t, 3>& ids, const Eigen::Vector3d& point,
                          const Eigen::Vector3d& direction, double depth) {
    const int count = ids[1] != ids[2] ? 3 : ids[0] != ids[1] ? 2 : 1;
    return StepElement{
        count,
        {static_cast<int>(ids[0]), static_cast<int>(ids[1]), static_cast<int>(ids[2])},
        point,
        direction,
        depth};
  };
  const auto append = [&](const std::array<std::uint32_t, 3>& ofA,
                          const std::array<std::uint32_t, 3>& ofB, const Eigen::Vector3d& toA,
                          double distance) {
    a.push_back(element(ofA, Eigen::Vector3d::Zero(), toA, -distance));
    b.push_back(element(ofB, Eigen::Vector3d::Zero(), -toA, -distance));
  };
  for (const VertexTriangleContact& contact : contacts.vertexTriangle())
    append({contact.vertex, contact.vertex, contact.vertex}, contact.vertices, contact.normal,
           contact.distance);
  for (const VertexTriangleContact& contact : contacts.triangleVertex())
    append(contact.vertices, {contact.vertex, contact.vertex, contact.vertex}, -contact.normal,
           contact.distance);
  for (const EdgeEdgeContact& contact : contacts.edgeEdge())
    append({contact.edgeA[0], contact.edgeA[1], contact.edgeA[1]},
           {contact.edgeB[0], contact.edgeB[1], contact.edgeB[1]}, contact.normal,
           contact.distance);
  const Body &bodyA = all.body(all.pair(index).a), &bodyB = all.body(all.pair(index).b);
  // Contacts stand for some of the triangles that intersect.
  if (all.pair(index).settings.all) {
    const auto corners = [&](const Body& body, std::uint32_t triangle) {
      return body.verticesPerCell == 4 ? all.collisions.surface(body.id).triangles[triangle]
                                       : body.triangles[triangle];
    };
    for (const ElementPair& pair : contacts.intersectingTriangles())
      append(corners(bodyA, pair.a), corners(bodyB, pair.b), Eigen::Vector3d::Zero(), 0.0);
  }
  const bool shapeIsA = bodyA.isShape();
  for (const ShapeContact& contact : contacts.shape()) {
    (shapeIsA ? b : a)
        .push_back(element(contact.vertices, contact.point, contact.normal, -contact.distance));
    (shapeIsA ? a : b).push_back({0, {}, contact.pointOnShape, -contact.normal, -contact.distance});
  }
  for (const ShapeShapeContact& contact : contacts.shapeShape()) {
    a.push_back({0, {}, contact.pointA, contact.normal, -contact.distance});
    b.push_back({0, {}, contact.pointB, -contact.normal, -contact.distance});
  }
}

std::size_t CollisionStep::hold(std::vector<int>& leftOut) {
  Implementation& all = *m_implementation;
  std::size_t held = 0;
  for (bool isDone = false; !isDone;) try {
      held = all.guard.hold();
      isDone = true;
    } catch (const Error& error) {
      bool isLeftOut = false;
      for (int i = 0; i < static_cast<int>(all.pairs.size()); ++i) {
        const PairOfBodies& pair = all.pair(i);
        if (error.code() != ErrorCode::ImpactRemains || !pair.settings.guarded || !mayCross(i) ||
            (error.geometry() != all.body(pair.a).id && error.geometry() != all.body(pair.b).id))
          continue;
        setGuarded(i, false);
        leftOut.push_back(i);
        isLeftOut = true;
      }
      if (!isLeftOut) throw;
    }
  if (held == 0) return 0;
  for (Body& body : all.bodies) {
    if (body.isPlaced()) {
      const Pose pose = all.collisions.transform(body.id);
      body.poseNow = {pose.rotation, pose.translation};
      body.place();
    } else {
      const std::span<const Eigen::Vector3d> positions = all.collisions.positions(body.id);
      body.now.assign(positions.begin(), positions.end());
    }
  }
  return held;
}

void CollisionStep::stay(int index) {
  Body& body = m_implementation->body(index);
  body.poseNow = body.poseBefore;
  m_implementation->collisions.setTransform(body.id, poseOf(body.poseNow));
  body.place();
}

void CollisionStep::restoreFixedEnds() {
  for (Body& body : m_implementation->bodies) {
    if (body.role != BodyRole::Fixed) continue;
    if (body.isShape()) {
      body.poseNow = body.programPose;
      m_implementation->collisions.setTransform(body.id, poseOf(body.poseNow));
    } else {
      body.now = body.program;
      m_implementation->collisions.setPositions(body.id, body.now);
    }
  }
}

void CollisionStep::advance() {
  m_implementation->collisions.advance();
  for (Body& body : m_implementation->bodies) {
    body.before = body.now;
    body.poseBefore = body.poseNow;
  }
}

}  // namespace palpate
