#include "Simplify/Simplifier.h"

#include <palpate/ClosedMesh.h>
#include <palpate/Error.h>

#include "Queries/ClosedBody.h"
#include "Queries/PointDistances.h"
#include "Octree/Traversal.h"
#include "Core/Text.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
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
/// Of the longest side: how far from a triangle its sides are looked at.
constexpr double kSideStep = 1e-7;
constexpr std::size_t kSlice = 4096, kGrain = 64;
constexpr std::uint32_t kNone = 0xffffffff;

}  // namespace

Simplifier::Simplifier(CollapseEdges collapseEdges, const Body& body,
                       const SimplifySettings& settings, double largest, const Threads& threads)
    : m_collapse(collapseEdges),
      m_body(body),
      m_settings(settings),
      m_threads(threads),
      m_certificate(body, settings.maxDistance, largest),
      m_input(body.mesh.topology.triangles),
      m_components(componentsOf(body.mesh.now.size(), m_input)),
      m_levels(m_input.size(), 0) {}

SimplifiedMesh Simplifier::run() {
  findSides();
  for (m_round = 1; m_round <= kMostRounds; ++m_round) {
    if (m_round == kVerbatimRound)
      for (std::uint8_t& level : m_levels) level = std::max(level, kVerbatim);
    collapse();
    if (m_round == 1) m_firstCount = m_triangles.size();
    if (m_restarts < kMostRestarts && m_triangles.size() > kMostGrowth * m_firstCount) restart();
    numberVertices();
    measureProtrusions();
    moveOutward();
    liftTouching();
    boundDistances();
    checkComponents();
    if (refineFailed() > 0) continue;
    const double distance = *std::max_element(m_bounds.begin(), m_bounds.end());
    return {std::move(m_moved), std::move(m_triangles), distance, m_round};
  }
  giveUp();
}

void Simplifier::restart() {
  ++m_restarts;
  std::fill(m_levels.begin(), m_levels.end(), std::uint8_t{0});
  collapse();
  m_firstCount = m_triangles.size();
}

double Simplifier::errorOf(std::uint8_t level) const {
  return std::ldexp(kFirstError * m_settings.maxDistance, -2 * level - m_restarts);
}
double Simplifier::offsetOf(std::uint8_t level) const { return kOffsetShare * errorOf(level); }

Corners Simplifier::cornersOf(const Triangle& triangle) const {
  return {m_moved[triangle[0]], m_moved[triangle[1]], m_moved[triangle[2]]};
}

template <class F>
void Simplifier::forEach(std::size_t size, F&& f) {
  for (std::size_t first = 0; first < size; first += kSlice) {
    report(static_cast<double>(first) / static_cast<double>(size));
    m_threads.forChunks(std::min(kSlice, size - first), kGrain,
                        [&](std::size_t, std::size_t begin, std::size_t end) {
                          PointQueryStack stack;
                          for (std::size_t i = begin; i < end; ++i) f(first + i, stack);
                        });
  }
}

/// share: of the current loop. An estimate: each round takes half of what is left.
void Simplifier::report(double share) {
  const double fraction = 1.0 - std::ldexp(1.0 - 0.5 * share, 1 - std::max(m_round, 1));
  m_reported = std::max(m_reported, fraction);
  if (m_settings.progress && !m_settings.progress(m_reported))
    throw Error(ErrorCode::Cancelled, "the simplification was cancelled");
}

/// The lowest vertex of each vertex' component.
Simplifier::Components Simplifier::componentsOf(std::size_t vertices,
                                                std::span<const Triangle> triangles) {
  Components parents(vertices);
  std::iota(parents.begin(), parents.end(), 0u);
  const auto rootOf = [&](std::uint32_t v) {
    while (parents[v] != v) v = parents[v] = parents[parents[v]];
    return v;
  };
  for (const auto& [a, b, c] : triangles)
    for (const std::uint32_t v : {b, c}) {
      const std::uint32_t one = rootOf(a), two = rootOf(v);
      parents[std::max(one, two)] = std::min(one, two);
    }
  for (std::uint32_t v = 0; v < vertices; ++v) parents[v] = rootOf(v);
  return parents;
}

