#include "NarrowPhase/Intersection.h"

#include "NarrowPhase/FeatureTests.h"
#include "Contact/Filters.h"
#include "NarrowPhase/IntersectionFilter.h"
#include "Contact/IntersectionContacts.h"
#include "Contact/Piercing.h"
#include "Mesh/Corners.h"
#include "Math/TriangleIntersection.h"
#include "Exact/Predicates.h"
#include "Core/Assert.h"

#include <algorithm>

namespace palpate {

namespace {

ExcludedFeatures featuresInCommon(const MeshTriangle& a, const MeshTriangle& b) {
  ExcludedFeatures excluded;
  const unsigned same = sameCorners(a.vertices, b.vertices);
  if (same == 0) return excluded;
  const auto sharesVertex = [&](int test) { return kSharingTests[same] >> test & 1; };
  for (int i = 0; i < 3; ++i) {
    excluded.cornersOfA |= sharesVertex(cornerTestOfA(i)) << i;
    excluded.cornersOfB |= sharesVertex(cornerTestOfB(i)) << i;
    for (int j = 0; j < 3; ++j)
      if (sharesVertex(edgeTest(i, j)) || a.edge(i) == kNoEdge || b.edge(j) == kNoEdge)
        excluded.edges |= TriangleIntersection::edgesBit(i, j);
  }
  return excluded;
}

TriangleIntersection intersectionOf(const MeshPair& pair, const MeshTriangle& a,
                                    const MeshTriangle& b, SignCounts& counts) {
  return intersectTriangles(a.positions, b.positions, counts,
                            pair.self() ? featuresInCommon(a, b) : ExcludedFeatures());
}

/// known: the pair's intersection if it has been computed, else empty.
void findOne(const MeshPair& pair, const ElementPair& candidate, TriangleIntersection known,
             SignCounts& counts, ContactBuffers& out) {
  const MeshTriangle a(pair.a, candidate.a, pair.a.now), b(pair.b, candidate.b, pair.b.now);
  if (!known.intersect()) known = intersectionOf(pair, a, b, counts);
  if (!known.intersect()) return;
  if (areNearAtRest(pair, a.vertices, b.vertices)) {
    out.facts.clearance = 0.0;
    return;
  }
  out.intersectingTriangles.push_back(candidate);
  recordCrossings(pair, false, candidate, known, out.crossings);
  if (known.touch())
    addTouching(pair, a, b, known, out);
  else
    out.pierced.push_back({candidate, known.edgesOfAThroughB, known.edgesOfBThroughA});
}

}  // namespace

void keepPossible(const MeshPair& pair, bool atStart, std::span<const ElementPair> candidates,
                  Buffer<PossibleIntersection>& possible) {
  const auto placed = [&](const TriangleMesh& mesh) {
    return PlacedTriangles{mesh.topology.elements, atStart ? mesh.before : mesh.now};
  };
  keepPossiblyIntersecting(placed(pair.a), placed(pair.b), pair.self(), candidates, possible);
}

void findIntersections(const MeshPair& pair, std::span<const ElementPair> candidates,
                       ContactBuffers& out) {
  SignCounts counts;
  keepPossible(pair, false, candidates, out.possible);
  for (const PossibleIntersection& possible : out.possible)
    findOne(pair, possible.triangles, possible.intersection, counts, out);
  out.exactDecisions += counts.undecided;
}

void findCrossingsAtStart(const MeshPair& pair, std::span<const ElementPair> candidates,
                          ContactBuffers& out) {
  keepPossible(pair, true, candidates, out.possible);
  for (const PossibleIntersection& possible : out.possible)
    addCrossingsAtStart(pair, possible.triangles, out);
}

void addCrossingsAtStart(const MeshPair& pair, const ElementPair& candidate, ContactBuffers& out) {
  SignCounts counts;
  const MeshTriangle a(pair.a, candidate.a, pair.a.before), b(pair.b, candidate.b, pair.b.before);
  const TriangleIntersection found = intersectionOf(pair, a, b, counts);
  if (found.intersect() && !areNearAtRest(pair, a.vertices, b.vertices))
    recordCrossings(pair, true, candidate, found, out.crossingsAtStart);
  out.exactDecisions += counts.undecided;
}

TriangleIntersection intersectionOf(const MeshPair& pair, bool atStart, const ElementPair& ids,
                                    SignCounts& counts) {
  const auto of = [&](const TriangleMesh& mesh, std::uint32_t triangle) {
    return MeshTriangle(mesh, triangle, atStart ? mesh.before : mesh.now);
  };
  return intersectionOf(pair, of(pair.a, ids.a), of(pair.b, ids.b), counts);
}

void addIntersection(const MeshPair& pair, const ElementPair& candidate, ContactBuffers& out) {
  SignCounts counts;
  findOne(pair, candidate, {}, counts, out);
  out.exactDecisions += counts.undecided;
}

}  // namespace palpate
