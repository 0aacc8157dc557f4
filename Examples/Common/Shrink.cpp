#include "Shrink.h"

#include <palpate/Capture.h>

#include <algorithm>
#include <utility>

namespace palpate::scenes {

namespace {

using Fails = std::function<bool(const CollisionProblem&)>;
constexpr std::uint32_t kUnused = 0xffffffffu;

/// Takes `smaller` if it fails.
bool accept(CollisionProblem& problem, CollisionProblem smaller, const Fails& fails) {
  if (!fails(smaller)) return false;
  problem = std::move(smaller);
  return true;
}

std::size_t triangleCount(const CollisionProblem& problem) {
  std::size_t count = 0;
  for (const CollisionProblem::Geometry& mesh : problem.geometries) count += mesh.triangles.size();
  return count;
}

/// Removes the triangles from begin to end, counted over all meshes.
CollisionProblem withoutTriangles(CollisionProblem problem, std::size_t begin, std::size_t end) {
  std::size_t first = 0;
  for (CollisionProblem::Geometry& mesh : problem.geometries) {
    const std::size_t size = mesh.triangles.size();
    const auto place = [&](std::size_t i) {
      return mesh.triangles.begin() +
             static_cast<std::ptrdiff_t>(std::clamp(i, first, first + size) - first);
    };
    const auto from = static_cast<std::uint32_t>(place(begin) - mesh.triangles.begin()),
               to = static_cast<std::uint32_t>(place(end) - mesh.triangles.begin());
    for (auto* ids : {&mesh.disabled, &mesh.removed}) {
      std::erase_if(*ids, [&](std::uint32_t id) { return id >= from && id < to; });
      for (std::uint32_t& id : *ids) id -= id >= to ? to - from : 0;
    }
    mesh.triangles.erase(place(begin), place(end));
    first += size;
  }
  return problem;
}

bool dropTriangles(CollisionProblem& problem, const Fails& fails) {
  bool dropped = false;
  std::size_t part = (triangleCount(problem) + 1) / 2;
  while (part > 0) {
    bool droppedNow = false;
    for (std::size_t begin = 0; begin < triangleCount(problem);)
      if (accept(problem, withoutTriangles(problem, begin, begin + part), fails))
        droppedNow = true;
      else
        begin += part;
    dropped |= droppedNow;
    // Removes single triangles again until none can go.
    part = part > 1 ? (part + 1) / 2 : droppedNow ? 1 : 0;
  }
  return dropped;
}

bool dropPairs(CollisionProblem& problem, const Fails& fails) {
  bool dropped = false;
  for (std::size_t i = problem.pairs.size(); i-- > 0;) {
    CollisionProblem smaller = problem;
    smaller.pairs.erase(smaller.pairs.begin() + static_cast<std::ptrdiff_t>(i));
    dropped |= accept(problem, std::move(smaller), fails);
  }
  return dropped;
}

void removeUnusedVertices(CollisionProblem::Geometry& mesh) {
  if (mesh.type == GeometryType::Points) return;
  std::vector<std::uint32_t> newIndex(mesh.now.size(), kUnused);
  for (const Triangle& triangle : mesh.triangles)
    for (const std::uint32_t corner : triangle) newIndex[corner] = 0;
  std::uint32_t count = 0;
  for (std::size_t v = 0; v < newIndex.size(); ++v) {
    if (newIndex[v] == kUnused) continue;
    mesh.before[count] = mesh.before[v];
    mesh.now[count] = mesh.now[v];
    if (mesh.radii.size() > 1) mesh.radii[count] = mesh.radii[v];
    if (!mesh.rest.empty()) mesh.rest[count] = mesh.rest[v];
    newIndex[v] = count++;
  }
  mesh.before.resize(count);
  mesh.now.resize(count);
  if (mesh.radii.size() > 1) mesh.radii.resize(count);
  if (!mesh.rest.empty()) mesh.rest.resize(count);
  for (Triangle& triangle : mesh.triangles)
    for (std::uint32_t& corner : triangle) corner = newIndex[corner];
}

CollisionProblem withoutUnusedVertices(CollisionProblem problem) {
  for (CollisionProblem::Geometry& mesh : problem.geometries) removeUnusedVertices(mesh);
  return problem;
}

CollisionProblem withoutUnusedMeshes(const CollisionProblem& problem) {
  CollisionProblem smaller{problem.settings, {}, problem.pairs};
  for (std::uint32_t i = 0; i < problem.geometries.size(); ++i) {
    const bool used =
        std::any_of(problem.pairs.begin(), problem.pairs.end(),
                    [&](const CollisionProblem::Pair& pair) { return pair.a == i || pair.b == i; });
    if (!used) continue;
    const auto index = static_cast<std::uint32_t>(smaller.geometries.size());
    for (std::size_t p = 0; p < problem.pairs.size(); ++p) {
      if (problem.pairs[p].a == i) smaller.pairs[p].a = index;
      if (problem.pairs[p].b == i) smaller.pairs[p].b = index;
    }
    smaller.geometries.push_back(problem.geometries[i]);
  }
  return smaller;
}

}  // namespace

OctreeBasedCD solve(CollisionProblem problem, Engine engine) {
  problem.settings.engine = engine;
  OctreeBasedCD detection = setUp(problem);
  detection.detectCollision();
  return detection;
}

const CollisionData& dataOf(const OctreeBasedCD& detection, const CollisionProblem::Pair& pair) {
  return detection.collisionData(GeometryId{pair.a}, GeometryId{pair.b});
}

CollisionProblem shrink(CollisionProblem problem, const Fails& fails) {
  for (CollisionProblem::Geometry& mesh : problem.geometries) {
    mesh.tetrahedra.clear();  // but surfaces
    mesh.removedTetrahedra.clear();
    mesh.tags.clear();  // only predicates use them
  }
  dropPairs(problem, fails);
  while (dropTriangles(problem, fails) && dropPairs(problem, fails)) continue;
  accept(problem, withoutUnusedVertices(problem), fails);
  accept(problem, withoutUnusedMeshes(problem), fails);
  return problem;
}

}  // namespace palpate::scenes
