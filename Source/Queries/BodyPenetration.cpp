#include "Queries/BodyPenetration.h"

#include "Queries/HullSeparation.h"
#include "Math/ClosestPoint.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Core/Assert.h"
#include "Core/Stopping.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

namespace {

constexpr std::size_t kMostRays = 8;          ///< of vertices that bound one translation
constexpr std::size_t kMostFaceNormals = 32;  ///< directions from faces
constexpr int kMostTests = 64;                ///< of whether one direction separates
/// Operations of all sweeps, for each triangle and besides; more if nothing separates the bodies.
constexpr std::size_t kOperationsPerTriangle = 24, kOperations = 40000;
constexpr int kMostDescents = 10;
/// A direction whose translation is longer than the best one by more than this starts no descent.
constexpr double kWorthDescent = 1.15;
/// Cosines: normals that are nearer to each other count once, and those that equal another seed.
constexpr double kSameNormal = 0.98, kEqualNormal = 1 - 0x1p-40;

/// A translation along a direction.
struct Translation {
  Vector3d direction = Vector3d::Zero();
  double depth = std::numeric_limits<double>::infinity();  ///< L
  TranslationSweep::Contact last;
  bool separates = false;  ///< proven; else it ended at the limit
};

/// Calls f(direction) for directions around the sphere: to a grid on the surface of a cube.
template <class F>
void forEachAround(F&& f) {
  constexpr int kSteps = 2;
  for (int x = -kSteps; x <= kSteps; ++x)
    for (int y = -kSteps; y <= kSteps; ++y)
      for (int z = -kSteps; z <= kSteps; ++z)
        if (std::max({std::abs(x), std::abs(y), std::abs(z)}) == kSteps) {
          const Vector3d direction(x, y, z);
          f(Vector3d(direction / stableLength(direction)));
        }
}

/// Where two triangles are nearest to each other.
struct NearestPoints {
  Vector3d weightsA, weightsB;
  double distance = kInfinity;
};
NearestPoints nearestPoints(const Corners& a, const Corners& b) {
  NearestPoints best;
  const auto take = [&](double distance, const Vector3d& ofA, const Vector3d& ofB) {
    if (distance < best.distance) best = {ofA, ofB, distance};
  };
  const auto onEdge = [](int i, double weight) {
    return Vector3d((1.0 - weight) * Vector3d::Unit(i) + weight * Vector3d::Unit((i + 1) % 3));
  };
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const VertexTriangleDistance ofA = finiteVertexTriangleDistance(a[k], b[0], b[1], b[2]),
                                 ofB = finiteVertexTriangleDistance(b[k], a[0], a[1], a[2]);
    take(ofA.distance, Vector3d::Unit(i), ofA.weights);
    take(ofB.distance, ofB.weights, Vector3d::Unit(i));
  }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const auto k = static_cast<std::size_t>(i), l = static_cast<std::size_t>(j);
      const EdgeEdgeDistance both =
          finiteEdgeEdgeDistance(a[k], a[(k + 1) % 3], b[l], b[(l + 1) % 3]);
      take(both.distance, onEdge(i, both.weightA), onEdge(j, both.weightB));
    }
  return best;
}

/// weights: on the triangle that meets last, in its place before the translation.
SurfacePoint pointOf(const BodyPair& pair, const Translation& at, bool ofA,
                     const Vector3d& weights) {
  const std::uint32_t element = ofA ? at.last.elementA : at.last.elementB;
  const Body& geometry = pair.geometry(ofA);
  const Triangle& vertices = geometry.mesh.topology.elements[element];
  Vector3d position = Vector3d::Zero();
  for (int i = 0; i < 3; ++i)
    position += weights[i] * pair.vertices(ofA).positions[vertices[static_cast<std::size_t>(i)]];
  return {geometry.id, element, vertices, weights, position, at.depth};
}

