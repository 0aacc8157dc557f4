#include "Simplify/SimplifyRounds.h"

#include <palpate/Error.h>
#include <palpate/Meshes.h>

#include "Simplify/Shells.h"
#include "Simplify/SimplifyCertificate.h"
#include "Simplify/SimplifyOffset.h"
#include "Queries/ClosedBody.h"
#include "Queries/PointDistances.h"
#include "Octree/Traversal.h"
#include "Mesh/Corners.h"
#include "Core/Assert.h"
#include "Core/Text.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// In kVerbatimRound, the whole mesh gets level kVerbatim.
constexpr int kMostRounds = 24, kVerbatimRound = 14;
/// From this level on, the mesh keeps its triangles. Finer levels only move them less.
constexpr std::uint8_t kVerbatim = 2, kFinest = 9;
/// Of maxDistance: the error at level 0, which each level divides by four.
constexpr double kFirstError = 0.25;
/// Of the error: the least offset.
constexpr double kOffsetShare = 1.0 / 16.0;
/// Of maxDistance: the longest way of a vertex.
constexpr double kLongestWay = 0.95;
/// If a greater share of a level fails, all of it gets the next level. Levels do not meet without
/// many small triangles.
constexpr double kMostFailures = 0.1;
/// If the parts of finer levels make the result so much larger, all of it is simplified anew with
/// half of the error.
constexpr std::size_t kMostGrowth = 3;
constexpr int kMostRestarts = 2;
/// How often triangles that touch the mesh are moved further.
constexpr int kMostLifts = 4;
constexpr std::size_t kSlice = 4096, kGrain = 64;
constexpr std::uint32_t kNone = 0xffffffff;

using Marks = std::vector<std::uint8_t>;
using Levels = std::vector<std::uint8_t>;  ///< of triangles

/// The mesh, and what is computed from it once.
struct Source {
  const Body& body;
  double maxDistance;  ///< L
  SimplifyCertificate certificate;
  Shells shells;

  std::span<const Triangle> triangles() const { return body.mesh.topology.elements; }
  std::span<const Vector3d> positions() const { return body.mesh.now.body(); }
};

/// The mesh after edges collapsed. Vertices are numbered anew, ascending by those of the mesh.
struct Collapsed {
  std::vector<Triangle> triangles;
  Levels levels;
  std::vector<double> errors;          ///< L, per triangle: for CollapseEdges
  std::vector<std::int8_t> sides;      ///< per triangle, as for outwardWays()
  std::vector<std::uint32_t> origins;  ///< per vertex: that of the mesh
  std::vector<Vector3d> positions;
};

/// How far the mesh is outside a collapsed one.
struct Protrusions {
  std::vector<double> heights;        ///< L, per triangle of the latter
  std::vector<std::uint32_t> owners;  ///< per vertex of the mesh: the triangle nearest to it
};

/// Where the vertices of a collapsed mesh move.
struct MovedOutward {
  std::vector<OutwardWay> ways;
  std::vector<double> offsets;  ///< L
  std::vector<Vector3d> positions;
};

/// The failure of a round.
struct Failure {
  Vector3d place = Vector3d::Zero();     ///< L
  std::optional<std::uint32_t> stuck{};  ///< a vertex of the mesh without a way
  bool isFinal = false;                  ///< there is no finer level
};

/// Loops that report the progress.
class Loops {
 public:
  Loops(const SimplifySettings& settings, const Threads& threads)
      : m_settings(settings), m_threads(threads) {}

  void startRound(int round) {
    m_round = round;
    report(0.0);
  }
  /// share: of the current loop. An estimate: each round takes half of what is left.
  void report(double share) {
    const double fraction = 1.0 - std::ldexp(1.0 - 0.5 * share, 1 - m_round);
    PALPATE_ASSERT(fraction >= 0.0 && fraction <= 1.0);
    m_reported = std::max(m_reported, fraction);
    if (m_settings.progress && !m_settings.progress(m_reported))
      throw Error(ErrorCode::Cancelled, "the simplification was cancelled");
  }
  /// Calls f(index, stack) for [0, size), on all threads.
  template <class F>
  void forEach(std::size_t size, F&& f) {
    for (std::size_t first = 0; first < size; first += kSlice) {
      report(static_cast<double>(first) / static_cast<double>(size));
      m_threads.forChunks(std::min(kSlice, size - first), kGrain,
                          [&](std::size_t, std::size_t begin, std::size_t end) {
                            PointQueryStack stack;
                            for (std::size_t i = begin; i < end; ++i) f(first + i, stack);
                          });
    }
  }
  const Threads& threads() const { return m_threads; }

