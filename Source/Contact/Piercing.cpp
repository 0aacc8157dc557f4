#include "Contact/Piercing.h"

#include "Contact/FeatureStar.h"
#include "Contact/Filters.h"
#include "Contact/IntersectionContacts.h"
#include "Mesh/Corners.h"
#include "Math/ClosestPoint.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"
#include "Exact/Predicates.h"
#include "Core/Assert.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>

namespace palpate {

namespace {

/// Cosine of the angle between the normals of a vertex and of a ridge above its edge: at a right
/// angle, the ridge leads out through the vertex' face and not through the crossed one.
constexpr double kSameWayOut = 0.7;

/// Of the product of two squared lengths, L^4. Between these bounds the products of two such
/// normals do not leave the range of double either.
constexpr double kSmallestSquare = 0x1p-400, kLargestSquare = 0x1p400;

/// A mesh at one end of the step.
struct PlacedMesh {
  const MeshTopology& topology;
  const Positions& at;

  PlacedMesh(const TriangleMesh& mesh, bool atStart)
      : topology(mesh.topology), at(atStart ? mesh.before : mesh.now) {}
  Corners corners(std::uint32_t triangle) const {
    return cornersOf(topology.elements[triangle], at);
  }
};

int sideOf(const Corners& triangle, const Eigen::Vector3d& position) {
  SignCounts counts;
  return orient3d(triangle[0], triangle[1], triangle[2], position, counts);
}

bool holds(const Segment& edge, std::uint32_t vertex) {
  return edge[0] == vertex || edge[1] == vertex;
}

/// The winding normal of a triangle times twice its area, with an error of at most 2^-30 of its
/// length. Nothing of a triangle that is nearly a line, or where squares leave the range of double.
/// Much cheaper than windingNormal().
std::optional<Eigen::Vector3d> roughNormal(const Corners& triangle) {
  const Eigen::Vector3d u = triangle[1] - triangle[0], v = triangle[2] - triangle[0],
                        normal = u.cross(v);
  const double square = normal.squaredNorm(), most = u.squaredNorm() * v.squaredNorm();
  if (!(most > kSmallestSquare && most < kLargestSquare && square > 0x1p-40 * most)) return {};
  return normal;
}

/// From an end of an edge to where the edge crosses a triangle. NaN where rounding hides that.
Eigen::Vector3d crossingFrom(std::uint32_t end, const PlacedMesh& own, std::uint32_t edge,
                             const PlacedMesh& surface, std::uint32_t triangle) {
  const Segment& ends = own.topology.edges[edge];
  const Eigen::Vector3d along = own.at[ends[ends[0] == end]] - own.at[end];
  const Corners corners = surface.corners(triangle);
  const auto& [a, b, c] = corners;
  const std::optional<Eigen::Vector3d> rough = roughNormal(corners);
  const Eigen::Vector3d normal = rough ? *rough : windingNormal(a, b, c);
  const double weight = normal.dot(a - own.at[end]) / normal.dot(along);
  if (!(weight >= 0.0 && weight <= 1.0))
    return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  return weight * along;
}

/// From the first of two segments to the second, if their closest points are between their ends.
/// Nothing otherwise, or if they are nearly parallel.
std::optional<Eigen::Vector3d> betweenInteriors(const Eigen::Vector3d& p, const Eigen::Vector3d& q,
                                                const Eigen::Vector3d& r,
                                                const Eigen::Vector3d& s) {
  Eigen::Vector3d u = q - p, v = s - r, from = r - p;
  const double scale = std::max({u.cwiseAbs().maxCoeff(), v.cwiseAbs().maxCoeff(),
                                 from.cwiseAbs().maxCoeff(), std::numeric_limits<double>::min()});
  u /= scale, v /= scale, from /= scale;
  const Eigen::Vector3d normal = u.cross(v);
  const double square = normal.squaredNorm();
  if (!(square > kTouchAngle * kTouchAngle * u.squaredNorm() * v.squaredNorm())) return {};
  const double ofU = from.cross(v).dot(normal);
  if (!(ofU > 0.0 && ofU < square)) return {};
  const double ofV = from.cross(u).dot(normal);
  if (!(ofV > 0.0 && ofV < square)) return {};
  return scale * (from.dot(normal) / square) * normal;
}

/// Whether two edges are certainly not nearest to each other within kSameWayOut of a direction.
bool leadElsewhere(const Eigen::Vector3d& u, const Eigen::Vector3d& v,
                   const Eigen::Vector3d& direction) {
  const Eigen::Vector3d normal = u.cross(v);
  const double along = normal.dot(direction), most = u.squaredNorm() * v.squaredNorm();
  return most > kSmallestSquare && most < kLargestSquare &&
         along * along < (1.0 - 0x1p-10) * kSameWayOut * kSameWayOut * normal.squaredNorm() &&
         normal.squaredNorm() > 0x1p-30 * most;
}

/// Whether the normals of two triangles are the same or opposite ones, up to kTouchAngle.
bool areParallel(const Corners& s, const Corners& t) {
  const std::optional<Eigen::Vector3d> m = roughNormal(s), n = roughNormal(t);
  const double most = m && n ? m->squaredNorm() * n->squaredNorm() : 0.0;
  if (std::isnormal(most) && m->cross(*n).squaredNorm() > 4.0 * kTouchAngle * kTouchAngle * most)
    return false;
  return windingNormal(s[0], s[1], s[2]).cross(windingNormal(t[0], t[1], t[2])).norm() <
         kTouchAngle;
}

bool isBorder(const MeshTopology& topology, std::uint32_t edge) {
  return isOnBorder(topology, {MeshFeature::Kind::Edge, edge});
}

/// Whether two triangles hold an edge, and each is behind the other by more than rounding.
bool isConvex(const PlacedMesh& mesh, std::uint32_t edge) {
  const auto both = mesh.topology.edgeTriangles[edge];
  if (both.size() != 2) return false;
  const Corners s = mesh.corners(both[0]), t = mesh.corners(both[1]);
  if (areParallel(s, t)) return false;
  const auto& corners = mesh.topology.elements[both[1]];
  return std::any_of(corners.begin(), corners.end(), [&](std::uint32_t v) {
    return !holds(mesh.topology.edges[edge], v) && sideOf(s, mesh.at[v]) < 0;
  });
}

/// The edges of one triangle that cross a triangle of the other mesh.
class CrossingEdges {
 public:
  /// ofB: the edges are of MeshPair::b.
  CrossingEdges(const MeshPair& pair, bool ofB, bool atStart, std::uint32_t triangle,
                std::uint32_t crossed, Buffer<EdgeCrossing>& out)
      : m_mesh(ofB ? pair.b : pair.a, atStart),
        m_others((ofB ? pair.a : pair.b).topology),
        m_ofB(ofB && !pair.self()),
        m_triangle(triangle),
        m_crossed(crossed),
        m_corners(PlacedMesh(ofB ? pair.a : pair.b, atStart).corners(crossed)),
        m_out(out) {}

