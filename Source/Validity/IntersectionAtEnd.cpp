#include "Validity/IntersectionAtEnd.h"

#include <algorithm>
#include <cstdint>
#include <span>

namespace palpate {

namespace {

/// Triangle pairs that may be tested besides one for each contact, and pairs tested together.
constexpr std::size_t kFreeChecks = 32, kChecksTogether = 16;

}  // namespace

IntersectionAtEnd checkEnd(const MeshPair& pair, const CollisionData::Contents& contacts,
                           ContactBuffers& counts) {
  using Ids = std::span<const std::uint32_t>;
  const MeshTopology &ofA = pair.a.topology, &ofB = pair.b.topology;
  const double rounding = pair.step.motionWithRounding - pair.step.motion;
  std::size_t checksLeft = kFreeChecks;
  forEachTimed(contacts, [&](const auto& list) { checksLeft += list.size(); });
  Buffer<ElementPair>& batch = counts.part;
  batch.clear();
  IntersectionAtEnd end;
  const auto check = [&] {
    end.isKnown = batch.size() <= checksLeft;
    if (!end.isKnown) return;
    checksLeft -= batch.size();
    const SurfaceMeeting found = meetingOf(pair, false, batch, counts);
    end.meeting = std::max(end.meeting, found.meeting);
    end.piercing = found.piercing;
    batch.clear();
  };
  const auto add = [&](const auto& contact, Ids trianglesOfA, Ids trianglesOfB) {
    if (end.piercing || !end.isKnown ||
        contact.distance > (1.0 - contact.timeOfImpact) * pair.step.motion + rounding)
      return;
    for (const std::uint32_t a : trianglesOfA)
      for (const std::uint32_t b : trianglesOfB)
        if (!pair.self() || a != b) batch.push_back({a, b});
    if (batch.size() >= kChecksTogether) check();
  };
  for (const VertexTriangleContact& c : contacts.vertexTriangle)
    add(c, ofA.vertexTriangles[c.vertex], Ids(&c.triangle, 1));
  for (const VertexTriangleContact& c : contacts.triangleVertex)
    add(c, Ids(&c.triangle, 1), ofB.vertexTriangles[c.vertex]);
  for (const EdgeEdgeContact& c : contacts.edgeEdge)
    add(c, ofA.edgeTriangles[ofA.edgeOf(c.edgeA)], ofB.edgeTriangles[ofB.edgeOf(c.edgeB)]);
  if (!end.piercing && end.isKnown) check();
  return end;
}

}  // namespace palpate