/// Along a direction out of the whole hull of b, and `slack` further.
Translation leavingHull(const BodyPair& pair, Vector3d direction, double slack) {
  if (direction == Vector3d::Zero()) direction = Vector3d::UnitX();
  const auto lastOf = [&](bool ofA, const Vector3d& way) {
    const BodyVertices& own = pair.vertices(ofA);
    std::uint32_t best = own.parts.front();
    for (std::uint32_t v = 0; v < own.positions.size(); ++v)
      if (own.triangleOf[v] != kNoElement &&
          way.dot(own.positions[v]) > way.dot(own.positions[best]))
        best = v;
    return best;
  };
  const std::uint32_t a = lastOf(true, -direction), b = lastOf(false, direction);
  const BodyVertices &ofA = pair.vertices(true), &ofB = pair.vertices(false);
  return {direction,
          direction.dot(ofB.positions[b] - ofA.positions[a]) + slack,
          {ofA.triangleOf[a], ofB.triangleOf[b], direction},
          true};
}

class PenetrationSearch {
 public:
  PenetrationSearch(const BodyPair& pair, OverlapTest& test, PenetrationScratch& scratch,
                    const PenetrationEffort& effort)
      : m_pair(pair),
        m_test(test),
        m_scratch(scratch),
        m_effort(effort),
        m_unit(unitOf(pair.magnitude())),
        m_hulls(separateHulls([&](const Vector3d& d) { return furthest(true, d); },
                              [&](const Vector3d& d) { return furthest(false, d); }, kExitSlack,
                              scratch.difference)),
        m_sweep(pair, m_hulls.direction, scratch.sweep),
        m_slack(kExitSlack * pair.magnitude()),
        m_mostSlack(4 * kInset * pair.magnitude()),
        m_triangles(pair.geometry(true).mesh.topology.count() +
                    pair.geometry(false).mesh.topology.count()) {}

  Penetration run() {
    // translate() reads both, also before they are found.
    m_scratch.insideA.clear();
    m_scratch.insideB.clear();
    const bool hasHulls = m_hulls.direction != Vector3d::Zero();
    if (hasHulls && areConvex()) {
      // No shorter translation separates them.
      const double least = (m_hulls.depth - m_hulls.gap) / m_unit - m_mostSlack;
      improve(m_hulls.direction, {kInfinity, std::max(least, 0.0), 4 * operations()});
    }
    if (!isMinimal()) {
      for (const bool ofA : {true, false})
        findInsideVertices(m_pair, ofA, m_scratch.intersecting, m_effort.inside, m_scratch.regions,
                           ofA ? m_scratch.insideA : m_scratch.insideB);
      searchDirections();
    }
    if (!m_best.separates) m_best = leavingHull(m_pair, m_hulls.direction, m_mostSlack);
    Penetration out = result();
    out.minimal = isMinimal();
    return out;
  }

 private:
  Vector3d furthest(bool ofA, const Vector3d& direction) const {
    checkTime();
    return m_unit * m_pair.vertices(ofA).furthest(direction);
  }

  // ---- One direction ----