  void addThroughFace(int edge) { add(edge, {MeshFeature::Kind::Face, m_crossed}); }

  /// touched: bit i is set if the edge meets edge i of the crossed triangle.
  void addIfThroughBorder(int edge, unsigned touched) {
    const std::uint32_t id = m_mesh.topology.triangleEdges[m_triangle][edge];
    if (touched == 0 || id == kNoEdge) return;
    const Segment& ends = m_mesh.topology.edges[id];
    if (side(ends[0]) * side(ends[1]) >= 0) return;
    // It crosses the plane in one point. If that is on two edges, it is their common corner.
    const auto feature = touched == 0b011   ? TriangleFeature::CornerB
                         : touched == 0b110 ? TriangleFeature::CornerC
                         : touched == 0b101 ? TriangleFeature::CornerA
                         : touched == 0b001 ? TriangleFeature::EdgeAB
                         : touched == 0b010 ? TriangleFeature::EdgeBC
                                            : TriangleFeature::EdgeCA;
    add(edge, featureOf(m_others, m_crossed, feature));
  }

 private:
  int side(std::uint32_t vertex) const { return sideOf(m_corners, m_mesh.at[vertex]); }
  void add(int edge, const MeshFeature& through) {
    const std::uint32_t id = m_mesh.topology.triangleEdges[m_triangle][edge];
    const bool lowerIsBehind = side(m_mesh.topology.edges[id][0]) < 0;
    m_out.push_back({m_ofB, id, through, m_crossed, lowerIsBehind});
  }