 private:
  const SimplifySettings& m_settings;
  const Threads& m_threads;
  int m_round = 1;
  double m_reported = 0.0;
};

/// Appends the collapsed triangles of a level. Vertices are those of the mesh.
void collapseLevel(const Source& source, CollapseEdges collapseEdges, const Levels& levels,
                   std::uint8_t level, double error, Collapsed& result) {
  std::vector<Triangle> triangles;
  for (std::size_t t = 0; t < levels.size(); ++t)
    if (levels[t] == level && source.shells.sideOf(source.triangles()[t]) != 0)
      triangles.push_back(source.triangles()[t]);
  if (level < kVerbatim) {
    [[maybe_unused]] const std::size_t most = triangles.size();
    triangles = collapseEdges(source.positions(), triangles, error);
    PALPATE_ASSERT(triangles.size() <= most);
  }
  for (const Triangle& triangle : triangles) {
    result.triangles.push_back(triangle);
    result.sides.push_back(source.shells.sideOf(triangle));
    PALPATE_ASSERT(result.sides.back() != 0);
  }
  result.levels.resize(result.triangles.size(), level);
  result.errors.resize(result.triangles.size(), error);
}

/// levels: of the mesh. Each restart halves the errors.
Collapsed collapse(const Source& source, CollapseEdges collapseEdges, const Levels& levels,
                   int restarts) {
  Collapsed result;
  for (std::uint8_t level = 0; level <= kFinest; ++level)
    collapseLevel(source, collapseEdges, levels, level,
                  std::ldexp(kFirstError * source.maxDistance, -2 * level - restarts), result);
  std::vector<std::uint32_t> numbers(source.positions().size(), kNone);
  for (const Triangle& triangle : result.triangles)
    for (const std::uint32_t v : triangle) numbers[v] = 0;
  for (std::uint32_t v = 0; v < numbers.size(); ++v) {
    if (numbers[v] == kNone) continue;
    numbers[v] = static_cast<std::uint32_t>(result.origins.size());
    result.origins.push_back(v);
    result.positions.push_back(source.positions()[v]);
  }
  // Collapses may leave folds. A folded triangle has to move with the others, against its normal.
  for (std::size_t t = 0; t < result.triangles.size(); ++t) {
    Vector3d normal = Vector3d::Zero();
    for (std::uint32_t& v : result.triangles[t]) {
      normal += source.shells.normals[v];
      v = numbers[v];
    }
    if (result.levels[t] < kVerbatim &&
        normal.dot(unitNormal(result.positions, result.triangles[t])) < 0.0)
      result.sides[t] = static_cast<std::int8_t>(-result.sides[t]);
  }
  return result;
}

/// Marks the triangles around edges because of which the result would not be closed.
Marks trianglesAtOpenEdges(std::span<const Triangle> triangles) {
  Marks marks(triangles.size(), 0);
  const MeshDefects defects = findMeshDefects(triangles);
  if (defects.closed()) return marks;
  std::vector<Segment> edges;
  for (const auto* list : {&defects.open, &defects.flipped, &defects.shared})
    edges.insert(edges.end(), list->begin(), list->end());
  std::sort(edges.begin(), edges.end());
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [p, q] = std::minmax(triangles[t][i], triangles[t][(i + 1) % 3]);
      marks[t] |= std::binary_search(edges.begin(), edges.end(), Segment{p, q});
    }
  return marks;
}

/// Finds how far the mesh's vertices are outside the collapsed surface, at the triangles nearest to
/// them.
Protrusions findProtrusions(const Source& source, const Collapsed& collapsed, Loops& loops) {
  const auto positions = source.positions();
  Protrusions found{std::vector<double>(collapsed.triangles.size(), 0.0),
                    std::vector<std::uint32_t>(positions.size(), kNone)};
  if (collapsed.triangles.empty()) return found;
  Body surface(GeometryId{1});
  makeBody(collapsed.positions, collapsed.triangles, loops.threads(), surface);
  std::vector<double> outside(positions.size(), 0.0);
  Marks isDone(positions.size(), 0);
  for (const std::uint32_t v : collapsed.origins) isDone[v] = 1;
  std::vector<std::uint32_t> order;  // along the octree of the mesh: neighbours are near
  order.reserve(positions.size());
  for (const Triangle& triangle : source.body.tree.ordered().first(source.triangles().size()))
    for (const std::uint32_t v : triangle)
      if (source.shells.sideOf(triangle) != 0 && !std::exchange(isDone[v], std::uint8_t{1}))
        order.push_back(v);
  std::vector<std::uint32_t> likely(order.size() / kGrain + 1, 0);
  loops.forEach(order.size(), [&](std::size_t i, PointQueryStack&) {
    const std::uint32_t v = order[i];
    std::uint32_t& last = likely[i / kGrain];
    const auto near = PointDistances(surface, positions[v], false).nearest(kInfinity, last);
    last = near->place;
    const std::uint32_t owner = found.owners[v] = near->element;
    const Vector3d normal =
        collapsed.sides[owner] * unitNormal(collapsed.positions, collapsed.triangles[owner]);
    if (near->closest.difference.dot(normal) > 0.0) outside[v] = near->distance;
  });
  for (const std::uint32_t v : order) {
    double& height = found.heights[found.owners[v]];
    height = std::max(height, outside[v]);
  }
  return found;
}

