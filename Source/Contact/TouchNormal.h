#pragma once

#include "Contact/ContactBuffers.h"
#include "Contact/MeshFeature.h"
#include "Contact/MeshPair.h"

#include <Eigen/Core>

#include <array>
#include <cstddef>

namespace palpate {

struct TouchNormal {
  Eigen::Vector3d direction;  ///< unit, from Features::second to Features::first
  bool isSideKnown;           ///< whether the step tells from which side the first feature came
};

/// The normal of two features that meet at `time`: one that can separate the surfaces there. If the
/// features' interiors meet and span a plane, it is that plane's normal, on the side that the step
/// tells, or else that the stars tell. Otherwise the stars decide.
///
/// The *star* of a feature is the set of triangles, or segments, that hold it. A unit vector n
/// separates two stars if no point of the first one is on the side of -n, and no point of the
/// second one on the side of n. Of a vertex in more than 16 triangles about 16 give candidates.
/// Candidates are of three kinds, in this order: the normals of both stars' triangles; the cross
/// products of an edge of each star; and one that the step or the distance functions give. Those on
/// the side from which the first feature came (Approach) compete. The one wins that is nearest to
/// separating the stars, up to kTouchAngle, or within the step up to 2^-10. Among equals the first
/// kind wins, then the least angle to the approach. If none on that side separates, those at right
/// angles to the approach compete, too: of surfaces that slide along each other. Then, and if the
/// step tells no side, the agreement with both surfaces' winding normals takes the place of the
/// angle to the approach; a closed surface counts more.
///
/// holders   the features of Features::first and Features::second that hold the closest points
/// time      in [0, 1] of the step, of the positions of the stars
/// normal    from the distance functions
template <ImpactQuery::Kind kind>
TouchNormal touchNormal(const Features<kind>&, std::uint32_t firstId, std::uint32_t secondId,
                        const std::array<MeshFeature, 2>& holders, double time,
                        const Eigen::Vector3d& normal, std::size_t& exactDecisions);

/// Replaces the normal of a distance of 0 at the step's end by touchNormal().
inline void turnToSeparate(const Features<ImpactQuery::Kind::VertexTriangle>& of,
                           std::uint32_t vertex, std::uint32_t triangle,
                           VertexTriangleDistance& measured, std::size_t& exactDecisions) {
  if (measured.distance != 0.0) return;
  const std::array<MeshFeature, 2> holders{
      MeshFeature{MeshFeature::Kind::Vertex, vertex},
      featureOf(of.second.topology, triangle, measured.feature)};
  measured.normal =
      touchNormal(of, vertex, triangle, holders, 1.0, measured.normal, exactDecisions).direction;
}
inline void turnToSeparate(const Features<ImpactQuery::Kind::EdgeEdge>& of, std::uint32_t edgeA,
                           std::uint32_t edgeB, EdgeEdgeDistance& measured,
                           std::size_t& exactDecisions) {
  if (measured.distance != 0.0) return;
  const std::array<MeshFeature, 2> holders{featureOf(of.first.topology, edgeA, measured.featureA),
                                           featureOf(of.second.topology, edgeB, measured.featureB)};
  measured.normal =
      touchNormal(of, edgeA, edgeB, holders, 1.0, measured.normal, exactDecisions).direction;
}

/// Appends the contact of features that were measured at the step's end, with the normal that
/// separates them. swapped: the vertex is of MeshPair::b. radii: L, both at the closest points.
void addAtEnd(const MeshPair&, std::uint32_t vertex, std::uint32_t triangle, bool swapped,
              VertexTriangleDistance measured, double radii, ContactBuffers& out);
void addAtEnd(const MeshPair&, std::uint32_t edgeA, std::uint32_t edgeB, EdgeEdgeDistance measured,
              ContactBuffers& out);

}  // namespace palpate
