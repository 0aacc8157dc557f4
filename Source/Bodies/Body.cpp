#include "Bodies/Body.h"

#include <palpate/Error.h>

#include <cstddef>

namespace palpate {

std::string GeometryLabel::number() const {
  const std::string number = std::to_string(static_cast<std::uint32_t>(id));
  return name.empty() ? number : number + " \"" + std::string(name) + "\"";
}

std::string nameOf(const GeometryLabel& label) { return "geometry " + label.number(); }

void makeBody(std::span<const Eigen::Vector3d> positions, std::span<const Triangle> triangles,
              const Threads& threads, Body& out) {
  out.mesh.now = Positions(std::vector(positions.begin(), positions.end()));
  out.mesh.before = out.mesh.now;
  out.mesh.topology.vertexCount = positions.size();
  out.mesh.topology.elements.assign(triangles.begin(), triangles.end());
  out.revisions.elements.topology = out.revisions.counter.next();
  const double spread = out.tree.sampleFrame(out.mesh, out.revisions.elements.topology);
  out.tree.update(out.mesh, out.revisions.elements.topology, frameScale(spread), {}, threads);
}

const Body& searchable(const Body& geometry) {
  if (!geometry.isField()) return geometry;
  throw Error(ErrorCode::UnsupportedMethod,
              nameOf(geometry) +
                  " is a distance field, which queries do not support; use DistanceField::value()",
              geometry.id);
}

std::string nameOf(GeometryType type) {
  constexpr const char* kNames[] = {"a triangle mesh", "a line mesh", "a point set", "a shape",
                                    "a distance field"};
  return kNames[static_cast<std::size_t>(type)];
}

void checkMeshType(const Body& geometry, bool tetrahedra, const char* call) {
  if (geometry.mesh.topology.hasFaces() && (geometry.solid != nullptr) == tetrahedra) return;
  throw Error(ErrorCode::UnsupportedMethod,
              nameOf(geometry) + " is " +
                  (geometry.solid ? "a tetrahedral mesh" : nameOf(geometry.mesh.topology.type)) +
                  "; " + call,
              geometry.id);
}

}  // namespace palpate