  PlacedMesh m_mesh;
  const MeshTopology& m_others;
  bool m_ofB;
  std::uint32_t m_triangle, m_crossed;
  Corners m_corners;
  Buffer<EdgeCrossing>& m_out;
};

/// Whether an edge leaves the surface in one of its features, on the way from p to q: 1. If it
/// enters: -1. earlier: crossings of the edge that were counted already; crossings: all in this
/// feature.
int leavesIn(const TriangleMesh& surface, bool atStart, std::span<const EdgeCrossing> earlier,
             std::span<const EdgeCrossing> crossings, const Eigen::Vector3d& p,
             const Eigen::Vector3d& q, SignCounts& counts) {
  const EdgeCrossing& first = crossings.front();
  const int sense = first.lowerIsBehind ? 1 : -1;
  if (first.through.kind == MeshFeature::Kind::Face) return sense;
  const FeatureStar star(surface, atStart, first.through, p, q, counts);
  if (std::any_of(earlier.begin(), earlier.end(),
                  [&](const EdgeCrossing& c) { return star.joins(c.through); }))
    return 0;
  if (star.isClosed()) return star.hasInside(p) - star.hasInside(q);
  const bool agree = std::all_of(crossings.begin(), crossings.end(), [&](const EdgeCrossing& c) {
    return c.lowerIsBehind == first.lowerIsBehind;
  });
  return agree && !star.holds(p) && !star.holds(q) ? sense : 0;
}

/// How often more an edge leaves the surface than it enters it, on the way from p to q.
/// crossings: of the edge, sorted.
int timesOfLeaving(const TriangleMesh& surface, bool atStart,
                   std::span<const EdgeCrossing> crossings, const Eigen::Vector3d& p,
                   const Eigen::Vector3d& q, SignCounts& counts) {
  int sum = 0;
  for (auto first = crossings.begin(); first != crossings.end();) {
    const auto end = std::find_if(
        first, crossings.end(), [&](const EdgeCrossing& c) { return c.through != first->through; });
    sum += leavesIn(surface, atStart, {crossings.begin(), first}, {first, end}, p, q, counts);
    first = end;
  }
  return sum;
}

/// Of the first exit distance: how far the boxes of triangles are from the vertex that connect
/// features with those that its edges cross. Around a right angle they are up to the root of 2; any
/// larger value will do.
constexpr double kExitReach = 1.5;

/// Of a vertex' depth: an edge that crosses the surface at least this deep has a contact of its
/// own. Below 1, so that rounding does not choose where the edge is as deep as its end.
constexpr double kDeepCrossing = 0.5;

/// Searches the feature of a surface that is nearest to a vertex behind it.
class NearestInFront {
 public:
  NearestInFront(const MeshPair& pair, bool ofB, bool atStart, std::uint32_t vertex)
      : m_pair(pair),
        m_surface(ofB ? pair.a : pair.b),
        m_own(ofB ? pair.b : pair.a, atStart),
        m_mesh(m_surface, atStart),
        m_atStart(atStart),
        m_vertex(vertex),
        m_position(m_own.at[vertex]) {}

  /// Begins at a triangle behind which the vertex is, or goes on to it if it is nearer.
  bool enter(std::uint32_t triangle) {
    if (m_isKnown && (triangle == m_triangle || isNoNearer(m_mesh.corners(triangle)))) return false;
    const VertexTriangleDistance found = measure(triangle);
    if (m_isKnown && !(found.distance < m_nearest.distance)) return false;
    m_isKnown = true;
    m_triangle = triangle;
    m_nearest = found;
    return true;
  }

  /// Goes on to nearer triangles, and at last to the lowest one that holds the feature.
  void walk() {
    for (bool isNearer = true; isNearer;) {
      isNearer = false;
      for (const std::uint32_t t : holdersOf(m_mesh.topology, feature()))
        isNearer |= isAllowed(t) && enter(t);
    }
    const MeshFeature last = feature();
    for (const std::uint32_t t : holdersOf(m_mesh.topology, last)) {
      if (t >= m_triangle) return;
      if (!isAllowed(t)) continue;
      const VertexTriangleDistance found = measure(t);
      if (featureOf(m_mesh.topology, t, found.feature) != last) continue;
      m_triangle = t;
      m_nearest = found;
    }
  }

