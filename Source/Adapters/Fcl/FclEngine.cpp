#include <palpate/FclEngine.h>

#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/geometry/shape/cylinder.h>
#include <fcl/geometry/shape/halfspace.h>
#include <fcl/geometry/shape/plane.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>

#include <algorithm>
#include <limits>
#include <map>
#include <string>
#include <utility>

namespace palpate {

namespace {

using Eigen::Vector3d;
using Model = fcl::BVHModel<fcl::OBBRSS<double>>;
using Geometry = std::shared_ptr<fcl::CollisionGeometry<double>>;

/// A geometry as FCL stores it: a shape is centred in its own frame, a capsule or cylinder along z.
struct Body {
  Geometry geometry;
  fcl::Transform3d inFrame = fcl::Transform3d::Identity(), frame = fcl::Transform3d::Identity();

  fcl::NODE_TYPE nodeType() const { return geometry->getNodeType(); }
  bool isMesh() const { return nodeType() == fcl::BV_OBBRSS; }
  fcl::Transform3d place() const { return frame * inFrame; }
};

Geometry modelOf(std::span<const Vector3d> positions, std::span<const Triangle> triangles) {
  auto model = std::make_shared<Model>();
  if (triangles.empty()) return model;  // FCL would print a warning
  std::vector<fcl::Triangle> indices;
  for (const auto& [a, b, c] : triangles) indices.emplace_back(a, b, c);
  model->beginModel(static_cast<int>(triangles.size()), static_cast<int>(positions.size()));
  model->addSubModel({positions.begin(), positions.end()}, indices);
  model->endModel();
  return model;
}

Body along(const Vector3d& p0, const Vector3d& p1, fcl::CollisionGeometry<double>* geometry) {
  Body body{Geometry(geometry)};
  body.inFrame.translation() = 0.5 * (p0 + p1);
  if (p0 != p1) body.inFrame.rotate(Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), p1 - p0));
  return body;
}
Body bodyOf(const Sphere& s) { return along(s.centre, s.centre, new fcl::Sphered(s.radius)); }
Body bodyOf(const Box& b) { return along(b.centre, b.centre, new fcl::Boxd(2 * b.halfExtents)); }
Body bodyOf(const Capsule& c) {
  return along(c.p0, c.p1, new fcl::Capsuled(c.radius, (c.p1 - c.p0).norm()));
}
Body bodyOf(const Cylinder& c) {
  return along(c.p0, c.p1, new fcl::Cylinderd(c.radius, (c.p1 - c.p0).norm()));
}
Body bodyOf(const Plane& p) {
  const Vector3d normal = p.normal.stableNormalized();
  const double offset = normal.dot(p.point);
  if (p.twoSided) return {Geometry(new fcl::Planed(normal, offset))};
  return {Geometry(new fcl::Halfspaced(normal, offset))};
}
/// The hull has no faces. FCL uses faces only to walk over the surface; without them it tests every
/// point.
Body bodyOf(const ConvexHull& h) {
  return {std::make_shared<fcl::Convexd>(std::make_shared<const std::vector<Vector3d>>(h.points), 0,
                                         std::make_shared<const std::vector<int>>())};
}

/// Whether FCL computes the distance in closed form. For other pairs it searches for the distance,
/// and an assertion in FCL ends the process where bodies lie along each other.
bool hasDistance(fcl::NODE_TYPE a, fcl::NODE_TYPE b) {
  if (a == fcl::GEOM_SPHERE || b == fcl::GEOM_SPHERE) return std::max(a, b) < fcl::GEOM_CONVEX;
  return a == fcl::GEOM_CAPSULE && b == fcl::GEOM_CAPSULE;
}

std::string nameOf(GeometryId a, GeometryId b) {
  return "pair (" + std::to_string(static_cast<std::uint32_t>(a)) + ", " +
         std::to_string(static_cast<std::uint32_t>(b)) + ")";
}

