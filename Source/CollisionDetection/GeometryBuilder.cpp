#include "CollisionDetection/GeometryBuilder.h"

#include "Bodies/InputChecks.h"
#include "Math/StableLength.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <utility>

namespace palpate {

void SmallestHeight::add(double height) {
  if (height < value) {
    value = height;
    count = 0;
  }
  count += height == value;
}

void SmallestHeight::remove(double height) {
  PALPATE_ASSERT(height >= value && (height > value || count > 0));
  count -= height == value;
}

double heightOf(const Triangle& triangle, std::span<const Eigen::Vector3d> rest) {
  const auto& [i, j, k] = triangle;
  const Eigen::Vector3d &a = rest[i], &b = rest[j], &c = rest[k];
  const double area = (b - a).cross(c - a).norm();
  const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
  return area > 0.0 ? area / longest : std::numeric_limits<double>::infinity();
}

SmallestHeight smallestHeight(const MeshTopology& topology,
                              std::span<const Eigen::Vector3d> rest) noexcept {
  SmallestHeight smallest;
  topology.forEachElement(
      [&](std::uint32_t t) { smallest.add(heightOf(topology.elements[t], rest)); });
  return smallest;
}

static double shortEdgeOf(const MeshTopology& topology, std::span<const Eigen::Vector3d> rest) {
  CountedVector<double> lengths;
  lengths.reserve(topology.edges.size());
  for (const auto& [i, j] : topology.edges) lengths.push_back(stableLength(rest[j] - rest[i]));
  if (lengths.empty()) return 0.0;
  const auto place = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 16);
  std::nth_element(lengths.begin(), place, lengths.end());
  return *place;
}

RestShape::RestShape(CountedVector<Eigen::Vector3d> newRest, MeshTopology newTopology,
                     std::unique_ptr<Solid> newSolid)
    : rest(std::move(newRest)),
      topology(std::move(newTopology)),
      solid(std::move(newSolid)),
      positions(std::make_shared<const CountedVector<Eigen::Vector3d>>(rest)),
      smallestHeight(palpate::smallestHeight(topology, rest)),
      shortEdge(shortEdgeOf(topology, rest)) {}

RestShape RestShape::ofTetrahedra(const GeometryLabel& geometry,
                                  std::span<const Eigen::Vector3d> positions,
                                  std::span<const Tetrahedron> tetrahedra) {
  CountedVector<Eigen::Vector3d> rest = checkedRest(geometry, positions);
  auto solid = std::make_unique<Solid>();
  solid->topology = checkedTopology(geometry, rest, tetrahedra);
  MeshTopology topology(positions.size(), solid->topology.surface);
  return {std::move(rest), std::move(topology), std::move(solid)};
}

using Built = GeometryBuilder::Built;

Built GeometryBuilder::build(RestShape shape) const {
  auto geometry = std::make_unique<Geometry>(m_id, m_revisions);
  geometry->setElements(shape);
  return geometry;
}

Built GeometryBuilder::triangles(std::span<const Eigen::Vector3d> positions,
                                 std::span<const Triangle> triangles, GeometryType type,
                                 std::span<const double> radii) const {
  checkCounts(m_id, positions.size(), triangles, type);
  checkRadii(m_id, radii);
  MeshTopology topology(positions.size(), triangles);
  topology.type = type;
  auto geometry = build({checkedRest(m_id, positions), std::move(topology)});
  TriangleMesh& mesh = geometry->body.mesh;
  if (!radii.empty()) mesh.largestRadius = *std::max_element(radii.begin(), radii.end());
  if (radii.size() > 1) mesh.radii.assign(radii.begin(), radii.end());
  return geometry;
}

Built GeometryBuilder::lines(std::span<const Eigen::Vector3d> positions,
                             std::span<const Segment> segments,
                             std::span<const double> radii) const {
  CountedVector<Triangle> degenerate;
  degenerate.reserve(segments.size());
  for (const auto& [p, q] : segments) degenerate.push_back({p, q, q});
  return triangles(positions, degenerate, GeometryType::Lines, radii);
}