  /// Goes on to the feature with the shortest exit distance. crossings: of the vertex' edges.
  void shorten(std::span<const PiercingContacts::Behind> crossings,
               PiercingContacts::Scratch& scratch) {
    findCrossings(crossings, scratch.crossings);
    const VertexTriangleContact nearest = contact();
    double shortest = exitDistance(nearest, scratch.crossings);
    const double reach = kExitReach * shortest;
    shortest *= 1.0 - kExitDistanceSlack;
    findNearer(shortest, reach, crossings, scratch);
    auto& nearer = scratch.nearer;
    auto best = std::pair(m_triangle, m_nearest);
    bool isBetter = false;
    std::make_heap(nearer.begin(), nearer.end(), std::greater<>());
    // No exit distance is shorter than the distance.
    for (auto end = nearer.end(); end != nearer.begin() && nearer.front().distance < shortest;
         --end) {
      std::pop_heap(nearer.begin(), end, std::greater<>());
      m_triangle = std::prev(end)->id;
      m_nearest = measure(m_triangle);
      const double other = exitDistance(contact(), scratch.crossings);
      if (!(other < shortest) || goesOn()) continue;
      shortest = (1.0 - kExitDistanceSlack) * other;
      best = {m_triangle, m_nearest};
      isBetter = true;
    }
    std::tie(m_triangle, m_nearest) = best;
    if (isBetter)
      walk();
    else
      m_contact = nearest;
  }

  bool isBeyondBorder() const {
    return palpate::isBeyondBorder(m_surface, feature(), contact().normal, m_atStart ? 0.0 : 1.0);
  }
  /// The mean normal of the triangles at the feature, an edge or a vertex.
  Eigen::Vector3d outward() const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const std::uint32_t t : holdersOf(m_mesh.topology, feature())) {
      const auto [a, b, c] = m_mesh.corners(t);
      sum += windingNormal(a, b, c);
    }
    return sum.stableNormalized();
  }
  MeshFeature feature() const { return featureOf(m_mesh.topology, m_triangle, m_nearest.feature); }

  std::uint32_t triangle() const { return m_triangle; }
  Corners corners() const { return m_mesh.corners(m_triangle); }
  bool exact() const { return m_nearest.exact; }
  VertexTriangleContact contact() const {
    if (m_contact) return *m_contact;
    VertexTriangleDistance answer = m_nearest;
    if (answer.distance > 0.0) turnToFront(corners(), answer);
    return contactOf(m_vertex, m_triangle, m_mesh.topology.elements[m_triangle], answer);
  }

