#include "Tracking/SideMemory.h"

#include "Contact/Filters.h"
#include "NarrowPhase/Proximity.h"
#include "Contact/SmoothNormals.h"
#include "Contact/ContactLists.h"
#include "Math/ClosestPoint.h"
#include "Math/StableLength.h"
#include "Exact/Predicates.h"
#include "Core/Assert.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

namespace palpate {

namespace {

using Eigen::Vector3d;
using Side = SideMemory::Side;

bool isEdges(const Crossing& passage) { return passage.kind == ContactKind::EdgeEdge; }
Segment edgeA(const Crossing& passage) { return {passage.ids[0], passage.ids[1]}; }
Segment edgeB(const Crossing& passage) { return {passage.ids[2], passage.ids[3]}; }

bool comesBefore(const Side& l, const Side& r) {
  return std::tie(l.passage.kind, l.passage.ids) < std::tie(r.passage.kind, r.passage.ids);
}
bool areEqual(const Side& l, const Side& r) {
  return l.passage == r.passage && l.corners == r.corners;
}
void sortUnique(Buffer<Side>& sides) {
  std::sort(sides.begin(), sides.end(), comesBefore);
  sides.erase(std::unique(sides.begin(), sides.end(),
                          [](const Side& l, const Side& r) { return !comesBefore(l, r); }),
              sides.end());
}

}  // namespace

/// A vertex and a triangle: of which meshes they are, and by what ids of a passage.
struct SideMemory::VertexSide {
  VertexSide(const MeshPair& pair, ContactKind kind)
      : swapped(kind == ContactKind::TriangleVertex),
        vertices(swapped ? pair.b : pair.a),
        triangles(swapped ? pair.a : pair.b) {}
  std::uint32_t vertexOf(const Crossing& p) const { return p.ids[swapped]; }
  std::uint32_t triangleOf(const Crossing& p) const { return p.ids[!swapped]; }