  struct Limits {
    double end;              ///< L
    double least;            ///< L: no shorter translation separates the bodies
    std::size_t operations;  ///< of all sweeps
  };
  /// wantsLast: the last contact is wanted even if the bodies are not separated before the end.
  Translation translate(const Vector3d& direction, const Limits& limits, bool wantsLast) {
    Translation at;
    at.direction = direction;
    at.depth = limits.least;
    boundByRays(at, limits.end);
    if (!(at.depth < limits.end)) return at;
    const double from = std::max(at.depth - m_mostSlack, 0.0);
    m_sweep.start(direction, from, m_isClosed);
    double slack = m_slack;
    bool isInside = false;
    for (int i = 0; i < kMostTests; ++i) {
      const bool isFree = m_sweep.advance({limits.end, limits.operations, wantsLast}, isInside);
      if (m_sweep.last().elementA != kNoElement) at.last = m_sweep.last();
      at.depth = std::max(at.depth, m_sweep.t());
      if (!isFree) {
        // Something blocks it up to the end, unless the operations ended.
        if (!wantsLast && m_sweep.operations() <= limits.operations) at.depth = limits.end;
        return at;
      }
      at.depth = m_sweep.t() + slack;
      // Not tested, as it is no better. Of equal depths, descents have the better direction.
      at.separates = wantsLast ? at.depth > m_best.depth : at.depth >= m_best.depth;
      if (at.separates) return at;
      switch (m_test.find(at.depth * direction)) {
        case OverlapTest::Result::Apart:
          at.separates = true;
          // Where they overlap by less than the inset, nothing has crossed.
          if (at.last.elementA == kNoElement) at.last = m_sweep.touchingAt(direction, m_sweep.t());
          return at;
        case OverlapTest::Result::Inside:
          isInside = true;
          break;
        case OverlapTest::Result::Piercing:
          if ((isInside = m_sweep.isInsetInside())) break;
          slack *= 2;  // within rounding
          isInside = slack > m_mostSlack;
          m_isClosed |= isInside;
      }
      if (isInside) slack = m_slack;
    }
    return at;
  }
  /// No translation that is shorter than where any inside vertex leaves separates the bodies.
  void boundByRays(Translation& at, double limit) const {
    for (const bool ofA : {true, false}) {
      const auto& inside = insideOf(ofA);
      if (inside.empty()) continue;
      takeHit(at, {ofA, deepest(ofA, at.direction)}, limit);
      const std::size_t stride = std::max<std::size_t>(1, inside.size() / kMostRays);
      for (std::size_t i = 0; i < inside.size() && at.depth < limit; i += stride)
        takeHit(at, {ofA, inside[i]}, limit);
    }
  }
  /// Moves on to where a vertex meets the other surface, at most to a limit.
  void takeHit(Translation& at, const BodyPair::PartVertex& vertex, double limit) const {
    const auto hit = m_sweep.firstHit(vertex.ofA, vertex.vertex, at.direction, limit);
    if (!hit) at.depth = limit < kInfinity ? limit : at.depth;
    if (!hit || !(hit->t > at.depth)) return;
    at.depth = hit->t;
    const std::uint32_t own = m_pair.vertices(vertex.ofA).triangleOf[vertex.vertex];
    const Vector3d normal = normalOf(!vertex.ofA, hit->element);
    at.last = {vertex.ofA ? own : hit->element, vertex.ofA ? hit->element : own,
               normal.dot(at.direction) < 0 ? Vector3d(-normal) : normal};
  }
  std::size_t operations() const { return kOperations + kOperationsPerTriangle * m_triangles; }
  /// Of all sweeps, after one that separates.
  std::size_t operationsToImprove() const {
    return std::max(operations(), m_sweep.operations() + operations() / 4);
  }

  // ---- Vertices inside the other body ----

  const CountedVector<std::uint32_t>& insideOf(bool ofA) const {
    return ofA ? m_scratch.insideA : m_scratch.insideB;
  }
  /// The inside vertex that starts furthest back.
  std::uint32_t deepest(bool ofA, const Vector3d& direction) const {
    const auto& positions = m_pair.vertices(ofA).positions;
    const Vector3d back = ofA ? Vector3d(-direction) : direction;
    return *std::max_element(insideOf(ofA).begin(), insideOf(ofA).end(),
                             [&](std::uint32_t v, std::uint32_t w) {
                               return back.dot(positions[v]) < back.dot(positions[w]);
                             });
  }
  Vector3d normalOf(bool ofA, std::uint32_t element) const {
    const auto [p, q, r] =
        ofA ? m_pair.cornersOfA(element, Vector3d::Zero()) : m_pair.cornersOfB(element);
    return windingNormal(p, q, r);
  }

  // ---- Directions ----