 private:
  /// From the vertex to where its edges cross the surface.
  void findCrossings(std::span<const PiercingContacts::Behind> crossings,
                     Buffer<Eigen::Vector3d>& found) const {
    found.clear();
    for (const auto& crossing : crossings)
      found.push_back(
          crossingFrom(crossing.vertex, m_own, crossing.edge, m_mesh, crossing.triangle));
  }
  /// L: how far the vertex, and the places where its edges cross the surface, must move along the
  /// contact's normal to be in front of the plane through the closest point.
  double exitDistance(const VertexTriangleContact& at,
                      std::span<const Eigen::Vector3d> crossings) const {
    double furthest = 0.0;
    for (const Eigen::Vector3d& crossing : crossings)  // NaN changes nothing
      furthest = std::max(furthest, -at.normal.dot(crossing));
    return furthest - at.distance;
  }
  /// Of the triangles that others, with boxes at most `distance` away, connect with the present one
  /// or one that the edges cross, those that are nearer than `shortest` and behind which the vertex
  /// is.
  void findNearer(double shortest, double distance,
                  std::span<const PiercingContacts::Behind> crossings,
                  PiercingContacts::Scratch& scratch) const {
    const MeshTopology& topology = m_mesh.topology;
    Buffer<PiercingContacts::Near>& nearer = scratch.nearer;
    Buffer<std::uint32_t>&reached = scratch.reached, &triangleTurns = scratch.triangleTurns,
    &vertexTurns = scratch.vertexTurns;
    std::uint32_t& turn = scratch.turn;
    const auto makeRoom = [](Buffer<std::uint32_t>& turns, std::size_t size) {
      if (turns.size() < size) turns.resize(size, 0u);
    };
    makeRoom(triangleTurns, topology.elements.size());
    makeRoom(vertexTurns, topology.vertexCount);
    if (++turn == 0) {
      std::fill(triangleTurns.begin(), triangleTurns.end(), 0u);
      std::fill(vertexTurns.begin(), vertexTurns.end(), 0u);
      turn = 1;
    }
    nearer.clear();
    reached.clear();
    // Without squares, all that is connected is measured.
    const double reachSquare = distance * distance, shortestSquare = shortest * shortest;
    const bool squaresHold = std::isnormal(shortestSquare) && std::isfinite(reachSquare);
    const auto reach = [&](std::uint32_t t) {
      if (std::exchange(triangleTurns[t], turn) == turn || !topology.isEnabled(t)) return;
      const Corners corners = m_mesh.corners(t);
      const double least = squaredDistanceToBox(corners);
      if ((squaresHold && least > reachSquare) || m_pair.excludesVertex(m_vertex, t)) return;
      for (const std::uint32_t corner : topology.elements[t])
        if (std::exchange(vertexTurns[corner], turn) != turn) reached.push_back(corner);
      if (squaresHold && (least >= shortestSquare || isOutOfReach(corners, shortestSquare))) return;
      const double found = measure(t).distance;
      if (found < shortest && isAllowed(t)) nearer.push_back({found, t});
    };
    reach(m_triangle);
    for (const auto& crossing : crossings) reach(crossing.triangle);
    for (std::size_t i = 0; i < reached.size(); ++i)
      for (const std::uint32_t t : topology.vertexTriangles[reached[i]]) reach(t);
  }
  /// To the triangle's box, less rounding.
  double squaredDistanceToBox(const Corners& triangle) const {
    const auto& [a, b, c] = triangle;
    const Eigen::Vector3d lower = a.cwiseMin(b).cwiseMin(c), upper = a.cwiseMax(b).cwiseMax(c);
    return (1.0 - 0x1p-40) *
           (lower - m_position).cwiseMax(m_position - upper).cwiseMax(0.0).squaredNorm();
  }
  /// Whether the triangle's plane is further away, or the vertex certainly in front of it. A
  /// triangle that is nearly a line has no plane.
  bool isOutOfReach(const Corners& triangle, double distanceSquared) const {
    const std::optional<Eigen::Vector3d> normal = roughNormal(triangle);
    if (!normal) return false;
    const Eigen::Vector3d from = m_position - triangle[0];
    const double square = normal->squaredNorm(), height = normal->dot(from);
    if (height > 0.0) return height * height > 0x1p-40 * square * from.squaredNorm();
    return isBeyond(height, distanceSquared * square);
  }
  /// Whether a triangle is certainly at least as far away as the nearest one so far.
  bool isNoNearer(const Corners& triangle) const {
    const double distanceSquared = m_nearest.distance * m_nearest.distance;
    if (!std::isnormal(distanceSquared)) return false;
    if (squaredDistanceToBox(triangle) >= distanceSquared) return true;
    const std::optional<Eigen::Vector3d> normal = roughNormal(triangle);
    if (!normal) return false;
    return isBeyond(normal->dot(m_position - triangle[0]), distanceSquared * normal->squaredNorm());
  }
  static bool isBeyond(double height, double limitSquared) {
    return std::isnormal(limitSquared) && (1.0 - 0x1p-20) * height * height >= limitSquared;
  }
  bool goesOn() const {
    const auto around = holdersOf(m_mesh.topology, feature());
    return std::any_of(around.begin(), around.end(), [&](std::uint32_t t) {
      return measure(t).distance < m_nearest.distance && isAllowed(t);
    });
  }
  bool isAllowed(std::uint32_t triangle) const {
    return !m_pair.excludesVertex(m_vertex, triangle) &&
           sideOf(m_mesh.corners(triangle), m_position) < 0;
  }
  VertexTriangleDistance measure(std::uint32_t triangle) const {
    const auto [a, b, c] = m_mesh.corners(triangle);
    return finiteVertexTriangleDistance(m_position, a, b, c);
  }

  const MeshPair& m_pair;
  const TriangleMesh& m_surface;
  PlacedMesh m_own, m_mesh;
  bool m_atStart;
  std::uint32_t m_vertex, m_triangle = 0;
  Eigen::Vector3d m_position;
  VertexTriangleDistance m_nearest{};
  bool m_isKnown = false;
  std::optional<VertexTriangleContact> m_contact;  ///< where it was measured already
};

}  // namespace

void recordCrossings(const MeshPair& pair, bool atStart, const ElementPair& triangles,
                     const TriangleIntersection& found, Buffer<EdgeCrossing>& out) {
  CrossingEdges ofA(pair, false, atStart, triangles.a, triangles.b, out),
      ofB(pair, true, atStart, triangles.b, triangles.a, out);
  const auto touches = [&](int i, int j) {
    return (found.touchingEdges & TriangleIntersection::edgesBit(i, j)) != 0;
  };
  for (int i = 0; i < 3; ++i) {
    unsigned touchedOfB = 0, touchedOfA = 0;
    for (int j = 0; j < 3; ++j) {
      touchedOfB |= touches(i, j) << j;
      touchedOfA |= touches(j, i) << j;
    }
    if (found.edgesOfAThroughB >> i & 1) ofA.addThroughFace(i);
    if (found.edgesOfBThroughA >> i & 1) ofB.addThroughFace(i);
    ofA.addIfThroughBorder(i, touchedOfB);
    ofB.addIfThroughBorder(i, touchedOfA);
  }
}