/// Moves a vertex by its offset.
void moveVertex(const Source& source, const Collapsed& collapsed, std::uint32_t vertex,
                MovedOutward& moved) {
  const OutwardWay& way = moved.ways[vertex];
  const double length =
      std::min(moved.offsets[vertex] * way.lengthPerOffset, kLongestWay * source.maxDistance);
  PALPATE_ASSERT(length >= 0.0);
  moved.positions[vertex] = collapsed.positions[vertex] + length * way.direction;
}

MovedOutward moveOutward(const Source& source, const Collapsed& collapsed,
                         std::span<const double> heights) {
  MovedOutward moved{outwardWays(collapsed.positions, collapsed.triangles, collapsed.sides),
                     std::vector<double>(collapsed.positions.size(), 0.0), collapsed.positions};
  for (std::size_t t = 0; t < collapsed.triangles.size(); ++t)
    for (const std::uint32_t v : collapsed.triangles[t])
      moved.offsets[v] =
          std::max(moved.offsets[v], heights[t] + kOffsetShare * collapsed.errors[t]);
  for (std::uint32_t v = 0; v < moved.offsets.size(); ++v) moveVertex(source, collapsed, v, moved);
  return moved;
}

/// L: how far a triangle that touches the mesh has to move; 0 if it has met another side of it.
/// touched: places of the mesh's triangles, in the octree's order. error: L, that of the triangle.
double liftOf(const Source& source, const Corners& corners, const Vector3d& normal,
              std::span<const std::uint32_t> touched, double error) {
  double height = 0.0, lift = 0.0;
  for (const std::uint32_t place : touched) {
    const Triangle& triangle = source.body.tree.ordered()[place];
    const std::int8_t side = source.shells.sideOf(triangle);
    if (!(side * normal.dot(unitNormal(source.positions(), triangle)) > 0.0)) continue;
    for (const std::uint32_t v : triangle)
      height = std::max(height, normal.dot(source.positions()[v] - corners[0]));
    lift = std::min(height, error) + kOffsetShare * error;
  }
  return lift;
}

/// Moves triangles further that touch the mesh. Returns marks of those that still do.
Marks liftTouching(const Source& source, const Collapsed& collapsed, Loops& loops,
                   MovedOutward& moved) {
  const std::size_t size = collapsed.triangles.size();
  std::vector<double> lifts(size, 0.0);
  Marks isTouching(size, 0), isOld(size, 0);
  for (int lift = 0;; ++lift) {
    loops.forEach(size, [&](std::size_t t, PointQueryStack& stack) {
      if (isOld[t]) return;
      const Triangle& triangle = collapsed.triangles[t];
      const Corners corners = cornersOf(triangle, moved.positions);
      std::vector<std::uint32_t> touched;
      source.certificate.findTouched(corners, stack, touched);
      isTouching[t] = !touched.empty();
      lifts[t] = liftOf(source, corners, collapsed.sides[t] * unitNormal(moved.positions, triangle),
                        touched, collapsed.errors[t]);
    });
    if (lift == kMostLifts) return isTouching;
    std::vector<double> ofVertex(moved.offsets.size(), 0.0);
    for (std::size_t t = 0; t < size; ++t)
      for (const std::uint32_t v : collapsed.triangles[t])
        ofVertex[v] = std::max(ofVertex[v], lifts[t]);
    bool isAny = false;
    for (std::uint32_t v = 0; v < ofVertex.size(); ++v) {
      if (!(ofVertex[v] > 0.0)) continue;
      moved.offsets[v] += ofVertex[v];
      moveVertex(source, collapsed, v, moved);
      isAny = true;
    }
    if (!isAny) return isTouching;
    for (std::size_t t = 0; t < size; ++t)
      isOld[t] = std::none_of(collapsed.triangles[t].begin(), collapsed.triangles[t].end(),
                              [&](std::uint32_t v) { return ofVertex[v] > 0.0; });
  }
}