/// Why FCL does not support a pair; empty if it does.
std::string unsupportedReason(const Body& a, const Body& b, const PairSettings& settings) {
  if (&a == &b) return "does not support a geometry with itself";
  if (a.isMesh() != b.isMesh()) return "supports two triangle meshes or two shapes only";
  if (a.isMesh() && settings.method != Method::Intersection)
    return "supports triangle meshes by Method::Intersection only";
  if (!a.isMesh() && settings.method != Method::Proximity)
    return "supports shapes by Method::Proximity only";
  const auto [lower, higher] = std::minmax({a.nodeType(), b.nodeType()});
  if (lower == fcl::GEOM_CONVEX && higher == fcl::GEOM_PLANE)
    return "does not support a hull with a two-sided plane";
  if (!a.isMesh() && settings.thickness > 0 && !hasDistance(a.nodeType(), b.nodeType()))
    return "has no reliable distance for these two shapes: the thickness must be 0";
  return "";
}

void addTriangles(const Body& a, const Body& b, std::vector<ElementPair>& pairs) {
  for (const Body* body : {&a, &b})
    if (static_cast<const Model&>(*body->geometry).num_tris == 0) return;
  // Without enable_contact (false) FCL reports each pair of triangles once, else several times.
  fcl::CollisionResultd result;
  fcl::collide(a.geometry.get(), a.place(), b.geometry.get(), b.place(),
               fcl::CollisionRequestd(std::numeric_limits<int>::max(), false), result);
  for (std::size_t i = 0; i < result.numContacts(); ++i) {
    const fcl::Contactd& contact = result.getContact(i);
    pairs.push_back(
        {static_cast<std::uint32_t>(contact.b1), static_cast<std::uint32_t>(contact.b2)});
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
}

/// Appends the deepest contact of collide() if the bodies overlap, else that of distance().
void addContact(const Body& a, const Body& b, double thickness,
                std::vector<ShapeShapeContact>& contacts) {
  fcl::CollisionResultd overlap;
  fcl::collide(a.geometry.get(), a.place(), b.geometry.get(), b.place(),
               fcl::CollisionRequestd(100, true), overlap);
  const fcl::Contactd* deepest = nullptr;
  for (std::size_t i = 0; i < overlap.numContacts(); ++i)
    if (!deepest || overlap.getContact(i).penetration_depth > deepest->penetration_depth)
      deepest = &overlap.getContact(i);
  if (deepest) {
    const double depth = deepest->penetration_depth;
    const Vector3d half = 0.5 * depth * deepest->normal;
    contacts.push_back({deepest->pos + half, deepest->pos - half, -deepest->normal, -depth});
  } else if (thickness > 0) {
    fcl::DistanceResultd nearest;
    fcl::distance(a.geometry.get(), a.place(), b.geometry.get(), b.place(),
                  fcl::DistanceRequestd(true), nearest);
    const auto& [p, q] = nearest.nearest_points;
    if (nearest.min_distance <= thickness)
      contacts.push_back({p, q, (p - q).stableNormalized(), nearest.min_distance});
  }
}

}  // namespace

struct FclEngine::Implementation {
  OctreeBasedCD input;  ///< stores and checks the user's input; detects nothing
  std::map<GeometryId, Body> bodies;
  std::map<std::pair<GeometryId, GeometryId>, CollisionData> answers;
};

FclEngine::FclEngine() : m_implementation(std::make_unique<Implementation>()) {}
FclEngine::FclEngine(FclEngine&&) noexcept = default;
FclEngine& FclEngine::operator=(FclEngine&&) noexcept = default;
FclEngine::~FclEngine() = default;

GeometryId FclEngine::addTriangleMesh(std::span<const Vector3d> positions,
                                      std::span<const Triangle> triangles) {
  const GeometryId id = m_implementation->input.addTriangleMesh(positions, triangles);
  m_implementation->bodies[id].geometry = modelOf(positions, triangles);
  return id;
}