  /// Follows a direction, and goes on from there if it is worth it. Returns L: no translation along
  /// it that separates is shorter.
  double improve(const Vector3d& direction, const Limits& limits) {
    const Translation first = translate(direction, limits, false);
    if (first.separates) {
      take(first);
      descend(first, limits.operations);
    }
    return first.depth;
  }
  void take(const Translation& found, bool orEqual = false) {
    if (!found.separates || found.depth > m_best.depth) return;
    if (orEqual || found.depth < m_best.depth) m_best = found;
  }
  void descend(const Translation& first, std::size_t operations) {
    ShortestTranslation& shortest = m_scratch.shortest;
    shortest.clear();
    shortest.add(first.last.normal, first.last.normal.dot(first.depth * first.direction));
    double depth = first.depth;
    for (int i = 0; i < kMostDescents; ++i) {
      const auto next = shortest.find();
      if (!next) return;
      const double length = stableLength(*next);
      if (!(length > 0) || !(length < (1.0 - kDepthGain) * std::min(depth, m_best.depth))) return;
      const Translation found =
          translate(*next / length, {kWorthDescent * depth, 0.0, operations}, true);
      if (found.last.elementA == kNoElement || m_sweep.operations() > operations) return;
      take(found, true);
      if (found.separates) depth = std::min(depth, found.depth);
      shortest.add(found.last.normal, found.last.normal.dot(found.depth * found.direction));
    }
  }
  void searchDirections() {
    auto& seeds = m_scratch.seeds;
    seeds.clear();
    addSeed(m_hulls.direction);
    addSeed(directionOfVolume());
    addNormals();
    if (m_effort.aroundTheSphere || seeds.empty())
      forEachAround([&](const Vector3d& direction) { seeds.push_back({direction, seeds.size()}); });
    // Short ways first: one through many layers, or across a hollow, costs more.
    const double most = m_hulls.depth / m_unit;
    for (auto& seed : seeds) seed.bound = boundOf(seed.direction, kWorthDescent * most);
    const double least = std::min_element(seeds.begin(), seeds.end(), isEarlier)->bound;
    for (double limit = std::max(kWorthDescent * least, most / 64);
         limit < most && !m_best.separates && m_sweep.operations() < operations() / 2; limit *= 2)
      trySeeds(limit, operations() / 2, 4 * operations());
    if (!m_best.separates) {
      const Limits limits{kInfinity, 0.0, 4 * operations()};
      const Translation last = translate(m_hulls.direction, limits, false);
      take(last);
      if (last.separates) descend(last, operationsToImprove());
    }
    const std::size_t end = operationsToImprove();
    trySeeds(kInfinity, end, end);
  }
  static bool isEarlier(const PenetrationScratch::Seed& l, const PenetrationScratch::Seed& r) {
    return std::tie(l.bound, l.place) < std::tie(r.bound, r.place);
  }
  /// start: after so many operations no further direction is tried. end: the last one ends.
  void trySeeds(double limit, std::size_t start, std::size_t end) {
    auto& seeds = m_scratch.seeds;
    std::sort(seeds.begin(), seeds.end(), isEarlier);
    int translations = 0;
    for (auto& seed : seeds) {
      if (translations++ >= m_effort.translations && m_best.separates) break;
      const double most = std::min(limit, kWorthDescent * m_best.depth);
      if (!(seed.bound < std::min(most, m_best.depth)) || m_sweep.operations() > start) break;
      seed.bound = std::max(seed.bound, improve(seed.direction, {most, seed.bound, end}));
    }
  }
  /// At most the limit.
  double boundOf(const Vector3d& direction, double limit) const {
    Translation at;
    at.direction = direction;
    at.depth = 0;
    for (const bool ofA : {true, false})
      if (!insideOf(ofA).empty()) takeHit(at, {ofA, deepest(ofA, direction)}, limit);
    return at.depth;
  }
  void addSeed(const Vector3d& direction) {
    if (direction != Vector3d::Zero())
      m_scratch.seeds.push_back({direction, m_scratch.seeds.size()});
  }
  /// Other seeds that are near a normal do not stand for it: between layers, only the normal does.
  void addNormals() {
    auto& seeds = m_scratch.seeds;
    const std::size_t first = seeds.size();
    TimeCheck check(16);
    const auto add = [&](bool ofA, std::uint32_t element) {
      check();
      if (seeds.size() >= kMostFaceNormals) return;
      const Vector3d direction = (ofA ? -1.0 : 1.0) * normalOf(ofA, element);
      for (std::size_t i = 0; i < seeds.size(); ++i)
        if (seeds[i].direction.dot(direction) > (i < first ? kEqualNormal : kSameNormal)) return;
      addSeed(direction);
    };
    for (const bool ofA : {true, false})
      for (const std::uint32_t v : insideOf(ofA)) add(ofA, m_pair.vertices(ofA).triangleOf[v]);
    for (const BodyPair::IntersectingTriangles& both : m_scratch.intersecting) {
      add(true, both.elementA);
      add(false, both.elementB);
    }
  }
  /// The direction in which the overlap shrinks fastest, about: the mean normal of inside faces.
  Vector3d directionOfVolume() const {
    Vector3d sum = Vector3d::Zero();
    for (const bool ofA : {true, false})
      for (const std::uint32_t v : insideOf(ofA))
        sum += (ofA ? -1.0 : 1.0) * normalOf(ofA, m_pair.vertices(ofA).triangleOf[v]);
    const double length = stableLength(sum);
    return length > 0 ? Vector3d(sum / length) : sum;
  }