/// L, per triangle: its distance from the mesh; infinite if it has failed or there is no proof.
std::vector<double> distanceBounds(const Source& source, std::span<const Triangle> triangles,
                                   const MovedOutward& moved, const Marks& failed, Loops& loops) {
  std::vector<double> bounds(triangles.size(), kInfinity);
  loops.forEach(triangles.size(), [&](std::size_t t, PointQueryStack& stack) {
    if (failed[t]) return;
    const Corners corners = cornersOf(triangles[t], moved.positions);
    bounds[t] = source.certificate.distanceBound(corners, stack).value_or(kInfinity);
  });
  return bounds;
}

bool hasFailed(double bound) { return bound == kInfinity; }

/// Marks components of the mesh that are not in the result, per lowest vertex. Each component of
/// the mesh must be inside the result, and each one of the result outside the mesh. Where no
/// triangles meet, one vertex of each decides.
Marks failedComponents(const Source& source, const Collapsed& collapsed, const MovedOutward& moved,
                       std::span<const double> bounds, const Threads& threads) {
  const std::vector<std::uint32_t>& componentOf = source.shells.componentOf;
  Marks failed(componentOf.size(), 0);
  // A component that is as small as the error may collapse to nothing.
  for (const std::uint32_t component : componentOf)
    failed[component] = source.shells.sides[component] != 0;
  for (const std::uint32_t v : collapsed.origins) failed[componentOf[v]] = 0;
  if (bounds.empty() || std::any_of(bounds.begin(), bounds.end(), hasFailed)) return failed;
  const std::vector<std::uint32_t> components =
      componentsOf(moved.positions.size(), collapsed.triangles);
  PointQueryStack stack;
  for (std::uint32_t v = 0; v < components.size(); ++v)
    if (components[v] == v && source.certificate.isInside(moved.positions[v], stack))
      failed[componentOf[collapsed.origins[v]]] = 1;
  Body surface(GeometryId{1});
  makeBody(moved.positions, collapsed.triangles, threads, surface);
  const SimplifyCertificate inside(surface, source.maxDistance, 0.0);
  Marks isChecked(componentOf.size(), 0);
  for (const Triangle& triangle : source.triangles()) {
    const std::uint32_t component = componentOf[triangle[0]];
    if (std::exchange(isChecked[component], std::uint8_t{1})) continue;
    if (!inside.isInside(source.positions()[component], stack)) failed[component] = 1;
  }
  return failed;
}

/// Gives the triangles of the mesh near failed ones of the result, and those of failed components,
/// the next level. Returns the last failure, or the first at the finest level.
std::optional<Failure> refineFailed(const Source& source, const Collapsed& collapsed,
                                    const MovedOutward& moved,
                                    std::span<const std::uint32_t> owners,
                                    std::span<const double> bounds, const Marks& failedComponents,
                                    Levels& levels) {
  std::optional<Failure> failure;
  Marks next(owners.size(), 0);  // per vertex of the mesh: least level
  const auto after = [&](std::size_t t) {
    return static_cast<std::uint8_t>(collapsed.levels[t] + 1);
  };
  std::array<std::size_t, kFinest + 1> ofLevel{}, failedOfLevel{};
  for (std::size_t t = 0; t < collapsed.triangles.size(); ++t) {
    const std::uint8_t level = collapsed.levels[t];
    ++ofLevel[level];
    if (!hasFailed(bounds[t])) continue;
    ++failedOfLevel[level];
    failure = {collapsed.positions[collapsed.triangles[t][0]], {}, level == kFinest};
    for (const std::uint32_t v : collapsed.triangles[t]) {
      const std::uint32_t origin = collapsed.origins[v];
      if (std::isinf(moved.ways[v].lengthPerOffset)) failure->stuck = origin;
      next[origin] = std::max(next[origin], after(t));
    }
    if (failure->isFinal) return failure;
  }
  for (std::size_t v = 0; v < next.size(); ++v)
    if (owners[v] != kNone && hasFailed(bounds[owners[v]])) next[v] = after(owners[v]);
  const auto hasMostlyFailed = [&](std::uint8_t level) {
    const double most = kMostFailures * static_cast<double>(ofLevel[level]);
    return static_cast<double>(failedOfLevel[level]) > most;
  };
  for (std::size_t t = 0; t < levels.size(); ++t) {
    const Triangle& triangle = source.triangles()[t];
    if (levels[t] < kVerbatim && hasMostlyFailed(levels[t])) ++levels[t];
    if (failedComponents[source.shells.componentOf[triangle[0]]]) {
      failure = {source.positions()[triangle[0]], {}, levels[t] == kFinest};
      if (failure->isFinal) return failure;
      ++levels[t];
    }
    for (const std::uint32_t v : triangle) levels[t] = std::max(levels[t], next[v]);
    PALPATE_ASSERT(levels[t] <= kFinest);
  }
  return failure;
}

