#include "Queries/BodyOverlap.h"

#include "Mesh/Corners.h"
#include "Math/ClosestPoint.h"
#include "Math/StableLength.h"
#include "Math/Tolerances.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace palpate {

using Eigen::Vector3d;

namespace {

/// The mean of the points at which features of two triangles touch. It is between them, and so in
/// the middle of what the triangles share.
Vector3d commonPoint(const BodyPair::IntersectingTriangles& both) {
  Vector3d sum = Vector3d::Zero();
  double count = 0;
  const auto add = [&](const Vector3d& p) {
    sum += p;
    ++count;
  };
  for (std::size_t i = 0; i < 3; ++i) {
    if (both.found.cornersOfAOnB >> i & 1) add(both.a[i]);
    if (both.found.cornersOfBOnA >> i & 1) add(both.b[i]);
    for (std::size_t j = 0; j < 3; ++j)
      if (both.found.touchingEdges &
          TriangleIntersection::edgesBit(static_cast<int>(i), static_cast<int>(j))) {
        const EdgeEdgeDistance at =
            finiteEdgeEdgeDistance(both.a[i], both.a[(i + 1) % 3], both.b[j], both.b[(j + 1) % 3]);
        add((1.0 - at.weightA) * both.a[i] + at.weightA * both.a[(i + 1) % 3]);
      }
  }
  return sum / count;
}

/// Whether a point beside p, behind the faces of both triangles, is inside both bodies.
bool overlapBeside(const BodyPair& pair, const Vector3d& p,
                   const BodyPair::IntersectingTriangles& both) {
  const Vector3d normalA = windingNormal(both.a[0], both.a[1], both.a[2]),
                 normalB = windingNormal(both.b[0], both.b[1], both.b[2]);
  const double size =
      std::min(stableLength(both.a[1] - both.a[0]), stableLength(both.b[1] - both.b[0]));
  const Vector3d middleA = (both.a[0] + both.a[1]) + both.a[2],
                 middleB = (both.b[0] + both.b[1]) + both.b[2];
  const std::array<Vector3d, 4> directions{-normalA - normalB, normalA + normalB, normalB - normalA,
                                           normalA - normalB};
  for (const double share : {0x1p-6, 0x1p-16, 0x1p-26})
    for (const Vector3d& direction : directions)
      for (const Vector3d& towards :
           {Vector3d(Vector3d::Zero()), Vector3d(middleA / 3.0 - p), Vector3d(middleB / 3.0 - p)})
        if (pair.isInBoth(p + share * (size * direction + 0.5 * towards))) return true;
  return false;
}

bool overlapWhereTouching(const BodyPair& pair,
                          const CountedVector<BodyPair::IntersectingTriangles>& intersecting) {
  for (const bool ofA : {true, false}) {
    const BodyVertices& vertices = pair.vertices(ofA);
    for (std::uint32_t v = 0; v < vertices.positions.size(); ++v)
      if (vertices.triangleOf[v] != kNoElement && pair.isInside(ofA, v)) return true;
  }
  return std::any_of(intersecting.begin(), intersecting.end(),
                     [&](const BodyPair::IntersectingTriangles& both) {
                       return overlapBeside(pair, commonPoint(both), both);
                     });
}

}  // namespace

bool overlap(const BodyPair& pair, CountedVector<BodyPair::IntersectingTriangles>& intersecting) {
  intersecting.clear();
  bool pierce = false;
  pair.forEachIntersecting(Vector3d::Zero(), [&](const BodyPair::IntersectingTriangles& both) {
    intersecting.push_back(both);
    pierce |= (both.found.edgesOfAThroughB | both.found.edgesOfBThroughA) != 0;
    return true;
  });
  if (isOver(pair.deadline())) return false;
  sortUntil(pair.deadline(), intersecting.begin(), intersecting.end(),
            [](const BodyPair::IntersectingTriangles& l, const BodyPair::IntersectingTriangles& r) {
              return std::pair(l.elementA, l.elementB) < std::pair(r.elementA, r.elementB);
            });
  if (pierce || pair.findInsidePart(Vector3d::Zero())) return true;
  return !intersecting.empty() && overlapWhereTouching(pair, intersecting);
}

bool isConvex(const BodyPair& pair, bool ofA) {
  const MeshTopology& topology = pair.geometry(ofA).mesh.topology;
  const auto& positions = pair.vertices(ofA).positions;
  const double most = kExitSlack * pair.magnitude();
  const Vector3d centre = pair.vertices(ofA).box.center();
  const int number = pair.windingNumberOf(ofA, centre);
  if (number != 1 && number != -1) return false;
  // Whether no point is in front of a triangle's outer side.
  const auto isBehind = [&](std::uint32_t triangle, const Vector3d& p) {
    const auto [a, b, c] = cornersOf(topology.elements[triangle], positions);
    return number * windingNormal(a, b, c).dot(p - a) <= most;
  };
  TimeCheck check(pair.deadline(), 64);
  for (std::uint32_t e = 0; e < topology.edges.size(); ++e) {
    check();
    const auto both = topology.edgeTriangles[e];
    if (both.size() != 2 || !isBehind(both[0], centre) || !isBehind(both[1], centre)) return false;
    for (std::size_t side = 0; side < 2; ++side)
      for (const std::uint32_t v : topology.elements[both[1 - side]])
        if (!isBehind(both[side], positions[v])) return false;
  }
  return true;
}

}  // namespace palpate
