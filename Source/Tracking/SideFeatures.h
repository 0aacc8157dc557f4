#pragma once

#include "Tracking/PassedSide.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Math/ClosestPoint.h"
#include "Core/Buffer.h"

#include <cstdint>

// The features between which a remembered side is: where they are, and to which ones it slides.
namespace palpate {

inline Segment edgeA(const Crossing& passage) { return {passage.ids[0], passage.ids[1]}; }
inline Segment edgeB(const Crossing& passage) { return {passage.ids[2], passage.ids[3]}; }

/// A vertex and a triangle: of which meshes they are, and by what ids of a passage.
struct VertexSide {
  VertexSide(const MeshPair& pair, ContactKind kind)
      : swapped(kind == ContactKind::TriangleVertex),
        vertices(swapped ? pair.b : pair.a),
        triangles(swapped ? pair.a : pair.b) {}
  std::uint32_t vertexOf(const Crossing& p) const { return p.ids[swapped]; }
  std::uint32_t triangleOf(const Crossing& p) const { return p.ids[!swapped]; }

  bool swapped;
  const TriangleMesh &vertices, &triangles;
};

/// now: at the step's end, else at its start.
VertexTriangleDistance distanceOf(const VertexSide&, std::uint32_t vertex, const Triangle& corners,
                                  bool now);
EdgeEdgeDistance distanceOf(const MeshPair&, const Segment& a, const Segment& b, bool now);

/// Whether features may still be a contact: they exist, are enabled, and no filter rejects them.
bool mayTouch(const MeshPair&, const VertexSide&, std::uint32_t vertex, std::uint32_t triangle);
bool mayTouch(const MeshPair&, const Segment& a, const Segment& b);

inline bool hasFaces(const MeshPair& pair) {
  return pair.a.topology.hasFaces() || pair.b.topology.hasFaces();
}

/// Whether a passage of these edges in the direction of `forward` is one of those edges forward.
/// isTurned: a path through both has one of them reversed.
bool forwardOf(const MeshPair&, bool now, const Crossing& passage, const Segment& a,
               const Segment& b, bool isTurned);

/// Slides a vertex along the surface, at the step's end, to the next triangle that is nearer to it.
/// Returns whether there is one. The closest points of both triangles may be `farthest` apart, from
/// which their distance is then taken.
bool slideVertex(const MeshPair&, PassedSide&, double& farthest);
/// How far a vertex may slide in the step: somewhat more than it moves across the direction that
/// its closest point had at the step's start.
double farthestSlide(const MeshPair&, const PassedSide&);
/// Slides one of two edges to the next edge that is nearer to the other one. Returns whether there
/// is one.
bool slideEdges(const MeshPair&, bool now, PassedSide&);

/// Finds the features of a side. Returns whether both are there.
bool findFeatures(const MeshPair&, PassedSide&);
/// Whether a vertex and its triangle, which it finds, are there and may touch.
bool isThere(const MeshPair&, PassedSide&);
/// Sorts sides by their features, and keeps one of each features: of a vertex and a triangle in the
/// direction in which it passed more often, or none.
void sortUnique(Buffer<PassedSide>&);
/// Brings a side to the positions at the step's start. Returns whether it lasts.
bool locate(const MeshPair&, PassedSide&);

}  // namespace palpate
