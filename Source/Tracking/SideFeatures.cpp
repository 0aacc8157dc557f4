#include "Tracking/SideFeatures.h"

#include "Contact/Filters.h"
#include "NarrowPhase/Proximity.h"
#include "Contact/SmoothNormals.h"
#include "Math/StableLength.h"
#include "Exact/Predicates.h"
#include "Core/Assert.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

namespace {

bool comesBefore(const PassedSide& l, const PassedSide& r) {
  return std::tie(l.passage.kind, l.passage.ids) < std::tie(r.passage.kind, r.passage.ids);
}

/// At an end of the step.
const Positions& at(const TriangleMesh& mesh, bool now) { return now ? mesh.now : mesh.before; }

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

/// Brings a side to the positions at the step's start. Returns whether it lasts.
bool locateVertex(const MeshPair& pair, PassedSide& side) {
  const VertexSide of(pair, side.passage.kind);
  const std::uint32_t vertex = of.vertexOf(side.passage);
  if (!isThere(pair, side)) return false;
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

bool locateEdges(const MeshPair& pair, PassedSide& side) {
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

}  // namespace

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

bool forwardOf(const MeshPair& pair, bool now, const Crossing& passage, const Segment& a,
               const Segment& b, bool isTurned) {
  const std::optional<bool> here = isForwardAlongNormal(pair, now, edgeA(passage), edgeB(passage)),
                            there = isForwardAlongNormal(pair, now, a, b);
  if (here && there) return passage.forward == (*here == *there);
  return passage.forward != isTurned;
}

bool slideVertex(const MeshPair& pair, PassedSide& side, double& farthest) {
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

double farthestSlide(const MeshPair& pair, const PassedSide& side) {
  const VertexSide of(pair, side.passage.kind);
  const std::uint32_t vertex = of.vertexOf(side.passage);
  const VertexTriangleDistance at = distanceOf(of, vertex, side.corners, false);
  Vector3d moved = of.vertices.now[vertex] - of.vertices.before[vertex];
  for (int i = 0; i < 3; ++i)
    moved -=
        at.weights[i] * (of.triangles.now[side.corners[i]] - of.triangles.before[side.corners[i]]);
  return kMostSliding * stableLength(moved - moved.dot(at.normal) * at.normal);
}

bool slideEdges(const MeshPair& pair, bool now, PassedSide& side) {
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

bool findFeatures(const MeshPair& pair, PassedSide& side) {
  if (isEdges(side.passage))
    return pair.a.topology.edgeOf(edgeA(side.passage)) != kNoEdge &&
           pair.b.topology.edgeOf(edgeB(side.passage)) != kNoEdge;
  const VertexSide of(pair, side.passage.kind);
  const std::uint32_t vertex = of.vertexOf(side.passage);
  return vertex < of.vertices.topology.vertexCount &&
         !of.vertices.topology.vertexTriangles[vertex].empty() &&
         findTriangle(of.triangles.topology, side.corners, side.passage.ids[!of.swapped]);
}

bool isThere(const MeshPair& pair, PassedSide& side) {
  const VertexSide of(pair, side.passage.kind);
  return findFeatures(pair, side) &&
         mayTouch(pair, of, of.vertexOf(side.passage), of.triangleOf(side.passage));
}

void sortUnique(Buffer<PassedSide>& sides) {
  std::sort(sides.begin(), sides.end(), comesBefore);
  auto last = sides.begin();
  for (auto first = sides.begin(); first != sides.end();) {
    const auto end = std::upper_bound(first, sides.end(), *first, comesBefore);
    const auto forward =
        std::count_if(first, end, [](const PassedSide& side) { return side.passage.forward; });
    const auto most = 2 * forward - (end - first);
    const auto kept =
        isEdges(first->passage) ? first : std::find_if(first, end, [&](const PassedSide& side) {
          return side.passage.forward ? most > 0 : most < 0;
        });
    if (kept != end) *last++ = *kept;
    first = end;
  }
  sides.erase(last, sides.end());
}

bool locate(const MeshPair& pair, PassedSide& side) {
  return isEdges(side.passage) ? locateEdges(pair, side) : locateVertex(pair, side);
}

}  // namespace palpate
