#include <palpate/PenetrationTracker.h>

#include <palpate/Error.h>

#include "Queries/QuerySource.h"
#include "Mesh/Corners.h"
#include "Math/Tolerances.h"
#include "Exact/Predicates.h"
#include "Core/FloatingPoint.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace palpate {

namespace {

Eigen::Vector3d pointAt(const Corners& corners, const Eigen::Vector3d& weights) {
  return weights[0] * corners[0] + weights[1] * corners[1] + weights[2] * corners[2];
}

/// An edge's direction, the normal, and the direction perpendicular to both. Nothing for a triangle
/// without area.
std::optional<Eigen::Matrix3d> axesOf(const Corners& t) {
  Eigen::Matrix3d axes;
  const Eigen::Vector3d edge = t[1] - t[0], normal = edge.cross(t[2] - t[0]);
  axes.col(0) = edge.stableNormalized();
  axes.col(1) = normal.stableNormalized();
  axes.col(2) = axes.col(0).cross(axes.col(1));
  if (!(std::abs(axes.determinant() - 1.0) < kAxesError)) return {};
  return axes;
}

/// The rotation of a triangle between two states; the identity where a triangle has no area.
Eigen::Matrix3d rotationOf(const Corners& before, const Corners& now) {
  if (before == now) return Eigen::Matrix3d::Identity();
  const auto from = axesOf(before), to = axesOf(now);
  if (!from || !to) return Eigen::Matrix3d::Identity();
  return *to * from->transpose();
}

/// The weights of the corners at the point where the segment from p to q crosses a triangle.
/// Nothing if it does not cross the triangle, or lies in its plane; this decision is exact.
std::optional<Eigen::Vector3d> crossing(const Eigen::Vector3d& p, const Eigen::Vector3d& q,
                                        const Corners& t, SignCounts& counts) {
  if (orient3d(t[0], t[1], t[2], p, counts) == orient3d(t[0], t[1], t[2], q, counts)) return {};
  Eigen::Vector3d weights = Eigen::Vector3d::Zero();
  int side = 0;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d &from = t[(i + 1) % 3], &to = t[(i + 2) % 3];
    const int sign = orient3d(p, q, from, to, counts);
    if (sign == 0) continue;
    if (sign == -side) return {};
    side = sign;
    weights[i] = std::abs((q - p).dot((from - p).cross(to - p)));
  }
  const double sum = weights.sum();
  if (!(sum > 0)) return {};
  return weights / sum;
}

}  // namespace

struct PenetrationTracker::Implementation {
  /// A vertex and its surface point at the end of a step.
  struct VertexState {
    std::uint32_t vertex, triangle;
    Eigen::Vector3d weights, direction;
    double depth;
    Eigen::Vector3d position;  ///< of the vertex
    Corners triangleAt;
  };
  class Search;

  GeometryId vertices, body;
  std::uint64_t sourceId = 0;  ///< SpatialQueries::Source::id()
  /// Of the vertices' geometry and of the body.
  struct Topologies {
    Revision vertices, body;
    friend bool operator==(const Topologies&, const Topologies&) = default;
  };
  DerivedFrom<Topologies> lastTopology, nowTopology;
  std::uint64_t step = 0;              ///< in which `now` was computed
  std::vector<VertexState> last, now;  ///< ascending vertices
  std::vector<InsideVertex> inside;
  std::vector<TrackedVertex> found;
  std::vector<PointQueryStack> stacks;
};

/// Finds surface points along directions, and chooses the penetration direction of a vertex.
class PenetrationTracker::Implementation::Search {
 public:
  Search(const Body& body, Engine engine, PointQueryStack& stack)
      : m_body(body), m_bruteForce(engine == Engine::BruteForce), m_stack(stack), m_frame(body) {}

  /// The first point of the surface from p along a unit direction, at most the distance `most`
  /// away. If it is on several triangles, names the lowest.
  std::optional<InsideVertex> firstHitAlong(std::uint32_t vertex, const Eigen::Vector3d& p,
                                            const Eigen::Vector3d& direction, double most) {
    const Eigen::Vector3d q = p + most * direction;
    std::optional<InsideVertex> first;
    if (!q.allFinite()) return first;
    SignCounts counts;
    const auto testOne = [&](std::uint32_t i) {
      const std::uint32_t id = m_body.tree.octree().order()[i];
      const Triangle& triangle = m_body.tree.ordered()[i];
      const Corners corners = cornersOf(triangle, m_body.mesh.now);
      const auto weights = crossing(p, q, corners, counts);
      if (!weights) return;
      const double depth = (pointAt(corners, *weights) - p).dot(direction);
      if (!(depth > 0) ||
          (first && (depth > first->depth || (depth == first->depth && id > first->triangle))))
        return;
      first = {vertex, id, triangle, *weights, direction, depth};
    };
    if (m_bruteForce) {
      for (std::uint32_t i = 0; i < m_body.tree.ordered().size(); ++i) testOne(i);
      return first;
    }
    FloatBox segmentBox = m_frame.boxOf(p);
    segmentBox.add(m_frame.boxOf(q));
    findOverlapping(m_body.tree.octree(), m_frame.map(), segmentBox, m_stack);
    for (const std::uint32_t i : m_stack.found) testOne(i);
    return first;
  }