void PiercingContacts::collect(std::span<ContactBuffers* const> found,
                               Buffer<EdgeCrossing> ContactBuffers::*list) {
  m_crossings.clear();
  for (const ContactBuffers* buffers : found)
    m_crossings.insert(m_crossings.end(), (buffers->*list).begin(), (buffers->*list).end());
  sortInTime(m_crossings.begin(), m_crossings.end(), std::less<>());
  m_crossings.erase(std::unique(m_crossings.begin(), m_crossings.end()), m_crossings.end());
}

void PiercingContacts::find(const MeshPair& pair, std::span<ContactBuffers* const> found,
                            ContactBuffers& out) {
  collect(found, &ContactBuffers::crossings);
  findBehind(pair, false, out);
  addDepths(pair, false, out);
  TimeCheck check(32);
  for (const ContactBuffers* buffers : found)
    for (const PiercedPair& pierced : buffers->pierced) {
      check();
      if (!isRepresented(pair, pierced) && !addBelow(pair, pierced, out))
        addPierced(pair, pierced, out);
    }
}

void PiercingContacts::findAtStart(const MeshPair& pair, std::span<ContactBuffers* const> found,
                                   ContactBuffers& out) {
  collect(found, &ContactBuffers::crossingsAtStart);
  findBehind(pair, true, out);
  addDepths(pair, true, out);
}

template <class IsAllowed>
std::span<const PiercingContacts::Near> PiercingContacts::findEdgesAbove(
    const MeshPair& pair, bool ofB, std::uint32_t edge, std::span<const std::uint32_t> triangles,
    const Eigen::Vector3d* wayOut, IsAllowed&& isAllowed) {
  const PlacedMesh own(ofB ? pair.b : pair.a, false), surface(ofB ? pair.a : pair.b, false);
  const MeshTopology& topology = surface.topology;
  const Segment& ends = own.topology.edges[edge];
  const Eigen::Vector3d p = own.at[ends[0]], q = own.at[ends[1]], along = q - p;
  Buffer<Near>& above = m_scratch.nearer;
  above.clear();
  for (const std::uint32_t triangle : triangles)
    for (const std::uint32_t corner : topology.elements[triangle])
      for (const std::uint32_t around : topology.vertexTriangles[corner]) {
        const Triangle& corners = topology.elements[around];
        const auto out = std::find(corners.begin(), corners.end(), corner) - corners.begin();
        for (const auto side : {out, (out + 2) % 3}) {
          const std::uint32_t other = topology.triangleEdges[around][side];
          // Of an inner edge to the corner, the other triangle has it from the corner.
          if (other == kNoEdge || (side != out && !isBorder(topology, other))) continue;
          const Segment& both = topology.edges[other];
          if (pair.self() && (holds(ends, both[0]) || holds(ends, both[1]))) continue;
          const Eigen::Vector3d r = surface.at[both[0]], s = surface.at[both[1]];
          if (wayOut && leadElsewhere(along, s - r, *wayOut)) continue;
          const auto up = betweenInteriors(p, q, r, s);
          if (!up) continue;
          const double length = stableLength(*up);
          if (isAllowed(other, *up, length)) above.push_back({length, other});
        }
      }
  std::sort(above.begin(), above.end());
  return above;
}

template <class IsAllowed>
bool PiercingContacts::addRidge(const MeshPair& pair, bool ofB, std::uint32_t edge,
                                std::initializer_list<std::uint32_t> triangles,
                                const Eigen::Vector3d* wayOut, ContactBuffers& out,
                                IsAllowed&& isAllowed) {
  const PlacedMesh surface(ofB ? pair.a : pair.b, false);
  const auto ridges = findEdgesAbove(pair, ofB, edge, {triangles.begin(), triangles.size()}, wayOut,
                                     [&](std::uint32_t, const Eigen::Vector3d& up, double length) {
                                       return isAllowed(up, length);
                                     });
  return std::any_of(ridges.begin(), ridges.end(), [&](const Near& ridge) {
    return isConvex(surface, ridge.id) &&
           addIfCrossed(pair, ofB ? ridge.id : edge, ofB ? edge : ridge.id, out);
  });
}