/// Looks at both sides of the largest triangle of each component. A wrong answer is no danger: the
/// certificate then fails.
void Simplifier::findSides() {
  const auto positions = m_body.mesh.now.body();
  m_normals.assign(positions.size(), Vector3d::Zero());
  std::vector<std::uint32_t> largest(positions.size(), kNone);
  std::vector<double> areas(positions.size(), 0.0);
  Eigen::AlignedBox3d box;
  for (std::uint32_t t = 0; t < m_input.size(); ++t) {
    const auto& [a, b, c] = m_input[t];
    const double area = (positions[b] - positions[a]).cross(positions[c] - positions[a]).norm();
    const std::uint32_t component = m_components[a];
    const Vector3d normal = unitNormal(positions, m_input[t]);
    for (const std::uint32_t v : m_input[t]) {
      box.extend(positions[v]);
      m_normals[v] += normal;
    }
    if (largest[component] != kNone && !(area > areas[component])) continue;
    largest[component] = t;
    areas[component] = area;
  }
  m_sides.assign(positions.size(), 0);
  PointQueryStack stack;
  for (const std::uint32_t t : largest) {
    if (t == kNone) continue;
    const auto& [a, b, c] = m_input[t];
    const Vector3d centre = (positions[a] + positions[b] + positions[c]) / 3.0,
                   step = kSideStep * box.sizes().maxCoeff() * unitNormal(positions, m_input[t]);
    std::int8_t& side = m_sides[m_components[a]];
    if (!m_certificate.isInside(centre + step, stack))
      side = 1;
    else if (!m_certificate.isInside(centre - step, stack))
      side = -1;
  }
  // Not all shells are inside others.
  if (std::all_of(m_sides.begin(), m_sides.end(), [](std::int8_t side) { return side == 0; }))
    std::fill(m_sides.begin(), m_sides.end(), std::int8_t{1});
}

// ---- In each round ----

void Simplifier::collapse() {
  m_triangles.clear();
  m_levelOf.clear();
  report(0.0);
  for (std::uint8_t level = 0; level <= kFinest; ++level) collapseLevel(level);
  m_failed.assign(m_triangles.size(), 0);
  markOpenEdges();
  markLostComponents();
}

void Simplifier::collapseLevel(std::uint8_t level) {
  std::vector<Triangle> triangles;
  for (std::size_t t = 0; t < m_input.size(); ++t)
    if (m_levels[t] == level && m_sides[m_components[m_input[t][0]]] != 0)
      triangles.push_back(m_input[t]);
  if (level < kVerbatim) triangles = m_collapse(m_body.mesh.now.body(), triangles, errorOf(level));
  m_triangles.insert(m_triangles.end(), triangles.begin(), triangles.end());
  m_levelOf.resize(m_triangles.size(), level);
}

/// The triangles around edges because of which the result would not be closed. Vertices are those
/// of the mesh.
void Simplifier::markOpenEdges() {
  const MeshDefects defects = findMeshDefects(m_triangles);
  if (defects.closed()) return;
  std::vector<Segment> edges;
  for (const auto* list : {&defects.open, &defects.flipped, &defects.shared})
    edges.insert(edges.end(), list->begin(), list->end());
  std::sort(edges.begin(), edges.end());
  for (std::size_t t = 0; t < m_triangles.size(); ++t)
    for (std::size_t i = 0; i < 3; ++i) {
      const auto [p, q] = std::minmax(m_triangles[t][i], m_triangles[t][(i + 1) % 3]);
      m_failed[t] |= std::binary_search(edges.begin(), edges.end(), Segment{p, q});
    }
}

/// A component that is as small as the error may collapse to nothing.
void Simplifier::markLostComponents() {
  m_isBad.assign(m_components.size(), 0);
  for (const std::uint32_t component : m_components) m_isBad[component] = m_sides[component] != 0;
  for (const Triangle& triangle : m_triangles) m_isBad[m_components[triangle[0]]] = 0;
}

