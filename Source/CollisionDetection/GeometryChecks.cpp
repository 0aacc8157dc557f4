#include "CollisionDetection/GeometryChecks.h"

#include "Math/Range.h"
#include "Math/Tolerances.h"
#include "Core/Text.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <mutex>
#include <optional>
#include <string>

namespace palpate {

void checkAttachable(const Geometry& geometry, const DistanceField& field) {
  const MeshTopology& topology = geometry.body.mesh.topology;
  const auto refuse = [&](const std::string& reason, ErrorCode code,
                          std::optional<std::size_t> element = {}) {
    throw Error(code, nameOf(geometry) + reason, geometry.body.id, element);
  };
  if (!topology.hasFaces())
    refuse(" is " + nameOf(topology.type) +
               "; attachDistanceField() is for triangle and tetrahedral meshes",
           ErrorCode::UnsupportedMethod);
  if (!topology.disabled.empty())
    refuse(" has disabled elements, and a distance field is of all elements",
           ErrorCode::UnsupportedMethod);
  const std::span<const Eigen::Vector3d> body = geometry.body.mesh.now.body();
  for (std::size_t v = 0; v < body.size(); ++v) {
    if (!topology.isUsed[v]) continue;
    const double value = field.value(body[v]);
    if (!(std::abs(value) <= field.errorBound()))
      refuse(": the distance field is not of this mesh; it has the value " + textOf(value) +
                 " at vertex " + std::to_string(v) + ", and its error bound is " +
                 textOf(field.errorBound()),
             ErrorCode::InvalidSettings, v);
  }
}

void checkProxy(const Geometry& geometry, const SurfaceProxySettings& settings) {
  const MeshTopology& topology = geometry.body.mesh.topology;
  if (!topology.hasFaces())
    throw Error(ErrorCode::UnsupportedMethod,
                nameOf(geometry) + " is " + nameOf(topology.type) +
                    "; attachSurfaceProxy() is for triangle and tetrahedral meshes",
                geometry.body.id);
  const auto need = [&](const char* which, double value, double most, const std::string& rule) {
    if (!(value > 0.0 && value <= most))
      throw Error(ErrorCode::InvalidSettings,
                  nameOf(geometry) + ": " + which + " is " + textOf(value) + "; it must be " + rule,
                  geometry.body.id);
  };
  need("reach", settings.reach, kLargestMeasure, "positive and finite");
  need("errorBound", settings.errorBound, kLargestMeasure, "positive and finite");
  need("widestNormalCone", settings.widestNormalCone, kWidestNormalCone, "above 0 and at most 1.5");
}

void checkShapeMayChange(const Geometry& geometry, const char* call) {
  if (!geometry.isShapeFixed()) return;
  const bool hasField = geometry.body.field != nullptr;
  throw Error(ErrorCode::UnsupportedMethod,
              nameOf(geometry) + " has " +
                  (hasField ? "a distance field" : "the leaves of a proxy") +
                  " attached, so that " + call + " may not change it; detach " +
                  (hasField ? "the field by attachDistanceField() with null"
                            : "them by attachSurfaceProxy() with none"),
              geometry.body.id);
}

void checkName(const Body& body, const std::string& name) {
  if (name.find('\0') != std::string::npos)
    throw Error(ErrorCode::InvalidSettings,
                nameOf(body) + ": the name has a null character, which would end messages",
                body.id);
}

void checkFilter(const Geometry& geometry, const CollisionFilter& filter) {
  const GeometryId id = geometry.body.id;
  if (filter.sidedness != Sidedness::Both && filter.sidedness != Sidedness::Outer)
    throw Error(ErrorCode::InvalidSettings,
                nameOf(geometry) + ": sidedness is " +
                    std::to_string(static_cast<int>(filter.sidedness)) +
                    "; it must be Both or Outer",
                id);
  if (filter.sidedness == Sidedness::Outer && !geometry.body.mesh.topology.hasFaces())
    throw Error(ErrorCode::InvalidSettings,
                nameOf(geometry) + " is " + nameOf(geometry.body.mesh.topology.type) +
                    ", which has no sides",
                id);
}

void checkElements(const Geometry& geometry, std::span<const std::uint32_t> elements) {
  const std::size_t count = geometry.body.mesh.topology.elements.size();
  for (const std::uint32_t element : elements)
    if (element >= count)
      throw Error(ErrorCode::IndexOutOfRange,
                  nameOf(geometry) + ": element " + std::to_string(element) +
                      " is out of range; the geometry has " + std::to_string(count) + " elements",
                  geometry.body.id, element);
}

void checkTags(const Body& body, std::size_t given) {
  const bool isOne = body.shape || body.isField();
  const std::size_t count = isOne        ? 1
                            : body.solid ? body.solid->topology.tetrahedra.size()
                                         : body.mesh.topology.elements.size();
  if (given != 0 && given != count)
    throw Error(ErrorCode::InvalidSettings,
                nameOf(body) + ": " + std::to_string(given) + " tags given, but it has " +
                    (isOne ? "1 element"
                           : std::to_string(count) + (body.solid ? " tetrahedra" : " elements")),
                body.id);
}

static void checkHasPositions(const Geometry& geometry) {
  if (geometry.body.shape)
    throw Error(ErrorCode::WrongPositionCount,
                nameOf(geometry) + " is a shape, which has no positions; setTransform() moves it",
                geometry.body.id);
  if (geometry.body.isField())
    throw Error(
        ErrorCode::WrongPositionCount,
        nameOf(geometry) + " is a distance field, which has no positions; setTransform() moves it",
        geometry.body.id);
}

void checkPositionCount(const Geometry& geometry, std::size_t count) {
  checkHasPositions(geometry);
  if (count != geometry.body.mesh.topology.vertexCount)
    throw Error(
        ErrorCode::WrongPositionCount,
        nameOf(geometry) + ": " + std::to_string(count) + " positions given, but it has " +
            std::to_string(geometry.body.mesh.topology.vertexCount) + " vertices" +
            (geometry.body.solid                      ? "; setTetrahedra() changes their number"
             : geometry.body.mesh.topology.hasFaces() ? "; setTriangles() changes their number"
                                                      : ""),
        geometry.body.id);
}

void checkPositionCount(const Geometry& geometry, std::size_t first, std::size_t count) {
  checkHasPositions(geometry);
  const std::size_t all = geometry.body.mesh.topology.vertexCount;
  if (first > all || count > all - first)
    throw Error(ErrorCode::WrongPositionCount,
                nameOf(geometry) + ": " + std::to_string(count) + " positions given from vertex " +
                    std::to_string(static_cast<std::ptrdiff_t>(first)) + " on, but it has " +
                    std::to_string(all) + " vertices",
                geometry.body.id);
}

}  // namespace palpate