GeometryId FclEngine::addAnalyticalGeometry(const AnalyticalGeometry& shape) {
  const GeometryId id = m_implementation->input.addAnalyticalGeometry(shape);
  m_implementation->bodies[id] = std::visit([](const auto& s) { return bodyOf(s); }, shape);
  return id;
}

void FclEngine::removeGeometry(GeometryId id) {
  m_implementation->input.removeGeometry(id);
  m_implementation->bodies.erase(id);
}

void FclEngine::setPositions(GeometryId id, std::span<const Vector3d> now) {
  m_implementation->input.setPositions(id, now);
  auto& model = static_cast<Model&>(*m_implementation->bodies[id].geometry);
  if (model.num_tris == 0) return;
  model.beginReplaceModel();  // endUpdateModel() would fit boxes over old and new positions
  model.replaceSubModel({now.begin(), now.end()});
  model.endReplaceModel(true, true);
}

void FclEngine::setTriangles(GeometryId id, std::span<const Vector3d> positions,
                             std::span<const Triangle> triangles) {
  m_implementation->input.setTriangles(id, positions, triangles);
  m_implementation->bodies[id].geometry = modelOf(positions, triangles);
}

void FclEngine::setTransform(GeometryId id, const Pose& given) {
  m_implementation->input.setTransform(id, given);
  fcl::Transform3d& frame = m_implementation->bodies[id].frame;
  const Pose pose = m_implementation->input.transform(id);
  frame.linear() = pose.rotation;
  frame.translation() = pose.translation;
}

void FclEngine::addCollisionPair(GeometryId a, GeometryId b, const PairSettings& settings) {
  const auto& bodies = m_implementation->bodies;
  const auto first = bodies.find(a), second = bodies.find(b);
  if (first != bodies.end() && second != bodies.end())  // for unknown ids the call below throws
    if (const std::string reason = unsupportedReason(first->second, second->second, settings);
        reason != "")
      throw Error(ErrorCode::UnsupportedMethod, nameOf(a, b) + ": FCL " + reason, a);
  m_implementation->input.addCollisionPair(a, b, settings);
}

void FclEngine::removeCollisionPair(GeometryId a, GeometryId b) {
  m_implementation->input.removeCollisionPair(a, b);
  m_implementation->answers.erase({a, b});
  m_implementation->answers.erase({b, a});
}

std::span<const CollisionPair> FclEngine::pairs() const { return m_implementation->input.pairs(); }

void FclEngine::detectCollision() {
  std::map<std::pair<GeometryId, GeometryId>, CollisionData> answers;
  for (const auto& [a, b, settings] : pairs()) {
    const Body &x = m_implementation->bodies[a], &y = m_implementation->bodies[b];
    std::vector<ElementPair> triangles;
    std::vector<ShapeShapeContact> contacts;
    try {
      if (x.isMesh())
        addTriangles(x, y, triangles);
      else
        addContact(x, y, settings.thickness, contacts);
    } catch (const std::exception& fault) {
      throw Error(ErrorCode::NotAvailable, nameOf(a, b) + ": FCL failed: " + fault.what(), a);
    }
    Validity validity;
    validity.method = settings.method;
    answers[{a, b}] = CollisionData(CollisionData::Parts{
        .intersectingTriangles = triangles, .shapeShape = contacts, .validity = validity});
  }
  m_implementation->answers = std::move(answers);
}

const CollisionData& FclEngine::collisionData(GeometryId a, GeometryId b) const {
  const auto answer = m_implementation->answers.find({a, b});
  try {
    m_implementation->input.collisionData(a, b);  // throws if there is no such pair
  } catch (const Error& error) {                  // the input itself detects nothing
    if (error.code() != ErrorCode::NotAvailable || answer == m_implementation->answers.end()) throw;
  }
  return answer->second;
}

}  // namespace palpate