void Simplifier::numberVertices() {
  const auto positions = m_body.mesh.now.body();
  std::vector<std::uint32_t> numbers(positions.size(), kNone);
  m_sideOf.resize(m_triangles.size());
  for (std::size_t t = 0; t < m_triangles.size(); ++t) {
    m_sideOf[t] = m_sides[m_components[m_triangles[t][0]]];
    for (const std::uint32_t v : m_triangles[t]) numbers[v] = 0;
  }
  m_origin.clear();
  m_start.clear();
  for (std::uint32_t v = 0; v < numbers.size(); ++v) {
    if (numbers[v] == kNone) continue;
    numbers[v] = static_cast<std::uint32_t>(m_origin.size());
    m_origin.push_back(v);
    m_start.push_back(positions[v]);
  }
  // Collapses may leave folds. A folded triangle has to move with the others, against its normal.
  for (std::size_t t = 0; t < m_triangles.size(); ++t) {
    Vector3d normal = Vector3d::Zero();
    for (std::uint32_t& v : m_triangles[t]) {
      normal += m_normals[v];
      v = numbers[v];
    }
    if (m_levelOf[t] < kVerbatim && normal.dot(unitNormal(m_start, m_triangles[t])) < 0.0)
      m_sideOf[t] = static_cast<std::int8_t>(-m_sideOf[t]);
  }
}

/// How far the mesh's vertices are outside the simplified surface, at the triangles nearest to
/// them.
void Simplifier::measureProtrusions() {
  m_protrusions.assign(m_triangles.size(), 0.0);
  m_owner.assign(m_components.size(), kNone);
  if (m_triangles.empty()) return;
  Body surface(GeometryId{1});
  makeBody(m_start, m_triangles, m_threads, surface);
  const auto positions = m_body.mesh.now.body();
  std::vector<double> outside(positions.size(), 0.0);
  std::vector<std::uint8_t> isCorner(positions.size(), 0);
  for (const std::uint32_t v : m_origin) isCorner[v] = 1;
  std::vector<std::uint32_t> order;  // along the octree of the mesh: neighbours are near
  order.reserve(positions.size());
  for (const Triangle& triangle : m_body.tree.ordered().first(m_input.size()))
    for (const std::uint32_t v : triangle)
      if (!isCorner[v] && m_sides[m_components[v]] != 0) {
        isCorner[v] = 1;
        order.push_back(v);
      }
  std::vector<std::uint32_t> likely(order.size() / kGrain + 1, 0);
  forEach(order.size(), [&](std::size_t i, PointQueryStack&) {
    const std::uint32_t v = order[i];
    std::uint32_t& last = likely[i / kGrain];
    const auto near = PointDistances(surface, positions[v], false).nearest(kInfinity, last);
    last = near->place;
    m_owner[v] = near->element;
    const Vector3d normal =
        m_sideOf[near->element] * unitNormal(m_start, m_triangles[near->element]);
    if (near->closest.difference.dot(normal) > 0.0) outside[v] = near->distance;
  });
  for (const std::uint32_t v : order)
    m_protrusions[m_owner[v]] = std::max(m_protrusions[m_owner[v]], outside[v]);
}

void Simplifier::moveOutward() {
  m_ways = outwardWays(m_start, m_triangles, m_sideOf);
  m_offsets.assign(m_start.size(), 0.0);
  for (std::size_t t = 0; t < m_triangles.size(); ++t)
    for (const std::uint32_t v : m_triangles[t])
      m_offsets[v] = std::max(m_offsets[v], m_protrusions[t] + offsetOf(m_levelOf[t]));
  m_moved = m_start;
  for (std::uint32_t v = 0; v < m_start.size(); ++v) moveVertex(v);
}

void Simplifier::moveVertex(std::uint32_t vertex) {
  const OutwardWay& way = m_ways[vertex];
  const double length =
      std::min(m_offsets[vertex] * way.lengthPerOffset, kLongestWay * m_settings.maxDistance);
  m_moved[vertex] = m_start[vertex] + length * way.direction;
}