  // ---- The answer ----

  bool isMinimal() const {
    const double most = kMinimalSlack * m_pair.magnitude();
    return m_best.separates && m_hulls.direction != Vector3d::Zero() &&
           m_best.depth <= (m_hulls.depth - m_hulls.gap) / m_unit + most && areConvex();
  }
  ElementPair firstIntersecting() const {
    if (m_scratch.intersecting.empty()) return {0, 0};
    return {m_scratch.intersecting.front().elementA, m_scratch.intersecting.front().elementB};
  }
  bool areConvex() const {
    if (!m_areConvex) m_areConvex = isConvex(m_pair, true) && isConvex(m_pair, false);
    return *m_areConvex;
  }
  Penetration result() {
    if (m_best.last.elementA == kNoElement) {  // the bodies overlap by less than kInset
      const auto& [a, b] = firstIntersecting();
      m_best.last = {a, b, m_best.direction};
    }
    const NearestPoints points =
        nearestPoints(m_pair.cornersOfA(m_best.last.elementA, m_best.depth * m_best.direction),
                      m_pair.cornersOfB(m_best.last.elementB));
    return {true,
            m_best.direction,
            m_best.depth,
            pointOf(m_pair, m_best, true, points.weightsA),
            pointOf(m_pair, m_best, false, points.weightsB),
            false};
  }

  const BodyPair& m_pair;
  OverlapTest& m_test;
  PenetrationScratch& m_scratch;
  const PenetrationEffort m_effort;
  const double m_unit;  ///< 1/L: brings coordinates to about 1
  const HullSeparation m_hulls;
  TranslationSweep m_sweep;
  const double m_slack;      ///< L
  const double m_mostSlack;  ///< L
  const std::size_t m_triangles;
  bool m_isClosed = false;  ///< faces lie in each other within rounding
  Translation m_best;
  mutable std::optional<bool> m_areConvex;
};

}  // namespace

Penetration apart(GeometryId a, GeometryId b) {
  const auto none = [](GeometryId id) {
    return SurfacePoint{id, kNoElement, {}, Vector3d::Zero(), Vector3d::Zero(), 0.0};
  };
  return {false, Vector3d::Zero(), 0.0, none(a), none(b), true};
}

Penetration penetrationOf(const Body& a, const Body& b, Engine engine, PenetrationScratch& scratch,
                          const PenetrationEffort& effort) {
  PALPATE_ASSERT(!a.shape && !b.shape);
  if (a.mesh.topology.count() == 0 || b.mesh.topology.count() == 0) return apart(a.id, b.id);
  return penetrationOf(BodyPair(a, b, engine, scratch.pair, effort.moved), scratch, effort);
}

Penetration penetrationOf(const BodyPair& pair, PenetrationScratch& scratch,
                          const PenetrationEffort& effort) {
  OverlapTest test(pair, scratch.overlap);
  if (test.find(Vector3d::Zero(), &scratch.intersecting) == OverlapTest::Result::Apart)
    return apart(pair.geometry(true).id, pair.geometry(false).id);
  return PenetrationSearch(pair, test, scratch, effort).run();
}

}  // namespace palpate
