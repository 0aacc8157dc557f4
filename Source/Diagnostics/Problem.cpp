// Part of CollisionDetection/DiagnosticsInterface.h: the input of a detection.
#include "CollisionDetection/DiagnosticsInterface.h"

#include <span>
#include <unordered_map>
#include <vector>

namespace palpate {

namespace {

template <class T>
void copyTo(std::vector<T>& out, std::span<const T> from) {
  out.assign(from.begin(), from.end());
}

CollisionProblem::Geometry meshOf(const Geometry& geometry) {
  const TriangleMesh& mesh = geometry.body.mesh;
  CollisionProblem::Geometry copy = problemOf(geometry);
  if (geometry.isShapeFixed()) {
    copyTo(copy.before, mesh.before.body());
    copyTo(copy.now, mesh.now.body());
  } else if (!geometry.body.shape) {
    copy.before = mesh.before.all(), copy.now = mesh.now.all();
  }
  copy.motion = {mesh.before.transform(), mesh.now.transform()};
  if (geometry.body.solid) copyTo<Eigen::Vector3d>(copy.rest, mesh.rest);
  return copy;
}

}  // namespace

CollisionProblem::Geometry problemOf(const Geometry& geometry) {
  const TriangleMesh& mesh = geometry.body.mesh;
  CollisionProblem::Geometry copy;
  copy.id = geometry.body.id;
  copy.name = geometry.body.name;
  copy.type = mesh.topology.type;
  copyTo<double>(copy.radii, mesh.radii);
  copy.filter = geometry.filter;
  copyTo<std::uint32_t>(copy.disabled, mesh.topology.disabled);
  copyTo<std::uint32_t>(copy.removed, mesh.topology.removed);
  copyTo<std::uint32_t>(copy.tags, geometry.body.solid ? geometry.body.solid->tags : mesh.tags);
  if (geometry.body.shape) copy.analytical = geometry.body.shape->analytical;
  copy.field = geometry.body.field;
  if (geometry.proxy) copy.proxy = geometry.proxySettings;
  if (copy.type != GeometryType::Points) copyTo<Triangle>(copy.triangles, mesh.topology.elements);
  if (copy.radii.empty() && mesh.largestRadius > 0.0) copy.radii = {mesh.largestRadius};
  if (geometry.body.solid) {
    copyTo<Tetrahedron>(copy.tetrahedra, geometry.body.solid->topology.tetrahedra);
    copyTo<std::uint32_t>(copy.removedTetrahedra, geometry.body.solid->topology.removed);
  }
  return copy;
}

CollisionProblem problemOf(const Settings& settings, const GeometryTable& geometries,
                           const PairTable& pairs) {
  CollisionProblem problem{settings, {}, {}};
  problem.settings.executor = nullptr;
  problem.settings.memoryLimit = 0;
  std::unordered_map<const Geometry*, std::uint32_t> indices;
  for (const auto& geometry : geometries.all()) {
    indices.emplace(geometry.get(), static_cast<std::uint32_t>(indices.size()));
    problem.geometries.push_back(meshOf(*geometry));
  }
  for (const auto& record : pairs.records()) {
    const PairPlan& plan = record->question->plan;
    problem.pairs.push_back({indices.at(record->a), indices.at(record->b), record->pair.settings,
                             plan.kind == PairKind::AttachedProxy ? Method::Proxy : plan.method,
                             static_cast<bool>(record->filters.predicate)});
    if (const auto& sides = record->memory.sides.sides;
        sides && record->pair.settings.rememberSides)
      problem.pairs.back().sides = sides->list(record->meshes(), geometries.stepNumber());
    if (record->pair.settings.restDistance > 0.0)
      copyTo<Eigen::Vector3d>(problem.geometries[problem.pairs.back().a].rest,
                              record->a->body.mesh.rest);
  }
  return problem;
}

}  // namespace palpate
