#include <palpate/DistanceField.h>

#include <palpate/Error.h>

#include "Core/FloatingPoint.h"
#include "Core/Text.h"
#include "Core/Threads.h"
#include "DistanceField/FieldBuilder.h"
#include "DistanceField/FieldCells.h"
#include "DistanceField/FieldFile.h"
#include "Mesh/FloatPositions.h"
#include "Queries/Containment.h"
#include "Queries/SearchableGeometry.h"

#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace palpate {

struct DistanceField::Implementation {
  explicit Implementation(FieldCells newCells) : cells(std::move(newCells)), lookup(cells) {}
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;

  const FieldCells cells;
  const FieldLookup lookup;
};

namespace {

constexpr std::size_t kMostElements = std::size_t{1} << 28;

void checkSettings(const DistanceFieldSettings& settings) {
  const auto check = [](double length, const char* name) {
    if (!(length > 0.0) || std::isinf(length))
      throw Error(ErrorCode::InvalidSettings,
                  std::string(name) + " is " + textOf(length) + "; it must be positive and finite");
  };
  check(settings.errorBound, "errorBound");
  check(settings.band, "band");
  if (settings.threads < 0 || settings.threads > 1024)
    throw Error(ErrorCode::InvalidSettings,
                "threads is " + std::to_string(settings.threads) + "; it must be in [0, 1024]");
}

void checkMesh(const TriangleMeshView& mesh, GeometryId id) {
  if (std::max(mesh.positions.size(), mesh.triangles.size()) > kMostElements)
    throw Error(ErrorCode::TooLarge,
                nameOf(id) + ": " + std::to_string(mesh.positions.size()) + " vertices and " +
                    std::to_string(mesh.triangles.size()) +
                    " triangles; at most 2^28 of each are supported",
                id);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    if (!(mesh.positions[v].cwiseAbs().array() <= 0x1p1000).all())
      throw Error(ErrorCode::NonFinitePosition,
                  nameOf(id) + ", vertex " + std::to_string(v) + " is " +
                      textOf(mesh.positions[v]) + "; it must be finite and at most 2^1000",
                  id, v);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const std::uint32_t vertex : mesh.triangles[t])
      if (vertex >= mesh.positions.size())
        throw Error(ErrorCode::IndexOutOfRange,
                    nameOf(id) + ", triangle " + std::to_string(t) + ": vertex index " +
                        std::to_string(vertex) + " is out of range; the mesh has " +
                        std::to_string(mesh.positions.size()) + " vertices",
                    id, t);
}

void checkPoint(const Eigen::Vector3d& point, const char* name) {
  if (!point.allFinite())
    throw Error(ErrorCode::NonFinitePosition, std::string(name) + " is " + textOf(point));
}

}  // namespace

DistanceField::DistanceField(std::shared_ptr<const Implementation> implementation)
    : m_implementation(std::move(implementation)) {}

const DistanceField::Implementation& DistanceField::valid() const {
  if (!m_implementation)
    throw Error(ErrorCode::InvalidCall, "this DistanceField object was moved from");
  return *m_implementation;
}

DistanceField DistanceField::build(const TriangleMeshView& mesh,
                                   const DistanceFieldSettings& settings) {
  const StandardFloatingPoint standard;
  checkSettings(settings);
  SearchableGeometry body(GeometryId{0});
  checkMesh(mesh, body.id);
  body.mesh.now = Positions(std::vector(mesh.positions.begin(), mesh.positions.end()));
  body.mesh.before = body.mesh.now;
  body.mesh.topology.vertexCount = mesh.positions.size();
  body.mesh.topology.triangles.assign(mesh.triangles.begin(), mesh.triangles.end());
  checkInside(body, InsideRule::Closed);
  if (mesh.triangles.empty())
    throw Error(ErrorCode::NotClosed, nameOf(body.id) + " has no triangles", body.id);
  const Threads threads(settings.threads);
  body.revisions.topology = body.revisions.counter.next();
  const double spread = body.tree.sampleFrame(body.mesh, body.revisions.topology);
  body.tree.update(body.mesh, body.revisions.topology, frameScale(spread), {}, threads);
  return DistanceField(std::make_shared<const Implementation>(buildField(body, settings, threads)));
}

double DistanceField::errorBound() const { return valid().cells.errorBound; }
double DistanceField::band() const { return valid().cells.band; }
std::size_t DistanceField::cells() const { return valid().cells.leaves.size(); }
std::size_t DistanceField::bytes() const { return sizeof(Implementation) + valid().cells.bytes(); }

double DistanceField::value(const Eigen::Vector3d& point) const {
  const Implementation& field = valid();
  const StandardFloatingPoint standard;
  checkPoint(point, "the point");
  return StandardFloatingPoint::evaluated(field.lookup.value(point));
}

Eigen::Vector3d DistanceField::gradient(const Eigen::Vector3d& point) const {
  const Implementation& field = valid();
  const StandardFloatingPoint standard;
  checkPoint(point, "the point");
  return field.lookup.gradient(point);
}

void DistanceField::values(std::span<const Eigen::Vector3d> points, std::span<double> out) const {
  const Implementation& field = valid();
  const StandardFloatingPoint standard;
  if (points.size() != out.size())
    throw Error(ErrorCode::InvalidSettings, std::to_string(points.size()) +
                                                " points, but room for " +
                                                std::to_string(out.size()) + " answers");
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!points[i].allFinite()) checkPoint(points[i], ("point " + std::to_string(i)).c_str());
  field.lookup.values(points, out.data());
}

void DistanceField::save(const std::filesystem::path& path) const {
  const Implementation& field = valid();
  const StandardFloatingPoint standard;
  writeField(field.cells, path);
}

DistanceField DistanceField::load(const std::filesystem::path& path) {
  const StandardFloatingPoint standard;
  return DistanceField(std::make_shared<const Implementation>(readField(path)));
}

}  // namespace palpate