  bool swapped;
  const TriangleMesh &vertices, &triangles;
};

namespace {

using VertexSide = SideMemory::VertexSide;

/// At an end of the step.
const Positions& at(const TriangleMesh& mesh, bool now) { return now ? mesh.now : mesh.before; }

VertexTriangleDistance distanceOf(const VertexSide& of, std::uint32_t vertex,
                                  const Triangle& corners, bool now) {
  const Positions& p = at(of.triangles, now);
  return finiteVertexTriangleDistance(at(of.vertices, now)[vertex], p[corners[0]], p[corners[1]],
                                      p[corners[2]]);
}

EdgeEdgeDistance distanceOf(const MeshPair& pair, const Segment& a, const Segment& b, bool now) {
  const Positions &p = at(pair.a, now), &q = at(pair.b, now);
  return finiteEdgeEdgeDistance(p[a[0]], p[a[1]], q[b[0]], q[b[1]]);
}

/// Whether features may still be a contact: they exist, are enabled, and no filter rejects them.
bool mayTouch(const MeshPair& pair, const VertexSide& of, std::uint32_t vertex,
              std::uint32_t triangle) {
  return of.triangles.topology.isEnabled(triangle) && !pair.excludesVertex(vertex, triangle) &&
         !rejectsVertex(pair, vertex, triangle, of.swapped);
}
bool mayTouch(const MeshPair& pair, const Segment& a, const Segment& b) {
  std::uint32_t p = pair.a.topology.edgeOf(a), q = pair.b.topology.edgeOf(b);
  if (p == kNoEdge || q == kNoEdge) return false;
  if (pair.self() && pair.a.topology.precedes(q, p)) std::swap(p, q);
  return !pair.a.topology.edgeTriangles[p].empty() && !pair.b.topology.edgeTriangles[q].empty() &&
         !pair.excludesEdges(p, q) && !rejectsEdges(pair, p, q);
}

/// Calls f(edge, isTurned) for the enabled edges that have a common vertex with this one. isTurned:
/// a path through both has one of them reversed.
template <class F>
void forEachNeighbour(const MeshTopology& topology, const Segment& edge, F&& f) {
  for (int end = 0; end < 2; ++end)
    for (const std::uint32_t t : topology.vertexTriangles[edge[end]])
      for (const std::uint32_t id : topology.triangleEdges[t]) {
        if (id == kNoEdge) continue;
        const Segment& other = topology.edges[id];
        if (other != edge && (other[0] == edge[end] || other[1] == edge[end]))
          f(other, other[end == 0] != edge[end]);
      }
}

/// Whether other is edge or has a common vertex with it; sets isTurned then.
bool isNear(const Segment& edge, const Segment& other, bool& isTurned) {
  isTurned = false;
  if (edge == other) return true;
  for (int end = 0; end < 2; ++end)
    for (int k = 0; k < 2; ++k)
      if (edge[end] == other[k]) return isTurned = end == k, true;
  return false;
}

bool hasFaces(const MeshPair& pair) {
  return pair.a.topology.hasFaces() || pair.b.topology.hasFaces();
}

/// Whether edge a passes forward where it passes to the side of the surface's normals, here at edge
/// b. None of two lines, or where no side is certain.
std::optional<bool> isForwardAlongNormal(const MeshPair& pair, bool now, const Segment& a,
                                         const Segment& b) {
  const bool ofB = pair.b.topology.hasFaces();
  const TriangleMesh& mesh = ofB ? pair.b : pair.a;
  if (!hasFaces(pair)) return {};
  const std::uint32_t edge = mesh.topology.edgeOf(ofB ? b : a);
  if (edge == kNoEdge) return {};
  Vector3d normal = Vector3d::Zero();
  const Positions &p = at(pair.a, now), &q = at(pair.b, now), &own = at(mesh, now);
  for (const std::uint32_t t : mesh.topology.edgeTriangles[edge]) {
    const auto& [i, j, k] = mesh.topology.elements[t];
    normal += windingNormal(own[i], own[j], own[k]);
  }
  const Vector3d along = (p[a[1]] - p[a[0]]).cross(q[b[1]] - q[b[0]]);
  const double side = along.dot(normal);
  constexpr double kClearly = 0.25;  // a cosine
  if (!(std::abs(side) > kClearly * along.norm() * normal.norm())) return {};
  return side > 0.0;
}

/// Whether a passage of these edges in the direction of `forward` is one of those edges forward.
/// isTurned: a path through both has one of them reversed.
bool forwardOf(const MeshPair& pair, bool now, const Crossing& passage, const Segment& a,
               const Segment& b, bool isTurned) {
  const std::optional<bool> here = isForwardAlongNormal(pair, now, edgeA(passage), edgeB(passage)),
                            there = isForwardAlongNormal(pair, now, a, b);
  if (here && there) return passage.forward == (*here == *there);
  return passage.forward != isTurned;
}

bool shareCorner(const Triangle& s, const Triangle& t) {
  return std::any_of(s.begin(), s.end(), [&](std::uint32_t v) { return containsVertex(t, v); });
}

/// Whether the exact side of the plane through the features is the one to which they passed.
bool isOn(bool forward, const Vector3d& a, const Vector3d& b, const Vector3d& c,
          const Vector3d& d) {
  SignCounts counts;
  const int sign = orient3d(a, b, c, d, counts);
  return sign == 0 || (sign > 0) == forward;
}

/// Below a flat surface the closest point moves as far as the vertex does beside it. Below a round
/// one it moves further, and from the centre on it runs ahead to the far wall of a closed body,
/// where a side must not follow it. A little above 1.
constexpr double kMostSliding = 1.25;

/// Slides a vertex along the surface, at the step's end, to the next triangle that is nearer to it.
/// Returns whether there is one. The closest points of both triangles may be `farthest` apart, from
/// which their distance is then taken.
bool slideVertex(const MeshPair& pair, Side& side, double& farthest) {
  const VertexSide of(pair, side.passage.kind);
  const MeshTopology& topology = of.triangles.topology;
  const std::uint32_t vertex = of.vertexOf(side.passage);
  PALPATE_ASSERT(topology.elements[of.triangleOf(side.passage)] == side.corners);
  const VertexTriangleDistance here = distanceOf(of, vertex, side.corners, true);
  double least = here.distance, way = 0.0;
  std::uint32_t nearest = kNoElement;
  for (const std::uint32_t corner : side.corners)
    for (const std::uint32_t t : topology.vertexTriangles[corner]) {
      const VertexTriangleDistance there = distanceOf(of, vertex, topology.elements[t], true);
      if (!(there.distance < least)) continue;
      const double apart = stableLength(there.difference - here.difference);
      if (!(apart <= farthest) || !mayTouch(pair, of, vertex, t)) continue;
      least = there.distance;
      way = apart;
      nearest = t;
    }
  if (nearest == kNoElement) return false;
  farthest -= way;
  side.passage.ids[!of.swapped] = nearest;
  side.corners = topology.elements[nearest];
  return true;
}

/// How far a side may slide in the step: kMostSliding times the motion of the vertex across the
/// direction that its closest point had at the step's start.
double farthestSlide(const MeshPair& pair, const Side& side) {
  const VertexSide of(pair, side.passage.kind);
  const std::uint32_t vertex = of.vertexOf(side.passage);
  const VertexTriangleDistance at = distanceOf(of, vertex, side.corners, false);
  Vector3d moved = of.vertices.now[vertex] - of.vertices.before[vertex];
  for (int i = 0; i < 3; ++i)
    moved -=
        at.weights[i] * (of.triangles.now[side.corners[i]] - of.triangles.before[side.corners[i]]);
  return kMostSliding * stableLength(moved - moved.dot(at.normal) * at.normal);
}

/// The same for two edges, one of which slides on.
bool slideEdges(const MeshPair& pair, bool now, Side& side) {
  const Segment a = edgeA(side.passage), b = edgeB(side.passage);
  double least = distanceOf(pair, a, b, now).distance;
  Crossing nearest = side.passage;
  const auto offer = [&](const Segment& nextA, const Segment& nextB, bool isTurned) {
    const double distance = distanceOf(pair, nextA, nextB, now).distance;
    if (!(distance < least) || !mayTouch(pair, nextA, nextB)) return;
    const bool forward = forwardOf(pair, now, side.passage, nextA, nextB, isTurned);
    // An edge that pierces a surface is nearest where it has not passed, or along the surface.
    const Positions &p = at(pair.a, now), &q = at(pair.b, now);
    if (hasFaces(pair) && (!isForwardAlongNormal(pair, now, nextA, nextB) ||
                           !isOn(forward, p[nextA[0]], p[nextA[1]], q[nextB[0]], q[nextB[1]])))
      return;
    least = distance;
    nearest.ids = {nextA[0], nextA[1], nextB[0], nextB[1]};
    nearest.forward = forward;
  };
  forEachNeighbour(pair.a.topology, a, [&](const Segment& e, bool turned) { offer(e, b, turned); });
  forEachNeighbour(pair.b.topology, b, [&](const Segment& e, bool turned) { offer(a, e, turned); });
  if (nearest == side.passage) return false;
  if (pair.self() && edgeB(nearest) < edgeA(nearest))  // the same side of both
    nearest.ids = {nearest.ids[2], nearest.ids[3], nearest.ids[0], nearest.ids[1]};
  side.passage = nearest;
  return true;
}

/// Whether a point of the feature has the surface on all sides of it, or the line on both.
bool isInside(const MeshTopology& topology, const MeshFeature& feature) {
  if (feature.kind == MeshFeature::Kind::Face) return true;
  if (feature.kind == MeshFeature::Kind::Vertex)
    return topology.hasFaces() ? topology.hasClosedStar[feature.id] != 0
                               : topology.vertexTriangles[feature.id].size() > 1;
  return !topology.hasFaces() || topology.edgeTriangles[feature.id].size() == 2;
}

/// Finds a triangle with these corners, whatever its index is now. Returns whether there is one.
bool findTriangle(const MeshTopology& topology, const Triangle& corners, std::uint32_t& triangle) {
  if (triangle < topology.elements.size() && topology.elements[triangle] == corners) return true;
  if (corners[0] >= topology.vertexCount) return false;
  for (const std::uint32_t t : topology.vertexTriangles[corners[0]])
    if (topology.elements[t] == corners) return triangle = t, true;
  return false;
}

/// Finds the features of a side. Returns whether both are there.
bool findFeatures(const MeshPair& pair, Side& side) {
  if (isEdges(side.passage))
    return pair.a.topology.edgeOf(edgeA(side.passage)) != kNoEdge &&
           pair.b.topology.edgeOf(edgeB(side.passage)) != kNoEdge;
  const VertexSide of(pair, side.passage.kind);
  const std::uint32_t vertex = of.vertexOf(side.passage);
  return vertex < of.vertices.topology.vertexCount &&
         !of.vertices.topology.vertexTriangles[vertex].empty() &&
         findTriangle(of.triangles.topology, side.corners, side.passage.ids[!of.swapped]);
}

/// Brings a side to the positions at the step's start. Returns whether it lasts.
bool locateVertex(const MeshPair& pair, Side& side) {
  const VertexSide of(pair, side.passage.kind);
  const std::uint32_t vertex = of.vertexOf(side.passage);
  if (!findFeatures(pair, side) || !mayTouch(pair, of, vertex, of.triangleOf(side.passage)))
    return false;
  const VertexTriangleDistance measured = distanceOf(of, vertex, side.corners, false);
  const MeshFeature feature =
      featureOf(of.triangles.topology, of.triangleOf(side.passage), measured.feature);
  if (feature.kind != MeshFeature::Kind::Face)
    return isInside(of.triangles.topology, feature) &&
           (measured.distance == 0.0 ||
            liesBelow(of.triangles, feature, measured.difference, 0.0) != side.passage.forward);
  const Positions& p = of.triangles.before;
  const auto& [a, b, c] = side.corners;
  return isOn(side.passage.forward, p[a], p[b], p[c], of.vertices.before[vertex]);
}

bool locateEdges(const MeshPair& pair, Side& side) {
  if (!mayTouch(pair, edgeA(side.passage), edgeB(side.passage))) return false;
  while (slideEdges(pair, false, side)) {
  }
  const Segment a = edgeA(side.passage), b = edgeB(side.passage);
  const MeshTopology &ofA = pair.a.topology, &ofB = pair.b.topology;
  const EdgeEdgeDistance measured = distanceOf(pair, a, b, false);
  const MeshFeature onA = featureOf(ofA, ofA.edgeOf(a), measured.featureA),
                    onB = featureOf(ofB, ofB.edgeOf(b), measured.featureB);
  constexpr auto kVertex = MeshFeature::Kind::Vertex;
  if (onA.kind == kVertex || onB.kind == kVertex)
    return (onA.kind != kVertex || isInside(ofA, onA)) &&
           (onB.kind != kVertex || isInside(ofB, onB));
  const Positions &p = pair.a.before, &q = pair.b.before;
  return isOn(side.passage.forward, p[a[0]], p[a[1]], q[b[0]], q[b[1]]);
}

/// The contacts of a remembered side: at the step's start, with the normal that leads back.
VertexTriangleContact contactOfVertex(const MeshPair& pair, const Side& side) {
  const VertexSide of(pair, side.passage.kind);
  const std::uint32_t vertex = of.vertexOf(side.passage);
  VertexTriangleDistance measured = distanceOf(of, vertex, side.corners, false);
  if (measured.feature == TriangleFeature::Face || measured.distance == 0.0) {
    const Positions& p = of.triangles.before;
    const auto& [a, b, c] = side.corners;
    measured.normal = windingNormal(p[a], p[b], p[c]);
    if (!side.passage.forward) measured.normal = -measured.normal;
  }
  VertexTriangleContact contact =
      contactOf(vertex, of.triangleOf(side.passage), side.corners, measured, 0.0);
  turn(contact);
  contact.distance -= pair.a.largestRadius + pair.b.largestRadius;
  return contact;
}

EdgeEdgeContact contactOfEdges(const MeshPair& pair, const Side& side) {
  const Segment a = edgeA(side.passage), b = edgeB(side.passage);
  EdgeEdgeDistance measured = distanceOf(pair, a, b, false);
  const bool areInteriors =
      measured.featureA == EdgeFeature::Interior && measured.featureB == EdgeFeature::Interior;
  if ((areInteriors || measured.distance == 0.0) && !measured.parallel) {
    const Positions &p = pair.a.before, &q = pair.b.before;
    measured.normal = normalOfCrossing(p[a[0]], p[a[1]], q[b[0]], q[b[1]]);
    if (!side.passage.forward) measured.normal = -measured.normal;
  }
  EdgeEdgeContact contact = contactOf(a, b, measured, 0.0);
  turn(contact);
  contact.distance -= pair.a.largestRadius + pair.b.largestRadius;
  return contact;
}

template <class Contact>
void insert(CountedVector<Contact>& contacts, ContactKind kind, const Contact& contact) {
  const ContactKey key = keyOf(kind, contact);
  const auto place =
      std::lower_bound(contacts.begin(), contacts.end(), key,
                       [&](const Contact& l, const ContactKey& r) { return keyOf(kind, l) < r; });
  PALPATE_ASSERT(place == contacts.end() || keyOf(kind, *place) != key);
  contacts.insert(place, contact);
}

}  // namespace

void SideMemory::startStep(std::uint64_t step) noexcept {
  if (std::exchange(m_step, step) == step) return;
  if (std::ranges::equal(m_start, m_end, areEqual)) return;
  m_start.swap(m_end);
  ++m_version;
}

void SideMemory::set(std::uint64_t step, std::span<const Side> sides) {
  m_start.assign(sides.begin(), sides.end());
  sortUnique(m_start);
  m_step = step;
  ++m_version;
}

void SideMemory::followNone() noexcept {
  m_next.clear();
  m_here.clear();
  m_courses.clear();
}

/// The list with the courses of a vertex, or of all edges.
std::size_t SideMemory::listOf(const Crossing& features) const {
  PALPATE_ASSERT(!m_heads.empty() && features.kind <= ContactKind::EdgeEdge);
  if (isEdges(features)) return m_heads.size() - 1;
  const bool ofB = features.kind == ContactKind::TriangleVertex;
  return (std::size_t{2} * features.ids[ofB] + ofB) & (m_heads.size() - 2);
}

/// Whether f(index of a course) is true for any course of the vertex, or of edges.
template <class F>
bool SideMemory::anyCourse(const Crossing& features, F&& f) const {
  const bool ofB = features.kind == ContactKind::TriangleVertex;
  for (std::uint32_t i = m_heads[listOf(features)]; i != kNoElement; i = m_courses[i].next) {
    const Crossing& own = m_courses[i].side.passage;
    if (own.kind == features.kind && (isEdges(own) || own.ids[ofB] == features.ids[ofB]) && f(i))
      return true;
  }
  return false;
}

/// The side to which a vertex had passed when the step began; null if it had not. kind: of vertices
/// of its mesh.
const Side* SideMemory::sideOf(ContactKind kind, std::uint32_t vertex) const {
  const Side* side = nullptr;
  anyCourse({kind, {vertex, vertex}}, [&](std::uint32_t i) {
    if (i < m_here.size()) side = &m_here[i];
    return side != nullptr;
  });
  return side;
}

/// The side to which vertices with weight had passed; none if they had not, or to both sides.
SideMemory::PartSide SideMemory::sideOf(const MeshPair& pair, ContactKind kind,
                                        const Part& part) const {
  PartSide found{{}, true, Vector3d::Zero()};
  const Positions& p = VertexSide(pair, kind).triangles.before;
  for (std::size_t i = 0; i < part.size; ++i) {
    if (part.weights[i] == 0.0) continue;
    const Side* const side = sideOf(kind, part.vertices[i]);
    found.isWhole &= side != nullptr;
    if (!side) continue;
    const bool forward = side->passage.forward;
    if (found.forward.value_or(forward) != forward) return {{}, false, Vector3d::Zero()};
    found.forward = forward;
    const auto& [a, b, c] = side->corners;
    found.back += (forward ? -1.0 : 1.0) * part.weights[i] * windingNormal(p[a], p[b], p[c]);
  }
  return found;
}

/// Turns contacts of elements all of whose vertices had passed through the other mesh. Not where
/// they are clearly on the side from which they came: this is another fold of the surface. And not
/// where they clearly lead the way back already: this is the far wall of a body. Elements
/// of which some vertices had passed pierce the surface; those of their contacts that lead
/// these vertices further behind it are removed.
void SideMemory::turnPassed(const MeshPair& pair, Contents& contents) const {
  constexpr double kClearly = 0.5;  // a cosine; directions along the surface are on no side
  constexpr ContactKind kOfA = ContactKind::VertexTriangle, kOfB = ContactKind::TriangleVertex;
  enum class Change { None, Turned, Removed };
  // part: of MeshPair::b or a; onSurface: of the other mesh. toA: from b to a.
  const auto changeOf = [&](const Part& part, const Part& onSurface, bool ofB, const Vector3d& toA,
                            double time) {
    const PartSide side = sideOf(pair, ofB ? kOfB : kOfA, part);
    if (!side.forward) return Change::None;
    const Vector3d normal =
        interpolatedNormal(ofB ? pair.a : pair.b, onSurface.ids(), onSurface.weights.data(), time);
    const Vector3d direction = ofB ? Vector3d(-toA) : toA;
    const double back = (*side.forward ? -1.0 : 1.0) * direction.dot(normal);
    const bool isFarWall = direction.dot(side.back) > kClearly * side.back.norm();
    if (side.isWhole) return back < kClearly && !isFarWall ? Change::Turned : Change::None;
    return back < 0.0 ? Change::Removed : Change::None;
  };
  const auto changeOfContact = [&](ContactKind kind, const auto& contact) {
    std::array<Part, 2> parts;
    const Stencil all = stencil(contact);
    const auto sides = sidesOf(kind);
    for (std::size_t i = 0; i < 4; ++i)
      parts[sides[i]].add(all.vertices[i], std::abs(all.weights[i]));
    const bool swapped = sides[0] == 1;
    const Vector3d toA = swapped ? Vector3d(-contact.normal) : contact.normal;
    const Change ofA = changeOf(parts[0], parts[1], false, toA, contact.timeOfImpact),
                 ofB = changeOf(parts[1], parts[0], true, toA, contact.timeOfImpact);
    if (ofA == Change::Turned || ofB == Change::Turned) return Change::Turned;
    return ofA == Change::None ? ofB : ofA;
  };
  forEachMeshList(contents, [&](ContactKind kind, auto& contacts) {
    std::erase_if(contacts, [&](const auto& contact) {
      return changeOfContact(kind, contact) == Change::Removed;
    });
    for (auto& contact : contacts) {
      if (changeOfContact(kind, contact) != Change::Turned) continue;
      turn(contact);
      contact.distance -= 2.0 * (pair.a.largestRadius + pair.b.largestRadius);
    }
  });
}

/// Whether features are among those along which a side of the same vertex, or of edges, slides, or
/// next to them. isSame: receives whether the passage has the direction in which the side passed.
bool SideMemory::contains(const MeshPair& pair, const Course& course, const Side& features,
                          bool* isSame) const {
  const Crossing& passage = features.passage;
  const std::size_t end = course.first + course.count;
  PALPATE_ASSERT(course.count > 0 && end <= m_visited.size());
  for (std::size_t i = course.first; i < end; ++i) {
    const auto& [visited, corners] = m_visited[i];
    bool isTurnedA = false, isTurnedB = false;
    if (isEdges(passage) ? !isNear(edgeA(visited), edgeA(passage), isTurnedA) ||
                               !isNear(edgeB(visited), edgeB(passage), isTurnedB)
                         : !shareCorner(corners, features.corners))
      continue;
    if (isSame)
      *isSame = isEdges(passage)
                    ? passage.forward == forwardOf(pair, true, visited, edgeA(passage),
                                                   edgeB(passage), isTurnedA != isTurnedB)
                    : visited.forward == passage.forward;
    return true;
  }
  return false;
}

void SideMemory::add(const MeshPair& pair, const Side& side, double time) {
  Course course{side, time, true, m_visited.size(), 0, kNoElement};
  double farthest = isEdges(side.passage) ? 0.0 : farthestSlide(pair, side);
  do m_visited.push_back(course.side);
  while (isEdges(side.passage) ? slideEdges(pair, true, course.side)
                               : slideVertex(pair, course.side, farthest));
  course.count = m_visited.size() - course.first;
  course.next =
      std::exchange(m_heads[listOf(side.passage)], static_cast<std::uint32_t>(m_courses.size()));
  m_courses.push_back(course);
}

/// A passage undoes that of a side next to it in the other direction. One in the same direction is
/// the same passage, through a common edge or vertex.
void SideMemory::take(const MeshPair& pair, const Crossing& passage) {
  PALPATE_ASSERT(passage.kind <= ContactKind::EdgeEdge);
  Side side{passage, {}};
  side.passage.time = 0.0;
  if (!isEdges(passage)) {
    const VertexSide of(pair, passage.kind);
    side.corners = of.triangles.topology.elements[of.triangleOf(passage)];
  }
  bool isKnown = false, isSame = false;
  anyCourse(passage, [&](std::uint32_t i) {
    if (contains(pair, m_courses[i], side, &isSame)) {
      m_courses[i].hasPassed = isSame;
      isKnown = true;
    }
    return false;
  });
  if (isKnown || (isEdges(passage) && hasPassedEnd(passage))) return;
  add(pair, side, passage.time);
}

/// Whether an end of an edge passes through the surface of the other one. The edge then pierces the
/// surface, and its passages through edges only move the place.
bool SideMemory::hasPassedEnd(const Crossing& passage) const {
  const auto passes = [&](ContactKind kind, std::uint32_t vertex) {
    return anyCourse({kind, {vertex, vertex}}, [](std::uint32_t) { return true; });
  };
  const auto& [p, q, r, s] = passage.ids;
  return passes(ContactKind::VertexTriangle, p) || passes(ContactKind::VertexTriangle, q) ||
         passes(m_ofSecond, r) || passes(m_ofSecond, s);
}

/// Whether a vertex passed into a body and out of it elsewhere, and vertices of the body passed the
/// vertex' surface there. What these remember leads both back; the sides of the vertex would lead
/// it into the body.
bool SideMemory::isOfPassedBody(const MeshPair& pair, const Course& course) const {
  const Crossing& passage = course.side.passage;
  if (isEdges(passage) || pair.self()) return false;
  const ContactKind ofBody = passage.kind == ContactKind::VertexTriangle
                                 ? ContactKind::TriangleVertex
                                 : ContactKind::VertexTriangle;
  const auto havePassed = [&](const Course& through) {
    const Triangle& corners = m_visited[through.first].corners;
    return std::any_of(corners.begin(), corners.end(), [&](std::uint32_t v) {
      return anyCourse({ofBody, {v, v}}, [](std::uint32_t) { return true; });
    });
  };
  return anyCourse(passage, [&](std::uint32_t i) {
    const Course& other = m_courses[i];
    return other.hasPassed && other.side.passage.forward != passage.forward &&
           (havePassed(course) || havePassed(other));
  });
}

void SideMemory::follow(const MeshPair& pair, std::span<const Crossing> passages) {
  m_here.clear();
  m_courses.clear();
  m_visited.clear();
  for (Side side : m_start)
    if (isEdges(side.passage) ? locateEdges(pair, side) : locateVertex(pair, side))
      m_here.push_back(side);
  sortUnique(m_here);
  m_ofSecond = pair.self() ? ContactKind::VertexTriangle : ContactKind::TriangleVertex;
  m_heads.assign(std::bit_ceil(m_here.size() + passages.size() + 1) + 1, kNoElement);
  for (const Side& side : m_here) add(pair, side, 0.0);
  // Those of vertices first, each kind in the order of time.
  m_order.resize(passages.size());
  std::iota(m_order.begin(), m_order.end(), 0u);
  std::sort(m_order.begin(), m_order.end(), [&](std::uint32_t l, std::uint32_t r) {
    const auto keyOf = [&](std::uint32_t i) {
      return std::tuple(isEdges(passages[i]), passages[i].time, i);
    };
    return keyOf(l) < keyOf(r);
  });
  for (const std::uint32_t i : m_order) take(pair, passages[i]);
  m_next.clear();
  m_searches.clear();
  for (std::uint32_t i = 0; i < m_courses.size(); ++i)
    if (isEdges(m_courses[i].side.passage) ? hasFaces(pair) : !m_courses[i].hasPassed)
      searchHooked(pair, i);
    else if (m_courses[i].hasPassed && !isOfPassedBody(pair, m_courses[i]))
      m_next.push_back(m_courses[i].side);
  std::sort(m_searches.begin(), m_searches.end());
  for (std::size_t i = 0; i < m_searches.size(); ++i)
    if (i == 0 || m_searches[i].kind != m_searches[i - 1].kind ||
        m_searches[i].edge != m_searches[i - 1].edge)
      addHooked(pair, m_searches[i]);
  sortUnique(m_next);
}

/// A vertex has returned, or edges have passed. An edge is hooked if its ends have not passed, are
/// on one side of the surface, and it pierces the surface. It may have passed while an end of it
/// was behind the surface; the places at which it pierces tell where.
void SideMemory::searchHooked(const MeshPair& pair, std::uint32_t course) {
  const Crossing& passage = m_courses[course].side.passage;
  if (isEdges(passage)) {
    if (pair.b.topology.hasFaces())
      m_searches.push_back({ContactKind::VertexTriangle, edgeA(passage), course});
    if (pair.a.topology.hasFaces()) m_searches.push_back({m_ofSecond, edgeB(passage), course});
    return;
  }
  const VertexSide of(pair, passage.kind);
  const MeshTopology& topology = of.vertices.topology;
  const std::uint32_t vertex = of.vertexOf(passage);
  for (const std::uint32_t element : topology.vertexTriangles[vertex])
    for (const std::uint32_t id : topology.triangleEdges[element]) {
      // Each edge once: by the first of its elements.
      if (id == kNoEdge || topology.edgeTriangles[id][0] != element) continue;
      const Segment& edge = topology.edges[id];
      if (edge[0] == vertex || edge[1] == vertex)
        m_searches.push_back({passage.kind, edge, course});
    }
}

/// Searches the surface around the places of the course, as far as the edge is long.
void SideMemory::addHooked(const MeshPair& pair, const HookSearch& search) {
  const auto& [kind, edge, index] = search;
  const Course& course = m_courses[index];
  for (const std::uint32_t end : edge)
    if (anyCourse({kind, {end, end}}, [&](std::uint32_t i) { return m_courses[i].hasPassed; }))
      return;
  const VertexSide of(pair, kind);
  const MeshTopology& topology = of.triangles.topology;
  const Positions& at = of.triangles.now;
  const Vector3d &p = of.vertices.now[edge[0]], &q = of.vertices.now[edge[1]];
  const Vector3d along = q - p, lower = p.cwiseMin(q), upper = p.cwiseMax(q);
  const double reach = along.norm();
  const auto isInReach = [&](const Triangle& t) {
    const Vector3d &a = at[t[0]], &b = at[t[1]], &c = at[t[2]];
    return ((a.cwiseMin(b).cwiseMin(c) - upper).array() <= reach).all() &&
           ((lower - a.cwiseMax(b).cwiseMax(c)).array() <= reach).all();
  };
  m_searched.resize(std::max(m_searched.size(), topology.elements.size()), 0);
  ++m_search;
  m_region.clear();
  const auto visit = [&](std::uint32_t triangle) {
    if (std::exchange(m_searched[triangle], m_search) == m_search) return;
    if (isInReach(topology.elements[triangle])) m_region.push_back(triangle);
  };
  for (std::size_t i = course.first; i < course.first + course.count; ++i) {
    const Crossing& passage = m_visited[i].passage;
    if (!isEdges(passage)) {
      visit(of.triangleOf(passage));
      continue;
    }
    for (const std::uint32_t vertex :
         of.swapped || (pair.self() && edge == edgeB(passage)) ? edgeA(passage) : edgeB(passage))
      for (const std::uint32_t triangle : topology.vertexTriangles[vertex]) visit(triangle);
  }
  SignCounts counts;
  m_pierced.clear();
  for (std::size_t next = 0; next < m_region.size(); ++next) {
    const std::uint32_t triangle = m_region[next];
    const Triangle& t = topology.elements[triangle];
    for (const std::uint32_t corner : t)
      for (const std::uint32_t neighbour : topology.vertexTriangles[corner]) visit(neighbour);
    if (pair.self() && (containsVertex(t, edge[0]) || containsVertex(t, edge[1]))) continue;
    const Vector3d &a = at[t[0]], &b = at[t[1]], &c = at[t[2]];
    const int side = orient3d(a, b, c, q, counts);
    if (side == 0 || orient3d(a, b, c, p, counts) != -side) continue;
    if (side * orient3d(p, q, a, b, counts) < 0 || side * orient3d(p, q, b, c, counts) < 0 ||
        side * orient3d(p, q, c, a, counts) < 0)
      continue;
    const Vector3d normal = (b - a).cross(c - a);
    m_pierced.push_back({normal.dot(a - p) / normal.dot(along), triangle, side});
  }
  std::sort(m_pierced.begin(), m_pierced.end());
  if (m_pierced.empty() || m_pierced.front().side == m_pierced.back().side) return;
  // Between the first place and the last one, the edge is on the side to which it passed.
  for (const Pierced& pierced : m_pierced)
    addHooked(pair, of, edge, pierced, pierced.side == m_pierced.front().side ? 1.0 : -1.0);
}

/// From where an edge pierces a triangle, it leads on past one of the triangle's edges, which it
/// has passed. direction: 1 towards the edge's second end, or -1.
void SideMemory::addHooked(const MeshPair& pair, const VertexSide& of, const Segment& edge,
                           const Pierced& pierced, double direction) {
  const MeshTopology& topology = of.triangles.topology;
  const Triangle& t = topology.elements[pierced.triangle];
  const Positions& at = of.triangles.now;
  const Vector3d &p = of.vertices.now[edge[0]], &q = of.vertices.now[edge[1]];
  const Vector3d along = direction * (q - p), place = p + pierced.place * (q - p),
                 normal = (at[t[1]] - at[t[0]]).cross(at[t[2]] - at[t[0]]);
  SignCounts counts;
  double least = std::numeric_limits<double>::infinity();
  std::size_t nearest = 3;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3d &first = at[t[k]], &second = at[t[(k + 1) % 3]];
    const Vector3d inward = normal.cross(second - first);
    const double distance = inward.dot(place - first), speed = -inward.dot(along);
    if (!(speed > 0.0) || !(distance < least * speed)) continue;
    if (orient3d(p, q, first, second, counts) == 0) continue;
    least = distance / speed;
    nearest = k;
  }
  if (nearest == 3) return;
  Segment ofA = edge, ofB = topology.edges[topology.triangleEdges[pierced.triangle][nearest]];
  if (of.swapped || (pair.self() && ofB < ofA)) std::swap(ofA, ofB);
  if (!mayTouch(pair, ofA, ofB)) return;
  const Positions &x = pair.a.now, &y = pair.b.now;
  const bool passed = orient3d(x[ofA[0]], x[ofA[1]], y[ofB[0]], y[ofB[1]], counts) > 0;
  m_next.push_back({{ContactKind::EdgeEdge, {ofA[0], ofA[1], ofB[0], ofB[1]}, 0.0, passed}, {}});
}