bool PiercingContacts::addBorders(const MeshPair& pair, std::span<const Behind> crossings,
                                  const VertexTriangleContact& nearest,
                                  const Eigen::Vector3d& outward, ContactBuffers& out) {
  const bool isOfB = crossings.front().ofB;
  const MeshTopology &own = (isOfB ? pair.b : pair.a).topology,
                     &topology = (isOfB ? pair.a : pair.b).topology;
  bool any = false;
  // Behind an open surface, they may be beyond its border as well.
  for (int i = 0; i < 3 && own.hasOnlyClosedStars(); ++i)
    any |=
        nearest.weights[i] != 0.0 && !behindOf(!isOfB && !pair.self(), nearest.vertices[i]).empty();
  const auto addAbove = [&](std::uint32_t edge, std::span<const std::uint32_t> triangles) {
    const auto borders = findEdgesAbove(
        pair, isOfB, edge, triangles, &outward,
        [&](std::uint32_t border, const Eigen::Vector3d& up, double length) {
          return isBorder(topology, border) && length > 0.0 && length <= -nearest.distance &&
                 up.dot(outward) >= kSameWayOut * length;
        });
    for (const Near& border : borders)
      addCrossed(pair, isOfB ? border.id : edge, isOfB ? edge : border.id, out);
    any |= !borders.empty();
  };
  const auto around = holdersOf(topology, featureOf(topology, nearest.triangle, nearest.feature));
  for (const Behind& crossing : crossings) {
    addAbove(crossing.edge, around);
    addAbove(crossing.edge, {&crossing.triangle, 1});
  }
  return any;
}

void PiercingContacts::addDepths(const MeshPair& pair, bool atStart, ContactBuffers& out) {
  for (auto first = m_behind.begin(); first != m_behind.end();) {
    const bool ofB = first->ofB;
    const std::uint32_t vertex = first->vertex;
    checkTime();
    NearestInFront nearest(pair, ofB, atStart, vertex);
    const auto begin = first;
    for (; first != m_behind.end() && first->ofB == ofB && first->vertex == vertex; ++first)
      if (first == begin || first->triangle != std::prev(first)->triangle)
        nearest.enter(first->triangle);
    nearest.walk();
    nearest.shorten({begin, first}, m_scratch);
    out.exactDecisions += nearest.exact();
    if (nearest.isBeyondBorder() &&
        (atStart || addBorders(pair, {begin, first}, nearest.contact(), nearest.outward(), out))) {
      out.beyondBorder.push_back({ofB, vertex, nearest.triangle(), nearest.outward()});
      continue;
    }
    if (!atStart) {
      if (rejectsVertex(pair, vertex, nearest.triangle(), ofB)) continue;
      const auto [a, b, c] = nearest.corners();
      out.facts.recordTriangle(pair, nearest.triangle(), !ofB, a, b, c);
    }
    const VertexTriangleContact contact = nearest.contact();
    (ofB ? out.triangleVertex : out.vertexTriangle).push_back(contact);
    if (atStart) continue;
    for (auto crossing = begin; crossing != first; ++crossing) {
      const Eigen::Vector3d& place = m_scratch.crossings[crossing - begin];
      const double depth = -contact.normal.dot(place) - contact.distance;
      if (depth > 0.0 && depth >= kDeepCrossing * -contact.distance)
        addRidge(pair, ofB, crossing->edge, {crossing->triangle}, &contact.normal, out,
                 [&](const Eigen::Vector3d& up, double length) {
                   return length <= kExitReach * depth &&
                          up.dot(contact.normal) >= kSameWayOut * length;
                 });
    }
  }
}

void PiercingContacts::findBehind(const MeshPair& pair, bool atStart, ContactBuffers& out) {
  TimeCheck check(64);
  SignCounts counts;
  m_behind.clear();
  for (auto first = m_crossings.begin(); first != m_crossings.end();) {
    check();
    const auto end = std::find_if(first, m_crossings.end(), [&](const EdgeCrossing& c) {
      return c.ofB != first->ofB || c.edge != first->edge;
    });
    const PlacedMesh mesh(first->ofB ? pair.b : pair.a, atStart);
    PALPATE_ASSERT(first->edge < mesh.topology.edges.size());
    const Segment& ends = mesh.topology.edges[first->edge];
    const int leaves = timesOfLeaving(first->ofB ? pair.a : pair.b, atStart, {first, end},
                                      mesh.at[ends[0]], mesh.at[ends[1]], counts);
    for (; first != end; ++first)
      if (leaves != 0 && first->lowerIsBehind == (leaves > 0))
        m_behind.push_back({first->ofB, ends[leaves < 0], first->triangle, first->edge});
  }
  out.exactDecisions += counts.undecided;
  sortInTime(m_behind.begin(), m_behind.end(), std::less<>());
  m_behind.erase(std::unique(m_behind.begin(), m_behind.end()), m_behind.end());
}

