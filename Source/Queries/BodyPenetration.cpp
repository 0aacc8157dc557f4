#include "Queries/BodyPenetration.h"

#include "Queries/BodyOverlap.h"
#include "Queries/HullSeparation.h"
#include "Math/ClosestPoint.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Math/TranslationExit.h"
#include "Core/Assert.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

namespace {

constexpr std::size_t kMostRays = 8;          ///< of vertices that bound one translation
constexpr std::size_t kMostFaceNormals = 32;  ///< directions from faces
constexpr int kMostSteps = 256;               ///< of one translation
constexpr int kMostDescents = 10;
/// A direction whose translation is longer than the best one by more than this starts no descent.
constexpr double kWorthDescent = 1.15;
/// Cosine: normals that are nearer to each other count once.
constexpr double kSameNormal = 0.98;

/// Where two surfaces touch last.
struct LastContact {
  std::uint32_t elementA = kNoElement, elementB = kNoElement;
  Vector3d weightsA = Vector3d::Zero(), weightsB = Vector3d::Zero();
  Vector3d normal = Vector3d::Zero();  ///< unit: a leaves b along it
};

/// A translation along a direction.
struct Translation {
  Vector3d direction = Vector3d::Zero();
  double depth = std::numeric_limits<double>::infinity();  ///< L
  LastContact last;
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

class Search {
 public:
  Search(const BodyPair& pair, PenetrationScratch& scratch, const PenetrationEffort& effort)
      : m_pair(pair),
        m_scratch(scratch),
        m_effort(effort),
        m_unit(unitOf(pair.magnitude())),
        m_slack(kExitSlack * pair.magnitude()) {}

  Penetration run() {
    findInside(true, m_scratch.insideA);
    findInside(false, m_scratch.insideB);
    const HullSeparation hulls = separateHulls(
        [&](const Vector3d& d) { return furthest(true, d); },
        [&](const Vector3d& d) { return furthest(false, d); }, kExitSlack, m_scratch.difference);
    if (hulls.direction != Vector3d::Zero()) improve(hulls.direction, kInfinity);
    if (isOver()) return {};
    if (!m_best.separates || !isMinimal(hulls)) searchDirections();
    if (isOver()) return {};
    Penetration out = result();
    out.minimal = isMinimal(hulls);
    return out;
  }

 private:
  Vector3d furthest(bool ofA, const Vector3d& direction) const {
    checkTime(m_pair.deadline());
    return m_unit * m_pair.vertices(ofA).furthest(direction, m_pair.deadline());
  }

  bool isOver() const { return palpate::isOver(m_pair.deadline()); }

  // ---- One direction ----