Built GeometryBuilder::points(std::span<const Eigen::Vector3d> positions,
                              std::span<const double> radii) const {
  CountedVector<Triangle> degenerate(positions.size());
  for (std::uint32_t i = 0; i < degenerate.size(); ++i) degenerate[i] = {i, i, i};
  return triangles(positions, degenerate, GeometryType::Points, radii);
}

Built GeometryBuilder::tetrahedra(std::span<const Eigen::Vector3d> positions,
                                  std::span<const Tetrahedron> tetrahedra) const {
  return build(RestShape::ofTetrahedra(m_id, positions, tetrahedra));
}

Built GeometryBuilder::shape(const AnalyticalGeometry& analytical) const {
  std::optional<std::size_t> element;
  if (const std::string fault = faultOf(analytical, element); !fault.empty())
    throw Error(ErrorCode::InvalidShape, nameOf(m_id) + ": " + fault, m_id, element);
  const PlacedShape shape(analytical);
  MeshTopology topology;
  topology.type = GeometryType::Shape;
  auto geometry =
      build({{shape.now.corners().begin(), shape.now.corners().end()}, std::move(topology)});
  geometry->body.mesh.rest.clear();
  geometry->body.shape = shape;
  geometry->step.startShape(shape.now);
  return geometry;
}

Built GeometryBuilder::field(std::shared_ptr<const DistanceField> field) const {
  if (!field) throw Error(ErrorCode::InvalidSettings, nameOf(m_id) + ": the field is null", m_id);
  static_cast<void>(field->isClosed());  // throws if it was moved from
  MeshTopology topology;
  topology.type = GeometryType::Field;
  auto geometry = build({{}, std::move(topology)});
  geometry->body.field = std::move(field);
  return geometry;
}

Built GeometryBuilder::problem(const CollisionProblem::Geometry& given) const {
  const std::vector<Eigen::Vector3d>& positions = given.rest.empty() ? given.now : given.rest;
  if (given.type == GeometryType::Field) return field(given.field);
  if (given.analytical) return shape(*given.analytical);
  if (given.radii.size() > 1) checkOnePerVertex(m_id, positions, given.radii);
  if (given.type == GeometryType::Points) return points(positions, given.radii);
  if (given.type == GeometryType::Lines) {
    std::vector<Segment> segments;
    for (const auto& [p, q, _] : given.triangles) segments.push_back({p, q});
    return lines(positions, segments, given.radii);
  }
  if (!given.removed.empty() || !given.removedTetrahedra.empty())
    return afterCuts(given, positions);
  return given.tetrahedra.empty() ? triangles(positions, given.triangles)
                                  : tetrahedra(positions, given.tetrahedra);
}

Built GeometryBuilder::afterCuts(const CollisionProblem::Geometry& given,
                                 std::span<const Eigen::Vector3d> positions) const {
  CountedVector<Eigen::Vector3d> rest = checkedRest(m_id, positions);
  checkCounts(m_id, positions.size(), given.triangles, GeometryType::Triangles);
  const auto removed = checkedRemoval(m_id, "triangle", given.triangles.size(), {}, given.removed);
  MeshTopology topology(positions.size(), given.triangles, removed);
  std::unique_ptr<Solid> solid;
  if (!given.tetrahedra.empty()) {
    solid = std::make_unique<Solid>();
    solid->topology = checkedTopology(
        m_id, rest, given.tetrahedra,
        checkedRemoval(m_id, "tetrahedron", given.tetrahedra.size(), {}, given.removedTetrahedra));
    if (keepSurfaceIds(topology.elements, solid->topology) != topology.removed ||
        solid->topology.surface != topology.elements)
      throw Error(ErrorCode::InvalidSettings,
                  nameOf(m_id) + ": the triangles are not the surface of the tetrahedra", m_id);
  }
  return build({std::move(rest), std::move(topology), std::move(solid)});
}

}  // namespace palpate