std::span<const PiercingContacts::Behind> PiercingContacts::behindOf(bool ofB,
                                                                     std::uint32_t vertex) const {
  const auto first = std::lower_bound(m_behind.begin(), m_behind.end(), Behind{ofB, vertex, 0, 0});
  return {first, std::find_if(first, m_behind.end(), [&](const Behind& behind) {
            return behind.ofB != ofB || behind.vertex != vertex;
          })};
}

bool PiercingContacts::isRepresented(const MeshPair& pair, const PiercedPair& pierced) const {
  const auto isByCorner = [&](bool ofB, std::uint32_t triangle, unsigned edges,
                              std::uint32_t pierces) {
    const TriangleMesh &own = ofB ? pair.b : pair.a, &surface = ofB ? pair.a : pair.b;
    const Triangle &corners = own.topology.elements[triangle],
                   &other = surface.topology.elements[pierces];
    for (int i = 0; i < 3; ++i) {
      const std::span<const Behind> behind = behindOf(ofB && !pair.self(), corners[i]);
      const bool isEnd = (edges >> i & 1) != 0 || (edges >> (i + 2) % 3 & 1) != 0;
      if (!behind.empty() &&
          (isEnd || std::any_of(behind.begin(), behind.end(), [&](const Behind& b) {
             const Triangle& crossed = surface.topology.elements[b.triangle];
             return std::any_of(crossed.begin(), crossed.end(),
                                [&](std::uint32_t v) { return containsVertex(other, v); });
           })))
        return true;
    }
    return false;
  };
  const auto& [a, b] = pierced.triangles;
  return isByCorner(false, a, pierced.edgesOfA, b) || isByCorner(true, b, pierced.edgesOfB, a);
}

std::span<const EdgeCrossing> PiercingContacts::crossingsOf(bool ofB, std::uint32_t edge) const {
  const auto first = std::partition_point(
      m_crossings.begin(), m_crossings.end(),
      [&](const EdgeCrossing& c) { return std::tie(c.ofB, c.edge) < std::tie(ofB, edge); });
  return {first, std::find_if(first, m_crossings.end(), [&](const EdgeCrossing& c) {
            return c.ofB != ofB || c.edge != edge;
          })};
}

/// Returns whether other contacts stand for the pair.
bool PiercingContacts::addBelow(const MeshPair& pair, const PiercedPair& pierced,
                                ContactBuffers& out) {
  bool any = false;
  /// here, there: where an edge leaves the surface and enters it.
  const auto addBetween = [&](bool ofB, const EdgeCrossing& here, const EdgeCrossing& there) {
    const PlacedMesh own(ofB ? pair.b : pair.a, false), surface(ofB ? pair.a : pair.b, false);
    const auto& elements = surface.topology.elements;
    for (const std::uint32_t v : elements[here.triangle])
      any |=
          containsVertex(elements[there.triangle], v) && !behindOf(!ofB && !pair.self(), v).empty();
    const std::uint32_t end = own.topology.edges[here.edge][0];
    const double apart = stableLength(crossingFrom(end, own, here.edge, surface, here.triangle) -
                                      crossingFrom(end, own, here.edge, surface, there.triangle));
    any |= addRidge(pair, ofB, here.edge, {here.triangle, there.triangle}, nullptr, out,
                    [&](const Eigen::Vector3d&, double length) { return length <= apart; });
  };
  const auto addOf = [&](bool ofB, std::uint32_t triangle, unsigned edges, std::uint32_t crossed) {
    for (int i = 0; i < 3; ++i) {
      if (!(edges >> i & 1)) continue;
      const std::uint32_t edge = (ofB ? pair.b : pair.a).topology.triangleEdges[triangle][i];
      const auto crossings = crossingsOf(ofB && !pair.self(), edge);
      for (const EdgeCrossing& here : crossings)
        for (const EdgeCrossing& there : crossings)
          if (here.triangle == crossed && there.lowerIsBehind != here.lowerIsBehind)
            addBetween(ofB, here, there);
    }
  };
  addOf(false, pierced.triangles.a, pierced.edgesOfA, pierced.triangles.b);
  addOf(true, pierced.triangles.b, pierced.edgesOfB, pierced.triangles.a);
  return any;
}

}  // namespace palpate