  /// Ends at the deadline without having separated the bodies, as follow() may end there.
  Translation translate(const Vector3d& direction, double limit) {
    Translation at;
    at.direction = direction;
    at.depth = 0;
    boundByRays(at, limit);
    double slack = m_slack;
    for (int step = 0; step < kMostSteps && at.depth < limit && !isOver(); ++step) {
      const double before = at.depth;
      if (!follow(at)) {
        at.separates = true;
        return at;
      }
      if (at.depth > before) {
        at.depth += m_slack;
      } else {
        at.depth = before + slack;
        slack *= 2;
      }
    }
    return at;
  }
  /// Moves on to where the triangles that meet come apart. Returns false if the bodies are apart.
  bool follow(Translation& at) {
    const Vector3d shift = at.depth * at.direction;
    const double start = at.depth;
    bool any = false;
    const auto takeIntersecting = [&](const BodyPair::IntersectingTriangles& both) {
      any = true;
      takeExit(at, start, both);
      return true;
    };
    m_pair.forEachIntersecting(shift, std::ref(takeIntersecting));  // a copy would allocate
    if (any || isOver()) return true;
    const auto part = m_pair.findInsidePart(shift);
    if (!part) return false;
    takeHit(at, *part, start);
    return true;
  }
  void takeExit(Translation& at, double start, const BodyPair::IntersectingTriangles& both) {
    const auto scaled = [&](const Corners& c) {
      return Corners{m_unit * c[0], m_unit * c[1], m_unit * c[2]};
    };
    const TranslationExit exit = lastTouch(scaled(both.a), scaled(both.b), at.direction);
    const double depth = start + exit.t / m_unit;
    const auto precedes = [&] {
      return std::pair(both.elementA, both.elementB) <
             std::pair(at.last.elementA, at.last.elementB);
    };
    // Bodies that overlap by less than rounding may have no exit after the start.
    const bool isOnly = at.last.elementA == kNoElement && exit.t > -kInfinity;
    if (!(isOnly || depth > at.depth || (depth == at.depth && depth > start && precedes()))) return;
    at.depth = std::max(at.depth, depth);
    at.last = {both.elementA, both.elementB, exit.weightsA, exit.weightsB, exit.normal};
  }
  /// Moves on to where a vertex meets the other surface.
  void takeHit(Translation& at, const BodyPair::PartVertex& vertex, double start) {
    const auto hit = m_pair.hitOf(vertex, start * at.direction, at.direction);
    if (!hit || !(start + hit->t > at.depth)) return;
    at.depth = start + hit->t;
    const std::uint32_t own = m_pair.vertices(vertex.ofA).triangleOf[vertex.vertex];
    Vector3d corner = Vector3d::Zero();
    const Triangle& corners = m_pair.geometry(vertex.ofA).mesh.topology.elements[own];
    for (int i = 0; i < 3; ++i)
      if (corners[static_cast<std::size_t>(i)] == vertex.vertex) corner = Vector3d::Unit(i);
    const Vector3d normal = normalOf(!vertex.ofA, hit->element);
    at.last = {own, hit->element, corner, hit->weights,
               normal.dot(at.direction) < 0 ? Vector3d(-normal) : normal};
    if (vertex.ofA) return;
    std::swap(at.last.elementA, at.last.elementB);
    std::swap(at.last.weightsA, at.last.weightsB);
  }
  /// No translation that is shorter than where any inside vertex leaves separates the bodies.
  void boundByRays(Translation& at, double limit) {
    for (const bool ofA : {true, false}) {
      const auto& inside = insideOf(ofA);
      if (inside.empty()) continue;
      takeHit(at, {ofA, deepest(ofA, at.direction)}, 0.0);
      const std::size_t stride = std::max<std::size_t>(1, inside.size() / kMostRays);
      for (std::size_t i = 0; i < inside.size() && at.depth < limit; i += stride)
        takeHit(at, {ofA, inside[i]}, 0.0);
    }
  }

  // ---- Vertices inside the other body ----