/// Moves triangles further that touch the mesh, unless they have met another side of it.
void Simplifier::liftTouching() {
  const auto positions = m_body.mesh.now.body();
  const auto ordered = m_body.tree.ordered();
  std::vector<double> lifts(m_triangles.size());
  std::vector<std::uint8_t> isTouching(m_triangles.size(), 0), isOld(m_triangles.size(), 0);
  for (int lift = 0;; ++lift) {
    forEach(m_triangles.size(), [&](std::size_t t, PointQueryStack& stack) {
      if (isOld[t]) return;
      const Corners corners = cornersOf(m_triangles[t]);
      std::vector<std::uint32_t> touched;
      m_certificate.findTouched(corners, stack, touched);
      isTouching[t] = !touched.empty();
      lifts[t] = 0.0;
      const Vector3d normal = m_sideOf[t] * unitNormal(m_moved, m_triangles[t]);
      double height = 0.0;
      for (const std::uint32_t place : touched) {
        const std::int8_t side = m_sides[m_components[ordered[place][0]]];
        if (!(side * normal.dot(unitNormal(positions, ordered[place])) > 0.0)) continue;
        for (const std::uint32_t v : ordered[place])
          height = std::max(height, normal.dot(positions[v] - corners[0]));
        lifts[t] = std::min(height, errorOf(m_levelOf[t])) + offsetOf(m_levelOf[t]);
      }
    });
    if (lift == kMostLifts) break;
    std::vector<double> ofVertex(m_start.size(), 0.0);
    for (std::size_t t = 0; t < m_triangles.size(); ++t)
      if (isTouching[t])
        for (const std::uint32_t v : m_triangles[t]) ofVertex[v] = std::max(ofVertex[v], lifts[t]);
    bool isAny = false;
    for (std::uint32_t v = 0; v < m_start.size(); ++v) {
      if (!(ofVertex[v] > 0.0)) continue;
      m_offsets[v] += ofVertex[v];
      moveVertex(v);
      isAny = true;
    }
    if (!isAny) break;
    for (std::size_t t = 0; t < m_triangles.size(); ++t) {
      isOld[t] = 1;
      for (const std::uint32_t v : m_triangles[t])
        if (ofVertex[v] > 0.0) isOld[t] = 0;
    }
  }
  for (std::size_t t = 0; t < m_triangles.size(); ++t) m_failed[t] |= isTouching[t];
}

void Simplifier::boundDistances() {
  m_bounds.assign(m_triangles.size(), 0.0);
  forEach(m_triangles.size(), [&](std::size_t t, PointQueryStack& stack) {
    if (m_failed[t]) return;
    const auto bound = m_certificate.distanceBound(cornersOf(m_triangles[t]), stack);
    if (bound)
      m_bounds[t] = *bound;
    else
      m_failed[t] = 1;
  });
}

/// Each component of the mesh must be inside the result, and each one of the result outside the
/// mesh. Where no triangles meet, one vertex of each decides.
void Simplifier::checkComponents() {
  if (m_triangles.empty() || std::find(m_failed.begin(), m_failed.end(), 1) != m_failed.end())
    return;
  const Components components = componentsOf(m_moved.size(), m_triangles);
  PointQueryStack stack;
  for (std::uint32_t v = 0; v < components.size(); ++v)
    if (components[v] == v && m_certificate.isInside(m_moved[v], stack))
      m_isBad[m_components[m_origin[v]]] = 1;
  Body surface(GeometryId{1});
  makeBody(m_moved, m_triangles, m_threads, surface);
  const SimplifyCertificate inside(surface, m_settings.maxDistance, 0.0);
  const auto positions = m_body.mesh.now.body();
  std::vector<std::uint8_t> isChecked(m_components.size(), 0);
  for (const Triangle& triangle : m_input) {
    const std::uint32_t component = m_components[triangle[0]];
    if (std::exchange(isChecked[component], std::uint8_t{1})) continue;
    if (!inside.isInside(positions[component], stack)) m_isBad[component] = 1;
  }
}