  TrackedVertex operator()(const InsideVertex& nearest, const Eigen::Vector3d& p,
                           const VertexState* earlier) {
    if (!earlier) return {nearest, nearest, DirectionChange::Entered};
    const Corners corners =
        cornersOf(m_body.mesh.topology.elements[earlier->triangle], m_body.mesh.now);
    const Eigen::Matrix3d rotation = rotationOf(earlier->triangleAt, corners);
    const Eigen::Vector3d direction = (rotation * earlier->direction).normalized();
    const Eigen::Vector3d moved =
        (p - pointAt(corners, earlier->weights)) -
        rotation * (earlier->position - pointAt(earlier->triangleAt, earlier->weights));
    const double turnByMotion = moved.norm() / std::sqrt(earlier->depth) / std::sqrt(nearest.depth);
    if ((nearest.direction - direction).norm() <= TrackedVertex::kMaxTurn + turnByMotion)
      return {nearest, nearest, DirectionChange::None};
    if (const auto kept = firstHitAlong(nearest.vertex, p, direction,
                                        TrackedVertex::kMaxDepthRatio * nearest.depth))
      return {*kept, nearest, DirectionChange::Kept};
    return {nearest, nearest, DirectionChange::Jumped};
  }

 private:
  const Body& m_body;
  bool m_bruteForce;
  PointQueryStack& m_stack;
  PointFrame m_frame;
};

PenetrationTracker::PenetrationTracker(GeometryId vertices, GeometryId body)
    : m_implementation(std::make_unique<Implementation>()) {
  m_implementation->vertices = vertices;
  m_implementation->body = body;
}
PenetrationTracker::PenetrationTracker(PenetrationTracker&&) noexcept = default;
PenetrationTracker& PenetrationTracker::operator=(PenetrationTracker&&) noexcept = default;
PenetrationTracker::~PenetrationTracker() = default;

std::span<const TrackedVertex> PenetrationTracker::update(const SpatialQueries& queries) {
  constexpr std::size_t kGrain = 256;
  if (!m_implementation)
    throw Error(ErrorCode::InvalidCall, "this PenetrationTracker was moved from");
  Implementation& all = *m_implementation;
  queries.findInsideVertices(all.vertices, all.body, all.inside);
  SpatialQueries::Source& source = SpatialQueries::Source::of(queries);
  const StandardFloatingPoint standard;
  const Body &vertices = source.at(all.vertices), &body = source.at(all.body);
  const std::size_t size = all.inside.size(), parts = (size + kGrain - 1) / kGrain;
  const bool isSameSource = all.sourceId == source.id();
  const bool isNewStep = !isSameSource || all.step != source.step();
  // If a call below throws, only the entries of this step are lost. Those of the step before stay
  // in `last`, and the next update() of this step uses them.
  if (isNewStep && isSameSource && all.nowTopology.isValid()) {
    std::swap(all.last, all.now);
    all.lastTopology = all.nowTopology;
  }
  if (!isSameSource) all.lastTopology.invalidate();
  all.nowTopology.invalidate();
  all.sourceId = source.id();
  all.step = source.step();
  all.found.resize(size);
  all.now.resize(size);
  if (all.stacks.size() < parts) all.stacks.resize(parts);
  const Implementation::Topologies topologies{vertices.revisions.elements.topology,
                                              body.revisions.elements.topology};
  using VertexState = Implementation::VertexState;
  const std::span<const VertexState> previous = all.lastTopology.isCurrent(topologies)
                                                    ? std::span<const VertexState>(all.last)
                                                    : std::span<const VertexState>();
  const SpatialQueries::Source::Workers workers(source);
  const Threads& threads = workers;
  threads.forChunks(size, kGrain, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    Implementation::Search search(body, source.engine(), all.stacks[chunk]);
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t vertex = all.inside[i].vertex;
      const auto last = std::lower_bound(
          previous.begin(), previous.end(), vertex,
          [](const VertexState& state, std::uint32_t v) { return state.vertex < v; });
      const bool known = last != previous.end() && last->vertex == vertex;
      const Eigen::Vector3d p = vertices.mesh.now[vertex];
      all.found[i] = search(all.inside[i], p, known ? &*last : nullptr);
      const InsideVertex& at = all.found[i].penetration;
      all.now[i] = {vertex,
                    at.triangle,
                    at.weights,
                    at.direction,
                    at.depth,
                    p,
                    cornersOf(at.vertices, body.mesh.now)};
    }
  });
  all.nowTopology.commit(topologies);
  return all.found;
}

}  // namespace palpate