  const CountedVector<std::uint32_t>& insideOf(bool ofA) const {
    return ofA ? m_scratch.insideA : m_scratch.insideB;
  }
  void findInside(bool ofA, CountedVector<std::uint32_t>& inside) {
    const BodyVertices& own = m_pair.vertices(ofA);
    const Eigen::AlignedBox3d& other = m_pair.vertices(!ofA).box;
    inside.clear();
    TimeCheck check(m_pair.deadline(), 1024);
    for (std::uint32_t v = 0; v < own.positions.size(); ++v) {
      check();
      if (own.triangleOf[v] != kNoElement && other.contains(own.positions[v])) inside.push_back(v);
    }
    const std::size_t stride = inside.size() / m_effort.inside + 1;
    std::size_t count = 0;
    for (std::size_t i = 0; i < inside.size(); i += stride)
      if (m_pair.isInside(ofA, inside[i])) inside[count++] = inside[i];
    inside.resize(count);
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

  /// Follows a direction, and goes on from there if it is worth it.
  void improve(const Vector3d& direction, double limit) {
    const Translation first = translate(direction, limit);
    if (!first.separates) return;
    take(first);
    descend(first);
  }
  void take(const Translation& found) {
    if (found.separates && found.depth < m_best.depth) m_best = found;
  }
  void descend(const Translation& first) {
    ShortestTranslation& shortest = m_scratch.shortest;
    shortest.clear();
    shortest.add(first.last.normal, first.last.normal.dot(first.depth * first.direction));
    double depth = first.depth;
    for (int i = 0; i < kMostDescents; ++i) {
      const auto next = shortest.find();
      if (!next) return;
      const double length = stableLength(*next);
      if (!(length > 0) || !(length < (1.0 - kDepthGain) * std::min(depth, m_best.depth))) return;
      const Translation found = translate(*next / length, kWorthDescent * depth);
      if (found.last.elementA == kNoElement || isOver()) return;
      take(found);
      if (found.separates) depth = std::min(depth, found.depth);
      shortest.add(found.last.normal, found.last.normal.dot(found.depth * found.direction));
    }
  }
  void searchDirections() {
    auto& seeds = m_scratch.seeds;
    seeds.clear();
    addNormals();
    if (m_effort.aroundTheSphere || !m_best.separates)
      forEachAround([&](const Vector3d& direction) { seeds.push_back({direction, seeds.size()}); });
    for (auto& seed : seeds) seed.bound = boundOf(seed.direction);
    std::sort(seeds.begin(), seeds.end(), [](const auto& l, const auto& r) {
      return std::tie(l.bound, l.place) < std::tie(r.bound, r.place);
    });
    int translations = 0;
    for (const auto& seed : seeds) {
      if (translations++ >= m_effort.translations && m_best.separates) break;
      if (!(seed.bound < m_best.depth)) break;
      improve(seed.direction, kWorthDescent * m_best.depth);
      if (isOver()) return;
    }
  }
  double boundOf(const Vector3d& direction) {
    Translation at;
    at.direction = direction;
    at.depth = 0;
    for (const bool ofA : {true, false})
      if (!insideOf(ofA).empty()) takeHit(at, {ofA, deepest(ofA, direction)}, 0.0);
    return at.depth;
  }
  void addSeed(const Vector3d& direction) {
    if (direction == Vector3d::Zero()) return;
    for (const auto& seed : m_scratch.seeds)
      if (seed.direction.dot(direction) > kSameNormal) return;
    m_scratch.seeds.push_back({direction, m_scratch.seeds.size()});
  }
  void addNormals() {
    TimeCheck check(m_pair.deadline(), 16);
    const auto add = [&](bool ofA, std::uint32_t element) {
      check();
      if (m_scratch.seeds.size() < kMostFaceNormals)
        addSeed(ofA ? Vector3d(-normalOf(true, element)) : normalOf(false, element));
    };
    addSeed(directionOfVolume());
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

  bool isMinimal(const HullSeparation& hulls) const {
    const double most = kMinimalSlack * m_pair.magnitude();
    return m_best.separates && hulls.direction != Vector3d::Zero() &&
           m_best.depth <= (hulls.depth - hulls.gap) / m_unit + most && areConvex();
  }
  ElementPair firstIntersecting() const {
    if (m_scratch.intersecting.empty()) return {0, 0};
    return {m_scratch.intersecting.front().elementA, m_scratch.intersecting.front().elementB};
  }
  bool areConvex() const {
    if (!m_areConvex) m_areConvex = isConvex(m_pair, true) && isConvex(m_pair, false);
    return *m_areConvex;
  }
  SurfacePoint pointOf(bool ofA) const {
    const std::uint32_t element = ofA ? m_best.last.elementA : m_best.last.elementB;
    const Body& geometry = m_pair.geometry(ofA);
    const Triangle& vertices = geometry.mesh.topology.elements[element];
    Vector3d weights = (ofA ? m_best.last.weightsA : m_best.last.weightsB).cwiseMax(0.0);
    weights /= weights.sum();
    Vector3d position = Vector3d::Zero();
    for (int i = 0; i < 3; ++i)
      position +=
          weights[i] * m_pair.vertices(ofA).positions[vertices[static_cast<std::size_t>(i)]];
    return {geometry.id, element, vertices, weights, position, m_best.depth};
  }
  Penetration result() {
    if (m_best.last.elementA == kNoElement) {  // no exit was found in floating point
      const Vector3d middle = Vector3d::Constant(1.0 / 3.0);
      const auto& [a, b] = firstIntersecting();
      m_best.last = {a, b, middle, middle, m_best.direction};
    }
    return {true, m_best.direction, m_best.depth, pointOf(true), pointOf(false), false};
  }

  const BodyPair& m_pair;
  PenetrationScratch& m_scratch;
  const PenetrationEffort m_effort;
  const double m_unit;   ///< 1/L: brings coordinates to about 1
  const double m_slack;  ///< L
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
  if (!overlap(pair, scratch.intersecting))
    return apart(pair.geometry(true).id, pair.geometry(false).id);
  return Search(pair, scratch, effort).run();
}

}  // namespace palpate
