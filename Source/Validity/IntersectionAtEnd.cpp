#include "Validity/IntersectionAtEnd.h"

#include "NarrowPhase/Meeting.h"
#include "Contact/ContactLists.h"
#include "Contact/MeshFeature.h"
#include "Math/MotionBound.h"
#include "Core/Assert.h"
#include "Core/Stopping.h"

#include <algorithm>
#include <cstdint>
#include <span>

namespace palpate {

namespace {

/// Triangle pairs that may be tested besides one for each contact, and pairs tested together.
constexpr std::size_t kFreeChecks = 32, kChecksTogether = 16;

double motionOf(const TriangleMesh& vertices, const TriangleMesh& triangles,
                const VertexTriangleContact& c) {
  return motionBound<ImpactQuery::Kind::VertexTriangle>(queryOf(vertices, triangles, c));
}
double motionOf(const TriangleMesh& a, const TriangleMesh& b, const EdgeEdgeContact& c) {
  return motionBound<ImpactQuery::Kind::EdgeEdge>(queryOf(a, b, c));
}

}  // namespace

IntersectionAtEnd checkEnd(const MeshPair& pair, const CollisionData::Contents& contacts,
                           ContactBuffers& counts) {
  using Ids = std::span<const std::uint32_t>;
  const MeshTopology &ofA = pair.a.topology, &ofB = pair.b.topology;
  const double rounding = pair.step.motionWithRounding - pair.step.motion;
  PALPATE_ASSERT(!(rounding < 0.0));
  std::size_t checksLeft = kFreeChecks + contactCount(contacts);
  Buffer<ElementPair>& batch = counts.part;
  batch.clear();
  IntersectionAtEnd end;
  TimeCheck checkOften(64);
  const auto check = [&] {
    checkTime();
    end.isKnown = batch.size() <= checksLeft;
    if (!end.isKnown) return;
    checksLeft -= batch.size();
    const SurfaceMeeting found = meetingOf(pair, false, batch, counts);
    end.meeting = std::max(end.meeting, found.meeting);
    end.piercing = found.piercing;
    batch.clear();
  };
  // Whether the rest of the step may close the distance at the impact.
  const auto mayTouch = [&](const TriangleMesh& first, const TriangleMesh& second,
                            const auto& contact) {
    checkOften();
    const double left = 1.0 - contact.timeOfImpact;
    return !end.piercing && end.isKnown && contact.distance <= left * pair.step.motion + rounding &&
           contact.distance <= left * motionOf(first, second, contact) + rounding;
  };
  const auto add = [&](Ids trianglesOfA, Ids trianglesOfB) {
    for (const std::uint32_t a : trianglesOfA)
      for (const std::uint32_t b : trianglesOfB)
        if (!pair.self() || a != b) batch.push_back({a, b});
    if (batch.size() >= kChecksTogether) check();
  };
  for (const VertexTriangleContact& c : contacts.vertexTriangle)
    if (mayTouch(pair.a, pair.b, c)) add(ofA.vertexTriangles[c.vertex], Ids(&c.triangle, 1));
  for (const VertexTriangleContact& c : contacts.triangleVertex)
    if (mayTouch(pair.b, pair.a, c)) add(Ids(&c.triangle, 1), ofB.vertexTriangles[c.vertex]);
  for (const EdgeEdgeContact& c : contacts.edgeEdge)
    if (mayTouch(pair.a, pair.b, c))
      add(ofA.edgeTriangles[ofA.edgeOf(c.edgeA)], ofB.edgeTriangles[ofB.edgeOf(c.edgeB)]);
  if (!end.piercing && end.isKnown) check();
  PALPATE_ASSERT(!end.piercing || end.meeting == Meeting::Piercing);
  return end;
}

}  // namespace palpate