/// The first two triangles of the mesh that have a common point and no common vertex.
std::optional<ElementPair> findCrossing(const Body& body) {
  std::optional<ElementPair> first;
  const auto corners = [&](std::uint32_t t) {
    return cornersOf(body.mesh.topology.elements[t], body.mesh.now.body());
  };
  auto test = [&](std::span<const ElementPair> pairs) {
    SignCounts counts;
    for (const ElementPair& pair : pairs)
      if ((!first || pair < *first) &&
          intersectTriangles(corners(pair.a), corners(pair.b), counts).intersect())
        first = pair;
  };
  const Octree& octree = body.tree.octree();
  const TreePair trees{&octree, &octree, body.tree.ordered().data()};
  TraversalStack starts, stack;
  PairSink sink;
  sink.start(
      [](void* context, std::span<const ElementPair> pairs) {
        (*static_cast<decltype(test)*>(context))(pairs);
      },
      &test);
  startPairs(trees, 1, starts);
  traverse(trees, starts.pairs, stack, sink);
  sink.flush();
  return first;
}

[[noreturn]] void giveUp(const Body& body, double maxDistance, const Failure& failure) {
  const std::string place = textOf(failure.place);
  if (const auto pair = findCrossing(body))
    throw Error(ErrorCode::UnsupportedMethod,
                nameOf(body) + " crosses or touches itself: triangles " + std::to_string(pair->a) +
                    " and " + std::to_string(pair->b) +
                    " have a common point, and there is no certified simplification near " + place,
                body.id, pair->a);
  throw Error(ErrorCode::NotAvailable,
              nameOf(body) + " has no certified simplification within maxDistance " +
                  textOf(maxDistance) + ": the proof fails near " + place +
                  (failure.stuck ? "; no displacement of vertex " + std::to_string(*failure.stuck) +
                                       " moves all of its triangles outward"
                                 : ""),
              body.id, failure.stuck);
}

}  // namespace

SimplifiedMesh simplifyInRounds(CollapseEdges collapseEdges, const Body& body,
                                const SimplifySettings& settings, double largest,
                                const Threads& threads) {
  PALPATE_ASSERT(body.tree.isValid() && !body.mesh.topology.elements.empty());
  Source source{body, settings.maxDistance, {body, settings.maxDistance, largest}, {}};
  source.shells = shellsOf(body, source.certificate);
  Loops loops(settings, threads);
  Levels levels(source.triangles().size(), 0);
  int restarts = 0;
  std::size_t firstCount = 0;  // of triangles, before any part had a finer level
  Failure last;
  for (int round = 1; round <= kMostRounds && !last.isFinal; ++round) {
    if (round == kVerbatimRound)
      for (std::uint8_t& level : levels) level = std::max(level, kVerbatim);
    loops.startRound(round);
    Collapsed collapsed = collapse(source, collapseEdges, levels, restarts);
    if (round == 1) firstCount = collapsed.triangles.size();
    if (restarts < kMostRestarts && collapsed.triangles.size() > kMostGrowth * firstCount) {
      std::fill(levels.begin(), levels.end(), std::uint8_t{0});
      loops.report(0.0);
      collapsed = collapse(source, collapseEdges, levels, ++restarts);
      firstCount = collapsed.triangles.size();
    }
    const Protrusions protrusions = findProtrusions(source, collapsed, loops);
    MovedOutward moved = moveOutward(source, collapsed, protrusions.heights);
    Marks failed = trianglesAtOpenEdges(collapsed.triangles);
    const Marks touching = liftTouching(source, collapsed, loops, moved);
    for (std::size_t t = 0; t < failed.size(); ++t) failed[t] |= touching[t];
    const std::vector<double> bounds =
        distanceBounds(source, collapsed.triangles, moved, failed, loops);
    const Marks components = failedComponents(source, collapsed, moved, bounds, threads);
    const auto failure =
        refineFailed(source, collapsed, moved, protrusions.owners, bounds, components, levels);
    if (!failure)
      return {std::move(moved.positions), std::move(collapsed.triangles),
              *std::max_element(bounds.begin(), bounds.end()), round};
    last = *failure;
  }
  giveUp(body, settings.maxDistance, last);
}

}  // namespace palpate
