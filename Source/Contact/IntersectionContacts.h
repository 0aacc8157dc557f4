#pragma once

#include <palpate/FeaturePairs.h>

#include "Contact/ContactBuffers.h"
#include "Contact/MeshPair.h"
#include "Mesh/Corners.h"
#include "Math/TriangleIntersection.h"

#include <cstdint>

namespace palpate {

// The first rule that applies gives the contacts of two intersecting triangles:
// (1) Features touch: every vertex-triangle and edge-edge pair at distance zero.
// (2) An end of a crossing edge is behind the surface: this end's contact with the nearest feature
//     of the surface, and those of its edges that are as deep at a ridge (PiercingContacts).
// (3) A crossing edge passes below an edge or a vertex of the surface: the contact of both
//     (PiercingContacts).
// (4) Two edges of one triangle cross the other: the vertex that these edges share.
// (5) One edge of each triangle crosses the other: these two edges.
// Touching features are reported once, by the pair of triangles that own them. findIntersections()
// adds only these. PiercingContacts adds the others after the last batch; of rules 3 to 5 several
// triangle pairs have the same contact, each time with the same bits.
//
// The winding normal points to the triangle's front. A vertex behind the triangle has a negative
// distance. The normal of a vertex-triangle contact is the winding normal if the closest point is
// in the triangle's interior or the vertex touches the triangle. If the closest point is on an
// edge or a corner, the normal is along the line through both points, on the winding normal's
// side. For a triangle without area, and for touching parallel edges, it is the axis that
// <palpate/FeaturePairs.h> defines.
//
// Two edges have crossed if each of the closest points lies below the surface around the other
// (liesBelow()), or in line with one of two faces. Their distance is then negative, and the normal
// leads out.

/// A triangle of a mesh, with its corners at one time.
struct MeshTriangle {
  const TriangleMesh& mesh;
  std::uint32_t id;
  const Triangle& vertices;
  Corners positions;

  MeshTriangle(const TriangleMesh& ofMesh, std::uint32_t triangle, const Positions& at)
      : mesh(ofMesh),
        id(triangle),
        vertices(mesh.topology.elements[id]),
        positions(cornersOf(vertices, at)) {}

  /// kNoEdge between two corners that are one vertex.
  std::uint32_t edge(int i) const { return mesh.topology.triangleEdges[id][i]; }
};

/// Adds the contacts of two triangles at the step's end by rule 1. Touching features also touch in
/// the triangles that own them. Only the pair of these triangles adds the contact.
void addTouching(const MeshPair&, const MeshTriangle& a, const MeshTriangle& b,
                 const TriangleIntersection&, ContactBuffers& out);

/// Adds the contact of an edge of a and an edge of b, if they have crossed. Returns whether they
/// have.
bool addIfCrossed(const MeshPair&, std::uint32_t edgeA, std::uint32_t edgeB, ContactBuffers& out);

/// Adds the contact of an edge of a and an edge of b that have crossed.
void addCrossed(const MeshPair&, std::uint32_t edgeA, std::uint32_t edgeB, ContactBuffers& out);

/// Adds the contact of two triangles by rule 4 or 5.
void addPierced(const MeshPair&, const PiercedPair&, ContactBuffers& out);

/// Makes a measured distance at a vertex strictly behind the triangle negative, with the normal
/// that leads out.
void turnToFront(const Corners& triangle, VertexTriangleDistance&);

}  // namespace palpate