void SideMemory::apply(const MeshPair& pair, Contents& contents) const {
  contents.rememberedSides.clear();
  for (const Side& side : m_here) contents.rememberedSides.push_back(side.passage);
  if (m_courses.empty()) return;
  // What had passed when the step began has the contacts below instead. What passes within the step
  // keeps that of the features through which it passes, and those before.
  const auto isReplaced = [&](const Side& features, double time) {
    return anyCourse(features.passage, [&](std::uint32_t i) {
      const Course& course = m_courses[i];
      const bool isLater = course.hasPassed && time > course.time &&
                           m_visited[course.first].passage.ids != features.passage.ids;
      return (i < m_here.size() || isLater) && contains(pair, course, features);
    });
  };
  forEachMeshList(contents, [&](ContactKind kind, auto& contacts) {
    std::erase_if(contacts, [&](const auto& contact) {
      return isReplaced({{kind, keyOf(kind, contact).ids}, cornersOf(contact)},
                        contact.timeOfImpact);
    });
  });
  if (!pair.self()) turnPassed(pair, contents);
  for (const Side& side : m_here)
    forEachMeshList(contents, [&](auto kind, auto& contacts) {
      if (side.passage.kind != kind) return;
      if constexpr (kind == ContactKind::EdgeEdge)
        insert(contacts, kind, contactOfEdges(pair, side));
      else
        insert(contacts, kind, contactOfVertex(pair, side));
    });
}

std::vector<Crossing> SideMemory::list(const MeshPair& pair, std::uint64_t step) const {
  std::vector<Crossing> all;
  for (Side side : step == m_step ? m_start : m_end)
    if (findFeatures(pair, side)) all.push_back(side.passage);
  return all;
}

void SideMemory::releaseMemory() {
  for (auto* list : {&m_start, &m_end, &m_here}) releaseSpare(*list);
  m_next = {};
  m_courses = {};
  m_visited = {};
  m_heads = {};
  m_order = {};
  m_region = {};
  m_searched = {};
  m_searches = {};
  m_pierced = {};
}

}  // namespace palpate
