#include "Queries/BodyOverlap.h"

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
Vector3d commonPoint(const BodyPair::Meeting& meeting) {
  Vector3d sum = Vector3d::Zero();
  double count = 0;
  const auto add = [&](const Vector3d& p) {
    sum += p;
    ++count;
  };
  for (std::size_t i = 0; i < 3; ++i) {
    if (meeting.found.cornersOfAOnB >> i & 1) add(meeting.a[i]);
    if (meeting.found.cornersOfBOnA >> i & 1) add(meeting.b[i]);
    for (std::size_t j = 0; j < 3; ++j)
      if (meeting.found.touchingEdges &
          TriangleIntersection::edgesBit(static_cast<int>(i), static_cast<int>(j))) {
        const EdgeEdgeDistance at = finiteEdgeEdgeDistance(meeting.a[i], meeting.a[(i + 1) % 3],
                                                           meeting.b[j], meeting.b[(j + 1) % 3]);
        add((1.0 - at.weightA) * meeting.a[i] + at.weightA * meeting.a[(i + 1) % 3]);
      }
  }
  return sum / count;
}

/// Whether a point beside p, behind the faces of both triangles, is inside both bodies.
bool overlapBeside(const BodyPair& pair, const Vector3d& p, const BodyPair::Meeting& meeting) {
  const Vector3d normalA = windingNormal(meeting.a[0], meeting.a[1], meeting.a[2]),
                 normalB = windingNormal(meeting.b[0], meeting.b[1], meeting.b[2]);
  const double size = std::min(stableLength(meeting.a[1] - meeting.a[0]),
                               stableLength(meeting.b[1] - meeting.b[0]));
  const Vector3d middleA = (meeting.a[0] + meeting.a[1]) + meeting.a[2],
                 middleB = (meeting.b[0] + meeting.b[1]) + meeting.b[2];
  const std::array<Vector3d, 4> directions{-normalA - normalB, normalA + normalB, normalB - normalA,
                                           normalA - normalB};
  for (const double share : {0x1p-6, 0x1p-16, 0x1p-26})
    for (const Vector3d& direction : directions)
      for (const Vector3d& towards :
           {Vector3d(Vector3d::Zero()), Vector3d(middleA / 3.0 - p), Vector3d(middleB / 3.0 - p)})
        if (pair.isInBoth(p + share * (size * direction + 0.5 * towards))) return true;
  return false;
}

bool overlapWhereTouching(const BodyPair& pair, const CountedVector<BodyPair::Meeting>& meetings) {
  for (const bool ofA : {true, false}) {
    const BodyVertices& vertices = pair.vertices(ofA);
    for (std::uint32_t v = 0; v < vertices.positions.size(); ++v)
      if (vertices.triangleOf[v] != kNoElement && pair.isInside(ofA, v)) return true;
  }
  return std::any_of(meetings.begin(), meetings.end(), [&](const BodyPair::Meeting& meeting) {
    return overlapBeside(pair, commonPoint(meeting), meeting);
  });
}

}  // namespace

bool overlap(const BodyPair& pair, CountedVector<BodyPair::Meeting>& meetings) {
  meetings.clear();
  bool pierce = false;
  pair.forEachMeeting(Vector3d::Zero(), [&](const BodyPair::Meeting& meeting) {
    meetings.push_back(meeting);
    pierce |= (meeting.found.edgesOfAThroughB | meeting.found.edgesOfBThroughA) != 0;
    return true;
  });
  std::sort(meetings.begin(), meetings.end(),
            [](const BodyPair::Meeting& l, const BodyPair::Meeting& r) {
              return std::pair(l.elementA, l.elementB) < std::pair(r.elementA, r.elementB);
            });
  if (pierce || pair.findInsidePart(Vector3d::Zero())) return true;
  return !meetings.empty() && overlapWhereTouching(pair, meetings);
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
    const Triangle& t = topology.triangles[triangle];
    const Vector3d normal = windingNormal(positions[t[0]], positions[t[1]], positions[t[2]]);
    return number * normal.dot(p - positions[t[0]]) <= most;
  };
  for (std::uint32_t e = 0; e < topology.edges.size(); ++e) {
    const auto both = topology.edgeTriangles[e];
    if (both.size() != 2 || !isBehind(both[0], centre) || !isBehind(both[1], centre)) return false;
    for (std::size_t side = 0; side < 2; ++side)
      for (const std::uint32_t v : topology.triangles[both[1 - side]])
        if (!isBehind(both[side], positions[v])) return false;
  }
  return true;
}

}  // namespace palpate