/// Returns the number of triangles that failed, of the result or in failed components.
std::size_t Simplifier::refineFailed() {
  std::vector<std::uint8_t> next(m_components.size(), 0);  // per vertex of the mesh: least level
  std::size_t failed = 0;
  std::array<std::size_t, kFinest + 1> ofLevel{}, failedOfLevel{};
  for (std::size_t t = 0; t < m_triangles.size(); ++t) {
    ++ofLevel[m_levelOf[t]];
    if (!m_failed[t]) continue;
    ++failed;
    ++failedOfLevel[m_levelOf[t]];
    m_failure = {m_start[m_triangles[t][0]], {}};
    for (const std::uint32_t v : m_triangles[t])
      if (std::isinf(m_ways[v].lengthPerOffset)) m_failure.stuck = m_origin[v];
    if (m_levelOf[t] == kFinest) giveUp();
    for (const std::uint32_t v : m_triangles[t])
      next[m_origin[v]] = std::max(next[m_origin[v]], static_cast<std::uint8_t>(m_levelOf[t] + 1));
  }
  for (std::size_t v = 0; v < next.size(); ++v)
    if (m_owner[v] != kNone && m_failed[m_owner[v]])
      next[v] = static_cast<std::uint8_t>(m_levelOf[m_owner[v]] + 1);
  for (std::size_t t = 0; t < m_input.size(); ++t) {
    const std::uint8_t level = m_levels[t];
    if (level<kVerbatim&& static_cast<double>(failedOfLevel[level])> kMostFailures *
        static_cast<double>(ofLevel[level]))
      ++m_levels[t];
    if (m_isBad[m_components[m_input[t][0]]]) {
      ++failed;
      m_failure = {m_body.mesh.now[m_input[t][0]], {}};
      if (m_levels[t]++ == kFinest) giveUp();
    }
    for (const std::uint32_t v : m_input[t]) m_levels[t] = std::max(m_levels[t], next[v]);
  }
  return failed;
}

void Simplifier::giveUp() const {
  const std::string place = textOf(m_failure.place);
  if (const auto pair = findCrossing())
    throw Error(ErrorCode::UnsupportedMethod,
                nameOf(m_body) + " crosses or touches itself: triangles " +
                    std::to_string(pair->a) + " and " + std::to_string(pair->b) +
                    " have a common point, and there is no certified simplification near " + place,
                m_body.id, pair->a);
  throw Error(
      ErrorCode::NotAvailable,
      nameOf(m_body) + " has no certified simplification within maxDistance " +
          textOf(m_settings.maxDistance) + ": the proof fails near " + place +
          (m_failure.stuck ? "; no displacement of vertex " + std::to_string(*m_failure.stuck) +
                                 " moves all of its triangles outward"
                           : ""),
      m_body.id, m_failure.stuck);
}

/// The first two triangles of the mesh that have a common point and no common vertex.
std::optional<ElementPair> Simplifier::findCrossing() const {
  struct Search {
    const Body& body;
    std::optional<ElementPair> first{};
    void test(const ElementPair& pair) {
      const auto& triangles = body.mesh.topology.triangles;
      const auto& now = body.mesh.now;
      const auto& [a, b, c] = triangles[pair.a];
      const auto& [d, e, f] = triangles[pair.b];
      SignCounts counts;
      if ((!first || pair < *first) &&
          intersectTriangles({now[a], now[b], now[c]}, {now[d], now[e], now[f]}, counts)
              .intersect())
        first = pair;
    }
  } search{m_body};
  const Octree& octree = m_body.tree.octree();
  const TreePair trees{&octree, &octree, m_body.tree.ordered().data()};
  TraversalStack starts, stack;
  PairSink sink;
  sink.start(
      [](void* context, std::span<const ElementPair> pairs) {
        for (const ElementPair& pair : pairs) static_cast<Search*>(context)->test(pair);
      },
      &search);
  startPairs(trees, 1, starts);
  traverse(trees, starts.pairs, stack, sink);
  sink.flush();
  return search.first;
}

}  // namespace palpate
